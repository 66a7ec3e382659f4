"""Simulate the mission of Phoenix: drop, dive, steep approach, flare and landing, to standstill.

The mission is that of the Phoenix paper, section II. Each flight superposes its own test inputs on
the autopilot, at its own approach speed, wind and turbulence: elevator 3-2-1-1 inputs and doublets,
speed-brake and body-flap holds that are not perfectly correlated, and doublets of aileron, rudder
and bank. After touchdown on the main wheels the nose is lowered; then the wheels brake, and the
rudder with its nose wheel holds the heading, until the vehicle stands still.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime, timedelta

import numpy as np
from numpy.typing import NDArray

from aerodb.examples.phoenix import read_example
from aerodb.examples.phoenix.instruments import instruments, lags, servo_channels
from aerodb.examples.phoenix.truth import EFFECTS, Effect, truth
from aerodb.exchange import joined, read_native
from aerodb.physics import DENSITY_0, GRAVITY, DrydenGusts, standard_atmosphere
from aerodb.recording import Topic
from aerodb.simulation import (
    Autopilot,
    ControlDerivatives,
    Event,
    FlownVehicle,
    History,
    at_instruments,
    control_derivatives,
    flown_of,
    measure,
    superposed,
)
from aerodb.simulation import fly as fly_closed_loop
from aerodb.support import Array
from aerodb.tables import AeroDatabase
from aerodb.vehicle import Vehicle, parse_vehicle

STEP = 0.01  # s
LONGEST = 140.0  # s
GROUND = 180.0  # m above sea level
DROP_HEIGHT = 2400.0  # m above the runway
DROP_SPEED = 40.0  # m/s equivalent airspeed
GEAR_HEIGHT = 40.0  # m
TOUCHDOWN_HEIGHT = 1.6  # m, CG above ground with the main wheels just touching
FLARE_TIME = 5.0  # s, time constant of the exponential flare
FLARE_SINK = 3.5  # m/s, sink rate at the end of the flare
CAPTURE_SPEED = 62.0  # m/s equivalent airspeed at which the dive ends
ALPHA_RATE = 0.1  # rad/s, rate limit of the commanded angle of attack
DEROTATION = 0.04  # rad/s at which the nose is lowered on the main wheels
LOWERED = -0.03  # rad, angle of attack to which it is lowered
NOSE_DOWN = 0.01  # rad, pitch attitude below which the nose wheel carries
BRAKE_RATE = 0.5  # 1/s at which the brakes come on
HEADING_GAIN = 1.5  # rudder for a heading error, on the ground
APPROACH = {"V": 105.0, "alpha": 0.08, "qbar": 6000.0, "height_above_ground": 1000.0}
ELEVATOR = ("delta_elevator_outboard", "delta_elevator_inboard")
AILERON = ("delta_aileron_outboard", "delta_aileron_inboard")


@dataclass(frozen=True)
class SimulatedLog:
    """Log of one flight: name, PX4 topics, and UTC at the start of the log's clock."""

    name: str
    topics: tuple[Topic, ...]
    start_utc: datetime


#: Ratio of body flap to speed brake where they move together.
_TOGETHER = 0.35
#: Largest opening of the speed brake [rad].
_OPEN = float(np.deg2rad(40.0))


@dataclass(frozen=True)
class MissionPlan:
    """Differences between the flights.

    Parameters
    ----------
    speed : (k,), approach speed [m/s EAS]
    path : (k,), path angle [rad]
    dive : (k,), angle of attack in the dive [rad]
    heading : (k,) [rad]
    coupling : (k,), ratio of body flap to speed brake
    wind : (3, k) [m/s]
    turbulence : (k,), wind 6 m above ground [m/s]
    events : test inputs, one tuple per flight
    together : whether the body flap follows the speed brake itself, not its command
    """

    speed: Array
    path: Array
    dive: Array
    heading: Array
    coupling: Array
    wind: Array
    turbulence: Array
    events: tuple[tuple[Event, ...], ...]
    together: bool = False


def plan(generator: np.random.Generator, flights: int, together: bool = False) -> MissionPlan:
    """Return randomly drawn flights of a campaign.

    together : the body flap follows the speed brake in one ratio and has no inputs of its own, as
    003 flew. Speeds [m/s], angles [rad], (k,) each; wind (3, k) [m/s].
    """
    wind = np.zeros((3, flights))
    wind[:2] = generator.uniform(-4.0, 4.0, (2, flights))
    spread = np.linspace(0.0, 1.0, flights) if flights > 1 else np.array([0.5])
    drawn = MissionPlan(
        speed=92.0 + 14.0 * generator.permutation(spread),
        path=-np.deg2rad(generator.uniform(24.5, 27.5, flights)),
        dive=np.deg2rad(generator.uniform(3.0, 7.0, flights)),
        heading=generator.uniform(-np.pi, np.pi, flights),
        coupling=generator.uniform(0.25, 0.45, flights),
        wind=wind,
        turbulence=generator.uniform(4.0, 9.0, flights),
        events=tuple(_events(generator, n) for n in range(flights)),
    )
    if not together:
        return drawn
    others = [tuple(e for e in own if e.target != "body_flap") for own in drawn.events]
    return replace(drawn, coupling=np.full(flights, _TOGETHER), events=tuple(others), together=True)


def _events(generator: np.random.Generator, number: int) -> tuple[Event, ...]:
    """Test inputs of one flight.

    Quick inputs follow each other on the approach in random order; slow surfaces move at the same
    time.
    """
    degree = np.deg2rad(1.0)
    sign = 1.0 if number % 2 else -1.0
    quick = [
        Event("elevator_outboard", 0.0, 0.35, 4.5 * sign * degree, "3211"),
        Event("elevator_inboard", 0.0, 0.35, -4.0 * sign * degree, "3211"),
        Event("alpha", 0.0, 1.3, 4.5 * degree),
        Event("elevator_outboard", 0.0, 0.5, 5.0 * degree),
        Event("aileron_outboard", 0.0, 0.4, 4.0 * sign * degree),
        Event("aileron_inboard", 0.0, 0.4, -5.0 * sign * degree),
        Event("rudder", 0.0, 0.6, 6.0 * sign * degree, "3211"),
        Event("bank", 0.0, 2.0, 20.0 * sign * degree),
        Event("alpha", 0.0, 1.0, 7.0 * degree, "pulse"),
    ]
    # Right after the dive the flight is slow: a large angle of attack needs little load factor.
    # Each flight opens speed brakes and body flap fully once, because an increment is valid only in
    # the range of the flights.
    placed = [
        Event(
            "alpha",
            generator.uniform(9.5, 10.5),
            generator.uniform(3.0, 4.0),
            generator.uniform(5.0, 8.0) * degree,
            "hold",
        ),
        Event(
            "speed_brake",
            generator.uniform(10.5, 11.5),
            3.5,
            generator.uniform(35.0, 38.0) * degree,
            "hold",
        ),
        Event(
            "body_flap",
            generator.uniform(11.0, 12.5),
            3.5,
            generator.uniform(6.0, 8.0) * degree,
            "hold",
        ),
    ]
    start = 15.0 + generator.uniform(0.0, 1.0)
    for index in generator.permutation(len(quick)):
        event = quick[index]
        size = generator.uniform(0.8, 1.2)
        placed.append(
            Event(
                event.target,
                start,
                event.width * generator.uniform(0.9, 1.1),
                size * event.amplitude,
                event.shape,
            )
        )
        start += generator.uniform(3.2, 4.0)
    for target, low, high in (("speed_brake", -12.0, 14.0), ("body_flap", -7.0, 9.0)):
        start = 16.0 + generator.uniform(0.0, 4.0)
        for amplitude in (low, high, low / 2, high / 2):
            width = generator.uniform(3.5, 6.0)
            placed.append(
                Event(
                    target, start, width, amplitude * generator.uniform(0.7, 1.1) * degree, "hold"
                )
            )
            start += width + generator.uniform(0.5, 3.0)
    return tuple(placed)


@dataclass
class Guidance:
    """Guidance, autopilot and test inputs: a Controller of `aerodb.simulation.closed_loop`."""

    flown: FlownVehicle
    autopilot: Autopilot
    plan: MissionPlan
    capture: NDArray[np.bool_] = field(init=False)
    flare: NDArray[np.bool_] = field(init=False)
    touched: NDArray[np.bool_] = field(init=False)
    rolling: NDArray[np.bool_] = field(init=False)
    brake: Array = field(init=False)
    wheel_brake: Array = field(init=False)
    wanted_alpha: Array = field(init=False)
    inputs: Array = field(init=False)

    def __post_init__(self) -> None:
        clock = STEP * np.arange(round(LONGEST / STEP) + 1, dtype=np.float64)
        own = [superposed(self.plan.events, name, clock) for name in _TARGETS]
        self.inputs = np.stack(own, axis=1)
        k = len(self.plan.speed)
        self.capture, self.flare, self.touched, self.rolling = np.zeros((4, k), dtype=bool)
        self.brake, self.wheel_brake = np.zeros((2, k))
        self.wanted_alpha = self.plan.dive

    def __call__(self, time: float, channels: Mapping[str, Array]) -> Mapping[str, Array]:
        c = channels
        height = c["height_above_ground"]
        equivalent = np.sqrt(2 * c["qbar"] / DENSITY_0)
        self.capture = self.capture | (equivalent > CAPTURE_SPEED)
        self.flare = self.flare | (
            height + FLARE_SINK * FLARE_TIME < FLARE_TIME * c["velocity_down"]
        )
        self.touched = self.touched | (height < TOUCHDOWN_HEIGHT)
        self.rolling = self.rolling | (self.touched & (c["theta"] < NOSE_DOWN))
        self.wheel_brake = np.where(
            self.rolling, np.minimum(self.wheel_brake + STEP * BRAKE_RATE, 1.0), 0.0
        )
        testing = np.where(self.flare, 0.0, 1.0)
        inputs = dict(zip(_TARGETS, testing * self.inputs[round(time / STEP)], strict=True))
        brake = self._speed_brake(equivalent) + inputs["speed_brake"]
        opened = np.clip(brake, 0.0, _OPEN) if self.plan.together else brake
        flap = np.deg2rad(-3.0) + self.plan.coupling * opened + inputs["body_flap"]
        alpha = np.clip(
            self._alpha(c) + inputs["alpha"],
            np.where(self.touched, LOWERED, np.deg2rad(1.0)),
            np.deg2rad(15.0),
        )
        elevator = np.where(
            self.rolling,
            0.0,
            self.autopilot.elevator(c, alpha, {"body_flap": flap, "speed_brake": brake}),
        )
        course = np.arctan2(c["velocity_east"], c["velocity_north"])
        turn = np.angle(np.exp(1j * (self.plan.heading - course)))
        bank = np.where(self.touched, 0.0, np.clip(1.2 * turn, -0.25, 0.25) + inputs["bank"])
        aileron = np.where(self.rolling, 0.0, self.autopilot.aileron(c, bank))
        rudder = np.where(self.touched, c["r"] - HEADING_GAIN * turn, self.autopilot.rudder(c))
        outboard, inboard = (
            elevator + inputs[f"elevator_{where}"] for where in ("outboard", "inboard")
        )
        roll_outboard, roll_inboard = (
            aileron + inputs[f"aileron_{where}"] for where in ("outboard", "inboard")
        )
        return {
            "elevon_outboard_right": outboard + roll_outboard,
            "elevon_outboard_left": outboard - roll_outboard,
            "elevon_inboard_right": inboard + roll_inboard,
            "elevon_inboard_left": inboard - roll_inboard,
            "rudder": rudder + inputs["rudder"],
            "body_flap": flap,
            "speed_brake": brake,
            "landing_gear": np.where(height < GEAR_HEIGHT, 1.0, 0.0),
            "brake": self.wheel_brake,
        }

    def _alpha(self, c: Mapping[str, Array]) -> Array:
        """Commanded angle of attack (k,).

        It is constant in the dive; then it gives the load factor that turns the path onto its
        target.
        """
        ground_speed = np.sqrt(
            c["velocity_north"] ** 2 + c["velocity_east"] ** 2 + c["velocity_down"] ** 2
        )
        path = -np.arcsin(c["velocity_down"] / ground_speed)
        sink = np.maximum(c["height_above_ground"] / FLARE_TIME + FLARE_SINK, 0.0)
        wanted = np.where(
            self.flare, -np.arcsin(np.clip(sink / ground_speed, 0.0, 0.7)), self.plan.path
        )
        gain = np.where(self.flare, 0.9, 0.8)
        bend = np.where(self.flare, c["velocity_down"] / FLARE_TIME / GRAVITY, 0.0)
        load = np.cos(path) + bend + ground_speed * gain * (wanted - path) / GRAVITY
        known = self.autopilot.known
        weight = self.flown.masses["mass"] * GRAVITY
        lift = np.clip(load, 0.2, 1.8) * weight / (c["qbar"] * self.flown.vehicle.reference.area)
        alpha = np.clip(
            known.alpha + (-lift - known.CZ) / known.CZ_alpha, np.deg2rad(1.0), np.deg2rad(14.0)
        )
        wanted = np.where(self.capture, alpha, self.plan.dive)
        rate = STEP * np.where(self.touched, DEROTATION, ALPHA_RATE)
        change = np.where(self.touched, LOWERED, wanted) - self.wanted_alpha
        self.wanted_alpha = self.wanted_alpha + np.clip(change, -rate, rate)
        return self.wanted_alpha

    def _speed_brake(self, equivalent: Array) -> Array:
        """Speed-brake angle (k,) that holds the approach speed.

        It is closed in the dive and nearly closed in the flare.
        """
        error = equivalent - self.plan.speed
        approaching = self.capture & ~self.flare
        self.brake = np.where(
            approaching, np.clip(self.brake + STEP * 0.006 * error, 0.0, 0.5), self.brake
        )
        wanted = np.where(
            self.flare,
            np.where(self.touched, _OPEN, np.deg2rad(4.0)),
            np.where(self.capture, 0.15 + self.brake + 0.035 * error, 0.0),
        )
        return np.clip(wanted, 0.0, _OPEN)


_TARGETS = (
    *(
        "alpha",
        "bank",
        "elevator_outboard",
        "elevator_inboard",
        "aileron_outboard",
        "aileron_inboard",
    ),
    *("rudder", "speed_brake", "body_flap"),
)


def known_derivatives(vehicle: Vehicle, preflight: AeroDatabase) -> ControlDerivatives:
    """Return the derivatives for the design of the autopilot.

    They are those of the preflight database on the approach, never of the true aerodynamics.

    At `APPROACH`: V [m/s], alpha [rad], qbar [Pa], height [m].
    """
    condition = dict.fromkeys(preflight.inputs, 0.0) | APPROACH
    pitch = {
        "elevator": ELEVATOR,
        "body_flap": ("delta_body_flap",),
        "speed_brake": ("delta_speed_brake",),
    }
    return control_derivatives(
        flown_of(vehicle, preflight), condition, pitch, AILERON, "delta_rudder"
    )


def drop_start(planned: MissionPlan) -> dict[str, Array]:
    """Return the start of each flight, as `aerodb.simulation.simulate` takes it.

    The flight is level at DROP_SPEED through the moving air, at the angle of attack of the dive.

    Each is (k,): V [m/s], angles [rad], altitude [m].
    """
    density = float(standard_atmosphere(GROUND + DROP_HEIGHT).density)
    speed = np.full(len(planned.speed), DROP_SPEED * np.sqrt(DENSITY_0 / density))
    return {
        "V": speed,
        "alpha": planned.dive,
        "theta": planned.dive,
        "psi": planned.heading,
        "altitude": np.full_like(speed, GROUND + DROP_HEIGHT),
    }


def simulate(
    vehicle: Vehicle,
    database: AeroDatabase,
    preflight: AeroDatabase,
    seed: int,
    flights: int,
    together: bool = False,
) -> History:
    """Return the flights of a campaign on `database`, with an autopilot designed on `preflight`.

    With legs (`on_legs`) they end as the vehicle stands still, without as it touches the ground.

    All randomness comes from `seed`. together : as for `plan`.

    Channels (n, k) of k flights, SI; the drop is that of `drop_start`, the gusts are `DrydenGusts`.
    """
    generator = np.random.default_rng([seed, 1])
    planned = plan(generator, flights, together)
    flown = flown_of(vehicle, database)
    known = known_derivatives(vehicle, preflight)

    def fly_from(deflections: Mapping[str, Array], duration: float) -> History:
        return fly_closed_loop(
            flown,
            drop_start(planned),
            deflections,
            Guidance(flown, Autopilot(flown, known, STEP), planned),
            step=STEP,
            duration=duration,
            wind=planned.wind,
            gusts=DrydenGusts(planned.turbulence, generator) if duration else None,
            ground_altitude=GROUND,
            touchdown_height=TOUCHDOWN_HEIGHT,
        )

    # The servos follow the autopilot before the drop: they start at its first command.
    free = {"brake": np.zeros(flights)}
    first = fly_from({name: np.zeros(flights) for name in vehicle.surfaces} | free, 0.0).commands
    servos = {
        name: np.clip(first[name][0], *surface.limits) for name, surface in vehicle.surfaces.items()
    }
    return fly_from(servos | free, LONGEST)


def on_legs(database: AeroDatabase) -> AeroDatabase:
    """Return aerodynamics (SI) on the example's landing gear."""
    return joined(database, read_example("legs.toml"), "legs.toml")


def fly(
    seed: int = 0,
    flights: int = 8,
    effects: tuple[Effect, ...] = EFFECTS,
    together: bool = False,
) -> list[SimulatedLog]:
    """Return logs of a campaign with the true aerodynamics, in the order flown, one day apart.

    together : whether the body flap follows the speed brake. Fields are (n,) in the units of PX4.
    """
    vehicle = parse_vehicle(read_example("vehicle.toml"), "vehicle.toml")
    preflight = read_native(read_example("preflight.toml"), "preflight.toml")
    flown = on_legs(truth(preflight, effects)[0])
    history = simulate(vehicle, flown, preflight, seed, flights, together)
    return logs(vehicle, history, seed)


def logs(vehicle: Vehicle, history: History, seed: int) -> list[SimulatedLog]:
    """Return the logs of simulated flights.

    Biases belong to the vehicle: they are the same in all flights of a seed.

    history : channels (n, k) of k flights, SI. Errors of sensors as `instruments` gives them.
    """
    installed = instruments(vehicle, _installation(seed))
    channels = at_instruments({**history.channels, **servo_channels(vehicle, history)}, vehicle)
    simulated = []
    for number in range(len(history.samples)):
        generator = np.random.default_rng([seed, 3, number])
        start = round(float(generator.uniform(20.0, 60.0)), 3)
        topics = measure(history, channels, number, installed, generator, start)
        taken_off = datetime(2004, 5, 8, 9, 0, tzinfo=UTC) + timedelta(days=number)
        simulated.append(SimulatedLog(f"phoenix-{number + 1:02d}", topics, taken_off))
    return simulated


def flown_lags(seed: int) -> dict[str, float]:
    """Return the lags [s], scalars, of the air-data sensors in the logs of a seed, by sensor
    parameter."""
    return lags(parse_vehicle(read_example("vehicle.toml"), "vehicle.toml"), _installation(seed))


def _installation(seed: int) -> np.random.Generator:
    return np.random.default_rng([seed, 2])
