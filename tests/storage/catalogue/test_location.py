"""Location of the catalogue: which settings are allowed, and that no password is ever shown."""

import time
from pathlib import Path
from typing import Any

import psycopg
import pytest
from typer.testing import CliRunner

from aerodb.errors import InputError, StoreBusyError, StoreError
from aerodb.flows.cli.main import app
from aerodb.flows.processes import database_of
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.location import catalogue_location
from aerodb.storage.catalogue.postgresql import open_postgresql
from aerodb.storage.catalogue.schema import metadata
from aerodb.storage.urls import checked_url, shown
from aerodb.storage.workspace import Workspace
from aerodb.storage.workspace_settings import SettingsError, load_settings
from tests.support.catalogue_samples import V
from tests.support.postgresql import Server, name_in_settings

SECRET = "s3cret-Word"
SECRET_URL = f"postgresql://aerodb:{SECRET}@127.0.0.1:{{port}}/{{database}}"


@pytest.mark.parametrize(
    "text",
    [
        f"postgresql://me:{SECRET}@host/db",
        f"postgresql://me@host/db?password={SECRET}",
        f"postgresql://me:{SECRET}/x@host/db",
        f"postgresql://me:{SECRET}#x@host/db",
        f"postgresql://me@host:{SECRET}/db",
        f"mysql://me:{SECRET}@host/db",
        f"me:{SECRET}",
        ["postgresql://me:" + SECRET],
        "$not a name",
        "postgresql://host",
    ],
)
def test_no_address_with_a_password_stands_in_the_file_and_none_is_shown(
    tmp_path: Path, text: Any
) -> None:
    for section, key in (("catalogue", "url"), ("serve", "database")):
        (tmp_path / "settings.toml").write_text(f"[{section}]\n{key} = {text!r}\n")
        with pytest.raises(SettingsError) as refusal:
            load_settings(tmp_path)
        assert f"{section}.{key}" in str(refusal.value)
        assert refusal.value.remedy
        assert SECRET not in str(refusal.value)
    (tmp_path / "settings.toml").write_text(f"[catalogue]\nurl = {text!r}\n")
    with pytest.raises(SettingsError) as refusal:
        catalogue_location(tmp_path / "catalogue.sqlite")
    assert SECRET not in str(refusal.value)


def test_an_address_is_shown_without_its_secrets() -> None:
    assert (
        shown(f"postgresql://me:{SECRET}@host:5433/db?password={SECRET}&sslmode=require")
        == "postgresql://me@host:5433/db"
    )
    assert shown("postgresql:///db?host=/run/postgresql") == "postgresql:///db"
    assert (
        checked_url("postgresql:///db?host=/run/postgresql")
        == "postgresql:///db?host=/run/postgresql"
    )


def test_the_variable_holds_the_address_and_nobody_tells_it(
    tmp_path: Path, postgresql_server: Server, database: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "catalogue.sqlite"
    name_in_settings(tmp_path, "$TEST_CATALOGUE")
    with pytest.raises(SettingsError, match="TEST_CATALOGUE is not set"):
        Catalogue.open(path)
    monkeypatch.setenv("TEST_CATALOGUE", f"http://me:{SECRET}@host")
    with pytest.raises(SettingsError, match="is not the address") as refusal:
        Catalogue.open(path)
    told = [str(refusal.value)]
    monkeypatch.setenv(
        "TEST_CATALOGUE", SECRET_URL.format(port=postgresql_server.port, database="absent")
    )
    with pytest.raises(StoreError, match='"absent" does not exist') as absent:
        Catalogue.open(path)
    monkeypatch.setenv("TEST_CATALOGUE", SECRET_URL.format(port=1, database="absent"))
    with pytest.raises(StoreBusyError, match="cannot be reached") as away:
        Catalogue.open(path)
    monkeypatch.setenv(
        "TEST_CATALOGUE", SECRET_URL.format(port=postgresql_server.port, database=database)
    )
    with Catalogue.open(path) as catalogue:
        told += [
            str(absent.value),
            str(away.value),
            catalogue._database.where,
            repr(catalogue_location(path)),
            repr(catalogue._database),
        ]
        assert catalogue.vehicles() == ()
    assert SECRET not in "".join(told)
    assert not path.exists()


def test_a_wrong_password_is_refused_and_not_told(
    tmp_path: Path, postgresql_server: Server, database: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    rules = postgresql_server.folder / "data" / "pg_hba.conf"
    trusting = rules.read_text()
    monkeypatch.setenv(
        "TEST_CATALOGUE",
        SECRET_URL.replace("aerodb:", "guarded:").format(
            port=postgresql_server.port, database=database
        ),
    )
    name_in_settings(tmp_path / "w", "$TEST_CATALOGUE")
    try:
        postgresql_server.execute("CREATE ROLE guarded LOGIN PASSWORD 'another'")
        rules.write_text("host all guarded 127.0.0.1/32 scram-sha-256\n" + trusting)
        with psycopg.connect(postgresql_server.url(database), autocommit=True) as raw:
            before = raw.execute("SELECT pg_conf_load_time()").fetchone()
            raw.execute("SELECT pg_reload_conf()")
            while _loaded(postgresql_server, database) == before:
                time.sleep(0.02)
        result = CliRunner().invoke(
            app, ["--workspace", str(tmp_path / "w"), "vehicle", "add", __file__]
        )
        with pytest.raises(StoreError, match="refuses the login") as refusal:
            Catalogue.open(tmp_path / "w" / "catalogue.sqlite")
    finally:
        rules.write_text(trusting)
        postgresql_server.execute("SELECT pg_reload_conf()", "DROP ROLE guarded")
    assert not isinstance(refusal.value, StoreBusyError), "trying again would not help"
    assert SECRET not in f"{refusal.value}{result.output}{result.exception}"


def _loaded(server: Server, database: str) -> Any:
    """When the server read its rules: those that a new connection meets."""
    with psycopg.connect(server.url(database)) as raw:
        return raw.execute("SELECT pg_conf_load_time()").fetchone()


def test_a_file_and_an_address_are_one_too_many(tmp_path: Path) -> None:
    Catalogue.open(tmp_path / "catalogue.sqlite").close()
    before = (tmp_path / "catalogue.sqlite").read_bytes()
    name_in_settings(tmp_path, "postgresql://me@127.0.0.1:1/db")
    with pytest.raises(InputError, match="the settings name another"):
        Catalogue.open(tmp_path / "catalogue.sqlite")
    assert (tmp_path / "catalogue.sqlite").read_bytes() == before


def test_settings_that_cannot_be_read_hide_no_file_and_begin_none(tmp_path: Path) -> None:
    (tmp_path / "settings.toml").write_text("[catalogue\n")
    with pytest.raises(SettingsError, match="cannot be read"):
        Catalogue.open(tmp_path / "catalogue.sqlite")
    assert not (tmp_path / "catalogue.sqlite").exists()
    (tmp_path / "settings.toml").unlink()
    with Catalogue.open(tmp_path / "catalogue.sqlite") as catalogue:
        catalogue.add_vehicle(V, "text")
    (tmp_path / "settings.toml").write_text("[catalogue\n")
    with Catalogue.open(tmp_path / "catalogue.sqlite") as catalogue:
        assert [row.name for row in catalogue.vehicles()] == [V]


def test_a_database_that_is_no_catalogue_is_refused_and_not_changed(
    tmp_path: Path, postgresql_server: Server, database: str
) -> None:
    other = postgresql_server.empty()
    url = postgresql_server.url(other)
    with pytest.raises(InputError, match="no catalogue here"):
        open_postgresql(url, create=False)
    with pytest.raises(InputError, match="no schema of the search path"):
        open_postgresql(f"{url}?options=-c search_path%3Dnowhere")
    postgresql_server.execute("CREATE TABLE theirs (a int)", database=other)
    with pytest.raises(InputError, match=r"already contains other tables \(theirs\)"):
        open_postgresql(url)
    postgresql_server.execute("CREATE SCHEMA ours", database=other)
    open_postgresql(f"{url}?options=-c search_path%3Dours").close()
    with psycopg.connect(url) as raw:
        tables = raw.execute(
            "SELECT schemaname, count(*) FROM pg_tables WHERE schemaname IN ('public', 'ours')"
            " GROUP BY 1"
        )
        assert dict(tables.fetchall()) == {"public": 1, "ours": len(metadata.tables) + 1}
    postgresql_server.execute("UPDATE alembic_version SET version_num = 'r9999'", database=database)
    with pytest.raises(InputError, match="by a newer version"):
        open_postgresql(postgresql_server.url(database))
    postgresql_server.drop(other)


def test_prefect_gets_an_address_of_its_own_kind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace = Workspace.open(tmp_path)
    assert database_of(workspace) == f"sqlite+aiosqlite:///{tmp_path / 'prefect' / 'prefect.db'}"
    monkeypatch.setenv("TEST_PREFECT", f"postgresql://me:{SECRET}@host/prefect?sslmode=require")
    name_in_settings(
        tmp_path, "postgresql://me@host/catalogue", '[serve]\ndatabase = "$TEST_PREFECT"'
    )
    assert database_of(workspace) == f"postgresql+asyncpg://me:{SECRET}@host/prefect?ssl=require"
    for url, what in (
        (f"postgresql://me:{SECRET}@host/catalogue", "the catalogue's database"),
        ("postgresql://h/p?options=x", "does not know the option"),
    ):
        monkeypatch.setenv("TEST_PREFECT", url)
        with pytest.raises(InputError, match=what) as refusal:
            database_of(workspace)
        assert SECRET not in str(refusal.value)
