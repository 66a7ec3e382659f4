"""The command line ``aerodb``: parses options and prints; the work is done in flows and tasks.

Queries read the catalogue and never import Prefect. With ``--json``, exactly one JSON document goes
to standard output, and all other text to standard error.
"""

from aerodb.flows.cli.main import main

__all__ = ["main"]
