"""Combine a flight's sensor estimates with their priors, and select the significant ones.

Estimates are normal variables with a covariance for coloured residuals. Priors are applied to these
and not as weights in the search: its weights assume white residuals, are too large where gusts or
drift colour them, and would outweigh any calibration sheet.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.special import chdtrc

from aerodb.consistency.calibration import Calibration
from aerodb.consistency.plan import TRUST, ReconstructionPlan
from aerodb.consistency.reconstructed import Estimate, Reconstruction
from aerodb.consistency.sensors import parameter
from aerodb.remarks import SENSOR_ERROR, Remark
from aerodb.support import DIFFERENCE, Array, Dual, dead_zone, standard_errors
from aerodb.vehicle import Accuracy

#: Smallest distance from zero, in standard errors, of a correction without a stated prior.
SIGNIFICANT = standard_errors(DIFFERENCE)

#: Largest ratio of standard error to prior of an estimate that is worth applying.
WORTH = 0.7

#: Smallest effect of a correction without a stated prior, as a fraction of the accuracy limit.
MATTERS = 0.03


@dataclass(frozen=True)
class SensorEstimates:
    """Estimates of k sensor parameters: `names`, `values` (k,) and `covariance` (k, k), SI."""

    names: tuple[str, ...]
    values: Array
    covariance: Array

    @property
    def standard_errors(self) -> Array:
        """(k,) standard errors, SI."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))

    @property
    def by_name(self) -> dict[str, tuple[float, float]]:
        """Name -> (value, standard error), SI."""
        pairs = zip(self.values.tolist(), self.standard_errors.tolist(), strict=True)
        return dict(zip(self.names, pairs, strict=True))

    def only(self, names: Iterable[str]) -> "SensorEstimates":
        """The estimates of those of these parameters that it has, in their order, the others
        integrated out: values (j,), covariance (j, j), SI."""
        index = [self.names.index(name) for name in names if name in self.names]
        return SensorEstimates(
            tuple(self.names[number] for number in index),
            self.values[index],
            self.covariance[np.ix_(index, index)],
        )

    def updated(
        self, names: tuple[str, ...], values: Array, covariance: Array
    ) -> "SensorEstimates":
        """The estimates updated (Kalman update) by independent values of some of the parameters.

        values : (m,), SI. covariance : (m, m). Joseph's form keeps the variances positive. Raises
        ValueError for a name that it does not have.
        """
        index = [self.names.index(name) for name in names]
        across = self.covariance[:, index]
        gain = across @ np.linalg.inv(self.covariance[np.ix_(index, index)] + covariance)
        # Joseph's form: no variance becomes negative by rounding
        kept = np.eye(len(self.names))
        kept[:, index] -= gain
        spread = kept @ self.covariance @ kept.T + gain @ covariance @ gain.T
        return SensorEstimates(
            self.names,
            self.values + gain @ (values - self.values[index]),
            0.5 * (spread + spread.T),
        )

    def conditioned_on_zero(self, name: str) -> "SensorEstimates":
        """The other parameters' estimates, conditioned on this one being zero.

        Of k parameters k - 1 are left, covariance (k - 1, k - 1), SI. Raises ValueError for a name
        that it does not have.
        """
        gone = self.names.index(name)
        gain = self.covariance[:, gone] / self.covariance[gone, gone]
        rest = [number for number in range(len(self.names)) if number != gone]
        values, spread = (
            self.values - gain * self.values[gone],
            self.covariance - np.outer(gain, self.covariance[gone]),
        )
        return SensorEstimates(
            tuple(self.names[number] for number in rest), values[rest], spread[np.ix_(rest, rest)]
        )


def shared_estimates(result: Reconstruction, still: bool = False) -> SensorEstimates:
    """Return the sensor parameters of a reconstruction, winds and first states integrated out.

    Of k parameters: values (k,), covariance (k, k), in SI units. still : with the covariance that
    they had in air without vertical motion.
    """
    index = [number for number, entry in enumerate(result.estimates) if not entry.parameter.scope]
    chosen = [result.estimates[number] for number in index]
    values = np.array([entry.value for entry in chosen])
    return SensorEstimates(
        tuple(entry.parameter.name for entry in chosen),
        values,
        (result.still if still else result.covariance)[np.ix_(index, index)],
    )


def with_vehicle_priors(estimates: SensorEstimates, stated: Mapping[str, float]) -> SensorEstimates:
    """The estimates updated by the vehicle file's priors (name -> one sigma about zero, SI).

    Where the file states none, the prior is the natural size: what a serviceable sensor may have,
    not what anybody has measured of this one. A flight that finds a bias beyond that size by more
    than its standard error speaks for itself: the variance of the prior is then the one that makes
    the estimate most likely, ``value^2 - standard_error^2``.
    """
    names = tuple(name for name in estimates.names if name in stated)
    sigma = np.array([_prior(name, stated[name], *estimates.by_name[name]) for name in names])
    return estimates.updated(names, np.zeros(len(names)), np.diag(sigma**2)) if names else estimates


def _prior(name: str, stated: float, value: float, error: float) -> float:
    """Standard deviation of the prior of a parameter with this estimate, SI."""
    return float(np.sqrt(value**2 - error**2)) if _beyond(name, stated, value, error) else stated


def _beyond(name: str, stated: float, value: float, error: float) -> bool:
    """Return whether the prior is only the natural size, and the estimate beyond it by more than
    its standard error, which is itself below that size."""
    size = parameter(name).size
    return stated == size and error < size and abs(value) > size + error


def with_calibration(estimates: SensorEstimates, calibration: Calibration) -> SensorEstimates:
    """The estimates updated by the values (m,) and covariance (m, m), SI, of a calibration."""
    part = calibration.only(estimates.names)
    return estimates.updated(part.names, part.values, part.covariance) if part.names else estimates


def overridden_by_calibration(
    estimates: SensorEstimates, calibration: Calibration
) -> SensorEstimates:
    """The estimates with those of a calibration in place of the flight's own, SI.

    Their covariance (m, m) is the calibration's; that with the flight's other parameters is zero.
    """
    part = calibration.only(estimates.names)
    index = [estimates.names.index(name) for name in part.names]
    values, spread = estimates.values.copy(), estimates.covariance.copy()
    values[index] = part.values
    spread[index, :] = spread[:, index] = 0.0
    spread[np.ix_(index, index)] = part.covariance
    return SensorEstimates(estimates.names, values, spread)


def is_early(name: str, value: float) -> bool:
    """Return whether a parameter is a delay that is negative: no sensor leads the motion.

    value : [s] for a delay. See `parameter`.
    """
    return value < 0.0 and parameter(name).kind == "delay"


def never_early(estimates: SensorEstimates) -> SensorEstimates:
    """Return the estimates, values (k,) in SI units, with negative delays [s] conditioned on
    zero."""
    while early := [
        name for name, (value, _) in estimates.by_name.items() if is_early(name, value)
    ]:
        estimates = estimates.conditioned_on_zero(early[0])
    return estimates


def agreeing_flights(
    flights: Sequence[SensorEstimates], names: Sequence[str]
) -> tuple[tuple[int, ...], ...]:
    """Return groups of flights that agree in some parameters, as numbers into `flights`.

    Every flight with one of these parameters starts as a group of its own; the two groups that
    agree best are joined, until no two agree: the chi-square of their difference, with its
    covariance, is less likely by chance than `DIFFERENCE`. Correlated errors count: two biases that
    a flight cannot tell apart are compared in the sum that it knows.

    Parameters
    ----------
    flights : independent estimates, without priors, SI.
    names : the parameters to compare.

    Source: chi-square test of equal means of normal variables; `docs/method/consistency.md`,
    section "Calibrations".
    """
    groups: dict[tuple[int, ...], SensorEstimates] = {
        (number,): part for number, own in enumerate(flights) if (part := own.only(names)).names
    }
    while len(groups) > 1:
        likely = {pair: _agreement(*(groups[each] for each in pair)) for pair in _pairs(groups)}
        best = max(likely, key=lambda pair: likely[pair])
        if likely[best] < DIFFERENCE:
            break
        one, other = (groups.pop(each) for each in best)
        groups[tuple(sorted((*best[0], *best[1])))] = pooled([one, other], names, {})
    return tuple(sorted(groups))


def _pairs(groups: Collection[tuple[int, ...]]) -> list[tuple[tuple[int, ...], tuple[int, ...]]]:
    return list(combinations(sorted(groups), 2))


def _agreement(one: SensorEstimates, other: SensorEstimates) -> float:
    """Probability that estimates of equal parameters differ by at least this much; 1 where they
    have none in common."""
    both = [name for name in one.names if name in other.names]
    if not both:
        return 1.0
    first, second = (each.only(both) for each in (one, other))
    difference, spread = first.values - second.values, first.covariance + second.covariance
    return float(chdtrc(len(both), difference @ np.linalg.solve(spread, difference)))


def pooled(
    flights: Sequence[SensorEstimates], names: Collection[str], stated: Mapping[str, float]
) -> SensorEstimates:
    """Return what several flights say together of some parameters, the others integrated out in
    each.

    flights : independent estimates, without priors. names : parameters; those that no flight has
    are left out. stated : priors, name -> one sigma about zero, SI.

    Information matrices add up. Gives values (m,) and covariance (m, m), SI.
    """
    known = tuple(dict.fromkeys(name for own in flights for name in own.names if name in names))
    information, push = np.zeros((len(known), len(known))), np.zeros(len(known))
    for own in flights:
        part = own.only(known)
        at = [known.index(name) for name in part.names]
        weight = np.linalg.inv(part.covariance)
        information[np.ix_(at, at)] += weight
        push[at] += weight @ part.values
    spread = np.linalg.inv(information)
    return with_vehicle_priors(
        SensorEstimates(known, spread @ push, 0.5 * (spread + spread.T)), stated
    )


def significant_parameters(
    result: Reconstruction, plan: ReconstructionPlan, accuracy: Accuracy
) -> tuple[str, ...]:
    """Names of the sensor parameters to keep, in the order of `plan.free`.

    Kept are parameters with a stated prior, and those with a relevant effect that are at least
    `SIGNIFICANT` standard errors from zero once the removed ones are zero. Parameters at a bound or
    without relevant effect are removed first, then the least significant one at a time; the rest is
    conditioned on the removed ones being zero, so that of two that trade off, one stays.

    accuracy : limits, SI, that tell which effects are relevant.
    """
    left = with_vehicle_priors(shared_estimates(result), plan.stated_priors)
    for entry in result.estimates:
        name = entry.parameter.name
        if (
            name in left.names
            and name not in plan.stated_priors
            and (entry.at_bound or not _matters(entry, result, accuracy))
        ):
            left = left.conditioned_on_zero(name)
    while True:
        distance = {
            name: abs(value) / max(error, 1e-300) for name, (value, error) in left.by_name.items()
        }
        open_to = {name: far for name, far in distance.items() if name not in plan.stated_priors}
        worst = min(open_to, key=lambda name: open_to[name], default=None)
        if worst is None or open_to[worst] >= SIGNIFICANT:
            return tuple(name for name in plan.free if name in left.names)
        left = left.conditioned_on_zero(worst)


def at_a_bound(
    result: Reconstruction, plan: ReconstructionPlan, accuracy: Accuracy
) -> tuple[Remark, ...]:
    """Delays and scales of flow angles and airspeed that are as large as they may be, and matter:
    no serviceable sensor has them, so that they are not applied, and the channel stays wrong.

    accuracy : limits, SI; an effect of `TRUST` of them matters.
    """
    return tuple(
        Remark(SENSOR_ERROR, (entry.parameter.label,), {"bound": (entry.value, "SI")})
        for entry in result.estimates
        if entry.at_bound
        and entry.parameter.kind in ("scale", "delay")
        and entry.parameter.subject in ("alpha", "beta", "V")
        and entry.parameter.subject not in plan.left_out
        and (entry.parameter.kind == "scale" or entry.value > 0.0)
        and abs(entry.value) > SIGNIFICANT * entry.standard_error
        and _matters(entry, result, accuracy, TRUST)
    )


def _matters(
    entry: Estimate, result: Reconstruction, accuracy: Accuracy, least: float = MATTERS
) -> bool:
    """Return whether a correction changes its channel by more than a part `least` of its limit
    (rms); always true for channels without a limit."""
    item = entry.parameter
    if item.kind == "probe":
        return abs(entry.value) * _probe_effect(item.name, result) > least * accuracy.flow_angle
    if item.subject not in ("alpha", "beta", "V") or item.kind not in ("bias", "scale", "delay"):
        return True
    pieces = [getattr(path, item.subject) for path in result.paths]
    motion = [piece - piece.mean() for piece in pieces]
    if item.kind == "delay":
        motion = [
            np.gradient(piece, path.record.step)
            for piece, path in zip(pieces, result.paths, strict=True)
        ]
    size = 1.0 if item.kind == "bias" else float(np.sqrt(np.mean(np.concatenate(motion) ** 2)))
    if item.subject == "V":
        return item.kind == "scale" or abs(
            entry.value
        ) * size > least * accuracy.qbar_fraction * float(np.mean(pieces[0]))
    return abs(entry.value) * size > least * accuracy.flow_angle


def _probe_effect(name: str, result: Reconstruction) -> float:
    """Standard deviation (rad) of the change of the flow angle per unit of a five-hole probe's
    parameter."""
    _, angle, part = name.split("_")
    own, other = (
        np.concatenate([getattr(path, each) for path in result.paths]) for each in _both(angle)
    )
    curve = next(
        c for path in result.paths if (c := path.record.installation.five_hole) is not None
    )
    over = dead_zone(Dual(own, {}), getattr(curve, angle).break_angle).value
    return (
        float(np.std({"slope": own, "square": own**2, "cross": other**2, "bend": over}[part]))
        if part != "offset"
        else 1.0
    )


def _both(angle: str) -> tuple[str, str]:
    return ("alpha", "beta") if angle == "alpha" else ("beta", "alpha")


def _worthwhile_error(name: str, value: float, error: float, plan: ReconstructionPlan) -> float:
    """Standard error from which on an estimate is not applied; half as much where the prior is only
    the natural size, unless the flight has found the parameter beyond that size."""
    stated, size = plan.stated_priors.get(name, np.inf), parameter(name).size
    if stated < size:
        return WORTH * stated
    if _beyond(name, stated, value, error):
        return WORTH * abs(value)
    return 0.5 * WORTH * stated


def applied_corrections(
    estimates: SensorEstimates,
    plan: ReconstructionPlan,
    calibration: Calibration | None,
    doubtful: Collection[str] = (),
) -> dict[str, float]:
    """Name -> value (SI) of the corrections to apply.

    These are the parameters of a calibration, and those of the flight that are significant or known
    clearly better than their prior; of `doubtful` ones (biases that may be vertical air, or that
    only a channel determines which disagrees), with no more than a natural size for a prior, only
    the significant.
    """
    known = {} if calibration is None else calibration.by_name
    worth = {
        name: value
        for name, (value, error) in estimates.by_name.items()
        if name in known
        or abs(value) > SIGNIFICANT * error
        or (
            (name not in doubtful or plan.stated_priors.get(name, np.inf) < parameter(name).size)
            and error < _worthwhile_error(name, value, error, plan)
        )
    }
    values = {**{name: value for name, (value, _) in known.items()}, **worth}
    return {name: value for name, value in values.items() if not is_early(name, value)}
