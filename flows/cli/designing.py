"""``aerodb version design``: the next manoeuvre to fly, as a file."""

import math
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from aerodb.flows.cli.next_flight import Flights, counted_flights, limit_of
from aerodb.flows.cli.output import Session
from aerodb.flows.cli.references import Vehicle
from aerodb.flows.cli.trimming import Altitude, Climb, Fuel, Given, Glide, Speed, steady_flight
from aerodb.flows.cli.vehicles import read_text

if TYPE_CHECKING:
    from aerodb.storage.catalogue import VersionRow


def design(
    context: typer.Context,
    version: str,
    speed: Speed,
    altitude: Altitude,
    model: Annotated[
        Path, typer.Option(help="Model file (TOML): the terms that are to be told apart.")
    ],
    limit: Annotated[
        list[str] | None,
        typer.Option(help="CHANNEL=LEAST:GREATEST, such as alpha=-2deg:10deg or az=-20:0 (m/s2)."),
    ] = None,
    duration: Annotated[str, typer.Option(help="Length of the manoeuvre, in s.")] = "20",
    flights: Flights = None,
    output: Annotated[
        Path | None, typer.Option(help="File to write, for aerodb version fly --manoeuvre.")
    ] = None,
    climb: Climb = None,
    glide: Glide = False,
    fuel: Fuel = None,
    given: Given = None,
    vehicle: Vehicle = None,
) -> None:
    """Design the doublet, 3-2-1-1 or multisine that tells the terms of a model file apart best
    within limits, with the standard errors expected before and after it.

    Example: aerodb version design released --speed 25 --altitude 300 --model increments.toml
    --limit alpha=0deg:9deg --output next.toml
    """
    from aerodb.tasks.references import value_of, version_of
    from aerodb.tasks.steps import design_flight

    session: Session = context.obj
    catalogue = session.catalogue()
    row = version_of(catalogue, version, vehicle)
    steady = steady_flight(session, row, speed, altitude, climb, glide, fuel, given)
    document = design_flight(
        row.id,
        workspace=str(session.workspace().root),
        run="",
        model=read_text(model),
        steady=steady,
        limits=dict(limit_of(text) for text in limit or []),
        duration=value_of("time", duration),
        flights=counted_flights(catalogue, row, flights),
    )
    if output is not None:
        output.write_text(document["manoeuvre"], "utf-8")
    _print(session, row, document, output)
    session.answer(document)


def _print(
    session: Session, row: "VersionRow", document: dict[str, Any], output: Path | None
) -> None:
    """Print the manoeuvre in a line, what it tells and how far it moves the aircraft; then its
    file, unless it was written."""
    from aerodb.report import channel_scale

    moves = []
    for name, (low, high) in document["reached"].items():
        factor, label = channel_scale(name, session.units)
        moves.append(f"{label} {low * factor:.3g} to {high * factor:.3g}")
    gained = max(document["parameters"], key=_gain)
    known = gained["standard_error_before"]
    before = "unknown" if known is None else f"{known:.3g}"
    fly = f"aerodb version fly {row.label} --vehicle {row.vehicle} --manoeuvre {output or 'FILE'}"
    session.headlines(
        f"{row.vehicle}: {_manoeuvre_words(document['manoeuvre'])}",
        [
            (
                "tells",
                f"{gained['parameter']} most: standard error {before} ->"
                f" {gained['standard_error_after']:.3g}",
            ),
            ("moves", "; ".join(moves)),
            ("limits", f"kept by {document['within']} of {document['tried']} manoeuvres"),
        ],
        fly if output else f"write it with --output FILE, then {fly}",
        [
            (
                "feedback",
                "closed: the vehicle is unstable without it" if document["feedback"] else "",
            )
        ],
    )
    session.say()
    session.table(
        ["parameter", "standard error before", "after"],
        [
            [
                row["parameter"],
                "unknown"
                if row["standard_error_before"] is None
                else f"{row['standard_error_before']:.3g}",
                f"{row['standard_error_after']:.3g}",
            ]
            for row in document["parameters"]
        ],
        numbers=(1, 2),
    )
    pair = document["separated"]
    if pair is not None:
        session.say(
            f"correlation of {' and '.join(pair['parameters'])}: {pair['correlation_before']:+.2f}"
            f" before, {pair['correlation_after']:+.2f} after"
        )
    for note in document["notes"]:
        session.say(f"- {note}")
    if output is None:
        session.say()
        session.say(document["manoeuvre"])


def _gain(row: dict[str, Any]) -> float:
    """By how much a standard error falls, as a factor; without bound where it was unknown."""
    before, after = row["standard_error_before"], row["standard_error_after"]
    return math.inf if before is None or not after else float(before / after)


def _manoeuvre_words(text: str) -> str:
    """Return the inputs of a manoeuvre file in words.

    >>> _manoeuvre_words('[[input]]\\ntarget = "delta_e"\\nshape = "3211"\\namplitude = "6 deg"')
    '3211 of delta_e by 6 deg'
    """
    inputs = tomllib.loads(text)["input"]
    told = [
        f"{each['shape']} of {each['target']}"
        + (f" by {each['amplitude']}" if "amplitude" in each else "")
        for each in inputs
    ]
    return "; ".join(told)
