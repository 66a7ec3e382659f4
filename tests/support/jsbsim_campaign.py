"""Campaigns of JSBSim flights whose database lacks one term: truth that shares no code with the
product.

JSBSim flies its own aircraft file. The database is imported from the text of that file with one
term taken out or scaled. What is logged is what instruments show: accelerations at the pilot's
seat, rates, air data, deflections, thrust, each with white and a little coloured noise. JSBSim's
aerodynamic forces never enter.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any
from xml.etree import ElementTree

import numpy as np
from scipy.signal import decimate, lfilter

from aerodb.exchange.jsbsim.reader import import_jsbsim
from aerodb.flight import Flight
from aerodb.storage.writers.jsbsim_executive import loaded_in_jsbsim
from aerodb.tables.database import AeroDatabase
from aerodb.tables.reference import ReferenceGeometry
from aerodb.vehicle import Vehicle, parse_vehicle
from tests.support.jsbsim_flights import FOOT, INCH, POUND, aircraft_file, simulator

STEP, INTEGRATION = 0.04, 0.01
FINER = round(STEP / INTEGRATION)
SETTLING, MARGIN = 5.0, 1.0  # s flown before the log begins and after it ends
#: Of second order: with JSBSim's default, rates lag half a step behind the moments, which tracing
#: finds (as damping), and the attitude behind the rates, which it finds as a delay of the vane.
ADAMS_BASHFORTH = 3
SLUG, SLUG_FT2 = POUND / FOOT, POUND * FOOT  # kg, kg m2

#: A known force in place of a propeller, whose torque and gyroscopic moments are in no vehicle
#: file.
PUSHER = "external_reactions/pusher/magnitude"

#: Noise of the instruments, one sigma of the white part; the coloured part has a third of it and
#: remembers for a second.
NOISE: Mapping[str, float] = {
    "V": 0.2, "qbar": 4.0, "alpha": 1.5e-3, "beta": 1.5e-3, "p": 5e-4, "q": 5e-4, "r": 5e-4,
    "ax_imu": 0.02, "ay_imu": 0.02, "az_imu": 0.02, "phi": 1e-3, "theta": 1e-3, "psi": 1e-3, "altitude": 0.3,
    "height_above_ground": 0.05,
}  # fmt: skip
DEFLECTION_NOISE = 3e-4
COLOURED, MEMORY = 1.0 / 3.0, 1.0
GAINS = (1.5, 0.5, 0.8, 0.15)  # of held angle, q, bank and p, in full travel per rad and rad/s

#: Channel -> JSBSim's property and the number that makes it SI. State, controls and thrust belong
#: together after a step.
STATE: Mapping[str, tuple[str, float]] = {
    "V": ("velocities/vt-fps", FOOT), "qbar": ("aero/qbar-psf", POUND / FOOT**2), "mach": ("velocities/mach", 1.0),
    "rho": ("atmosphere/rho-slugs_ft3", POUND / FOOT**4), "alpha": ("aero/alpha-rad", 1.0), "beta": ("aero/beta-rad", 1.0),
    "p": ("velocities/p-rad_sec", 1.0), "q": ("velocities/q-rad_sec", 1.0), "r": ("velocities/r-rad_sec", 1.0),
    "phi": ("attitude/phi-rad", 1.0), "theta": ("attitude/theta-rad", 1.0), "psi": ("attitude/psi-rad", 1.0),
    "altitude": ("position/h-sl-ft", FOOT), "height_above_ground": ("position/h-agl-ft", FOOT),
    "mass": ("inertia/mass-slugs", SLUG), "Ixx": ("inertia/ixx-slugs_ft2", SLUG_FT2), "Iyy": ("inertia/iyy-slugs_ft2", SLUG_FT2),
    "Izz": ("inertia/izz-slugs_ft2", SLUG_FT2), "Ixz": ("inertia/ixz-slugs_ft2", -SLUG_FT2),
    "cg_x": ("inertia/cg-x-in", -INCH), "cg_y": ("inertia/cg-y-in", INCH), "cg_z": ("inertia/cg-z-in", -INCH),
    "delta_elevator": ("fcs/elevator-pos-rad", 1.0), "delta_rudder": ("fcs/rudder-pos-rad", 1.0),
}  # fmt: skip
#: Specific force at the pilot's seat, which JSBSim has one step late.
SEAT = {f"a{axis}_imu": (f"accelerations/a-pilot-{axis}-ft_sec2", FOOT) for axis in "xyz"}

Signal = Callable[[float], float]
Edit = Callable[[ElementTree.Element], None]


def pulses(*edges: tuple[float, float]) -> Signal:
    """A staircase: (from when [s], value)."""
    return lambda time: next((value for start, value in reversed(edges) if time >= start), 0.0)


def doublet(start: float, length: float, size: float) -> Signal:
    """Two opposite pulses of `length` s each."""
    return pulses((start, size), (start + length, -size), (start + 2 * length, 0.0))


def ladder(start: float, unit: float, size: float) -> Signal:
    """A 3-2-1-1 of `unit` s."""
    edges = np.cumsum([0.0, 3.0, 2.0, 1.0, 1.0]) * unit + start
    return pulses(*zip(edges, (size, -size, size, -size, 0.0), strict=True))


def together(*signals: Signal) -> Signal:
    return lambda time: sum(signal(time) for signal in signals)


def nothing(time: float) -> float:
    return 0.0


@dataclass(frozen=True)
class Plan:
    """One flight: where it begins and what the pilot does.

    start : JSBSim's initial conditions. elevator, aileron, rudder : added to what holds attitude,
    of full travel. bank, pitch : attitudes to hold [rad], pitch about the trim. height : feet above
    ground to hold instead of a pitch, or None. other : property -> what it is set to over time.
    hold_alpha : hold the angle of attack, not the pitch. pushed : pounds of PUSHER's thrust in
    level flight, which also holds the speed; then there is no engine and no trim.
    """

    start: Mapping[str, float]
    seconds: float
    elevator: Signal = nothing
    aileron: Signal = nothing
    rudder: Signal = nothing
    bank: Signal = nothing
    pitch: Signal = nothing
    height: Signal | None = None
    hold_alpha: bool = False
    pushed: float | None = None
    other: Mapping[str, Signal] = field(default_factory=dict)


@dataclass(frozen=True)
class Aircraft:
    """How one aircraft is flown and logged: channels beside STATE, what its own properties mean,
    thrust and its line.

    edit : of the file that JSBSim flies and that the database is imported from.
    """

    name: str
    channels: Mapping[str, tuple[str, float]]
    bindings: Mapping[str, str]
    thrust: tuple[str, ...]
    thrust_point: tuple[float, float, float]
    edit: Edit | None = None

    def file(self, edit: Edit | None = None) -> bytes:
        """The aircraft's file, after another edit too."""
        root = ElementTree.fromstring(aircraft_file(self.name))
        for change in (self.edit, edit):
            if change is not None:
                change(root)
        return ElementTree.tostring(root)


def flown(aircraft: Aircraft, plan: Plan) -> dict[str, np.ndarray]:
    """Channels without noise, from SETTLING s after the trim."""
    executive = (
        simulator(aircraft.name) if aircraft.edit is None else loaded_in_jsbsim(aircraft.file())
    )
    executive.set_dt(INTEGRATION)
    for name, value in plan.start.items():
        executive[name] = value
    executive.run_ic()
    for motion in ("rate/rotational", "rate/translational", "position/rotational"):
        executive[f"simulation/integrator/{motion}"] = ADAMS_BASHFORTH
    if plan.pushed is None:
        executive["propulsion/set-running"] = -1
        executive["simulation/do_simple_trim"] = 1
    held = "aero/alpha-rad" if plan.hold_alpha else "attitude/theta-rad"
    trim = {name: executive[f"fcs/{name}-cmd-norm"] for name in ("elevator", "aileron", "rudder")}
    trim["angle"] = executive[held]
    places = {**STATE, **aircraft.channels}
    rows = []
    for number in range(round((SETTLING + plan.seconds + MARGIN) / INTEGRATION)):
        time = number * INTEGRATION - SETTLING
        row = [executive[place] * scale for place, scale in places.values()]
        row.append(sum(executive[place] for place in aircraft.thrust) * POUND)
        if number % FINER == 0:
            _steer(executive, plan, time, trim, held)
        executive.run()
        assert not any(executive[f"gear/unit[{wheel}]/WOW"] for wheel in range(3)), (
            f"on the ground at {time:.1f} s"
        )
        rows.append(row + [executive[place] * scale for place, scale in SEAT.values()])
    table = np.array(rows)
    names = [*places, "thrust", *SEAT]
    table[:, names.index("psi")] = np.unwrap(table[:, names.index("psi")])
    filtered = decimate(table, FINER, ftype="fir", axis=0)  # what a logger does, and without delay
    first, last = round(SETTLING / STEP), round((SETTLING + plan.seconds) / STEP)
    return dict(zip(names, filtered[first:last].T, strict=True))


def _steer(executive: Any, plan: Plan, time: float, trim: dict[str, float], held: str) -> None:
    on_theta, on_q, on_phi, on_p = GAINS
    angle, phi = executive[held], executive["attitude/phi-rad"]
    q, p = executive["velocities/q-rad_sec"], executive["velocities/p-rad_sec"]
    tilt = trim["angle"] + plan.pitch(time)
    if plan.height is not None:
        wanted = float(
            np.clip(0.3 * (plan.height(time) - executive["position/h-agl-ft"]), -8.0, 10.0)
        )
        miss = wanted - executive["velocities/h-dot-fps"]
        trim["angle"] = float(np.clip(trim["angle"] + 0.004 * miss * STEP, -0.05, 0.15))
        tilt += float(np.clip(0.01 * miss, -0.1, 0.1))
    if plan.pushed is not None:  # never trimmed: the pilot finds the elevator
        trim["elevator"] -= 1.0 * (tilt - angle) * STEP
    executive["fcs/elevator-cmd-norm"] = (
        trim["elevator"] - on_theta * (tilt - angle) + on_q * q + plan.elevator(time)
    )
    executive["fcs/aileron-cmd-norm"] = (
        trim["aileron"] + on_phi * (plan.bank(time) - phi) - on_p * p + plan.aileron(time)
    )
    executive["fcs/rudder-cmd-norm"] = trim["rudder"] + plan.rudder(time)
    if plan.pushed is not None:
        executive[PUSHER] = max(
            plan.pushed + 15.0 * (plan.start["ic/vt-fps"] - executive["velocities/vt-fps"]), 0.0
        )
    for name, signal in plan.other.items():
        executive[name] = signal(time)


def as_logged(
    channels: Mapping[str, np.ndarray], name: str, vehicle: str, rng: np.random.Generator
) -> Flight:
    """What instruments show of it."""
    shown = {}
    for channel, values in channels.items():
        sigma = NOISE.get(channel, DEFLECTION_NOISE if channel.startswith("delta_") else 0.0)
        shown[channel] = values + sigma * (
            rng.standard_normal(len(values)) + COLOURED * _coloured(len(values), rng)
        )
    time = STEP * np.arange(len(next(iter(shown.values()))))
    return Flight(name, vehicle, time, shown)


def _coloured(samples: int, rng: np.random.Generator) -> np.ndarray:
    """Noise of unit size with a memory of MEMORY s."""
    keep = np.exp(-STEP / MEMORY)
    first = rng.standard_normal()
    values, _ = lfilter(
        [np.sqrt(1 - keep**2)], [1.0, -keep], rng.standard_normal(samples), zi=[keep * first]
    )
    return np.asarray(values)


def vehicle_of(aircraft: Aircraft, database: AeroDatabase) -> Vehicle:
    """The vehicle file of an aircraft: geometry and points as its own file states them."""
    return parse_vehicle(vehicle_text(aircraft, database), "vehicle.toml")


def vehicle_text(aircraft: Aircraft, database: AeroDatabase) -> str:
    executive = simulator(aircraft.name)
    executive.run_ic()
    thrust = f"point = {list(aircraft.thrust_point)!r}\n"
    return vehicle_file(aircraft.name.lower(), aircraft.name, database.reference, thrust)


def vehicle_file(
    name: str,
    aircraft: str,
    reference: ReferenceGeometry,
    thrust: str,
    noise: Mapping[str, float] = NOISE,
) -> str:
    """The text of a vehicle file: the accelerometers are at the pilot's eyes, as the aircraft's own
    file states them. thrust : lines of its section, and sections after it; noise : of the
    instruments, one sigma."""
    metrics = ElementTree.fromstring(aircraft_file(aircraft)).find("metrics")
    assert metrics is not None
    seat = next(place for place in metrics.findall("location") if place.get("name") == "EYEPOINT")
    unit = {"IN": INCH, "M": 1.0, "FT": FOOT}[seat.get("unit", "IN").upper()]
    x, y, z = (float(seat.findtext(axis, "").strip()) * unit for axis in "xyz")
    noises = "".join(f"[sensors.{which}]\nnoise = {sigma!r}\n" for which, sigma in noise.items())
    return f"""name = "{name}"
[reference]
area = {reference.area!r}
chord = {reference.chord!r}
span = {reference.span!r}
[points]
moment_reference = {list(reference.moment_reference)!r}
imu = {[-x, y, -z]!r}
[mass]
source = "channels"
[thrust]
source = "channel"
{thrust}{noises}"""


def imported(aircraft: Aircraft, edit: Edit | None = None) -> AeroDatabase:
    """The database of the aircraft's own file, after `edit` of its elements."""
    return import_jsbsim(aircraft.file(edit), bindings=aircraft.bindings, name=aircraft.name)


def function_of(
    root: ElementTree.Element, name: str
) -> tuple[ElementTree.Element, ElementTree.Element]:
    """A function of the aerodynamics and the element that it stands in."""
    for parent in root.iter():
        for child in parent.findall("function"):
            if child.get("name") == name:
                return parent, child
    raise AssertionError(name)


def without(*names: str) -> Edit:
    """Takes functions out of their axes."""

    def edit(root: ElementTree.Element) -> None:
        for name in names:
            parent, child = function_of(root, name)
            parent.remove(child)

    return edit


def scaled_slope(name: str, factor: float) -> Edit:
    """Scales how far the table of a function differs from its own row at alpha = 0: an alpha slope
    that is wrong."""

    def edit(root: ElementTree.Element) -> None:
        data = function_of(root, name)[1].find(".//tableData")
        assert data is not None
        header, *lines = [line for line in (data.text or "").splitlines() if line.split()]
        rows = np.array([[float(word) for word in line.split()] for line in lines])
        (zero,) = rows[rows[:, 0] == 0.0]
        rows[:, 1:] = zero[1:] + factor * (rows[:, 1:] - zero[1:])
        data.text = "\n".join([header, *(" ".join(map(repr, row.tolist())) for row in rows)])

    return edit


def set_to_one(*names: str) -> Edit:
    """Makes the tables of functions, which are factors, equal to one everywhere."""

    def edit(root: ElementTree.Element) -> None:
        for name in names:
            data = function_of(root, name)[1].find("table/tableData")
            assert data is not None
            data.text = "\n".join(
                f"{line.split()[0]} 1.0" for line in (data.text or "").splitlines() if line.split()
            )

    return edit


def one_branch(name: str, argument: str) -> Edit:
    """Leaves of a table over two variables its column at the least value of `argument`."""

    def edit(root: ElementTree.Element) -> None:
        table = function_of(root, name)[1].find(".//table")
        assert table is not None
        for variable in table.findall("independentVar"):
            variable.attrib.pop("lookup", None)
            if variable.text == argument:
                table.remove(variable)
        data = table.find("tableData")
        assert data is not None
        _, *lines = [line.split() for line in (data.text or "").splitlines() if line.split()]
        data.text = "\n".join(f"{words[0]} {words[1]}" for words in lines)

    return edit


def ramp(start: float, top: float, end: float, size: float) -> Signal:
    """Straight up from `start` to `size` at `top`, kept until `end`, then nothing."""
    return lambda time: (
        0.0 if not start < time < end else min(1.0, (time - start) / (top - start)) * size
    )


def pushed(root: ElementTree.Element) -> None:
    """Takes engine and slipstream off, and puts PUSHER where the thrust was."""
    propulsion = root.find("propulsion")
    assert propulsion is not None
    engine = propulsion.find("engine")
    assert engine is not None
    propulsion.remove(engine)
    place = engine.find("thruster/location")
    assert place is not None
    force = ElementTree.SubElement(
        ElementTree.SubElement(root, "external_reactions"), "force", name="pusher", frame="BODY"
    )
    force.append(place)
    direction = ElementTree.SubElement(force, "direction")
    for axis, value in zip("xyz", "100", strict=True):
        ElementTree.SubElement(direction, axis).text = value
    for parent in list(root.iter()):
        for child in list(parent):
            if "prop-induced" in (child.text or "") and child.tag == "property":
                parent.remove(child)
