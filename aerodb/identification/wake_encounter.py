"""A vortex pair from the air along a path: circulation, core radius, spacing and place.

Step 1 is the velocity of the air along the flight (`aerodb.consistency.air_velocity`), step 2 the
pair, with a constant wind, that makes the likelihood greatest. What it leaves is turbulence: an
autoregression of each component whitens air and model alike. A wake is claimed where the likelihood
grows by more than chance explains over all places of the path.

Components may be fewer than three: with one vane, the one that it shows, in an axis that turns with
the aircraft. The airspeed tells less than it seems to: without the other angle, the velocity across
enters it by its square.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.physics import CORES, Core, VortexPair
from aerodb.support import Array

#: Order of the autoregression of what is left: turbulence of the second order and noise of vanes.
_ORDER: Final = 6
#: Headings from which the search begins, over half a turn.
_HEADINGS: Final = 36
#: Starts of the search, the best of those tried.
_TRIED: Final = 4
#: Probability of claiming a wake in a flight through turbulence alone.
FALSE_CLAIM: Final = 0.05
#: Cores differ within about this many core radii; farther away neither is named.
NAMED_WITHIN: Final = 2.0
#: Gain of log-likelihood that names a core: 20 times as likely.
_NAMED_BY: Final = 3.0
#: Spacing [m] and core radius over spacing that the search begins with: those of small, medium and
#: heavy aircraft, and 3.5 % of the span as seen in flight, grown with age.
_SPACINGS: Final = (10.0, 18.0, 40.0)
_CORE_OVER_SPACING: Final = 0.06
#: Least and greatest logarithm of core radius and spacing [m].
_LOGARITHMS: Final = (-4.0, 5.0)
#: Most evaluations of a search.
_MOST: Final = 60
#: Fewest samples of an encounter.
_FEWEST: Final = 60
#: Least share of the best known component of the wind that another is told by: along an axis that
#: hardly turned, the wind is what noise makes of it.
_TOLD: Final = 0.05
#: Number of unknowns of the pair.
_UNKNOWNS: Final = 7


@dataclass(frozen=True)
class WakeEncounter:
    """What an encounter shows.

    Parameters
    ----------
    found : whether a wake is claimed, with `gain` of log-likelihood against `needed`; between its
        vortices the air sinks.
    pair : the most likely one; its place is relative to the start of the path.
    errors : standard error of circulation, core_radius, spacing, right, below, heading and slope,
        SI, NaN for what the air does not tell; `right` and `below` are of the axis across itself.
    nearest : least distance of the path from a vortex [m].
    core : which is named; empty where neither is. rival : gain of log-likelihood over the other.
    wind : north, east, down [m/s].
    """

    found: bool
    gain: float
    needed: float
    pair: VortexPair
    errors: dict[str, float]
    nearest: float
    core: str
    rival: float
    wind: tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class _Fitted:
    """Cost, pair, standard errors, wind and unknowns of a fit."""

    cost: float
    pair: VortexPair
    errors: dict[str, float]
    wind: tuple[float, float, float]
    unknowns: Array


@dataclass(frozen=True, eq=False)
class _Air:
    """Measured components of the air.

    Parameters
    ----------
    axes : (m, 3, n). wind_of : (3, m n), components -> steady wind. moved : (m, n) [m/s], without
        wind. wind : north, east, down [m/s].
    """

    axes: Array
    wind_of: Array
    moved: Array
    wind: Array

    @classmethod
    def of(cls, air: Array, axes: Array) -> "_Air":
        columns = axes.transpose(0, 2, 1).reshape(-1, 3)
        wind_of = np.asarray(np.linalg.pinv(columns, rcond=_TOLD), dtype=np.float64)
        seen = np.einsum("mcn,cn->mn", axes, air)
        found = cls(axes, wind_of, seen, np.zeros(3))
        return replace(found, moved=found.without_wind(seen), wind=found.steady(seen))

    def steady(self, seen: Array) -> Array:
        """The wind (3,) of components (m, n)."""
        return np.asarray(self.wind_of @ seen.ravel())

    def without_wind(self, seen: Array) -> Array:
        return np.asarray(seen - np.einsum("mcn,c->mn", self.axes, self.steady(seen)))

    def seen(self, pair: VortexPair, path: Array) -> Array:
        """Components (m, n) of a pair, without wind."""
        return self.without_wind(np.einsum("mcn,cn->mn", self.axes, pair.velocity(path)))


def identify_wake(
    air: Array,
    path: Array,
    *,
    axes: Array | None = None,
    heading: float | None = None,
    cores: Sequence[Core] = CORES,
) -> WakeEncounter:
    """Return the vortex pair that explains the air along a path.

    Parameters
    ----------
    air : (3, n) velocity of the air north, east, down [m/s].
    path : (3, n) north, east, altitude [m] of the point where it was measured.
    axes : (m, 3, n) unit vectors north, east, down along which the air is known; None: all three.
    heading : of the aircraft that made the wake [rad], where it is known.

    Raises InputError for too few samples.
    """
    if air.shape[1] < _FEWEST:
        raise InputError(f"{air.shape[1]} samples", remedy=f"an encounter needs {_FEWEST}")
    n = air.shape[1]
    if axes is None:
        axes = np.repeat(np.eye(3)[:, :, None], n, axis=2)
    known = _Air.of(air, axes)
    nothing = _cost(known.moved)
    fits: list[_Fitted] = []
    for core in cores:
        fits.append(_fit(known, path, core, heading, fits[0].unknowns if fits else None))
    if len(axes) < 3:  # fewer components have more optima
        fits = [_searched_on(known, path, heading, each, fits) for each in fits]
    best = min(fits, key=lambda each: each.cost)
    errors = dict(best.errors)
    pair = best.pair
    gain = nothing - best.cost
    rival = min((each.cost - best.cost for each in fits if each is not best), default=np.inf)
    from scipy.stats import chi2  # slow to import

    places = n * _HEADINGS
    needed = 0.5 * float(chi2.isf(FALSE_CLAIM / places, _UNKNOWNS))
    nearest = pair.nearest(path)
    named = nearest < NAMED_WITHIN * pair.core_radius and rival > _NAMED_BY
    if not named:  # the cores have radii of their own
        apart = max(abs(each.pair.core_radius - pair.core_radius) for each in fits)
        errors["core_radius"] = float(np.hypot(errors["core_radius"], apart))
    if pair.core_radius > 0.5 * pair.spacing:
        # Cores that overlap are a dipole, of which the air tells G times the spacing alone.
        errors["circulation"] = errors["spacing"] = np.nan
    return WakeEncounter(
        found=gain > needed and pair.circulation > 0.0,
        gain=gain,
        needed=needed,
        pair=pair,
        errors=errors,
        nearest=nearest,
        core=pair.core if named else "",
        rival=rival,
        wind=best.wind,
    )


def _whitened(series: Array, coefficients: Array) -> Array:
    """Innovations (m, n - order) of series under the autoregressions (m, order)."""
    order = coefficients.shape[1]
    late = series[:, order:].copy()
    for k in range(order):
        late -= coefficients[:, k, None] * series[:, order - 1 - k : series.shape[1] - 1 - k]
    return late


def _autoregression(series: Array) -> Array:
    """Coefficients (m, order) of each row by least squares."""
    found = np.zeros((len(series), _ORDER))
    for row, values in enumerate(series):
        past = np.stack(
            [values[_ORDER - 1 - k : len(values) - 1 - k] for k in range(_ORDER)], axis=1
        )
        found[row] = np.linalg.lstsq(past, values[_ORDER:], rcond=None)[0]
    return found


def _cost(left: Array) -> float:
    """Negative log-likelihood of what is left (m, n), each row as turbulence of its own."""
    innovations = _whitened(left, _autoregression(left))
    return float(0.5 * innovations.shape[1] * np.log(np.mean(innovations**2, axis=1)).sum())


def _fit(air: _Air, path: Array, core: Core, heading: float | None, begin: Array | None) -> _Fitted:
    """The most likely pair with a core; begin : unknowns that the search begins with."""
    from scipy.optimize import least_squares  # slow to import

    moved = air.moved
    # Where the air moves most, the path is nearest to a vortex.
    at = int(np.argmax(np.sum(moved**2, axis=0)))

    def pair_of(x: Array) -> VortexPair:
        """The pair of which the right vortex is x[3] m to the right and x[4] m below that place."""
        turned = float(x[5]) if heading is None else heading
        core_radius, spacing = np.exp(np.clip(x[1:3], *_LOGARITHMS)).tolist()
        away = float(x[3]) - 0.5 * spacing
        north, east = path[:2, at] + away * np.array([-np.sin(turned), np.cos(turned)])
        place = (float(north), float(east), float(path[2, at] - x[4]))
        return VortexPair(float(x[0]), core_radius, spacing, place, turned, float(x[6]), core)

    def residuals(x: Array, filters: Array, scale: Array) -> Array:
        left = moved - air.seen(pair_of(x), path)
        return np.asarray((_whitened(left, filters) / scale[:, None]).ravel())

    # The search begins with the air itself; what it leaves then says how to whiten.
    plain, one = np.zeros((len(moved), _ORDER)), np.ones(len(moved))
    x = begin
    if x is None:
        found = []
        for start in _starts(air, path, pair_of, heading):
            solution = least_squares(
                residuals, start, args=(plain, one), x_scale=_SCALES, method="lm", max_nfev=_MOST
            )
            found.append((float(solution.cost), solution.x))
        nothing = np.array([0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0])
        x = min(found, key=lambda each: each[0])[1] if found else nothing
    for _ in range(2):
        left = moved - air.seen(pair_of(x), path)
        filters = _autoregression(left)
        own = np.maximum(np.sqrt(np.mean(_whitened(left, filters) ** 2, axis=1)), 1e-9)
        solution = least_squares(
            residuals, x, args=(filters, own), x_scale=_SCALES, method="lm", max_nfev=_MOST
        )
        x = solution.x
    pair = pair_of(x)
    # The air of a pair is the same whichever way the aircraft flew: what climbs ahead sinks behind.
    if heading is None:
        turns, within = np.divmod(pair.heading, np.pi)
        slope = -pair.slope if turns % 2.0 else pair.slope
        pair = replace(pair, heading=float(within), slope=slope)
    blown = np.einsum("mcn,cn->mn", air.axes, pair.velocity(path))
    wind = air.wind - air.steady(blown)
    free = [k for k in range(_UNKNOWNS) if k != 5 or heading is None]
    slopes = np.asarray(solution.jac)[:, free]
    sigma = np.full(_UNKNOWNS, np.nan)
    sigma[free] = np.sqrt(np.maximum(np.diag(np.linalg.pinv(slopes.T @ slopes)), 0.0))
    sigma[free] = np.where(slopes.any(axis=0), sigma[free], np.nan)  # NaN: at the end of its range
    size = np.array([1.0, pair.core_radius, pair.spacing, 1.0, 1.0, 1.0, 1.0])
    names = ("circulation", "core_radius", "spacing", "right", "below", "heading", "slope")
    errors = dict(zip(names, (sigma * size).tolist(), strict=True))
    cost = _cost(moved - air.without_wind(blown))
    if heading is not None:
        x = np.where(np.arange(_UNKNOWNS) == 5, heading, x)
    return _Fitted(cost, pair, errors, (float(wind[0]), float(wind[1]), float(wind[2])), x)


def _searched_on(
    air: _Air, path: Array, heading: float | None, fit: _Fitted, fits: Sequence[_Fitted]
) -> _Fitted:
    """The most likely of a fit and of others of its core: from a start of its own, and from where
    any fit ended, with a usual core."""
    begins: list[Array | None] = [None]
    for each in fits:
        usual = each.unknowns.copy()
        usual[1] = usual[2] + np.log(_CORE_OVER_SPACING)
        begins += [each.unknowns, usual]
    others = [_fit(air, path, fit.pair.core, heading, begin) for begin in begins]
    return min([fit, *others], key=lambda each: each.cost)


def _starts(
    air: _Air, path: Array, pair_of: Callable[[Array], VortexPair], heading: float | None
) -> list[Array]:
    """The most likely of many pairs about the place where the air moves most; the circulation of
    each, in which the air is linear, is its best."""
    headings = np.arange(_HEADINGS) * np.pi / _HEADINGS if heading is None else [heading]
    tried: list[tuple[float, Array]] = []
    for turned, spacing, side, below in product(
        headings, _SPACINGS, (0.0, 1.0), (-0.1, -0.03, 0.03, 0.1)
    ):
        size = np.log(np.array([_CORE_OVER_SPACING, 1.0]) * spacing)
        x = np.array([1.0, *size, side * spacing, below * spacing, turned, 0.0])
        shape = air.seen(pair_of(x), path)
        square = float(np.sum(shape * shape))
        along = float(np.sum(shape * air.moved))
        if along > 0.0:
            x[0] = along / square
            tried.append((-x[0] * along, x))
    tried.sort(key=lambda each: each[0])
    return [x for _, x in tried[:_TRIED]]


#: Typical sizes of the unknowns: circulation [m2/s], logarithms, place [m], angles [rad].
_SCALES: Final = np.array([50.0, 0.5, 0.3, 2.0, 2.0, 0.2, 0.05])
