"""``aerodb database``: import a baseline from a file."""

from pathlib import Path
from typing import Annotated

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.output import Session

app = typer.Typer(name="database", no_args_is_help=True, help="Baseline databases from files.")


@app.command("import")
def import_file(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(help="DAVE-ML, JSBSim XML or native TOML.")],
    vehicle: Annotated[str, typer.Option(help="The vehicle that it describes.")],
    bind: Annotated[
        list[str] | None,
        typer.Option(
            help="Definition of an unknown input of the file: NAME=EXPRESSION over channels."
        ),
    ] = None,
) -> None:
    """Import a database file as a version; a vehicle's first one becomes `released`.

    Example: aerodb database import DHC6.xml --vehicle twin-otter --bind
    systems/propulsion/thrust-coefficient=0
    """
    from aerodb.flows.importing import import_flow

    session: Session = context.obj
    if not file.is_file():
        raise InputError("no such file", str(file), "check the path")
    bindings = dict(_binding(text) for text in bind or [])
    parameters = {"file": str(file), "vehicle": vehicle, "bindings": bindings}
    document = session.run(import_flow, parameters, direct=True)
    session.say(f"{document['label']} ({document['version'][:12]}): {document['database']}")
    session.say(f"needs: {', '.join(document['inputs'])}")
    session.answer(document)


def _binding(text: str) -> tuple[str, str]:
    name, sign, expression = text.partition("=")
    if not sign or not name.strip() or not expression.strip():
        raise InputError(
            f"'{text}' is not NAME=EXPRESSION",
            "--bind",
            "for example --bind gear/gear-pos-norm=delta_landing_gear",
        )
    return name.strip(), expression.strip()
