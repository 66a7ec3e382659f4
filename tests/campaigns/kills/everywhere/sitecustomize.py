"""Imported by each Python process whose PYTHONPATH names this folder: the children of a service."""

from tests.campaigns.kills.writes import arm

arm()
