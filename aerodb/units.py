"""Conversion of declared units to SI at the boundary; inside the package all values are SI."""

from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import BeforeValidator, Field

from aerodb.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray


@lru_cache(maxsize=1)
def _registry() -> Any:
    import pint  # the import takes a third of a second; calls without a unit skip it

    registry: Any = pint.UnitRegistry(autoconvert_offset_to_baseunit=True)
    # Units that flight-test files use and pint does not know.
    registry.define("psf = pound_force / foot ** 2")
    return registry


_SPELLINGS = {
    "": "dimensionless",
    "-": "dimensionless",
    "1": "dimensionless",
    "g": "g0",
    "lbs": "lbf",
}


@lru_cache(maxsize=256)
def conversion(unit: str, to: str) -> tuple[float, float]:
    """Return scale and offset from `unit` to `to`: ``y = scale * x + offset``.

    ``g`` means standard gravity (9.80665 m/s2), never gram: logs hold accelerations.

    >>> conversion("deg", "rad")[0] * 180
    3.141592653589793
    >>> conversion("degC", "K")
    (1.0, 273.15)

    Raises InputError for an unknown unit, or one of another dimension.
    """
    try:
        source = _registry().Unit(_SPELLINGS.get(unit, unit))
        target = _registry().Unit(_SPELLINGS.get(to, to))
        zero, one = (
            float(_registry().Quantity(x, source).to(target).magnitude) for x in (0.0, 1.0)
        )
    except (
        Exception
    ) as error:  # pint's parser raises many types, down to TokenError, on malformed text
        if type(error).__name__ == "DimensionalityError":
            raise InputError(f"unit '{unit}' cannot be converted to '{to}': {error}") from error
        raise InputError(
            f"unknown unit '{unit}'", remedy="use a unit that pint knows, such as deg, ft/s or slug"
        ) from error
    return one - zero, zero


@lru_cache(maxsize=256)
def si_conversion(unit: str) -> tuple[float, float]:
    """Return scale and offset from `unit` to the SI unit of its dimension, angles in radians.

    >>> round(si_conversion("ft/s")[0], 12)
    0.3048
    >>> si_conversion("g")[0]
    9.80665

    Raises InputError for an unknown unit.
    """
    conversion(unit, unit)  # an unknown one is an error
    base = f"{_registry().Quantity(1.0, _SPELLINGS.get(unit, unit)).to_base_units().units}"
    return conversion(unit, base)


def convert(
    values: "NDArray[np.floating[Any]] | float", unit: str, to: str
) -> "NDArray[np.float64]":
    """Return `values`, given in `unit`, as float64 in `to`."""
    scale, offset = conversion(unit, to)
    import numpy as np  # queries of the catalogue parse quantities and convert no arrays

    result: NDArray[np.float64] = np.asarray(values, dtype=np.float64) * scale
    return result + offset if offset else result


def quantity(value: float | int | str, unit: str) -> float:
    """Return a number in `unit` (SI): a bare number as it is, text such as ``"6.5 ft"`` converted.

    >>> quantity("90 deg", "rad") == quantity(1.5707963267948966, "rad")
    True

    Raises InputError for anything else.
    """
    if isinstance(value, bool):
        raise InputError(f"'{value}' is not a quantity")
    if isinstance(value, (int, float)):
        try:
            return float(value)
        except OverflowError as error:
            raise InputError(f"a number of {len(str(value))} digits is no quantity") from error
    text = value.strip()
    for end in range(len(text), 0, -1):
        try:
            number = float(text[:end])
        except ValueError:
            continue
        return float(convert(number, text[end:].strip() or unit, unit))
    raise InputError(
        f"'{value}' is not a quantity",
        remedy=f"write a number (in {unit or 'no unit'}) or a number with a unit",
    )


def in_unit(unit: str) -> BeforeValidator:
    """Return a validator that accepts a number in SI, or text such as "6.5 ft", as `unit`."""
    return BeforeValidator(
        lambda value: quantity(value, unit) if isinstance(value, (str, int, float)) else value
    )


#: Fields of hand-written files: a number in SI, or text with a unit, converted on reading.
Metres = Annotated[float, in_unit("m")]
Radians = Annotated[float, in_unit("rad")]
Seconds = Annotated[float, in_unit("s"), Field(ge=0)]
Kilograms = Annotated[float, in_unit("kg"), Field(gt=0)]
Inertia = Annotated[float, in_unit("kg m^2")]
Number = Annotated[float, in_unit("")]
Point = tuple[Metres, Metres, Metres]
