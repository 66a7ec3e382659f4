"""Effects that differ between flights: slopes against direct least squares, planted dependences on
dynamic pressure, Mach number and angle of attack, and none where none is planted, with sensors as
their priors allow them.
"""

from collections.abc import Mapping
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from aerodb.flight import Flight
from aerodb.loop.between_flights import conditions_of
from aerodb.support.arrays import Array
from aerodb.tracing.decision.between_flights import FEWEST, _slope, dependences_on_conditions
from aerodb.tracing.decision.verdicts import trace
from aerodb.tracing.evidence.normal_equations import normal_equations_of
from aerodb.tracing.settings import TracingSettings
from tests.support import varied_flights as varied
from tests.support.golden import same
from tests.support.tracing_small import LIBRARY, evidence

FIRST = LIBRARY[0].id


def test_a_slope_is_that_of_weighted_least_squares() -> None:
    generator = np.random.default_rng(1)
    z, estimate = generator.uniform(1.0, 3.0, 9), generator.standard_normal((9, 1))
    information = generator.uniform(1.0, 20.0, (9, 1))
    test = SimpleNamespace(included=np.ones((9, 1), dtype=bool))
    estimates = SimpleNamespace(estimate=estimate, information=information)
    slope = _slope(0, "qbar", z, test, estimates)  # type: ignore[arg-type]
    assert slope is not None
    variance = 1.0 / information[:, 0]
    weight = 1.0 / (variance + variance.mean())
    fit, covariance = np.polyfit(z, estimate[:, 0], 1, w=np.sqrt(weight), cov=True)
    assert slope.slope == pytest.approx(fit[0])
    assert slope.factor * slope.scale == pytest.approx(covariance[0, 0])
    assert slope.lever @ estimate[:, 0] == pytest.approx(fit[0])
    design = np.column_stack([z, np.ones(9)]) * np.sqrt(weight)[:, None]
    left = np.eye(9) - design @ np.linalg.pinv(design)
    assert slope.expected == pytest.approx(np.trace(left @ np.diag(weight * variance)) / 7)


def test_a_slope_that_rests_on_one_flight_is_none() -> None:
    z, ones = np.r_[np.linspace(1.0, 1.1, 7), 4.0], np.ones((8, 1))
    test = SimpleNamespace(included=np.ones((8, 1), dtype=bool))
    estimates = SimpleNamespace(estimate=ones, information=ones)
    assert _slope(0, "qbar", z, test, estimates) is None  # type: ignore[arg-type]


def differing(size: float, count: int = 6) -> tuple[list[str], Mapping[str, float]]:
    """Hypotheses claimed of small flights whose first term grows with a condition."""
    made, condition = [], {}
    for seed in range(count):
        flight = evidence(seed)
        at = float(seed)
        more = size * (at - 0.5 * (count - 1)) * flight.columns[FIRST]["CX"]
        residual = {**flight.residual, "CX": flight.residual["CX"] + more}
        made.append(normal_equations_of(replace(flight, residual=residual), TracingSettings()))
        condition[flight.flight] = at
    traced = trace(made, LIBRARY, TracingSettings())
    claims = dependences_on_conditions(
        made, LIBRARY, TracingSettings(), traced, {"qbar": condition}, [FIRST]
    )
    return [claim.hypothesis.id for claim in claims], condition


def test_only_what_changes_is_claimed_and_only_from_five_flights() -> None:
    assert differing(0.3)[0] == [FIRST]
    assert differing(0.0)[0] == []
    assert differing(0.3, FEWEST - 1)[0] == []


def aileron(flight: Flight) -> dict[str, Array]:
    """An aileron that loses with dynamic pressure."""
    return {"Cl": -flight["delta_aileron"] * (flight["qbar"] - 2300.0)}


def mach_kink(flight: Flight) -> dict[str, Array]:
    """A lift slope that grows from a Mach number on."""
    return {"CZ": -flight["alpha"] * np.maximum(flight["mach"] - 0.19, 0.0)}


def roll_damping(flight: Flight) -> dict[str, Array]:
    """A roll damping that changes with angle of attack."""
    return {"Cl": flight["p"] / flight["V"] * (flight["alpha"] - 0.07)}


#: Planted, its size in noise floors, what is to be said over which condition, flights, and the
#: power asked for.
CASES = (
    (aileron, 5.0, "control_effectiveness@Cl:aileron", "qbar", 8, 0.9),
    (mach_kink, 3.0, "alpha_slope@CZ", "mach", 12, 0.7),
    (roll_damping, 5.0, "roll_damping@Cl", "alpha", 12, 0.4),
)


@pytest.mark.campaign
@pytest.mark.parametrize(("planted", "floors", "name", "over", "flights", "power"), CASES)
def test_what_differs_between_flights_is_said(
    planted: varied.Planted,
    floors: float,
    name: str,
    over: str,
    flights: int,
    power: float,
    capsys: pytest.CaptureFixture[str],
) -> None:
    effect, count = varied.in_floors(planted, floors), 50
    hits, others = 0, 0
    for number in range(count):
        generator = np.random.default_rng([number, flights])
        found = varied.campaign(flights, generator, effect).between
        hits += any(
            claim.hypothesis.id == name and over in (claim.condition, *claim.also)
            for claim in found
        )
        others += any(claim.hypothesis.id != name for claim in found)
    with capsys.disabled():
        print(f"\n{name} over {over}, {flights} flights: {hits} of {count}, others {others}")
    assert hits >= np.floor(power * count)
    assert others <= max(1, 0.1 * count)


def test_one_campaign_says_what_it_always_said() -> None:
    """An aileron that loses with dynamic pressure, eight flights: its slope and interval; of flights
    without it, with sensors as their priors allow, nothing."""
    generator = np.random.default_rng([0, 8])
    found = varied.campaign(8, generator, varied.in_floors(aileron, 5.0)).between
    said = [(c.hypothesis.id, c.condition, *c.also, c.slope, *c.ci95) for c in found]
    known = ("control_effectiveness@Cl:aileron", "mach", "qbar", -1.43, -1.65, -1.2)
    assert same(said, [known])
    errors = [varied.Errors.drawn(generator) for _ in range(6)]
    assert varied.campaign(6, generator, None, errors).between == ()


@pytest.mark.campaign
def test_sensors_as_their_priors_allow_differ_no_effect(capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing planted: sensors right, wrong in all flights alike, wrong in each flight anew; six,
    eight and twelve flights. Limit: 5 % of the campaigns."""
    claims, count = 0, 0
    for flights in (8, 6, 12):
        for kind in ("right", "alike", "each"):
            for number in range(40):
                generator = np.random.default_rng([number, flights, len(kind)])
                alike = varied.Errors.drawn(generator)
                errors = {
                    "right": [varied.RIGHT] * flights,
                    "alike": [alike] * flights,
                    "each": [varied.Errors.drawn(generator) for _ in range(flights)],
                }[kind]
                claims += bool(varied.campaign(flights, generator, None, errors).between)
                count += 1
    with capsys.disabled():
        print(f"\nnothing planted: {claims} of {count} campaigns claim")
    assert claims <= 0.05 * count


class View(SimpleNamespace):
    """What is asked of a flight's view for its conditions."""

    def __getitem__(self, name: str) -> Array:
        return np.asarray(self.channels[name])

    def has(self, names: list[str]) -> bool:
        return set(names) <= set(self.channels)


def view(name: str, speed: float, flap: float) -> View:
    each = {
        "qbar": 0.6 * speed**2,
        "mach": speed / 340.0,
        "alpha": 0.05,
        "mass": 1000.0 + 1e-3 * speed,
        "delta_flap": flap,
    }
    return View(
        flight=name,
        vehicle=varied.vehicle(),
        channels={channel: np.full(9, value) for channel, value in each.items()},
        usable={"CX": np.ones(9, dtype=bool)},
    )


def test_conditions_are_those_that_differ() -> None:
    differing = [view("a", 50.0, 0.0), view("b", 60.0, 0.3), view("c", 70.0, 0.3)]
    found = conditions_of(differing)  # type: ignore[arg-type]
    assert set(found) == {"qbar", "mach", "delta_flap"}
    assert found["qbar"]["b"] == pytest.approx(2160.0)
    alike = [view(name, 60.0, 0.2) for name in "abc"]
    assert conditions_of(alike) == {}  # type: ignore[arg-type]
