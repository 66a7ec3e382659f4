"""`make bench`, running by itself: a night beside more and more stored flights, Prefect's share, a
second worker, and what a million flights would cost."""

import json
import os
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from aerodb.flows.flight import flight_flow
from aerodb.flows.nightly import nightly_flow
from aerodb.flows.run import run_flow
from aerodb.storage.workspace import Workspace
from tests.bench.closed_loop import campaign
from tests.support.clusters import cluster
from tests.support.end_to_end import environment, prefect_server
from tests.support.glider_runs import prepared
from tests.support.small_glider import MODEL, NAME, channels, write_csv, write_files

MILLION = 1_000_000
#: No loop is due in these nights: what they measure is the sweep, the per-flight run and the look
#: at what is due.
QUIET = '[inbox]\nsettle = "0.01 s"\n[loop]\nafter = 1_000_000\n'
#: In these one is: the declared update over the newest flights, at most ten of them.
UPDATING = (
    '[inbox]\nsettle = "0.01 s"\n[loop]\nafter = 1\nnewest = 10\nrun = ["update"]\nmodel ='
    ' "increments.toml"\n'
)


def running(folder: Path, sizes: Sequence[int] = (10, 100, 1000), flights: int = 8) -> None:
    """All of it; `sizes`: so many flights are stored beside the new one. `flights` of a minute go
    to one worker, and to two."""
    night, catalogue = nights(folder / "nights", sizes)
    minutes = campaign(folder / "minutes", flights, 60.0)
    seconds, store = one_minute(folder / "minutes", minutes)
    workers(folder / "minutes", minutes)
    projection(
        night, seconds, catalogue, store, sum(log.stat().st_size for log in minutes) / len(minutes)
    )


def nights(folder: Path, sizes: Sequence[int]) -> tuple[float, float]:
    """A night with one new flight beside so many stored ones. Returns the last one's seconds, and
    the catalogue's bytes per flight."""
    logs = write_files(folder / "files", 1)
    workspace = prepared(folder / "workspace", logs[0].parent)
    (workspace.root / "increments.toml").write_text(MODEL, encoding="utf-8")
    (workspace.inbox / NAME).mkdir()
    print(
        "nightly flow with one new flight, direct, beside stored ones (median of 5; of 3 with an"
        " update over the newest ten)"
    )
    stored, first, quiet = 0, {}, 0.0
    sized: list[tuple[int, float]] = []
    for size in sizes:
        stored = _grown(workspace, folder / "files", stored, size)
        quiet = _night(workspace, QUIET, stored, 5)
        updating = _night(workspace, UPDATING, stored + 5, 3)
        stored += 8
        first = first or {"quiet": quiet, "updating": updating}
        sized.append((stored, _bytes(workspace)["catalogue"]))
        update = f"with an update {updating:7.3f} s ({updating / first['updating']:.2f} x)"
        print(
            f"  {size:6} stored {quiet:7.3f} s ({quiet / first['quiet']:.2f} x); {update};"
            f" {_bytes_text(workspace)}"
        )
    (fewest, small), (most, large) = sized[0], sized[-1]
    return quiet, (large - small) / max(most - fewest, 1)


def _grown(workspace: Workspace, folder: Path, stored: int, size: int) -> int:
    """Takes in tiny flights until `size` are stored."""
    logs = [
        write_csv(folder / f"stored{k}.csv", channels(k, seconds=6.0)) for k in range(stored, size)
    ]
    for start in range(0, len(logs), 100):
        batch = [str(log) for log in logs[start : start + 100]]
        run_flow(flight_flow, {"logs": batch, "vehicle": NAME}, workspace, "direct")
    return max(stored, size)


def _night(workspace: Workspace, settings: str, seed: int, times: int) -> float:
    (workspace.root / "settings.toml").write_text(settings, encoding="utf-8")
    taken = []
    for k in range(times):
        write_csv(
            workspace.inbox / NAME / f"new{seed + k}.csv",
            channels(1_000_000 + seed + k, seconds=6.0),
        )
        time.sleep(0.05)
        begun = time.perf_counter()
        document = run_flow(nightly_flow, {}, workspace, "direct")
        taken.append(time.perf_counter() - begun)
        assert [entry["kind"] for entry in document["files"]] == ["stored"], document
        assert all(not loop["error"] for loop in document["loops"]), document
    return statistics.median(taken)


def _bytes(workspace: Workspace) -> dict[str, float]:
    """Bytes of the catalogue (with its write-ahead log) and of the store."""
    catalogue = sum(path.stat().st_size for path in workspace.root.glob("catalogue.sqlite*"))
    folders = ("flights", "results", "logs")
    store = sum(
        path.stat().st_size
        for name in folders
        for path in (workspace.root / name).rglob("*")
        if path.is_file()
    )
    return {"catalogue": float(catalogue), "store": float(store)}


def _bytes_text(workspace: Workspace) -> str:
    return ", ".join(f"{name} {count / 1e6:.1f} MB" for name, count in _bytes(workspace).items())


#: Runs flights one by one, each a run of its own, in a process that has its imports and its
#: connections behind it.
ONE_BY_ONE = """
import json, sys, time
from pathlib import Path
from aerodb.flows.flight import flight_flow
from aerodb.flows.run import run_flow
from aerodb.storage.workspace import Workspace
how, root, *logs = sys.argv[1:]
workspace = Workspace.open(Path(root))
taken = []
for log in logs:
    begun = time.perf_counter()
    (outcome,) = run_flow(flight_flow, {"logs": [log], "vehicle": "phoenix"}, workspace, how)
    taken.append(time.perf_counter() - begun)
    assert outcome["comparison"]["key"], outcome
print(json.dumps(taken[1:]))
"""


def one_minute(folder: Path, logs: Sequence[Path]) -> tuple[float, float]:
    """A one-minute flight at 50 Hz, directly and under a Prefect server; returns the seconds of the
    direct one, and the bytes that the store holds of it."""
    made: dict[str, float] = {}
    with prefect_server(folder) as url:
        for name, how, more in (
            ("direct", "direct", {}),
            ("Prefect", "auto", {"PREFECT_API_URL": url}),
        ):
            workspace = _copied(folder, f"overhead-{how}")
            command = [
                sys.executable,
                "-c",
                ONE_BY_ONE,
                how,
                str(workspace.root),
                *map(str, logs[:6]),
            ]
            made[name] = statistics.median(_answer(command, environment(**more)))
    share = 100.0 * (made["Prefect"] / made["direct"] - 1.0)
    print("per-flight run of a flight of 60 s at 50 Hz, the demo's aircraft, warm (median of 5)")
    print(
        f"  direct {made['direct']:.2f} s, under a Prefect server {made['Prefect']:.2f} s:"
        f" {share:+.0f} %"
    )
    return made["direct"], _bytes(Workspace.open(folder / "overhead-direct"))["store"] / 6


def _answer(command: list[str], given: dict[str, str]) -> Any:
    done = subprocess.run(command, env=given, capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(done.stderr)
    return json.loads(done.stdout.splitlines()[-1])


def _copied(folder: Path, name: str) -> Workspace:
    shutil.copytree(folder / "workspace", folder / name)
    return Workspace.open(folder / name)


def workers(folder: Path, logs: Sequence[Path]) -> None:
    """The same flights through one worker and through two, each warm. The processor time that each
    worker spent says what two free cores would give, on a machine that has other things to do
    meanwhile."""
    taken, spent = {}, {}
    for count in (1, 2):
        (folder / f"dask{count}").mkdir()
        with cluster(folder / f"dask{count}", workers=count) as dask:
            warm, workspace = (_copied(folder, f"{name}{count}") for name in ("warm", "workers"))
            for each in (warm, workspace):
                (each.root / "settings.toml").write_text(dask.settings(), encoding="utf-8")
            _sent(warm, logs[:count])
            before = _processor_seconds(dask.at_work())
            taken[count] = _sent(workspace, logs)
            spent[count] = [
                after - first
                for first, after in zip(before, _processor_seconds(dask.at_work()), strict=True)
            ]
    load = f"{os.cpu_count()} cores, load {os.getloadavg()[0]:.1f} in the last minute"
    print(f"{len(logs)} flights of 60 s on Dask workers of this machine ({load})")
    print(f"  one {taken[1]:.2f} s, two {taken[2]:.2f} s: {taken[1] / taken[2]:.2f} times")
    each = " and ".join(f"{seconds:.1f}" for seconds in spent[2])
    print(
        f"  processor time: one {sum(spent[1]):.1f} s, two {each} s: at best"
        f" {sum(spent[1]) / max(spent[2]):.2f} times"
    )


def _processor_seconds(processes: Sequence[int]) -> list[float]:
    """What each process has spent, with the readers of logs that it keeps."""
    import psutil

    families = [
        [psutil.Process(pid), *psutil.Process(pid).children(recursive=True)] for pid in processes
    ]
    return [sum(sum(member.cpu_times()[:4]) for member in family) for family in families]


def _sent(workspace: Workspace, logs: Sequence[Path]) -> float:
    begun = time.perf_counter()
    outcomes = run_flow(
        flight_flow, {"logs": [str(log) for log in logs], "vehicle": "phoenix"}, workspace, "direct"
    )
    assert all(outcome["comparison"]["key"] for outcome in outcomes)
    return time.perf_counter() - begun


def projection(night: float, seconds: float, catalogue: float, store: float, log: float) -> None:
    """What a million flights of one minute would cost, from what was measured of one."""
    print("projected for 1,000,000 flights of 60 s at 50 Hz, taken in one after the other")
    print(f"  processing on one core {seconds * MILLION / 86_400:8.0f} days ({seconds:.2f} s each)")
    print(
        f"  the night with one new {night:8.2f} s, where it stays as it was measured beside the"
        " most"
    )
    print(
        f"  catalogue              {catalogue * MILLION / 1e9:8.1f} GB ({catalogue / 1e3:.1f} kB"
        " each)"
    )
    print(f"  store                  {store * MILLION / 1e12:8.2f} TB ({store / 1e6:.2f} MB each)")
    print(f"  logs as they came      {log * MILLION / 1e12:8.2f} TB ({log / 1e6:.2f} MB each)")
