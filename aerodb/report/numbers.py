"""Numbers and units as text."""

import math
from typing import Final

from aerodb.errors import UnknownNameError
from aerodb.nomenclature import channel
from aerodb.units import UnitSystem, shown_units

_RAISED: Final = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def number(value: float | None, digits: int = 3, zeros: bool = False) -> str:
    """Format a scalar with `digits` significant digits, a true minus sign and powers of ten.

    None and non-finite values give a dash. zeros : keep trailing zeros.

    >>> number(-0.00123456), number(None), number(1234.5), number(0.5, zeros=True), number(2.04e-5)
    ('−0.00123', '–', '1234', '0.500', '2.04×10⁻⁵')
    """
    if value is None or not math.isfinite(value):
        return "–"
    size = abs(value)
    if 10 ** (digits - 1) <= size < 1e6:
        return f"{value:.0f}".replace("-", "−")
    shown, _, power = f"{value:{'#' if zeros else ''}.{digits}g}".replace("-", "−").partition("e")
    return f"{shown}{power_of_ten(int(power.replace('−', '-')))}" if power else shown


def change(before: float, after: float, digits: int = 3) -> str:
    """Format what a value was and what it is, scalars, in one form: neither with a power of ten
    where the other has none, down to a millionth.

    >>> change(0.00166, 9.01e-5), change(2.0e-5, 1.0e-5), change(-4.0, -4.6)
    ('0.00166 -> 0.0000901', '2×10⁻⁵ -> 1×10⁻⁵', '−4 -> −4.6')
    """
    texts = [number(value, digits) for value in (before, after)]
    if len({"×" in text for text in texts}) > 1:
        for k, value in enumerate((before, after)):
            if "×" in texts[k] and 1e-6 <= abs(value) < 1.0:
                places = digits - 1 - math.floor(math.log10(abs(value)))
                texts[k] = f"{value:.{places}f}".rstrip("0").replace("-", "−")
    return " -> ".join(texts)


def power_of_ten(power: int) -> str:
    """A power of ten with raised digits.

    >>> power_of_ten(-8)
    '×10⁻⁸'
    """
    return f"×10{str(power).translate(_RAISED)}"


def for_people(unit: str, units: UnitSystem | None = None) -> tuple[float, str]:
    """Return factor (a scalar) and label of the display unit of an SI unit (`UnitSystem.scale`):
    degrees for radians, a dash without dimension.

    units : as `shown_units` says where none are given.

    >>> [for_people(unit)[1] for unit in ("rad", "rad/s", "1", "m/s^2", "1/rad")]
    ['deg', 'deg/s', '-', 'm/s²', '1/rad']
    """
    return (units or shown_units()).scale(unit)


def display_unit(name: str, units: UnitSystem | None = None) -> tuple[float, str | None]:
    """Factor to the display unit of a channel, and that unit: empty without dimension, None for a
    free input.

    >>> [display_unit(name)[1] for name in ("alpha", "mach", "my_input")]
    ['deg', '', None]
    """
    try:
        factor, unit = for_people(channel(name).unit, units)
    except UnknownNameError:
        return 1.0, None
    return factor, "" if unit == "-" else unit
