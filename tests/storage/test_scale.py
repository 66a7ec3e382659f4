"""The cost of a query grows with its answer, not with the catalogue: the same family of versions
in a small and in a large catalogue costs the same work, counted in steps of SQLite's virtual
machine and in rows, never in time."""

import re
import sqlite3
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.rows import FlightRole
from aerodb.storage.catalogue.schema import HEAD
from aerodb.storage.catalogue.seal import seal_of
from aerodb.tasks.view.lineage_documents import compare_versions, prov_of, rebuilds
from tests.support.catalogue_samples import V, add_flight, add_version, h
from tests.tasks.test_promotion import provable

#: Versions and flights beside the family that is asked for.
SIZES = {"small": (60, 180), "large": (6_000, 18_000)}
_AT = "2026-01-01T00:00:00.000000Z"


def crowd(path: Path, versions: int, flights: int) -> None:
    """Rows as the catalogue itself would have written them: lines of ten versions, each resting on
    three flights of its own, and a move of a name to each version. Written in one go: through the
    catalogue it would take minutes."""
    raw = sqlite3.connect(path)
    raw.execute("PRAGMA synchronous = OFF")
    names = [f"crowd-{k}" for k in range(flights)]
    ids = [h(name) for name in names]
    raw.executemany(
        "INSERT INTO log_files VALUES (?, ?, 10, 'ulog', 'stored', '', '[]', ?)",
        [(i, i, _AT) for i in ids],
    )
    raw.executemany(
        "INSERT INTO flights VALUES (?, ?, ?, ?, ?)",
        [(i, V, n, i, _AT) for i, n in zip(ids, names, strict=True)],
    )
    record = (
        "INSERT INTO flight_records (flight, mapping, start_utc, duration, samples, step,"
        " added_utc)"
    )
    raw.executemany(
        f"{record} VALUES (?, 'px4', NULL, 20.0, 1001, 0.02, ?)", [(i, _AT) for i in ids]
    )
    event = "INSERT INTO flight_events (flight, kind, verdict, reasons, at_utc)"
    raw.executemany(f"{event} VALUES (?, 'verdict', 'good', '[]', ?)", [(i, _AT) for i in ids])
    keys = [h(f"version-{k}") for k in range(versions)]
    rows = [
        (
            key,
            V,
            k + 1,
            keys[k - 1] if k % 10 else None,
            "{}" + " " * 500,
            h(k),
            "{}",
            "{}",
            None,
            _AT,
        )
        for k, key in enumerate(keys)
    ]
    raw.executemany("INSERT INTO versions VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)", rows)
    per = flights // versions
    uses = [(keys[k // per], i, "identified", "") for k, i in enumerate(ids)]
    raw.executemany("INSERT INTO version_flights VALUES (?, ?, ?, ?)", uses)
    moves = [
        (V, "crowd", k + 1, key, keys[k - 1] if k else None, _AT, "me", "r")
        for k, key in enumerate(keys)
    ]
    columns = "vehicle, name, step, version, previous, at_utc, user, reason"
    raw.executemany(f"INSERT INTO name_events ({columns}) VALUES (?, ?, ?, ?, ?, ?, ?, ?)", moves)
    raw.commit()
    raw.close()
    seal_of(path).unlink()  # the change is ours


def family(catalogue: Catalogue) -> None:
    """base <- one <- two <- three, each on five flights; `released` at one of them."""
    parent = provable(catalogue, "base", None)
    catalogue.move_name(V, "released", parent, user="me", reason="r", expected=None)
    for name in ("one", "two", "three"):
        uses = [FlightRole(add_flight(catalogue, f"{name}-{k}"), "identified") for k in range(5)]
        parent = provable(catalogue, name, parent)
        with catalogue._database.writing() as connection:
            values = [
                {"version": parent, "flight": use.flight, "role": use.role, "reason": ""}
                for use in uses
            ]
            connection.execute(
                sa.text("INSERT INTO version_flights VALUES (:version, :flight, :role, :reason)"),
                values,
            )


@pytest.fixture(scope="module")
def catalogues(tmp_path_factory: pytest.TempPathFactory) -> Iterator[dict[str, Catalogue]]:
    folder, opened = tmp_path_factory.mktemp("scale"), {}
    for size, (versions, flights) in SIZES.items():
        path = folder / f"{size}.sqlite"
        with Catalogue.open(path) as catalogue:
            catalogue.add_vehicle(V, "text")
        crowd(path, versions, flights)
        opened[size] = Catalogue.open(path)
        family(opened[size])
    yield opened
    for catalogue in opened.values():
        catalogue.close()


class Work:
    """What queries cost: steps of SQLite's machine (in tens), rows handed over, and the statements
    themselves."""

    def __init__(self) -> None:
        self.steps = 0
        self.statements: list[tuple[str, Any]] = []


@contextmanager
def counted(catalogue: Catalogue) -> Iterator[Work]:
    """Counts while it lasts, on every connection of `catalogue`."""
    work, engine = Work(), catalogue._database._readers

    def tick() -> int:
        work.steps += 1
        return 0

    def before(connection: Any, _cursor: Any, statement: str, parameters: Any, *_: Any) -> None:
        connection.connection.dbapi_connection.set_progress_handler(tick, 10)
        work.statements.append((statement, parameters))

    def after(connection: Any, *_: Any) -> None:
        connection.connection.dbapi_connection.set_progress_handler(None, 0)

    sa.event.listen(engine, "before_cursor_execute", before)
    sa.event.listen(engine, "commit", after)
    try:
        yield work
    finally:
        sa.event.remove(engine, "before_cursor_execute", before)
        sa.event.remove(engine, "commit", after)


QUERIES: dict[str, Callable[[Catalogue], Any]] = {
    "list": lambda c: c.versions(V, 50),
    "count": lambda c: c.count_versions(V),
    "names": lambda c: c.names(V),
    "history": lambda c: c.name_history(V, limit=50),
    "history of a name": lambda c: c.name_history(V, "released"),
    "version by name": lambda c: c.version(V, "released"),
    "version by label": lambda c: c.version(V, f"v{c.count_versions(V):04d}"),
    "version by id": lambda c: c.version(V, h("two")),
    "version by prefix": lambda c: c.version(V, h("two")[:12]),
    "load": lambda c: c.version_documents(h("three")),
    "flight by name": lambda c: c.flight("two-3"),
    "flight by name of a vehicle": lambda c: c.flight("two-3", V),
    "flight by prefix": lambda c: c.flight(h("two-3")[:12]),
    "lineage": lambda c: c.lineage(h("three")),
    "stale": lambda c: c.stale(h("three")),
    "impact": lambda c: c.impact(h("one-2")),
    "rebuild": lambda c: rebuilds(c, c.impact(h("one-2"))),
    "steps": lambda c: c.steps_behind(h("three")),
    "roles": lambda c: c.roles_in_line(h("three")),
    "prov": lambda c: prov_of(c, c.version_of_id(h("three"))),
    "diff": lambda c: compare_versions(c, c.version_of_id(h("one")), c.version_of_id(h("three"))),
}


#: In these catalogues; all others have something to find.
FIND_NOTHING = {"stale", "steps"}


@pytest.mark.parametrize("query", QUERIES)
def test_a_query_does_the_same_work_in_a_catalogue_a_hundred_times_larger(
    catalogues: dict[str, Catalogue], query: str
) -> None:
    cost = {}
    for size, catalogue in catalogues.items():
        with counted(catalogue) as work:
            found = QUERIES[query](catalogue)
        assert bool(found) == (query not in FIND_NOTHING)
        cost[size] = work
    assert len(cost["large"].statements) == len(cost["small"].statements)
    assert cost["large"].steps <= 1.2 * cost["small"].steps + 5, (
        cost["small"].steps,
        cost["large"].steps,
    )
    _no_scans(catalogues["large"], cost["large"])


def _no_scans(catalogue: Catalogue, work: Work) -> None:
    """No statement reads a whole table: what is scanned is only what the statement itself has put
    together."""
    with catalogue._database.reading() as connection:
        for statement, parameters in work.statements:
            if not statement.lstrip().startswith(("SELECT", "WITH")):
                continue
            plan = connection.exec_driver_sql(f"EXPLAIN QUERY PLAN {statement}", parameters).all()
            for row in plan:
                scanned = re.match(r"SCAN (\w+)", row[3])
                tables = {
                    "versions",
                    "flights",
                    "flight_records",
                    "flight_events",
                    "version_flights",
                    "name_events",
                    "log_files",
                }
                assert scanned is None or scanned[1] not in tables or "VIRTUAL" in row[3], (
                    statement,
                    row[3],
                )


def test_the_counting_sees_a_query_that_grows(catalogues: dict[str, Catalogue]) -> None:
    steps = {}
    for size, catalogue in catalogues.items():
        with counted(catalogue) as work:
            catalogue.versions(V)
        steps[size] = work.steps
    assert steps["large"] > 20 * steps["small"]


def test_a_list_reads_headers_from_an_index_and_no_document(
    catalogues: dict[str, Catalogue],
) -> None:
    with counted(catalogues["large"]) as work:
        rows = catalogues["large"].versions(V, 50)
    assert len(rows) == 50
    assert [row.number for row in rows] == list(range(rows[-1].number - 49, rows[-1].number + 1))
    plans = []
    with catalogues["large"]._database.reading() as connection:
        for statement, parameters in work.statements:
            if "FROM versions" in statement:
                assert "versions.content," not in statement
                plans += [
                    r[3]
                    for r in connection.exec_driver_sql(
                        f"EXPLAIN QUERY PLAN {statement}", parameters
                    ).all()
                ]
    assert plans == ["SEARCH versions USING COVERING INDEX ix_versions_header (vehicle=?)"]


def test_a_version_is_loaded_by_its_own_row_alone(catalogues: dict[str, Catalogue]) -> None:
    with counted(catalogues["large"]) as work:
        documents = catalogues["large"].version_documents(h("three"))
    assert documents.report["check_cases"]
    assert (
        len([statement for statement, _ in work.statements if statement.startswith("SELECT")]) == 1
    )
    assert work.steps <= 10


def test_a_catalogue_of_the_first_kind_is_brought_up_and_keeps_every_row(tmp_path: Path) -> None:
    """r0001 had no index for lists; its rows stay what they were, and its triggers stay too."""
    path = tmp_path / "old.sqlite"
    with Catalogue.open(path) as catalogue:
        catalogue.add_vehicle(V, "text")
        add_version(catalogue, "a")
    raw = sqlite3.connect(path)
    for index in ("ix_versions_header", "ix_name_events_order", "ix_name_events_version"):
        raw.execute(f"DROP INDEX {index}")
    for table in (
        "flight_fingerprints",
        "flight_repeats",
        "calibrations",
        "flight_calibrations",
        "verdict_remarks",
        "stored_files",
        "inbox_events",
        "user_events",
        "version_notes",
        "run_dismissals",
        "chain",
        "row_links",
    ):
        raw.execute(f"DROP TABLE {table}")
    raw.execute('ALTER TABLE flight_events DROP COLUMN "user"')
    raw.execute("DROP INDEX ix_flights_newest")
    raw.execute("DROP INDEX ix_runs_flow")
    raw.execute("DROP INDEX ix_runs_started_utc")
    raw.execute("UPDATE alembic_version SET version_num = 'r0001'")
    raw.commit()
    before = raw.execute("SELECT * FROM versions").fetchall()
    raw.close()
    seal_of(path).unlink()  # the change is ours
    with Catalogue.open(path) as catalogue:
        assert [row.label for row in catalogue.versions(V, 50)] == ["v0001"]
    raw = sqlite3.connect(path)
    assert raw.execute("SELECT version_num FROM alembic_version").fetchone() == (HEAD,)
    assert raw.execute("SELECT * FROM versions").fetchall() == before
    with pytest.raises(sqlite3.IntegrityError, match="never changed or deleted"):
        raw.execute("DELETE FROM versions")
    raw.close()
