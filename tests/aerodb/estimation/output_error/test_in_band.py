"""Output error in the frequency domain: published analyses, output error in time and exact motions
of scipy as independent answers; planted truth with coverage, and where nothing may be found."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import StateSpace, lfilter, lsim

from aerodb.errors import InputError
from aerodb.estimation import (
    Parameter,
    Parameters,
    TimeHistory,
    frequency_domain_output_error,
    output_error,
    state_space,
    with_delays,
)
from tests.support.output_error_cases import (
    ATTAS_LATERAL,
    TWIN_OTTER_LATERAL,
    TWIN_OTTER_LONGITUDINAL,
    attas_model,
    attas_records,
    twin_otter_lateral,
    twin_otter_longitudinal,
)
from tests.support.unstable_aircraft import NOISE, piloted_flight, unstable_model
from tests.support.unstable_aircraft import TRUTH as UNSTABLE

TRUTH = {"Lp": -2.0, "Lr": 1.0, "Ld": -6.0, "Np": -0.2, "Nr": -0.5, "Nd": 0.8}


def roll_and_yaw(more=(), **values):
    items = [Parameter(name, values.get(name, value)) for name, value in TRUTH.items()]
    items += [Parameter("L0", 0.0), Parameter("bias_r", 0.0), *more]
    return state_space(
        ["p", "r"], ["d"], ["p", "r"], Parameters(tuple(items)),
        a=[["Lp", "Lr"], ["Np", "Nr"]], b=[["Ld"], ["Nd"]], c=[[1, 0], [0, 1]],
        state_bias=["L0", 0], output_bias=[0, "bias_r"],
    )  # fmt: skip


def flown(seconds=10.0, name="one", late=0.0, yaw=TRUTH["Nd"]):
    """Exact motion by scipy from a first state, with a constant moment and a bias of r."""
    t, time = TRUTH, np.arange(0.0, seconds, 0.02)
    d = 0.05 * np.interp(time % 3.0, [0.0, 0.2, 1.0, 1.2, 2.0, 2.2, 3.0], [0, 1, 1, -1, -1, 0, 0])
    moved = np.interp(time - late, time, d)
    a = [[t["Lp"], t["Lr"]], [t["Np"], t["Nr"]]]
    b = [[t["Ld"], 0.03], [yaw, 0.0]]
    system = StateSpace(a, b, np.eye(2), np.zeros((2, 2)))
    _, y, _ = lsim(system, np.column_stack([moved, np.ones(len(time))]), time, X0=[0.1, -0.05])
    return TimeHistory(name, time, {"d": d}, {"p": y[:, 0], "r": y[:, 1] + 0.02})


def noisy(record, rng, sizes, colour=0.0):
    """White noise, or first-order noise of the same size whose samples correlate by `colour`."""
    outputs = {}
    for name, size in sizes.items():
        white = rng.standard_normal(len(record.time) + 200)
        outputs[name] = (
            record.outputs[name]
            + size * np.sqrt(1.0 - colour**2) * lfilter([1.0], [1.0, -colour], white)[200:]
        )
    return replace(record, outputs=outputs)


class _Still:
    """No noise."""

    @staticmethod
    def standard_normal(size):
        return np.zeros(size)


def errors(fit, truth):
    return np.array([(fit[n].value - v) / fit[n].standard_error for n, v in truth.items()])


def test_motions_of_scipy_obey_the_model_whatever_their_start_and_end():
    """First states, a moment and a bias that never vanish: the algebra between transforms is exact,
    in a band too. Two records of different length; the motion does not come to rest."""
    records = [flown(10.0, "one"), flown(7.3, "two")]
    start = roll_and_yaw(**{name: 0.7 * value for name, value in TRUTH.items()})
    fit = frequency_domain_output_error(start, records, band=(0.3, 2.0))
    assert fit.converged
    for name, value in TRUTH.items():
        assert fit[name].value == pytest.approx(value, rel=1e-4)
    assert fit["L0"].standing == fit["bias_r"].standing == "left out"
    assert fit.noise["p"] < 1e-6
    low = np.fft.rfft(fit.fitted["one"]["p"])[1:3]  # .1 and .2 Hz are beside the band
    assert np.abs(low).max() < 1e-9


def test_over_all_frequencies_it_is_output_error_with_free_constants():
    """Both use all that white noise leaves but the mean: estimates differ by a small part of their
    errors, and these are the same."""
    own = [Parameter("initial_p[one]", 0.0), Parameter("initial_r[one]", 0.0)]
    record = noisy(flown(), np.random.default_rng(3), {"p": 0.004, "r": 0.002})
    model = roll_and_yaw(own)
    time, band = (
        output_error(model, [record]),
        frequency_domain_output_error(model, [record], band=(0.1, 25.0)),
    )
    for name in TRUTH:
        assert abs(band[name].value - time[name].value) < 0.5 * time[name].standard_error
        assert band[name].cramer_rao == pytest.approx(time[name].cramer_rao, rel=0.15)
    assert band.noise["p"] == pytest.approx(time.noise["p"], rel=0.02)
    assert "initial_p[one]" not in [each.name for each in band.estimates]


def test_attas_as_published_and_as_in_time(measured):
    records, model = attas_records(measured("attas/fAttasAilRud1.mat")), attas_model()
    fit, time = frequency_domain_output_error(model, records), output_error(model, records)
    slopes = {name: value for name, value in ATTAS_LATERAL.items() if name not in ("L0", "N0")}
    for name, published in slopes.items():
        error = np.hypot(fit[name].standard_error, time[name].standard_error)
        assert abs(fit[name].value - time[name].value) < error
        assert abs(fit[name].value - published) < 3.5 * fit[name].standard_error


def test_twin_otter_as_nasa_published_it(measured):
    """NASA's output error in time; the band is that of its published equation error."""
    model, record = twin_otter_lateral(measured("twin_otter/totter_f1_017_data.mat"))
    fit, time = frequency_domain_output_error(model, [record]), output_error(model, [record])
    assert "0.0999 to 1.5 Hz" in " ".join(fit.notes)
    for name, published in TWIN_OTTER_LATERAL.items():
        error = np.hypot(fit[name].standard_error, time[name].standard_error)
        assert abs(fit[name].value - published) < 2.5 * error, name
    model, record = twin_otter_longitudinal(measured("twin_otter/totter_demo_data.mat"), 0.03)
    fit = frequency_domain_output_error(model, [record])
    for name, published in TWIN_OTTER_LONGITUDINAL.items():
        if name != "CZ_0":
            assert fit[name].value == pytest.approx(published, rel=0.05)


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_an_unstable_motion_needs_no_feedback_and_intervals_hold_the_truth(colour):
    """A pilot flies it. 200 flights: 95.5 % in white noise, 94.7 % in coloured noise, where bounds
    for white noise would be off by half."""
    clean = piloted_flight(_Still)
    start = unstable_model({name: 0.8 * value for name, value in UNSTABLE.items()})
    inside, away, bounds = [], [], []
    for seed in range(40):
        record = noisy(clean, np.random.default_rng(seed), NOISE, colour)
        fit = frequency_domain_output_error(start, [record])
        assert fit.converged
        spans = [fit.interval(name) for name in UNSTABLE]
        inside += [lo < v < hi for (lo, hi), v in zip(spans, UNSTABLE.values(), strict=True)]
        away.append(errors(fit, UNSTABLE))
        bounds.append([fit[n].standard_error / fit[n].cramer_rao for n in UNSTABLE])
    assert np.mean(inside) > 0.9
    assert np.std(away) == pytest.approx(1.0, abs=0.25)
    assert np.mean(bounds) == pytest.approx(1.5 if colour else 1.0, abs=0.15)


def test_what_lies_beside_the_band_does_not_matter():
    """A vibration at 8 Hz and an error of the gyros that goes once up and down in the record:
    output error in time takes them for the aircraft."""
    time = (record := flown()).time
    spoiled = noisy(record, np.random.default_rng(4), {"p": 0.001, "r": 0.0005})
    slow = 0.03 * np.sin(2.0 * np.pi * time / (len(time) * record.step) + 1.0)
    beside = slow + 0.02 * np.sin(2.0 * np.pi * 8.0 * time)
    outputs = {name: values + beside for name, values in spoiled.outputs.items()}
    spoiled = replace(spoiled, outputs=outputs)
    fit = frequency_domain_output_error(roll_and_yaw(), [spoiled], band=(0.3, 3.0))
    whole = output_error(roll_and_yaw(), [spoiled])
    for name, value in TRUTH.items():
        assert abs(fit[name].value - value) < 3.0 * fit[name].standard_error, name
    assert abs(fit["Nr"].value / TRUTH["Nr"] - 1.0) < 0.05
    assert abs(whole["Nr"].value / TRUTH["Nr"] - 1.0) > 0.2


def test_a_control_without_effect_gets_none_and_noise_gives_no_estimate():
    """The aileron yaws nothing: intervals of its yaw hold zero. Outputs that are noise give none."""
    held, still = [], flown(yaw=0.0)
    for seed in range(40):
        record = noisy(still, np.random.default_rng(seed), {"p": 0.004, "r": 0.002})
        fit = frequency_domain_output_error(roll_and_yaw(), [record])
        assert fit.converged
        low, high = fit.interval("Nd")
        held.append(low < 0.0 < high)
    assert np.mean(held) > 0.88
    noise = noisy(still, np.random.default_rng(1), {"p": 10.0, "r": 10.0})
    fit = frequency_domain_output_error(roll_and_yaw(), [noise])
    assert {each.standing for each in fit.estimates} <= {"diverged", "left out"}


def test_a_late_input_is_estimated():
    item = Parameter("delay_d", 0.0, "s", lower=-0.5, upper=0.5)
    model = with_delays(roll_and_yaw([item]), ["d"], [])
    record = noisy(flown(late=0.1), np.random.default_rng(5), {"p": 0.001, "r": 0.0005})
    fit = frequency_domain_output_error(model, [record])
    assert abs(fit["delay_d"].value - 0.1) < 3.0 * fit["delay_d"].standard_error
    assert fit["delay_d"].standard_error < 0.01
    assert np.abs(errors(fit, TRUTH)).max() < 3.5


def test_what_no_transform_takes_is_refused():
    record = flown()
    gap = np.where(np.arange(len(record.time)) == 70, np.nan, record.outputs["p"])
    with pytest.raises(InputError, match="p has gaps"):
        frequency_domain_output_error(
            roll_and_yaw(), [replace(record, outputs={**record.outputs, "p": gap})]
        )
    with pytest.raises(InputError, match="no band from 1 to 60 Hz"):
        frequency_domain_output_error(roll_and_yaw(), [record], band=(1.0, 60.0))
    with pytest.raises(InputError, match=r"no frequency from 1\.01 to 1\.02 Hz"):
        frequency_domain_output_error(roll_and_yaw(), [record], band=(1.01, 1.02))
    with pytest.raises(InputError, match="a band of 1 frequencies"):
        frequency_domain_output_error(roll_and_yaw(), [record], band=(1.0,))
    late = with_delays(roll_and_yaw([Parameter("delay_p", 0.0, "s")]), [], ["p"])
    with pytest.raises(InputError, match="output that is late"):
        frequency_domain_output_error(late, [record])
    with pytest.raises(InputError, match="it needs a linear model"):
        frequency_domain_output_error(object(), [record])
