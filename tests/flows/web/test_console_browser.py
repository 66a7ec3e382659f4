"""The console in the system's own Chromium: no console error, no other host, no barrier in either
colour scheme, keyboard, nothing cut off."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import jsbsim
import numpy as np
import pytest

from aerodb.storage.workspace import Workspace
from aerodb.tasks.view.finding_documents import findings_page
from aerodb.tasks.workspace_access import access_workspace
from tests.aerodb.increments.test_measured_update import LEFT_OUT
from tests.flows.web.test_console import pages
from tests.support.browser import SQUEEZED, barriers, look, look_everywhere, visit, watched
from tests.support.catalogue_samples import h
from tests.support.command import asked
from tests.support.console_workspace import Made, add_long_flight, made_workspace, served
from tests.support.paths import VEHICLES
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import channels, write_csv


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Made:
    return made_workspace(shared, tmp_path_factory.mktemp("console") / "workspace")


@pytest.fixture(scope="module")
def hour(made: Made) -> str:
    return add_long_flight(made.workspace)[0]


@pytest.fixture(scope="module")
def address(made: Made, hour: str) -> Iterator[str]:
    with served(made.workspace) as opened:
        yield opened


def test_every_page_is_sound(browser: Any, address: str, made: Made) -> None:
    with watched(browser, address) as page:
        for path in pages(made):
            visit(page, address, path)
            look_everywhere(page, path)


def test_the_checks_see_what_is_wrong(browser: Any, address: str) -> None:
    with watched(browser, address) as page:
        visit(page, address, "/flights")
        page.evaluate("""() => {
          const wide = document.createElement('div');
          wide.style.width = '3000px'; wide.textContent = 'wide'; document.querySelector('main').append(wide);
          document.querySelectorAll('label').forEach((label) => label.remove());
          document.querySelector('h1').style.color = '#ddd';
        }""")
        assert page.evaluate(
            "document.documentElement.scrollWidth > document.documentElement.clientWidth"
        )
        assert {"label", "color-contrast", "select-name"} & {rule for rule, _, _ in barriers(page)}
    with watched(browser, address, 400) as page:
        visit(page, address, "/work")
        assert page.evaluate(SQUEEZED) == []
        page.evaluate("""() => {
          const name = document.querySelector('main tbody th'), caption = document.querySelector('main caption');
          name.textContent = 'longest name'; name.style.overflowWrap = 'anywhere';
          name.style.display = 'block'; name.style.width = '1rem'; name.style.minWidth = '0';
          caption.textContent = caption.textContent.repeat(9); caption.style.maxWidth = 'none';
        }""")
        assert [found.split(":")[0] for found in page.evaluate(SQUEEZED)] == ["TH", "CAPTION"]
    with pytest.raises(AssertionError, match="wrong"):
        _complain(browser, address)


def _complain(browser: Any, address: str) -> None:
    with watched(browser, address) as page:
        visit(page, address, "/")
        page.evaluate("console.error('wrong')")


def test_the_keyboard_reaches_the_content_first_and_everything_in_order(
    browser: Any, address: str
) -> None:
    with watched(browser, address) as page:
        visit(page, address, "/flights")
        page.keyboard.press("Tab")
        assert page.evaluate("document.activeElement.textContent") == "Skip to the content"
        box = page.evaluate("document.activeElement.getBoundingClientRect().left")
        assert box >= 0  # it comes into sight
        page.keyboard.press("Enter")
        assert page.evaluate("document.activeElement.id") == "content"
        order = []
        for _ in range(4):
            page.keyboard.press("Tab")
            order.append(page.evaluate("document.activeElement.id || document.activeElement.type"))
            outline = page.evaluate("getComputedStyle(document.activeElement).outlineWidth")
            assert outline == "3px"
        assert order == ["vehicle", "verdict", "text", "submit"]
        page.keyboard.press("Shift+Tab")
        page.keyboard.type("flight1")
        page.keyboard.press("Enter")
        page.wait_for_url("**text=flight1**")
        assert page.locator("#flights tbody tr").count() == 1


def test_an_hour_opens_and_zooms_to_every_sample(browser: Any, address: str, hour: str) -> None:
    with watched(browser, address) as page:
        visit(page, address, f"/flights/{hour}")
        page.wait_for_selector("#record[data-shown]")
        assert page.locator("#panels figure").count() == 12
        whole = page.get_attribute("#record", "data-shown")
        assert whole == "0,3599.99"
        said = page.locator("#said").text_content()
        samples = int(said.split()[6])
        assert 12 * 500 < samples < 12 * 4100
        assert (
            page.locator("#panels .plot")
            .nth(1)
            .get_attribute("aria-label")
            .endswith(f"to {np.rad2deg(1.25):.5g}")
        )  # the spike
        canvas = page.locator("#panels .u-over").first.bounding_box()
        page.mouse.move(canvas["x"] + 0.25 * canvas["width"], canvas["y"] + 30)
        page.mouse.down()
        page.mouse.move(canvas["x"] + 0.5 * canvas["width"], canvas["y"] + 30, steps=4)
        page.mouse.up()
        page.wait_for_selector(f"#record:not([data-shown='{whole}'])")
        start, end = (
            float(part) for part in page.get_attribute("#record", "data-shown").split(",")
        )
        assert (start, end) == (pytest.approx(900, abs=15), pytest.approx(1800, abs=15))
        page.fill("#from", "1199")
        page.fill("#to", "1201")
        page.keyboard.press("Enter")
        page.wait_for_selector("#record[data-shown='1199,1201']")
        near = int(page.locator("#said").text_content().split()[6])
        assert near == 12 * 203  # 2 s at 100 Hz, both ends and one more on either side
        page.click("button[data-move=all]")
        page.wait_for_selector(f"#record[data-shown='{whole}']")


def test_channels_are_chosen_and_coefficients_shown(browser: Any, address: str, made: Made) -> None:
    with watched(browser, address) as page:
        visit(page, address, f"/flights/{made.flight}")
        page.wait_for_selector("#record[data-shown]")
        page.click("summary:has-text('Choose channels')")
        page.evaluate(
            "document.querySelectorAll('#choice input').forEach((box) => { box.checked = false; })"
        )
        page.check("#choice input[value=CZ]")
        page.check("#choice input[value=alpha]")
        page.click("#choice button")
        page.wait_for_selector("#panels figure:nth-child(2):last-child")
        titles = page.locator("#panels figcaption").all_text_contents()
        assert titles[0] == "alpha [deg]"
        assert titles[1].startswith("CZ [-]")


def test_curves_are_drawn_beside_the_parent(browser: Any, address: str, made: Made) -> None:
    with watched(browser, address) as page:
        visit(page, address, f"/versions/{made.candidate}")
        page.wait_for_selector("#sweep[data-shown=alpha]")
        assert page.locator("#curves figure").count() == 6
        page.fill("#low", "-60")
        page.fill("#high", "60")
        page.click("#sweep button")
        page.wait_for_function(
            "() => /have faded to nothing below -/.test(swept.textContent.replace('−', '-'))"
        )
        page.select_option("#over", "delta_elevator")
        page.fill("#through", "alpha=5deg,V=25")
        page.click("#sweep button")
        page.wait_for_selector("#sweep[data-shown=delta_elevator]")


def test_the_figure_of_differences_is_seen_whole_on_a_phone(
    browser: Any, address: str, made: Made
) -> None:
    with watched(browser, address, 400) as page:
        for path in (
            f"/diff?before={made.baseline}&after={made.candidate}",
            f"/versions/{made.candidate}/promote",
            f"/versions/{made.candidate}",
        ):
            visit(page, address, path)
            figure = page.locator("figure picture img")
            figure.scroll_into_view_if_needed()
            figure.evaluate("(image) => image.decode()")
            assert "on_phone=true" in figure.evaluate("(image) => image.currentSrc")
            box = figure.bounding_box()
            assert box["x"] >= 0
            assert box["x"] + box["width"] <= 400
            assert box["width"] >= 300, "letters are as large as they were drawn"


def test_two_versions_are_drawn_side_by_side_while_other_inputs_are_moved(
    browser: Any, address: str, made: Made
) -> None:
    curves = "() => [...document.querySelectorAll('#curves .plot')].map((e) => e.ariaLabel)"
    with watched(browser, address, 400) as page:
        visit(page, address, f"/compare?before={made.baseline}&after={made.candidate}")
        page.wait_for_selector("#compare[data-shown^='alpha']")
        assert page.locator("#curves figure").count() == 6
        before = page.evaluate(curves)
        page.click("main summary >> text=other inputs")
        page.focus("#at-delta_elevator")
        page.keyboard.press("End")
        page.wait_for_function(f"(before) => ({curves})()[4] !== before[4]", arg=before)
        assert page.evaluate(curves)[:4] == before[:4], "the elevator acts on Cm alone"
        look(page, "/compare", 400)
        page.select_option("#over", "q")
        page.wait_for_selector("#compare[data-shown^='q ']")
        address_kept = page.url
        assert "delta_elevator%3D20" in address_kept
        page.goto(address_kept)
        page.wait_for_selector("#compare[data-shown^='q ']")
        page.fill("[data-name=alpha] .exact", "no number")
        page.keyboard.press("Tab")
        page.fill("#low", "x")
        page.keyboard.press("Tab")
        page.wait_for_function("() => document.getElementById('swept').textContent")
        assert page.input_value("[data-name=alpha] .exact") == "0"


def test_a_version_is_promoted_by_keyboard_alone(
    browser: Any, shared: SharedWorkspaces, tmp_path: Path
) -> None:
    made = made_workspace(shared, tmp_path / "workspace")
    with served(made.workspace) as address, watched(browser, address) as page:
        visit(page, address, f"/versions/{made.candidate}")
        page.focus("text=Promote…")
        page.keyboard.press("Enter")
        page.wait_for_url("**/promote")
        page.focus("#reason")
        page.keyboard.type("proved on two flights")
        page.keyboard.press("Tab")
        page.keyboard.press("Enter")
        page.wait_for_selector("main:has-text('now points to v0002')")
        assert barriers(page) == []


def test_hostile_names_run_nothing(browser: Any, address: str) -> None:
    with watched(browser, address) as page:
        for path in (
            "/flights",
            f"/flights/{h('hostile 0')}",
            f"/flights/{h('hostile 1')}",
            "/",
            f"/flights/{h('hostile 0')}/impact",
        ):
            visit(page, address, path)
            assert page.locator("main script, main img").count() == 0
            assert (
                page.evaluate(
                    "document.documentElement.scrollWidth - document.documentElement.clientWidth"
                )
                <= 0
            )


def _sections(workspace: Workspace) -> list[str]:
    """Addresses of every kind of page of any workspace that holds a finding."""
    opened = access_workspace(str(workspace.root))
    entry = next(entry for entry in findings_page(opened, 20)[0] if entry["reference"])
    vehicle = opened.catalogue.vehicles()[0].name
    rows, (flight, *_) = opened.catalogue.versions(vehicle), opened.catalogue.flights(vehicle)
    first, last = rows[0].id, rows[-1].id
    paths = [
        "/",
        "/flights",
        f"/flights/{flight.id}",
        f"/flights/{flight.id}/impact",
        "/versions",
        f"/versions/{last}",
        "/work",
        "/findings",
    ]
    paths += [
        f"/findings/{entry['reference']}",
        f"/diff?before={first}&after={last}",
        f"/versions/{last}/lineage",
        "/history",
    ]
    return [*paths, f"/versions/{last}/promote", f"/rollback?vehicle={vehicle}"]


@pytest.mark.campaign
def test_every_page_of_the_demo(browser: Any, tmp_path: Path) -> None:
    asked(tmp_path / "demo", "demo", "--seed", "5", "--direct")
    _sound(browser, Workspace.open(tmp_path / "demo"))


@pytest.mark.campaign
def test_every_page_of_a_measured_aircraft(browser: Any, tmp_path: Path, measured: Any) -> None:
    workspace = tmp_path / "otter"
    asked(workspace, "vehicle", "add", str(VEHICLES / "twin_otter.toml"))
    file = Path(jsbsim.get_default_root_dir()) / "aircraft" / "DHC6" / "DHC6.xml"
    bindings = [word for name, value in LEFT_OUT.items() for word in ("--bind", f"{name}={value}")]
    asked(workspace, "database", "import", str(file), "--vehicle", "twin-otter", *bindings)
    logs = [
        str(measured(f"twin_otter/totter_{name}_data.mat"))
        for name in ("f1_017", "demo", "9752ed20")
    ]
    asked(workspace, "flight", "ingest", *logs, "--vehicle", "twin-otter", "--direct")
    asked(workspace, "close-loop", "--vehicle", "twin-otter", "--direct")
    _sound(browser, Workspace.open(workspace))


def _sound(browser: Any, workspace: Workspace) -> None:
    with served(workspace) as address, watched(browser, address) as page:
        for path in _sections(workspace):
            visit(page, address, path)
            look_everywhere(page, path)


def test_a_dropped_log_becomes_a_form_of_its_mapping(
    browser: Any, address: str, tmp_path: Path
) -> None:
    """Dropped, answered and checked: the plot beside the line follows the answer."""
    flown = channels(1, 20.0, 50.0)
    log = write_csv(tmp_path / "unknown.csv", flown)
    with watched(browser, address) as page:
        visit(page, address, "/logs")
        page.check("input[value=drafted]")
        page.set_input_files("#log", str(log))
        page.wait_for_selector("form[aria-label=Mapping]")
        look_everywhere(page, "draft")
        row = page.locator("tr", has=page.locator("input[value=alpha]"))
        before = row.locator("svg").get_attribute("aria-label")
        row.locator("input[name^=scale]").fill("2")
        page.click("text=Check")
        page.wait_for_load_state()
        after = row.locator("svg").get_attribute("aria-label")
        ends = [
            [float(x) for x in re.findall(r"-?[0-9.e-]+(?= )", each)] for each in (before, after)
        ]
        assert ends[1] == pytest.approx([2 * x for x in ends[0]], rel=1e-2)


def test_a_dropped_log_is_plotted_and_says_the_value_under_the_cursor(
    browser: Any, address: str, tmp_path: Path
) -> None:
    """One click or drop until the first plot; the script is the only one that may run there."""
    flown = channels(1, 20.0, 50.0)
    log = write_csv(tmp_path / "unknown.csv", flown)
    with watched(browser, address) as page:
        visit(page, address, "/logs")
        page.set_input_files("#log", str(log))
        page.wait_for_selector("[data-panel]")
        look_everywhere(page, "log")
        page.set_viewport_size({"width": 1400, "height": 900})
        picture = page.locator("[data-panel] img").nth(1)
        picture.scroll_into_view_if_needed()
        box = picture.bounding_box()
        page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"])
        said = page.locator("[data-panel] output").nth(1).text_content()
        at, value = said.partition(" s: alpha ")[0], said.partition(" s: alpha ")[2]
        assert value.endswith(" deg"), said
        known = np.rad2deg(np.interp(float(at), flown["time"] - flown["time"][0], flown["alpha"]))
        found = float(value.removesuffix(" deg").replace("−", "-"))
        assert abs(found - known) < 0.5, said
        assert page.locator(".mark:visible").count() == page.locator("[data-panel]").count()
        page.locator("[data-panel]").first.focus()
        page.keyboard.press("ArrowRight")
        assert page.locator("[data-panel] output").nth(1).text_content() != said
