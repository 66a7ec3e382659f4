"""What rising and sinking air does to the estimates.

A path is integrated through air without a vertical motion. Air that rises at w looks like an error
of the angle of attack, ``w / V``: an alpha bias from a single stretch is the vane's only as far as
the air stood still. The air's velocity is a Gauss-Markov process of second order (white noise
through two equal lags) with a time constant: unlike one of first order it has no part as fast as
gusts. Its effect on the least-squares estimates is linear, which gives the covariance that it adds.

How far the air moves is told by the residuals: a flight whose vane follows the motion for a minute
had still air, one whose vane wanders did not, and a short one tells nothing. The standard deviation
is therefore the root of the mean variance given the residuals (linear model with the air's velocity
at knots, the unknowns integrated out), under a half-normal prior of the size that the vehicle file
states. What a path leaves free (the first vertical velocity, where neither altitude nor climb rate
is logged) takes the air up, and nothing else widens.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.consistency.sensors import FlightRecord, parameter, predict_outputs
from aerodb.estimation import samples_per_independent
from aerodb.support import Array
from aerodb.vehicle import VerticalAir

#: Time constants that are summed at once: ``exp`` of them must be a number.
_BLOCK: Final = 50.0

#: Knots of the air's velocity per time constant.
_KNOTS: Final = 3.0

#: Standard deviations tried, in units of that of the prior.
_TRIED: Final = np.geomspace(0.003, 10.0, 60)


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


@dataclass(frozen=True)
class AirColumns:
    """Vertical air of 1 m/s along a record of n samples.

    felt : channel -> (n,), change of the output by the air at that sample, SI per m/s.
    knots : (m,) times [s]. hats : (n, m), weights of the knots at each sample (linear between).
    """

    felt: Mapping[str, Array]
    knots: Array
    hats: Array

    def beside(self, slopes: Mapping[str, Array]) -> dict[str, Array]:
        """Channel -> (n, k + m): derivatives `slopes` (n, k), and those by the air at the knots."""
        return {
            name: np.hstack([slope, self.felt[name][:, None] * self.hats])
            for name, slope in slopes.items()
        }


@dataclass(frozen=True)
class AirSigns:
    """What a record's residuals say of vertical air: normal equations for its k parameters followed
    by the air's velocity at m knots.

    flight : its flight. index : of the k parameters. knots : (m,) times [s].
    information : (k + m, k + m). gradient : (k + m,), with its covariance `spread` (k + m, k + m)
        in still air: noise of the channels as coloured as it is, and the path's drift.
    """

    flight: str
    index: Sequence[int]
    knots: Array
    information: Array
    gradient: Array
    spread: Array


def air_columns(
    record: FlightRecord, values: Mapping[str, float], initial: Array, air: VerticalAir
) -> AirColumns:
    """Return what vertical air does to the outputs of a record.

    record : n samples. values : parameter name -> value, SI. initial : (9,), initial state.
    air : prior, whose time constant spaces the knots.
    """
    by_air = predict_outputs(
        record, values, initial, (parameter("wind_down", record.flight),)
    ).slopes
    n = len(record.inputs)
    time = record.start + record.step * np.arange(n)
    pieces = int(np.ceil((n - 1) * record.step * _KNOTS / air.time))
    knots = np.linspace(time[0], time[-1], pieces + 1)
    hats = np.column_stack([np.interp(time, knots, row) for row in np.eye(len(knots))])
    return AirColumns({name: slope[:, 0] for name, slope in by_air.items()}, knots, hats)


def pull_and_signs(
    record: FlightRecord,
    columns: AirColumns,
    slopes: Mapping[str, Array],
    errors: Mapping[str, Array],
    usable: Mapping[str, NDArray[np.bool_]],
    noise: Mapping[str, float],
    drift: Array,
    index: Sequence[int],
) -> tuple[Pull, AirSigns]:
    """Return what vertical air does to the k parameters of one record, and what its residuals say
    of it.

    Parameters
    ----------
    record : n samples.
    columns : what vertical air does to its outputs.
    slopes : channel -> (n, k + m), from `AirColumns.beside`.
    errors : channel -> (n,), measured minus reconstructed, SI. usable : channel -> (n,).
    noise : channel -> variance, SI.
    drift : (k + m, k + m), `input_noise.drift_information` of these slopes.
    index : numbers of the k parameters in the problem.
    """
    n, m = columns.hats.shape
    k = len(index)
    total, gradient = np.zeros((n, k)), np.zeros(k + m)
    information, spread = np.zeros((k + m, k + m)), drift.copy()
    for name, slope in slopes.items():
        good = usable[name]
        total += slope[:, :k] * (columns.felt[name] * good / noise[name])[:, None]
        error, part = errors[name][good], slope[good]
        if len(error) > m:
            known = part.T @ part / noise[name]
            coloured = _independent_variance(error, columns.hats[good]) / noise[name]
            information += known
            spread += coloured * known
            gradient += part.T @ error / noise[name]
    flight, end = record.flight.partition("#")[0], record.start + (n - 1) * record.step
    return (
        Pull(flight, record.start, end, record.step, index, total),
        AirSigns(flight, index, columns.knots, information, gradient, spread),
    )


def _independent_variance(error: Array, hats: Array) -> float:
    """Variance of white noise with the information of the residual (n,) without what it has at the
    knots (n, m)."""
    left = error - hats @ np.linalg.lstsq(hats, error)[0]
    return max(float(np.mean(left**2)) * samples_per_independent(left), 1e-30)


def air_deviation(
    signs: Sequence[AirSigns], vector: Array, prior: Array, air: VerticalAir
) -> float:
    """Standard deviation of the air's vertical velocity given the residuals, m/s.

    The root of the mean variance under the posterior of the standard deviation: half-normal prior
    with ``air.sigma``, likelihood of the residuals with unknowns and velocities integrated out.

    signs : of the records. vector : (k,) unknowns. prior : (k,) their standard deviations about
    zero (inf: no prior). air : prior.
    """
    k, m = len(prior), sum(len(each.knots) for each in signs)
    known, spread = (np.zeros((k + m, k + m)) for _ in range(2))
    known[:k, :k] = spread[:k, :k] = np.diag(prior**-2.0)
    push = np.concatenate([-vector / prior**2, np.zeros(m)])
    time, flights = np.zeros(m), np.zeros(m, dtype=int)
    numbers = {flight: number for number, flight in enumerate({each.flight for each in signs})}
    at = 0
    for each in signs:
        here = np.arange(at, at + len(each.knots))
        index = np.concatenate([np.array(each.index, dtype=int), k + here])
        known[np.ix_(index, index)] += each.information
        spread[np.ix_(index, index)] += each.spread
        push[index] += each.gradient
        time[here], flights[here] = each.knots, numbers[each.flight]
        at += len(each.knots)
    # what the air's velocities change once the unknowns have followed
    size = 1.0 / np.sqrt(np.diag(known)[:k])
    gain = np.linalg.solve(known[:k, :k] * np.outer(size, size), known[:k, k:] * size[:, None])
    left = np.vstack([-gain * size[:, None], np.eye(m)])
    seen, information, noise = left.T @ push, known[k:] @ left, left.T @ spread @ left
    apart = np.abs(time[:, None] - time) / air.time
    shape = (1.0 + apart) * np.exp(-apart) * (flights[:, None] == flights)
    root = np.linalg.cholesky(noise + 1e-9 * np.trace(noise) / m * np.eye(m))
    white = np.linalg.solve(root, np.column_stack([information, seen]))
    strength, turn = np.linalg.eigh(white[:, :-1] @ shape @ white[:, :-1].T)
    sizes = (turn.T @ white[:, -1]) ** 2
    sigma = air.sigma * _TRIED
    grown = 1.0 + np.outer(sigma**2, np.maximum(strength, 0.0))
    fit = -0.5 * np.sum(np.log(grown) + sizes / grown, axis=1)
    weight = fit - 0.5 * _TRIED**2 + np.log(sigma)  # the last: equal steps of the logarithm
    weight = np.exp(weight - weight.max())
    return float(np.sqrt(np.sum(weight * sigma**2) / np.sum(weight)))


def air_information(pulls: Sequence[Pull], air: VerticalAir, k: int) -> Array:
    """Covariance (k, k) that vertical air adds to the right-hand side of the normal equations.

    ``sum_ij a_i' r(t_i - t_j) a_j`` over all samples of a flight, with the autocovariance ``r(t) =
    sigma^2 (1 + |t| / time) exp(-|t| / time)``; flights are independent.

    pulls : of the records. air : prior. k : number of unknowns.

    air.sigma [m/s], air.time [s].
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
