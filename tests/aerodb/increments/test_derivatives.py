"""What an update changes of the derivatives inside the data: closed-form numbers, and what the gate
makes of them."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.exchange.native import read_native
from aerodb.flight import Flight
from aerodb.increments.derivatives import (
    DerivativeChange,
    derivative_changes,
    derivatives_document,
    judge_derivatives,
)
from aerodb.tables.database import AeroDatabase
from aerodb.tables.expression import parse
from aerodb.tables.increment import Increment
from tests.support.small_glider import DATABASE

N = 2000


@pytest.fixture(scope="module")
def baseline() -> AeroDatabase:
    """Cm = -0.6 alpha - 12 q_hat - 1.1 delta_elevator; Cl = -0.5 p_hat."""
    return read_native(DATABASE)


@pytest.fixture(scope="module")
def flight() -> Flight:
    """alpha, q and elevator with standard deviations of .02 rad, .1 rad/s and .03 rad; V 25 m/s."""
    generator = np.random.default_rng(4)
    spread = {"alpha": 0.02, "beta": 0.01, "p": 0.1, "q": 0.1, "r": 0.1, "delta_elevator": 0.03}
    channels = {name: size * generator.standard_normal(N) for name, size in spread.items()}
    channels["V"] = np.full(N, 25.0)
    return Flight("f", "small-glider", np.arange(N) / 50.0, channels)


def with_term(database: AeroDatabase, axis: str, term: str, value: float) -> AeroDatabase:
    increment = Increment(axis, (parse(term),), np.array([value]), np.zeros((1, 1)))
    return replace(database, increments=(*database.increments, increment))


def test_the_change_of_one_derivative_is_what_was_added_and_its_share_follows(
    baseline: AeroDatabase, flight: Flight
) -> None:
    """Shares of Cm: .6 x .02, 12 x .25 / 50 x .1 and 1.1 x .03, over their root sum square."""
    candidate = with_term(baseline, "Cm", "delta_elevator", 2.2)
    (change,) = derivative_changes([flight], baseline, candidate)
    assert change.name == "Cm_delta_elevator"
    assert change.before == pytest.approx(-1.1, rel=1e-6)
    assert change.after == pytest.approx(1.1, rel=1e-6)
    parts = np.array([0.6 * 0.02, 12 * 0.25 / 50.0 * 0.1, 1.1 * 0.03])
    assert change.share == pytest.approx(parts[2] / np.linalg.norm(parts), rel=0.02)
    assert "acts the other way round" in change.refusal(0.5)


def test_a_database_that_did_not_change_has_no_changes(
    baseline: AeroDatabase, flight: Flight
) -> None:
    assert derivative_changes([flight], baseline, baseline) == ()
    assert judge_derivatives((), 0.5, ()).passed


@pytest.mark.parametrize(
    ("axis", "term", "value", "refused"),
    [
        ("Cm", "delta_elevator", 0.3, ""),  # 27 %
        ("Cm", "delta_elevator", -0.7, "by more than 50%"),  # 64 %
        ("Cm", "q_hat", 13.0, "its damping becomes an excitation"),
        ("Cl", "p_hat", 0.6, "its damping becomes an excitation"),
        ("Cl", "p_hat", 0.2, ""),
        ("Cm", "alpha", 0.5, "by more than 50%"),
        ("CY", "delta_elevator", 0.4, ""),  # the wind tunnel says nothing of it
        ("Cn", "r_hat", -0.1, ""),
        ("Cn", "r_hat", 0.1, "its damping becomes an excitation"),
    ],
)
def test_a_person_is_asked_for_wrong_signs_and_large_changes_only(
    baseline: AeroDatabase, flight: Flight, axis: str, term: str, value: float, refused: str
) -> None:
    changes = derivative_changes([flight], baseline, with_term(baseline, axis, term, value))
    assert len(changes) == 1
    listed = derivatives_document(changes, 0.5)
    check = judge_derivatives(listed, 0.5, ())
    assert check.passed == (not refused)
    assert all(refused in reason and changes[0].name in reason for reason in check.reasons)
    assert judge_derivatives(listed, 0.5, {changes[0].name}).passed


def test_a_small_cross_effect_may_change_its_sign() -> None:
    small = DerivativeChange("Cn", "delta_elevator", -0.001, 0.0012, 0.01)
    assert small.refusal(0.5) == ""
    assert small.relative == pytest.approx(2.2)


def test_what_changes_an_axis_most_comes_first_and_nothing_refused_is_left_out(
    baseline: AeroDatabase, flight: Flight
) -> None:
    candidate = with_term(baseline, "Cm", "alpha", -0.1)
    candidate = with_term(candidate, "Cm", "delta_elevator", 0.4)
    candidate = with_term(candidate, "Cn", "r_hat", 1e-4)
    changes = derivative_changes([flight], baseline, candidate)
    assert [change.name for change in changes][:2] == ["Cm_delta_elevator", "Cm_alpha"]
    assert "Cn_r" in {f"{e['axis']}_{e['variable']}" for e in derivatives_document(changes, 0.5)}


def test_a_report_of_before_has_to_be_made_again() -> None:
    (reason,) = judge_derivatives(None, 0.5, ()).reasons
    assert "create the version again" in reason
