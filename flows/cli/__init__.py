"""The command line ``aerodb``: a door, no more. What a command does stands in the flows, tasks and
stores below it.

Queries read the catalogue and never import Prefect. With ``--json`` exactly one JSON document goes
to standard output and everything meant for people to standard error.
"""

from aerodb.flows.cli.main import main

__all__ = ["main"]
