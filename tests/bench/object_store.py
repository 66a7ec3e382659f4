"""What an object store costs: one flight taken in and read again, its files in a folder, or on a
service, with and without cache.

``python -m tests.bench.object_store``. The service is moto's, in this process. What another one
costs is its bytes, and its requests, which are counted here, times what it takes for one. Nothing
here asserts.
"""

import logging
import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from aerodb.examples.phoenix import read_example
from aerodb.flows.demo import write_logs
from aerodb.flows.flight import flight_flow
from aerodb.flows.run import run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.files.transfer import STORE
from aerodb.storage.workspace import Workspace
from aerodb.tasks.steps.coefficients import load_coefficients
from aerodb.tasks.workspace_access import access_workspace
from tests.support.object_service import ObjectService, object_service

VEHICLE = "phoenix"
_RUNS = 3


class _Requests(logging.Handler):
    """How many requests the service has answered: its server logs each."""

    def __init__(self) -> None:
        super().__init__()
        self.number = 0

    def emit(self, record: logging.LogRecord) -> None:
        self.number += '"' in record.getMessage()


def _workspace(root: Path, url: str = "") -> Workspace:
    workspace = Workspace.open(root)
    if url:
        (root / "settings.toml").write_text(f'[store]\nurl = "{url}"\n')
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_vehicle(VEHICLE, read_example("vehicle.toml"))
    return workspace


def _ingest(workspace: Workspace, log: Path) -> None:
    (outcome,) = run_flow(
        flight_flow, {"logs": [str(log)], "vehicle": VEHICLE}, workspace, "direct"
    )
    assert outcome["flight"], outcome


def _read(workspace: Workspace) -> None:
    """What every later step does first: the flight, what was found of its sensors, its
    coefficients."""
    access = access_workspace(str(workspace.root))
    load_coefficients(access, access.catalogue.flights(VEHICLE)[0], access.catalogue.runs()[0].id)


def _cold(workspace: Workspace) -> None:
    for folder in STORE:
        shutil.rmtree(workspace.root / folder)
    Workspace.open(workspace.root)


def _say_files(workspace: Workspace, what: str) -> None:
    sizes = [
        path.stat().st_size
        for folder in STORE
        for path in (workspace.root / folder).rglob("*")
        if path.is_file()
    ]
    print(f"{len(sizes)} files {what}, {sum(sizes) / 1e6:.1f} MB")


def _timed(
    what: str, work: Callable[[], None], before: Callable[[], None], requests: _Requests
) -> None:
    taken = []
    for _ in range(_RUNS):
        before()
        number, start = requests.number, time.perf_counter()
        work()
        taken.append((time.perf_counter() - start, requests.number - number))
    print(f"{what:34} {min(taken)[0]:7.3f} s  {taken[-1][1]:4d} requests")


def measure(service: ObjectService, folder: Path, requests: _Requests) -> None:
    """Prints a line per case: the shortest of a few runs, and the requests of one."""
    (log,) = write_logs(folder / "logs", 1, 5)
    print(f"log: {log.stat().st_size / 1e6:.1f} MB")
    made: list[Workspace] = []

    def fresh(url: bool) -> Callable[[], None]:
        def make() -> None:
            address = f"s3://{service.bucket()}/bench" if url else ""
            made.append(_workspace(folder / f"w{len(made)}", address))

        return make

    fresh(False)()
    _ingest(made[-1], log)  # what is loaded and compiled once is no part of it
    for name, url in (("folder", False), ("object store", True)):
        _timed(f"ingest, {name}", lambda: _ingest(made[-1], log), fresh(url), requests)
        if url:
            _say_files(made[-1], "put")
        _timed(
            f"read, {name}" + (", in the cache" if url else ""),
            lambda: _read(made[-1]),
            lambda: None,
            requests,
        )
    _timed(
        "read, object store, empty cache",
        lambda: _read(made[-1]),
        lambda: _cold(made[-1]),
        requests,
    )
    _say_files(made[-1], "fetched")


if __name__ == "__main__":
    counting = _Requests()
    with object_service() as running, tempfile.TemporaryDirectory() as temporary:
        log = logging.getLogger("werkzeug")
        log.setLevel(logging.INFO)
        log.handlers, log.propagate = [counting], False
        measure(running, Path(temporary), counting)
