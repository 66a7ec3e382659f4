"""Lost and damaged objects of an object store: reported by name, refused by hash, repaired by the
reported remedy; and copies of an object store."""

import hashlib
from pathlib import Path
from typing import Any

import pytest

from aerodb.errors import InputError, StoreError
from aerodb.flows.flight import flight_flow
from aerodb.flows.run import run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.file_identity import StoredFile, measured
from aerodb.storage.disk_errors import is_temporary, remove
from aerodb.storage.files import transfer
from aerodb.storage.files.cache import local, local_recording
from aerodb.storage.files.flights import INDEX, files_of
from aerodb.storage.files.objects import DamagedObject, Objects
from aerodb.storage.upkeep.backup import back_up, restore
from aerodb.storage.upkeep.verification import verify
from aerodb.storage.workspace import Workspace
from aerodb.storage.workspace_settings import load_settings
from aerodb.tasks.workspace_access import access_workspace
from tests.support.command import asked
from tests.support.glider_runs import prepared, stored
from tests.support.object_service import ObjectService
from tests.support.object_store_runs import (
    another,
    checked,
    empty_cache,
    flight_of,
    kinds,
    name,
    processed,
    read_all,
    settings,
    the,
)
from tests.support.small_glider import NAME, write_files


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    return write_files(tmp_path_factory.mktemp("logs"), flights=2)


@pytest.fixture(scope="module")
def made(
    tmp_path_factory: pytest.TempPathFactory, service: ObjectService, logs: list[Path]
) -> tuple[Workspace, str]:
    """A workspace with two flights, its store at the address that comes second."""
    root, url = tmp_path_factory.mktemp("made"), f"s3://{service.bucket()}/tests/gliders"
    settings(root, url)
    workspace = prepared(root, logs[0].parent)
    run_flow(
        flight_flow, {"logs": [str(log) for log in logs], "vehicle": NAME}, workspace, "direct"
    )
    return workspace, url


@pytest.fixture
def kept(
    made: tuple[Workspace, str], service: ObjectService, tmp_path: Path
) -> tuple[Workspace, str]:
    """A workspace like that one with a bucket of its own, to be spoiled; and its address."""
    return another(*made, tmp_path / "w", service)


def test_a_lost_object_is_told_and_put_again_from_the_cache(
    kept: tuple[Workspace, str], service: ObjectService
) -> None:
    workspace, url = kept
    lost = [the(workspace, "flight"), the(workspace, "index")]
    for file in lost:
        service.delete(url, name(file))
    report = checked(workspace)
    assert kinds(report) == ["not put"] * 2
    assert {problem.where for problem in report.problems} == {file.path for file in lost}
    assert all("aerodb store push" in problem.remedy for problem in report.problems)
    assert asked(workspace.root, "store", "push")["files"] == 2
    assert checked(workspace, fetch=True).problems == []


def test_a_lost_result_that_is_nowhere_is_made_again(
    kept: tuple[Workspace, str], service: ObjectService
) -> None:
    workspace, url = kept
    file = the(workspace, "flight")
    service.delete(url, name(file))
    empty_cache(workspace)
    assert [(p.kind, p.where) for p in checked(workspace).problems] == [("missing", file.path)]
    processed(workspace, flight_of(workspace))
    assert name(file) in service.names(url)
    assert checked(workspace, fetch=True).problems == []


def test_a_damaged_object_is_refused_and_made_again_once_it_is_removed(
    kept: tuple[Workspace, str], service: ObjectService
) -> None:
    workspace, url = kept
    file = the(workspace, "flight")
    service.spoil(url, name(file))
    assert checked(workspace).problems == [], "its size is right, and the folder has it"
    report = checked(workspace, fetch=True)
    assert [(p.kind, p.where) for p in report.problems] == [("changed", f"{url}/{name(file)}")]
    assert "aerodb store push" in report.problems[0].remedy
    empty_cache(workspace)
    assert "recomputed" in checked(workspace, fetch=True).problems[0].remedy
    with pytest.raises(StoreError, match="differ from those that were stored") as caught:
        processed(workspace, flight_of(workspace))
    assert caught.value.where == f"{url}/{name(file)}"
    assert not list((workspace.root / "flights").rglob("*.parquet*"))
    service.delete(url, name(file))
    processed(workspace, flight_of(workspace))
    assert checked(workspace, fetch=True).problems == []


def test_a_lost_topic_makes_the_log_come_again(
    kept: tuple[Workspace, str], service: ObjectService, logs: list[Path]
) -> None:
    workspace, url = kept
    index = the(workspace, "index")
    folder = index.path.removesuffix(INDEX)
    topic = next(each for each in service.names(url) if each.startswith(f"{folder}0000"))
    service.delete(url, topic)
    empty_cache(workspace)
    (problem,) = checked(workspace).problems
    assert (problem.kind, problem.where) == ("missing", topic.rpartition(".")[0])
    sha256 = Path(folder).name.partition(".")[0]
    with (
        Catalogue.open(workspace.catalogue) as catalogue,
        pytest.raises(InputError, match="missing") as caught,
    ):
        local_recording(workspace, catalogue, sha256)
    assert caught.value.remedy == "ingest the log again"
    assert not [path for path in (workspace.root / "flights").rglob("*") if is_temporary(path)]
    assert "ingest its log again" in problem.remedy
    log = next(path for path in logs if hashlib.sha256(path.read_bytes()).hexdigest() == sha256)
    run_flow(flight_flow, {"logs": [str(log)], "vehicle": NAME}, workspace, "direct")
    assert checked(workspace, fetch=True).problems == []


def test_what_nobody_names_is_told_once_it_is_old(
    kept: tuple[Workspace, str], service: ObjectService, monkeypatch: Any
) -> None:
    workspace, url = kept
    service.client.put_object(
        **service.at(url, f"results/ab/{'ab' * 32}.parquet.{'cd' * 32}"), Body=b"nobody's"
    )
    service.client.put_object(**service.at(url, "flights/zz/readme"), Body=b"nobody's")
    report = checked(workspace)
    assert (report.problems, report.pending) == ([], 2)
    monkeypatch.setattr("aerodb.storage.upkeep.object_verification._SETTLED", -1.0)
    report = checked(workspace)
    assert kinds(report) == ["orphan object"] * 2
    assert report.problems[0].where == f"{url}/flights/zz/readme"


def test_a_damaged_file_of_the_cache_needs_no_more_than_to_be_removed(
    kept: tuple[Workspace, str],
) -> None:
    workspace, _ = kept
    path = workspace.root / the(workspace, "flight").path
    path.write_bytes(path.read_bytes()[:-1])
    (problem,) = checked(workspace).problems
    assert (problem.kind, problem.where) == ("changed", workspace.relative(path))
    assert problem.remedy.startswith("remove it: it is downloaded")
    path.unlink()
    assert checked(workspace).problems == []
    assert read_all(workspace) > 10


def test_a_backup_is_the_whole_store_and_goes_back_into_either(
    kept: tuple[Workspace, str], tmp_path: Path, service: ObjectService
) -> None:
    """Made without a cache; restored into a folder, into a new bucket, and into the one that it
    came from, which has gone on."""
    workspace, url = kept
    held, backup = stored(workspace), tmp_path / "b"
    empty_cache(workspace)
    made = back_up(workspace, backup)
    assert (made.problems, made.copied) == ((), made.files)
    assert made.files == len(service.names(url))
    assert back_up(workspace, backup).copied == 0
    (tmp_path / "folder.toml").write_text("")
    elsewhere = f"s3://{service.bucket()}/restored"
    (tmp_path / "elsewhere.toml").write_text(f'[store]\nurl = "{elsewhere}"\n')
    for name_of_one in ("folder", "elsewhere"):
        root = tmp_path / name_of_one
        assert restore(backup, root, tmp_path / f"{name_of_one}.toml")["problems"] == []
        assert stored(Workspace.open(root)) == held
        assert read_all(Workspace.open(root)) > 10
        assert checked(Workspace.open(root), fetch=True).problems == []
    assert service.names(elsewhere) == service.names(url)
    assert any("store.url" in each for each in restore(backup, tmp_path / "own")["left_off"])
    assert read_all(Workspace.open(tmp_path / "own")) > 10
    assert not load_settings(tmp_path / "own").store.url
    assert restore(backup, tmp_path / "again", backup / "settings.toml")["problems"] == []
    empty_cache(Workspace.open(tmp_path / "again"))
    assert read_all(Workspace.open(tmp_path / "again")) > 10


def test_a_backup_leaves_out_what_is_damaged_there_and_says_so(
    kept: tuple[Workspace, str], tmp_path: Path, service: ObjectService
) -> None:
    workspace, url = kept
    damaged, lost, here = (
        the(workspace, "flight"),
        the(workspace, "conditioning"),
        the(workspace, "coefficients"),
    )
    service.spoil(url, name(damaged))
    service.delete(url, name(lost))
    held = (workspace.root / here.path).read_bytes()
    empty_cache(workspace)
    (workspace.root / here.path).parent.mkdir(parents=True, exist_ok=True)
    (workspace.root / here.path).write_bytes(held[:-1])
    made = back_up(workspace, tmp_path / "b")
    said = {problem.where: problem.what for problem in made.problems}
    assert set(said) == {damaged.path, lost.path}
    assert "differ from those that were stored" in said[damaged.path]
    assert "not in the object store" in said[lost.path]
    assert (tmp_path / "b" / here.path).read_bytes() == held, (
        "damaged in the cache only: the object is copied"
    )
    (tmp_path / "folder.toml").write_text("")
    left = restore(tmp_path / "b", tmp_path / "new", tmp_path / "folder.toml")["problems"]
    assert {problem["where"] for problem in left} == {damaged.path, lost.path}


def _frozen(service: ObjectService, url: str, file: StoredFile) -> None:
    """An object that is listed, and whose reading is refused: a rule of the bucket has moved it to
    where nothing is read."""
    body = service.client.get_object(**service.at(url, name(file)))["Body"].read()
    service.client.put_object(**service.at(url, name(file)), Body=body, StorageClass="GLACIER")


def test_what_may_not_be_read_is_not_taken_for_damaged(
    kept: tuple[Workspace, str], tmp_path: Path, service: ObjectService
) -> None:
    workspace, url = kept
    back_up(workspace, tmp_path / "b")
    manifest = (tmp_path / "b" / "backup.json").read_bytes()
    held = stored(workspace)
    for kind in ("flight", "index"):
        file = the(workspace, kind)
        _frozen(service, url, file)
        empty_cache(workspace)
        (tmp_path / "b" / file.path).unlink()
        with Catalogue.open(workspace.catalogue) as catalogue:
            for read in (
                lambda catalogue=catalogue: verify(workspace, catalogue, fetch=True),
                lambda catalogue=catalogue: transfer.pull(workspace, catalogue),
                lambda _=None: back_up(workspace, tmp_path / "b"),
            ):
                with pytest.raises(StoreError, match=r"refuses access|storage class") as caught:
                    read()
                assert not isinstance(caught.value, DamagedObject)
        assert (tmp_path / "b" / "backup.json").read_bytes() == manifest
    assert stored(workspace) == held


@pytest.mark.parametrize("fault", ["spoil", "delete"])
def test_below_an_index_that_is_nowhere_no_topic_is_called_an_orphan(
    kept: tuple[Workspace, str], service: ObjectService, monkeypatch: pytest.MonkeyPatch, fault: str
) -> None:
    workspace, url = kept
    index = the(workspace, "index")
    getattr(service, fault)(url, name(index))
    empty_cache(workspace)
    monkeypatch.setattr("aerodb.storage.upkeep.object_verification._SETTLED", -1.0)
    (problem,) = checked(workspace, fetch=True).problems
    assert problem.kind == {"spoil": "changed", "delete": "missing"}[fault]
    assert index.path in problem.where


def test_an_index_is_not_put_without_its_topics(
    kept: tuple[Workspace, str], tmp_path: Path, service: ObjectService
) -> None:
    workspace, url = kept
    index = the(workspace, "index")
    folder = index.path.removesuffix(INDEX)
    for each in service.names(url):
        if each.startswith(folder):
            service.delete(url, each)
    topic = workspace.root / folder / "0000.parquet"
    topic.write_bytes(topic.read_bytes()[:-1])
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert transfer.push(workspace, catalogue).left == (f"{folder}0000.parquet", index.path)
    assert name(index) not in service.names(url)
    assert [problem.where for problem in back_up(workspace, tmp_path / "b").problems] == [
        f"{folder}0000.parquet"
    ]
    (tmp_path / "elsewhere.toml").write_text(f'[store]\nurl = "s3://{service.bucket()}/restored"\n')
    left = restore(tmp_path / "b", tmp_path / "new", tmp_path / "elsewhere.toml")["problems"]
    assert {problem["where"] for problem in left} == {f"{folder}0000.parquet", index.path}


def test_what_another_writes_while_it_is_verified_is_no_problem(
    kept: tuple[Workspace, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    workspace, _ = kept
    written, below = [], Objects.below

    def listed(objects: Objects, folder: str) -> dict[str, tuple[StoredFile, float]]:
        found = below(objects, folder)
        path = workspace.root / folder / f"{'ab' * 32}.json"
        path.write_text("of another run")
        file = objects.put(path, workspace.relative(path))
        catalogue.add_file(file.path, file.sha256, file.size)
        written.append(file)
        return found

    monkeypatch.setattr(Objects, "below", listed)
    with Catalogue.open(workspace.catalogue) as catalogue:
        assert verify(workspace, catalogue).problems == []
    assert written


def test_what_leaves_the_cache_meanwhile_is_fetched_again_and_no_fault(
    kept: tuple[Workspace, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Another process trims the same folder, just before what is there is used, read or removed
    here."""
    workspace, _ = kept
    file, index = the(workspace, "flight"), the(workspace, "index")
    folder = (workspace.root / index.path).parent
    with Catalogue.open(workspace.catalogue) as catalogue:
        with monkeypatch.context() as patched:
            patched.setattr(
                "aerodb.storage.files.cache._used",
                lambda place: remove(place.parent if place.name == INDEX else place),
            )
            assert measured(local(workspace, catalogue, file.path)) == (file.sha256, file.size)
            assert (
                local_recording(workspace, catalogue, folder.name.partition(".")[0]) / INDEX
            ).is_file()
        with monkeypatch.context() as patched:
            patched.setattr(
                "aerodb.storage.upkeep.verification.files_of",
                lambda folder: [remove(folder), files_of(folder)][1],
            )
            assert verify(workspace, catalogue).problems == []
            assert not folder.exists()
        with monkeypatch.context() as patched:
            patched.setattr(
                "aerodb.storage.files.transfer._is_idle", lambda place: remove(place) is None
            )
            assert transfer.trim(workspace, catalogue, 0) == transfer.TransferReport(0, 0, ())
        assert read_all(workspace) > 10


def test_a_row_is_never_of_bytes_that_are_not_put(
    kept: tuple[Workspace, str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A file is written once more between its hash and its object: it is refused, and what was
    noted before still counts."""
    workspace, _ = kept
    file, access = the(workspace, "flight"), access_workspace(str(workspace.root))
    path = workspace.root / file.path

    def overtaken(path: Path) -> tuple[str, int]:
        found = measured(path)
        path.write_bytes(path.read_bytes() + b"more")
        return found

    monkeypatch.setattr("aerodb.tasks.workspace_access.measured", overtaken)
    with pytest.raises(InputError, match="changed while it was read"):
        access.keep_file(path, StoredFile(file.path, "cd" * 32, file.size))
    assert access.catalogue.stored_file(file.path) == file
