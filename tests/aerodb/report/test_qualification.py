"""The qualification table: cases side by side in the units of the standards, and what is missing."""

import csv
import io
from typing import Any

import numpy as np
import pytest
from lxml import html

from aerodb.report.qualification import (
    UNCHECKED,
    feedback_words,
    qualification_csv,
    qualification_rows,
    qualification_table,
    standard_words,
)
from aerodb.report.response_page import FlownStretch, response_report, tolerance_bands
from aerodb.simulation import Oscillation, check_responses, parse_tolerances
from aerodb.tasks.steps import default_tolerances, responses_summary, standard_document

LIMITS = parse_tolerances(default_tolerances())
TIME = np.linspace(0.0, 10.0, 501)
FLOWN = {"theta": 0.1 * np.sin(TIME), "q": 0.1 * np.cos(TIME), "az": -9.8 + np.sin(TIME)}


def checks(pitch: float, load: float) -> list[dict[str, Any]]:
    """Results of a response that is off by `pitch` [rad] and `load` [m/s2]."""
    off = FLOWN | {"theta": FLOWN["theta"] + pitch, "q": FLOWN["q"] + 1.0}
    off["az"] = FLOWN["az"] + load
    found = check_responses(LIMITS, off, FLOWN, ("pitch",))
    return [{**vars(check), "bands": [vars(band) for band in check.bands]} for check in found]


def document(version: str, pitch: float, load: float, closed: bool = True) -> dict[str, Any]:
    stretch: dict[str, Any] = {
        "since": 7.3, "until": 17.3, "kind": "pull_up", "controls": ["pitch"], "responses": [],
        "feedback": {"delta_elevator:q": 0.3} if closed else {},
        "correction": {"delta_elevator": np.deg2rad(0.4)} if closed else {},
        "condition": {"V": 77.2, "altitude": 1905.0, "mass": 22700.0,
                      "configuration": {"delta_landing_gear": 0.0, "delta_flap": np.deg2rad(20.0)}},
        "checks": checks(pitch, load), "oscillations": {}, "notes": [],
    }  # fmt: skip
    if closed:
        stretch["open_loop"] = {
            "checks": checks(0.5, 20.0), "ended": 12.0, "doubling_time": 0.35,
        }  # fmt: skip
    return {
        "flight": "f" * 64,
        "version": version,
        "tolerances": LIMITS.name,
        "standard": standard_document(LIMITS),
        "stretches": [stretch],
    }


@pytest.fixture
def summary() -> dict[str, Any]:
    after = [document("a", np.deg2rad(0.4), 0.49)]
    before = [document("b", np.deg2rad(0.9), 2.06)]
    return responses_summary(after, before, {"f" * 64: "=phoenix-07"}, True)


def test_a_case_has_condition_tolerance_deviation_and_both_results(
    summary: dict[str, Any],
) -> None:
    attitude, load = qualification_rows(summary)
    assert (attitude.test, load.test) == ("2.c.10", "2.c.10")
    assert attitude.case == "=phoenix-07, 7.3 to 17.3 s"
    assert attitude.condition == "150 kt, 6250 ft, 22700 kg"
    assert attitude.configuration == "flap 20 deg"
    assert attitude.tolerance == "theta ±1.5 deg or q ±2 deg/s"
    assert attitude.after.deviation == "theta 0.4 deg, q 57 deg/s"
    assert (attitude.after.inside, attitude.after.result) == ("100", "pass")
    assert load.tolerance == "az ±0.1 g"
    assert load.after.deviation == "az 0.05 g"
    assert load.before is not None
    assert (load.before.deviation, load.before.result) == ("az 0.21 g", "FAIL")
    assert load.after.alone is not None
    assert (load.after.alone.inside, load.after.alone.result) == ("0", "FAIL")


def test_feedback_and_open_loop_are_told(summary: dict[str, Any]) -> None:
    assert feedback_words(summary) == [
        "Feedback was closed in 1 of 1 manoeuvres; it moved a control by up to 0.4 deg.",
        "Open loop, 0 of 2 checks are within tolerance: the fastest motion doubles in 0.35 s.",
    ]
    stable = responses_summary([document("a", 0.0, 0.0, False)], [], {"f" * 64: "f"}, True)
    assert stable["feedback"] is None
    assert feedback_words(stable) == []
    assert qualification_rows(stable)[0].after.alone is None


def test_what_no_flight_covers_is_listed(summary: dict[str, Any]) -> None:
    left = [test["number"] for test in summary["not_covered"]]
    assert "2.c.10" not in left
    assert len(left) == 17
    assert left[:2] == ["2.c.1", "2.c.2"]


def test_every_paragraph_says_what_of_it_was_compared_with_which_text(
    summary: dict[str, Any],
) -> None:
    said = standard_words(summary)
    assert said[:6] == [
        "Numbers of tests: 14 CFR part 60, appendix A, table A2A, edition of 1 January 2014.",
        "Compared with that text, tolerance, title and flight condition: "
        "2.c.9-10, 2.d.2, 2.d.4, 2.d.6-7.",
        "Compared with that text, title and flight condition: "
        "2.c.1-4, 2.c.6-7, 2.d.1, 2.d.5, 2.d.8.",
        "Compared with that text, title: 2.c.5, 2.c.8, 2.d.3.",
        "Nothing was compared with AC 120-40B, appendix 2.",
        "Nothing was compared with CS-FSTD(A).",
    ]
    summary["standard"]["tests"][0]["compared"] = ""  # somebody's own paragraph
    assert "Not compared with that text: 2.c.1." in standard_words(summary)
    rows = csv.DictReader(io.StringIO(qualification_csv(summary, "v0002", "")))
    compared = {row["test"]: row["compared with the text"] for row in rows}
    assert compared["2.c.10"] == "tolerance, title and flight condition"
    assert compared["2.c.5"] == "title"


def test_a_paragraph_that_judges_has_its_tolerance_compared() -> None:
    judged = {check.test for check in LIMITS.checks if check.test}
    assert judged == {test.number for test in LIMITS.tests if test.compared.startswith("tolerance")}


def test_the_csv_has_a_row_per_case_and_per_test_that_is_missing(summary: dict[str, Any]) -> None:
    rows = list(csv.DictReader(io.StringIO(qualification_csv(summary, "v0002", "v0001"))))
    load = rows[1]
    assert load["title"] == "short period dynamics"
    assert load["flight"] == "'=phoenix-07"  # no formula
    assert load["true airspeed [kt]"] == "150.1"
    assert load["configuration"] == "landing gear 0, flap 20 deg"
    assert (load["v0002: result"], load["v0001: result"]) == ("pass", "FAIL")
    assert load["v0002: largest correction by feedback [deg]"] == "0.400"
    assert load["v0002: open loop: result"] == "FAIL"
    missing = [row["test"] for row in rows if row["v0002: result"] == "not covered"]
    assert missing == [test["number"] for test in summary["not_covered"]]
    assert [row["title"] for row in rows if row["test"] == "note"] == [
        *feedback_words(summary),
        *standard_words(summary),
    ]
    alone = list(csv.DictReader(io.StringIO(qualification_csv(summary, "v0002", ""))))
    assert not any(name.startswith("v0001") for name in alone[0])


def test_a_check_without_a_paragraph_says_so(summary: dict[str, Any]) -> None:
    summary["cases"][0]["test"] = ""
    first, last = qualification_rows(summary)
    assert (first.test, last.test) == ("2.c.10", UNCHECKED)


def test_the_table_is_there_before_a_figure_is_drawn(summary: dict[str, Any]) -> None:
    """The first stretch cannot be drawn: what stands before its figure is read all the same."""
    stretch = {"since": 0.0, "until": 1.0, "kind": "roll", "checks": [], "correction": {}}
    nothing = FlownStretch("flight", {**stretch, "notes": []}, {"alpha": ()}, {})
    pieces = response_report("v0002", "", summary, [nothing])
    read = list[str]()
    with pytest.raises(ValueError, match="unpack"):
        read.extend(pieces)
    said = "".join(read)
    assert "Qualification table" in said
    assert said.count("</table>") == said.count("<table")


def test_a_page_has_the_table_with_the_result_beside_the_case(summary: dict[str, Any]) -> None:
    tree = html.fromstring("".join(response_report("v0002", "v0001", summary, [])))
    assert [h.text_content() for h in tree.xpath("//h2")] == ["Qualification table"]
    (table,) = tree.xpath("//table[@class='qualification']")
    cells = [cell.text_content() for cell in table.xpath(".//tr[last()]/td")]
    assert cells == [
        "100 % pass",
        "az ±0.1 g",
        "az 0.05 g",
        "0 % FAIL",
        "az 0.21 g",
        "0 % FAIL",
    ]
    said = [p.text_content() for p in tree.xpath("//p[starts-with(@class, 'lead')]")]
    assert said[0].startswith("Checks within tolerance of v0002: 2 of 2 (v0001: 1 of 2), in 1")
    assert said[2:] == feedback_words(summary)


def test_documents_of_earlier_releases_have_no_table() -> None:
    old = document("a", 0.0, 0.0, False)
    del old["standard"], old["stretches"][0]["condition"]
    old["stretches"][0]["checks"] = []
    assert qualification_table(responses_summary([old], [], {"f" * 64: "f"}, True)) is None
    old["stretches"][0]["checks"] = [{"check": "q", "share": 1.0, "passed": True}]
    (row,) = qualification_rows(responses_summary([old], [], {"f" * 64: "f"}, True))
    assert (row.test, row.condition, row.tolerance) == (UNCHECKED, "", "")


def test_bands_are_those_of_time_histories() -> None:
    swings = {"r": (None, Oscillation(2.0, 0.1, 3.0, 3.5, 0.0, 0.0))}
    turning = FLOWN | {"r": FLOWN["q"]}
    found = check_responses(LIMITS, turning, turning, ("pitch", "yaw"), oscillations=swings)
    told = [{"bands": [vars(band) for band in check.bands]} for check in found]
    widths = tolerance_bands(told)
    assert widths["theta"] == pytest.approx(np.deg2rad(1.5))
    assert widths["az"] == pytest.approx(0.981)
    assert set(widths) == {"theta", "q", "az", "r"}
    period = next(check for check in found if check.check == "Dutch roll: period")
    assert period.bands[0].deviation is None  # the simulation does not oscillate
    assert period.bands[0].limit == pytest.approx(0.5)
