"""What the closed loop asks of flights, wherever they are kept: a store, or the memory of a
test."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from aerodb.coefficients import Comparison
from aerodb.conditioning import Segment
from aerodb.consistency import StateNoise
from aerodb.flight import Flight
from aerodb.loop.library import Library
from aerodb.tables import AeroDatabase
from aerodb.tracing import NormalEquations, thinned
from aerodb.vehicle import Vehicle


@dataclass(frozen=True)
class Reconstruction:
    """What the flight-path reconstruction of a flight says of its channels.

    noise : spectrum of the errors of its states, None where nothing was reconstructed. angles :
    flow angles (``alpha``, ``beta``) that no sensor showed and that come from the motion. errors :
    sensor parameter -> standard error (SI) of all that was estimated; applied : those of them that
    were taken off the channels. calibrated : whether its sensors were corrected by a calibration,
    which other flights share.
    """

    noise: StateNoise | None = None
    angles: frozenset[str] = frozenset()
    errors: Mapping[str, float] = field(default_factory=dict)
    applied: tuple[str, ...] = ()
    calibrated: bool = False

    @property
    def applied_errors(self) -> dict[str, float]:
        """Parameter -> standard error (SI) of every sensor error that was taken off the
        channels."""
        return {name: self.errors[name] for name in self.applied}


class FlightSource(Protocol):
    """Flights of one vehicle by their ids: what was measured, and the same beside any database.

    A database need not be stored anywhere. Calls may come from several threads at once. Every
    method raises InputError where a flight lacks what it is asked for.
    """

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle that all these flights flew."""
        ...

    def flight(self, flight: str) -> Flight:
        """The channels of a flight after reconstruction."""
        ...

    def reconstruction(self, flight: str) -> Reconstruction:
        """What the reconstruction of a flight says of its channels."""
        ...

    def segments(self, flight: str) -> tuple[Segment, ...]:
        """The manoeuvres and states of a flight, start and end in s from its first sample."""
        ...

    def comparison(self, flight: str, database: AeroDatabase) -> tuple[Flight, Comparison]:
        """The channels of a flight and its coefficients beside those that a database predicts, at
        the full rate."""
        ...

    def normal_equations(
        self, flight: str, database: AeroDatabase, library: Library
    ) -> NormalEquations:
        """Whitened cross-products of all columns of the library and of the residual of a flight
        beside a database: what `aerodb.tracing.normal_equations_of` makes of
        `aerodb.loop.evidence.evidence_beside`."""
        ...

    def looked_before(self, flights: Sequence[str], library: Library) -> frozenset[str] | None:
        """Ids of hypotheses that all other libraries had with which any of these flights was traced
        before; None without such."""
        ...


def thinned_comparison(
    flights: FlightSource, flight: str, database: AeroDatabase, bandwidth: float
) -> tuple[Flight, Comparison]:
    """A flight and its comparison with a database at the rate that tracing at `bandwidth` [Hz]
    needs."""
    return thinned(*flights.comparison(flight, database), bandwidth)
