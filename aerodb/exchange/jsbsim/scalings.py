"""Properties that a file's own flight control makes of others: scaled and multiplied positions."""

import math
from typing import Any, Final

from aerodb.errors import InputError
from aerodb.exchange.jsbsim.metrics import read_number

_CENTRED: Final = ("true", "1", "")


def read_scalings(root: Any, where: str) -> dict[str, tuple[str, str]]:
    """Return property -> the property that it is made of, and an expression in which ``{x}`` stands
    for that one.

    root : element of the aircraft. Elements ``aerosurface_scale`` and ``pure_gain`` with one input
    are looked at (JSBSim, FGGain): a scale that is centred at zero maps each side of its domain to
    that of its range. What cannot be read, or is made twice, is left out.
    """
    found: dict[str, tuple[str, str]] = {}
    twice: set[str] = set()
    for tag, expression in (("aerosurface_scale", _scale), ("pure_gain", _gain)):
        for element in root.iter(tag):
            inputs = [_text(child) for child in element.findall("input")]
            outputs = [_text(child) for child in element.findall("output")]
            if len(inputs) != 1 or not outputs or element.find("clipto") is not None:
                continue
            sign = "-" if inputs[0].startswith("-") else ""
            try:
                text = expression(element, where)
            except InputError:
                continue  # a property of the simulation, not a number
            for output in outputs:
                twice |= {output} & set(found)
                found[output] = (inputs[0].removeprefix("-"), text.replace("{x}", f"({sign}{{x}})"))
    return {name: made for name, made in found.items() if name not in twice}


def _text(element: Any) -> str:
    return str(element.text or "").strip()


def _number(element: Any, path: str, default: float, where: str) -> float:
    found = element.find(path)
    return default if found is None else read_number(found.text, f"{where}: <{element.tag}>")


def _gain(element: Any, where: str) -> str:
    return f"{_number(element, 'gain', 1.0, where)!r}*{{x}}"


def _scale(element: Any, where: str) -> str:
    low = _number(element, "domain/min", -1.0, where)
    high = _number(element, "domain/max", 1.0, where)
    least, most = (_number(element, f"range/{end}", math.nan, where) for end in ("min", "max"))
    gain = _number(element, "gain", 1.0, where)
    if not (math.isfinite(least + most) and low < high):
        raise InputError("a scale without range", where)
    centred = element.find("zero_centered")
    if centred is not None and _text(centred).lower() not in _CENTRED:
        return f"{gain!r}*({least!r} + ({{x}} - {low!r})*{(most - least) / (high - low)!r})"
    above = f"max({{x}}, 0)*{gain * most / high!r}" if high else ""
    below = f"min({{x}}, 0)*{gain * least / low!r}" if low else ""
    return " + ".join(part for part in (above, below) if part)
