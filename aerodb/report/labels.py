"""Names in pages and figures: escaped, cut, and with the unit in which a channel is shown."""

import unicodedata
from typing import Final

from aerodb.report.numbers import display_unit, for_people
from aerodb.units import UnitSystem

#: Names longer than this are cut in figures; pages show them in full.
LONGEST: Final = 28


def visible(text: str) -> str:
    """Escape control, formatting and broken characters; log text cannot alter a page.

    >>> visible("a\\x1b[1m")
    'a\\\\x1b[1m'
    """
    hidden = {c for c in text if unicodedata.category(c) in ("Cc", "Cf", "Cs")}
    return text.translate(
        {ord(c): c.encode("unicode_escape", "surrogatepass").decode() for c in hidden}
    )


def in_figure(text: str, most: int = LONGEST) -> str:
    """Return a name for a figure: not parsed as a formula, cut to `most` characters.

    >>> in_figure("$x$")
    '\\\\$x\\\\$'
    """
    shown = visible(text)
    shown = shown if len(shown) <= most else f"{shown[: most - 1]}…"
    return shown.replace("$", r"\$")


def channel_scale(name: str, units: UnitSystem | None = None) -> tuple[float, str]:
    """Return factor (a scalar) to the display unit and axis label of a channel, such as ``alpha
    [deg]``.

    A free input has no unit: it is drawn as it is.

    >>> channel_scale("alpha")[1], channel_scale("mach")[1]
    ('alpha [deg]', 'mach [-]')
    """
    factor, unit = display_unit(name, units)
    return factor, f"{name} [{unit or '-'}]" if unit is not None else in_figure(name)


def parameter_scale(name: str, unit: str) -> tuple[float, str]:
    """As `channel_scale`, for an estimated parameter of unit `unit`."""
    factor, shown = for_people(unit)
    return factor, f"{in_figure(name)} [{shown}]"
