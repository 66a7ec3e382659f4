"""Moments that part from the database with time: a surface's zero, its effect, or the CG changes.

Of what the database leaves of a moment, everything that motion, speed and surfaces explain is taken
off. No aerodynamics makes the rest grow evenly over a flight, or jump within a fifth of a second
and stay: the zero of a surface's channel, or the centre of gravity, moved (a change point: Chow,
Econometrica 28, 1960, with the place searched for).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import SETTLED, Suspicion
from aerodb.estimation import least_squares, samples_per_independent
from aerodb.flight import Flight
from aerodb.nomenclature import is_surface
from aerodb.signals import runs
from aerodb.support import Array
from aerodb.suspicions.changing import CHANGED, LOUDER, MISSED
from aerodb.suspicions.equation_error import averaged
from aerodb.suspicions.evidence import ERRORS, FEWEST, LIKELIER
from aerodb.suspicions.in_flight import HUGE, flying
from aerodb.suspicions.surfaces import role_of

#: Kind of a suspicion of a zero that moves.
MOVED: Final = "zero"
#: Least equivalent deflection of a surface that is said [rad]. Rigging and a tunnel's trim are
#: known to a degree; fuel moves a CG by as much.
LEAST: Final = float(np.deg2rad(2.0))
#: Least change of a surface's effect that is said, as a share of the database's. Speed and flaps
#: change it by less within a flight (`changing.RATIOS`).
LEAST_GAIN: Final = 0.4
#: Fewest equal means in a row for a channel that stands still.
HELD: Final = 3
#: Least share of a change's squares that motion must leave of it.
LEFT: Final = 1e-6
#: Samples are averaged to this step [s]: what jumps does so within two of them.
STEP: Final = 0.1
#: Least share of what is left of a moment that a drift or a jump explains: noise may hold the rest.
EXPLAINED: Final = 0.5
#: Motion and speed on which an error of a database may depend, as they are and squared.
STATES: Final = ("alpha", "beta", "V", "mach", "p", "q", "r", "thrust")
#: The surfaces of each moment.
_ROLES: Final = {"Cm": "pitch", "Cl": "roll", "Cn": "yaw"}


@dataclass(frozen=True, eq=False)
class _Shape:
    """A change with time: in words, its values (m,), whether it is one of a surface's effect."""

    how: str
    values: Array
    is_gain: bool = False


def moved_zeros(
    flight: Flight,
    slopes: Mapping[str, Mapping[str, float]],
    measured: Mapping[str, Array],
    predicted: Mapping[str, Array],
    usable: Mapping[str, NDArray[np.bool_]],
) -> list[Suspicion]:
    """Return the moments whose difference from the database drifts over the flight or jumps in it,
    as the deflection [rad] that the surface of the axis would need.

    slopes : axis -> surface -> dC/d delta per rad. measured, predicted, usable : axis -> (n,).
    Source: `docs/method/consistency.md`, section "Against the database".
    """
    listed = []
    for axis, role in _ROLES.items():
        own = {n: s for n, s in slopes.get(axis, {}).items() if role_of(n) == role and s != 0.0}
        if axis not in measured or not own:
            continue
        name = max(own, key=lambda n: abs(own[n]))
        rest = measured[axis] - predicted[axis]
        good = usable[axis] & np.isfinite(rest) & flying(flight, ())
        found = _moved(flight, axis, name, sum(own.values()), rest, good)
        if found is not None:
            listed.append(found)
    return listed


def _moved(
    flight: Flight, axis: str, name: str, slope: float, rest: Array, good: NDArray[np.bool_]
) -> Suspicion | None:
    every = max(1, round(STEP / flight.step))
    thin = {"rest": averaged(np.where(good, rest, np.nan), every)}
    for each in flight.channels:
        if (each in STATES or is_surface(each)) and np.ptp(flight[each][good]) > 0.0:
            thin[each] = averaged(flight[each], every)
    inside = np.logical_and.reduce([np.abs(values) < HUGE for values in thin.values()])
    time = averaged(flight.time, every)
    if inside.sum() < max(FEWEST, 2.0 * SETTLED / (every * flight.step)):
        return None
    y, t = thin.pop("rest")[inside], time[inside]
    basis = _basis([values[inside] for values in thin.values()], len(y))
    left = y - basis @ (basis.T @ y)
    ramp = (t - t[0]) / (t[-1] - t[0]) - 0.5
    edge = round(SETTLED / (every * flight.step))
    deflected = thin[name][inside] if name in thin else np.zeros_like(y)
    held = _held(axis, name, slope, deflected, (y, [v[inside] for v in thin.values()]), t)
    if held is not None:
        return held
    whole, best, gained = float(left @ left), _Shape("", ramp), 0.0
    own = ramp - basis @ (basis.T @ ramp)
    if float(own @ own) > LEFT * float(ramp @ ramp):
        best = _Shape("drifts over the flight", ramp)
        gained = float(left @ own) ** 2 / float(own @ own)
    for values, is_gain in ((np.ones_like(y), False), (deflected, True)):
        gains = _gains(values, basis, left)
        gains[:edge], gains[len(y) - edge :] = 0.0, 0.0
        at = int(np.argmax(gains))
        if gains[at] > gained:
            how = f"{t[at]:.1f}" if is_gain else f"jumps at {t[at]:.1f} s"
            best, gained = _Shape(how, values * (np.arange(len(y)) >= at), is_gain), gains[at]
    if not gained > EXPLAINED * whole:
        return None
    try:
        columns = np.column_stack([basis, best.values])
        fit = least_squares(columns, y, tuple(str(k) for k in range(columns.shape[1])))
    except ValueError:
        return None
    change, error = float(fit.estimates[-1]) / slope, float(fit.standard_errors[-1]) / abs(slope)
    independent = len(y) / max(1.0, samples_per_independent(fit.residual))
    likelier = -0.5 * independent * float(np.log(max(1.0 - gained / whole, 1e-12)))
    least = LEAST_GAIN if best.is_gain else LEAST
    if likelier < LIKELIER + np.log(2 * len(y)) or not abs(change) > least + ERRORS * error:
        return None
    evidence = {"change": change, "standard_error": error, "likelier": likelier}
    if best.is_gain:
        words = (
            f"from {best.how} s on the effect of {name} on {axis} is another, by {change:.2g} times"
            " the database's: the surface, its channel or its calibration changed"
        )
        return Suspicion(name, CHANGED, words, evidence)
    words = (
        f"what the database leaves of {axis} {best.how} by as much as {np.rad2deg(change):.2g} deg"
        f" of {name}. No motion explains it: the zero of the channel changed, or the CG moved"
    )
    return Suspicion(name, MOVED, words, evidence)


def _gains(values: Array, basis: Array, left: Array) -> Array:
    """What each time explains of the squares of `left`, from which on `values` are added, (n,)."""

    def later(products: Array) -> Array:
        return np.cumsum(products[::-1], axis=0)[::-1]

    squares = later(values * values)
    size = squares - (later(basis * values[:, None]) ** 2).sum(axis=1)
    told = size > LEFT * squares
    return np.asarray(np.where(told, later(left * values) ** 2 / np.where(told, size, 1.0), 0.0))


def _held(
    axis: str,
    name: str,
    slope: float,
    deflected: Array,
    rest: tuple[Array, list[Array]],
    t: Array,
) -> Suspicion | None:
    """A surface whose channel stands still for stretches in which its axis goes on without it."""
    same = np.diff(deflected) == 0.0
    still = np.zeros(len(deflected), dtype=bool)
    for first, last in runs(same, HELD):
        still[first : last + 2] = True
    if min(int(still.sum()), int((~still).sum())) < FEWEST // 4:
        return None
    # Motion explains as much of the rest where the channel moves as where it does not.
    columns = np.column_stack([np.ones_like(t), *rest[1]])
    left = rest[0] - columns @ np.linalg.lstsq(columns[~still], rest[0][~still])[0]
    here, elsewhere = (float(np.sqrt(np.mean(left[where] ** 2))) for where in (still, ~still))
    own = abs(slope) * float(np.std(deflected[~still]))
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
