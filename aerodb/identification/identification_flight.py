"""A flight as the methods take it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

from aerodb.coefficients import Coefficients, Comparison
from aerodb.conditioning import selected
from aerodb.flight import Flight
from aerodb.signals import runs
from aerodb.vehicle import Vehicle


@dataclass(frozen=True, eq=False)
class IdentificationFlight:
    """A consistent flight with what the methods need of it.

    Parameters
    ----------
    comparison : with the database that the increments are declared on.
    coefficients : of the flight, in the vehicle's geometry.
    windows : stretches that dynamic methods fly, from and to [s] from the first sample.
    estimated : channels that no sensor measured but an estimator made.
    """

    flight: Flight
    comparison: Comparison
    coefficients: Coefficients
    vehicle: Vehicle
    windows: tuple[tuple[float, float], ...]
    estimated: frozenset[str] = frozenset()


#: Shortest selected stretch [s] that dynamic methods fly.
SHORTEST: Final = 1.0


def within(given: IdentificationFlight, conditions: Sequence[str]) -> IdentificationFlight:
    """Return the flight with only the samples (n,) for which all conditions hold, and the parts
    of its windows [s] where they hold for 1 s or more.

    Raises InputError as `selected` does.
    """
    if not conditions:
        return given
    flight = given.flight
    mask = selected(flight, conditions)
    spent = flight.time - flight.time[0]
    windows = [
        (float(spent[first]), float(spent[last]))
        for since, until in given.windows
        for first, last in runs(mask & (spent >= since) & (spent <= until))
        if spent[last] - spent[first] >= SHORTEST
    ]
    usable, own = given.comparison.usable, given.coefficients.usable
    return replace(
        given,
        comparison=replace(
            given.comparison, usable={axis: each & mask for axis, each in usable.items()}
        ),
        coefficients=replace(
            given.coefficients, usable={axis: each & mask for axis, each in own.items()}
        ),
        windows=tuple(windows),
    )
