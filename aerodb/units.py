"""Conversion of declared units to SI at the boundary; inside the package all values are SI.

`UnitSystem` is the other boundary: in which units people are shown quantities.
"""

import math
import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final

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


#: What tools write -> the unit as pint knows it; G and R as accelerations and temperatures have it.
_SPELLINGS: Final = {
    **dict.fromkeys(("", "-", "1"), "dimensionless"),
    **{"g": "g0", "G": "g0", "lbs": "lbf", "R": "degR", "C": "degC", "F": "degF"},
    **{"NM": "nautical_mile", "kN": "kN"},
}
#: The same in any case and with any spaces; words of which the case decides are not among them.
_ANY_CASE: Final = {
    **dict.fromkeys(("deg", "degs", "degree", "degrees", "degtrue", "degmag"), "deg"),
    # German; the hundredth of a right angle is "gon".
    **{"grad": "deg", "grad/s": "deg/s", "grad/sec": "deg/s"},
    **dict.fromkeys(("rad", "rads", "radian", "radians"), "rad"),
    **{"cdeg": "cdeg", "mrad": "mrad", "cdeg/s": "cdeg/s", "mrad/s": "mrad/s"},
    **dict.fromkeys(("deg/s", "deg/sec", "degs/sec", "degree/s", "degrees/s", "dps"), "deg/s"),
    **dict.fromkeys(("degrees/second", "degree/second", "degs/s"), "deg/s"),
    **dict.fromkeys(("rad/s", "rad/sec", "rads/s", "radians/s", "rads/sec"), "rad/s"),
    **dict.fromkeys(("deg/s2", "deg/s^2", "deg/s/s", "deg/sec2", "deg/sec^2"), "deg/s^2"),
    **dict.fromkeys(("rad/s2", "rad/s^2", "rad/s/s", "rad/sec2", "rad/sec^2"), "rad/s^2"),
    **dict.fromkeys(("kt", "kts", "kn", "knot", "knots", "ktas", "kias", "kcas", "keas"), "knot"),
    **dict.fromkeys(("m/s", "m/sec", "mps", "ms-1", "ms^-1", "meters/sec", "meter/s"), "m/s"),
    **dict.fromkeys(("ft/s", "ft/sec", "fps", "feet/s", "feet/sec"), "ft/s"),
    **dict.fromkeys(("ft/min", "fpm", "feet/min"), "ft/min"),
    **dict.fromkeys(("km/h", "kmh", "kph", "km/hr"), "km/h"),
    **{"mph": "mile/hour", "cm/s": "cm/s", "mm/s": "mm/s"},
    **dict.fromkeys(("m/s2", "m/s^2", "m/s/s", "m/sec2", "m/sec^2", "mps2", "ms-2"), "m/s^2"),
    **dict.fromkeys(("ft/s2", "ft/s^2", "ft/s/s", "ft/sec2", "ft/sec^2", "fps2"), "ft/s^2"),
    **dict.fromkeys(("g", "gs", "g's"), "g0"),
    **dict.fromkeys(("m", "meter", "meters", "metre", "metres"), "m"),
    **dict.fromkeys(("ft", "feet", "foot"), "ft"),
    **dict.fromkeys(("in", "inch", "inches"), "inch"),
    **{"km": "km", "cm": "cm", "mm": "mm", "nmi": "nautical_mile"},
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), "s"),
    **dict.fromkeys(("ms", "msec", "millis", "milliseconds", "millisecond"), "ms"),
    **dict.fromkeys(("us", "usec", "micros", "microseconds", "microsecond"), "us"),
    **dict.fromkeys(("ns", "nsec", "nanoseconds", "nanosecond"), "ns"),
    **dict.fromkeys(("min", "mins", "minute", "minutes"), "minute"),
    **dict.fromkeys(("h", "hr", "hrs", "hour", "hours"), "hour"),
    **dict.fromkeys(("degc", "celsius", "centigrade"), "degC"),
    **dict.fromkeys(("degf", "fahrenheit"), "degF"),
    **dict.fromkeys(("k", "kelvin", "degk"), "K"),
    **dict.fromkeys(("degr", "rankine"), "degR"),
    **dict.fromkeys(("pa", "pascal", "n/m2", "n/m^2"), "Pa"),
    **{"hpa": "hPa", "kpa": "kPa", "mbar": "mbar", "mb": "mbar", "bar": "bar", "psi": "psi"},
    **dict.fromkeys(("psf", "lbf/ft2", "lbf/ft^2", "lb/ft2", "lb/ft^2", "lbs/ft2"), "psf"),
    **dict.fromkeys(("lbs/ft^2", "lbsf/ft2"), "psf"),
    **dict.fromkeys(("inhg", "inchhg", "in.hg", "inhga"), "inHg"),
    **dict.fromkeys(("kg/m3", "kg/m^3"), "kg/m^3"),
    **dict.fromkeys(("lb/ft3", "lb/ft^3", "lbm/ft3", "lbm/ft^3"), "lb/ft^3"),
    **dict.fromkeys(("slug/ft3", "slug/ft^3", "slugs/ft3", "slugs/ft^3"), "slug/ft^3"),
    **{"kg": "kg", "lb": "lb", "slug": "slug", "slugs": "slug", "n": "N", "newton": "N"},
    **{"lbf": "lbf", "newtons": "N", "ratio": "dimensionless"},
    **dict.fromkeys(("%", "pct", "percent"), "percent"),
}
#: What tools write behind a unit about the quantity, not the unit.
_QUALIFIERS: Final = re.compile(r"(?<=[a-z])\s*_?(msl|agl|amsl|asl|baro|wgs|gps|true|mag)$")
#: Units of columns that are no channels, in rows of units.
_OTHER_UNITS: Final = frozenset(
    [
        "volts",
        "volt",
        "v",
        "mv",
        "amps",
        "amp",
        "a",
        "ma",
        "mah",
        "w",
        "rpm",
        "gals",
        "gal",
        "gph",
        "pph",
        "hz",
        "khz",
        "bool",
        "enum",
        "ident",
        "text",
        "string",
        "crsr",
        "#",
        "none",
        "n/a",
        "yyyy-mm-dd",
        "yyy-mm-dd",
        "hh:mm:ss",
        "hh:mm",
        "dd.mm.yyyy",
        "utc",
        "count",
        "counts",
        "int",
        "float",
        "pixel",
        "dbm",
        "c",
        "f",
        "r",
    ]
)


def spelled(unit: str) -> str:
    """Return a unit as pint knows it, from what tools write; unknown text as it is.

    >>> spelled("KTAS"), spelled("deg/sec^2"), spelled("ft MSL"), spelled("R"), spelled("slug")
    ('knot', 'deg/s^2', 'ft', 'degR', 'slug')
    """
    if unit in _SPELLINGS:
        return _SPELLINGS[unit]
    plain = unit.strip()
    for sign, word in _SIGNS.items():
        plain = plain.replace(sign, word)
    short = re.sub(r"\s+", "", plain.lower())
    for key in (short, _QUALIFIERS.sub("", plain.lower()).strip(), _QUALIFIERS.sub("", short)):
        if key in _ANY_CASE:
            return _ANY_CASE[key]
    return _SPELLINGS.get(plain, plain)


def _is_unit(unit: str) -> bool:
    try:
        conversion(unit, unit)
    except InputError:
        return False
    return True


_SIGNS: Final = {"°": "deg", "º": "deg", "µ": "u", "μ": "u", "²": "^2", "³": "^3", "⁻¹": "^-1"}


def is_spelled(text: str) -> bool:
    """Return whether a text is a unit as logs write it, such as ``KTAS`` or ``ft msl``.

    >>> is_spelled("ft msl"), is_spelled("time"), is_spelled("deg C")
    (True, False, True)
    """
    words = text.strip()
    unit = spelled(words)
    return (
        words in ("", "-")
        or words in _SPELLINGS
        or (unit != words and _is_unit(unit))
        or words.lower() in _ANY_CASE
        or words.lower() in _OTHER_UNITS
    )


#: Common units and their SI units -> scale and offset as pint gives them, whose start takes as long
#: as half a command.
_TO_SI: Final = {
    ("degC", "K"): (1.0, 273.15),
    ("deg", "rad"): (0.017453292519943295, 0.0),
    ("deg/s", "rad/s"): (0.017453292519943295, 0.0),
    ("deg/s^2", "rad/s^2"): (0.017453292519943295, 0.0),
    ("ft", "m"): (0.30479999999999996, 0.0),
    ("inch", "m"): (0.0254, 0.0),
    ("mm", "m"): (0.001, 0.0),
    ("cm", "m"): (0.01, 0.0),
    ("km", "m"): (1000.0, 0.0),
    ("nautical_mile", "m"): (1852.0, 0.0),
    ("ft^2", "m^2"): (0.09290303999999999, 0.0),
    ("km/h", "m/s"): (0.2777777777777778, 0.0),
    ("ft/min", "m/s"): (0.0050799999999999994, 0.0),
    ("ft/s", "m/s"): (0.30479999999999996, 0.0),
    ("knot", "m/s"): (0.5144444444444445, 0.0),
    ("g0", "m/s^2"): (9.80665, 0.0),
    ("ft/s^2", "m/s^2"): (0.30479999999999996, 0.0),
    ("hPa", "Pa"): (100.0, 0.0),
    ("mbar", "Pa"): (100.0, 0.0),
    ("kPa", "Pa"): (1000.0, 0.0),
    ("psf", "Pa"): (47.88025898033586, 0.0),
    ("lb", "kg"): (0.4535923700000001, 0.0),
    ("slug", "kg"): (14.59390293720637, 0.0),
    ("slug ft^2", "kg m^2"): (1.3558179483314006, 0.0),
    ("rpm", "rad/s"): (0.10471975511965977, 0.0),
    ("percent", "dimensionless"): (0.01, 0.0),
    ("lbf", "N"): (4.4482216152605005, 0.0),
    ("ms", "s"): (0.001, 0.0),
    ("us", "s"): (1e-06, 0.0),
    **{(name, name): (1.0, 0.0) for name in ("dimensionless", "m", "m/s", "m/s^2", "rad", "rad/s")},
    **{(name, name): (1.0, 0.0) for name in ("rad/s^2", "s", "Pa", "N", "K", "kg", "kg/m^3")},
    **{(name, name): (1.0, 0.0) for name in ("Hz", "m^2", "kg m^2", "V")},
}
#: The same by unit alone, and with each unit to itself, as checks of a unit ask.
_IN_SI: Final = {unit: pair for (unit, _), pair in _TO_SI.items()}
_COMMON: Final = _TO_SI | {(unit, unit): (1.0, 0.0) for unit in _IN_SI}


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
    known = _COMMON.get((spelled(unit), spelled(to)))
    return _by_pint(unit, to) if known is None else known


def _by_pint(unit: str, to: str) -> tuple[float, float]:
    """What `conversion` returns, by pint's registry."""
    try:
        source = _registry().Unit(spelled(unit))
        target = _registry().Unit(spelled(to))
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
    if (known := _IN_SI.get(spelled(unit))) is not None:
        return known
    conversion(unit, unit)  # an unknown one is an error
    base = f"{_registry().Quantity(1.0, spelled(unit)).to_base_units().units}"
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


#: Systems of units, as they are chosen.
UNIT_SYSTEMS: Final = tuple(_SHOWN)
#: Units of a system that are named in words.
_NAMED: Final = 4


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

    @property
    def words(self) -> str:
        """The system in words.

        >>> UnitSystem("aero").words
        'kt, ft, hPa, otherwise SI units'
        """
        others = [label for label, _ in _SHOWN[self.name].values()][:_NAMED]
        return ", ".join([*others, "otherwise SI units"]) if others else "SI units"

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
_SHOWN_IN: Final = ContextVar("units in which quantities are shown", default=SI)


def shown_units() -> UnitSystem:
    """Return the units in which whoever reads is shown quantities: those of `shown_in`, else SI."""
    return _SHOWN_IN.get()


@contextmanager
def shown_in(units: UnitSystem) -> Iterator[None]:
    """Context manager in which pages and figures are drawn in these units.

    >>> with shown_in(UnitSystem("aero")):
    ...     shown_units().shown(100.0, "m/s")
    '194 kt'
    """
    before = _SHOWN_IN.set(units)
    try:
        yield
    finally:
        _SHOWN_IN.reset(before)
