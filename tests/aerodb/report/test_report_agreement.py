"""What a report says is what the stored document holds: one name for each effect, no bound that
bounds nothing, every changed axis, and type that can be read on paper."""

import base64
import re
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import etree, html

from aerodb.effects.library import TEMPLATES, hypotheses_for
from aerodb.flight import Flight
from aerodb.nomenclature import AXES
from aerodb.report.error_table import excluded_sizes, shown_axes
from aerodb.report.estimates_page import estimates_report
from aerodb.report.glossary import EFFECTS, advice_words, hypothesis_words, in_words
from aerodb.report.head import Head
from aerodb.report.response_page import response_report
from aerodb.report.style import SMALLEST
from aerodb.report.update_page import update_report
from aerodb.tracing.decision.findings import MeanTest
from tests.aerodb.effects.test_effects import phoenix
from tests.aerodb.report.test_report import checked, found, loop, proof, words_of
from tests.aerodb.report.test_report_content import story
from tests.support import synthetic

#: Width and height of A4 less the margins of the style, pt.
PAPER = ((210.0 - 2 * 14.0) / 25.4 * 72.0, 235.0 / 25.4 * 72.0)


@pytest.fixture(scope="module")
def flight() -> Flight:
    return synthetic.flight(np.random.default_rng(1), seconds=20.0)


@pytest.fixture(scope="module")
def page(flight: Flight) -> Any:
    """The page of a loop that changes all six axes, of two flights."""
    rng, n = np.random.default_rng(5), len(flight.time)
    before = {
        id: synthetic.comparison(flight, {axis: 0.02 * rng.standard_normal(n) for axis in AXES})
        for id in ("f4", "f5")
    }
    after = {
        id: synthetic.comparison(flight, {axis: 0.01 * rng.standard_normal(n) for axis in AXES})
        for id in before
    }
    findings = [
        replace(
            found(f"zero_offset@{axis}"),
            ci95=(-0.4, 0.02),
            test=MeanTest(-0.19, (-0.22, -0.16), 1e-6),
            what="always there",
            size=f"{axis}_q = -0.19 over 4 flights",
            reasons=("cannot be told from qbar_scale@all",),
        )
        for axis in AXES
    ]
    document = loop(findings, findings, [proof(axis, 0.02, 0.01) for axis in AXES])
    return "".join(update_report(story(document, (before, after), flight)))


def test_every_effect_of_the_library_has_a_name() -> None:
    known = {template.effect for template in TEMPLATES} | {"unnamed"}
    assert known <= set(EFFECTS)
    names = {}
    for each in hypotheses_for(*phoenix()):
        name = hypothesis_words(each.id)
        assert "@" not in name
        assert "_" not in re.sub("C_(lift|drag|side)", "", name).replace(each.subject, "")
        assert names.setdefault(name, each.id) == each.id, "two effects with one name"
    assert len(names) > 50


def test_sentences_have_names_for_ids_and_leave_settings_alone() -> None:
    said = "table_sign@Cl:Clb or alpha_scale@all: excite delta_flap; state it as [measured.alpha_scale]"
    assert advice_words(said) == (
        "the sign or symmetry of table Clb of Cl or the scale of angle of attack: excite flap;"
        " state it as [measured.alpha_scale]"
    )
    assert in_words("would need -5.15 1/rad^3") == "would need -5.15 1/rad³"
    assert in_words("hysteresis: stall_hysteresis@C_lift:loop").endswith(
        "closed loop of C_lift in the stall"
    )
    assert in_words("write to a@b.example, not CX") == "write to a@b.example, not CX"


def test_a_bound_beyond_every_believable_size_is_none() -> None:
    entry = {"verdict": "not_excited", "unit": "1/rad", "upper_bound": 4273.0}
    entry |= {"minimum_detectable": 1.5, "believable": [-2.0, 1.0]}
    sizes = excluded_sizes(entry)
    assert (sizes["upper_bound"], sizes["minimum_detectable"]) == (None, 1.5)
    assert excluded_sizes({**entry, "upper_bound": 1.9})["upper_bound"] == 1.9
    older = {name: value for name, value in entry.items() if name != "believable"}
    assert excluded_sizes(older)["upper_bound"] is None
    degrees = excluded_sizes({**older, "unit": "rad", "verdict": "not_detected"})
    assert degrees["minimum_detectable"] == pytest.approx(np.rad2deg(1.5))


def test_forces_are_told_along_one_set_of_axes() -> None:
    every = [proof(axis, 0.02, 0.01) for axis in (*AXES, "C_lift", "C_drag", "C_side")]
    body = loop([found("alpha_slope@CZ")], [], every)
    assert shown_axes(body) == list(AXES)
    wind = loop([found(f"alpha_slope@{axis}") for axis in ("C_lift", "C_drag")], [], every)
    wind["not_found"] = []
    assert shown_axes(wind) == ["Cl", "Cm", "Cn", "C_drag", "C_side", "C_lift"]
    declared = {**body, "increments": [{"axis": "C_drag"}]}
    assert "C_drag" in shown_axes(declared)


def test_every_changed_axis_is_drawn_where_the_text_says_so(page: str) -> None:
    tree = checked(page)
    left = tree.xpath("//h2[starts-with(., 'What is left')]/following-sibling::figure/img")
    drawn = "".join(_svg(image) for image in left)
    for axis in AXES:
        assert f">{axis} [-]<" in drawn
    assert all(axis in left[0].get("alt") for axis in AXES)


def test_an_interval_that_contradicts_its_test_says_why(page: str) -> None:
    words = words_of(checked(page))
    assert "mean of 4 estimates: −0.19 (95 %: −0.22 to −0.16), p = 1×10⁻⁶" in words
    assert "The mean is not zero; the interval of the estimate contains zero because" in words
    assert "Always there; cannot be told from the scale of dynamic pressure." in words


def test_pages_of_estimates_and_responses_begin_like_the_others() -> None:
    head = Head(datetime(2026, 11, 25, 3, 4, tzinfo=UTC), "ada", "0.1.0+abc", "/w")
    row = {"parameter": "initial_alpha", "spread": 3.2, "agree": False}
    row |= {
        "estimates": {
            "regression": {"value": 0.1, "standard_error": 0.01, "standing": "estimated"},
            "output-error": {"value": 0.2, "standard_error": None, "standing": "diverged"},
        }
    }
    answer = {"assumes": [], "notes": [], "estimates": [{"name": "initial_alpha", "unit": "rad"}]}
    document = {"believe": "regression", "reasons": [], "parameters": [row]}
    document |= {"methods": [{"method": name, **answer} for name in row["estimates"]]}
    summary = {"manoeuvres": 2, "flights": ["f"], "passed": False, "independent": True}
    summary |= {"failed": [{"check": "spiral: bank"}], "not_flown": [], "checks": []}
    summary |= {"responses": [], "tolerances": "t"}
    for page, said in (
        (
            estimates_report(document, {}, head),
            "Left: methods disagree on 1 of 1 parameters, most on initial_alpha (3.2"
            " standard errors); output-error: 1 parameter diverged.",
        ),
        (
            "".join(response_report("v0002", "", summary, [], head)),
            "Left: outside tolerance spiral: bank (1).",
        ),
    ):
        tree = checked(page)
        assert tree.xpath("//p[@class='lead second']")[0].text_content() == said
        assert [dd.text_content() for dd in tree.xpath("//dl[@class='facts']/dd")] == [
            "2026-11-25 03:04 UTC",
            "ada",
            "aerodb 0.1.0+abc",
            "/w",
        ]
    cells = checked(estimates_report(document, {}, head)).xpath("//tbody/tr[1]/td")
    assert [cell.text_content() for cell in cells][1:4] == ["5.730", "0.57", "deg"]


def test_type_is_eight_points_or_larger_on_a4(page: str) -> None:
    style = Path("aerodb/report/templates/style.css").read_text(encoding="utf-8")
    root = float(re.search(r"@media print \{\s*(?:/\*.*?\*/\s*)?html \{ font-size: ([\d.]+)px",
                           style, re.DOTALL)[1])  # fmt: skip
    shares = [float(size) for size in re.findall(r"font(?:-size)?: ([\d.]+)rem", style)]
    assert min(shares) * root * 0.75 >= SMALLEST
    assert not re.search(r"font(?:-size)?: [\d.]+em", style), "sizes do not multiply"
    estimates = {"believe": None, "methods": [{"method": "m", "assumes": [], "notes": []}]}
    estimates |= {"parameters": [], "reasons": []}
    fitted = {
        name: (np.arange(50.0), np.zeros(50), np.ones(50)) for name in ("alpha", "q", "az", "theta")
    }
    pages = (page, estimates_report(estimates, {"m": {"r" * 16: fitted}}))
    for text in pages:
        images = html.document_fromstring(text).xpath("//img")
        assert images
        for image in images:
            assert _smallest(_svg(image)) >= SMALLEST - 0.01, image.get("alt")


def _svg(image: Any) -> str:
    return base64.b64decode(image.get("src").partition(",")[2]).decode()


def _smallest(svg: str) -> float:
    """The smallest type of a figure as printed [pt]: shrunk to the paper, never enlarged."""
    root = etree.fromstring(svg.encode())
    width, height = (float(root.get(side).removesuffix("pt")) for side in ("width", "height"))
    shrunk = min(1.0, PAPER[0] / width, PAPER[1] / height)
    sizes = re.findall(r"font(?:-size)?: (?:[a-z]+ )?([\d.]+)px", svg)
    assert sizes
    return shrunk * min(map(float, sizes))
