"""Five lines to decide on: they say what the document says, in few lines and short sentences."""

from typing import Any

from aerodb.remarks import REFUSED
from aerodb.report.decision import decision, to_try
from tests.aerodb.report.test_report import found, loop, proof

#: Lines until the next command, at most: three changes, the count of the others, proof, gate, rest.
MOST_LINES = 8


def told(document: dict[str, Any]) -> dict[str, tuple[str, ...]]:
    """Label -> texts, of a document that fits into few lines without long sentences."""
    made = decision(document)
    assert 1 + sum(len(texts) for _, texts in made.lines) <= MOST_LINES
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
        f"{document['vehicle']}: {document['label']} has 1 change; it waits for the gate ("
    )
    assert lines["found"] == ("slope of CX with pitch rate (confirmed): CX_q \u22120.19 +- 0.03",)
    assert lines["proved"] == (
        "on 2 flights not used: error of CX 0.02 -> 0.005 (126 % -> 32 % of what was flown)",
    )
    assert lines["gate"] == ("nothing known here stands against it",)
    assert lines["left"][0].startswith("Cm ")
    assert lines["next"][0].startswith(f"aerodb version gate {document['label']} --vehicle")


def test_what_became_worse_and_what_the_gate_refuses_is_in_the_lines() -> None:
    rows = [proof("CX", 0.02, 0.005), proof("CZ", 0.01, 0.02)]
    both = [found(), found("alpha_slope@CZ")]
    document = published(loop(both, both, rows), "CX", "CZ")
    document["remarks"] = ["The gate will refuse this version: CZ_alpha changes its sign."]
    document["remark_data"] = [{"kind": REFUSED, "subjects": [], "text": "", "values": {}}]
    lines = told(document)
    assert lines["proved"][0].endswith("; worse: CZ")
    assert lines["gate"] == ("The gate will refuse this version: CZ_alpha changes its sign",)
    assert "the gate will refuse it as it is" in decision(document).verdict


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


def test_the_empty_case_claims_nothing() -> None:
    document = loop([], [], [proof("CX", 0.002, 0.002, outcome="unchanged")])
    assert "nothing is missing that these flights could show" in decision(document).verdict
    assert {"found", "strongest", "proved", "gate"}.isdisjoint(told(document))
    document["not_found"] = [{**each, "verdict": "not_testable"} for each in document["not_found"]]
    assert "these flights cannot decide; 2 of 2 causes stay open" in decision(document).verdict


def test_what_a_sensor_may_be_asks_for_its_measurement() -> None:
    document = loop([found(verdict="ambiguous_sensor")], [], [proof("CX", 0.02, 0.02)])
    sigma = {"parameter": "thrust_line_z", "sigma": 0.021, "unit": "m"}
    document["findings"][0]["wanted"] = [sigma]
    assert told(document)["next"] == (
        "measure thrust_line_z to 0.021 m outside flight; aerodb close-loop --vehicle v"
        " --measured thrust_line_z=SIGMA",
    )


def test_what_no_effect_fits_has_no_size() -> None:
    rows = [proof("CX", 0.02, 0.02)]
    document = loop([found()], [], rows)
    nameless = {"hypothesis": "unnamed@CX", "effect": "unnamed", "verdict": "unnamed"}
    document["findings"][0] |= {**nameless, "ci95": None, "value": None}
    assert told(document)["strongest"] == (
        "error of CX that no effect of the library fits (unnamed)",
    )
