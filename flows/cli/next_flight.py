"""What the commands that plan the next flight have in common: flights that count, and limits."""

from typing import TYPE_CHECKING, Annotated

import typer

from aerodb.errors import InputError

if TYPE_CHECKING:
    from aerodb.storage.catalogue import Catalogue, VersionRow

Flights = Annotated[
    list[str] | None,
    typer.Option(help="Flights to count as flown, or `none`; default: all of the vehicle."),
]


def counted_flights(
    catalogue: "Catalogue", row: "VersionRow", flights: list[str] | None
) -> list[str]:
    """Ids of the flights that are counted as flown."""
    if flights == ["none"]:
        return []
    if flights:
        return [catalogue.flight(ref, row.vehicle).id for ref in flights]
    return [f.id for f in catalogue.flights(row.vehicle) if f.verdict != "rejected"]


def limit_of(text: str) -> tuple[str, tuple[float, float]]:
    """A channel and its least and greatest value, from ``CHANNEL=LEAST:GREATEST``."""
    from aerodb.tasks.references import value_of

    name, equals, ends = text.partition("=")
    low, colon, high = ends.partition(":")
    if not equals or not colon:
        raise InputError(f"'{text}' is no limit", remedy="write CHANNEL=LEAST:GREATEST")
    return name, (value_of(name, low), value_of(name, high))
