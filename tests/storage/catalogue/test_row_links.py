"""Rows that are not events: whatever is changed, deleted or added by hand is found, and named."""

from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path

import pytest
import sqlalchemy as sa

from aerodb.storage.catalogue import schema
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.copying import copy_catalogue
from aerodb.storage.catalogue.row_links import LINKED, broken_rows
from aerodb.storage.upkeep.audit import Audit
from tests.storage.catalogue.test_chain import WORDS, filled, others, tampering
from tests.support.catalogue_samples import V, h

WORDS |= {
    "version_flights.role": schema.ROLES,
}


def _add_result(catalogue: Catalogue, name: str) -> None:
    catalogue.add_result(
        h(name),
        path=f"results/{name}.parquet",
        step="compare",
        kind="comparison",
        flight=h("f1"),
        settings={"order": 2},
        result_version=1,
        code_version="test",
        inputs=[h("f1"), h("base")],
        run=catalogue.start_run("flow", how="direct").id,
    )


@pytest.fixture
def path(kept_in: str, tmp_path: Path) -> Path:
    """A catalogue with rows in every table."""
    with Catalogue.open(tmp_path / "catalogue.sqlite") as catalogue:
        catalogue.add_vehicle(V, "name = 'a'")
        filled(catalogue)
        with catalogue._database.writing() as connection:
            marks = [{"mark": mark, "flight": h("f1")} for mark in (1, 2, 3)]
            connection.execute(sa.insert(schema.flight_fingerprints), marks)
        for name in ("one", "two"):
            _add_result(catalogue, name)
    return tmp_path / "catalogue.sqlite"


def test_a_change_of_any_field_of_any_row_is_found(path: Path, kept_in: str) -> None:
    tried = 0
    with tampering(path, kept_in) as connection:
        if kept_in == "sqlite":
            connection.exec_driver_sql("PRAGMA foreign_keys = OFF")
        assert list(broken_rows(connection)) == []
        for name in (*LINKED, "row_links"):
            table = schema.metadata.tables[name]
            key = tuple(table.primary_key.columns)
            rows = connection.execute(sa.select(table).order_by(*key)).mappings().all()
            assert rows, name
            for row in rows[:3]:
                mine = sa.and_(*(column == row[column.name] for column in key))
                for column in table.columns:
                    for value in others(name, column, row[column.name]):
                        change = sa.update(table).where(mine).values({column.name: value})
                        assert connection.execute(change).rowcount == 1
                        found = list(broken_rows(connection))
                        assert any(f"table {name}" in where for _, where in found), (name, column)
                        connection.rollback()
                        tried += 1
                connection.execute(sa.delete(table).where(mine))
                last = name == "row_links" and row == rows[-1]
                assert bool(list(broken_rows(connection))) or last, name
                connection.rollback()
    print(f"{tried} changes of a field, all found")
    assert tried > 90


def test_roles_settings_and_verdicts_are_named(path: Path, kept_in: str) -> None:
    with tampering(path, kept_in) as connection:
        for statement in (
            "UPDATE version_flights SET role = 'held_out'",
            "UPDATE results SET settings = '{\"order\":1}'",
            "UPDATE flights SET added_utc = 'then'",
        ):
            connection.exec_driver_sql(statement)
        connection.commit()
    with Catalogue.open(path) as catalogue:
        problems = list(Audit.of(catalogue).problems(lambda *_: None))
    said = {problem.where.split(",")[0] for problem in problems if problem.kind == "chain"}
    assert said == {"table version_flights", "table results", "table flights"}


def test_a_row_that_came_otherwise_never_gets_a_link(path: Path, kept_in: str) -> None:
    with tampering(path, kept_in) as connection:
        row = connection.execute(sa.select(schema.results).limit(1)).mappings().one()
        connection.execute(sa.insert(schema.results).values({**row, "key": h("forged")}))
        connection.commit()
    with Catalogue.open(path) as catalogue:
        _add_result(catalogue, "more")
        with catalogue._database.reading() as connection:
            ((what, where),) = broken_rows(connection)
    assert what == "the row was added by other means than aerodb"
    assert h("forged") in where


def test_concurrent_writers_and_rolled_back_rows_leave_sound_links(path: Path) -> None:
    def write(writer: int) -> None:
        with Catalogue.open(path) as catalogue:
            for number in range(10):
                _add_result(catalogue, f"{writer} {number}")
                with suppress(KeyError), catalogue.transaction():
                    with suppress(ZeroDivisionError), catalogue.transaction():
                        _add_result(catalogue, f"lost {writer} {number}")
                        raise ZeroDivisionError
                    _add_result(catalogue, f"kept {writer} {number}")
                    if number % 2:
                        raise KeyError

    with ThreadPoolExecutor(4) as threads:
        list(threads.map(write, range(4)))
    with Catalogue.open(path) as catalogue, catalogue._database.reading() as connection:
        assert list(broken_rows(connection)) == []
        assert connection.scalar(sa.select(sa.func.count()).select_from(schema.results)) == 2 + 60


def test_a_copy_has_the_same_links(path: Path, tmp_path: Path) -> None:
    with Catalogue.open(path) as catalogue, Catalogue.in_file(tmp_path / "copy.sqlite") as copy:
        copy_catalogue(catalogue, copy)
        links = sa.select(schema.row_links).order_by("number")
        with catalogue._database.reading() as one, copy._database.reading() as other:
            assert one.execute(links).all() == other.execute(links).all()
            assert list(broken_rows(other)) == []
        _add_result(copy, "after")
        with copy._database.reading() as other:
            assert list(broken_rows(other)) == []
