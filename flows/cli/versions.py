"""``aerodb version``: ask the database versions. Answers at once, without the orchestrator."""

import json
import math
from datetime import UTC, datetime
from typing import Annotated, Any

import typer

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.nomenclature import AXES, channel
from aerodb.units import quantity
from flows.cli.output import Session
from storage.catalogue import Catalogue
from storage.rows import VersionRow

app = typer.Typer(name="version", no_args_is_help=True, help="Database versions: list, ask, trace.")

Vehicle = Annotated[str | None, typer.Option(help="The vehicle; not needed where there is only one.")]
AsOf = Annotated[str | None, typer.Option("--as-of", help="As it was at this date (ISO 8601, UTC).")]


@app.command("list")
def list_versions(context: typer.Context, vehicle: Vehicle = None) -> None:
    """List versions, oldest first.

    Example: aerodb version list --vehicle my-glider
    """
    session: Session = context.obj
    catalogue = session.catalogue()
    owner = _vehicle(catalogue, vehicle)
    names: dict[str, list[str]] = {}
    for name, version in _names(catalogue, owner).items():
        names.setdefault(version, []).append(name)
    rows = catalogue.versions(owner)
    labels = {row.id: row.label for row in rows}
    session.table(
        ["version", "id", "parent", "made", "names"],
        [
            [
                r.label,
                r.id[:12],
                labels.get(r.parent or "", ""),
                f"{r.created_utc:%Y-%m-%d %H:%M}",
                ", ".join(names.get(r.id, [])),
            ]
            for r in rows
        ],
    )
    session.answer([{**_document(row), "names": names.get(row.id, [])} for row in rows])


@app.command()
def show(context: typer.Context, version: str, vehicle: Vehicle = None, as_of: AsOf = None) -> None:
    """Show a version: terms, tables, increments, and the report it was made with.

    Example: aerodb version show released
    """
    import numpy as np

    from aerodb.exchange.native import from_document

    session: Session = context.obj
    catalogue = session.catalogue()
    row = _version(catalogue, version, vehicle, as_of)
    documents = catalogue.version_documents(row.id)
    database = from_document(json.loads(documents.content))
    stale = catalogue.stale(row.id)
    session.say(f"{row.label} ({row.id[:12]}) of {row.vehicle}, made {row.created_utc:%Y-%m-%d %H:%M} UTC: {database.name}")
    session.say(f"{len(database.terms)} terms, {len(database.tables)} tables, {len(database.increments)} increments from flights")
    for reason in stale:
        session.say(f"stale: {reason}")
    session.table(["axis", "term", "expression"], [[t.axis, t.name, str(t.expression)] for t in database.terms])
    for increment in database.increments:
        session.say(f"increment on {increment.axis}, from {len(increment.flights)} flights:")
        errors = np.sqrt(np.diag(increment.covariance))
        rows = zip(increment.regressors, increment.estimates, errors, strict=True)
        session.table(["regressor", "value", "standard error"], [[str(r), f"{v:.5g}", f"{e:.2g}"] for r, v, e in rows], (1, 2))
    session.answer({**_document(row), "stale": list(stale), "report": documents.report, "settings": documents.settings})


@app.command()
def history(context: typer.Context, vehicle: Vehicle = None) -> None:
    """Show every move of every name: what was released when, by whom, why.

    Example: aerodb version history
    """
    session: Session = context.obj
    catalogue = session.catalogue()
    owner = _vehicle(catalogue, vehicle)
    labels = {row.id: row.label for row in catalogue.versions(owner)}
    events = catalogue.name_history(owner)
    session.table(
        ["when", "name", "to", "from", "by", "why"],
        [
            [f"{e.at_utc:%Y-%m-%d %H:%M}", e.name, labels[e.version], labels.get(e.previous or "", ""), e.user, e.reason]
            for e in events
        ],
    )
    session.answer(
        [
            {
                "at_utc": e.at_utc.isoformat(),
                "name": e.name,
                "to": e.version,
                "from": e.previous,
                "user": e.user,
                "reason": e.reason,
            }
            for e in events
        ]
    )


@app.command()
def lineage(context: typer.Context, version: str, vehicle: Vehicle = None) -> None:
    """Show what a version rests on: ancestors, flights, log hashes, inputs, runs.

    Example: aerodb version lineage candidate
    """
    session: Session = context.obj
    catalogue = session.catalogue()
    found = catalogue.lineage(_version(catalogue, version, vehicle).id)
    names = {flight: catalogue.flight(flight).label for flight in found.roles}
    session.say(" <- ".join(f"{row.label} ({row.id[:12]})" for row in found.line))
    session.table(
        ["flight", "role", "log sha256"],
        [[names[f], role.replace("_", " "), found.logs[f][:12]] for f, role in sorted(found.roles.items())],
    )
    session.table(
        ["run", "flow", "how", "state", "code"], [[r.id[:12], r.flow, r.how, r.state, r.code_version] for r in found.runs]
    )
    session.answer(
        {
            "version": found.version.id,
            "line": [_document(row) for row in found.line],
            "flights": [{"flight": f, "role": role, "log_sha256": found.logs[f]} for f, role in sorted(found.roles.items())],
            "inputs": {key: list(values) for key, values in found.inputs.items()},
            "runs": [{"run": r.id, "flow": r.flow, "how": r.how, "code_version": r.code_version} for r in found.runs],
        }
    )


@app.command()
def impact(context: typer.Context, flight: str, vehicle: Vehicle = None) -> None:
    """Show which versions rest on a flight.

    Example: aerodb version impact 1a2b3c
    """
    session: Session = context.obj
    catalogue = session.catalogue()
    row = catalogue.flight(flight, vehicle)
    uses = catalogue.impact(row.id)
    through = {use.version.id: use.version.label for use in uses}
    session.table(
        ["version", "role of the flight", "through"],
        [[u.version.label, u.role.replace("_", " "), through.get(u.through, u.through[:12])] for u in uses],
    )
    session.answer(
        {"flight": row.id, "versions": [{"version": u.version.id, "role": u.role, "through": u.through} for u in uses]}
    )


@app.command()
def evaluate(
    context: typer.Context,
    version: str,
    at: Annotated[str, typer.Option(help="Point: NAME=VALUE,... with units or SI; what is not given is 0.")],
    vehicle: Vehicle = None,
    as_of: AsOf = None,
) -> None:
    """Evaluate a version at a point.

    Example: aerodb version evaluate released --at alpha=5deg,V=70,mach=0.2
    """
    import numpy as np

    from aerodb.exchange.native import from_document

    session: Session = context.obj
    catalogue = session.catalogue()
    row = _version(catalogue, version, vehicle, as_of)
    database = from_document(json.loads(catalogue.version_documents(row.id).content))
    point = _point(at, database.inputs)
    assumed = [name for name in database.inputs if name not in point]
    channels = {**dict.fromkeys(assumed, 0.0), **point}
    if "V" in assumed:
        channels["V"] = 1.0  # rates are zero where they are not given: any airspeed gives the same
    prediction = database.predict({name: np.array([value]) for name, value in channels.items()})
    values = {axis: float(prediction.coefficients[axis][0]) for axis in AXES}
    session.table(["axis", f"{row.label} at {at}"], [[axis, f"{value:.6g}"] for axis, value in values.items()], numbers=(1,))
    if assumed:
        session.say(f"taken as zero: {', '.join(assumed)}")
    if prediction.outside[0]:
        session.say(f"outside tables: {', '.join(sorted(prediction.outside_tables))} (edge values held)")
    session.answer(
        {
            "version": row.id,
            "at": point,
            "taken_as_zero": assumed,
            "coefficients": values,
            "outside_tables": bool(prediction.outside[0]),
        }
    )


def _point(text: str, inputs: tuple[str, ...]) -> dict[str, float]:
    point = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, sign, value = (piece.strip() for piece in part.partition("="))
        if not sign or name not in inputs:
            raise InputError(f"'{part}' is no input of this version", "--at", nearest(name, inputs))
        try:
            unit = channel(name).unit
        except UnknownNameError:
            unit = "1"  # a free input of an imported file: a bare number
        point[name] = quantity(value, unit)
        if not math.isfinite(point[name]):
            raise InputError(f"'{part}' is not a finite number", "--at", "give a number, with a unit or in SI")
    return point


def _vehicle(catalogue: Catalogue, vehicle: str | None) -> str:
    if vehicle is not None:
        return catalogue.vehicle(vehicle).name
    names = [row.name for row in catalogue.vehicles()]
    if len(names) != 1:
        raise UnknownNameError(
            "which vehicle?", remedy=f"--vehicle {' or '.join(names)}" if names else "add one: aerodb vehicle add"
        )
    return names[0]


def _version(catalogue: Catalogue, reference: str, vehicle: str | None, as_of: str | None = None) -> VersionRow:
    when = None
    if as_of is not None:
        try:
            when = datetime.fromisoformat(as_of)
        except ValueError as error:
            raise InputError(f"'{as_of}' is not a date", "--as-of", "for example 2026-05-31 or 2026-05-31T12:00") from error
        when = when.replace(tzinfo=UTC) if when.tzinfo is None else when.astimezone(UTC)
    return catalogue.version(_vehicle(catalogue, vehicle), reference, when)


def _names(catalogue: Catalogue, vehicle: str) -> dict[str, str]:
    return {event.name: event.version for event in catalogue.name_history(vehicle)}


def _document(row: VersionRow) -> dict[str, Any]:
    return {
        "version": row.id,
        "label": row.label,
        "vehicle": row.vehicle,
        "parent": row.parent,
        "content_sha256": row.content_sha256,
        "created_utc": row.created_utc.isoformat(),
    }
