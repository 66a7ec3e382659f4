"""Report pages in the system's own Chromium, as a file from a mail: nothing complained of, fetched,
cut off or hidden; printed, what is folded away on the screen is there."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aerodb.conditioning.segmentation import Segment
from aerodb.report.flight_page import flight_report
from aerodb.report.update_page import update_report
from tests.aerodb.report.test_report import HOSTILE, found, loop, proof
from tests.aerodb.report.test_report_content import flight_story, pooled, story
from tests.support import synthetic
from tests.support.browser import look_everywhere, visit, watched

SHOWN = """() => [...document.images].map((image) => image.complete && image.naturalWidth > 0)"""
#: The smallest type of the page's text as printed [pt].
SMALLEST_TYPE = """() => Math.min(...[...document.querySelectorAll('body *')]
  .filter((e) => e.checkVisibility() && [...e.childNodes].some((n) => n.nodeType === 3 && n.data.trim()))
  .map((e) => 0.75 * parseFloat(getComputedStyle(e).fontSize)))"""
FOLDED = """() => [...document.querySelectorAll('details td')].filter((cell) => !cell.closest('.screen'))
  .map((cell) => cell.checkVisibility())"""
#: What paper leaves to the screen, and the sentence that says so.
LEFT = """() => [...document.querySelectorAll('.screen')].map((e) => e.checkVisibility())"""
SAYS_SO = """() => [...document.querySelectorAll('.paper')].map((e) => e.checkVisibility())"""


@pytest.fixture(scope="module")
def pages(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """A flight, a closed loop and one that added nothing, with hostile names throughout."""
    folder, rng = tmp_path_factory.mktemp("pages"), np.random.default_rng(4)
    flown = synthetic.flight(rng, seconds=60.0)
    noise = {id: 0.02 * rng.standard_normal(len(flown.time)) for id in ("f4", "f5")}
    before = {
        id: synthetic.comparison(flown, {"CZ": values, "CX": values})
        for id, values in noise.items()
    }
    after = {
        id: synthetic.comparison(flown, {"CZ": 0.1 * values, "CX": values})
        for id, values in noise.items()
    }
    one = found("alpha_slope@CZ")
    errors = [
        proof("CZ", pooled(before, "CZ"), pooled(after, "CZ")),
        proof("CX", pooled(before, "CX"), pooled(before, "CX")),
    ]
    named = {f"f{k}": HOSTILE[k % len(HOSTILE)] for k in range(7)}
    segments = [
        Segment("doublet", 5.0, 9.25, HOSTILE[-1]),
        Segment("airborne", 0.0, 60.0, "never slow"),
    ]
    texts = {
        "flight": flight_report(
            flight_story(
                flown,
                comparison=before["f4"],
                database=synthetic.database(),
                version="v0001",
                segments=segments,
            )
        ),
        "loop": update_report(
            _named(story(loop([one], [one], errors), (before, after), flown), named)
        ),
        "nothing": update_report(
            _named(story(loop([], [], errors), (before, after), flown, added=False), named)
        ),
    }
    for name, text in texts.items():
        (folder / f"{name}.html").write_text("".join(text), encoding="utf-8")
    return sorted(folder.iterdir())


def _named(told: Any, labels: dict[str, str]) -> Any:
    told.labels.update(labels)
    return told


def test_every_report_is_sound(browser: Any, pages: list[Path]) -> None:
    with watched(browser, "file://") as page:
        for path in pages:
            visit(page, "file://", str(path))
            look_everywhere(page, str(path))
            assert all(page.evaluate(SHOWN)), "every picture is there"


def test_what_is_folded_away_is_printed(browser: Any, pages: list[Path]) -> None:
    with watched(browser, "file://") as page:
        for path in pages:
            visit(page, "file://", str(path))
            assert not any(page.evaluate(FOLDED))
            left = len(page.evaluate(LEFT))
            said = page.evaluate(SAYS_SO)
            assert not any(said)
            assert bool(said) == bool(left)
            page.emulate_media(media="print")
            shown = page.evaluate(FOLDED)
            assert shown or left
            assert all(shown)
            assert not any(page.evaluate(LEFT))
            assert all(page.evaluate(SAYS_SO))
            wide = "document.documentElement.scrollWidth > document.documentElement.clientWidth"
            page.set_viewport_size({"width": 690, "height": 1000})  # A4 less its margins, at 96 dpi
            assert not page.evaluate(wide), f"{path.stem} is cut off on paper"
            assert page.evaluate(SMALLEST_TYPE) >= 8.0, f"type of {path.stem} is too small"
            page.emulate_media(media="screen")
            page.set_viewport_size({"width": 1280, "height": 900})
