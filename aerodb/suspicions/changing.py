"""Control surfaces whose effect changes during a flight: reversed, dead, of another gain, or with a
channel that stands still from one time on.

One effect over a whole flight is the mean of two that contradict each other. Of each surface the
time is sought from which on another effect explains the moments best (a change point: Chow,
Econometrica 28, 1960, with the place searched for); the claim pays for the search.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import SETTLED, Suspicion
from aerodb.estimation import Regression
from aerodb.flight import Flight
from aerodb.support import SUBSTANTIAL, Array
from aerodb.suspicions.equation_error import RATE_OF, EquationError
from aerodb.suspicions.evidence import ERRORS, INFLATION, LIKELIER, SWING, likelier_by
from aerodb.suspicions.surfaces import Control, along

#: Kind of a suspicion of a surface whose effect changes.
CHANGED = "changed"
#: Shares of a surface's motion before the times that are tried.
SPLITS = tuple(k / 20.0 for k in range(2, 19))
#: Least and largest ratio of the effect afterwards to that before which speed, flaps and angle of
#: attack make within a flight.
RATIOS = (0.6, 1.7)
#: Share of the moment that must be explained with the change for a claim about it.
EXPLAINED = SUBSTANTIAL
#: How many times the residual before, that of a stretch without its surface must be.
LOUDER = 3.0
#: Part of what the surface did before, that is left unexplained without it.
MISSED = SUBSTANTIAL


def changing_suspicions(
    flight: Flight,
    axes: Mapping[str, EquationError],
    controls: Mapping[str, Control],
) -> list[Suspicion]:
    """Return surfaces whose effect on their own axis changes during the flight, one per surface.

    axes : of `equation_errors`. Deflections [rad], effects per rad, times [s], channels (n,).
    Source: `docs/method/consistency.md`, section "Against the vehicle".
    """
    listed = []
    for role, axis in axes.items():
        for name, control in controls.items():
            if control.role != role or name not in axis.controls:
                continue
            found = _stands_still(flight, axis, name, control) or _changes(flight, axis, name)
            if found is not None:
                listed.append(found)
    return listed


def _changes(flight: Flight, axis: EquationError, name: str) -> Suspicion | None:
    """The change of a surface's effect that explains most, if it is one."""
    where, values = axis.where, axis.controls[name]
    used = np.cumsum(np.where(where, values, 0.0) ** 2)
    if not float(np.std(values[where])) > SWING or not used[-1] > 0.0:
        return None
    places = [int(np.searchsorted(used, share * used[-1])) for share in SPLITS]
    best, left = _likeliest(axis, name, list(dict.fromkeys(places)))
    wanted = LIKELIER + float(np.log(len(SPLITS)))
    if not 0.5 * float(where.sum()) * np.log(left) >= wanted:  # nan: no finite moment
        return None
    with_change = {**axis.controls, CHANGED: _later(values, best)}
    if not _is_worth_a_fit(axis, name, with_change):
        return None
    fit = axis.fit(with_change)
    if fit is None:
        return None
    one, other = fit.names.index(name), fit.names.index(CHANGED)
    before, change = float(fit.estimates[one]), float(fit.estimates[other])
    error = float(fit.standard_errors[other])
    likelier = likelier_by(fit, left)
    if (
        fit.r_squared < EXPLAINED
        or likelier < wanted
        or max(fit.vif[one], fit.vif[other]) > INFLATION
        or abs(before) < ERRORS * float(fit.standard_errors[one])
    ):
        return None
    ratio, margin = 1.0 + change / before, ERRORS * error / abs(before)
    if not _is_beyond(ratio, margin):
        return None
    how = "is reversed" if ratio + margin < 0.0 else f"is {ratio:.2g} times that before"
    since = float(axis.thinned(flight.time)[best])
    words = (
        f"{name} gives {before:.3g} per rad about the {axis.role} axis until about {since:.1f} s."
        f" From then on its effect {how}: the surface, its channel or its calibration changed,"
        f" or that of {' or '.join((RATE_OF[axis.role], *list(axis.motion)[:1]))}"
    )
    evidence = {"before": before, "ratio": ratio, "margin": margin, "from": since}
    return Suspicion(name, CHANGED, words, evidence)


def _likeliest(axis: EquationError, name: str, places: list[int]) -> tuple[int, float]:
    """The place of the change that explains most, and how many times the squares that are left
    without it are those left with it."""
    columns = {**axis.motion, **axis.controls}
    basis = np.linalg.qr(np.column_stack([v[axis.where] for v in columns.values()]))[0]
    moment = axis.moment[axis.where]
    rest = moment - basis @ (basis.T @ moment)
    gains = []
    for place in places:
        later = _later(axis.controls[name], place)[axis.where]
        own = later - basis @ (basis.T @ later)
        size, common = float(own @ own), float(rest @ own)
        gains.append(common * common / size if size > 0.0 else 0.0)
    whole, best = float(rest @ rest), int(np.argmax(gains))
    return places[best], whole / max(whole - gains[best], 1e-12 * max(whole, 1e-300))


def _is_worth_a_fit(axis: EquationError, name: str, controls: Mapping[str, Array]) -> bool:
    """Whether the change may be claimed at all: standard errors, which take long, come after."""
    columns = {**axis.motion, **controls}
    matrix = np.column_stack([values[axis.where] for values in columns.values()])
    moment = axis.moment[axis.where]
    if not (np.isfinite(matrix).all() and np.isfinite(moment).all()):
        return False
    solution = np.linalg.lstsq(matrix, moment)[0]
    effects = dict(zip(columns, solution.tolist(), strict=True))
    left = moment - matrix @ solution
    total = float(np.sum((moment - moment.mean()) ** 2))
    if not effects[name] or float(left @ left) > (1.0 - EXPLAINED) * total:
        return False
    # With the errors of white residuals, which coloured ones exceed.
    later = matrix[:, -1]
    basis = np.linalg.qr(matrix[:, :-1])[0]
    own = later - basis @ (basis.T @ later)
    size = float(own @ own)
    if not size * INFLATION > float(later @ later):
        return False
    sigma = float(np.sqrt(left @ left / max(len(left) - len(effects), 1)))
    margin = ERRORS * sigma / np.sqrt(size) / abs(effects[name])
    return _is_beyond(1.0 + effects[CHANGED] / effects[name], margin)


def _is_beyond(ratio: float, margin: float) -> bool:
    """Whether a ratio of effects is beyond what a flight makes of it, with its margin."""
    return ratio + margin < RATIOS[0] or ratio - margin > RATIOS[1]


def _later(values: Array, place: int) -> Array:
    return np.asarray(values * (np.arange(len(values)) >= place))


def _stands_still(
    flight: Flight, axis: EquationError, name: str, control: Control
) -> Suspicion | None:
    """A channel that stands still until the end while the moments go on without it."""
    raw = axis.thinned(along(flight, control))
    still = raw != raw[-1]
    flown = np.flatnonzero(axis.where)
    first = int(np.flatnonzero(still)[-1]) + 1 if still.any() else 0
    before = axis.where & (np.arange(len(raw)) < first)
    after = axis.where & (np.arange(len(raw)) >= first)
    least = max(SETTLED / axis.step, 0.1 * len(flown))
    if min(before.sum(), after.sum()) < least:
        return None
    fit = _fit_over(axis, before)
    if fit is None or fit.r_squared < EXPLAINED:
        return None
    # Whatever the rest explains from then on is not missed.
    others = {other: values for other, values in axis.controls.items() if other != name}
    rest = replace(axis, controls=others)
    left = _fit_over(rest, after)
    if left is None:
        return None
    rms_before, rms_after = (float(np.sqrt(np.mean(each.residual**2))) for each in (fit, left))
    effect = float(fit.estimates[fit.names.index(name)])
    own = abs(effect) * float(np.std(axis.controls[name][before]))
    if rms_after < LOUDER * rms_before or rms_after < MISSED * own:
        return None
    since = float(axis.thinned(flight.time)[first])
    words = (
        f"{name} stands still from {since:.1f} s on and was not recorded any more: since then what"
        f" turns the aircraft about the {axis.role} axis is left unexplained"
    )
    return Suspicion(name, "stuck", words, {"from": since, "ratio": rms_after / rms_before})


def _fit_over(axis: EquationError, where: NDArray[np.bool_]) -> Regression | None:
    return replace(axis, where=where).fit() if where.sum() > 3 * len(axis.motion) + 30 else None
