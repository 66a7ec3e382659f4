"""Results of tracing on small campaigns: verdicts, rivals, bounds, bad input, and the empty case in
which nothing may be found."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from aerodb.effects.hypothesis import Hypothesis
from aerodb.errors import InputError
from aerodb.signals import rms
from aerodb.tables.expression import parse
from aerodb.tracing.decision.explanation_sets import Explanation
from aerodb.tracing.decision.findings import Finding, Traced
from aerodb.tracing.decision.residual_records import FlightResidual
from aerodb.tracing.decision.selection import Decision
from aerodb.tracing.decision.unexplained_residual import unexplained_by_axis, without_state_noise
from aerodb.tracing.decision.verdicts import trace, verdict_of
from aerodb.tracing.evidence import Evidence
from aerodb.tracing.evidence.normal_equations import (
    normal_equations_from_arrays,
    normal_equations_of,
)
from tests.support.tracing_flights import coloured
from tests.support.tracing_small import LIBRARY, SETTINGS, STEP, evidence, instrument, term

A_CX, B_CX, A_CZ, SENSOR, OTHER = (h.id for h in LIBRARY)


def flights(
    count: int, values: Mapping[str, float] | None = None, first: int = 100
) -> list[Evidence]:
    return [evidence(seed, values) for seed in range(first, first + count)]


def traced(given: Sequence[Evidence], library: Sequence[Hypothesis] = LIBRARY) -> Traced:
    return trace([normal_equations_of(flight, SETTINGS) for flight in given], library, SETTINGS)


def only(result: Traced) -> Finding:
    (finding,) = result.findings
    return finding


def with_twin(
    given: Sequence[Evidence], twin: Hypothesis, of: str, factor: float
) -> list[Evidence]:
    """The flights with one more hypothesis, whose columns are `factor` times those of another."""
    return [
        replace(
            e,
            columns={**e.columns, twin.id: {axis: factor * x for axis, x in e.columns[of].items()}},
        )
        for e in given
    ]


def beside(flight: Evidence, alike: float, size: float) -> NDArray[np.float64]:
    """`alike` times the column of `A_CX`, and a column that is not correlated with it, of its size
    times `size`."""
    one = flight.columns[A_CX]["CX"]
    apart = np.roll(flight.columns[SENSOR]["CZ"] - 0.7 * flight.columns[A_CZ]["CZ"], 200)
    return np.asarray(alike * one + size * apart * rms(one) / rms(apart))


def test_where_nothing_is_missing_nothing_is_found_and_everything_has_a_bound() -> None:
    result = traced(flights(6))
    assert result.findings == ()
    assert len(result.not_found) == len(LIBRARY)
    for item in result.not_found:
        assert item.verdict == "not_detected"
        assert item.upper_bound is not None
        assert item.minimum_detectable is not None
        assert item.upper_bound > 0.0
        assert item.minimum_detectable > 0.0


def test_a_missing_term_is_confirmed_with_its_value_votes_and_reasons() -> None:
    result = traced(flights(6, {A_CX: 0.3}))
    finding = only(result)
    assert (finding.hypothesis, finding.verdict, finding.axis) == (A_CX, "confirmed", ("CX",))
    assert finding.ci95[0] < 0.3 < finding.ci95[1]
    assert finding.value == pytest.approx(0.3, abs=0.1)
    assert finding.explanation_set == (A_CX,)
    assert finding.p_adjusted < 0.05
    assert len(finding.votes) == 6
    assert finding.refound == (6, 6)
    assert finding.held_out_share == 1.0
    assert "CX lacks a" in finding.because
    assert B_CX in finding.fallen  # correlated with it at .6, and worse in flight after flight
    assert {item.hypothesis for item in result.not_found} == {B_CX, A_CZ, SENSOR, OTHER}
    document = json.loads(json.dumps(result.document()))
    assert set(document) == {"findings", "not_found", "next_flight"}
    assert document["findings"][0]["votes"][0]["flight"] == "f100"


def test_the_order_of_flights_does_not_matter_nor_does_storing_their_grams() -> None:
    normal_equations = [normal_equations_of(e, SETTINGS) for e in flights(5, {A_CX: 0.3})]
    first = trace(normal_equations, LIBRARY, SETTINGS)
    again = trace(
        [normal_equations_from_arrays(g.to_arrays()) for g in reversed(normal_equations)],
        LIBRARY,
        SETTINGS,
    )
    assert only(again).value == pytest.approx(only(first).value, rel=1e-9)
    assert only(again).p_adjusted == pytest.approx(only(first).p_adjusted, rel=1e-6)


def test_a_wrong_sensor_is_called_a_sensor() -> None:
    finding = only(traced(flights(6, {SENSOR: 0.6})))
    assert (finding.hypothesis, finding.verdict) == (SENSOR, "sensor")
    assert finding.ci95[0] < 0.6 < finding.ci95[1]


@pytest.mark.parametrize(("planted", "named"), [((0.2, 0.2), "whole"), ((0.2, 0.0), "first")])
def test_one_sensor_takes_the_place_of_several_that_it_explains(
    planted: tuple[float, float], named: str
) -> None:
    """As a mass does of dynamic pressure and the inertias; one of these alone keeps its name."""
    library = [instrument("first", 0.05), instrument("second", 0.05), instrument("whole", 0.02)]
    seen = []
    for flight in flights(6, dict(zip((A_CX, A_CZ), planted, strict=True))):
        own = {axis: flight.columns[id][axis] for id, axis in ((A_CX, "CX"), (A_CZ, "CZ"))}
        both = {"first@all": {"CX": own["CX"]}, "second@all": {"CZ": own["CZ"]}, "whole@all": own}
        seen.append(replace(flight, columns=both))
    finding = only(traced(seen, library))
    assert (finding.effect, finding.verdict) == (named, "sensor")
    assert finding.ci95[0] < 0.2 < finding.ci95[1]


def test_two_terms_at_once_are_both_found() -> None:
    result = traced(flights(6, {A_CX: 0.3, A_CZ: -0.3}))
    assert {f.hypothesis: f.verdict for f in result.findings} == {
        A_CX: "confirmed",
        A_CZ: "confirmed",
    }


@pytest.mark.parametrize(
    ("alike", "regressor", "verdict"),
    [
        (0.9, "beta", "alias_group"),
        (0.6, "beta", "confirmed"),
        (0.9, "alpha*mach^2", "confirmed"),
    ],
)
def test_two_terms_that_cancel_are_one_group(alike: float, regressor: str, verdict: str) -> None:
    """Of opposite sign and at this correlation; nearly all of both is what the other takes away. A
    slope and its change with Mach number are one curve, of which neither is in doubt."""
    own = replace(LIBRARY[0], increment=(("CX", parse("alpha")),))
    twin, seen = replace(term("twin", "CX"), increment=(("CX", parse(regressor)),)), []
    for flight in flights(6):
        one = flight.columns[A_CX]["CX"]
        other = beside(flight, alike, np.sqrt(1.0 - alike**2))
        columns = {**flight.columns, own.id: {"CX": one}, twin.id: {"CX": other}}
        residual = {**flight.residual, "CX": flight.residual["CX"] + one - other}
        seen.append(replace(flight, columns=columns, residual=residual))
    findings = traced(seen, [own, *LIBRARY[1:], twin]).findings
    assert {f.hypothesis: f.verdict for f in findings} == dict.fromkeys((own.id, twin.id), verdict)
    others = set().union(*(f.explanation_set for f in findings))
    assert others == {own.id, twin.id}
    assert all((len(f.explanation_set) == 2) == (verdict == "alias_group") for f in findings)


def test_a_slope_that_cancels_its_own_change_is_in_doubt_where_the_change_is() -> None:
    """Flights that cannot tell the change with Mach number from the change with pressure leave the
    slope beside it without a value of its own."""
    own = replace(LIBRARY[0], increment=(("CX", parse("alpha")),))
    change, other = (
        replace(term(name, "CX"), increment=(("CX", parse(regressor)),))
        for name, regressor in (("mach", "alpha*mach^2"), ("pressure", "alpha*qbar"))
    )
    seen = []
    for flight in flights(6):
        one = flight.columns[A_CX]["CX"]
        with_mach = beside(flight, 0.9, np.sqrt(0.19))
        columns = {**flight.columns, own.id: {"CX": one}, change.id: {"CX": with_mach}}
        columns[other.id] = {"CX": 3.0 * with_mach}
        residual = {**flight.residual, "CX": flight.residual["CX"] + one - with_mach}
        seen.append(replace(flight, columns=columns, residual=residual))
    found = {f.hypothesis: f for f in traced(seen, [own, *LIBRARY[1:], change, other]).findings}
    pair = {change.id, other.id}
    assert {id: f.verdict for id, f in found.items() if id not in pair} == {own.id: "alias_group"}
    (named,) = pair & found.keys()
    assert set(found[named].explanation_set) == pair
    assert set(found[own.id].explanation_set) == {own.id, named}


@pytest.mark.parametrize(("regressor", "found"), [("alpha*mach^2", 2), ("beta", 0)])
def test_a_slope_and_its_change_that_hide_each_other_are_found_together(
    regressor: str, found: int
) -> None:
    """A database that is right in the middle of what was flown: alone, neither is significant."""
    own = replace(LIBRARY[0], increment=(("CX", parse("alpha")),))
    change = replace(term("change", "CX"), increment=(("CX", parse(regressor)),))
    seen = []
    for number, flight in enumerate(flights(6)):
        one = flight.columns[A_CX]["CX"]
        other = beside(flight, 1.1 if number % 2 else 0.9, 0.2)
        columns = {**flight.columns, own.id: {"CX": one}, change.id: {"CX": other}}
        residual = {**flight.residual, "CX": flight.residual["CX"] + one - other}
        seen.append(replace(flight, columns=columns, residual=residual))
    findings = traced(seen, [own, *LIBRARY[1:], change]).findings
    assert {f.hypothesis: f.verdict for f in findings} == dict.fromkeys(
        (own.id, change.id)[:found], "confirmed"
    )


@pytest.mark.parametrize("believable", [9.0, 1.0])
def test_two_shapes_over_one_variable_enter_by_believable_sizes_only(believable: float) -> None:
    """Beside a slope, a curve that takes most of it back is none that anybody would add."""
    own = replace(LIBRARY[0], increment=(("CX", parse("alpha")),), plausible=(-9.0, 9.0))
    curve = replace(
        term("curve", "CX"),
        increment=(("CX", parse("alpha^2")),),
        plausible=(-believable, believable),
    )
    seen = []
    for flight in flights(6):
        one = flight.columns[A_CX]["CX"]
        bent = beside(flight, 0.9, np.sqrt(0.19))
        columns = {**flight.columns, own.id: {"CX": one}, curve.id: {"CX": bent}}
        residual = {**flight.residual, "CX": flight.residual["CX"] + 5.0 * one - 3.0 * bent}
        seen.append(replace(flight, columns=columns, residual=residual))
    found = {f.hypothesis for f in traced(seen, [own, *LIBRARY[1:], curve]).findings}
    assert found == ({own.id, curve.id} if believable > 3.0 else {own.id})


@pytest.mark.parametrize(("size", "named"), [(-2.0, "sign"), (0.36, "a")])
def test_a_reversed_sign_is_claimed_at_the_size_of_a_reversal(size: float, named: str) -> None:
    """A table that is a third too weak is what its own control does, and no sign."""
    sign = term("sign", "CX", plausible=(-2.5, -1.5))
    seen = []
    for flight in flights(6):
        own = flight.columns[A_CX]["CX"]
        table = 0.98 * own + 0.2 * np.roll(flight.columns[A_CZ]["CZ"], 100)
        columns = {**flight.columns, sign.id: {"CX": table}}
        residual = {**flight.residual, "CX": flight.residual["CX"] + size * table}
        seen.append(replace(flight, columns=columns, residual=residual))
    found = [f.effect for f in traced(seen, [sign, *LIBRARY]).findings if f.verdict == "confirmed"]
    assert found == [named]


def test_a_constant_that_only_a_freed_sensor_brings_is_no_claim() -> None:
    """The sensor varies as what is lacking does, but its level is not in the residual."""
    offset = Hypothesis(
        "zero_offset", ("CX",), "", "CX_0", "aerodynamic", "1", (-9.0, 9.0), None, "CX is off"
    )

    def seen(level: float) -> list[Evidence]:
        """level : of the residual; the sensor's error of .6 leaves 1.8."""
        made = []
        for flight in flights(6, {SENSOR: 0.6}):
            column = {**flight.columns[SENSOR], "CX": flight.columns[SENSOR]["CX"] + 3.0}
            constant = {"CX": np.ones(flight.samples)}
            columns = {**flight.columns, SENSOR: column, offset.id: constant}
            residual = {**flight.residual, "CX": flight.residual["CX"] + level}
            made.append(replace(flight, columns=columns, residual=residual))
        return made

    right = traced(seen(1.8), [*LIBRARY, offset]).findings
    assert [(f.hypothesis, f.verdict) for f in right] == [(SENSOR, "sensor")]
    cancelled = traced(seen(0.0), [*LIBRARY, offset]).findings
    assert {f.hypothesis: f.verdict for f in cancelled} == dict.fromkeys(
        (SENSOR, offset.id), "ambiguous_sensor"
    )
    assert all(set(f.explanation_set) >= {SENSOR, offset.id} for f in cancelled)


def test_ten_times_the_believable_size_is_not_confirmed() -> None:
    small = replace(LIBRARY[0], plausible=(-0.04, 0.04))
    finding = only(traced(flights(6, {A_CX: 0.6}), [small, *LIBRARY[1:]]))
    assert (finding.hypothesis, finding.verdict) == (A_CX, "suspected")
    assert "ten times what is believable" in finding.because


def test_twins_are_an_alias_group_and_the_next_flight_says_what_to_move() -> None:
    twin = term("twin", "CX")
    result = traced(with_twin(flights(6, {A_CX: 0.3}), twin, A_CX, 1.0), [*LIBRARY, twin])
    finding = only(result)
    assert finding.verdict == "alias_group"
    assert set(finding.explanation_set) == {A_CX, twin.id}
    assert any(A_CX in sentence and twin.id in sentence for sentence in result.next_flight)


@pytest.mark.parametrize(("noise", "verdict"), [(0.02, "alias_group"), (0.3, "confirmed")])
def test_noise_of_a_channel_does_not_tell_twins_apart(noise: float, verdict: str) -> None:
    """Two surfaces move together, each with noise of its own channel. At a correlation of .9998 the
    quieter one fits a strong effect better in flight after flight, and is no better a name; at .96
    the flights tell."""
    twin, rng = term("twin", "CX"), np.random.default_rng(10)
    seen = []
    for flight in flights(6, {A_CX: 3.0}):
        moved = flight.columns[A_CX]["CX"]
        shaken = moved + noise * moved.std() * rng.standard_normal(len(moved))
        seen.append(replace(flight, columns={**flight.columns, twin.id: {"CX": shaken}}))
    finding = next(f for f in traced(seen, [*LIBRARY, twin]).findings if f.axis == ("CX",))
    assert (finding.hypothesis, finding.verdict) == (A_CX, verdict)
    assert (twin.id in finding.explanation_set) == (verdict == "alias_group")


def test_a_sensor_that_is_a_twin_makes_it_ambiguous_unless_its_value_would_be_absurd() -> None:
    loose, tight = (instrument("twin", 0.01, (-size, size)) for size in (1.0, 0.05))
    given = with_twin(flights(6, {A_CX: 0.3}), loose, A_CX, 1.0)
    doubtful = only(traced(given, [*LIBRARY, loose]))
    assert doubtful.verdict == "ambiguous_sensor"
    assert set(doubtful.explanation_set) >= {A_CX, loose.id}
    certain = only(traced(given, [*LIBRARY, tight]))
    assert (certain.hypothesis, certain.verdict) == (A_CX, "confirmed")


@pytest.mark.parametrize(("factor", "verdict"), [(0.9, "confirmed"), (1.1, "ambiguous_sensor")])
def test_a_measurement_as_good_as_the_one_that_is_wanted_decides(
    factor: float, verdict: str
) -> None:
    """Three sigmas and the interval of the error that would take its place, in quadrature."""
    loose = instrument("twin", 0.2, (-1.0, 1.0))
    given = with_twin(flights(6, {A_CX: 0.6}), loose, A_CX, 1.0)
    doubtful = only(traced(given, [*LIBRARY, loose]))
    wanted = {each.parameter: each for each in doubtful.wanted}["twin"]
    assert wanted.sigma is not None
    assert wanted.unit == "1"
    sigma = factor * wanted.sigma
    stated = instrument("twin", sigma, (-3.0 * sigma, 3.0 * sigma))
    found = only(traced(given, [*LIBRARY, replace(stated, known_by="rig")]))
    assert (found.verdict, A_CX in found.explanation_set) == (verdict, True)


def test_two_flights_suspect_and_one_says_nothing_but_bounds() -> None:
    two = traced(flights(2, {A_CX: 0.5}))
    assert [(f.hypothesis, f.verdict) for f in two.findings] == [(A_CX, "suspected")]
    assert any("no error rate" in note for note in two.notes)
    assert any("1 more flight" in sentence for sentence in two.next_flight)
    one = traced(flights(1, {A_CX: 0.5}))
    assert one.findings == ()
    assert all(
        item.verdict == "not_testable" and item.upper_bound is not None for item in one.not_found
    )


def test_what_only_two_of_six_flights_show_is_suspected_at_most() -> None:
    given = flights(6)
    rare = term("rare", "CZ")
    stall = [coloured(np.random.default_rng(seed), given[0].samples, 0.6) for seed in range(2)]
    shown = []
    for number, e in enumerate(given):
        column = stall[number] if number < 2 else np.zeros(e.samples)
        residual = {**e.residual, "CZ": e.residual["CZ"] + 0.6 * column}
        shown.append(replace(e, residual=residual, columns={**e.columns, rare.id: {"CZ": column}}))
    finding = only(traced(shown, [*LIBRARY, rare]))
    assert (finding.hypothesis, finding.verdict, len(finding.votes)) == (rare.id, "suspected", 2)


def test_what_is_never_excited_or_not_separable_is_said_so() -> None:
    idle, tied = term("idle", "CZ"), term("tied", "CX")
    given = with_twin(flights(5), tied, A_CX, 1.0)
    shadow = instrument("shadow", 1e6)
    given = with_twin(given, shadow, A_CX, 1.0)
    verdicts = {
        item.hypothesis: item for item in traced(given, [*LIBRARY, idle, tied, shadow]).not_found
    }
    assert verdicts[idle.id].verdict == "not_excited"
    assert verdicts[idle.id].upper_bound is None
    assert verdicts[tied.id].verdict == "not_separable"


def test_a_constant_that_returns_in_all_flights_is_a_zero_offset_and_one_that_changes_is_not() -> (
    None
):
    offset = Hypothesis(
        "zero_offset",
        ("CX",),
        "",
        "CX_0",
        "aerodynamic",
        "1",
        (-9.0, 9.0),
        None,
        "CX is off by a constant",
    )

    def shown(levels: Sequence[float], *zeros: str) -> list[Evidence]:
        """zeros : sensors whose errors are constants too, twice as large per unit."""
        return [
            replace(
                e,
                residual={**e.residual, "CX": e.residual["CX"] + level},
                columns={
                    **e.columns,
                    offset.id: {"CX": np.ones(e.samples)},
                    **{zero: {"CX": np.full(e.samples, 2.0)} for zero in zeros},
                },
            )
            for e, level in zip(flights(6), levels, strict=True)
        ]

    common = only(traced(shown([1.0] * 6), [*LIBRARY, offset]))
    assert (common.hypothesis, common.verdict) == (offset.id, "confirmed")
    assert common.ci95[0] < 1.0 < common.ci95[1]
    assert traced(shown([1.0, -1.1, 0.8, -0.9, 1.2, -1.0]), [*LIBRARY, offset]).findings == ()
    silent = traced(shown([0.0] * 6), [*LIBRARY, offset])
    (level,) = (item for item in silent.not_found if item.hypothesis == offset.id)
    assert level.verdict == "not_detected"
    # one sensor leaves what is nearest to zero in the interval, or two independent ones together
    nearest = common.ci95[0]
    for share, count, verdict in (
        (1.1, 1, "ambiguous_sensor"),
        (0.8, 1, "confirmed"),
        (0.8, 2, "ambiguous_sensor"),
    ):
        size = 0.5 * share * nearest
        rigged = [instrument(f"zero{k}_bias", 0.01, (-size, size)) for k in range(count)]
        names = [each.id for each in rigged]
        (finding,) = traced(shown([1.0] * 6, *names), [*LIBRARY, offset, *rigged]).findings
        assert (finding.hypothesis, finding.verdict) == (offset.id, verdict)
        assert set(names) & set(finding.explanation_set) == (
            set(names) if verdict == "ambiguous_sensor" else set()
        )


def test_the_same_flight_under_two_names_has_one_vote() -> None:
    given = flights(4, {A_CX: 0.3})
    result = traced([*given, replace(given[0], flight="copy")])
    assert result.flights == ("f100", "f101", "f102", "f103")
    assert any("copy" in note for note in result.notes)


def test_what_is_no_longer_significant_in_the_model_of_all_findings_is_suspected() -> None:
    decision, alone = Decision((0,), (), ()), Explanation(0, (), (), {})
    assert verdict_of(decision, alone, significant=True) == "confirmed"
    assert verdict_of(decision, alone, significant=False) == "suspected"
    assert verdict_of(decision, replace(alone, rivals=(1,)), significant=False) == "alias_group"


def test_nothing_to_trace_is_refused() -> None:
    with pytest.raises(InputError, match="nothing to trace"):
        trace([], LIBRARY, SETTINGS)


def left(count: int, shape: float) -> list[FlightResidual]:
    """Flights whose CX has a product of two variables left that no template has."""
    found = []
    for seed in range(count):
        rng = np.random.default_rng([seed, 9])
        u, v, w = (coloured(rng, 1500, 0.6) for _ in range(3))
        residual = {
            "CX": shape * u * v + 0.3 * coloured(rng, 1500, 0.5),
            "CZ": 0.3 * coloured(rng, 1500, 0.5),
        }
        usable = {axis: np.ones(1500, dtype=bool) for axis in residual}
        found.append(
            FlightResidual(
                Evidence(f"f{seed}", STEP, residual, usable, {}), {"u": u, "v": v, "w": w}
            )
        )
    return found


def test_what_no_template_fits_is_unnamed_with_its_variables() -> None:
    cx, cz = unexplained_by_axis(left(6, 0.3), SETTINGS)
    assert (cx.axis, cx.found, set(cx.variables)) == ("CX", True, {"u", "v"})
    assert cx.skill > 0.2
    assert not cz.found
    assert cz.variables == ()


def test_a_variable_that_stands_in_every_flight_hides_nothing() -> None:
    """The mass differs between flights, and is constant in each."""
    given = [
        replace(flight, variables={**flight.variables, "mass": np.full(1500, 1000.0 + number)})
        for number, flight in enumerate(left(6, 0.3))
    ]
    cx, cz = unexplained_by_axis(given, SETTINGS)
    assert (cx.found, cz.found) == (True, False)
    assert {"u", "v"} <= set(cx.variables)


def test_noise_that_a_variable_shares_with_the_residual_is_not_unnamed() -> None:
    """A sensor's column is a variable without its noise, and the residual holds that noise: of the
    variable nothing but the noise is left beside the sensor."""
    column = term("sensor", "CX")
    given = []
    for flight in left(6, 0.0):
        rng = np.random.default_rng([int(flight.evidence.flight[1:]), 4])
        noise = 0.3 * coloured(rng, 1500, 0.5)
        residual = {axis: values + noise for axis, values in flight.evidence.residual.items()}
        u = 6.0 * flight.variables["u"]
        evidence = replace(
            flight.evidence,
            residual=residual,
            columns={column.id: dict.fromkeys(residual, u)},
        )
        given.append(FlightResidual(evidence, {"u": u + noise}))
    assert not any(r.found for r in unexplained_by_axis(given, SETTINGS))
    looser = replace(SETTINGS, inflation_limit=1e6)
    assert all(r.found for r in unexplained_by_axis(given, looser))


def test_what_noise_of_the_states_predicts_of_itself_is_not_unnamed() -> None:
    """Noise of a variable is in the residual too; a copy has it twice. What is predicted grows with
    it, while a product that is really there stays what it was."""

    def seen(true: Sequence[FlightResidual], times: int) -> list[FlightResidual]:
        shown = []
        for flight in true:
            seed = int(flight.evidence.flight[1:])
            noise = sum(
                0.5 * coloured(np.random.default_rng([seed, 5, number]), 1500, 0.5)
                for number in range(times)
            )
            residual = {
                axis: values - 0.6 * noise for axis, values in flight.evidence.residual.items()
            }
            variables = {**flight.variables, "w": flight.variables["w"] + noise}
            evidence = replace(flight.evidence, residual=residual)
            shown.append(FlightResidual(evidence, variables))
        return shown

    def judged(shape: float) -> tuple[list[bool], list[bool]]:
        once, twice = (
            unexplained_by_axis(seen(left(6, shape), times), SETTINGS) for times in (1, 2)
        )
        corrected = without_state_noise(once, [twice], SETTINGS)
        return [each.found for each in once], [each.found for each in corrected]

    assert judged(0.0) == ([True, True], [False, False])
    assert judged(0.6) == ([True, True], [True, False])


def test_of_noise_nothing_is_left() -> None:
    false = sum(
        r.found
        for seed in range(10)
        for r in unexplained_by_axis([_shuffled(f, seed) for f in left(6, 0.0)], SETTINGS)
    )
    assert false <= 2


def _shuffled(flight: FlightResidual, seed: int) -> FlightResidual:
    rng = np.random.default_rng([seed, 3, int(flight.evidence.flight[1:])])
    noise = {axis: coloured(rng, 1500, 0.5) for axis in flight.evidence.residual}
    return FlightResidual(replace(flight.evidence, residual=noise), flight.variables)


def test_the_rest_needs_three_flights_and_common_variables() -> None:
    with pytest.raises(InputError, match="too few"):
        unexplained_by_axis(left(2, 0.3), SETTINGS)
    apart = left(3, 0.3)
    with pytest.raises(InputError, match="no variable in common"):
        unexplained_by_axis(
            [
                replace(flight, variables={flight.evidence.flight: flight.variables["u"]})
                for flight in apart
            ],
            SETTINGS,
        )
