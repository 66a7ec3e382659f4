"""Finer shapes: the algebra against direct least squares, planted functions come back, and exact
templates stay as they are."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.effects.spline import Spline
from aerodb.tables.expression import parse
from aerodb.tables.program import evaluate
from aerodb.tracing.decision.refinement import ShapeProblem, _problem, search
from aerodb.tracing.estimates import campaign
from aerodb.tracing.evidence.normal_equations import normal_equations_of
from aerodb.tracing.settings import TracingSettings
from tests.support.tracing_small import LIBRARY, SETTINGS, evidence

SPLINE = Spline("alpha", (0.0, 0.05, 0.1, 0.15, 0.2, 0.25, 0.3))
GROUP = tuple(range(1, 7))
FLIGHTS, SAMPLES = 6, 400


def rows(seed: int, change: float) -> tuple[np.ndarray, np.ndarray]:
    """Columns (flights, samples, 7), a term and its six ramps, and response: the gain, 0.5, has
    grown by `change` of itself at the last node, as the square of alpha."""
    rng = np.random.default_rng(seed)
    alpha, term = rng.uniform(0.0, 0.3, (FLIGHTS, SAMPLES)), rng.standard_normal((FLIGHTS, SAMPLES))
    ramps = SPLINE.ramps(alpha.ravel()).reshape(FLIGHTS, SAMPLES, 6)
    columns = np.concatenate([term[..., None], term[..., None] * ramps], axis=2)
    response = 0.5 * term * (1.0 + change * (alpha / 0.3) ** 2) + rng.standard_normal(
        (FLIGHTS, SAMPLES)
    )
    return columns, response


def problem(seed: int, change: float) -> ShapeProblem:
    columns, response = rows(seed, change)
    square, right = columns.transpose(0, 2, 1) @ columns, np.einsum("gnk,gn->gk", columns, response)
    unit = np.full(7, np.sqrt(square[:, 0, 0].max()))
    return ShapeProblem(
        square / np.outer(unit, unit), right / unit, np.sum(response**2, axis=1), unit
    )


def test_ramps_times_a_regressor_are_a_function_that_is_linear_between_nodes() -> None:
    alpha, changes = np.linspace(-0.1, 0.4, 51), np.array([1.0, -2.0, 0.5, 0.0, 3.0, -1.0])
    wanted = 2.0 * np.interp(alpha, SPLINE.nodes, np.cumsum([0.7, *changes]))
    found = 2.0 * 0.7 + sum(
        d * evaluate(each, {"alpha": alpha, "mach": np.full(51, 2.0)})
        for d, each in zip(changes, SPLINE.expressions(parse("mach")), strict=True)
    )
    assert np.allclose(found, wanted)
    assert np.allclose(2.0 * (0.7 + SPLINE.ramps(alpha) @ changes), wanted)


def test_values_are_those_of_ridge_regression_on_all_samples() -> None:
    made, ridge = problem(1, 1.0), np.r_[0.0, np.full(6, 0.01)]
    values, covariance = made.estimate(range(7), ridge, 4.0)
    columns, response = rows(1, 1.0)
    penalty = np.diag(np.sqrt(FLIGHTS * ridge) * made.unit)
    design = np.vstack([columns.reshape(-1, 7), penalty])
    direct = np.linalg.lstsq(design, np.r_[response.ravel(), np.zeros(7)], rcond=None)[0]
    assert values == pytest.approx(direct, rel=1e-6)
    assert np.linalg.eigvalsh(covariance).min() > 0.0


def test_a_function_comes_back_where_there_is_one() -> None:
    made = problem(2, 1.5)
    (choice,) = search(made, [GROUP], 1, TracingSettings())
    assert choice.fall > 0.02
    ridge = np.r_[0.0, np.full(6, choice.ridge)]
    values, covariance = made.estimate(range(7), ridge, 4.0)
    alpha = np.linspace(0.02, 0.28, 14)
    basis = np.column_stack([np.ones(14), SPLINE.ramps(alpha)])
    error = basis @ values - 0.5 * (1.0 + 1.5 * (alpha / 0.3) ** 2)
    assert np.abs(error).max() < 0.15
    sigma = np.sqrt(np.einsum("nk,kl,nl->n", basis, covariance, basis))
    assert np.mean(np.abs(error) < 3.0 * sigma) >= 0.9


def test_where_the_template_is_right_its_shape_stays() -> None:
    refine = [
        bool(search(problem(seed, 0.0), [GROUP], 1, TracingSettings())) for seed in range(100)
    ]
    assert sum(refine) <= 5


def test_a_constant_keeps_the_value_that_levels_gave() -> None:
    """What turns with a constant on another axis is no measure of it: an error there would be."""
    term = LIBRARY[0]
    constant = replace(term, effect="zero_offset", increment=(("CX", parse("1")),))
    flights = []
    for seed in range(6):
        flown = evidence(seed, {term.id: 0.3})
        turned = 0.05 * flown.columns[LIBRARY[2].id]["CZ"]
        columns = {
            constant.id: {"CX": np.ones(flown.samples), "CZ": turned},
            term.id: flown.columns[term.id],
        }
        residual = flown.residual | {"CZ": flown.residual["CZ"] + turned}
        flights.append(replace(flown, columns=columns, residual=residual))
    equations = [normal_equations_of(flight, SETTINGS) for flight in flights]
    made = _problem(campaign(equations, [constant, term]), range(2), SETTINGS)
    values, _ = made.estimate(range(2), np.zeros(2), SETTINGS.prior_dof)
    assert values == pytest.approx([0.0, 0.3], abs=0.05)
