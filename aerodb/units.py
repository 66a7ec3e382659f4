"""Conversion of declared units to SI at the boundary; inside the package all values are SI.

`UnitSystem` is the other boundary: in which units people are shown quantities.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Annotated, Any, Final

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


_FOOT: Final = 0.3048  # m
_POUND: Final = 0.45359237  # kg
_POUND_FORCE: Final = _POUND * 9.80665  # N
_SLUG: Final = _POUND_FORCE / _FOOT  # kg

#: System -> SI unit -> the unit in it, and what of the SI unit that is; other units stay SI.
_SHOWN: Final[Mapping[str, Mapping[str, tuple[str, float]]]] = {
    "si": {},
    "aero": {
        "m/s": ("kt", 1852.0 / 3600.0),
        "m": ("ft", _FOOT),
        "Pa": ("hPa", 100.0),
    },
    "imperial": {
        "m/s": ("ft/s", _FOOT),
        "m/s^2": ("ft/s²", _FOOT),
        "m": ("ft", _FOOT),
        "kg": ("lb", _POUND),
        "kg/s": ("lb/s", _POUND),
        "kg/m^3": ("slug/ft³", _SLUG / _FOOT**3),
        "kg m^2": ("slug ft²", _SLUG * _FOOT**2),
        "N": ("lbf", _POUND_FORCE),
        "N m": ("lbf ft", _POUND_FORCE * _FOOT),
        "Pa": ("psf", _POUND_FORCE / _FOOT**2),
        "K": ("degR", 5.0 / 9.0),
    },
}


@dataclass(frozen=True)
class UnitSystem:
    """Units in which people are shown quantities: ``si``, ``aero`` (kt, ft, hPa) or ``imperial``;
    angles are in degrees in each, and slopes per radian.

    Raises InputError for another name.
    """

    name: str = "si"

    def __post_init__(self) -> None:
        if self.name not in _SHOWN:
            raise InputError(
                f"no system of units is called '{self.name[:40]}'",
                "--units",
                f"choose one of: {', '.join(_SHOWN)}",
            )

    def scale(self, unit: str) -> tuple[float, str]:
        """Return factor (a scalar) from an SI unit to the unit shown, and its label; a dash without
        dimension.

        >>> UnitSystem("aero").scale("m/s")[1], UnitSystem("imperial").scale("rad/s")[1]
        ('kt', 'deg/s')
        >>> round(UnitSystem("aero").scale("m")[0] * 0.3048, 12)
        1.0
        """
        shown = _SHOWN[self.name].get(unit)
        if shown is not None:
            return 1.0 / shown[1], shown[0]
        label = unit.replace("^2", "²").replace("^3", "³")
        if unit == "rad" or unit.startswith("rad/"):
            return math.degrees(1.0), label.replace("rad", "deg", 1)
        return 1.0, label if unit not in ("", "1") else "-"

    def shown(self, value: float, unit: str, digits: int = 3) -> str:
        """Return a value of an SI unit with its unit, as people are shown it.

        >>> UnitSystem("aero").shown(100.0, "m/s"), UnitSystem().shown(0.0873, "rad")
        ('194 kt', '5 deg')
        """
        factor, label = self.scale(unit)
        size = abs(factor * value)
        form = ".0f" if 10 ** (digits - 1) <= size < 1e6 else f".{digits}g"
        return f"{factor * value:{form}}{'' if label == '-' else f' {label}'}"


#: SI, angles in degrees: what is shown where nobody has chosen.
SI: Final = UnitSystem()
