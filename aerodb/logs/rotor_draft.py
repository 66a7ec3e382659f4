"""Drafts of a vehicle file and a database for what rotors carry, from its log.

Mass, diameter and speed of rotors are in few logs. What is not known is one with what it cannot be
told from: with a mass of 1 kg all loads are per kg, with a diameter of 1 m and commands in place of
revolutions the coefficients hold diameter and speed. The drafts say so beside each number.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.logs.autopilot import LoggedAircraft
from aerodb.logs.rotors import FoundRotor, FoundRotors
from aerodb.logs.time_grid import SETTLED
from aerodb.logs.vehicle_draft import surface_blocks
from aerodb.recording import Recording, Topic
from aerodb.signals import band_passed, first_order_lag, low_passed, smooth, uniform_grid
from aerodb.support import Array
from aerodb.vehicle import UNKNOWN_INERTIA

_GRAVITY: Final = 9.80665
#: Density [kg/m3] for the first thrust: an update corrects the thrust.
_DENSITY: Final = 1.2
#: Band [Hz] in which turns answer to rotors: below, wind and trim; above, noise of gyros.
_BAND: Final = (0.3, 8.0)
#: Rate [Hz] of the samples that are compared, and fewest seconds of them. A held command comes half
#: a sample late, which must be less than half a step of the lags.
_RATE, _LEAST = 250.0, 10.0
#: Lags [s] of rotors that are tried: none to the slowest of large propellers.
_LAGS: Final = np.round(np.arange(0.0, 0.2001, 0.005), 4)
#: Samples at the start of a log in which speeds are not known: commands before it may still act.
_UNKNOWN: Final = round(SETTLED * float(_LAGS[-1]) * _RATE)
#: Least sum of the rotors' shares of speed that a flow is told by.
_STILL: Final = 1e-3
#: Least correlation of turning with the rotors' moments for an inertia to be told from it.
_FOLLOWS: Final = 0.7
#: Airspeed [m/s] at which a wing carries its aircraft, where no parameter states it: PX4's default
#: of FW_AIRSPD_TRIM.
_TRIM: Final = 15.0
#: Angle of attack [rad] of a wing that carries its aircraft at this airspeed: 5 deg above that of
#: zero lift, a placeholder.
_CARRIES: Final = 0.09
#: Largest value over the first: of a rotor, of a wing that carries its aircraft at 2 deg.
_ROTOR_MOST, _WING_MOST = 5.0, 2.5
#: Moment of a control over the wing's slope and the span of the rotors, per rad: a placeholder.
_CONTROL: Final = 0.1


@dataclass(frozen=True)
class LearntInertia:
    """What turns say: inertia over mass about x and y [m2], `lag` of the rotors [s], and the
    correlation with the rotors' moments; nan where it does not follow."""

    Ixx: float
    Iyy: float
    lag: float
    correlation: tuple[float, float]

    @property
    def known(self) -> bool:
        """Whether both inertias are told."""
        return bool(np.isfinite([self.Ixx, self.Iyy]).all())


def learnt_inertia(recording: Recording, found: FoundRotors) -> LearntInertia:
    """Return inertia over mass (scalars) as angular acceleration and specific force tell it.

    The thrust of all rotors is the specific force along z. So the moments of their shares per kg
    are known by their places. What a steady thrust per square of speed does not explain of that
    force is of the flow through the rotors, and goes with their speed. Least squares of moments,
    the rate, which damps, and the gyroscopic product of the other two on the angular acceleration,
    between .3 and 8 Hz, give the inertia over mass. The lag is that of the best correlation, by a
    parabola through the three best.
    """
    nothing = LearntInertia(np.nan, np.nan, np.nan, (np.nan, np.nan))
    if not (found.logged and found.placed):
        return nothing
    rates = _first(recording, ("vehicle_angular_velocity", "xyz[{}]"), ("IMU", "Gyr{}"))
    force = _first(recording, ("vehicle_acceleration", "xyz[{}]"), ("IMU", "Acc{}"))
    if rates is None or force is None:
        return nothing
    start = max(rates[0].time[0], force[0].time[0])
    end = min(rates[0].time[-1], force[0].time[-1])
    if not end - start > _LEAST + _UNKNOWN / _RATE:
        return nothing
    grid = uniform_grid(float(start), float(end), 1.0 / _RATE)
    lifting = found.lifting
    speeds = np.array([_share(recording.topics[r.topic], r, grid) for r in lifting])
    level = speeds[:, _UNKNOWN:].mean(axis=0)
    flying = level > 0.5 * np.quantile(level, 0.95)
    if flying.sum() < _LEAST * _RATE:
        return nothing
    strength = np.array([rotor.strength for rotor in lifting])
    places = np.array([rotor.position for rotor in lifting])

    def banded(values: Array) -> Array:
        return band_passed(values[_UNKNOWN:], 1.0 / _RATE, *_BAND)[flying]

    raw = [_on(rates[0], rates[1].format(_named(rates[1], axis)), grid) for axis in range(3)]
    p, q, r = (low_passed(rate, 1.0 / _RATE, _BAND[1]) for rate in raw)
    az = _on(force[0], force[1].format(_named(force[1], 2)), grid)
    az = low_passed(az, 1.0 / _RATE, _BAND[1])
    turns = [
        (np.column_stack([banded(rate), banded(across * r)]),
         banded(smooth(each, 1.0 / _RATE, _BAND[1]).rate))
        for rate, across, each in zip((p, q), (q, p), raw, strict=False)
    ]  # fmt: skip
    told = []
    for lag in _LAGS:
        turned = np.array([first_order_lag(each, 1.0 / _RATE, lag) for each in speeds])
        first, second = strength[:, None] * turned, strength[:, None] * turned**2
        steady = second.sum(axis=0)
        lift = -np.median(az[_UNKNOWN:][flying]) / np.median(steady[_UNKNOWN:][flying])
        flow = (-az - lift * steady) / np.maximum(first.sum(axis=0), _STILL)
        thrust = lift * second + flow * first
        moments = (-places[:, 1] @ thrust, places[:, 0] @ thrust)
        told.append([_told(banded(m), *turn) for m, turn in zip(moments, turns, strict=True)])
    (x, along_x), (y, along_y) = np.moveaxis(np.array(told), 0, -1)
    best = int(np.argmax(along_x + along_y))
    if not min(along_x[best], along_y[best]) > _FOLLOWS:
        return nothing
    lag = round(_peak(_LAGS, along_x + along_y, best), 4)
    correlation = (float(along_x[best]), float(along_y[best]))
    return LearntInertia(float(x[best]), float(y[best]), lag, correlation)


def _peak(at: Array, values: Array, best: int) -> float:
    """Where the parabola through the largest value (k,) and its neighbours is largest; at an end,
    there. at : (k,), equally spaced."""
    if not 0 < best < len(at) - 1:
        return float(at[best])
    low, middle, high = values[best - 1 : best + 2]
    bend = low - 2.0 * middle + high
    moved = 0.5 * (low - high) / bend if bend < 0.0 else 0.0
    return float(at[best] + (at[1] - at[0]) * moved)


def _told(moment: Array, motion: Array, turn: Array) -> tuple[float, float]:
    """Inertia over mass, and correlation of what moments per kg (n,) and motion (n, k) make of the
    angular acceleration (n,) with it."""
    columns = np.column_stack([moment, motion])
    share = np.linalg.lstsq(columns, turn, rcond=None)[0]
    made = columns @ share
    size = np.sqrt(float(made @ made) * float(turn @ turn))
    return (1.0 / share[0] if share[0] > 0.0 else np.nan), float(made @ turn) / max(size, 1e-12)


def _first(recording: Recording, *places: tuple[str, str]) -> tuple[Topic, str] | None:
    for topic, fields in places:
        found = recording.topics.get(topic)
        if found is not None and fields.format(_named(fields, 0)) in found.fields:
            return found, fields
    return None


def _named(fields: str, axis: int) -> str:
    return str(axis) if "[" in fields else "XYZ"[axis]


def _on(topic: Topic, name: str, grid: Array) -> Array:
    return np.interp(grid, topic.time, np.asarray(topic.fields[name], dtype=np.float64))


def _share(topic: Topic, rotor: FoundRotor, grid: Array) -> Array:
    """Command (n,) of a rotor, held until the next."""
    values = (np.asarray(topic.fields[rotor.field], dtype=np.float64) - rotor.low) / (
        rotor.high - rotor.low
    )
    good = np.isfinite(values)
    held = np.searchsorted(topic.time[good], grid, side="right") - 1
    return np.clip(values[good][np.maximum(held, 0)], 0.0, 1.0)


def draft_rotorcraft(
    name: str, recording: Recording, autopilot: LoggedAircraft, battery: str = ""
) -> tuple[str, str]:
    """Return the text of a vehicle file and of a database for what the rotors of a log carry.

    Names that start with `rotor_`, `pusher_`, `frame_` and `wing_`, and those of controls, are
    parameters; lengths [m], loads [N, N m] over the mass that the vehicle file states. autopilot :
    with rotors whose commands or speeds are logged. battery : factor of all speeds, a formula of
    `battery_voltage` [V]; empty for none.
    """
    found = autopilot.rotors
    places = np.array([rotor.position for rotor in found.lifting])
    span = 2.0 * float(np.max(np.hypot(places[:, 0], places[:, 1])))
    span = max(round(span, 3), 0.01)
    pressure = float(f"{_GRAVITY / span**2:.3g}")
    learnt = learnt_inertia(recording, found)
    return (
        _vehicle(name, autopilot, span, pressure, learnt),
        _database(name, autopilot, span, pressure, battery),
    )


def _reference(span: float, pressure: float) -> str:
    return (
        f"[reference]\narea = {span**2:.4g}\nchord = {span:g}\nspan = {span:g}\n"
        f'pressure = "{pressure:g} Pa"       # of 1 kg: CZ is -1 in hover\n'
    )


_VEHICLE: Final = """\
name = "{name}"

{reference}
[points]
moment_reference = [0.0, 0.0, 0.0]
imu = "cg"

[mass]
source = "constant"
mass = "1 kg"          # weigh it, and scale the inertia: until then loads are per kg
cg = [0.0, 0.0, 0.0]
Ixx = {Ixx:g}           # kg m2: {why}
Iyy = {Iyy:g}
Izz = {Izz:g}
Ixz = 0.0

# Logged values that are commands of 0 and 1, and the lag from command to speed.
"""


def _vehicle(
    name: str, autopilot: LoggedAircraft, span: float, pressure: float, learnt: LearntInertia
) -> str:
    x, y, z = UNKNOWN_INERTIA
    why = "a placeholder"
    if learnt.known:
        x, y = (float(f"{value:.3g}") for value in (learnt.Ixx, learnt.Iyy))
        z, why = float(f"{x + y:.3g}"), "of 1 kg, x and y by turns in the log, z their sum"
    text = _VEHICLE.format(
        name=name, reference=_reference(span, pressure), Ixx=x, Iyy=y, Izz=z, why=why
    )
    for rotor in autopilot.rotors.rotors:
        text += (
            f'[rotors.{rotor.name}]\nlog = {{ topic = "{rotor.topic}", field = "{rotor.field}" }}\n'
        )
        if (rotor.low, rotor.high) != (0.0, 1.0):
            text += f"range = [{rotor.low:g}, {rotor.high:g}]\n"
        if learnt.known and learnt.lag:
            text += f'lag = "{learnt.lag:g} s"\n'
    return text + ("\n" + surface_blocks(autopilot) if autopilot.surfaces else "")


_DATABASE: Final = """\
# Each parameter holds what flights do not tell apart from it. With a mass of 1 kg all are per kg.
# D is the diameter of a rotor{speed}.
{battery}name = "{name}"
{reference}moment_reference = [0.0, 0.0, 0.0]

[parameters]
"""

#: What the log tells of the battery.
_BATTERY: Final = (
    "# This log tells that speeds go with the voltage of the battery: {factor}.\n"
    "# State a voltage where it flies without a log: --set battery_voltage=VOLTS.\n"
)


def _database(
    name: str, autopilot: LoggedAircraft, span: float, pressure: float, battery: str
) -> str:
    found = autopilot.rotors
    speeds = all(rotor.fastest for rotor in found.rotors)
    once, twice = ("", "") if speeds else (" n_max", " n_max^2")
    usual = float(np.mean([r.usual * (r.fastest or 1.0) for r in found.lifting]))
    thrust = _GRAVITY / (len(found.lifting) * _DENSITY * usual**2)
    drag = thrust * float(np.mean([rotor.moment_ratio for rotor in found.lifting]))
    pushed = len(found.lifting) < len(found.rotors)
    text = _DATABASE.format(
        name=name,
        reference=_reference(span, pressure),
        speed="" if speeds else ", n_max its speed at full command in rev/s",
        battery=_BATTERY.format(factor=battery) if battery else "",
    )
    for key, value, what in (
        *(
            row
            for kind in ("rotor", *(("pusher",) if pushed else ()))
            for row in (
                (f"{kind}_cT0", thrust, f"thrust: c_T0 D^4{twice}"),
                (f"{kind}_cT1", 0.0, f"loss of thrust by the flow along the axis: c_T1 D^3{once}"),
                (f"{kind}_cQ", drag, f"drag moment: c_Q D^5{twice}"),
                (f"{kind}_drag", 0.0, f"drag across the axis: c_D{once}"),
            )
        ),
        ("frame_x", 0.0, "drag area of the frame along x"),
        ("frame_y", 0.0, "drag area of the frame along y"),
        ("frame_z", 0.0, "drag area of the frame along z"),
    ):
        text += _parameter(key, value, what)
    wing, parts = _wing(autopilot, span) if autopilot.has_wing else ("", "")
    text += wing
    for rotor in found.lifting:
        text += (
            f"strength_{rotor.name} = {{ value = {rotor.strength:g}, bounds = [0.0, 2.0],"
            f' description = "thrust of rotor {rotor.name} over that of a sound one" }}\n'
        )
    if not found.placed:
        text += f"\n# Places and turning are those of a {found.frame}: measure them.\n"
    return text + "\n" + "".join(_part(r, found, battery) for r in found.rotors) + _FRAME + parts


def _parameter(name: str, value: float, what: str, most: float = _ROTOR_MOST) -> str:
    """Line of a parameter: one that does not begin with zero keeps its sign, up to `most` times."""
    low, high = sorted((0.0, most * value))
    bounds = f", bounds = [{low:.3g}, {high:.3g}]" if value else ""
    return f'{name} = {{ value = {value:.4g}{bounds}, description = "{what}" }}\n'


def _wing(autopilot: LoggedAircraft, span: float) -> tuple[str, str]:
    """Parameters and parts of a wing and its controls, of which a hover tells nothing: all sizes
    are placeholders."""
    trim = autopilot.airspeeds.get("TRIM", _TRIM)
    slope = _GRAVITY / (0.5 * _DENSITY * trim**2 * _CARRIES)
    logged = {each.name for each in autopilot.surfaces} | {
        name for name, *_ in autopilot.combinations
    }
    moved = [name for name in _CONTROLS if name in logged]
    what = "of the wing: area times lift slope, a placeholder; hover does not tell it"
    text = _parameter("wing_slope", slope, what, _WING_MOST)
    for name in moved:
        what = "moment by it: area, arm and lift slope, a placeholder; hover does not tell it"
        text += _parameter(f"{name}_moment", -_CONTROL * slope * span, what, _WING_MOST)
    loads = "".join(
        f'[[parts.controls.load]]\naxis = "{_CONTROLS[name]}"\n'
        f'expression = "0.5*rho*u*abs(u)*{name}_moment*delta_{name}"\n'
        for name in moved
    )
    parts = '\n[parts.controls]\nkind = "body"\nposition = [0.0, 0.0, 0.0]\n' + loads
    return text, _SECTION + (parts if moved else "")


def _part(rotor: FoundRotor, found: FoundRotors, battery: str) -> str:
    command = f"command_{rotor.name}"
    if found.thrust_factor > 0.0 and rotor.topic == "actuator_motors":
        f = found.thrust_factor
        a = (1.0 - f) / (2.0 * f)
        command = f"sqrt({a * a:g} + {command}/{f:g}) - {a:g}"
    kind, strength = ("rotor", f"strength_{rotor.name}*") if rotor.lifts else ("pusher", "")
    speed = f"{rotor.fastest:g}*{command}" if rotor.fastest else command
    if battery:
        speed = f"({speed})*{battery}"
    x, y, z = rotor.position
    axis = "" if rotor.axis == (0.0, 0.0, -1.0) else f"axis = {list(rotor.axis)}\n"
    return (
        f'[parts.rotor_{rotor.name}]\nkind = "rotor"\nposition = [{x:g}, {y:g}, {z:g}]\n{axis}'
        f'turns = {rotor.turns}\ndiameter = 1.0\nspeed = "{speed}"\n'
        f'thrust = ["{strength}{kind}_cT0", "{kind}_cT1"]\n'
        f'torque = "{kind}_cQ"\ndrag = "{kind}_drag"\n\n'
    )


_FRAME = '[parts.frame]\nkind = "body"\nposition = [0.0, 0.0, 0.0]\n' + "".join(
    f'[[parts.frame.load]]\naxis = "F{axis.upper()}"\n'
    f'expression = "-0.5*rho*frame_{axis}*{own}*abs({own})"\n'
    for axis, own in zip("xyz", "uvw", strict=True)
)

#: Control -> axis of its moment.
_CONTROLS: Final = {"aileron": "MX", "elevator": "MY", "rudder": "MZ"}
#: Of 1 m2, so that its parameters hold its area. What it is beyond its stall is the frame's.
_SECTION = """
[parts.wing]
kind = "section"
position = [0.0, 0.0, 0.0]
area = 1.0
lift = "wing_slope*alpha"
separated = { angle = "15 deg", sharpness = 30.0, lift = 0.0, drag = [0.0, 0.0] }
"""
