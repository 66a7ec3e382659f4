"""Delays of inputs and outputs of linear models: an independent simulation, planted delays, exact
derivatives, and what cannot be used with them."""

import numpy as np
import pytest
from scipy.signal import lsim

from aerodb.errors import InputError
from aerodb.estimation import TimeHistory, delayed, filter_error, multiple_shooting, output_error
from aerodb.identification import parse_state_space

MODEL = """
[state_space]
states = ["p", "r"]
inputs = ["da", "dr"]
outputs = ["p", "r"]
a = [["Lp", "Lr"], ["Np", "Nr"]]
b = [["Lda", "Ldr"], ["Nda", "Ndr"]]
c = [[1, 0], [0, 1]]
late_inputs = ["da"]
late_outputs = ["r"]
"""
A = np.array([[-2.0, 1.0], [-0.2, -0.5]])
B = np.array([[-6.0, 1.1], [-0.4, -1.8]])
TRUTH = {
    "Lp": -2.0, "Lr": 1.0, "Np": -0.2, "Nr": -0.5, "Lda": -6.0, "Ldr": 1.1, "Nda": -0.4,
    "Ndr": -1.8,
}  # fmt: skip
LATE_AILERON, LATE_YAW_RATE = 0.073, 0.035


def aileron(time):
    return 0.1 * np.sin(0.4 * np.maximum(time, 0.0) ** 1.5)


def rudder(time):
    return 0.08 * np.sin(np.maximum(time, 0.0) * (1.3 + 0.05 * time)) ** 3


def record(seed, name="one", late_yaw_rate=LATE_YAW_RATE):
    """20 s at 50 Hz; the motion by scipy at 1 kHz, driven and measured late."""
    rng = np.random.default_rng(seed)
    time, fine = np.arange(0.0, 20.0, 0.02), np.arange(-1000, 20000) * 0.001
    driven = np.column_stack([aileron(fine - LATE_AILERON), rudder(fine)])
    _, motion, _ = lsim((A, B, np.eye(2), np.zeros((2, 2))), driven, fine - fine[0])
    p = np.interp(time, fine, motion[:, 0]) + 0.003 * rng.standard_normal(len(time))
    r = np.interp(time - late_yaw_rate, fine, motion[:, 1]) + 0.002 * rng.standard_normal(len(time))
    return TimeHistory(name, time, {"da": aileron(time), "dr": rudder(time)}, {"p": p, "r": r})


def test_delays_and_derivatives_of_an_independent_simulation_are_found():
    records = [record(1, "one"), record(2, "two")]
    fit = output_error(parse_state_space(MODEL).model(records), records)
    planted = {**TRUTH, "delay_da": LATE_AILERON, "delay_r": LATE_YAW_RATE}
    assert fit.converged
    for name, truth in planted.items():
        assert fit[name].standing == "estimated"
        assert abs(fit[name].value - truth) < 3.5 * fit[name].standard_error, fit[name]
    assert fit["delay_da"].unit == "s"
    assert fit["delay_da"].standard_error < 0.001  # a twentieth of a sample


def test_a_delay_that_is_left_out_biases_what_stands_beside_it():
    given = record(1)
    whole = output_error(parse_state_space(MODEL).model([given]), [given])
    without = MODEL.replace('late_inputs = ["da"]', "").replace('late_outputs = ["r"]', "")
    plain = output_error(parse_state_space(without).model([given]), [given])
    assert plain.log_likelihood < whole.log_likelihood - 100.0
    assert abs(plain["Lda"].value - TRUTH["Lda"]) > 5.0 * whole["Lda"].standard_error


def test_derivatives_are_those_of_differences():
    given = record(1)
    model = parse_state_space(MODEL).model([given])
    names = model.parameters.names
    centre = np.array([{**TRUTH, "delay_da": 0.031, "delay_r": 0.047}[name] for name in names])
    outputs, slopes = model.derivatives(model.parameters.values(centre), given, names)
    lanes = model.parameters.values(centre[:, None])
    assert model.simulated(lanes, given)[:, :, 0] == pytest.approx(outputs, abs=1e-12)
    step = 1e-6
    moved = np.hstack([centre[:, None] + step * np.eye(len(names)),
                       centre[:, None] - step * np.eye(len(names))])  # fmt: skip
    runs = model.simulated(model.parameters.values(moved), given)
    half = len(names)
    assert slopes == pytest.approx((runs[:, :, :half] - runs[:, :, half:]) / (2 * step), abs=1e-6)


def test_a_delay_can_be_fixed_bounded_and_of_one_record():
    records = [record(1, "one"), record(2, "two")]
    table = '[[parameter]]\nname = "delay_da"\nvalue = 0.05\n'
    held = output_error(parse_state_space(MODEL + table + "fixed = true\n").model(records), records)
    assert (held["delay_da"].value, held["delay_da"].standing) == (0.05, "fixed")
    bound = output_error(parse_state_space(MODEL + table + "upper = 0.06").model(records), records)
    assert (bound["delay_da"].value, bound["delay_da"].standing) == (0.06, "at bound")
    own = MODEL + 'own = ["delay_da"]\n'
    apart = output_error(parse_state_space(own).model(records), records)
    for name in ("delay_da[one]", "delay_da[two]"):
        assert abs(apart[name].value - LATE_AILERON) < 3.5 * apart[name].standard_error


def test_a_filter_takes_late_inputs_and_refuses_late_outputs():
    given = record(1, late_yaw_rate=0.0)
    late = MODEL.replace('late_outputs = ["r"]', "")
    fit = filter_error(parse_state_space(late).model([given]), [given])
    assert abs(fit["delay_da"].value - LATE_AILERON) < 4.0 * fit["delay_da"].standard_error
    both = parse_state_space(MODEL).model([given])
    with pytest.raises(InputError, match="output that is late: r"):
        filter_error(both, [given])
    with pytest.raises(InputError, match="whole records"):
        multiple_shooting(both, [given])


def test_names_of_delays_are_checked():
    with pytest.raises(InputError, match="no output 'q'"):
        parse_state_space(MODEL.replace('late_outputs = ["r"]', 'late_outputs = ["q"]'))


def test_a_series_is_shifted_between_samples_and_held_or_continued_beyond_its_ends():
    n = np.arange(60.0)
    wave = np.sin(0.2 * n)[:, None]
    later, slope = delayed(wave, np.array([2.5, -1.25]))
    inside = slice(5, 55)
    for lane, late in enumerate((2.5, -1.25)):
        assert later[inside, lane] == pytest.approx(np.sin(0.2 * (n - late))[inside], abs=2e-4)
        assert slope[inside, lane] == pytest.approx(
            -0.2 * np.cos(0.2 * (n - late))[inside], abs=2e-3
        )
    assert later[:2, 0].tolist() == [0.0, 0.0]
    ramp = (3.0 * n)[:, None]
    assert delayed(ramp, np.array([4.2]), held=False)[0][:, 0] == pytest.approx(3.0 * (n - 4.2))
