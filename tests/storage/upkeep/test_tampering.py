"""What another program changes in the catalogue: the next write refuses it, and a verification
names each trigger, view, index, table, rule and function that is not as aerodb writes it."""

import sqlite3
from contextlib import closing
from pathlib import Path

import pytest

from aerodb.errors import StoreError
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.seal import is_intact, seal_of
from aerodb.storage.upkeep.audit import Audit
from tests.support.catalogue_samples import V
from tests.support.postgresql import Server, by_hand, name_in_settings

#: A guard with another body: who takes a role gets another, or a promotion is swallowed.
_BODY = "CREATE TRIGGER {0}_no_delete BEFORE DELETE ON {0} BEGIN {1}; END"
_GIVES_A_ROLE = (
    "INSERT INTO user_events (name, kind, role, token_sha256, at_utc, by) VALUES ('eve', 'added',"
    " 'release', 'x', '2026', 'eve')"
)
_SQLITE = {
    "trigger user_events_no_delete of user_events": (
        "DROP TRIGGER user_events_no_delete",
        _BODY.format("user_events", _GIVES_A_ROLE),
    ),
    "trigger name_events_no_delete of name_events": (
        "DROP TRIGGER name_events_no_delete",
        _BODY.format("name_events", "SELECT RAISE(IGNORE)"),
    ),
    "trigger more of version_notes": (
        f"CREATE TRIGGER more AFTER INSERT ON version_notes BEGIN {_GIVES_A_ROLE}; END",
    ),
    "view spare": ("CREATE VIEW spare AS SELECT 1",),
    "table heap": ("CREATE TABLE heap (a)",),
    "index ix_runs_flow of runs": ("DROP INDEX ix_runs_flow",),
}
_POSTGRESQL = {
    "function refuse_change()": (
        "CREATE OR REPLACE FUNCTION refuse_change() RETURNS trigger LANGUAGE plpgsql AS"
        " $$ BEGIN RETURN NULL; END $$",
    ),
    "rule quiet of name_events": (
        "CREATE RULE quiet AS ON INSERT TO name_events DO INSTEAD NOTHING",
    ),
    "trigger user_events_no_delete of user_events": (
        "ALTER TABLE user_events DISABLE TRIGGER user_events_no_delete",
    ),
    "view spare": ("CREATE VIEW spare AS SELECT 1 AS a",),
    "index ix_runs_flow of runs": ("DROP INDEX ix_runs_flow",),
    "constraint ck_log_files_status of log_files": (
        "ALTER TABLE log_files DROP CONSTRAINT ck_log_files_status",
    ),
}


@pytest.fixture
def path(kept_in: str, tmp_path: Path) -> Path:
    with Catalogue.open(tmp_path / "catalogue.sqlite") as catalogue:
        catalogue.add_vehicle(V, "name = 'twin-otter'")
    return tmp_path / "catalogue.sqlite"


def _changed(path: Path) -> set[str]:
    with Catalogue.open(path, create=False) as catalogue:
        problems = list(Audit.of(catalogue).problems(lambda *_: None))
    return {problem.where for problem in problems if problem.kind == "catalogue"}


def test_every_object_with_another_text_is_named(path: Path, kept_in: str) -> None:
    seal_of(path).unlink(missing_ok=True)
    assert _changed(path) == set()
    every = _SQLITE if kept_in == "sqlite" else _POSTGRESQL
    for where, statements in every.items():
        before = _changed(path)
        with closing(by_hand(path)) as raw:
            for statement in statements:
                raw.execute(statement)
            raw.commit()
        assert _changed(path) - before == {where}


def test_a_write_refuses_what_another_program_changed(tmp_path: Path) -> None:
    path = tmp_path / "catalogue.sqlite"
    with Catalogue.open(path) as catalogue:
        catalogue.add_vehicle(V, "name = 'twin-otter'")
    with closing(sqlite3.connect(path)) as raw:
        for statement in _SQLITE["trigger more of version_notes"]:
            raw.execute(statement)
        raw.commit()
    rows = _rows(path)
    with (
        Catalogue.open(path) as catalogue,
        pytest.raises(StoreError, match="another program wrote to it") as refused,
    ):
        catalogue.start_run("flow", how="direct")
    assert "aerodb verify" in refused.value.remedy
    assert _rows(path) == rows
    assert is_intact(path) is False, "the seal still tells"
    seal_of(path).unlink()
    with Catalogue.open(path) as catalogue:
        catalogue.start_run("flow", how="direct")
    assert is_intact(path)
    assert _changed(path) == {"trigger more of version_notes"}, "a seal made anew hides nothing"


def _rows(path: Path) -> list[str]:
    with closing(sqlite3.connect(path)) as raw:
        return list(raw.iterdump())


def test_a_write_to_a_sealed_file_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "catalogue.sqlite"
    for _ in range(3):
        with Catalogue.open(path) as catalogue:
            catalogue.add_vehicle(V, "name = 'twin-otter'")
            catalogue.start_run("flow", how="direct")
        assert is_intact(path)


def test_a_user_who_may_make_no_schema_is_told(
    postgresql_server: Server, database: str, tmp_path: Path
) -> None:
    url = postgresql_server.url(database)
    name_in_settings(tmp_path, url)
    path = tmp_path / "catalogue.sqlite"
    Catalogue.open(path).close()
    with closing(by_hand(path)) as raw:
        raw.execute("DROP ROLE IF EXISTS reader")
        raw.execute("CREATE ROLE reader LOGIN")
        raw.execute("GRANT SELECT ON ALL TABLES IN SCHEMA public TO reader")
        raw.commit()
    try:
        name_in_settings(tmp_path, url.replace("//aerodb@", "//reader@"))
        with Catalogue.open(path, create=False) as catalogue:
            problems = list(Audit.of(catalogue).problems(lambda *_: None))
        assert ["GRANT CREATE" in each.remedy for each in problems] == [True]
    finally:
        name_in_settings(tmp_path, url)
        with closing(by_hand(path)) as raw:
            raw.execute("DROP OWNED BY reader")
            raw.execute("DROP ROLE reader")
            raw.commit()
