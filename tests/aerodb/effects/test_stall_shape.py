"""Shapes of a stall: planted ones are found, a static break is not taken for memory, and nothing is
found in noise."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.coefficients.comparison import Comparison, with_states
from aerodb.effects.flight_view import view_of
from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.stall.stall_hysteresis import TEMPLATE, stall_hypotheses, with_stall
from aerodb.effects.stall.stall_shape import (
    FAMILIES,
    STALL_GAIN_BOUNDS,
    Shape,
    StallFlight,
    cross_fit_shapes,
    fit_shape,
    lift_factor,
)
from aerodb.effects.template import LibraryContext
from aerodb.errors import InputError, UnknownNameError
from aerodb.flight import Flight
from aerodb.tables.increment import Interval
from aerodb.tables.state_model import Kirchhoff, Law, Relay
from tests.support.attas_stalls import attas, empty_database

CHORD = 3.159
TRUTH = Kirchhoff(sharpness=60.0, alpha_star=0.28, lag=20.0)
TRUE_GAINS = {"C_lift": 1.5, "C_drag": 0.05, "Cm": -0.08}
STATIC = ("static_separation", "slope_break", "square_break", "alpha_squared")


def stall(
    seed: int, law: Law | None, gains: dict[str, float] | None = None, alpha_max: float = 0.28
) -> StallFlight:
    """Two minutes: slowly up into a stall, quickly down, some waves; with buffet-like noise of .02,
    .006 and .01."""
    rng, time = np.random.default_rng(seed), np.arange(0.0, 120.0, 0.04)
    peak, floor = alpha_max + 0.01 * rng.standard_normal(), 0.08
    up, down = (
        0.09 + (peak - 0.09) * np.clip(time / 85.0, 0, 1) ** 2,
        np.clip((time - 85.0) / (3.0 + rng.uniform(0, 1.5)), 0, 1),
    )
    alpha = (
        up
        + (floor - up) * (3 * down**2 - 2 * down**3)
        + 0.02 * np.sin(0.7 * time + rng.uniform(0, 6)) * (time > 92)
    )
    speed = 98.0 - 34.0 * np.clip(time / 85.0, 0, 1) + 20.0 * np.clip((time - 85) / 35.0, 0, 1)
    flight = StallFlight(
        f"stall-{seed}", time, alpha, speed, CHORD, {}, {}, np.ones(len(time), dtype=bool)
    )
    q_hat = np.gradient(alpha, time) * CHORD / (2 * speed)
    residual, nuisance = {}, {}
    for axis, noise in zip(STALL_GAIN_BOUNDS, (0.02, 0.006, 0.01), strict=True):
        coloured = np.convolve(rng.standard_normal(len(time) + 24), np.ones(25) / 5.0, "valid")
        nuisance[axis] = np.column_stack([np.ones(len(time)), alpha, q_hat])
        residual[axis] = nuisance[axis] @ np.array([0.01, -0.1, 1.0]) + noise * coloured
        if law is not None:
            attached = flight.attached(law)
            column = alpha * lift_factor(attached) if axis == "C_lift" else 1.0 - attached
            residual[axis] = residual[axis] + (gains or TRUE_GAINS)[axis] * column
    return replace(flight, residual=residual, nuisance=nuisance)


def test_planted_shape_and_gains_are_recovered():
    shape = fit_shape([stall(seed, TRUTH) for seed in (1, 2, 3)], "kirchhoff")
    assert shape.parameters["alpha_star"] == pytest.approx(0.28, abs=0.005)
    assert shape.parameters["lag"] == pytest.approx(20.0, abs=4.0)
    assert shape.parameters["sharpness"] == pytest.approx(60.0, rel=0.35)
    assert shape.at_bound == ()
    for axis, gain in TRUE_GAINS.items():
        assert shape.gains[axis] == pytest.approx(gain, rel=0.15), axis
    assert shape.flights == ("stall-1", "stall-2", "stall-3")


def test_planted_relay_is_told_from_smooth_separation():
    flights = [stall(seed, Relay(0.15, 0.265)) for seed in (4, 5)]
    relay = fit_shape(flights, "relay")
    assert relay.parameters["alpha_low"] == pytest.approx(0.15, abs=0.015)
    assert relay.parameters["alpha_high"] == pytest.approx(0.265, abs=0.006)
    assert relay.cost < min(fit_shape(flights, family).cost for family in ("kirchhoff", *STATIC))


def test_memory_is_named_before_every_static_family_and_the_other_way_round():
    """Same flights, the truth with and without its lag: memory predicts the other flights better,
    or no better."""
    late = [stall(seed, TRUTH) for seed in (6, 7, 8)]
    prompt = [stall(seed, replace(TRUTH, lag=0.0, alpha_star=0.25)) for seed in (6, 7, 8)]
    assert _predicted(late, "kirchhoff") < 0.9 * min(_predicted(late, family) for family in STATIC)
    assert _predicted(prompt, "static_separation") < 1.01 * _predicted(prompt, "kirchhoff")
    assert fit_shape(prompt, "kirchhoff").parameters["lag"] < 5.0


def test_without_a_stall_the_gains_are_noise():
    """Nothing is missing: what the best of all shapes explains of one flight does not help on the
    others."""
    flights = [stall(seed, None) for seed in range(10, 16)]
    plain = sum(
        _rest(flight, np.linalg.lstsq(*_pooled(flights, flight), rcond=None)[0])
        for flight in flights
    )
    assert _predicted(flights, "kirchhoff", axis="C_lift") > 0.995 * plain


def _pooled(flights: list[StallFlight], left_out: StallFlight) -> tuple[np.ndarray, np.ndarray]:
    kept = [flight for flight in flights if flight is not left_out]
    return np.concatenate([f.nuisance["C_lift"] for f in kept]), np.concatenate(
        [f.residual["C_lift"] for f in kept]
    )


def _rest(flight: StallFlight, values: np.ndarray) -> float:
    return float(np.sum((flight.residual["C_lift"] - flight.nuisance["C_lift"] @ values) ** 2))


def _predicted(flights: list[StallFlight], family: str, axis: str = "C_lift") -> float:
    """Sum of squares that is left of every flight when the others chose the shape."""
    shapes = cross_fit_shapes(flights, family)
    return sum(
        float(np.sum(shapes[flight.flight].unexplained(flight)[axis] ** 2)) for flight in flights
    )


def test_shapes_stay_where_the_data_are():
    """A flight that never stalls: no gain is offered for flow that it does not separate, and angles
    stay near its own."""
    calm = stall(20, None, alpha_max=0.15)
    for family in FAMILIES:
        limits = FAMILIES[family].limits([calm])
        assert all(
            high <= 0.3
            for name, (_, high) in zip(FAMILIES[family].names, limits, strict=True)
            if "alpha" in name
        )
    shape = fit_shape([calm], "kirchhoff")
    assert np.min(calm.attached(shape.law)) < 0.5
    assert 0.0 <= shape.gains["C_lift"] <= 7.0


@pytest.mark.parametrize(
    ("call", "error", "named"),
    [
        (lambda: fit_shape([], "kirchhoff"), InputError, "no flight"),
        (lambda: fit_shape([stall(1, None)], "kirchhof"), UnknownNameError, "kirchhoff"),
        (lambda: cross_fit_shapes([stall(1, None)], "kirchhoff"), InputError, "second stall"),
        (lambda: fit_shape([stall(1, None)], "kirchhoff", axes=("CY",)), InputError, "axes"),
    ],
)
def test_what_cannot_be_answered_is_refused(call, error, named):
    with pytest.raises(error, match=named):
        call()


# As hypotheses for tracing, and added to a database


def flight_with(law: Law, seed: int = 30) -> Flight:
    source = stall(seed, None)
    zero = np.zeros(len(source.time))
    channels = {
        "alpha": source.alpha,
        "V": source.V,
        "beta": zero + 0.02,
        "qbar": 0.5 * 0.72 * source.V**2,
        "thrust": zero,
    }
    return Flight(source.flight, "attas", source.time, {**channels, **dict.fromkeys("pqr", zero)})


def in_the_air(flight: Flight) -> Comparison:
    axes = ("CX", "CY", "CZ", "Cl", "Cm", "Cn")
    zero, good = (
        dict.fromkeys(axes, np.zeros(len(flight.time))),
        np.ones(len(flight.time), dtype=bool),
    )
    return Comparison(
        flight.id, flight.time, zero, zero, zero, dict.fromkeys(axes, good), ~good, 5.0, ()
    )


def columns_of(flight: Flight, found: list[Hypothesis]) -> dict[str, dict[str, np.ndarray]]:
    view = view_of(flight, in_the_air(flight), empty_database(), attas())
    return {hypothesis.id: dict(hypothesis.columns(view)) for hypothesis in found}


def context(flight: Flight) -> LibraryContext:
    return LibraryContext(empty_database(), attas(), frozenset(flight.channels))


@pytest.mark.parametrize("law", [TRUTH, Relay(0.15, 0.27)])
def test_a_column_is_what_the_added_effect_changes(law):
    """The finding added to the database changes the prediction of a flight by its column times its
    value, on every axis."""
    flight = flight_with(law)
    columns = columns_of(flight, stall_hypotheses(context(flight), law))
    assert sorted(columns) == [f"stall_hysteresis@{axis}" for axis in ("C_drag", "C_lift", "Cm")]
    envelope = {"alpha": Interval(0.0, 0.35, 0.02)}
    for axis, gain in TRUE_GAINS.items():
        candidate = with_stall(empty_database(), law, {axis: (gain, 0.01)}, envelope, (flight.id,))
        filled = with_states(flight, candidate)
        after = candidate.predict(dict(filled.channels)).coefficients
        column = columns[f"stall_hysteresis@{axis}"]
        assert max(np.max(np.abs(values)) for values in column.values()) > 0.05
        for body in ("CX", "CY", "CZ", "Cl", "Cm", "Cn"):
            assert after[body] == pytest.approx(
                gain * column.get(body, np.zeros(1)) + 0 * flight.time, abs=1e-12
            ), (axis, body)


def test_cross_fitted_laws_reach_their_own_flights_only():
    flight, other = flight_with(TRUTH), replace(flight_with(TRUTH), id="another")
    found = stall_hypotheses(context(flight), {flight.id: TRUTH})
    assert all(columns for columns in columns_of(flight, found).values())
    assert not any(
        values.any() for columns in columns_of(other, found).values() for values in columns.values()
    )
    assert (
        found[0].formula != stall_hypotheses(context(flight), TRUTH)[0].formula
    )  # part of the library's hash
    assert [h.effect for h in TEMPLATE.hypotheses(context(flight))] == ["stall_hysteresis"] * 3


def test_a_second_stall_model_is_refused():
    once = with_stall(empty_database(), TRUTH, {"Cm": (-0.1, 0.01)}, {}, ())
    with pytest.raises(InputError, match="already"):
        with_stall(once, TRUTH, {"Cm": (-0.1, 0.01)}, {}, ())
    with pytest.raises(InputError, match="Cm"):
        with_stall(empty_database(), TRUTH, {"CM": (-0.1, 0.01)}, {}, ())


def test_a_shape_without_memory_has_no_law():
    flights = [stall(1, TRUTH)]
    assert isinstance(fit_shape(flights, "kirchhoff").law, Kirchhoff)
    static: Shape = fit_shape(flights, "slope_break")
    assert static.law is None
    assert set(static.unexplained(flights[0])) == set(STALL_GAIN_BOUNDS)
