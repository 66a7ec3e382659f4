"""What flight-path reconstruction leaves open of a sensor bounds what tracing may blame on it.

Reconstruction compares sensors with the motion, not with the aerodynamic model. A vane whose scale
it knows to one per cent cannot explain a lift slope that is wrong by fifteen; an accelerometer
whose bias it has estimated cannot be off by ten times the standard error of that estimate. The
remaining error becomes the prior of the sensor's parameter, and three times it its believable range
(docs/method/tracing.md, section 4).
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.measurement.sensor import BELIEVED
from aerodb.effects.measurement.sensor_flow_angles import NATURAL_ANGLE_ERRORS, WORDS
from aerodb.support import Array

#: Smallest remaining error of a flow angle, as a part of its natural size: the flow at a probe is
#: not exactly linear in the angle.
_LEAST: Final = 0.25


def within_reconstruction_accuracy(
    hypotheses: Iterable[Hypothesis],
    known: Sequence[Mapping[str, tuple[float, float]]],
    independent: bool = True,
) -> tuple[Hypothesis, ...]:
    """Narrow priors and believable ranges of sensor errors to what reconstruction leaves open.

    Scales and delays are the same in all flights: their estimates are averaged. Biases are each
    flight's own: the least certain flight counts. An error that not all flights know keeps its
    range.

    Parameters
    ----------
    known : per flight, sensor parameter -> error that its channels still have, and its standard
        error, SI.
    independent : whether the flights' estimates are; not if they share a calibration.
    """
    common = set[str]().union(*known).intersection(*known)
    remaining = {}
    for name in common:
        values, errors = np.array([flight[name] for flight in known]).T
        shared = independent and name.endswith(("_scale", "_delay"))
        remaining[name] = (
            _of_mean(values, errors) if shared else float(np.hypot(values, errors).max())
        )
    return tuple(
        _narrowed(hypothesis, remaining.get(hypothesis.parameter)) for hypothesis in hypotheses
    )


def _of_mean(values: Array, errors: Array) -> float:
    """Size of an error that is common to flights (n,), one sigma: of the weighted mean of their
    estimates and its standard error, which the estimates' scatter may enlarge (Birge 1932)."""
    weights = 1.0 / np.maximum(errors, 1e-12) ** 2
    mean = float(weights @ values / weights.sum())
    scatter = float(weights @ (values - mean) ** 2) / max(len(values) - 1, 1)
    return float(np.hypot(mean, np.sqrt(max(scatter, 1.0) / weights.sum())))


def _narrowed(hypothesis: Hypothesis, sigma: float | None) -> Hypothesis:
    if sigma is None or hypothesis.prior_sigma is None:
        return hypothesis
    angle, _, kind = hypothesis.parameter.partition("_")
    if angle in WORDS and kind in NATURAL_ANGLE_ERRORS:
        sigma = max(sigma, _LEAST * NATURAL_ANGLE_ERRORS[kind])
    low, high = hypothesis.plausible
    if BELIEVED * sigma >= min(-low, high):
        return hypothesis
    return replace(
        hypothesis,
        plausible=(max(low, -BELIEVED * sigma), min(high, BELIEVED * sigma)),
        prior_sigma=min(hypothesis.prior_sigma, sigma),
        known_by="the flight-path reconstruction",
    )
