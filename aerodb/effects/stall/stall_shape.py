"""Families of stall shapes, and the shape within a family that fits a set of flights best.

A shape has few nonlinear parameters; given them, all other parameters are linear: one gain per
axis, beside the corrections of the attached flow (nuisances). So only the shape is searched for and
the linear parameters are projected out (variable projection; Golub & Pereyra, SIAM J. Numer. Anal.
10(2), 1973). All axes share one shape, because they share one flow; lift alone hardly determines
it, three axes do.

Shapes are bounded to the data: one that leaves more than half of the flow attached in every flight
has an undetermined gain and is not tried. A shape must not be judged on a flight that helped to
choose it: `cross_fit_shapes` fits the shape for each flight on the others.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.support import Array
from aerodb.tables import STATE_CHANNEL, Kirchhoff, Law, Rate, Relay, StateModel, slow_rate

#: Axis -> plausible range of its gain: lift-curve slope that separates [1/rad], drag and pitching
#: moment of separated flow.
STALL_GAIN_BOUNDS: Final[Mapping[str, tuple[float, float]]] = {
    "C_lift": (0.0, 7.0),
    "C_drag": (0.0, 2.0),
    "Cm": (-2.0, 2.0),
}

#: Shapes are compared on means over blocks of this length [s], which keep what is slower than about
#: 2 Hz; above that, a stall is buffet.
BLOCK: Final = 0.25

#: At least one flight must separate this share of the flow.
_SEPARATED: Final = 0.5

#: Bounds of a shape's sharpness [1/rad]: beyond 200 the step is narrower than alpha is known.
_SHARPNESS: Final = (5.0, 200.0)
#: Bounds of its lag [chords].
_LAG: Final = (0.0, 40.0)
#: Bounds of its relaxation [chords].
_RELAXATION: Final = (0.0, 40.0)

#: How far beyond the greatest angle of attack [rad] flow may be half separated: a lag carries the
#: effective angle there.
_BEYOND: Final = 0.1


@dataclass(frozen=True, eq=False)
class StallFlight:
    """Data of one flight for fitting stall shapes.

    Attributes
    ----------
    time : (n,) [s].
    alpha, V : (n,) [rad], [m/s].
    chord : [m].
    residual : axis of STALL_GAIN_BOUNDS -> (n,), measured - predicted.
    nuisance : axis -> (n, k), regressors of the attached flow's corrections, constant included.
    usable : (n,) bool.
    alpha_0 : zero-lift angle of the database [rad].
    """

    flight: str
    time: Array
    alpha: Array
    V: Array
    chord: float
    residual: Mapping[str, Array]
    nuisance: Mapping[str, Array]
    usable: NDArray[np.bool_]
    alpha_0: float = 0.0

    @property
    def step(self) -> float:
        """Mean sampling interval [s], a scalar."""
        return float(self.time[-1] - self.time[0]) / (len(self.time) - 1)

    def attached(self, law: Law, quickly: bool = False) -> Array:
        """Flow attachment (n,) under a law, 1 attached and 0 separated.

        quickly : interpolate alphadot between two tabulated lags near the law's.

        It is dimensionless.
        """
        channels = {"alpha": self.alpha, "V": self.V}
        if quickly and not isinstance(law, (Relay, Rate)) and law.lag > 0.0:
            position = float(np.clip(np.log2(law.lag), 0.0, len(self._rates) - 1.001))
            below, share = int(position), position % 1.0
            channels["alphadot"] = (1.0 - share) * self._rates[below] + share * self._rates[
                below + 1
            ]
        return StateModel(STATE_CHANNEL, law).along(self.time, channels, self.chord)

    @cached_property
    def _rates(self) -> tuple[Array, ...]:
        """alphadot (n,) filtered for laws with a lag of 1, 2, 4, ... chords."""
        channels = {"alpha": self.alpha, "V": self.V}
        return tuple(slow_rate(self.time, channels, 2.0**power * self.chord) for power in range(7))


def lift_factor(attached: Array) -> Array:
    """Change of the attached lift-curve slope by separation: ``((1 + sqrt X)/2)^2 - 1``.

    It is 0 for attached and -3/4 for fully separated flow.

    >>> lift_factor(np.array([1.0, 0.0])).tolist()
    [0.0, -0.75]

    attached : (n,), dimensionless.
    """
    return np.asarray(((1.0 + np.sqrt(np.clip(attached, 0.0, 1.0))) / 2.0) ** 2 - 1.0)


def blocked(flight: StallFlight, values: Array) -> Array:
    """Means (m, ...) of `values` (n, ...) over blocks of `BLOCK` seconds, all samples usable."""
    size = max(1, round(BLOCK / flight.step))
    whole = len(flight.time) // size * size
    good = flight.usable[:whole].reshape(-1, size).all(axis=1)
    return np.asarray(values[:whole].reshape(-1, size, *values.shape[1:]).mean(axis=1)[good])


Parameters = tuple[float, ...]


@dataclass(frozen=True)
class Family:
    """A family of stall shapes.

    Attributes
    ----------
    names, bounds : of the parameters; those named ``alpha_*`` are bounded by the flights instead.
    law : parameters -> law of the state model; None for static families.
    static : (alpha (n,), parameters) -> column (n,) of a static family.
    starts : starting points of the search, as shares of the bounds.
    """

    name: str
    names: tuple[str, ...]
    bounds: tuple[tuple[float, float], ...]
    law: Callable[[Parameters], Law] | None = None
    static: Callable[[Array, Parameters], Array] | None = None
    starts: tuple[tuple[float, ...], ...] = ()

    def columns(
        self, flight: StallFlight, parameters: Parameters, quickly: bool = False
    ) -> dict[str, Array]:
        """Columns of unit gains, axis -> (n,); `quickly` as for `StallFlight.attached`."""
        if self.law is None:
            assert self.static is not None
            return dict.fromkeys(STALL_GAIN_BOUNDS, self.static(flight.alpha, parameters))
        attached = flight.attached(self.law(parameters), quickly)
        return {
            "C_lift": (flight.alpha - flight.alpha_0) * lift_factor(attached),
            "C_drag": 1.0 - attached,
            "Cm": 1.0 - attached,
        }

    def gains(self, axis: str) -> tuple[float, float]:
        """Return bounds (low, high) of the gain on an axis, dimensionless or per rad as
        `STALL_GAIN_BOUNDS` states; none for static families, which may bend either way."""
        return STALL_GAIN_BOUNDS[axis] if self.law is not None else (-np.inf, np.inf)

    def observable(self, flights: Sequence[StallFlight], parameters: Parameters) -> bool:
        """Return whether at least one flight (alpha (n,) [rad]) separates enough flow to determine
        a gain."""
        if self.law is None:
            return any(
                bool(np.any(self.static(f.alpha, parameters) != 0.0))
                for f in flights
                if self.static
            )
        law = self.law(parameters)
        return any(
            float(np.nanmin(flight.attached(law, quickly=True))) < 1.0 - _SEPARATED
            for flight in flights
        )

    def refined(self, cost: Callable[[Array], float], share: Array) -> Array:
        """Minimize `cost` near a start; returns shares of the bounds (k,).

        Nelder-Mead, except for a relay: its cost has steps, so the grid is refined instead.
        """
        if not len(share):
            return share
        if self.name != "relay":
            size = {"xatol": 1e-3, "fatol": 1e-2, "maxiter": 300}
            span = [(0.0, 1.0)] * len(share)
            optimum = minimize(cost, share, method="Nelder-Mead", bounds=span, options=size)  # type: ignore[call-overload]
            return np.asarray(optimum.x)
        for reach in (0.05, 0.01, 0.002):
            for number in range(len(share)):
                tried = [
                    np.where(np.arange(len(share)) == number, x, share)
                    for x in share[number] + reach * _FINE
                ]
                share = min(tried, key=cost)
        return share

    def limits(self, flights: Sequence[StallFlight]) -> Array:
        """Bounds of the parameters, (k, 2).

        Angles lie between the flights' median and greatest angle of attack, with a lag beyond it.

        Angles are in rad.
        """
        high = max(float(np.max(flight.alpha[flight.usable])) for flight in flights)
        low = min(float(np.median(flight.alpha[flight.usable])) for flight in flights)
        beyond = _BEYOND if "lag" in self.names else 0.0
        span = {
            "alpha_star": (low, high + beyond),
            "alpha_break": (low, high),
            "alpha_low": (0.0, high),
            "alpha_high": (low, high),
        }
        return np.array(
            [span.get(name, bound) for name, bound in zip(self.names, self.bounds, strict=True)]
        ).reshape(-1, 2)


_ANGLE: Final = (0.0, 1.0)
_FINE: Final = np.linspace(-1.0, 1.0, 21)
_SHARES: Final = (0.15, 0.35, 0.55, 0.75)


def _grid(*shares: tuple[float, ...]) -> tuple[tuple[float, ...], ...]:
    return tuple(product(*shares))


#: The competing families by name: three with hysteresis, then static ones.
FAMILIES: Final[Mapping[str, Family]] = {
    family.name: family
    for family in (
        Family(
            "kirchhoff",
            ("sharpness", "alpha_star", "lag"),
            (_SHARPNESS, _ANGLE, _LAG),
            law=lambda p: Kirchhoff(p[0], p[1], lag=p[2]),
            starts=_grid((0.1, 0.3, 0.6), _SHARES, (0.15, 0.3, 0.5, 0.75)),
        ),
        Family(
            "kirchhoff_relaxed",
            ("sharpness", "alpha_star", "lag", "relaxation"),
            (_SHARPNESS, _ANGLE, _LAG, _RELAXATION),
            law=lambda p: Kirchhoff(p[0], p[1], lag=p[2], relaxation=p[3]),
            starts=_grid((0.1, 0.5), _SHARES, (0.1, 0.5), (0.1, 0.5)),
        ),
        Family(
            "relay",
            ("alpha_low", "alpha_high"),
            (_ANGLE, _ANGLE),
            law=lambda p: Relay(min(p), max(p)),
            starts=_grid(tuple(np.linspace(0.05, 0.95, 19)), tuple(np.linspace(0.05, 0.99, 32))),
        ),
        Family(
            "static_separation",
            ("sharpness", "alpha_star"),
            (_SHARPNESS, _ANGLE),
            law=lambda p: Kirchhoff(p[0], p[1]),
            starts=_grid((0.1, 0.3, 0.6), _SHARES),
        ),
        Family(
            "slope_break",
            ("alpha_break",),
            (_ANGLE,),
            static=lambda a, p: np.maximum(a - p[0], 0.0),
            starts=_grid(_SHARES),
        ),
        Family(
            "square_break",
            ("alpha_break",),
            (_ANGLE,),
            static=lambda a, p: np.maximum(a - p[0], 0.0) ** 2,
            starts=_grid(_SHARES),
        ),
        Family("alpha_squared", (), (), static=lambda a, p: a**2, starts=((),)),
    )
}


@dataclass(frozen=True, eq=False)
class Shape:
    """The best-fitting shape of a family, with its linear parameters.

    Attributes
    ----------
    parameters : name -> value.
    at_bound : names of parameters at a bound.
    gains : axis -> gain.
    nuisance : axis -> (k,).
    cost : negative log likelihood up to a constant; samples are block means, which are not
        independent.
    flights : ids of the flights it was fitted to.
    """

    family: str
    parameters: Mapping[str, float]
    at_bound: tuple[str, ...]
    gains: Mapping[str, float]
    nuisance: Mapping[str, Array]
    cost: float
    flights: tuple[str, ...] = field(default=())

    @property
    def law(self) -> Law | None:
        """Law of the state model with the shape's `parameters`, scalars in SI units; None for a
        static family."""
        family = FAMILIES[self.family]
        return None if family.law is None else family.law(tuple(self.parameters.values()))

    def columns(self, flight: StallFlight) -> dict[str, Array]:
        """Columns of unit gains for a flight, axis -> (n,)."""
        return FAMILIES[self.family].columns(flight, tuple(self.parameters.values()))

    def unexplained(self, flight: StallFlight) -> dict[str, Array]:
        """Residual of a flight less the fitted nuisances and stall, axis -> (n,).

        Coefficients are dimensionless.
        """
        columns = self.columns(flight)
        return {
            axis: flight.residual[axis]
            - flight.nuisance[axis] @ self.nuisance[axis]
            - self.gains[axis] * columns[axis]
            for axis in self.gains
        }


def fit_shape(
    flights: Sequence[StallFlight], family: str, *, axes: Sequence[str] = tuple(STALL_GAIN_BOUNDS)
) -> Shape:
    """Fit the shape of `family` to all flights together, by variable projection.

    Parameters
    ----------
    flights : stalled flights.
    family : a name in `FAMILIES`.
    axes : axes to use; those that some flight lacks are left out.

    Raises
    ------
    InputError : there are no flights or no common axes, or no shape separates the flow in any
        flight.
    UnknownNameError : no such family.
    """
    if family not in FAMILIES:
        raise UnknownNameError(
            f"unknown family of stall shapes '{family}'", remedy=nearest(family, FAMILIES)
        )
    common = [axis for axis in axes if all(axis in flight.residual for flight in flights)]
    if not flights or not common:
        raise InputError(
            "no flight with a residual on these axes",
            f"stall shape {family}",
            "give C_lift, C_drag or Cm",
        )
    kind, problem = FAMILIES[family], _Problem(tuple(flights), tuple(common))
    limits = kind.limits(flights)
    wide = np.diff(limits, axis=1).ravel()

    def cost(share: Array) -> float:
        parameters = tuple((limits[:, 0] + np.clip(share, 0.0, 1.0) * wide).tolist())
        return problem.cost(kind, parameters) if kind.observable(flights, parameters) else np.inf

    costs = [cost(np.array(start)) for start in kind.starts]
    if not np.isfinite(min(costs)):
        raise InputError(
            "no flight separates enough of the flow", f"stall shape {family}", "fly a deeper stall"
        )
    share = kind.refined(cost, np.array(kind.starts[int(np.argmin(costs))]))
    parameters = tuple((limits[:, 0] + np.clip(share, 0.0, 1.0) * wide).tolist())
    linear = problem.solved(kind, parameters)
    return Shape(
        family=family,
        parameters=dict(zip(kind.names, parameters, strict=True)),
        at_bound=tuple(
            name
            for name, part in zip(kind.names, share, strict=True)
            if min(part, 1.0 - part) < 1e-3
        ),
        gains={axis: gain for axis, (gain, _) in linear.items()},
        nuisance={axis: values for axis, (_, values) in linear.items()},
        cost=problem.cost(kind, parameters),
        flights=tuple(flight.flight for flight in flights),
    )


def cross_fit_shapes(flights: Sequence[StallFlight], family: str) -> dict[str, Shape]:
    """Fit for each flight the shape to all *other* flights; returns flight id -> shape.

    On its own flight such a shape is a prediction. Raises InputError for fewer than two flights,
    and as `fit_shape`.
    """
    if len(flights) < 2:
        raise InputError(
            "a shape fitted to one flight cannot be checked on it",
            f"stall shape {family}",
            "fly a second stall",
        )
    return {
        flight.flight: fit_shape([other for other in flights if other is not flight], family)
        for flight in flights
    }


class _Problem:
    """Least-squares problem: block means of all flights per axis, nuisances projected out once."""

    def __init__(self, flights: Sequence[StallFlight], axes: Sequence[str]) -> None:
        self.axes = tuple(axes)
        self._flights = tuple(flights)
        self._nuisance = {
            axis: np.concatenate([blocked(f, f.nuisance[axis]) for f in flights]) for axis in axes
        }
        self._response = {
            axis: np.concatenate([blocked(f, f.residual[axis]) for f in flights]) for axis in axes
        }
        self._basis = {axis: _basis(self._nuisance[axis]) for axis in axes}
        self._projected = {
            axis: self._without_nuisance(axis, self._response[axis]) for axis in axes
        }

    def cost(self, kind: Family, parameters: Parameters) -> float:
        """Negative log likelihood up to a constant; each axis's noise is its own residual."""
        total = 0.0
        for axis, column in self._columns(kind, parameters, quickly=True).items():
            own = self._without_nuisance(axis, column)
            unexplained = self._projected[axis] - self._gain(kind, axis, own) * own
            total += 0.5 * unexplained.size * float(np.log(np.mean(unexplained**2)))
        return total

    def solved(self, kind: Family, parameters: Parameters) -> dict[str, tuple[float, Array]]:
        """Axis -> (gain within its bounds, nuisance parameters (k,))."""
        solutions = {}
        for axis, column in self._columns(kind, parameters).items():
            gain = self._gain(kind, axis, self._without_nuisance(axis, column))
            rest: Array = np.linalg.lstsq(
                self._nuisance[axis], self._response[axis] - gain * column, rcond=None
            )[0]
            solutions[axis] = (gain, rest)
        return solutions

    def _columns(
        self, kind: Family, parameters: Parameters, quickly: bool = False
    ) -> dict[str, Array]:
        by_flight = [
            (flight, kind.columns(flight, parameters, quickly)) for flight in self._flights
        ]
        return {
            axis: np.concatenate([blocked(f, each[axis]) for f, each in by_flight])
            for axis in self.axes
        }

    def _without_nuisance(self, axis: str, values: Array) -> Array:
        basis = self._basis[axis]
        return np.asarray(values - basis @ (basis.T @ values))

    def _gain(self, kind: Family, axis: str, own: Array) -> float:
        """Best gain of a column with its nuisance part removed; 0 where the column vanishes."""
        size = float(own @ own)
        return (
            float(np.clip(own @ self._projected[axis] / size, *kind.gains(axis)))
            if size > 0.0
            else 0.0
        )


def _basis(matrix: Array) -> Array:
    """Orthonormal basis (m, r) of the column space of `matrix` (m, k); r = 0 for k = 0."""
    left, sizes, _ = np.linalg.svd(matrix, full_matrices=False)
    return np.asarray(left[:, sizes > 1e-10 * max(sizes.max(initial=0.0), 1e-300)])
