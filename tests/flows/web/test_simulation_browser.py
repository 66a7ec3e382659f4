"""What a simulation engineer does with a released version: it goes into an aircraft of JSBSim and
into a table, and beside the one before it while other inputs are moved."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from lxml import etree

from aerodb.storage.workspace import Workspace
from tests.support.browser import look_everywhere, visit, watched
from tests.support.command import asked
from tests.support.console_workspace import served
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME

#: JSBSim's simulation of an aircraft file at one state: force coefficient along body z.
POINT = {"alpha": 0.07, "V": 25.0}

#: The suite looks at every page in `test_console_browser.py`.
pytestmark = pytest.mark.campaign


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Workspace:
    """A workspace whose released version was changed by flights."""
    place, _ = shared.updated(tmp_path_factory.mktemp("simulation") / "w")
    moved = asked(
        place.root, "version", "promote", "candidate", "--reason", "proved on two flights"
    )
    assert moved["label"] == "v0002"
    return place


@pytest.fixture(scope="module")
def address(workspace: Workspace) -> Iterator[str]:
    with served(workspace) as opened:
        yield opened


def test_the_released_version_flies_in_an_own_aircraft(
    workspace: Workspace, tmp_path: Path
) -> None:
    """Its engine and its mass stay, and JSBSim computes what the version says."""
    jsbsim = pytest.importorskip("jsbsim")
    own = tmp_path / "aircraft" / "mine" / "mine.xml"
    own.parent.mkdir(parents=True)
    export = ("version", "export", "v0001", "--format", "jsbsim", "--output", str(own))
    asked(workspace.root, *export)  # the aircraft that the engineer has flown so far
    tree = etree.parse(own)
    tree.find("mass_balance/emptywt").text = "33"
    tree.write(own)
    said = asked(
        workspace.root, "version", "export", "released", "--format", "jsbsim", "--into", str(own),
        "--output", str(own),
    )  # fmt: skip
    assert said["label"] == "v0002"
    assert said["into"]["lost"] == []
    flown = jsbsim.FGFDMExec(str(tmp_path))
    flown.set_debug_level(0)
    assert flown.load_model("mine")
    assert flown["inertia/empty-weight-lbs"] == pytest.approx(33)
    flown["ic/alpha-rad"], flown["ic/vt-fps"] = POINT["alpha"], POINT["V"] / 0.3048
    flown["ic/h-sl-ft"] = 1000.0
    assert flown.run_ic()
    force = flown["forces/fbz-aero-lbs"] / (flown["aero/qbar-psf"] * flown["metrics/Sw-sqft"])
    at = ",".join(f"{name}={value}" for name, value in POINT.items())
    values = {
        label: asked(workspace.root, "version", "evaluate", label, "--at", at)["coefficients"]["CZ"]
        for label in ("v0001", "v0002")
    }
    assert abs(values["v0002"] - values["v0001"]) > 0.03
    assert force == pytest.approx(values["v0002"], abs=2e-3)


def test_a_table_has_what_the_version_says_with_its_errors(
    workspace: Workspace, tmp_path: Path
) -> None:
    file = tmp_path / "glider.csv"
    asked(workspace.root, "version", "export", "released", "--format", "csv", "--output", str(file))
    rows = pd.read_csv(file)
    assert not rows.isna().all().any(), "no empty column"
    nodes = rows[(rows.kind == "node") & (rows.name == "CZ0")].dropna(axis="columns")
    assert np.rad2deg(nodes["alpha [rad]"]).tolist() == pytest.approx([-4, 0, 4, 8, 12])
    found = rows[(rows.kind == "increment") & (rows.axis == "CZ")]
    assert len(found) == 3
    assert (found["standard error"] > 0).all()
    assert set(rows.loc[rows.kind == "check input", "unit"]) == {"m/s", "rad", "rad/s"}
    assert rows["kind"].iloc[-1] == "manifest", "what pandas shows first is data"
    asked(workspace.root, "database", "import", str(file), "--vehicle", NAME)


def labels(page: Any) -> list[str]:
    return list(
        page.evaluate(
            "[...document.querySelectorAll('#curves .plot')].map((plot) => plot.ariaLabel)"
        )
    )


def test_two_versions_stand_side_by_side_with_bands_while_others_are_moved(
    browser: Any, address: str, workspace: Workspace
) -> None:
    """From the list to the curves by clicks alone; the elevator is moved, then the pitch rate."""
    with watched(browser, address) as page:
        visit(page, address, "/versions")
        page.click("main table a:has-text('v0002')")
        page.click("text=Curves beside v0001")
        page.wait_for_selector("#compare[data-shown^='alpha']")
        titles = page.locator("#curves figcaption").all_inner_texts()
        assert [title.split()[0] for title in titles] == ["CX", "CY", "CZ", "Cl", "Cm", "Cn"]
        key = page.locator("p.key").inner_text()
        assert "v0001" in key
        assert "v0002" in key
        painted = "document.querySelector('#curves canvas')?.toDataURL()"
        light = page.evaluate(painted)
        page.emulate_media(color_scheme="dark")
        page.wait_for_function(f"(light) => {painted} !== light", arg=light)
        page.emulate_media(color_scheme="light")
        page.wait_for_function(f"(light) => {painted} === light", arg=light)
        before = labels(page)
        page.click("main summary >> text=other inputs")
        page.focus("#at-q")
        page.keyboard.press("End")
        page.wait_for_function(
            "(before) => document.querySelectorAll('#curves .plot')[2].ariaLabel !== before",
            arg=before[2],
        )
        after = labels(page)
        changed = [axis for axis, a, b in zip(titles, before, after, strict=True) if a != b]
        assert [title.split()[0] for title in changed] == ["CZ", "Cm"]
        look_everywhere(page, "/compare")
        shared = page.url
        page.goto(shared)
        page.wait_for_selector("#compare[data-shown^='alpha']")
        page.wait_for_function(
            "(after) => document.querySelectorAll('#curves .plot')[2].ariaLabel === after",
            arg=after[2],
        )


#: Per plot, the pixels that a band tints and no line covers.
TINTED = """() => [...document.querySelectorAll('#curves canvas')].map((c) => {
  const data = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
  let count = 0;
  for (let k = 3; k < data.length; k += 4) if (data[k] > 40 && data[k] < 110) count += 1;
  return count;
})"""


def test_bands_are_seen_where_flights_have_measured(browser: Any, address: str) -> None:
    """The errors are small: they show close to the curve, on the axes that flights have changed."""
    with watched(browser, address) as page:
        visit(page, address, "/compare?before=v0002&after=v0002&low=4&high=4.001")
        page.wait_for_selector("#compare[data-shown^='alpha']")
        tinted = dict(zip(("CX", "CY", "CZ", "Cl", "Cm", "Cn"), page.evaluate(TINTED), strict=True))
        for axis, count in tinted.items():
            assert (count > 5_000) == (axis in ("CX", "CZ")), tinted


def test_the_page_hands_out_the_same_files(
    browser: Any, address: str, workspace: Workspace
) -> None:
    released = asked(workspace.root, "version", "show", "released")["version"]
    with watched(browser, address) as page:
        visit(page, address, f"/versions/{released}")
        with page.expect_download() as begun:
            page.click("a[href$='format=jsbsim']")
        tree = etree.parse(begun.value.path())
        assert tree.find("aerodynamics") is not None
        assert begun.value.suggested_filename.endswith(".xml")
