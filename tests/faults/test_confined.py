"""What a log costs after it was parsed: under the limits in a process of its own, so that one log of
a batch or of the inbox takes nothing from the others or from this process."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from aerodb.errors import CalculationError, InputError, StoreBusyError
from aerodb.flows.flight import again_flow, flight_flow
from aerodb.flows.inbox import sweep_flow
from aerodb.flows.run import How, Steps, requires, run_flow
from aerodb.logs import choose_mapping
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.limits import Limits
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.workspace import Workspace
from aerodb.tasks.actors import Actor, acting_as, user
from aerodb.tasks.steps import check_consistency, look_over, store_log
from aerodb.tasks.workers import OverLimitError, confined, parsed_log
from aerodb.tasks.workers.parsing import parsing
from aerodb.tasks.workers.pool import done
from tests.support.paths import ROOT
from tests.support.small_glider import NAME, VEHICLE, channels, write_files, write_parquet
from tests.support.sweeps import QUICK, kinds, left

pytestmark = pytest.mark.skipif(os.name == "nt", reason="no fork, no limits")
#: Little enough that the hostile log reaches it in a second, enough for honest flights.
LITTLE = "[limits]\nmemory = 300_000_000\n"
HOSTILE = "hostile.parquet"


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    made = Workspace.open(tmp_path / "w")
    with Catalogue.open(made.catalogue) as catalogue:
        catalogue.add_vehicle(NAME, VEHICLE + "rate = 50.0\n")
    return made


def sparse(path: Path, samples: int = 12_000) -> Path:
    """Samples 1.9 s apart, each of which the mapping's grid makes 95 at 50 Hz: half a megabyte
    becomes a flight of 1.1 million samples."""
    table = channels(1, seconds=samples / 25.0)
    table |= {"theta": table["alpha"], "phi": table["beta"], "psi": table["beta"]}
    table["time"] = 1.9 * np.arange(samples)
    return write_parquet(path, table)


def in_workspace(workspace: Workspace, settings: str) -> None:
    (workspace.root / "settings.toml").write_text(settings, encoding="utf-8")


# The limits themselves


def call(workspace: Workspace, function: Callable[..., Any], *arguments: Any) -> Any:
    where = {"workspace": str(workspace.root), "flight": "a", "what": "the work", "where": "log a"}
    return confined(function, *arguments, **where)


@pytest.mark.parametrize(
    ("settings", "function", "arguments", "said"),
    [
        ("memory = 50_000_000", bytes, (10**9,), "the work needs more than 50 MB of memory"),
        ("processor = 1.0", pow, (7, 10**8), "the work was stopped after 1 s of processor time"),
        ("wall = 0.2", time.sleep, (900.0,), "the work was stopped after 0.2 s"),
        ("", os.abort, (), r"the work crashed its process \(SIGABRT\)"),
        ("", os._exit, (7,), r"the work ended its process \(exit code 7\)"),
    ],
)
def test_work_that_breaks_a_limit_or_its_process_is_lost_alone(
    workspace: Workspace,
    settings: str,
    function: Callable[..., Any],
    arguments: tuple[Any, ...],
    said: str,
) -> None:
    in_workspace(workspace, f"[limits]\n{settings}\n")
    with pytest.raises(OverLimitError, match=rf"log a: {said}") as caught:
        call(workspace, function, *arguments)
    assert "[limits]" in caught.value.remedy
    assert call(workspace, os.getpid) != os.getpid()


@pytest.mark.parametrize("product", ["ones @ ones", "blas.dgemm(1.0, ones, ones)"])
def test_linear_algebra_needs_no_memory_of_its_own(workspace: Workspace, product: str) -> None:
    """BLAS takes buffers of 32 MB when it is first used, and ends the process if it gets none."""
    in_workspace(workspace, "[limits]\nmemory = 20_000_000\n")
    first = "import numpy; from scipy.linalg import blas; ones = numpy.ones((300, 300)); "
    assert call(workspace, exec, first + product) is None


#: Spends .4 s of processor time, and keeps 30 MB for good.
SPENDING = """
import builtins, time
builtins.held = [*getattr(builtins, "held", []), bytearray(30_000_000)]
until = time.process_time() + 0.4
while time.process_time() < until:
    pass
"""


def test_limits_count_from_each_job(workspace: Workspace) -> None:
    """A worker stays for many jobs; what earlier ones took is not counted to the next."""
    in_workspace(workspace, "[limits]\nmemory = 50_000_000\nprocessor = 1.0\n")
    worker = call(workspace, os.getpid)
    for _ in range(4):
        call(workspace, exec, SPENDING)
    assert call(workspace, os.getpid) == worker
    assert call(workspace, eval, "len(held)") == 4


FAILING = {
    "input": "from aerodb.errors import InputError\nraise InputError('a', 'b', 'c')",
    "busy": "from aerodb.errors import StoreBusyError\nraise StoreBusyError('locked')",
    "no class of a module": "class Odd(Exception): pass\nraise Odd('1 and 2')",
    "index": "[][7]",
}


@pytest.mark.parametrize(
    ("kind", "expected", "said"),
    [
        ("input", InputError, "b: a\nc"),
        ("busy", StoreBusyError, "locked"),
        ("no class of a module", CalculationError, r"log a: the work failed \(Odd: 1 and 2\)"),
        ("index", CalculationError, r"log a: the work failed \(IndexError: list"),
    ],
)
def test_errors_come_back_as_they_were_raised(
    workspace: Workspace, kind: str, expected: type[Exception], said: str
) -> None:
    with pytest.raises(expected, match=said) as caught:
        call(workspace, exec, FAILING[kind])
    assert type(caught.value) is expected


def test_worker_acts_as_its_caller(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    call(workspace, os.getpid)  # a worker of another folder, environment and actor
    monkeypatch.setenv("AERODB_EXAMPLE", "later")
    monkeypatch.chdir(tmp_path)
    with acting_as(Actor("anna", "ingest")):
        assert call(workspace, user) == "anna"
    assert call(workspace, user) == user()
    assert call(workspace, os.getenv, "AERODB_EXAMPLE") == "later"
    assert call(workspace, os.getcwd) == str(tmp_path)


#: Names of all variables of a process, and those that it or the one that forked it began with.
VARIABLES = "[*__import__('os').environ, open('/proc/self/environ').read()]"


@pytest.mark.skipif(not Path("/proc/self/environ").is_file(), reason="no /proc")
def test_process_that_parses_has_no_secrets(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Nor does the one that forks it; a worker for steps on flights has them, from its job. What
    chooses numerical kernels is no secret: without it, results would differ in the last digit."""
    monkeypatch.setenv("AERODB_EXAMPLE", "secret")
    monkeypatch.setenv("OPENBLAS_VERBOSE", "0")
    psutil.Process(call(workspace, os.getppid)).kill()  # the next one starts with the secret here
    job = parsing(tmp_path / "a.csv", tmp_path / "topics", Limits())
    seen = done(replace(job, function=eval, arguments=(VARIABLES,)))
    assert {"PATH", "OPENBLAS_VERBOSE"} <= set(seen)
    assert "AERODB_EXAMPLE" not in " ".join(seen)
    assert call(workspace, os.getenv, "AERODB_EXAMPLE") == "secret"


def test_process_that_parses_does_nothing_else(workspace: Workspace, tmp_path: Path) -> None:
    job = replace(parsing(tmp_path, tmp_path, Limits()), function=os.getpid, arguments=())
    parsers = {done(job), done(job)}
    assert len(parsers) == 2
    assert call(workspace, os.getpid) not in parsers
    assert not any(psutil.pid_exists(parser) for parser in parsers)


def test_worker_that_died_while_it_waited_is_replaced(workspace: Workspace) -> None:
    worker = call(workspace, os.getpid)
    os.kill(worker, signal.SIGKILL)
    psutil.wait_procs([psutil.Process(worker)] if psutil.pid_exists(worker) else [], timeout=0.1)
    assert call(workspace, os.getpid) not in (worker, os.getpid())


def test_end_of_all_workers_is_no_fault_of_a_log(workspace: Workspace) -> None:
    """Their server is killed while one works: the step may be tried again, and is done then."""
    server = psutil.Process(call(workspace, os.getppid))
    assert "aerodb.tasks.workers.server" in server.cmdline()
    killer = threading.Timer(0.3, server.kill)
    killer.start()
    with pytest.raises(StoreBusyError, match="log a: the processes for flights end unexpectedly"):
        call(workspace, time.sleep, 600.0)
    killer.join()
    assert call(workspace, os.getppid) != server.pid


def test_termination_is_left_to_the_run(workspace: Workspace) -> None:
    """A service manager ends all processes of a service at once; a worker is not to end first."""
    worker = call(workspace, os.getpid)
    for process in (worker, call(workspace, os.getppid)):
        os.kill(process, signal.SIGTERM)
    assert call(workspace, os.getpid) == worker


# A log that costs too much


def check_batch(outcomes: list[dict[str, Any]], said: str) -> dict[str, Any]:
    """The hostile log, in the middle, is refused with the limit; the others have all results."""
    first, hostile, last = outcomes
    for outcome in (first, last):
        assert outcome["status"] == "stored"
        assert outcome["consistency"]["key"]
        assert outcome["coefficients"]["key"]
    assert hostile["status"] == "refused"
    assert said in hostile["what"]
    assert Path(hostile["where"]).name == HOSTILE
    assert "[limits]" in hostile["remedy"]
    return hostile


@pytest.mark.parametrize("how", ["direct", pytest.param("auto", marks=pytest.mark.campaign)])
def test_log_whose_flight_takes_too_much_memory_is_refused_and_the_others_complete(
    workspace: Workspace, tmp_path: Path, how: How
) -> None:
    in_workspace(workspace, LITTLE)
    files = write_files(tmp_path / "files", 2)
    logs = [str(files[0]), str(sparse(tmp_path / HOSTILE)), str(files[1])]
    memory = psutil.Process().memory_info().rss
    outcomes = run_flow(flight_flow, {"logs": logs, "vehicle": NAME}, workspace, how)
    hostile = check_batch(outcomes, "the conversion into a flight needs more than 300 MB of memory")
    if how == "direct":  # under Prefect this process also imports the orchestrator
        assert psutil.Process().memory_info().rss - memory < 100e6
    held_back = workspace.root / "quarantine" / hostile["sha256"]
    assert sorted(path.name for path in held_back.iterdir()) == ["log.parquet", "reason.json"]


def test_log_of_the_inbox_is_quarantined_and_the_others_complete(
    workspace: Workspace, tmp_path: Path
) -> None:
    in_workspace(workspace, QUICK + LITTLE)
    folder = workspace.inbox / NAME
    folder.mkdir(parents=True)
    for file in write_files(tmp_path / "files", 2)[:2]:
        (folder / file.name).write_bytes(file.read_bytes())
    sparse(folder / HOSTILE)
    document = run_flow(sweep_flow, {}, workspace, "direct")
    assert kinds(document) == {
        "flight1.csv": "stored",
        "flight2.csv": "stored",
        HOSTILE: "quarantined",
    }
    assert left(workspace) == []
    (reason,) = [e["reason"] for e in document["files"] if e["kind"] == "quarantined"]
    assert "the conversion into a flight needs more than 300 MB of memory" in reason


def test_log_that_is_only_inspected_is_held_to_the_limits(
    workspace: Workspace, tmp_path: Path
) -> None:
    in_workspace(workspace, "[limits]\nmemory = 50_000_000\n")
    log = write_parquet(tmp_path / HOSTILE, channels(1, seconds=16_000.0))
    with parsed_log(log, tmp_path / "topics", Limits()) as parsed:
        mapping = choose_mapping(parsed.recording, builtin_mappings().values())
        document = look_over(parsed.folder, HOSTILE, mapping, str(workspace.root))
    assert f"{HOSTILE}: the conversion into a flight needs more than 50 MB" in document["refused"]
    assert document["suspicions"] == []


@requires("ingest")
def store_flow(steps: Steps, *, workspace: str, run: str, logs: list[str]) -> Any:
    return steps.map(store_log, logs, workspace=workspace, run=run, vehicle=NAME)


@requires("ingest")
def check_flow(steps: Steps, *, workspace: str, run: str, flights: list[str]) -> Any:
    return steps.map(check_consistency, flights, workspace=workspace, run=run)


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        ("memory = 100_000_000", "needs more than 100 MB of memory"),
        ("processor = 1.0", "was stopped after 1 s of processor time"),
    ],
)
def test_flight_whose_consistency_takes_too_much_is_rejected(
    workspace: Workspace, tmp_path: Path, limits: str, said: str
) -> None:
    """Once: no later step begins again what the consistency step could not bear."""
    log = sparse(tmp_path / HOSTILE, samples=6_000)
    (stored,) = run_flow(store_flow, {"logs": [str(log)]}, workspace, "direct")
    in_workspace(workspace, f"[limits]\n{limits}\n")
    document = run_flow(again_flow, {"flight": stored["flight"]}, workspace, "direct")
    with Catalogue.open(workspace.catalogue) as catalogue:
        row = catalogue.flight(stored["flight"])
    assert row.verdict == "rejected"
    (reason,) = row.reasons
    assert f"({HOSTILE}): the consistency step {said}" in reason
    assert document["consistency"]["key"] is None
    assert document["coefficients"]["key"] is None
    assert document["coefficients"]["reason"] == reason


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="no /proc")
def test_flight_whose_process_is_killed_is_rejected_and_the_others_complete(
    workspace: Workspace, tmp_path: Path
) -> None:
    """The signal is a real one, sent to the worker while it works on the long flight."""
    files = write_files(tmp_path / "files", 2)
    slow = sparse(tmp_path / HOSTILE, samples=6_000)
    logs = [str(files[0]), str(slow), str(files[1])]
    stored = run_flow(store_flow, {"logs": logs}, workspace, "direct")
    stop, killed = threading.Event(), []

    def kill() -> None:
        while not stop.wait(0.02):
            for process in psutil.Process().children(recursive=True):
                try:
                    own = process.parent()
                    if (
                        own is not None
                        and "aerodb.tasks.workers.server" in own.cmdline()
                        and process.memory_info().rss > own.memory_info().rss + 150e6
                    ):
                        os.kill(process.pid, signal.SIGSEGV)
                        killed.append(process.pid)
                        return
                except psutil.Error:
                    continue

    killer = threading.Thread(target=kill)
    killer.start()
    flights = [outcome["flight"] for outcome in stored]
    checked = run_flow(check_flow, {"flights": flights}, workspace, "direct")
    stop.set()
    killer.join()
    assert killed
    assert checked[1]["verdict"] == "rejected"
    assert "the consistency step crashed its process (SIGSEGV)" in checked[1]["reasons"][0]
    assert checked[0]["key"]
    assert checked[2]["key"]


_ALLOCATES = """
import resource, sys
import numpy as np
from aerodb.errors import AeroError
from aerodb.storage.limits import Limits
from aerodb.tasks.workers.pool import Job, done
if sys.argv[1] != "0":
    resource.setrlimit(resource.RLIMIT_AS, (int(sys.argv[1]),) * 2)
try:
    done(Job(np.ones, (10**9,), Limits(memory=7 * 10**9), "", "its parsing", "log", needs=()))
except AeroError as error:
    print(type(error).__name__)
"""


@pytest.mark.parametrize(("given", "kind"), [(0, "OverLimitError"), (6 * 10**9, "StoreBusyError")])
def test_a_memory_limit_of_the_environment_is_no_fault_of_the_log(given: int, kind: str) -> None:
    command = [sys.executable, "-c", _ALLOCATES, str(given)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, timeout=300)
    assert done.stdout == f"{kind}\n", done.stderr
