"""Forward-mode automatic differentiation: arithmetic that carries exact first derivatives.

Sensor models are written once, as formulas; their derivatives follow from the chain rule.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from aerodb.support.arrays import Array

Value = Array | float


@dataclass(frozen=True)
class Dual:
    """A dual number: `value` (n,) or scalar, and its derivatives `by` each named variable.

    >>> x = Dual(3.0, {"x": 1.0})
    >>> (x * x + 1.0).by["x"]
    6.0
    """

    value: Value
    by: Mapping[str, Value]

    def chain(self, value: Value, slope: Value) -> "Dual":
        """Return a function of this signal, given its `value` and its `slope` by this signal."""
        return Dual(value, {name: slope * part for name, part in self.by.items()})

    def __add__(self, other: "Dual | Value") -> "Dual":
        if not isinstance(other, Dual):
            return Dual(self.value + other, self.by)
        by = dict(self.by)
        for name, part in other.by.items():
            by[name] = by[name] + part if name in by else part
        return Dual(self.value + other.value, by)

    def __mul__(self, other: "Dual | Value") -> "Dual":
        if not isinstance(other, Dual):
            return self.chain(self.value * other, other)
        by = {name: other.value * part for name, part in self.by.items()}
        for name, part in other.by.items():
            slope = self.value * part
            by[name] = by[name] + slope if name in by else slope
        return Dual(self.value * other.value + 0.0, by)

    def __neg__(self) -> "Dual":
        return self.chain(-self.value, -1.0)

    def __sub__(self, other: "Dual | Value") -> "Dual":
        if not isinstance(other, Dual):
            return Dual(self.value - other, self.by)
        by = dict(self.by)
        for name, part in other.by.items():
            by[name] = by[name] - part if name in by else -1.0 * part
        return Dual(self.value - other.value, by)

    def __rsub__(self, other: Value) -> "Dual":
        return -self + other

    def __truediv__(self, other: "Dual | Value") -> "Dual":
        if not isinstance(other, Dual):
            return self * (1.0 / other)
        return self * other.chain(1.0 / other.value, -1.0 / other.value**2)

    # Keep numpy from applying its operators element by element to a Dual
    __array_ufunc__ = None
    __radd__ = __add__
    __rmul__ = __mul__


Triple = tuple[Dual, Dual, Dual]


def sine(x: Dual) -> Dual:
    """Return ``sin(x)``. x : [rad], (n,) or scalar."""
    return x.chain(np.sin(x.value), np.cos(x.value))


def cosine(x: Dual) -> Dual:
    """Return ``cos(x)``. x : [rad], (n,) or scalar."""
    return x.chain(np.cos(x.value), -np.sin(x.value))


def root(x: Dual) -> Dual:
    """Return the square root; x must be positive.

    (n,) or scalar; zero or less gives inf or nan, and no error is raised.
    """
    value = np.sqrt(x.value)
    return x.chain(value, 0.5 / value)


def arcsine(x: Dual) -> Dual:
    """Return ``asin(x)``, x between -1 and 1. (n,) or scalar [rad]."""
    return x.chain(np.arcsin(x.value), 1.0 / np.sqrt(1.0 - x.value**2))


def angle(y: Dual, x: Dual) -> Dual:
    """Return ``atan2(y, x)``. (n,) or scalar [rad]; both zero gives nan derivatives."""
    square = x.value**2 + y.value**2
    value = np.arctan2(y.value, x.value)
    return y.chain(value, x.value / square) + x.chain(0.0, -y.value / square)


def dead_zone(x: Dual, edge: float) -> Dual:
    """Return the part of x beyond +-`edge`, with its sign; zero inside.

    (n,) or scalar; x and `edge` have one unit.
    """
    outside = np.abs(x.value) > edge
    return x.chain(
        np.where(outside, x.value - edge * np.sign(x.value), 0.0), np.where(outside, 1.0, 0.0)
    )


def cross(a: Triple, b: Triple) -> Triple:
    """Return the vector product ``a x b``.

    Components (n,) or scalar; the unit is the product of theirs.
    """
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def body_to_earth(phi: Dual, theta: Dual, psi: Dual) -> tuple[Triple, Triple, Triple]:
    """Return the rows of the rotation from body to earth (north, east, down) axes.

    Euler angles 3-2-1 [rad]; the transpose rotates from earth to body axes.

    Elements are (n,) or scalar.
    """
    cf, sf, ct, st, cp, sp = (f(x) for x in (phi, theta, psi) for f in (cosine, sine))
    return (
        (ct * cp, sf * st * cp - cf * sp, cf * st * cp + sf * sp),
        (ct * sp, sf * st * sp + cf * cp, cf * st * sp - sf * cp),
        (-st, sf * ct, cf * ct),
    )


def dot(a: Triple, b: Triple) -> Dual:
    """Return the scalar product.

    Of components (n,) or scalar; the unit is the product of theirs.
    """
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
