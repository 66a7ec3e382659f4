"""What is made wrong in the database that flights of the whole aircraft are traced against.

The file that is imported is changed, never the aircraft that flies. Functions are found by the axis
on which they act and by the properties that they contain, so that one description serves every
aircraft; what changes has the shape of the aircraft's own tables.
"""

import copy
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from xml.etree import ElementTree

import numpy as np

from aerodb.coefficients.comparison import compare
from aerodb.coefficients.total import total_coefficients
from aerodb.effects.flight_view import view_of
from aerodb.effects.library import hypotheses_for
from aerodb.flight import Flight
from aerodb.signals import rms
from aerodb.support import Array
from aerodb.tables.database import AeroDatabase
from aerodb.vehicle import parse_vehicle
from tests.campaigns.fleet import Airframe, trimmed, vehicle_text
from tests.support.jsbsim_flights import POUND, aircraft_file

Element = ElementTree.Element
Change = Callable[[Element, Airframe], None]
ALPHA = ("aero/alpha-rad", "aero/alpha-deg")
_RATES = ("p-aero", "q-aero", "r-aero", "alphadot", "p-rad", "q-rad", "r-rad")
_MACH = "velocities/mach"
_THRUST = "planted/thrust"
#: Share of what is lacking that one hypothesis must be, or there is no value that is true of it.
EXACT = 0.98
ZERO = 0.002  # rad; one sigma of a surface's zero, where it was measured


class NotThere(Exception):
    """The aircraft's file has nothing of the kind."""


@dataclass(frozen=True)
class Planted:
    """One error of the database. right : hypotheses, or their beginnings, that name it. near : others
    that an explanation set may hold in its place. axis : on which the error is judged. bindings :
    of properties that it brings. differs : hypotheses, or their beginnings, whose size then differs
    between flights: where flights of one minute hardly change what it depends on, that names it."""

    change: Change
    right: tuple[str, ...]
    axis: str
    near: tuple[str, ...] = ()
    bindings: Mapping[str, str] = field(default_factory=dict)
    differs: tuple[str, ...] = ()

    def file(self, craft: Airframe) -> bytes:
        """The aircraft's file with the error. Raises NotThere."""
        root = ElementTree.fromstring(aircraft_file(craft.name))
        self.change(root, craft)
        return ElementTree.tostring(root)

    def bindings_of(self, craft: Airframe) -> dict[str, str]:
        """Bindings for what its file still uses."""
        aerodynamics = ElementTree.fromstring(self.file(craft)).find("aerodynamics")
        assert aerodynamics is not None
        known = {**craft.bindings, **self.bindings}
        used = {(part.text or "").strip().removeprefix("-") for part in aerodynamics.iter()}
        return {name: text for name, text in known.items() if name in used}

    def names(self, hypothesis: str, near: bool = False) -> bool:
        """Whether `hypothesis` is right, or near it too."""
        return hypothesis.startswith(self.right + (self.near if near else ()))


def _acting(root: Element, axis: str) -> Element:
    found = root.findall(f"aerodynamics/axis[@name='{axis}']")
    if len(found) != 1:
        raise NotThere(f"{len(found)} axes {axis}")
    return found[0]


def _properties(function: Element) -> set[str]:
    tags = ("property", "p", "independentVar")
    return {(part.text or "").strip() for part in function.iter() if part.tag in tags}


def _functions(
    root: Element, axis: str, having: tuple[str, ...], without: tuple[str, ...] = ()
) -> list[Element]:
    """Functions on an axis with a property that holds one of `having`, and none of `without`."""
    found = [
        function
        for function in _acting(root, axis).findall("function")
        if any(word in p for p in _properties(function) for word in having)
        and not any(word in p for p in _properties(function) for word in without)
    ]
    if not found:
        raise NotThere(f"no function of {having} on {axis}")
    return found


def _operation(function: Element) -> Element:
    return next(part for part in function if part.tag != "description")


def _node(tag: str, *children: Element, text: str = "") -> Element:
    made = ElementTree.Element(tag)
    made.text = text or None
    made.extend(children)
    return made


def _value(number: float) -> Element:
    return _node("value", text=repr(float(number)))


def _replace(function: Element, new: Element) -> None:
    old = _operation(function)
    place = list(function).index(old)
    function.remove(old)
    function.insert(place, new)


def _times(function: Element, *factors: Element) -> None:
    _replace(function, _node("product", *factors, _operation(function)))


def scaled(
    axis: str, having: tuple[str, ...], factor: float, without: tuple[str, ...] = ()
) -> Change:
    """Multiplies functions."""

    def change(root: Element, craft: Airframe) -> None:
        for function in _functions(root, axis, having, without):
            _times(function, _value(factor))

    return change


def removed(axis: str, having: tuple[str, ...]) -> Change:
    """Takes functions away, those of the angle of attack excepted."""

    def change(root: Element, craft: Airframe) -> None:
        for function in _functions(root, axis, having, ALPHA):
            _acting(root, axis).remove(function)

    return change


def _of_alpha(root: Element, axis: str, craft: Airframe) -> list[Element]:
    """Functions of alpha; those with a control surface too only where there are no others, and none
    of a surface that stands still."""
    still = tuple(name for name, text in craft.bindings.items() if text == "0.0")
    others = ("gear/", "speedbrake", "spoiler", "beta", *_RATES, *still)
    try:
        return _functions(root, axis, ALPHA, ("elevator", "aileron", "rudder", *others))
    except NotThere:
        return _functions(root, axis, ALPHA, others)


def alpha_slope(axis: str, factor: float) -> Change:
    """Scales how far functions of the angle of attack differ from themselves at none."""

    def change(root: Element, craft: Airframe) -> None:
        aerodynamics = root.find("aerodynamics")
        assert aerodynamics is not None
        for function in _of_alpha(root, axis, craft):
            operation = _operation(function)
            fixed = copy.deepcopy(operation)
            for part in fixed.iter():
                if (part.text or "").strip() in ALPHA:
                    part.text = "planted/no-alpha"
            parts = [
                _node("product", _value(factor), operation),
                _node("product", _value(1.0 - factor), fixed),
            ]
            _replace(function, _node("sum", *parts))
        none = ElementTree.Element("property", value="0.0")
        none.text = "planted/no-alpha"
        aerodynamics.insert(0, none)

    return change


def lift_scale(factor: float) -> Change:
    """Multiplies functions of the angle of attack in the lift, with what they are at none."""

    def change(root: Element, craft: Airframe) -> None:
        for function in _of_alpha(root, "LIFT", craft):
            _times(function, _value(factor))

    return change


def by_mach(root: Element, craft: Airframe) -> None:
    """The lift's functions of alpha times (1 - M^2)/(1 - M0^2): they lack most of what
    compressibility adds."""
    mach = trimmed(craft.name, craft.altitude, craft.knots, 0.01)[_MACH]
    for function in _of_alpha(root, "LIFT", craft):
        square = _node("product", *(_node("property", text=_MACH) for _ in range(2)))
        _times(function, _value(1.0 / (1.0 - mach**2)), _node("difference", _value(1.0), square))


def by_pressure(root: Element, craft: Airframe) -> None:
    """The lift's functions of alpha grow by .3 where dynamic pressure doubles: they lack that the
    wing bends."""
    pressure = trimmed(craft.name, craft.altitude, craft.knots, 0.01)["aero/qbar-psf"]
    for function in _of_alpha(root, "LIFT", craft):
        share = _node("product", _value(0.3 / pressure), _node("property", text="aero/qbar-psf"))
        _times(function, _node("sum", _value(0.7), share))


def added(axis: str, size: float, *properties: str) -> Change:
    """Adds a function that multiplies `size` with properties."""

    def change(root: Element, craft: Airframe) -> None:
        function = ElementTree.SubElement(_acting(root, axis), "function", name="planted/more")
        names = [_node("property", text=name) for name in properties]
        function.append(_node("product", _value(size), *names))

    return change


_FORCE = ("aero/qbar-psf", "metrics/Sw-sqft")
_MOMENT = (*_FORCE, "metrics/cbarw-ft")

PLANTED: Mapping[str, Planted] = {
    "lift slope 15 %": Planted(
        alpha_slope("LIFT", 1.0 / 1.15), ("alpha_slope@C_lift", "lift_scale@C_lift"), "CZ",
        ("alpha_slope@C_drag",),  # right too, where drag is imported as a function of lift
    ),
    "lift 15 %": Planted(
        lift_scale(1.0 / 1.15), ("alpha_slope@C_lift", "lift_scale@C_lift"), "CZ",
        ("alpha_slope@C_drag",),
    ),
    "Cm_alpha 20 %": Planted(
        alpha_slope("PITCH", 0.8), ("alpha_slope@Cm",), "Cm", ("cg_offset@all:x",)
    ),
    "Cn_dr 25 %": Planted(
        scaled("YAW", ("rudder",), 0.75), ("control_effectiveness@Cn:rudder",), "Cn"
    ),
    "Cm_de 25 %": Planted(
        scaled("PITCH", ("elevator",), 0.75), ("control_effectiveness@Cm:elevator",), "Cm"
    ),
    "Cl_da 25 %": Planted(
        scaled("ROLL", ("aileron",), 0.75), ("control_effectiveness@Cl:aileron",), "Cl"
    ),
    "pitch damping 40 %": Planted(
        scaled("PITCH", ("q-aero",), 0.6), ("pitch_damping@Cm",), "Cm", ("alpha_dot@Cm",)
    ),
    "gear drag": Planted(removed("DRAG", ("gear/gear-pos",)), ("landing_gear@C_drag",), "CX"),
    "brake drag": Planted(removed("DRAG", ("speedbrake",)), ("speed_brake@C_drag",), "CX"),
    "flap lift": Planted(removed("LIFT", ("flap-pos",)), ("flap@C_lift",), "CZ"),
    "thrust moment": Planted(
        added("PITCH", 0.15, _THRUST, "metrics/cbarw-ft"), ("thrust_effect@Cm",), "Cm",
        bindings={_THRUST: f"thrust/{POUND!r}"},
    ),
    "sign of Cl_beta": Planted(
        scaled("ROLL", ("aero/beta",), -1.0, ("fcs/", *_RATES)),
        ("table_sign@Cl:", "beta_slope@Cl"), "Cl", ("sideslip_coupling@Cl",),
    ),
    "sign of CD_beta": Planted(
        scaled("DRAG", ("beta",), -1.0, ("fcs/", *_RATES)),
        # in the range flown the tables are linear in |beta|: both names are the same function
        ("table_sign@C_drag:", "sideslip_coupling@C_drag"), "CX",
    ),
    "Mach": Planted(
        by_mach, ("mach_effect@C_lift",), "CZ", ("dynamic_pressure_effect@C_lift",),
        differs=("alpha_slope@C_lift",),
    ),
    "dynamic pressure": Planted(
        by_pressure, ("dynamic_pressure_effect@C_lift",), "CZ", ("mach_effect@C_lift",),
        differs=("alpha_slope@C_lift",),
    ),
    "offset of lift": Planted(added("LIFT", 0.05, *_FORCE), ("zero_offset@CZ",), "CZ"),
    "offset of Cm": Planted(added("PITCH", 0.02, *_MOMENT), ("zero_offset@Cm",), "Cm"),
}  # fmt: skip


def stated(craft: Airframe) -> dict[str, float]:
    """Channel -> one sigma of what the vehicle file says was measured outside flight: mass
    properties, thrust and deflections to 1 %, the CG and the thrust line to 1 % of the chord."""
    reference = craft.database().reference
    share = dict.fromkeys(("mass", "Ixx", "Iyy", "Izz", "thrust", *craft.channels), 0.01)
    positions = ("cg_x", "cg_z", "thrust_line_y", "thrust_line_z")
    return share | dict.fromkeys(positions, 0.01 * reference.chord)


def measured_text(craft: Airframe) -> str:
    """What a vehicle file says of `stated`, and of the zeros of the surfaces."""
    lines = [
        f'{name} = {{ sigma = {sigma!r}, by = "rig" }}' for name, sigma in stated(craft).items()
    ]
    zeros = "".join(f"[sensors.{name}]\nbias_prior = {ZERO!r}\n" for name in craft.channels)
    return "\n[measured]\n" + "\n".join(lines) + "\n" + zeros


def as_measured(
    craft: Airframe, log: Mapping[str, Array], rng: np.random.Generator
) -> dict[str, Array]:
    """A log whose mass properties, thrust and deflections, channels (n,), are as wrong as stated;
    the same `rng` gives the same errors."""
    found = dict(log)
    for name, sigma in stated(craft).items():
        error, zero = sigma * rng.standard_normal(), ZERO * rng.standard_normal()
        if name not in log:
            continue
        found[name] = log[name] + error if name.startswith("cg_") else log[name] * (1.0 + error)
        if name in craft.channels:
            found[name] = found[name] + zero
    return found


def lacks(
    craft: Airframe, wrong: AeroDatabase, axis: str, flights: Sequence[Mapping[str, Array]]
) -> float:
    """rms of what the database `wrong` lacks on a body axis along flights, channels (n,) each."""
    whole, missing = craft.database(), []
    for channels in flights:
        steady = {"alphadot": 0.0 * channels["V"], "betadot": 0.0 * channels["V"], **channels}
        parts = [database.predict(steady).coefficients[axis] for database in (whole, wrong)]
        missing.append(parts[0] - parts[1])
    return rms(np.concatenate(missing))


def true_value(
    hypothesis: str,
    craft: Airframe,
    wrong: AeroDatabase,
    flights: Mapping[str, Mapping[str, Array]],
    step: float,
) -> float | None:
    """The value with which a hypothesis comes nearest to what the database `wrong` lacks, along
    flights (channels (n,) without noise), each with an intercept per axis; None if the library has
    no such hypothesis or it is less than EXACT of what is lacking."""
    vehicle, whole = parse_vehicle(vehicle_text(craft)), craft.database()
    cross = square = total = 0.0
    for name, channels in flights.items():
        flight = Flight(name, vehicle.name, step * np.arange(len(channels["V"])), dict(channels))
        library = hypotheses_for(wrong, vehicle, set(channels))
        chosen = [entry for entry in library if entry.id == hypothesis]
        if not chosen:
            return None
        coefficients = total_coefficients(flight, vehicle)
        beside = compare(flight, coefficients, wrong, vehicle.reference)
        true = compare(flight, coefficients, whole, vehicle.reference)
        constant = chosen[0].effect == "zero_offset"
        for axis, column in chosen[0].columns(view_of(flight, beside, wrong, vehicle)).items():
            lacking = true.predicted[axis] - beside.predicted[axis]
            x, y = (v if constant else v - v.mean() for v in (column, lacking))
            cross, square = cross + float(x @ y), square + float(x @ x)
            total += float(y @ y)
    exact = square > 0.0 and total > 0.0 and cross**2 / square / total >= EXACT
    return float(cross / square) if exact else None
