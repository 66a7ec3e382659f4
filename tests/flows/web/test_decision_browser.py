"""Who has to decide sees on one page what to decide on, and is there in a few clicks."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from aerodb.report import gate_rows
from aerodb.report.glossary import with_true_signs
from aerodb.storage.workspace import Workspace
from tests.support.browser import Clicks, counted, look_everywhere, visit, watched
from tests.support.command import asked
from tests.support.console_workspace import served
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME

#: What has to be read before the reason is asked for, by what it begins with.
BEFORE_THE_REASON = (
    "changes",
    "proved",
    "gate",
    "open",
    "checks of the gate",
    "All differences",
    "Reason",
)


@pytest.fixture
def workspace(tmp_path: Path, shared: SharedWorkspaces) -> Workspace:
    """A workspace whose candidate waits."""
    return shared.updated(tmp_path / "w")[0]


@pytest.fixture
def address(workspace: Workspace) -> Iterator[str]:
    with served(workspace) as opened:
        yield opened


def released(workspace: Workspace) -> str:
    return str(asked(workspace.root, "version", "show", "released")["label"])


def test_a_decision_is_few_clicks_away_and_everything_stands_before_the_reason(
    browser: Any, address: str, workspace: Workspace
) -> None:
    gate = asked(workspace.root, "version", "gate", "candidate")
    with watched(browser, address) as page:
        visit(page, address, "/")
        assert page.locator(".lead").inner_text() == f"v0002 of {NAME} waits for your decision"
        look_everywhere(page, "waits")
        clicks = Clicks(page)
        clicks.on("text=Decide on v0002")
        words = page.locator("main").inner_text()
        places = [words.index(each) for each in BEFORE_THE_REASON]
        assert places == sorted(places)
        shown = " ".join(words.split())
        for row in gate_rows(gate["checks"]):
            assert with_true_signs(row.found) in shown
            assert with_true_signs(row.limit) in shown
        assert "%)" in shown[: shown.index("proved")], "what changes, in per cent"
        assert "the change fades to nothing at" in shown
        figure = page.locator("figure img")
        assert figure.evaluate("image => image.complete && image.naturalWidth > 0")
        for sign in ("->", "+-"):
            assert sign not in words
        look_everywhere(page, "decide")
        page.fill("#reason", "proved on two flights")
        clicks.on("button.strong")
        assert "now points to v0002" in page.locator("main").inner_text()
        counted(clicks)
        visit(page, address, "/")
        assert "nothing waits for a decision" in page.locator("main").inner_text()
    assert released(workspace) == "v0002"


def test_what_a_person_accepts_is_chosen_on_the_page(
    browser: Any, address: str, workspace: Workspace
) -> None:
    limit = f"[vehicles.{NAME}.gate]\nlargest_change = 1e-4\n"
    (workspace.root / "settings.toml").write_text(limit, encoding="utf-8")
    candidate = asked(workspace.root, "version", "show", "candidate")["version"]
    with watched(browser, address, answers={409}) as page:
        path = f"/versions/{candidate}/promote"
        visit(page, address, path)
        assert "The gate would refuse it." in page.locator("main").inner_text()
        look_everywhere(page, "accept")
        page.fill("#reason", "small ones")
        page.click("button.strong")
        page.wait_for_selector("main:has-text('nothing was changed')")
        visit(page, address, path)
        for box in page.locator(".accept input").all():
            box.check()
        page.fill("#reason", "small ones")
        page.click("button.strong")
        page.wait_for_selector("main:has-text('now points to v0002')")
        assert "small ones (accepted: " in page.locator("main").inner_text()
    assert released(workspace) == "v0002"


def test_a_version_begins_with_quality_flights_gate_and_findings(
    browser: Any, address: str, workspace: Workspace
) -> None:
    candidate = asked(workspace.root, "version", "show", "candidate")["version"]
    with watched(browser, address) as page:
        visit(page, address, f"/versions/{candidate}")
        words = page.locator("main").inner_text()
        _, verdict, words = words.partition("v0002 waits for your decision; the gate passes it")
        assert verdict
        order = ("flights", "changes", "proved", "gate", "Quality", "Gate", "Contents", "Evaluate")
        places = [words.index(each) for each in order]
        assert places == sorted(places)
        assert page.locator("form").first.evaluate("f => f.getBoundingClientRect().top") > 900
        visit(page, address, f"/versions/{candidate}/lineage")
        boxes = page.locator("svg text").all_text_contents()
        assert "v0001" in boxes
        assert "candidate" in boxes
        assert sum(text.startswith("20") for text in boxes) == 2, "a date each"
        look_everywhere(page, "lineage")


def test_a_page_printed_from_a_dark_scheme_is_dark_on_white(
    browser: Any, address: str, workspace: Workspace
) -> None:
    candidate = asked(workspace.root, "version", "show", "candidate")["version"]
    colours = "e => [getComputedStyle(e).color, getComputedStyle(document.documentElement).backgroundColor]"
    with watched(browser, address) as page:
        page.emulate_media(color_scheme="dark", media="print")
        for path in (f"/versions/{candidate}", f"/versions/{candidate}/promote"):
            visit(page, address, path)
            ink, paper = page.locator("main dd").first.evaluate(colours)
            assert ink == "rgb(22, 32, 42)"
            assert paper == "rgb(255, 255, 255)"
