"""``aerodb serve`` with the catalogue and Prefect's own database in PostgreSQL: the inbox, cut
connections, and its end."""

import os
import shutil
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import psycopg
import pytest

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.locks import is_held, note_of
from tests.flows.test_serve import TOKEN, Served, end_service, has_ended, start_service, wait_until
from tests.support.glider_runs import prepared
from tests.support.postgresql import Server, name_in_settings
from tests.support.small_glider import NAME, write_files

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="locks and signals of POSIX")
SECRET = "s3cret-Word"
SETTINGS = """\
[serve]
port = 0
database = "$TEST_PREFECT"
[inbox]
settle = "0.5 s"
[nightly]
every = "1 h"
[loop]
run = []
"""


@pytest.fixture
def served(
    tmp_path: Path, postgresql_server: Server, monkeypatch: pytest.MonkeyPatch
) -> Iterator[tuple[Served, list[str]]]:
    """A workspace that is served, and the names of the databases of its catalogue and of
    Prefect."""
    databases = [postgresql_server.empty(), postgresql_server.empty()]
    urls = [
        postgresql_server.url(name).replace("aerodb@", f"aerodb:{SECRET}@") for name in databases
    ]
    given = {
        "TEST_CATALOGUE": urls[0],
        "TEST_PREFECT": urls[1],
        "AERODB_TOKEN": TOKEN,
        "HOME": str(tmp_path),
    }
    monkeypatch.setenv("TEST_CATALOGUE", urls[0])
    logs = write_files(tmp_path / "logs", 2)
    name_in_settings(tmp_path / "w", "$TEST_CATALOGUE", SETTINGS)
    workspace = prepared(tmp_path / "w", logs[0].parent)
    (workspace.inbox / NAME).mkdir()
    shutil.copy(logs[0], workspace.inbox / NAME / "missed.csv")
    one = Served(workspace, start_service(workspace, **given), logs)
    try:
        yield one, databases
    finally:
        end_service(one.process)
        for name in databases:
            postgresql_server.drop(name)


@pytest.mark.campaign
def test_logs_are_taken_in_with_everything_in_postgresql_and_through_cuts(
    served: tuple[Served, list[str]], postgresql_server: Server
) -> None:
    one, databases = served
    workspace = one.workspace
    wait_until(lambda: note_of(workspace.lock("serve")).get("url"), one, "the server came up")
    wait_until(
        lambda: has_ended(one).get("missed.csv") == "stored", one, "what waited was taken in"
    )
    wait_until(
        lambda: _completed(postgresql_server.url(databases[1])),
        one,
        "Prefect's database held the run",
    )
    assert not list(workspace.prefect.glob("prefect.db*"))
    for name in databases:
        postgresql_server.cut(name)
    shutil.copy(one.logs[1], workspace.inbox / NAME / "after.csv")
    wait_until(
        lambda: has_ended(one).get("after.csv") == "stored",
        one,
        "a log was taken in after all connections were cut",
    )
    one.process.send_signal(signal.SIGTERM)
    assert one.process.wait(timeout=300) == 0, one.said()
    assert not is_held(workspace.lock("serve"))
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert len(catalogue.flights(NAME)) == 2
        assert not list(catalogue.runs("running"))
    _nothing_tells_the_secret(one)


def _completed(url: str) -> bool:
    with psycopg.connect(url) as raw:
        return (
            raw.execute("SELECT 1 FROM flow_run WHERE state_type = 'COMPLETED'").fetchone()
            is not None
        )


def _nothing_tells_the_secret(one: Served) -> None:
    """Neither a log, nor a report, nor a setting that is kept."""
    for folder, _, names in os.walk(one.workspace.root.parent):
        for name in names:
            assert SECRET.encode() not in (Path(folder) / name).read_bytes(), name
