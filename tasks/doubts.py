"""What the reconstruction of flights leaves uncertain, as doubt in the increments that are estimated from them."""

from collections.abc import Sequence

from aerodb.coefficients.comparison import Comparison
from aerodb.consistency.smoother.state_error_spectrum import StateNoise
from aerodb.effects.flight_view import FlightView, view_of
from aerodb.effects.measurement.angle_errors import doubts_of_alpha
from aerodb.effects.measurement.constant_errors import doubts
from aerodb.flight import Flight
from aerodb.increments.estimate import Doubt
from aerodb.tables.database import AeroDatabase
from aerodb.tasks.steps.consistency import load_consistent, noise_of, reconstructed_angles
from aerodb.tasks.workspace_access import Stores
from aerodb.tracing.evidence.bandwidth import tracing_bandwidth
from aerodb.tracing.evidence.noise_limits import bounded_noise
from aerodb.tracing.evidence.state_errors import noisy_copies
from aerodb.tracing.settings import Settings
from aerodb.vehicle import Vehicle

#: Times the smoother's power that the error of alpha may have where the residual allows it: gusts that nobody saw.
_MOST = 10.0
#: Copies of the flights with their states' error once more.
_COPIES = 4


def sensor_doubts(
    opened: Stores,
    vehicle: Vehicle,
    database: AeroDatabase,
    flights: Sequence[Flight],
    comparisons: Sequence[Comparison],
    run: str,
) -> dict[str, tuple[Doubt, ...]]:
    """Flight -> what its reconstruction leaves uncertain of its sensors. What a flight estimated for itself errs for itself; a
    calibration, and what only the vehicle file knows, err alike in all."""
    found: dict[str, tuple[Doubt, ...]] = {}
    for flight, comparison in zip(flights, comparisons, strict=True):
        _, document, _ = load_consistent(opened, opened.catalogue.flight(flight.id), run)
        noise = noise_of(document)
        if noise is not None:
            errors = {e["parameter"]: e["standard_error"] for e in document["estimates"]}
            late = {f"{name}_delay": s.delay_prior for name, s in vehicle.sensors.items() if f"{name}_delay" not in errors}
            sigma = {**errors, **late, **{f"{name}_bias": size for name, size in noise.offset.items()}}
            own = [] if document["calibration"] else [e["parameter"] for e in document["estimates"] if e["applied"]]
            view = view_of(flight, comparison, database, vehicle)
            found[flight.id] = doubts(view, sigma, own)
            if "alpha" in reconstructed_angles(document):
                found[flight.id] += doubts_of_alpha(view, _bounded(noise, view, comparison, flight))
    return found


def once_more(
    opened: Stores,
    vehicle: Vehicle,
    database: AeroDatabase,
    flights: Sequence[Flight],
    comparisons: Sequence[Comparison],
    run: str,
) -> list[list[tuple[Flight, Comparison]]]:
    """The flights again and again, with their states' error once more where alpha was reconstructed; empty where none was."""
    copies: list[list[tuple[Flight, Comparison]]] = []
    blind = False
    for flight, comparison in zip(flights, comparisons, strict=True):
        _, document, _ = load_consistent(opened, opened.catalogue.flight(flight.id), run)
        noise = noise_of(document)
        if noise is not None and "alpha" in reconstructed_angles(document):
            blind = True
            view = view_of(flight, comparison, database, vehicle)
            bounded = _bounded(noise, view, comparison, flight)
            copies.append(noisy_copies(flight, bounded, database, vehicle, _COPIES))
        else:
            copies.append([(flight, comparison)] * _COPIES)
    return [list(each) for each in zip(*copies, strict=True)] if blind else []


def _bounded(noise: StateNoise, view: FlightView, comparison: Comparison, flight: Flight) -> StateNoise:
    settings = Settings(bandwidth=tracing_bandwidth(view.database, view.vehicle, [flight]))
    return bounded_noise(noise, view, comparison, settings, most=_MOST)
