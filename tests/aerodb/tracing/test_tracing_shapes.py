"""Shapes that may be wrong: shape-misfit terms against direct least squares, planted wrong shapes,
and none where none is due.
"""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.effects.hypothesis import Hypothesis
from aerodb.tables.expression import parse
from aerodb.tracing.decision.verdicts import trace
from aerodb.tracing.estimates.campaigns import campaign
from aerodb.tracing.evidence.evidence import Evidence
from aerodb.tracing.evidence.normal_equations import FlightNormalEquations, normal_equations_of
from aerodb.tracing.evidence.shape_misfit import (
    LEAST,
    TOLERANCE,
    all_shape_terms,
    shape_term_columns,
    without_shape_terms,
)
from aerodb.tracing.settings import TracingSettings
from tests.support.tracing_flights import coloured, library
from tests.support.tracing_small import LIBRARY, STEP, evidence

#: No filter and no decimation: what the matrix is the product of is then written down in one line.
PLAIN = TracingSettings(order=0, bandwidth=0.2 / STEP)
FIRST, SECOND = LIBRARY[0].id, LIBRARY[1].id


def shaped(seed: int, error: float = 0.0, size: float = 0.4) -> Evidence:
    """A flight of the small vehicle: the first term is in it, by `error` of itself more per sigma
    of an angle, and the second column looks a little like what that leaves. Only the first has a
    companion."""
    flight = evidence(seed)
    angle = 0.1 + 0.05 * coloured(np.random.default_rng([seed, 1]), flight.samples, 2.0)
    column = flight.columns[FIRST]["CX"]
    like = {
        "CX": column * (angle - 0.1) / 0.05
        + coloured(np.random.default_rng([seed, 2]), flight.samples, 0.6)
    }
    residual = {
        **flight.residual,
        "CX": flight.residual["CX"] + size * column * (1.0 + error * (angle - 0.1) / 0.05),
    }
    return replace(
        flight,
        residual=residual,
        columns={**flight.columns, SECOND: like, f"{FIRST}~alpha": {"CX": column * angle}},
    )


def test_votes_beside_a_companion_are_those_of_direct_least_squares_with_its_prior_as_a_row() -> (
    None
):
    flight = shaped(3, 0.5)
    estimates = campaign([normal_equations_of(flight, PLAIN)], LIBRARY).flight_estimates((0,), ())
    rows, names = [], [h.id for h in LIBRARY]
    for number, axis in enumerate(("CX", "CZ")):
        zero, trims = np.zeros(flight.samples), np.zeros((flight.samples, 2))
        trims[:, number] = 1.0
        columns = [flight.columns[n].get(axis, zero) for n in (*names, f"{FIRST}~alpha")]
        spread = np.std(flight.residual[axis])
        rows.append(np.column_stack([trims, *columns, flight.residual[axis]]) / spread)
    every = np.concatenate(rows)
    without_trims = (
        every[:, 2:] - every[:, :2] @ np.linalg.lstsq(every[:, :2], every[:, 2:], rcond=None)[0]
    )
    term, other, shape, response = (without_trims[:, n] for n in (0, 1, 5, 6))
    shape = shape - term * (term @ shape) / (term @ term)
    sensors = without_trims[:, 3:5]
    known = [1.0 / float(h.prior_sigma or 1.0) for h in LIBRARY[3:]]

    def solved(columns: list[np.ndarray], priors: list[float]) -> np.ndarray:
        design = np.column_stack([*columns, sensors])
        return np.asarray(
            np.linalg.lstsq(
                np.vstack([design, np.diag([*priors, *known])]),
                np.r_[response, np.zeros(design.shape[1])],
                rcond=None,
            )[0]
        )

    value = solved([term], [0.0])[0]
    sigma = TOLERANCE * abs(value) / max(np.sqrt((shape @ shape) / (term @ term)), LEAST["~alpha"])
    assert estimates.estimate[0, 1] == pytest.approx(
        solved([other, term, shape], [0.0, 0.0, 1.0 / sigma])[0], rel=1e-5
    )
    assert estimates.estimate[0, 0] == pytest.approx(
        solved([term, shape], [0.0, 1.0 / sigma])[0], rel=1e-5
    )


def claims(
    error: float, with_companion: bool, earlier: dict[str, float] | None = None
) -> list[str]:
    flights = [shaped(seed, error) for seed in range(6)]
    normal_equations: list[FlightNormalEquations] = [
        normal_equations_of(f if with_companion else without_shape_terms(f), TracingSettings())
        for f in flights
    ]
    return [
        f.hypothesis for f in trace(normal_equations, LIBRARY, TracingSettings(), earlier).findings
    ]


def test_what_a_wrong_shape_leaves_over_is_no_second_effect() -> None:
    assert SECOND in claims(0.5, with_companion=False)
    assert claims(0.5, with_companion=True) == [FIRST]
    assert claims(0.0, with_companion=True) == [FIRST]


def test_nor_in_a_later_round() -> None:
    """What an earlier round has added is taken off; what is left is its shape alone."""

    def later(known: dict[str, float] | None) -> list[str]:
        normal_equations = []
        for seed in range(6):
            flight = shaped(seed, 0.5)
            rest = flight.residual["CX"] - 0.4 * flight.columns[FIRST]["CX"]
            normal_equations.append(
                normal_equations_of(
                    replace(flight, residual={**flight.residual, "CX": rest}), TracingSettings()
                )
            )
        return [
            f.hypothesis
            for f in trace(normal_equations, LIBRARY, TracingSettings(), known).findings
        ]

    assert SECOND in later(None)
    assert SECOND not in later({FIRST: 0.4})


def test_a_second_effect_of_its_own_is_still_found() -> None:
    flights = [shaped(seed) for seed in range(6)]
    both = [
        replace(
            f,
            residual={**f.residual, "CZ": f.residual["CZ"] + 0.3 * f.columns[LIBRARY[2].id]["CZ"]},
        )
        for f in flights
    ]
    found = trace(
        [normal_equations_of(f, TracingSettings()) for f in both], LIBRARY, TracingSettings()
    ).findings
    assert {f.hypothesis for f in found} == {FIRST, LIBRARY[2].id}


def test_what_the_library_has_a_name_for_has_no_companion() -> None:
    names = all_shape_terms(library())
    assert {"speed_brake@CZ~alpha", "pitch_rate_force@CX~alpha", "beta_slope@Cn~size"} <= names
    named = (
        "alpha_slope@CZ~alpha",
        "beta_slope@Cn~alpha",
        "control_effectiveness@Cm:elevator_inboard~size",
        "zero_offset@CX~alpha",
    )
    assert not names & set(named)
    assert all(not name.startswith(h.id) for h in library() if h.kind == "sensor" for name in names)


def test_a_shape_is_the_same_whatever_its_factor_and_its_share_of_the_slope() -> None:
    def term(name: str, regressor: str) -> Hypothesis:
        axis = (("Cn", parse(regressor)),)
        return replace(LIBRARY[0], effect=name, axes=("Cn",), increment=axis)

    slope, coupling = term("slope", "beta"), term("coupling", "3*alpha*beta - 0.2*beta")
    assert shape_term_columns(slope.id).keys() - all_shape_terms([slope, coupling]) == {
        f"{slope.id}~alpha"
    }
    assert shape_term_columns(slope.id).keys() <= all_shape_terms([slope])
