"""Parameters of a build-up are corrected by flights: each named by itself, nothing where all are
right."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.exchange.native import from_document, read_native, to_document
from aerodb.loop import Accept, LoopResult, freeze_library, run_loop
from aerodb.simulation import flight_model
from aerodb.simulation.parameter_covariance import parameter_covariance
from aerodb.tables import (
    Increment,
    Parameter,
    Term,
    Variable,
    number,
    parse,
    sigma_of,
    slices,
    slopes_by_parameter,
    with_parameters,
)
from tests.support.build_up import TEXT, build_up, flights, in_newtons
from tests.support.flights_in_memory import FlightsInMemory


@pytest.fixture(scope="module")
def source() -> FlightsInMemory:
    return flights(range(60, 66), build_up())


def closed(source: FlightsInMemory, wrong: Mapping[str, float], asked: str = "") -> LoopResult:
    ids, database = tuple(source.flown), build_up(wrong)
    library = freeze_library(source, ids, database)
    accept = Accept(frozenset({asked} if asked else ()))
    return run_loop(source, ids, database, library, accept)


def test_a_wrong_parameter_gets_its_value_error_flights_and_flown_intervals(
    source: FlightsInMemory,
) -> None:
    loop = closed(source, {"fin_CLa": 2.2})
    (finding,) = loop.added
    assert finding.hypothesis == "parameter@CY+Cn:fin_CLa"
    assert finding.verdict == "confirmed"
    assert finding.ci95[0] < 0.6 < finding.ci95[1]
    fin = loop.candidate.variables["fin_CLa"]
    assert loop.candidate.parameters["fin_CLa"] == pytest.approx(2.8, rel=0.05)
    assert loop.candidate.parameters["fin_CLa"] == pytest.approx(2.2 + finding.value)
    assert fin.parameter is not None
    assert fin.parameter.flights == tuple(source.flown)
    assert fin.uncertainty is not None
    assert fin.uncertainty.bounds[0] == pytest.approx(
        (finding.ci95[1] - finding.ci95[0]) / 3.92, rel=0.02
    )
    low, high = fin.parameter.flown["beta"]
    assert low == pytest.approx(min(f["beta"].min() for f, _ in source.flown.values()))
    assert high == pytest.approx(max(f["beta"].max() for f, _ in source.flown.values()))
    others = {name: value for name, value in loop.candidate.parameters.items() if name != "fin_CLa"}
    assert others == {
        name: value for name, value in build_up().parameters.items() if name in others
    }


def test_two_that_act_on_one_axis_are_told_apart_where_flights_show_both(
    source: FlightsInMemory,
) -> None:
    """Their values are right, and what takes their place is said: the centre of gravity."""
    loop = closed(source, {"tail_CLa": 3.0, "tail_tau": 0.4})
    found = {f.subject: f for f in loop.findings if f.effect == "parameter"}
    assert found.keys() == {"tail_CLa", "tail_tau"}
    assert found["tail_CLa"].ci95[0] < 0.6 < found["tail_CLa"].ci95[1]
    assert found["tail_tau"].ci95[0] < 0.1 < found["tail_tau"].ci95[1]


def test_nothing_is_found_where_all_parameters_are_right(source: FlightsInMemory) -> None:
    loop = closed(source, {})
    assert loop.findings == ()
    assert loop.candidate == loop.baseline


def test_loads_are_traced_like_coefficients() -> None:
    """The same build-up in N and N m flies: a wrong fin is named, and nothing where all is right."""
    source = flights(range(60, 66), in_newtons(build_up()))
    ids = tuple(source.flown)
    found = []
    for wrong in ({}, {"fin_CLa": 2.2}):
        database = in_newtons(build_up(wrong))
        library = freeze_library(source, ids, database)
        found.append(run_loop(source, ids, database, library, Accept()).findings)
    assert found[0] == ()
    (finding,) = found[1]
    assert (finding.subject, finding.verdict) == ("fin_CLa", "confirmed")
    assert finding.ci95[0] < 0.6 < finding.ci95[1]


@pytest.mark.campaign
def test_false_confirmations_of_a_right_build_up() -> None:
    """Of 40 campaigns of three flights, in which nothing is wrong, none corrects a parameter."""
    confirmed = []
    for seed in range(100, 220, 3):
        source = flights(range(seed, seed + 3), build_up())
        confirmed += [f.hypothesis for f in closed(source, {}).findings if f.verdict == "confirmed"]
    assert confirmed == []


@pytest.mark.campaign
def test_intervals_hold_the_true_values() -> None:
    """One parameter is wrong, in campaigns of four flights: it is named or in the set of what is,
    and its own interval holds what it lacks. What the centre of gravity explains as well is not
    claimed."""
    wrong = {"wing_CLa": 0.125, "tail_CLa": 0.125, "tail_tau": 0.125, "fin_CLa": 0.25}
    hits, found, in_set, n = 0, 0, 0, 0
    for seed in range(300, 340, 4):
        source = flights(range(seed, seed + 4), build_up())
        for name, share in wrong.items():
            lacks = share * build_up().parameters[name]
            findings = closed(source, {name: (1.0 - share) * build_up().parameters[name]}).findings
            own = [finding for finding in findings if finding.subject == name]
            members = {member for finding in findings for member in finding.explanation_set}
            n, found = n + 1, found + len(own)
            in_set += any(member.endswith(f":{name}") for member in members)
            hits += sum(finding.ci95[0] < lacks < finding.ci95[1] for finding in own)
    assert in_set >= 0.97 * n
    assert found >= 0.7 * n
    assert hits >= 0.93 * found


def test_the_slope_by_a_parameter_is_that_of_all_expressions_that_share_it() -> None:
    rng = np.random.default_rng(3)
    channels = {name: rng.uniform(-0.1, 0.1, 7) for name in build_up().inputs}
    channels["V"] = rng.uniform(50.0, 70.0, 7)
    slopes = slopes_by_parameter(build_up(), "tail_CLa", channels)
    assert slopes.keys() == {"CZ", "Cm"}
    alpha = 0.65 * channels["alpha"] + 6 * channels["q"] / channels["V"]
    alpha = alpha + 0.5 * channels["delta_elevator"]
    np.testing.assert_allclose(slopes["CZ"], -0.2 * alpha, atol=1e-12)
    np.testing.assert_allclose(slopes["Cm"], -3.2 * 0.2 * alpha, atol=1e-12)


def test_a_flying_build_up_has_its_parameters_as_what_a_run_may_vary() -> None:
    model = flight_model(build_up())
    assert model.parameters == build_up().parameters
    assert not set(model.parameters) & set(model.inputs)
    assert parameter_covariance(model).shape == (5, 5)


def test_a_document_gives_back_parameters_with_what_flights_told(source: FlightsInMemory) -> None:
    candidate = closed(source, {"fin_CLa": 2.2}).candidate
    again = from_document(to_document(candidate))
    assert again.variables["fin_CLa"] == candidate.variables["fin_CLa"]
    assert to_document(again) == to_document(candidate)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("value = 4.4", "value = 9.0", r"wing_CLa.*9 lies outside its bounds 2 to 7"),
        ("bounds = [2.0, 7.0]", "bounds = [7.0, 2.0]", r"wing_CLa.*bounds 7 and 2"),
        ("bounds = [2.0, 7.0]", "prior_sigma = -1.0", r"prior_sigma"),
        ("[variables]\n", '[variables]\nwing_CLa = { expression = "alpha" }\n', "'wing_CLa' is"),
        ('"-wing_lift - tail_lift"', '"-wing_lift - tale_CLa"', "unknown name 'tale_CLa'"),
    ],
)
def test_a_wrong_file_says_which_parameter(old: str, new: str, says: str) -> None:
    assert TEXT.count(old) == 1
    with pytest.raises(InputError, match=says):
        read_native(TEXT.replace(old, new))


def test_a_value_outside_its_bounds_is_refused() -> None:
    with pytest.raises(InputError, match="fin_CLa"):
        with_parameters(build_up(), {"fin_CLa": 60.0})


def test_slices_tell_the_error_of_a_parameter_and_where_its_flights_have_been(
    source: FlightsInMemory,
) -> None:
    loop = closed(source, {"fin_CLa": 2.2})
    sigma = sigma_of(loop.candidate.variables["fin_CLa"].uncertainty)
    known = loop.candidate.variables["fin_CLa"].parameter
    assert sigma is not None
    assert known is not None
    (cut,) = (
        each
        for each in slices(loop.baseline, loop.candidate)
        if (each.axis, each.variable) == ("CY", "beta")
    )
    np.testing.assert_allclose(cut.error, 0.15 * sigma * np.abs(cut.at), atol=1e-12)
    low, high = known.flown["beta"]
    np.testing.assert_array_equal(cut.inside, (low <= cut.at) & (cut.at <= high))
    assert cut.held["V"] == pytest.approx(np.mean(known.flown["V"]))


def test_derivatives_stay_out_only_where_parameters_reach(source: FlightsInMemory) -> None:
    """None by alpha or speed on the pitching moment, which wing and tail make; those of roll, which
    are numbers, and of a landing gear, which the build-up does not know, stay."""
    library = freeze_library(source, tuple(source.flown), build_up())
    ids = {hypothesis.id for hypothesis in library.hypotheses}
    assert not ids & {"alpha_slope@Cm", "mach_effect@Cm", "dynamic_pressure_effect@CZ"}
    assert {"roll_damping@Cl", "zero_offset@Cm", "landing_gear@CX"} <= ids
    assert sum(id.startswith("parameter@") for id in ids) == 5


def test_a_parameter_of_the_lift_moves_the_drag_that_follows_the_whole_lift() -> None:
    """Induced drag k (CL + increments)^2: the slope by the parameter holds the increment's share."""
    variables = {"a": Variable(number(5.0), parameter=Parameter())}
    terms = (
        Term("lift", "C_lift", parse("a*alpha")),
        Term("induced", "C_drag", parse("0.1*(a*alpha + C_lift_increments)^2")),
    )
    more = Increment("C_lift", (parse("1"),), np.array([0.3]), np.zeros((1, 1)))
    whole = replace(build_up(), variables=variables, terms=terms, increments=(more,))
    slopes = slopes_by_parameter(whole, "a", {"alpha": np.array([0.1]), "beta": np.array([0.0])})
    drag = 2 * 0.1 * (5.0 * 0.1 + 0.3) * 0.1
    expected = 0.1 * np.sin(0.1) - drag * np.cos(0.1)
    np.testing.assert_allclose(slopes["CX"], [expected], rtol=1e-9)
