"""The equations of motion as a model: derivatives, biases, delays and factors of simulated flights
are found again; its rates and outputs are those of the simulation."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.estimation import output_error
from aerodb.identification import flight_dynamics
from aerodb.simulation import simulate, with_feedback
from tests.support.flying_increments import NOISE, TRUTH, light_aircraft, stretches

STATES = ("V", "alpha", "beta", "p", "q", "r", "phi", "theta")
PLANTED = {f"estimate_{axis}_{k}_{j}": value
           for k, (axis, own) in enumerate(TRUTH.items())
           for j, value in enumerate(own.values())}  # fmt: skip


@pytest.fixture(scope="module")
def flown():
    return stretches(np.random.default_rng(11), count=2, seconds=14.0)


def wrong_model(**more):
    return light_aircraft(
        {axis: {name: 0.75 * value for name, value in own.items()} for axis, own in TRUTH.items()},
        **more,
    )


def test_derivatives_of_the_database_are_found_in_flights(flown):
    model = wrong_model()
    dynamics, records = flight_dynamics(model, flown, tuple(model.parameters))
    fit = output_error(dynamics, records)
    assert fit.converged
    for name, value in PLANTED.items():
        assert abs(fit[name].value - value) < 3.5 * fit[name].standard_error
        assert fit[name].standard_error < 0.05 * abs(value)
    for name, sigma in NOISE.items():
        assert fit.noise[name] == pytest.approx(sigma, rel=0.12)


def half_a_sample_later(values, whole, before):
    """Keys' cubic convolution half-way between samples, weights (-1, 9, 9, -1)/16, `whole` samples
    and a half late; before the first sample the values of `before` (time in samples)."""
    n = len(values)
    place = np.arange(n) - whole
    padded = np.concatenate([[2.0 * values[0] - values[1]], values])
    at = np.maximum(place, 1)
    sum_of_four = np.array([-1.0, 9.0, 9.0, -1.0]) @ [padded[at + j - 1] for j in range(4)] / 16.0
    return np.where(place >= 1, sum_of_four, before(place - 0.5))


def test_delays_biases_scales_positions_and_a_factor(flown):
    """Outputs are moved by known amounts; the truth of everything else is held."""
    noiseless = stretches(np.random.default_rng(1), 1, 12.0, noise=dict.fromkeys(NOISE, 0.0))
    (stretch,) = noiseless.values()
    position = (0.8, -0.1, 0.3)
    model = light_aircraft(factors={"Cn": "yaw_factor"}, Cn="-0.03*p_hat")
    planted = {
        "delay_alpha": 0.1, "delay_delta_elevator": 0.06, "bias_q[flight 0]": 0.01,
        "scale_beta": 0.05, "yaw_factor": 1.5,
    }  # fmt: skip
    chosen = {
        "outputs": ("alpha", "beta", "q", "r", "az"), "initial": (), "biases": ("q",),
        "scales": ("beta",), "delays": ("alpha", "delta_elevator"), "accelerometer": position,
    }  # fmt: skip
    dynamics, records = flight_dynamics(model, noiseless, ("yaw_factor",), **chosen)
    truth = {**dynamics.parameters.values(dynamics.parameters.start()), **planted}
    true = dynamics.simulated({name: np.asarray(v) for name, v in truth.items()}, records[0])
    plain = dynamics.simulated(dynamics.parameters.values(dynamics.parameters.start()), records[0])
    elevator = stretch.series["delta_elevator"]
    late = half_a_sample_later(elevator, 1, lambda place: elevator[0])
    run = simulate(
        model, stretch.time, stretch.start, {**stretch.series, "delta_elevator": late},
        parameters={"yaw_factor": 1.5},
    )  # fmt: skip
    rates = [run.channels[name][:, 0] for name in ("p", "q", "r")]
    turning = np.stack([run.channels[f"{name}dot"][:, 0] for name in "pqr"], axis=1)
    swung = np.cross(turning, position)
    pulled = np.cross(np.stack(rates, axis=1), np.cross(np.stack(rates, axis=1), position))
    alpha = run.channels["alpha"][:, 0]
    expected = {
        "alpha": half_a_sample_later(alpha, 2, lambda place: alpha[0] + place * np.diff(alpha)[0]),
        "beta": 1.05 * run.channels["beta"][:, 0],
        "q": run.channels["q"][:, 0] + 0.01,
        "r": run.channels["r"][:, 0],
        "az": run.channels["az"][:, 0] + swung[:, 2] + pulled[:, 2],
    }
    for j, name in enumerate(dynamics.outputs):
        np.testing.assert_allclose(true[:, j, 0], expected[name], atol=1e-9)
        assert np.abs(true[:, j, 0] - plain[:, j, 0]).max() > 1e-4
    rng = np.random.default_rng(2)
    noisy = true[:, :, 0] + rng.standard_normal(true.shape[:2]) * [1e-3, 1e-3, 1e-3, 1e-3, 0.05]
    record = type(records[0])(
        "flight 0",
        records[0].time,
        records[0].inputs,
        dict(zip(dynamics.outputs, noisy.T, strict=True)),
    )
    fit = output_error(dynamics, [record])
    for name, value in planted.items():
        assert abs(fit[name].value - value) < 3.5 * fit[name].standard_error
        assert fit[name].standard_error < 0.2 * value


def test_its_rates_are_the_slopes_of_what_it_flies(flown):
    dynamics, records = flight_dynamics(light_aircraft(), flown, ())
    record = records[0]
    values = dynamics.parameters.values(dynamics.parameters.start())
    run = dynamics.simulated(values, record)[:, :, 0]
    for sample in (110, 145, 240):
        state = run[sample, :8, None]
        slope = (run[sample + 1, :8] - run[sample - 1, :8]) / (2.0 * record.step)
        rates = dynamics.rates(values, record, sample, np.repeat(state, 2, axis=1))
        scale = np.abs(np.gradient(run[:, :8], record.step, axis=0)).max(axis=0)
        np.testing.assert_allclose(rates[:, 1] / scale, slope / scale, atol=0.01)
        np.testing.assert_allclose(
            dynamics.observed(values, record, sample, state)[:, 0], run[sample], atol=2e-3
        )


def test_runs_side_by_side_are_those_of_each(flown):
    dynamics, records = flight_dynamics(light_aircraft(), flown, tuple(PLANTED))
    vector = dynamics.parameters.start()
    lanes = vector[:, None] * np.linspace(0.9, 1.1, 3)
    together = dynamics.simulated(dynamics.parameters.values(lanes), records[1])
    for lane in range(3):
        alone = dynamics.simulated(dynamics.parameters.values(lanes[:, lane]), records[1])
        np.testing.assert_allclose(together[:, :, lane], alone[:, :, 0], rtol=1e-9, atol=1e-9)


def test_unknown_names_are_refused(flown):
    for wrong in (
        {"unknown": ("Cm_alpa",)},
        {"unknown": (), "initial": ("u",)},
        {"unknown": (), "biases": ("lift",)},
        {"unknown": (), "delays": ("delta_flap",)},
    ):
        with pytest.raises(InputError, match="no "):
            flight_dynamics(light_aircraft(), flown, **wrong)


def test_loads_hold_a_motion_at_the_flights():
    """A model that lacks a quarter of each lateral derivative drifts away in roll, unless loads
    bring it back; the references are the flown motion."""
    quiet = dict.fromkeys(NOISE, 0.0)
    (stretch,) = stretches(np.random.default_rng(11), 1, 14.0, noise=quiet).values()
    mass, rolling, yawing = (stretch.series[name][0] for name in ("mass", "Ixx", "Izz"))
    gains = {
        ("moment_x", "p"): 20.0 * rolling,
        ("moment_x", "phi"): 100.0 * rolling,
        ("moment_z", "r"): 10.0 * yawing,
        ("force_y", "beta"): 2.0 * mass * stretch.flown["V"][0],
    }
    references = {f"reference_{name}": stretch.flown[name] for name in ("beta", "p", "r", "phi")}
    free = simulate(wrong_model(), stretch.time, stretch.start, stretch.series)
    held = simulate(
        with_feedback(wrong_model(), gains), stretch.time, stretch.start,
        {**stretch.series, **references},
    )  # fmt: skip
    drift, left = (
        np.abs(run.channels["phi"][:, 0] - stretch.flown["phi"]).max() for run in (free, held)
    )
    assert drift > 0.02  # rad
    assert left < 0.15 * drift
    with pytest.raises(InputError, match="no feedback of 'psi'"):
        with_feedback(wrong_model(), {("moment_x", "psi"): 1.0})
