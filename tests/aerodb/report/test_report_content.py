"""Text and figures of report pages.

Sentences claim no more than is confirmed, every axis has its unit, figures agree with the stored
numbers or say that they do not, and pages stay small.
"""

import base64
import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from lxml import html
from matplotlib.figure import Figure

from aerodb.coefficients.comparison import Comparison
from aerodb.conditioning.segmentation import Segment
from aerodb.conditioning.suspicion import Suspicion
from aerodb.flight import Flight
from aerodb.remarks import CONTRADICTS, MOVING_AIR, SAID, SUSPECTED, Remark
from aerodb.report.database_figure import database_figure
from aerodb.report.decision import decision
from aerodb.report.figures import update_figure
from aerodb.report.findings import meaning
from aerodb.report.flight_errors import disagreements, flight_errors
from aerodb.report.flight_figures import (
    channel_figure,
    coefficient_figure,
    envelope_figure,
    segment_figure,
)
from aerodb.report.flight_page import FlightStory, flight_report, verdict_sentences
from aerodb.report.numbers import number
from aerodb.report.style import Picture
from aerodb.report.update_figures import error_figure, residual_figure, voter
from aerodb.report.update_page import UpdateStory, update_report
from tests.aerodb.report.test_report import checked, found, loop, page_of, proof, table, words_of
from tests.support import synthetic

#: The rms of a residual beside its distribution.
RESIDUAL = re.compile(r">[\d.×⁰-⁹¹²³⁻]+ rms<")
HOSTILE = "<script>alert(1)</script>\u202e$\\frac{1}{$"


@pytest.fixture(scope="module")
def flown() -> Flight:
    return synthetic.flight(np.random.default_rng(1), seconds=60.0)


@pytest.fixture(scope="module")
def sides(flown: Flight) -> tuple[dict[str, Comparison], dict[str, Comparison]]:
    """Two flights before and after, with errors of CZ that differ between them."""
    rng, n = np.random.default_rng(2), len(flown.time)
    noise = {f"f{k}": (0.01 + 0.01 * k) * rng.standard_normal(n) for k in (4, 5)}
    before = {
        id: synthetic.comparison(flown, {"CZ": values, "CX": values})
        for id, values in noise.items()
    }
    after = {
        id: synthetic.comparison(flown, {"CZ": 0.1 * values, "CX": values})
        for id, values in noise.items()
    }
    return before, after


def pooled(side: dict[str, Comparison], axis: str) -> float:
    return float(
        np.sqrt(
            np.mean(np.concatenate([c.residual(axis)[c.usable[axis]] for c in side.values()]) ** 2)
        )
    )


def story(document: dict[str, Any], sides: Any, flown: Flight, added: bool = True) -> UpdateStory:
    before, after = sides
    database = synthetic.database()
    labels = {f"f{k}": f"flight {k}" for k in range(7)}
    channels = {id: dict(flown.channels) for id in before}
    return UpdateStory(
        document,
        labels,
        "v0001",
        "v0002" if added else None,
        (database, database),
        before,
        after if added else {},
        channels,
    )


def drawn(tree: Any) -> list[str]:
    """The SVGs of a page."""
    return [
        base64.b64decode(image.get("src").partition(",")[2]).decode()
        for image in tree.xpath("//img")
    ]


def without_units(figure: Figure) -> list[str]:
    """Labels without a unit: of the lowest panel of each column over x, of the leftmost of each row
    over y, or its title. A row of names (axes, flights, segments) needs none."""
    shown = [
        (panel, panel.get_subplotspec())
        for panel in figure.axes
        if panel.get_visible() and panel.axison
    ]
    lowest = {
        place.colspan.start: panel
        for panel, place in sorted(shown, key=lambda entry: entry[1].rowspan.start)
    }
    leftmost = {
        place.rowspan.start: panel
        for panel, place in sorted(shown, key=lambda entry: -entry[1].colspan.start)
    }
    figure.canvas.draw()
    named = [
        panel
        for panel in leftmost.values()
        if any(t.get_text().strip("−-.0123456789") for t in panel.get_yticklabels())
    ]
    labels = [panel.get_xlabel() for panel in lowest.values()]
    labels += [
        panel.get_ylabel() or panel.get_title(loc="left")
        for panel in leftmost.values()
        if panel not in named
    ]
    return [label for label in labels if not re.search(r"\[.+\]", label)]


def test_every_axis_says_its_unit(flown: Flight, sides: Any) -> None:
    before, after = sides
    rows = [
        {
            "axis": "CZ",
            "before": 0.02,
            "after": 0.01,
            "floor": 0.005,
            "each": [[0.02, 0.01], [0.03, None]],
        }
    ]
    segments = [
        Segment("doublet", 1.0, 3.0, "elevator"),
        Segment("airborne", 0.0, 60.0, "never slow"),
    ]
    channels = {id: dict(flown.channels) for id in before}
    figures = [
        error_figure(rows),
        update_figure(["CX", "CZ"], before, {}, {}),
        residual_figure(["CZ"], ["alpha", "q"], before, after, channels, {"CZ": 1e-3}),
        segment_figure(segments, flown),
        database_figure(synthetic.database()),
    ]
    figures += [
        coefficient_figure(before["f4"], flown),
        channel_figure(["alpha", "V"], flown, flown),
        envelope_figure(flown, None),
    ]
    assert [without_units(figure) for figure in figures] == [[]] * len(figures)
    figures[1].axes[0].set_ylabel("CX")
    assert without_units(figures[1]) == ["CX"]


def test_a_curve_of_a_database_goes_through_its_breakpoints() -> None:
    panel = next(
        p for p in database_figure(synthetic.database()).axes if p.get_ylabel() == "CZ [-]"
    )
    marks = panel.lines[1]
    assert np.allclose(np.deg2rad(marks.get_xdata()), [-0.2, -0.1, 0.0, 0.1, 0.2, 0.3])
    assert np.allclose(marks.get_ydata(), [0.6, 0.3, 0.0, -0.3, -0.6, -0.8])


def test_the_verdict_and_the_consistency_are_a_sentence_each() -> None:
    channels = [
        {"channel": "alpha", "after": np.deg2rad(0.4), "limit": np.deg2rad(0.5)},
        {"channel": "V", "after": 0.1, "limit": 1.0},
        {"channel": "velocity_down", "after": 9.0, "limit": float("nan")},
    ]
    channels = [{**channel, "verdict": "good"} for channel in channels]
    said = verdict_sentences("good", [], {"channels": channels})
    assert said == (
        "The flight can be used for identification and validation.",
        "All 2 channels with a limit are consistent with the reconstructed motion; alpha is closest"
        " to its limit (0.4 of 0.5 deg).",
    )
    limited = verdict_sentences(
        "limited",
        [
            Remark(MOVING_AIR, text="gusts: V 0.4"),
            Remark(MOVING_AIR, text="gusts: b"),
        ],
        {"channels": channels[1:]},
    )
    assert limited[0] == "The flight can be used with limitations: turbulence."
    assert limited[1].startswith("The one channel with a limit is consistent")
    beyond = [{**channels[0], "after": np.deg2rad(0.6), "verdict": "limited"}, channels[1]]
    assert verdict_sentences(
        "rejected", [Remark(SAID, text="qbar fails")], {"channels": beyond}
    ) == (
        "The flight is stored but not used for identification: qbar fails.",
        "Outside their limits: alpha.",
    )
    assert verdict_sentences("unchecked", [], None) == (
        "The kinematic consistency of the flight has not been checked.",
        "",
    )
    contradicts = verdict_sentences(
        "limited", [Remark(CONTRADICTS, ("v0001", "CZ"), text="lift is 0")], None
    )
    assert contradicts[0].endswith("with limitations: it contradicts version v0001.")
    suspected = verdict_sentences(
        "good", [Remark(SUSPECTED, ("v0001", "Ixx"), text="a mass")], None
    )
    assert suspected == verdict_sentences("good", [], None)


def test_a_channel_whose_gusts_were_left_out_is_not_outside_its_limit() -> None:
    gusts = {"channel": "beta", "after": np.deg2rad(0.51), "limit": np.deg2rad(0.5)}
    _, said = verdict_sentences("good", [], {"channels": [{**gusts, "verdict": "good"}]})
    assert "is consistent" in said
    assert "beta is closest to its limit (0.51 of 0.5 deg, gusts included)" in said


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        ({"within_flights": True}, "The first and last parts were predicted from the rest."),
        (
            {},
            "Heads and tails were predicted from everything else (cross-validated within flights).",
        ),
    ],
    ids=["by its key", "an older document, by its remark"],
)
def test_what_was_predicted_from_parts_of_flights_is_not_called_whole(
    flown: Flight, sides: Any, stated: dict[str, Any], said: str
) -> None:
    one = found(votes=())
    document = loop([one], [one], [proof("CX", 0.02, 0.005)])
    document["flights"]["held_out"] = []
    document["validation"] |= {"kind": "cross-validated", **stated}
    document["remarks"] = [said]
    made = {**document, "candidate": "d" * 64, "label": "v0002", "increments": [{"axis": "CX"}]}
    (proved,) = dict(decision(made).lines)["proved"]
    assert proved.startswith("on parts not used: error of CX 0.02 -> 0.005")
    tree = checked(update_report(story(document, sides, flown)))
    assert not [svg for svg in drawn(tree) if RESIDUAL.search(svg)], (
        "no number on other samples than the table's"
    )
    assert "They are optimistic" in words_of(tree)


def test_axes_that_stayed_bad_are_drawn_beside_those_with_findings(
    flown: Flight, sides: Any
) -> None:
    errors = [proof("CZ", 0.06, 0.06, noise_floor=0.001), proof("CX", 0.06, 0.06, noise_floor=0.05)]
    document = loop([found(verdict="suspected")], [], errors)
    tree = checked(update_report(story(document, sides, flown, added=False)))
    (alt,) = [alt for alt in tree.xpath("//img/@alt") if alt.startswith("Coefficients")]
    assert "CX, CZ over time" in alt
    near = [proof("CZ", 0.06, 0.06, noise_floor=0.001), proof("CX", 0.06, 0.06, noise_floor=0.06)]
    other = loop([found(verdict="suspected")], [], near)
    other["findings"][0] |= {"hypothesis": "alpha_slope@CZ", "axis": ["CZ"]}
    tree = checked(update_report(story(other, sides, flown, added=False)))
    told = tree.xpath("//figure[img[starts-with(@alt, 'Coefficients')]]/figcaption")[0]
    assert "Not drawn: CX, unchanged and near the noise floor." in told.text_content()


def test_all_that_stayed_bad_is_drawn_in_the_axes_in_which_it_is_told(flown: Flight) -> None:
    """Findings on the lift: forces along the wind axes, as in the table and the lines."""
    told = ("Cl", "Cm", "Cn", "C_drag", "C_side", "C_lift")
    axes = (*told, "CX", "CY", "CZ")
    errors = [proof(axis, 0.06, 0.06, noise_floor=0.001) for axis in axes]
    findings = [
        replace(found(f"{effect}@C_lift", verdict="suspected"), axis=("CX", "CZ"))
        for effect in ("alpha_slope", "pitch_rate_force", "mach_effect")
    ]
    document = loop(findings, [], errors)
    values = dict.fromkeys(axes, 0.06 * np.random.default_rng(2).standard_normal(len(flown.time)))
    sides = {"f4": synthetic.comparison(flown, values)}, {}
    tree = checked(update_report(story(document, sides, flown, added=False)))
    alts = [alt for alt in tree.xpath("//img/@alt") if alt.startswith("Flight minus model on ")]
    assert alts
    assert {alt.partition(" on ")[2].partition(" against ")[0] for alt in alts} == {", ".join(told)}
    said = " ".join(tree.xpath("//dl[contains(@class, 'decision')]")[0].text_content().split())
    assert f"{told[0]} " in said
    assert "noise floors" in said


def test_one_flight_that_voted_is_not_predicted_by_others() -> None:
    shown = {}
    for votes in (1, 2):
        one = found(verdict="suspected")
        one = replace(one, held_out_share=0.0, votes=one.votes[:votes])
        document = loop([one], [], [proof("CX", 0.02, 0.02)])
        shown[votes] = "when estimated from the others" in words_of(page_of(document))
    assert shown == {1: False, 2: True}


def test_what_a_mean_of_the_flights_is_not_is_said() -> None:
    mean = {"mean": -0.19, "ci95": [-0.25, -0.13], "p": 0.01}
    shown = {}
    for value in (-0.19, -0.11):
        one = found(verdict="suspected", value=value, ci95=(value - 0.03, value + 0.03))
        document = loop([one], [], [proof("CX", 0.02, 0.02)])
        document["findings"][0]["test"] = mean
        shown[value] = "beside all linear effects at once" in words_of(page_of(document))
    assert shown == {-0.19: False, -0.11: True}


def test_an_axis_that_was_corrected_as_a_whole_is_told_so() -> None:
    terms = [
        found("alpha_slope@CZ", verdict="ambiguous_sensor"),
        found("zero_offset@CZ", "suspected"),
    ]
    document = loop(terms, terms, [proof("CZ", 0.04, 0.005)])
    document["asked_for"] = []
    words = words_of(page_of(document))
    assert "so it is not added" not in words
    assert words.count("it was added with others of its axis") == len(terms)
    document["asked_for"] = [terms[0].hypothesis]
    said = [meaning(finding, document).partition("; ")[2] for finding in document["findings"]]
    assert said == [
        "it was added because you asked for it",
        "it was added with others of its axis, whose sum is known better",
    ]
    assert meaning(document["findings"][0], {**document, "added": []}).endswith(
        "so it is not added"
    )


def test_a_vote_is_labelled_by_its_flight_and_part() -> None:
    labels = {"ab" * 32: "f1_017.mat"}
    assert voter("ab" * 32, labels) == "f1_017.mat"
    assert voter("abababababab@8.12-20", labels) == "f1_017.mat 8.12-20 s"
    assert voter("cd" * 32, labels) == "cd" * 6
    assert "\u202e" not in voter("ab" * 32, {"ab" * 32: HOSTILE})


def test_single_flights_stand_beside_all(flown: Flight, sides: Any) -> None:
    before, after = sides
    one = found("alpha_slope@CZ")
    document = loop([one], [one], [proof("CZ", pooled(before, "CZ"), pooled(after, "CZ"))])
    assert disagreements(document, ["CZ"], before) == []
    page = checked(update_report(story(document, sides, flown)))
    assert [svg for svg in drawn(page) if RESIDUAL.search(svg)], "beside the histories"
    each = flight_errors("CZ", before, after)
    assert list(each) == ["f4", "f5"]
    assert each["f4"][0] == pytest.approx(0.05, rel=0.05)
    assert each["f4"][1] == pytest.approx(0.1 * each["f4"][0])
    tree = checked(update_report(story(document, sides, flown)))
    rows = tree.xpath("//details[contains(., 'Error of each flight')]//tbody/tr")
    cells = [[" ".join(cell.text_content().split()) for cell in row] for row in rows]
    assert cells == [
        row
        for id, (first, last) in each.items()
        for row in ([f"flight {id[1]}", "v0001", number(first, 2)], ["v0002", number(last, 2)])
    ]
    assert flight_errors("Cm", before) == {"f4": [None], "f5": [None]}, "an axis without data"
    blind = {"f4": replace(before["f4"], usable={"CZ": np.zeros(len(flown.time), dtype=bool)})}
    assert flight_errors("CZ", blind) == {"f4": [None]}


def test_flights_that_were_processed_again_are_not_passed_off_as_those_of_the_report(
    flown: Flight, sides: Any
) -> None:
    before, after = sides
    one = found("alpha_slope@CZ")
    document = loop([one], [one], [proof("CZ", 1.5 * pooled(before, "CZ"), pooled(after, "CZ"))])
    said = words_of(checked(update_report(story(document, sides, flown))))
    now, stored = number(pooled(before, "CZ")), number(1.5 * pooled(before, "CZ"))
    assert (
        "processed again since this report was made: the figures show the results stored now"
        f" (CZ {now} where {stored} is stored)" in said
    )


def test_where_nothing_was_added_the_distance_is_drawn(flown: Flight, sides: Any) -> None:
    document = loop(
        [],
        [],
        [proof("CZ", 0.06, 0.06, noise_floor=0.001), proof("CX", 0.06, 0.06, noise_floor=0.03)],
    )
    tree = checked(update_report(story(document, sides, flown, added=False)))
    assert tree.xpath("//h2")[0].text == "Error of the database on these flights"
    pictures = drawn(tree)
    assert len(pictures) == 3, (
        "errors, residuals over variables, histories; no slices through two equal databases"
    )
    assert not [svg for svg in pictures if "updated database" in svg]
    assert table(tree, "Error of the database")[1][4] == "60", "after / floor of CZ"


def flight_story(flown: Flight, **other: Any) -> FlightStory:
    known: dict[str, Any] = {
        "id": "ab" * 32,
        "label": HOSTILE,
        "vehicle": "v",
        "log": HOSTILE,
        "start_utc": None,
        "verdict": "good",
    }
    known |= {
        "remarks": [],
        "retracted": "",
        "consistency": None,
        "measured": flown,
        "flight": flown,
        "comparison": None,
    }
    known |= {"database": None, "version": "", "no_comparison": "none", "versions": []}
    return FlightStory(**{**known, **other})


def test_a_flights_segments_and_suspicions_are_told(flown: Flight) -> None:
    segments = [
        Segment("3-2-1-1", 5.0, 9.25, f"elevator {HOSTILE}", "delta_elevator"),
        Segment("airborne", 0.0, 60.0, "never slow"),
    ]
    suspicion = Suspicion("alpha", "sign", f"alpha looks turned round {HOSTILE}", {})
    tree = checked(flight_report(flight_story(flown, segments=segments, suspicions=[suspicion])))
    rows = tree.xpath("//details[contains(., 'Segments (2)')]//tbody/tr")
    assert [cell.text_content() for cell in rows[0]][:3] == ["5.00", "9.25", "3-2-1-1"]
    assert (
        tree.xpath("//ul[@class='notice']/li")[0]
        .text_content()
        .startswith("Suspicion: alpha looks turned round <script>")
    )
    later = replace(flown, time=flown.time + 48.5)
    moved = [replace(each, start=each.start + 48.5, end=each.end + 48.5) for each in segments]
    tree = checked(flight_report(flight_story(later, measured=later, segments=moved)))
    again = tree.xpath("//details[contains(., 'Segments (2)')]//tbody/tr")
    assert [row.text_content() for row in again] == [row.text_content() for row in rows]
    assert "at 48.500 s on the log's clock" in tree.text_content(), (
        "times count from the first sample"
    )
    bare = checked(flight_report(flight_story(flown)))
    assert not bare.xpath("//h2[.='Flight segments']")
    assert not bare.xpath("//ul[@class='notice']")


def test_a_flight_of_an_hour_stays_light() -> None:
    """360,000 samples of twelve noisy channels and six axes beside a database: small enough to
    mail."""
    rng, n = np.random.default_rng(3), 360_000
    names = (
        "V",
        "alpha",
        "beta",
        "p",
        "q",
        "r",
        "phi",
        "theta",
        "psi",
        "ax_imu",
        "az_imu",
        "delta_elevator",
    )
    long = Flight("f", "v", np.arange(n) / 100.0, {name: rng.standard_normal(n) for name in names})
    axes = {axis: rng.standard_normal(n) for axis in ("CX", "CY", "CZ", "Cl", "Cm", "Cn")}
    comparison = synthetic.comparison(long, axes)
    told = flight_story(long, comparison=comparison, database=synthetic.database(), version="v0001")
    page = "".join(flight_report(told))
    assert len(page.encode()) < 2e6
    assert html.document_fromstring(page).xpath("//td[.='360000']"), (
        "nothing was left out of the numbers"
    )


def test_what_to_decide_on_is_there_before_a_figure_is_drawn(
    monkeypatch: pytest.MonkeyPatch,
    flown: Flight,
    sides: tuple[dict[str, Comparison], dict[str, Comparison]],
) -> None:
    def never(_picture: Picture) -> str:
        raise RuntimeError("drawn")

    monkeypatch.setattr(Picture, "svg", property(never))
    document = loop([], [], [proof("CZ", 0.02, 0.01)])
    for pieces, said in (
        (flight_report(flight_story(flown)), "Kinematic consistency"),
        (update_report(story(document, sides, flown)), decision(document).verdict),
    ):
        read = list[str]()
        with pytest.raises(RuntimeError, match="drawn"):
            read.extend(pieces)
        assert said in "".join(read)
