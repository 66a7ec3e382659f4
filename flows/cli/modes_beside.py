"""Modes of a version beside those of flights: options, and the table that is printed."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerodb.flows.cli.output import HALF_INTERVAL, Session, plus_minus
from aerodb.flows.cli.vehicles import read_text

if TYPE_CHECKING:
    from aerodb.storage.catalogue import VersionRow
    from aerodb.tasks.view import StatedCondition

Flown = Annotated[
    Path | None,
    typer.Option(
        help="Modes of flights to put beside: the JSON answer of `aerodb estimate` of a linear"
        " model."
    ),
]
Method = Annotated[
    str | None,
    typer.Option(help="Its method; without, the one to believe.", show_default=False),
]
Beside = Annotated[
    str | None,
    typer.Option(help="Version before; without, the parent if there is one.", show_default=False),
]


def beside_flights(
    session: Session,
    row: "VersionRow",
    flight: "StatedCondition",
    flown: Path,
    method: str | None,
    beside: str | None,
) -> dict[str, Any]:
    """The document of `modes_beside_flights` of a version and the one before it."""
    from aerodb.errors import InputError
    from aerodb.tasks.view import flown_modes, modes_beside_flights

    catalogue = session.catalogue()
    try:
        document = json.loads(read_text(flown))
    except ValueError as error:
        raise InputError("it is no JSON", str(flown), "write it with: aerodb --json ...") from error
    found = flown_modes(document, method, str(flown))
    before = (
        catalogue.version(row.vehicle, beside)
        if beside is not None
        else catalogue.version_of_id(row.parent)
        if row.parent
        else None
    )
    rows = [each for each in (before, row) if each is not None]
    return modes_beside_flights(catalogue, rows, flight, found)


def print_beside(session: Session, found: Mapping[str, Any]) -> None:
    """Print modes beside those of flights, and what came nearer."""
    from aerodb.report import COMPARED

    headings = [part for label in found["labels"] for part in (label, "error [%]")]
    session.say()
    session.say(f"beside the linear model of the flights by {found['method']}")
    session.table(
        ["mode", "figure", "flights", *headings],
        [
            [
                row["mode"],
                " ".join(filter(None, (COMPARED[row["figure"]][0], COMPARED[row["figure"]][1]))),
                _cell(row["flown"], row["standard_error"]),
                *(
                    part
                    for label in found["labels"]
                    for part in (
                        _cell(row["values"][label], None),
                        "-" if row["errors"][label] is None else f"{row['errors'][label]:+.2f}",
                    )
                ),
            ]
            for row in found["rows"]
        ],
        numbers=tuple(range(2, 3 + len(headings))),
    )
    session.say(HALF_INTERVAL)
    for sentence in found["said"]:
        session.say(sentence)


def _cell(value: float | None, error: float | None) -> str:
    return "-" if value is None else plus_minus(value, error)
