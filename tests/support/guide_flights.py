"""Logs for the guides in docs/guides/: a simulated small glider, logged as PX4 would log it, with or
without a boom.

The vehicle and the handbook are those written in the guide; the simulated aircraft has a steeper
lift curve.
"""

import re
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
from pyulog import ULog

from aerodb.exchange import import_code
from aerodb.exchange.native import read_native
from aerodb.physics.turbulence import DrydenGusts
from aerodb.simulation.autopilot import Autopilot, control_derivatives
from aerodb.simulation.closed_loop import History, fly
from aerodb.simulation.flown_vehicle import flown_of
from aerodb.simulation.inputs import Event, superposed
from aerodb.simulation.sensors import Instrument, SensorSignal, at_instruments, measure
from aerodb.storage.writers.ulog import write_ulog
from aerodb.support.arrays import Array
from aerodb.tables import Number, Term, times
from aerodb.tables.database import AeroDatabase
from aerodb.tasks.steps.importing import known_vehicle
from aerodb.vehicle import Vehicle, parse_vehicle
from tests.support.guide_build_up import write_build_up_flights
from tests.support.multicopter_flight import fly as fly_quadrotor
from tests.support.multicopter_flight import write_px4
from tests.support.paths import ROOT
from tests.support.small_glider import write_csv
from tests.support.three_wheels import MASSES, SPRING, measured, rolled_in_jsbsim

STEP, SECONDS, SPEED, ALPHA, GLIDE, HEIGHT = 0.01, 50.0, 14.0, 0.06, 0.06, 500.0
#: What the handbook has too small by a sixth: the slope of CZ, 1/rad.
HANDBOOK, FLOWN = "alpha = -5.0", "alpha = -6.0"
_SERVOS = ("aileron_right", "aileron_left", "elevator", "rudder")


@dataclass
class Pilot:
    """Turns that show the wind, and test inputs of each flight's own; a Controller of
    `aerodb.simulation.closed_loop`."""

    autopilot: Autopilot
    inputs: Mapping[str, Array]

    def __call__(self, time: float, channels: Mapping[str, Array]) -> Mapping[str, Array]:
        given = {name: values[round(time / STEP)] for name, values in self.inputs.items()}
        climbing = channels["theta"] - channels["alpha"] * np.cos(channels["phi"]) + GLIDE
        wanted = np.clip(
            ALPHA / np.cos(channels["phi"]) - 0.5 * climbing, 0.0, 0.16
        )  # damps the phugoid
        elevator = (
            self.autopilot.elevator(channels, wanted + given["alpha"], {}) + given["elevator"]
        )
        aileron = self.autopilot.aileron(channels, given["bank"]) + given["aileron"]
        rudder = self.autopilot.rudder(channels) + given["rudder"]
        return {
            "elevator": elevator,
            "aileron_right": aileron,
            "aileron_left": -aileron,
            "rudder": rudder,
        }


def manoeuvres(generator: np.random.Generator, flights: int) -> dict[str, Array]:
    """What each flight asks of its pilot over `SECONDS` [rad]: turns and test inputs, name ->
    (n, flights)."""
    degree, events = np.deg2rad(1.0), []
    for number in range(flights):
        sign = 1.0 if number % 2 else -1.0
        own = [
            Event("bank", 1.0, 15.0, sign * 22 * degree),
            Event("bank", 36.0, 11.0, sign * 18 * degree, "pulse"),
        ]
        quick = [
            ("elevator", 0.35, 3.0, "3211"), ("elevator", 0.6, 3.0, "doublet"), ("alpha", 1.0, 4.5, "doublet"),
            ("aileron", 0.4, 3.0, "doublet"), ("rudder", 0.6, 5.0, "3211"),
        ]  # fmt: skip
        start = 3.0
        for index in [*generator.permutation(len(quick)), *generator.permutation(len(quick))]:
            target, width, size, shape = quick[index]
            amplitude = sign * size * generator.uniform(0.8, 1.2) * degree
            own.append(Event(target, start, width * generator.uniform(0.9, 1.1), amplitude, shape))
            start += generator.uniform(4.0, 4.6)
        events.append(tuple(own))
    clock = STEP * np.arange(round(SECONDS / STEP) + 1)
    return {
        name: superposed(tuple(events), name, clock)
        for name in ("alpha", "bank", "elevator", "aileron", "rudder")
    }


@dataclass(frozen=True)
class Flown:
    """Simulated flights: what they did, and what their instruments would show without error."""

    history: History
    channels: Mapping[str, Array]

    def true(self, name: str, number: int) -> tuple[Array, Array]:
        """Time (n,) s from the start and the true channel (n,) of one flight."""
        return self.history.time, self.history.channels[name][:, number]


def fly_glider(
    vehicle: Vehicle,
    handbook: AeroDatabase,
    flown: AeroDatabase,
    flights: int,
    seed: int,
    *,
    cycles: int = 0,
    height: float = HEIGHT,
    wind_at_6m: float = 0.0,
) -> Flown:
    """`flights` of the vehicle with the aerodynamics `flown`, by an autopilot that knows the
    handbook.

    cycles : a flight is so many times `SECONDS` of manoeuvres and `SECONDS` of rest; 0: once the
    manoeuvres alone. height : at the start [m]. wind_at_6m : of Dryden's turbulence [m/s]; 0: none.
    """
    generator = np.random.default_rng(seed)
    frame = flown_of(vehicle, flown)
    condition = dict.fromkeys(handbook.inputs, 0.0) | {
        "V": SPEED,
        "alpha": ALPHA,
        "qbar": 0.6 * SPEED**2,
    }
    known = control_derivatives(
        flown_of(vehicle, handbook),
        condition,
        {"elevator": ("delta_elevator",)},
        ("delta_aileron",),
        "delta_rudder",
    )
    heading = generator.uniform(-np.pi, np.pi, flights)
    wind = np.zeros((3, flights))
    wind[:2] = generator.uniform(-3.0, 3.0, (2, flights))
    inputs = manoeuvres(generator, flights)
    if cycles:
        rest = {name: np.zeros_like(values) for name, values in inputs.items()}
        parts = [part for _ in range(cycles) for part in (manoeuvres(generator, flights), rest)]
        inputs = {name: np.concatenate([part[name] for part in parts]) for name in inputs}
    history = fly(
        frame,
        {"V": SPEED, "alpha": ALPHA, "theta": ALPHA - GLIDE, "psi": heading, "altitude": height},
        {name: np.zeros(flights) for name in vehicle.surfaces},
        Pilot(Autopilot(frame, known, STEP), inputs),
        step=STEP,
        duration=SECONDS * max(2 * cycles, 1),
        wind=wind,
        gusts=DrydenGusts(np.full(flights, wind_at_6m), generator) if wind_at_6m else None,
    )
    commands = {
        f"servo_{k}": history.commands[name] / vehicle.surfaces[name].scale
        for k, name in enumerate(_SERVOS)
    }
    attitude = {f"q{n}": history.quaternion[:, n] for n in range(4)}
    return Flown(history, at_instruments({**history.channels, **commands, **attitude}, vehicle))


def write_logs(
    folder: Path, flown: Flown, instruments: tuple[Instrument, ...], seed: int
) -> list[Path]:
    """Writes ``flight-1.ulg`` and so on into `folder`, as PX4 would have logged them; returns
    them."""
    paths = []
    for number in range(len(flown.history.samples)):
        topics = measure(
            flown.history,
            flown.channels,
            number,
            instruments,
            np.random.default_rng([seed, number]),
            20.0,
        )
        taken_off = datetime(2026, 5, 8, 9, 0, tzinfo=UTC) + timedelta(hours=number)
        paths.append(folder / f"flight-{number + 1}.ulg")
        write_ulog(
            paths[-1],
            topics,
            metadata={"sys_name": "PX4", "ver_hw": "SIMULATED"},
            start_utc=taken_off,
        )
    return paths


def steeper(database_text: str) -> str:
    """The handbook with the lift curve that flies. Raises ValueError where it is not that of the
    guide."""
    if database_text.count(HANDBOOK) != 1:
        raise ValueError(f"the handbook has no {HANDBOOK}")
    return database_text.replace(HANDBOOK, FLOWN)


def write_flights(
    folder: Path, vehicle_text: str, database_text: str, flights: int, *, boom: bool = False
) -> list[Path]:
    """Flies `flights` of the vehicle and writes ``flight-1.ulg`` and so on into `folder`; returns
    them.

    Raises ValueError where the handbook is not that of the guide.
    """
    vehicle = parse_vehicle(vehicle_text)
    flown = fly_glider(
        vehicle, read_native(database_text), read_native(steeper(database_text)), flights, 7
    )
    return write_logs(folder, flown, instruments(vehicle, boom=boom), 7)


def lattice_of(name: str, text: str, vehicle: Vehicle) -> AeroDatabase:
    """The database of a guide's output of AVL, as the guide imports it."""
    return import_code([(name, text.encode())], name, vehicle=known_vehicle(vehicle))


def beyond_the_lattice(database: AeroDatabase) -> AeroDatabase:
    """What flies instead of a lattice: profile drag, a tenth less lift slope, a fuselage that takes a fifth of the
    stability, and a weaker elevator."""
    changed = {"C_lift_alpha": 0.9, "Cm_alpha": 0.8, "Cm_elevator": 0.85}
    terms = [
        replace(term, expression=times(Number(changed[term.name]), term.expression))
        if term.name in changed
        else term
        for term in database.terms
    ]
    return replace(database, terms=(*terms, Term("profile", "C_drag", Number(0.02))))


def write_database_flights(
    folder: Path, vehicle_text: str, database: AeroDatabase, flights: int
) -> list[Path]:
    """Flies what `beyond_the_lattice` makes of a database, with a boom, and writes ``flight-1.ulg`` and so on."""
    vehicle = parse_vehicle(vehicle_text)
    flown = fly_glider(vehicle, database, beyond_the_lattice(database), flights, 7)
    return write_logs(folder, flown, instruments(vehicle, boom=True), 7)


def instruments(
    vehicle: Vehicle, *, boom: bool = False, heave_bias: float = 0.01
) -> tuple[Instrument, ...]:
    """PX4's topics; with `boom` those of its vanes too, biased and late by what is usual.
    heave_bias : of the accelerometer along z, m/s^2."""
    carried = (
        Instrument(
            "vehicle_angular_velocity",
            50.0,
            tuple(SensorSignal(f"xyz[{n}]", x, 6e-4, 3e-4 * (n - 1)) for n, x in enumerate("pqr")),
        ),
        Instrument(
            "vehicle_acceleration",
            50.0,
            tuple(
                SensorSignal(f"xyz[{n}]", f"a{x}_imu", 0.03, heave_bias if x == "z" else 0.01)
                for n, x in enumerate("xyz")
            ),
        ),
        Instrument(
            "vehicle_attitude",
            50.0,
            tuple(SensorSignal(f"q[{n}]", f"q{n}", 3e-4) for n in range(4)),
            phase=0.003,
        ),
        Instrument(
            "airspeed_validated",
            10.0,
            (
                SensorSignal("true_airspeed_m_s", "V_probe", 0.1, 0.05),
                SensorSignal("calibrated_airspeed_m_s", "calibrated_airspeed", 0.1),
            ),
            phase=0.004,
        ),
        Instrument(
            "vehicle_air_data",
            20.0,
            (
                SensorSignal("rho", "rho", 4e-4),
                SensorSignal("baro_pressure_pa", "static_pressure", 6.0),
                SensorSignal("ambient_temperature", "temperature", 0.05, offset=-273.15),
                SensorSignal("baro_alt_meter", "altitude", 0.3),
            ),
            phase=0.007,
        ),
        Instrument(
            "vehicle_local_position",
            20.0,
            (
                *(
                    SensorSignal(field, channel, 0.2)
                    for field, channel in (("x", "north"), ("y", "east"))
                ),
                *(
                    SensorSignal(f"v{x}", f"velocity_{to}", 0.04)
                    for x, to in zip("xyz", ("north", "east", "down"), strict=True)
                ),
            ),
            delay=0.03,
            phase=0.001,
        ),
        Instrument(
            "actuator_servos",
            50.0,
            tuple(SensorSignal(f"control[{n}]", f"servo_{n}", held=True) for n in range(4)),
        ),
    )
    vanes = (
        Instrument(
            "airflow_aoa",
            50.0,
            (SensorSignal("aoa_rad", "alpha_probe", 1e-3, np.deg2rad(0.8)),),
            0.02,
            0.002,
        ),
        Instrument(
            "airflow_slip",
            50.0,
            (SensorSignal("slip_rad", "beta_probe", 1e-3, np.deg2rad(-0.5)),),
            0.02,
            0.002,
        ),
    )
    return (*carried, *(vanes if boom else ()))


def blocks(guide: str) -> Iterator[tuple[str, str, str]]:
    """Kind, title (empty: none) and text of the fenced blocks of a guide, in order."""
    for found in re.finditer(
        r'^```(\w+)(?: title="([^"]+)")?\n(.*?)^```$', guide, re.DOTALL | re.MULTILINE
    ):
        yield found[1], found[2] or "", found[3]


def prepare(guide: str, folder: Path) -> None:
    """What a reader of a guide has before the first command: the files that it shows, and logs
    where it asks for flights."""
    files = {title: text for _, title, text in blocks(guide) if title}
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    wanted = re.search(r"<!-- flights: (\d+)(, with a boom)? -->", guide)
    if wanted:
        write_flights(
            folder,
            files["my-glider.toml"],
            files["handbook.toml"],
            int(wanted[1]),
            boom=bool(wanted[2]),
        )
    lattice = re.search(r"<!-- flights: (\d+) of (\S+\.st), vehicle of (\S+) -->", guide)
    if lattice:
        other = (ROOT / "docs" / "guides" / f"{lattice[3]}.md").read_text(encoding="utf-8")
        vehicle_text = next(text for _, title, text in blocks(other) if title == "my-glider.toml")
        (folder / "my-glider.toml").write_text(vehicle_text, encoding="utf-8")
        database = lattice_of(lattice[2], files[lattice[2]], parse_vehicle(vehicle_text))
        write_database_flights(folder, vehicle_text, database, int(lattice[1]))
    build_up = re.search(r"<!-- flights of the build-up (\S+), vehicle (\S+) -->", guide)
    if build_up:
        write_build_up_flights(folder, files[build_up[2]], files[build_up[1]])
    if "<!-- flights of JSBSim's c172p -->" in guide:
        from tests.support.guide_light_aircraft import write_light_aircraft_flights

        write_light_aircraft_flights(folder)
    if "<!-- flights of a quadrotor: 4, and one with rotor 3 weak -->" in guide:
        sound, weak = fly_quadrotor(range(61, 65), 30.0, gusts=0.1), (1.0, 1.0, 0.92, 1.0)
        for column in range(4):
            write_px4(folder / f"flight-{column + 1}.ulg", sound, column)
        write_px4(folder / "flight-5.ulg", fly_quadrotor([65], 30.0, strength=weak))
    if (
        "<!-- flights of a helicopter: 4 at 60 kt by cruise.toml, 2 in hover by rotor.toml -->"
        in guide
    ):
        from tests.support.helicopter_derivatives import fly as fly_at_60_kt
        from tests.support.helicopter_flight import fly as fly_hovers

        fly_at_60_kt(folder, range(1, 5), 40.0)
        fly_hovers(folder, range(1, 3), 20.0)
    rolls = " ".join(re.findall(r"<!-- rolls? of JSBSim: (.+?) -->", guide)).split()
    if rolls:
        height = 1.2 - MASSES["mass"] * 9.80665 / (3.0 * SPRING)
        channels = rolled_in_jsbsim(0.1917, (0.0, 5.0), height)
        for seed, name in enumerate(rolls):
            (folder / name).parent.mkdir(exist_ok=True)
            write_csv(folder / name, measured(channels, seed))
    table = re.search(r"<!-- table: (\S+) of (\S+) -->", guide)
    if table:
        write_table(folder / table[2], folder / table[1])


def write_table(log: Path, path: Path) -> None:
    """Write what a simulated log holds as a table of a flight-test data system: at 50 Hz, in its own
    units and with the normal load positive upwards."""
    topics = {each.name: each.data for each in ULog(str(log)).data_list}
    rates, loads = topics["vehicle_angular_velocity"], topics["vehicle_acceleration"]
    air, path_of = topics["airspeed_validated"], topics["vehicle_local_position"]
    attitude, servos = topics["vehicle_attitude"], topics["actuator_servos"]
    begin = max(each["timestamp"][0] for each in (rates, loads, air, path_of, attitude, servos))
    clock = np.arange(begin, rates["timestamp"][-1], 20_000)

    def along(topic: Mapping[str, Array], field: str, scale: float = 1.0) -> Array:
        return np.interp(clock, topic["timestamp"], topic[field]) * scale

    w, x, y, z = (along(attitude, f"q[{k}]") for k in range(4))
    degrees, knots, standard = np.rad2deg(1.0), 3600.0 / 1852.0, 1.0 / 9.80665
    columns = {
        "time_ms": (clock - begin) / 1000.0,
        "TAS_kts": along(air, "true_airspeed_m_s", knots),
        "roll_rate_dps": along(rates, "xyz[0]", degrees),
        "pitch_rate_dps": along(rates, "xyz[1]", degrees),
        "yaw_rate_dps": along(rates, "xyz[2]", degrees),
        "nx_g": along(loads, "xyz[0]", standard),
        "ny_g": along(loads, "xyz[1]", standard),
        "nz_g": along(loads, "xyz[2]", -standard),
        "bank": degrees * np.arctan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
        "pitch": degrees * np.arcsin(np.clip(2 * (w * y - z * x), -1, 1)),
        "heading": degrees * np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)),
        "vn_mps": along(path_of, "vx"),
        "ve_mps": along(path_of, "vy"),
        "vd_mps": along(path_of, "vz"),
        "baro_alt_ft": along(topics["vehicle_air_data"], "baro_alt_meter", 1 / 0.3048),
        "elevator": along(servos, "control[2]", 25.0),
        "rudder": along(servos, "control[3]", 25.0),
        "sideslip_vane": np.zeros(clock.size),
    }
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, "%.7g", ",", header=",".join(columns), comments="")


# To follow a guide by hand:
# python -m tests.support.guide_flights docs/guides/with-a-boom.md FOLDER
if __name__ == "__main__":
    prepare(Path(sys.argv[1]).read_text(encoding="utf-8"), Path(sys.argv[2]))
