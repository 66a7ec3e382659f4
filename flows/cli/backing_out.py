"""``aerodb version back-out``: parameters of a version from the derivatives of a linear model."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerodb.flows.cli.output import Session
from aerodb.flows.cli.trimming import steady_command
from aerodb.flows.cli.vehicles import read_text

if TYPE_CHECKING:
    from aerodb.storage.catalogue import VersionRow
    from aerodb.tasks.view import StatedCondition

#: Standard errors beyond which a derivative counts as not met.
_MET = 2.0


@steady_command
def back_out(
    session: Session,
    row: "VersionRow",
    flight: "StatedCondition",
    words: str,
    linear: Annotated[
        Path,
        typer.Option(help="File (TOML) of dimensional derivatives, as `aerodb derivatives` takes."),
    ],
    parameter: Annotated[
        list[str], typer.Option(help="A parameter of the database; repeat the option.")
    ],
) -> None:
    """Find the parameters of a version with which its own linear model meets given derivatives:
    start values and priors for its database.

    Example: aerodb version back-out v0001 --speed 64 --altitude 3000 --linear flown.toml
    --parameter tail_CLa --parameter fin_CLa
    """
    from aerodb.identification import parse_derivative_file
    from aerodb.tasks.view import back_out_document

    file = parse_derivative_file(read_text(linear), str(linear))
    document = back_out_document(session.catalogue(), row, flight, file, parameter)
    _print(session, row, document, f"aerodb version modes {words}")
    session.answer(document)


def _print(session: Session, row: "VersionRow", document: dict[str, Any], then: str) -> None:
    apart = [
        each
        for each in document["derivatives"]
        if abs(each["after"] - each["given"]) > _MET * each["standard_error"]
    ]
    names = ", ".join(each["name"] for each in apart)
    held = ", ".join(each["name"] for each in document["parameters"] if each["at_bound"])
    verdict = (
        "the search did not settle: start nearer"
        if not document["converged"]
        else "the linear model meets the derivatives"
        if not apart
        else f"{len(apart)} of {len(document['derivatives'])} derivatives are not met"
    )
    session.headlines(
        f"{row.vehicle}: {row.label}: {verdict}",
        [
            ("beyond two standard errors", names),
            ("at a bound", held),
        ],
        then,
    )
    session.say()
    session.table(
        ["parameter", "start", "value", "standard error", "unit"],
        [
            [
                each["name"],
                f"{factor * each['start']:.4g}",
                f"{factor * each['value']:.4g}",
                f"{factor * each['standard_error']:.2g}",
                "" if unit == "-" else unit,
            ]
            for each in document["parameters"]
            for factor, unit in [session.units.scale(each["unit"])]
        ],
        numbers=(1, 2, 3),
    )
    session.say()
    session.table(
        ["derivative", "given", "standard error", "at the start", "met"],
        [
            [
                each["name"],
                *(f"{each[key]:.4g}" for key in ("given", "standard_error", "before", "after")),
            ]
            for each in document["derivatives"]
        ],
        numbers=(1, 2, 3, 4),
    )
    session.say("start values: value and prior_sigma of [parameters] in the database file")
