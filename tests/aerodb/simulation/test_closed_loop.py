"""Flights with a controller in the loop, and what belongs to them: air, inputs, instruments."""

from collections.abc import Mapping

import numpy as np
import pytest
from scipy.signal import welch

from aerodb.errors import InputError
from aerodb.exchange import read_native
from aerodb.physics.turbulence import DrydenGusts, dryden_scales
from aerodb.simulation import Actuator, FlownVehicle, flight_model, flown_of, simulate
from aerodb.simulation.closed_loop import Actuators, History, fly
from aerodb.simulation.engine import _DEFAULTS, initial_state
from aerodb.simulation.ground import standstill
from aerodb.simulation.inputs import Event, superposed
from aerodb.simulation.layout import SURROUNDINGS
from aerodb.simulation.sensors import Instrument, SensorSignal, at_instruments, measure
from aerodb.support.arrays import Array
from aerodb.tables import AeroDatabase, ReferenceGeometry, Term, parse
from aerodb.vehicle import Surface, parse_vehicle
from tests.support.three_wheels import VEHICLE as WHEELS
from tests.support.three_wheels import WITH_AIR

PLAIN = """
name = "body"
[reference]
area = 2.0
chord = 1.0
span = 4.0
[points]
moment_reference = [0.1, 0.0, 0.0]
imu = [1.0, 0.2, -0.3]
air_data = [2.0, 0.0, 0.0]
[mass]
mass = 50.0
cg = [0.0, 0.0, 0.0]
Ixx = 10.0
Iyy = 20.0
Izz = 25.0
Ixz = 2.0
"""


def plain(**changed: float) -> FlownVehicle:
    """An unstable plain aircraft: the reference point lies 0.1 m ahead of the CG."""
    vehicle = parse_vehicle(f"{PLAIN}\n[surfaces.elevator]\nlimits = [-0.4, 0.4]\nlag = 0.05\n")
    terms = {
        "CX": "-0.03",
        "CZ": "-4*alpha",
        "Cm": "0.02*alpha - 0.3*q/V - 0.5*delta_elevator",
    }
    reference = ReferenceGeometry(2.0, 1.0, 4.0, (changed.get("ahead", 0.1), 0.0, 0.0))
    database = AeroDatabase(
        name="plain",
        reference=reference,
        terms=tuple(Term(f"{axis}_all", axis, parse(text)) for axis, text in terms.items()),
    )
    return flown_of(vehicle, database)


def test_flights_side_by_side_are_each_as_if_alone_and_end_at_the_ground() -> None:
    def pilot(_: float, c: Mapping[str, Array]) -> dict[str, Array]:
        return {"elevator": 2.0 * (c["alpha"] - 0.05) + 0.3 * c["q"]}

    def flown(speed: Array, height: Array) -> History:
        k = len(speed)
        start = {"V": speed, "altitude": height}
        return fly(
            plain(), start, {"elevator": np.zeros(k)}, pilot,
            step=0.01, duration=20.0, wind=np.full((3, k), 1.0),
        )  # fmt: skip

    speed, height = np.array([35.0, 45.0]), np.array([20.0, 25.0])
    both, alone = flown(speed, height), flown(speed[1:], height[1:])
    assert both.samples[1] == alone.samples[0] < 2000
    n = both.samples[1]
    for name, values in both.channels.items():
        assert values[:n, 1] == pytest.approx(alone.channels[name][:n, 0], rel=1e-7, abs=1e-7), name
    heights = [
        both.channels["height_above_ground"][m - 2 : m, j] for j, m in enumerate(both.samples)
    ]
    assert all(before > 0 >= after for before, after in heights)


def test_a_controller_that_holds_still_flies_as_the_engine_does_alone() -> None:
    """A second of an unstable vehicle with a surface that lags: the engine's own actuator, and a
    fourth of the step. The difference stays far below a sensor's noise (1e-3 rad, 6e-4 rad/s)."""
    flown, held = plain(ahead=0.01), np.array([0.01])
    start = {"V": 40.0, "alpha": 0.0125, "altitude": 500.0}
    looped = fly(
        flown, start, {"elevator": np.zeros(1)}, lambda _, c: {"elevator": held + 0 * c["V"]},
        step=0.01, duration=1.0, wind=np.array([[3.0], [-2.0], [0.5]]),
    )  # fmt: skip
    model = flight_model(
        flown.model.database, actuators={"delta_elevator": Actuator((-0.4, 0.4), lag=0.05)}
    )
    wind = {"wind_north": 3.0, "wind_east": -2.0, "wind_down": 0.5}
    time = np.arange(0.0, 1.0001, 0.0025)
    commanded = np.full(len(time), 0.01)
    state = initial_state(
        model,
        start,
        {n: np.full(1, {**_DEFAULTS, **flown.masses, **wind}[n]) for n in SURROUNDINGS}
        | {"delta_elevator": np.zeros(1)},
        1,
    )
    alone = simulate(model, time, state, {**flown.masses, **wind, "delta_elevator": commanded})
    assert np.abs(alone.channels["q"][-1, 0]) > 0.05
    for name in ("V", "alpha", "beta", "p", "q", "r", "theta", "altitude", "az", "delta_elevator"):
        ours, theirs = looped.channels[name][:, 0], alone.channels[name][::4, 0]
        tolerance = 40.0 * 1e-4 if name in ("V", "altitude", "az") else 1e-4
        assert np.abs(ours - theirs).max() < tolerance, name


def test_turbulence_has_drydens_spectrum_and_intensity_at_any_step() -> None:
    """MIL-F-8785C, 3.7.1.2: Phi_u = 2 sigma^2 L/(pi V) / (1 + (L w/V)^2) per rad/s, and the lateral
    form."""
    speed, height, k = 50.0, 300.0, 64
    calm = np.full(k, 7.7)
    lengths, sigma = dryden_scales(np.full(k, height), calm)
    for step, number in ((0.02, 8192), (0.1, 4096)):
        gusts = DrydenGusts(calm, np.random.default_rng(1))
        series = np.stack(
            [gusts.advance(step, np.full(k, speed), np.full(k, height)) for _ in range(number)]
        )
        assert np.sqrt(np.mean(series**2, axis=(0, 2))) == pytest.approx(sigma[:, 0], rel=0.06)
    frequency, density = welch(series, fs=1 / step, nperseg=512, axis=0)
    band = (frequency > 0.03) & (frequency < 1.0)
    x = lengths[:, 0] * 2 * np.pi * frequency[band, None] / speed
    along = 4 * lengths[:, 0] / speed / (1 + x**2)
    across = 2 * lengths[:, 0] / speed * (1 + 3 * x**2) / (1 + x**2) ** 2
    expected = sigma[:, 0] ** 2 * np.stack([along[:, 0], across[:, 1], across[:, 2]], axis=1)
    ratio = density.mean(axis=2)[band] / expected
    assert np.abs(np.mean(ratio, axis=0) - 1).max() < 0.05


def test_turbulence_scales_are_those_of_the_specification() -> None:
    """MIL-F-8785C figures at 200 ft: L = 200/(.177+.1646)^1.2 ft, sigma_u = .1 W20/(.3416)^.4; 1750
    ft above 2000 ft."""
    lengths, sigma = dryden_scales(np.array([200.0, 3000.0]) * 0.3048, np.array([10.0, 10.0]))
    assert lengths[:, 0] / 0.3048 == pytest.approx([200 / 0.3416**1.2, 200 / 0.3416**1.2, 200.0])
    assert sigma[:, 0] == pytest.approx([1 / 0.3416**0.4, 1 / 0.3416**0.4, 1.0])
    assert lengths[:, 1] / 0.3048 == pytest.approx([1750.0] * 3)
    assert sigma[:, 1] == pytest.approx([1.0] * 3)


def test_events_have_the_shape_that_their_name_says() -> None:
    time = np.arange(0.0, 10.0, 0.5)
    pattern = Event("x", 1.0, 1.0, 2.0, "3211")(time)
    assert (
        pattern.tolist() == [0.0] * 2 + [2.0] * 6 + [-2.0] * 4 + [2.0] * 2 + [-2.0] * 2 + [0.0] * 4
    )
    held = Event("x", 0.0, 5.0, 1.0, "hold")(np.array([0.0, 0.5, 1.0, 2.5, 4.5, 5.0, 6.0]))
    assert held == pytest.approx([0.0, 0.5, 1.0, 1.0, 0.5, 0.0, 0.0])
    both = superposed(((Event("x", 1.0, 1.0, 2.0), Event("y", 0.0, 1.0, 9.0)), ()), "x", time)
    assert both.sum(axis=0).tolist() == [0.0, 0.0]
    assert both.max() == 2.0


def test_instruments_off_the_cg_see_rotation_and_show_their_delay_bias_and_noise() -> None:
    vehicle = parse_vehicle(PLAIN)
    n = 4001
    time = 0.01 * np.arange(n)
    names = ("ax", "ay", "az", "p", "q", "r", "pdot", "qdot", "rdot", "beta")
    true = {name: np.zeros((n, 1)) for name in names}
    true |= {
        "V": np.full((n, 1), 50.0),
        "alpha": np.full((n, 1), 0.1),
        "rho": np.full((n, 1), 1.225),
    }
    true["q"], true["pdot"] = np.full((n, 1), 0.2), np.full((n, 1), 3.0)
    seen = at_instruments(true, vehicle)
    # Steady pitch rate: centripetal -q^2 r; roll acceleration about x moves y by -pdot z and z by
    # pdot y.
    assert [seen[f"a{x}_imu"][0, 0] for x in "xyz"] == pytest.approx(
        [-0.04 * 1.0, 3.0 * 0.3, 3.0 * 0.2 + 0.04 * 0.3]
    )
    u, w = 50 * np.cos(0.1), 50 * np.sin(0.1) - 0.2 * 2.0
    assert seen["alpha_probe"][0, 0] == pytest.approx(np.arctan2(w, u))
    assert seen["V_probe"][0, 0] == pytest.approx(np.hypot(u, w))
    ramp = {"ramp": 2.0 * time[:, None], "state": np.floor(time)[:, None]}
    signals = (
        SensorSignal("y", "ramp", noise=0.5, bias=3.0, scale=10.0, offset=1.0),
        SensorSignal("s", "state", dtype="int8", held=True),
    )
    history = History(time, {}, {}, np.zeros((n, 4, 1)), np.array([n]))
    (topic,) = measure(
        history,
        ramp,
        0,
        (Instrument("t", 50.0, signals, 0.05, 0.003),),
        np.random.default_rng(0),
        7.0,
    )
    assert topic.fields["y"].dtype == np.float32
    clock = topic.time - 7.0
    assert clock[0] >= 0.05
    assert np.diff(clock) == pytest.approx(0.02)
    assert np.abs(topic.time * 1e6 - np.round(topic.time * 1e6)).max() < 1e-3
    rest = (topic.fields["y"] - 1.0) / 10.0 - 2.0 * (clock - 0.05)
    assert rest.mean() == pytest.approx(3.0, abs=4 * 0.5 / np.sqrt(len(rest)))
    assert rest.std() == pytest.approx(0.5, rel=0.1)
    assert topic.fields["s"].tolist() == np.floor(clock + 1e-9).tolist()


def test_actuators_stop_at_their_limits() -> None:
    fin = Surface(limits=(-0.2, 0.3), lag=0.0)
    moved = Actuators([fin], 0.01).moved(np.zeros((1, 2)), np.array([[-1.0, 1.0]]))
    assert moved.tolist() == [[-0.2, 0.3]]


def test_a_vehicle_without_surfaces_has_nothing_to_move() -> None:
    assert len(Actuators([], 0.01).moved(np.array([]), np.array([]))) == 0


@pytest.mark.parametrize("change", ["[thrust]\nsource = 'unknown'", "fuel"])
def test_a_vehicle_that_cannot_be_simulated_is_refused(change: str) -> None:
    text = (
        PLAIN.replace("cg = [0.0", 'source = "channels"\ncg = [0.0')
        if change == "fuel"
        else f"{PLAIN}\n{change}"
    )
    database = AeroDatabase(
        name="plain", reference=ReferenceGeometry(2.0, 1.0, 4.0, (0.0, 0.0, 0.0)), terms=()
    )
    with pytest.raises(InputError, match=r"gliding|logged in flight"):
        fly(
            flown_of(parse_vehicle(text), database), {"V": 40.0}, {}, lambda _, c: {},
            step=0.01, duration=1.0, wind=np.zeros((3, 1)),
        )  # fmt: skip


def test_a_pure_roll_moment_couples_through_the_product_of_inertia() -> None:
    flown = plain()
    found = simulate(
        flight_model(AeroDatabase(name="none", reference=flown.model.database.reference, terms=())),
        np.array([0.0]), {"V": 40.0}, {**flown.masses, "moment_x": 1.0},
    )  # fmt: skip
    determinant = 10.0 * 25.0 - 4.0
    rates = [found.channels[name][0, 0] for name in ("pdot", "qdot", "rdot")]
    assert rates == pytest.approx([25.0 / determinant, 0.0, 2.0 / determinant])


def test_on_legs_a_flight_rolls_until_it_stands_still() -> None:
    """Brakes that the controller sets, and the standstill that `simulate` finds with the same
    commands."""
    database = read_native(WITH_AIR)
    flown = flown_of(parse_vehicle(WHEELS), database)
    k = 2
    brake = np.array([1.0, 0.5])
    free = {"brake": np.zeros(k), "steering": np.zeros(k)}
    start = {"V": np.full(k, 40.0), "altitude": np.full(k, 1.19)}
    found = fly(
        flown, start, free, lambda _, c: {"brake": brake, "steering": 0.0 * c["V"]},
        step=0.01, duration=60.0, wind=np.zeros((3, k)),
    )  # fmt: skip
    time = 0.01 * np.arange(6001)
    for number, share in enumerate(brake):
        given = {**flown.masses, "brake": np.where(time > 0.0, share, 0.0), "steering": 0.0}
        alone = simulate(flown.model, time, {"V": 40.0, "altitude": 1.19}, given, parts=2)
        end = standstill(alone, database, (0.0, 0.0, 0.0))
        assert end is not None
        n = found.samples[number]
        assert found.time[n - 1] == pytest.approx(end.time, abs=0.1)
        assert found.channels["north"][n - 1, number] == pytest.approx(end.distance, rel=1e-3)
    assert found.samples[0] < found.samples[1]
