"""Aircraft of JSBSim, each with a condition in which it trims, and what its own properties mean.

What an aircraft's aerodynamics depend on is read from its file. A property without a meaning is
looked at in flight: one that stands still is a number, one that is a surface in other units is an
expression of that surface, and any other is logged as a surface of its own.
"""

import contextlib
import io
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from aerodb.exchange.jsbsim.properties import CHANNEL_PROPERTIES
from aerodb.exchange.jsbsim.reader import import_jsbsim
from aerodb.nomenclature import is_surface
from aerodb.tables.database import AeroDatabase
from tests.support.jsbsim_campaign import NOISE as OF_INSTRUMENTS
from tests.support.jsbsim_campaign import STATE, vehicle_file
from tests.support.jsbsim_flights import FOOT, INCH, POUND, aircraft_file, simulator
from tests.support.paths import ROOT

#: Aircraft -> altitude [ft] and calibrated airspeed [kt] about which it is flown. Others do not trim,
#: have propellers, need properties of another simulator, or hold what their file does not say (f15:
#: 3 % of the pitching moment).
CONDITIONS: Mapping[str, tuple[float, float]] = {
    "737": (9000, 240), "T38": (15000, 320), "A320": (10000, 250), "F4N": (15000, 330),
    "global5000": (15000, 250), "MD11": (12000, 280), "A4": (10000, 300), "Concorde": (20000, 330),
    "f16": (10000, 280), "T37": (8000, 200), "F80C": (10000, 280), "B747": (12000, 280),
    "787-8": (12000, 270),
}  # fmt: skip
#: Those whose own files state an inertia that no body has, which ingest says.
NO_BODIES = frozenset({"Concorde", "787-8"})
#: Velocity over the ground, as satellites show it.
SATELLITES = {
    f"velocity_{to}": (f"velocities/v-{to}-fps", FOOT) for to in ("north", "east", "down")
}
NOISE = {**OF_INSTRUMENTS, **dict.fromkeys(SATELLITES, 0.1)}
#: What is moved besides elevator, aileron and rudder where the aerodynamics depend on it: role,
#: command and how far.
MOVED = {
    "gear": ("gear/gear-cmd-norm", 1.0),
    "brake": ("fcs/speedbrake-cmd-norm", 0.6),
    "flap": ("fcs/flap-cmd-norm", 0.4),
}
_LINEAR = 1e-6  # of the largest value: how well a surface in other units is that surface


@dataclass(frozen=True, eq=False)
class Airframe:
    """An aircraft as it is flown and logged.

    channels : surfaces logged -> JSBSim's property and the number that makes it SI. bindings :
    property -> expression, for the import. thrust : unit vector of the force, and a point [m] on
    its line, body axes from the datum. roles : of MOVED, those on which the aerodynamics depend.
    flies : folder of the aircraft that flies where it is not JSBSim's own, and its shape.
    """

    name: str
    altitude: float
    knots: float
    channels: Mapping[str, tuple[str, float]]
    bindings: Mapping[str, str]
    direction: tuple[float, ...]
    point: tuple[float, ...]
    roles: tuple[str, ...]
    flies: Path | None = None
    shape: str = ""

    @property
    def vehicle(self) -> str:
        """Its name in vehicle files."""
        return self.name.lower()

    def database(
        self, xml: bytes | None = None, bindings: Mapping[str, str] | None = None
    ) -> AeroDatabase:
        """Its database, of the text `xml` of a file and other bindings instead of its own."""
        text = aircraft_file(self.name) if xml is None else xml
        known = self.bindings if bindings is None else bindings
        return import_jsbsim(text, bindings=known, name=self.vehicle)


def trimmed(
    name: str, altitude: float, knots: float, step: float, aircraft: Path | None = None
) -> Any:
    """JSBSim with the aircraft trimmed in level flight at altitude [ft] and airspeed [kt]; from a
    folder of `aircraft` with another file of it: with the state and controls of its own trim.

    Raises RuntimeError where it does not trim.
    """
    with contextlib.redirect_stdout(io.StringIO()):
        executive = simulator(name, aircraft=aircraft)
        executive.set_dt(step)
        executive["ic/h-sl-ft"], executive["ic/vc-kts"] = altitude, knots
        executive["gear/gear-cmd-norm"] = 0.0
        if aircraft is not None:
            own = trimmed(name, altitude, knots, step)
            executive["ic/theta-rad"] = own["attitude/theta-rad"]
            executive["ic/alpha-rad"] = own["aero/alpha-rad"]
            for control in ("elevator", "aileron", "rudder", "throttle"):
                executive[f"fcs/{control}-cmd-norm"] = own[f"fcs/{control}-cmd-norm"]
            for engine in range(1, 8):
                if executive.query_property_catalog(f"fcs/throttle-cmd-norm[{engine}]"):
                    executive[f"fcs/throttle-cmd-norm[{engine}]"] = own["fcs/throttle-cmd-norm"]
        executive.run_ic()
        executive["propulsion/set-running"] = -1
        if aircraft is None:
            executive["simulation/do_simple_trim"] = 1
    return executive


@lru_cache(maxsize=32)
def airframe(name: str) -> Airframe:
    """What one aircraft's file depends on, and the meanings of its properties."""
    altitude, knots = CONDITIONS[name]
    database = import_jsbsim(aircraft_file(name), name=name.lower())
    free = {
        identifier: text.removeprefix("JSBSim property ")
        for identifier, text in database.free_inputs.items()
        if ": relay" not in text
    }
    surfaces = {
        channel: CHANNEL_PROPERTIES[channel]
        for channel in database.inputs
        if is_surface(channel) and channel in CHANNEL_PROPERTIES
    }
    own = {
        text.removeprefix("JSBSim property "): str(variable.expression)
        for variable in database.variables.values()
        if (text := variable.description).startswith("JSBSim property fcs/") and ":" not in text
    }
    places = dict.fromkeys([*free.values(), *own, *(place for place, _ in surfaces.values())])
    seen = _seen(name, altitude, knots, tuple(places))
    still = {channel for channel, (place, _) in surfaces.items() if np.ptp(seen[place]) == 0.0}
    surfaces = {channel: place for channel, place in surfaces.items() if channel not in still}
    bindings: dict[str, str] = {
        place: repr(float(seen[place][0]))
        for place, text in own.items()
        if any(channel in text for channel in still)
    }
    for place in sorted(set(free.values())):
        values = seen[place]
        if np.ptp(values) == 0.0:
            bindings[place] = repr(float(values[0]))
            continue
        known = [
            made
            for channel, (base, scale) in surfaces.items()
            if (made := _in_terms_of(channel, seen[base] * scale, values))
        ]
        if not known:
            channel = _channel_of(place, surfaces)
            sign = -1.0 if "left" in place else 1.0
            surfaces[channel] = (place, sign)
            known = [channel if sign > 0 else f"-{channel}"]
        bindings[place] = known[0]
    direction, point = _thrust_line(name, altitude, knots)
    words = " ".join([*surfaces])
    roles = tuple(
        role
        for role, pattern in {"gear": "gear", "brake": "brake", "flap": r"flap\b"}.items()
        if re.search(pattern, words)
    )
    return Airframe(name, altitude, knots, surfaces, bindings, direction, point, roles)


def _seen(name: str, altitude: float, knots: float, places: tuple[str, ...]) -> dict[str, Any]:
    """What properties do while every control is moved for 12 s."""
    executive = trimmed(name, altitude, knots, 0.01)
    rows = []
    for number in range(1200):
        phase = 2.0 * np.pi * number / 400
        for axis, size in (("elevator", 0.1), ("aileron", 0.2), ("rudder", 0.3)):
            executive[f"fcs/{axis}-cmd-norm"] = size * np.sin(3 * phase + len(axis))
        for start, (place, size) in enumerate(MOVED.values()):
            executive[place] = size * (150 + 200 * start < number < 500 + 210 * start)
        executive.run()
        rows.append([executive[place] for place in places])
    return dict(zip(places, np.array(rows).T, strict=True))


def _in_terms_of(channel: str, surface: np.ndarray, values: np.ndarray) -> str | None:
    """`values` as a multiple of the surface up and another one down; None if they are not that."""
    up, down = np.maximum(surface, 0.0), np.minimum(surface, 0.0)
    columns = np.column_stack([up, down])
    (above, below), *_ = np.linalg.lstsq(columns, values, rcond=None)
    if np.abs(columns @ [above, below] - values).max() > _LINEAR * np.abs(values).max():
        return None
    if np.isclose(above, below, rtol=1e-9) or not down.any() or not up.any():
        return f"{channel}*({float(above if up.any() else below)!r})"
    return f"max({channel}, 0)*({float(above)!r}) + min({channel}, 0)*({float(below)!r})"


def _channel_of(place: str, taken: Mapping[str, Any]) -> str:
    stem = re.sub(r"-(pos|cmd|mix)?-?(norm|rad|deg)$", "", place.rsplit("/", 1)[-1])
    stem = stem.replace("speedbrake", "speed-brake").replace("left-aileron", "aileron")
    name = "delta_" + re.sub(r"\W+", "_", stem).lower()
    return name if name not in taken else f"{name}_norm"


def _thrust_line(
    name: str, altitude: float, knots: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Direction of the thrust, and the point of its line that is nearest to the CG."""
    executive = trimmed(name, altitude, knots, 0.01)
    executive.run()
    force = np.array([executive[f"forces/fb{axis}-prop-lbs"] for axis in "xyz"]) * POUND
    moment = np.array([executive[f"moments/{axis}-prop-lbsft"] for axis in "lmn"]) * POUND * 0.3048
    x, y, z = (executive[f"inertia/cg-{axis}-in"] * INCH for axis in "xyz")
    arm = np.cross(force, moment) / (force @ force)
    direction = force / np.linalg.norm(force)
    return tuple(direction.tolist()), tuple((np.array([-x, y, -z]) + arm).tolist())


def vehicle_text(craft: Airframe) -> str:
    """The vehicle file: geometry and points as the aircraft's own file states them."""
    listed = (ROOT / "storage" / "mappings" / "canonical.toml").read_text(encoding="utf-8")
    surfaces = "".join(
        f"""[surfaces.{channel.removeprefix("delta_")}]
limits = [-2.0, 2.0]
log = {{ topic = "table", field = "{channel}", unit = "rad" }}
"""
        for channel in craft.channels
        if f'name = "{channel}"' not in listed
    )
    thrust = f"direction = {list(craft.direction)!r}\npoint = {list(craft.point)!r}\n"
    return vehicle_file(
        craft.vehicle, craft.name, craft.database().reference, thrust + surfaces, NOISE
    )


#: STATE without surfaces: those that an aircraft has are its own channels.
MOTION = {
    **{name: place for name, place in STATE.items() if not is_surface(name)},
    **SATELLITES,
    "latitude": ("position/lat-geod-rad", 1.0),
}
