"""Shared parts of the sensor and vehicle-data hypotheses: one parameter that acts on all axes.

A sensor reads ``(1 + scale) true(t - delay) + bias``. A tangent is the derivative of measured -
predicted with respect to such a parameter, through the whole processing chain, at the current
model. Where the measurement itself would appear (a mass error scales it), the prediction of the
model takes its place.
"""

from collections.abc import Callable, Sequence
from functools import reduce

import numpy as np

from aerodb.effects.flight_view import FlightView
from aerodb.effects.hypothesis import Columns, Hypothesis
from aerodb.effects.template import LibraryContext
from aerodb.nomenclature import AXES
from aerodb.signals import smooth
from aerodb.support import Array

#: Largest believable error of what was measured or reconstructed, in standard deviations.
BELIEVED = 3.0


def sensor(
    context: LibraryContext,
    effect: str,
    parameter: str,
    tangent: Callable[[FlightView], Columns],
    *,
    unit: str,
    plausible: tuple[float, float],
    natural: float,
    because: str,
    formula: str,
    needs: tuple[str, ...],
    source: str,
    subject: str = "",
    declared: float = 0.0,
    measured: Sequence[str] = (),
    secant: Callable[[FlightView, float], Columns] | None = None,
) -> Hypothesis:
    """A sensor hypothesis; its sigma is the context's prior for `parameter`, else `declared`, else
    `natural`.

    measured : channels whose size the parameter is an error of. Where the vehicle file states how
    well the parameter itself was measured, or all of them, that is the sigma, and three times it
    the believable range.
    """
    known_by = ""
    itself = context.vehicle.measured.get(parameter)
    stated = [itself] if itself else [context.vehicle.measured.get(name) for name in measured]
    if stated and all(stated):
        largest = max((each for each in stated if each), key=lambda each: each.sigma)
        declared, known_by = largest.sigma, largest.by or "the vehicle file"
        least, most = plausible
        plausible = (max(least, -BELIEVED * declared), min(most, BELIEVED * declared))
    return Hypothesis(
        effect=effect,
        axes=AXES,
        subject=subject,
        parameter=parameter,
        kind="sensor",
        unit=unit,
        plausible=plausible,
        prior_sigma=context.sigma(parameter, declared, natural),
        because=because,
        tangent=tangent,
        secant=secant,
        formula=formula,
        needs=needs,
        source=source,
        known_by=known_by,
    )


def bias_prior(context: LibraryContext, *channels: str) -> float:
    """The first bias prior that the vehicle file declares for one of `channels`, else 0.

    It is in the unit of the channel.
    """
    priors = (
        context.vehicle.sensors[name].bias_prior
        for name in channels
        if name in context.vehicle.sensors
    )
    return next((sigma for sigma in priors if sigma > 0), 0.0)


def delay_prior(context: LibraryContext, channel: str) -> float:
    """The delay prior that the vehicle file declares for `channel`, else 0. It is in seconds."""
    return (
        context.vehicle.sensors[channel].delay_prior if channel in context.vehicle.sensors else 0.0
    )


def predicted_change(view: FlightView, **changes: Array | float) -> dict[str, Array]:
    """Minus what the prediction changes when inputs of the model change by these amounts (each (n,)
    or a number): axis -> (n,).

    Where the log holds no alphadot or betadot, it was made of the angle and changes with it.

    Changes are in SI units, coefficients dimensionless.
    """
    for angle in ("alpha", "beta"):
        if (
            np.ndim(changes.get(angle, 0.0))
            and f"{angle}dot" in view.derived
            and view.slope(f"{angle}dot")
        ):
            changes[f"{angle}dot"] = smooth(
                np.asarray(changes[angle]), view.step, view.bandwidth
            ).rate
    total = {axis: np.zeros(len(view.time)) for axis in AXES}
    for variable, change in changes.items():
        for axis, slope in view.slope(variable).items():
            total[axis] -= slope * change
    return total


def added(*columns: Columns) -> dict[str, Array]:
    """Sum of several sets of columns, axis by axis. Each column is (n,); all are in one unit."""
    return {axis: reduce(np.add, [part[axis] for part in columns]) for axis in AXES}
