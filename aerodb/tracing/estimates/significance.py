"""The test over flights: one flight, one estimate.

Few flights borrow from the noise inside them; what sensors and state noise may add is subtracted.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.special import stdtr, stdtrit

from aerodb.support import Array, Mask
from aerodb.tracing.estimates.per_flight import FlightEstimates
from aerodb.tracing.settings import TracingSettings

#: Power at which the minimum detectable effect is stated.
POWER = 0.8


@dataclass(frozen=True)
class Tested:
    """Each hypothesis (k,) over the flights that take part in its test.

    mean, standard_error (of the mean), dof, included (flights, k) : which flights take part, count
    : how many. gain : coherent, the fall of the whitened sum of squares under one common value.
    inflation : median VIF. excited : some flight shows it at all. testable : separable, and enough
    flights. sigma (s,) : prior sigma of each sensor, 0 for those that are freed. families : what
    can be claimed, see `by_families`; empty: all of it, in one. What follows from the biases of
    `estimates` is computed on request and cached.
    """

    mean: Array
    standard_error: Array
    dof: Array
    included: Mask
    count: NDArray[np.int64]
    gain: Array
    inflation: Array
    excited: Mask
    testable: Mask
    estimates: FlightEstimates
    sigma: Array
    settings: TracingSettings
    families: tuple[tuple[int, ...], ...] = ()
    cached: dict[int, tuple[float, float]] = field(
        default_factory=dict, init=False, repr=False, compare=False
    )

    @cached_property
    def systematic(self) -> Array:
        """(k,) systematic bound, from sensors and state noise.

        Each is in the unit of its parameter.
        """
        return self.systematic_at(range(len(self.mean)))

    @cached_property
    def p(self) -> Array:
        """Dimensionless p (k,) of "no more than the systematic bound"; 1 where nothing is
        tested."""
        return self.p_at(range(len(self.mean)))

    @cached_property
    def adjusted(self) -> Array:
        """(k,) p adjusted after Holm, over the whole library or by families."""
        return by_families(self.p, self.families) if self.families else holm(self.p, len(self.p))

    @cached_property
    def bound(self) -> Array:
        """(k,) upper bound: larger values are excluded (95 %).

        Each is in the unit of its parameter.
        """
        half = stdtrit(self.dof, 0.975) * self.standard_error + self.systematic
        return np.where(self.count > 0, np.abs(self.mean) + half, np.inf)

    @cached_property
    def detectable(self) -> Array:
        """(k,) minimum detectable effect, power .8. Each is in the unit of its parameter."""
        hurdle = stdtrit(self.dof, 1.0 - 0.5 * self.settings.level / len(self.mean)) + stdtrit(
            self.dof, POWER
        )
        return np.where(self.count > 0, self.systematic + hurdle * self.standard_error, np.inf)

    def systematic_at(self, indices: Sequence[int]) -> Array:
        """Systematic bound (m,) of some hypotheses, from sensors and state noise.

        Each is in the unit of its parameter.
        """
        sensors, simex_bias = self._biases_at(indices)
        return np.asarray(sensors + np.abs(simex_bias))

    def p_at(self, indices: Sequence[int]) -> Array:
        """`p` (m,) of some hypotheses.

        A SIMEX bias counts only where it has the sign of the estimate: noise that makes an estimate
        smaller has not made it.
        """
        sensors, simex_bias = self._biases_at(indices)
        at = np.array(indices, dtype=np.intp)
        return self._p(at, sensors + self._of_noise(at, simex_bias))

    def p_by_noise(self, indices: Sequence[int]) -> Array:
        """`p` (m,) of some hypotheses as if sensors had no constant error: state noise only."""
        _, simex_bias = self._biases_at(indices)
        at = np.array(indices, dtype=np.intp)
        return self._p(at, self._of_noise(at, simex_bias))

    def _of_noise(self, at: NDArray[np.intp], simex_bias: Array) -> Array:
        return np.where(self.mean[at] * simex_bias > 0.0, np.abs(simex_bias), 0.0)

    def _biases_at(self, indices: Sequence[int]) -> tuple[Array, Array]:
        """Bound from sensors (m,), and SIMEX bias (m,) with its sign."""
        new = [index for index in indices if index not in self.cached]
        if new:
            sensor_bias, simex_bias = self.estimates.mean_biases(new, self.included)
            sensors = self.settings.kappa * np.sqrt(
                np.square(sensor_bias * self.sigma).sum(axis=-1)
            )
            self.cached.update(
                zip(
                    new,
                    zip(sensors, self.settings.shift_factor * simex_bias, strict=True),
                    strict=True,
                )
            )
        biases = np.array([self.cached[index] for index in indices]).reshape(-1, 2)
        return biases[:, 0], biases[:, 1]

    @cached_property
    def significant(self) -> Mask:
        """(k,) where `adjusted` is below the level of the settings."""
        if self.families:
            return np.asarray(self.adjusted < self.settings.level)
        floor = holm(self.unmasked, len(self.mean))
        # What is close may be asked for when some flights are left out: the algebra of many places
        # costs as much as that of one.
        self.estimates.biases.at(np.flatnonzero(floor < 1.0).tolist())
        return np.asarray(holm(self._where(floor), len(floor)) < self.settings.level)

    @cached_property
    def possible(self) -> Mask:
        """(k,) where `p` itself is below the level of the settings."""
        return np.asarray(self._where(self.unmasked) < self.settings.level)

    def _where(self, floor: Array) -> Array:
        """`p` (k,) where `floor` is below the level, 1 elsewhere: the systematic bound only raises
        p.
        """
        near = np.flatnonzero(floor < self.settings.level)
        p = np.ones(len(floor))
        p[near] = self.p_at(near.tolist())
        return p

    @cached_property
    def unmasked(self) -> Array:
        """(k,) p as if sensors and states had no error; no claim rests on it."""
        return self._p(slice(None), np.zeros(len(self.mean)))

    def _p(self, indices: "slice | NDArray[np.intp]", systematic: Array) -> Array:
        size, error, dof = (
            np.abs(self.mean[indices]),
            self.standard_error[indices],
            self.dof[indices],
        )
        safe = np.where(error > 0.0, error, 1.0)
        p = stdtr(dof, -(size - systematic) / safe) + stdtr(dof, -(size + systematic) / safe)
        return np.asarray(np.where(self.testable[indices] & (error > 0.0), np.minimum(p, 1.0), 1.0))

    def interval(self, index: int) -> tuple[float, float]:
        """Return the 95 % interval (low, high) of one hypothesis, in its unit (SI); Student's t,
        variance moderated as by Smyth (2004); random and systematic parts add in quadrature.
        """
        systematic = float(self.systematic_at([index])[0])
        half = float(
            np.hypot(stdtrit(self.dof[index], 0.975) * self.standard_error[index], systematic)
        )
        return float(self.mean[index]) - half, float(self.mean[index]) + half

    def not_rejected(self, index: int) -> tuple[float, float]:
        """Return the means that the test of one hypothesis does not reject at 5 %: zero is outside
        if and only if its `p` is below .05.

        The ends are the test solved for its null value, with the systematic bound on the side on
        which it counts: an interval for an estimate of bounded bias (Armstrong & Kolesar,
        Econometrica 86(2), 2018, section 3).

        They are in the unit of the parameter.
        """
        sensors, simex_bias = (float(part[0]) for part in self._biases_at([index]))
        mean, error, dof = (float(of[index]) for of in (self.mean, self.standard_error, self.dof))
        ends = [
            mean + side * _half_width(sensors + max(0.0, -side * simex_bias), error, dof)
            for side in (-1.0, 1.0)
        ]
        return ends[0], ends[1]


def _half_width(systematic: float, error: float, dof: float) -> float:
    """Distance from the mean at which the test with this systematic bound and standard error has p
    = .05."""
    if error <= 0.0:
        return systematic
    if systematic <= 0.0:
        return error * float(stdtrit(dof, 0.975))
    # At this end p is nearer to .025 than to .05: the two have different signs.
    off, widest = systematic / error, systematic / error + float(stdtrit(dof, 0.99))

    def excess(size: float) -> float:
        return float(stdtr(dof, off - size) + stdtr(dof, -off - size)) - 0.05

    return error * float(brentq(excess, 0.0, widest))


def holm(p: Array, size: int) -> Array:
    """Adjusted p-values (k,) of Holm (Scand. J. Stat. 6, 1979) among `size` >= k tests; those not
    given count as p = 1.

    >>> holm(np.array([0.01, 0.04]), 2).tolist()
    [0.02, 0.04]
    """
    order = np.argsort(p, kind="stable")
    adjusted = np.minimum(1.0, np.maximum.accumulate(p[order] * (size - np.arange(len(p)))))
    result = np.empty_like(adjusted)
    result[order] = adjusted
    return result


def by_families(p: Array, families: Sequence[Sequence[int]]) -> Array:
    """Adjusted p-values (k,) where only the places in `families` can be claimed, each in one of
    them: Holm inside a family, which has an equal part of the level. What cannot be claimed cannot
    be claimed falsely: it counts in none, and gets 1.

    >>> by_families(np.array([0.01, 0.04, 0.02]), [[0], [1]]).tolist()
    [0.02, 0.08, 1.0]
    """
    adjusted = np.ones_like(p)
    for family in families:
        indices = np.asarray(family, dtype=np.intp)
        adjusted[indices] = np.minimum(1.0, len(families) * holm(p[indices], len(indices)))
    return adjusted


def moderated_variance(between: Array, dof: Array, within: Array, prior_dof: float) -> Array:
    """Posterior variance ``(d0 v0 + d v) / (d0 + d)``, d0 + d > 0.

    between (k,), dof (k,) : v and d, over flights; within (k,), prior_dof : v0 and d0. Source:
    Smyth, Stat. Appl. Genet. Mol. Biol. 3(1), 2004.
    """
    return np.asarray((prior_dof * within + dof * between) / (prior_dof + dof))


def over_flights(
    estimates: FlightEstimates,
    sigma: Array,
    settings: TracingSettings,
    fewest: int,
    constants: Sequence[int] = (),
    own: Sequence[int] = (),
    left: Array | None = None,
) -> Tested:
    """Test every hypothesis over flights.

    Parameters
    ----------
    estimates : per-flight estimates (g, k)
    sigma : (s,) prior sigma of each sensor, 0 for those that are freed
    fewest : flights that a hypothesis needs to be tested
    constants : hypotheses that are an axis' own constant. They vary from flight to flight by more
        than the noise inside them: they have an s0 of their own, and their variance is never below
        that over flights.
    own : errors that are each flight's own, such as what reconstruction leaves of a bias; their
        variance is never below that over flights either.
    left : variance (g, k) of the innovation that the model leaves, as a part of that with all
        that it explains: what a model holds is no noise of its own values; None: all of it.

    Returns
    -------
    Tested : with ``se^2 = (d0 s0 v0 + d v) / ((d0 + d) G)``, v the variance over flights, d = G -
        1, v0 = mean 1/I and s0 = max(1, median v/v0 over the hypotheses); ``p = T(-(|m| - D)/se) +
        T(-(|m| + D)/se)``, D with the SIMEX bias where it has the sign of m (without the noise the
        estimate would be m - bias).

    References
    ----------
    docs/method/tracing.md, section 8; Ibragimov & Mueller, JBES 28(4), 2010; Cook & Stefanski, JASA
        89,
    1994.
    """
    included = estimates.information > settings.least_share * estimates.information.max(
        axis=0, initial=0.0
    )
    count = included.sum(axis=0)
    number = np.maximum(count, 1)
    estimate, information = (
        np.where(included, estimates.estimate, 0.0),
        np.where(included, estimates.information, 0.0),
    )
    mean = estimate.sum(axis=0) / number
    deviation = np.where(included, estimate - mean, 0.0)
    dof = np.maximum(count - 1, 0).astype(np.float64)
    between = np.einsum("gk,gk->k", deviation, deviation) / np.maximum(dof, 1.0)
    noise = 1.0 if left is None else left
    within = np.divide(noise, information, out=deviation, where=included).sum(axis=0) / number
    inflation = _median_inflation(estimates, included)
    constant = np.zeros(len(mean), dtype=bool)
    constant[list(constants)] = True
    separable = (inflation <= settings.inflation_limit) | constant
    ratio = between / np.where(within > 0.0, within, 1.0)
    among = separable & (count >= 2)
    excess = np.where(constant, _excess(ratio[among & constant]), _excess(ratio[among & ~constant]))
    variance = moderated_variance(between, dof, excess * within, settings.prior_dof)
    constant[list(own)] = True
    variance = np.where(constant, np.maximum(variance, between), variance)
    total, right = information.sum(axis=0), np.einsum("gk,gk->k", information, estimate)
    return Tested(
        mean=mean,
        standard_error=np.sqrt(variance / number),
        dof=settings.prior_dof + dof,
        included=included,
        count=count,
        gain=np.square(right) / np.where(total > 0.0, total, 1.0),
        inflation=inflation,
        excited=np.asarray((estimates.information_before > 0.0).any(axis=0)),
        testable=separable & (count >= fewest),
        estimates=estimates,
        sigma=sigma,
        settings=settings,
    )


def coherent_gain(estimate: Array, information: Array, settings: TracingSettings) -> float:
    """`gain` of one hypothesis, estimate and information (flights,). It is dimensionless."""
    on = information > settings.least_share * information.max(initial=0.0)
    total = float(information[on].sum())
    return float(information[on] @ estimate[on]) ** 2 / total if total > 0.0 else 0.0


def _excess(ratio: Array) -> float:
    """s0: by how much flights differ more than the noise inside them says, at least 1."""
    return max(1.0, float(np.median(ratio))) if ratio.size else 1.0


def _median_inflation(estimates: FlightEstimates, included: Mask) -> Array:
    """Median VIF (k,) over the flights that take part; infinite where none does."""
    count = included.sum(axis=0)
    ordered = np.sort(np.where(included, estimates.inflation, np.inf), axis=0)
    each = np.arange(len(count))
    lower, upper = (
        ordered[np.maximum(count - 1, 0) // 2, each],
        ordered[np.minimum(count // 2, len(ordered) - 1), each],
    )
    return np.asarray(np.where(count > 0, 0.5 * (lower + upper), np.inf))


def paired_p(better: Array, worse: Array) -> float:
    """One-sided p of "`better` (g,) gains no more than `worse` (g,)": Student's paired t over
    flights; 1 for fewer than two. Gains share one unit; p has none."""
    difference = better - worse
    if len(difference) < 2:
        return 1.0
    spread = float(difference.std(ddof=1))
    mean = float(difference.mean())
    if spread == 0.0:
        return 0.0 if mean > 0.0 else 1.0
    return float(stdtr(len(difference) - 1, -mean / (spread / np.sqrt(len(difference)))))


def scatter_p(less: Array, more: Array) -> float:
    """One-sided p of "`less` (g,) scatters no less than `more` (g,)" for paired values in one unit;
    1 for fewer than three. Pitman, Biometrika 31, 1939; Morgan, ibid."""
    if len(less) < 3:
        return 1.0
    total, difference = less + more, less - more
    spread = float(total.std() * difference.std())
    if spread == 0.0:
        return 1.0
    r = float(np.mean((total - total.mean()) * (difference - difference.mean()))) / spread
    dof = len(less) - 2
    return float(stdtr(dof, r * np.sqrt(dof / max(1.0 - r**2, np.finfo(float).eps))))
