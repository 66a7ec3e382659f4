"""Migrations of the catalogue. They describe the tables as they were at that time and never import
today's."""
