"""Products of all flights with the sensors taken out under their priors: once for a campaign, every
vote stands beside them.

``A = H - H_s (H_ss + P)^-1 H_s'`` (TRACING, step 3). Terms that are accepted are taken out of what
is left, a few columns instead of all of them. So is a sensor that gets another precision p' instead
of its p: with a column of its own once more, of precision ``p p' / (p - p')``: 0 where it is freed,
-p where it is known to be right.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aerodb.support import Array, Mask, Threads
from aerodb.tracing.estimates.products import Places, Products

#: A trace of ridge: a nuisance that a flight does not show must not stop the others.
RIDGE = 1e-11
#: Flights that are worked on at a time: what is made of them stays in a core's cache.
PART = 32


class EliminationCache:
    """Columns that votes stand beside, with the sensors taken out of them: each once for a
    campaign, when it is first asked for.

    pairs (g, n, n) : with one another. beside (g, n, w) : with the k hypotheses and the residual;
    then what the s sensors say of them, ``(H_ss + P)^-1 H_s``; then with the trims of the o
    offsets. The sensors come first: ``H_ss (H_ss + P)^-1 = 1 - P (H_ss + P)^-1`` says without a
    difference of near numbers what is left of them. Longer than what is filled.
    """

    def __init__(
        self,
        products: Products,
        sensors: Places,
        prior: Array,
        inverse: Array,
        reach: Array,
        across: Array,
    ) -> None:
        """sensors : their columns; prior (s,) : P; inverse (g, s, s), reach (g, s, k + 1); across
        (g, o, c) : trims with all."""
        self._products, self._sensors, self._prior, self._inverse, self._reach = (
            products,
            sensors,
            prior,
            inverse,
            reach,
        )
        self._across, self._owed = across, across[:, :, sensors]
        self._indices = {int(sensor): number for number, sensor in enumerate(sensors)}
        (flights, s, core), offsets = reach.shape, across.shape[1]
        self._onto, self._intercepts = slice(core, core + s), slice(core + s, None)
        self.pairs, self.beside = (
            np.empty((flights, 2 * s, 2 * s)),
            np.empty((flights, 2 * s, core + s + offsets)),
        )
        self.pairs[:, :s, :s] = np.diag(prior) - np.outer(prior, prior) * inverse
        self.beside[:, :s, :core] = prior[:, None] * reach
        self.beside[:, :s, self._onto] = np.eye(s) - prior[:, None] * inverse
        self.beside[:, :s, self._intercepts] = (prior * (self._owed @ inverse)).transpose(0, 2, 1)

    def indices(self, members: Places) -> Places:
        """Where each of the columns stands."""
        new = [member for member in members.tolist() if member not in self._indices]
        if new:
            # Who stands beside a term will stand beside its companions as well.
            shape_terms = np.flatnonzero(np.isin(self._products.base, new)).tolist()
            self._add(
                np.array(
                    [m for m in dict.fromkeys([*new, *shape_terms]) if m not in self._indices],
                    dtype=np.intp,
                )
            )
        return np.array([self._indices[member] for member in members.tolist()], dtype=np.intp)

    def _add(self, new: Places) -> None:
        first, s, core = len(self._indices), len(self._sensors), self._reach.shape[2]
        self._indices |= {int(member): first + number for number, member in enumerate(new)}
        last = len(self._indices)
        if last > self.pairs.shape[1]:
            self._grow(2 * last)
        others = np.array(list(self._indices)[s:], dtype=np.intp)
        block = self._products.block(new, np.r_[self._products.core, others])
        shared = block[:, :, self._sensors]
        onto = shared @ self._inverse
        self.beside[:, first:last, self._onto] = onto
        self.beside[:, first:last, :core] = block[:, :, :core] - shared @ self._reach
        self.beside[:, first:last, self._sensors] = onto * self._prior
        self.beside[:, first:last, self._intercepts] = (
            self._across[:, :, new] - self._owed @ onto.transpose(0, 2, 1)
        ).transpose(0, 2, 1)
        pairs = block[:, :, core:] - shared @ self.beside[:, s:last, self._onto].transpose(0, 2, 1)
        pairs = np.concatenate([onto * self._prior, pairs], axis=2)
        self.pairs[:, first:last, :last] = pairs
        self.pairs[:, :last, first:last] = pairs.transpose(0, 2, 1)

    def _grow(self, size: int) -> None:
        """Room for `size` columns."""
        (flights, old, width), pairs, beside = self.beside.shape, self.pairs, self.beside
        self.pairs, self.beside = np.empty((flights, size, size)), np.empty((flights, size, width))
        self.pairs[:, :old, :old], self.beside[:, :old] = pairs, beside


class SensorElimination:
    """Products without the sensors: what votes are without any term, and what they need for some.

    sensors (s,) : their places; precision (s,) : scaled, of their priors. inverse (g, s, s) :
    ``(H_ss + P)^-1``; reach (g, s, k + 1) : that times ``H_s``. own (g, k) : ``H_hh`` of the
    hypotheses, of offsets that of their trims. column (columns,) : where a hypothesis, a sensor or
    an offset stands in the stock's `beside`, w columns; of these spread, level (g, w) beside the
    sensors alone: ``A_hh`` and ``A_hy`` of a hypothesis; variance and mean of a sensor; of an
    offset the level of its trim, and the spread that the sensors add to it. shares (g, s, w) : what
    the sensors say of each.
    """

    def __init__(self, products: Products, sensors: Sequence[int], precision: Array) -> None:
        """precision (columns,) : scaled, 0 for what is no sensor."""
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
        self.reach: Array = self.inverse @ shared
        weight, across = products.constants()
        on = across[:, :, self.sensors]
        owed = on @ self.inverse
        self.own = np.diagonal(matrix, axis1=1, axis2=2)[:, :k].copy()
        self.own[:, list(products.offsets)] = weight
        known = self.reach[:, :, -1]
        left = np.diagonal(matrix, axis1=1, axis2=2) - np.einsum("gsk,gsk->gk", shared, self.reach)
        right = matrix[:, :, -1] - np.einsum("gsk,gs->gk", shared, known)
        of_sensors = np.diagonal(self.inverse, axis1=1, axis2=2)
        self.spread: Array = np.concatenate([left, of_sensors, (owed * on).sum(axis=2)], axis=1)
        self.level: Array = np.concatenate(
            [right, known, across[:, :, -1] - np.einsum("gos,gs->go", on, known)], axis=1
        )
        self.shares: Array = np.concatenate(
            [self.reach, self.inverse, owed.transpose(0, 2, 1)], axis=2
        )
        self.column = np.arange(len(products.base))
        self.column[self.sensors] = k + 1 + np.arange(s)
        self.column[list(products.offsets)] = k + 1 + s + np.arange(len(products.offsets))
        self.cache = EliminationCache(
            products, self.sensors, self.prior, self.inverse, self.reach, across
        )
        self.parts = [slice(first, first + PART) for first in range(0, len(matrix), PART)]
        self.threads = Threads()

    def beside(
        self, prior: Mapping[int, float], freed: Sequence[int], fixed: Sequence[int]
    ) -> "ModelElimination":
        """Votes beside the terms and companions of `prior` (place -> scaled precision), sensors
        `freed` of it, and `fixed` ones.

        A hypothesis that is itself a nuisance is estimated beside the others, its own prior left
        out; a sensor that is known to be right has no vote.
        """
        of = dict(zip(self.sensors.tolist(), self.prior.tolist(), strict=True))
        extra = {
            place: each + RIDGE for place, each in (dict(prior) | dict.fromkeys(freed, 0.0)).items()
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
    """What is taken out of the products beyond the sensors. members (n,), in order; extra (n,) :
    what they have on the diagonal.

    changed (s,) : sensors of another precision than their prior's; freed : those of none.
    """

    base: SensorElimination
    members: Places
    extra: Array
    changed: Mask
    freed: frozenset[int]

    def at(self, places: Places) -> tuple[Array, Array, Array]:
        """Schur complements (g, places), scaled: own ``H_hh``, left ``A_hh``, right ``A_hy``."""
        base, k, column = self.base, self.base.products.hypotheses, self.base.column[places]
        indices, among = base.cache.indices(self.members), self._among(places)
        own = base.own[:, places]
        left, right = np.empty_like(own), np.empty_like(own)
        which, of = self._sensors(places)
        offsets = np.flatnonzero(column > k + len(base.sensors))

        def fill(part: slice) -> None:
            squares, across = self._contracted(part, indices, np.array([k]), places, among)
            taken, told = squares[:, : len(places)], across[:, 0, : len(places)]
            spread = base.spread[part, column] + np.where(column < k, -taken, taken)
            level = base.level[part, column] - told
            left[part], right[part] = spread, level
            # A nuisance's posterior mean and variance, with its own prior taken out again.
            left[part, which] = 1.0 / spread[:, which] - base.precision[of]
            right[part, which] = level[:, which] / spread[:, which]
            weight = own[part, offsets]
            shown = 1.0 / (1.0 / np.where(weight > 0.0, weight, 1.0) + spread[:, offsets])
            left[part, offsets] = np.where(weight > 0.0, shown, 0.0)
            right[part, offsets] = left[part, offsets] * level[:, offsets]
            for place, variance, value in zip(
                among, squares[:, len(places) :].T, across[:, 0, len(places) :].T, strict=True
            ):
                left[part, place], right[part, place] = self._member(
                    int(places[place]), variance, value
                )

        base.threads.each(fill, base.parts)
        return own, left, right

    def _member(self, member: int, spread: Array, value: Array) -> tuple[Array, Array]:
        """``A_hh`` and ``A_hy`` (g,) of one of the members, from its variance and value."""
        if self.base.number[member] < 0:
            return 1.0 / spread, value / spread
        if member not in self.freed:
            return np.zeros_like(spread), np.zeros_like(spread)
        # Its column is taken out under its prior already; what is left of it is less by what that
        # prior is worth.
        prior = self.base.prior[self.base.number[member]]
        rest = np.maximum(1.0 / spread - RIDGE, np.finfo(np.float64).tiny)
        left = 1.0 / (1.0 / rest - 1.0 / prior)
        return left, left * value / (spread * rest)

    def _sensors(self, places: Places) -> tuple[Places, Places]:
        """Which of the places are sensors, and which sensors these are."""
        number = self.base.number[places]
        which = np.flatnonzero(number >= 0)
        return which, number[which]

    def _among(self, places: Places) -> Places:
        """Which of the places are members."""
        member = np.zeros(len(self.base.column), dtype=bool)
        member[self.members] = True
        return np.flatnonzero(member[places])

    def sensor_bias(self, places: Places, left: Array, factor: Array, error: Array) -> Array:
        """(places, g, s): what an `error` (s,) of a sensor, scaled, adds to `right` despite its
        prior; 0 for a changed one.

        left (g, places) : as `at` gave it. factor (g, places) : of `right`.
        """
        base, k, column = self.base, self.base.products.hypotheses, self.base.column[places]
        indices, among = base.cache.indices(self.members), self._among(places)
        sensors, prior = (
            base.column[base.sensors],
            np.where(self.changed, 0.0, base.precision * error),
        )
        found = np.empty((len(places), len(left), len(sensors)))
        which, of = self._sensors(places)
        offsets = np.flatnonzero(column > k + len(base.sensors))

        def fill(part: slice) -> None:
            squares, across = self._contracted(part, indices, sensors, places, among)
            told, turned = (
                across[:, :, : len(places)],
                across[:, :, len(places) :],
            )  # minus what sensors have in common with
            sensor_bias = base.shares[part].take(column, axis=2)
            sensor_bias[:, :, which] *= -1.0
            sensor_bias -= told
            variance = base.spread[part, column[which]] + squares[:, which]
            covariance = -sensor_bias[:, :, which]
            sensor_bias[:, :, which] /= variance[:, None]
            sensor_bias[:, :, offsets] *= left[part, None, offsets]
            for number, place in enumerate(among):
                if base.number[places[place]] < 0:
                    sensor_bias[:, :, place] = (
                        turned[:, :, number] / squares[:, None, len(places) + number]
                    )
                # a sensor of another precision is the one under its prior and the one beside it
                # together
                else:
                    own = covariance[:, :, np.searchsorted(which, place)]
                    sensor_bias[:, :, place] = (turned[:, :, number] - own) * left[
                        part, None, place
                    ]
            sensor_bias[:, of, which] = 0.0
            np.multiply(
                sensor_bias.transpose(2, 0, 1), factor[part].T[:, :, None], out=found[:, part]
            )
            found[:, part] *= prior

        base.threads.each(fill, base.parts)
        return found

    def _contracted(
        self, part: slice, indices: Places, left: Places, places: Places, among: Places
    ) -> tuple[Array, Array]:
        """``u' G u`` (g, p + m) and ``v' G u`` (g, l, p + m), G the inverse of the members' pairs:
        v are columns `left` of the stock's `beside`, u those of the p places, then the unit vectors
        of the m members `among` them. Of some flights.
        """
        from aerodb.tracing.estimates.kernels import (
            contracted,
        )  # compiled: nothing else should wait for it

        pairs, beside = self.base.cache.pairs[part], self.base.cache.beside[part]
        units = np.searchsorted(self.members, places[among])
        squares = np.empty((len(pairs), len(places) + len(units)))
        across = np.empty((len(pairs), len(left), squares.shape[1]))
        contracted(
            pairs,
            beside,
            indices,
            self.extra,
            left,
            self.base.column[places],
            units,
            squares,
            across,
        )
        return squares, across
