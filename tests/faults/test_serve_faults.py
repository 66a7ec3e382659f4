"""``aerodb serve`` with several faults in one run: the server killed, the database disconnected,
the clock set back.

The next runs complete the work, and the workspace equals that of undisturbed nights.
"""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from aerodb.flows.nightly import nightly_flow
from aerodb.flows.run import run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.locks import is_held, note_of
from aerodb.storage.upkeep.verification import verify
from aerodb.storage.workspace import Workspace
from tests.flows.test_serve import TOKEN, Served, end_service, start_service, wait_until
from tests.support.glider_runs import prepared, stored
from tests.support.postgresql import Server, name_in_settings
from tests.support.set_clock import Clock, can_be_set, set_clock
from tests.support.small_glider import MODEL, NAME, write_files

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="clocks of Linux")
SETTINGS = """\
[serve]
port = 0
database = "$TEST_PREFECT"
[inbox]
settle = "0.5 s"
[nightly]
cron = "* * * * * */20"
[loop]
after = 3
run = ["update"]
model = "increments.toml"
"""


def _empty(root: Path, logs: list[Path]) -> Workspace:
    """A workspace whose nights take in what is dropped, and update the database when that is three
    logs."""
    workspace = prepared(root, logs[0].parent)
    (root / "increments.toml").write_text(MODEL, encoding="utf-8")
    (workspace.inbox / NAME).mkdir()
    return workspace


def _drop(workspace: Workspace, logs: list[Path]) -> None:
    for log in logs:
        shutil.copy(log, workspace.inbox / NAME)


@pytest.fixture(scope="module")
def undisturbed(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[list[Path], Workspace]:
    """Six logs, and a workspace that has had three of them in each night."""
    folder = tmp_path_factory.mktemp("undisturbed")
    logs = write_files(folder / "logs", 6)
    workspace = _empty(folder / "w", logs)
    (workspace.root / "settings.toml").write_text(SETTINGS, encoding="utf-8")
    for night in range(2):
        _drop(workspace, logs[3 * night : 3 * night + 3])
        run_flow(nightly_flow, {}, workspace, "direct")
    return logs, workspace


@pytest.fixture
def served(
    tmp_path: Path, postgresql_server: Server, undisturbed: tuple[list[Path], Workspace]
) -> Iterator[tuple[Served, list[str], Path]]:
    """A workspace that is served, the names of the databases of its catalogue and of Prefect, and
    the clock of its processes."""
    if not can_be_set():
        pytest.skip("no C compiler here to make a clock that can be set")
    databases, clock = (
        [postgresql_server.empty(), postgresql_server.empty()],
        Clock(tmp_path / "clock"),
    )
    name_in_settings(tmp_path / "w", postgresql_server.url(databases[0]), SETTINGS)
    workspace = _empty(tmp_path / "w", undisturbed[0])
    _drop(workspace, undisturbed[0][:3])
    given = {
        "TEST_PREFECT": postgresql_server.url(databases[1]),
        "AERODB_TOKEN": TOKEN,
        "HOME": str(tmp_path),
    }
    one = Served(workspace, start_service(workspace, **given, **clock.environment), undisturbed[0])
    try:
        yield one, databases, clock.added
    finally:
        end_service(one.process)
        for name in databases:
            postgresql_server.drop(name)


def _under_way(workspace: Workspace) -> bool:
    with Catalogue.open(workspace.catalogue) as catalogue:
        return any(is_held(workspace.lock(f"run-{run.id}")) for run in catalogue.runs("running"))


def _labels(workspace: Workspace) -> list[str]:
    with Catalogue.open(workspace.catalogue) as catalogue:
        return [row.label for row in catalogue.versions(NAME)]


@pytest.mark.campaign
def test_server_database_and_clock_fail_in_one_run(
    served: tuple[Served, list[str], Path],
    undisturbed: tuple[list[Path], Workspace],
    postgresql_server: Server,
) -> None:
    """In the end the clock is set back once more, and nothing else ails: the server would wait for the
    day that is gone."""
    one, databases, clock = served
    workspace = one.workspace
    wait_until(lambda: note_of(workspace.lock("serve")).get("url"), one, "the server came up")
    wait_until(lambda: _under_way(workspace), one, "a run is under way")
    found = subprocess.run(
        ["pgrep", "-P", str(one.process.pid), "-f", "aerodb.flows.prefect_server"],
        capture_output=True,
        text=True,
    )
    os.kill(int(found.stdout.split()[0]), signal.SIGKILL)
    for name in databases:
        postgresql_server.cut(name)
    set_clock(clock, -86_400)
    wait_until(lambda: "the clock was set back by 864" in one.said(), one, "the clock is noticed")
    wait_until(lambda: _labels(workspace) == ["v0001", "v0002"], one, "what was begun is done")
    set_clock(clock, -2 * 86_400)
    _drop(workspace, one.logs[3:])
    wait_until(
        lambda: _labels(workspace)[2:] == ["v0003"],
        one,
        "a night on the schedule, by the clock as it is now",
    )
    wait_until(lambda: not _under_way(workspace), one, "it has ended")
    one.process.send_signal(signal.SIGTERM)
    assert one.process.wait(timeout=300) == 0, one.said()
    assert list((workspace.inbox / NAME).iterdir()) == []
    assert stored(workspace) == stored(undisturbed[1])
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert verify(workspace, catalogue).problems == []
        assert catalogue.runs("running") == ()
        assert [event.version for event in catalogue.name_history(NAME)][-1] == catalogue.versions(
            NAME
        )[-1].id
