"""Options that commands share; `aerodb.tasks.references` says what those about versions mean."""

from typing import TYPE_CHECKING, Annotated

import typer

from aerodb.errors import InputError
from aerodb.flows.cli.output import begin_server

if TYPE_CHECKING:
    from aerodb.storage.catalogue import Catalogue, FlightRow

Vehicle = Annotated[str | None, typer.Option(help="The vehicle; optional if there is only one.")]
AsOf = Annotated[
    str | None, typer.Option("--as-of", help="As it was at this date (ISO 8601, UTC).")
]
OfFlight = Annotated[
    str | None, typer.Option(help="The vehicle, if several flights have this name.")
]
Direct = Annotated[
    bool,
    typer.Option(callback=begin_server, help="Run without Prefect; steps and keys are the same."),
]
Flights = Annotated[
    list[str] | None, typer.Option(help="Flights to use; default: all of the vehicle.")
]
HoldOut = Annotated[
    list[str] | None,
    typer.Option(
        help="Flights to hold out (the search does not see them, they check it), or `none`;"
        " default: the newest fifth."
    ),
]
Beside = Annotated[
    str | None,
    typer.Option(
        "--with",
        help="A version of the other line, flown and rolled as one with this: legs with their"
        " friction beside aerodynamics, or the reverse.",
    ),
]
Since = Annotated[
    float | None,
    typer.Option("--from", min=0.0, help="Start [s] from the flight's first sample."),
]
Until = Annotated[float | None, typer.Option("--to", help="End [s].")]
Select = Annotated[
    list[str] | None,
    typer.Option(
        help="Condition of the samples that count, such as `command_1 > 0.3`, `time < 20 s` or"
        " `phase = hover`; repeat the option: all hold."
    ),
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Also print the details.")]
MappingFile = Annotated[
    str | None, typer.Option(help="Name or file of a mapping; default: chosen by content.")
]


def stretch_of(
    row: "FlightRow", since: float | None, until: float | None
) -> dict[str, float | None]:
    """Return ``since`` and ``until`` [s] of a stretch of a flight; InputError where it has none."""
    end = row.duration if until is None else min(until, row.duration)
    if not (since or 0.0) < end:
        raise InputError(
            f"no sample from {since or 0.0:g} to {end:g} s",
            f"flight {row.label}",
            f"it lasts {row.duration:.1f} s: choose --from and --to within it",
        )
    return {"since": since, "until": until}


def beside_of(catalogue: "Catalogue", vehicle: str, reference: str | None) -> dict[str, str]:
    """Return the id of the version of ``--with`` as a parameter of a flow; none without it."""
    return {} if reference is None else {"beside": catalogue.version(vehicle, reference).id}


def held_out(catalogue: "Catalogue", vehicle: str, flights: list[str] | None) -> list[str] | None:
    """Return the ids of the flights of ``--hold-out``; None without it, which chooses them."""
    if flights is None or flights == ["none"]:
        return flights and []
    return [catalogue.flight(ref, vehicle).id for ref in flights]
