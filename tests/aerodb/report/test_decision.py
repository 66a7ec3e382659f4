"""Five lines to decide on: they say what the document says, in few lines and short sentences."""

import textwrap
from itertools import combinations_with_replacement, product
from typing import Any

import pytest

from aerodb.increments.model_file import parse_model_file
from aerodb.remarks import REFUSED
from aerodb.report.decision import decision
from aerodb.report.next_command import to_try
from tests.aerodb.report.test_report import found, loop, proof
from tests.support.contradictions import contradictions

#: Lines until the next command, at most, of a terminal of so many columns.
MOST_LINES, COLUMNS = 5, 80


def told(document: dict[str, Any]) -> dict[str, tuple[str, ...]]:
    """Label -> texts, of a document whose next command is in few lines of a narrow terminal, without
    long sentences."""
    made = decision(document)
    labels = [label for label, _ in made.lines]
    upper = made.lines[: labels.index("next") + 1] if "next" in labels else ()
    margin = 4 + max(map(len, labels))
    read = [*textwrap.wrap(made.verdict, COLUMNS)]
    for _, texts in upper:
        read += [line for each in texts for line in textwrap.wrap(each, COLUMNS - margin)]
    assert len(read) <= MOST_LINES, read
    for text in (made.verdict, *(text for _, texts in made.lines for text in texts)):
        assert all(len(part.split()) <= 25 for part in text.split("; ")), text
    return dict(made.lines)


def published(document: dict[str, Any], *axes: str) -> dict[str, Any]:
    """The document with the version that publishing adds, and increments on these axes."""
    made = {"candidate": "d" * 64, "label": "v0002", "increments": [{"axis": a} for a in axes]}
    return {**document, **made}


def test_a_version_says_change_proof_gate_and_next_command() -> None:
    better = [proof("CX", 0.02, 0.005, noise_floor=0.001), proof("Cm", 0.02, 0.02)]
    document = published(loop([found()], [found()], better), "CX")
    lines = told(document)
    assert decision(document).verdict.startswith(
        f"{document['vehicle']}: {document['label']} has 1 change ("
    )
    assert lines["found"] == ("slope of CX with pitch rate: CX_q \u22120.19 +- 0.03 (confirmed)",)
    assert lines["proved"] == ("on 2 flights not used: error of CX 0.02 -> 0.005 (126 -> 32 %)",)
    assert "gate" not in lines, "nobody asked"
    document["gate"] = {"checks": 2 * [{"label": "parent", "reasons": []}]}
    assert told(document)["gate"] == ("all 2 checks pass",)
    assert "has 1 change; the gate passes it (" in decision(document).verdict
    document["gate"] = {"checks": []}
    assert told(document)["gate"] == ("it is released",)
    assert lines["left"][0].startswith("Cm ")
    assert lines["next"][0].startswith(f"aerodb version gate {document['label']} --vehicle")


def test_a_wrong_sensor_beside_what_was_added_is_said_with_its_size() -> None:
    sensor = found(verdict="sensor", hypothesis="cg_offset@all:x")
    document = published(loop([found(), sensor], [found()], [proof("CX", 0.02, 0.005)]), "CX")
    (said,) = told(document)["wrong"]
    assert said.endswith("(sensor); correct it; its part is left out of the errors")
    assert "wrong" not in told(published(loop([found()], [found()], [proof("CX", 0.02, 0.005)])))


def test_what_the_vehicle_file_states_wrong_is_corrected_next() -> None:
    """An error is what is stated less what is true: too far forward is corrected by less. A vane is
    no matter of that file, and what heads the findings comes first."""
    placed = found(verdict="sensor", hypothesis="cg_offset@all:x", value=0.0152, unit="m")
    flap = found(verdict="sensor", hypothesis="surface_scale@all:flap", value=-0.0141)
    vane = found(verdict="sensor", hypothesis="alpha_bias@all", value=0.01, unit="rad")
    lines = told(loop([placed, flap, vane], [], [proof("CX", 0.02, 0.02)]))
    assert lines["next"] == ("aerodb vehicle add FILE",)
    assert lines["FILE"][0].endswith(
        "along body x 0.0152 m lower; scale of the deflection of the flap 1.41 % higher"
    )
    assert "angle of attack" not in lines["FILE"][0]
    other = told(loop([vane, placed], [], [proof("CX", 0.02, 0.02)]))
    assert "FILE" not in other


def test_levels_that_follow_a_condition_come_first_with_the_model_that_estimates_them() -> None:
    """The command has those options of the loop that an update has; a level that follows nothing is
    no step."""
    follows = {
        "condition": "mach",
        "slope": -0.5,
        "standard_error": 0.05,
        "levels": [[0.541, 0.045], [0.583, 0.0236], [0.618, 0.0069]],
        "effects": ["mach_effect@C_lift"],
    }
    level = {"axis": "CZ", "constant": 0.025, "spread": 0.019, "share": 0.9, "floor": 0.003}
    document = loop([], [], [proof("CZ", 0.03, 0.03, noise_floor=0.003)])
    document["levels"] = [{**level, "rivals": [], "conditions": [follows]}]
    given = ("--baseline v0002", "--accept-suspected all", "--hold-out none")
    made = decision(document, given=given)
    assert "what the database lacks on CZ differs from flight to flight" in made.verdict
    lines = dict(made.lines)
    assert lines["strongest"][0].endswith("follows Mach number: 0.045 at 0.541 to 0.0069 at 0.618")
    ((command,), (model,)) = lines["next"], lines["FILE"]
    (increment,) = parse_model_file(model).increment
    assert (increment.axis, increment.terms[-1]) == ("C_lift", "alpha*mach^2")
    vehicle = document["vehicle"]
    assert command == (
        f"aerodb update --vehicle {vehicle} --baseline v0002 --hold-out none --model FILE"
    )
    document["levels"] = [{**level, "rivals": [], "conditions": []}]
    assert "FILE" not in dict(decision(document).lines)


def test_what_became_worse_and_what_the_gate_refuses_is_in_the_lines() -> None:
    rows = [proof("CX", 0.02, 0.005), proof("CZ", 0.01, 0.02)]
    both = [found(), found("alpha_slope@CZ")]
    document = published(loop(both, both, rows), "CX", "CZ")
    document["remarks"] = ["The gate will refuse this version: CZ_alpha changes its sign."]
    document["remark_data"] = [{"kind": REFUSED, "subjects": [], "text": "", "values": {}}]
    lines = told(document)
    assert lines["proved"][0].endswith("; worse: CZ")
    assert lines["gate"] == ("it will refuse; the reasons are below",)
    assert lines["why"] == ("The gate will refuse this version: CZ_alpha changes its sign",)
    assert "the gate refuses it (" in decision(document).verdict
    failed = [
        {"label": "held-out error", "reasons": ["Cm is worse"]},
        {"label": "check cases", "reasons": ["none are there."]},
    ]
    document["gate"] = {"checks": [*failed, {"label": "parent", "reasons": []}]}
    refused = told(document)
    assert refused["gate"] == ("refuses, by held-out error and check cases (2 of 3 checks)",)
    assert refused["why"] == ("Cm is worse", "none are there")


def test_one_change_is_read_first_and_the_others_below_the_next_command() -> None:
    names = ["alpha_slope@CZ", "beta_slope@Cn", "beta_slope@CY", "alpha_slope@Cm", "q@Cm"]
    five = [found(name, verdict="suspected") for name in names]
    document = published(loop(five, five, [proof("CZ", 0.02, 0.005)]), "CZ")
    document["gate"] = {"checks": [{"label": "parent", "reasons": []}]}
    lines = decision(document).lines
    assert [label for label, _ in lines][:4] == ["found", "proved", "gate", "next"]
    assert len(dict(lines)["found"]) == 1
    assert dict(lines)["also"][2:] == ("2 more: -v",)
    assert " has 5 unconfirmed changes; " in decision(document).verdict
    document["findings"][4]["verdict"] = "confirmed"
    assert " has 5 changes, 1 confirmed; " in decision(document).verdict
    (first,) = dict(decision(document).lines)["found"]
    assert "Cm" in first
    assert "(confirmed)" in first


def test_suspicions_propose_the_command_that_tries_them() -> None:
    """One by name, four as all; never what a better shape takes the name from."""
    rows = [proof("CX", 0.02, 0.02)]
    names = ["alpha_slope@CZ", "beta_slope@Cn", "beta_slope@CY", "alpha_slope@Cm"]
    maybe = [found(name, verdict="suspected") for name in names]
    one = loop(maybe[:1], [], rows)
    assert told(one)["next"][0].endswith("--accept-suspected alpha_slope@CZ")
    assert told(loop(maybe, [], rows))["next"][0].endswith("--accept-suspected all")
    twin = loop([found("body_flap@Cm", verdict="alias_group")], [], rows)
    assert to_try(twin) == ["--accept-lumped body_flap@Cm"]
    one["findings"][0]["shape"] = {"by": ["alpha"]}
    assert to_try(one) == []


@pytest.mark.parametrize("worst", ["CX", "Cm"])
def test_what_acts_where_most_is_left_is_read_first(worst: str) -> None:
    rows = [proof(a, 0.02, 0.02, noise_floor=0.001 if a == worst else 0.01) for a in ("CX", "Cm")]
    maybe = [found(f"alpha_slope@{a}", verdict="suspected") for a in ("Cm", "CX", "Cn")]
    lines = told(loop(maybe, [], rows))
    assert f"slope of {worst} " in lines["strongest"][0]
    assert lines["left"][0].startswith(worst)


def test_the_empty_case_claims_nothing() -> None:
    document = loop([], [], [proof("CX", 0.001, 0.001, outcome="unchanged")])
    assert "nothing is missing that these flights could show" in decision(document).verdict
    assert {"found", "strongest", "proved", "gate"}.isdisjoint(told(document))
    document["not_found"] = [{**each, "verdict": "not_testable"} for each in document["not_found"]]
    assert "these flights cannot decide; 2 of 2 causes stay open" in decision(document).verdict


def test_what_a_sensor_may_be_asks_for_its_measurement() -> None:
    document = loop([found(verdict="ambiguous_sensor")], [], [proof("CX", 0.02, 0.02)])
    sigma = {"parameter": "thrust_line_z", "sigma": 0.021, "unit": "m"}
    document["findings"][0]["wanted"] = [sigma]
    lines = told(document)
    assert lines["next"] == ("aerodb close-loop --vehicle v --measured thrust_line_z=SIGMA",)
    assert lines["measure"] == ("thrust_line_z to 0.021 m, not in flight",)


def test_what_no_effect_fits_has_no_size() -> None:
    rows = [proof("CX", 0.02, 0.02)]
    document = loop([found()], [], rows)
    nameless = {"hypothesis": "unnamed@CX", "effect": "unnamed", "verdict": "unnamed"}
    document["findings"][0] |= {**nameless, "ci95": None, "value": None}
    assert told(document)["strongest"] == ("error of CX that no known effect fits (unnamed)",)


VERDICTS = ("confirmed", "suspected", "alias_group", "ambiguous_sensor", "sensor", "unnamed")
#: Two measurements each for three findings: more than a sentence names.
WANTED = [
    {"parameter": f"{name}_bias", "sigma": 0.01, "unit": "rad"} for name in ("alpha", "beta", "phi")
]
GIVEN = ("--baseline v0003", "--flights 0123456789ab", "--hold-out none")


def results() -> list[tuple[str, dict[str, Any]]]:
    """Closed loops with every set of up to three verdicts, of which each that may enter does, stays
    out, or proved no gain, beside errors that fall, rise, or are at their floor."""
    names = ("alpha_slope@CX", "beta_slope@CY", "alpha_slope@CZ")
    errors = {"falls": (0.02, 0.005), "rises": (0.02, 0.03), "floor": (0.001, 0.001)}
    made = []
    for count in range(4):
        for verdicts in combinations_with_replacement(VERDICTS, count):
            findings = [found(n, verdict=v) for n, v in zip(names, verdicts, strict=False)]
            for entered, kind, floor in product(("all", "none", "idle"), errors, (0.001, 0.0)):
                enter = [f for f in findings if f.verdict == "confirmed" and entered == "all"]
                proofs = [proof(axis, *errors[kind], noise_floor=floor) for axis in ("CX", "CZ")]
                document = loop(findings, enter, proofs)
                for k, each in enumerate(document["findings"]):
                    if each["verdict"] == "ambiguous_sensor":
                        each["wanted"] = [*WANTED[k:], {**WANTED[0], "parameter": "q_scale"}]
                if entered == "idle":
                    document["without_gain"] = [
                        f.hypothesis for f in findings if f.verdict == "confirmed"
                    ]
                if enter:
                    document = published(document, *(f.axis[0] for f in enter))
                    reasons = ["CX is worse"] if kind == "rises" else []
                    document["gate"] = {"checks": [{"label": "held-out error", "reasons": reasons}]}
                made.append((f"{verdicts} {entered} {kind} {floor}", document))
    return made


def test_no_line_of_any_result_contradicts_its_neighbour() -> None:
    documents = results()
    assert len(documents) > 1000
    wrong = {name: found for name, each in documents if (found := contradictions(each, GIVEN))}
    assert not wrong, next(iter(wrong.items()))


@pytest.mark.parametrize(
    ("verdict", "said"),
    [
        ("confirmed", "nothing was added; 1 confirmed, as other flights gain nothing from it"),
        ("suspected", "nothing is proved yet; 1 suspicion"),
        ("sensor", "the database stays; the errors found are in the sensors"),
    ],
)
def test_what_is_proved_is_said_where_nothing_was_added(verdict: str, said: str) -> None:
    document = loop([found(verdict=verdict)], [], [proof("CX", 0.02, 0.02)])
    document["without_gain"] = [document["findings"][0]["hypothesis"]]
    assert said in decision(document).verdict


def test_an_error_that_no_cause_explains_is_not_called_nothing() -> None:
    document = loop([], [], [proof("CX", 0.05, 0.05)])
    assert "no cause was found for the error that is left; 2" in decision(document).verdict


def test_commands_name_every_measurement_and_repeat_the_options() -> None:
    document = loop([found(verdict="ambiguous_sensor")], [], [proof("CX", 0.02, 0.02)])
    document["findings"][0]["wanted"] = [*WANTED, {**WANTED[0], "parameter": "q_scale"}]
    lines = dict(decision(document, given=GIVEN).lines)
    assert lines["measure"][0].startswith("alpha_bias to 0.01 rad, ")
    assert lines["measure"][0].endswith(" and 1 more, not in flight")
    (step,) = lines["next"]
    assert step.startswith("aerodb close-loop --vehicle v ")
    assert step.endswith(
        f"{' '.join(GIVEN)} --measured alpha_bias=SIGMA --measured beta_bias=SIGMA"
        " --measured phi_bias=SIGMA --measured q_scale=SIGMA"
    )
