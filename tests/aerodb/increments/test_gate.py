"""The promotion gate: every check refuses for its own reason, with numbers known beforehand, and
only then."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aerodb.exchange.native import database_content_sha256, read_native
from aerodb.increments.acceptable import judge_shapes
from aerodb.increments.estimate import Update, keep_slope_signs
from aerodb.increments.gate import GateVerdict, Standing, judge_release, notes_on_release
from aerodb.increments.held_out import held_out_error
from aerodb.increments.validation import repeatability
from aerodb.tables.analysis.check_cases import CheckCase, failed_check_cases, make_check_cases
from aerodb.tables.analysis.slopes import new_increments, new_sign_changes
from aerodb.tables.database import AeroDatabase, Term
from aerodb.tables.expression import parse
from aerodb.tables.increment import Increment, Interval
from tests.support.small_glider import DATABASE

DEG = np.pi / 180.0
STANDING = Standing("v0002", "v0001", "v0001", True, (), "abc", "abc")


@pytest.fixture(scope="module")
def baseline() -> AeroDatabase:
    """Cm = -0.6 alpha + ...; a lift curve over -4 .. 12 deg."""
    return read_native(DATABASE)


def increment(axis: str, terms: dict[str, float], cell: float = 4.0, **more: Interval) -> Increment:
    """An increment of flights between 2 and 6 deg of alpha."""
    envelope = {"alpha": Interval(2 * DEG, 6 * DEG, cell * DEG), **more}
    estimates = np.array(list(terms.values()))
    covariance = np.diag((0.01 * estimates) ** 2)
    return Increment(
        axis, tuple(parse(term) for term in terms), estimates, covariance, envelope, ("f1", "f2")
    )


def updated(database: AeroDatabase, *increments: Increment) -> AeroDatabase:
    return replace(database, increments=(*database.increments, *increments))


def axes(**changed: dict[str, Any]) -> dict[str, dict[str, Any]]:
    """A report in which CZ improves and Cm stays; `changed` overwrites single numbers of an
    axis."""
    quiet = {"noise_floor": 0.001, "repeatability": 0.0002}
    report: dict[str, dict[str, Any]] = {
        "CZ": {
            "held_out_rms_before": 0.05,
            "held_out_rms_after": 0.01,
            "excess_before": 0.05,
            "excess_after": 0.01,
            **quiet,
        },
        "Cm": {
            "held_out_rms_before": 0.01,
            "held_out_rms_after": 0.01,
            "excess_before": 0.01,
            "excess_after": 0.01,
            **quiet,
        },
    }
    for axis, values in changed.items():
        report[axis] |= values
    return report


def judged(
    baseline: AeroDatabase,
    standing: Standing = STANDING,
    report: Any = None,
    added: Increment | None = None,
) -> GateVerdict:
    candidate = updated(baseline, added or increment("CZ", {"1": -0.02, "alpha": -0.5}))
    return judge_release(
        standing,
        baseline,
        candidate,
        make_check_cases(candidate),
        axes() if report is None else report,
    )


def test_a_proved_version_passes_every_check(baseline: AeroDatabase) -> None:
    verdict = judged(baseline)
    assert verdict.passed
    assert verdict.reasons == ()
    assert len(verdict.checks) == 7
    numbers = {check.label: check.measures for check in verdict.checks}
    whole, single, *_ = numbers["held-out error"]
    assert (whole.of, whole.bound, whole.limit) == ("all axes", "below", whole.before)
    assert whole.value < whole.before
    assert (single.of, single.before, single.limit) == ("CZ", 0.05, None)
    assert {m.of: (m.value, m.limit) for m in numbers["repeatability"]}["CZ"] == (
        pytest.approx(-0.04),
        0.0002,
    )


def test_measures_are_beyond_their_limits_where_the_check_fails(baseline: AeroDatabase) -> None:
    worse = axes(CZ={"excess_after": 0.07, "held_out_rms_after": 0.07})
    for check in judged(baseline, replace(STANDING, stale=("f1 retracted",)), worse).checks:
        beyond = {
            "at most": lambda m: m.value > m.limit,
            "at least": lambda m: m.value < m.limit,
            "below": lambda m: m.value >= m.limit,
        }
        held = [m for m in check.measures if m.limit is not None]
        if held:
            assert check.passed != any(beyond[m.bound](m) for m in held), check.name
    failed = {c.label for c in judged(baseline, report=worse).checks if not c.passed}
    assert failed == {"held-out error", "repeatability"}


@pytest.mark.parametrize(("drag", "passed"), [(0.01, True), (0.02, False)])
def test_a_force_along_x_counts_where_drag_or_lift_became_worse(
    baseline: AeroDatabase, drag: float, passed: bool
) -> None:
    report, quiet = axes(), axes()["Cm"]
    report["CX"] = quiet | {"held_out_rms_after": 0.012}
    report["C_lift"] = report["CZ"]
    report["C_drag"] = quiet | {"held_out_rms_after": drag}
    (check,) = (c for c in judged(baseline, report=report).checks if c.label == "repeatability")
    assert check.passed == passed
    assert ("CX" in {measure.of for measure in check.measures}) != passed


@pytest.mark.parametrize(
    ("changed", "check", "reason"),
    [
        (
            {"released": "v0003", "below_released": False},
            "parent is the released",
            "would silently undo that release",
        ),
        (
            {"parent": "", "below_released": False},
            "parent is the released",
            "v0002 has no parent, but v0001 is released",
        ),
        (
            {"parent": "", "below_released": False},
            "parent is the released",
            "of another flight condition is imported for a vehicle of its own: aerodb vehicle add",
        ),
        ({"parent": "v0004", "released": "v0001"}, "parent is the released", "promote v0004 first"),
        ({"stale": ("flight f1 was retracted",)}, "not stale", "flight f1 was retracted"),
        (
            {"content_sha256": "abd"},
            "content as stored",
            "its numbers have the hash abd, but the stored hash is abc",
        ),
    ],
)
def test_where_a_version_stands_is_judged(
    baseline: AeroDatabase, changed: dict[str, Any], check: str, reason: str
) -> None:
    verdict = judged(baseline, replace(STANDING, **changed))
    (failed,) = [entry for entry in verdict.checks if not entry.passed]
    assert check in failed.name
    assert reason in failed.reasons[0]


def test_the_excess_error_must_fall_over_all_axes_in_units_of_their_noise(
    baseline: AeroDatabase,
) -> None:
    # CZ gains 0.05 -> 0.01 at a floor of 0.001; Cm may lose at most what CZ gained: 0.05^2 - 0.01^2
    # = 0.0024 in floors^2.
    just, beyond = np.sqrt(0.01**2 + 0.0024) * 0.999, np.sqrt(0.01**2 + 0.0024) * 1.001
    assert judged(baseline, report=axes(Cm={"excess_after": just})).passed
    (reason,) = judged(baseline, report=axes(Cm={"excess_after": beyond})).reasons
    assert "Cm 0.01 to 0.05" in reason
    assert judged(baseline, report=axes(CZ={"excess_after": 0.0494})).passed
    (reason,) = judged(baseline, report=axes(CZ={"excess_after": 0.0496})).reasons
    assert (
        reason == "on no axis does the error beyond the noise floor fall on held-out flights by 1%"
    )
    (reason,) = judged(baseline, report=axes(CZ={"excess_after": 0.05})).reasons
    assert "goes from" in reason
    unproved = {
        axis: {**entry, "excess_before": None, "held_out_rms_before": None}
        for axis, entry in axes().items()
    }
    assert judged(baseline, report=unproved).reasons == (
        "not held out: no flight was, so nothing shows that the error falls",
    )
    assert not judged(baseline, report={}).passed


def test_parts_of_the_flights_that_identified_are_no_proof(baseline: AeroDatabase) -> None:
    candidate = updated(baseline, increment("CZ", {"1": -0.02, "alpha": -0.5}))
    cases = make_check_cases(candidate)
    verdict = judge_release(STANDING, baseline, candidate, cases, axes(), within_flights=True)
    (failed,) = [entry for entry in verdict.checks if not entry.passed]
    assert failed.name == "error beyond the noise floor falls"
    assert "only parts of the flights" in failed.reasons[0]


def test_an_axis_may_be_worse_by_what_flights_differ_among_themselves(
    baseline: AeroDatabase,
) -> None:
    assert repeatability([0.010, 0.0102, 0.0098]) == pytest.approx(0.0002)
    assert repeatability([0.5]) == 0.0
    assert judged(baseline, report=axes(Cm={"held_out_rms_after": 0.01 + 0.00019})).passed
    (reason,) = judged(baseline, report=axes(Cm={"held_out_rms_after": 0.01 + 0.00021})).reasons
    assert reason.startswith("Cm is worse on held-out flights: 0.01 to 0.01021 rms")
    old = {
        axis: {k: v for k, v in entry.items() if k != "repeatability"}
        for axis, entry in axes().items()
    }
    assert "create the version again" in judged(baseline, report=old).reasons[0]


def test_check_cases_are_evaluated_again(baseline: AeroDatabase) -> None:
    candidate = updated(baseline, increment("CZ", {"1": -0.02}))
    cases = make_check_cases(candidate)
    assert len(cases) == 25
    assert cases == make_check_cases(candidate)
    assert failed_check_cases(candidate, cases) == ()
    one = cases[3]
    broken = CheckCase(one.inputs, {**one.coefficients, "CZ": one.coefficients["CZ"] + 1e-6})
    verdict = judge_release(STANDING, baseline, candidate, (*cases[:3], broken, *cases[4:]), axes())
    assert len(verdict.reasons) == 1
    assert verdict.reasons[0].startswith("check case 4: CZ is ")
    assert (
        "and 21 more check values differ"
        in judge_release(STANDING, baseline, baseline, cases, axes()).reasons
    )
    assert (
        "it has no check cases"
        in judge_release(STANDING, baseline, candidate, (), axes()).reasons[0]
    )


# Sign changes


@pytest.mark.parametrize("scale", [1.0, -1.0])
def test_a_fade_steeper_than_the_slope_is_refused_and_a_flatter_one_is_not(
    baseline: AeroDatabase, scale: float
) -> None:
    """Cm falls by 0.6 per rad. An increment of c fades over one cell of 4 deg: by c / cell, upwards
    on one side only."""
    cell = 4 * DEG
    for share, count in ((0.98, 0), (1.02, 2)):
        changes = new_sign_changes(
            baseline, updated(baseline, increment("Cm", {"1": scale * share * 0.6 * cell}))
        )
        plain = [change for change in changes if not change.at]
        assert len(plain) == count
        assert {change.quantity for change in changes} == ({"Cm"} if count else set())
        if count:
            edge, side = (2 * DEG, -1.0) if scale > 0 else (6 * DEG, 1.0)
            found = sorted(change.alpha for change in plain)
            assert found == pytest.approx(
                sorted([edge + side * 2 * cell, edge + side * cell]), abs=0.2 * DEG
            )
            assert sorted(change.rising for change in plain) == [False, True]
    reasons = judged(baseline, added=increment("Cm", {"1": 0.1})).reasons
    assert reasons == ("new sign change of dCm/dalpha outside the data at alpha = -6.0, -2.0 deg",)


def test_inside_the_data_a_sign_may_change(baseline: AeroDatabase) -> None:
    """Unstable between 2 and 6 deg, as flown; wide cells let it fade gently."""
    unstable = updated(baseline, increment("Cm", {"alpha - 0.07": 0.9}, cell=12.0))
    slope = np.diff(
        unstable.predict({**neutral(unstable), "alpha": np.array([3.0, 5.0]) * DEG}).coefficients[
            "Cm"
        ]
    )
    assert slope[0] > 0
    assert new_sign_changes(baseline, unstable) == ()


def neutral(database: AeroDatabase) -> dict[str, float]:
    return {name: 25.0 if name == "V" else 0.0 for name in database.inputs}


def test_a_stall_that_moves_within_a_cell_is_the_same_stall(baseline: AeroDatabase) -> None:
    table = baseline.tables["CZ0"]
    stalled = replace(
        baseline, tables={"CZ0": replace(table, values=np.array([0.05, -0.3, -0.65, -1.0, -0.8]))}
    )
    moved = replace(
        baseline, tables={"CZ0": replace(table, values=np.array([0.05, -0.3, -0.65, -0.6, -0.8]))}
    )
    little = updated(stalled, increment("CZ", {"1": -0.01}))
    assert new_sign_changes(stalled, little) == ()
    assert new_sign_changes(stalled, stalled) == ()
    # Without increments nothing was flown: a table that falls earlier, and rises again, brings new
    # ones.
    assert {change.quantity for change in new_sign_changes(stalled, moved)} == {"C_lift"}


def test_beyond_the_flown_mach_number_every_alpha_is_outside() -> None:
    """Two increments cancel where both were flown. One fades earlier in Mach, and leaves a kink of
    the other at alpha = 0."""
    terms = {"Cm": "-0.3*alpha", "CZ": "-5*alpha + 0.01*mach"}
    reference = read_native(DATABASE).reference
    base = AeroDatabase(
        "m",
        reference,
        terms=tuple(Term(f"t_{axis}", axis, parse(text)) for axis, text in terms.items()),
    )
    wide = Interval(-90 * DEG, 90 * DEG, 1 * DEG)

    def kink(value: float, highest: float) -> Increment:
        envelope = {"alpha": wide, "mach": Interval(0.2, highest, 0.1)}
        return Increment(
            "Cm",
            (parse("max(alpha, 0)"),),
            np.array([value]),
            np.array([[1e-4]]),
            envelope,
            ("f1",),
        )

    assert new_sign_changes(base, updated(base, kink(0.6, 0.4), kink(-0.6, 0.4))) == ()
    # Alone it turns the slope where it was flown: seen, and carried along where it fades.
    assert new_sign_changes(base, updated(base, kink(0.6, 0.4))) == ()
    changes = [
        c
        for c in new_sign_changes(base, updated(base, kink(0.7, 0.6), kink(-0.6, 0.4)))
        if abs(c.alpha) < 1 * DEG
    ]
    assert changes
    # At 0.55 the second is half faded, at 0.6 gone; the first still acts in full: the slope is -0.3
    # + 0.7 - 0.6 w.
    for change in changes:
        assert (change.quantity, change.rising) == ("Cm", True)
        assert change.at["mach"] in (pytest.approx(0.55), pytest.approx(0.6), pytest.approx(0.75))


def test_what_an_earlier_version_had_is_not_new(baseline: AeroDatabase) -> None:
    first, second = increment("CZ", {"1": -0.02}), increment("Cm", {"1": 0.01})
    old, new = updated(baseline, first), updated(baseline, first, second)
    assert new_increments(old, new) == (second,)
    assert new_increments(new, old) == ()
    assert new_increments(baseline, baseline) == ()
    assert database_content_sha256(old) != database_content_sha256(new)


def test_a_database_without_alpha_has_no_slopes() -> None:
    base = AeroDatabase(
        "b", read_native(DATABASE).reference, terms=(Term("t", "CY", parse("-0.3*beta")),)
    )
    assert new_sign_changes(base, base) == ()


@pytest.mark.parametrize("scale", [1.0, -1.0])
def test_an_update_lengthens_a_fade_until_no_slope_changes_its_sign(
    baseline: AeroDatabase, scale: float
) -> None:
    """Cm falls by 0.6 per rad; faded over one cell of 4 deg the increment would outweigh that, over
    two it does not."""
    size = scale * 1.5 * 0.6 * 4 * DEG
    made = Update(
        updated(baseline, increment("Cm", {"1": size}), increment("CX", {"1": -0.001})), (), ()
    )
    kept = keep_slope_signs(made, baseline).candidate
    assert new_sign_changes(baseline, made.candidate)
    assert new_sign_changes(baseline, kept) == ()
    moment, force = kept.increments
    assert moment.envelope["alpha"].cell == pytest.approx(8 * DEG)
    assert "2 table cells" in moment.full_note
    assert force.envelope["alpha"].cell == pytest.approx(4 * DEG)
    flown = {**neutral(baseline), "alpha": np.array([4.0]) * DEG}
    assert (
        kept.predict(flown).coefficients["Cm"] == made.candidate.predict(flown).coefficients["Cm"]
    )


def test_an_update_that_no_length_of_fade_can_mend_is_left_to_the_gate(
    baseline: AeroDatabase,
) -> None:
    made = Update(updated(baseline, increment("Cm", {"1": 100.0})), (), ())
    assert keep_slope_signs(made, baseline) is made


def test_what_was_not_held_out_or_is_only_suspected_is_said(baseline: AeroDatabase) -> None:
    candidate = updated(baseline, increment("CZ", {"1": -0.02, "alpha": -0.5}))
    cases = make_check_cases(candidate)
    verdict = judge_release(STANDING, baseline, candidate, cases, axes(), cross_validated=True)
    assert verdict.passed
    names = [check.name for check in verdict.checks]
    assert (
        "error beyond the noise floor of each flight left out in turn falls (not held out)" in names
    )
    assert notes_on_release({}) == ("not held out: an import comes without flights",)
    held = {"axes": axes(), "validation": {"kind": "held-out"}}
    assert notes_on_release(held) == ()
    turned = {"axes": axes(), "validation": {"kind": "cross-validated"}}
    assert notes_on_release(turned)[0].startswith("not held out: each flight was predicted")
    assert notes_on_release({"axes": axes(Cm={"held_out_rms_after": None})}) == (
        "not held out: Cm; no held-out flight measures them",
    )
    findings = [
        {"verdict": "confirmed", "hypothesis": "alpha_slope@CZ"},
        {"verdict": "suspected", "hypothesis": "zero_offset@Cm"},
        {"verdict": "alias_group", "hypothesis": "mass_offset"},
    ]
    report = {**held, "findings": findings, "asked_for": ["zero_offset@Cm"]}
    said = notes_on_release(report)
    assert said[0] == "only suspected, added because you asked for it: zero_offset@Cm"
    assert said[1].endswith("cannot tell apart, not added: mass_offset")
    report |= {"added": ["zero_offset@Cm"], "asked_for": []}
    assert notes_on_release(report)[0].endswith("added with others of its axis: zero_offset@Cm")
    assert len(said) == 2
    findings.append({"verdict": "suspected", "hypothesis": "alpha_slope@CX"})
    report |= {"added": [], "findings": findings}
    two = "only suspected, not added: zero_offset@Cm; alpha_slope@CX"
    assert notes_on_release(report)[0] == two
    findings += [{"verdict": "suspected", "hypothesis": f"alpha_slope@C{n}"} for n in "mn"]
    assert notes_on_release(report)[0] == f"{two}; 2 more"


def test_the_held_out_error_of_a_list_is_that_of_the_gate() -> None:
    report = {"axes": axes(), "validation": {"kind": "held-out"}}
    error = held_out_error(report)
    assert error["kind"] == "held-out"
    for axis, pair in error["axes"].items():
        entry = report["axes"][axis]
        assert pair == [entry["held_out_rms_before"], entry["held_out_rms_after"]]
    assert "CZ" in error["axes"]
    assert error["after"] < error["before"]
    assert held_out_error({})["kind"] == "not held out"
    inside = {"axes": axes(), "validation": {"kind": "cross-validated", "within_flights": True}}
    assert held_out_error(inside)["kind"] == "within flights"


SHAPED = {
    "hypothesis": "roll_damping@Cl",
    "axis": ["Cl"],
    "verdict": "suspected",
    "shape": {"variables": ["delta_aileron_past"], "axis": "Cl"},
}
UNNAMED = {"hypothesis": "unnamed@Cl", "axis": ["Cl"], "verdict": "unnamed"}


def test_a_shape_that_fits_better_refuses_what_was_added() -> None:
    (reason,) = judge_shapes({"findings": [SHAPED], "added": ["roll_damping@Cl"]}, ()).reasons
    assert "delta_aileron_past on Cl" in reason
    assert "--accept roll_damping@Cl" in reason
    assert judge_shapes(
        {"findings": [SHAPED], "added": ["roll_damping@Cl"]}, ["roll_damping@Cl"]
    ).passed
    assert judge_shapes({"findings": [SHAPED], "added": []}, ()).passed
    finer = {**SHAPED, "verdict": "confirmed"}  # of the same variables: the refit gives its shape
    assert judge_shapes({"findings": [finer], "added": ["roll_damping@Cl"]}, ()).passed


def test_what_has_no_name_refuses_what_may_stand_in_for_it() -> None:
    plain = {**SHAPED, "verdict": "confirmed", "shape": None}
    report = {"findings": [plain, UNNAMED], "added": ["roll_damping@Cl"]}
    (reason,) = judge_shapes(report, ()).reasons
    assert "roll_damping@Cl may stand in for it" in reason
    assert judge_shapes(report, ["unnamed@Cl"]).passed
    assert judge_shapes({**report, "findings": [plain, {**UNNAMED, "axis": ["Cn"]}]}, ()).passed
    assert judge_shapes({}, ()).passed
