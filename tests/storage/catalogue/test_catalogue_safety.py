"""The catalogue against manual changes, invalid files, many concurrent writers and killed
writers."""

import multiprocessing
import multiprocessing.context
import os
import signal
import sqlite3
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from contextlib import closing
from pathlib import Path
from typing import Any

import psycopg
import pytest
import sqlalchemy as sa
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy.dialects import postgresql
from sqlalchemy.schema import CreateTable

from aerodb.errors import AeroError, InputError
from aerodb.remarks import said
from aerodb.storage.catalogue import schema
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.names import NameMovedError
from aerodb.storage.catalogue.rows import InboxEvent, RepeatedStretch, RepeatRow
from aerodb.storage.upkeep.audit import Audit
from tests.support.catalogue_samples import V, add_family, add_version, h
from tests.support.end_to_end import environment
from tests.support.forking import Forked
from tests.support.paths import ROOT
from tests.support.postgresql import by_hand


@pytest.fixture
def catalogue(kept_in: str, tmp_path: Path) -> Any:
    with Catalogue.open(tmp_path / "catalogue.sqlite") as opened:
        opened.add_vehicle(V, "name = 'twin-otter'")
        yield opened


@pytest.fixture
def family(catalogue: Catalogue) -> Catalogue:
    return add_family(catalogue)


#: What somebody may try on a table by hand, all of it in vain; `column` is its last column, `keys`
#: its primary key.
ATTACKS = {
    "sqlite": (
        "DELETE FROM {table}",
        "INSERT OR REPLACE INTO {table} SELECT * FROM {table} LIMIT 1",
        (
            "UPDATE {table} SET {column} = 'x' WHERE ({keys}) = (SELECT {keys} FROM {table} ORDER"
            " BY 1 DESC LIMIT 1)"
        ),
    ),
    "postgresql": (
        "DELETE FROM {table}",
        (
            "INSERT INTO {table} SELECT * FROM {table} LIMIT 1 ON CONFLICT ({keys}) DO UPDATE SET"
            " {column} = 'x'"
        ),
        "TRUNCATE {table} CASCADE",
        (
            "UPDATE {table} SET {column} = 'x' WHERE ({keys}) = (SELECT {keys} FROM {table} ORDER"
            " BY 1 DESC LIMIT 1)"
        ),
    ),
}
UNCHANGED = "never changed or deleted"
BROKEN = (sqlite3.IntegrityError, psycopg.IntegrityError)


def filled(family: Catalogue) -> None:
    """A row in every table but those of calibrations."""
    family.move_name(V, "released", h("a"), user="me", reason="r", expected=None)
    run = family.start_run("update", how="direct")
    family.judge_flight(h("f1"), "limited", [said("alpha is late")])
    family.add_result(
        h("r"), step="s", kind="k", path="p", result_version=1, inputs=[h("in")], run=run.id
    )
    for row in family.runs("running"):
        family.end_run(row.id, "completed")
    family.add_version(
        h("v"),
        vehicle=V,
        parent=None,
        content="{}",
        content_sha256=h("v"),
        settings={},
        report={},
        inputs=[h("in")],
        run=run.id,
    )
    family.add_marks(h("f1"), [1, 2**63 - 1])
    family.add_file("results/r.parquet", h("bytes"), 10)
    family.add_inbox_events([InboxEvent("glider/a.ulg", V, 10, 5, "stored", h("a"))])
    family.add_user("anna", "release", h("token"), by="me")
    family.add_note(h("v"), "tag", "flight-tested", user="me")
    family.dismiss_run(run.id, "disk replaced", user="me")
    family.add_repeat(
        RepeatRow(h("f2"), h("f1"), 0.5, (RepeatedStretch(1.0, 2.0, 3.0, 4.0, 50, 0.0),))
    )


def test_nothing_is_changed_or_deleted_even_by_hand(
    family: Catalogue, kept_in: str, tmp_path: Path
) -> None:
    filled(family)
    family.close()
    raw = by_hand(tmp_path / "catalogue.sqlite")
    raw.execute(
        f"INSERT INTO calibrations VALUES ('c', '{V}', 1, NULL, '{{}}', 'now', NULL, 'first')"
    )
    raw.execute(f"INSERT INTO flight_calibrations VALUES (1, '{h('f1')}', 'c', 'now', NULL)")
    raw.commit()

    def refused(attack: str) -> None:
        with pytest.raises(BROKEN, match=UNCHANGED):
            raw.execute(attack)
        raw.rollback()

    for name, table in schema.metadata.tables.items():
        rows = raw.execute(f"SELECT * FROM {name} ORDER BY 1, 2").fetchall()
        assert rows, name
        keys = ", ".join(f'"{column.name}"' for column in table.primary_key.columns)
        for attack in ATTACKS[kept_in]:
            refused(
                attack.format(table=name, column=f'"{list(table.columns)[-1].name}"', keys=keys)
            )
        assert raw.execute(f"SELECT * FROM {name} ORDER BY 1, 2").fetchall() == rows
    if kept_in == "sqlite":  # A new id on a label that is taken would delete the old version.
        refused(
            "INSERT OR REPLACE INTO versions (id, vehicle, number, content, content_sha256,"
            f" settings, report, created_utc) VALUES ('new', '{V}', 1, '', '', '', '', '')"
        )
    raw.close()


def test_types_and_edges_are_checked_by_the_database(
    catalogue: Catalogue, kept_in: str, tmp_path: Path
) -> None:
    with pytest.raises(sa.exc.IntegrityError), catalogue._database.writing() as connection:
        connection.execute(
            sa.insert(schema.result_inputs).values(key=h("no such result"), input_key=h(1))
        )
    raw = by_hand(tmp_path / "catalogue.sqlite")
    refusals = {
        "sqlite": "cannot store TEXT value in INTEGER column",
        "postgresql": "invalid input syntax for type bigint",
    }
    with pytest.raises((sqlite3.IntegrityError, psycopg.DataError), match=refusals[kept_in]):
        raw.execute(
            "INSERT INTO log_files VALUES ('a', 'a', 'not a number', '', 'stored', '', '[]', '')"
        )
    raw.close()


def test_text_is_in_the_order_of_its_bytes(catalogue: Catalogue) -> None:
    """In English a database would take 'a-b', 'a_b' and 'ab' together, and would not tell capitals
    first."""
    names = ["ab", "a-c", "a_b", "b", "a1", "a-b-c"]
    for name in names:
        catalogue.add_vehicle(name, "text")
        add_version(catalogue, name, vehicle=name)
    assert [row.name for row in catalogue.vehicles()] == sorted([*names, V])
    for name in ("b/Z", "b/a", "b/_", "b0", "b/0", "a"):
        catalogue.add_file(name, h(name), 1)
    assert list(catalogue.stored_files("b/", "b0")) == ["b/Z", "b/a", "b/_", "b/0"]
    assert [file.path for file in catalogue.every_stored_file()] == [
        "a",
        "b/0",
        "b/Z",
        "b/_",
        "b/a",
        "b0",
    ]


def _of_the_database(catalogue: Catalogue) -> list[str]:
    """What the database itself finds wrong: pages, edges and triggers, not what the rows mean."""
    found = Audit.of(catalogue).problems(lambda *_: None)
    return [p.what for p in found if p.where.startswith(("table", "catalogue.sqlite"))]


# Schema and opening


def test_migrations_lead_to_the_declared_schema(catalogue: Catalogue, kept_in: str) -> None:
    config = Config()
    config.set_main_option("script_location", "aerodb.storage:migrations")
    assert ScriptDirectory.from_config(config).get_heads() == [schema.HEAD]
    with catalogue._database.reading() as connection:
        assert compare_metadata(MigrationContext.configure(connection), schema.metadata) == []
        for name, table in schema.metadata.tables.items():
            assert "STRICT" not in str(CreateTable(table).compile(dialect=postgresql.dialect()))
            if kept_in == "sqlite":
                asked = sa.text("SELECT sql FROM sqlite_master WHERE name = :n")
                assert (
                    connection.execute(asked, {"n": name}).scalar_one().rstrip().endswith("STRICT")
                ), name
            else:
                columns = "SELECT column_name, collation_name FROM information_schema.columns"
                asked = sa.text(f"{columns} WHERE table_name = :n AND data_type = 'text'")
                collations = dict(map(tuple, connection.execute(asked, {"n": name})))
                assert collations == {
                    c.name: "C" for c in table.columns if isinstance(c.type, sa.Text)
                }
    assert _of_the_database(catalogue) == []


def test_a_query_on_a_current_catalogue_imports_neither_alembic_nor_pyarrow(
    catalogue: Catalogue, tmp_path: Path
) -> None:
    code = (
        "import sys, pathlib; from aerodb.storage.catalogue.catalogue import Catalogue\nwith"
        " Catalogue.open(pathlib.Path(sys.argv[1]), create=False) as c:"
        " print(c.vehicles()[0].name)\nprint({'alembic', 'pyarrow', 'pandas', 'scipy', 'prefect'} &"
        " set(sys.modules))"
    )
    run = [sys.executable, "-c", code, str(tmp_path / "catalogue.sqlite")]
    shown = subprocess.run(
        run, check=True, capture_output=True, text=True, timeout=600, cwd=ROOT
    ).stdout
    assert shown.split("\n")[:2] == [V, "set()"]


def test_what_is_no_catalogue_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no catalogue here"):
        Catalogue.open(tmp_path / "absent.sqlite", create=False)
    with pytest.raises(InputError, match="folder does not exist"):
        Catalogue.open(tmp_path / "absent" / "catalogue.sqlite")
    (tmp_path / "text.sqlite").write_text("these are not the bytes of a database " * 100)
    with pytest.raises(InputError, match="the catalogue cannot be used"):
        Catalogue.open(tmp_path / "text.sqlite")
    Catalogue.open(tmp_path / "newer.sqlite").close()
    with by_hand(tmp_path / "newer.sqlite") as raw:
        raw.execute("UPDATE alembic_version SET version_num = 'r9999'")
    raw.close()
    with pytest.raises(InputError, match="by a newer version"):
        Catalogue.open(tmp_path / "newer.sqlite")


# Transactions, concurrency, crashes


def test_a_transaction_happens_as_a_whole(catalogue: Catalogue) -> None:
    def fail() -> None:
        with catalogue.transaction():
            assert catalogue.version(V, add_version(catalogue, "a")).label == "v0001"
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()
    assert catalogue.versions(V) == ()
    with catalogue.transaction():
        add_version(catalogue, "a")
        with pytest.raises(AeroError):
            add_version(catalogue, "b", parent=h("nobody"))
        catalogue.move_name(V, "released", h("a"), user="me", reason="r", expected=None)
    assert catalogue.version(V, "released").label == "v0001"


def _write_many(path: Path, worker: int) -> tuple[list[str], int]:
    """50 read-then-write transactions: a version each, then one attempt to move the name on from
    what was seen."""
    ids, won = [], 0
    with Catalogue.open(path) as catalogue:
        catalogue.add_vehicle(V, "the same text")
        for k in range(50):
            ids.append(add_version(catalogue, f"{worker}/{k}"))
            history = catalogue.name_history(V, "candidate")
            try:
                catalogue.move_name(
                    V,
                    "candidate",
                    ids[-1],
                    user=str(worker),
                    reason="r",
                    expected=history[-1].version if history else None,
                )
                won += 1
            except NameMovedError:
                pass
    return ids, won


def _processes() -> multiprocessing.context.ForkServerContext:
    """Processes that share nothing but the disk, forked from one that has imported this module."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload([__name__])
    return context


def test_eight_processes_write_at_once_from_the_first_moment(kept_in: str, tmp_path: Path) -> None:
    """Deferred transactions lose about half of these to 'database is locked', whatever the
    timeout."""
    path = tmp_path / "catalogue.sqlite"
    with ProcessPoolExecutor(8, mp_context=_processes()) as pool:
        outcomes = list(pool.map(_write_many, [path] * 8, range(8)))
    with Catalogue.open(path) as catalogue:
        rows, history = catalogue.versions(V), catalogue.name_history(V, "candidate")
    with closing(by_hand(path)) as raw:
        assert raw.execute("SELECT count(*) FROM vehicle_texts").fetchone() == (1,)
    assert {row.id for row in rows} == {id for ids, _ in outcomes for id in ids}
    assert [row.number for row in rows] == list(range(1, 401))
    # Exactly one winner per step: every move starts where the one before it ended.
    assert len(history) == sum(won for _, won in outcomes)
    assert [event.step for event in history] == list(range(1, len(history) + 1))
    assert [event.previous for event in history] == [
        None,
        *(event.version for event in history[:-1]),
    ]


def _race(path: Path, expected: str, target: str) -> bool:
    with Catalogue.open(path) as catalogue:
        try:
            catalogue.move_name(V, "released", target, user="me", reason="race", expected=expected)
        except NameMovedError:
            return False
        return True


def test_of_eight_that_swap_the_same_name_one_wins(catalogue: Catalogue, tmp_path: Path) -> None:
    current = add_version(catalogue, "start")
    targets = [add_version(catalogue, f"t{k}") for k in range(9)]
    catalogue.move_name(V, "released", current, user="me", reason="r", expected=None)
    path = tmp_path / "catalogue.sqlite"
    with ProcessPoolExecutor(4, mp_context=_processes()) as pool:
        for _ in range(5):
            won = list(
                pool.map(_race, [path] * 8, [current] * 8, [t for t in targets if t != current][:8])
            )
            assert sum(won) == 1
            current = catalogue.version(V, "released").id


_KILLED = """
import os, pathlib, signal, sys
from tests.support.catalogue_samples import *
with Catalogue.open(pathlib.Path(sys.argv[1])) as catalogue:
    number = 0
    while True:
        with catalogue.transaction():
            add_version(catalogue, f"{os.getpid()}/{number}")
            seen = catalogue.name_history(V, "released")
            if number == (sys.argv[2] != "inside"):
                print("inside", flush=True)
            if sys.argv[2] == "inside":
                os.kill(os.getpid(), signal.SIGKILL)
            expected = seen[-1].version if seen else None
            catalogue.move_name(V, "released", h(f"{os.getpid()}/{number}"), user="", reason="r", expected=expected)
        number += 1
"""


@pytest.mark.skipif(os.name == "nt", reason="no SIGKILL")
@pytest.mark.parametrize("when", ["inside", "0.05", "0.11", "0.2"])
def test_a_killed_writer_leaves_whole_transactions_and_no_lock(
    catalogue: Catalogue, tmp_path: Path, when: str
) -> None:
    reading, writing = os.pipe()
    with open(reading, "rb") as said, tempfile.TemporaryFile() as errors:
        with open(writing, "wb") as output:
            given = [str(tmp_path / "catalogue.sqlite"), when]
            process = Forked(given, environment(), output, errors, ROOT, _KILLED)
        with process:
            assert said.readline() == b"inside\n"
            if when != "inside":
                time.sleep(float(when))
                process.kill()
            assert process.wait(300) == -signal.SIGKILL
    before = catalogue.versions(V)
    assert (len(before) == 0) == (when == "inside")
    assert [row.id for row in before] == [event.version for event in catalogue.name_history(V)]
    add_version(catalogue, "after")
    assert len(catalogue.versions(V)) == len(before) + 1
    assert _of_the_database(catalogue) == []
