"""Frequency responses and transfer-function fits: scipy's exact responses, planted systems in
coloured noise, correlated inputs, and records without coherence."""

import numpy as np
import pytest
import scipy.signal

from aerodb.errors import InputError
from aerodb.estimation import TimeHistory
from aerodb.estimation.spectra.frequency_response import frequency_responses
from aerodb.estimation.spectra.transfer_function import TransferFunction, transfer_function_fit
from tests.support.equations import coloured

STEP = 0.02
SHORT_PERIOD = TransferFunction(zeros=(1,), poles=(2,))
#: Gain, zero [rad/s], omega [rad/s], zeta, delay [s] of pitch rate per elevator.
TRUTH = np.array([-8.0, 1.1, 3.2, 0.55, 0.08])


def sweep(seconds, seed=0):
    """A logarithmic sweep from 0.08 to 2.5 Hz [rad] with a little noise, and its time [s]."""
    time = STEP * np.arange(round(seconds / STEP))
    rng = np.random.default_rng(seed)
    tone = scipy.signal.chirp(time, 0.08, seconds, 2.5, method="logarithmic")
    return time, 0.05 * tone + 0.005 * coloured(rng, len(time), 0.9)


def pitch_rate(time, control):
    late = np.interp(time - TRUTH[4], time, control, left=control[0])
    numerator = TRUTH[0] * np.array([1.0, TRUTH[1]])
    denominator = [1.0, 2.0 * TRUTH[3] * TRUTH[2], TRUTH[2] ** 2]
    return scipy.signal.lsim((numerator, denominator), late, time)[1]


def record(time, inputs, output):
    return TimeHistory("r", time, inputs, {"q": output})


def test_transfer_functions_are_those_of_scipy():
    omega = np.geomspace(0.1, 50.0, 40)
    structure = TransferFunction(zeros=(1, 2), poles=(2, 1, 2), delay=False)
    assert structure.names == (
        *("gain", "zero", "zero_omega", "zero_zeta"),
        *("omega", "zeta", "pole", "omega2", "zeta2"),
    )
    values = np.array([2.0, 0.5, 4.0, 0.1, 3.0, 0.6, 1.5, 12.0, 0.3])
    top = 2.0 * np.convolve([1.0, 0.5], [1.0, 0.8, 16.0])
    bottom = np.convolve(np.convolve([1.0, 3.6, 9.0], [1.0, 1.5]), [1.0, 7.2, 144.0])
    _, exact = scipy.signal.freqs(top, bottom, omega)
    np.testing.assert_allclose(structure.response(values, omega), exact, rtol=1e-12)
    late = TransferFunction(zeros=(1, 2), poles=(2, 1, 2))
    np.testing.assert_allclose(
        late.response(np.append(values, 0.1), omega), exact * np.exp(-0.1j * omega), rtol=1e-12
    )
    with pytest.raises(InputError, match="factors"):
        TransferFunction(poles=(3,))


def test_a_response_without_noise_is_exact():
    time, control = sweep(120.0)
    q = pitch_rate(time, control)
    response, fit = transfer_function_fit(
        [record(time, {"de": control}, q)], ["de"], "q", SHORT_PERIOD, highest=12.0
    )
    exact = SHORT_PERIOD.response(TRUTH, response.omega)
    inside = (response.omega > 0.8) & (response.omega < 11.0)
    assert np.abs(response.response / exact - 1.0)[inside].max() < 0.1
    assert response.coherence[inside].min() > 0.97
    for name, truth in zip(SHORT_PERIOD.names, TRUTH, strict=True):
        assert fit[name].value == pytest.approx(truth, rel=0.03), name
    assert "acceptable" in fit.notes[0]
    assert "not acceptable" not in fit.notes[0]


def test_coherence_is_what_the_noise_leaves():
    """White input and white noise of the same power: half, as scipy's average says too."""
    rng = np.random.default_rng(1)
    time = STEP * np.arange(20_000)
    x, noise = rng.standard_normal((2, 20_000))
    (found,) = frequency_responses([record(time, {"x": x}, 2.0 * x + 2.0 * noise)], ["x"], "q")
    _, other = scipy.signal.coherence(x, x + noise, 1.0 / STEP, nperseg=2000)
    short = found.omega > 5.0
    assert np.mean(found.smooth_coherence[short]) == pytest.approx(0.5, abs=0.05)
    assert np.mean(found.smooth_coherence[short]) == pytest.approx(np.mean(other), abs=0.06)
    apart = np.abs(found.response[short] / 2.0 - 1.0) / found.random_error[short]
    assert np.sqrt(np.mean(apart**2)) == pytest.approx(np.sqrt(2.0), rel=0.35)


def test_two_inputs_are_told_apart():
    """A rudder that follows the aileron, and more: each response is conditioned on the other."""
    rng = np.random.default_rng(2)
    time = STEP * np.arange(10_000)
    aileron = coloured(rng, 10_000, 0.9)
    rudder = 0.8 * aileron + 0.6 * coloured(rng, 10_000, 0.9)
    r = 0.5 * aileron - 2.0 * rudder + 0.1 * rng.standard_normal(10_000)
    both = record(time, {"da": aileron, "dr": rudder}, r)
    first, second = frequency_responses([both], ["da", "dr"], "q", highest=20.0)
    assert np.median(first.response.real) == pytest.approx(0.5, abs=0.05)
    assert np.median(second.response.real) == pytest.approx(-2.0, abs=0.05)
    (alone,) = frequency_responses([both], ["da"], "q", highest=20.0)
    assert np.median(alone.response.real) < -0.8
    twins = record(time, {"da": aileron, "dr": 3.0 * aileron}, r)
    lost, _ = frequency_responses([twins], ["da", "dr"], "q", highest=20.0)
    assert not lost.usable.any()
    assert np.isnan(lost.response).all()


def test_planted_short_period_in_coloured_noise():
    time, control = sweep(120.0, 3)
    rng = np.random.default_rng(3)
    q = pitch_rate(time, control) + 0.015 * coloured(rng, len(time), 0.95)
    response, fit = transfer_function_fit(
        [record(time, {"de": control}, q)], ["de"], "q", SHORT_PERIOD, highest=12.0
    )
    assert response.usable.sum() > 30
    for name, truth in zip(SHORT_PERIOD.names, TRUTH, strict=True):
        each = fit[name]
        assert each.standing == "estimated"
        assert each.value == pytest.approx(truth, abs=4.0 * each.standard_error)
        assert each.standard_error < 0.3 * abs(truth)
    assert fit["omega"].unit == "rad/s"
    # A structure of too low an order cannot follow, and says so.
    _, poor = transfer_function_fit(
        [record(time, {"de": control}, q)],
        ["de"],
        "q",
        TransferFunction(poles=(1,), delay=False),
        highest=12.0,
    )
    assert "not acceptable" in poor.notes[0]
    assert any("does not follow" in note for note in poor.notes)


def test_without_coherence_there_is_no_estimate():
    rng = np.random.default_rng(4)
    time = STEP * np.arange(4000)
    unrelated = record(time, {"de": coloured(rng, 4000, 0.9)}, coloured(rng, 4000, 0.9))
    response, fit = transfer_function_fit([unrelated], ["de"], "q", SHORT_PERIOD, highest=20.0)
    assert response.usable.sum() < 10
    assert {each.standing for each in fit.estimates} == {"not excited"}
    assert not fit.converged
    assert "excite de" in fit["gain"].reason
    still = record(time, {"de": np.zeros(4000)}, coloured(rng, 4000, 0.9))
    _, nothing = transfer_function_fit([still], ["de"], "q", SHORT_PERIOD, highest=20.0)
    assert {each.standing for each in nothing.estimates} == {"not excited"}


def test_records_that_hold_no_response():
    rng = np.random.default_rng(5)
    time = STEP * np.arange(100)
    short = record(time, {"de": rng.standard_normal(100)}, rng.standard_normal(100))
    with pytest.raises(InputError, match="no frequencies"):
        frequency_responses([short], ["de"], "q", lowest=1.0, highest=500.0)
    with pytest.raises(InputError, match="no rudder"):
        frequency_responses([short], ["rudder"], "q")


@pytest.mark.campaign
@pytest.mark.heavy
def test_intervals_cover_the_truth(trials):
    """95 % intervals of the parameters hold the truth in 92 to 98 % of 300 sweeps of two minutes,
    taken together."""
    rng = np.random.default_rng(6)
    count, held = trials(10, 300), 0
    for k in range(count):
        time, control = sweep(120.0, k)
        q = pitch_rate(time, control) + 0.04 * coloured(rng, len(time), (0.0, 0.9, 0.97)[k % 3])
        _, fit = transfer_function_fit(
            [record(time, {"de": control}, q)], ["de"], "q", SHORT_PERIOD, highest=12.0
        )
        for name, truth in zip(SHORT_PERIOD.names, TRUTH, strict=True):
            low, high = fit.interval(name)
            held += low <= truth <= high
    spread = 2.5 * np.sqrt(0.95 * 0.05 / (2 * count)) if count < 300 else 0.0
    assert 0.92 - spread <= held / (5 * count) <= 0.98 + spread
