"""The flight simulation against analytic solutions, then against itself."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import welch
from scipy.special import ellipj

from aerodb.errors import InputError
from aerodb.physics import quaternion_from_euler, to_body, to_earth
from aerodb.physics.atmosphere import GRAVITY
from aerodb.simulation.airframe_model import Airframe, MovingAir, airframe
from aerodb.simulation.flight import Actuators, History, fly
from aerodb.simulation.inputs import Event, superposed
from aerodb.simulation.motion import (
    angular_acceleration,
    derivative,
    gravity_body,
    inertia_matrix,
    midpoint_step,
)
from aerodb.simulation.sensors import Instrument, Signal, at_instruments, measure
from aerodb.simulation.turbulence import DrydenGusts, dryden_scales
from aerodb.support.arrays import Array
from aerodb.vehicle import Surface, parse_vehicle
from tests.support.linearised import jacobian
from tests.support.runge_kutta import runge_kutta_step

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


def integrate(step_rule, rate, state: Array, step: float, number: int) -> Array:
    for n in range(number):
        state = step_rule(rate, n * step, state, step, rate(n * step, state))
    return state


def body(inertia: Array, force=lambda state: np.zeros_like(state[:3])):
    return lambda _, state: derivative(state, force(state), np.zeros_like(state[:3]), inertia)


def test_torque_free_tumbling_is_that_of_jacobis_elliptic_functions() -> None:
    """Landau & Lifshitz, Mechanics, section 37: omega of a free asymmetric top with I1 < I2 < I3
    and M^2 > 2 E I2."""
    i1, i2, i3 = 10.0, 17.0, 30.0
    w1, w3 = 0.9, 1.4
    energy2, momentum2 = i1 * w1**2 + i3 * w3**2, (i1 * w1) ** 2 + (i3 * w3) ** 2
    assert momentum2 > energy2 * i2
    state = np.zeros((13, 1))
    state[3], state[5], state[6] = w1, w3, 1.0
    time, step = 8.0, 0.01
    end = integrate(
        runge_kutta_step, body(inertia_matrix(i1, i2, i3, 0.0)), state, step, round(time / step)
    )[3:6, 0]
    tau = time * np.sqrt((i3 - i2) * (momentum2 - energy2 * i1) / (i1 * i2 * i3))
    m = (i2 - i1) * (energy2 * i3 - momentum2) / ((i3 - i2) * (momentum2 - energy2 * i1))
    sn, cn, dn, _ = ellipj(tau, m)
    exact = [
        np.sqrt((energy2 * i3 - momentum2) / (i1 * (i3 - i1))) * cn,
        np.sqrt((energy2 * i3 - momentum2) / (i2 * (i3 - i2))) * sn,
        np.sqrt((momentum2 - energy2 * i1) / (i3 * (i3 - i1))) * dn,
    ]
    assert end == pytest.approx(exact, abs=2e-8)


def test_tumbling_with_a_product_of_inertia_keeps_angular_momentum_and_energy() -> None:
    inertia = inertia_matrix(520.0, 2900.0, 3150.0, 400.0)
    state = np.zeros((13, 2))
    state[3:6] = [[1.0, -0.5], [0.3, 2.0], [-0.7, 0.1]]
    state[6:10] = quaternion_from_euler(
        np.array([0.3, 1.0]), np.array([-0.8, 0.2]), np.array([2.0, -3.0])
    )
    start = (
        to_earth(state[6:10], inertia @ state[3:6]),
        np.sum(state[3:6] * (inertia @ state[3:6]), axis=0),
    )
    end = integrate(runge_kutta_step, body(inertia), state, 0.005, 2000)
    assert np.abs(end[3:6] - state[3:6]).max() > 0.1
    assert to_earth(end[6:10], inertia @ end[3:6]) == pytest.approx(start[0], rel=1e-7, abs=1e-4)
    assert np.sum(end[3:6] * (inertia @ end[3:6]), axis=0) == pytest.approx(start[1], rel=1e-9)


def test_a_dropped_sphere_with_drag_follows_the_hyperbolic_tangent() -> None:
    """m dv/dt = m g - k v^2: v = vt tanh(g t / vt), fallen vt^2/g ln cosh(g t / vt); tumbling does
    not change that."""
    terminal = 30.0

    def drag(state: Array) -> Array:
        return -GRAVITY / terminal**2 * np.sqrt(np.sum(state[:3] ** 2, axis=0)) * state[:3]

    state = np.zeros((13, 1))
    state[3:6, 0], state[6] = [0.5, -1.0, 2.0], 1.0
    end = integrate(runge_kutta_step, body(np.eye(3), drag), state, 0.01, 500)
    x = GRAVITY * 5.0 / terminal
    assert to_earth(end[6:10], end[:3])[:, 0] == pytest.approx(
        [0.0, 0.0, terminal * np.tanh(x)], abs=1e-6
    )
    assert end[10:, 0] == pytest.approx(
        [0.0, 0.0, terminal**2 / GRAVITY * np.log(np.cosh(x))], abs=1e-6
    )


def test_a_thrown_body_in_vacuum_flies_the_parabola_whatever_its_rotation() -> None:
    state = np.zeros((13, 1))
    state[6:10] = quaternion_from_euler(np.array([0.4]), np.array([0.5]), np.array([1.2]))
    thrown = np.array([[20.0], [-10.0], [-30.0]])
    state[:3] = to_body(state[6:10], thrown)
    state[3:6, 0] = [1.0, 0.5, -0.8]
    end = integrate(runge_kutta_step, body(inertia_matrix(10, 20, 25, 2)), state, 0.01, 400)
    assert end[10:, 0] == pytest.approx([80.0, -40.0, -120.0 + 0.5 * GRAVITY * 16], abs=1e-6)


def test_integration_has_its_order() -> None:
    inertia = inertia_matrix(10.0, 17.0, 30.0, 3.0)
    state = np.zeros((13, 1))
    state[3:6, 0], state[6] = [1.0, 0.5, 1.5], 1.0
    fine = integrate(runge_kutta_step, body(inertia), state, 0.0025, 800)
    errors = [
        np.abs(integrate(midpoint_step, body(inertia), state, h, round(2.0 / h)) - fine).max()
        for h in (0.1, 0.05)
    ]
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.4)


def test_gravity_in_body_axes_is_that_of_the_attitude() -> None:
    phi, theta, psi = np.array([0.3]), np.array([-0.4]), np.array([2.0])
    quaternion = quaternion_from_euler(phi, theta, psi)
    direct = GRAVITY * np.array(
        [-np.sin(theta), np.sin(phi) * np.cos(theta), np.cos(phi) * np.cos(theta)]
    )
    assert gravity_body(quaternion) == pytest.approx(direct)
    assert to_body(quaternion, np.array([[0.0], [0.0], [GRAVITY]])) == pytest.approx(direct)


def simple(channels: Mapping[str, Array]) -> dict[str, Array]:
    """An unstable plain aircraft whose short-period matrix is known by hand."""
    zero = 0 * channels["alpha"]
    pitch = (
        0.02 * channels["alpha"]
        - 0.3 * channels["q"] / channels["V"]
        - 0.5 * channels["delta_elevator"]
    )
    return {
        "CX": zero - 0.03,
        "CY": zero,
        "CZ": -4.0 * channels["alpha"],
        "Cl": zero,
        "Cm": pitch,
        "Cn": zero,
    }


def plain_airframe() -> Airframe:
    inertia = inertia_matrix(10.0, 20.0, 25.0, 2.0)
    return Airframe(
        50.0, inertia, 2.0, np.array([4.0, 1.0, 4.0]), np.array([0.1, 0.0, 0.0]), simple, {}
    )


def test_short_period_is_that_of_the_derivatives_and_the_flight_grows_at_its_rate() -> None:
    """With w and q as states: w' = Zw w + V q, q' = Mw w + Mq q (Etkin & Reid's short-period
    approximation)."""
    frame, speed = plain_airframe(), 40.0
    state = np.zeros(13)
    state[0], state[6], state[12] = speed, 1.0, -500.0
    still = MovingAir(np.zeros((3, 1)), np.zeros((3, 1)))

    def rate(states: Array) -> Array:
        return frame.state_rate(states, still, {"elevator": np.zeros(states.shape[1])})

    matrix = jacobian(rate, state)
    scale = float(frame.channels(state[:, None], still, {"elevator": np.zeros(1)})["qbar"][0]) * 2.0
    # The reference point lies 0.1 m ahead of the CG: lift there pitches up.
    moment_alpha = scale * (0.02 + 4.0 * 0.1)
    by_hand = np.array(
        [
            [-4.0 * scale / 50.0 / speed, speed],
            [moment_alpha / 20.0 / speed, -0.3 * scale / 20.0 / speed],
        ]
    )
    assert matrix[np.ix_([2, 4], [2, 4])] == pytest.approx(by_hand, rel=1e-5)
    fastest = np.linalg.eigvals(matrix[np.ix_([2, 4], [2, 4])]).real.max()
    assert fastest > 0
    vector = np.linalg.eig(by_hand)
    growing = vector.eigenvectors[:, np.argmax(vector.eigenvalues.real)].real
    pair = np.stack([state, state], axis=1)
    pair[[2, 4], 1] += 1e-5 * growing
    start, steps = pair[4, 1] - pair[4, 0], 20
    pair = integrate(runge_kutta_step, lambda _, s: rate(s), pair, 0.01, steps)
    growth = np.log((pair[4, 1] - pair[4, 0]) / start) / (0.01 * steps)
    assert growth == pytest.approx(fastest, rel=0.05)


def test_flights_side_by_side_are_each_as_if_alone_and_end_at_the_ground() -> None:
    frame = plain_airframe()
    surfaces = {"elevator": Surface(limits=(-0.4, 0.4), lag=0.05)}

    def pilot(_: float, c: Mapping[str, Array]) -> dict[str, Array]:
        return {"elevator": 2.0 * (c["alpha"] - 0.05) + 0.3 * c["q"]}

    def flown(states: Array):
        k = states.shape[1]
        return fly(
            frame,
            surfaces,
            states,
            {"elevator": np.zeros(k)},
            pilot,
            step=0.01,
            duration=20.0,
            wind=np.full((3, k), 1.0),
        )

    initial = np.zeros((13, 2))
    initial[0], initial[6], initial[12] = [35.0, 45.0], 1.0, [-20.0, -25.0]
    both, alone = flown(initial), flown(initial[:, 1:])
    assert both.samples[1] == alone.samples[0] < 2000
    n = both.samples[1]
    for name, values in both.channels.items():
        assert values[:n, 1] == pytest.approx(alone.channels[name][:n, 0], rel=1e-7, abs=1e-7), name
    heights = [
        both.channels["height_above_ground"][m - 2 : m, j] for j, m in enumerate(both.samples)
    ]
    assert all(before > 0 >= after for before, after in heights)


def test_midpoint_at_100_hz_is_adequate_for_an_unstable_vehicle() -> None:
    """A second of growth, doubling every 0.3 s: the error stays far below a sensor's noise (1e-3
    rad, 6e-4 rad/s)."""
    frame = replace(plain_airframe(), reference_arm=np.array([0.01, 0.0, 0.0]))
    still = MovingAir(np.zeros((3, 1)), np.zeros((3, 1)))
    state = np.zeros((13, 1))
    state[0], state[2], state[6], state[12] = 40.0, 0.5, 1.0, -500.0

    def rate(_: float, s: Array) -> Array:
        return frame.state_rate(s, still, {"elevator": np.full(1, 0.001)})

    coarse, fine = (
        integrate(midpoint_step, rate, state, 0.01, 100),
        integrate(runge_kutta_step, rate, state, 0.0025, 400),
    )
    assert np.abs(fine[4, 0]) > 0.1
    assert np.abs(coarse[3:6] - fine[3:6]).max() < 1e-4
    assert np.abs(coarse[:3] - fine[:3]).max() < 40.0 * 1e-4


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
        Signal("y", "ramp", noise=0.5, bias=3.0, scale=10.0, offset=1.0),
        Signal("s", "state", dtype="int8", held=True),
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

    class Nothing:
        class reference:
            moment_reference = (0.0, 0.0, 0.0)

        def predict(self, channels: Mapping[str, Array]) -> None:
            raise AssertionError("never asked")

    with pytest.raises(InputError, match="gliding"):
        airframe(parse_vehicle(text), Nothing())


def test_angular_acceleration_of_a_pure_roll_moment_couples_through_the_product_of_inertia() -> (
    None
):
    inertia = inertia_matrix(10.0, 20.0, 25.0, 2.0)
    found = angular_acceleration(np.zeros((3, 1)), np.array([[1.0], [0.0], [0.0]]), inertia)[:, 0]
    determinant = 10.0 * 25.0 - 4.0
    assert found == pytest.approx([25.0 / determinant, 0.0, 2.0 / determinant])
