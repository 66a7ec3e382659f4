"""Tests of flight-path reconstruction against published results: F/A-18 HARV (NASA), HFB-320 (DLR),
AP2, and ATTAS (DLR) beyond its published biases (`test_consistency_published`)."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.io import loadmat

from aerodb.consistency.output_error.reconstruction import reconstruct
from aerodb.consistency.sensors.expected import detect_faults
from aerodb.consistency.sensors.navigation import flow_against_velocity, position_against_velocity
from aerodb.consistency.sensors.whiteness import process_noise
from aerodb.consistency.verdict import judge, judge_navigation
from aerodb.vehicle import Accuracy
from tests.support.consistency_records import ATTAS_BIASES, FOOT, attas, harv, hfb320
from tests.support.plain_reconstruction import plain_biases


@pytest.fixture(scope="module")
def three(measured):
    return [attas(measured(f"attas/fAttas{name}.mat")) for name in ("Elv1", "Ail1", "Rud1")]


@pytest.fixture(scope="module")
def freed(three):
    return reconstruct(three, ATTAS_BIASES)


def test_the_plain_loop_agrees(three):
    """The baseline of the bench, written without anything compiled, finds the same biases on the
    shortest record."""
    result = reconstruct(three[:1], ATTAS_BIASES, initial=())
    assert three[0].between == "linear"
    values = np.array([result[name].value for name in ATTAS_BIASES])
    np.testing.assert_allclose(plain_biases(three[:1], iterations=6), values, rtol=1e-3, atol=1e-6)


def test_attas_mismatch_falls_as_published(three):
    """Theta from 3.14 to .11 deg, V from 5.9 to .18 m/s (published .17, from first states that are
    not stated)."""
    result = reconstruct(three, ATTAS_BIASES, initial=())

    def joint(name, kind):
        return np.sqrt(
            np.nanmean(np.concatenate([getattr(path, kind)[name] for path in result.paths]) ** 2)
        )

    assert np.rad2deg(joint("theta", "before")) == pytest.approx(3.14, abs=0.01)
    assert joint("V", "before") == pytest.approx(5.92, abs=0.02)
    assert np.rad2deg(joint("theta", "residuals")) < 0.11
    assert joint("V", "residuals") < 0.19


def test_attas_verdicts(three, freed):
    """Good but for the bank angle of the bank-to-bank record, which biases alone leave .35 deg
    apart."""
    words = {
        record.name: judge(freed, record.flight, Accuracy(), detect_faults(record))
        for record in three
    }
    assert [verdict.word for verdict in words.values()] == ["good", "limited", "good"]
    assert words["fAttasAil1"].reasons == (
        "phi remains 0.35 deg from the reconstructed motion; limit 0.3 deg ([accuracy] attitude, [sensors.phi] noise)",
    )
    assert not any(verdict.process_noise.matters for verdict in words.values())


@pytest.mark.parametrize(
    ("name", "free"),
    [
        ("lon", ("ax_bias", "az_bias", "q_bias", "alpha_scale", "theta_scale")),
        ("lat", ("ay_bias", "p_bias", "r_bias", "beta_scale", "phi_scale", "psi_scale")),
    ],
)
def test_harv_as_published(measured, name, free):
    """Every estimate within 0.1 of its published standard error, and the white standard errors to
    0.1 %."""
    path = measured(f"f18_harv/dca_{name}_demo_data.mat")
    record, first = harv(path)
    result = reconstruct([record], free, initial=(), starts=[first])
    data = loadmat(path, squeeze_me=True)
    error = np.sqrt(np.diag(data["crbc"]))
    for estimate, published, sigma in zip(result.estimates, data["pc"], error, strict=True):
        sign = (
            -1.0 if estimate.parameter.kind == "bias" else 1.0
        )  # the published bias is added, ours is what the sensor shows
        unit = FOOT if estimate.parameter.name in ("ax_bias", "ay_bias", "az_bias") else 1.0
        assert abs(sign * estimate.value - published * unit) < 0.1 * sigma * unit, (
            estimate.parameter.name
        )
        assert estimate.white_standard_error == pytest.approx(sigma * unit, rel=1e-3)
        assert estimate.standard_error > estimate.white_standard_error


def test_harv_held_inputs_are_no_fault_of_the_published(measured):
    """Between samples the published analysis holds inputs; as the smooth motion that they are, pitch
    attitude fits a third better."""
    record, first = harv(measured("f18_harv/dca_lon_demo_data.mat"))
    free = ("ax_bias", "az_bias", "q_bias", "alpha_scale", "theta_scale")
    held, linear, cubic = (
        reconstruct([replace(record, between=how)], free, initial=(), starts=[first]).noise["theta"]
        for how in ("held", "linear", "cubic")
    )
    assert held == pytest.approx(0.0014023, abs=1e-6)
    assert linear < 0.75 * held
    assert cubic == pytest.approx(linear, rel=2e-3)


def test_turbulence_is_noticed(measured):
    """HFB-320 flew in turbulence, and its verdict says so; ATTAS did not (above)."""
    record = hfb320(measured("hfb320/hfb320_1_10.asc"))
    result = reconstruct([record], ATTAS_BIASES, initial=("u", "v", "w", "phi", "theta"))
    verdict = judge(result, "hfb320", Accuracy())
    assert verdict.word == "limited"
    assert verdict.process_noise.matters
    assert re.fullmatch(r"turbulence of 0\.\d+ m/s rms: use regression .*", verdict.reasons[-1])
    assert verdict.process_noise.gusts["alpha"] == pytest.approx(0.27, abs=0.05)


def test_gusts_need_air_data():
    still = {"theta": 1e-4 * np.random.default_rng(1).standard_normal(500)}
    assert not process_noise(still, 60.0, 0.02).matters


def test_ap2_is_refused_for_both_reasons(measured):
    data = loadmat(
        measured("ampyx_ap2/validationDataFC114_1_v2_pc.mat"),
        struct_as_record=False,
        squeeze_me=True,
    )
    log = data["validationData"]
    response = log.response
    velocity = position_against_velocity(log.controls.times, response.p.T, response.v.T)
    flow = flow_against_velocity(
        response.rollPitchYaw.T, response.v.T, log.controls.wind.T, response.angleOfAttack
    )
    verdict = judge_navigation(velocity, flow, Accuracy())
    assert verdict.word == "rejected"
    assert [round(value, 1) for value in velocity.rms.values()] == [2.6, 1.7, 1.3]
    assert velocity.jump > 40
    assert np.rad2deg(flow.mean) == pytest.approx(-1.1, abs=0.05)
    assert np.rad2deg(flow.deviation) == pytest.approx(2.4, abs=0.05)
    assert "position is not the integral of velocity" in verdict.reasons[0]
    assert "differs from the probe by -1.1 deg mean, 2.4 deg std" in verdict.reasons[1]
