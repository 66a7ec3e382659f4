"""Errors of sensors that explain what declared increments would change.

A declared increment takes whatever its columns can: a surface whose zero is off, a vane with a
wrong scale, a centre of gravity elsewhere. What counts is what the update *changes* along its
flights, and what the axes that it leaves alone say of the same error: docs/method/updates.md,
section "Gate".
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.special import stdtrit

from aerodb.effects import FlightView, Hypothesis
from aerodb.loop.flight_source import FlightSource
from aerodb.loop.frozen_library import Library
from aerodb.signals import rms
from aerodb.support import (
    CLAIM,
    DIFFERENCE,
    HALF,
    NEARLY_ALL,
    NEGLIGIBLE,
    NOTABLE,
    QUARTER,
    SMALL,
    Array,
)
from aerodb.tables import AeroDatabase

#: Least effect of a sensor's error on an axis with which it is a rival of the increments: a part of
#: what they change.
_LEAST: Final = SMALL
#: Share of a change's mean square from which an error explains all of it (dimensionless).
#: An increment with noise leaves as much.
_EXPLAINS: Final = NEARLY_ALL
#: Least share of a change's mean square that an error shown by other axes takes (dimensionless).
#: Less is not what the update changes.
_TAKES: Final = HALF
#: Rms of a change, in rms of the residual, that no flight tells from none (dimensionless).
#: A few thousand coloured samples know a mean to a tenth of their scatter.
_UNSEEN: Final = SMALL
#: The same up to which an axis of a change may be left unexplained: several terms of one axis move
#: it by more than one does.
_HARDLY_SEEN: Final = NOTABLE
#: Part of an error's size by which axes may disagree about it (dimensionless).
#: Columns are tangents, right for small errors.
_TANGENT: Final = QUARTER
#: Believable zero of a surface that nobody measured, in the library's range (dimensionless).
#: A rigging of 5 deg is seen in flight, and the library believes 3.4 deg.
_UNMEASURED: Final = 2.0
#: Length of the stretches whose scores are independent of each other [s]: several periods of the
#: short-period motion.
_STRETCH: Final = 5.0
#: Rms change, as a part of the rms residual of an axis, up to which an axis is left alone
#: (dimensionless): rounding.
_CHANGED: Final = NEGLIGIBLE


@dataclass(frozen=True)
class SensorRival:
    """The error of a sensor, a surface or the vehicle data that explains what increments change.

    Parameters
    ----------
    hypothesis, parameter, unit : of the library, SI. value, ci95 : its size and interval, SI.
    because : what would be wrong, and what shows it.
    shares : axis -> rms effect of the error on the prediction, as a part of the rms that the
        increments change there.
    """

    hypothesis: str
    parameter: str
    unit: str
    value: float
    ci95: tuple[float, float]
    because: str
    shares: dict[str, float]


def sensor_rivals(
    source: FlightSource,
    flights: Sequence[str],
    baseline: AeroDatabase,
    candidate: AeroDatabase,
    library: Library,
) -> tuple[SensorRival, ...]:
    """Return the errors of sensors, surfaces and vehicle data that explain what `candidate` changes
    of `baseline` along these flights (ids), in SI units.

    Either one believable size explains the whole change, and the axes that do not change do not
    contradict it; or these axes show an error that is a part of the change. Raises InputError where
    a flight lacks what is needed.
    """

    def seen(flight: str) -> _Seen:
        bandwidth = library.settings.bandwidth
        before = source.view(flight, baseline, bandwidth)
        return _seen(before, source.view(flight, candidate, bandwidth))

    change = _Change([seen(flight) for flight in flights])
    if not change.is_seen:
        return ()
    sensors = [each for each in library.hypotheses if each.kind == "sensor"]
    found = [each for sensor in sensors if (each := _explains(change, sensor)) is not None]
    zeros = [each for each in sensors if each.effect == "surface_bias" and each.known_by]
    found = [each for each in found if not any(_is_beyond(change, each, zero) for zero in zeros)]
    return tuple(
        SensorRival(
            each.hypothesis.id,
            each.hypothesis.parameter,
            each.hypothesis.unit,
            each.size,
            (each.size - each.half, each.size + each.half),
            each.hypothesis.because,
            shares,
        )
        for each in _best(change, found)
        if (shares := _shares(change, each.columns, each.size))
    )


@dataclass(frozen=True)
class _Seen:
    """One flight: its view beside the baseline; axis -> usable samples (m,), what the update
    changes (m,), and what it leaves of the residual (m,)."""

    view: FlightView
    rows: Mapping[str, NDArray[np.intp]]
    changed: Mapping[str, Array]
    left: Mapping[str, Array]
    views: dict[str, FlightView] = field(default_factory=dict, repr=False)

    def measured(self, axis: str) -> FlightView:
        """The view with the measured loads of all axes but one."""
        if axis not in self.views:
            self.views[axis] = self.view.as_measured(axis)
        return self.views[axis]


def _seen(before: FlightView, after: FlightView) -> _Seen:
    rows, changed, left = {}, {}, {}
    for axis, usable in before.usable.items():
        rows[axis] = np.flatnonzero(usable & after.usable.get(axis, usable))
        predicted = (view.comparison.predicted[axis][rows[axis]] for view in (before, after))
        old, new = predicted
        changed[axis] = new - old
        left[axis] = before.comparison.measured[axis][rows[axis]] - new
    return _Seen(before, rows, changed, left)


@dataclass(frozen=True)
class _Shown:
    """What the axes that an update leaves alone show of an error: its size and standard error (SI),
    and the degrees of freedom of the latter; an infinite error where they show nothing."""

    size: float
    error: float
    freedom: int

    def excludes(self, size: float, rate: float) -> bool:
        """Whether the error is not of this size (SI), at a rate of false alarms."""
        most = float(stdtrit(max(self.freedom, 1), 1.0 - 0.5 * rate))
        return abs(self.size - size) > most * self.error + _TANGENT * abs(size)


@dataclass(frozen=True)
class _Change:
    """What an update changes along all flights."""

    flights: Sequence[_Seen]

    @cached_property
    def floors(self) -> dict[str, float]:
        """Axis -> rms of the residual that is left about each flight's mean, a dimensionless
        scalar; the weight of an axis is its inverse square. None of an axis without residual."""
        axes = dict.fromkeys(axis for each in self.flights for axis in each.left)
        centred = {
            axis: [_about_mean(each.left[axis]) for each in self.flights if axis in each.left]
            for axis in axes
        }
        sizes = {
            axis: rms(joined)
            for axis, parts in centred.items()
            if len(joined := np.concatenate(parts))
        }
        return {axis: size for axis, size in sizes.items() if size > 0.0}

    @cached_property
    def sizes(self) -> dict[str, float]:
        """Axis -> rms of the change, in floors."""
        return {
            axis: rms(np.concatenate([f.changed[axis] for f in self.flights if axis in f.changed]))
            / floor
            for axis, floor in self.floors.items()
        }

    @cached_property
    def axes(self) -> frozenset[str]:
        """The axes that change."""
        return frozenset(axis for axis, size in self.sizes.items() if size > _CHANGED)

    @property
    def is_seen(self) -> bool:
        """Whether flights tell the change from none."""
        return any(size > _UNSEEN for size in self.sizes.values())

    def beside(
        self, columns: Sequence[Mapping[str, Array]], axis: str
    ) -> tuple[float, float, float, int]:
        """Products on an axis: column with itself, with the change, change with itself, samples."""
        pairs = [
            (column.get(axis, np.zeros_like(each.changed[axis])), each.changed[axis])
            for each, column in zip(self.flights, columns, strict=True)
            if axis in each.changed
        ]
        return (
            sum(float(c @ c) for c, _ in pairs),
            sum(float(c @ d) for c, d in pairs),
            sum(float(d @ d) for _, d in pairs),
            sum(len(d) for _, d in pairs),
        )

    def is_explained(self, columns: Sequence[Mapping[str, Array]], axis: str, size: float) -> bool:
        """Whether an error of this size (SI) leaves hardly anything of the change on an axis, or no
        more of what was measured there than the update does."""
        c, x, d, n = self.beside(columns, axis)
        least = n * (_HARDLY_SEEN * self.floors[axis]) ** 2
        if size * (size * c - 2.0 * x) + d <= (1.0 - _EXPLAINS) * d + least:
            return True
        by_update, by_error = 0.0, 0.0
        for each, column in zip(self.flights, columns, strict=True):
            if axis in each.left:
                left = each.left[axis]
                other = left + each.changed[axis] - size * column.get(axis, np.zeros_like(left))
                by_update += float(left @ left)
                by_error += float(other @ other)
        return bool(by_error <= by_update + least)

    def errors(self, columns: Sequence[Mapping[str, Array]], size: float) -> Array:
        """Square errors per stretch (k,), in floors, of an error of this size (SI) alone."""
        totals: dict[float, float] = {}
        for number, (each, column) in enumerate(zip(self.flights, columns, strict=True)):
            for axis, floor in self.floors.items():
                if not len(each.rows.get(axis, ())):
                    continue
                c = size * column[axis] if axis in column else 0.0
                left = (each.left[axis] + each.changed[axis] - c) / floor
                left = left if axis in self.axes else _about_mean(left)
                stretch = each.view.time[each.rows[axis]] // _STRETCH + 1e6 * number
                names, which = np.unique(stretch, return_inverse=True)
                for name, value in zip(names, np.bincount(which, left**2), strict=True):
                    totals[name] = totals.get(name, 0.0) + float(value)
        return np.array([totals[name] for name in sorted(totals)])

    def shown(
        self,
        columns: Sequence[Mapping[str, Array]],
        measured: Sequence[Mapping[str, Array]] | None = None,
    ) -> _Shown:
        """What the other axes show, by what varies in each flight; errors follow from the scores of
        stretches (Liang & Zeger, Biometrika 73, 1986).

        measured : the columns by the measured loads of other axes, as instruments (Wright, 1928).
        """
        parts: list[tuple[Array, Array, Array, Array]] = []
        for number, (each, column, other) in enumerate(
            zip(self.flights, columns, measured or columns, strict=True)
        ):
            for axis, floor in self.floors.items():
                if axis in self.axes or not len(column.get(axis, ())):
                    continue
                stretch = each.view.time[each.rows[axis]] // _STRETCH + 1e6 * number
                c, y, z = (
                    _about_mean(values) / floor
                    for values in (column[axis], each.left[axis], other.get(axis, column[axis]))
                )
                parts.append((c, y, z, stretch))
        square = sum(float(z @ c) for c, _, z, _ in parts)
        if square <= 0.0:
            return _Shown(0.0, np.inf, 1)
        size = sum(float(z @ y) for _, y, z, _ in parts) / square
        scores = np.concatenate([z * (y - size * c) for c, y, z, _ in parts])
        _, which = np.unique(np.concatenate([s for *_, s in parts]), return_inverse=True)
        score = np.bincount(which, scores)
        freedom = max(len(score) - 1, 1)
        error = np.sqrt(float(score @ score) * len(score) / freedom) / square
        return _Shown(size, float(error) if len(score) > 1 else np.inf, freedom)


def _about_mean(values: Array) -> Array:
    return values - values.mean() if len(values) else values


@dataclass(frozen=True)
class _Explains:
    """An error that explains a change: its columns per flight, its size and half interval (SI)."""

    hypothesis: Hypothesis
    columns: Sequence[Mapping[str, Array]]
    size: float
    half: float


def _explains(change: _Change, hypothesis: Hypothesis) -> _Explains | None:
    """The error of a hypothesis, if it explains the change. Its columns are those of its size,
    where that matters."""
    columns = _columns(change, hypothesis, 0.0)
    if columns is None:
        return None
    cc, cd, dd = _products(change, columns)
    if cc <= 0.0 or dd <= 0.0 or not np.isfinite(cc + dd):
        return None
    if hypothesis.secant is not None and _believable(hypothesis, cd / cc):
        columns = _columns(change, hypothesis, cd / cc) or columns
        cc, cd, dd = _products(change, columns)
    shown, size = change.shown(columns), cd / cc
    whole = _believable(hypothesis, size) and all(
        change.is_explained(columns, axis, size) for axis in sorted(change.axes)
    )
    if whole and shown.excludes(size, DIFFERENCE):
        # Noise of beta is in the side force that the database predicts, and in the residual of yaw:
        # it makes a size of its own. It is not in the side force that accelerometers measure; but
        # with an arm, noise of rdot is. What is excluded is so by both.
        other = change.shown(columns, _by_measured_loads(change, hypothesis, size))
        whole = not other.excludes(size, DIFFERENCE)
        shown = other if whole else shown
    part = (
        np.isfinite(shown.error)
        and shown.excludes(0.0, CLAIM)
        and _believable(hypothesis, shown.size)
        and 2.0 * shown.size * cd - shown.size**2 * cc >= _TAKES * dd
    )
    if not whole and not part:
        return None
    error = shown.error if np.isfinite(shown.error) else abs(size)
    half = float(stdtrit(shown.freedom, 1.0 - 0.025)) * error
    return _Explains(hypothesis, columns, size if whole else shown.size, half)


def _is_beyond(change: _Change, found: _Explains, zero: Hypothesis) -> bool:
    """Whether an error of a surface is one of its zero along these flights, which are as far on one
    side of it, and a larger one than was measured."""
    if found.hypothesis.subject != zero.subject or found.hypothesis is zero:
        return False
    columns = _columns(change, zero, 0.0)
    if columns is None:
        return False
    own = cross = square = 0.0
    for axis in change.axes:
        for column, other in zip(found.columns, columns, strict=True):
            if axis in column and axis in other:
                c, z = column[axis] / change.floors[axis], other[axis] / change.floors[axis]
                own, cross, square = own + float(c @ c), cross + float(c @ z), square + float(z @ z)
    alike = cross * cross > _EXPLAINS * own * square
    return bool(alike and not _believable(zero, found.size * cross / square))


def _columns(
    change: _Change, hypothesis: Hypothesis, size: float
) -> list[Mapping[str, Array]] | None:
    """The columns of an error of a size (SI) per flight, axis -> (m,); None where a flight lacks
    what it needs."""
    if not all(each.view.has(hypothesis.needs) for each in change.flights):
        return None
    made = [(each, hypothesis.columns(each.view, size)) for each in change.flights]
    return [{a: all_[a][rows] for a, rows in each.rows.items() if a in all_} for each, all_ in made]


def _by_measured_loads(
    change: _Change, hypothesis: Hypothesis, size: float
) -> list[Mapping[str, Array]]:
    """The same of the axes that do not change, by the measured loads of all other axes."""
    found = list[Mapping[str, Array]]()
    for each in change.flights:
        columns = {}
        for axis in each.rows.keys() - change.axes:
            made = hypothesis.columns(each.measured(axis), size)
            if axis in made:
                columns[axis] = made[axis][each.rows[axis]]
        found.append(columns)
    return found


def _products(
    change: _Change, columns: Sequence[Mapping[str, Array]]
) -> tuple[float, float, float]:
    """Products over all axes that change, in floors: column with itself, with the change, and
    change with itself."""
    pairs = {axis: change.beside(columns, axis) for axis in sorted(change.axes)}
    weights = {axis: change.floors[axis] ** -2 for axis in pairs}
    cc, cd, dd = (
        sum(weights[axis] * float(products[k]) for axis, products in pairs.items())
        for k in range(3)
    )
    return cc, cd, dd


def _best(change: _Change, found: Sequence[_Explains]) -> list[_Explains]:
    """Those that leave no larger error than the best of them, stretch after stretch."""
    if len(found) < 2:
        return list(found)
    errors = [change.errors(each.columns, each.size) for each in found]
    best = min(errors, key=lambda each: float(each.sum()))
    most = float(stdtrit(max(len(best) - 1, 1), 1.0 - 0.5 * DIFFERENCE))
    kept = []
    for each, own in zip(found, errors, strict=True):
        more = own - best
        if more.mean() <= most * more.std(ddof=1) / np.sqrt(len(more)) or own is best:
            kept.append(each)
    return kept


def _believable(hypothesis: Hypothesis, size: float) -> bool:
    """Whether an error may be of this size (SI); what was measured may be off as far as stated."""
    is_rigging = hypothesis.effect == "surface_bias" and not hypothesis.known_by
    factor = _UNMEASURED if is_rigging else 1.0
    low, high = (factor * end for end in hypothesis.plausible)
    return low <= size <= high


def _shares(
    change: _Change, columns: Sequence[Mapping[str, Array]], value: float
) -> dict[str, float]:
    """Axis -> share (`SensorRival.shares`), where it is at least `_LEAST`."""
    shares = {}
    for axis in change.floors:
        if axis not in change.axes:
            continue
        pairs = [
            (column[axis], each.changed[axis])
            for each, column in zip(change.flights, columns, strict=True)
            if axis in column
        ]
        own, whole = (rms(np.concatenate(parts)) for parts in zip(*pairs, strict=True))
        if own * abs(value) >= _LEAST * whole:
            shares[axis] = own * abs(value) / whole
    return shares
