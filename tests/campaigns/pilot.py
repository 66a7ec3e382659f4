"""A pilot for any aircraft that trims: sizes and gains follow from what a step of each control does
to that aircraft."""

import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from scipy.signal import decimate

from tests.campaigns.fleet import MOTION, MOVED, Airframe, trimmed
from tests.support.jsbsim_campaign import (
    ADAMS_BASHFORTH,
    INTEGRATION,
    MARGIN,
    SEAT,
    SETTLING,
    Signal,
    doublet,
    ladder,
    nothing,
    pulses,
    together,
)
from tests.support.jsbsim_flights import POUND

SECONDS = 60.0
CONTROLS = ("elevator", "aileron", "rudder")
CONTROL_STEP = 0.04  # s between two decisions of the pilot
#: What the inputs shall reach: angle of attack, roll rate, sideslip [deg, deg/s, deg].
REACHED = {"elevator": 2.2, "aileron": 10.0, "rudder": 3.0}
MOST = {"elevator": 0.4, "aileron": 0.5, "rudder": 1.0}  # of full travel
_STEP, _WATCHED = 0.03, 2.0  # of full travel; s
#: Lags [s] of the pilot's arm, two in a row: an aircraft file without actuators would have forces
#: that jump.
_ARM = 0.08
#: Dryden turbulence: wind at 20 ft [ft/s] and JSBSim's index of its probability.
AIR = {"calm": None, "moderate": (50.0, 4.0), "severe": (75.0, 6.0)}


@dataclass(frozen=True)
class Response:
    """What a step of one control does: per unit of full travel, largest angle [deg] or rate
    [deg/s] of REACHED, and rate [rad/s] after a second."""

    peak: float
    rate: float


@lru_cache(maxsize=32)
def responses(craft: Airframe) -> dict[str, Response]:
    """The response to each control at the condition of the fleet, of the aircraft as JSBSim has it."""
    seen = {"elevator": ("aero/alpha-rad", "velocities/q-rad_sec"),
            "aileron": ("velocities/p-rad_sec", "velocities/p-rad_sec"),
            "rudder": ("aero/beta-rad", "velocities/r-rad_sec")}  # fmt: skip
    found = {}
    for control, places in seen.items():
        runs = []
        for step in (0.0, _STEP):
            executive = trimmed(craft.name, craft.altitude, craft.knots, INTEGRATION)
            place = f"fcs/{control}-cmd-norm"
            executive[place] += step
            rows = []
            for _ in range(round(_WATCHED / INTEGRATION)):
                executive.run()
                rows.append([executive[name] for name in places])
            runs.append(np.array(rows))
        change = (runs[1] - runs[0]) / _STEP
        second = change[: round(1.0 / INTEGRATION)]
        rate = second[np.argmax(np.abs(second[:, 1])), 1]
        found[control] = Response(np.rad2deg(np.abs(change[:, 0]).max()), float(rate))
    return found


@dataclass(frozen=True)
class Script:
    """What the pilot does in one flight: where it begins, inputs of full travel, other commands."""

    altitude: float
    knots: float
    inputs: Mapping[str, Signal]
    bank: Signal = nothing
    throttle: Signal = nothing
    other: Mapping[str, Signal] = field(default_factory=dict)


def script(craft: Airframe, number: int) -> Script:
    """Flight `number` of an aircraft: 3-2-1-1, doublets or multisine in turn, at several speeds and
    heights; no two alike."""
    rng = np.random.default_rng([zlib.crc32(craft.name.encode()), number])
    reached = responses(craft)
    size = {
        control: min(REACHED[control] / reached[control].peak, MOST[control])
        * rng.uniform(0.8, 1.2)
        * rng.choice([-1.0, 1.0])
        for control in CONTROLS
    }
    unit, late = rng.uniform(0.7, 1.2), rng.uniform(0.0, 2.0)
    kind = number % 3
    if kind == 0:
        inputs = {
            "elevator": together(
                ladder(2 + late, unit, size["elevator"]), ladder(33 + late, unit, -size["elevator"])
            ),
            "aileron": _doublets(size["aileron"], unit, 12 + late, 44 + late),
            "rudder": _doublets(size["rudder"], 1.5 * unit, 18 + late, 50 + late),
        }
    elif kind == 1:
        inputs = {
            "elevator": _doublets(
                size["elevator"], 1.5 * unit, 3 + late, 14 + late, 30 + late, 47 + late
            ),
            "aileron": _doublets(size["aileron"], unit, 9 + late, 38 + late),
            "rudder": _doublets(size["rudder"], 1.5 * unit, 21 + late, 53 + late),
        }
    else:
        inputs = {
            control: _multisine(size[control], 2 + late, 50.0, start, rng)
            for start, control in enumerate(CONTROLS)
        }
    moved: dict[str, Signal] = {"gear/gear-cmd-norm": nothing}
    for role, first, lasting in (("gear", 20, 14.0), ("brake", 38, 7.0), ("flap", 6, 16.0)):
        if role in craft.roles:
            start = first + rng.uniform(-4.0, 6.0)
            place, full = MOVED[role]
            moved[place] = pulses((start, full * rng.uniform(0.8, 1.0)), (start + lasting, 0.0))
    thrust = rng.choice([-0.1, 0.1])
    return Script(
        altitude=craft.altitude * (1.0 + 0.12 * (number % 3 - 1)),
        knots=craft.knots * (1.0 + 0.08 * ((2 * number) % 5 - 2) / 2),
        inputs=inputs,
        throttle=doublet(24 + rng.uniform(-3, 3), 4.0, thrust),
        other=moved,
    )


def _doublets(size: float, length: float, *starts: float) -> Signal:
    return together(*(doublet(s, length, size * (-1) ** k) for k, s in enumerate(starts)))


def _multisine(
    size: float, start: float, lasting: float, offset: int, rng: np.random.Generator
) -> Signal:
    """Every third harmonic of `lasting` from .1 to 1.4 Hz, phases drawn; rms half of `size`."""
    harmonics = np.arange(5 + offset, round(1.4 * lasting), 6)
    phases = rng.uniform(0.0, 2.0 * np.pi, len(harmonics))
    scale = 0.5 * size * np.sqrt(2.0 / len(harmonics))

    def signal(time: float) -> float:
        if not start < time < start + lasting:
            return 0.0
        turns = 2.0 * np.pi * harmonics * (time - start) / lasting
        return float(scale * np.sin(turns + phases).sum())

    return signal


def flown(
    craft: Airframe,
    number: int,
    *,
    step: float,
    air: str = "calm",
    sensed: Mapping[str, np.ndarray] | None = None,
) -> dict[str, np.ndarray]:
    """Channels of a flight without noise, each (n,), `step` s apart, from SETTLING s after the
    trim.

    air : of AIR. sensed : what the instruments that feed the pilot show beyond the truth, per
    CONTROL_STEP from the trim on: p, q, phi, theta.

    Raises RuntimeError where the aircraft does not trim, or leaves the air or its envelope.
    """
    plan, reached = script(craft, number), responses(craft)
    executive = trimmed(craft.name, plan.altitude, plan.knots, INTEGRATION, craft.flies)
    executive["simulation/randomseed"] = number + 1
    for motion in ("rate/rotational", "rate/translational", "position/rotational"):
        # the attitude too: by default it lags half a step behind the rates, and the angles with it
        executive[f"simulation/integrator/{motion}"] = ADAMS_BASHFORTH
    gust = AIR[air]
    if gust is not None:
        executive["atmosphere/turbulence/milspec/windspeed_at_20ft_AGL-fps"] = gust[0]
        executive["atmosphere/turbulence/milspec/severity"] = gust[1]
        executive["atmosphere/turb-type"] = 4
    trim = {control: executive[f"fcs/{control}-cmd-norm"] for control in CONTROLS}
    throttle = executive["fcs/throttle-cmd-norm"]
    engines = sum(
        bool(executive.query_property_catalog(f"fcs/throttle-cmd-norm[{k}]")) for k in range(1, 8)
    )
    pilot = _Pilot(plan, reached, trim, executive["attitude/theta-rad"], sensed or {})
    places = {**MOTION, **craft.channels}
    finer, rows = round(CONTROL_STEP / INTEGRATION), []
    nodes = {name: _node(executive, place) for name, (place, _) in {**places, **SEAT}.items()}
    forces = [_node(executive, f"forces/fb{axis}-prop-lbs") for axis in "xyz"]
    for tick in range(round((SETTLING + SECONDS + MARGIN) / INTEGRATION)):
        time = tick * INTEGRATION - SETTLING
        row = [nodes[name].get_double_value() * scale for name, (_, scale) in places.items()]
        row.append(
            sum(
                part * node.get_double_value()
                for part, node in zip(craft.direction, forces, strict=True)
            )
            * POUND
        )
        if tick % finer == 0:
            pilot.steer(executive, time, tick // finer)
            power = throttle + plan.throttle(time)
            executive["fcs/throttle-cmd-norm"] = power
            for engine in range(1, engines + 1):
                executive[f"fcs/throttle-cmd-norm[{engine}]"] = power
        if not executive.run():
            raise RuntimeError(f"{craft.name} stopped at {time:.1f} s")
        rows.append(row + [nodes[n].get_double_value() * scale for n, (_, scale) in SEAT.items()])
    names = [*places, "thrust", *SEAT]
    table = np.array(rows)
    angles = table[:, [names.index("alpha"), names.index("beta"), names.index("phi")]]
    if not np.isfinite(table).all() or (np.abs(angles).max(axis=0) > (0.5, 0.35, 1.2)).any():
        extreme = np.rad2deg(np.abs(angles).max(axis=0)).round(1).tolist()
        raise RuntimeError(f"{craft.name} {number}: alpha, beta, phi reached {extreme} deg")
    table[:, names.index("psi")] = np.unwrap(table[:, names.index("psi")])
    every = round(step / INTEGRATION)
    filtered = decimate(table, every, ftype="fir", axis=0)  # what a logger does, without delay
    first, last = round(SETTLING / step), round((SETTLING + SECONDS) / step)
    return dict(zip(names, filtered[first:last].T, strict=True))


def _node(executive: Any, place: str) -> Any:
    return executive.get_property_manager().get_node(place)


@dataclass
class _Pilot:
    """Holds pitch attitude and bank, and adds the script's inputs."""

    plan: Script
    reached: Mapping[str, Response]
    trim: Mapping[str, float]
    theta: float
    sensed: Mapping[str, np.ndarray]
    arm: dict[str, tuple[float, float]] = field(default_factory=dict)

    def moved(self, control: str, wanted: float) -> float:
        """Where the stick is after CONTROL_STEP towards `wanted`."""
        share = 1.0 - float(np.exp(-CONTROL_STEP / _ARM))
        first, second = self.arm.get(control, (0.0, 0.0))
        first += share * (wanted - first)
        second += share * (first - second)
        self.arm[control] = (first, second)
        return second

    def steer(self, executive: Any, time: float, tick: int) -> None:
        """Sets the commands for the next CONTROL_STEP."""
        places = {"p": "velocities/p-rad_sec", "q": "velocities/q-rad_sec",
                  "phi": "attitude/phi-rad", "theta": "attitude/theta-rad"}  # fmt: skip
        shown = {
            name: executive[place] + (self.sensed[name][tick] if name in self.sensed else 0.0)
            for name, place in places.items()
        }
        pitch = 0.4 * (0.6 * (self.theta - shown["theta"]) - shown["q"])
        roll = 0.5 * (0.5 * (self.plan.bank(time) - shown["phi"]) - shown["p"])
        held = {
            "elevator": np.clip(pitch / self.reached["elevator"].rate, -0.3, 0.3),
            "aileron": np.clip(roll / self.reached["aileron"].rate, -0.3, 0.3),
            "rudder": 0.0,
        }
        for control in CONTROLS:
            wanted = held[control] + self.plan.inputs[control](time)
            command = self.trim[control] + self.moved(control, wanted)
            executive[f"fcs/{control}-cmd-norm"] = float(np.clip(command, -1.0, 1.0))
        for place, signal in self.plan.other.items():
            executive[place] = signal(time)
