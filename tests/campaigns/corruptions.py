"""Corruptions of flights and of vehicle files, each a function of a right pair.

A flight counts for a kind only if the corruption changes its coefficients, or the control
derivative that this flight determines, by more than 2 %: of surfaces, only flights that tell the
effect to a fifth.
"""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.suspicions.equation_error import equation_errors
from aerodb.suspicions.surfaces import by_role
from aerodb.tables.database import AeroDatabase
from aerodb.vehicle import Vehicle, add_combinations


@dataclass(frozen=True)
class Pair:
    """A flight with its vehicle file and the vehicle's database; None: not known."""

    name: str
    flight: Flight
    vehicle: Vehicle
    database: AeroDatabase | None = None


def determined(flight: Flight, vehicle: Vehicle, role: str) -> float:
    """How well a flight tells the effect of a role's surfaces: standard error over the estimate;
    infinite for roll and yaw without sideslip, which a flight then takes for theirs."""
    if role != "pitch" and "beta" not in flight:
        return float("inf")
    controls = by_role(flight, vehicle, ())
    axis = equation_errors(flight, vehicle, controls).get(role)
    fit = None if axis is None else axis.fit()
    best = float("inf")
    for name, control in controls.items():
        if fit is not None and control.role == role and name in fit.names:
            k = fit.names.index(name)
            best = min(best, float(fit.standard_errors[k] / abs(fit.estimates[k])))
    return best


#: Fields of a vehicle file -> what a sentence may call them.
_FIELDS: Mapping[tuple[str, str], str] = {
    ("mass", "mass"): "mass",
    ("mass", "cg"): "CG|cg_[xyz]|centre of gravity",
    ("mass", "Ixx"): "Ixx|moments? of inertia",
    ("mass", "Iyy"): "Iyy|moments? of inertia",
    ("mass", "Izz"): "Izz|moments? of inertia",
    ("mass", "Ixz"): "Ixz",
    ("reference", "area"): r"area|\[reference\]",
    ("reference", "chord"): r"chord|lengths|\[reference\]",
    ("reference", "span"): r"span|lengths|\[reference\]",
}


def is_field_named(right: Pair, wrong: Pair, sentence: str) -> bool:
    """Whether a sentence names a field that differs between two vehicle files, alone or in a
    group."""
    before, after = right.vehicle.model_dump(), wrong.vehicle.model_dump()
    words = [
        word
        for (part, name), word in _FIELDS.items()
        if not np.array_equal(before[part].get(name, 0.0), after[part].get(name, 0.0))
    ]
    return any(re.search(rf"(?<!\w)({word})(?!\w)", sentence, re.IGNORECASE) for word in words)


#: A wrong pair; None where the corruption changes nothing, or the file is refused when it is read.
Corruption = Callable[[Pair], Pair | None]


def _channels(pair: Pair, made: Mapping[str, Any]) -> Pair | None:
    if not made:
        return None
    flight = pair.flight.with_channels({n: np.asarray(v, float) for n, v in made.items()})
    return replace(pair, flight=add_combinations(flight, pair.vehicle))


def _surface(role: str, change: Callable[[np.ndarray, float], np.ndarray]) -> Corruption:
    """All channels of a role changed, if the flight tells the effect of the role to a fifth."""

    def corrupt(pair: Pair) -> Pair | None:
        if determined(pair.flight, pair.vehicle, role) > 0.2:
            return None
        names = of_role(pair, role)
        return _channels(pair, {n: change(pair.flight[n], pair.flight.step) for n in names})

    return corrupt


def of_role(pair: Pair, role: str) -> list[str]:
    """Return the logged channels of a role; none where the surfaces are shared by two roles."""
    word = {"pitch": "elevator", "roll": "aileron", "yaw": "rudder"}[role]
    combined = {f"delta_{name}" for name in pair.vehicle.combinations}
    names = [n for n in pair.flight.channels if word in n and n not in combined]
    if not names and role == "pitch":  # elevons: reversed together, both roles are
        names = [n for n in pair.flight.channels if "elevon" in n and n not in combined]
    return names


def _swapped(pair: Pair) -> Pair | None:
    flight = pair.flight
    told = [determined(flight, pair.vehicle, role) for role in ("roll", "yaw")]
    names = ("delta_aileron", "delta_rudder")
    if max(told) > 0.2 or any(n not in flight for n in names):
        return None
    if "delta_aileron_right" in flight:
        return _channels(
            pair,
            {
                "delta_aileron_right": flight["delta_rudder"],
                "delta_aileron_left": -flight["delta_rudder"],
                "delta_rudder": flight["delta_aileron"],
            },
        )
    return _channels(pair, {names[0]: flight[names[1]], names[1]: flight[names[0]]})


def _exchanged_with_elevator(role: str) -> Corruption:
    """Fields of the elevator and of one other control exchanged, if a flight tells both."""

    def corrupt(pair: Pair) -> Pair | None:
        names = {each: of_role(pair, each) for each in ("pitch", role)}
        told = [determined(pair.flight, pair.vehicle, each) for each in names]
        if max(told) > 0.1 or not all(names.values()):
            return None
        first = {each: pair.flight[listed[0]] for each, listed in names.items()}
        made = {}
        for each, other in (("pitch", role), (role, "pitch")):
            for k, name in enumerate(names[each]):
                sign = -1.0 if k and each == "roll" else 1.0
                made[name] = sign * first[other]
        return _channels(pair, made)

    return corrupt


def _surfaces_of_another_time(pair: Pair) -> Pair | None:
    """All surfaces as they moved a third of the flight earlier; shorter flights than half a minute
    hardly tell them from others by chance."""
    roles = [r for r in ("pitch", "roll", "yaw") if determined(pair.flight, pair.vehicle, r) < 0.1]
    if len(roles) < 2 or np.ptp(pair.flight.time) < 30.0:
        return None
    late = len(pair.flight.time) // 3
    moved = [n for r in ("pitch", "roll", "yaw") for n in of_role(pair, r)]
    return _channels(pair, {name: np.roll(pair.flight[name], late) for name in moved})


def _shifted(seconds: float) -> Callable[[np.ndarray, float], np.ndarray]:
    def shift(values: np.ndarray, step: float) -> np.ndarray:
        index = np.arange(len(values)) - round(seconds / step)
        return values[np.clip(index, 0, len(values) - 1)]

    return shift


def _scaled(factor: float, *names: str) -> Corruption:
    def corrupt(pair: Pair) -> Pair | None:
        return _channels(pair, {n: factor * pair.flight[n] for n in names if n in pair.flight})

    return corrupt


def _replaced(name: str, change: Callable[[np.ndarray], np.ndarray]) -> Corruption:
    def corrupt(pair: Pair) -> Pair | None:
        there = name in pair.flight
        return _channels(pair, {name: change(pair.flight[name])} if there else {})

    return corrupt


def _vehicle(change: Callable[[dict[str, Any]], bool | None]) -> Corruption:
    """A wrong vehicle file; of one whose mass properties are logged, the channels change alike."""

    def corrupt(pair: Pair) -> Pair | None:
        data = pair.vehicle.model_dump()
        logged = data["mass"]["source"] == "channels"
        names = ("mass", "cg_x", "cg_y", "cg_z", "Ixx", "Iyy", "Izz", "Ixz")
        if logged:
            flight = pair.flight
            data["mass"] |= {n: flight[n] for n in names if n in flight}
            data["mass"]["cg"] = [flight[n] for n in names[1:4] if n in flight]
        if change(data) is False:
            return None
        made = replace(pair)
        if logged:
            values = data["mass"]
            channels = {n: values[n] for n in names if n in values and n in pair.flight}
            made = replace(pair, flight=pair.flight.with_channels(channels))
            data["mass"] = pair.vehicle.model_dump()["mass"]
        try:
            return replace(made, vehicle=Vehicle.model_validate(data))
        except (InputError, ValueError):
            return None  # refused when it is read: noticed before

    return corrupt


def _mass(factor: float, *names: str) -> Corruption:
    def change(data: dict[str, Any]) -> None:
        data["mass"] |= {n: factor * data["mass"][n] for n in names}

    return _vehicle(change)


def _size(**factors: float) -> Corruption:
    def change(data: dict[str, Any]) -> None:
        data["reference"] |= {n: f * data["reference"][n] for n, f in factors.items()}

    return _vehicle(change)


def _exchanged_inertia(data: dict[str, Any]) -> None:
    mass = data["mass"]
    mass["Ixx"], mass["Izz"] = mass["Izz"], mass["Ixx"]


def _shifted_cg(change: Callable[[float], float]) -> Corruption:
    """The CG assumed further forward by `change` of the chord [m], where that is a twentieth of
    it."""

    def corrupt(pair: Pair) -> Pair | None:
        chord = pair.vehicle.reference.chord
        shift = change(chord)
        if abs(shift) < 0.05 * chord:
            return None
        if pair.vehicle.mass.source == "channels":
            return _channels(pair, {"cg_x": pair.flight["cg_x"] + shift})
        data = pair.vehicle.model_dump()
        x, y, z = data["mass"]["cg"]
        data["mass"]["cg"] = (x + shift, y, z)
        return replace(pair, vehicle=Vehicle.model_validate(data))

    return corrupt


def _thrust(factor: float) -> Corruption:
    """The thrust that the coefficients are freed of, if it is logged and not idle."""

    def corrupt(pair: Pair) -> Pair | None:
        names = [name for name in pair.vehicle.thrust.lines if name in pair.flight]
        if pair.vehicle.thrust.source != "channel":
            return None
        return _channels(pair, {name: factor * pair.flight[name] for name in names})

    return corrupt


def _fields_exchanged(pair: Pair) -> Pair | None:
    """Fields of aileron and rudder exchanged, also where a flight hardly tells their effect."""
    flight = pair.flight
    if "delta_rudder" not in flight:
        return None
    rudder, sides = flight["delta_rudder"], ("delta_aileron_right", "delta_aileron_left")
    if all(name in flight for name in sides):
        right, left = (flight[name] for name in sides)
        made = {sides[0]: rudder, sides[1]: -rudder, "delta_rudder": 0.5 * (right - left)}
        return _channels(pair, made)
    if "delta_aileron" not in flight:
        return None
    return _channels(pair, {"delta_aileron": rudder, "delta_rudder": flight["delta_aileron"]})


def _cg_sign(data: dict[str, Any]) -> bool:
    if data["points"]["moment_reference"] == "cg" or data["mass"]["source"] == "channels":
        return False
    x, y, z = data["mass"]["cg"]
    data["mass"]["cg"] = (-x, y, z)
    return abs(x) > 0.02 * data["reference"]["chord"]


FOOT, POUND, DEGREE = 0.3048, 0.45359237, np.pi / 180
MOMENTS = ("Ixx", "Iyy", "Izz", "Ixz")

#: Kinds of corruption of a log.
FLIGHTS: dict[str, Corruption] = {
    "elevator reversed": _surface("pitch", lambda d, _: -d),
    "aileron reversed": _surface("roll", lambda d, _: -d),
    "rudder reversed": _surface("yaw", lambda d, _: -d),
    "elevator in percent": _surface("pitch", lambda d, _: d / 0.44 * 100.0),
    "elevator in microseconds": _surface("pitch", lambda d, _: 1500.0 + d / 0.44 * 500.0),
    "elevator in degrees": _surface("pitch", lambda d, _: d / DEGREE),
    "elevator converted twice": _surface("pitch", lambda d, _: d * DEGREE),
    "aileron in degrees": _surface("roll", lambda d, _: d / DEGREE),
    "rudder converted twice": _surface("yaw", lambda d, _: d * DEGREE),
    "aileron and rudder swapped": _swapped,
    "elevator and aileron swapped": _exchanged_with_elevator("roll"),
    "elevator and rudder swapped": _exchanged_with_elevator("yaw"),
    "surfaces of another time": _surfaces_of_another_time,
    "alpha is theta": lambda pair: _channels(
        pair,
        {"alpha": pair.flight["theta"]} if {"alpha", "theta"} <= set(pair.flight.channels) else {},
    ),
    "elevator .3 s late": _surface("pitch", _shifted(0.3)),
    "elevator .3 s early": _surface("pitch", _shifted(-0.3)),
    "aileron .3 s late": _surface("roll", _shifted(0.3)),
    "rudder .3 s late": _surface("yaw", _shifted(0.3)),
    "elevator dead": _surface("pitch", lambda d, _: np.full_like(d, d[0])),
    "aileron dead": _surface("roll", lambda d, _: np.full_like(d, d[0])),
    "rudder dead": _surface("yaw", lambda d, _: np.full_like(d, d[0])),
    "density in slug/ft3": _scaled(1.0 / 515.379, "rho"),
    "density zero": _scaled(0.0, "rho"),
    "density and qbar of slug/ft3": _scaled(1.0 / 515.379, "rho", "qbar"),
    "temperature in degC": _replaced("temperature", lambda t: t - 273.15),
    "static pressure in hPa": _scaled(0.01, "static_pressure"),
    "airspeed in kt": _scaled(1.0 / 0.514444, "V"),
    "airspeed in kt, qbar with it": lambda pair: _channels(
        pair,
        {"V": pair.flight["V"] / 0.514444, "qbar": pair.flight["qbar"] / 0.514444**2},
    ),
    "qbar in psf": _scaled(1.0 / 47.88, "qbar"),
    "az in g": _scaled(1.0 / 9.80665, "az", "az_imu"),
    "az reversed": _scaled(-1.0, "az", "az_imu"),
    "alpha in degrees": _scaled(1.0 / DEGREE, "alpha"),
    "q reversed": _scaled(-1.0, "q"),
}
#: Kinds of wrong vehicle files.
FILES: dict[str, Corruption] = {
    "mass in lb": _mass(1.0 / POUND, "mass"),
    "mass in g": _mass(1000.0, "mass"),
    "mass in slug": _mass(1.0 / 14.5939, "mass"),
    "mass infinite": _mass(np.inf, "mass"),
    "inertia in slug ft2": _mass(1.0 / 1.35582, *MOMENTS),
    "inertia in lb ft2": _mass(1.0 / 0.04214, *MOMENTS),
    "inertia in g cm2": _mass(1e7, *MOMENTS),
    "Ixx ten times": _mass(10.0, "Ixx"),
    "Ixx a tenth": _mass(0.1, "Ixx"),
    "Iyy ten times": _mass(10.0, "Iyy"),
    "Iyy a tenth": _mass(0.1, "Iyy"),
    "Izz ten times": _mass(10.0, "Izz"),
    "Izz a tenth": _mass(0.1, "Izz"),
    "Ixx and Izz exchanged": _vehicle(_exchanged_inertia),
    "CG of the other sign": _vehicle(_cg_sign),
    "area in ft2": _size(area=1.0 / FOOT**2),
    "area ten times": _size(area=10.0),
    "chord in ft": _size(chord=1.0 / FOOT),
    "span in ft": _size(span=1.0 / FOOT),
    "half span": _size(span=0.5),
    "all lengths in ft": _size(area=1.0 / FOOT**2, chord=1.0 / FOOT, span=1.0 / FOOT),
    "all lengths in inch": _size(area=1.0 / 0.0254**2, chord=1.0 / 0.0254, span=1.0 / 0.0254),
}
#: Kinds that leave every value believable: only the vehicle's database may tell.
BELIEVABLE: dict[str, Corruption] = {
    "mass .7 times": _mass(0.7, "mass"),
    "mass .85 times": _mass(0.85, "mass"),
    "mass 1.2 times": _mass(1.2, "mass"),
    "CG .25 m for .25 chords": _shifted_cg(lambda chord: 0.25 * (chord - 1.0)),
    "thrust zero": _thrust(0.0),
    "thrust in lbf": _thrust(1.0 / 4.4482216),
    "thrust reversed": _thrust(-1.0),
    "aileron and rudder exchanged": _fields_exchanged,
    "upwash of 1.1 inverted": _scaled(1.1**2, "alpha"),
    "upwash of 1.3 inverted": _scaled(1.3**2, "alpha"),
}
