"""Catalogues that earlier versions wrote: the folder `former` has those of the demo, made by the
code of their time. They are migrated with all their rows, and kept as they were."""

import logging
import lzma
import sqlite3
from collections.abc import Iterable
from contextlib import closing
from pathlib import Path

import pytest
import sqlalchemy as sa
from alembic import command
from alembic.autogenerate import compare_metadata
from alembic.config import Config
from alembic.migration import MigrationContext

from aerodb.errors import InputError
from aerodb.storage.catalogue import Catalogue, schema
from aerodb.storage.catalogue.location import catalogue_location
from aerodb.storage.catalogue.postgresql import _engine
from aerodb.storage.upkeep.audit import Audit

FORMER = sorted((Path(__file__).parent / "former").glob("*.sql.xz"))
REVISIONS = [path.name.removesuffix(".sql.xz") for path in FORMER]
OLD = [revision for revision in REVISIONS if revision != schema.HEAD]


def _text(revision: str) -> str:
    (path,) = [path for path in FORMER if path.name.startswith(revision)]
    return lzma.decompress(path.read_bytes()).decode("utf-8")


def _in_file(revision: str, path: Path) -> None:
    with closing(sqlite3.connect(path)) as raw:
        raw.executescript(_text(revision))


def _rows(names: Iterable[str], connection: sa.Connection) -> dict[str, list[str]]:
    """Rows of tables, each without the columns that are null."""
    rows = {}
    for name in names:
        every = connection.execute(sa.text(f'SELECT * FROM "{name}"')).mappings()
        rows[name] = sorted(
            str(sorted((key, str(value)) for key, value in row.items() if value is not None))
            for row in every
        )
    return rows


def _as_of_then(revision: str, tmp_path: Path, kept_in: str) -> dict[str, list[str]]:
    """Put the catalogue of that time where `kept_in` says; returns its rows."""
    path = tmp_path / "catalogue.sqlite"
    file = path if kept_in == "sqlite" else tmp_path / "then.sqlite"
    _in_file(revision, file)
    then = sa.create_engine(f"sqlite:///{file}")
    with then.connect() as source:
        names = [n for n in sa.inspect(source).get_table_names() if n != "alembic_version"]
        rows = _rows(names, source)
        if kept_in == "postgresql":
            config = Config()
            config.set_main_option("script_location", "aerodb.storage:migrations")
            server = _engine(catalogue_location(path).url)
            with server.begin() as target:
                target.exec_driver_sql("DROP SCHEMA public CASCADE; CREATE SCHEMA public")
                config.attributes["connection"] = target
                command.upgrade(config, revision)
                metadata = sa.MetaData()
                metadata.reflect(target)
                for table in metadata.sorted_tables:
                    if table.name != "alembic_version":
                        own = source.execute(sa.select(table)).mappings().all()
                        if own:
                            target.execute(sa.insert(table), [dict(row) for row in own])
            server.dispose()
    then.dispose()
    return rows


@pytest.mark.parametrize("revision", REVISIONS)
def test_what_earlier_versions_wrote_is_migrated_with_every_row(
    kept_in: str, tmp_path: Path, revision: str, caplog: pytest.LogCaptureFixture
) -> None:
    before = _as_of_then(revision, tmp_path, kept_in)
    with (
        caplog.at_level(logging.WARNING),
        Catalogue.open(tmp_path / "catalogue.sqlite", create=False) as catalogue,
    ):
        with catalogue._database.reading() as connection:
            assert compare_metadata(
                MigrationContext.configure(connection), schema.metadata
            ) == [] or (
                kept_in == "postgresql"  # what is kept there stands beside the catalogue's tables
            )
            after = _rows(before, connection)
            if kept_in == "postgresql" and revision in OLD:
                kept = _rows([f"former_{revision}_{name}" for name in before], connection)
                assert [len(rows) for rows in kept.values()] == [len(r) for r in before.values()]
        for name, rows in before.items():
            assert len(after[name]) == len(rows), name
        (vehicle,) = catalogue.vehicles()
        assert vehicle.name == "phoenix"
        assert [version.label for version in catalogue.versions("phoenix")] == ["v0001", "v0002"]
        assert catalogue.version("phoenix", "released").label == "v0001"
        assert len(catalogue.flights("phoenix")) == 5
        assert not [problem.what for problem in Audit.of(catalogue).problems(lambda *_: None)]
    said = [record.getMessage() for record in caplog.records]
    assert bool(said) == (revision != schema.HEAD)


@pytest.mark.parametrize("revision", OLD)
def test_the_former_catalogue_is_kept_and_can_go_on(tmp_path: Path, revision: str) -> None:
    path = tmp_path / "catalogue.sqlite"
    _in_file(revision, path)
    assert Catalogue.pending_migration(path) == (revision, schema.HEAD)
    Catalogue.open(path).close()
    assert Catalogue.pending_migration(path) is None
    (kept,) = tmp_path.glob(f"catalogue-{revision}-*.sqlite")
    with closing(sqlite3.connect(kept)) as raw:
        assert "\n".join(raw.iterdump()) + "\n" == _text(revision)
    Catalogue.open(path).close()
    assert len(list(tmp_path.glob("catalogue-*.sqlite"))) == 1


@pytest.mark.parametrize("revision", OLD)
def test_a_migration_that_fails_changes_nothing(
    tmp_path: Path, revision: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "catalogue.sqlite"
    _in_file(revision, path)

    def fail(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr(command, "upgrade", fail)
    with pytest.raises(ZeroDivisionError):
        Catalogue.open(path)
    assert [each.name for each in tmp_path.glob("catalogue-*")] == []
    with closing(sqlite3.connect(path)) as raw:
        assert "\n".join(raw.iterdump()) + "\n" == _text(revision)


def test_a_newer_catalogue_is_neither_changed_nor_copied(tmp_path: Path) -> None:
    path = tmp_path / "catalogue.sqlite"
    _in_file(REVISIONS[-1], path)
    with closing(sqlite3.connect(path)) as raw:
        raw.execute("UPDATE alembic_version SET version_num = 'r9999'")
        raw.commit()
    with pytest.raises(InputError, match="by a newer version"):
        Catalogue.open(path)
    assert [each.name for each in tmp_path.glob("catalogue-*.sqlite")] == []
