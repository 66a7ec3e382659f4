"""Per-flight estimates of whole models against direct least squares on the columns themselves,
flight by flight; and what is computed on request against the same computed everywhere.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from aerodb.effects.hypothesis import Hypothesis
from aerodb.tracing.decision.selection import CrossFlightTests
from aerodb.tracing.estimates.campaigns import OFFSET, campaign
from aerodb.tracing.estimates.per_flight import Campaign
from aerodb.tracing.evidence.normal_equations import FlightNormalEquations
from aerodb.tracing.evidence.shape_misfit import LEAST, TOLERANCE
from aerodb.tracing.settings import TracingSettings
from tests.support.tracing_small import instrument, term

Array = np.ndarray
AXES = ("CX", "CZ")
TERMS = (term("a", "CX"), term("b", "CX"), term("c", "CZ"), term("d", "CZ"))
OFFSETS = tuple(replace(term(OFFSET, axis), subject="") for axis in AXES)
SENSORS = (instrument("s", 0.5), instrument("u", 0.2), instrument("v", 1.5))
LIBRARY: tuple[Hypothesis, ...] = (*TERMS, *OFFSETS, *SENSORS)
NAMES = [h.id for h in LIBRARY]
#: Columns that stand beside terms: their names, and the place of each one's term.
SHAPES = {f"{TERMS[0].id}~alpha": 0, f"{TERMS[0].id}~size": 0, f"{TERMS[2].id}~alpha": 2}
OFFSET_PLACES, SENSOR_PLACES = (4, 5), (6, 7, 8)


@dataclass(frozen=True)
class Flown:
    """Whitened columns of one flight and their normal equations. rows (m, columns); trims (m,
    axes)."""

    names: tuple[str, ...]
    intercepts: Array
    columns: dict[str, Array]
    residual: Array
    equations: FlightNormalEquations


def flown(seed: int) -> Flown:
    """A flight: the second lacks a term and a sensor, the third an axis; nothing varies but what
    acts on the axis."""
    rng = np.random.default_rng(seed)
    axes = AXES[:1] if seed == 2 else AXES
    m = 60 * len(axes)
    on = {axis: np.repeat(np.arange(len(axes)) == n, 60) for n, axis in enumerate(axes)}
    common = rng.standard_normal((m, 3))
    columns: dict[str, Array] = {}
    for place, h in enumerate(LIBRARY):
        acting = (
            np.any([on[axis] for axis in h.axes if axis in on], axis=0)
            if set(h.axes) & set(axes)
            else np.zeros(m, bool)
        )
        noise = rng.standard_normal(m) + common @ rng.standard_normal(3)
        columns[h.id] = np.where(
            acting, 0.9 if place in OFFSET_PLACES else 10.0 ** (place % 3 - 1) * noise, 0.0
        )
    for name, place in SHAPES.items():
        columns[name] = columns[NAMES[place]] * (0.4 + 0.3 * rng.standard_normal(m))
    if seed == 1:
        del columns[NAMES[1]], columns[NAMES[7]]
    residual = rng.standard_normal(m) + 0.8 * columns[NAMES[0]] + 0.3 * columns[NAMES[6]]
    intercepts = np.column_stack([0.9 * on[axis] for axis in axes])
    stacked = np.column_stack([intercepts, *columns.values(), residual])
    again = stacked + 0.05 * rng.standard_normal(stacked.shape) * (stacked != 0.0)
    again[:, : len(axes)] = intercepts
    names, none = tuple(columns), np.zeros(0)
    equations = FlightNormalEquations(
        f"f{seed}",
        axes,
        names,
        stacked.T @ stacked,
        again.T @ again,
        none,
        none,
        none.astype(np.int64),
        np.ones(len(names)),
        np.array(
            [[varies(each[on[axis]]) for each in (*columns.values(), residual)] for axis in axes]
        ),
    )
    return Flown(names, intercepts, columns, residual, equations)


def varies(values: Array) -> float:
    return float(np.sum((values - values.mean()) ** 2))


FLIGHTS = [flown(seed) for seed in range(7)]


def beside(
    flight: Flown,
    shape_terms: dict[str, float],
    terms: Sequence[int],
    freed: Sequence[int],
    fixed: Sequence[int],
) -> Array:
    """Columns of nuisances, trims first, on top of the rows of their priors; zero where the flight
    lacks one."""
    found, prior = [*flight.intercepts.T], [0.0] * flight.intercepts.shape[1]
    for place in terms:
        found.append(flight.columns.get(NAMES[place], np.zeros(len(flight.residual))))
        prior.append(0.0)
    for name, sigma in shape_terms.items():
        found.append(apart(flight, name))
        prior.append(1.0 / sigma)
    for place in SENSOR_PLACES:
        if place not in fixed:
            found.append(flight.columns.get(NAMES[place], np.zeros(len(flight.residual))))
            prior.append(0.0 if place in freed else 1.0 / float(LIBRARY[place].prior_sigma or 1.0))
    return np.vstack([np.column_stack(found), np.diag(prior)])


def level(flight: Flown, column: Array) -> Array:
    return np.asarray(
        column - flight.intercepts @ np.linalg.lstsq(flight.intercepts, column, rcond=None)[0]
    )


def apart(flight: Flown, name: str) -> Array:
    """A companion without the part of its term that is in it, beyond the levels of both."""
    term = flight.columns[NAMES[SHAPES[name]]]
    own, column = level(flight, term), level(flight, flight.columns[name])
    return np.asarray(
        flight.columns[name] - term * ((own @ column) / (own @ own) if own @ own > 0.0 else 0.0)
    )


def direct(flight: Flown, place: int, design: Array, response: Array) -> tuple[float, float]:
    """Estimate and information of one hypothesis beside a design; the column of its own in it, if
    there is one, is taken out."""
    column = flight.columns.get(NAMES[place], np.zeros(len(response)))
    if place in OFFSET_PLACES:
        design = design[
            :,
            [
                n
                for n in range(design.shape[1])
                if not np.array_equal(design[: len(column), n], column)
            ],
        ]
    own = np.r_[column, np.zeros(len(design) - len(column))]
    same = [n for n in range(design.shape[1]) if np.array_equal(design[: len(column), n], column)]
    design = np.delete(design, same, axis=1)
    design = design[:, np.any(design != 0.0, axis=0)]
    left = own - design @ np.linalg.lstsq(design, own, rcond=None)[0]
    right = np.r_[response, np.zeros(len(design) - len(column))]
    return float(left @ right / (left @ left)), float(left @ left)


def sizes(terms: Sequence[int], freed: Sequence[int], fixed: Sequence[int]) -> dict[int, float]:
    """Common value of each term where its shape is taken to be right."""
    found = {}
    for place in terms:
        each = [
            direct(f, place, beside(f, {}, terms, freed, fixed), f.residual)
            for f in FLIGHTS
            if shown(f, place)
        ]
        found[place] = sum(value * weight for value, weight in each) / sum(
            weight for _, weight in each
        )
    return found


def shown(flight: Flown, place: int) -> bool:
    return bool(np.any(flight.columns.get(NAMES[place], np.zeros(1)) != 0.0))


def tolerances(values: dict[int, float]) -> dict[str, float]:
    """Prior sigma of each companion of the terms."""
    found = {}
    for name, place in SHAPES.items():
        if place in values:
            own = sum(float(np.sum(level(f, f.columns[NAMES[place]]) ** 2)) for f in FLIGHTS)
            rest = sum(float(np.sum(level(f, apart(f, name)) ** 2)) for f in FLIGHTS)
            found[name] = (
                TOLERANCE
                * abs(values[place])
                / max(np.sqrt(rest / own), LEAST[name[name.index("~") :]])
            )
    return found


@pytest.fixture(scope="module")
def made() -> Campaign:
    return campaign([f.equations for f in FLIGHTS], LIBRARY)


@pytest.mark.parametrize("terms", [(), (0,), (0, 1, 2), (0, 4)])
@pytest.mark.parametrize(("freed", "fixed"), [((), ()), ((6,), ()), ((), (8,)), ((7, 6), (8,))])
def test_a_model_is_solved_as_least_squares_solve_it(
    made: Campaign, terms: tuple[int, ...], freed: tuple[int, ...], fixed: tuple[int, ...]
) -> None:
    estimates = made.flight_estimates(terms, freed, fixed)
    real = [place for place in terms if place not in OFFSET_PLACES]
    shape_terms = tolerances(sizes(real, freed, fixed))
    for row, flight in enumerate(FLIGHTS):
        design = beside(flight, shape_terms, real, freed, fixed)
        for place in range(len(LIBRARY)):
            if (
                not shown(flight, place) or place in fixed
            ):  # no vote; of sensors there is the trace of ridge
                assert estimates.information[row, place] <= 1e-9 * made.scale[place] ** 2
                continue
            estimate, information = direct(flight, place, design, flight.residual)
            assert estimates.estimate[row, place] == pytest.approx(estimate, rel=1e-6, abs=1e-9)
            assert estimates.information[row, place] == pytest.approx(information, rel=1e-6)
            sensor_bias = estimates.biases.at([place])[0].sensor_bias[row]
            for number, sensor in enumerate(SENSOR_PLACES):
                changed = sensor == place or sensor in (*freed, *fixed) or not shown(flight, sensor)
                error = (
                    0.0
                    if changed
                    else direct(flight, place, design, flight.columns[NAMES[sensor]])[0]
                )
                assert sensor_bias[number] == pytest.approx(error, rel=1e-5, abs=1e-7)


@pytest.mark.parametrize("terms", [(), (0,), (0, 2), (0, 1, 3)])
def test_noise_is_what_is_left_on_an_axis_when_its_terms_are_taken_away(
    made: Campaign, terms: tuple[int, ...]
) -> None:
    estimates = made.flight_estimates(terms, ())
    noise_left = made.noise_left(terms, ())
    if not terms:
        assert noise_left is None
        return
    assert noise_left is not None
    for row, flight in enumerate(FLIGHTS):
        for place in range(4):
            if not shown(flight, place) or LIBRARY[place].axes[0] not in flight.equations.axes:
                continue
            on = flight.columns[NAMES[place]] != 0.0
            rest = flight.residual.copy()
            for each in terms:
                size = estimates.estimate[row, each]
                column = flight.columns.get(NAMES[each], np.zeros(len(rest)))
                rest -= (0.0 if np.isnan(size) else size) * column
            expected = min(varies(rest[on]) / varies(flight.residual[on]), 1.0)
            assert noise_left[row, place] == pytest.approx(expected, rel=1e-6)


def test_the_shift_follows_from_the_noisy_copies_and_the_flights(made: Campaign) -> None:
    """Information and cross-product are linear in the noise: once less the noise is twice the
    flights' less the copies'. Under the priors of the flights themselves: so only where the noisy
    normal equations are made the flights' own. With more than a quarter of noise, all of it may be
    noise."""
    alone = campaign(
        [replace(f.equations, noisy=f.equations.matrix) for f in FLIGHTS], LIBRARY
    ).flight_estimates((0, 2), (6,))
    noisy = campaign(
        [replace(f.equations, matrix=f.equations.noisy, noisy=None) for f in FLIGHTS], LIBRARY
    ).flight_estimates((), (6,))
    plain = made.flight_estimates((), (6,))
    for place in (1, 3, 4, 6, 7):
        assert np.nanmax(np.abs(alone.biases.at([place])[0].simex_bias)) == pytest.approx(
            0.0, abs=1e-12
        )
        simex_bias = plain.biases.at([place])[0].simex_bias
        before, after = plain.information[:, place], noisy.information[:, place]
        signal = 2.0 * before - after
        cross = 2.0 * before * plain.estimate[:, place] - after * noisy.estimate[:, place]
        own, copies = plain.information_before[:, place], noisy.information_before[:, place]
        trusted = (signal > 0.75 * before) & (2.0 * own - copies > 0.75 * own)
        without = np.where(trusted, cross / signal, 0.0)
        assert np.allclose(
            simex_bias,
            plain.estimate[:, place] - without,
            rtol=1e-7,
            atol=1e-9,
            equal_nan=True,
        )
        assert np.nanmax(np.abs(simex_bias)) > 1e-4


def test_what_is_asked_for_late_or_alone_is_what_was_there_at_once(made: Campaign) -> None:
    fresh = campaign([f.equations for f in FLIGHTS], LIBRARY)
    whole = made.flight_estimates((0, 2), (6,)).biases.at(range(len(LIBRARY)))
    for place in reversed(range(len(LIBRARY))):
        found = fresh.flight_estimates((2, 0), (6,)).biases.at([place])[0]
        assert np.allclose(found.sensor_bias, whole[place].sensor_bias, rtol=1e-9, atol=1e-12)
        assert np.allclose(
            found.simex_bias, whole[place].simex_bias, rtol=1e-9, atol=1e-12, equal_nan=True
        )
    tests = CrossFlightTests(made, (0, 1, 3, 4), TracingSettings())
    test = tests.tested((0, 2), (6,), fixed=(8,))
    for place in (1, 3, 7):
        assert tests.gain(place, (0, 2), (6,), (8,)) == pytest.approx(test.gain[place], rel=1e-9)


@pytest.mark.parametrize("flights", [(0, 1, 2, 3, 4, 5, 6), (4, 0, 3, 6, 5)])
def test_screening_by_p_without_a_systematic_bound_loses_nothing(
    made: Campaign, flights: tuple[int, ...]
) -> None:
    """At every level between the p of the hypotheses."""
    intercepts = [0.001, 0.05, 0.1, 0.3, 0.49]
    found = set()
    for level in intercepts:
        tests = CrossFlightTests(made, flights, TracingSettings(level=level))
        for model in (((), ()), ((0,), ()), ((0,), (6,)), ((0, 2), (6, 7))):
            test = tests.tested(*model)
            assert np.array_equal(test.significant, test.adjusted < level)
            assert np.array_equal(test.possible, test.p < level)
            assert np.array_equal(test.p_at([3, 1]), test.p[[3, 1]])
            found |= set(test.significant.tolist())
    assert found == {True, False}


@pytest.mark.parametrize("terms", [(), (0,), (0, 1)])
def test_the_interval_of_a_mean_leaves_out_zero_exactly_if_its_p_is_small(
    made: Campaign, terms: tuple[int, ...]
) -> None:
    """For every hypothesis at many standard errors and sizes, systematic bounds included."""
    tested = CrossFlightTests(made, tuple(range(7)), TracingSettings()).tested(terms, ())
    places = [k for k in range(len(NAMES)) if tested.testable[k] and tested.standard_error[k] > 0.0]
    outside = []
    for size in (0.0, 0.3, 1.0, 3.0, 10.0):
        for error in (0.2, 1.0, 5.0):
            scaled = replace(
                tested,
                mean=size * tested.mean,
                standard_error=error * tested.standard_error,
            )
            for k in places:
                low, high = scaled.not_rejected(k)
                assert low <= scaled.mean[k] <= high
                outside.append(not low <= 0.0 <= high)
                assert outside[-1] == (scaled.p_at([k])[0] < 0.05), (NAMES[k], size, error)
    assert any(outside)
    assert not all(outside)
