"""Schema migrations of the catalogue (Alembic). Each describes the tables as they were at its time
and does not import the current ones."""
