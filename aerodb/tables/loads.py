"""Loads: terms in newtons and newton metres, which do not scale with dynamic pressure.

``FX FY FZ`` [N] and ``MX MY MZ`` [N m] act on body axes; moments are about the moment reference. A
load is a share of a coefficient where a coefficient is asked for: the coefficient of a database is
that of its coefficient terms plus ``F/(qbar S)``, of moments ``M/(qbar S l)``. Prediction,
comparison, simulation and exports take that share from here.
"""

from collections.abc import Iterable, Sequence
from functools import cache
from typing import Final

from aerodb.errors import InputError, nearest
from aerodb.tables.algebra import plus, substituted
from aerodb.tables.expression import Expression, Number, Operation, number, parse

#: Load axis -> the coefficient that it is a share of, and the product that makes it one.
_COEFFICIENT: Final[dict[str, tuple[str, str]]] = {
    "FX": ("CX", "qbar*S_ref"),
    "FY": ("CY", "qbar*S_ref"),
    "FZ": ("CZ", "qbar*S_ref"),
    "MX": ("Cl", "qbar*S_ref*b_ref"),
    "MY": ("Cm", "qbar*S_ref*c_ref"),
    "MZ": ("Cn", "qbar*S_ref*b_ref"),
}
#: Axes of loads: forces [N] and moments about the moment reference [N m], body axes.
LOAD_AXES: Final[tuple[str, ...]] = tuple(_COEFFICIENT)


@cache
def scale_of(axis: str, pressure: float | None = None) -> Expression:
    """Return what a coefficient is multiplied by to be the load of an axis [N, N m]; `pressure`
    [Pa] in place of the dynamic pressure where it is given."""
    product = parse(_COEFFICIENT[axis][1])
    return product if pressure is None else substituted(product, {"qbar": number(pressure)})


def load_axis(axis: str) -> str:
    """Return the load axis that a coefficient axis, such as Cm, is a share of; InputError for
    others, such as wind axes."""
    for load, (coefficient, _) in _COEFFICIENT.items():
        if coefficient == axis:
            return load
    raise InputError(f"'{axis}' is no body axis", remedy=nearest(axis, list(_COEFFICIENT)))


def coefficient_axis(axis: str) -> str:
    """Return the coefficient axis that a term's axis acts on: of a load its own, else `axis`."""
    return _COEFFICIENT[axis][0] if axis in _COEFFICIENT else axis


def as_coefficient(axis: str, load: Expression, pressure: float | None = None) -> Expression:
    """Return a load [N, N m] as a dimensionless coefficient, over the database's own lengths and
    dynamic pressure, or the reference pressure [Pa].

    Raises InputError for an axis that is none of `LOAD_AXES`.

    >>> str(as_coefficient("MY", parse("-2*thrust")))
    '-2*thrust/(qbar*S_ref*c_ref)'
    """
    if axis not in _COEFFICIENT:
        raise InputError(f"'{axis}' is no axis of loads", remedy=nearest(axis, LOAD_AXES))
    return Operation("/", load, scale_of(axis, pressure))


def summed(parts: Sequence[Expression]) -> Expression:
    """Return a sum as a balanced tree, so that its depth stays small; 0 of nothing."""
    if not parts:
        return Number(0.0)
    if len(parts) == 1:
        return parts[0]
    half = len(parts) // 2
    return plus(summed(parts[:half]), summed(parts[half:]))


def load_shares(
    terms: Iterable[tuple[str, Expression]], pressure: float | None = None
) -> list[tuple[str, Expression]]:
    """Return the coefficients that loads add, one per load axis that has any: (coefficient axis,
    dimensionless expression).

    terms : (axis, expression [SI]) of each term; those on other axes are passed over. pressure : as
        of `as_coefficient`.
    """
    by_axis: dict[str, list[Expression]] = {}
    for axis, expression in terms:
        if axis in _COEFFICIENT:
            by_axis.setdefault(axis, []).append(expression)
    return [
        (coefficient_axis(axis), as_coefficient(axis, summed(by_axis[axis]), pressure))
        for axis in LOAD_AXES
        if axis in by_axis
    ]
