"""What rising and sinking air does to the estimates.

A path is integrated through air without a vertical motion. Air that rises at w looks like an error
of the angle of attack, ``w / V``: an alpha bias from a single stretch is the vane's only as far as
the air stood still. The air's velocity is a Gauss-Markov process of second order (white noise
through two equal lags), with a stated standard deviation and time constant: unlike one of first
order it has no part as fast as gusts, which the residuals show. Its effect on the least-squares
estimates is linear, which gives the covariance that it adds. What a path leaves free (the first
vertical velocity, where neither altitude nor climb rate is logged) takes the air up, and nothing
else widens.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.consistency.output_error.normal_equations import usable_samples
from aerodb.consistency.sensors import Parameter, Record, Response, parameter, predict_outputs
from aerodb.support import Array
from aerodb.vehicle import VerticalAir

#: Time constants that are summed at once: ``exp`` of them must be a number.
_BLOCK: Final = 50.0


@dataclass(frozen=True)
class Pull:
    """What vertical air of 1 m/s at each sample adds to the gradient of a record's cost.

    flight : its flight. start, end : times of its first and last sample [s]. step : [s].
    index : of the k parameters that act on the record. by_sample : (n, k).
    """

    flight: str
    start: float
    end: float
    step: float
    index: Sequence[int]
    by_sample: Array


def pull(
    record: Record,
    values: Mapping[str, float],
    initial: Array,
    unknowns: Sequence[Parameter],
    index: Sequence[int],
    response: Response,
    noise: Mapping[str, float],
) -> Pull:
    """The `Pull` on the parameters of one record.

    Parameters
    ----------
    record : n samples.
    values : parameter name -> value, SI.
    initial : (9,), initial state.
    unknowns : the k parameters of this record. index : their numbers in the problem.
    response : outputs with their derivatives by the unknowns.
    noise : channel -> variance, SI.
    """
    air = parameter("wind_down", record.flight)
    by_air = predict_outputs(record, values, initial, (air,)).slopes
    total = np.zeros((len(record.inputs), len(unknowns)))
    for name, slope in response.slopes.items():
        felt = by_air[name][:, 0]
        if felt.any():
            good = usable_samples(record, name, unknowns, values)
            total += slope * (felt * good / noise[name])[:, None]
    end = record.start + (len(record.inputs) - 1) * record.step
    return Pull(record.flight.partition("#")[0], record.start, end, record.step, index, total)


def air_information(pulls: Sequence[Pull], air: VerticalAir, k: int) -> Array:
    """Covariance (k, k) that vertical air adds to the right-hand side of the normal equations.

    ``sum_ij a_i' r(t_i - t_j) a_j`` over all samples of a flight, with the autocovariance ``r(t) =
    sigma^2 (1 + |t| / time) exp(-|t| / time)``; flights are independent.

    pulls : of the records. air : prior. k : number of unknowns.
    """
    total = np.zeros((k, k))
    for flight in dict.fromkeys(each.flight for each in pulls):
        own = sorted((each for each in pulls if each.flight == flight), key=lambda one: one.start)
        near, far, until = np.zeros(k), np.zeros(k), 0.0
        for each in own:
            a = np.zeros((len(each.by_sample), k))
            a[:, list(each.index)] = each.by_sample
            past, later = _faded(a, each.step / air.time), _faded(a[::-1], each.step / air.time)
            total += a.T @ (past.sum(axis=0) + later.sum(axis=0)[::-1] - a)
            # with the records before it: near and far are the sums over these, at their end
            gap = max(each.start - until, 0.0) / air.time
            ahead, beyond = later[:, -1]
            across = np.outer((1.0 + gap) * near + far, ahead) + np.outer(near, beyond)
            total += np.exp(-gap) * (across + across.T)
            passed = gap + (each.end - each.start) / air.time
            near, far = (
                np.exp(-passed) * near + past[0, -1],
                np.exp(-passed) * (far + passed * near) + past[1, -1],
            )
            until = each.end
    return np.asarray(air.sigma**2 * total)


def _faded(a: Array, step: float) -> Array:
    """(2, n, k) sums over the samples up to each, of a (n, k) weighted with ``exp(-t)`` and with
    ``t exp(-t)``, for a time t since the sample in units of the time constant, as `step` is."""
    block = max(1, int(_BLOCK / step))
    sums = np.empty((2, *a.shape))
    near, far = np.zeros(a.shape[1]), np.zeros(a.shape[1])
    for start in range(0, len(a), block):
        part = a[start : start + block]
        passed = step * np.arange(1, len(part) + 1)[:, None]  # since the sample before the block
        grown = np.exp(passed) * part
        own = np.cumsum(grown, axis=0) + near
        late = passed * own - np.cumsum(passed * grown, axis=0) + far
        sums[:, start : start + block] = np.exp(-passed) * np.stack([own, late])
        near, far = sums[:, start + len(part) - 1]
    return sums
