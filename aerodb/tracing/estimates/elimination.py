"""Eliminate sensors and accepted terms from the products of all flights.

The sensors are eliminated under their priors once per campaign: ``A = H - H_s (H_ss + P)^-1 H_s'``
(docs/method/tracing.md, section 7). Accepted terms are then eliminated from the result, a few
columns instead of all. A sensor that gets another precision p' instead of p is eliminated once more
by a copy of its column with precision ``p p' / (p - p')``: 0 where it is freed, -p where it is
taken as right.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aerodb.support import Array, Mask, Threads
from aerodb.tracing.estimates.products import Indices, Products

#: A trace of ridge: a nuisance that a flight does not show must not stop the others.
RIDGE = 1e-11
#: Part of a column's own information below which what is left beside the nuisances is rounding.
ROUNDING = 1e-9
#: Flights that are worked on at a time: what is made of them stays in a core's cache.
PART = 32


@dataclass(frozen=True)
class SchurComplements:
    """Products of some hypotheses (g, m) in scaled units, before and after the elimination.

    before : ``H_hh``, the information before the nuisance parameters (after the intercepts).
    after : ``A_hh``, the information after them. cross : ``A_hy``, with the residual.
    """

    before: Array
    after: Array
    cross: Array

    @property
    def informative(self) -> Mask:
        """Mask (g, m), where what is left of the column is more than rounding: `ROUNDING`, relative
        and dimensionless."""
        return np.asarray(self.after > ROUNDING * np.maximum(self.before, ROUNDING))


class EliminationCache:
    """Nuisance columns with the sensors eliminated, each computed once per campaign, on first use.

    pairs (g, n, n) : products with one another. beside (g, n, w) : products with the k hypotheses
    and the residual; then what the s sensors say of them, ``(H_ss + P)^-1 H_s``; then with the
    intercepts of the o offsets. The sensors come first: ``H_ss (H_ss + P)^-1 = 1 - P (H_ss +
    P)^-1`` gives what remains of them without a difference of nearly equal numbers. Both arrays may
    be longer than what is filled.
    """

    def __init__(
        self,
        products: Products,
        sensors: Indices,
        prior: Array,
        inverse: Array,
        gain: Array,
        of_intercepts: Array,
    ) -> None:
        """sensors : their columns; prior (s,) : P; inverse (g, s, s), gain (g, s, k + 1);
        of_intercepts (g, o, c) : products of the intercepts with all columns.
        """
        self._products, self._sensors, self._prior, self._inverse, self._gain = (
            products,
            sensors,
            prior,
            inverse,
            gain,
        )
        self._of_intercepts, self._sensors_of_intercepts = (
            of_intercepts,
            of_intercepts[:, :, sensors],
        )
        self._position = {int(sensor): number for number, sensor in enumerate(sensors)}
        (flights, s, core), offsets = gain.shape, of_intercepts.shape[1]
        self._onto, self._intercepts = slice(core, core + s), slice(core + s, None)
        self.pairs, self.beside = (
            np.empty((flights, 2 * s, 2 * s)),
            np.empty((flights, 2 * s, core + s + offsets)),
        )
        self.pairs[:, :s, :s] = np.diag(prior) - np.outer(prior, prior) * inverse
        self.beside[:, :s, :core] = prior[:, None] * gain
        self.beside[:, :s, self._onto] = np.eye(s) - prior[:, None] * inverse
        self.beside[:, :s, self._intercepts] = (
            prior * (self._sensors_of_intercepts @ inverse)
        ).transpose(0, 2, 1)

    def positions(self, members: Indices) -> Indices:
        """Return the row (m,) of each column (m,) in the cache; compute the columns that are new,
        with their shape-misfit terms (docs/method/tracing.md, section 20)."""
        new = [member for member in members.tolist() if member not in self._position]
        if new:
            # A model that needs a term needs its shape-misfit terms as well.
            shape_terms = np.flatnonzero(np.isin(self._products.base, new)).tolist()
            self._add(
                np.array(
                    [m for m in dict.fromkeys([*new, *shape_terms]) if m not in self._position],
                    dtype=np.intp,
                )
            )
        return np.array([self._position[member] for member in members.tolist()], dtype=np.intp)

    def _add(self, new: Indices) -> None:
        first, s, core = len(self._position), len(self._sensors), self._gain.shape[2]
        self._position |= {int(member): first + number for number, member in enumerate(new)}
        last = len(self._position)
        if last > self.pairs.shape[1]:
            self._grow(2 * last)
        others = np.array(list(self._position)[s:], dtype=np.intp)
        block = self._products.block(new, np.r_[self._products.core, others])
        shared = block[:, :, self._sensors]
        onto = shared @ self._inverse
        self.beside[:, first:last, self._onto] = onto
        self.beside[:, first:last, :core] = block[:, :, :core] - shared @ self._gain
        self.beside[:, first:last, self._sensors] = onto * self._prior
        self.beside[:, first:last, self._intercepts] = (
            self._of_intercepts[:, :, new] - self._sensors_of_intercepts @ onto.transpose(0, 2, 1)
        ).transpose(0, 2, 1)
        pairs = block[:, :, core:] - shared @ self.beside[:, s:last, self._onto].transpose(0, 2, 1)
        pairs = np.concatenate([onto * self._prior, pairs], axis=2)
        self.pairs[:, first:last, :last] = pairs
        self.pairs[:, :last, first:last] = pairs.transpose(0, 2, 1)

    def _grow(self, size: int) -> None:
        """Make room for `size` columns."""
        (flights, old, width), pairs, beside = self.beside.shape, self.pairs, self.beside
        self.pairs, self.beside = np.empty((flights, size, size)), np.empty((flights, size, width))
        self.pairs[:, :old, :old], self.beside[:, :old] = pairs, beside


class SensorElimination:
    """Products with the sensors eliminated: estimates without any term, and what terms need.

    sensors (s,) : their columns; precision (s,) : scaled, of their priors. inverse (g, s, s) :
    ``(H_ss + P)^-1``; gain (g, s, k + 1) : that times ``H_s``. information_before (g, k) : ``H_hh``
    of the hypotheses, for offsets that of their intercepts. column (columns,) : where a hypothesis,
    a sensor or an offset is in the cache's `beside`, w columns. quadratic, linear (g, w), given the
    sensors alone: ``A_hh`` and ``A_hy`` of a hypothesis; posterior variance and mean of a sensor;
    of an offset the variance that the sensors add to its intercept, and the intercept. shares (g,
    s, w) : what the sensors say of each.
    """

    def __init__(self, products: Products, sensors: Sequence[int], precision: Array) -> None:
        """precision (columns,) : scaled, 0 for columns that are no sensor."""
        self.products, self.sensors = products, np.array(sensors, dtype=np.intp)
        self.number = np.full(len(products.base), -1)  # column -> which sensor it is
        self.number[self.sensors] = np.arange(len(self.sensors))
        self.precision = precision[self.sensors]
        self.prior = self.precision + RIDGE
        matrix, k, s = products.matrix, products.hypotheses, len(self.sensors)
        shared = matrix[:, self.sensors]
        self.inverse: Array = np.asarray(
            np.linalg.inv(shared[:, :, self.sensors] + np.diag(self.prior)), dtype=np.float64
        )
        self.gain: Array = self.inverse @ shared
        weight, of_intercepts = products.constants()
        on = of_intercepts[:, :, self.sensors]
        intercept_gain = on @ self.inverse
        self.information_before = np.diagonal(matrix, axis1=1, axis2=2)[:, :k].copy()
        self.information_before[:, list(products.offsets)] = weight
        known = self.gain[:, :, -1]
        after = np.diagonal(matrix, axis1=1, axis2=2) - np.einsum("gsk,gsk->gk", shared, self.gain)
        cross = matrix[:, :, -1] - np.einsum("gsk,gs->gk", shared, known)
        of_sensors = np.diagonal(self.inverse, axis1=1, axis2=2)
        self.quadratic: Array = np.concatenate(
            [after, of_sensors, (intercept_gain * on).sum(axis=2)], axis=1
        )
        self.linear: Array = np.concatenate(
            [cross, known, of_intercepts[:, :, -1] - np.einsum("gos,gs->go", on, known)], axis=1
        )
        self.shares: Array = np.concatenate(
            [self.gain, self.inverse, intercept_gain.transpose(0, 2, 1)], axis=2
        )
        self.column = np.arange(len(products.base))
        self.column[self.sensors] = k + 1 + np.arange(s)
        self.column[list(products.offsets)] = k + 1 + s + np.arange(len(products.offsets))
        self.cache = EliminationCache(
            products, self.sensors, self.prior, self.inverse, self.gain, of_intercepts
        )
        self.parts = [slice(first, first + PART) for first in range(0, len(matrix), PART)]
        self.threads = Threads()

    def beside(
        self, prior: Mapping[int, float], freed: Sequence[int], fixed: Sequence[int]
    ) -> "ModelElimination":
        """Return the model with the terms and shape-misfit terms of `prior` (index -> scaled
        precision).

        freed : sensors without a prior; fixed : sensors taken as right. A hypothesis that is itself
        a nuisance parameter is estimated with all the others present and its own prior left out; a
        sensor taken as right has no estimate.
        """
        of = dict(zip(self.sensors.tolist(), self.prior.tolist(), strict=True))
        extra = {
            index: each + RIDGE for index, each in (dict(prior) | dict.fromkeys(freed, 0.0)).items()
        }
        extra |= {
            sensor: -of[sensor] for sensor in fixed
        }  # exactly: beside a weak prior, a ridge would free it instead
        members = np.array(sorted(extra), dtype=np.intp)
        changed = np.zeros(len(self.sensors), dtype=bool)
        changed[self.number[[*freed, *fixed]]] = True
        return ModelElimination(
            self,
            members,
            np.array([extra[member] for member in members.tolist()]),
            changed,
            frozenset(freed),
        )


@dataclass(frozen=True)
class ModelElimination:
    """One model: what is eliminated from the products beyond the sensors.

    members (n,) : columns, in order; extra (n,) : what is added to their diagonal. changed (s,) :
    sensors whose precision is not that of their prior; freed : those without a prior.
    """

    base: SensorElimination
    members: Indices
    extra: Array
    changed: Mask
    freed: frozenset[int]

    def at(self, indices: Indices) -> SchurComplements:
        """Return the Schur complements (g, m) of hypotheses (m,), scaled to be dimensionless, of
        all flights."""
        base, k, column = self.base, self.base.products.hypotheses, self.base.column[indices]
        positions, among = base.cache.positions(self.members), self._among(indices)
        before = base.information_before[:, indices]
        after, cross = np.empty_like(before), np.empty_like(before)
        which, of = self._sensors(indices)
        offsets = np.flatnonzero(column > k + len(base.sensors))

        def fill(part: slice) -> None:
            squares, cross_products = self._contracted(
                part, positions, np.array([k]), indices, among
            )
            reduction, cross_reduction = (
                squares[:, : len(indices)],
                cross_products[:, 0, : len(indices)],
            )
            quadratic = base.quadratic[part, column] + np.where(column < k, -reduction, reduction)
            linear = base.linear[part, column] - cross_reduction
            after[part], cross[part] = quadratic, linear
            # A nuisance's posterior mean and variance, with its own prior taken out again.
            after[part, which] = 1.0 / quadratic[:, which] - base.precision[of]
            cross[part, which] = linear[:, which] / quadratic[:, which]
            weight = before[part, offsets]
            shown = 1.0 / (1.0 / np.where(weight > 0.0, weight, 1.0) + quadratic[:, offsets])
            after[part, offsets] = np.where(weight > 0.0, shown, 0.0)
            cross[part, offsets] = after[part, offsets] * linear[:, offsets]
            for index, variance, value in zip(
                among,
                squares[:, len(indices) :].T,
                cross_products[:, 0, len(indices) :].T,
                strict=True,
            ):
                after[part, index], cross[part, index] = self._member(
                    int(indices[index]), variance, value
                )

        base.threads.each(fill, base.parts)
        return SchurComplements(before, after, cross)

    def _member(self, member: int, quadratic: Array, value: Array) -> tuple[Array, Array]:
        """``A_hh`` and ``A_hy`` (g,) of one of the members, from its variance and value."""
        if self.base.number[member] < 0:
            return 1.0 / quadratic, value / quadratic
        if member not in self.freed:
            return np.zeros_like(quadratic), np.zeros_like(quadratic)
        # Its column is taken out under its prior already; what is left of it is less by what that
        # prior is worth.
        prior = self.base.prior[self.base.number[member]]
        rest = np.maximum(1.0 / quadratic - RIDGE, np.finfo(np.float64).tiny)
        after = 1.0 / (1.0 / rest - 1.0 / prior)
        return after, after * value / (quadratic * rest)

    def _sensors(self, indices: Indices) -> tuple[Indices, Indices]:
        """Return which of the indices are sensors, and which sensors these are."""
        number = self.base.number[indices]
        which = np.flatnonzero(number >= 0)
        return which, number[which]

    def _among(self, indices: Indices) -> Indices:
        """Return which of the indices are members."""
        member = np.zeros(len(self.base.column), dtype=bool)
        member[self.members] = True
        return np.flatnonzero(member[indices])

    def sensor_bias(self, indices: Indices, after: Array, factor: Array, error: Array) -> Array:
        """Return what an `error` (s,) of each sensor, scaled, adds to estimates in spite of its
        prior.

        Parameters
        ----------
        indices : (m,) hypotheses
        after : (g, m) ``A_hh`` as `at` gives it
        factor : (g, m) multiplies ``A_hy``
        error : (s,) scaled

        Returns
        -------
        (m, g, s) : 0 for a sensor whose precision was changed
        """
        base, k, column = self.base, self.base.products.hypotheses, self.base.column[indices]
        positions, among = base.cache.positions(self.members), self._among(indices)
        sensors, prior = (
            base.column[base.sensors],
            np.where(self.changed, 0.0, base.precision * error),
        )
        biases = np.empty((len(indices), len(after), len(sensors)))
        which, of = self._sensors(indices)
        offsets = np.flatnonzero(column > k + len(base.sensors))

        def fill(part: slice) -> None:
            squares, cross_products = self._contracted(part, positions, sensors, indices, among)
            cross_reduction, turned = (
                cross_products[:, :, : len(indices)],
                cross_products[:, :, len(indices) :],
            )  # minus what sensors have in common with
            sensor_bias = base.shares[part].take(column, axis=2)
            sensor_bias[:, :, which] *= -1.0
            sensor_bias -= cross_reduction
            variance = base.quadratic[part, column[which]] + squares[:, which]
            covariance = -sensor_bias[:, :, which]
            sensor_bias[:, :, which] /= variance[:, None]
            sensor_bias[:, :, offsets] *= after[part, None, offsets]
            for number, index in enumerate(among):
                if base.number[indices[index]] < 0:
                    sensor_bias[:, :, index] = (
                        turned[:, :, number] / squares[:, None, len(indices) + number]
                    )
                # a sensor of another precision is the one under its prior and the one beside it
                # together
                else:
                    before = covariance[:, :, np.searchsorted(which, index)]
                    sensor_bias[:, :, index] = (turned[:, :, number] - before) * after[
                        part, None, index
                    ]
            sensor_bias[:, of, which] = 0.0
            np.multiply(
                sensor_bias.transpose(2, 0, 1), factor[part].T[:, :, None], out=biases[:, part]
            )
            biases[:, part] *= prior

        base.threads.each(fill, base.parts)
        return biases

    def _contracted(
        self, part: slice, positions: Indices, after: Indices, indices: Indices, among: Indices
    ) -> tuple[Array, Array]:
        """``u' G u`` (g, p + m) and ``v' G u`` (g, l, p + m) of some flights, G the inverse of the
        members' pairs: v are the columns `after` of the cache's `beside`, u those of the p indices,
        then the unit vectors of the m members `among` them.
        """
        from aerodb.tracing.estimates.kernels import (
            contracted,
        )  # compiled: nothing else should wait for it

        pairs, beside = self.base.cache.pairs[part], self.base.cache.beside[part]
        units = np.searchsorted(self.members, indices[among])
        squares = np.empty((len(pairs), len(indices) + len(units)))
        cross_products = np.empty((len(pairs), len(after), squares.shape[1]))
        contracted(
            pairs,
            beside,
            positions,
            self.extra,
            after,
            self.base.column[indices],
            units,
            squares,
            cross_products,
        )
        return squares, cross_products


def prepare_elimination() -> None:
    """Compile the elimination of nuisance parameters, so that no later process waits for it."""
    from aerodb.tracing.estimates.kernels import contracted

    one = np.zeros(1, dtype=np.intp)
    contracted(
        np.ones((1, 1, 1)),
        np.ones((1, 1, 1)),
        one,
        np.ones(1),
        one,
        one,
        one,
        np.zeros((1, 2)),
        np.zeros((1, 1, 2)),
    )
