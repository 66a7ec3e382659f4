"""The chain of events: whatever is changed, deleted, added or put in another order by hand is found,
and named; concurrent writers make one chain; events of older catalogues are linked."""

import math
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest
import sqlalchemy as sa

from aerodb.remarks import said
from aerodb.storage.catalogue import schema
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.chain import CHAINED, broken_links, has_link, link_of, newest_link
from aerodb.storage.catalogue.copying import copy_catalogue
from aerodb.storage.catalogue.database import migrate
from aerodb.storage.catalogue.rows import InboxEvent, RepeatedStretch, RepeatRow
from tests.support.catalogue_samples import V, add_family, add_flight, h
from tests.support.postgresql import by_hand

WORDS = {
    "flight_events.kind": schema.FLIGHT_EVENTS,
    "flight_events.verdict": schema.VERDICTS,
    "inbox_events.kind": schema.INBOX_KINDS,
    "user_events.kind": ("added", "removed"),
    "user_events.role": schema.USER_ROLES,
    "version_notes.kind": schema.NOTE_KINDS,
}


def filled(catalogue: Catalogue) -> None:
    """Three rows at least in every table of events."""
    add_family(catalogue)
    for text in ("name = 'b'", "name = 'c'"):
        catalogue.add_vehicle(V, text)
    expected = None
    for version in ("base", "a", "b"):
        catalogue.move_name(V, "released", h(version), user="me", reason="r", expected=expected)
        expected = h(version)
    for flight, verdict in (("f1", "good"), ("f2", "limited"), ("f3", "rejected")):
        catalogue.judge_flight(h(flight), verdict, [said("because")])  # type: ignore[arg-type]
        stretch = (RepeatedStretch(1.0, 2.0, 3.0, 4.0, 50, 0.0),)
        catalogue.add_repeat(RepeatRow(h(flight), h("f4"), 0.5, stretch))
        catalogue.add_file(f"results/{flight}.parquet", h(flight), 10)
        event = InboxEvent(f"{V}/{flight}.ulg", V, 10, 5, "stored", h(flight))
        catalogue.add_inbox_events([event])
    catalogue.retract_flight(h("f3"), "pitot cover", user="anna")
    for role in ("read", "release"):
        catalogue.add_user("anna", role, h(role), by="me")  # type: ignore[arg-type]
    catalogue.remove_user("anna", by="me")
    for kind, text in (("comment", "flew well"), ("tag", "good"), ("untag", "good")):
        catalogue.add_note(h("a"), kind, text, user="anna")  # type: ignore[arg-type]
    for run in ("r1", "r2", "r3"):
        catalogue.start_run("update_flow", how="direct", id=run)
        catalogue.end_run(run, "failed", "no disk")
        catalogue.dismiss_run(run, "disk replaced", user="anna")
    with catalogue._database.writing() as connection:
        calibration = {
            "id": "c",
            "vehicle": V,
            "number": 1,
            "content": "{}",
            "created_utc": "now",
            "reason": "first",
        }
        connection.execute(sa.insert(schema.calibrations).values(calibration))
        for flight in ("f1", "f2", "f3"):
            binding = {"flight": h(flight), "calibration": "c", "at_utc": "now"}
            connection.execute(sa.insert(schema.flight_calibrations).values(binding))


@pytest.fixture
def path(kept_in: str, tmp_path: Path) -> Path:
    """A catalogue with three rows in every table of events."""
    with Catalogue.open(tmp_path / "catalogue.sqlite") as catalogue:
        catalogue.add_vehicle(V, "name = 'a'")
        filled(catalogue)
    return tmp_path / "catalogue.sqlite"


@contextmanager
def tampering(path: Path, kept_in: str) -> Iterator[sa.Connection]:
    """A connection of somebody who takes triggers and foreign keys away first."""
    raw = by_hand(path)
    dialect = "sqlite" if kept_in == "sqlite" else "postgresql+psycopg"
    engine = sa.create_engine(f"{dialect}://", creator=lambda: raw, poolclass=sa.StaticPool)
    with engine.connect() as connection:
        if kept_in == "sqlite":
            named = "SELECT name FROM sqlite_master WHERE type = 'trigger'"
            for (name,) in connection.exec_driver_sql(named).all():
                connection.exec_driver_sql(f"DROP TRIGGER {name}")
        else:
            connection.exec_driver_sql("SET session_replication_role = replica")
        connection.commit()
        yield connection
    raw.close()


def problems(connection: sa.Connection) -> list[tuple[str, str]]:
    return list(broken_links(connection))


def others(table: str, column: sa.Column[Any], value: Any) -> list[Any]:
    """Values that somebody might put in place of one."""
    changed: list[Any] = [None] if column.nullable and value is not None else []
    if words := WORDS.get(f"{table}.{column.name}"):
        return changed + [word for word in words if word != value][:1]
    if isinstance(value, float):
        return [*changed, math.nextafter(value, math.inf), value + 1.0]
    if isinstance(value, int):
        return [*changed, value + 1000]
    return [*changed, f"{value or ''}x"]


def test_a_change_of_any_field_of_any_event_is_found(path: Path, kept_in: str) -> None:
    tried = 0
    with tampering(path, kept_in) as connection:
        assert problems(connection) == []
        for name in (*CHAINED, "chain"):
            table = schema.metadata.tables[name]
            key = next(iter(table.primary_key.columns))
            rows = connection.execute(sa.select(table).order_by(key)).mappings().all()
            assert len(rows) >= 3, name
            for row in rows[:3]:
                for column in table.columns:
                    for value in others(name, column, row[column.name]):
                        change = sa.update(table).where(key == row[key.name])
                        done = connection.execute(change.values({column.name: value}))
                        assert done.rowcount == 1
                        found = problems(connection)
                        assert found, (name, column.name, value)
                        if name != "chain":
                            where = f"table {name}, row {row['sequence']}"
                            assert where in [place for _, place in found], (column.name, found)
                        connection.rollback()
                        tried += 1
    print(f"{tried} changes of a field, all found")
    assert tried > 200


def test_deletion_insertion_and_another_order_are_found(path: Path, kept_in: str) -> None:
    with tampering(path, kept_in) as connection:
        for name in CHAINED:
            table = schema.metadata.tables[name]
            key = table.c.sequence
            rows = connection.execute(sa.select(table).order_by(key)).mappings().all()
            for row in (rows[0], rows[1], rows[-1]):
                where = f"table {name}, row {row['sequence']}"
                connection.execute(sa.delete(table).where(key == row["sequence"]))
                assert problems(connection) == [("the row was deleted", where)]
                c = schema.chain.c
                link = (c.of_table == name) & (c.of_sequence == row["sequence"])
                last = (
                    connection.scalar(sa.select(c.number).where(link)) == newest_link(connection)[0]
                )
                connection.execute(sa.delete(schema.chain).where(link))
                assert bool(problems(connection)) != last  # nothing comes after the last one
                connection.rollback()
            more = {**rows[-1], "sequence": rows[-1]["sequence"] + 1}
            more |= {"step": 99} if "step" in more and name == "name_events" else {}
            connection.execute(sa.insert(table).values(more))
            (found,) = problems(connection)
            assert found[1] == f"table {name}, row {more['sequence']}"
            connection.rollback()
            one, other = rows[0]["sequence"], rows[1]["sequence"]
            for old, new in ((one, -1), (other, one), (-1, other)):
                connection.execute(sa.update(table).where(key == old).values(sequence=new))
            assert {place for _, place in problems(connection)} >= {
                f"table {name}, row {one}",
                f"table {name}, row {other}",
            }
            connection.rollback()
        newest = newest_link(connection)
        c = schema.chain.c
        swapped = sa.case((c.number == 2, -3), else_=-2)
        connection.execute(
            sa.update(schema.chain).where(c.number.in_([2, 3])).values(number=swapped)
        )
        connection.execute(sa.update(schema.chain).where(c.number < 0).values(number=-c.number))
        assert newest_link(connection) == newest
        assert problems(connection)


def test_a_row_that_came_otherwise_never_becomes_a_link(path: Path, kept_in: str) -> None:
    """The next writer does not link what somebody slipped in before."""
    with tampering(path, kept_in) as connection:
        query = sa.select(schema.stored_files).order_by(schema.stored_files.c.sequence.desc())
        row = connection.execute(query.limit(1)).mappings().one()
        forged = {**row, "sequence": row["sequence"] + 1, "sha256": h("forged")}
        connection.execute(sa.insert(schema.stored_files).values(forged))
        if kept_in == "postgresql":
            connection.exec_driver_sql("SELECT nextval('stored_files_sequence_seq')")
        connection.commit()
    with Catalogue.open(path) as catalogue:
        catalogue.add_file("results/more.parquet", h("more"), 10)
        with catalogue._database.reading() as connection:
            ((what, where),) = problems(connection)
    assert (what, where) == (
        "the row was added by other means than aerodb",
        f"table stored_files, row {forged['sequence']}",
    )


def test_a_history_that_was_written_anew_lacks_the_hash_that_was_noted(
    path: Path, kept_in: str
) -> None:
    """Whoever may write everything can also make every link anew: what was noted elsewhere tells."""
    with tampering(path, kept_in) as connection:
        _, noted = newest_link(connection)
        assert has_link(connection, noted)
        forged = sa.update(schema.name_events).where(schema.name_events.c.sequence == 1)
        connection.execute(forged.values(user="somebody else"))
        before = ""
        for link in connection.execute(sa.select(schema.chain).order_by("number")).all():
            table = schema.metadata.tables[link.of_table]
            chosen = sa.select(table).where(table.c.sequence == link.of_sequence)
            before = link_of(before, table.name, connection.execute(chosen).mappings().one())
            again = sa.update(schema.chain).where(schema.chain.c.number == link.number)
            connection.execute(again.values(sha256=before))
        assert problems(connection) == []
        assert not has_link(connection, noted)


def test_concurrent_writers_make_one_chain(path: Path, kept_in: str) -> None:
    def write(writer: int) -> None:
        with Catalogue.open(path) as catalogue:
            for number in range(20):
                catalogue.add_file(f"results/{writer}-{number}.parquet", h(number), number)
                if number % 5 == 0:
                    with suppress(KeyError), catalogue.transaction():
                        catalogue.add_file(f"results/lost-{writer}.parquet", h(0), 1)
                        raise KeyError

    with ThreadPoolExecutor(8) as threads:
        list(threads.map(write, range(8)))
    with Catalogue.open(path) as catalogue, catalogue._database.reading() as connection:
        assert problems(connection) == []
        assert (
            connection.scalar(
                sa.select(sa.func.count()).where(schema.chain.c.of_table == "stored_files")
            )
            == 3 + 8 * 20
        )


def test_events_of_an_older_catalogue_are_linked(path: Path, kept_in: str, tmp_path: Path) -> None:
    with tampering(path, kept_in) as connection:
        connection.exec_driver_sql("DROP TABLE chain")
        connection.exec_driver_sql("DROP TABLE row_links")
        for table in ("user_events", "version_notes", "run_dismissals", "verdict_remarks"):
            connection.exec_driver_sql(f"DROP TABLE {table}")
        connection.exec_driver_sql('ALTER TABLE flight_events DROP COLUMN "user"')
        connection.exec_driver_sql("UPDATE alembic_version SET version_num = 'r0007'")
        connection.commit()
    with Catalogue.open(path) as catalogue:
        assert catalogue.users() == ()
        assert catalogue.flight(h("f3")).retract_reason == "pitot cover"
        add_flight(catalogue, "f9")
        migrate(catalogue._database)
        with catalogue._database.reading() as connection:
            assert problems(connection) == []
            number, _ = newest_link(connection)
            rows = sum(
                connection.scalar(sa.select(sa.func.count()).select_from(schema.metadata.tables[t]))
                or 0
                for t in CHAINED
            )
    assert number == rows > 20


def test_a_copy_has_the_same_chain(path: Path, tmp_path: Path) -> None:
    with Catalogue.open(path) as catalogue, Catalogue.in_file(tmp_path / "copy.sqlite") as copy:
        copy_catalogue(catalogue, copy)
        with (
            catalogue._database.reading() as reading,
            copy._database.reading() as copied,
        ):
            assert newest_link(reading) == newest_link(copied)
            assert problems(copied) == []
        copy.add_file("results/after.parquet", h("after"), 3)
        with copy._database.reading() as copied:
            assert problems(copied) == []
