"""Tests of the further sensor models: exact derivatives, recovery of planted errors, and standard
errors of those that cannot be recovered."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.consistency.kinematics import INPUTS, STATES
from aerodb.consistency.output_error.estimation import solve
from aerodb.consistency.output_error.reconstruction import reconstruct
from aerodb.consistency.plan import ReconstructionPlan
from aerodb.consistency.sensors import FlightRecord, predict_outputs
from aerodb.consistency.sensors.models import Installation
from aerodb.consistency.sensors.parameters import (
    FURTHER_OUTPUTS,
    OUTPUTS,
    PER_FLIGHT,
    known_names,
    parameter,
)
from aerodb.errors import InputError
from aerodb.physics.geodesy import Earth
from tests.support.golden import estimated, same
from tests.support.instrumented_path import NOISE, instrumented
from tests.support.simulated_path import GRAVITY

ALL = (*OUTPUTS, *FURTHER_OUTPUTS)
PRESSURES = tuple(name for name in ALL if name not in ("alpha", "beta", "height_above_ground"))
FIRST = ("u", "v", "w", "phi", "theta", "psi", "north", "east", "altitude")
PLANTED = {
    "gps_x": 0.5, "gps_y": -0.2, "gps_z": 0.3, "gps_delay": 0.12, "air_data_roll": 0.05,
    "static_port_error": 0.0925, "total_port_error": -0.02, "terrain_elevation": 310.0,
    "probe_alpha_offset": 0.01, "probe_alpha_slope": 0.08, "probe_alpha_cross": 0.4,
    "probe_beta_offset": -0.02, "probe_beta_slope": -0.05, "wind_north": 5.0, "wind_east": -3.0,
    "ax_bias": 0.05, "ay_bias": -0.04, "az_bias": 0.1,
    "p_bias": 0.002, "q_bias": -0.001, "r_bias": 0.0015,
}  # fmt: skip


def _value(result, name, flight="flight"):
    return result[f"{name}[{flight}]" if parameter(name).kind in PER_FLIGHT else name]


@pytest.mark.parametrize("earth", [None, Earth(0.85, 0.2, 40.0)], ids=["flat", "rotating"])
def test_derivatives_are_exact(earth):
    """Every sensor by every parameter, at a point where all of them act: central differences of the
    sensor itself."""
    rng = np.random.default_rng(1)
    base = instrumented(rng, {}, ALL, seconds=0.8)
    how = replace(
        base.installation,
        boom=(0.1, -0.05, 0.08),
        upwash=(0.1, -0.05),
        flank=True,
        beam=(0.2, -0.1),
    )
    record = replace(base, installation=how, earth=earth)
    names = [name for name in known_names() if not name.startswith("initial_")]
    items = [
        *(parameter(name) for name in names),
        *(parameter(f"initial_{state}") for state in STATES),
    ]
    at = {item.name: 0.1 * item.size * rng.uniform(0.5, 1.0) for item in items}
    at["gps_delay"] = 0.013  # a cubic between samples bends at whole ones
    first = np.array([60.0, 1.0, 4.0, 0.3, 0.15, 0.4, 20.0, 30.0, 900.0])

    def shown(values):
        start = first + [values[f"initial_{state}"] for state in STATES]
        return predict_outputs(record, values, start, items)

    response = shown(at)
    for column, item in enumerate(items):
        tiny = 1e-4 * item.size
        ahead, behind = (shown({**at, item.name: at[item.name] + sign * tiny}) for sign in (1, -1))
        for name in ALL:
            slope = (ahead.outputs[name] - behind.outputs[name]) / (2 * tiny)
            found = response.slopes[name][:, column]
            scale = np.abs(slope).max() + NOISE[name] / item.size
            assert np.abs(found - slope).max() < 2e-6 * scale, (name, item.name)
        air = (ahead.air - behind.air) / (2 * tiny)
        assert np.abs(response.air_slopes[:, :, column] - air).max() < 1e-6 * (
            np.abs(air).max() + 1.0
        ), item.name


def test_planted_errors_come_back_without_noise():
    """Plain formulas of their own made the record; what remains is the interpolation of samples at
    50 Hz."""
    planted = {**PLANTED, "probe_alpha_square": 0.3, "probe_alpha_bend": -0.1, "air_data_x": 0.3}
    result = reconstruct(
        [instrumented(np.random.default_rng(0), planted, PRESSURES, noise=1e-6)],
        tuple(planted),
        initial=FIRST,
    )
    for name, value in planted.items():
        assert _value(result, name).value == pytest.approx(value, rel=6e-3), name


def test_the_phoenix_dynamic_pressure_error_is_one_static_port():
    """003, eq. 5: qbar = 1.101907 qbar_m for a static port in error: one parameter explains V, qbar
    and pressure altitude."""
    planted = {"static_port_error": 1.0 - 1.0 / 1.101907, "wind_north": 4.0, "wind_east": 2.0}
    channels = (
        "V",
        "alpha",
        "beta",
        "qbar",
        "phi",
        "theta",
        "psi",
        *ALL[7:13],
        "pressure_altitude",
    )
    record = instrumented(np.random.default_rng(3), planted, channels)
    free = (
        "static_port_error",
        "total_port_error",
        "pressure_altitude_bias",
        "wind_north",
        "wind_east",
        "alpha_bias",
    )
    result = reconstruct([record], free, initial=FIRST)
    correction = 1.0 / (1.0 + result["total_port_error"].value - result["static_port_error"].value)
    assert correction == pytest.approx(1.101907, abs=0.004)
    for name, value in {
        **planted,
        "total_port_error": 0.0,
        "pressure_altitude_bias": 0.0,
        "alpha_bias": 0.0,
    }.items():
        found = _value(result, name)
        assert abs(found.value - value) < 4 * found.standard_error, name
    for name in ("V", "qbar", "pressure_altitude"):
        assert result.noise[name] == pytest.approx(NOISE[name], rel=0.05), name


@pytest.mark.campaign
def test_intervals_cover_the_truth():
    """95 % intervals of antenna, delay, boom, ports, probe calibration, terrain, wind and biases,
    white noise of all sensors."""
    inside = []
    for seed in range(300):
        record = instrumented(np.random.default_rng(1000 + seed), PLANTED, PRESSURES, step=0.04)
        result = reconstruct([record], tuple(PLANTED), initial=FIRST)
        found = [_value(result, name) for name in PLANTED]
        inside.append(
            [abs(e.value - PLANTED[e.parameter.name]) < 1.96 * e.standard_error for e in found]
        )
    share = np.mean(inside)
    assert 0.92 <= share <= 0.98
    assert np.min(np.mean(inside, axis=0)) >= 0.90


def test_one_noisy_flight_gives_what_it_always_gave():
    """Estimates and their standard errors under white noise of all sensors."""
    record = instrumented(np.random.default_rng(1000), PLANTED, PRESSURES, step=0.04)
    result = reconstruct([record], tuple(PLANTED), initial=FIRST)
    known = [
        ("gps_x", 0.604, 0.0611),
        ("gps_y", -0.221, 0.0216),
        ("gps_z", 0.261, 0.02),
        ("gps_delay", 0.121, 0.000952),
        ("air_data_roll", 0.0505, 0.0024),
        ("static_port_error", 0.0922, 0.000178),
        ("total_port_error", -0.0207, 0.000347),
        ("terrain_elevation", 310.0, 0.0382),
        ("probe_alpha_offset", 0.0101, 0.000264),
        ("probe_alpha_slope", 0.0787, 0.00307),
        ("probe_alpha_cross", 0.288, 0.106),
        ("probe_beta_offset", -0.0203, 0.000238),
        ("probe_beta_slope", -0.0504, 0.00346),
        ("wind_north", 4.99, 0.00863),
        ("wind_east", -3.01, 0.00796),
        ("ax_bias", 0.0493, 0.00163),
        ("ay_bias", -0.0394, 0.00133),
        ("az_bias", 0.0996, 0.0013),
        ("p_bias", 0.00203, 2.44e-05),
        ("q_bias", -0.000999, 2.41e-05),
        ("r_bias", 0.00149, 1.91e-05),
    ]
    assert same(estimated(result.estimates, PLANTED), known)


def test_two_flights_have_their_own_ground():
    shared = {"gps_delay": 0.1, "q_bias": 0.001}
    one, two = (
        instrumented(
            np.random.default_rng(k),
            {**shared, "terrain_elevation": ground},
            ALL[4:],
            seconds=15.0,
            start=t,
            name=name,
        )
        for k, ground, t, name in ((1, 200.0, 0.0, "one"), (2, 350.0, 30.0, "two"))
    )
    drop = ("probe_dp_alpha", "probe_dp_beta")
    records = [
        replace(r, outputs={name: x for name, x in r.outputs.items() if name not in drop})
        for r in (one, two)
    ]
    result = reconstruct(records, (*shared, "terrain_elevation"), initial=FIRST)
    for flight, ground in (("one", 200.0), ("two", 350.0)):
        found = _value(result, "terrain_elevation", flight)
        assert abs(found.value - ground) < 4 * found.standard_error < 4.0


CONFUSED = {
    "ports, V and qbar alone": (
        ("V", "qbar", *ALL[4:13]),
        ("total_port_error", "V_scale", "qbar_scale", "static_port_error"),
    ),
    "boom and vane": (
        ("V", "alpha", "beta", *ALL[4:13]),
        ("air_data_pitch", "alpha_bias", "air_data_yaw", "beta_bias"),
    ),
    "probe and boom": (
        PRESSURES,
        ("probe_alpha_offset", "air_data_pitch", "probe_beta_offset", "air_data_yaw", "wind_down"),
    ),
    "heading without the earth": (
        ("V", "alpha", "beta", "phi", "theta", "psi"),
        ("psi_bias", "wind_north", "q_bias"),
    ),
    "ground and laser": (
        (*ALL[:13], "slant_range"),
        ("terrain_elevation", "slant_range_bias", "altitude_bias"),
    ),
}


@pytest.mark.heavy
@pytest.mark.parametrize("case", CONFUSED)
def test_what_cannot_be_observed_is_never_reported_with_a_small_error(case, trials):
    """Several explanations of one mismatch, all of them true at once, of usual size: what the
    flight does not tell apart keeps the uncertainty of its prior, and no estimate is further from
    the truth than its standard error says."""
    channels, free = CONFUSED[case]
    distance, vague = [], set()
    for seed in range(trials(1, 6)):
        rng = np.random.default_rng(seed)
        planted = {name: 0.4 * parameter(name).size * rng.standard_normal() for name in free}
        record = instrumented(rng, planted, channels, step=0.04, seconds=30.0)
        first = [state for state in FIRST if state in channels or state in "uvw"]
        result = solve([record], ReconstructionPlan(free, tuple(first), {}, ()))
        for estimate in result.estimates:
            if estimate.parameter.name in planted:
                distance.append(
                    abs(estimate.value - planted[estimate.parameter.name]) / estimate.standard_error
                )
                vague |= (
                    {estimate.parameter.name}
                    if estimate.standard_error > 0.5 * estimate.parameter.size
                    else set()
                )
    assert vague
    assert np.max(distance, initial=0.0) < 3.5


def test_straight_flight_says_nothing_of_arms_delays_and_mounts():
    """Constant velocity, no rotation: these keep the standard errors of their priors."""
    rng = np.random.default_rng(4)
    free = (
        "gps_x",
        "gps_y",
        "gps_z",
        "gps_delay",
        "air_data_x",
        "alpha_scale",
        "alpha_bias",
        "alpha_delay",
        "beta_delay",
    )
    plan = ReconstructionPlan(free, FIRST, {}, ())
    result = solve([_straight(rng)], plan)
    for name in set(free) - {"alpha_bias"}:
        assert result[name].standard_error > 0.9 * plan.priors[name], name
        assert abs(result[name].value) < result[name].standard_error, name
    # a scale of usual size would show as a bias of that share of alpha: so uncertain is the bias
    assert result["alpha_bias"].standard_error == pytest.approx(0.2 * 0.06, rel=0.1)


def _straight(rng):
    time = 0.04 * np.arange(500)
    alpha, speed, channels = 0.06, 60.0, ("V", "alpha", "beta", *ALL[4:13])
    still = {"theta": alpha, "V": speed, "alpha": alpha, "velocity_north": speed, "altitude": 900.0}
    values = {name: np.full(len(time), still.get(name, 0.0)) for name in (*channels, *INPUTS)}
    values["north"] = speed * time
    values["ax"], values["az"] = (
        values["ax"] + GRAVITY * np.sin(alpha),
        values["az"] - GRAVITY * np.cos(alpha),
    )
    noisy = {
        name: values[name] + NOISE[name] * rng.standard_normal(len(time))
        for name in channels
        if name != "qbar"
    }
    inputs = np.column_stack([values[name] for name in INPUTS]) + 1e-4 * rng.standard_normal(
        (len(time), 6)
    )
    return FlightRecord(
        "straight", 0.04, inputs, noisy, "straight", (3.0, 0.0, 0.2), gravity=GRAVITY
    )


def test_what_sensors_need_is_asked_for():
    record = instrumented(
        np.random.default_rng(1), {}, ("V", "phi", "theta", "psi", "probe_dp_alpha"), seconds=5.0
    )
    with pytest.raises(InputError, match="without a calibration"):
        replace(record, installation=Installation())
    with pytest.raises(InputError, match="probe_dp_alpha without density"):
        replace(record, density=None)
    plain = replace(
        record,
        outputs={name: x for name, x in record.outputs.items() if name != "probe_dp_alpha"},
        density=None,
    )
    with pytest.raises(InputError, match="ports without density"):
        reconstruct([plain], ("static_port_error",))
