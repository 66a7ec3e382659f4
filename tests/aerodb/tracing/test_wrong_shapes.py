"""Shapes that the library lacks: functions against direct least squares, and closed loops of a dozen
families of wrong shapes: what they confirm, what their bands hold, and what they say.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from aerodb.loop.model_error import between_flights
from aerodb.tables import parse
from aerodb.tracing import Evidence, Finding, FlightResidual, with_checked_shapes
from aerodb.tracing.decision.findings import Vote
from aerodb.tracing.decision.functions import (
    BasisFunctions,
    FunctionProblem,
    functions_of,
    present,
    with_past,
)
from tests.support import wrong_shapes as wrong
from tests.support.equations import coloured as wandering
from tests.support.tracing_small import SETTINGS, term

FINDING = Finding(
    "beta_slope@Cl", "beta_slope", ("Cl",), "", "confirmed", "Cl_beta", "1", 1.0, (0.9, 1.1),
    0.001, (), (), "", "", (),
)  # fmt: skip
FLIGHTS, SAMPLES = 6, 300


def problem(shape: Callable[[np.ndarray], np.ndarray]) -> tuple[FunctionProblem, BasisFunctions]:
    """Flights whose residual is a function of "u" and noise, a named column of "u" itself, and the
    functions of "u", "v" and alpha."""
    rng = np.random.default_rng(3)
    flights = [
        {n: rng.uniform(-1.0, 1.0, SAMPLES) for n in ("alpha", "u", "v")} for _ in range(FLIGHTS)
    ]
    functions = functions_of(flights)
    matrices = []
    for flight, own in zip(flights, functions.columns, strict=True):
        residual = shape(flight["u"]) + 0.3 * rng.standard_normal(SAMPLES)
        columns = np.column_stack([flight["u"], own, residual])
        columns -= columns.mean(axis=0)
        matrices.append(columns.T @ columns)
    matrix = np.stack(matrices)
    before = matrix.sum(axis=0)[:-1, :-1]
    return FunctionProblem.of(matrix, before, functions, 1, 100.0), functions


def test_functions_are_of_one_variable_or_products_with_what_modulates() -> None:
    _, functions = problem(np.abs)
    assert [each.variables for each in functions.each] == [
        ("alpha",),
        ("u",),
        ("v",),
        ("alpha", "u"),
        ("alpha", "v"),
    ]
    ramps = functions.columns[0][:, functions.each[1].columns]
    assert ramps.min() == 0.0
    assert ramps.max() == 1.0


def test_the_past_of_a_deflection_is_what_it_has_yet_to_become() -> None:
    """A step: the rate is a pulse, the difference from a lag of .25 s decays, and in a play the
    deflection stays at the flank."""
    step = 0.05
    time = step * np.arange(200)
    moved = np.where(time < 5.0, 0.0, 0.1)
    past = with_past({"delta_elevator": moved, "q_hat": moved}, step)
    assert set(past) == {
        "delta_elevator", "q_hat", "delta_elevator_rate", "delta_elevator_past", "delta_elevator_play",
    }  # fmt: skip
    late = past["delta_elevator_past"]
    assert late[99] == 0.0
    decay = late[101:140] / late[100:139]
    np.testing.assert_allclose(decay, np.exp(-step / 0.25), rtol=1e-9)
    assert past["delta_elevator_play"][-1] == pytest.approx(moved.std() / 3.0)
    assert {present(name) for name in past} == {"delta_elevator", "q_hat"}


def test_values_are_those_of_ridge_regression() -> None:
    made, _ = problem(np.abs)
    active = made.with_functions([0], [1])
    values = made.solved(made.flights, active)
    square = made.square.sum(axis=0)[np.ix_(active, active)]
    square = square + np.diag(FLIGHTS * np.r_[0.0, np.full(len(active) - 1, 0.01)])
    assert values == pytest.approx(
        np.linalg.solve(square, made.right.sum(axis=0)[active]), rel=1e-6
    )
    direct = made.total[0] - made.gain(made.flights[:1], active, values)[0]
    left = values @ made.square[0][np.ix_(active, active)] @ values
    assert direct == pytest.approx(made.total[0] - 2 * values @ made.right[0, active] + left)


def test_the_right_variable_is_chosen_and_only_where_there_is_something() -> None:
    made, functions = problem(np.abs)
    assert functions.variables(made.chosen(made.flights, [0])) == ("u",)
    before = made.left_out(made.flights, [0])
    assert np.all(made.predicted([0]) > before)
    linear, _ = problem(lambda u: 0.7 * u)
    assert linear.chosen(linear.flights, [0]) == ()
    nothing, _ = problem(np.zeros_like)
    assert nothing.chosen(nothing.flights, []) == ()


def test_a_term_that_leans_on_the_shape_of_another_is_suspected() -> None:
    """Lift that lags by .08 s: its first term is the rate of alpha, what that misses looks like the
    elevator, which drives alpha, and in this noise nothing beats the two. Where the rate and the
    elevator are what acts, both stand."""

    def checked(load: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]) -> list[str]:
        flights, step = [], 0.04
        for seed in range(4):
            rng = np.random.default_rng([seed, 22])
            elevator = wandering(rng, 1500, 0.95)
            alpha = -2.0 * lfilter([step**2], [1.0, -1.9, 0.904], elevator)
            alpha += 0.02 * wandering(rng, 1500, 0.98)
            keep = np.exp(-step / 0.08)
            rate, past = np.gradient(alpha, step), alpha - lfilter([1 - keep], [1, -keep], alpha)
            measured = load(rate, elevator, past)
            measured = measured + 0.5 * measured.std() * wandering(rng, 1500, 0.9)
            columns = {f"{n}@CZ": {"CZ": v} for n, v in (("rate", rate), ("elevator", elevator))}
            evidence = Evidence(
                f"f{seed}", step, {"CZ": measured}, {"CZ": np.ones(1500, dtype=bool)}, columns
            )
            shown = {"alpha": alpha, "alphadot_hat": rate, "delta_elevator": elevator}
            flights.append(FlightResidual(evidence, shown))
        driven = {"rate": "alphadot_hat", "elevator": "delta_elevator"}
        library = [
            replace(term(n, "CZ"), subject="", increment=(("CZ", parse(of)),))
            for n, of in driven.items()
        ]
        findings = [
            replace(FINDING, hypothesis=h.id, effect=h.effect, axis=("CZ",)) for h in library
        ]
        judged = with_checked_shapes(flights, findings, library, SETTINGS)
        for finding in judged:
            assert (finding.verdict == "suspected") == bool(finding.shape)
        return [f.hypothesis for f in judged if f.verdict == "confirmed"]

    assert checked(lambda rate, elevator, past: rate + 0.05 * elevator) == [
        "rate@CZ",
        "elevator@CZ",
    ]
    assert "elevator@CZ" not in checked(lambda rate, elevator, past: past)


def test_a_term_that_leans_on_the_shapes_of_two_others_is_suspected() -> None:
    """Flap and elevator act with a kink that their terms lack. The brake, which was moved as a
    combination of both kinks, stands for them. Where it acts itself, moved so or independently, it
    stands beside the right shapes and beside the wrong ones."""

    def checked(base: int, kinked: bool, acts: bool, follows: bool = True) -> list[Finding]:
        flights, step, size = [], 0.04, 1500
        for seed in range(6):
            rng = np.random.default_rng([seed, base])
            moved = (wandering(rng, size, 0.95) for _ in range(3))
            flap, elevator, own = (each / each.std() for each in moved)
            kinks = np.abs(flap) + np.abs(elevator)
            brake = kinks + 0.3 * own if follows else own
            measured = flap + elevator + 0.5 * kinks * kinked + 0.5 * brake * acts
            measured = measured + 0.5 * measured.std() * wandering(rng, size, 0.9)
            surfaces = {"flap": flap, "elevator": elevator, "speedbrake": brake}
            evidence = Evidence(
                f"f{seed}", step, {"CZ": measured}, {"CZ": np.ones(size, dtype=bool)},
                {f"{name}@CZ": {"CZ": values} for name, values in surfaces.items()},
            )  # fmt: skip
            shown = {f"delta_{name}": values for name, values in surfaces.items()}
            flights.append(FlightResidual(evidence, shown))
        library = [
            replace(term(n, "CZ"), subject="", increment=(("CZ", parse(f"delta_{n}")),))
            for n in ("flap", "elevator", "speedbrake")
        ]
        findings = [
            replace(FINDING, hypothesis=h.id, effect=h.effect, axis=("CZ",)) for h in library
        ]
        return [*with_checked_shapes(flights, findings, library, SETTINGS)]

    stands = [checked(base, True, False)[2] for base in range(30, 40)]
    leaning = [f.shape for f in stands if f.verdict == "suspected" and f.shape and "of" in f.shape]
    assert len(leaning) >= 6
    assert any("with" in shape for shape in leaning)
    for base in range(30, 36):
        assert {f.verdict for f in checked(base, False, True)} == {"confirmed"}
        assert not checked(base, True, True, follows=False)[2].shape


def test_a_term_whose_estimates_scatter_differs_between_flights() -> None:
    errors = np.array([0.1, 0.2, 0.1, 0.3, 0.2, 0.1])

    def variance(values: np.ndarray, count: int = 6) -> float:
        votes = tuple(Vote(f"f{k}", float(values[k]), float(errors[k])) for k in range(count))
        return between_flights(replace(FINDING, votes=votes))

    rng = np.random.default_rng(2)
    alike = [variance(1.0 + errors * rng.standard_normal(6)) for _ in range(400)]
    apart = [
        variance(1.0 + rng.standard_normal(6) + errors * rng.standard_normal(6)) for _ in range(400)
    ]
    assert np.mean(alike) < 0.01
    assert np.mean(apart) == pytest.approx(1.0, rel=0.15)
    assert variance(np.arange(6.0), 3) == 0.0


@pytest.mark.campaign
def test_a_shape_of_the_library_keeps_its_name() -> None:
    family = wrong.PLAIN[0]
    for seed in range(10):
        found = wrong.closed_loop(family, seed)
        assert found.wrong == ()
        assert found.named == ("control_effectiveness@Cl:aileron",)
        assert found.after <= 1.2


@pytest.mark.campaign
def test_wrong_shapes_get_no_wrong_name(capsys: pytest.CaptureFixture[str]) -> None:
    """A dozen families, ten loops each."""
    table = wrong.Table()
    for family in wrong.FAMILIES:
        for seed in range(10):
            table.add(family, wrong.closed_loop(family, seed))
    with capsys.disabled():
        print("", table.text(), f"coverage {table.coverage():.2f}", sep="\n")
    assert table.wrong() <= 0.03


def test_a_wrong_shape_is_said_and_gets_no_wrong_name() -> None:
    """Of one family, whose nearest names are of other variables, one loop."""
    (family,) = (each for each in wrong.FAMILIES if each.name.startswith("one-sided spoiler"))
    found = wrong.closed_loop(family, 0)
    assert found.wrong == ()
    assert found.said
