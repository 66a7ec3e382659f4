"""``python -m aerodb`` is the command ``aerodb``."""

from aerodb.flows.cli import main

main()
