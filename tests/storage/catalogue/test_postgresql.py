"""The catalogue in PostgreSQL where it differs from a file: cut connections, a server that goes
away, a full disk, and moving it. Behaviour that both databases share is in the tests of the
catalogue, addresses are in `test_location.py`."""

import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import psycopg
import pytest
import sqlalchemy as sa

from aerodb.errors import InputError, StoreBusyError, StoreError
from aerodb.remarks import said
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.copying import copy_catalogue
from aerodb.storage.catalogue.postgresql import open_postgresql
from aerodb.storage.catalogue.rows import InboxEvent
from aerodb.storage.catalogue.schema import metadata
from aerodb.tasks.steps import mark_ended
from aerodb.tasks.workspace_access import access_workspace
from tests.support.catalogue_samples import V, add_family, add_version, h
from tests.support.paths import ROOT
from tests.support.postgresql import Server, name_in_settings


@pytest.fixture
def catalogue(postgresql_server: Server, database: str, tmp_path: Path) -> Iterator[Catalogue]:
    name_in_settings(tmp_path, postgresql_server.url(database))
    with Catalogue.open(tmp_path / "catalogue.sqlite") as opened:
        opened.add_vehicle(V, "name = 'twin-otter'")
        yield opened


# Connections


def test_a_connection_that_was_cut_meanwhile_costs_nothing(
    catalogue: Catalogue, postgresql_server: Server, database: str
) -> None:
    for k in range(3):
        postgresql_server.cut(database)
        add_version(catalogue, str(k))
    assert [row.number for row in catalogue.versions(V)] == [1, 2, 3]


def test_a_connection_cut_inside_a_transaction_leaves_nothing_of_it(
    catalogue: Catalogue, postgresql_server: Server, database: str
) -> None:
    add_version(catalogue, "before")

    def interrupted() -> None:
        with catalogue.transaction():
            add_version(catalogue, "inside")
            postgresql_server.cut(database)
            add_version(catalogue, "after the cut")

    with pytest.raises(StoreBusyError, match="cannot be reached"):
        interrupted()
    assert [row.id for row in catalogue.versions(V)] == [h("before")]
    add_version(catalogue, "again")
    assert [row.number for row in catalogue.versions(V)] == [1, 2]


@pytest.mark.parametrize("how", [signal.SIGINT, signal.SIGQUIT], ids=["shut down", "crashed"])
def test_a_server_that_is_started_again_is_waited_for(
    catalogue: Catalogue, postgresql_server: Server, how: signal.Signals
) -> None:
    add_version(catalogue, "before")
    postgresql_server.stop(how)
    with ThreadPoolExecutor(1) as pool:
        late = pool.submit(add_version, catalogue, "after")
        time.sleep(1.5)
        waited = not late.done()
        postgresql_server.start()
        late.result(300)
    assert waited
    assert [row.id for row in catalogue.versions(V)] == [h("before"), h("after")]


def test_a_server_that_stays_away_is_told_after_the_wait(
    catalogue: Catalogue, postgresql_server: Server
) -> None:
    catalogue._database.patience = 0.5
    postgresql_server.stop()
    try:
        begun = time.monotonic()
        with pytest.raises(StoreBusyError, match="cannot be reached") as away:
            catalogue.vehicles()
        assert time.monotonic() - begun >= 0.5
    finally:
        postgresql_server.start()
    assert away.value.where.startswith("postgresql://aerodb@127.0.0.1:")
    assert [row.name for row in catalogue.vehicles()] == [V]


_HOLDS = """
import sys, pathlib
from tests.support.catalogue_samples import *
with Catalogue.open(pathlib.Path(sys.argv[1])) as catalogue, catalogue.transaction():
    add_version(catalogue, "held")
    print("holds", flush=True)
    sys.stdin.readline()
"""


def test_who_holds_the_lock_is_waited_for_and_readers_are_not_kept(
    catalogue: Catalogue, postgresql_server: Server, database: str, tmp_path: Path
) -> None:
    command = [sys.executable, "-c", _HOLDS, str(tmp_path / "catalogue.sqlite")]
    holder = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT)
    assert holder.stdout is not None
    assert holder.stdout.readline() == b"holds\n"
    assert catalogue.versions(V) == ()
    with psycopg.connect(postgresql_server.url(database)) as raw:
        waiting = (
            "SELECT count(*) FROM pg_stat_activity WHERE wait_event = 'advisory' AND datname ="
            " current_database()"
        )
        with ThreadPoolExecutor(1) as pool:
            late = pool.submit(add_version, catalogue, "late")
            while raw.execute(waiting).fetchone() != (1,):
                raw.rollback()
                assert not late.done()
                time.sleep(0.02)
            holder.communicate(b"\n", timeout=300)
            late.result(300)
    assert [(row.number, row.id) for row in catalogue.versions(V)] == [
        (1, h("held")),
        (2, h("late")),
    ]


def test_a_lock_that_is_never_given_back_is_said(
    catalogue: Catalogue, postgresql_server: Server, database: str
) -> None:
    url = f"{postgresql_server.url(database)}?options=-c lock_timeout%3D200ms"
    with catalogue.transaction():
        add_version(catalogue, "held")
        impatient = open_postgresql(url)
        with (
            pytest.raises(StoreBusyError, match="another process has locked the catalogue"),
            impatient.writing(),
        ):
            pass
        impatient.close()


def test_other_catalogues_of_the_same_database_are_not_held_up(
    postgresql_server: Server, tmp_path: Path
) -> None:
    name = postgresql_server.empty()
    postgresql_server.execute("CREATE SCHEMA one", "CREATE SCHEMA two", database=name)
    opened = []
    for schema in ("one", "two"):
        name_in_settings(
            tmp_path / schema, f"{postgresql_server.url(name)}?options=-csearch_path%3D{schema}"
        )
        opened.append(Catalogue.open(tmp_path / schema / "catalogue.sqlite"))
    with opened[0].transaction():
        opened[0].add_vehicle("first", "text")
        with ThreadPoolExecutor(1) as pool:
            pool.submit(opened[1].add_vehicle, "second", "text").result(20)
    assert [[row.name for row in one.vehicles()] for one in opened] == [["first"], ["second"]]
    for one in opened:
        one.close()
    postgresql_server.drop(name)


def test_a_database_that_may_only_be_read_is_said_and_can_be_read(
    catalogue: Catalogue, postgresql_server: Server, database: str
) -> None:
    add_version(catalogue, "a")
    postgresql_server.execute(f"ALTER DATABASE {database} SET default_transaction_read_only = on")
    postgresql_server.cut(database)
    url = postgresql_server.url(database)
    reader = open_postgresql(url)
    with (
        pytest.raises(StoreError, match="is read-only now") as refusal,
        reader.writing() as connection,
    ):
        connection.execute(sa.text("INSERT INTO vehicles VALUES ('x', 'now')"))
    assert not isinstance(refusal.value, StoreBusyError)
    reader.close()
    assert [row.number for row in catalogue.versions(V)] == [1]


@pytest.fixture
def small_disk(postgresql_server: Server) -> Iterator[Path]:
    """A small file system of its own, for tables."""
    folder = postgresql_server.folder / "small"
    folder.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=24m", "tmpfs", str(folder)], capture_output=True
    )
    if mounted.returncode:
        folder.rmdir()
        pytest.skip("may not mount a file system here")
    (folder / "tables").mkdir()
    shutil.chown(
        folder / "tables", postgresql_server.folder.owner(), postgresql_server.folder.group()
    )
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)
        folder.rmdir()


def test_a_full_disk_of_the_server_is_said_and_everything_stays_readable(
    small_disk: Path, postgresql_server: Server, database: str, tmp_path: Path
) -> None:
    postgresql_server.cut(database)
    postgresql_server.execute(
        f"CREATE TABLESPACE small LOCATION '{small_disk / 'tables'}'",
        f"ALTER DATABASE {database} SET TABLESPACE small",
    )
    name_in_settings(tmp_path, postgresql_server.url(database))
    noise = random.Random(1)

    def document() -> str:
        return f'"{noise.randbytes(500_000).hex()}"'

    def fill() -> None:
        for k in range(100):
            add_version(catalogue, str(k), content=document())

    with Catalogue.open(tmp_path / "catalogue.sqlite") as catalogue:
        catalogue.add_vehicle(V, "text")
        with pytest.raises(StoreError, match="the disk is full") as full:
            fill()
        assert not isinstance(full.value, StoreBusyError)
        kept = len(catalogue.versions(V))
        assert kept > 3
        assert len(catalogue.version_documents(h(str(kept - 1))).content) == 1_000_002
        subprocess.run(["mount", "-o", "remount,size=64m", str(small_disk)], check=True)
        add_version(catalogue, "after", content=document())
        assert len(catalogue.versions(V)) == kept + 1
    postgresql_server.cut(database)
    postgresql_server.execute(
        f"ALTER DATABASE {database} SET TABLESPACE pg_default", "DROP TABLESPACE small"
    )


def test_names_longer_than_an_index_holds_are_kept(catalogue: Catalogue) -> None:
    """A name in the inbox is somebody else's: PostgreSQL's usual indices take 2.7 kB."""
    path = "glider/" + "".join(
        random.Random(1).choices("abcdefghijklmnopqrstuvwxyz0123456789/ä", k=4000)
    )
    catalogue.add_inbox_events(
        [InboxEvent(path, V, 10, 5, "tried"), InboxEvent(path, V, 10, 5, "failed", reason="r\0")]
    )
    assert catalogue.inbox_attempts([path]) == {(path, 10, 5): (1, "r\\x00")}


# Moving


def test_all_rows_go_there_and_back(
    kept_in: str, tmp_path: Path, postgresql_server: Server
) -> None:
    """From either kind into a file, from there into the other kind, and into a file again: the same
    rows."""
    from tests.storage.catalogue.test_catalogue_safety import filled

    with Catalogue.open(tmp_path / "catalogue.sqlite") as first:
        first.add_vehicle(V, "text \N{SNOWMAN} \x7f")
        add_family(first)
        filled(first)
        with Catalogue.in_file(tmp_path / "between") as between:
            copy_catalogue(first, between)
            other = postgresql_server.catalogue()
            name_in_settings(tmp_path / "other", postgresql_server.url(other))
            with (
                Catalogue.open(tmp_path / "other" / "catalogue.sqlite") as moved,
                Catalogue.in_file(tmp_path / "last") as last,
            ):
                copy_catalogue(between, moved)
                copy_catalogue(moved, last)
                rows = [_rows(one) for one in (first, between, moved, last)]
                assert rows[0] == rows[1] == rows[2] == rows[3]
                with pytest.raises(InputError, match="already contains a catalogue"):
                    copy_catalogue(between, moved)
                # Numbers go on where they stood.
                assert add_version(moved, "next") == h("next")
                moved.judge_flight(h("f2"), "limited", [said("later")])
                assert moved.flight("f2").verdict == "limited"
    postgresql_server.drop(other)


def _rows(catalogue: Catalogue) -> dict[str, list[tuple[Any, ...]]]:
    with catalogue._database.reading() as connection:
        return {
            name: sorted((tuple(row) for row in connection.execute(sa.select(table))), key=repr)
            for name, table in metadata.tables.items()
        }


def test_two_workspaces_never_share_a_catalogue(
    postgresql_server: Server, database: str, tmp_path: Path
) -> None:
    """Each would take the other's runs for crashed: locks are files of a workspace's folder."""
    for name in ("one", "other", "gone"):
        (tmp_path / name / "locks").mkdir(parents=True)
        name_in_settings(tmp_path / name, postgresql_server.url(database))
    with Catalogue.open(tmp_path / "one" / "catalogue.sqlite") as catalogue:
        catalogue.start_run("flow", how="direct")
    with (
        Catalogue.open(tmp_path / "other" / "catalogue.sqlite") as catalogue,
        pytest.raises(InputError, match=r"belongs to another workspace, .*/one") as refusal,
    ):
        catalogue.start_run("flow", how="direct")
    other = access_workspace(str(tmp_path / "other"))
    with pytest.raises(InputError, match="belongs to another workspace"):
        mark_ended(other)
    own = (tmp_path / "one" / "locks" / "workspace_id").read_text(encoding="ascii")
    assert own.strip() in refusal.value.remedy
    (tmp_path / "gone" / "locks" / "workspace_id").write_text(own, encoding="ascii")
    with Catalogue.open(tmp_path / "gone" / "catalogue.sqlite") as catalogue:
        catalogue.start_run("flow", how="direct")
        assert len(catalogue.runs("running", limit=5)) == 2
    (tmp_path / "one").rename(tmp_path / "moved")
    with Catalogue.open(tmp_path / "moved" / "catalogue.sqlite") as catalogue:
        catalogue.start_run("flow", how="direct")
