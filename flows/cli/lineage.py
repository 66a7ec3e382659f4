"""``aerodb version lineage``, ``impact`` and ``diff``: sources of a number, uses of a flight,
changes."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.output import Session
from aerodb.flows.cli.references import Vehicle

if TYPE_CHECKING:
    from aerodb.storage.catalogue import Catalogue, VersionRow
    from aerodb.storage.workspace import Workspace

#: Largest number of nodes printed; `--json` lists them all.
_LISTED = 12


def lineage(
    context: typer.Context,
    version: str,
    vehicle: Vehicle = None,
    node: Annotated[
        str | None, typer.Option(help="A table node, TABLE[i,j], counted from 0.")
    ] = None,
    at: Annotated[
        str | None,
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
        _origins(session, catalogue, row, node, at or "")
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
    session.say(
        " <- ".join(
            f"{ancestor['label']} ({ancestor['version'][:12]})" for ancestor in document["line"]
        )
    )
    for reason in document["stale"]:
        session.say(f"stale: {reason}")
    session.table(
        ["flight", "role", "log sha256"],
        [
            [flights[e["flight"]], e["role"].replace("_", " "), e["log_sha256"][:12]]
            for e in document["flights"]
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
    from aerodb.tasks.view import origins_document

    document = origins_document(catalogue, row, node, at)
    what, origins = document["at"], document["increments"]
    if not origins:
        session.say(
            f"{what}: no increment acts here: the value is that of {row.label}'s imported database"
        )
    for origin in origins:
        session.say(
            f"{what}: increment on {origin['axis']} of {origin['value']:.5g} +-"
            f" {origin['standard_error']:.2g} ({', '.join(origin['regressors'])}), made by"
            f" {origin['label']} in run {str(origin['run'])[:12]}, code {origin['code_version']},"
            f" steps {_steps(origin['step_versions'])}"
        )
        session.table(
            ["flight", "role", "log sha256", "retracted"],
            [
                [f["name"], f["role"], f["log_sha256"][:12], f["retracted"] or ""]
                for f in origin["flights"]
            ],
        )
    session.answer(document)


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
    session.table(
        ["version", "role of the flight", "through"],
        [
            [u.version.label, u.role.replace("_", " "), through.get(u.through, u.through[:12])]
            for u in uses
        ],
    )
    session.answer(impact_document(row.id, uses))


def diff(
    context: typer.Context,
    before: Annotated[str, typer.Argument(help="The version to start from.")],
    after: Annotated[str, typer.Argument(help="The version to compare with it.")],
    vehicle: Vehicle = None,
    figure: Annotated[
        Path | None, typer.Option(help="Also draw slices to this file (.png, .svg, .pdf).")
    ] = None,
) -> None:
    """Show the differences of two versions, per term and table node, with sigma, coverage and
    flights.

    Example: aerodb version diff v0001 candidate --figure diff.png
    """
    from aerodb.storage.workspace import write_for_user
    from aerodb.tasks.references import version_of
    from aerodb.tasks.view import compare_versions

    session: Session = context.obj
    workspace = session.workspace()
    catalogue = session.catalogue()
    old, new = version_of(catalogue, before, vehicle), version_of(catalogue, after, vehicle)
    document, picture = compare_versions(
        catalogue, old, new, figure.suffix if figure is not None else ""
    )
    labels = catalogue.flight_labels({f for t in document["terms"] for f in t["flights"]})
    _say_diff(session, document, labels)
    if figure is not None and picture is not None:
        session.say(f"figure: {write_for_user(workspace, figure, picture)}")
    session.answer(document)


def _say_diff(session: Session, document: dict[str, Any], labels: dict[str, str]) -> None:
    if not any(document[key] for key in ("terms", "tables", "nodes", "not_addressable")):
        session.say("no difference")
    if document["terms"]:
        session.table(
            ["what", "axis", "name", "before", "after", "flights"],
            [
                [
                    t["kind"],
                    t["axis"],
                    t["name"],
                    t["before"],
                    t["after"],
                    ", ".join(labels[f] for f in t["flights"]),
                ]
                for t in document["terms"]
            ],
        )
    for name, what in document["tables"].items():
        session.say(f"table {name}: {what}")
    for name, largest in document["not_addressable"].items():
        session.say(
            f"table {name}: values differ by up to {largest:.5g} (its arguments are not single"
            " channels)"
        )
    for entry in document["nodes"]:
        nodes = sorted(entry["nodes"], key=lambda node: -abs(node["change"]))
        session.say()
        session.say(
            f"{entry['axis']} at the nodes of {entry['table']}: {len(nodes)} change,"
            f" {entry['unchanged']} do not"
        )
        session.table(
            ["node", "at", "change", "sigma", "flown"],
            [
                [
                    str(n["index"]),
                    ", ".join(f"{name} = {value:.4g}" for name, value in n["at"].items()),
                    f"{n['change']:.5g}",
                    f"{n['sigma']:.2g}",
                    "yes" if n["inside_data"] else "no",
                ]
                for n in nodes[:_LISTED]
            ],
            numbers=(2, 3),
        )
        if len(nodes) > _LISTED:
            session.say(f"and {len(nodes) - _LISTED} smaller ones (--json lists them)")
