"""Tests of flight-path reconstruction on analytic flights with planted sensor errors."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.consistency.kinematics import integrate
from aerodb.consistency.output_error.estimation import solve
from aerodb.consistency.output_error.reconstruction import reconstruct
from aerodb.consistency.plan import ReconstructionPlan
from aerodb.consistency.sensors import FlightRecord
from aerodb.consistency.sensors.expected import detect_faults, expected_inputs
from aerodb.consistency.verdict import judge
from aerodb.errors import InputError, UnknownNameError
from aerodb.vehicle import Accuracy
from tests.support.golden import estimated, same
from tests.support.simulated_path import NOISE, simulated, truth

PLANTED = {
    "ax_bias": 0.05, "ay_bias": -0.04, "az_bias": 0.1,
    "p_bias": 0.002, "q_bias": -0.001, "r_bias": 0.0015,
    "alpha_scale": 0.08, "alpha_bias": 0.01, "alpha_delay": 0.03,
    "beta_bias": -0.008, "beta_scale": -0.05, "beta_delay": 0.04,
    "wind_north": 6.0, "wind_east": -4.0, "V_scale": 0.02, "qbar_scale": 0.1019, "air_data_x": 0.4,
}  # fmt: skip
STATES = ("u", "v", "w", "phi", "theta", "psi")
BOOM = (3.0, 0.0, 0.2)


def _solve(record, free=tuple(PLANTED), **how):
    return reconstruct(
        [record] if isinstance(record, FlightRecord) else record, free, initial=STATES, **how
    )


def test_motion_is_that_of_the_formulas():
    """Rates and specific force of the formulas, integrated, give attitude and velocity over the
    earth again."""
    time = np.arange(0.0, 30.0, 0.02)
    exact = truth(time)
    inputs = np.column_stack([exact[name] for name in ("ax", "ay", "az", "p", "q", "r")])
    air = exact["V"] * np.stack(
        [
            np.cos(exact["beta"]) * np.cos(exact["alpha"]),
            np.sin(exact["beta"]),
            np.cos(exact["beta"]) * np.sin(exact["alpha"]),
        ]
    )
    first = np.r_[air[:, 0], exact["phi"][0], exact["theta"][0], exact["psi"][0], 0.0, 0.0, 100.0]
    states, _ = integrate(inputs, 0.02, first, 9.80665)
    for row, name in ((3, "phi"), (4, "theta"), (5, "psi")):
        assert np.abs(states[row] - exact[name]).max() < 2e-4
    assert np.abs(states[:3] - air).max() < 0.02
    climbed = -np.cumsum(exact["velocity_down"][1:] + exact["velocity_down"][:-1]) * 0.01
    assert np.abs(states[8, 1:] - 100.0 - climbed).max() < 0.1


@pytest.mark.parametrize(
    ("between", "lost"), [("cubic", 2e-5), ("linear", (3.0 * np.pi * 0.02) ** 2 / 12.0)]
)
def test_an_oscillation_keeps_its_size_between_samples(between: str, lost: float):
    """Pitch of 1.5 Hz at 50 samples a second, free of forces: straight lines lose (w h)^2/12 of it."""
    time, omega, size = np.arange(0.0, 20.0, 0.02), 3.0 * np.pi, 0.05
    inputs = np.zeros((len(time), 6))
    inputs[:, 4] = size * omega * np.cos(omega * time)
    states, _ = integrate(inputs, 0.02, np.zeros(9), 0.0, between=between)
    wave = np.sin(omega * time)
    share = float(states[4] @ wave) / float(wave @ wave) / size
    assert 1.0 - share == pytest.approx(lost, rel=0.02, abs=1e-5)


def test_sensitivities_are_derivatives():
    """Every column of the joint sensitivities equals a central difference of the integration
    itself."""
    rng = np.random.default_rng(3)
    inputs = np.column_stack([rng.normal([0, 0, -9.8], 1, (100, 3)), rng.normal(0, 0.2, (100, 3))])
    first = np.array([50.0, 1.0, 3.0, 0.1, 0.2, 0.3, 0.0, 0.0, 100.0])
    kind = np.array([-1] * 9 + list(range(12)))
    directions = np.hstack([np.eye(9), np.zeros((9, 12))])
    bias, scale, tiny = (
        np.array([0.1, -0.2, 0.3, 0.01, -0.02, 0.03]),
        np.linspace(0.01, 0.06, 6),
        1e-6,
    )

    def run(change):
        gain = 1.0 / (1.0 + scale + change[15:])
        return integrate((inputs - bias - change[9:15]) * gain, 0.02, first + change[:9], 9.81)[0]

    gain = 1.0 / (1.0 + scale)
    _, slopes = integrate((inputs - bias) * gain, 0.02, first, 9.81, None, directions, kind, gain)
    for column in range(21):
        step = tiny * np.eye(21)[column]
        difference = (run(step) - run(-step)) / (2 * tiny)
        np.testing.assert_allclose(
            slopes[:, :, column], difference, atol=2e-6 * max(1.0, np.abs(difference).max())
        )


def test_planted_errors_come_back_without_noise():
    """What remains without noise is the integration and interpolation error of samples at 50 Hz."""
    result = _solve(simulated(np.random.default_rng(0), PLANTED, arm=BOOM, noise=1e-6))
    for name, value in PLANTED.items():
        assert result[
            name if not name.startswith("wind") else f"{name}[simulated]"
        ].value == pytest.approx(value, rel=5e-3), name


def test_a_dynamic_pressure_error_is_found_as_such():
    """10.19 % on qbar, none on V: the scale of qbar says so, V's and the wind's intervals hold
    zero; unmended it is rejected."""
    record = simulated(np.random.default_rng(8), {"qbar_scale": 0.1019})
    result = _solve(
        record,
        (
            "ax_bias",
            "az_bias",
            "q_bias",
            "qbar_scale",
            "V_scale",
            "alpha_bias",
            "wind_north",
            "wind_east",
        ),
    )
    assert result["qbar_scale"].value == pytest.approx(0.1019, abs=4e-3)
    for name in ("V_scale", "wind_north[simulated]", "wind_east[simulated]"):
        assert abs(result[name].value) < 3 * result[name].standard_error
    unmended = judge(_solve(record, ("ax_bias", "az_bias", "q_bias")), "simulated", Accuracy())
    assert unmended.word == "rejected"
    assert any(reason.startswith("qbar remains") for reason in unmended.reasons)


@pytest.mark.campaign
def test_intervals_cover_the_truth():
    """95 % intervals under white noise of all sensors, inertial ones included, whose drift
    dominates the biases' error."""
    inside = []
    for seed in range(300):
        result = _solve(simulated(np.random.default_rng(1000 + seed), PLANTED, arm=BOOM))
        planted = [estimate for estimate in result.estimates if estimate.parameter.name in PLANTED]
        inside.append(
            [abs(e.value - PLANTED[e.parameter.name]) < 1.96 * e.standard_error for e in planted]
        )
    share = np.mean(inside)
    assert 0.92 <= share <= 0.98
    assert np.min(np.mean(inside, axis=0)) >= 0.90


def test_one_noisy_flight_gives_what_it_always_gave():
    """Estimates and their standard errors under white noise of all sensors."""
    result = _solve(simulated(np.random.default_rng(1000), PLANTED, arm=BOOM))
    known = [
        ("ax_bias", 0.0511, 0.00107),
        ("ay_bias", -0.04, 0.000887),
        ("az_bias", 0.0988, 0.00081),
        ("p_bias", 0.00199, 1.57e-05),
        ("q_bias", -0.000992, 1.67e-05),
        ("r_bias", 0.00149, 1.36e-05),
        ("alpha_scale", 0.0747, 0.00263),
        ("alpha_bias", 0.0105, 0.000197),
        ("alpha_delay", 0.0276, 0.00138),
        ("beta_bias", -0.00786, 0.000123),
        ("beta_scale", -0.0522, 0.00286),
        ("beta_delay", 0.038, 0.00186),
        ("wind_north", 5.99, 0.00729),
        ("wind_east", -4.0, 0.00559),
        ("V_scale", 0.0199, 0.000156),
        ("qbar_scale", 0.102, 0.000287),
        ("air_data_x", 0.401, 0.0346),
    ]
    assert same(estimated(result.estimates, PLANTED), known)


def test_gaps_and_more_noise_widen_the_intervals():
    record = simulated(np.random.default_rng(5), PLANTED, arm=BOOM)
    sparse = {
        name: np.where(np.arange(len(values)) % 4 == 0, values, np.nan)
        for name, values in record.outputs.items()
    }
    full, less = _solve(record), _solve(replace(record, outputs=sparse))
    loud = _solve(simulated(np.random.default_rng(5), PLANTED, arm=BOOM, noise=3.0))
    for name in ("alpha_scale", "beta_scale", "V_scale"):
        assert less[name].standard_error > 1.5 * full[name].standard_error
        assert loud[name].standard_error > 2.0 * full[name].standard_error
        for result in (less, loud):
            assert abs(result[name].value - PLANTED[name]) < 4 * result[name].standard_error


def test_what_cannot_be_separated_keeps_the_width_of_its_prior():
    """Without velocity over the earth nothing tells the wind; a heading bias and the first heading
    are one, and the prior of the former is the narrower one."""
    channels = ("V", "alpha", "beta", "phi", "theta", "psi")
    record = simulated(np.random.default_rng(2), {}, channels=channels)
    plan = ReconstructionPlan(
        ("ax_bias", "q_bias", "wind_north", "wind_east", "psi_bias"), STATES, {}, ()
    )
    result = solve([record], plan)
    for name in ("wind_north", "wind_east"):
        assert result[f"{name}[simulated]"].standard_error > 0.5 * plan.priors[name]
    assert result["psi_bias"].standard_error == pytest.approx(plan.priors["psi_bias"], rel=0.05)
    assert result["initial_psi[simulated]"].standard_error == pytest.approx(
        plan.priors["psi_bias"], rel=0.05
    )
    assert abs(result["q_bias"].value) < 3 * result["q_bias"].standard_error


def test_a_prior_separates_what_the_flight_does_not():
    record = simulated(
        np.random.default_rng(2),
        {"psi_bias": 0.0},
        channels=("V", "alpha", "beta", "phi", "theta", "psi"),
    )
    result = _solve(record, ("q_bias", "psi_bias"), priors={"psi_bias": 0.005})
    assert result["psi_bias"].standard_error == pytest.approx(0.005, rel=0.05)


def test_bounds_hold():
    record = simulated(np.random.default_rng(4), {"alpha_scale": 0.1})
    result = _solve(
        record,
        ("alpha_scale", "alpha_bias", "wind_north", "wind_east"),
        bounds={"alpha_scale": (-0.05, 0.05)},
    )
    assert result["alpha_scale"].value == 0.05
    assert result["alpha_scale"].at_bound


def test_two_flights_share_sensors_and_have_their_own_wind():
    shared = {"p_bias": 0.001, "q_bias": 0.002, "alpha_bias": 0.01}
    first = simulated(
        np.random.default_rng(6), {**shared, "wind_north": 5.0}, name="one", seconds=20.0
    )
    second = simulated(
        np.random.default_rng(7),
        {**shared, "wind_north": -3.0},
        name="two",
        seconds=20.0,
        start=30.0,
    )
    result = _solve([first, second], (*shared, "wind_north", "wind_east"))
    assert result["wind_north[one]"].value == pytest.approx(
        5.0, abs=3 * result["wind_north[one]"].standard_error
    )
    assert result["wind_north[two]"].value == pytest.approx(
        -3.0, abs=3 * result["wind_north[two]"].standard_error
    )
    assert result["alpha_bias"].value == pytest.approx(0.01, abs=1e-3)


def test_alpha_is_reconstructed_without_a_vane():
    """PX4 users have none: attitude, velocity over the earth and airspeed give alpha, with its
    price in standard error."""
    rng = np.random.default_rng(9)
    channels = tuple(name for name in NOISE if name not in ("alpha", "beta", "qbar"))
    planted = {"az_bias": 0.05, "q_bias": 0.001, "wind_north": 4.0, "wind_east": 2.0}
    path = _solve(
        simulated(rng, planted, channels=channels),
        ("ax_bias", "az_bias", "q_bias", "wind_north", "wind_east"),
    ).paths[0]
    error = path.alpha - truth(0.02 * np.arange(len(path.alpha)))["alpha"]
    assert np.rad2deg(np.sqrt(np.mean(error**2))) < 0.5
    assert np.sqrt(np.mean(error**2)) < 3 * path.air_sigma[1].mean()


BROKEN = {
    "p has the wrong sign": lambda u: u * np.array([1, 1, 1, -1, 1, 1]),
    "q is 57 times too large: degrees declared as radians": lambda u: (
        u * np.array([1, 1, 1, 1, np.rad2deg(1), 1])
    ),
    "az lacks gravity": lambda u: u + np.array([0, 0, 9.80665, 0, 0, 0]),
    "az has the wrong sign": lambda u: u * np.array([1, 1, -1, 1, 1, 1]),
    "ay and az are swapped": lambda u: u[:, [0, 2, 1, 3, 4, 5]],
    "q and r are swapped": lambda u: u[:, [0, 1, 2, 3, 5, 4]],
    "r does not change at all": lambda u: u * np.array([1, 1, 1, 1, 1, 0]),
}


@pytest.mark.parametrize("sentence", BROKEN)
def test_blunt_faults_are_named(sentence):
    record = simulated(np.random.default_rng(1), {})
    assert detect_faults(record) == ()
    found = detect_faults(replace(record, inputs=BROKEN[sentence](record.inputs)))
    assert [fault.sentence.startswith(sentence) for fault in found] == [True]


def test_degrees_in_an_attitude_are_named():
    record = simulated(np.random.default_rng(1), {})
    found = detect_faults(
        replace(record, outputs={**record.outputs, "phi": np.rad2deg(record.outputs["phi"])})
    )
    assert found[0].sentence.endswith("degrees declared as radians")


def test_expected_inputs_are_those_of_the_formulas():
    """To the accuracy of differentiated, noisy attitude: a tenth of the motion."""
    record = simulated(np.random.default_rng(1), {}, noise=0.1)
    exact = truth(0.02 * np.arange(len(record.inputs)))
    expected = expected_inputs(record)
    for column, name in enumerate(("ax", "ay", "az", "p", "q", "r")):
        inner = slice(100, -100)
        assert np.std(expected[inner, column] - exact[name][inner]) < 0.2 * np.std(exact[name]), (
            name
        )


def test_bad_input_is_refused():
    record = simulated(np.random.default_rng(1), {})
    with pytest.raises(UnknownNameError, match="did you mean 'alpha_bias'"):
        reconstruct([record], ("alpha_bais",))
    with pytest.raises(InputError, match="unique names"):
        reconstruct([record, record], ("q_bias",))
    with pytest.raises(InputError, match="bank or pitch"):
        reconstruct([replace(record, outputs={"V": record.outputs["V"]})], ("q_bias",))
    with pytest.raises(InputError, match="not finite"):
        replace(
            record,
            inputs=np.where(np.arange(len(record.inputs))[:, None] == 5, np.nan, record.inputs),
        )
    with pytest.raises(InputError, match="no usable sample of alpha"):
        reconstruct(
            [
                replace(
                    record, outputs={**record.outputs, "alpha": np.full(len(record.inputs), np.nan)}
                )
            ],
            ("q_bias",),
        )
