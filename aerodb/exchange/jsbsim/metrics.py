"""Sections, numbers and metrics of JSBSim's XML, which has no document type."""

import math
from collections.abc import Callable
from typing import Any, Final

from aerodb.errors import InputError, nearest
from aerodb.exchange.xml_elements import parsed, shortened
from aerodb.tables import ReferenceGeometry
from aerodb.units import convert

_MAX_BYTES: Final = 20_000_000
MAX_NAME: Final = 1000  # characters of an attribute or of a property name
_DECLARATIONS: Final = tuple(
    declaration.encode(encoding)
    for declaration in ("<!DOCTYPE", "<!ENTITY")
    for encoding in ("ascii", "utf-16-le", "utf-16-be", "utf-32-le", "utf-32-be")
)
_UNITS: Final = {
    "FT2": "ft^2",
    "M2": "m^2",
    "FT": "ft",
    "IN": "inch",
    "M": "m",
    "DEG": "deg",
    "RAD": "rad",
}

#: Further metrics that functions may use: tag -> JSBSim property, its unit, default unit.
_CONSTANTS: Final = {
    "wing_incidence": ("metrics/iw-rad", "rad", "RAD"),
    "htailarea": ("metrics/Sh-sqft", "ft^2", "FT2"),
    "htailarm": ("metrics/lh-ft", "ft", "FT"),
    "vtailarea": ("metrics/Sv-sqft", "ft^2", "FT2"),
    "vtailarm": ("metrics/lv-ft", "ft", "FT"),
}


def read_root(xml: bytes, where: str) -> Any:
    """Return the root element.

    Raises InputError for a document type (entities are never expanded), content that is not XML,
    more than `_MAX_BYTES`, and an attribute of more than `MAX_NAME` characters.
    """
    if any(declaration in xml for declaration in _DECLARATIONS):
        raise _document_type(where)
    root = parsed(xml, where, _MAX_BYTES, remove_comments=True)
    if root.getroottree().docinfo.doctype:
        raise _document_type(where)
    for element in root.iter():
        if any(
            len(text) > MAX_NAME
            for text in (element.tag, *element.attrib.keys(), *element.attrib.values())
        ):
            raise InputError(
                f"an attribute of more than {MAX_NAME} characters in line {element.sourceline}",
                where,
            )
    return root


def _document_type(where: str) -> InputError:
    return InputError("XML with a document type", where, "remove the <!DOCTYPE ...> declaration")


def only_child(parent: Any, tag: str, where: str) -> Any:
    """Return the one child of this tag. Raises InputError if there are none or several."""
    matches = parent.findall(tag)
    if len(matches) != 1:
        raise InputError(
            f"{len(matches)} elements <{tag}> in <{parent.tag}>", where, "exactly one is needed"
        )
    return matches[0]


def read_section(root: Any, tag: str, where: str, loader: Callable[[str], bytes] | None) -> Any:
    """Return the one child of this tag, from its own file if it names one.

    Raises InputError for a file without a `loader`, for a file named by an absolute path or through
    ``..``, and for a file with another root.
    """
    element = only_child(root, tag, where)
    file = element.get("file", "").strip()
    if not file:
        return element
    if loader is None:
        raise InputError(
            f"{tag} are in another file, '{file}'",
            where,
            "provide that file too, or move them into this one",
        )
    if not is_beside(file):
        raise InputError(
            f"{tag} are in a file outside the aircraft's folder, '{file}'",
            where,
            "use a path relative to the aircraft",
        )
    inner = read_root(loader(file), f"{where}: {file}")
    if inner.tag != tag or inner.get("file"):
        raise InputError(f"root element <{inner.tag}>", f"{where}: {file}", f"<{tag}> is needed")
    return inner


def is_beside(file: str) -> bool:
    """Whether the name of a file is relative to an aircraft's folder, and stays inside it."""
    parts = file.replace("\\", "/").split("/")
    return not (file.startswith(("/", "\\")) or ":" in file or ".." in parts)


def read_number(text: str | None, where: str) -> float:
    """Return a finite scalar, in the unit of the element. Raises InputError for any other text."""
    try:
        value = float(text or "")
    except ValueError:
        raise InputError(f"'{shortened(text)}' is not a number", where) from None
    if not math.isfinite(value):
        raise InputError(f"'{shortened(text)}' is not finite", where)
    return value


def _convert(element: Any, text: str | None, default: str, to: str, where: str) -> float:
    unit = element.get("unit") or default  # JSBSim converts nothing for unit="" as without it
    if unit not in _UNITS:
        raise InputError(f"unit '{unit}' of <{element.tag}>", where, nearest(unit, _UNITS))
    return float(convert(read_number(text, f"{where}: <{element.tag}>"), _UNITS[unit], to))


def read_reference(metrics: Any, where: str) -> ReferenceGeometry:
    """Return area, chord, span and moment reference (AERORP) in SI units.

    Positions are in body axes from the structural origin, (3,). Raises InputError where one is
    missing.
    """
    area, span, chord = (
        only_child(metrics, tag, where) for tag in ("wingarea", "wingspan", "chord")
    )
    point = next(
        (place for place in metrics.findall("location") if place.get("name") == "AERORP"), None
    )
    if point is None:
        raise InputError(
            "no <location name='AERORP'> in <metrics>",
            where,
            "state the reference point of the moments",
        )
    x, y, z = (
        _convert(point, only_child(point, axis, where).text, "IN", "m", where) for axis in "xyz"
    )
    return ReferenceGeometry(
        area=_convert(area, area.text, "FT2", "m^2", where),
        chord=_convert(chord, chord.text, "FT", "m", where),
        span=_convert(span, span.text, "FT", "m", where),
        moment_reference=(-x, y, -z),
    )


def read_constants(metrics: Any, where: str) -> dict[str, float]:
    """Return further numbers of ``<metrics>`` by JSBSim property, in JSBSim's units.

    A number that the file leaves out is 0. Raises InputError for an unknown unit.
    """
    values = {}
    for tag, (name, to, default) in _CONSTANTS.items():
        element = metrics.find(tag)
        values[name] = (
            0.0 if element is None else _convert(element, element.text, default, to, where)
        )
    return values


def read_limits(element: Any, where: str) -> tuple[float, float]:
    """Return ``<min>`` and ``<max>`` [rad] of an element; without a unit they are in radians.
    Raises InputError where one is missing."""
    low, high = (
        _convert(element, only_child(element, tag, where).text, "RAD", "rad", where)
        for tag in ("min", "max")
    )
    return low, high
