"""A workspace with an object store, as its tests take it apart: its files, its cache, its
catalogue, what verifying says."""

import shutil
import sqlite3
from pathlib import Path

from aerodb.flight import Flight
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.file_identity import StoredFile, measured
from aerodb.storage.files.cache import local, local_recording
from aerodb.storage.files.flights import INDEX, read_recording
from aerodb.storage.upkeep.problems import VerificationReport
from aerodb.storage.upkeep.verification import verify
from aerodb.storage.workspace import Workspace
from aerodb.tasks.steps.ingest import load_flight
from aerodb.tasks.workspace_access import access_workspace
from tests.support.object_service import ObjectService
from tests.support.small_glider import NAME

STORE = ("flights", "results", "logs")


def settings(root: Path, url: str) -> None:
    root.mkdir(exist_ok=True)
    (root / "settings.toml").write_text(f'[store]\nurl = "{url}"\n')


def empty_cache(workspace: Workspace) -> None:
    for folder in STORE:
        shutil.rmtree(workspace.root / folder)
    Workspace.open(workspace.root)


def checked(workspace: Workspace, fetch: bool = False) -> VerificationReport:
    with Catalogue.open(workspace.catalogue) as catalogue:
        return verify(workspace, catalogue, fetch)


def kinds(report: VerificationReport) -> list[str]:
    return sorted(problem.kind for problem in report.problems)


def named(workspace: Workspace) -> list[StoredFile]:
    with Catalogue.open(workspace.catalogue) as catalogue:
        return list(catalogue.every_stored_file())


def read_all(workspace: Workspace) -> int:
    """Reads every file that the catalogue names by the way in which the product does; how many
    there are."""
    found = named(workspace)
    with Catalogue.open(workspace.catalogue) as catalogue:
        for file in found:
            if file.path.endswith(INDEX):
                folder = local_recording(
                    workspace, catalogue, Path(file.path).parent.name.partition(".")[0]
                )
                assert all(len(topic.time) for topic in read_recording(folder).topics.values())
            assert measured(local(workspace, catalogue, file.path)) == (file.sha256, file.size)
    return len(found)


def flight_of(workspace: Workspace) -> str:
    with Catalogue.open(workspace.catalogue) as catalogue:
        return catalogue.flights(NAME)[0].id


def the(workspace: Workspace, kind: str) -> StoredFile:
    """The first flight's file (``flight``), its recording's index (``index``), or what conditioning
    found in it."""
    with Catalogue.open(workspace.catalogue) as catalogue:
        row = catalogue.flights(NAME)[0]
        if kind == "index":
            path = workspace.relative(workspace.recording_path(row.log_sha256) / INDEX)
        else:
            path = catalogue.results_of(row.id, {"flight": "ingest"}.get(kind, kind))[-1].path
        found = catalogue.stored_file(path)
    assert found is not None
    return found


def copy_catalogue(source: Workspace, target: Workspace) -> None:
    """What the catalogue of one is, that of the other is, too: as if both had the same one."""
    for path in target.root.glob("catalogue.sqlite*"):
        path.unlink()
    reading, writing = sqlite3.connect(source.catalogue), sqlite3.connect(target.catalogue)
    reading.backup(writing)
    reading.close()
    writing.close()


def processed(workspace: Workspace, flight: str) -> Flight:
    """The flight (its id) as a step loads it; made again where its file is lost."""
    access = access_workspace(str(workspace.root))
    return load_flight(access, access.catalogue.flight(flight), access.catalogue.runs()[0].id)[0]


def name(file: StoredFile) -> str:
    return f"{file.path}.{file.sha256}"


def another(
    made: Workspace, made_url: str, root: Path, service: ObjectService
) -> tuple[Workspace, str]:
    """A workspace in `root` like the one that was `made`, with a bucket of its own, to be spoiled;
    and its address."""
    url = f"s3://{service.bucket()}/spoiled"
    for each in service.names(made_url):
        service.client.copy_object(**service.at(url, each), CopySource=service.at(made_url, each))
    shutil.copytree(made.root, root)
    settings(root, url)
    return Workspace.open(root), url
