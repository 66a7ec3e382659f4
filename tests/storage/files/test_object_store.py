"""A workspace with a real S3 service: same results, interchangeable folders, faults reported and
repaired."""

import hashlib
import os
import shutil
import threading
import time
from pathlib import Path
from typing import Any

import pytest

from aerodb.errors import StoreBusyError, StoreError
from aerodb.flows.flight import flight_flow
from aerodb.flows.inbox import sweep_flow
from aerodb.flows.nightly import nightly_flow
from aerodb.flows.run import run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.files import transfer
from aerodb.storage.files.cache import local
from aerodb.storage.files.flights import INDEX
from aerodb.storage.workspace import Workspace
from aerodb.tasks.steps.compare import load_comparison
from aerodb.tasks.workspace_access import access_workspace
from tests.support.command import aerodb, asked, of_schema
from tests.support.end_to_end import environment
from tests.support.forking import run_forked
from tests.support.glider_runs import ingest_and_update, prepared, rows, stored, ways
from tests.support.object_service import ObjectService
from tests.support.object_store_runs import (
    STORE,
    another,
    checked,
    copy_catalogue,
    empty_cache,
    kinds,
    name,
    named,
    processed,
    read_all,
    settings,
    the,
)
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME


@pytest.fixture(scope="module")
def logs(shared: SharedWorkspaces) -> list[Path]:
    return shared.logs[:3]


@pytest.fixture(scope="module")
def plain(
    tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces
) -> tuple[Workspace, dict[str, Any]]:
    """Workspace and update's document without an object store."""
    return shared.updated(tmp_path_factory.mktemp("plain"), flights=3)


@pytest.fixture(scope="module")
def made(
    tmp_path_factory: pytest.TempPathFactory, service: ObjectService, logs: list[Path]
) -> tuple[Workspace, Any, str]:
    """A workspace like the plain one, and its update's document; its store is at the address that
    comes third."""
    root, url = tmp_path_factory.mktemp("made"), f"s3://{service.bucket()}/tests/gliders"
    settings(root, url)
    workspace = prepared(root, logs[0].parent)
    return workspace, ingest_and_update(workspace, logs), url


@pytest.fixture
def kept(
    made: tuple[Workspace, Any, str], service: ObjectService, tmp_path: Path
) -> tuple[Workspace, str]:
    """A workspace like that one with a bucket of its own, to be spoiled; and its address."""
    return another(made[0], made[2], tmp_path / "w", service)


def test_from_logs_to_proof_the_same_is_stored(
    made: tuple[Workspace, Any, str], plain: tuple[Workspace, dict[str, Any]]
) -> None:
    assert stored(made[0]) == stored(plain[0])
    assert made[1]["candidate"] == plain[1]["candidate"] is not None
    assert [entry["terms"] for entry in made[1]["increments"]] == [
        entry["terms"] for entry in plain[1]["increments"]
    ]


def test_every_file_is_an_object_whose_name_has_its_hash(
    made: tuple[Workspace, Any, str], service: ObjectService
) -> None:
    workspace, _, url = made
    there = service.names(url)
    assert {name(file) for file in named(workspace)} <= set(there)
    for each in there:
        body = service.client.get_object(**service.at(url, each))["Body"].read()
        path, _, sha256 = each.rpartition(".")
        assert hashlib.sha256(body).hexdigest() == sha256
        assert (workspace.root / path).read_bytes() == body
    here = [
        path for folder in STORE for path in (workspace.root / folder).rglob("*") if path.is_file()
    ]
    assert len(here) == len(there) > 18
    report = checked(workspace, fetch=True)
    assert report.problems == []
    assert report.checked["objects"] == len(there)


@pytest.mark.campaign
def test_without_the_cache_everything_is_readable_and_nothing_is_made_again(
    kept: tuple[Workspace, str], logs: list[Path], service: ObjectService
) -> None:
    workspace, url = kept
    held, counted, objects = stored(workspace), rows(workspace), service.names(url)
    shown = asked(workspace.root, "flight", "show", held["flights"][0])
    empty_cache(workspace)
    assert asked(workspace.root, "flight", "show", held["flights"][0]) == shown
    assert checked(workspace, fetch=True).problems == []
    empty_cache(workspace)
    assert read_all(workspace) > 15
    empty_cache(workspace)
    ingest_and_update(workspace, logs)
    assert (stored(workspace), rows(workspace), service.names(url)) == (held, counted, objects)
    empty_cache(workspace)
    access = access_workspace(str(workspace.root))
    version = access.named(NAME, "released")
    for _ in range(2):  # whether it is there is asked, not fetched
        key = load_comparison(
            access, held["flights"][0], version or "", access.catalogue.runs()[0].id
        ).key
        row = access.catalogue.result(key)
        assert row is not None
        assert access.has(key)
        assert not (workspace.root / row.path).exists()


def test_two_machines_read_each_others_flights(
    kept: tuple[Workspace, str], logs: list[Path], tmp_path: Path, service: ObjectService
) -> None:
    one, _ = kept
    two = Workspace.open(tmp_path / "two")
    shutil.copy2(one.root / "settings.toml", two.root)
    copy_catalogue(one, two)
    assert read_all(two) > 15
    more = tmp_path / "seventh.csv"
    lines = logs[0].read_text().splitlines()
    more.write_text("\n".join([lines[0], *lines[60:]]) + "\n")
    (outcome,) = run_flow(flight_flow, {"logs": [str(more)], "vehicle": NAME}, two, "direct")
    assert outcome["flight"]
    copy_catalogue(two, one)
    assert len(processed(one, outcome["flight"]).time) > 100
    assert read_all(one) == len(named(two))
    assert checked(one, fetch=True).problems == []


def test_who_wrote_the_same_file_otherwise_spoils_nothing(
    kept: tuple[Workspace, str], tmp_path: Path
) -> None:
    """Two machines agree on a result to 1e-9, not on its bytes: the newest row says which counts,
    and both objects stand."""
    workspace, _ = kept
    file, other = the(workspace, "conditioning"), tmp_path / "other"
    other.write_bytes((workspace.root / file.path).read_bytes() + b"more")
    objects = transfer.required_objects(workspace)
    newer = objects.put(other, file.path)
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_file(newer.path, newer.sha256, newer.size)
        (workspace.root / file.path).unlink()
        assert local(workspace, catalogue, file.path).read_bytes() == other.read_bytes()
    assert objects.has(file)


def test_the_cache_is_kept_small_and_gives_up_nothing_that_is_not_put(
    kept: tuple[Workspace, str], service: ObjectService
) -> None:
    workspace, url = kept
    places = [place for folder in STORE for place in (workspace.root / folder).glob("??/*")]
    made_room = of_schema("store trim", asked(workspace.root, "store", "trim"))
    assert made_room == {"files": 0, "bytes": 0, "left": []}, "no limit is set"
    before = time.time() - 86_400.0
    for place in places:
        os.utime(place / INDEX if place.is_dir() else place, (before, before))
    used, only = the(workspace, "flight"), the(workspace, "conditioning")
    service.delete(url, name(only))
    with Catalogue.open(workspace.catalogue) as catalogue:
        local(workspace, catalogue, used.path)
        moved = transfer.trim(workspace, catalogue, 0)
    assert set(moved.left) == {used.path, only.path}
    assert moved.files == len(places) - 2
    left = [path for folder in STORE for path in (workspace.root / folder).glob("??/*")]
    assert {workspace.relative(path) for path in left} == {used.path, only.path}
    assert kinds(checked(workspace)) == ["not put"]
    assert read_all(workspace) > 15


def test_what_a_killed_trim_has_put_aside_goes_with_the_next(kept: tuple[Workspace, str]) -> None:
    workspace, _ = kept
    file = the(workspace, "conditioning")
    code = (
        "import os, sys; from pathlib import Path\n"
        "from aerodb.storage.disk_errors import temporary_beside\n"
        "os.replace(sys.argv[1], temporary_beside(Path(sys.argv[1])))\n"
    )
    done = run_forked([str(workspace.root / file.path)], environment(), code=code)
    assert done.returncode == 0, done.stderr
    assert kinds(checked(workspace)) == ["half-written"]
    with Catalogue.open(workspace.catalogue) as catalogue:
        transfer.trim(workspace, catalogue, 1 << 40)
    assert kinds(checked(workspace)) == []


def as_plain(workspace: Workspace, plain: Workspace) -> None:
    """Asserts that the one flight of a workspace has all results under the keys that it has without
    an object store."""
    ((flight, results),) = stored(workspace)["results"].items()
    assert set(results) <= set(stored(plain)["results"][flight])
    assert {step for step, _ in results} >= {
        "ingest",
        "conditioning",
        "consistency",
        "coefficients",
        "compare",
    }


def test_a_store_that_is_away_costs_a_run_but_loses_nothing(
    logs: list[Path],
    tmp_path: Path,
    service: ObjectService,
    plain: tuple[Workspace, dict[str, Any]],
) -> None:
    url = f"s3://{service.bucket()}/away"
    settings(tmp_path / "w", url)
    workspace = prepared(tmp_path / "w", logs[0].parent)
    service.stop()
    try:
        with pytest.raises(StoreBusyError, match="cannot be reached"):
            run_flow(flight_flow, {"logs": [str(logs[0])], "vehicle": NAME}, workspace, "direct")
    finally:
        service.start()
    assert stored(workspace)["flights"] == []
    assert service.names(url) == []
    run_flow(flight_flow, {"logs": [str(logs[0])], "vehicle": NAME}, workspace, "direct")
    as_plain(workspace, plain[0])
    assert checked(workspace, fetch=True).problems == []


@pytest.mark.campaign
def test_a_store_that_is_away_for_a_while_is_waited_for_under_prefect(
    logs: list[Path],
    tmp_path: Path,
    service: ObjectService,
    plain: tuple[Workspace, dict[str, Any]],
) -> None:
    """It comes back after the first file was to be put: the steps that could not do so are tried
    again by themselves."""
    root = tmp_path / "w"
    settings(root, f"s3://{service.bucket()}/for-a-while")
    workspace = prepared(root, logs[0].parent)

    def back_later() -> None:
        until = time.monotonic() + 90.0
        while not list((root / "flights").glob("??/*.parquet")) and time.monotonic() < until:
            time.sleep(0.05)
        time.sleep(2.0)
        service.start()

    service.stop()
    waiting = threading.Thread(target=back_later)
    waiting.start()
    try:
        words = ("--json", "flight", "ingest", str(logs[0]), "--vehicle", NAME)
        done = aerodb(root, *words, under_prefect=True)
    finally:
        waiting.join()
    assert done.returncode == 0, done.stderr
    as_plain(workspace, plain[0])
    assert ("flight_flow", "ephemeral", "completed") in ways(workspace)
    assert checked(workspace, fetch=True).problems == []


def test_a_workspace_moves_into_an_object_store_and_out_again(
    tmp_path: Path, service: ObjectService, plain: tuple[Workspace, dict[str, Any]]
) -> None:
    root, url = (
        Path(shutil.copytree(plain[0].root, tmp_path / "w")),
        f"s3://{service.bucket()}/moved",
    )
    workspace = Workspace.open(root)
    settings(root, url)
    assert set(kinds(checked(workspace))) == {"not put"}
    put = of_schema("store push", asked(root, "store", "push"))
    assert put["files"] == len(service.names(url)) > 18
    assert checked(workspace, fetch=True).problems == []
    empty_cache(workspace)
    assert of_schema("store pull", asked(root, "store", "pull"))["left"] == []
    (root / "settings.toml").unlink()
    service.stop()
    try:
        assert checked(workspace).problems == []
        assert read_all(workspace) > 15
        assert stored(workspace) == stored(plain[0])
    finally:
        service.start()


def test_a_log_of_the_inbox_is_an_object_before_it_leaves(
    logs: list[Path], tmp_path: Path, service: ObjectService
) -> None:
    root, url = tmp_path / "w", f"s3://{service.bucket()}/inbox"
    settings(root, url)
    (root / "settings.toml").write_text(
        (root / "settings.toml").read_text() + "[inbox]\nsettle = 0.0\n"
    )
    workspace = prepared(root, logs[0].parent)
    (workspace.inbox / NAME).mkdir()
    shutil.copy2(logs[0], workspace.inbox / NAME / "a.csv")
    run_flow(sweep_flow, {}, workspace, "direct")
    sha256 = hashlib.sha256(logs[0].read_bytes()).hexdigest()
    assert f"logs/{sha256[:2]}/{sha256}.csv.{sha256}" in service.names(url)
    assert not list((workspace.inbox / NAME).iterdir())
    empty_cache(workspace)
    assert checked(workspace, fetch=True).problems == []


def test_a_log_whose_flight_is_stored_waits_for_the_object_store_without_blame(
    kept: tuple[Workspace, str], logs: list[Path], service: ObjectService
) -> None:
    """Tries that only the service's absence ended once added up: after three sweeps such a log was
    put into quarantine."""
    workspace, url = kept
    path = workspace.root / "settings.toml"
    path.write_text(path.read_text() + "[inbox]\nsettle = 0.0\nattempts = 2\n")
    (workspace.inbox / NAME).mkdir()
    log = Path(shutil.copy2(logs[0], workspace.inbox / NAME / "a.csv"))
    service.stop()
    try:
        for _ in range(3):
            with pytest.raises(StoreError, match="cannot be reached"):
                run_flow(sweep_flow, {}, workspace, "direct")
            assert log.exists()
    finally:
        service.start()
    (ending,) = run_flow(sweep_flow, {}, workspace, "direct")["files"]
    assert ending["kind"] == "duplicate", "it was taken in by its name before"
    assert not log.exists()
    sha256 = hashlib.sha256(logs[0].read_bytes()).hexdigest()
    assert f"logs/{sha256[:2]}/{sha256}.csv.{sha256}" in service.names(url)


def test_a_night_keeps_the_cache_as_small_as_the_settings_say(kept: tuple[Workspace, str]) -> None:
    workspace, _ = kept
    path = workspace.root / "settings.toml"
    path.write_text(path.read_text() + "cache = 100000\n[loop]\nrun = []\n[inbox]\nsettle = 0.0\n")
    for place in (place for folder in STORE for place in (workspace.root / folder).glob("??/*")):
        os.utime(place / INDEX if place.is_dir() else place, (1e9, 1e9))
    trimmed = run_flow(nightly_flow, {}, workspace, "direct")["trimmed"]
    assert trimmed["error"] == ""
    held = sum(
        path.stat().st_size
        for folder in STORE
        for path in (workspace.root / folder).rglob("*")
        if path.is_file()
    )
    assert 0 < held <= 100_000 < held + trimmed["bytes"]
    assert read_all(workspace) > 15
