"""The built-in example: Phoenix's published figures, hidden truth, usable flights."""

import ast

import numpy as np
import pytest

from aerodb.coefficients.total import total_coefficients
from aerodb.conditioning.segmentation import flag_on_ground
from aerodb.examples.phoenix import mission, read_example
from aerodb.examples.phoenix.preflight import preflight_text
from aerodb.examples.phoenix.truth import EFFECTS, truth
from aerodb.exchange.native import read_native
from aerodb.flight import Flight
from aerodb.increments.model_file import check_channels, parse_model_file
from aerodb.logs.mapping import map_recording
from aerodb.nomenclature import AXES, CHANNELS, is_surface
from aerodb.recording import Recording
from aerodb.simulation import flown_of, simulate
from aerodb.simulation.closed_loop import History
from aerodb.simulation.layout import X
from aerodb.simulation.sensors import at_instruments
from aerodb.storage.mappings import builtin_mappings
from aerodb.support.arrays import Array
from aerodb.tables.database import AeroDatabase
from aerodb.vehicle import Vehicle, parse_vehicle
from aerodb.vehicle.probe import air_data_at_cg
from tests.support.paths import ROOT

FLIGHTS = 3


@pytest.fixture(scope="module")
def vehicle() -> Vehicle:
    return parse_vehicle(read_example("vehicle.toml"))


@pytest.fixture(scope="module")
def preflight() -> AeroDatabase:
    return read_native(read_example("preflight.toml"))


@pytest.fixture(scope="module")
def history(vehicle: Vehicle, preflight: AeroDatabase) -> History:
    database = mission.on_legs(truth(preflight)[0])
    return mission.simulate(vehicle, database, preflight, seed=4, flights=FLIGHTS)


def flown(history: History, number: int) -> dict[str, Array]:
    n = history.samples[number]
    return {name: values[:n, number] for name, values in history.channels.items()}


def landing(history: History, number: int) -> int:
    """The first sample with a wheel on the ground."""
    c = flown(history, number)
    main = np.array([-0.4, 0.85, 1.57])  # of legs.toml, from the centre of gravity
    below = -main[0] * np.sin(c["theta"]) + np.cos(c["theta"]) * (
        main[1] * np.abs(np.sin(c["phi"])) + main[2] * np.cos(c["phi"])
    )
    return int(np.argmax(c["height_above_ground"] < below))


def polar(database: AeroDatabase, alpha: Array) -> dict[str, Array]:
    clean = {name: np.zeros_like(alpha) for name in database.inputs}
    clean |= {
        "alpha": alpha,
        "V": np.full_like(alpha, 90.0),
        "height_above_ground": np.full_like(alpha, 1000.0),
    }
    return database.predict(clean).coefficients


def test_vehicle_has_the_published_figures(vehicle: Vehicle, preflight: AeroDatabase) -> None:
    """Phoenix paper, IV.A: 1198 kg, 10.3 m2, 6 m, 3.48 m.

    Section I: best glide ratio 5.5, unstable with time to double < 0.5 s.
    """
    assert vehicle.mass.mass == 1198.0
    assert (vehicle.reference.area, vehicle.reference.chord, vehicle.reference.span) == (
        10.3,
        6.0,
        3.48,
    )
    database = truth(preflight)[0]
    alpha = np.deg2rad(np.arange(0.0, 18.0, 0.5))
    c = polar(database, alpha)
    lift = c["CX"] * np.sin(alpha) - c["CZ"] * np.cos(alpha)
    drag = -c["CX"] * np.cos(alpha) - c["CZ"] * np.sin(alpha)
    assert np.max(lift / drag) == pytest.approx(5.5, abs=0.4)
    flown = flown_of(vehicle, database)
    start = {"V": 71.0, "alpha": 0.16, "altitude": mission.GROUND + 300.0}
    given = {**flown.masses, "ground_altitude": mission.GROUND}
    given |= dict.fromkeys(flown.model.inputs, 0.0)
    step = 1e-4
    base = simulate(flown.model, np.array([0.0]), start, given).state
    rows = [X.u, X.w, X.q]
    moved = np.repeat(base, 6, axis=1)
    for k, row in enumerate(rows):
        moved[row, 2 * k] += step
        moved[row, 2 * k + 1] -= step
    rates = simulate(flown.model, np.array([0.0]), moved, given).rates[rows]
    longitudinal = (rates[:, ::2] - rates[:, 1::2]) / (2 * step)
    assert np.log(2.0) / np.linalg.eigvals(longitudinal).real.max() < 0.5


def test_preflight_file_is_what_its_formulas_give() -> None:
    assert read_example("preflight.toml") == preflight_text()
    assert "INVENTED" in read_example("preflight.toml").splitlines()[0]


def test_truth_differs_as_the_phoenix_paper_reports(
    preflight: AeroDatabase, vehicle: Vehicle
) -> None:
    """Section IV.D: lift slope 9-10 % low, pitching-moment slope within 3 %, no CX of pitch rate.

    Speed brakes are overestimated.
    """
    database, effects = truth(preflight)
    alpha = np.deg2rad(np.array([2.0, 9.0]))
    before, after = polar(preflight, alpha), polar(database, alpha)
    slope = [np.diff(c["CZ"])[0] for c in (before, after)]
    assert 1.085 < slope[1] / slope[0] < 1.105
    known = [mission.known_derivatives(vehicle, d) for d in (preflight, database)]
    own = next(e.value for e in effects if e.axis == "Cm" and e.parameter == "Cm_alpha")
    assert abs(own) < 0.03 * known[0].Cm_alpha
    assert database.reference.moment_reference[0] > vehicle.mass.cg[0]
    turning = {name: np.zeros(2) for name in preflight.inputs} | {
        "V": np.full(2, 90.0),
        "q": np.array([0.0, 0.3]),
    }
    assert np.ptp(preflight.predict(turning).coefficients["CX"]) == 0.0
    assert np.ptp(database.predict(turning).coefficients["CX"]) > 1e-3
    braking = turning | {"q": np.zeros(2), "delta_speed_brake": np.array([0.0, 0.6])}
    drag = [-np.diff(d.predict(braking).coefficients["CX"])[0] for d in (preflight, database)]
    assert 0.0 < drag[1] < 0.95 * drag[0]


def test_declared_model_spans_the_truth_and_names_channels_that_flights_have(
    history: History,
) -> None:
    model = parse_model_file(read_example("model.toml"))
    check_channels(model, {*flown(history, 0), "q_hat"})
    declared = {(entry.axis, term) for entry in model.increment for term in entry.terms}
    plain = {"min(alpha, 0.175)": "alpha", "max(alpha - 0.175, 0)": "alpha"}
    assert {(e.axis, plain.get(e.regressor, e.regressor)) for e in EFFECTS} == declared


def test_nothing_that_a_flow_imports_reads_the_truth() -> None:
    root = ROOT
    readers = set()
    for path in (
        p for floor in ("flows", "tasks", "aerodb", "storage") for p in (root / floor).rglob("*.py")
    ):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom):
                names = [f"{node.module}.{a.name}" for a in node.names]
            if any(name.startswith("aerodb.examples.phoenix.truth") for name in names):
                readers.add(path.relative_to(root).as_posix())
    assert readers <= {"aerodb/examples/phoenix/mission.py", "flows/demo.py"}


def test_flights_follow_the_published_mission_and_survive(
    history: History, preflight: AeroDatabase
) -> None:
    """Phoenix paper, II: drop at 2400 m at 40 m/s EAS, dive, flare, touchdown near 71 m/s.

    There are about 50 s between drop and 120 m.
    """
    for number in range(FLIGHTS):
        whole, end = flown(history, number), landing(history, number) + 1
        assert all(np.all(np.isfinite(values)) for values in whole.values())
        c = {name: values[:end] for name, values in whole.items()}
        equivalent = np.sqrt(2 * c["qbar"] / 1.225)
        assert c["height_above_ground"][0] == 2400.0
        assert equivalent[0] == pytest.approx(40.0, abs=1.0)
        assert c["height_above_ground"][-1] == pytest.approx(mission.TOUCHDOWN_HEIGHT, abs=0.1)
        assert 0.0 < c["velocity_down"][-1] < 2.0
        assert 62.0 < equivalent[-1] < 90.0
        assert 40.0 < history.time[np.argmax(c["height_above_ground"] < 120.0)] < 75.0
        assert np.abs(c["phi"]).max() < np.deg2rad(40)
        assert c["delta_landing_gear"][-1] > 0.98
        assert not preflight.predict(c).outside.any()
        # What the increments need: both sides of 0.175 rad, pitch rate, slow surfaces that do not
        # move as one.
        assert np.percentile(c["alpha"], 1) < np.deg2rad(2)
        assert np.deg2rad(14) < c["alpha"].max() < np.deg2rad(20)
        assert np.mean(c["alpha"] > 0.175) > 0.04
        assert c["q"].std() > 0.05
        assert 0.3 < np.corrcoef(c["delta_speed_brake"], c["delta_body_flap"])[0, 1] < 0.97


def test_flights_land_lower_their_nose_brake_and_stand_still(
    history: History, vehicle: Vehicle, preflight: AeroDatabase
) -> None:
    """As the Phoenix paper, section II, tells it. The wheels' work is what the speed loses beside the
    air's: the deceleration with both is that of eq. 8 and the true aerodynamics."""
    air, masses = truth(preflight)[0], vehicle.mass
    for number in range(FLIGHTS):
        c, down = flown(history, number), landing(history, number)
        braked = history.commands["brake"][: len(c["V"]), number] > 0.0
        nose = int(np.argmax(braked))
        assert not braked[:nose].any()
        assert braked[nose:].all()
        # On the main wheels the nose is held up, then comes down within a few seconds, for good.
        assert c["theta"][down] > 0.08
        assert 2.0 < history.time[nose] - history.time[down] < 6.0
        assert np.abs(c["theta"][nose:]).max() < mission.NOSE_DOWN + 0.01
        assert c["height_above_ground"][down:].max() < mission.TOUCHDOWN_HEIGHT + 0.05
        assert np.abs(c["phi"][down:]).max() < np.deg2rad(6.0)
        speed = np.hypot(c["velocity_north"], c["velocity_east"])
        assert speed[-1] < 0.06 < 0.1 < speed[-10]
        heading = np.angle(np.exp(1j * (c["psi"][down:] - c["psi"][down])))
        assert np.abs(heading).max() < np.deg2rad(6.0)
        distance = np.hypot(c["north"][-1] - c["north"][down], c["east"][-1] - c["east"][down])
        assert 700.0 < distance < 1300.0
        # Full brakes, all wheels on the ground, the air a small part: below 25 m/s.
        n = np.flatnonzero(
            (history.commands["brake"][: len(speed), number] == 1.0) & (speed < 25.0)
        )
        n = n[speed[n] > 1.0]
        at = {name: values[n] for name, values in c.items()}
        pressed = at["qbar"] * vehicle.reference.area
        forces = {axis: pressed * v for axis, v in air.predict(at).coefficients.items()}
        load = -masses.mass * at["az"] - forces["CZ"]
        # The nose wheel is 3 m ahead of the others, and friction below the centre of gravity loads it.
        height, brake = at["height_above_ground"], 0.22 * (0.74712 - 0.00144 * speed[n])
        moment = forces["Cm"] * vehicle.reference.chord
        nose_load = (load * (0.4 + height * (0.043 + brake)) - moment) / (3.0 + height * brake)
        friction = 0.043 * load + brake * (load - nose_load)
        expected = float(
            np.mean((forces["CX"] - friction + load * np.sin(at["theta"])) / masses.mass)
        )
        assert float(np.mean(at["ax"])) == pytest.approx(expected, rel=0.01)


def test_without_legs_a_flight_ends_as_it_touches_the_ground(
    vehicle: Vehicle, preflight: AeroDatabase, history: History
) -> None:
    """And is the same until then."""
    bare = mission.simulate(vehicle, truth(preflight)[0], preflight, seed=4, flights=FLIGHTS)
    for number in range(FLIGHTS):
        end = landing(history, number)
        assert 0 <= bare.samples[number] - 1 - end < 5
        for name, values in flown(bare, number).items():
            assert np.array_equal(values[:end], history.channels[name][:end, number]), name


def test_reconstructed_coefficients_of_a_perfect_log_are_the_truth(
    history: History, vehicle: Vehicle, preflight: AeroDatabase
) -> None:
    """Forward and inverse dynamics are separate code.

    The IMU is off the CG, the probe is on a boom, and moments are about the reference point.
    """
    n = landing(history, 0)
    seen = {
        name: values[:n, 0] for name, values in at_instruments(history.channels, vehicle).items()
    }
    probe = {name: seen[f"{name}_probe"] for name in ("V", "alpha", "beta")}
    logged = {
        name: v
        for name, v in seen.items()
        if (name in CHANNELS or is_surface(name)) and name not in ("ax", "ay", "az")
    }
    flight = air_data_at_cg(Flight("perfect", "phoenix", history.time[:n], logged | probe), vehicle)
    for name in probe:
        assert flight[name] == pytest.approx(seen[name], abs=1e-12)
    found = total_coefficients(flight, vehicle, angular_acceleration="logged")
    expected = truth(preflight)[0].predict(seen).coefficients
    for axis in AXES:
        assert np.abs(found.values[axis] - expected[axis]).max() < 1e-10, axis


def test_effects_are_of_phoenix_size_in_the_logs(
    history: History, vehicle: Vehicle, preflight: AeroDatabase
) -> None:
    """An effect's rms is at least 3 times the noise floor.

    The noise floor is the residual of the true model on logged data: docs/reference/conventions.md,
    "Noise floor and error measures".
    """
    database = truth(preflight)[0]
    floor: dict[str, list[Array]] = {axis: [] for axis in AXES}
    effect: dict[str, list[Array]] = {axis: [] for axis in AXES}
    for log in mission.logs(vehicle, history, seed=4):
        recording = Recording(
            log.name, "ulog", "0" * 64, 0, {t.name: t for t in log.topics}, layout="px4"
        )
        mapped = map_recording(recording, builtin_mappings()["px4"], vehicle, log.name)
        flight = flag_on_ground(mapped)
        airborne = flight.usable(["p"])
        # Gaps at both ends: delayed sensors start later than the inertial ones.
        good = flight.usable(["alpha", "beta", "V", "height_above_ground"])
        assert good.sum() > 0.99 * airborne.sum()
        measured = total_coefficients(flight, vehicle).values
        inputs = {name: flight[name] for name in flight.channels}
        true, before = database.predict(inputs).coefficients, preflight.predict(inputs).coefficients
        for axis in AXES:
            floor[axis].append((measured[axis] - true[axis])[good])
            effect[axis].append((true[axis] - before[axis])[good])
    rms = {
        axis: [float(np.sqrt(np.mean(np.concatenate(x) ** 2))) for x in (effect[axis], floor[axis])]
        for axis in AXES
    }
    for axis in ("CX", "CZ", "Cm"):
        assert rms[axis][0] > 3 * rms[axis][1], (axis, rms[axis])
    limits = {"CX": 0.0013, "CY": 0.0015, "CZ": 0.0045, "Cl": 0.0003, "Cm": 0.0006, "Cn": 0.0004}
    assert all(rms[axis][1] < limits[axis] for axis in AXES), rms


def test_logs_are_what_px4_would_write(history: History, vehicle: Vehicle) -> None:
    log = mission.logs(vehicle, history, seed=4)[1]
    topics = {topic.name: topic for topic in log.topics}
    rates = {name: 1 / np.median(np.diff(topic.time)) for name, topic in topics.items()}
    assert rates["vehicle_angular_velocity"] == pytest.approx(100.0)
    assert rates["vehicle_attitude"] == pytest.approx(50.0)
    dtypes = {value.dtype.name for topic in topics.values() for value in topic.fields.values()}
    assert dtypes == {"float32", "int8"}
    servos = topics["actuator_servos"].fields
    assert all(np.abs(servos[f"control[{n}]"]).max() <= 1.0 for n in range(7))
    assert np.isnan(servos["control[7]"]).all()
    assert set(np.unique(topics["landing_gear"].fields["landing_gear"])) == {-1, 1}
    quaternion = np.stack([topics["vehicle_attitude"].fields[f"q[{n}]"] for n in range(4)])
    assert np.sum(quaternion**2, axis=0) == pytest.approx(1.0, abs=3e-3)


def test_a_seed_says_everything(
    vehicle: Vehicle, preflight: AeroDatabase, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(mission, "LONGEST", 1.0)
    first, again, other = (mission.fly(seed, flights=2) for seed in (1, 1, 2))
    for a, b in zip(first, again, strict=True):
        for x, y in zip(a.topics, b.topics, strict=True):
            assert np.array_equal(x.time, y.time)
            assert all(np.array_equal(x.fields[f], y.fields[f], equal_nan=True) for f in x.fields)
    noise = [log[0].topics[0].fields["xyz[0]"][:50] for log in (first, other)]
    assert not np.array_equal(*noise)
    assert first[0].start_utc < first[1].start_utc


def test_air_data_stay_at_the_probe_when_rates_are_not_logged(vehicle: Vehicle) -> None:
    time = 0.01 * np.arange(10)
    channels = {"V": np.full(10, 50.0), "alpha": np.full(10, 0.1)}
    flight = air_data_at_cg(Flight("x", "phoenix", time, channels), vehicle)
    assert flight["alpha"].tolist() == channels["alpha"].tolist()
    assert "p, q, r not logged" in flight.notes[-1]
    plain = vehicle.model_copy(
        update={"points": vehicle.points.model_copy(update={"air_data": None})}
    )
    assert air_data_at_cg(flight, plain) is flight


def test_flap_and_brake_move_together_where_asked(
    vehicle: Vehicle, preflight: AeroDatabase
) -> None:
    """As those of 003 did; the autopilot works on both, and nothing else moves the flap."""
    together = mission.simulate(vehicle, preflight, preflight, 0, 1, together=True)
    own = flown(together, 0)
    brake, flap = own["delta_speed_brake"], own["delta_body_flap"]
    assert np.corrcoef(brake, flap)[0, 1] > 0.9999
    assert np.ptp(brake) > np.deg2rad(20.0)
