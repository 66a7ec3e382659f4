"""``aerodb version tabulate``: a version as tables, with its error between the nodes."""

from typing import Annotated, Any

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.output import Session
from aerodb.flows.cli.references import Vehicle


def tabulate(
    context: typer.Context,
    version: str,
    over: Annotated[
        list[str],
        typer.Option(help="INPUT=LEAST:GREATEST:NODES, such as alpha=-10deg:20deg:31; repeat it."),
    ],
    at: Annotated[
        str, typer.Option(help="NAME=VALUE,... of other inputs, such as V=55,throttle=0.6.")
    ] = "",
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
        "at": point_of(at, database_of(catalogue, row).inputs),
    }
    if len(parameters["over"]) < len(over):
        raise InputError("an input stands twice", "--over", "give each input once")
    document = session.run(tabulate_flow, parameters, direct=True)
    _print(session, document)
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


def _print(session: Session, document: dict[str, Any]) -> None:
    session.say(
        f"{document['label']} descends from {document['parent']}: {document['tables']} tables of"
        f" {document['nodes']} nodes over {', '.join(document['over'])}"
    )
    if document["rates"]:
        session.say(f"linear in {', '.join(document['rates'])}")
    if document["kept"]:
        session.say(f"terms that stay as they are: {', '.join(document['kept'])}")
    held = ", ".join(f"{name} {value:.5g}" for name, value in document["held"].items())
    if held:
        session.say(f"held (SI): {held}")
    session.table(
        ["axis", "largest error", "rms", "of", "at (SI)"],
        [
            [
                axis,
                *(f"{error[key]:.2g}" for key in ("largest", "rms", "span")),
                ", ".join(f"{name} {value:.3g}" for name, value in error["at"].items()),
            ]
            for axis, error in document["errors"].items()
        ],
        (1, 2, 3),
    )
    session.say(f"errors at {document['points']} points between the breakpoints")
