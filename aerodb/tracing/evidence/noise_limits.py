"""How large the error of a reconstructed flow angle can be: no larger than what it would leave in
the residual.

Without a vane nobody saw the gusts; the smoother then allows for all that could have been there.
But an angle that is wrong by e moves the prediction by ``dC/dalpha e``, on every axis that depends
on it, and whatever else is wrong comes on top: where the residual of one axis has less power than
that, the error is smaller. The bound of errors in variables (Klepper & Leamer, Econometrica 52(1),
1984), one-sided: a residual that a lacking effect makes larger only loosens it.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.consistency import StateNoise
from aerodb.effects import FlightView
from aerodb.nomenclature import AXES
from aerodb.support import Array
from aerodb.tracing.evidence.low_pass import band_limited, stretches
from aerodb.tracing.settings import TracingSettings


def bounded_noise(
    noise: StateNoise,
    view: FlightView,
    comparison: Comparison,
    settings: TracingSettings,
    most: float = 1.0,
) -> StateNoise:
    """The noise with the density of alpha no larger than the flight's residual allows.

    view, comparison : of the flight beside the current model. most : times the power that the
    smoother states; beyond 1 where all that the residual allows is to count, since of gusts that
    nobody saw the smoother may state too little. What is constant over the flight stays: trims take
    it. So does the noise of beta: of the horizontal gusts the airspeed says how strong they are, of
    the vertical ones without a vane nothing.
    """
    if "alpha" not in noise.density:
        return noise
    power = noise.rms("alpha", noise.edges[0], settings.bandwidth) ** 2
    share = min(
        most, _share(power, view.slope("alpha"), _residual_power(comparison, view.step, settings))
    )
    return replace(
        noise,
        density={
            **noise.density,
            "alpha": tuple(share * density for density in noise.density["alpha"]),
        },
    )


def _share(power: float, slopes: Mapping[str, Array], residual: Mapping[str, float]) -> float:
    """How often the angle's error power (rad^2) the axis allows that allows least of it; 1 where
    none depends on the angle."""
    caused = {
        axis: power * float(np.mean(np.square(slopes[axis]))) for axis in residual if axis in slopes
    }
    return min(
        (residual[axis] / caused[axis] for axis in caused if caused[axis] > 0.0), default=1.0
    )


def _residual_power(
    comparison: Comparison, step: float, settings: TracingSettings
) -> dict[str, float]:
    """Axis -> mean square of the residual about its level in the band of tracing; axes without a
    usable stretch are absent."""
    power = {}
    for axis in (axis for axis in AXES if axis in comparison.usable):
        usable = comparison.usable[axis]
        values = np.nan_to_num(comparison.residual(axis))
        parts = [
            band_limited([values[part]], usable[part], step, settings.bandwidth)
            for part in stretches(usable, step, settings.bandwidth, settings.order)
        ]
        if parts:
            power[axis] = float(np.concatenate(parts).var())
    return power
