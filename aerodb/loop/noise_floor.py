"""The error that the true model would leave on a flight: sensor noise, what flight-path
reconstruction does not know of the state, and what is stated of the vehicle data.

docs/method/updates.md, "Noise floor".
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.coefficients import Comparison, compare, total_coefficients
from aerodb.consistency import StateNoise
from aerodb.effects import view_of
from aerodb.flight import Flight
from aerodb.increments import NoiseFloor
from aerodb.loop.consider import stated_consider_parameters
from aerodb.loop.flight_source import FlightSource, on_each
from aerodb.signals import rms
from aerodb.support import Array
from aerodb.tables import AeroDatabase
from aerodb.tracing import rotating_air, with_deflection_noise
from aerodb.vehicle import Vehicle

#: Realisations of the state noise, as many as tracing draws (`TracingSettings.noisy_copies`).
_DRAWS: Final = 2
#: Samples about the middle of a flight that the state noise is run through: it is stationary.
_MOST: Final = 6000


def noise_floors_of(
    source: FlightSource, flights: Sequence[str], database: AeroDatabase
) -> dict[str, Mapping[str, NoiseFloor]]:
    """Return flight (id) -> axis -> error that remains if `database` is right, dimensionless; see
    `noise_floor_of`."""
    floors = on_each(source, flights, lambda flight: noise_floor_of(source, flight, database))
    return dict(zip(flights, floors, strict=True))


def noise_floor_of(
    source: FlightSource, flight: str, database: AeroDatabase
) -> dict[str, NoiseFloor]:
    """Return axis -> error that remains on a flight (its id) if `database` is right, dimensionless.

    The larger of the sensors' white noise in the measured coefficient and of the state noise run
    through measurement and prediction (which holds both, where reconstruction gives it), with the
    stated noise of deflections and the rotation of gusts. With what the constant errors leave of
    which reconstruction is not sure, and those that the vehicle file states of mass properties,
    thrust and deflections. Raises InputError where the flight lacks what is needed.
    """
    comparison = source.comparison(flight, database)
    white = {
        axis: rms(comparison.sigma[axis][good])
        for axis, good in comparison.usable.items()
        if good.any()
    }
    flown = source.flight(flight)
    noise = with_deflection_noise(
        source.reconstruction(flight).noise, source.vehicle, flown.channels, flown.step
    )
    known = {} if noise is None else state_error(flown, noise, database, source.vehicle)
    view = view_of(flown, comparison, database, source.vehicle)
    stated = stated_consider_parameters(view) if source.vehicle.measured else ()
    return {
        axis: _with_stated(
            _with_white(sigma, known.get(axis)),
            [
                each.sigma * each.columns[axis][comparison.usable[axis]]
                for each in stated
                if axis in each.columns
            ],
        )
        for axis, sigma in white.items()
    }


def _with_white(sigma: float, known: tuple[float, NoiseFloor] | None) -> NoiseFloor:
    moving, constant = (0.0, NoiseFloor(0.0, 0.0)) if known is None else known
    return NoiseFloor(constant.level, float(np.hypot(max(sigma, moving), constant.shape)))


def _with_stated(floor: NoiseFloor, errors: Sequence[Array]) -> NoiseFloor:
    """The floor with errors (n,) of one sigma each, independent of each other."""
    level, shape = (
        float(np.sqrt(own**2 + sum(float(of(error)) for error in errors)))
        for own, of in ((floor.level, lambda e: np.mean(e) ** 2), (floor.shape, np.var))
    )
    return NoiseFloor(level, shape)


def state_error(
    flight: Flight, noise: StateNoise, database: AeroDatabase, vehicle: Vehicle
) -> dict[str, tuple[float, NoiseFloor]]:
    """Return axis -> rms by which measured - predicted changes under the state noise of a flight,
    and under its constant errors, each of one sigma and independent; dimensionless.

    Gusts also turn the air (`rotating_air`): the prediction has its rates, the gyros do not.
    """
    first = max(0, (len(flight.time) - _MOST) // 2)
    part = slice(first, first + _MOST)
    cut = replace(
        flight,
        time=flight.time[part],
        channels={name: values[part] for name, values in flight.channels.items()},
        flags={name: values[part] for name, values in flight.flags.items()},
    )

    def with_errors(flight: Flight, errors: Mapping[str, Array | float]) -> Flight:
        return flight.with_channels({n: flight[n] + e for n, e in errors.items() if n in flight})

    def residuals(
        errors: Mapping[str, Array | float], air: Mapping[str, Array] | None = None
    ) -> Comparison:
        wrong = with_errors(cut, errors)
        measured = total_coefficients(wrong, vehicle)
        felt = with_errors(wrong, air) if air else wrong
        return compare(felt, measured, database, vehicle.reference)

    def draws(of: StateNoise, *seed: int) -> dict[str, Array]:
        drawn = of.draw(np.random.default_rng([*seed]), len(cut.time), cut.step)
        return {name: error - error.mean() for name, error in drawn.items()}

    clean = residuals({})
    air = rotating_air(noise, cut, vehicle.reference.span)
    moving = [
        residuals(draws(noise, number), None if air is None else draws(air, number, 1))
        for number in range(_DRAWS)
    ]
    constant = []
    for name, size in noise.offset.items():
        if name in cut and size > 0.0:
            also = {"qbar": noise.pressure_slope * size} if name == "V" else {}
            constant.append(residuals({name: size, **also}))

    def changes(axis: str, others: Sequence[Comparison]) -> NoiseFloor:
        good, own = clean.usable[axis], clean.residual(axis)
        each = [(other.residual(axis) - own)[good] for other in others]
        return NoiseFloor(
            float(np.sqrt(sum(np.mean(change) ** 2 for change in each))),
            float(np.sqrt(sum(np.var(change) for change in each))),
        )

    return {
        axis: (changes(axis, moving).total / np.sqrt(_DRAWS), changes(axis, constant))
        for axis, good in clean.usable.items()
        if good.any()
    }
