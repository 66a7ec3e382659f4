"""``aerodb version expand``: the next point to which the flown envelope may be expanded."""

from typing import TYPE_CHECKING, Annotated

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.output import Session
from aerodb.flows.cli.references import Vehicle
from aerodb.flows.cli.trimming import Altitude, Climb, Fuel, Given, Glide, Speed, steady_flight

if TYPE_CHECKING:
    from aerodb.identification import Growth


def expand(
    context: typer.Context,
    version: str,
    speed: Speed,
    altitude: Altitude,
    variable: Annotated[str, typer.Option(help="V, altitude, climb, ... of the steady flight.")],
    start: Annotated[str, typer.Option("--from", help="Edge of what has been flown.")],
    end: Annotated[str, typer.Option("--to", help="Target.")],
    step: Annotated[str, typer.Option(help="Largest step of the variable.")],
    growth: Annotated[
        list[str] | None,
        typer.Option(
            help="AXIS:TERM=SIZE: one-sigma change of a derivative per rad of alpha beyond the"
            " edge, such as Cm:delta_elevator=8; without, the version's standard errors alone."
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
    from aerodb.flows.cli.designing import limit_of
    from aerodb.identification import Margins
    from aerodb.tasks.references import version_of
    from aerodb.tasks.view import expansion_document, sweep_value

    session: Session = context.obj
    catalogue = session.catalogue()
    row = version_of(catalogue, version, vehicle)
    document = expansion_document(
        catalogue,
        row,
        steady_flight(session, row, speed, altitude, climb, glide, fuel, given),
        variable,
        (sweep_value(start, variable), sweep_value(end, variable)),
        sweep_value(step, variable),
        Margins(
            sigmas,
            control_margin,
            growth_rate,
            dict(limit_of(text) for text in limit or []),
            load_factor,
        ),
        [_growth(text) for text in growth or []],
    )
    session.table(
        [variable, "margins"],
        [
            [f"{point['value']:.6g}", "; ".join(point["violations"]) or "hold"]
            for point in document["points"]
        ],
        numbers=(0,),
    )
    ending = ", the target" if document["reached"] else ""
    session.say(f"next permitted point: {variable} {document['value']:.6g}{ending}")
    for text in document["stopped_by"]:
        session.say(f"stopped by: {text}")
    session.answer(document)


def _growth(text: str) -> "Growth":
    from aerodb.identification import Growth

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
