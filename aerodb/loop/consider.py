"""Consider parameters: errors of sensors that the reconstruction of flights leaves open, and those
of vehicle data as well as they were measured.

What is estimated from these flights does not estimate them, but carries their uncertainty (consider
covariance: Bierman, *Factorization Methods*, 1977, chapter VIII).
"""

from collections.abc import Collection, Mapping, Sequence

from aerodb.coefficients import Comparison
from aerodb.consistency import StateNoise
from aerodb.effects import ERROR_COLUMNS, FlightView, hypotheses_for, view_of, with_wind
from aerodb.flight import Flight
from aerodb.increments import ConsiderParameter
from aerodb.loop.angle_errors import alpha_consider_parameters
from aerodb.loop.flight_source import ReconstructionErrors
from aerodb.tables import AeroDatabase
from aerodb.tracing import TracingSettings, bounded_noise, noisy_copies, tracing_bandwidth
from aerodb.vehicle import Vehicle

#: Times the smoother's power that the error of alpha may have where the residual allows it: gusts
#: that nobody saw.
_MOST = 10.0
#: Copies of the flights with their states' error once more.
_COPIES = 4


def consider_parameters(
    reconstructions: Mapping[str, ReconstructionErrors],
    vehicle: Vehicle,
    database: AeroDatabase,
    flights: Sequence[Flight],
    comparisons: Sequence[Comparison],
) -> dict[str, tuple[ConsiderParameter, ...]]:
    """Return, for each flight, the sensor errors that its reconstruction leaves open, and those of
    the vehicle data that the vehicle file states in ``[measured]``.

    Errors that a flight estimated for itself are its own; those of a calibration, or known from the
    vehicle file only, are common to all flights. reconstructions : by flight (its id). Sizes are in
    the SI unit of each error [rad], [Pa], [s]; Bierman (1977), chapter VIII.
    """
    parameters: dict[str, tuple[ConsiderParameter, ...]] = {}
    for flight, comparison in zip(flights, comparisons, strict=True):
        reconstruction = reconstructions[flight.id]
        noise, errors = reconstruction.noise, reconstruction.errors
        if vehicle.measured:
            view = view_of(flight, comparison, database, vehicle)
            parameters[flight.id] = stated_consider_parameters(view)
        if noise is not None:
            late = {
                f"{name}_delay": s.delay_prior
                for name, s in vehicle.sensors.items()
                if f"{name}_delay" not in errors
            }
            sigma = {
                **errors,
                **late,
                **{f"{name}_bias": size for name, size in noise.offset.items()},
            }
            own = [] if reconstruction.calibrated else list(reconstruction.applied)
            view = view_of(flight, comparison, database, vehicle)
            parameters[flight.id] = (
                *sensor_consider_parameters(view, sigma, own),
                *parameters.get(flight.id, ()),
            )
            if "alpha" in reconstruction.angles:
                parameters[flight.id] += alpha_consider_parameters(view, _bounded(noise, view))
    return parameters


def stated_consider_parameters(view: FlightView) -> tuple[ConsiderParameter, ...]:
    """Consider parameters for mass properties, thrust and deflections, which are as wrong as the
    vehicle file says (``[measured]``) and common to all flights.

    Columns are (n,), sizes in the unit of each error.
    """
    library = hypotheses_for(view.database, view.vehicle, frozenset(view.channels))
    return tuple(
        ConsiderParameter(each.id, each.prior_sigma, True, with_wind(view, each.columns(view)))
        for each in library
        if each.known_by and each.prior_sigma and each.parameter not in ERROR_COLUMNS
    )


def sensor_consider_parameters(
    view: FlightView, sigma: Mapping[str, float], own: Collection[str] = ()
) -> tuple[ConsiderParameter, ...]:
    """Consider parameters for the sensor errors left in one flight.

    Parameters
    ----------
    sigma : ``<channel>_bias`` and ``<angle>_delay`` -> standard error of what remains of it, SI.
    own : names of errors of this flight alone; all others are common to all flights of the vehicle,
        like that of a calibration.
    """
    parameters = []
    for name, columns in ERROR_COLUMNS.items():
        channel = name.rpartition("_")[0]
        if sigma.get(name, 0.0) > 0 and (
            channel in view.channels or f"{channel}_imu" in view.channels
        ):
            parameters.append(
                ConsiderParameter(
                    name, sigma[name], name not in own, with_wind(view, columns(view))
                )
            )
    return tuple(parameters)


def noisier_flights(
    reconstructions: Mapping[str, ReconstructionErrors],
    vehicle: Vehicle,
    database: AeroDatabase,
    flights: Sequence[Flight],
    comparisons: Sequence[Comparison],
) -> list[list[tuple[Flight, Comparison]]]:
    """Return copies of all flights, with the state noise added once more where alpha was
    reconstructed.

    Empty where no alpha was. reconstructions : by flight (its id). Channels are (n,), in SI units;
    Cook & Stefanski (1994).
    """
    copies: list[list[tuple[Flight, Comparison]]] = []
    blind = False
    for flight, comparison in zip(flights, comparisons, strict=True):
        reconstruction = reconstructions[flight.id]
        if reconstruction.noise is not None and "alpha" in reconstruction.angles:
            blind = True
            view = view_of(flight, comparison, database, vehicle)
            bounded = _bounded(reconstruction.noise, view)
            copies.append(noisy_copies(flight, bounded, database, vehicle, _COPIES))
        else:
            copies.append([(flight, comparison)] * _COPIES)
    return [list(each) for each in zip(*copies, strict=True)] if blind else []


def _bounded(noise: StateNoise, view: FlightView) -> StateNoise:
    bandwidth = tracing_bandwidth(view.database, view.vehicle, [view.recorded])
    settings = TracingSettings(bandwidth=bandwidth)
    return bounded_noise(noise, view, settings, most=_MOST)
