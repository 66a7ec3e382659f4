"""Validation: which flights may validate, and errors before and after, worked by hand."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.coefficients.comparison import Comparison
from aerodb.errors import InputError, UnknownNameError
from aerodb.increments.validation import (
    HoldOut,
    choose_hold_out,
    validate_by_leaving_one_out,
    validate_on_held_out,
    worse_axes,
)
from aerodb.nomenclature import FORCE_AXES
from aerodb.tables import wind_to_body

NAMES = tuple(f"f{k:02d}" for k in range(30))


@pytest.mark.parametrize(
    ("flights", "held"), [(5, 2), (8, 2), (10, 2), (13, 3), (15, 3), (20, 4), (30, 6)]
)
def test_the_newest_fifth_and_at_least_two_are_held_out(flights: int, held: int) -> None:
    split = choose_hold_out(NAMES[:flights], {})
    assert split == HoldOut(NAMES[: flights - held], NAMES[flights - held : flights], "held-out")


@pytest.mark.parametrize("flights", [2, 3, 4])
def test_below_five_flights_each_is_left_out_in_turn(flights: int) -> None:
    assert choose_hold_out(NAMES[:flights], {}) == HoldOut(NAMES[:flights], (), "cross-validated")


def test_a_single_flight_proves_nothing() -> None:
    assert choose_hold_out(NAMES[:1], {}) == HoldOut(("f00",), (), "not validated")


def test_roles_are_fixed_along_a_line() -> None:
    """The newest two identified an ancestor: they identify again, and those next in age
    validate."""
    used = {"f06": "identified", "f07": "identified"}
    assert choose_hold_out(NAMES[:8], used).held_out == ("f04", "f05")
    # Held out before: held out again, although older; only what is lacking to the fifth is taken
    # from the new ones.
    assert choose_hold_out(NAMES[:8], {"f00": "held_out"}).held_out == ("f00", "f07")
    assert (
        choose_hold_out(
            NAMES[:8], {"f00": "held_out", "f01": "held_out", "f02": "held_out"}
        ).held_out
        == NAMES[:3]
    )
    # Excluded flights have no role that binds them.
    assert choose_hold_out(NAMES[:8], {"f07": "excluded"}).held_out == ("f06", "f07")
    # Also below five: a flight that was held out stays so.
    assert choose_hold_out(NAMES[:3], {"f00": "held_out"}) == HoldOut(
        ("f01", "f02"), ("f00",), "held-out"
    )


@pytest.mark.parametrize("flights", [3, 6])
def test_flights_that_made_the_baseline_do_not_cross_validate_what_is_built_on_it(
    flights: int,
) -> None:
    """Leaving one out leaves it in the baseline: a second update on the same flights was once
    called cross-validated."""
    used = dict.fromkeys(NAMES[:flights], "identified")
    assert choose_hold_out(NAMES[:flights], used) == HoldOut(NAMES[:flights], (), "not validated")
    assert choose_hold_out(NAMES[:3], {"f00": "identified"}).kind == "not validated"


def test_requested_flights_are_held_out_and_no_others() -> None:
    assert choose_hold_out(NAMES[:8], {}, ["f03"]) == HoldOut(
        tuple(n for n in NAMES[:8] if n != "f03"), ("f03",), "held-out"
    )
    assert choose_hold_out(NAMES[:3], {}, ["f01"]).kind == "held-out"
    assert choose_hold_out(NAMES[:8], {}, []) == HoldOut(NAMES[:8], (), "not validated")
    assert choose_hold_out(NAMES[:8], {"f00": "held_out"}, ["f03"]).held_out == ("f00", "f03")


def test_requests_that_break_the_rules_are_refused() -> None:
    with pytest.raises(
        UnknownNameError, match="'f0x' is not among these flights\ndid you mean 'f0"
    ):
        choose_hold_out(NAMES[:8], {}, ["f0x"])
    with pytest.raises(InputError, match="'f01' identified an earlier version of this line"):
        choose_hold_out(NAMES[:8], {"f01": "identified"}, ["f01"])
    with pytest.raises(InputError, match="every flight is held out"):
        choose_hold_out(NAMES[:2], {}, ["f00", "f01"])
    with pytest.raises(InputError, match="every flight is held out"):
        choose_hold_out(NAMES[:1], {"f00": "held_out"})


def compared(
    flight: str, measured: list[float], residual: list[float], sigma: float, bad: int | None = None
) -> Comparison:
    """A comparison on CZ of a few samples; sample `bad` is not usable."""
    values, n = np.array(measured), len(measured)
    usable = np.ones(n, dtype=bool)
    if bad is not None:
        usable[bad] = False
    return Comparison(
        flight=flight,
        time=np.arange(n) * 1.0,
        measured={"CZ": values},
        sigma={"CZ": np.full(n, sigma)},
        predicted={"CZ": values - np.array(residual)},
        usable={"CZ": usable},
        outside=np.zeros(n, dtype=bool),
        bandwidth=None,
        notes=(),
    )


@pytest.mark.parametrize(("grown", "worse"), [(0.9, set()), (1.009, set()), (1.011, {"CZ"})])
def test_an_axis_is_worse_when_its_error_grew_beyond_what_counts_as_unchanged(
    grown: float, worse: set[str]
) -> None:
    before = {name: compared(name, [1, 2, 3], [3, -5, 1e6], 0.1, bad=2) for name in "ab"}
    after = {
        "a": before["a"],
        "b": compared("b", [1, 2, 3], [3 * grown, -5 * grown, 0], 0.1, bad=2),
    }
    pooled = {
        name: compared(name, [1, 2, 3], [3 * grown, -5 * grown, 0], 0.1, bad=2) for name in "ab"
    }
    assert worse_axes(before, pooled) == worse
    assert worse_axes(before, after) == set()


def test_an_axis_is_not_worse_when_its_level_is_anothers_and_its_changes_are_met_better() -> None:
    """An effect of a surface that is out in half of the samples, on an axis whose level is off by
    .6; the effect hides a part of that."""
    out = np.repeat([0.0, 1.0], 20)
    ripple = 0.1 * np.tile([1.0, -1.0], 20)
    lacking = 0.6 - 0.5 * out + ripple
    measured = list(3.0 + ripple)
    before = {"a": compared("a", measured, list(lacking), 0.1)}
    added = (
        (0.5 * out, set()),  # right: the level was off where it is nil, too
        (0.5 * out + 0.2, {"CZ"}),  # it shifts all samples
        (-0.5 * out, {"CZ"}),  # the changes are met worse
    )
    for effect, worse in added:
        after = {"a": compared("a", measured, list(lacking + effect), 0.1)}
        assert worse_axes(before, after) == worse


@pytest.mark.parametrize(("ripple", "worse"), [(1.02, set()), (1.2, {"CZ"})])
def test_a_repaired_level_outweighs_a_chance_growth_about_the_mean(
    ripple: float, worse: set[str]
) -> None:
    """A level of .5 is gone; the error about the mean, .1, has grown."""
    changes = 0.1 * np.tile([1.0, -1.0], 20)
    measured = list(3.0 + changes)
    before = {"a": compared("a", measured, list(0.5 + changes), 0.1)}
    after = {"a": compared("a", measured, list(ripple * changes), 0.1)}
    assert worse_axes(before, after) == worse


def test_a_repaired_lift_may_bare_what_its_error_had_hidden_along_x() -> None:
    """Lift lacks .3; drag is .02 too small in the database, of which the lift's part along x hides
    most at alpha = .06 rad. A drag that becomes worse counts, on both of its axes."""
    rng, alpha = np.random.default_rng(5), np.full(40, 0.06)
    ripple = 0.001 * rng.standard_normal(40)

    def beside(drag: float, lift: float) -> dict[str, Comparison]:
        residual = {"C_drag": drag + ripple, "C_side": ripple, "C_lift": lift + ripple}
        body = wind_to_body(*residual.values(), alpha, 0.0 * alpha)
        left = dict(zip(FORCE_AXES, body, strict=True)) | residual
        zero, usable = np.zeros(40), dict.fromkeys(left, np.ones(40, dtype=bool))
        sigma = {axis: np.full(40, 0.001) for axis in left}
        made = Comparison("a", np.arange(40.0), left, sigma, dict.fromkeys(left, zero), usable,
                          outside=zero > 0, bandwidth=None, notes=())  # fmt: skip
        return {"a": made}

    first = beside(0.02, 0.3)
    along_x = [float(np.abs(each["a"].residual("CX")).mean()) for each in (first, beside(0.02, 0))]
    assert along_x[1] > 5.0 * along_x[0]
    assert worse_axes(first, beside(0.02, 0.0)) == set()
    assert worse_axes(first, beside(0.05, 0.0)) == {"CX"}


SPLIT = HoldOut(("a",), ("b",), "held-out")


def test_numbers_by_hand() -> None:
    """Identified: rms of (3, 4) and of (0, 1). Held out: (3, 5) and (1, 2, ...) with a bad sample
    that must not count."""
    before = {
        "a": compared("a", [1, 2], [3, 4], 0.1),
        "b": compared("b", [10, -10, 0], [3, 5, 1e6], 0.6, bad=2),
    }
    after = {
        "a": compared("a", [1, 2], [0, 1], 0.1),
        "b": compared("b", [10, -10, 0], [1, 2, 1e6], 0.6, bad=2),
    }
    (validation,) = validate_on_held_out(before, after, SPLIT)
    assert validation.axis == "CZ"
    assert validation.rms_before == pytest.approx(np.sqrt(12.5))
    assert validation.rms_after == pytest.approx(np.sqrt(0.5))
    assert validation.held_out_rms_before == pytest.approx(np.sqrt(17.0))
    assert validation.held_out_rms_after == pytest.approx(np.sqrt(2.5))
    assert validation.held_out_shape_before == pytest.approx(1.0)
    assert validation.held_out_shape_after == pytest.approx(0.5)
    assert validation.noise_floor == pytest.approx(0.6)
    assert validation.excess_before == pytest.approx(np.sqrt(17.0 - 0.36))
    assert validation.excess_after == pytest.approx(np.sqrt(2.5 - 0.36))
    assert validation.explained == pytest.approx(1.0 - 2.5 / 100.0)
    assert validation.outcome == "improved"
    # Theil: predicted (9, -12) against (10, -10): errors (-1, -2), mean -1.5; spreads 10.5 and 10.
    assert validation.theil is not None
    size = np.sqrt((81 + 144) / 2) + 10.0
    assert validation.theil.fit_percent == pytest.approx(100 * (1 - np.sqrt(2.5) / size))
    assert validation.theil.bias == pytest.approx(2.25 / 2.5)
    assert validation.theil.variance == pytest.approx(0.25 / 2.5)
    assert validation.theil.covariance == pytest.approx(0.0, abs=1e-12)


def test_the_error_cannot_fall_below_nothing() -> None:
    before = {"a": compared("a", [1, 2], [3, 4], 0.1), "b": compared("b", [10, -10], [3, 5], 2.0)}
    after = {"a": compared("a", [1, 2], [0, 1], 0.1), "b": compared("b", [10, -10], [1, 2], 2.0)}
    (validation,) = validate_on_held_out(before, after, SPLIT)
    assert validation.excess_after == 0.0
    assert validation.outcome == "at noise floor"


@pytest.mark.parametrize(
    ("held_before", "held_after", "sigma", "outcome"),
    [
        ([3.0, -3.0], [1.24, -1.24], 1.0, "at noise floor"),
        ([3.0, -3.0], [1.3, -1.3], 1.0, "improved"),
        ([3.0, -3.0], [2.98, -2.98], 1.0, "unchanged"),
        ([3.0, -3.0], [3.2, -3.2], 1.0, "worse"),
        ([9.0, -9.0], [8.0, -8.0], 1.0, "not repaired"),
        ([9.0, -9.0], [11.0, -11.0], 1.0, "not repaired"),
    ],
)
def test_outcomes(
    held_before: list[float], held_after: list[float], sigma: float, outcome: str
) -> None:
    """Measured +-10: an error of 8 leaves 36 % of the variance explained, less than half."""
    before = {
        "a": compared("a", [10, -10], [1, 1], sigma),
        "b": compared("b", [10, -10], held_before, sigma),
    }
    after = {
        "a": compared("a", [10, -10], [0, 0], sigma),
        "b": compared("b", [10, -10], held_after, sigma),
    }
    assert validate_on_held_out(before, after, SPLIT)[0].outcome == outcome


def test_without_held_out_flights_the_numbers_are_those_that_identified() -> None:
    before, after = (
        {"a": compared("a", [1, 2], [3, 4], 0.1)},
        {"a": compared("a", [1, 2], [0, 1], 0.1)},
    )
    (validation,) = validate_on_held_out(before, after, HoldOut(("a",), (), "not validated"))
    assert (
        validation.held_out_rms_before,
        validation.held_out_rms_after,
        validation.excess_after,
    ) == (
        None,
        None,
        None,
    )
    assert validation.rms_after == pytest.approx(np.sqrt(0.5))


def test_leaving_one_out_scores_each_flight_by_the_others() -> None:
    before = {name: compared(name, [10, -10], [4, -4], 0.1) for name in "abc"}
    after = {name: compared(name, [10, -10], [1, -1], 0.1) for name in "abc"}
    asked = []

    def without(flight: str) -> Comparison:
        asked.append(flight)
        return compared(flight, [10, -10], [2, -2], 0.1)

    (validation,) = validate_by_leaving_one_out(before, after, without)
    assert asked == ["a", "b", "c"]
    assert (validation.rms_before, validation.rms_after) == (pytest.approx(4.0), pytest.approx(1.0))
    assert (validation.held_out_rms_before, validation.held_out_rms_after) == (
        pytest.approx(4.0),
        pytest.approx(2.0),
    )


def test_an_axis_that_a_held_out_flight_lacks_is_judged_on_the_others() -> None:
    lacking = replace(
        compared("b", [10, -10], [3, 5], 0.1), usable={}, measured={}, predicted={}, sigma={}
    )
    sides = [{"a": compared("a", [10, -10], [k, -k], 0.1), "b": lacking} for k in (4, 1)]
    (validation,) = validate_on_held_out(*sides, SPLIT)
    assert validation.held_out_rms_after is None
    assert validation.rms_after == pytest.approx(1.0)
    assert validation.outcome == "improved"
    nothing = [
        {"a": compared("a", [10, -10], [k, -k], 0.1), "b": compared("b", [1], [k], 0.1, bad=0)}
        for k in (4, 1)
    ]
    assert validate_on_held_out(*nothing, SPLIT)[0].held_out_rms_after is None
