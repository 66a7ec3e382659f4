"""A linear model declared in a file is the one written in code, and is fitted to manoeuvres."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.estimation import TimeHistory, output_error
from aerodb.flight import Flight
from aerodb.identification import (
    IdentificationFlight,
    chosen_methods,
    declares_state_space,
    flight_records,
    parse_state_space,
    state_space_fit,
)
from tests.support.output_error_cases import ATTAS_LATERAL, attas_model, attas_records

TEXT = """
[state_space]
states = ["p", "r"]
inputs = ["delta_aileron", "delta_rudder"]
outputs = ["p", "r"]
a = [["Lp", "Lr"], ["Np", "Nr"]]
b = [["Lda", 0.5], ["Nda", "2*Ndr - 0.1"]]
c = [[1, 0], [0, 1]]
state_bias = ["L0", "N0"]
initial = ["p", "r"]
own = ["L0", "N0"]

[[parameter]]
name = "Lp"
value = -2.5
upper = 0.0

[[parameter]]
name = "Nr"
value = -0.5
fixed = true
"""
TRUTH = {"Lp": -2.0, "Lr": 0.8, "Np": -0.1, "Lda": -6.0, "Nda": 0.3, "Ndr": -1.0}


def flights():
    """Two manoeuvres of one flight, each with constants of its own."""
    time = np.arange(0.0, 24.0, 0.02)
    inputs = {
        "delta_aileron": 0.05 * np.sign(np.sin(1.9 * time)),
        "delta_rudder": 0.05 * np.sign(np.sin(1.1 * time + 1.0)),
    }
    file, rng = parse_state_space(TEXT), np.random.default_rng(3)
    channels = {name: values.copy() for name, values in inputs.items()}
    channels |= {name: np.zeros(len(time)) for name in "pr"}
    for part, bias in ((slice(0, 600), 0.02), (slice(600, 1200), -0.03)):
        empty = TimeHistory(
            "any",
            time[part],
            {name: values[part] for name, values in inputs.items()},
            {name: np.zeros(600) for name in "pr"},
        )
        model = file.model([empty])
        planted = TRUTH | {"L0[any]": bias, "N0[any]": -bias, "initial_p[any]": 0.1}
        start = model.parameters.changed(planted)
        outputs = model.simulated(start.values(start.start()), empty)[:, :, 0]
        for j, name in enumerate("pr"):
            channels[name][part] = outputs[:, j] + 0.002 * rng.standard_normal(600)
    flight = Flight("f" * 64, "any", time, channels)
    windows = ((0.0, 11.99), (12.0, 23.98))
    return [IdentificationFlight(flight, None, None, None, windows)]


def fitted(method, given, file):
    return state_space_fit(method, flight_records(given, file), file)


def test_attas_from_a_file(measured):
    """Rates of roll and yaw as declared, of the same optimum as the model in code."""
    text = """
[state_space]
states = ["p", "r"]
inputs = ["da", "dr", "beta"]
outputs = ["pdot", "rdot", "p", "r"]
a = [["Lp", "Lr"], ["Np", "Nr"]]
b = [["Lda", "Ldr", "Lbeta"], ["Nda", "Ndr", "Nbeta"]]
c = [["Lp", "Lr"], ["Np", "Nr"], [1, 0], [0, 1]]
d = [["Lda", "Ldr", "Lbeta"], ["Nda", "Ndr", "Nbeta"], [0, 0, 0], [0, 0, 0]]
state_bias = ["L0", "N0"]
output_bias = ["L0", "N0", 0, 0]
[[parameter]]
name = "Lp"
value = -1
[[parameter]]
name = "Nr"
value = -1
"""
    records = attas_records(measured("attas/fAttasAilRud1.mat"))
    fit = output_error(parse_state_space(text).model(records), records)
    other = output_error(attas_model(), records)
    for name in ATTAS_LATERAL:
        assert fit[name].value == pytest.approx(other[name].value, abs=1e-3 * fit[name].cramer_rao)


def test_manoeuvres_of_flights_are_records_with_parameters_of_their_own():
    (method,) = chosen_methods(["output-error"])
    fit = fitted(method, flights(), parse_state_space(TEXT))
    assert fit.converged
    for name, value in TRUTH.items():
        assert abs(fit[name].value - value) < 4.0 * fit[name].standard_error
        assert fit[name].standard_error < 0.05 * abs(value) + 0.01
    assert fit["Nr"].standing == "fixed"
    one, two = fit.residuals
    assert fit[f"L0[{one}]"].value == pytest.approx(0.02, abs=0.005)
    assert fit[f"L0[{two}]"].value == pytest.approx(-0.03, abs=0.005)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (TEXT.replace('"Lp"\nvalue', '"Lq"\nvalue'), "no entry 'Lq'"),
        (TEXT.replace('own = ["L0"', 'own = ["M0"'), "no entry 'M0'"),
        (TEXT.replace("c = [[1, 0], [0, 1]]", "c = [[1, 0]]"), "not"),
        (TEXT.replace("2*Ndr - 0.1", "Ndr*Nda"), "no sum of parameters"),
        (TEXT.replace("fixed", "fix"), "unknown key"),
    ],
)
def test_wrong_files_are_refused(wrong, said):
    with pytest.raises(InputError, match=said):
        parse_state_space(wrong)


def test_what_cannot_be_fitted_is_said():
    file = parse_state_space(TEXT)
    assert declares_state_space(TEXT)
    assert not declares_state_space("[[increment]]\naxis = 'Cm'")
    (method,) = chosen_methods(["output-error"])
    (each,) = flights()
    bare = Flight("f" * 64, "any", each.flight.time, {"p": each.flight["p"]})
    with pytest.raises(InputError, match="no manoeuvre"):
        fitted(method, [IdentificationFlight(bare, None, None, None, each.windows)], file)
