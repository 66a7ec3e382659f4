"""Glossary of every stored channel, coefficient and flag: unit, axis and positive direction.

Axes and signs are those of flight mechanics: body x forward, y right, z down; earth north, east,
down. All values are in SI and radians. A name that is not listed here cannot be stored: `channel`
refuses it and names the nearest one.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

from aerodb.errors import UnknownNameError, nearest


@dataclass(frozen=True)
class Channel:
    """One canonical channel: name, SI unit, meaning with positive direction, source."""

    name: str
    unit: str
    description: str
    source: str = ""


_ISO = "ISO 1151"
_TABLE: tuple[tuple[str, str, str, str], ...] = (
    ("time", "s", "time on the log's monotonic clock", ""),
    # Air-relative motion of the centre of gravity
    ("V", "m/s", "true airspeed", _ISO),
    ("alpha", "rad", "angle of attack atan2(w, u) of the air-relative velocity at the CG", _ISO),
    ("beta", "rad", "angle of sideslip asin(v/V) of the air-relative velocity at the CG", _ISO),
    ("alphadot", "rad/s", "time derivative of alpha", _ISO),
    ("betadot", "rad/s", "time derivative of beta", _ISO),
    ("qbar", "Pa", "dynamic pressure rho V^2 / 2", _ISO),
    ("mach", "1", "Mach number", _ISO),
    ("rho", "kg/m^3", "air density", _ISO),
    ("temperature", "K", "static air temperature", _ISO),
    ("static_pressure", "Pa", "static air pressure", _ISO),
    ("calibrated_airspeed", "m/s", "calibrated airspeed", _ISO),
    (
        "probe_dp_alpha",
        "Pa",
        "five-hole probe: pressure of the lower hole less that of the upper",
        "",
    ),
    (
        "probe_dp_beta",
        "Pa",
        "five-hole probe: pressure of the right hole less that of the left",
        "",
    ),
    # Inertial motion
    ("ax", "m/s^2", "specific force at the CG along body x (forward)", _ISO),
    ("ay", "m/s^2", "specific force at the CG along body y (right)", _ISO),
    ("az", "m/s^2", "specific force at the CG along body z (down); -9.81 at rest and level", _ISO),
    ("ax_imu", "m/s^2", "specific force at the accelerometer along body x (forward)", _ISO),
    ("ay_imu", "m/s^2", "specific force at the accelerometer along body y (right)", _ISO),
    ("az_imu", "m/s^2", "specific force at the accelerometer along body z (down)", _ISO),
    ("p", "rad/s", "roll rate about body x, right wing down", _ISO),
    ("q", "rad/s", "pitch rate about body y, nose up", _ISO),
    ("r", "rad/s", "yaw rate about body z, nose right", _ISO),
    ("pdot", "rad/s^2", "roll acceleration", _ISO),
    ("qdot", "rad/s^2", "pitch acceleration", _ISO),
    ("rdot", "rad/s^2", "yaw acceleration", _ISO),
    ("phi", "rad", "bank angle, Euler 3-2-1, right wing down", _ISO),
    ("theta", "rad", "pitch attitude, Euler 3-2-1, nose up", _ISO),
    ("psi", "rad", "heading, Euler 3-2-1, clockwise from north", _ISO),
    ("velocity_north", "m/s", "velocity over the earth, north", _ISO),
    ("velocity_east", "m/s", "velocity over the earth, east", _ISO),
    ("velocity_down", "m/s", "velocity over the earth, down", _ISO),
    (
        "wind_north",
        "m/s",
        "velocity of the air over the earth, north, as the on-board solution has it",
        "",
    ),
    (
        "wind_east",
        "m/s",
        "velocity of the air over the earth, east, as the on-board solution has it",
        "",
    ),
    (
        "wind_down",
        "m/s",
        "velocity of the air over the earth, down, as the on-board solution has it",
        "",
    ),
    ("north", "m", "position north of the local origin", ""),
    ("east", "m", "position east of the local origin", ""),
    ("altitude", "m", "altitude above mean sea level, positive up", ""),
    ("height_above_ground", "m", "height above ground, positive up", ""),
    (
        "pressure_altitude",
        "m",
        "altitude at which the standard atmosphere has the measured static pressure",
        "ICAO 7488",
    ),
    ("slant_range", "m", "distance to the ground along a beam fixed in the body, down", ""),
    ("latitude", "rad", "geodetic latitude, north positive", ""),
    ("longitude", "rad", "longitude, east positive", ""),
    # Mass properties and propulsion at each sample
    ("mass", "kg", "mass", ""),
    ("fuel_mass", "kg", "mass of fuel on board", ""),
    ("cg_x", "m", "CG position along body x from the vehicle's datum", ""),
    ("cg_y", "m", "CG position along body y from the vehicle's datum", ""),
    ("cg_z", "m", "CG position along body z from the vehicle's datum", ""),
    ("Ixx", "kg m^2", "moment of inertia about body x at the CG", ""),
    ("Iyy", "kg m^2", "moment of inertia about body y at the CG", ""),
    ("Izz", "kg m^2", "moment of inertia about body z at the CG", ""),
    ("Ixz", "kg m^2", "product of inertia, integral of x z dm", ""),
    ("thrust", "N", "total thrust along the thrust line, forward", ""),
    ("thrust_left", "N", "thrust of the left engine", ""),
    ("thrust_right", "N", "thrust of the right engine", ""),
    ("throttle", "1", "throttle position, 0 idle to 1 full", ""),
    ("battery_voltage", "V", "voltage of the battery under load", ""),
    ("brake", "1", "command of the wheel brakes, 0 free to 1 full", ""),
    ("brake_left", "1", "command of the brakes of the left wheels, 0 free to 1 full", ""),
    ("brake_right", "1", "command of the brakes of the right wheels, 0 free to 1 full", ""),
    ("steering", "rad", "angle of the steered wheel, nose right positive", ""),
    # Non-dimensional rates: docs/reference/conventions.md, "Axes, signs, units"; Klein & Morelli
    # (2006), eq. 3.2
    ("p_hat", "1", "p b / (2 V)", "Klein & Morelli 2006"),
    ("q_hat", "1", "q c / (2 V)", "Klein & Morelli 2006"),
    ("r_hat", "1", "r b / (2 V)", "Klein & Morelli 2006"),
    ("alphadot_hat", "1", "alphadot c / (2 V)", "Klein & Morelli 2006"),
    # Command of the pilot or test programme, before any controller adds to it: full travel is 1,
    # the sign is that of the log
    ("command_roll", "1", "command in roll", ""),
    ("command_pitch", "1", "command in pitch", ""),
    ("command_yaw", "1", "command in yaw", ""),
    # Flow states, computed along a flight by a state model
    (
        "flow_attachment",
        "1",
        "how far the flow over the wing is attached, 1 attached, 0 separated",
        "Leishman & Beddoes 1989",
    ),
    # Positions that are not surfaces but are used in the same way
    ("captive", "1", "1 while a carrier holds the vehicle, 0 in free flight", ""),
    ("delta_landing_gear", "1", "landing gear position, 0 up to 1 down and locked", ""),
)

#: Velocity over the earth and position, of which a flight may have several solutions.
NAVIGATION: Final[tuple[str, ...]] = (
    "velocity_north",
    "velocity_east",
    "velocity_down",
    "north",
    "east",
    "altitude",
)

#: Commands of wheels, which few logs have.
WHEELS: Final = ("brake", "brake_left", "brake_right", "steering")
#: Channels that no flight needs: none is told missing.
UNNEEDED: Final = ("battery_voltage",)
#: Positions and commands from 0 to 1.
SHARES: Final = ("brake", "brake_left", "brake_right", "delta_landing_gear")
#: Largest value [-] of such a one: full travel is 1, and calibrations are a tenth wrong.
MOST_SHARE: Final = 1.1
#: Pairs of channels that give a position over the ground.
POSITIONS: Final = (("north", "east"), ("latitude", "longitude"))

_SURFACE = re.compile(r"delta_[a-z][a-z0-9_]*")
_FUEL = re.compile(r"fuel_(flow|used)_([a-z][a-z0-9]*)")
_COMMAND = re.compile(r"command_[a-z0-9][a-z0-9_]*")
_HINGE_MOMENT = re.compile(r"hinge_moment_([a-z][a-z0-9_]*)")
_HINGE_AXIS = re.compile(r"Ch_([a-z][a-z0-9_]*)")
_SOLUTION = re.compile(rf"({'|'.join(NAVIGATION)})_([a-z][a-z0-9]*)")

CHANNELS: Final[dict[str, Channel]] = {row[0]: Channel(*row) for row in _TABLE}

#: The six coefficient axes: values in tables and files, never names of columns or files.
AXES: Final[tuple[str, ...]] = ("CX", "CY", "CZ", "Cl", "Cm", "Cn")
FORCE_AXES: Final[tuple[str, ...]] = AXES[:3]
MOMENT_AXES: Final[tuple[str, ...]] = AXES[3:]

#: What a roll on the ground is compared with, in the place of the axes: place along and across the
#: runway, velocities along both, heading and airspeed -> unit.
ROLL_OUTPUTS: Final[dict[str, str]] = {
    "along": "m",
    "across": "m",
    "speed": "m/s",
    "drift": "m/s",
    "psi": "rad",
    "V": "m/s",
}

#: Axis -> the quantity, and its sign.
_AXIS_TEXT: Final[dict[str, tuple[str, str]]] = {
    "CX": ("force along body x over qbar S", "positive forward"),
    "CY": ("force along body y over qbar S", "positive right"),
    "CZ": ("force along body z over qbar S", "positive down"),
    "Cl": ("moment about body x over qbar S b", "positive right wing down"),
    "Cm": ("moment about body y over qbar S c", "positive nose up"),
    "Cn": ("moment about body z over qbar S b", "positive nose right"),
    "C_lift": ("lift over qbar S", "positive up, normal to the air-relative velocity"),
    "C_drag": ("drag over qbar S", "positive aft, along the air-relative velocity"),
    "C_side": ("side force over qbar S", "positive right, normal to lift and drag"),
    "FX": ("force along body x [N]", "positive forward"),
    "FY": ("force along body y [N]", "positive right"),
    "FZ": ("force along body z [N]", "positive down"),
    "MX": ("moment about body x [N m]", "positive right wing down"),
    "MY": ("moment about body y [N m]", "positive nose up"),
    "MZ": ("moment about body z [N m]", "positive nose right"),
}

#: Free inputs of imported databases that a state model computes along a flight; they then stand
#: beside the channels.
STATES: Final[dict[str, Channel]] = {
    c.name: c
    for c in (
        Channel(
            "stall_hyst_norm",
            "1",
            "1 from the stall until the flow attaches again, else 0",
            "JSBSim, aero/stall-hyst-norm",
        ),
    )
}

#: Columns of stored results in long form: one row per time and axis.
RESULT_COLUMNS: Final[dict[str, Channel]] = {
    c.name: c
    for c in (
        Channel(
            "axis", "", "which coefficient the row is about: CX CY CZ Cl Cm Cn, or Ch_<surface>"
        ),
        Channel("measured", "1", "total coefficient reconstructed from flight"),
        Channel("sigma", "1", "one standard deviation of `measured` from sensor noise"),
        Channel(
            "predicted",
            "1",
            "coefficient that a database version gives for the same flight condition",
        ),
        Channel("residual", "1", "measured - predicted"),
        Channel("stretch", "1", "number of a simulated stretch of the flight, from 0"),
        Channel("response", "", "channel whose simulated and flown values follow"),
        Channel("simulated", "", "response of the database, in the unit of its channel"),
        Channel("flown", "", "response of the flight, in the unit of its channel"),
        Channel("method", "", "estimation method whose fit follows"),
        Channel("record", "", "record that was fitted: flight, and number of its stretch"),
        Channel("sample", "1", "number of the sample in its record, from 0"),
        Channel("fitted", "", "response of the fitted model, in the unit of `response`"),
        Channel("usable", "", "true where the sample may identify or validate"),
        Channel("sigma_V", "m/s", "one standard error of the consistent true airspeed"),
        Channel("sigma_alpha", "rad", "one standard error of the consistent angle of attack"),
        Channel("sigma_beta", "rad", "one standard error of the consistent angle of sideslip"),
        Channel("sigma_phi", "rad", "one standard error of the consistent bank angle"),
        Channel("sigma_theta", "rad", "one standard error of the consistent pitch attitude"),
        Channel("sigma_psi", "rad", "one standard error of the consistent heading"),
        Channel("sigma_wind_north", "m/s", "one standard error of the reconstructed wind, north"),
        Channel("sigma_wind_east", "m/s", "one standard error of the reconstructed wind, east"),
        Channel("sigma_wind_down", "m/s", "one standard error of the reconstructed wind, down"),
        Channel(
            "product",
            "1",
            "whitened cross-products of the columns and the residual of tracing, row by row",
        ),
        Channel(
            "product_noisy", "1", "the same with the reconstruction's state noise added once more"
        ),
    )
}

#: Bits of a `flags_<channel>` column: why a sample of that channel must not be used. ``captive``:
#: a carrier holds the vehicle, so that its motion is valid for kinematics but not for aerodynamics.
FLAGS: Final[dict[str, int]] = {
    "gap": 1,
    "wild_point": 2,
    "saturated": 4,
    "on_ground": 8,
    "out_of_table": 16,
    "damaged": 32,
    "implausible": 64,
    "stuck": 128,
    "captive": 256,
    "failed": 512,
    "hover": 1024,
}


def axis_description(axis: str) -> str:
    """Return the meaning of an axis of coefficients or loads.

    Raises UnknownNameError with the nearest name.
    """
    return ", ".join(_axis_text(axis))


def axis_quantity(axis: str) -> str:
    """Return the quantity of such an axis without its sign; raises as `axis_description`."""
    return _axis_text(axis)[0]


def _axis_text(axis: str) -> tuple[str, str]:
    """The quantity of an axis, and its sign."""
    if hinge := _HINGE_AXIS.fullmatch(axis):
        what = hinge[1].replace("_", " ")
        return (
            f"hinge moment of {what} over qbar S c of {what} behind the hinge line",
            "positive where the air turns the trailing edge down (rudder: left)",
        )
    if axis not in _AXIS_TEXT:
        raise UnknownNameError(f"unknown axis '{axis}'", remedy=nearest(axis, _AXIS_TEXT))
    return _AXIS_TEXT[axis]


def is_hinge_axis(axis: str) -> bool:
    """Return whether an axis is the coefficient of a hinge moment, ``Ch_<surface>``."""
    return _HINGE_AXIS.fullmatch(axis) is not None


def hinge_moment_of(surface: str) -> tuple[str, str]:
    """Return the channel of a surface's hinge moment [N m], and the axis of its coefficient.

    >>> hinge_moment_of("elevator")
    ('hinge_moment_elevator', 'Ch_elevator')
    """
    return f"hinge_moment_{surface}", f"Ch_{surface}"


def hinge_surface(name: str) -> str:
    """Return the surface of a hinge moment's channel or axis; empty for any other name.

    >>> hinge_surface("hinge_moment_elevator"), hinge_surface("Ch_rudder"), hinge_surface("alpha")
    ('elevator', 'rudder', '')
    """
    found = _HINGE_MOMENT.fullmatch(name) or _HINGE_AXIS.fullmatch(name)
    return found[1] if found else ""


def in_order(axes: Iterable[str]) -> tuple[str, ...]:
    """Return those of some axes that are coefficients on body axes or of hinge moments: first those
    of `AXES` in their order, then hinge moments by name.

    >>> in_order({"Ch_rudder", "C_lift", "Cm", "CZ", "Ch_elevator"})
    ('CZ', 'Cm', 'Ch_elevator', 'Ch_rudder')
    """
    given = set(axes)
    return (
        *(axis for axis in AXES if axis in given),
        *sorted(axis for axis in given if is_hinge_axis(axis)),
    )


def is_surface(name: str) -> bool:
    """Return whether `name` has the form of a control surface deflection, ``delta_<name>``."""
    return _SURFACE.fullmatch(name) is not None


def is_command(name: str) -> bool:
    """Return whether `name` has the form of the command of a rotor, ``command_<name>``, and is none
    of the pilot's (``command_roll``).

    >>> is_command("command_1"), is_command("command_roll")
    (True, False)
    """
    return _COMMAND.fullmatch(name) is not None and name not in CHANNELS


def channel(name: str) -> Channel:
    """Return the glossary entry of a channel; surfaces are named ``delta_<name>``, in rad, and
    further navigation solutions ``<channel>_<source>``, such as ``velocity_north_dgps``, and an
    engine's ``fuel_flow_<engine>`` and ``fuel_used_<engine>``, a rotor's ``command_<rotor>``, and
    a surface's ``hinge_moment_<surface>``.

    >>> channel("alpha").unit
    'rad'
    >>> channel("delta_elevator").unit
    'rad'

    Raises UnknownNameError, with the nearest name, for a name that is not registered.
    """
    if name in CHANNELS:
        return CHANNELS[name]
    if name in STATES:
        return STATES[name]
    if is_surface(name):
        what = name.removeprefix("delta_").replace("_", " ")
        return Channel(
            name, "rad", f"deflection of {what}, trailing edge down positive (rudder: left)", _ISO
        )
    solution = _SOLUTION.fullmatch(name)
    if solution:
        base = CHANNELS[solution[1]]
        return Channel(name, base.unit, f"{base.description}, as {solution[2]} has it", base.source)
    if burnt := _FUEL.fullmatch(name):
        unit, what = ("kg/s", "flow of fuel to") if burnt[1] == "flow" else ("kg", "fuel used by")
        return Channel(name, unit, f"mass {what} engine {burnt[2]}")
    if hinge := _HINGE_MOMENT.fullmatch(name):
        what = hinge[1].replace("_", " ")
        text = f"hinge moment of the air on {what}, trailing edge down positive (rudder: left)"
        return Channel(name, "N m", text)
    if is_command(name):
        what = name.removeprefix("command_").replace("_", " ")
        return Channel(name, "1", f"command of rotor {what}: 0 to 1, or -1 to 1 if it turns back")
    inner = name.removeprefix("flags_")
    known = inner == "flight" or inner in CHANNELS or is_surface(inner) or is_command(inner)
    families = (_SOLUTION, _FUEL, _HINGE_MOMENT)
    if inner != name and (known or any(each.fullmatch(inner) for each in families)):
        return Channel(name, "", f"why samples of {inner} must not be used; bits as in FLAGS")
    raise UnknownNameError(f"unknown channel '{name}'", remedy=nearest(name, CHANNELS))
