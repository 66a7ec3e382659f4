"""What a release is decided on, as rows and words."""

from typing import Any

import pytest

from aerodb.report.gate_lines import gate_rows, release_lines


def measure(value: float, limit: float | None, **other: Any) -> dict[str, Any]:
    given = {"of": "values", "value": value, "limit": limit, "bound": "at most"}
    return {**given, "before": None, "unit": "", **other}


def check(label: str, *measures: dict[str, Any], reasons: tuple[str, ...] = ()) -> dict[str, Any]:
    named = {"label": label, "name": f"{label} in full", "acceptable": []}
    return {**named, "measures": list(measures), "reasons": list(reasons), "passed": not reasons}


def gate(*checks: dict[str, Any], notes: tuple[str, ...] = ()) -> dict[str, Any]:
    return {"label": "v0002", "checks": list(checks), "notes": list(notes)}


@pytest.mark.parametrize(
    ("measures", "found", "limit"),
    [
        ([], "", ""),
        ([measure(25, None, of="cases"), measure(0, 0)], "25 cases, 0 values", "none"),
        ([measure(0.1, 0.5), measure(0.4, 0.5, of="near")], "near 0.4", "at most 0.5"),
        (
            [measure(5, 6, bound="at least"), measure(3, 9, bound="at least", of="few")],
            "3 few",
            "at least 9",
        ),
        (
            [measure(0.5, 4.0, bound="below", before=4.0, unit="noise floors")],
            "values 4 -> 0.5 noise floors",
            "must fall",
        ),
    ],
)
def test_a_row_has_the_number_nearest_to_its_limit(
    measures: list[dict[str, Any]], found: str, limit: str
) -> None:
    (row,) = gate_rows([check("parent", *measures)])
    assert (row.found, row.limit, row.passed) == (found, limit, True)


def test_what_is_refused_and_open_stands_with_what_changes() -> None:
    slope = {"axis": "CZ", "variable": "alpha", "before": -2.0, "after": -2.5}
    steps = {"check": "q", "manoeuvres": 4, "passed": 3, "before": {"passed": 1, "manoeuvres": 4}}
    responses = {"checks": [steps], "stabilised": 2, "manoeuvres": 4}
    asked = gate(check("stale", reasons=("a flight is retracted",)), check("parent"), notes=("n",))
    lines = dict(release_lines(asked, {"derivatives": [slope]}, responses, ("alpha 8 -> 7 deg",)))
    assert lines == {
        "changes": ["slope of CZ with alpha -2 -> -2.5 1/rad (+25 %)"],
        "trim": ["alpha 8 -> 7 deg"],
        "gate": ["1 of 2 checks pass; fails stale"],
        "refused": ["a flight is retracted"],
        "responses": [
            "3 of 4 (baseline: 1 of 4) within tolerance; feedback closed in 2 of 4 manoeuvres"
        ],
        "open": ["n"],
    }


def test_an_import_has_little_to_decide_on() -> None:
    assert release_lines(gate(), {}, None) == []
    assert release_lines(None, {}, None) == []
    many = gate(notes=tuple("abcdef"))
    assert release_lines(many, {}, None) == [("open", ["a", "b", "c", "d", "2 more"])]
