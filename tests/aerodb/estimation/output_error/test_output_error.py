"""Output error against published analyses, a textbook's form of it, planted truth, and parameters
that the data cannot give."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from aerodb.errors import InputError
from aerodb.estimation import Parameter, Parameters, TimeHistory, output_error, state_space
from tests.support.output_error_cases import (
    ATTAS_LATERAL,
    TWIN_OTTER_LATERAL,
    TWIN_OTTER_LONGITUDINAL,
    attas_model,
    attas_records,
    twin_otter_lateral,
    twin_otter_longitudinal,
)
from tests.support.textbook_output_error import attas_textbook


def test_twin_otter_as_nasa_published_it(measured):
    """The model is linear at the mean flight condition with fixed initial states: all 13 published
    derivatives are within the Cramer-Rao bounds, ten of them to three digits."""
    model, record = twin_otter_lateral(measured("twin_otter/totter_f1_017_data.mat"))
    fit = output_error(model, [record])
    assert fit.converged
    apart = {name: fit[name].value - value for name, value in TWIN_OTTER_LATERAL.items()}
    assert max(abs(apart[name]) / fit[name].cramer_rao for name in apart) < 1.4
    close = [name for name in apart if abs(apart[name]) <= 2e-3 * abs(TWIN_OTTER_LATERAL[name])]
    assert len(close) >= 9
    assert all(fit[name].standard_error > fit[name].cramer_rao for name in apart)  # coloured


def test_twin_otter_longitudinal_once_the_lag_of_its_vane_is_out(measured):
    """The recorded angle of attack is late by .02 to .03 s against the kinematics. Without that lag
    the published derivatives are met within 5 % (Cm_q -33.25); with it the elevator's lift is lost.
    """
    file = measured("twin_otter/totter_demo_data.mat")
    timely, late = (
        output_error(model, [record])
        for model, record in (twin_otter_longitudinal(file, lag) for lag in (0.03, 0.0))
    )
    for name, published in TWIN_OTTER_LONGITUDINAL.items():
        assert timely[name].value == pytest.approx(published, rel=0.05)
    assert timely["Cm_q"].value == pytest.approx(-33.25, rel=0.03)
    assert late["CZ_de"].value > 0.0
    assert timely.log_likelihood > late.log_likelihood + 100.0


def test_attas_as_an_independent_form_gives_it_and_near_what_was_published(measured):
    """The data pack's printout differs from the optimum of its cost by up to 4 Cramer-Rao bounds,
    and by less than 3.5 standard errors that count the colour of the residuals."""
    records, model = attas_records(measured("attas/fAttasAilRud1.mat")), attas_model()
    fit = output_error(model, records)
    plain, bounds = attas_textbook(records, ATTAS_LATERAL, list(ATTAS_LATERAL.values()))
    for name, published in ATTAS_LATERAL.items():
        assert fit[name].value == pytest.approx(plain[name], abs=2e-3 * bounds[name])
        assert fit[name].cramer_rao == pytest.approx(bounds[name], rel=2e-3)
        assert abs(fit[name].value - published) < 3.5 * fit[name].standard_error


TRUTH = {"Lp": -2.0, "Lr": 1.0, "Ld": -6.0, "Np": -0.2, "Nr": -0.5, "Nd": 0.8}


def roll_and_yaw(parameters, **more):
    return state_space(
        ["p", "r"], ["d"], ["p", "r"], parameters,
        a=[["Lp", "Lr"], ["Np", "Nr"]], b=[["Ld"], ["Nd"]], c=[[1, 0], [0, 1]], **more,
    )  # fmt: skip


def flown(rng, parameters, names=("one",), noise=(0.002, 0.004), correlation=0.0, seconds=10.0):
    """Records of the model at these parameters with noise."""
    model = roll_and_yaw(parameters, output_bias=["bias_p", 0])
    time = np.arange(0.0, seconds, 0.02)
    records = []
    for number, name in enumerate(names):
        d = 0.05 * np.sign(np.sin(1.7 * time + number)) * (time < 0.7 * seconds)
        empty = TimeHistory(name, time, {"d": d}, {each: np.zeros(len(time)) for each in "pr"})
        outputs = model.simulated(parameters.values(parameters.start()), empty)[:, :, 0]
        white = rng.standard_normal(outputs.shape)
        white[:, 1] = correlation * white[:, 0] + np.sqrt(1 - correlation**2) * white[:, 1]
        outputs = outputs + white * np.array(noise)
        records.append(replace(empty, outputs=dict(zip("pr", outputs.T, strict=True))))
    return records


def parameters_of(more=(), **values):
    return Parameters(
        (*(Parameter(name, values.get(name, value)) for name, value in TRUTH.items()), *more)
    )


def test_several_records_with_initial_states_and_biases_of_their_own():
    names = ("one", "two", "three")
    own = [Parameter("bias_p", 0.0, free=False)]
    for k, name in enumerate(names):
        own += [
            Parameter(f"bias_p[{name}]", 0.01 * (k + 1)),
            Parameter(f"initial_p[{name}]", 0.05 * k),
            Parameter(f"initial_r[{name}]", -0.02 * k),
        ]
    planted = parameters_of(own)
    records = flown(np.random.default_rng(1), planted, names)
    records[0].outputs["p"][100:150] = np.nan
    records[1].outputs["r"][:] = np.nan
    start = planted.changed({item.name: 0.5 * item.value for item in planted.items if item.free})
    fit = output_error(roll_and_yaw(start, output_bias=["bias_p", 0]), records)
    assert fit.converged
    for item in planted.unknown:
        estimate = fit[item.name]
        assert abs(estimate.value - item.value) < 4.0 * estimate.standard_error
        assert estimate.cramer_rao == pytest.approx(estimate.standard_error, rel=0.5)
    assert fit.noise["p"] == pytest.approx(0.002, rel=0.1)
    assert np.isnan(fit.residuals["two"]["r"]).all()


def test_a_full_covariance_finds_the_correlation_and_gains_by_it():
    own = [Parameter("bias_p", 0.0, free=False)]
    planted = parameters_of(own)
    records = flown(np.random.default_rng(2), planted, noise=(0.004, 0.004), correlation=0.95)
    model = roll_and_yaw(planted)
    diagonal, full = (
        output_error(model, records, covariance=kind) for kind in ("diagonal", "full")
    )
    left = np.column_stack([full.residuals["one"][name] for name in "pr"])
    assert np.corrcoef(left.T)[0, 1] == pytest.approx(0.95, abs=0.02)
    assert full.log_likelihood > diagonal.log_likelihood + 100.0
    for name, value in TRUTH.items():
        assert abs(full[name].value - value) < 4.0 * full[name].standard_error
    assert full["Ld"].standard_error < diagonal["Ld"].standard_error


def test_what_the_data_cannot_give_is_said_per_parameter():
    own = [
        Parameter("bias_p", 0.0, free=False),
        Parameter("unused", 1.0),
        Parameter("Nx", 0.0),
        Parameter("known", 0.3, prior=0.3, prior_error=1e-6),
        Parameter("half", 0.0, tied=("Lp", 0.5)),
    ]
    planted = parameters_of(own)
    records = flown(np.random.default_rng(3), parameters_of([own[0]]))
    limited = Parameters(
        tuple(
            replace(item, value=-0.6, upper=-0.55) if item.name == "Nr" else item
            for item in planted.items
        )
    )
    model = state_space(
        ["p", "r"], ["d"], ["p", "r"], limited,
        a=[["Lp", "Lr"], ["Np", "Nr"]], b=[["Ld"], ["Nd + Nx"]], c=[[1, 0], [0, 1]],
        output_bias=["known - 0.3", 0],
    )  # fmt: skip
    fit = output_error(model, records)
    assert fit["unused"].standing == "not excited"
    assert np.isnan(fit["unused"].value)
    assert fit["Nd"].standing == fit["Nx"].standing == "not identifiable"
    assert "Nx can take its place" in fit["Nd"].reason
    assert fit["Nr"].standing == "at bound"
    assert fit["Nr"].value == -0.55
    assert fit["known"].standing == "prior"
    assert fit["half"].standing == "tied"
    assert fit["half"].value == pytest.approx(0.5 * fit["Lp"].value)
    assert fit["bias_p"].standing == "fixed"


def test_errors_of_the_others_count_what_a_bound_holds():
    """A yaw damping that a bound keeps a little off is no better known than a free one."""
    own = [Parameter("bias_p", 0.0, free=False)]
    records = flown(np.random.default_rng(5), parameters_of(own), noise=(0.02, 0.02))
    free = output_error(roll_and_yaw(parameters_of(own)), records)
    end = free["Nr"].value - 0.2 * free["Nr"].standard_error
    bound = Parameters(
        tuple(
            replace(item, value=end - 0.05, upper=end) if item.name == "Nr" else item
            for item in parameters_of(own).items
        )
    )
    fit = output_error(roll_and_yaw(bound), records)
    assert fit["Nr"].standing == "at bound"
    for name in ("Np", "Nd", "Lp"):
        assert fit[name].standard_error == pytest.approx(free[name].standard_error, rel=0.05)


def test_a_prior_adds_its_information():
    own = [Parameter("bias_p", 0.0, free=False)]
    records = flown(np.random.default_rng(4), parameters_of(own), noise=(0.02, 0.02))
    free = output_error(roll_and_yaw(parameters_of(own)), records)
    error = free["Lr"].cramer_rao
    informed = Parameters(
        tuple(
            replace(item, prior=2.0, prior_error=error) if item.name == "Lr" else item
            for item in parameters_of(own).items
        )
    )
    fit = output_error(roll_and_yaw(informed), records)
    assert fit["Lr"].value == pytest.approx(0.5 * (2.0 + free["Lr"].value), abs=0.2 * error)
    assert fit["Lr"].cramer_rao == pytest.approx(error / np.sqrt(2.0), rel=0.05)


def test_insensitivity_is_the_error_with_all_others_known():
    own = [Parameter("bias_p", 0.0, free=False)]
    planted = parameters_of(own)
    records = flown(np.random.default_rng(5), planted)
    fit = output_error(roll_and_yaw(planted), records)
    for name in ("Lr", "Nd"):
        known = Parameters(
            tuple(
                replace(item, value=fit[item.name].value, free=item.name == name)
                for item in planted.items
            )
        )
        alone = output_error(roll_and_yaw(known), records)
        assert fit[name].insensitivity == pytest.approx(alone[name].cramer_rao, rel=0.01)
        assert fit[name].insensitivity < 0.9 * fit[name].cramer_rao


def test_a_record_without_excitation_and_wrong_records():
    own = [Parameter("bias_p", 0.0, free=False)]
    model = roll_and_yaw(parameters_of(own))
    time = np.arange(0.0, 2.0, 0.02)
    still = TimeHistory("still", time, {"d": 0 * time}, {"p": 0 * time, "r": 0 * time})
    fit = output_error(model, [still])
    assert {estimate.standing for estimate in fit.estimates} == {"not excited", "fixed"}
    with pytest.raises(InputError, match="unique names"):
        output_error(model, [still, still])
    with pytest.raises(InputError, match="it has no r"):
        output_error(model, [TimeHistory("x", time, {"d": time}, {"p": time})])


@pytest.mark.heavy
@pytest.mark.parametrize("colour", [0.0, 0.9, 0.97])
def test_intervals_hold_the_truth_as_often_as_they_say(trials, colour):
    """95 % intervals of derivatives, biases and initial states, white and coloured noise (first
    order, correlation time up to .65 s); where that is near the limit, the fit says so."""
    names = ("one", "two")
    own = [Parameter("bias_p", 0.0, free=False)]
    own += [Parameter(f"bias_p[{name}]", 0.01) for name in names]
    own += [Parameter(f"initial_{state}[{name}]", 0.02) for state in "pr" for name in names]
    planted = parameters_of(own)
    model = roll_and_yaw(planted, output_bias=["bias_p", 0])
    clean = flown(np.random.default_rng(0), planted, names, noise=(0.0, 0.0), seconds=20.0)
    rng, held, short, count = np.random.default_rng(7), [], 0, trials(40, 300)
    for _ in range(count):
        noisy = []
        for record in clean:
            outputs = {}
            for name, sigma in (("p", 0.004), ("r", 0.003)):
                white = rng.standard_normal(len(record.time) + 300)
                noise = lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], white)[300:]
                outputs[name] = record.outputs[name] + sigma * noise
            noisy.append(replace(record, outputs=outputs))
        fit = output_error(model, noisy)
        assert fit.converged
        short += any(note.startswith("Too short") for note in fit.notes)
        for item in planted.unknown:
            low, high = fit.interval(item.name)
            held.append(low < item.value < high)
    # the unknowns of one fit are not independent: few trials scatter by 2 %
    margin = 0.0 if count >= 300 else 0.05
    assert 0.92 - margin <= np.mean(held) <= 0.98 + margin
    assert (short > 0.9 * count) == (colour == 0.97)
