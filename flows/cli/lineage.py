"""``aerodb version lineage`` and ``impact``: sources of a number, uses of a flight."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.output import Session, plus_minus
from aerodb.flows.cli.references import Vehicle
from aerodb.support import counted

if TYPE_CHECKING:
    from aerodb.storage.catalogue import Catalogue, VersionRow
    from aerodb.storage.workspace import Workspace


def lineage(
    context: typer.Context,
    version: str,
    vehicle: Vehicle = None,
    node: Annotated[
        str | None,
        typer.Option(help="A table node, TABLE[i,j], counted from 0; or a parameter's name."),
    ] = None,
    at: Annotated[
        list[str] | None,
        typer.Option(help="A point: NAME=VALUE,... with units or in SI; the rest are 0."),
    ] = None,
    prov: Annotated[
        Path | None, typer.Option(help="Also write it as W3C PROV-JSON to this file.")
    ] = None,
) -> None:
    """Show what a version or one of its numbers is based on: ancestors, flights, logs, settings,
    runs.

    Example: aerodb version lineage candidate --node CZ0[2]
    """
    from aerodb.tasks.references import version_of

    session: Session = context.obj
    workspace = session.workspace()
    catalogue = session.catalogue()
    row = version_of(catalogue, version, vehicle)
    if node is not None and at is not None:
        raise InputError("--node and --at exclude each other", remedy="give a node or a point")
    if prov is not None:
        _write_prov(session, workspace, catalogue, row, prov)
    if node is not None or at is not None:
        _origins(session, catalogue, row, node, ",".join(at or ()))
    else:
        _whole(session, catalogue, row)


def _write_prov(
    session: Session,
    workspace: "Workspace",
    catalogue: "Catalogue",
    row: "VersionRow",
    target: Path,
) -> None:
    from aerodb.storage.workspace import write_for_user
    from aerodb.tasks.view import prov_of

    written = write_for_user(workspace, target, prov_of(catalogue, row))
    session.say(f"PROV-JSON: {written}")


def _whole(session: Session, catalogue: "Catalogue", row: "VersionRow") -> None:
    from aerodb.tasks.view import lineage_document

    document = lineage_document(catalogue, row)
    flights = catalogue.flight_labels(entry["flight"] for entry in document["flights"])
    used = sorted(document["flights"], key=lambda entry: flights[entry["flight"]])
    roles = Counter(entry["role"].replace("_", " ") for entry in used)
    before = [each["label"] for each in document["line"] if each["version"] == row.parent]
    based = f"based on {counted(len(used), 'flight')}" if used else "an import"
    session.headlines(
        f"{row.vehicle}: {row.label} is {based}",
        [
            ("flights", ", ".join(f"{n} {role}" for role, n in roles.items())),
            (
                "line",
                " <- ".join(
                    f"{each['label']} ({each['version'][:12]})" for each in document["line"]
                ),
            ),
            ("stale", "; ".join(document["stale"])),
        ],
        f"aerodb version diff {before[0]} {row.label} --vehicle {row.vehicle}" if before else "",
    )
    session.say()
    if used:
        session.table(
            ["flight", "role", "log sha256"],
            [
                [flights[e["flight"]], e["role"].replace("_", " "), e["log_sha256"][:12]]
                for e in used
            ],
        )
    session.table(
        ["run", "flow", "how", "state", "code"],
        [
            [r["run"][:12], r["flow"], r["how"], r["state"], r["code_version"]]
            for r in document["runs"]
        ],
    )
    session.answer(document)


def _origins(
    session: Session, catalogue: "Catalogue", row: "VersionRow", node: str | None, at: str
) -> None:
    """Print which increments act at a node or point, or what gave a parameter, and their flights
    once."""
    from aerodb.report import term_name
    from aerodb.tasks.view import origins_document

    document = origins_document(catalogue, row, node, at)
    what, origins = f"{row.vehicle}: {row.label} at {document['at']}", document["increments"]
    if "parameter" in document:
        origins = [document["parameter"]] if document["parameter"]["flights"] else []
        what = f"{row.vehicle}: {row.label}: {document['at']}"
        what += f" = {_value(session, document['parameter'])}"
    flights = list(dict.fromkeys(f["flight"] for origin in origins for f in origin["flights"]))
    makers = dict.fromkeys(origin["label"] for origin in origins)
    count = counted(len(flights), "flight")
    based = f"from {count}, by {', '.join(makers)}" if origins else "as imported: no flight acts"
    acting = []
    for origin in origins if "parameter" not in document else ():
        terms = dict.fromkeys(map(term_name, origin["regressors"]))
        size = plus_minus(origin["value"], origin["standard_error"], 4)
        acting.append((origin["axis"], f"{size} ({', '.join(terms)})"))
    session.headlines(
        f"{what}{':' if acting or not origins else ''} {based}",
        acting,
        f"aerodb version lineage {row.label} --vehicle {row.vehicle}",
    )
    _say_flights(session, origins)
    for label, origin in {origin["label"]: origin for origin in origins}.items():
        session.say(
            f"{label} was made in run {str(origin['run'])[:12]}, code {origin['code_version']},"
            f" steps {_steps(origin['step_versions'])}"
        )
    session.answer(document)


def _value(session: Session, origin: dict[str, Any]) -> str:
    """Return the value of a parameter with half of its 95 % interval, in the units shown."""
    factor, unit = session.units.scale(origin["unit"])
    known = plus_minus(origin["value"], origin["standard_error"], 6, factor)
    return f"{known}{'' if unit == '-' else f' {unit}'}"


def _say_flights(session: Session, origins: Sequence[dict[str, Any]]) -> None:
    """Print the flights behind increments, each once."""
    behind = {f["flight"]: f for origin in origins for f in origin["flights"]}
    if behind:
        session.say()
        session.table(
            ["flight", "role", "log sha256", "retracted"],
            [
                [f["name"], f["role"].replace("_", " "), f["log_sha256"][:12], f["retracted"] or ""]
                for f in sorted(behind.values(), key=lambda each: each["name"])
            ],
        )


def _steps(versions: dict[str, list[int]]) -> str:
    return (
        ", ".join(f"{step} {'/'.join(map(str, numbers))}" for step, numbers in versions.items())
        or "none stored"
    )


def impact(context: typer.Context, flight: str, vehicle: Vehicle = None) -> None:
    """Show which versions are based on a flight.

    Example: aerodb version impact 1a2b3c
    """
    from aerodb.tasks.view import impact_document

    session: Session = context.obj
    catalogue = session.catalogue()
    row = catalogue.flight(flight, vehicle)
    uses = catalogue.impact(row.id)
    through = {use.version.id: use.version.label for use in uses}
    name = catalogue.flight_labels([row.id])[row.id]
    count = f"{counted(len(uses), 'version')} {'is' if len(uses) == 1 else 'are'} based on it"
    last = f"version show {uses[-1].version.label}" if uses else "close-loop"
    session.headlines(
        f"{row.vehicle}: {name}: {count}", (), f"aerodb {last} --vehicle {row.vehicle}"
    )
    session.table(
        ["version", "role of the flight", "through"],
        [
            [u.version.label, u.role.replace("_", " "), through.get(u.through, u.through[:12])]
            for u in uses
        ],
    )
    session.answer(impact_document(row.id, uses))
