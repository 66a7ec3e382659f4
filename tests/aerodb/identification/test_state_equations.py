"""Methods of equation error on linear models: the rows of the model as equations."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.estimation import Parameter, Parameters, TimeHistory, output_error, state_space
from aerodb.identification import (
    METHODS,
    chosen_methods,
    flight_records,
    parse_state_space,
    state_space_fit,
)
from aerodb.identification.state_equations import equation_error_fit
from tests.aerodb.identification.test_model_file import TEXT, TRUTH, flights
from tests.support.output_error_cases import (
    ATTAS_LATERAL,
    TWIN_OTTER_LATERAL,
    attas_model,
    attas_records,
    twin_otter_lateral,
)

SOLVED = [m.name for m in METHODS.values() if m.kind == "equation error" and not m.display]


def by(method, model, records):
    (found,) = chosen_methods([method])
    return equation_error_fit(found, model, records)


def test_measured_rates_give_the_least_squares_of_each_row(measured):
    """Roll and yaw acceleration of ATTAS are outputs: numpy solves the two equations."""
    records = attas_records(measured("attas/fAttasAilRud1.mat"))
    fit = by("regression", attas_model(), records)
    columns = np.vstack(
        [
            np.column_stack(
                [r.outputs["p"], r.outputs["r"], *r.inputs.values(), np.ones(r.time.size)]
            )
            for r in records
        ]
    )
    for rate, names in (("pdot", list(ATTAS_LATERAL)[:6]), ("rdot", list(ATTAS_LATERAL)[6:])):
        response = np.concatenate([r.outputs[rate] for r in records])
        solution = np.linalg.lstsq(columns, response, rcond=None)[0]
        assert [fit[name].value for name in names] == pytest.approx(solution, rel=1e-6)
        left = response - columns @ solution
        assert fit.noise[rate] == pytest.approx(float(np.sqrt(np.mean(left**2))), rel=1e-6)
    assert set(fit.residuals["rudder"]) == {"pdot", "rdot"}


def test_rows_that_share_parameters_are_solved_together(measured):
    """In body axes Cl and Cn act on both accelerations; output error of the same record is the
    independent answer."""
    model, record = twin_otter_lateral(measured("twin_otter/totter_f1_017_data.mat"))
    fit, other = by("regression", model, [record]), output_error(model, [record])
    for name in ("Cl_beta", "Cl_p", "Cl_da", "Cn_beta", "Cn_r", "Cn_dr", "CY_beta"):
        error = np.hypot(fit[name].standard_error, other[name].standard_error)
        assert abs(fit[name].value - other[name].value) < 4.0 * error, name
        assert fit[name].value == pytest.approx(TWIN_OTTER_LATERAL[name], rel=0.25), name
    assert set(fit.fitted["f1_017"]) == {
        *(f"rate of {state}" for state in ("beta", "p", "r", "phi")),
        "ay",
    }


@pytest.mark.parametrize("method", SOLVED)
def test_planted_derivatives_are_recovered(method):
    """Two records with constants of their own, one derivative fixed, one entry a sum."""
    file = parse_state_space(TEXT)
    records = flight_records(flights(), file)
    (found,) = chosen_methods([method])
    fit = state_space_fit(found, records, file)
    for name, value in TRUTH.items():
        assert abs(fit[name].value - value) < 4.0 * fit[name].standard_error, name
        assert fit[name].standard_error < 0.01 * abs(value) + 0.02
    assert fit["Nr"].standing == "fixed"
    one, two = (record.name for record in records)
    assert fit[f"L0[{one}]"].value == pytest.approx(0.02, abs=0.005)
    assert fit[f"N0[{two}]"].value == pytest.approx(0.03, abs=0.005)
    assert set(fit.residuals) == {one, two}
    assert len(fit.times[one]) == len(fit.fitted[one]["rate of p"])


def one_state(c, d=0.0, still=False):
    """``x' = a x + b u`` with an output, and a record of it."""
    model = state_space(
        ["x"], ["u"], ["x"], Parameters((Parameter("a", 0.0), Parameter("b", 0.0))),
        a=[["a"]], b=[["b"]], c=[[c]], d=[[d]],
    )  # fmt: skip
    time, rng = np.arange(0.0, 20.0, 0.02), np.random.default_rng(1)
    u = np.zeros(len(time)) if still else np.sign(np.sin(time))
    flown = model.parameters.changed({"a": -1.0, "b": 0.0 if still else 2.0})
    record = TimeHistory("r", time, {"u": u}, {"x": np.zeros(len(time))})
    clean = model.simulated(flown.values(flown.start()), record)[:, 0, 0]
    noisy = clean + 0.01 * rng.standard_normal(len(time))
    return model, replace(record, outputs={"x": noisy})


def test_what_the_records_do_not_move_has_no_estimate():
    model, record = one_state(1.0, still=True)
    fit = by("regression", model, [record])
    assert fit["b"].standing == "not excited"
    assert np.isnan(fit["b"].value)


@pytest.mark.parametrize(("c", "d"), [(2.0, 0.0), (1.0, 0.5)])
def test_states_that_no_output_shows_are_refused(c, d):
    model, record = one_state(c, d)
    with pytest.raises(InputError, match="no output is the state 'x' alone"):
        by("regression", model, [record])


def test_gaps_and_delays_are_refused():
    model, record = one_state(1.0)
    torn = record.outputs["x"].copy()
    torn[100:120] = np.nan  # more than a quarter of a second
    with pytest.raises(InputError, match="gaps in x"):
        by("regression", model, [replace(record, outputs={"x": torn})])
    late = parse_state_space(TEXT.replace("own =", 'late_inputs = ["delta_aileron"]\nown ='))
    (method,) = chosen_methods(["regression"])
    with pytest.raises(InputError, match="without delays"):
        state_space_fit(method, flight_records(flights(), late), late)
