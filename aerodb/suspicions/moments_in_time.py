"""Coefficients that part from the database with time: a zero, an effect or a delay that changes.

Of what the database leaves of an axis, everything that motion, speed and surfaces explain is taken
off. No aerodynamics makes the rest grow evenly over a flight, or change at a sample and stay (a
change point: Chow, Econometrica 28, 1960, with the place searched for). What changes is sought
among the causes of the axis: its surface, its flow angle, and the sensor that measures the axis.
Causes that the flight cannot tell apart are named together.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import SETTLED, Suspicion
from aerodb.estimation import least_squares, samples_per_independent
from aerodb.flight import Flight
from aerodb.nomenclature import MOMENT_AXES, is_surface
from aerodb.signals import played, runs
from aerodb.support import Array
from aerodb.suspicions.changing import CHANGED, LOUDER, MISSED
from aerodb.suspicions.equation_error import averaged
from aerodb.suspicions.evidence import ERRORS, FEWEST, LATE, LIKELIER
from aerodb.suspicions.in_flight import HUGE, flying
from aerodb.suspicions.surfaces import role_of

#: Kind of a suspicion of a zero that moves.
MOVED: Final = "zero"
#: Least change of a zero that is said [rad]. Rigging and a tunnel's trim are known to a degree;
#: fuel moves a CG by as much.
LEAST: Final = float(np.deg2rad(2.0))
#: Least change of an effect that is said, as a share of the database's. Speed and flaps
#: change it by less within a flight (`changing.RATIOS`).
LEAST_GAIN: Final = 0.25
#: Fewest equal means in a row for a channel that stands still.
HELD: Final = 3
#: Least share of a change's squares that motion must leave of it.
LEFT: Final = 1e-6
#: Samples are averaged to this step [s]: what jumps does so within two of them.
STEP: Final = 0.1
#: Least share of a cause's squares before and after a change.
SIDE: Final = 0.1
#: Sensors of forces, whose scale or sign may change; flight-path reconstruction sees that of rates.
FORCES: Final = ("ay", "az")
#: Sensors of moments, whose constant delay is sought beside kinematics, without the database.
RATES: Final = ("p", "q", "r")
#: Least share of what is left of an axis that a change explains: noise may hold the rest.
EXPLAINED: Final = 0.45
#: The same of a delay or a play, which errors of derivatives do not imitate.
EXPLAINED_DELAY: Final = 0.35
#: The same of a zero, which no error of a derivative imitates. Where gusts hold the rest, a jump of
#: 4 deg is a fifth of it.
EXPLAINED_ZERO: Final = 0.15
#: Share of what the likeliest cause explains from which on another is named with it: slopes are
#: straight lines.
ALIKE: Final = 0.7
#: Half the play of a linkage that is looked for [rad]: a sound one has .05 deg, a worn one several.
PLAY: Final = float(np.deg2rad(0.5))
#: Least half of a play that is said [rad].
LEAST_PLAY: Final = float(np.deg2rad(0.2))
#: Flow angle up to which most of a flight must be for changes of its forces to be sought [rad]: an
#: aircraft that hovers has any, and no slope over it.
STEEP: Final = float(np.deg2rad(30.0))
#: Part of a flight that is most of it.
MOST_OF: Final = 0.9
#: When a change acts that begins at no sample, in words.
ALWAYS: Final = "all the time"
EVENLY: Final = "over the whole flight"
#: Least change of a delay within a flight that is said [s]: a logger's buffer makes less.
LEAST_DELAY: Final = 0.1
_EXPLAINED: Final = {
    "gain": EXPLAINED,
    "delay": EXPLAINED_DELAY,
    "play": EXPLAINED_DELAY,
    "zero": EXPLAINED_ZERO,
}
_LEAST: Final = {"gain": LEAST_GAIN, "delay": LEAST_DELAY, "zero": LEAST, "play": LEAST_PLAY}
#: Motion and speed on which an error of a database may depend, as they are and squared.
STATES: Final = ("alpha", "beta", "V", "mach", "p", "q", "r", "thrust")
#: Of each axis: the role of its surfaces, its flow angle, and the sensor that measures it.
_CAUSES: Final = {
    "Cm": ("pitch", "", "q"),
    "Cl": ("roll", "", "p"),
    "Cn": ("yaw", "", "r"),
    "CZ": ("", "alpha", "az"),
    "CY": ("", "beta", "ay"),
}


@dataclass(frozen=True, eq=False)
class _Cause:
    """What may change with time: its name, its slope on the axis (per rad; 1 for the sensor of the
    whole axis), and its values (m,)."""

    name: str
    slope: float
    values: Array
    is_angle: bool


@dataclass(frozen=True, eq=False)
class _Change:
    """A change of a cause: of its zero, gain or delay, or play in its linkage; when in words; the
    column (m,) that it adds per unit of change times slope, what explains the rest of the axis
    (m, k), and the share of what that leaves which the change explains."""

    cause: _Cause
    what: str
    when: str
    column: Array
    basis: Array
    share: float


def moved_zeros(
    flight: Flight,
    slopes: Mapping[str, Mapping[str, float]],
    measured: Mapping[str, Array],
    predicted: Mapping[str, Array],
    usable: Mapping[str, NDArray[np.bool_]],
) -> list[Suspicion]:
    """Return what changes with time on the axes of the database; of each channel the likeliest.

    slopes : axis -> variable -> dC/dvariable per rad. measured, predicted, usable : axis -> (n,).
    Source: `docs/method/consistency.md`, section "Against the database".
    """
    found: dict[str, Suspicion] = {}
    for axis in _CAUSES:
        if axis not in measured or not slopes.get(axis):
            continue
        rest = measured[axis] - predicted[axis]
        good = usable[axis] & np.isfinite(rest) & flying(flight, ())
        if _is_steep(flight, _CAUSES[axis][1], good):
            continue
        for each in _moved(flight, axis, slopes[axis], rest, predicted[axis], good):
            known = found.get(each.channel)
            if known is None or each.evidence.get("likelier", 0.0) > known.evidence["likelier"]:
                found[each.channel] = each
    return list(found.values())


def _is_steep(flight: Flight, angle: str, good: NDArray[np.bool_]) -> bool:
    """Whether the flow angle of an axis, if it has one, is beyond `STEEP` for a part of the flight
    that matters."""
    if not angle or angle not in flight.channels or not good.any():
        return False
    return bool(np.nanquantile(np.abs(flight[angle][good]), MOST_OF) > STEEP)


def _moved(
    flight: Flight,
    axis: str,
    slopes: Mapping[str, float],
    rest: Array,
    predicted: Array,
    good: NDArray[np.bool_],
) -> list[Suspicion]:
    """The change of one axis, if there is one."""
    every = max(1, round(STEP / flight.step))
    step = every * flight.step
    thin = {"": averaged(np.where(good, rest, np.nan), every)}
    for each in flight.channels:
        if (each in STATES or is_surface(each)) and np.ptp(flight[each][good]) > 0.0:
            thin[each] = averaged(flight[each], every)
    whole = averaged(np.where(good, predicted, np.nan), every)
    inside = np.logical_and.reduce([np.abs(values) < HUGE for values in (*thin.values(), whole)])
    if inside.sum() < max(FEWEST, 2.0 * SETTLED / step):
        return []
    thin = {name: values[inside] for name, values in thin.items()}
    y, t = thin.pop(""), averaged(flight.time, every)[inside]
    causes = _causes(axis, slopes, thin, whole[inside])
    surface = next((each for each in causes if is_surface(each.name)), None)
    if surface is not None and surface.name in thin:
        held = _held(axis, surface, y, list(thin.values()), t)
        if held is not None:
            return [held]
    basis = _basis(list(thin.values()), len(y))
    left = y - basis @ (basis.T @ y)
    edge = round(SETTLED / step)
    best: dict[str, _Change] = {}
    for change in _changes(causes, basis, left, t, edge):
        known = best.get(change.cause.name)
        if known is None or change.share > known.share:
            best[change.cause.name] = change
    ranked = sorted(best.values(), key=lambda change: -change.share)
    if not ranked or not ranked[0].share > _EXPLAINED[ranked[0].what]:
        return []
    return _claim(axis, ranked, y)


def _causes(
    axis: str, slopes: Mapping[str, float], thin: Mapping[str, Array], whole: Array
) -> list[_Cause]:
    role, angle, sensor = _CAUSES[axis]
    causes = [_Cause(sensor, 1.0, whole, False)]
    own = {n: s for n, s in slopes.items() if role and role_of(n) == role and s != 0.0}
    if own:
        name = max(own, key=lambda n: abs(own[n]))
        values = thin.get(name, np.zeros_like(whole))
        causes.append(_Cause(name, sum(own.values()), values, True))
    if slopes.get(angle) and angle in thin:
        causes.append(_Cause(angle, slopes[angle], thin[angle], True))
    return causes


def _changes(
    causes: Sequence[_Cause], basis: Array, left: Array, t: Array, edge: int
) -> Iterator[_Change]:
    """Every change of the causes that may be: all the time, evenly over the flight, or from a
    sample on."""
    ramp = (t - t[0]) / (t[-1] - t[0])
    for cause in causes:
        late = -np.gradient(cause.values, t)
        always = {} if cause.name in RATES else {"delay": late}
        if is_surface(cause.name):
            always["play"] = (played(cause.values, PLAY) - cause.values) / PLAY
        columns = {"delay": late}
        if cause.is_angle or cause.name in FORCES:
            columns["gain"] = cause.values
        if cause.is_angle:
            columns["zero"] = np.ones_like(t)
        for what, values in always.items():
            yield _evenly(cause, what, ALWAYS, values, basis, left)
        for what, values in columns.items():
            # Of a rate, a delay that changes is more than one that the flight has all the time.
            constant = what == "delay" and "delay" not in always
            known = _joined(basis, late) if constant else basis
            rest = left - known @ (known.T @ left)
            yield _evenly(cause, what, EVENLY, values * ramp, known, rest)
            gains = _gains(values, known, rest)
            gains[:edge], gains[len(t) - edge :] = 0.0, 0.0
            spent = np.cumsum(values * values)
            gains[(spent < SIDE * spent[-1]) | (spent > (1.0 - SIDE) * spent[-1])] = 0.0
            at = int(np.argmax(gains))
            later = values * (np.arange(len(t)) >= at)
            when = f"at {t[at]:.1f} s" if what == "zero" else f"from {t[at]:.1f} s on"
            share = _over(float(gains[at]), float(rest @ rest))
            yield _Change(cause, what, when, later, known, share)


def _evenly(
    cause: _Cause, what: str, when: str, values: Array, basis: Array, left: Array
) -> _Change:
    """A change whose column is the same all the time, or grows."""
    own = values - basis @ (basis.T @ values)
    size = float(own @ own)
    told = size > LEFT * float(values @ values)
    gained = float(left @ own) ** 2 / size if told else 0.0
    return _Change(cause, what, when, values, basis, _over(gained, float(left @ left)))


def _joined(basis: Array, values: Array) -> Array:
    """The basis with one more column, where it adds anything."""
    own = values - basis @ (basis.T @ values)
    size = float(own @ own)
    if not size > LEFT * float(values @ values):
        return basis
    return np.column_stack([basis, own / np.sqrt(size)])


def _over(part: float, whole: float) -> float:
    return part / whole if whole > 0.0 else 0.0


def _claim(axis: str, ranked: Sequence[_Change], y: Array) -> list[Suspicion]:
    """What the likeliest change says, with the causes that are nearly as likely."""
    best = ranked[0]
    try:
        columns = np.column_stack([best.basis, best.column])
        fit = least_squares(columns, y, tuple(str(k) for k in range(columns.shape[1])))
    except ValueError:
        return []
    slope = best.cause.slope
    change, error = float(fit.estimates[-1]) / slope, float(fit.standard_errors[-1]) / abs(slope)
    independent = len(y) / max(1.0, samples_per_independent(fit.residual))

    def likelier(each: _Change) -> float:
        return -0.5 * independent * float(np.log(max(1.0 - each.share, 1e-12)))

    tried = len(_LEAST) * len(ranked) * len(y)
    if likelier(best) < LIKELIER + float(np.log(tried)):
        return []
    least = LATE if (best.what, best.when) == ("delay", ALWAYS) else _LEAST[best.what]
    if not abs(change) > least + ERRORS * error:
        return []
    # A delay is told by its first order, which is no larger than what is delayed.
    delayed = abs(change) * float(np.std(best.column))
    if best.what == "delay" and delayed > float(np.std(best.cause.values)):
        return []
    near = [
        each.cause
        for each in ranked
        if likelier(each) > likelier(best) - LIKELIER or each.share > ALIKE * best.share
    ]
    evidence = {"change": change, "standard_error": error, "likelier": likelier(best)}
    kind = MOVED if best.what == "zero" else CHANGED
    return [Suspicion(best.cause.name, kind, _words(axis, best, change, near), evidence)]


def _words(axis: str, best: _Change, change: float, near: Sequence[_Cause]) -> str:
    name, named = best.cause.name, " or ".join(cause.name for cause in near)
    if best.what == "zero":
        how = "drifts" if best.when == EVENLY else "jumps"
        moved = axis in MOMENT_AXES
        other = "the CG moved" if moved else f"that of {_CAUSES[axis][2]}, or the mass"
        return (
            f"what the database leaves of {axis} {how} {best.when} by as much as"
            f" {np.rad2deg(change):.2g} deg of {name}. No motion explains it: the zero of the"
            f" channel changed, or {other}"
        )
    if best.what == "play":
        return (
            f"{name} and its surface part by {2.0 * np.rad2deg(abs(change)):.2g} deg where the"
            f" motion turns, by the {axis} of the database: a linkage has play"
        )
    if best.what == "delay":
        # What measures the axis is late where its causes are early.
        is_late = (change < 0.0) == best.cause.is_angle
        how, other = ("late", "early") if is_late else ("early", "late")
        rivals = [
            f", or {cause.name} {how if cause.is_angle == best.cause.is_angle else other}"
            for cause in near
            if cause is not best.cause
        ]
        return (
            f"{best.when} {name} is {abs(change):.2g} s {how} by the {axis} of the"
            f" database{''.join(rivals)}: a clock, a filter or a servo"
        )
    what = f"the effect of {name} on {axis}" if best.cause.is_angle else f"the measured {axis}"
    return (
        f"{best.when} {what} is another, by {change:.2g} times the"
        f" database's: {named}, the channel or its calibration changed"
    )


def _gains(values: Array, basis: Array, left: Array) -> Array:
    """What each time explains of the squares of `left`, from which on `values` are added, (n,)."""

    def later(products: Array) -> Array:
        return np.cumsum(products[::-1], axis=0)[::-1]

    squares = later(values * values)
    size = squares - (later(basis * values[:, None]) ** 2).sum(axis=1)
    told = size > LEFT * squares
    return np.asarray(np.where(told, later(left * values) ** 2 / np.where(told, size, 1.0), 0.0))


def _held(
    axis: str, surface: _Cause, y: Array, motion: Sequence[Array], t: Array
) -> Suspicion | None:
    """A surface whose channel stands still for stretches in which its axis goes on without it."""
    name, deflected = surface.name, surface.values
    same = np.diff(deflected) == 0.0
    still = np.zeros(len(deflected), dtype=bool)
    for first, last in runs(same, HELD):
        still[first : last + 2] = True
    if min(int(still.sum()), int((~still).sum())) < FEWEST // 4:
        return None
    # Motion explains as much of the rest where the channel moves as where it does not.
    columns = np.column_stack([np.ones_like(t), *motion])
    left = y - columns @ np.linalg.lstsq(columns[~still], y[~still])[0]
    here, elsewhere = (float(np.sqrt(np.mean(left[where] ** 2))) for where in (still, ~still))
    own = abs(surface.slope) * float(np.std(deflected[~still]))
    if not here > max(LOUDER * elsewhere, MISSED * own):
        return None
    since = float(t[int(np.argmax(still))])
    seconds = float(still.sum()) * float(np.median(np.diff(t)))
    words = (
        f"{name} stands still for {seconds:.1f} s in all, first at {since:.1f} s, and there"
        f" {here / elsewhere:.2g} times as much of {axis} is left. Its channel is clipped, or was"
        " not recorded"
    )
    return Suspicion(name, "stuck", words, {"from": since, "seconds": seconds})


def _basis(columns: list[Array], n: int) -> Array:
    """Orthonormal columns (n, k) that span a constant, the columns and their squares."""
    centred = [values - values.mean() for values in columns]
    scaled = [v / size for v in centred if (size := float(np.std(v))) > 0.0]
    whole = np.column_stack([np.ones(n), *scaled, *(v * v for v in scaled)])
    own, sizes, _ = np.linalg.svd(whole, full_matrices=False)
    return np.asarray(own[:, sizes > 1e-6 * sizes[0]])
