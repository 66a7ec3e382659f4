"""What the reconstruction of flights leaves uncertain, as doubt in the increments that are estimated from them."""

from collections.abc import Sequence

from aerodb.coefficients import Comparison
from aerodb.consistency import StateNoise
from aerodb.effects import FlightView, doubts, doubts_of_alpha, view_of
from aerodb.flight import Flight
from aerodb.increments import Doubt
from aerodb.tables import AeroDatabase
from aerodb.tasks.steps import load_consistent, noise_of, reconstructed_angles
from aerodb.tasks.workspace_access import Stores
from aerodb.tracing import Settings, bounded_noise, noisy_copies, tracing_bandwidth
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
