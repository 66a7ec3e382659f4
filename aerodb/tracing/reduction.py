"""Products of all flights with the sensors taken out under their priors: once for a campaign, every vote stands beside them.

``A = H - H_s (H_ss + P)^-1 H_s'`` (TRACING, step 3). Terms that are accepted are taken out of what is left, a few columns instead
of all of them. So is a sensor that gets another precision p' instead of its p: with a column of its own once more, of precision
``p p' / (p - p')``: 0 where it is freed, -p where it is known to be right.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from aerodb.tracing.evidence import Array, Mask
from aerodb.tracing.products import Places, Products

#: A trace of ridge: a nuisance that a flight does not show must not stop the others.
RIDGE = 1e-11
#: Flights whose rows are worked on at a time: they fit into a processor's cache.
BLOCK = 256


class Stock:
    """Columns that votes stand beside, with the sensors taken out of them: each once for a campaign, when it is first asked for.

    rows (g, n, k + 1) : with the hypotheses and the residual; pairs (g, n, n) : with one another; onto (g, n, s) : what sensors
    say of them, ``(H_ss + P)^-1 H_s``; trims (g, o, n) : with the offsets' trims. The sensors come first: ``H_ss (H_ss + P)^-1 =
    1 - P (H_ss + P)^-1`` says without a difference of near numbers what is left of them. Longer than what is filled.
    """

    def __init__(self, products: Products, sensors: Places, prior: Array, inverse: Array, reach: Array, across: Array) -> None:
        """sensors : their columns; prior (s,) : P; inverse (g, s, s), reach (g, s, k + 1); across (g, o, c) : trims with all."""
        self._products, self._sensors, self._prior, self._inverse, self._reach = products, sensors, prior, inverse, reach
        self._across, self._owed = across, across[:, :, sensors]
        self._slots = {int(sensor): number for number, sensor in enumerate(sensors)}
        (flights, s, core), offsets = reach.shape, across.shape[1]
        self.rows, self.pairs = np.empty((flights, 2 * s, core)), np.empty((flights, 2 * s, 2 * s))
        self.onto, self.trims = np.empty((flights, 2 * s, s)), np.empty((flights, offsets, 2 * s))
        self.rows[:, :s] = prior[:, None] * reach
        self.onto[:, :s] = np.eye(s) - prior[:, None] * inverse
        self.pairs[:, :s, :s] = np.diag(prior) - np.outer(prior, prior) * inverse
        self.trims[:, :, :s] = prior * (self._owed @ inverse)

    def slots(self, members: Sequence[int]) -> Places:
        """Where each of the columns stands."""
        new = [member for member in members if member not in self._slots]
        if new:
            # Who stands beside a term will stand beside its companions as well.
            companions = np.flatnonzero(np.isin(self._products.base, new)).tolist()
            self._add(np.array([m for m in dict.fromkeys([*new, *companions]) if m not in self._slots], dtype=np.intp))
        return np.array([self._slots[member] for member in members], dtype=np.intp)

    def _add(self, new: Places) -> None:
        first, s, core = len(self._slots), len(self._sensors), self.rows.shape[2]
        self._slots |= {int(member): first + number for number, member in enumerate(new)}
        last = len(self._slots)
        if last > self.rows.shape[1]:
            self._grow(2 * last)
        others = np.array(list(self._slots)[s:], dtype=np.intp)
        block = self._products.block(new, np.r_[self._products.core, others])
        beside = block[:, :, self._sensors]
        onto = beside @ self._inverse
        self.onto[:, first:last] = onto
        self.rows[:, first:last] = block[:, :, :core] - beside @ self._reach
        self.rows[:, first:last, self._sensors] = onto * self._prior
        pairs = block[:, :, core:] - beside @ self.onto[:, s:last].transpose(0, 2, 1)
        pairs = np.concatenate([onto * self._prior, pairs], axis=2)
        self.pairs[:, first:last, :last] = pairs
        self.pairs[:, :last, first:last] = pairs.transpose(0, 2, 1)
        self.trims[:, :, first:last] = self._across[:, :, new] - self._owed @ onto.transpose(0, 2, 1)

    def among(self, slots: Places) -> Array:
        """(g, n, n) copy of `pairs`."""
        return self.pairs.reshape(len(self.pairs), -1).take(slots[:, None] * self.pairs.shape[2] + slots, axis=1)

    def _grow(self, size: int) -> None:
        """Room for `size` columns."""

        def wider(array: Array, axes: tuple[int, ...]) -> Array:
            found = np.empty([size if axis in axes else length for axis, length in enumerate(array.shape)])
            found[tuple(slice(length) for length in array.shape)] = array
            return found

        self.rows, self.pairs = wider(self.rows, (1,)), wider(self.pairs, (1, 2))
        self.onto, self.trims = wider(self.onto, (1,)), wider(self.trims, (2,))


class Reduced:
    """Products without the sensors: what votes are without any term, and what they need for some.

    sensors (s,) : their places; precision (s,) : scaled, of their priors. inverse (g, s, s) : ``(H_ss + P)^-1``;
    reach (g, s, k + 1) : that times ``H_s``. own, left, right (g, k) : ``H_hh``, ``A_hh`` and ``A_hy`` of the hypotheses.
    level, spread (g, o), owed (g, o, s) : of the offsets beside the sensors alone, their level, the spread that these
    add, and what it owes them.
    """

    def __init__(self, products: Products, sensors: Sequence[int], precision: Array) -> None:
        """precision (columns,) : scaled, 0 for what is no sensor."""
        self.products, self.sensors = products, np.array(sensors, dtype=np.intp)
        self.number = np.full(len(products.base), -1)  # column -> which sensor it is
        self.number[self.sensors] = np.arange(len(self.sensors))
        self.precision = precision[self.sensors]
        self.prior = self.precision + RIDGE
        matrix, k = products.matrix, products.hypotheses
        beside = matrix[:, self.sensors]
        self.inverse = _inverse(beside[:, :, self.sensors] + np.diag(self.prior))
        self.reach: Array = self.inverse @ beside
        self.own = np.diagonal(matrix, axis1=1, axis2=2)[:, :k].copy()
        self.left: Array = self.own - np.einsum("gsk,gsk->gk", beside[:, :, :k], self.reach[:, :, :k])
        self.right: Array = matrix[:, :k, -1] - np.einsum("gsk,gs->gk", beside[:, :, :k], self.reach[:, :, -1])
        self.weight, across = products.constants()
        on = across[:, :, self.sensors]
        self.owed: Array = on @ self.inverse
        self.level: Array = across[:, :, -1] - _along(on, self.reach[:, :, -1])
        self.spread: Array = (self.owed * on).sum(axis=2)
        self.stock = Stock(products, self.sensors, self.prior, self.inverse, self.reach, across)

    def beside(self, prior: Mapping[int, float], freed: Sequence[int], fixed: Sequence[int]) -> "Solved":
        """Votes beside the terms and companions of `prior` (place -> scaled precision), sensors `freed` of it, and `fixed` ones.

        A hypothesis that is itself a nuisance is estimated beside the others, its own prior left out; a sensor that is known to
        be right has no vote.
        """
        of = dict(zip(self.sensors.tolist(), self.prior.tolist(), strict=True))
        extra = {place: each + RIDGE for place, each in (dict(prior) | dict.fromkeys(freed, 0.0)).items()}
        extra |= {sensor: -of[sensor] for sensor in fixed}  # exactly: beside a weak prior, a ridge would free it instead
        members = sorted(extra)
        slots = self.stock.slots(members)
        among = self.stock.among(slots)
        among += np.diag([extra[member] for member in members])
        changed = np.zeros(len(self.sensors), dtype=bool)
        changed[self.number[[*freed, *fixed]]] = True
        return Solved(self, np.array(members, dtype=np.intp), slots, _inverse(among), changed, frozenset(freed))


@dataclass(frozen=True)
class Solved:
    """What is taken out of the products beyond the sensors. members (n,), in `slots` of the stock; inverse (g, n, n).

    changed (s,) : sensors of another precision than their prior's; freed : those of none.
    """

    base: Reduced
    members: Places
    slots: Places
    inverse: Array
    changed: Mask
    freed: frozenset[int]

    @cached_property
    def value(self) -> Array:
        """(g, n) of the members."""
        return _along(self.inverse, self.base.stock.rows[:, self.slots, -1])

    @property
    def _onto(self) -> Array:
        """(g, n, s) of the members."""
        return self.base.stock.onto[:, self.slots]

    @cached_property
    def _posterior(self) -> tuple[Array, Array]:
        """Variance and mean (g, s) of the sensors beside the members."""
        base, onto = self.base, self._onto
        variance = np.diagonal(base.inverse, axis1=1, axis2=2) + np.einsum("gns,gns->gs", onto, self.inverse @ onto)
        return variance, base.reach[:, :, -1] - (self.value[:, None] @ onto)[:, 0]

    def _rows(self, places: Places) -> Array:
        """(g, n, places) of the members with hypotheses."""
        rows = self.base.stock.rows
        if len(places) == self.base.products.hypotheses:
            return rows[:, self.slots, :-1]
        return rows.reshape(len(rows), -1).take(self.slots[:, None] * rows.shape[2] + places, axis=1)

    def _others(self, places: Places) -> "slice | Places":
        """Which of the places, each given once, are no members: all of them where these are all hypotheses, in order."""
        if len(places) == self.base.products.hypotheses:
            return slice(None)
        other = np.ones(len(self.base.number), dtype=bool)
        other[self.members] = False
        return np.flatnonzero(other[places])

    def _sensors(self, places: Places) -> tuple[Places, Places]:
        """Which of the places are sensors, and which sensors these are."""
        number = self.base.number[places]
        which = np.flatnonzero(number >= 0)
        return which, number[which]

    def at(self, places: Places) -> tuple[Array, Array, Array]:
        """Schur complements (g, places), scaled: own ``H_hh``, left ``A_hh``, right ``A_hy``."""
        base, others = self.base, self._others(places)
        own, left, right = base.own[:, places], base.left[:, places], base.right[:, places]
        rows = self._rows(places[others])
        left[:, others] -= np.einsum("gnk,gnk->gk", rows, self.inverse @ rows)
        right[:, others] -= (self.value[:, None] @ rows)[:, 0]
        # A nuisance's posterior mean and variance, with its own prior taken out again.
        which, of = self._sensors(places)
        if which.size:
            variance, mean = (each[:, of] for each in self._posterior)
            left[:, which], right[:, which] = 1.0 / variance - base.precision[of], mean / variance
        for number, column in self._among(places):
            left[:, column], right[:, column] = self.member(number)
        for number, column in self._offsets(places):
            own[:, column] = base.weight[:, number]
            left[:, column], right[:, column] = (each[:, number] for each in self._trims)
        return own, left, right

    def member(self, number: int) -> tuple[Array, Array]:
        """``A_hh`` and ``A_hy`` (g,) of one of the members."""
        member, spread, value = int(self.members[number]), self.inverse[:, number, number], self.value[:, number]
        if self.base.number[member] < 0:
            return 1.0 / spread, value / spread
        if member not in self.freed:
            return np.zeros_like(spread), np.zeros_like(spread)
        # Its column is taken out under its prior already; what is left of it is less by what that prior is worth.
        prior = self.base.prior[self.base.number[member]]
        rest = np.maximum(1.0 / spread - RIDGE, np.finfo(np.float64).tiny)
        left = 1.0 / (1.0 / rest - 1.0 / prior)
        return left, left * value / (spread * rest)

    def _among(self, places: Places) -> list[tuple[int, int]]:
        """Number of each member that is among the places, and where it is there."""
        at = {int(place): column for column, place in enumerate(places)}
        return [(number, at[int(member)]) for number, member in enumerate(self.members) if int(member) in at]

    def _offsets(self, places: Places) -> list[tuple[int, int]]:
        """Number of each offset that is among the places, and where it is there."""
        at = {int(place): column for column, place in enumerate(places)}
        return [(number, at[place]) for number, place in enumerate(self.base.products.offsets) if place in at]

    @cached_property
    def _trims(self) -> tuple[Array, Array]:
        """``A_hh`` and ``A_hy`` (g, o) of the offsets."""
        base, beyond = self.base, self.base.stock.trims[:, :, self.slots]
        spread = base.spread + np.einsum("gon,gon->go", beyond @ self.inverse, beyond)
        shown = base.weight > 0.0
        left = np.where(shown, 1.0 / (1.0 / np.where(shown, base.weight, 1.0) + spread), 0.0)
        return left, left * (base.level - _along(beyond, self.value))

    def leak(self, places: Places, left: Array) -> Array:
        """(g, s, places): what a scaled unit of error of a sensor adds to `right` despite its prior; 0 for a changed one.

        left (g, places) : as `at` gave it.
        """
        base, onto = self.base, self._onto
        turned = self.inverse @ onto  # (g, n, s), minus the members' covariance with the sensors
        leak, others = base.reach.take(places, axis=2), self._others(places)
        leak[:, :, others] -= turned.transpose(0, 2, 1) @ self._rows(places[others])
        which, of = self._sensors(places)
        among = base.inverse[:, :, of] + turned.transpose(0, 2, 1) @ onto[:, :, of]
        leak[:, :, which] = -(among / self._posterior[0][:, None, of])
        column_of = dict(zip(which.tolist(), range(len(which)), strict=True))
        for number, column in self._among(places):
            if column in column_of:  # a sensor of another precision is the one under its prior and the one beside it together
                leak[:, :, column] = (turned[:, number] - among[:, :, column_of[column]]) * left[:, column, None]
            else:
                leak[:, :, column] = turned[:, number] / self.inverse[:, number, number, None]
        prior = np.where(self.changed, 0.0, base.precision)
        leak *= prior[:, None]
        leak[:, of, which] = 0.0
        for number, column in self._offsets(places):
            beyond = base.stock.trims[:, number][:, self.slots]
            owed = base.owed[:, number] - (beyond[:, None] @ turned)[:, 0]
            leak[:, :, column] = owed * prior * left[:, column, None]
        return leak


def _along(matrices: Array, vectors: Array) -> Array:
    """(g, m): matrices (g, m, n) times vectors (g, n)."""
    return np.asarray((matrices @ vectors[:, :, None])[:, :, 0])


def _inverse(matrices: Array) -> Array:
    return np.asarray(np.linalg.inv(matrices), dtype=np.float64)
