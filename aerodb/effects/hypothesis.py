"""A hypothesis: one parameter that may be wrong in the database, a sensor or the vehicle file.

Its column is the derivative of the residual, measured minus predicted, with respect to the
parameter: for an aerodynamic hypothesis the term missing from the database, for a sensor the
tangent of the whole chain from the sensor to the coefficients. `library` lists the hypotheses;
`aerodb.tracing` tests them.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np

from aerodb.effects.flight_view import FlightView
from aerodb.nomenclature import FORCE_AXES
from aerodb.support import Array
from aerodb.tables import (
    HAT_RATES,
    LIFT_INCREMENTS,
    WIND_AXES,
    Expression,
    evaluate,
    parse,
    wind_to_body,
)

Kind = Literal["aerodynamic", "sensor"]

#: Body axis -> derivative (n,) of measured - predicted by the parameter.
Columns = Mapping[str, Array]


@dataclass(frozen=True)
class Hypothesis:
    """One parameter and its effect on the residual.

    Attributes
    ----------
    effect : name of the effect, as in reports and JSON.
    axes : body axes on which the parameter acts.
    subject : surface, table or channel concerned, or empty.
    parameter : name, such as "CX_q" or "alpha_bias".
    unit, plausible : SI unit and believable range.
    prior_sigma : prior one sigma of sensor and vehicle-data parameters; None if aerodynamic.
    because : one clause for reports.
    increment : aerodynamic: (axis, regressor over channels), wind axes allowed; `adding` adds
        exactly these to a database.
    tangent : columns of a flight, for sensors and for shapes without an expression.
    secant : of a sensor whose large errors are not its tangent times their size: columns of a
        flight for one of a size, in its unit.
    formula : text, part of the library's hash.
    needs : channels without which a flight cannot show it.
    source : literature or data.
    version : incremented when formula or tangent change.
    limit : effect on the same axis that this is where it is small; it is a shape of that.
    known_by : what determined the believable range from these very flights, or empty; a sensor is
        never blamed beyond it.
    """

    effect: str
    axes: tuple[str, ...]
    subject: str
    parameter: str
    kind: Kind
    unit: str
    plausible: tuple[float, float]
    prior_sigma: float | None
    because: str
    increment: tuple[tuple[str, Expression], ...] = ()
    tangent: Callable[[FlightView], Columns] | None = field(default=None, compare=False, repr=False)
    secant: Callable[[FlightView, float], Columns] | None = field(
        default=None, compare=False, repr=False
    )
    formula: str = ""
    needs: tuple[str, ...] = ()
    source: str = ""
    version: int = 1
    limit: str = ""
    known_by: str = ""

    @property
    def id(self) -> str:
        """``effect@axis`` or ``effect@axis:subject``; unique in a library. Sensors act on all axes:
        ``qbar_scale@all``."""
        where = "all" if self.kind == "sensor" else "+".join(self.written_on)
        return f"{self.effect}@{where}" + (f":{self.subject}" if self.subject else "")

    @property
    def written_on(self) -> tuple[str, ...]:
        """Body or wind axes of its `formula`, one regressor (n,) each; `axes` are the body axes on
        which it acts."""
        return tuple(axis for axis, _ in self.increment) or self.axes

    @cached_property
    def drivers(self) -> tuple[str, ...]:
        """Channels that must vary for the effect to be visible."""
        names = frozenset[str]().union(*(regressor.names for _, regressor in self.increment))
        return tuple(sorted(names)) or self.needs

    def has_shape(self, other: "Hypothesis") -> bool:
        """Return whether `other` is this effect with another shape: this one is linear in one
        variable, and the other is not, or changes with alpha, Mach number or dynamic pressure; or
        this is the `limit` of the other.

        Where flights cannot tell the two apart, they are the same function there; whether the
        effect changes with the condition is tested between flights.
        """
        if not self._linear or not other.increment or self.written_on != other.written_on:
            return False
        if other.limit:
            return other.limit == self.effect
        own, others = set(self.drivers), set(other.drivers)
        return own <= others <= own | {"alpha", "mach", "qbar"} and (
            self.subject == other.subject or own == others
        )

    def is_size_of(self, other: "Hypothesis") -> bool:
        """Return whether `other` is this effect with another of the numbers that it may have, such
        as a lag: at most one of them is right."""
        return bool(self.limit) and (self.effect, self.written_on) == (
            other.effect,
            other.written_on,
        )

    @cached_property
    def _linear(self) -> bool:
        """Whether this is linear in one variable alone."""
        return (
            self.tangent is None
            and len(self.drivers) == 1
            and all(regressor == parse(self.drivers[0]) for _, regressor in self.increment)
        )

    def columns(self, view: FlightView, size: float = 0.0) -> Columns:
        """Columns of one flight, body axis -> (n,), finite, on the axes that the flight has: for an
        error of `size`, in its unit, where it has a `secant`.

        Empty where the flight lacks a channel in `needs`.
        """
        if not view.has(self.needs):
            return {}
        if self.secant is not None and size:
            derivatives: Columns = self.secant(view, size)
        elif self.tangent is not None:
            derivatives = self.tangent(view)
        else:
            derivatives = evaluated(self.increment, view)
        return {axis: _finite(derivatives[axis]) for axis in self.axes if axis in view.usable}


def _finite(values: Array) -> Array:
    """The values (n,), zero where they are not finite."""
    return (
        values
        if math.isfinite(np.dot(values, values)) or np.isfinite(values).all()
        else np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)
    )


def evaluated(increment: tuple[tuple[str, Expression], ...], view: FlightView) -> dict[str, Array]:
    """Return regressors on the body axes, axis -> (n,); those of the lift with the drag that they
    induce."""
    n = len(view.time)
    total: dict[str, Array] = {}
    for axis, regressor in increment:
        values = np.broadcast_to(
            evaluate(regressor, {name: view[name] for name in regressor.names}), (n,)
        )
        parts = {axis: values}
        if axis in WIND_AXES:
            drag, side, lift = (values if axis == wind else 0.0 for wind in WIND_AXES)
            rotated = wind_to_body(drag, side, lift, view["alpha"], view["beta"])
            parts = dict(zip(FORCE_AXES, rotated, strict=True))
        by_lift = view.slope(LIFT_INCREMENTS) if axis == "C_lift" else {}
        if by_lift:  # drag that depends on the lift comes with it
            parts = {body: values * by_lift[body] for body in FORCE_AXES}
        for body, part in parts.items():
            total[body] = total[body] + part if body in total else np.array(part)
    return total


def needed_channels(regressor: Expression) -> tuple[str, ...]:
    """Return the channels of a flight that a regressor needs; a dimensionless rate needs the rate
    [rad/s] and V [m/s] (`HAT_RATES`).

    >>> from aerodb.tables.expression import parse
    >>> needed_channels(parse("alpha*q_hat"))
    ('V', 'alpha', 'q')
    """
    names = {
        part
        for name in regressor.names
        for part in ((HAT_RATES[name][0], "V") if name in HAT_RATES else (name,))
    }
    return tuple(sorted(names))
