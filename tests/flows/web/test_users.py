"""The task of each of eight kinds of users, by command and in Chromium: how many lines are read until
the answer, and how many clicks lie before a decision."""

import re
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from tests.support.browser import Clicks, counted, visit, watched
from tests.support.command import asked
from tests.support.console_workspace import served
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME
from tests.support.terminal import answered, on_terminal

#: Most words of a sentence.
MOST_WORDS = 25
#: The glider of the guide "PX4 without vanes".
GLIDER = "my-glider"
#: The first plot of a log's page can be seen.
DRAWN = "() => document.querySelector('.plot img')?.naturalWidth > 0"
MODEL = '[[increment]]\naxis = "CZ"\nterms = ["alpha"]\n'


@pytest.fixture(scope="module")
def glider(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Workspace:
    """A workspace with a candidate that waits, and a run that failed."""
    place, _ = shared.updated(tmp_path_factory.mktemp("users") / "w")
    with Catalogue.open(place.catalogue) as catalogue:
        run = catalogue.start_run("update_flow", how="direct", parameters={"vehicle": NAME}).id
        catalogue.end_run(run, "failed", "no room on the disk")
    return place


@pytest.fixture(scope="module")
def address(glider: Workspace) -> Iterator[str]:
    with served(glider) as opened:
        yield opened


@pytest.fixture(scope="module")
def boomless(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Path:
    """The folder with vehicle, handbook and log of a glider without vanes; in its workspace are the
    first two."""
    place = tmp_path_factory.mktemp("boomless")
    shutil.copytree(shared.guide, place, dirs_exist_ok=True)
    (place / "model.toml").write_text(MODEL, encoding="utf-8")
    workspace = place / "workspace"
    asked(workspace, "vehicle", "add", str(place / "my-glider.toml"))
    asked(workspace, "database", "import", str(place / "handbook.toml"), "--vehicle", GLIDER)
    return place


def test_a_hobbyist_sees_what_an_unknown_log_holds(
    browser: Any, address: str, boomless: Path, tmp_path: Path
) -> None:
    """Without a vehicle file, and without a workspace; on the console by a drop."""
    log, page_file = boomless / "flight-1.ulg", tmp_path / "log.html"
    nowhere = tmp_path / "none"
    answered(nowhere, ("log", "inspect", str(log)), "USABLE", "reconstructed +alpha")
    began = time.perf_counter()
    answered(nowhere, ("log", "show", str(log), "--output", str(page_file)), r"log\.html")
    with watched(browser, "file://") as page:
        page.goto(page_file.as_uri())
        page.wait_for_function(DRAWN)
        print(f"first plot of an unknown log after {time.perf_counter() - began:.1f} s")
        assert "USABLE" in page.locator("main, body").first.inner_text()
    with watched(browser, address) as page:
        visit(page, address, "/")
        clicks = Clicks(page)
        clicks.on("nav a[href='/logs']")
        page.set_input_files("#log", str(log))
        page.wait_for_function(DRAWN)
        counted(clicks)


def test_a_flight_test_engineer_knows_whether_the_flight_was_good(
    browser: Any, boomless: Path
) -> None:
    workspace, log = boomless / "workspace", str(boomless / "flight-1.ulg")
    ingest = ("flight", "ingest", log, "--vehicle", GLIDER, "--direct")
    answered(workspace, ingest, "stored: good", "largest +C", "next +aerodb")
    answered(workspace, ("flight", "show", "flight-1"), "flight-1.* is good", "next +aerodb")
    beside = ("flight", "compare", "flight-1", "released")
    answered(
        workspace, beside, r"axes err beyond noise", r"most +C\w errs by", "without", "next +aerodb"
    )
    with served(Workspace.open(workspace)) as address, watched(browser, address) as page:
        visit(page, address, "/")
        clicks = Clicks(page)
        clicks.on("main >> text=flight-1.ulg")
        page.wait_for_selector("#record[data-shown]")
        assert "good" in page.locator(".verdict").first.inner_text()
        counted(clicks)


def test_a_simulator_engineer_gets_trim_and_file(
    browser: Any, address: str, glider: Workspace, tmp_path: Path
) -> None:
    steady = ("version", "trim", "candidate", "--speed", "25", "--altitude", "0", "--glide")
    answered(glider.root, steady, "alpha .* deg, climb .* delta_elevator .* deg")
    target = tmp_path / "glider.xml"
    export = ("version", "export", "candidate", "--format", "jsbsim", "--output", str(target))
    answered(glider.root, export, r"wrote .*check")
    with watched(browser, address) as page:
        visit(page, address, "/")
        clicks = Clicks(page)
        clicks.on("main table >> text=v0002")
        with page.expect_download() as loaded:
            clicks.on("a[download]:has-text('jsbsim')")
        assert b"<aerodynamics" in Path(loaded.value.path()).read_bytes()
        counted(clicks)


def test_an_operator_knows_what_to_do_and_does_it(
    browser: Any, address: str, glider: Workspace
) -> None:
    answered(
        glider.root,
        ("status",),
        "2 things to do",
        "update_flow failed .no room on the disk.: aerodb retry",
        "v0002 of small-glider waits for a decision",
    )
    with watched(browser, address) as page:
        visit(page, address, "/")
        clicks = Clicks(page)
        clicks.on("nav a[href='/work']")
        failed = "[aria-label='failed runs that no later run has made up for']"
        clicks.on(f"{failed} summary")
        page.fill(f"{failed} [name=reason]", "a larger disk is in")
        clicks.on(f"{failed} button")
        assert "no room on the disk" not in page.locator("main").inner_text()
        assert page.locator("main a:has-text('Decide on v0002')").count() == 1
        counted(clicks)
    answered(glider.root, ("status",), "1 thing to do")


def test_a_scientist_sees_effect_size_and_error(
    browser: Any, address: str, glider: Workspace
) -> None:
    loop = ("close-loop", "--vehicle", NAME, "--direct")
    answered(glider.root, loop, "4 suspicions", r"of Cm: Cm_0 \S+ \+- \S+ \(ambig", "next +aerodb")
    with watched(browser, address) as page:
        visit(page, address, "/")
        clicks = Clicks(page)
        clicks.on("main a[href^='/findings/'] >> nth=0")
        words = page.locator("main").inner_text()
        assert "±" in words
        counted(clicks)


def test_a_manager_sees_whether_it_is_better(browser: Any, address: str, glider: Workspace) -> None:
    basis = ("version", "lineage", "v0002")
    answered(glider.root, basis, "v0002 is based on 6 flights", "2 held out", "next +aerodb")
    show = ("version", "show", "v0002")
    flights = asked(glider.root, "version", "lineage", "v0002")["flights"]
    used = {each["role"]: each["flight"] for each in flights}
    for role, proof in (("held_out", "checked on this flight"), ("identified", "proof +none")):
        better = ("flight", "compare", used[role], "v0002")
        answered(
            glider.root,
            better,
            r"from v0001: CZ \S+ % -> \S+ %",
            proof,
            "next +aerodb version gate",
        )
    answered(glider.root, show, r"proved .* on 2 flights not used: error of CZ \S+ -> \S+ \(.*%")
    with watched(browser, address) as page:
        visit(page, address, "/")
        clicks = Clicks(page)
        listed = page.locator("td.wide").all_inner_texts()
        told = next(each for each in listed if "v0002 has " in each)  # before any click
        assert re.search(r"error of CZ \S+ → \S+", told.replace("->", "→"))
        assert all(len(line.split()) <= MOST_WORDS for line in told.splitlines()), told
        clicks.on("text=Quality, flights")
        words = " ".join(page.locator("main").inner_text().split())
        assert re.search(r"proved on 2 flights not used: error of CZ \S+ → \S+", words)
        counted(clicks)


def test_a_qualification_engineer_sees_what_is_within_tolerance_and_what_is_missing(
    browser: Any, boomless: Path, tmp_path: Path
) -> None:
    workspace, log = boomless / "workspace", str(boomless / "flight-1.ulg")
    asked(workspace, "flight", "ingest", log, "--vehicle", GLIDER, "--direct")
    model = ("--model", str(boomless / "model.toml"), "--hold-out", "none", "--direct")
    asked(workspace, "update", "--vehicle", GLIDER, *model)
    table = tmp_path / "qtg.csv"
    validate = ("version", "validate", "candidate", "--table", str(table))
    code, lines = on_terminal(workspace, 100, *validate)
    assert code in (0, 4), lines
    said = answered(workspace, validate, "checks within tolerance: ", "not covered +2", code=code)
    assert "errors of each response: -v" in said
    assert not any("covariance" in line for line in said)
    assert table.read_text("utf-8").startswith("test,title")
    flown = ("version", "fly", "candidate", "--flight", "flight-1")
    lines = answered(workspace, flown, r"\d+ of \d+ checks within", "next +aerodb version validate")
    assert len(lines) < 30
    with served(Workspace.open(workspace)) as address, watched(browser, address) as page:
        visit(page, address, "/")
        clicks = Clicks(page)
        clicks.on("main table >> text=v0002")
        clicks.on("main >> text=Responses")
        table, figure = page.locator("table.qualification"), page.locator("figure").first
        assert table.bounding_box()["y"] < figure.bounding_box()["y"]
        page.set_viewport_size({"width": 400, "height": 900})  # the result is seen on a phone
        result = page.locator("table.qualification td:has-text('%')").first.bounding_box()
        assert result["x"] + result["width"] <= 400
        counted(clicks)


def test_a_chief_engineer_decides(browser: Any, address: str, glider: Workspace) -> None:
    """The last of this file: it releases what the others look at."""
    gate = ("version", "gate", "candidate")
    answered(
        glider.root,
        gate,
        "can be released",
        "changes +slope of C.*%",
        "checks pass",
        "next +aerodb",
    )
    with watched(browser, address) as page:
        visit(page, address, "/")
        clicks = Clicks(page)
        clicks.on("text=Decide on v0002")
        page.fill("#reason", "proved on two flights")
        clicks.on("button.strong")
        assert "now points to v0002" in page.locator("main").inner_text()
        counted(clicks)
