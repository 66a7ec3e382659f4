"""Parts in files and documents: stored as they are written, found again, and refused with the place."""

from dataclasses import replace

import pytest

from aerodb.errors import InputError
from aerodb.exchange.daveml.export import export_daveml
from aerodb.exchange.daveml.reader import import_daveml
from aerodb.exchange.jsbsim.check_cases import check_in_jsbsim, jsbsim_check_cases
from aerodb.exchange.jsbsim.export import export_jsbsim, input_properties
from aerodb.exchange.native import database_document_sha256, from_document, read_native, to_document
from aerodb.simulation import Condition, flight_model, linear_model, modes, trim
from aerodb.storage.writers.jsbsim_executive import loaded_in_jsbsim
from aerodb.tables import (
    Parameter,
    diff,
    failed_check_cases,
    make_check_cases,
    neutral_point,
    new_sign_changes,
    parse,
    with_parameters,
)
from tests.support.parts import MASSES, TEXT, aircraft


def test_a_build_up_is_stored_as_it_is_written() -> None:
    own = aircraft()
    document = to_document(own)
    assert document["parts"]["wing"]["control"]["delta_aileron"]["span"] == [0.6, 0.95]
    assert set(document["variables"]) == set(own.parameters)
    assert document["terms"] == []
    again = from_document(document)
    assert to_document(again) == document
    assert failed_check_cases(again, make_check_cases(own)) == ()


def test_a_corrected_parameter_leaves_the_parts_as_they_are() -> None:
    before, after = to_document(aircraft()), to_document(aircraft({"wing_slope": 5.4}))
    assert before["parts"] == after["parts"]
    assert after["variables"]["wing_slope"]["expression"] == "5.4"
    assert database_document_sha256(aircraft()) != database_document_sha256(
        aircraft({"wing_slope": 5.4})
    )


def test_what_something_else_has_changed_is_stored_as_terms() -> None:
    own = aircraft()
    at = next(k for k, term in enumerate(own.terms) if term.name == "propeller_FX")
    changed = replace(own.terms[at], expression=parse("0.5*propeller_thrust"))
    half = replace(own, terms=(*own.terms[:at], changed, *own.terms[at + 1 :]))
    document = to_document(half)
    assert "parts" not in document
    again = from_document(document)
    assert failed_check_cases(again, make_check_cases(half)) == ()


def test_a_difference_of_parts_is_told_as_it_is_written() -> None:
    moved = TEXT.replace("tip = [-6.7, 1.7, -0.4]", "tip = [-6.7, 1.9, -0.4]")
    changed = diff(aircraft(), read_native(moved)).terms
    assert [(each.kind, each.name) for each in changed] == [("part", "tail")]
    assert changed[0].before == "tip = [-6.7, 1.7, -0.4]"
    assert changed[0].after == "tip = [-6.7, 1.9, -0.4]"
    steeper = diff(aircraft(), aircraft({"tail_slope": 4.0})).terms
    assert [(each.kind, each.name) for each in steeper] == [("parameter", "tail_slope")]


def test_terms_and_parts_stand_beside_each_other() -> None:
    text = TEXT + '\n[derivatives.Cm]\nalpha = -0.1\n[[terms]]\nname = "more"\naxis = "CX"\n'
    more = read_native(text + 'expression = "0.01*wing_right_3_lift"\n')
    document = to_document(more)
    assert [term["name"] for term in document["terms"]] == ["more", "Cm_alpha"]
    assert failed_check_cases(from_document(document), make_check_cases(more)) == ()


def test_a_build_up_is_trimmed_and_has_modes() -> None:
    model = flight_model(aircraft())
    limits = {"throttle": (0.0, 1.0)}
    found = trim(model, Condition(55.0, 1000.0), MASSES, thrust="throttle", limits=limits)
    assert 0.0 < found.series["throttle"] < 1.0
    assert abs(found.series["delta_aileron"]) < 1e-9
    names = {mode.name for mode in modes(linear_model(found))}
    assert {"short period", "phugoid", "Dutch roll", "roll"} <= names


def test_other_simulators_compute_the_same() -> None:
    """JSBSim, flying the exported file, and the exported DAVE-ML, read back."""
    own = with_parameters(aircraft(), {"wing_zero": 0.31})
    cases = jsbsim_check_cases(own, 20)
    agreement = check_in_jsbsim(
        own,
        loaded_in_jsbsim(export_jsbsim(own, name="parts", cases=cases)),
        cases,
        input_properties(own),
    )
    assert agreement.passed, agreement.errors
    again = import_daveml(export_daveml(own), name="again")
    assert failed_check_cases(again, make_check_cases(again)) == ()


REFUSED = [
    ('position = [0.0, 0.0, 0.1]\nthrust', 'thrust', r"\[parts.propeller\]: position is missing"),
    ('kind = "engine"', 'kind = "motor"', r"\[parts.propeller\]: unknown kind 'motor'"),
    ('kind = "engine"\n', "", r"\[parts.propeller\]: a part without kind"),
    ('slipstream = "propeller"', 'slipstream = "propellor"', r"\[parts.tail\] slipstream: no engine 'propellor'(?s:.*)'propeller'"),
    ("diameter = 1.9\n", "", r"\[parts.tail\] slipstream: no engine 'propeller' with a diameter"),
    ('lift = "tail_slope*alpha"', 'lift = "tale_slope*alpha"', r"\[parts.tail\] lift: unknown name 'tale_slope'(?s:.*)'tail_slope'"),
    ('lift = "tail_slope*alpha"', 'lift = "tail_slope*alpha)"', r"\[parts.tail\] lift: unexpected '\)'"),
    ('lift = "tail_slope*alpha"', 'lyft = "tail_slope*alpha"', r"\[parts.tail\]: unknown key 'lyft'(?s:.*)'lift'"),
    ('THRUST(V, throttle)"', 'THRUSH(V, throttle)"', r"\[parts.propeller\] thrust: no table or function 'THRUSH'"),
    ("[parts.fin]", "[parts.tail]", r"(?i)tail"),
    ("[parts.fin]", "[parts.wing_left]", r"\[parts.wing_left\]: '.*' is a name of \[parts.wing\] too"),
    ("[parts.fin]", "[parts.2fin]", r"\[parts.2fin\]"),
    ('downwash = "0.02 + tail_downwash*alpha"', 'downwash = "0.1*fin_1_lift"\n', r"\[parts.(tail|fin)\] downwash: the flow at .* depends on each other"),
    ("bounds = [0.0, 0.8], description = \"downwash", 'bounds = [0.5, 0.8], description = "downwash', r"\[parameters\] tail_downwash: value 0.38 lies outside its bounds 0.5 to 0.8"),
    ("position = [-2.4, 0.0, 0.1]", "position = [-2.4, 0.1]", r"\[parts.fuselage\]: position has 2 values only"),
    ("position = [-2.4, 0.0, 0.1]", "position = [-2.4, nan, 0.1]", r"\[parts.fuselage\]: position.1: Input should be a finite"),
    ("wing_slope = { value = 5.0", "wing_slope = { value = nan", r"parameters.wing_slope.value: Input should be a finite"),
    ("wing_zero = {", "wing_slope = {", r"(?s)Cannot overwrite.*at line 9.*line 9 begins with: wing_slope = "),
    ("[tables.THRUST]", "[variables.wing_slope]\nexpression = \"alpha\"\n[tables.THRUST]", r"'wing_slope' is a parameter and a variable"),
    ("[parameters]\n", "[parameters]\nalpha = { value = 1.0 }\n", r"parameter 'alpha' has the name of a channel"),
    ("[parameters]\n", "[parameters]\nfin_1_lift = { value = 1.0 }\n", r"\[parts.fin\]: 'fin_1_lift' is a name of a parameter too"),
    ('"0.02 + tail_downwash*alpha"', '"0.1*tail_right_1_lift"', r"\[parts.tail\] downwash: the flow at tail depends on itself"),
    ("span = [0.6, 0.95]", "span = [0.95, 0.6]", r"\[parts.wing\]: control.delta_aileron(.span)?: span"),
    ("chord_ratio = 0.22\n", "", r"\[parts.wing\] control.delta_aileron: it has effectiveness and chord_ratio, or neither"),
    ("root = [-1.95, 0.3, -0.7]", "root = [-1.95, -9.3, -0.7]", r"\[parts.wing\]: a mirrored part that is not on the right"),
]  # fmt: skip


@pytest.mark.parametrize(("old", "new", "says"), REFUSED)
def test_a_wrong_part_is_refused_with_its_place(old: str, new: str, says: str) -> None:
    text = TEXT
    if "fin_1_lift" in new:
        fin = 'lift = "fin_slope*alpha"\n'
        text = text.replace(fin, fin + 'downwash = "0.1*tail_right_1_lift"\n')
    assert text.count(old) == 1
    with pytest.raises(InputError, match=says):
        read_native(text.replace(old, new))


def test_all_mistakes_of_a_file_are_said_each_with_its_place() -> None:
    """Two parts without a position; then, with these right, two parameters outside their bounds."""
    text = TEXT
    for line in (
        "position = [0.0, 0.0, 0.1]\n",
        "position = [-2.4, 0.0, 0.1]\n",
        "tip = [-6.9, 0.0, -2.0]\n",
    ):
        text = text.replace(line, "")
    with pytest.raises(InputError) as told:
        read_native(text, "aircraft.toml")
    lines = str(told.value).splitlines()
    assert lines[0] == "aircraft.toml: 3 mistakes"
    assert [line.partition(";")[0] for line in lines[1:]] == [
        "[parts.propeller]: position is missing",
        "[parts.fin]: tip is missing",
        "[parts.fuselage]: position is missing",
    ]
    text = TEXT.replace("bounds = [0.0, 0.8]", "bounds = [0.5, 0.8]")
    text = text.replace("bounds = [3.0, 7.0]", "bounds = [7.0, 3.0]")
    with pytest.raises(InputError) as told:
        read_native(text, "aircraft.toml")
    lines = str(told.value).splitlines()
    assert lines[1].startswith("[parameters] wing_slope: bounds 7 and 3;")
    assert lines[2].startswith("[parameters] tail_downwash: value 0.38 lies outside its bounds")


def test_a_corrected_parameter_is_no_new_sign_change_of_a_slope() -> None:
    """The engine pulls: at 1 m/s its coefficient would be a hundred, and no sign there tells of the lift."""
    assert neutral_point(aircraft())["V"] == 40.0
    for name in ("tail_slope", "tail_downwash", "wing_slope", "wing_zero", "fin_slope"):
        for factor in (0.8, 1.2):
            other = aircraft({name: factor * aircraft().parameters[name]})
            assert new_sign_changes(aircraft(), other) == (), (name, factor)


def test_an_unstable_build_up_is_refused_unless_flights_have_been_there() -> None:
    unstable = aircraft({"tail_slope": 1.1, "tail_downwash": 0.75})
    found = new_sign_changes(aircraft(), unstable)
    assert {change.quantity for change in found} == {"Cm"}
    reason = min(change.alpha for change in found)
    for low, expected in ((reason - 0.1, False), (reason + 0.01, True)):
        variables = dict(unstable.variables)
        for name in ("tail_slope", "tail_downwash"):
            flown = Parameter((0.0, 7.0), ("one",), {"alpha": (low, 0.5), "V": (45.0, 60.0)})
            variables[name] = replace(variables[name], parameter=flown)
        known = replace(unstable, variables=variables)
        assert neutral_point(known)["V"] == 52.5
        assert bool(new_sign_changes(aircraft(), known)) == expected
