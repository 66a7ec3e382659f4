"""The catalogue: what is added stays, what is found is what was meant, and concurrent writers never spoil it."""

import multiprocessing
import os
import signal
import sqlite3
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from datetime import UTC, datetime, timedelta
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext
from alembic.script import ScriptDirectory
from sqlalchemy.dialects import postgresql
from sqlalchemy.schema import CreateTable

from aerodb.errors import AeroError, GateRefusal, InputError, UnknownNameError
from aerodb.recording import Damage
from storage import schema
from storage.catalogue import Catalogue
from storage.rows import FlightRole
from storage.versions import NameMovedError

V = "twin-otter"


def h(text: object) -> str:
    return sha256(str(text).encode()).hexdigest()


def add_flight(catalogue: Catalogue, name: str, vehicle: str = V, named: bool = True, id: str = "") -> str:
    log = h(name)
    catalogue.add_log(log, name=f"{name}.ulg", size=10, format="ulog", status="stored")
    values: dict[str, Any] = {"mapping": "px4", "start_utc": None, "duration": 20.0, "samples": 1001, "step": 0.02}
    return catalogue.add_flight(id or log, vehicle=vehicle, log_sha256=log, name=name if named else None, **values).id


def add_version(catalogue: Catalogue, name: str, parent: str | None = None, vehicle: str = V, **more: Any) -> str:
    documents = {"content": f'{{"name":"{name}"}}', "content_sha256": h(name), "settings": {"name": name}, "report": {}}
    return catalogue.add_version(h(name), vehicle=vehicle, parent=parent, **{**documents, **more}).id


@pytest.fixture
def catalogue(tmp_path: Path) -> Any:
    with Catalogue.open(tmp_path / "catalogue.sqlite") as opened:
        opened.add_vehicle(V, "name = 'twin-otter'")
        yield opened


# What is added comes back


def test_vehicles_keep_every_text(catalogue: Catalogue) -> None:
    first = catalogue.vehicle(V)
    catalogue.add_vehicle(V, "new text")
    catalogue.add_vehicle(V, "new text")
    assert [row.text for row in catalogue.vehicle_history(V)] == ["name = 'twin-otter'", "new text"]
    assert catalogue.vehicle(V).sha256 == h("new text")
    assert catalogue.vehicle(V, first.sha256) == first
    assert [row.name for row in catalogue.vehicles()] == [V]
    with pytest.raises(UnknownNameError, match="did you mean 'twin-otter'"):
        catalogue.vehicle("twinotter")


def test_logs_are_added_once_and_only_quarantine_is_left_again(catalogue: Catalogue) -> None:
    damage = (Damage("lost_tail", "7 bytes \ud800", bytes_lost=7),)
    assert catalogue.add_log(
        h(1), name="\ud800';--", size=2**40, format="ulog", status="quarantined", reason="no topic", damage=damage
    )
    log = catalogue.log(h(1))
    assert log is not None
    assert (log.name, log.size, log.reason, log.damage[0].bytes_lost) == ("\\ud800';--", 2**40, "no topic", 7)
    assert not catalogue.add_log(h(1), name="other", size=1, format="ulog", status="damaged", damage=damage)
    assert [(row.status, row.name) for row in catalogue.logs()] == [("damaged", "\\ud800';--")]
    catalogue.add_log(h(1), name="other", size=1, format="ulog", status="quarantined")
    assert catalogue.logs("quarantined") == ()
    assert catalogue.log(h(2)) is None


def test_a_flight_with_verdict_and_retraction(catalogue: Catalogue) -> None:
    id = add_flight(catalogue, "f1")
    assert (catalogue.flight("f1").verdict, catalogue.flight("f1").duration) == ("unchecked", 20.0)
    catalogue.judge_flight(id, "limited", ["alpha: bias 0.7 deg"])
    catalogue.judge_flight(id, "limited", ["alpha: bias 0.7 deg"])
    catalogue.judge_flight(id, "good")
    assert (catalogue.flight(id).verdict, catalogue.flight(id).reasons) == ("good", ())
    first = catalogue.retract_flight(id, "pitot blocked")
    again = catalogue.retract_flight(id, "another reason")
    assert (again.retract_reason, again.retracted_utc) == ("pitot blocked", first.retracted_utc)
    with pytest.raises(InputError, match="needs a reason"):
        catalogue.retract_flight(id, "  ")
    with pytest.raises(UnknownNameError):
        catalogue.retract_flight("nobody", "x")


def test_the_same_flight_again_changes_nothing_and_a_better_mapping_adds_a_record(catalogue: Catalogue, tmp_path: Path) -> None:
    id = add_flight(catalogue, "f1")
    assert add_flight(catalogue, "f1") == id
    assert add_flight(catalogue, "f1", named=False) == id
    start = datetime(2026, 5, 1, 12, tzinfo=UTC)
    values: dict[str, Any] = {"mapping": "px4 + rudder", "start_utc": start, "duration": 1.0, "samples": 51, "step": 0.02}
    row = catalogue.add_flight(id, vehicle=V, log_sha256=id, **values)
    assert (row.mapping, row.samples, row.start_utc, row.name) == ("px4 + rudder", 51, start, "f1")
    with sqlite3.connect(tmp_path / "catalogue.sqlite") as raw:
        assert raw.execute("SELECT (SELECT count(*) FROM flights), (SELECT count(*) FROM flight_records)").fetchone() == (1, 2)
    raw.close()


def test_a_flight_that_contradicts_a_stored_one_is_refused(catalogue: Catalogue) -> None:
    add_flight(catalogue, "f1")
    catalogue.add_vehicle("other", "")
    with pytest.raises(InputError, match="already stored for vehicle 'twin-otter' as 'f1'"):
        add_flight(catalogue, "f1", vehicle="other")
    catalogue.add_log(h("z"), name="z", size=1, format="ulog", status="stored")
    values: dict[str, Any] = {"mapping": "", "start_utc": None, "duration": 1.0, "samples": 2, "step": 1.0}
    with pytest.raises(InputError, match="already has a flight named 'f1'"):
        catalogue.add_flight(h("z"), vehicle=V, log_sha256=h("z"), name="f1", **values)
    with pytest.raises(InputError, match="log is not stored"):
        catalogue.add_flight(h("y"), vehicle=V, log_sha256=h("y"), **values)
    assert [row.name for row in catalogue.flights()] == ["f1"]


def test_results_are_added_once_with_their_inputs_and_runs(catalogue: Catalogue) -> None:
    flight = add_flight(catalogue, "f1")
    run = catalogue.start_run("flight", how="direct", parameters={"log": "a.ulg"})
    values: dict[str, Any] = {"step": "coefficients", "kind": "table", "path": "results/ab/x.parquet", "result_version": 1}
    more = {"flight": flight, "settings": {"bandwidth": 4.0}, "inputs": [h("in2"), h("in1")], "run": run.id}
    assert catalogue.add_result(h("r"), **values, **more)
    assert not catalogue.add_result(h("r"), **{**values, "path": "elsewhere"}, run=catalogue.start_run("flight", how="direct").id)
    row = catalogue.result(h("r"))
    assert row is not None
    assert (row.path, row.settings, row.inputs) == ("results/ab/x.parquet", {"bandwidth": 4}, tuple(sorted([h("in1"), h("in2")])))
    assert catalogue.results_of(flight) == catalogue.results_of(flight, "coefficients") == (row,)
    assert catalogue.results_of(flight, "compare") == ()
    assert catalogue.result(h("nothing")) is None
    for path in ("/etc/passwd", "../x", "a/../../b", "", "a\\b", "a\nb"):
        with pytest.raises(InputError, match="inside the workspace"):
            catalogue.add_result(h(path), **{**values, "path": path})


def test_a_run_ends_once(catalogue: Catalogue) -> None:
    run = catalogue.start_run("nightly", how="server", id="b9c0a4c2-0000-4000-8000-000000000000")
    assert catalogue.start_run("nightly", how="server", id=run.id) == run
    assert catalogue.runs("running") == (run,)
    ended = catalogue.end_run(run.id, "crashed", "killed")
    assert catalogue.end_run(run.id, "completed") == ended
    assert (ended.state, ended.error, catalogue.runs("running")) == ("crashed", "killed", ())
    with pytest.raises(UnknownNameError):
        catalogue.end_run("nobody", "completed")


# References


def test_a_version_is_found_by_id_prefix_label_and_name(catalogue: Catalogue) -> None:
    a, b = add_version(catalogue, "a"), add_version(catalogue, "b", h("a"))
    assert add_version(catalogue, "b", h("a")) == b
    catalogue.move_name(V, "released", a, user="me", reason="first", expected=None)
    for ref in (a, a[:12], "v0001", "v1", "released"):
        assert catalogue.version(V, ref).id == a, ref
    assert [row.label for row in catalogue.versions(V)] == ["v0001", "v0002"]
    assert catalogue.version_documents(b).content == '{"name":"b"}'
    with pytest.raises(UnknownNameError, match="did you mean 'released'"):
        catalogue.version(V, "relaesed")
    with pytest.raises(UnknownNameError, match="no version 'v0003'"):
        catalogue.version(V, "v0003")


def test_labels_count_per_vehicle(catalogue: Catalogue) -> None:
    catalogue.add_vehicle("other", "")
    add_version(catalogue, "a")
    assert catalogue.version("other", add_version(catalogue, "x", vehicle="other")).label == "v0001"
    with pytest.raises(UnknownNameError):
        catalogue.version("other", h("a"))
    with pytest.raises(UnknownNameError, match="no version with id"):
        add_version(catalogue, "y", parent=h("a"), vehicle="other")


def test_an_ambiguous_prefix_says_how_to_go_on(catalogue: Catalogue) -> None:
    for end in ("aa", "ab"):
        add_flight(catalogue, end, named=False, id="c0ffee" + end)
    with pytest.raises(UnknownNameError, match=r"(?s)not unique.*give more digits: c0ffeeaa\.\.\., c0ffeeab"):
        catalogue.flight("c0ff")
    assert catalogue.flight("c0ffeeaa").id == "c0ffeeaa"
    with pytest.raises(UnknownNameError, match="no flight 'c0'"):
        catalogue.flight("c0")


def test_a_flight_name_of_two_vehicles_needs_the_vehicle(catalogue: Catalogue) -> None:
    catalogue.add_vehicle("other", "")
    mine, theirs = add_flight(catalogue, "f1", id="id-1"), add_flight(catalogue, "f1", vehicle="other", id="id-2")
    assert (catalogue.flight("f1", V).id, catalogue.flight("f1", "other").id) == (mine, theirs)
    with pytest.raises(UnknownNameError, match="several vehicles"):
        catalogue.flight("f1")
    assert [row.id for row in catalogue.flights("other")] == [theirs]


HOSTILE = ["", "../../x", "'; DROP TABLE flights;--", "%", "_", "\ud800", "\0", "ä", "a\n", "x" * 100_000, "v" + "9" * 400, "a b"]


@pytest.mark.parametrize("name", HOSTILE, ids=range(len(HOSTILE)))
def test_hostile_names_are_refused_and_harmless(catalogue: Catalogue, name: str) -> None:
    flight, version = add_flight(catalogue, "f1"), add_version(catalogue, "a")
    for ask in (catalogue.vehicle, catalogue.flight, lambda ref: catalogue.version(V, ref)):
        with pytest.raises(UnknownNameError) as error:
            ask(name)
        assert len(str(error.value)) < 400
    with pytest.raises(InputError):
        catalogue.add_vehicle(name, "text")
    with pytest.raises(InputError):
        catalogue.move_name(V, name, version, user="me", reason="r", expected=None)
    with pytest.raises(InputError):
        add_flight(catalogue, "new", id=name or " ")
    with pytest.raises(InputError):
        catalogue.add_result(name, step="s", kind="k", path="p", result_version=1)
    catalogue.retract_flight(flight, f"because {name}")
    catalogue.move_name(V, "released", version, user=name, reason=f"because {name}", expected=None)
    assert len(catalogue.flights()) == len(catalogue.versions(V)) == len(catalogue.vehicles()) == 1


def test_a_name_that_looks_like_a_label_is_refused(catalogue: Catalogue) -> None:
    with pytest.raises(InputError, match="cannot be a name for versions"):
        catalogue.move_name(V, "v0001", add_version(catalogue, "a"), user="me", reason="r", expected=None)


# Names move by compare and swap, and their history can be asked


def test_a_name_moves_only_from_where_it_stands(catalogue: Catalogue) -> None:
    a, b = add_version(catalogue, "a"), add_version(catalogue, "b", h("a"))
    before = datetime.now(UTC)
    first = catalogue.move_name(V, "released", a, user="me", reason="import", expected=None)
    second = catalogue.move_name(V, "released", b, user="me", reason="proved", expected=a)
    for expected in (None, a):
        with pytest.raises(NameMovedError, match="was moved meanwhile") as error:
            catalogue.move_name(V, "released", a, user="me", reason="late", expected=expected)
        assert isinstance(error.value, GateRefusal)
    assert catalogue.move_name(V, "released", b, user="me", reason="once more", expected=b) == second
    assert catalogue.name_history(V) == catalogue.name_history(V, "released") == (first, second)
    assert (second.previous, catalogue.version(V, "released").id) == (a, b)
    assert catalogue.version(V, "released", as_of=first.at_utc).id == a
    assert catalogue.version(V, "released", as_of=datetime.now(UTC) + timedelta(days=1)).id == b
    with pytest.raises(UnknownNameError, match="as of"):
        catalogue.version(V, "released", as_of=before - timedelta(seconds=1))
    with pytest.raises(InputError, match="has no zone"):
        catalogue.version(V, "released", as_of=datetime(2026, 1, 1))


def test_a_clock_set_back_does_not_reorder_the_history(catalogue: Catalogue, monkeypatch: pytest.MonkeyPatch) -> None:
    a, b = add_version(catalogue, "a"), add_version(catalogue, "b")
    first = catalogue.move_name(V, "released", a, user="me", reason="r", expected=None)
    monkeypatch.setattr("storage.encoding.now", lambda: datetime(2001, 1, 1, tzinfo=UTC))
    assert catalogue.move_name(V, "released", b, user="me", reason="r", expected=a).at_utc == first.at_utc


# What rests on what: a(f1 identifies, f2 held out) <- b(f3) <- c;  a <- d(f4 excluded)


@pytest.fixture
def family(catalogue: Catalogue) -> Catalogue:
    for name in ("f1", "f2", "f3", "f4"):
        add_flight(catalogue, name)
    run = catalogue.start_run("update", how="direct")
    add_version(catalogue, "base")
    roles = [FlightRole(h("f1"), "identified"), FlightRole(h("f2"), "held_out"), FlightRole(h("f4"), "excluded", "rejected")]
    add_version(catalogue, "a", h("base"), flights=roles, inputs=[h("in")], run=run.id)
    add_version(catalogue, "b", h("a"), flights=[FlightRole(h("f3"), "identified"), FlightRole(h("f2"), "held_out")])
    add_version(catalogue, "c", h("b"))
    add_version(catalogue, "d", h("a"), flights=[FlightRole(h("f4"), "excluded")])
    return catalogue


def test_lineage_of_a_version(family: Catalogue) -> None:
    lineage = family.lineage(h("c"))
    assert [row.id for row in lineage.line] == [h(name) for name in ("c", "b", "a", "base")]
    assert lineage.version == lineage.line[0]
    assert lineage.roles == family.roles_in_line(h("c"))
    assert lineage.roles == {h("f1"): "identified", h("f2"): "held_out", h("f3"): "identified", h("f4"): "excluded"}
    assert lineage.logs == {flight: flight for flight in lineage.roles}
    assert lineage.inputs == {h("a"): (h("in"),)}
    assert [run.flow for run in lineage.runs] == ["update"]
    assert family.roles_in_line(None) == family.roles_in_line(h("base")) == {}
    assert family.version_flights(h("d")) == (FlightRole(h("f4"), "excluded"),)


def test_impact_of_a_flight(family: Catalogue) -> None:
    def names(flight: str) -> list[tuple[str, str]]:
        known = {h(name): name for name in ("base", "a", "b", "c", "d")}
        return [(known[i.version.id], f"{i.role} by {known[i.through]}") for i in family.impact(h(flight))]

    by_a = "identified by a"
    assert names("f1") == [("a", by_a), ("b", by_a), ("c", by_a), ("d", by_a)]
    assert names("f3") == [("b", "identified by b"), ("c", "identified by b")]
    assert names("f2")[:2] == [("a", "held_out by a"), ("b", "held_out by b")]
    assert names("f4") == []


def test_a_retracted_flight_makes_exactly_its_versions_stale(family: Catalogue) -> None:
    assert not any(family.stale(row.id) for row in family.versions(V))
    family.retract_flight(h("f4"), "excluded anyway")
    family.retract_flight(h("f3"), "pitot blocked")
    reasons = {row.label: family.stale(row.id) for row in family.versions(V)}
    assert {label for label, why in reasons.items() if why} == {"v0003", "v0004"}
    assert reasons["v0004"][0].startswith("flight f3 (identified) was retracted on ")
    assert reasons["v0004"][0].endswith(": pitot blocked")


def test_a_flight_keeps_its_role_along_a_line(family: Catalogue) -> None:
    for flight, role in (("f1", "held_out"), ("f2", "identified")):
        with pytest.raises(InputError, match="keeps its role along a line"):
            add_version(family, "e", h("c"), flights=[FlightRole(h(flight), role)])
    add_version(family, "e", h("base"), flights=[FlightRole(h("f1"), "held_out"), FlightRole(h("f4"), "identified")])
    assert family.roles_in_line(h("e")) == {h("f1"): "held_out", h("f4"): "identified"}
    with pytest.raises(InputError, match="no flight with id"):
        add_version(family, "g", flights=[FlightRole(h("f9"), "identified")])


# Immutable, whoever opens the file


def test_nothing_is_changed_or_deleted_even_by_hand(family: Catalogue, tmp_path: Path) -> None:
    family.move_name(V, "released", h("a"), user="me", reason="r", expected=None)
    run = family.start_run("update", how="direct")
    family.judge_flight(h("f1"), "good")
    family.add_result(h("r"), step="s", kind="k", path="p", result_version=1, inputs=[h("in")], run=run.id)
    family.end_run(run.id, "completed")
    family.close()
    raw = sqlite3.connect(tmp_path / "catalogue.sqlite")
    for name, table in schema.metadata.tables.items():
        rows = raw.execute(f"SELECT * FROM {name} ORDER BY 1").fetchall()
        assert rows, name
        column = list(table.columns)[-1].name
        attacks = [f"DELETE FROM {name}", f"INSERT OR REPLACE INTO {name} SELECT * FROM {name} LIMIT 1"]
        attacks.append(f"UPDATE {name} SET {column} = 'x' WHERE rowid = (SELECT max(rowid) FROM {name})")
        for attack in attacks:
            with pytest.raises(sqlite3.IntegrityError, match="never changed or deleted"):
                raw.execute(attack)
        assert raw.execute(f"SELECT * FROM {name} ORDER BY 1").fetchall() == rows
    # A new id on a label that is taken would delete the old version.
    with pytest.raises(sqlite3.IntegrityError, match="never changed or deleted"):
        raw.execute(
            "INSERT OR REPLACE INTO versions (id, vehicle, number, content, content_sha256, settings, report, created_utc)"
            f" VALUES ('new', '{V}', 1, '', '', '', '', '')"
        )
    raw.close()


def test_strict_types_and_edges_are_checked_by_the_database(catalogue: Catalogue, tmp_path: Path) -> None:
    with pytest.raises(sa.exc.IntegrityError), catalogue._database.writing() as connection:
        connection.execute(sa.insert(schema.result_inputs).values(key=h("no such result"), input_key=h(1)))
    raw = sqlite3.connect(tmp_path / "catalogue.sqlite")
    with pytest.raises(sqlite3.IntegrityError, match="cannot store TEXT value in INTEGER column"):
        raw.execute("INSERT INTO log_files VALUES ('a', 'a', 'not a number', '', 'stored', '', '[]', '')")
    assert raw.execute(
        "SELECT count(*) FROM pragma_table_list WHERE strict = 0 AND name IN ('versions', 'results')"
    ).fetchone() == (0,)
    raw.close()


# Schema and opening


def test_migrations_lead_to_the_declared_schema(catalogue: Catalogue, tmp_path: Path) -> None:
    config = Config()
    config.set_main_option("script_location", "storage:migrations")
    assert ScriptDirectory.from_config(config).get_heads() == [schema.HEAD]
    engine = sa.create_engine(f"sqlite:///{tmp_path / 'catalogue.sqlite'}")
    with engine.connect() as connection:
        assert compare_metadata(MigrationContext.configure(connection), schema.metadata) == []
        guarded = connection.scalars(
            sa.text("SELECT tbl_name FROM sqlite_master WHERE type = 'trigger' GROUP BY 1 HAVING count(*) = 3")
        )
        assert set(guarded) == set(schema.metadata.tables)
        for name, table in schema.metadata.tables.items():
            stored = connection.execute(sa.text("SELECT sql FROM sqlite_master WHERE name = :n"), {"n": name}).scalar_one()
            assert stored.rstrip().endswith("STRICT"), name
            assert "STRICT" not in str(CreateTable(table).compile(dialect=postgresql.dialect()))
    engine.dispose()


def test_a_query_on_a_current_catalogue_imports_neither_alembic_nor_pyarrow(catalogue: Catalogue, tmp_path: Path) -> None:
    code = (
        "import sys, pathlib; from storage.catalogue import Catalogue\n"
        "with Catalogue.open(pathlib.Path(sys.argv[1]), create=False) as c: print(c.vehicles()[0].name)\n"
        "print({'alembic', 'pyarrow', 'pandas', 'scipy', 'prefect'} & set(sys.modules))"
    )
    run = [sys.executable, "-c", code, str(tmp_path / "catalogue.sqlite")]
    shown = subprocess.run(run, check=True, capture_output=True, text=True, timeout=60, cwd=Path(__file__).parents[1]).stdout
    assert shown.split("\n")[:2] == [V, "set()"]


def test_what_is_no_catalogue_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no catalogue here"):
        Catalogue.open(tmp_path / "absent.sqlite", create=False)
    with pytest.raises(InputError, match="folder does not exist"):
        Catalogue.open(tmp_path / "absent" / "catalogue.sqlite")
    (tmp_path / "text.sqlite").write_text("these are not the bytes of a database " * 100)
    with pytest.raises(InputError, match="not a usable catalogue"):
        Catalogue.open(tmp_path / "text.sqlite")
    Catalogue.open(tmp_path / "newer.sqlite").close()
    with sqlite3.connect(tmp_path / "newer.sqlite") as raw:
        raw.execute("UPDATE alembic_version SET version_num = 'r9999'")
    raw.close()
    with pytest.raises(InputError, match="of a newer kind"):
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
    """50 read-then-write transactions: a version each, then one attempt to move the name on from what was seen."""
    ids, won = [], 0
    with Catalogue.open(path) as catalogue:
        catalogue.add_vehicle(V, "the same text")
        for k in range(50):
            ids.append(add_version(catalogue, f"{worker}/{k}"))
            history = catalogue.name_history(V, "candidate")
            try:
                catalogue.move_name(
                    V, "candidate", ids[-1], user=str(worker), reason="r", expected=history[-1].version if history else None
                )
                won += 1
            except NameMovedError:
                pass
    return ids, won


def test_eight_processes_write_at_once_from_the_first_moment(tmp_path: Path) -> None:
    """Deferred transactions lose about half of these to 'database is locked', whatever the timeout."""
    path = tmp_path / "catalogue.sqlite"
    with ProcessPoolExecutor(8, mp_context=multiprocessing.get_context("spawn")) as pool:
        outcomes = list(pool.map(_write_many, [path] * 8, range(8)))
    with Catalogue.open(path) as catalogue:
        rows, history = catalogue.versions(V), catalogue.name_history(V, "candidate")
        assert len(catalogue.vehicle_history(V)) == 1
    assert {row.id for row in rows} == {id for ids, _ in outcomes for id in ids}
    assert [row.number for row in rows] == list(range(1, 401))
    # Exactly one winner per step: every move starts where the one before it ended.
    assert len(history) == sum(won for _, won in outcomes)
    assert [event.step for event in history] == list(range(1, len(history) + 1))
    assert [event.previous for event in history] == [None, *(event.version for event in history[:-1])]


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
    with ProcessPoolExecutor(4, mp_context=multiprocessing.get_context("spawn")) as pool:
        for _ in range(5):
            won = list(pool.map(_race, [path] * 8, [current] * 8, [t for t in targets if t != current][:8]))
            assert sum(won) == 1
            current = catalogue.version(V, "released").id


_KILLED = """
import os, pathlib, signal, sys
sys.path.insert(0, sys.argv[2])
from test_catalogue import *
with Catalogue.open(pathlib.Path(sys.argv[1])) as catalogue:
    number = 0
    while True:
        with catalogue.transaction():
            add_version(catalogue, f"{os.getpid()}/{number}")
            seen = catalogue.name_history(V, "released")
            if number == 0:
                print("inside", flush=True)
            if sys.argv[3] == "inside":
                os.kill(os.getpid(), signal.SIGKILL)
            expected = seen[-1].version if seen else None
            catalogue.move_name(V, "released", h(f"{os.getpid()}/{number}"), user="", reason="r", expected=expected)
        number += 1
"""


@pytest.mark.skipif(os.name == "nt", reason="no SIGKILL")
@pytest.mark.parametrize("when", ["inside", "0.05", "0.11", "0.2"])
def test_a_killed_writer_leaves_whole_transactions_and_no_lock(catalogue: Catalogue, tmp_path: Path, when: str) -> None:
    run = [sys.executable, "-c", _KILLED, str(tmp_path / "catalogue.sqlite"), str(Path(__file__).parent), when]
    process = subprocess.Popen(run, stdout=subprocess.PIPE, cwd=Path(__file__).parents[1])
    assert process.stdout is not None
    assert process.stdout.readline() == b"inside\n"
    if when != "inside":
        time.sleep(float(when))
        process.kill()
    assert process.wait(60) == -signal.SIGKILL
    process.stdout.close()
    before = catalogue.versions(V)
    assert (len(before) == 0) == (when == "inside")
    assert [row.id for row in before] == [event.version for event in catalogue.name_history(V)]
    add_version(catalogue, "after")
    assert len(catalogue.versions(V)) == len(before) + 1
    raw = sqlite3.connect(tmp_path / "catalogue.sqlite")
    assert raw.execute("PRAGMA integrity_check").fetchone() == ("ok",)
    assert raw.execute("PRAGMA foreign_key_check").fetchall() == []
    raw.close()
