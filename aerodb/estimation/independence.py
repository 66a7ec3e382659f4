"""Whether residuals are independent of the inputs: a model that explains the whole response to an
input leaves nothing of that input in its residuals."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.special import ndtr

from aerodb.estimation.coloured_noise import NoiseModel, autoregressive_noise
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array

#: Of the motion of an input.
Part = Literal["all", "first half", "second half"]
#: Probability that the largest of all lags of independent residuals is within its bound.
_LEVEL: Final = 0.95
#: More standard deviations than any bound.
_FAR: Final = 40.0
#: Probability below which chance does not explain the correlations of a fit.
_CHANCE: Final = 0.01
#: Longest lag, as a share of the shortest record.
_SHARE = 0.25
#: Fewest lags.
_FEWEST = 4


@dataclass(frozen=True)
class InputCorrelation:
    """Correlation of a residual with an input before it, where it is furthest from zero.

    Parameters
    ----------
    output, input : names.
    correlation : coefficient, -1 to 1.
    lag : how much earlier the input is [s].
    bound : that independent residuals stay within at all lags with a probability of 95 %.
    p_value : probability of so large a correlation at any lag if they were independent.
    part : of the input's motion, all of it or half. Where only halves are correlated, the response
        changes: the errors of a parameter in between cancel over the whole.
    """

    output: str
    input: str
    correlation: float
    lag: float
    bound: float
    p_value: float
    part: Part = "all"


def dependent(correlations: Sequence[InputCorrelation]) -> tuple[InputCorrelation, ...]:
    """Return the correlations (dimensionless scalars) that chance does not explain, however many
    were looked at (Bonferroni): those with the whole motion of an input first, then the least
    likely."""
    found = list[InputCorrelation]()
    for halves in (False, True):
        family = [each for each in correlations if (each.part != "all") is halves]
        likely = [each for each in family if each.p_value * len(family) < _CHANCE]
        found += sorted(likely, key=lambda each: each.p_value)
    return tuple(found)


def input_correlations(
    residuals: Mapping[str, Mapping[str, Array]], records: Sequence[TimeHistory]
) -> tuple[InputCorrelation, ...]:
    """Correlation of each residual with each input that moves, over all records, and with the first
    and the second half of its motion (of its power, in the order of the records).

    The bound holds for residuals that are coloured: their spectrum is that of an autoregressive
    model. Lags begin at one sample, because a controller that responds at once brings the noise of
    the same sample into the input.

    Parameters
    ----------
    residuals : record -> output -> (n,), NaN where not measured.
    records : with the inputs; those without residuals of the same length are left out.

    References
    ----------
    Box, Jenkins & Reinsel, Time Series Analysis, 4th ed., 2008, section 12.3.2. Ljung, System
    Identification, 2nd ed., 1999, section 16.6.
    """
    found = []
    outputs = dict.fromkeys(name for each in residuals.values() for name in each)
    for output in outputs:
        kept = [
            (record, _about_mean(left))
            for record in records
            if (left := residuals.get(record.name, {}).get(output)) is not None
            and len(left) == len(record.time)
        ]
        noise = autoregressive_noise([left for _, left in kept])
        for name in dict.fromkeys(name for record, _ in kept for name in record.inputs):
            whole = [_about_mean(record.inputs[name]) for record, _ in kept]
            for part, moved in _parts(whole).items():
                pairs = [(*both, own) for both, own in zip(kept, moved, strict=True)]
                correlation = _furthest(output, name, part, pairs, noise)
                if correlation is not None:
                    found.append(correlation)
    return tuple(found)


def _parts(whole: Sequence[Array]) -> dict[Part, list[Array]]:
    """The motion of an input (n,) in each record: all, and its halves, zero elsewhere."""
    power = np.cumsum(np.concatenate([values**2 for values in whole]))
    first = power <= 0.5 * power[-1]
    edges = np.cumsum([len(values) for values in whole])[:-1]
    early = np.split(first, edges)
    return {
        "all": list(whole),
        "first half": [np.where(e, v, 0.0) for e, v in zip(early, whole, strict=True)],
        "second half": [np.where(e, 0.0, v) for e, v in zip(early, whole, strict=True)],
    }


def _about_mean(values: Array) -> Array:
    """Values about the mean of those there are; 0 where there is none."""
    good = np.isfinite(values)
    return np.where(good, values - values[good].mean() if good.any() else 0.0, 0.0)


def _furthest(
    output: str,
    name: str,
    part: Part,
    pairs: Sequence[tuple[TimeHistory, Array, Array]],
    noise: NoiseModel,
) -> InputCorrelation | None:
    """The correlation at the lag where it is largest; None where residual or input stand still."""
    step = max(record.step for record, _, _ in pairs)
    most = min(float(record.time[-1] - record.time[0]) for record, _, _ in pairs) * _SHARE
    lags = step * np.arange(1, int(most / step) + 1)
    size = np.sqrt(sum(float(left @ left) for _, left, _ in pairs))
    size *= np.sqrt(sum(float(moved @ moved) for _, _, moved in pairs))
    if len(lags) < _FEWEST or not size > 0.0:
        return None
    products, covariance = np.zeros(len(lags)), np.zeros((2, 2))
    for record, left, moved in pairs:
        at = np.arange(len(moved)) * record.step
        products += np.interp(lags, at, _products(left, moved))
        covariance += noise.summed(np.column_stack([moved[1:], moved[:-1]]))
    from scipy.optimize import brentq  # slow to import

    neighbours = covariance[0, 1] / np.sqrt(covariance[0, 0] * covariance[1, 1])
    crossings = len(lags) * float(np.arccos(min(neighbours, 1.0))) / np.pi
    deviation = float(np.sqrt(covariance[0, 0]))
    tests = len(lags)
    within = brentq(lambda z: _exceeded(z, crossings, tests) - (1.0 - _LEVEL), 0.0, _FAR)
    k = int(np.argmax(np.abs(products)))
    return InputCorrelation(
        output,
        name,
        correlation=float(products[k] / size),
        lag=float(lags[k]),
        bound=within * deviation / float(size),
        p_value=min(1.0, _exceeded(float(abs(products[k])) / deviation, crossings, tests)),
        part=part,
    )


def _exceeded(size: float, crossings: float, tests: int) -> float:
    """Probability, where it is small, that a normal process of unit variance exceeds a size at one
    of so many samples, among which it is expected to cross zero so often: Rice's formula (Bell
    System Technical Journal 24, 1945), or Bonferroni's where that is less."""
    alone = 2.0 * float(ndtr(-size))
    return float(min(tests * alone, alone + crossings * np.exp(-0.5 * size**2)))


def _products(later: Array, earlier: Array) -> Array:
    """``sum_t later(t) earlier(t - k)`` for lags k = 0 ... n - 1."""
    size = next_fast_len(2 * len(later))
    spectrum = rfft(later, size) * np.conj(rfft(earlier, size))
    return np.asarray(irfft(spectrum, size)[: len(later)])
