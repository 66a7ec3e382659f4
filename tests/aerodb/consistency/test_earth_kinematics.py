"""Tests of the kinematics over a rotating oblate earth and through any attitude, against closed
forms, an inertial frame, JSBSim and a loop."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from aerodb.consistency.earth_terms import over_flat_earth
from aerodb.consistency.kinematics import INPUTS, integrate
from aerodb.consistency.output_error.reconstruction import reconstruct
from aerodb.consistency.sensors.prediction import FlightRecord
from aerodb.errors import InputError
from aerodb.physics.geodesy import (
    EARTH_RATE,
    PLUMB_LINE_CURVATURE,
    SEMI_MAJOR,
    Earth,
    normal_gravity,
    radii_of_curvature,
)

FOOT = 0.3048
MINOR, GRAVITATION = 6356752.314245, 3.986004418e14
ORIGIN = Earth(np.deg2rad(48.0), np.deg2rad(11.0), 0.0)


def gravity_vector(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Normal gravity (n, 3) in earth-fixed axes, closed form in ellipsoidal coordinates (TR8350.2,
    section 4.2)."""
    focus = SEMI_MAJOR**2 - MINOR**2
    over = x * x + y * y + z * z - focus
    u2 = 0.5 * over * (1.0 + np.sqrt(1.0 + 4.0 * focus * z * z / over**2))
    u, e = np.sqrt(u2), np.sqrt(focus)
    rho = np.hypot(x, y)
    beta = np.arctan2(z * np.sqrt(u2 + focus), u * rho)
    w = np.sqrt((u2 + focus * np.sin(beta) ** 2) / (u2 + focus))

    def q(at: np.ndarray | float) -> np.ndarray | float:
        return 0.5 * ((1.0 + 3.0 * at**2 / focus) * np.arctan(e / at) - 3.0 * at / e)

    slope = 3.0 * (1.0 + u2 / focus) * (1.0 - u / e * np.arctan(e / u)) - 1.0
    spin = (EARTH_RATE * SEMI_MAJOR) ** 2
    part = GRAVITATION / (u2 + focus) + spin * e / (u2 + focus) * slope / q(MINOR) * (
        0.5 * np.sin(beta) ** 2 - 1.0 / 6.0
    )
    up = (-part + EARTH_RATE**2 * u * np.cos(beta) ** 2) / w
    north = (
        (spin / np.sqrt(u2 + focus) * q(u) / q(MINOR) - EARTH_RATE**2 * np.sqrt(u2 + focus))
        * np.sin(beta)
        * np.cos(beta)
        / w
    )
    stretch = u / np.sqrt(u2 + focus)
    outward = (up * stretch * np.cos(beta) - north * np.sin(beta)) / w
    return np.stack(
        [
            outward * x / rho,
            outward * y / rho,
            (up * np.sin(beta) + north * stretch * np.cos(beta)) / w,
        ],
        axis=-1,
    )


def place(latitude: np.ndarray, longitude: np.ndarray, height: np.ndarray) -> np.ndarray:
    """Earth-fixed Cartesian position (n, 3)."""
    normal = SEMI_MAJOR / np.sqrt(1.0 - (1.0 - (MINOR / SEMI_MAJOR) ** 2) * np.sin(latitude) ** 2)
    flat = (normal + height) * np.cos(latitude)
    high = ((MINOR / SEMI_MAJOR) ** 2 * normal + height) * np.sin(latitude)
    return np.stack([flat * np.cos(longitude), flat * np.sin(longitude), high], axis=-1)


def test_gravity_and_curvature_are_those_published():
    assert normal_gravity(0.0, 0.0).gravity == pytest.approx(9.7803253359, abs=1e-10)
    assert normal_gravity(np.pi / 2, 0.0).gravity == pytest.approx(9.8321849378, abs=1e-9)
    assert radii_of_curvature(0.0).meridian == pytest.approx(6335439.3273, abs=1e-3)
    assert radii_of_curvature(np.pi / 2)[:2] == pytest.approx(
        (6399593.6258, 6399593.6258), abs=1e-3
    )


@pytest.mark.parametrize("height", [0.0, 3000.0, 12000.0, 20000.0])
def test_gravity_aloft_against_the_closed_form(height):
    for degrees in (-70.0, -20.0, 5.0, 45.0, 80.0):
        latitude = np.deg2rad(degrees)
        down, _, _, bend = normal_gravity(latitude, height)
        exact = gravity_vector(*place(np.array([latitude]), np.array([0.0]), np.array([height]))[0])
        north = exact @ [-np.sin(latitude), 0.0, np.cos(latitude)]
        assert down == pytest.approx(-(exact @ [np.cos(latitude), 0.0, np.sin(latitude)]), abs=3e-6)
        assert bend * height == pytest.approx(north, abs=2e-6)
        assert bend == PLUMB_LINE_CURVATURE * np.sin(2 * latitude)


def test_eotvos_and_transport_rate():
    """Ten minutes along the 45th parallel at 250 m/s: the figure of Eotvos in az, what curves the
    track in ay, the earth's and the transport rate in the gyros; height and latitude stay. On a
    flat earth the same sensors would climb six kilometres."""
    latitude, height, speed = np.deg2rad(45.0), 8000.0, 250.0
    down, _, _, bend = normal_gravity(latitude, height)
    across = radii_of_curvature(latitude).normal + height
    eotvos = 2.0 * EARTH_RATE * speed * np.cos(latitude) + speed**2 / across
    assert eotvos == pytest.approx(0.03557, abs=2e-5)
    turn = EARTH_RATE + speed / (across * np.cos(latitude))
    # body axes of eastward flight: forward is east, right is south
    south = (
        -(2.0 * EARTH_RATE * np.sin(latitude) * speed + speed**2 * np.tan(latitude) / across)
        + bend * height
    )
    steady = [0.0, south, -(down - eotvos), 0.0, -turn * np.cos(latitude), -turn * np.sin(latitude)]
    inputs = np.tile(steady, (6001, 1))
    earth = Earth(latitude, 0.0, 0.0)
    first = np.array([speed, 0.0, 0.0, 0.0, 0.0, np.pi / 2, 0.0, 0.0, height])
    states, _ = integrate(inputs, 0.1, first, 0.0, earth=earth)
    assert np.abs(states[8] - height).max() < 0.01
    assert np.abs(states[6]).max() < 0.01
    assert np.abs(states[5] - np.pi / 2).max() < 1e-7
    assert states[7, -1] == pytest.approx(
        600.0 * speed * earth.metres_per_radian[1] / (across * np.cos(latitude)), rel=1e-9
    )
    flat, _ = integrate(inputs, 0.1, first, down)
    assert abs(flat[8, -1] - height) > 5000.0


def test_a_falling_stone_lands_to_the_east():
    """Free fall from rest over the earth: eastward by W g t^3 cos(latitude) / 3, 30 s from 5 km."""
    latitude = np.deg2rad(40.0)
    inputs = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0], (3001, 1))
    first = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 5000.0])
    states, _ = integrate(inputs, 0.01, first, 0.0, earth=Earth(latitude))
    gravity = normal_gravity(latitude, 3500.0).gravity
    assert states[7, -1] == pytest.approx(
        EARTH_RATE * gravity * 30.0**3 * np.cos(latitude) / 3.0, rel=5e-3
    )
    assert 5000.0 - states[8, -1] == pytest.approx(0.5 * gravity * 900.0, rel=5e-4)


def _inertial_sensors(time: np.ndarray) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """A path by formulas in latitude, longitude and height, and what inertial sensors show on it by
    Newton's law in axes that do not turn: (n, 6), from sixth-order differences of position and
    attitude there."""
    tiny, weights = 0.05, np.array([-1 / 60, 3 / 20, -3 / 4, 0.0, 3 / 4, -3 / 20, 1 / 60])
    second = np.array([1 / 90, -3 / 20, 3 / 2, -49 / 18, 3 / 2, -3 / 20, 1 / 90])

    def path(t: np.ndarray) -> dict[str, np.ndarray]:
        return {
            "latitude": ORIGIN.latitude + 2e-5 * t + 1e-4 * np.sin(0.05 * t),
            "longitude": ORIGIN.longitude + 4e-5 * t + 1e-4 * np.sin(0.07 * t),
            "altitude": 6000.0 + 300.0 * np.sin(0.04 * t),
            "phi": 0.5 * np.sin(0.3 * t), "theta": 0.1 + 0.1 * np.sin(0.2 * t),
            "psi": 1.0 + 0.8 * np.sin(0.1 * t),
        }  # fmt: skip

    def inertial(t: np.ndarray) -> tuple[np.ndarray, Rotation]:
        at = path(t)
        spin = Rotation.from_rotvec(np.outer(EARTH_RATE * t, [0.0, 0.0, 1.0]))
        to_earth_fixed = Rotation.from_euler(
            "ZY", np.column_stack([at["longitude"], -at["latitude"] - np.pi / 2])
        )
        attitude = Rotation.from_euler("ZYX", np.column_stack([at["psi"], at["theta"], at["phi"]]))
        return (
            spin.apply(place(at["latitude"], at["longitude"], at["altitude"])),
            spin * to_earth_fixed * attitude,
        )

    stencil = [inertial(time + k * tiny) for k in range(-3, 4)]
    acceleration = (
        sum(w * position for w, (position, _) in zip(second, stencil, strict=True)) / tiny**2
    )
    turned = [stencil[3][1].inv() * attitude for _, attitude in stencil]
    rates = sum(w * turn.as_rotvec() for w, turn in zip(weights, turned, strict=True)) / tiny
    at = path(time)
    fixed = place(at["latitude"], at["longitude"], at["altitude"])
    spin = Rotation.from_rotvec(np.outer(EARTH_RATE * time, [0.0, 0.0, 1.0]))
    centrifugal = EARTH_RATE**2 * fixed * [1.0, 1.0, 0.0]
    attraction = spin.apply(gravity_vector(*fixed.T) - centrifugal)
    return at, np.column_stack([stencil[3][1].inv().apply(acceleration - attraction), rates])


def test_the_inertial_frame_gives_the_same_motion():
    """Ten minutes and 130 km: two metres from the path, which is what inputs linear within 20 ms
    leave (at half the step it is a quarter); the flat earth is kilometres off."""
    time = np.arange(0.0, 600.0, 0.02)
    at, inputs = _inertial_sensors(time)
    north, east = ORIGIN.to_local(at["latitude"], at["longitude"])
    meridian, normal = radii_of_curvature(ORIGIN.latitude)[:2]
    over = np.array([2e-5 + 5e-6, 4e-5 + 7e-6]) * [
        meridian + 6000.0,
        (normal + 6000.0) * np.cos(ORIGIN.latitude),
    ]
    attitude = Rotation.from_euler("ZYX", [at["psi"][0], at["theta"][0], at["phi"][0]])
    first = np.r_[
        attitude.inv().apply([*over, -12.0]),
        at["phi"][0],
        at["theta"][0],
        at["psi"][0],
        0.0,
        0.0,
        6000.0,
    ]
    states, _ = integrate(inputs, 0.02, first, 0.0, earth=ORIGIN)
    assert np.hypot(states[6] - north, states[7] - east).max() < 2.0
    assert np.abs(states[8] - at["altitude"]).max() < 1.0
    for row, name in ((3, "phi"), (4, "theta"), (5, "psi")):
        assert np.abs(states[row] - at[name]).max() < 4e-6, name
    flat, _ = integrate(inputs, 0.02, first, normal_gravity(ORIGIN.latitude, 6000.0).gravity)
    assert np.hypot(flat[6] - north, flat[7] - east).max() > 3000.0


def test_a_minute_over_a_flat_earth_without_the_earths_terms():
    """Forces and rates of the inertial frame, the earth's own rate taken off as an attitude
    reference does: without curvature and Coriolis they give the motion over a flat earth. With
    them, the velocity across is off by a tenth of a degree of sideslip after a minute."""
    time = np.arange(0.0, 60.0, 0.02)
    at, inputs = _inertial_sensors(time)
    attitude = np.array([at["phi"], at["theta"], at["psi"]])
    to_body = Rotation.from_euler("ZYX", attitude[::-1].T).inv()
    earth = EARTH_RATE * np.array([np.cos(ORIGIN.latitude), 0.0, -np.sin(ORIGIN.latitude)])
    inputs[:, 3:] -= to_body.apply(earth)
    meridian, normal = radii_of_curvature(ORIGIN.latitude)[:2]
    height = meridian + at["altitude"], normal + at["altitude"]
    over = np.array([
        (2e-5 + 5e-6 * np.cos(0.05 * time)) * height[0],
        (4e-5 + 7e-6 * np.cos(0.07 * time)) * height[1] * np.cos(at["latitude"]),
        -12.0 * np.cos(0.04 * time),
    ])  # fmt: skip
    body = to_body.apply(over.T).T
    first = np.r_[body[:, 0], attitude[:, 0], 0.0, 0.0, 6000.0]
    gravity = float(normal_gravity(ORIGIN.latitude, 6100.0).gravity)
    flat, _ = integrate(
        over_flat_earth(inputs, attitude, body, ORIGIN.latitude), 0.02, first, gravity
    )
    bent, _ = integrate(inputs, 0.02, first, gravity)
    speed = np.linalg.norm(body, axis=0)
    assert np.abs(flat[3:6] - attitude).max() < 1e-5
    assert np.abs((flat[1] - body[1]) / speed).max() < 1e-4
    assert np.abs((bent[1] - body[1]) / speed).max() > 1.7e-3
    # without a latitude what is left is Coriolis and the convergence of the meridians
    curved, _ = integrate(over_flat_earth(inputs, attitude, body, None), 0.02, first, gravity)
    assert np.abs(curved[3:5] - attitude[:2]).max() < 0.3 * np.abs(bent[3:5] - attitude[:2]).max()


def test_jsbsim_flies_the_same_earth():
    """Three minutes of JSBSim's own 6-DOF over its rotating WGS-84 earth: its forces and inertial
    rates, integrated, lead to its position and attitude; on a flat earth they end hundreds of
    metres away."""
    from tests.support.jsbsim_flights import simulator

    executive = simulator("c172p")
    start = {
        "lat-geod-deg": 50,
        "long-gc-deg": 8,
        "h-sl-ft": 15000,
        "vt-fps": 170,
        "alpha-deg": 4,
        "psi-true-deg": 90,
        "theta-deg": 4,
    }
    for name, value in start.items():
        executive[f"ic/{name}"] = value
    executive["fcs/throttle-cmd-norm"] = 0.5
    assert executive.run_ic()
    step, rows = executive.get_delta_t(), []
    for number in range(round(180.0 / step)):
        time = number * step
        executive["fcs/elevator-cmd-norm"] = -0.05 + 0.02 * np.sin(0.7 * time)
        bank, roll = executive["attitude/phi-rad"], executive["velocities/p-rad_sec"]
        executive["fcs/aileron-cmd-norm"] = -0.4 * bank - 0.3 * roll + 0.2 * np.sin(0.1 * time)
        executive.run()
        force = [
            executive[f"forces/fb{a}-total-lbs"] / executive["inertia/mass-slugs"] * FOOT
            for a in "xyz"
        ]
        rates = [executive[f"velocities/{a}i-rad_sec"] for a in "pqr"]
        velocity = [executive[f"velocities/{a}-fps"] * FOOT for a in "uvw"]
        attitude = [executive[f"attitude/{a}-rad"] for a in ("phi", "theta", "psi")]
        where = [executive[f"position/{a}"] for a in ("lat-geod-rad", "long-gc-rad", "geod-alt-ft")]
        rows.append([*force, *rates, *velocity, *attitude, *where])
    table = np.array(rows)
    earth = Earth(table[0, 12], table[0, 13])
    north, east = earth.to_local(table[:, 12], table[:, 13])
    truth = np.column_stack([table[:, 6:12], north, east, table[:, 14] * FOOT])

    def off(kind: Earth | None) -> np.ndarray:
        states, _ = integrate(table[:, :6], step, truth[0], 9.80665, earth=kind, between="held")
        return np.abs(states.T - truth)[-1]

    ours, flat = off(earth), off(None)
    assert np.all(ours[3:5] < 2e-6)
    assert np.hypot(ours[6], ours[7]) < 3.0
    assert ours[8] < 4.0
    assert np.hypot(flat[6], flat[7]) > 100 * np.hypot(ours[6], ours[7])
    assert flat[8] > 40 * ours[8]


def _loop(rng: np.random.Generator) -> tuple[FlightRecord, np.ndarray]:
    """Two loops with some roll and yaw in between, at 25 m/s and 0.35 rad/s of pitch: attitude as a
    quaternion by scipy from the rates, velocity forward along the body but for a constant alpha;
    the sensors follow."""
    step, time = 0.01, np.arange(0.0, 40.0, 0.01)
    rates = np.column_stack(
        [0.03 * np.sin(0.5 * time), 0.35 + 0.05 * np.sin(time), 0.02 * np.sin(0.7 * time)]
    )
    # exact for rates linear within a step to fourth order: two-point Magnus
    middle = (
        0.5 * (rates[1:] + rates[:-1]) * step + np.cross(rates[:-1], rates[1:]) * step**2 / 12.0
    )
    attitude = [Rotation.from_euler("ZYX", [0.3, 0.1, -0.05])]
    for turn in Rotation.from_rotvec(middle):
        attitude.append(attitude[-1] * turn)
    whole = Rotation.concatenate(attitude)
    angles = whole.as_euler("ZYX")[:, ::-1]
    air = np.column_stack(
        [25.0 + 2.0 * np.sin(0.4 * time), 0.3 * np.sin(0.9 * time), 1.5 + 0.5 * np.cos(0.6 * time)]
    )
    change = np.column_stack(
        [0.8 * np.cos(0.4 * time), 0.27 * np.cos(0.9 * time), -0.3 * np.sin(0.6 * time)]
    )
    down = whole.inv().apply([0.0, 0.0, 1.0])
    force = change + np.cross(rates, air) - 9.80665 * down
    over = whole.apply(air) + np.array([3.0, -2.0, 0.0])
    speed = np.linalg.norm(air, axis=1)
    exact = {
        "V": speed, "alpha": np.arctan2(air[:, 2], air[:, 0]), "beta": np.arcsin(air[:, 1] / speed),
        **dict(zip(("phi", "theta", "psi"), angles.T, strict=True)),
        **dict(zip(("velocity_north", "velocity_east", "velocity_down"), over.T, strict=True)),
    }  # fmt: skip
    noise = {"V": 0.2, "alpha": 3e-3, "beta": 3e-3, "phi": 2e-3, "theta": 2e-3, "psi": 2e-3}
    bias = np.array([0.05, -0.03, 0.08, 0.002, -0.001, 0.0015])
    outputs = {
        name: x + noise.get(name, 0.1) * rng.standard_normal(len(time)) for name, x in exact.items()
    }
    inputs = np.column_stack([force, rates]) + bias
    assert np.abs(angles[:, 1]).max() > np.deg2rad(85.0)
    return FlightRecord("loop", step, inputs, outputs, "loop"), bias


def test_a_loop_is_reconstructed():
    """Through the vertical, twice: every bias and the wind within its interval, no angle lost."""
    record, bias = _loop(np.random.default_rng(2))
    free = tuple(f"{name}_bias" for name in INPUTS)
    result = reconstruct(
        [record], (*free, "wind_north", "wind_east"), initial=("u", "v", "w", "phi", "theta", "psi")
    )
    assert result.converged
    for name, value in zip(free, bias, strict=True):
        assert abs(result[name].value - value) < 4 * result[name].standard_error < 0.02, name
    assert result["wind_north[loop]"].value == pytest.approx(
        3.0, abs=4 * result["wind_north[loop]"].standard_error
    )
    for name in ("phi", "theta", "psi"):
        assert result.noise[name] == pytest.approx(2e-3, rel=0.05)
    assert np.isfinite(result.paths[0].state_sigma).all()
    assert np.isfinite(result.paths[0].air_sigma).all()


def test_sensitivities_hold_through_the_vertical():
    """Of attitude, as turns of the body: differences of two loops flown with one input changed."""
    record, bias = _loop(np.random.default_rng(2))
    record = replace(record, inputs=record.inputs - bias)
    first = np.array([25.0, 0.0, 2.0, -0.05, 0.1, 0.3, 0.0, 0.0, 500.0])
    directions, kind, tiny = np.zeros((9, 1)), np.array([4]), 1e-6
    states, slopes = integrate(record.inputs, 0.01, first, 9.80665, None, directions, kind)
    assert np.abs(states[4]).max() > np.deg2rad(85.0)
    changed = record.inputs - tiny * np.eye(6)[4]
    moved, _ = integrate(changed, 0.01, first, 9.80665)
    one, two = (Rotation.from_euler("ZYX", x[[5, 4, 3]].T) for x in (states, moved))
    f, t = states[3], states[4]
    df, dt, dp = slopes[3:6, :, 0]
    turn = np.stack(
        [
            df - dp * np.sin(t),
            dt * np.cos(f) + dp * np.sin(f) * np.cos(t),
            -dt * np.sin(f) + dp * np.cos(f) * np.cos(t),
        ]
    )
    np.testing.assert_allclose(turn.T, (one.inv() * two).as_rotvec() / tiny, atol=1e-3)


def test_long_records_are_reconstructed_over_the_real_earth():
    """The same ten minutes with sensors: gyro and accelerometer biases a tenth of the earth's rate
    and of Coriolis come back over the rotating earth; the flat earth takes both for sensor
    errors."""
    time = np.arange(0.0, 300.0, 0.1)
    at, inputs = _inertial_sensors(time)
    rng = np.random.default_rng(7)
    north, east = ORIGIN.to_local(at["latitude"], at["longitude"])
    outputs = {
        "phi": at["phi"],
        "theta": at["theta"],
        "psi": at["psi"],
        "north": north,
        "east": east,
        "altitude": at["altitude"],
    }
    for axis, place_, rate in (
        ("north", north, 1.0),
        ("east", east, 1.0),
        ("down", at["altitude"], -1.0),
    ):
        outputs[f"velocity_{axis}"] = rate * np.gradient(place_, time, edge_order=2)
    noise = {"phi": 1e-4, "theta": 1e-4, "psi": 1e-4, "north": 1.0, "east": 1.0, "altitude": 1.0}
    outputs = {
        name: x + noise.get(name, 0.3) * rng.standard_normal(len(time))
        for name, x in outputs.items()
    }
    bias = {"p_bias": 7e-6, "q_bias": -7e-6, "r_bias": 7e-6, "az_bias": 0.002}
    inputs = inputs + np.array([0.0, 0.0, 0.002, 7e-6, -7e-6, 7e-6])
    record = FlightRecord("long", 0.1, inputs, outputs, "long", gravity=9.8076, earth=ORIGIN)
    free, first = tuple(bias), ("u", "v", "w", "phi", "theta", "psi", "north", "east", "altitude")
    real = reconstruct([record], free, initial=first)
    for name, value in bias.items():
        assert abs(real[name].value - value) < 4 * real[name].standard_error, name
    flat = reconstruct([replace(record, earth=None)], free, initial=first)
    assert (
        max(abs(flat[name].value - value) for name, value in bias.items() if name != "az_bias")
        > 2e-5
    )


def test_what_an_earth_must_be():
    with pytest.raises(InputError, match="too close to a pole"):
        Earth(50.0)
    record = FlightRecord(
        "g", 0.1, np.zeros((10, 6)), {}, given={"phi": np.zeros(10)}, earth=ORIGIN
    )
    with pytest.raises(InputError, match="given on a rotating earth"):
        integrate(record.inputs, 0.1, np.zeros(9), 9.8, np.full((10, 9), 0.0), earth=record.earth)
    with pytest.raises(InputError, match="leaves all bounds"):
        integrate(np.tile([1e6, 0, 0, 0, 0, 0], (100, 1)), 0.1, np.zeros(9), 9.8)
    there = Earth(0.1, np.pi - 1e-4)
    assert there.to_local(np.array([0.1]), np.array([-np.pi + 1e-4]))[1] == pytest.approx(
        2e-4 * there.metres_per_radian[1], rel=1e-6
    )
