"""``aerodb version tabulate``: a version as tables, with its error between the nodes."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.output import Session, percent
from aerodb.flows.cli.references import Vehicle

if TYPE_CHECKING:
    from aerodb.storage.catalogue import VersionRow


def tabulate(
    context: typer.Context,
    version: str,
    over: Annotated[
        list[str],
        typer.Option(help="INPUT=LEAST:GREATEST:NODES, such as alpha=-10deg:20deg:31; repeat it."),
    ],
    at: Annotated[
        list[str] | None,
        typer.Option(help="NAME=VALUE,... of other inputs, such as V=55,throttle=0.6."),
    ] = None,
    vehicle: Vehicle = None,
) -> None:
    """Make a version of tables of a version, such as an aircraft of parts, for tools that know
    tables only; says its largest error between the breakpoints.

    Example: aerodb version tabulate released --over alpha=-10deg:20deg:31
    --over delta_elevator=-20deg:20deg:9 --at V=55
    """
    from aerodb.flows.importing import tabulate_flow
    from aerodb.tasks.references import point_of, version_of
    from aerodb.tasks.view import database_of

    session: Session = context.obj
    catalogue = session.catalogue()
    row = version_of(catalogue, version, vehicle)
    parameters = {
        "version": row.id,
        "over": dict(_range(text) for text in over),
        "at": point_of(",".join(at or ()), database_of(catalogue, row).inputs),
    }
    if len(parameters["over"]) < len(over):
        raise InputError("an input stands twice", "--over", "give each input once")
    document = session.run(tabulate_flow, parameters, direct=True)
    _print(session, row, document)
    session.answer(document)


def _range(text: str) -> tuple[str, list[float | int]]:
    """An input, its least and greatest value [SI] and number of nodes."""
    from aerodb.flows.cli.next_flight import limit_of

    ends, colon, nodes = text.rpartition(":")
    if not colon or not nodes.isascii() or not nodes.isdigit() or ":" not in ends:
        raise InputError(
            f"'{text}' is no range of nodes", "--over", "write INPUT=LEAST:GREATEST:NODES"
        )
    name, (low, high) = limit_of(ends)
    if not low < high or int(nodes) < 2:
        raise InputError(
            f"'{text}' has no cell", "--over", "the smaller value first, and at least 2 nodes"
        )
    return name, [low, high, int(nodes)]


def _print(session: Session, row: "VersionRow", document: dict[str, Any]) -> None:
    from aerodb.report import display_unit

    def shown(point: dict[str, float], digits: int) -> str:
        said = []
        for name, value in point.items():
            factor, unit = display_unit(name, session.units)
            said.append(f"{name} {factor * value:.{digits}g} {unit or ''}".rstrip())
        return ", ".join(said)

    errors = document["errors"]
    worst = max(errors, key=lambda axis: _share(errors[axis]), default="")
    size = f"{worst} off by up to {percent(_share(errors[worst]))} of its span" if worst else ""
    session.headlines(
        f"{row.vehicle}: {document['label']} has {document['tables']} tables of"
        f" {document['nodes']} points over {', '.join(document['over'])}, made of {row.label}",
        [
            ("between", f"{size}, at {document['points']} points between breakpoints" * bool(size)),
            ("linear in", ", ".join(document["rates"])),
            ("as before", ", ".join(document["kept"])),
            ("held", shown(document["held"], 5)),
        ],
        f"aerodb version export {document['label']} --vehicle {row.vehicle} --format csv",
    )
    session.say()
    session.table(
        ["axis", "largest error", "rms", "span", "at"],
        [
            [
                axis,
                *(f"{error[key]:.2g}" for key in ("largest", "rms", "span")),
                shown(error["at"], 3),
            ]
            for axis, error in errors.items()
        ],
        (1, 2, 3),
    )


def _share(error: dict[str, Any]) -> float:
    """The largest error as a part of the span of its axis."""
    return float(error["largest"] / error["span"]) if error["span"] else 0.0
