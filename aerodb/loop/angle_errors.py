"""Errors in variables: uncertainty that a reconstructed alpha adds to declared increments.

An angle reconstructed from the motion has an error e of its own. No residual shows its three
consequences. The estimates follow e, which varies slowly and independently in each flight. The
angle has a scale error where the airspeed has one, in all flights alike. And a coefficient whose
regressor is in error is attenuated, its neighbours taking up the difference (Fuller, *Measurement
Error Models*, 1987, section 2.2); estimates from flights with e added once more are off by as much
again (SIMEX; Cook & Stefanski, JASA 89, 1994).
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.consistency import StateNoise
from aerodb.effects import NATURAL_ANGLE_ERRORS, FlightView, predicted_change, with_wind
from aerodb.increments import AxisUpdate, ConsiderParameter, Update, correlation_of
from aerodb.support import Array
from aerodb.tables import AeroDatabase, parameter_covariance, with_parameter_covariance

#: Realisations of e that represent its covariance.
_DRAWS: Final = 16


def alpha_consider_parameters(view: FlightView, noise: StateNoise) -> tuple[ConsiderParameter, ...]:
    """The doubts in what one flight with a reconstructed alpha gives: in proportion, and in
    `_DRAWS` realisations of e.

    noise : of the flight's channels, that of alpha no larger than its residual allows
    (`aerodb.tracing.evidence.noise_limits`).
    """
    if "alpha" not in noise.density:
        return ()

    def doubt(name: str, sigma: float, shared: bool, error: Array) -> ConsiderParameter:
        return ConsiderParameter(
            name, sigma, shared, with_wind(view, predicted_change(view, alpha=error))
        )

    generator = np.random.default_rng(
        int.from_bytes(view.flight.encode()[:8].ljust(8, b"0"), "big")
    )
    drawn = [noise.draw(generator, len(view.time), view.step)["alpha"] for _ in range(_DRAWS)]
    return (
        doubt("alpha_scale", NATURAL_ANGLE_ERRORS["scale"], True, view["alpha"]),
        *(
            doubt(f"alpha_{number}", _DRAWS**-0.5, False, error)
            for number, error in enumerate(drawn)
        ),
    )


def with_attenuation(update: Update, noisier: Sequence[Update], factor: float) -> Update:
    """The update with the doubt that errors in its regressors have flattened it.

    noisier : the same estimated from the same flights with their states' error once more. `factor`
    times their mean distance is one standard error, of all estimates of an axis together.
    """
    if not noisier:
        return update
    if update.parameters:
        return replace(update, candidate=_shifted(update, noisier, factor))
    first = len(update.candidate.increments) - len(update.axes)
    kept, added = update.candidate.increments[:first], update.candidate.increments[first:]
    axes = tuple(
        _flattened(axis, [other.axes[number] for other in noisier], factor)
        for number, axis in enumerate(update.axes)
    )
    increments = tuple(
        replace(inc, covariance=axis.covariance) for inc, axis in zip(added, axes, strict=True)
    )
    return replace(
        update, axes=axes, candidate=replace(update.candidate, increments=(*kept, *increments))
    )


def _shifted(update: Update, noisier: Sequence[Update], factor: float) -> AeroDatabase:
    """The database with the doubt in the errors of its parameters."""
    names, database = update.parameters, update.candidate
    moved = np.array(
        [
            np.mean([other.candidate.parameters[name] for other in noisier])
            - database.parameters[name]
            for name in names
        ]
    )
    return with_parameter_covariance(
        database, names, parameter_covariance(database, names) + factor**2 * np.outer(moved, moved)
    )


def _flattened(axis: AxisUpdate, noisier: Sequence[AxisUpdate], factor: float) -> AxisUpdate:
    """One axis with the doubt; a term that a noisier estimate lacks has moved by nothing there."""
    moved = np.zeros(len(axis.names))
    for other in noisier:
        other_estimates = dict(zip(other.names, other.estimates, strict=True))
        moved += [
            (other_estimates.get(name, value) - value) / len(noisier)
            for name, value in zip(axis.names, axis.estimates, strict=True)
        ]
    covariance = axis.covariance + factor**2 * np.outer(moved, moved)
    return replace(
        axis,
        covariance=covariance,
        standard_errors=np.sqrt(np.diag(covariance)),
        correlation=correlation_of(covariance),
    )
