"""``aerodb version expand``: the next point to which the flown envelope may be expanded."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.next_flight import Flights, counted_flights, limit_of
from aerodb.flows.cli.output import Session, plus_minus
from aerodb.flows.cli.references import Vehicle
from aerodb.flows.cli.trimming import (
    Altitude,
    Climb,
    Fuel,
    Given,
    Glide,
    Speed,
    scaled,
    steady_flight,
    unit_of,
)
from aerodb.flows.cli.vehicles import read_text

if TYPE_CHECKING:
    from aerodb.simulation import Growth


def expand(
    context: typer.Context,
    version: str,
    speed: Speed,
    altitude: Altitude,
    variable: Annotated[str, typer.Option(help="V, altitude, climb, ... of the steady flight.")],
    start: Annotated[str, typer.Option("--from", help="Edge of what has been flown.")],
    end: Annotated[str, typer.Option("--to", help="Target.")],
    step: Annotated[str, typer.Option(help="Largest step of the variable.")],
    model: Annotated[
        Path | None,
        typer.Option(
            help="Model file (TOML): terms that are estimated on the version from all flights, with"
            " its priors; their uncertainty is what grows beyond the edge."
        ),
    ] = None,
    flights: Flights = None,
    growth: Annotated[
        list[str] | None,
        typer.Option(
            help="AXIS:TERM=SIZE: one-sigma change of a derivative per rad of alpha beyond the"
            " edge, such as Cm:delta_elevator=8. Without it: the version's standard errors alone."
        ),
    ] = None,
    sigmas: Annotated[float, typer.Option(help="Standard errors at which margins hold.")] = 2.0,
    control_margin: Annotated[
        float, typer.Option(help="Share of each surface's range left at either end.")
    ] = 0.1,
    growth_rate: Annotated[
        float, typer.Option(help="Largest growth rate of a mode, in 1/s.")
    ] = 0.1,
    limit: Annotated[
        list[str] | None, typer.Option(help="CHANNEL=LEAST:GREATEST of the trim.")
    ] = None,
    load_factor: Annotated[
        float | None, typer.Option(help="Load factor of a pull-up that must be possible, in g.")
    ] = None,
    climb: Climb = None,
    glide: Glide = False,
    fuel: Fuel = None,
    given: Given = None,
    vehicle: Vehicle = None,
) -> None:
    """Find the farthest point at which trim, modes and controls keep their margins with the
    version's uncertainty, and say what stops it.

    Example: aerodb version expand released --speed 30 --altitude 300 --variable V --from 25
    --to 17 --step 2 --growth Cm:delta_elevator=8
    """
    from aerodb.simulation import Margins
    from aerodb.tasks.references import version_of
    from aerodb.tasks.steps import expand_flight
    from aerodb.tasks.view import sweep_value

    session: Session = context.obj
    catalogue = session.catalogue()
    row = version_of(catalogue, version, vehicle)
    document = expand_flight(
        row.id,
        workspace=str(session.workspace().root),
        run="",
        steady=steady_flight(session, row, speed, altitude, climb, glide, fuel, given),
        variable=variable,
        reach=(sweep_value(start, variable), sweep_value(end, variable)),
        largest_step=sweep_value(step, variable),
        margins=Margins(
            sigmas,
            control_margin,
            growth_rate,
            dict(limit_of(text) for text in limit or []),
            load_factor,
        ),
        growth=[_growth(text) for text in growth or []],
        model=None if model is None else read_text(model),
        flights=[] if model is None else counted_flights(catalogue, row, flights),
    )
    factor, heading = scaled(session, variable)
    permitted = f"{variable} {session.units.shown(document['value'], unit_of(variable))}"
    session.headlines(
        f"{row.vehicle}: {row.label}: next permitted point: {permitted}"
        f"{', the target' if document['reached'] else ''}",
        [("stopped by", text) for text in document["stopped_by"]],
        f"fly there, then aerodb flight ingest LOG --vehicle {row.vehicle}",
    )
    session.say()
    if document["known"]:
        session.table(
            ["parameter", "known"],
            [
                [each["parameter"], plus_minus(each["value"], each["standard_error"])]
                for each in document["known"]
            ],
            numbers=(1,),
        )
    session.table(
        [heading, "margins"],
        [
            [f"{factor * point['value']:.6g}", "; ".join(point["violations"]) or "hold"]
            for point in document["points"]
        ],
        numbers=(0,),
    )
    session.answer(document)


def _growth(text: str) -> "Growth":
    from aerodb.simulation import Growth

    name, equals, size = text.rpartition("=")
    axis, colon, term = name.partition(":")
    try:
        number = float(size)
    except ValueError:
        number = -1.0
    if not equals or not colon or not 0.0 <= number < float("inf"):
        raise InputError(
            f"'{text}' is no growth", "--growth", "write AXIS:TERM=SIZE, as Cm:delta_elevator=8"
        )
    return Growth(axis, term, number)
