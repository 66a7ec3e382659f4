"""Alembic environment: run migrations on the connection of `aerodb.storage.catalogue.database`,
within its transaction."""

from alembic import context

from aerodb.storage.catalogue import schema

connection = context.config.attributes["connection"]
# SQLite alters a table by copying it; in batch mode one migration works on SQLite and PostgreSQL.
context.configure(
    connection=connection,
    target_metadata=schema.metadata,
    render_as_batch=connection.dialect.name == "sqlite",
)
with context.begin_transaction():
    context.run_migrations()
