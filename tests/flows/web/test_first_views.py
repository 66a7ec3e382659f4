"""The first view of a page: what takes long is loaded before, said, or comes after the answer."""

import json
import subprocess
import sys
from typing import Any

import pytest
from lxml import html
from starlette.testclient import TestClient

from tests.support.console_workspace import Made, client_of, made_workspace
from tests.support.shared_workspace import SharedWorkspaces

#: Packages that take long to load.
NUMERICAL = {"numba", "numpy", "scipy", "matplotlib", "pyarrow"}
VIEWS = """
import json, sys
from pathlib import Path
from aerodb.flows.web.prepare import prepare
from aerodb.storage.workspace import Workspace
from tests.support.console_workspace import client_of

root, *pages = sys.argv[1:]
client = client_of(Workspace.open(Path(root)))
prepare()
before = set(sys.modules)
codes = [client.get(page).status_code for page in pages]
print(json.dumps({"codes": codes, "new": sorted(set(sys.modules) - before), "all": [*sys.modules]}))
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Made:
    return made_workspace(shared, tmp_path_factory.mktemp("views") / "w")


@pytest.fixture(scope="module")
def client(made: Made) -> TestClient:
    return client_of(made.workspace)


def first_views(made: Made, *pages: str) -> dict[str, Any]:
    """Status of pages that a fresh, prepared process serves, and the modules that they loaded."""
    command = [sys.executable, "-W", "ignore", "-c", VIEWS, str(made.workspace.root), *pages]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    answer: dict[str, Any] = json.loads(done.stdout)
    return answer


def test_responses_that_were_not_flown_are_announced_before_they_are(
    client: TestClient, made: Made
) -> None:
    address = f"/versions/{made.candidate}/responses"
    announced = client.get(address)
    further = f"{address}?fly=true"
    assert announced.headers["refresh"] == f"0;url={further}"
    (link,) = html.fromstring(announced.content).xpath("//p[@class='actions']/a/@href")
    assert link == further
    assert "flown over" in announced.text


@pytest.mark.parametrize("fly", ["", "?fly=true"])
def test_responses_that_were_flown_are_shown_at_once(
    client: TestClient, made: Made, fly: str
) -> None:
    address = f"/versions/{made.candidate}/responses"
    assert client.get(f"{address}?fly=true").status_code == 200
    shown = client.get(f"{address}{fly}")
    assert "refresh" not in shown.headers
    assert "Checks within tolerance" in shown.text


def test_a_first_view_loads_no_numerical_code(made: Made) -> None:
    """The responses were flown by the tests before."""
    version = f"/versions/{made.candidate}"
    pages = (
        "/",
        version,
        f"{version}/promote",
        f"{version}/report",
        f"{version}/responses?fly=true",
        f"/findings/{made.candidate}/report",
        f"/flights/{made.flight}/report",
        f"/diff?before={made.baseline}&after={made.candidate}",
    )
    seen = first_views(made, *pages)
    assert seen["codes"] == [200] * len(pages)
    late = [name for name in seen["new"] if name.partition(".")[0] in NUMERICAL]
    assert late == []
    assert "pandas" not in seen["all"]  # half a second, for nothing that a page shows
