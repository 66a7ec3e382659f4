"""Tests on a JSBSim flight with planted sensor errors: they are recovered within their
intervals, and no other error is found."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.consistency.output_error.estimation import solve
from aerodb.consistency.output_error.reconstruction import reconstruct
from aerodb.consistency.plan import ReconstructionPlan
from aerodb.consistency.sensors.expected import detect_faults
from aerodb.consistency.verdict import judge
from aerodb.tasks.steps import load_consistent
from aerodb.tasks.workspace_access import access_workspace
from aerodb.vehicle import Accuracy

pytest.importorskip("jsbsim")

from tests.support.golden import estimated, same
from tests.support.jsbsim_records import NOISE, WIND, flown, measured_record  # needs jsbsim

ERRORS = {
    "ax_bias": 0.05, "ay_bias": -0.04, "az_bias": 0.1,
    "p_bias": 0.002, "q_bias": -0.001, "r_bias": 0.0015,
    "alpha_scale": 0.08, "alpha_bias": 0.01, "alpha_delay": 0.03,
    "beta_bias": -0.008, "beta_scale": -0.05, "beta_delay": 0.04,
    "V_scale": 0.02, "qbar_scale": 0.1019, "air_data_x": 0.4,
}  # fmt: skip
PLANTED = {**ERRORS, **WIND}
STATES = ("u", "v", "w", "phi", "theta", "psi")
ARM = (3.0, 0.0, 0.2)


@pytest.fixture(scope="module")
def flight(tmp_path_factory):
    return flown(tmp_path_factory.mktemp("jsbsim"))


def _record(flight, errors=ERRORS, seed=1, **how):
    return measured_record(flight, errors, np.random.default_rng(seed), arm=ARM, **how)


def _solve(record, free=tuple(PLANTED), **how):
    return reconstruct([record], free, initial=STATES, **how)


def _found(result):
    """Estimates by name, without those of first states."""
    return {
        entry.parameter.name: entry
        for entry in result.estimates
        if entry.parameter.kind != "initial"
    }


def test_every_planted_error_comes_back_without_noise(flight):
    """Biases, scales, wind and boom to 2 % of themselves; delays to .7 ms, half the step at which
    JSBSim integrates."""
    result = _solve(_record(flight, noise=1e-6))
    for name, entry in _found(result).items():
        tolerance = {"abs": 7.5e-4} if name.endswith("_delay") else {"rel": 0.02}
        assert entry.value == pytest.approx(PLANTED[name], **tolerance), name


@pytest.mark.campaign
def test_intervals_cover_the_truth(flight):
    """95 % intervals under white noise of all sensors, inertial ones included."""
    inside = []
    for seed in range(300):
        found = _found(_solve(_record(flight, seed=5000 + seed)))
        inside.append(
            [
                abs(found[name].value - value) < 1.96 * found[name].standard_error
                for name, value in PLANTED.items()
            ]
        )
    shares = np.mean(inside, axis=0)
    assert 0.92 <= shares.mean() <= 0.98
    assert shares.min() >= 0.90


def test_one_noisy_flight_gives_what_it_always_gave(flight):
    """Estimates and their standard errors under white noise of all sensors."""
    result = _solve(_record(flight, seed=5000))
    known = [
        ("ax_bias", 0.0492, 0.000849),
        ("ay_bias", -0.041, 0.00075),
        ("az_bias", 0.0995, 0.000477),
        ("p_bias", 0.00199, 1.18e-05),
        ("q_bias", -0.000991, 1.19e-05),
        ("r_bias", 0.0015, 1.1e-05),
        ("alpha_scale", 0.0834, 0.00785),
        ("alpha_bias", 0.00982, 0.000139),
        ("alpha_delay", 0.0335, 0.00368),
        ("beta_bias", -0.00823, 0.000195),
        ("beta_scale", -0.0498, 0.00132),
        ("beta_delay", 0.042, 0.00163),
        ("V_scale", 0.0198, 0.000365),
        ("qbar_scale", 0.102, 0.000764),
        ("air_data_x", 0.299, 0.08),
        ("wind_north", 5.01, 0.0133),
        ("wind_east", -7.01, 0.015),
    ]
    assert same(estimated(result.estimates, PLANTED), known)


def test_nothing_is_found_where_nothing_is_wrong(flight):
    """Sixteen errors sought in a flawless record: none stands out by four standard errors, and the
    verdict is good."""
    record = _record(flight, {})
    result = _solve(record)
    for name, entry in _found(result).items():
        assert abs(entry.value - WIND.get(name, 0.0)) < 4 * entry.standard_error, name
    verdict = judge(result, "jsbsim", Accuracy(), detect_faults(record))
    assert verdict.word == "good", verdict.reasons


def test_a_dynamic_pressure_error_is_found_as_such(flight):
    """10.19 % too much on qbar, V right: the scale of qbar says so and all rivals stay at zero. Not
    sought, it is refused."""
    record = _record(flight, {"qbar_scale": 0.1019})
    rivals = ("V_scale", "alpha_scale", "ax_bias", "az_bias", "air_data_x")
    result = _solve(record, (*rivals, "qbar_scale", "alpha_bias", "q_bias", *WIND))
    entry = result["qbar_scale"]
    assert entry.value == pytest.approx(0.1019, abs=3 * entry.standard_error)
    assert entry.standard_error < 2e-3
    for name in rivals:
        assert abs(result[name].value) < 3.5 * result[name].standard_error, name
    verdict = judge(_solve(record, ("ax_bias", "az_bias", "q_bias", *WIND)), "jsbsim", Accuracy())
    assert verdict.word == "rejected"
    assert any(reason.startswith("qbar remains") for reason in verdict.reasons)


def _with_gaps(record, rng):
    """Two thirds of every output lost, in stretches of a second."""
    lost = np.repeat(rng.random(-(-len(record.inputs) // 50)) < 2 / 3, 50)[: len(record.inputs)]
    return replace(
        record,
        outputs={name: np.where(lost, np.nan, values) for name, values in record.outputs.items()},
    )


def _with_outliers(record, rng):
    """Every fiftieth output sample off by thirty times its noise."""
    found = {}
    for name, values in record.outputs.items():
        wild = rng.random(len(values)) < 0.02
        found[name] = values + wild * 30 * NOISE[name] * rng.choice([-1.0, 1.0], len(values))
    return replace(record, outputs=found)


SPOILED = {
    "noise": lambda record, rng, louder: louder,
    "gaps": lambda record, rng, louder: _with_gaps(record, rng),
    "outliers": lambda record, rng, louder: _with_outliers(record, rng),
}


@pytest.mark.parametrize("how", SPOILED)
def test_what_spoils_a_record_widens_the_intervals(flight, how):
    """Not the error beyond them: noise of three times the size, gaps, outliers."""
    clean = _record(flight)
    spoiled = SPOILED[how](clean, np.random.default_rng(2), _record(flight, noise=3.0))
    before, after = _found(_solve(clean)), _found(_solve(spoiled))
    for name in ("alpha_scale", "beta_scale", "V_scale", "qbar_scale", "air_data_x"):
        assert after[name].standard_error > 1.3 * before[name].standard_error, name
    miss = np.array(
        [
            (after[name].value - value) / after[name].standard_error
            for name, value in PLANTED.items()
        ]
    )
    assert np.abs(miss).max() < 4.0
    assert np.sqrt(np.mean(miss**2)) < 1.6


def test_what_the_flight_cannot_tell_is_not_told(flight):
    """Without a velocity over the earth no wind; V and qbar scaled alike with the wind; the first
    heading and a heading bias: the standard error of each is what its prior leaves, and no estimate
    of the others is further off than its own."""
    channels = ("V", "alpha", "beta", "phi", "theta", "psi", "qbar")
    record = _record(flight, {}, channels=channels)
    free = ("ax_bias", "q_bias", "psi_bias", "wind_north", "wind_east", "wind_down")
    plan = ReconstructionPlan(free, STATES, {}, ())
    result = solve([record], plan)
    for name in ("wind_north", "wind_east", "psi_bias"):
        label = name if name == "psi_bias" else f"{name}[jsbsim]"
        assert result[label].standard_error > 0.5 * plan.priors[name], name
    for entry in result.estimates:
        name = entry.parameter.name
        if name in PLANTED and name not in WIND:
            assert abs(entry.value) < 4 * entry.standard_error, name


def test_a_straight_flight_does_not_tell_the_wind_from_airspeed(flight):
    """A few seconds of one heading, no vanes: the scale of V and the wind along trade off, the wind
    across is unseen. Their standard errors say so; over the whole flight, which turns, the same
    channels tell all three."""
    channels = ("V", "phi", "theta", "psi", "velocity_north", "velocity_east", "velocity_down")
    record = _record(flight, {}, channels=channels)
    free = ("V_scale", "wind_north", "wind_east")
    straight = slice(0, 60)
    short = replace(
        record,
        inputs=record.inputs[straight],
        outputs={name: values[straight] for name, values in record.outputs.items()},
        density=None,
    )
    told, whole = _found(_solve(short, free)), _found(_solve(record, free))
    assert set(whole) == set(free)
    for name in free:
        assert whole[name].standard_error < (0.006 if name == "V_scale" else 0.4), name
        if name in told:
            assert told[name].standard_error > 5 * whole[name].standard_error, name
            assert abs(told[name].value - WIND.get(name, 0.0)) < 4 * told[name].standard_error, name


def test_a_fast_flight_over_the_round_earth_shows_no_sideslip_error(tmp_path, monkeypatch):
    """A 737 banks at 105 to 129 m/s over JSBSim's WGS-84 earth, its instruments without error: over a flat
    earth its vane was given .0015 rad of bias, four standard errors, and its gyro the curvature."""
    from tests.campaigns import runs
    from tests.campaigns.fleet import airframe

    monkeypatch.setattr(runs, "noise_of", lambda *_: {})
    ready = runs.prepared(
        airframe("737"), "declared", [0], 1, tmp_path / "flights", tmp_path / "cache"
    )
    (id,) = ready.flights
    access = access_workspace(str(ready.workspace))
    document = load_consistent(access, access.catalogue.flight(id), "test").document
    found = {each["parameter"]: each["value"] for each in document["estimates"]}
    assert document["earth"] == "flat"
    assert abs(found["beta_bias"]) < 5e-5
    assert abs(found["q_bias"]) < 1e-6
    assert abs(found["az_bias"]) < 5e-4
