"""What the closed loop needs of flights, wherever they are kept: a store, or memory."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Protocol, TypeVar

from aerodb.coefficients import Comparison
from aerodb.conditioning import Segment
from aerodb.consistency import StateNoise
from aerodb.effects import FlightView
from aerodb.flight import Flight
from aerodb.increments import NoiseFloor
from aerodb.loop.frozen_library import Library
from aerodb.support import in_processes
from aerodb.tables import AeroDatabase
from aerodb.tracing import FlightNormalEquations
from aerodb.vehicle import Vehicle

Result = TypeVar("Result")


@dataclass(frozen=True)
class ReconstructionErrors:
    """Results of the flight-path reconstruction of a flight.

    noise : spectrum of the errors of its states, None where nothing was reconstructed. angles :
    flow angles (``alpha``, ``beta``) that no sensor measured and that come from the motion. errors
    : sensor parameter -> standard error (SI) of all that was estimated; known : the error that the
    channels still have and its standard error, also of what was estimated and found insignificant;
    applied : those of `errors` that were subtracted from the channels. calibrated : whether its
    sensors were corrected by a calibration, which other flights share.
    """

    noise: StateNoise | None = None
    angles: frozenset[str] = frozenset()
    errors: Mapping[str, float] = field(default_factory=dict)
    known: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    applied: tuple[str, ...] = ()
    calibrated: bool = False


class FlightSource(Protocol):
    """Flights of one vehicle by their ids: measurements, and the flights compared with any
    database.

    A database need not be stored anywhere. Calls may come from several threads at once. Every
    method raises InputError where a flight lacks what is needed.
    """

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle of all these flights."""
        ...

    def flight(self, flight: str) -> Flight:
        """Return the channels of a flight after reconstruction. Channels are (n,), in SI units."""
        ...

    def reconstruction(self, flight: str) -> ReconstructionErrors:
        """Return the results of the reconstruction of a flight, errors in SI units; raises
        InputError where the flight lacks it."""
        ...

    def segments(self, flight: str) -> tuple[Segment, ...]:
        """Return manoeuvres and states of a flight, start and end [s] from its first sample. Raises
        InputError where the flight lacks what is needed."""
        ...

    def comparison(self, flight: str, database: AeroDatabase) -> Comparison:
        """Return the coefficients of a flight with those that a database predicts, at the full
        rate.

        Coefficients are (n,), dimensionless.
        """
        ...

    def view(
        self, flight: str, database: AeroDatabase, bandwidth: float | None = None
    ) -> FlightView:
        """Return a flight compared with a database: at the full rate (None), or at that which
        tracing at `bandwidth` [Hz] needs (`aerodb.tracing.thinned`).
        """
        ...

    def noise_floors(
        self, flights: Sequence[str], database: AeroDatabase
    ) -> dict[str, Mapping[str, NoiseFloor]]:
        """Return flight (id) -> axis -> error that remains if a database is right, dimensionless:
        `aerodb.loop.noise_floors_of`."""
        ...

    def normal_equations(
        self, flights: Sequence[str], database: AeroDatabase, library: Library
    ) -> list[FlightNormalEquations]:
        """Return the normal equations of flights compared with a database, for all columns of the
        library: `aerodb.loop.normal_equations_beside`.

        Each matrix is (k, k), dimensionless or per unit of the parameters.
        """
        ...

    def looked_before(self, flights: Sequence[str], library: Library) -> frozenset[str] | None:
        """Return the ids of hypotheses that were in every other library with which these flights
        were traced.

        None where none of them was traced before with another library.
        """
        ...


def on_each(
    source: FlightSource, flights: Sequence[str], function: Callable[[str], Result]
) -> list[Result]:
    """Return `function` of each flight (its id), in order, from forks where this process may be
    forked (`in_processes`).

    Flights are loaded here: what a fork loads is lost with it. Raises InputError where a flight
    lacks what is needed.
    """
    for flight in flights:
        source.reconstruction(flight)
        source.flight(flight)
    return in_processes(function, flights)
