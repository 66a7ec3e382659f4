"""Versions without inputs (constants only) and on scattered tables: every page and export of them
answers, says what there is, and complains of nothing in Chromium."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from aerodb.storage.workspace import Workspace
from tests.support.browser import look_everywhere, visit, watched
from tests.support.command import aerodb, asked
from tests.support.console_workspace import client_of, served
from tests.support.small_glider import DATABASE, VEHICLE

HEAD = DATABASE[: DATABASE.index("[tables")]
CONSTANTS = HEAD + '[derivatives.CX]\n"1" = -0.03\n[derivatives.CZ]\n"1" = -0.3\n'
SCATTERED = (
    HEAD
    + """\
[scattered.cloud]
arguments = ["alpha", "mach"]
points = [[0.0, 0.1], [0.1, 0.1], [0.1, 0.2], [0.0, 0.25]]
values = [-0.2, -0.3, -0.4, -0.5]
[[terms]]
name = "lift"
axis = "CZ"
expression = "cloud(alpha, mach)"
"""
)
KINDS = {"constants": CONSTANTS, "scattered": SCATTERED}


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Workspace:
    """A vehicle for each kind, with two versions that differ."""
    folder = tmp_path_factory.mktemp("odd")
    root = folder / "w"
    for kind, text in KINDS.items():
        (folder / "vehicle.toml").write_text(VEHICLE.replace("small-glider", kind))
        asked(root, "vehicle", "add", str(folder / "vehicle.toml"))
        for k, content in enumerate((text, text.replace("-0.3", "-0.35"))):
            file = folder / f"{kind}{k}.toml"
            file.write_text(content, encoding="utf-8")
            asked(root, "database", "import", str(file), "--vehicle", kind)
    return Workspace.open(root)


@pytest.fixture(scope="module")
def client(workspace: Workspace) -> Iterator[TestClient]:
    with client_of(workspace) as opened:
        yield opened


def ids(client: TestClient, kind: str) -> list[str]:
    return [row["version"] for row in client.get(f"/api/versions?vehicle={kind}").json()]


def pages(client: TestClient, kind: str) -> list[str]:
    """Addresses of every page of two versions."""
    first, last = ids(client, kind)
    at = "at=alpha%3D2deg,mach%3D0.15" if kind == "scattered" else "at="
    return [
        "/",
        f"/versions?vehicle={kind}",
        f"/versions/{last}",
        f"/versions/{last}?{at}",
        f"/versions/{last}/lineage",
        f"/versions/{last}/lineage?{at}",
        f"/versions/{last}/promote",
        f"/compare?before={first}&after={last}",
        f"/diff?before={first}&after={last}",
        f"/history?vehicle={kind}",
        *([f"/versions/{last}?table=cloud"] if kind == "scattered" else []),
    ]


@pytest.mark.campaign
@pytest.mark.parametrize("kind", KINDS)
def test_every_page_answers_and_is_sound(
    browser: Any, client: TestClient, workspace: Workspace, kind: str
) -> None:
    with served(workspace) as address, watched(browser, address) as page:
        for path in pages(client, kind):
            visit(page, address, path)
            assert "The request failed" not in page.content(), path
            assert "undefined" not in page.locator("main").inner_text(), path
            if path.startswith(("/versions/", "/compare", "/diff")) and "promote" not in path:
                look_everywhere(page, f"{kind}{path}".replace("/", "-")[:50])


@pytest.mark.parametrize("kind", KINDS)
def test_documents_and_reports_answer(client: TestClient, kind: str) -> None:
    first, last = ids(client, kind)
    for path in (
        f"/versions/{last}/report",
        f"/diff/figure.svg?before={first}&after={last}",
        f"/api/diff?before={first}&after={last}",
        f"/api/versions/{last}",
        f"/api/versions/{last}/lineage",
    ):
        answer = client.get(path)
        assert answer.status_code == 200, (path, answer.text[:300])


def test_constants_are_shown_without_being_asked_for_a_point(client: TestClient) -> None:
    last = ids(client, "constants")[1]
    said = client.get(f"/versions/{last}").text
    assert "needs no input" in said
    assert "−0.35" in said or "-0.35" in said
    assert 'id="sweep"' not in said
    compared = client.get(f"/compare?before={ids(client, 'constants')[0]}&after={last}").text
    assert "Neither version depends on an input" in compared
    assert 'id="compare"' not in compared


def test_scattered_points_are_shown_as_they_are(client: TestClient) -> None:
    last = ids(client, "scattered")[1]
    said = client.get(f"/versions/{last}?table=cloud").text
    for words in ("alpha [deg]", "5.7296", "−0.35", "4 points"):
        assert words in said, words
    table = client.get(f"/api/versions/{last}/tables/cloud").json()
    assert table["points"][1] == [0.1, 0.1]
    assert table["values"][1] == -0.35
    assert client.get(f"/api/versions/{last}/tables/clod").status_code == 404
    along = client.get(f"/api/versions/{last}/sweep?over=alpha&from=0&to=0.1&at=mach=0.15")
    assert along.status_code == 200


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("format", ["jsbsim", "csv", "daveml", "mat", "netcdf"])
def test_exports_are_written_or_refused_with_the_reason(
    client: TestClient, workspace: Workspace, tmp_path: Path, kind: str, format: str
) -> None:
    """JSBSim has no table on scattered points; all else goes everywhere, from page and command."""
    file = tmp_path / ("x.xml" if format == "jsbsim" else f"x.{format}")
    done = aerodb(
        workspace.root, "version", "export", "v0001", "--vehicle", kind,
        "--format", format, "--output", str(file),
    )  # fmt: skip
    answer = client.get(f"/api/versions/{ids(client, kind)[0]}/export?format={format}")
    if (kind, format) == ("scattered", "jsbsim"):
        assert (done.returncode, answer.status_code) == (3, 422)
        for said in (done.stderr, answer.text):
            assert "on scattered points has no equivalent in JSBSim" in said
        assert not file.exists()
    else:
        assert done.returncode == 0, done.stderr
        assert answer.status_code == 200, answer.text
        assert file.stat().st_size > 0


def test_a_difference_without_slices_is_not_called_none(client: TestClient) -> None:
    first, last = ids(client, "constants")
    figure = client.get(f"/diff/figure.svg?before={first}&after={last}").text
    assert "same coefficients" not in figure
    assert "CZ: −0.3 in v0001, −0.35 in v0002" in figure
    same = client.get(f"/diff/figure.svg?before={first}&after={first}").text
    assert "give the same coefficients" in same
    first, last = ids(client, "scattered")
    assert ": 1 edit<" in client.get(f"/diff?before={first}&after={last}").text
    figure = client.get(f"/diff/figure.svg?before={first}&after={last}").text
    assert "same coefficients" not in figure
    assert "alpha" in figure, "a slice within its points"


def test_ranges_are_those_of_scattered_points(client: TestClient) -> None:
    first, last = ids(client, "scattered")
    said = client.get(f"/compare?before={first}&after={last}").text
    assert 'data-name="mach" data-factor="1.0" data-low="0.1" data-high="0.25"' in said
