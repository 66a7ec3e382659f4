"""A workspace whose catalogue is in PostgreSQL: verified, backed up, moved to SQLite and back, and
cut off while it runs."""

import random
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any

import psycopg
import pytest
from typer.testing import CliRunner

from aerodb.errors import InputError, StoreBusyError
from aerodb.flows.cli.main import app
from aerodb.flows.flight import flight_flow
from aerodb.flows.run import requires, run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.upkeep.backup import back_up, restore
from aerodb.storage.upkeep.verification import verify
from aerodb.storage.workspace import Workspace
from aerodb.tasks.workspace_access import access_workspace
from tests.faults.killing import STAGES, picture
from tests.storage.upkeep.test_backup import beside_a_writer, files
from tests.support.glider_runs import ingest_and_update, prepared, rows, stored
from tests.support.postgresql import Server, by_hand, name_in_settings
from tests.support.small_glider import NAME, write_files


@dataclass
class Made:
    """A workspace and the name of its database, before and after an update, and its logs."""

    root: Path
    database: str
    logs: list[Path]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, postgresql_server: Server) -> Iterator[Made]:
    """Three flights, an update, and a log in quarantine."""
    logs = write_files(tmp_path_factory.mktemp("logs"), flights=4)
    root, database = tmp_path_factory.mktemp("w"), postgresql_server.catalogue()
    name_in_settings(root, postgresql_server.url(database), "[limits]\nreserve = 1000\n")
    workspace = prepared(root, logs[0].parent)
    ingest_and_update(workspace, logs[:3])
    bad = logs[0].parent / "bad.csv"
    bad.write_text("no numbers\n")
    ingest(workspace, bad)
    yield Made(root, database, logs)
    postgresql_server.drop(database)


class Copies:
    """Copies of workspaces with their databases, which go when the test ends."""

    def __init__(self, server: Server, folder: Path) -> None:
        self._server, self._folder, self.databases = server, folder, list[str]()

    def of(self, made: Made, name: str = "copy") -> Workspace:
        self.databases.append(self._server.copy_of(made.database))
        root = Path(shutil.copytree(made.root, self._folder / name))
        settings = (
            (root / "settings.toml")
            .read_text()
            .replace(f'/{made.database}"', f'/{self.databases[-1]}"')
        )
        (root / "settings.toml").write_text(settings)
        return Workspace.open(root)

    def empty(self) -> str:
        """The address of a database with nothing in it."""
        self.databases.append(self._server.empty())
        return self._server.url(self.databases[-1])


@pytest.fixture
def copies(postgresql_server: Server, tmp_path: Path) -> Iterator[Copies]:
    one = Copies(postgresql_server, tmp_path)
    yield one
    for database in one.databases:
        postgresql_server.drop(database)


@pytest.fixture
def workspace(made: Made, copies: Copies) -> Workspace:
    return copies.of(made)


def ingest(workspace: Workspace, *logs: Path) -> None:
    run_flow(
        flight_flow, {"logs": [str(log) for log in logs], "vehicle": NAME}, workspace, "direct"
    )


def found(workspace: Workspace) -> list[tuple[str, str]]:
    with Catalogue.open(workspace.catalogue) as catalogue:
        return [(problem.kind, problem.where) for problem in verify(workspace, catalogue).problems]


# Verifying


@pytest.mark.parametrize(
    ("statement", "where"),
    [
        ("UPDATE versions SET settings = '{}' WHERE number = 2", f"v0002 of {NAME}"),
        (
            "UPDATE versions SET content = replace(content, '-0.65', '-0.66') WHERE number = 1",
            f"v0001 of {NAME}",
        ),
        (
            "DELETE FROM version_inputs WHERE version = (SELECT id FROM versions WHERE number = 1)",
            f"v0001 of {NAME}",
        ),
        (
            (
                "UPDATE name_events SET previous = version WHERE sequence = (SELECT max(sequence)"
                " FROM name_events)"
            ),
            "'candidate'",
        ),
        ("DELETE FROM vehicles", "table flights"),
        (
            "INSERT INTO run_versions VALUES ('no such run', 'no such version')",
            "table run_versions",
        ),
        (
            "ALTER TABLE versions DISABLE TRIGGER versions_no_update",
            "trigger versions_no_update of versions",
        ),
        ("DROP TRIGGER flights_no_truncate ON flights", "trigger flights_no_truncate of flights"),
    ],
)
def test_a_catalogue_changed_by_hand_is_found_out(
    workspace: Workspace, statement: str, where: str
) -> None:
    with by_hand(workspace.catalogue) as raw:
        raw.execute(
            "SET session_replication_role = replica"
        )  # a superuser's way past triggers and foreign keys
        raw.execute(statement)
    assert any(kind == "catalogue" and where in place for kind, place in found(workspace))


# Backup, and moving


def test_a_catalogue_moves_to_a_file_and_back_with_every_row(
    workspace: Workspace, made: Made, copies: Copies, tmp_path: Path
) -> None:
    def called(*arguments: str) -> Any:
        result = CliRunner().invoke(app, list(arguments))
        assert result.exit_code == 0, (result.output, result.exception)

    def rest(root: Path) -> dict[str, str]:
        return {name: sha256 for name, sha256 in files(root).items() if name != "settings.toml"}

    local = tmp_path / "local.toml"
    local.write_text("[limits]\nreserve = 1000\n")
    called("--workspace", str(workspace.root), "backup", str(tmp_path / "b1"))
    called(
        "restore",
        str(tmp_path / "b1"),
        "--workspace",
        str(tmp_path / "file"),
        "--settings",
        str(local),
    )
    in_file = Workspace.open(tmp_path / "file", create=False)
    assert in_file.catalogue.is_file()
    assert (stored(in_file), rows(in_file), rest(in_file.root)) == (
        stored(workspace),
        rows(workspace),
        rest(workspace.root),
    )
    name_in_settings(tmp_path / "there", copies.empty())
    called("--workspace", str(in_file.root), "backup", str(tmp_path / "b2"))
    called(
        "restore",
        str(tmp_path / "b2"),
        "--workspace",
        str(tmp_path / "back"),
        "--settings",
        str(tmp_path / "there" / "settings.toml"),
    )
    back = Workspace.open(tmp_path / "back", create=False)
    assert not list(back.root.glob("catalogue*"))
    assert (stored(back), rows(back), rest(back.root)) == (
        stored(workspace),
        rows(workspace),
        rest(workspace.root),
    )
    # Work goes on alike in all three.
    for one in (workspace, in_file, back):
        ingest(one, made.logs[3])
        assert found(one) == []
    assert stored(workspace) == stored(in_file) == stored(back)


def test_a_backup_is_never_restored_over_a_catalogue(workspace: Workspace, tmp_path: Path) -> None:
    """Its own settings name the database that it was made of."""
    back_up(workspace, tmp_path / "b")
    before = stored(workspace), rows(workspace)
    with pytest.raises(InputError, match="already contains a catalogue"):
        restore(tmp_path / "b", tmp_path / "new", tmp_path / "b" / "settings.toml")
    assert not (tmp_path / "new").exists()
    (left,) = restore(tmp_path / "b", tmp_path / "file")["left_off"]
    assert left.startswith("catalogue.url")
    assert Workspace.open(tmp_path / "file").catalogue.is_file()
    assert (stored(workspace), rows(workspace)) == before
    refused = CliRunner().invoke(app, ["--workspace", str(tmp_path / "b"), "flight", "list"])
    assert "no workspace here" in str(refused.exception), (
        "a backup is no workspace: nobody writes to the database by it"
    )


def test_a_damaged_backup_leaves_an_empty_database(
    workspace: Workspace, copies: Copies, tmp_path: Path
) -> None:
    back_up(workspace, tmp_path / "b")
    damaged = next((tmp_path / "b" / "results").rglob("*.parquet"))
    whole = damaged.read_bytes()
    damaged.write_bytes(whole[:-1])
    name_in_settings(tmp_path / "there", copies.empty())
    with pytest.raises(InputError, match="differ from those that were stored"):
        restore(tmp_path / "b", tmp_path / "new", tmp_path / "there" / "settings.toml")
    assert not (tmp_path / "new").exists()
    damaged.write_bytes(whole)
    restore(tmp_path / "b", tmp_path / "new", tmp_path / "there" / "settings.toml")
    assert stored(Workspace.open(tmp_path / "new")) == stored(workspace)


@pytest.mark.campaign
def test_a_backup_while_another_process_takes_logs_in_holds_whole_flights(
    workspace: Workspace, made: Made, tmp_path: Path
) -> None:
    more = write_files(tmp_path / "more", flights=7)[4:]
    local = tmp_path / "local.toml"
    local.write_text("")

    def backup(k: int) -> int:
        place = tmp_path / f"new{k}"
        back_up(workspace, tmp_path / "b")
        restore(tmp_path / "b", place, local)
        new = Workspace.open(place)
        assert found(new) == []
        return len(stored(new)["flights"])

    before = len(stored(workspace)["flights"])
    numbers = beside_a_writer(workspace, more, backup)
    assert [k for k in range(len(more)) if numbers[k] - before not in (k, k + 1)] == [], numbers


# Connections that are cut while it runs


@contextmanager
def cutting(server: Server, database: str, generator: random.Random) -> Iterator[None]:
    """Cuts all connections to a database at random moments, about twenty times a second, while it
    lasts."""
    ended = threading.Event()

    def cut() -> None:
        while not ended.wait(generator.uniform(0.0, 0.1)):
            server.cut(database)

    thread = threading.Thread(target=cut)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()


@pytest.fixture(scope="module")
def stages(
    tmp_path_factory: pytest.TempPathFactory, postgresql_server: Server
) -> Iterator[dict[str, tuple[Made, Any]]]:
    """Stage -> the workspace before it, and the picture after it, undisturbed."""
    logs = write_files(tmp_path_factory.mktemp("logs"), flights=3)
    folder = tmp_path_factory.mktemp("stages")
    copies, before = Copies(postgresql_server, folder), {}
    copies.databases.append(postgresql_server.catalogue())
    name_in_settings(folder / "w", postgresql_server.url(copies.databases[0]))
    workspace = prepared(folder / "w", logs[0].parent)
    for name in ("per_flight", "update", "promotion"):
        kept = copies.of(Made(workspace.root, copies.databases[0], logs), f"before-{name}")
        STAGES[name](workspace, logs)
        before[name] = Made(kept.root, copies.databases[-1], logs), picture(workspace)
    yield before
    for database in copies.databases:
        postgresql_server.drop(database)


@pytest.mark.campaign
def test_cut_at_random_moments_the_same_run_again_ends_as_if_nothing_had_happened(
    stages: dict[str, Any], copies: Copies, postgresql_server: Server
) -> None:
    generator, outcomes = random.Random(1), []
    for name, number in product(stages, range(30)):
        made, wanted = stages[name]
        workspace = copies.of(made, f"{name}-{number}")
        with cutting(postgresql_server, copies.databases[-1], generator):
            try:
                STAGES[name](workspace, made.logs)
                outcomes.append("ended well")
            except StoreBusyError as error:
                outcomes.append(str(error))
        STAGES[name](workspace, made.logs)
        assert picture(workspace) == wanted, outcomes
        assert found(workspace) == [], outcomes


CUT: list[str] = []


def _cut_inside(item: str, *, workspace: str, run: str) -> int:
    """A step whose connection is cut in its transaction, the first time."""
    catalogue = access_workspace(workspace).catalogue
    with catalogue.transaction():
        catalogue.add_vehicle(item, "text")
        if not CUT:
            CUT.append(catalogue._database.where)
            with psycopg.connect(CUT[0]) as raw:
                chosen = (
                    "FROM pg_stat_activity WHERE datname = current_database() AND pid <>"
                    " pg_backend_pid()"
                )
                raw.execute(f"SELECT pg_terminate_backend(pid) {chosen}")
        catalogue.add_vehicle(f"{item}-too", "text")
    return len(CUT)


@pytest.mark.campaign
def test_a_step_whose_connection_is_cut_costs_a_retry_and_nothing_else(
    workspace: Workspace,
) -> None:
    @requires("ingest")
    def cut_flow(steps: Any, *, workspace: str, run: str) -> int:
        answer: int = steps(_cut_inside, "another", workspace=workspace, run=run)
        return answer

    CUT.clear()
    assert run_flow(cut_flow, {}, workspace) == 1
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert [row.name for row in catalogue.vehicles()] == ["another", "another-too", NAME]
        assert [(run.flow, run.state) for run in catalogue.runs(limit=1)] == [
            ("cut_flow", "completed")
        ]
