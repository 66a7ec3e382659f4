"""What the flying aircraft has and its database cannot hold: shapes, some of which have a name.

The file that flies is changed, the one that is imported never: controls that are late, have backlash
or a dead zone, surfaces that act on one side, lift that lags, damping that is not linear.
"""

from collections.abc import Callable, Mapping
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from tests.campaigns.planted import NotThere
from tests.support.jsbsim_flights import aircraft_file, jsbsim

Element = ElementTree.Element
Change = Callable[[Element], None]
#: Unit of a surface's property per radian, by its ending; full travel counts as a radian.
UNITS = {"rad": 1.0, "deg": 180.0 / np.pi, "norm": 1.0}


def _node(tag: str, *children: Element, text: str = "", **attributes: str) -> Element:
    made = ElementTree.Element(tag, attributes)
    made.text = text or None
    made.extend(children)
    return made


def _users(root: Element, word: str, axes: tuple[str, ...] = ()) -> list[Element]:
    """Places in the aerodynamics (on some axes) that read a property whose name holds `word`."""
    scopes = [
        part
        for part in root.findall("aerodynamics/*")
        if not axes or (part.tag == "axis" and part.get("name") in axes)
    ]
    found = [
        part
        for scope in scopes
        for part in scope.iter()
        if part.tag in ("property", "p", "independentVar") and word in (part.text or "")
    ]
    if not found:
        raise NotThere(f"nothing uses {word}")
    return found


def _through(root: Element, places: list[Element], made: Callable[[str, float], Element]) -> None:
    """Puts a component of the control system between properties and the places that read them.

    made : from the name of the property and its unit (per rad) to the component.
    """
    control = root.find("flight_control")
    if control is None:
        control = root.find("autopilot")
    if control is None:  # a file whose controls are systems of their own
        control = ElementTree.SubElement(root, "system", name="outside")
    channel = ElementTree.SubElement(control, "channel", name="outside")
    names: dict[str, str] = {}
    for place in places:
        text = (place.text or "").strip()
        name, sign = text.removeprefix("-"), "-" if text.startswith("-") else ""
        if name not in names:
            names[name] = f"outside/{name.replace('/', '-')}-{len(names)}"
            component = made(name, UNITS.get(name.rsplit("-", 1)[-1], 1.0))
            component.set("name", names[name])
            channel.append(component)
        place.text = sign + names[name]


def _actuated(surface: str, part: str, size: float, **attributes: str) -> Change:
    def change(root: Element) -> None:
        def made(name: str, unit: float) -> Element:
            scale = 1.0 if part == "delay" else unit
            return _node(
                "actuator", _node("input", text=name),
                _node(part, text=repr(size * scale), **attributes),
            )  # fmt: skip

        _through(root, _users(root, surface), made)

    return change


def _dead(surface: str, size: float) -> Change:
    def change(root: Element) -> None:
        def made(name: str, unit: float) -> Element:
            return _node(
                "deadband", _node("input", text=name), _node("width", text=repr(2 * size * unit))
            )

        _through(root, _users(root, surface), made)

    return change


def _one_sided(surface: str, share: float) -> Change:
    """The surface acts by `share` more to one side."""

    def change(root: Element) -> None:
        def made(name: str, unit: float) -> Element:
            positive = _node("max", _node("property", text=name), _node("value", text="0"))
            more = _node("product", _node("value", text=repr(share)), positive)
            total = _node("sum", _node("property", text=name), more)
            return _node("fcs_function", _node("function", total))

        _through(root, _users(root, surface), made)

    return change


def _lag(word: str, axes: tuple[str, ...], lag: float) -> Change:
    def change(root: Element) -> None:
        def made(name: str, unit: float) -> Element:
            return _node("lag_filter", _node("input", text=name), _node("c1", text=repr(1.0 / lag)))

        _through(root, _users(root, word, axes), made)

    return change


def _more(axis: str, size: float, *factors: str | tuple[str, str]) -> Change:
    """Adds `size` times properties (each also as ("abs", property)) in coefficients of a moment."""

    def change(root: Element) -> None:
        found = root.find(f"aerodynamics/axis[@name='{axis}']")
        if found is None:
            raise NotThere(axis)
        length = "metrics/cbarw-ft" if axis == "PITCH" else "metrics/bw-ft"
        parts = [
            _node(each[0], _node("property", text=each[1]))
            if isinstance(each, tuple)
            else _node("property", text=each)
            for each in (*factors, "aero/qbar-psf", "metrics/Sw-sqft", length)
        ]
        function = ElementTree.SubElement(found, "function", name=f"outside/{axis}")
        function.append(_node("product", _node("value", text=repr(size)), *parts))

    return change


_P, _ALPHA, _BETA = "velocities/p-aero-rad_sec", "aero/alpha-rad", "aero/beta-rad"
#: Half the span over the airspeed [s].
_ROLL = "aero/bi2vel"
#: Name -> what is changed. Widths are those of both flanks together.
OUTSIDE: Mapping[str, Change] = {
    "aileron backlash": _actuated("aileron", "hysteresis_width", 0.024),
    "elevator backlash": _actuated("elevator", "hysteresis_width", 0.012),
    "elevator dead zone": _dead("elevator", 0.006),
    "aileron dead zone": _dead("aileron", 0.012),
    "aileron late": _actuated("aileron", "delay", 0.15, type="time"),
    "elevator late": _actuated("elevator", "delay", 0.1, type="time"),
    "rudder one-sided": _one_sided("rudder", 0.6),
    "aileron one-sided": _one_sided("aileron", 0.4),
    "lag of lift": _lag("aero/alpha", ("LIFT",), 0.25),
    "damping of |p|": _more("ROLL", -20.0, _P, ("abs", _P), _ROLL, _ROLL),
    "damping of alpha": _more("ROLL", 2.5, _P, _ALPHA, _ROLL),
    "weathercock of beta^3": _more("YAW", 60.0, _BETA, _BETA, _BETA),
}


def changed(name: str, kind: str, folder: Path) -> Path:
    """The folder of aircraft in which `name` has the shape `kind`. Raises NotThere."""
    root = ElementTree.fromstring(aircraft_file(name))
    OUTSIDE[kind](root)
    own = Path(jsbsim.get_default_root_dir()) / "aircraft" / name
    there = folder / name
    there.mkdir(parents=True, exist_ok=True)
    for other in own.iterdir():
        if other.name != f"{name}.xml" and not (there / other.name).exists():
            (there / other.name).symlink_to(other)
    (there / f"{name}.xml").write_bytes(ElementTree.tostring(root))
    return folder
