"""Properties that a file's own flight control makes of others: scaled and multiplied positions."""

import contextlib
import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import Any, Final

from aerodb.errors import InputError
from aerodb.exchange.jsbsim.metrics import is_beside, read_number, read_root
from aerodb.exchange.jsbsim.properties import own_property

_CENTRED: Final = ("true", "1", "")


def read_scalings(roots: Iterable[Any], where: str) -> dict[str, list[tuple[str, str]]]:
    """Return property -> the properties that it is a scaled copy of, each with an expression in
    which ``{x}`` stands for that one: those that make it, then those that are made of it.

    roots : elements of the aircraft (`roots_of`). Elements ``aerosurface_scale`` and ``pure_gain``
    with one input are looked at (JSBSim, FGGain): a scale that is centred at zero maps each side of
    its domain to that of its range. What cannot be read, or is made twice, is left out.
    """
    made: dict[str, tuple[str, _Scaling]] = {}
    twice: set[str] = set()
    for element in _components(roots, "aerosurface_scale", "pure_gain"):
        inputs = [_text(child) for child in element.findall("input")]
        if len(inputs) != 1 or element.find("clipto") is not None:
            continue
        try:
            scaling = (_gain if element.tag == "pure_gain" else _scale)(element, where)
        except InputError:
            continue  # a property of the simulation, not a number
        if inputs[0].startswith("-"):
            scaling = scaling.of_negative()
        for output in _outputs(element):
            twice |= {output} & set(made)
            made[output] = (inputs[0].removeprefix("-"), scaling)
    made = {name: each for name, each in made.items() if name not in twice}
    found = {name: [(of, scaling.text())] for name, (of, scaling) in made.items()}
    for name, (of, scaling) in made.items():
        if back := scaling.inverse():
            found.setdefault(of, []).append((name, back.text()))
    return found


@dataclass(frozen=True)
class _Scaling:
    """y = offset + above*x for x > 0, and offset + below*x else (units of the properties)."""

    above: float
    below: float
    offset: float = 0.0

    def of_negative(self) -> "_Scaling":
        return _Scaling(-self.below, -self.above, self.offset)

    def inverse(self) -> "_Scaling | None":
        """The scaling from y to x; None where sides differ about an offset, or one is lost."""
        if not self.above * self.below > 0.0 or (self.offset and self.above != self.below):
            return None
        one, other = 1.0 / self.above, 1.0 / self.below
        return _Scaling(*((one, other) if one > 0 else (other, one)), -self.offset * one)

    def text(self) -> str:
        """The expression, with ``{x}`` for x."""
        shift = f"{self.offset!r} + " if self.offset else ""
        if self.above == self.below:
            return f"{shift}{self.above!r}*{{x}}"
        sides = {"max": self.above, "min": self.below}
        return shift + " + ".join(f"{side}({{x}}, 0)*{k!r}" for side, k in sides.items() if k)


def read_computed(roots: Iterable[Any]) -> dict[str, Any]:
    """Return property -> the element ``function`` by which flight control or a system computes it
    (``fcs_function``); what is limited, or computed twice, is left out."""
    found: dict[str, Any] = {}
    twice: set[str] = set()
    for element in _components(roots, "fcs_function"):
        functions = element.findall("function")
        bare = element.find("clipto") is None and element.find("input") is None
        if bare and len(functions) == 1:
            for output in _outputs(element):
                twice |= {output} & set(found)
                found[output] = functions[0]
    return {name: each for name, each in found.items() if name not in twice}


def roots_of(root: Any, where: str, loader: Callable[[str], bytes] | None) -> list[Any]:
    """Return the element of an aircraft, and those of the files that it names for its flight
    control and systems; one that is not there is left out."""
    found = [root]
    for element in root.iterchildren("flight_control", "autopilot", "system"):
        file = element.get("file", "").strip().removesuffix(".xml")
        for name in (f"Systems/{file}", f"systems/{file}", file):
            if loader is not None and file and is_beside(name):
                with contextlib.suppress(InputError, OSError):  # the aircraft does without
                    found.append(read_root(loader(name), f"{where}: {name}"))
                    break
    return found


def _components(roots: Iterable[Any], *tags: str) -> Iterator[Any]:
    for root in roots:
        yield from root.iter(*tags)


def _outputs(element: Any) -> set[str]:
    """Properties that a component sets: its own, and those that it names."""
    own = own_property(_of_component(element.get("name", "").strip()))
    return {own, *(_text(each) for each in element.findall("output"))}


def _of_component(name: str) -> str:
    """The property of a component's own output (JSBSim, FGFCSComponent).

    >>> _of_component("Flap Normalization"), _of_component("fcs/aileron-deg")
    ('fcs/flap-normalization', 'fcs/aileron-deg')
    """
    return name if "/" in name else f"fcs/{'-'.join(name.lower().split())}"


def _text(element: Any) -> str:
    return own_property(str(element.text or "").strip())


def _number(element: Any, path: str, default: float, where: str) -> float:
    found = element.find(path)
    return default if found is None else read_number(found.text, f"{where}: <{element.tag}>")


def _gain(element: Any, where: str) -> _Scaling:
    gain = _number(element, "gain", 1.0, where)
    return _Scaling(gain, gain)


def _scale(element: Any, where: str) -> _Scaling:
    low = _number(element, "domain/min", -1.0, where)
    high = _number(element, "domain/max", 1.0, where)
    least, most = (_number(element, f"range/{end}", math.nan, where) for end in ("min", "max"))
    gain = _number(element, "gain", 1.0, where)
    if not (math.isfinite(least + most) and low < high):
        raise InputError("a scale without range", where)
    centred = element.find("zero_centered")
    if centred is not None and _text(centred).lower() not in _CENTRED:
        slope = gain * (most - least) / (high - low)
        return _Scaling(slope, slope, gain * least - slope * low)
    return _Scaling(gain * most / high if high else 0.0, gain * least / low if low else 0.0)
