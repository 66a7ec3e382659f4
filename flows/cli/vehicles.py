"""``aerodb vehicle``: describe vehicles."""

import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.groups import Commands
from aerodb.flows.cli.output import Session
from aerodb.support import counted

app = typer.Typer(
    name="vehicle",
    cls=Commands,
    no_args_is_help=True,
    help="Vehicles: geometry, mass, surfaces, sensors.",
)


@app.command()
def init(
    context: typer.Context,
    name: str,
    source: Annotated[
        Path | None,
        typer.Option("--from", help="A PX4 log: its surfaces, airframe and rates are filled in."),
    ] = None,
) -> None:
    """Write a commented vehicle file to fill in; what a log states is taken from it.

    Example: aerodb vehicle init my-glider --from flight.ulg
    """
    from aerodb.storage.encoding import VEHICLE_NAME, checked
    from aerodb.vehicle import vehicle_template

    session: Session = context.obj
    checked(name, VEHICLE_NAME, "the name of a vehicle")  # before it becomes that of a file
    path, second = Path(f"{name}.toml"), Path(f"{name}-rotors.toml")
    text, database, filled = (
        (vehicle_template(name), "", {}) if source is None else _from_log(session, name, source)
    )
    for each in (path, second) if database else (path,):
        if each.exists():
            raise InputError(
                "the file exists already", str(each), "move it away, or choose another name"
            )
    path.write_text(text, encoding="utf-8")
    if database:
        second.write_text(database, encoding="utf-8")
        filled["database"] = str(second)
        also = "".join(f", {each}" for each in filled["surfaces"])
        session.say(f"{filled['airframe']}: {filled['rotors']} rotors{also}")
        for each in filled["beyond"]:
            session.say(f"WARNING: {each}")
        if filled["battery"]:
            session.say(f"the battery takes thrust: speeds are multiplied by {filled['battery']}")
    elif filled:
        session.say(f"{filled['airframe'] or 'airframe unknown'}: {', '.join(filled['surfaces'])}")
    session.say(f"wrote {path}; fill it in, then: aerodb vehicle add {path}")
    if database:
        session.say(f"wrote {second}; then: aerodb database import {second} --vehicle {name}")
    session.answer({"file": str(path), **filled})


def _from_log(session: Session, name: str, source: Path) -> tuple[str, str, dict[str, Any]]:
    """The text of a vehicle file from a log, that of a database of its rotors ('' for one with
    wings), and what was found in it."""
    from aerodb.logs import draft_vehicle, read_autopilot, wingless_sentence
    from aerodb.storage.workspace_settings import load_settings
    from aerodb.tasks.steps import drafted_rotorcraft
    from aerodb.tasks.workers import parsed_log

    if not source.is_file():
        raise InputError("no such file", str(source), "check the path")
    limits = load_settings(session.root).limits
    with (
        tempfile.TemporaryDirectory() as folder,
        parsed_log(source, Path(folder) / "topics", limits) as parsed,
    ):
        autopilot = read_autopilot(parsed.recording)
        if not autopilot.described:
            raise InputError(
                wingless_sentence(autopilot),
                str(source),
                "use a log with parameters and commands of its rotors (actuator_motors,"
                " actuator_outputs, esc_status, RCOU); or write the file without --from",
            )
        if not (autopilot.kind or autopilot.surfaces):
            raise InputError(
                "the log has no parameters of an autopilot",
                str(source),
                "--from reads PX4 logs; write the file without it, and fill it in",
            )
        filled = {
            "airframe": autopilot.kind,
            "surfaces": [surface.name for surface in autopilot.surfaces],
            "airspeeds": dict(autopilot.airspeeds),
        }
        if not autopilot.rotors.logged:
            return draft_vehicle(name, parsed.recording, autopilot), "", filled
        vehicle, database, battery = drafted_rotorcraft(name, parsed.recording, autopilot)
        beyond = [
            f"{each.reached}: correct [rotors.{each.name}] range in {name}.toml"
            for each in autopilot.rotors.beyond
        ]
        count = len(autopilot.rotors.rotors)
        found = {"rotors": count, "beyond": beyond, "battery": battery}
        return vehicle, database, {**filled, **found}


@app.command()
def add(
    context: typer.Context, file: Annotated[Path, typer.Argument(help="Vehicle file (TOML).")]
) -> None:
    """Check a vehicle file and store it; an earlier text of the same name is kept as well.

    Example: aerodb vehicle add my-glider.toml
    """
    from aerodb.tasks.actors import require_role
    from aerodb.vehicle import parse_vehicle, placeholders

    session: Session = context.obj
    text = read_text(file)
    vehicle = parse_vehicle(text, file.name)
    catalogue = session.catalogue(create=True)
    require_role(session.workspace(), catalogue, "ingest", "adding a vehicle")
    row = catalogue.add_vehicle(vehicle.name, text)
    then = "flight ingest LOG" if catalogue.count_versions(row.name) else "database import FILE"
    session.headlines(
        f"vehicle {row.name} stored ({row.sha256[:12]})",
        (),
        f"aerodb {then} --vehicle {row.name}",
    )
    left = placeholders(vehicle)
    say_placeholders(session, left, file.name)
    session.answer({"vehicle": row.name, "sha256": row.sha256, "placeholders": list(left)})


def say_placeholders(session: Session, left: Sequence[str], where: str) -> None:
    """Warn of a vehicle's values that are still the template's."""
    for each in left:
        session.say(f"WARNING: {where}: {each} is the template's placeholder, not your aircraft's")


@app.command("list")
def list_vehicles(context: typer.Context) -> None:
    """List the vehicles.

    Example: aerodb vehicle list
    """
    session: Session = context.obj
    rows = session.catalogue().vehicles()
    then = f"vehicle show {rows[-1].name}" if rows else "vehicle init NAME"
    session.headlines(counted(len(rows), "vehicle"), (), f"aerodb {then}")
    session.say()
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
    from aerodb.vehicle import parse_vehicle, placeholders

    session: Session = context.obj
    row = session.catalogue().vehicle(name)
    session.say(row.text.rstrip())
    left = list(placeholders(parse_vehicle(row.text, row.name)))
    session.answer(
        {"vehicle": row.name, "sha256": row.sha256, "placeholders": left, "text": row.text}
    )


def read_text(file: Path) -> str:
    """Return the text of a file; InputError if it cannot be read as UTF-8."""
    try:
        return file.read_text(encoding="utf-8")
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", str(file), "check the path") from error
    except UnicodeDecodeError as error:
        raise InputError("not UTF-8 text", str(file), "save it as UTF-8") from error
