"""JSBSim's XML: parsed without document types, entities or network; single elements, numbers and the metrics."""

import math
from typing import Any, Final

from lxml import etree

from aerodb.errors import InputError, nearest
from aerodb.tables.reference import Reference
from aerodb.units import convert

MAX_BYTES: Final = 20_000_000
_UNITS: Final = {"FT2": "ft^2", "M2": "m^2", "FT": "ft", "IN": "inch", "M": "m"}


def read_root(xml: bytes, where: str) -> Any:
    """The root element. Raises InputError for a document type, for what is not XML and for more than `MAX_BYTES`."""
    if len(xml) > MAX_BYTES:
        raise InputError(f"{len(xml)} bytes of XML", where, f"at most {MAX_BYTES}")
    parser = etree.XMLParser(resolve_entities=False, no_network=True, load_dtd=False, remove_comments=True, remove_pis=True)
    try:
        root = etree.fromstring(xml, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise InputError(f"not valid XML: {error}", where) from None
    if root.getroottree().docinfo.doctype:
        raise InputError("XML with a document type", where, "remove the <!DOCTYPE ...> declaration")
    return root


def only(parent: Any, tag: str, where: str) -> Any:
    """The one child of this tag; InputError when there are none or several."""
    found = parent.findall(tag)
    if len(found) != 1:
        raise InputError(f"{len(found)} elements <{tag}> in <{parent.tag}>", where, "exactly one is needed")
    return found[0]


def read_number(text: str | None, where: str) -> float:
    """A finite number from text, else InputError."""
    try:
        value = float(text or "")
    except ValueError:
        raise InputError(f"'{(text or '').strip()}' is not a number", where) from None
    if not math.isfinite(value):
        raise InputError(f"'{(text or '').strip()}' is not finite", where)
    return value


def _metres(element: Any, text: str | None, default: str, to: str, where: str) -> float:
    unit = element.get("unit", default)
    if unit not in _UNITS:
        raise InputError(f"unit '{unit}' of <{element.tag}>", where, nearest(unit, _UNITS))
    return float(convert(read_number(text, f"{where}: <{element.tag}>"), _UNITS[unit], to))


def read_reference(metrics: Any, where: str) -> Reference:
    """Area, chord, span and moment reference (AERORP) in SI; positions from the structural origin in body axes."""
    area, span, chord = (only(metrics, tag, where) for tag in ("wingarea", "wingspan", "chord"))
    point = next((place for place in metrics.findall("location") if place.get("name") == "AERORP"), None)
    if point is None:
        raise InputError("no <location name='AERORP'> in <metrics>", where, "moments need their reference point")
    x, y, z = (_metres(point, only(point, axis, where).text, "IN", "m", where) for axis in "xyz")
    return Reference(
        area=_metres(area, area.text, "FT2", "m^2", where),
        chord=_metres(chord, chord.text, "FT", "m", where),
        span=_metres(span, span.text, "FT", "m", where),
        moment_reference=(-x, y, -z),
    )
