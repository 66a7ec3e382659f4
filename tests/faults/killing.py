"""Runs killed (SIGKILL) at random moments, then repeated: `main` with ``UNDISTURBED FOLDER SEED
TRIALS`` as arguments, where `make_undisturbed` has left in UNDISTURBED what the runs end as.

A separate process with one thread: each run is a fork of it, so a trial costs no imports. Prints
one JSON line per trial.
"""

import json
import os
import shutil
import signal
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from aerodb.errors import AeroError
from aerodb.flows.close_loop import close_loop_flow
from aerodb.flows.flight import flight_flow
from aerodb.flows.release import promote_flow
from aerodb.flows.run import run_flow
from aerodb.flows.update import update_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.upkeep.verification import verify
from aerodb.storage.workspace import Workspace
from tests.support.forking import IMPORTED
from tests.support.glider_runs import prepared, rows, stored
from tests.support.small_glider import MODEL, NAME, state_of, write_files

for _name in IMPORTED:  # what runs import when they need it: here once, so that no fork does
    import_module(_name)
#: What a kill may leave behind until the run is done again: nothing that anybody could take for the
#: truth.
HARMLESS = {"half-written", "orphan"}
Stage = Callable[[Workspace, list[Path]], Any]


def _ids(workspace: Workspace) -> tuple[str, list[str], str]:
    """The released version, all flights, and the candidate (empty: none)."""
    with Catalogue.open(workspace.catalogue) as catalogue:
        names = catalogue.names(NAME)
        return (
            names["released"],
            sorted(row.id for row in catalogue.flights(NAME)),
            names.get("candidate", ""),
        )


def per_flight(workspace: Workspace, logs: list[Path]) -> Any:
    parameters = {"logs": [str(log) for log in logs], "vehicle": NAME}
    outcomes = run_flow(flight_flow, parameters, workspace, "direct")
    assert {outcome["status"] for outcome in outcomes} <= {"stored", "duplicate"}


def update(workspace: Workspace, logs: list[Path]) -> Any:
    released, flights, _ = _ids(workspace)
    parameters = {"vehicle": NAME, "baseline": released, "flights": flights, "model": MODEL}
    run_flow(update_flow, parameters, workspace, "direct")


def promotion(workspace: Workspace, logs: list[Path]) -> Any:
    parameters = {"version": _ids(workspace)[2], "name": "released", "reason": "proved"}
    run_flow(promote_flow, parameters, workspace, "direct")


def close_loop(workspace: Workspace, logs: list[Path]) -> Any:
    released, flights, _ = _ids(workspace)
    parameters = {
        "vehicle": NAME,
        "baseline": released,
        "flights": flights,
        "accept_ambiguous": ["alpha_slope"],
    }
    run_flow(close_loop_flow, parameters, workspace, "direct")


STAGES: dict[str, Stage] = {
    "per_flight": per_flight,
    "close_loop": close_loop,
    "update": update,
    "promotion": promotion,
}


def begun(stage: Stage, workspace: Workspace, logs: list[Path]) -> int:
    """Begins a stage in a fork; returns its process, which ends with 0, with 1 for an error that
    says what to do, else with 2."""
    child = os.fork()
    if child == 0:
        try:
            stage(workspace, logs)
        except BaseException as error:
            print(f"{type(error).__name__}: {error}", file=sys.stderr, flush=True)
            os._exit(1 if isinstance(error, AeroError) else 2)
        os._exit(0)
    return child


def forked(
    stage: Stage, workspace: Workspace, logs: list[Path], kill_after: float | None = None
) -> tuple[float, int]:
    """Runs a stage in a fork, killed after so many seconds; how long it took, and its exit code
    (negative: the signal)."""
    start = time.monotonic()
    child = begun(stage, workspace, logs)
    while kill_after is not None and time.monotonic() - start < kill_after:
        ended, status = os.waitpid(child, os.WNOHANG)
        if ended:
            return time.monotonic() - start, os.waitstatus_to_exitcode(status)
        time.sleep(0.002)
    if kill_after is not None:
        os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    return time.monotonic() - start, os.waitstatus_to_exitcode(status)


def picture(workspace: Workspace) -> dict[str, Any]:
    """What must be the same as without the kill: ids, keys, roles, rows, names and their moves, and
    every file of the store."""
    with Catalogue.open(workspace.catalogue) as catalogue:
        moves = [(e.name, e.step, e.version, e.previous) for e in catalogue.name_history(NAME)]
        logs = [(row.sha256, row.status) for row in catalogue.logs()]
    files = {
        name: sha256
        for name, sha256 in state_of(workspace.root).items()
        if name.startswith(("flights/", "results/"))
    }
    shown = {
        **stored(workspace),
        "moves": moves,
        "logs": sorted(logs),
        "files": files,
        "rows": rows(workspace),
    }
    found: dict[str, Any] = json.loads(json.dumps(shown))
    return found


def problems(workspace: Workspace) -> list[tuple[str, str, str]]:
    with Catalogue.open(workspace.catalogue) as catalogue:
        return [
            (problem.kind, problem.where, problem.what)
            for problem in verify(workspace, catalogue).problems
        ]


@dataclass(frozen=True)
class Undisturbed:
    """Stage -> a copy of the workspace before it, how long it takes, and the picture after it; and
    the logs."""

    logs: list[Path]
    stages: dict[str, tuple[Path, float, dict[str, Any]]]

    @classmethod
    def read(cls, folder: Path) -> "Undisturbed":
        told = json.loads((folder / "undisturbed.json").read_text())
        stages = {name: (folder / f"before-{name}", *entry) for name, entry in told.items()}
        return cls(sorted((folder / "logs").glob("*.csv")), stages)


def make_undisturbed(folder: Path) -> None:
    """Run all stages, and leave in `folder` what `Undisturbed` reads."""
    logs = write_files(folder / "logs", flights=3)
    workspace = prepared(folder / "undisturbed", logs[0].parent)
    found = {}
    for name, stage in STAGES.items():
        before = folder / f"before-{name}"
        shutil.copytree(workspace.root, before)
        seconds, code = forked(stage, workspace, logs)
        assert code == 0, name
        assert problems(workspace) == [], name
        found[name] = (seconds, picture(workspace))
    (folder / "undisturbed.json").write_text(json.dumps(found))


def cleared(folder: Path) -> None:
    """Removes a workspace; a reader of logs whose run has ended may still be at its last file
    there."""
    until = time.monotonic() + 60
    while folder.exists():
        try:
            shutil.rmtree(folder)
        except OSError:
            if time.monotonic() > until:
                raise
            time.sleep(0.05)


def trial(
    folder: Path, before: Path, logs: list[Path], stage: Stage, kill_after: float
) -> tuple[int, dict[str, Any]]:
    """One kill and the run after it: how the killed run ended, what was left then, what is wrong at
    the end, and the picture."""
    workspace = Workspace.open(Path(shutil.copytree(before, folder / "trial")))
    try:
        _, code = forked(stage, workspace, logs, kill_after)
        left = problems(workspace)
        _, again = forked(stage, workspace, logs)
        said = {
            "left": left,
            "again": again,
            "wrong": problems(workspace),
            "picture": picture(workspace),
        }
        return code, said
    finally:
        cleared(folder / "trial")


def main() -> None:
    undisturbed, folder = Undisturbed.read(Path(sys.argv[1])), Path(sys.argv[2])
    seed, trials = int(sys.argv[3]), int(sys.argv[4])
    logs, expected = undisturbed.logs, undisturbed.stages
    generator = np.random.default_rng(seed)
    for number in range(trials):
        name = list(STAGES)[number % len(STAGES)]
        before, seconds, wanted = expected[name]
        moment = float(generator.uniform(0.0, 1.0)) * seconds
        code, said = trial(folder, before, logs, STAGES[name], moment)
        while (
            code != -signal.SIGKILL
        ):  # it ended before its kill came (the measured duration held a first run): earlier
            assert code == 0, name
            moment *= 0.7
            code, said = trial(folder, before, logs, STAGES[name], moment)
        shown = said.pop("picture")
        differs = [key for key in wanted if shown[key] != wanted[key]]
        bad = [entry for entry in said["left"] if entry[0] not in HARMLESS]
        told = {
            "stage": name,
            "moment": moment,
            "of": seconds,
            "code": code,
            "differs": differs,
            "bad": bad,
            **said,
        }
        print(json.dumps(told), flush=True)
