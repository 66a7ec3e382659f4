"""Schema migrations of the catalogue (Alembic).

Each migration defines the tables as of its revision and does not import the current ones.
"""
