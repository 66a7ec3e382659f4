"""``aerodb vehicle``: describe vehicles."""

from pathlib import Path
from typing import Annotated

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.output import Session

app = typer.Typer(
    name="vehicle", no_args_is_help=True, help="Vehicles: geometry, mass, surfaces, sensors."
)


@app.command()
def init(context: typer.Context, name: str) -> None:
    """Write a commented vehicle file to fill in.

    Example: aerodb vehicle init my-glider
    """
    from aerodb.storage.encoding import VEHICLE_NAME, checked
    from aerodb.vehicle import vehicle_template

    session: Session = context.obj
    checked(name, VEHICLE_NAME, "the name of a vehicle")  # before it becomes that of a file
    path = Path(f"{name}.toml")
    if path.exists():
        raise InputError(
            "the file exists already", str(path), "move it away, or choose another name"
        )
    path.write_text(vehicle_template(name), encoding="utf-8")
    session.say(f"wrote {path}; fill it in, then: aerodb vehicle add {path}")
    session.answer({"file": str(path)})


@app.command()
def add(
    context: typer.Context, file: Annotated[Path, typer.Argument(help="Vehicle file (TOML).")]
) -> None:
    """Check a vehicle file and store it; an earlier text of the same name is kept as well.

    Example: aerodb vehicle add my-glider.toml
    """
    from aerodb.tasks.actors import require_role
    from aerodb.vehicle import parse_vehicle

    session: Session = context.obj
    text = read_text(file)
    vehicle = parse_vehicle(text, file.name)
    catalogue = session.catalogue(create=True)
    require_role(session.workspace(), catalogue, "ingest", "adding a vehicle")
    row = catalogue.add_vehicle(vehicle.name, text)
    session.say(f"vehicle {row.name} stored ({row.sha256[:12]})")
    session.answer({"vehicle": row.name, "sha256": row.sha256})


@app.command("list")
def list_vehicles(context: typer.Context) -> None:
    """List the vehicles.

    Example: aerodb vehicle list
    """
    session: Session = context.obj
    rows = session.catalogue().vehicles()
    session.table(
        ["vehicle", "file", "since"],
        [[r.name, r.sha256[:12], f"{r.added_utc:%Y-%m-%d %H:%M}"] for r in rows],
    )
    session.answer(
        [
            {"vehicle": r.name, "sha256": r.sha256, "added_utc": r.added_utc.isoformat()}
            for r in rows
        ]
    )


@app.command()
def show(context: typer.Context, name: str) -> None:
    """Print a vehicle's file.

    Example: aerodb vehicle show my-glider
    """
    session: Session = context.obj
    row = session.catalogue().vehicle(name)
    session.say(row.text.rstrip())
    session.answer({"vehicle": row.name, "sha256": row.sha256, "text": row.text})


def read_text(file: Path) -> str:
    """Return the text of a file; InputError if it cannot be read as UTF-8."""
    try:
        return file.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", str(file), "check the path") from error
    except UnicodeDecodeError as error:
        raise InputError("not UTF-8 text", str(file), "save it as UTF-8") from error
