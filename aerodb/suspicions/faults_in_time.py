"""Channels that part from the database with time: a gain, a zero or a delay that changes.

A fault of a channel reaches every axis on which the database lets the channel act, with one size.
Of what the database leaves of each axis, everything that motion, speed and surfaces explain is
taken off: errors of a database are functions of these, and of no time. Faults are ranked by the
likelihood of all axes together (a change point: Chow, Econometrica 28, 1960, with the place
searched for), with the samples that are independent in what the likeliest one leaves. Faults that
the flight cannot tell apart are named together.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import SETTLED, Suspicion
from aerodb.estimation import samples_per_independent
from aerodb.flight import Flight
from aerodb.nomenclature import is_surface
from aerodb.signals import played, runs
from aerodb.support import Array
from aerodb.suspicions.begin import LEFT, explained_from, explained_within
from aerodb.suspicions.changing import CHANGED, LOUDER, MISSED
from aerodb.suspicions.equation_error import RATE_OF, averaged
from aerodb.suspicions.evidence import ERRORS, FEWEST, LATE, LIKELIER
from aerodb.suspicions.in_flight import HUGE, flying
from aerodb.suspicions.surfaces import role_of

#: Kind of a suspicion of a zero that moves.
MOVED: Final = "zero"
#: Least change of an effect that is said, as a share of the database's. Speed and flaps change it
#: by less within a flight (`changing.RATIOS`).
LEAST_GAIN: Final = 0.2
#: Least change of a zero that is said [rad]: rigging and a tunnel's trim are known to a degree;
#: fuel moves a CG by as much.
LEAST_ZERO: Final = float(np.deg2rad(1.0))
#: Least change of a delay within a flight that is said [s]: a logger's buffer makes less.
LEAST_DELAY: Final = 0.05
#: Least half of a play that is said [rad]: a sound linkage has half of it.
LEAST_PLAY: Final = float(np.deg2rad(0.1))
#: Fewest equal means in a row for a channel that stands still.
HELD: Final = 3
#: Samples are averaged to this step [s]: what jumps does so within two of them.
STEP: Final = 0.1
#: Least share that a change of gain explains of what is left of the axis on which it acts most.
#: Beside right flights a database that lacks an effect makes .38 look like one.
EXPLAINED_GAIN: Final = 0.4
#: The same of a zero: an aileron in coarse steps makes .11 look like one.
EXPLAINED_ZERO: Final = 0.15
#: The same of a delay: a wing that bends makes .22 look like one.
EXPLAINED_DELAY: Final = 0.3
#: The same of a play: gusts make .26 look like one.
EXPLAINED_PLAY: Final = 0.35
#: Share of what is left of an axis from which on a fault is said to be seen there.
SEEN: Final = 0.15
#: Share of the gain of the likeliest fault from which on another is named with it. The slopes by
#: which the axes share a fault are a database's.
ALIKE: Final = 0.5
#: Half the play of a linkage that is looked for [rad]: a worn one has several times this.
PLAY: Final = float(np.deg2rad(0.5))
#: Flow angle up to which most of a flight must be for changes of its forces to be sought [rad]: an
#: aircraft that hovers has any, and no slope over it.
STEEP: Final = float(np.deg2rad(30.0))
#: Times at which a stretch may begin or end in a first search.
STRETCHES: Final = 30
#: Part of a flight that is most of it.
MOST_OF: Final = 0.9
#: When a fault acts that begins at no sample, in words.
ALWAYS: Final = "all the time"
EVENLY: Final = "over the whole flight"
#: Motion and speed on which an error of a database may depend, as they are and squared.
STATES: Final = ("alpha", "beta", "V", "mach", "p", "q", "r", "thrust")
#: Rates, whose constant delay is told by kinematics: gusts imitate it beside a database.
RATES: Final = ("p", "q", "r")
_LEAST: Final = {
    "gain": LEAST_GAIN,
    "zero": LEAST_ZERO,
    "delay": LEAST_DELAY,
    "play": LEAST_PLAY,
}
_EXPLAINED: Final = {
    "gain": EXPLAINED_GAIN,
    "zero": EXPLAINED_ZERO,
    "delay": EXPLAINED_DELAY,
    "play": EXPLAINED_PLAY,
}
_ANGLE_OF: Final = {"CY": "beta", "CZ": "alpha"}
_MEASURED_BY: Final = {**dict(zip(("Cl", "Cm", "Cn"), RATES, strict=True)), "CY": "ay", "CZ": "az"}


@dataclass(frozen=True, eq=False)
class _Axis:
    """One axis: what the database and motion leave of it (m,); orthonormal columns (m, k) of the
    motion; what they explain of the database's coefficient (m,); how many samples are
    independent."""

    left: Array
    basis: Array
    whole: Array
    independent: float

    def own(self, values: Array) -> Array:
        """What motion leaves of `values` (m,)."""
        return np.asarray(values - self.basis @ (self.basis.T @ values))

    def beside(self, values: Array) -> "_Axis":
        """The axis with one more column (m,) among the motion."""
        own = self.own(values)
        size = float(own @ own)
        if not size > LEFT * float(values @ values):
            return self
        wider = replace(self, basis=np.column_stack([self.basis, own / np.sqrt(size)]))
        return replace(wider, left=wider.own(self.left))


@dataclass(frozen=True, eq=False)
class _Fault:
    """A fault of a channel: what changes, and when, in words; axis -> what it adds per unit of the
    change (m,) and the share that it explains of what is left, the axis on which it acts most
    first; its size, the standard error, and the gain of the logarithm of the likelihood."""

    channel: str
    what: str
    when: str
    columns: Mapping[str, Array]
    shares: Mapping[str, float]
    size: float
    error: float
    likelier: float

    @property
    def axes(self) -> list[str]:
        """Axes on which it is seen."""
        return [axis for axis, share in self.shares.items() if share > SEEN]

    @property
    def is_large(self) -> bool:
        """Whether its share and its size are large enough to be said. The zero of a gyro is a
        rival only: damping is small, and any constant looks like a large one."""
        if self.what == "zero" and self.channel in RATES:
            return False
        share = next(iter(self.shares.values()))
        return share > _EXPLAINED[self.what] and abs(self.size) > self.least

    @property
    def least(self) -> float:
        """The size up to which nothing is said."""
        return LATE if (self.what, self.when) == ("delay", ALWAYS) else _LEAST[self.what]

    def is_claimed(self, tried: int) -> bool:
        """Whether it is beyond chance; each sample is tried where one is sought."""
        wanted = LIKELIER + float(np.log(tried))
        if self.when not in (ALWAYS, EVENLY):
            wanted += float(np.log(len(next(iter(self.columns.values())))))
        certain = abs(self.size) > self.least + ERRORS * self.error
        return self.is_large and certain and self.likelier > wanted


def faults_in_time(
    flight: Flight,
    slopes: Mapping[str, Mapping[str, float]],
    measured: Mapping[str, Array],
    predicted: Mapping[str, Array],
    usable: Mapping[str, NDArray[np.bool_]],
) -> list[Suspicion]:
    """Return channels that stand still while the motion goes on, or the likeliest fault that
    changes with time; empty where nothing does.

    slopes : axis -> variable -> dC/dvariable per rad. measured, predicted, usable : axis -> (n,).
    Source: `docs/method/consistency.md`, section "Against the database".
    """
    every = max(1, round(STEP / flight.step))
    judged = _judged(flight, slopes, measured, predicted, usable)
    if not judged:
        return []
    good = np.logical_and.reduce(list(judged.values()))
    rests = {a: averaged(np.where(good, measured[a] - predicted[a], np.nan), every) for a in judged}
    wholes = {a: averaged(np.where(good, predicted[a], np.nan), every) for a in judged}
    thin = {
        name: averaged(flight[name], every)
        for name in flight.channels
        if name in STATES or is_surface(name)
    }
    listed = (*rests.values(), *wholes.values(), *thin.values())
    inside = np.logical_and.reduce([np.abs(values) < HUGE for values in listed])
    if inside.sum() <= max(FEWEST, 2.0 * SETTLED / STEP):
        return []
    t = averaged(flight.time, every)[inside]
    thin = {name: values[inside] for name, values in thin.items()}
    moving = {name: values for name, values in thin.items() if np.ptp(values) > 0.0}
    held = [
        each
        for axis in judged
        if (each := _held(axis, slopes[axis], rests[axis][inside], moving, t)) is not None
    ]
    if held:
        return held
    basis = _basis(moving, len(t))
    axes = {axis: _axis(rests[axis][inside], basis, wholes[axis][inside]) for axis in judged}
    return _likeliest(axes, slopes, moving, t)


def _judged(
    flight: Flight,
    slopes: Mapping[str, Mapping[str, float]],
    measured: Mapping[str, Array],
    predicted: Mapping[str, Array],
    usable: Mapping[str, NDArray[np.bool_]],
) -> dict[str, NDArray[np.bool_]]:
    """Axis -> where it can be judged (n,), for axes that can be for as long as most."""
    flown, found = flying(flight, ()), {}
    for axis in _MEASURED_BY:
        if axis in measured and slopes.get(axis):
            good = usable[axis] & flown & np.isfinite(measured[axis] - predicted[axis])
            if not _is_steep(flight, _ANGLE_OF.get(axis, ""), good):
                found[axis] = good
    most = max((int(good.sum()) for good in found.values()), default=0)
    return {axis: good for axis, good in found.items() if 2 * int(good.sum()) > most}


def _is_steep(flight: Flight, angle: str, good: NDArray[np.bool_]) -> bool:
    """Whether the flow angle of an axis, if it has one, is beyond `STEEP` for a part of the flight
    that matters."""
    if not angle or angle not in flight.channels or not good.any():
        return False
    return bool(np.nanquantile(np.abs(flight[angle][good]), MOST_OF) > STEEP)


def _axis(rest: Array, basis: Array, whole: Array) -> _Axis:
    left = rest - basis @ (basis.T @ rest)
    independent = len(rest) / samples_per_independent(left)
    return _Axis(left, basis, basis @ (basis.T @ whole), independent)


def _likeliest(
    axes: Mapping[str, _Axis],
    slopes: Mapping[str, Mapping[str, float]],
    moving: Mapping[str, Array],
    t: Array,
) -> list[Suspicion]:
    """The likeliest fault, if it pays for all that were tried, with those that are nearly so."""
    faults = _ranked(_faults(axes, slopes, moving, t))
    found = next((fault for fault in faults if fault.is_large), None)
    if found is None:
        return []
    # What is independent is known with the fault.
    axes = {axis: _with_fault(each, found, axis) for axis, each in axes.items()}
    faults = _ranked(_faults(axes, slopes, moving, t))
    best = next((fault for fault in faults if fault.is_claimed(len(faults))), None)
    if best is None:
        return []
    least = min(ALIKE * best.likelier, best.likelier - LIKELIER)
    near = {best.channel: best}
    for each in faults:
        if each.likelier > least and any(abs(each.shares.get(a, 0.0)) > SEEN for a in best.axes):
            near.setdefault(each.channel, each)
    effect = best.what == "gain" and best.channel not in _MEASURED_BY.values()
    turned = effect or best.what == "zero"
    change = -best.size if turned else best.size
    evidence = {"change": change, "standard_error": best.error, "likelier": best.likelier}
    kind = MOVED if best.what == "zero" else CHANGED
    return [Suspicion(best.channel, kind, _words(best, list(near.values())[1:]), evidence)]


def _ranked(faults: Iterable[_Fault]) -> list[_Fault]:
    """The likeliest time of each kind of fault of each channel, the likeliest fault first."""
    likeliest: dict[tuple[str, str], _Fault] = {}
    for fault in sorted(faults, key=lambda fault: fault.likelier, reverse=True):
        likeliest.setdefault((fault.channel, fault.what), fault)
    return list(likeliest.values())


def _with_fault(axis: _Axis, fault: _Fault, name: str) -> _Axis:
    """The axis with the samples that are independent once the fault is taken off."""
    left = axis.left
    if fault.shares.get(name, 0.0) > 0.0:
        left = left - fault.size * axis.own(fault.columns[name])
    return replace(axis, independent=len(left) / samples_per_independent(left))


def _added(
    axes: Mapping[str, _Axis],
    slopes: Mapping[str, Mapping[str, float]],
    moving: Mapping[str, Array],
) -> Iterator[tuple[str, str, dict[str, Array]]]:
    """Channel, what is wrong with it, and axis -> what this adds to what the database leaves (m,),
    per unit of the fault: what is logged is the truth and the fault."""
    measured = {_MEASURED_BY[axis]: axis for axis in axes}
    names = [name for name in moving if name in STATES or role_of(name)]
    for name in dict.fromkeys((*names, *measured)):
        acts = {axis: -slopes[axis][name] for axis in axes if slopes[axis].get(name)}
        acts = acts if name in moving else {}
        own = measured.get(name)
        kinds: dict[str, Callable[[Array], Array]] = {"gain": np.asarray, "delay": _rate}
        if acts and (own is None or name in RATES):
            kinds["zero"] = np.ones_like
        if acts and is_surface(name):
            kinds["play"] = _slack
        for what, change in kinds.items():
            added = {axis: slope * change(moving[name]) for axis, slope in acts.items()}
            if own is not None and what != "zero":  # a moment follows from the rate's change
                added[own] = added.get(own, 0.0) + change(axes[own].whole)
            if added:
                yield name, what, added
    yield "qbar", "gain", {axis: -each.whole for axis, each in axes.items()}
    turning = {
        axis: np.sum([slopes[axis][rate] * moving[rate] for rate in rates], axis=0)
        for axis in axes
        if (rates := [rate for rate in RATES if rate in moving and slopes[axis].get(rate)])
    }
    if turning:
        yield "V", "gain", turning


def _rate(values: Array) -> Array:
    return np.asarray(np.gradient(values, STEP))


def _slack(values: Array) -> Array:
    return (values - played(values, PLAY)) / PLAY


def _faults(
    axes: Mapping[str, _Axis],
    slopes: Mapping[str, Mapping[str, float]],
    moving: Mapping[str, Array],
    t: Array,
) -> Iterator[_Fault]:
    """Every fault that may be: all the time, evenly over the flight, from a sample on, or within a
    stretch."""
    ramp = (t - t[0]) / (t[-1] - t[0])
    for name, what, added in _added(axes, slopes, moving):
        own = {axis: axes[axis] for axis in added}
        kinematic = name in RATES and what == "delay"
        if what in ("delay", "play") and not kinematic:
            yield from _sized(own, name, what, ALWAYS, added)
        if what == "play":
            continue
        if kinematic:
            # A delay that changes is more than one that the flight has all the time.
            own = {axis: each.beside(added[axis]) for axis, each in own.items()}
        evenly = {axis: values * ramp for axis, values in added.items()}
        yield from _sized(own, name, what, EVENLY, evenly)
        at = _begin(own, added)
        later = {axis: values * (np.arange(len(t)) >= at) for axis, values in added.items()}
        when = f"at {t[at]:.1f} s" if what == "zero" else f"from {t[at]:.1f} s on"
        found = list(_sized(own, name, what, when, later))
        yield from found
        if what == "zero":  # a stall moves a moment and lets it go; a zero that moved stays
            continue
        first, last = _stretch(own, added)
        sample = np.arange(len(t))
        part = {axis: v * ((sample >= first) & (sample < last)) for axis, v in added.items()}
        when = f"from {t[first]:.1f} to {t[last - 1]:.1f} s"
        # An end is one more time that is sought.
        needed = max((fault.likelier for fault in found), default=0.0) + LIKELIER
        for fault in _sized(own, name, what, when, part):
            if fault.likelier > needed:
                yield fault


def _begin(axes: Mapping[str, _Axis], added: Mapping[str, Array]) -> int:
    """The sample from which on a fault explains most, if each axis had a size of its own."""
    gained: Array | float = 0.0
    for axis, values in added.items():
        whole = max(float(axes[axis].left @ axes[axis].left), 1e-300)
        share = explained_from(values, axes[axis].basis, axes[axis].left) / whole
        gained = gained - axes[axis].independent * np.log(np.maximum(1.0 - share, 1e-12))
    inner = np.asarray(gained)
    edge = round(SETTLED / STEP)
    return edge + int(np.argmax(inner[edge : len(inner) - edge]))


def _stretch(axes: Mapping[str, _Axis], added: Mapping[str, Array]) -> tuple[int, int]:
    """First sample of the stretch in which a fault explains most, and of what follows it, if each
    axis had a size of its own."""
    n, edge = len(next(iter(added.values()))), round(SETTLED / STEP)
    starts = ends = np.linspace(edge, n - edge, STRETCHES, dtype=int)
    for _ in range(2):  # coarse, then near the best
        gained = np.zeros((len(starts), len(ends)))
        for axis, values in added.items():
            whole = max(float(axes[axis].left @ axes[axis].left), 1e-300)
            found = explained_within(values, axes[axis].basis, axes[axis].left, starts, ends)
            share = np.where(ends > starts[:, None], found, 0.0) / whole
            gained -= axes[axis].independent * np.log(np.maximum(1.0 - share, 1e-12))
        first, last = (int(k) for k in np.unravel_index(np.argmax(gained), gained.shape))
        begin, end = int(starts[first]), int(ends[last])
        width = (n - 2 * edge) // STRETCHES + 1
        near = np.linspace(-width, width, STRETCHES + 1, dtype=int)
        starts, ends = (np.clip(at + near, edge, n - edge) for at in (begin, end))
    return begin, max(end, begin + 1)


def _sized(
    axes: Mapping[str, _Axis], name: str, what: str, when: str, columns: Mapping[str, Array]
) -> Iterator[_Fault]:
    """The fault with the size that makes all axes together likeliest; none where motion leaves
    nothing of it."""
    parts: list[tuple[str, float, float, float]] = []
    for axis, values in columns.items():
        own, left = axes[axis].own(values), axes[axis].left
        size, whole = float(own @ own), float(left @ left)
        if size > LEFT * float(values @ values) and whole > 0.0:
            parts.append((axis, size / whole, float(own @ left) / whole, axes[axis].independent))
    if not parts:
        return
    names, (squares, common, independent) = (
        [p[0] for p in parts],
        np.array([p[1:] for p in parts]).T,
    )

    def unexplained(size: float) -> Array:
        return np.maximum(1.0 + size * (size * squares - 2.0 * common), 1e-12)

    def gain(size: float) -> float:
        return -0.5 * float(independent @ np.log(unexplained(size)))

    size = max((common / squares).tolist(), key=gain)
    for _ in range(5):  # each axis with the weight that its rest has
        weights = independent / unexplained(size)
        size = float(weights @ common) / float(weights @ squares)
    shares = 1.0 - unexplained(size)
    error = float(1.0 / np.sqrt((independent / unexplained(size)) @ squares))
    shared = {names[k]: float(shares[k]) for k in np.argsort(-squares)}
    yield _Fault(name, what, when, columns, shared, size, error, gain(size))


def _words(best: _Fault, near: Sequence[_Fault]) -> str:
    name = best.channel
    on = ", ".join(best.axes)
    rivals = "".join(f", or {each.channel} {_how(each)}" for each in near)
    if best.what == "zero":
        how = "drifts" if best.when == EVENLY else "jumps"
        other = "the mass" if best.axes[0] in _ANGLE_OF else "the CG moved"
        return (
            f"what the database leaves of {on} {how} {best.when} by as much as"
            f" {np.rad2deg(-best.size):.2g} deg of {name}. No motion explains it: the zero of the"
            f" channel changed, or {other}{rivals}"
        )
    if best.what == "play":
        return (
            f"{name} and its surface part by {2.0 * np.rad2deg(abs(best.size)):.2g} deg where the"
            f" motion turns, by the {on} of the database: a linkage has play{rivals}"
        )
    if best.what == "delay":
        return (
            f"{best.when} {name} is {abs(best.size):.2g} s {_how(best)} by the {on} of the"
            f" database{rivals}: a clock, a filter or a servo"
        )
    if name in _MEASURED_BY.values():
        return (
            f"{best.when} the measured {on} is another, by {best.size:.2g} times the database's:"
            f" {name}{rivals}, the channel or its calibration changed"
        )
    return (
        f"{best.when} the effect of {name} on {on} is another, by {-best.size:.2g} times the"
        f" database's: the channel or its calibration changed{rivals}"
    )


def _how(fault: _Fault) -> str:
    """What is wrong with a channel, after its name."""
    if fault.what == "delay":
        return "late" if fault.size < 0.0 else "early"
    return "with play" if fault.what == "play" else f"with another {fault.what}"


def _held(
    axis: str, slopes: Mapping[str, float], rest: Array, moving: Mapping[str, Array], t: Array
) -> Suspicion | None:
    """A surface or a vane whose channel stands still for stretches in which its axis goes on
    without it."""
    sensor, angle = _MEASURED_BY[axis], _ANGLE_OF.get(axis)
    own = {n: s for n, s in slopes.items() if n == angle or RATE_OF.get(role_of(n)) == sensor}
    name = max(own.keys() & moving.keys(), key=lambda n: abs(own[n]), default="")
    same = np.diff(moving[name]) == 0.0 if name else np.zeros(0, dtype=bool)
    still = np.zeros(len(t), dtype=bool)
    for first, last in runs(same, HELD):
        still[first : last + 2] = True
    if min(int(still.sum()), int((~still).sum())) < FEWEST // 4:
        return None
    # Motion explains as much of the rest where the channel moves as where it does not.
    columns = np.column_stack([np.ones_like(t), *moving.values()])
    left = rest - columns @ np.linalg.lstsq(columns[~still], rest[~still])[0]
    here, elsewhere = (float(np.sqrt(np.mean(left[where] ** 2))) for where in (still, ~still))
    does = abs(sum(own.values())) * float(np.std(moving[name][~still]))
    if not here > max(LOUDER * elsewhere, MISSED * does):
        return None
    since = float(t[int(np.argmax(still))])
    seconds = STEP * float(still.sum())
    words = (
        f"{name} stands still for {seconds:.1f} s in all, first at {since:.1f} s, and there"
        f" {here / elsewhere:.2g} times as much of {axis} is left. Its channel is clipped, or was"
        " not recorded"
    )
    return Suspicion(name, "stuck", words, {"from": since, "seconds": seconds})


def _basis(columns: Mapping[str, Array], n: int) -> Array:
    """Orthonormal columns (n, k) that span a constant, the columns and the squares of `STATES`."""
    scaled = {name: (values - values.mean()) / np.std(values) for name, values in columns.items()}
    squares = [values * values for name, values in scaled.items() if name in STATES]
    whole = np.column_stack([np.ones(n), *scaled.values(), *squares])
    own, sizes, _ = np.linalg.svd(whole, full_matrices=False)
    return np.asarray(own[:, sizes > 1e-6 * sizes[0]])
