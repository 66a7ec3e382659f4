"""Displays of which terms a response has: published selection on the Twin Otter, planted terms, and
the false alarms that they state against those that happen."""

import re

import numpy as np
import pytest
import scipy.io

from aerodb.errors import InputError
from aerodb.estimation import EquationRecord, LinearEquation, Parameter, Parameters
from aerodb.estimation.regression.stepwise import orthogonal_functions, stepwise, with_products
from tests.support.equations import coloured, equation, manoeuvre

DISPLAYS = (stepwise, orthogonal_functions)


def stated(fit):
    """The stated rate of false alarms."""
    (note,) = (note for note in fit.notes if note.startswith("False alarms"))
    return float(re.search(r"in (\d+)%", note)[1]) / 100.0


def records(rng, n=1500, more=3, size=0.3, planted=True):
    made = manoeuvre(rng, n)
    made |= {f"extra{k}": coloured(rng, n, 0.95) for k in range(more)}
    z = size * coloured(rng, n, 0.9)
    if planted:
        z = z + made["alpha"] - 0.8 * made["q"] + 0.1
    return made, z


@pytest.mark.parametrize("display", DISPLAYS)
def test_the_twin_otters_yawing_moment(measured, display):
    """SIDPAC's model of Cn, [beta p r da dr 1]; its aileron term is zero within its error."""
    data = scipy.io.loadmat(
        measured("twin_otter/totter_f1_017_data.mat"), variable_names=["fdata"]
    )["fdata"]
    degree = np.pi / 180
    columns = {
        "beta": data[:, 2] * degree, "p": data[:, 70], "r": data[:, 72],
        "da": data[:, 14] * degree, "dr": data[:, 15] * degree, "1": np.ones(len(data)),
    }  # fmt: skip
    fit = display(equation([columns], [data[:, 65]], "Cn"))
    assert {"beta", "r", "dr"} <= {e.name for e in fit.estimates if e.standing == "estimated"}
    assert fit["beta"].value == pytest.approx(0.0854, abs=0.003)
    assert 0.0 <= stated(fit) <= 1.0


@pytest.mark.parametrize("display", DISPLAYS)
def test_planted_terms_are_found(display):
    rng = np.random.default_rng(1)
    made, z = records(rng)
    fit = display(equation([made], [z]))
    assert fit["alpha"].standing == fit["q"].standing == "estimated"
    assert fit["q"].value == pytest.approx(-0.8, abs=0.1)
    assert fit["1"].standing == "estimated"
    left = [e for e in fit.estimates if e.standing == "left out"]
    assert len(left) >= 2
    assert all(e.value == 0.0 and np.isnan(e.standard_error) and e.reason for e in left)


def test_terms_that_repeat_others_do_not_enter():
    rng = np.random.default_rng(3)
    made, z = records(rng, more=0)
    made |= {"twice": 2.0 * made["alpha"], "none": np.zeros(len(z))}
    for display in DISPLAYS:
        fit = display(equation([made], [z]))
        assert {fit["twice"].standing, fit["alpha"].standing} == {"estimated", "left out"}
        assert fit["none"].standing == "not excited"


def test_products_are_named_and_found():
    rng = np.random.default_rng(5)
    made, z = records(rng, more=0)
    whole = equation([made], [z + 0.5 * made["alpha"] * made["q"]])
    fit = orthogonal_functions(whole, order=2)
    assert fit["alpha*q"].value == pytest.approx(0.5, abs=0.15)
    assert len(with_products(whole, 2).parameters.items) == 4 + 6
    assert len(with_products(whole, 3).parameters.items) == 4 + 6 + 10


@pytest.mark.campaign
@pytest.mark.heavy
@pytest.mark.parametrize("display", DISPLAYS)
def test_the_stated_rate_of_false_alarms_is_the_one_that_happens(trials, display):
    """Records without any term: how often a search finds one, and how often it says it would."""
    rng = np.random.default_rng(7)
    count, found, told = trials(10, 200), 0, []
    for _ in range(count):
        made, z = records(rng, n=800, more=2, planted=False)
        fit = display(equation([made], [z]))
        found += any(e.standing == "estimated" and e.name != "1" for e in fit.estimates)
        told.append(stated(fit))
    happened = found / count
    spread = 3.0 * np.sqrt(max(happened * (1 - happened), 0.05) / count)
    assert np.mean(told) == pytest.approx(happened, abs=spread + 0.05)


def test_wrong_settings_and_no_term():
    constant = LinearEquation(
        "Cm",
        Parameters((Parameter("1", 0.0),)),
        (EquationRecord("r", np.arange(50.0), np.ones((50, 1)), np.arange(50.0)),),
    )
    for display in DISPLAYS:
        fit = display(constant)
        assert fit["1"].value == pytest.approx(24.5)
        assert stated(fit) == 0.0
    with pytest.raises(InputError, match="no level"):
        stepwise(constant, level=0.0)
    with pytest.raises(InputError, match="order 0"):
        orthogonal_functions(constant, order=0)
