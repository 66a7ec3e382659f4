"""What people come to a flight's page for, by commands and in Chromium: a hobbyist without vanes, a
test engineer, and who shares a view, on one workspace."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from aerodb.storage.workspace import Workspace
from tests.support.browser import barriers, visit, watched
from tests.support.command import asked
from tests.support.console_workspace import served
from tests.support.shared_workspace import SharedWorkspaces

VEHICLE = "my-glider"

#: The suite looks at every page in `test_console_browser.py`.
pytestmark = pytest.mark.campaign


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Path:
    """Vehicle, handbook and one PX4 log of the guide "PX4 without vanes"."""
    place = tmp_path_factory.mktemp("hobbyist")
    return Path(shutil.copytree(shared.guide, place, dirs_exist_ok=True))


@pytest.fixture(scope="module")
def address(folder: Path) -> Iterator[str]:
    """The console of a workspace that commands have prepared; no log is in it yet."""
    workspace = folder / "workspace"
    asked(workspace, "vehicle", "add", str(folder / "my-glider.toml"))
    asked(workspace, "database", "import", str(folder / "handbook.toml"), "--vehicle", VEHICLE)
    with served(Workspace.open(workspace)) as opened:
        yield opened


@pytest.fixture(scope="module")
def flight(browser: Any, address: str, folder: Path) -> str:
    """A log is dropped onto the list of flights and becomes one; a broken one is refused with the
    reason."""
    broken = folder / "broken.ulg"
    broken.write_bytes((folder / "flight-1.ulg").read_bytes()[:16])
    with watched(browser, address) as page:
        visit(page, address, "/flights")
        page.set_input_files("#logs", [str(folder / "flight-1.ulg"), str(broken)])
        page.wait_for_selector("#sent li:nth-child(2)[data-ended]")
        first, second = page.locator("#sent li").all_text_contents()
        assert first == "flight-1.ulg: good look at the flight"
        assert page.get_attribute("#sent li:nth-child(2)", "data-ended") == "quarantined", second
        assert "contains no data" in second
        assert barriers(page) == []
        page.click("#sent a")
        page.wait_for_selector("#record[data-shown]")
        return urlsplit(page.url).path


def titles(page: Any) -> list[str]:
    return [text.split("   ")[0] for text in page.locator("#panels figcaption").all_text_contents()]


def test_a_hobbyist_finds_what_no_vane_measured(browser: Any, address: str, flight: str) -> None:
    with watched(browser, address) as page:
        visit(page, address, flight)
        page.wait_for_selector("#record[data-shown]")
        assert {"alpha [deg]", "beta [deg]"} <= set(titles(page))
        spoken = page.get_attribute("#panels figure:nth-child(2) .plot", "aria-label")
        assert spoken.startswith("alpha [deg]: from ")
        low, high = (float(word.replace("−", "-")) for word in spoken.split()[3::2])
        assert -5 < low < high < 25  # degrees, two standard errors included
        page.click("button:text-is('Air')")
        page.wait_for_selector("#panels figcaption:has-text('wind_north [m/s]')")
        page.click("button:text-is('Coefficients')")
        page.wait_for_selector("#panels figcaption:has-text('Cn [-]')")
        assert [title[:6] for title in titles(page)] == [
            f"{axis} [-]" for axis in ("CX", "CY", "CZ", "Cl", "Cm", "Cn")
        ]
        page.wait_for_selector("#track svg path.curve")
        north, east = (page.locator("#track svg text").all_text_contents()[k] for k in (-1, -2))
        assert (north, east) == ("north [m]", "east [m]")
        assert page.get_attribute("#profile svg", "aria-label").startswith("altitude [m] over")
        facts = page.locator("dl.facts").first.text_content()
        assert "first sample, at 20.0" in facts
        assert "PX4" in facts


def test_a_test_engineer_plots_one_channel_over_another_and_a_raw_topic(
    browser: Any, address: str, flight: str
) -> None:
    with watched(browser, address) as page:
        visit(page, address, flight)
        page.wait_for_selector("#record[data-shown]")
        page.select_option("#x", "alpha")
        page.select_option("#y", "Cm")
        page.click("#pair button")
        page.wait_for_selector("#over[data-shown='alpha,Cm'] svg path.curve")
        page.click("summary:has-text('Every logged topic')")
        page.wait_for_selector("#fields details")
        page.fill("#find", "actuator_servos:control[2]")
        assert page.locator("#fields label:visible").count() == 1
        page.check("#fields input:visible")
        page.wait_for_selector("#panels figcaption:has-text('actuator_servos:control[2]')")
        assert barriers(page) == []


def test_a_shared_address_shows_the_same_picture(browser: Any, address: str, flight: str) -> None:
    """On another machine, which is narrow and dark; the verdict stays in sight."""
    with watched(browser, address) as page:
        visit(page, address, f"{flight}?show=beta,CZ&logged=vehicle_air_data:rho&x=V&y=CZ")
        page.wait_for_selector("#record[data-shown]")
        page.fill("#from", "10")
        page.fill("#to", "12.5")
        page.keyboard.press("Enter")
        page.wait_for_selector("#record[data-shown='10,12.5']")
        page.wait_for_selector("#over[data-shown='V,CZ']")
        shared, seen = page.url, titles(page)
        labels = [plot.get_attribute("aria-label") for plot in page.locator("#panels .plot").all()]
    assert seen[0] == "beta [deg]"
    assert seen[1].startswith("CZ [-]")
    assert seen[2] == "vehicle_air_data:rho [kg/m³]"
    with watched(browser, address, 400) as page:
        page.emulate_media(color_scheme="dark")
        page.goto(shared)
        page.wait_for_selector("#record[data-shown='10,12.5']")
        page.wait_for_selector("#over[data-shown='V,CZ']")
        assert titles(page) == seen
        narrow = [plot.get_attribute("aria-label") for plot in page.locator("#panels .plot").all()]
        assert narrow == labels
        paper = page.evaluate("getComputedStyle(document.documentElement).backgroundColor")
        assert sum(int(part) for part in paper[4:-1].split(",")) < 150
        page.locator("#over").scroll_into_view_if_needed()
        verdict = page.locator(".stuck .verdict").bounding_box()
        assert 0 <= verdict["y"] < 200
        visit(page, address, "/flights")
        verdict = page.locator("#flights .verdict").bounding_box()
        assert verdict["x"] + verdict["width"] <= 400
