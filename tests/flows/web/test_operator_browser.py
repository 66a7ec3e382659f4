"""What an operator does: logs come in by the page and the inbox, one is refused with its reason, a
failed run is dismissed, and a version is released through the gate by who may."""

from collections.abc import Iterator
from typing import Any

import pytest

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from tests.support.browser import look_everywhere, visit, watched
from tests.support.command import asked
from tests.support.console_workspace import add_child, served
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME, channels, write_csv
from tests.support.sweeps import QUICK, swept


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Workspace:
    """A workspace with a candidate, a version below it that no gate would let pass, and an
    inbox."""
    place, document = shared.updated(tmp_path_factory.mktemp("operator") / "w")
    (place.root / "settings.toml").write_text(QUICK, encoding="utf-8")
    (place.inbox / NAME).mkdir()
    with Catalogue.open(place.catalogue) as catalogue:
        add_child(catalogue, document["candidate"], "unproved", document["flights"]["identified"])
        run = catalogue.start_run("update_flow", how="direct", parameters={"vehicle": NAME}).id
        catalogue.end_run(run, "failed", "no room on the disk")
    return place


@pytest.fixture(scope="module")
def tokens(workspace: Workspace) -> dict[str, str]:
    """Role -> token of a user with it, as `aerodb user add` shows it."""
    users = {"read": "rita", "ingest": "ines", "release": "olga"}
    return {
        role: asked(workspace.root, "user", "add", name, "--role", role)["token"]
        for role, name in users.items()
    }


@pytest.fixture(scope="module")
def address(workspace: Workspace, tokens: dict[str, str]) -> Iterator[str]:
    with served(workspace) as opened:
        yield opened


def version(workspace: Workspace, label: str) -> str:
    rows = asked(workspace.root, "version", "list")
    return str(next(row["version"] for row in rows if row["label"] == label))


def released(workspace: Workspace) -> str:
    return str(asked(workspace.root, "version", "show", "released")["label"])


def test_logs_come_in_and_a_refused_one_says_why(
    browser: Any, address: str, workspace: Workspace, tokens: dict[str, str]
) -> None:
    """By the page as who may ingest, and by the inbox."""
    folder = workspace.root.parent
    good = write_csv(folder / "morning.csv", channels(31))
    bad = folder / "torn.csv"
    bad.write_text("no,numbers\nhere,at all\n", encoding="utf-8")
    with watched(browser, address, token=tokens["ingest"]) as page:
        visit(page, address, "/flights")
        page.set_input_files("#logs", [str(good), str(bad)])
        page.wait_for_selector("#sent li:nth-child(2)[data-ended]")
        assert page.get_attribute("#sent li:nth-child(1)", "data-ended") == "stored"
        assert page.get_attribute("#sent li:nth-child(2)", "data-ended") == "quarantined"
        told = page.locator("#sent li:nth-child(2)").inner_text()
        write_csv(workspace.inbox / NAME / "noon.csv", channels(32))
        (workspace.inbox / NAME / "cut.ulg").write_bytes(b"ULog\x01\x12\x35\x01")
        while swept(workspace)["waiting"]:  # files settle first
            pass
        visit(page, address, "/flights")
        listed = page.locator("#flights tbody").inner_text()
        assert "morning" in listed
        assert "noon" in listed
        visit(page, address, "/work")
        rows = page.locator("[aria-label=Quarantine] tbody tr").all_inner_texts()
        why = {row.split("\t")[0]: row.split("\t")[-1] for row in rows}
        assert set(why) == {"torn.csv", "cut.ulg"}
        assert told == f"torn.csv: quarantined: {why['torn.csv']}"
        assert "the header is incomplete" in why["cut.ulg"]
        look_everywhere(page, "/work")


def test_a_failed_run_is_dismissed_with_a_reason(
    browser: Any, address: str, tokens: dict[str, str]
) -> None:
    with watched(browser, address, token=tokens["release"]) as page:
        visit(page, address, "/work")
        failed = page.locator("[aria-label='failed runs that no later run has made up for']")
        assert "no room on the disk" in failed.inner_text()
        failed.locator("summary").click()
        failed.locator("[name=reason]").fill("a larger disk is in")
        failed.locator("button").click()
        page.wait_for_load_state("networkidle")
        assert "no room on the disk" not in page.locator("main").inner_text()


def promote(page: Any, address: str, version: str, reason: str) -> str:
    """Promote a version on its page; what the page then says."""
    visit(page, address, f"/versions/{version}")
    page.click("text=Promote…")
    page.fill("#reason", reason)
    page.click("button.strong")
    page.wait_for_selector("a.button:has-text('Continue')")
    return str(page.locator("main").inner_text())


def test_the_gate_refuses_and_says_why(
    browser: Any, address: str, workspace: Workspace, tokens: dict[str, str]
) -> None:
    unproved, allowed = version(workspace, "v0003"), f"{address}/versions/"
    with watched(browser, address, token=tokens["release"], answers={409}) as page:
        said = promote(page, address, unproved, "it should be fine")
        assert "The gate refused; nothing was changed" in said
        assert "held-out" in said or "held out" in said
        look_everywhere(page, "refused")
        assert page.url.startswith(allowed)
    assert released(workspace) == "v0001"


def test_who_has_the_role_releases_with_a_reason(
    browser: Any, address: str, workspace: Workspace, tokens: dict[str, str]
) -> None:
    with watched(browser, address, token=tokens["release"]) as page:
        said = promote(page, address, version(workspace, "v0002"), "proved on two flights")
        assert "released of small-glider now points to v0002" in said
        assert "olga" in said
        look_everywhere(page, "released")
        visit(page, address, f"/history?vehicle={NAME}")
        first = page.locator("[aria-label=Moves] tbody tr").first.inner_text()
        for words in ("released", "v0002", "v0001", "olga", "proved on two flights"):
            assert words in first
    assert released(workspace) == "v0002"


@pytest.mark.parametrize("role", ["read", "ingest"])
def test_nobody_is_offered_what_the_role_does_not_allow(
    browser: Any, address: str, workspace: Workspace, tokens: dict[str, str], role: str
) -> None:
    """Pages do not offer it; who asks for the address is told who may."""
    candidate = version(workspace, "v0003")
    with watched(browser, address, token=tokens[role], answers={403}) as page:
        for path in (f"/versions/{candidate}", f"/history?vehicle={NAME}", "/work"):
            visit(page, address, path)
            offered = page.locator("main a.button, main button").all_inner_texts()
            forbidden = ("Promote", "Roll back", *(("Dismiss",) if role == "read" else ()))
            assert not [text for text in offered if text.startswith(forbidden)], path
        visit(page, address, "/flights")
        assert page.locator("#logs").count() == (role == "ingest")
        visit(page, address, f"/versions/{candidate}/promote")
        said = page.locator("main").inner_text()
        assert "requires the role release" in said
        assert f"has the role {role}" in said
        assert page.locator("main form").count() == 0
        look_everywhere(page, f"{role} refused")


def test_without_a_token_nothing_is_shown(browser: Any, address: str) -> None:
    with watched(browser, address, token="of nobody at all", answers={401}) as page:
        page.goto(f"{address}/versions")
        assert "password is your token" in page.content()
        assert NAME not in page.content()
