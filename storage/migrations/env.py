"""Alembic environment: runs migrations on the connection of `aerodb.storage.catalogue.database`,
inside its transaction."""

from alembic import context

from aerodb.storage.catalogue import schema

connection = context.config.attributes["connection"]
# SQLite alters a table by copying it: batch mode lets one migration serve SQLite and PostgreSQL.
context.configure(
    connection=connection,
    target_metadata=schema.metadata,
    render_as_batch=connection.dialect.name == "sqlite",
)
with context.begin_transaction():
    context.run_migrations()
