"""Dimensional derivatives of a linear model, and coefficients: each from the other.

Dimensional derivatives are the entries of linear equations of motion without gravity and
kinematics: a letter for the row (X, Z, M, Y, L, N) and a variable, such as ``Zw``, ``Malpha``,
``Lp`` or ``Ndelta_rudder``. X, Z and Y are accelerations [m/s2 per unit], M, L and N angular
accelerations [rad/s2 per unit]. L and N are those of ``p' = Lp p + Lr r + ...``, with the product
of inertia in them (primed derivatives), or moments over Ixx and Izz (`primed` false). Coefficients
are named like parameters of equation error: ``Cm_q_hat``, ``CZ_alpha``, ``Cl_delta_aileron``, and
``CX_V`` [s/m]. The derivative by the rate of a flow angle is contained in that by the pitch rate.

Every dimensional derivative is a linear combination of coefficients and a constant (the trim), so
that covariances are carried over exactly.

References
----------
"Parameter Identification for Application within a Fault-Tolerant Flight Control System", eqs. 23 to
39 and 53 to 77. "Aerodynamic Model Update Using Parameter Identification Supporting a Cessna Grand
Caravan Engineering Simulation", eqs. 2 to 20. McRuer, Ashkenas & Graham, Aircraft Dynamics and
Automatic Control, 1973, chapter 4 (primed derivatives).
"""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Final, Literal

import numpy as np

from aerodb.errors import InputError
from aerodb.physics import GRAVITY
from aerodb.support import Array

#: Axes of dimensional derivatives: of the body, or rotated by the angle of attack of the trim.
Axes = Literal["body", "stability"]
#: Axes of longitudinal force coefficients: CX and CZ, or C_lift and C_drag.
Forces = Literal["body", "wind"]

_NAME: Final = re.compile(r"([XZMYLN])_?(u|w|q|V|alpha|v|p|r|beta|delta_\w+)")
_LONGITUDINAL: Final = frozenset({"u", "w", "q", "V", "alpha"})
_LATERAL: Final = frozenset({"v", "p", "r", "beta"})
#: Step of differences by a quantity of the flight, as a share of it.
_STEP: Final = 1e-6

#: Coefficient -> weight, and the constant under the name "1".
Combination = dict[str, float]


@dataclass(frozen=True)
class LinearisedFlight:
    """The flight condition and the aircraft of a linear model.

    Parameters
    ----------
    mass : kg. Ixx, Iyy, Izz, Ixz : kg m2 about the CG in body axes.
    area : m2. chord, span : m.
    pressure : dynamic pressure [Pa]. V : airspeed [m/s].
    alpha, theta : trim [rad], wings level. thrust : N, along the body's x axis tilted up by
    `thrust_angle` [rad], through the CG, and independent of airspeed.
    """

    mass: float
    Ixx: float
    Iyy: float
    Izz: float
    Ixz: float
    area: float
    chord: float
    span: float
    pressure: float
    V: float
    alpha: float = 0.0
    theta: float = 0.0
    thrust: float = 0.0
    thrust_angle: float = 0.0

    def __post_init__(self) -> None:
        positive = ("mass", "Ixx", "Iyy", "Izz", "area", "chord", "span", "pressure", "V")
        for name in positive:
            if not getattr(self, name) > 0.0:
                raise InputError(f"{name} is not positive", "flight condition")
        if self.Ixz**2 >= self.Ixx * self.Izz:
            raise InputError("the inertias are of no body: Ixz is too large", "flight condition")

    @property
    def force(self) -> float:
        """Scale ``qbar S`` [N] of force coefficients, a scalar."""
        return self.pressure * self.area

    @property
    def trim_forces(self) -> tuple[float, float]:
        """Aerodynamic CX and CZ of the trim: what carries the weight, less the thrust. Both are
        dimensionless, in body axes; the shape is (2,)."""
        weight = self.mass * GRAVITY
        along = self.thrust * np.cos(self.thrust_angle)
        up = self.thrust * np.sin(self.thrust_angle)
        return (
            (weight * np.sin(self.theta) - along) / self.force,
            (up - weight * np.cos(self.theta)) / self.force,
        )


@dataclass(frozen=True, eq=False)
class Derivatives:
    """names (k), values (k,) and covariance (k, k), SI."""

    names: tuple[str, ...]
    values: Array
    covariance: Array

    def __getitem__(self, name: str) -> float:
        return float(self.values[self.names.index(name)])

    @property
    def standard_errors(self) -> Array:
        """(k,), in SI units, as `values`."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))


def exact(values: Mapping[str, float]) -> Derivatives:
    """Derivatives without covariance. Values (k,) in SI units, covariance (k, k) of zeros."""
    return Derivatives(
        tuple(values), np.array(list(values.values()), dtype=float), np.zeros((len(values),) * 2)
    )


def dimensional_derivatives(
    coefficients: Derivatives,
    names: Iterable[str],
    flight: LinearisedFlight,
    *,
    axes: Axes = "body",
    forces: Forces = "body",
    primed: bool = True,
    errors: Mapping[str, float] | None = None,
) -> Derivatives:
    """Return the dimensional derivatives `names` of coefficients.

    A coefficient that is not given counts as zero. errors : standard errors of quantities of the
    flight, such as ``{"Ixx": 50.0}``, which the covariance then includes.

    Raises InputError for a name that is no dimensional derivative.

    Values (k,) and covariance (k, k) in SI units.
    """
    wanted = tuple(names)
    known = coefficients.names

    def at(place: LinearisedFlight) -> tuple[Array, Array]:
        rows = [_combination(name, place, axes, forces, primed) for name in wanted]
        matrix = np.array([[row.get(name, 0.0) for name in known] for row in rows])
        return matrix, np.array([row.get("1", 0.0) for row in rows])

    matrix, constant = at(flight)
    values = matrix @ coefficients.values + constant
    covariance = matrix @ coefficients.covariance @ matrix.T

    def moved(place: LinearisedFlight) -> Array:
        other, offset = at(place)
        return other @ coefficients.values + offset

    return Derivatives(wanted, values, covariance + _of_flight(moved, flight, errors or {}))


def coefficient_derivatives(
    dimensional: Derivatives,
    flight: LinearisedFlight,
    *,
    axes: Axes = "body",
    forces: Forces = "body",
    primed: bool = True,
    errors: Mapping[str, float] | None = None,
) -> Derivatives:
    """Return the coefficients that dimensional derivatives determine; arguments as in
    `dimensional_derivatives`.

    Raises InputError for a name that is no dimensional derivative, and for one that is not enough:
    with a product of inertia, Lp needs Np as well; Zw needs Zu where the trim has an angle of
    attack.

    Values (k,) and covariance (k, k).
    """

    def solved(place: LinearisedFlight) -> tuple[tuple[str, ...], Array, Array]:
        rows = [_combination(name, place, axes, forces, primed) for name in dimensional.names]
        names = tuple(dict.fromkeys(key for row in rows for key in row if key != "1"))
        matrix = np.array([[row.get(name, 0.0) for name in names] for row in rows])
        if matrix.shape[0] != matrix.shape[1] or np.linalg.matrix_rank(matrix) < len(names):
            raise InputError(
                f"{', '.join(dimensional.names)} do not determine {', '.join(names)}",
                "conversion to coefficients",
                "give both derivatives that share a coefficient, such as Lp with Np and Zu with"
                " Zw; those that the model lacks are 0",
            )
        inverse = np.linalg.inv(matrix)
        constant = np.array([row.get("1", 0.0) for row in rows])
        return names, inverse, inverse @ (dimensional.values - constant)

    names, inverse, values = solved(flight)
    covariance = inverse @ dimensional.covariance @ inverse.T
    moved = _of_flight(lambda place: solved(place)[2], flight, errors or {})
    return Derivatives(names, values, covariance + moved)


def matrix_derivatives(
    A: Array, B: Array, states: Sequence[str], inputs: Sequence[str], flight: LinearisedFlight
) -> dict[str, float]:
    """Return the dimensional derivatives (body axes, primed) of a linear model ``x' = A x + B u``.

    Gravity and kinematics are taken off. states : u, w, q and v, p, r; or V, alpha, q and beta, p,
    r; with theta and phi or without, longitudinal or lateral ones or both. Rows of the forces need
    both of their states (u and w, or V and alpha).

    Raises InputError for other states. A is (s, s), B (s, m), both SI; derivatives are in SI units
    as well.
    """
    known = {"u", "w", "q", "theta", "v", "p", "r", "phi", "V", "alpha", "beta"}
    wrong = [name for name in states if name not in known]
    if wrong:
        raise InputError(f"no derivative belongs to the state '{wrong[0]}'", "linear model")
    variables = [name for name in (*states, *inputs) if name not in ("theta", "phi")]
    entries = {
        state: dict(zip((*states, *inputs), (*A[k], *B[k]), strict=True))
        for k, state in enumerate(states)
    }
    sine, cosine = np.sin(flight.alpha), np.cos(flight.alpha)
    rows: dict[str, dict[str, float]] = {}
    if {"V", "alpha"} <= set(states):
        speed, angle = entries["V"], entries["alpha"]
        rows["X"] = {n: cosine * speed[n] - flight.V * sine * angle[n] for n in variables}
        rows["Z"] = {n: sine * speed[n] + flight.V * cosine * angle[n] for n in variables}
    elif {"u", "w"} <= set(states):
        rows["X"], rows["Z"] = entries["u"], entries["w"]
    if "beta" in states:
        rows["Y"] = {name: flight.V * entries["beta"][name] for name in variables}
    elif "v" in states:
        rows["Y"] = entries["v"]
    rows |= {
        row: entries[state]
        for row, state in (("M", "q"), ("L", "p"), ("N", "r"))
        if state in entries
    }
    kinematic = {
        ("X", "q"): -flight.V * sine,
        ("Z", "q"): flight.V * cosine,
        ("Y", "p"): flight.V * sine,
        ("Y", "r"): -flight.V * cosine,
    }
    return {
        f"{row}{name}": float(values[name] - kinematic.get((row, name), 0.0))
        for row, values in rows.items()
        for name in variables
        if name not in (_LATERAL if row in "XZM" else _LONGITUDINAL)
    }


def _of_flight(
    function: Callable[[LinearisedFlight], Array],
    flight: LinearisedFlight,
    errors: Mapping[str, float],
) -> Array:
    """Covariance due to errors of the flight's quantities, by central differences."""
    known = {each.name for each in fields(LinearisedFlight)}
    total = np.zeros((len(function(flight)),) * 2)
    for name, error in errors.items():
        if name not in known:
            raise InputError(
                f"'{name}' is no quantity of a flight", "conversion", ", ".join(sorted(known))
            )
        value = float(getattr(flight, name))
        step = _STEP * max(abs(value), 1.0)
        up, down = (
            function(replace(flight, **{name: value + sign * step})) for sign in (1.0, -1.0)
        )
        slope = (up - down) / (2.0 * step)
        total += error**2 * np.outer(slope, slope)
    return total


def _combination(
    name: str, flight: LinearisedFlight, axes: Axes, forces: Forces, primed: bool
) -> Combination:
    """A dimensional derivative as a combination of coefficients."""
    found = _NAME.fullmatch(name)
    if found is None or found[2] in (_LATERAL if found[1] in "XZM" else _LONGITUDINAL):
        raise InputError(
            f"'{name}' is no dimensional derivative",
            "conversion",
            "name it by row and variable, such as Zw, Malpha, Lp, Ybeta or Ndelta_rudder",
        )
    row, variable = found[1], found[2]
    if axes == "body":
        return _body(row, variable, flight, forces, primed)
    sine, cosine = np.sin(flight.alpha), np.cos(flight.alpha)
    turned = {
        "X": (("X", cosine), ("Z", sine)),
        "Z": (("Z", cosine), ("X", -sine)),
        "L": (("L", cosine), ("N", sine)),
        "N": (("N", cosine), ("L", -sine)),
    }.get(row, ((row, 1.0),))
    along = {
        "u": (("V", 1.0),),
        "w": (("alpha", 1.0 / flight.V),),
        "p": (("p", cosine), ("r", sine)),
        "r": (("r", cosine), ("p", -sine)),
    }.get(variable, ((variable, 1.0),))
    # Moments over the body's inertias do not turn like a vector; moments themselves do.
    size = {"L": flight.Ixx, "N": flight.Izz} if not primed else {}
    about = dict(zip("LN", _turned_inertias(flight), strict=True)) if not primed else {}
    total: Combination = {}
    for one, weight in turned:
        for other, share in along:
            factor = weight * share * size.get(one, 1.0) / about.get(row, 1.0)
            for key, value in _body(one, other, flight, forces, primed).items():
                total[key] = total.get(key, 0.0) + factor * value
    return total


def _turned_inertias(flight: LinearisedFlight) -> tuple[float, float]:
    """Ixx and Izz in stability axes."""
    sine, cosine = float(np.sin(flight.alpha)), float(np.cos(flight.alpha))
    coupled = 2.0 * flight.Ixz * sine * cosine
    return (
        flight.Ixx * cosine**2 + flight.Izz * sine**2 - coupled,
        flight.Ixx * sine**2 + flight.Izz * cosine**2 + coupled,
    )


def _body(
    row: str, variable: str, flight: LinearisedFlight, forces: Forces, primed: bool
) -> Combination:
    """A derivative in body axes; u, w and v by those of airspeed and flow angles."""
    if variable in ("u", "w"):
        sine, cosine = np.sin(flight.alpha), np.cos(flight.alpha)
        by_speed, by_angle = (cosine, -sine) if variable == "u" else (sine, cosine)
        total: Combination = {}
        for other, weight in (("V", by_speed), ("alpha", by_angle / flight.V)):
            for key, value in _body(row, other, flight, forces, primed).items():
                total[key] = total.get(key, 0.0) + float(weight) * value
        return {key: value for key, value in total.items() if key == "1" or value != 0.0}
    if variable == "v":
        part = _body(row, "beta", flight, forces, primed)
        return {key: value / flight.V for key, value in part.items()}
    half_chord, half_span = flight.chord / (2 * flight.V), flight.span / (2 * flight.V)
    scale = {"q": half_chord, "p": half_span, "r": half_span}.get(variable, 1.0)
    term = f"{variable}_hat" if variable in ("p", "q", "r") else variable
    moment, determinant = flight.force * flight.span, flight.Ixx * flight.Izz - flight.Ixz**2
    if row == "Y":
        return {f"CY_{term}": flight.force / flight.mass * scale}
    if row == "M":
        return {f"Cm_{term}": flight.force * flight.chord / flight.Iyy * scale}
    if row in "LN":
        own, other = ("Cl", "Cn") if row == "L" else ("Cn", "Cl")
        if not primed:
            return {f"{own}_{term}": moment * scale / (flight.Ixx if row == "L" else flight.Izz)}
        direct = (flight.Izz if row == "L" else flight.Ixx) / determinant
        combined = {f"{own}_{term}": moment * scale * direct}
        if flight.Ixz:
            combined[f"{other}_{term}"] = moment * scale * flight.Ixz / determinant
        return combined
    force = flight.force / flight.mass * scale
    at_trim = dict(zip("XZ", flight.trim_forces, strict=True))
    sine, cosine = float(np.sin(flight.alpha)), float(np.cos(flight.alpha))
    constant = 2.0 * at_trim[row] / flight.V if variable == "V" else 0.0
    if forces == "body":
        combined = {f"C{row}_{term}": force}
    else:
        lift, drag = (sine, -cosine) if row == "X" else (-cosine, -sine)
        combined = {f"C_lift_{term}": force * lift, f"C_drag_{term}": force * drag}
        if variable == "alpha":  # lift and drag turn with the angle of attack
            constant = -at_trim["Z"] if row == "X" else at_trim["X"]
    return combined | ({"1": force * constant} if constant else {})
