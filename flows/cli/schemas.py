"""``aerodb schema``: the form of what commands answer as JSON."""

import json
import sys
from typing import Annotated

import typer

from aerodb.flows.cli.output import Session


def schema(
    context: typer.Context,
    command: Annotated[
        list[str] | None, typer.Argument(help="The command; without one, those that have a schema.")
    ] = None,
) -> None:
    """Print the JSON Schema of what a command answers with --json.

    Example: aerodb schema version trim
    """
    from aerodb.flows.answers import ANSWERS, schema_of

    session: Session = context.obj
    if command:
        sys.stdout.write(json.dumps(schema_of(" ".join(command)), indent=1) + "\n")
        return
    for name in ANSWERS:
        session.say(name)
    session.answer(list(ANSWERS))
