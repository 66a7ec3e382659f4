"""The demo: the built-in example through the whole product, from real log files to a proof on flights not used.

The flights are simulated on a sealed truth; what they leave are ``.ulg`` files. The flows that run are the product's own
and see nothing else. Only when all results are stored is the truth looked at, to say what the noise floor is.
"""

from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerodb.comparison import compare
from aerodb.estimation.statistics import rms
from aerodb.examples.phoenix import text
from aerodb.examples.phoenix.mission import fly
from aerodb.examples.phoenix.truth import truth
from aerodb.nomenclature import AXES
from flows.flight import flight_flow
from flows.importing import import_flow
from flows.update import update_flow
from storage.workspace import Workspace
from storage.writers.ulog import write_ulog
from tasks.coefficients import load_coefficients
from tasks.open import stores

VEHICLE = "phoenix"

#: Runs a flow with its parameters: the command line's way, or a test's.
Run = Callable[[Any, dict[str, Any]], Any]
Say = Callable[[str], None]


@dataclass(frozen=True)
class Demo:
    """What the demo shows: the update's document, and the truth beside it.

    floors : axis -> rms on the held-out flights ``before``, ``after`` and ``floor``, the last that of the true model.
    """

    document: dict[str, Any]
    floors: dict[str, dict[str, float]]
    truth: list[dict[str, Any]]


def run_demo(workspace: Workspace, logs: list[Path], run: Run, say: Say) -> Demo:
    """Takes the logs of `write_logs` in, updates the database, and then opens the envelope."""
    database = logs[0].parent / "preflight.toml"
    database.write_text(text("preflight.toml"), encoding="utf-8")
    opened = stores(str(workspace.root))
    opened.catalogue.add_vehicle(VEHICLE, text("vehicle.toml"))
    baseline = run(import_flow, {"file": str(database), "vehicle": VEHICLE, "bindings": {}})["version"]
    outcomes = run(flight_flow, {"logs": [str(log) for log in logs], "vehicle": VEHICLE})
    ids = [outcome["flight"] for outcome in outcomes]
    say(f"took in {len(ids)} logs: {', '.join(sorted({outcome['status'] for outcome in outcomes}))}")
    parameters = {"vehicle": VEHICLE, "baseline": baseline, "flights": ids, "model": text("model.toml")}
    document = run(update_flow, parameters)
    return Demo(document, _floors(workspace, document), [asdict(effect) for effect in _truth(workspace, baseline)[1]])


def write_logs(folder: Path, flights: int, seed: int) -> list[Path]:
    """Flies the campaign and writes one ``.ulg`` file per flight; returns the files in the order flown."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for log in fly(seed, flights):
        path = folder / f"{log.name}.ulg"
        write_ulog(path, log.topics, metadata={"sys_name": "PX4", "ver_hw": "AERODB_EXAMPLE"}, start_utc=log.start_utc)
        paths.append(path)
    return paths


def _truth(workspace: Workspace, baseline: str) -> Any:
    return truth(stores(str(workspace.root)).database(baseline))


def _floors(workspace: Workspace, document: dict[str, Any]) -> dict[str, dict[str, float]]:
    """Residual of the baseline, the candidate and the true model on the same reconstructed held-out coefficients."""
    opened = stores(str(workspace.root))
    models = {
        "before": opened.database(document["baseline"]),
        "after": opened.database(document["candidate"]),
        "floor": _truth(workspace, document["baseline"])[0],
    }
    residuals: dict[str, dict[str, list[np.ndarray]]] = {axis: {name: [] for name in models} for axis in AXES}
    for id in document["flights"]["held_out"]:
        row = opened.catalogue.flight(id)
        flight, coefficients, _ = load_coefficients(opened, row, "")
        vehicle, _ = opened.vehicle(row.vehicle)
        for name, database in models.items():
            comparison = compare(flight, coefficients, database, vehicle.reference)
            for axis in AXES:
                residuals[axis][name].append(comparison.residual(axis)[comparison.usable[axis]])
    return {axis: {name: rms(np.concatenate(parts)) for name, parts in sides.items()} for axis, sides in residuals.items()}
