"""The demo: the built-in example from log files to a validated candidate.

The flights are simulated with a sealed truth, and leave ``.ulg`` files and a closed envelope with
the true effects. The product's own flows run on the logs alone; the envelope is opened only after
all results are stored.
"""

import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from aerodb.examples.phoenix import read_example
from aerodb.examples.phoenix.mission import flown_lags, fly
from aerodb.examples.phoenix.truth import EFFECTS, Effect, draw_effects, truth
from aerodb.flows.close_loop import close_loop_flow
from aerodb.flows.flight import flight_flow
from aerodb.flows.importing import import_flow
from aerodb.nomenclature import AXES
from aerodb.signals import rms
from aerodb.storage.workspace import Workspace
from aerodb.storage.writers import write_ulog
from aerodb.tasks.steps import compare_with_database
from aerodb.tasks.workspace_access import access_workspace

VEHICLE = "phoenix"
ENVELOPE = "envelope.json"
#: The lags of the air-data sensors that flew, sealed beside the effects.
LAGS = "lags.json"

#: Runs a flow with its parameters, as the command line or a test does.
Run = Callable[[Any, dict[str, Any]], Any]
Say = Callable[[str], None]
Agreement = Literal["named", "in_set", "missed"]


@dataclass(frozen=True)
class Demo:
    """Result of the demo: the closed loop's document, and the truth from the envelope.

    floors : axis -> rms on the held-out flights ``before``, ``after`` and ``floor`` (of the true
    model). truth : the effects that flew, each with ``agreement``.
    """

    document: dict[str, Any]
    floors: dict[str, dict[str, float]]
    truth: list[dict[str, Any]]
    lags: list[dict[str, Any]]


def run_demo(workspace: Workspace, logs: list[Path], run: Run, say: Say) -> Demo:
    """Ingest the logs of `write_logs`, close the loop on them, then open the envelope."""
    database = write_database(logs[0].parent)
    access = access_workspace(str(workspace.root))
    access.catalogue.add_vehicle(VEHICLE, read_example("vehicle.toml"))
    baseline = run(import_flow, {"file": str(database), "vehicle": VEHICLE, "bindings": {}})[
        "version"
    ]
    outcomes = run(flight_flow, {"logs": [str(log) for log in logs], "vehicle": VEHICLE})
    ids = [outcome["flight"] for outcome in outcomes]
    statuses = sorted({outcome["status"] for outcome in outcomes})
    say(f"ingested {len(ids)} logs: {', '.join(statuses)}")
    document = run(close_loop_flow, {"vehicle": VEHICLE, "baseline": baseline, "flights": ids})
    folder = logs[0].parent
    flown = json.loads((folder / LAGS).read_text(encoding="utf-8"))
    return beside_truth(workspace, document, open_envelope(folder), flown)


def write_database(folder: Path) -> Path:
    """Write the preflight database, which lacks the effects, to `folder`, and return its file."""
    file = folder / "preflight.toml"
    file.write_text(read_example("preflight.toml"), encoding="utf-8")
    return file


def beside_truth(
    workspace: Workspace,
    document: dict[str, Any],
    effects: tuple[Effect, ...],
    flown: dict[str, float],
) -> Demo:
    """Compare the document of a closed loop with the effects and the lags [s] that flew."""
    told = [
        {
            **asdict(effect),
            "agreement": agreement(effect, document["findings"]),
            "verdict": verdict_on(effect, document["findings"]),
        }
        for effect in effects
    ]
    lags = [
        {
            "parameter": finding["parameter"],
            "value": flown[finding["parameter"]],
            "found": finding["value"],
            "ci95": finding["ci95"],
        }
        for finding in document["findings"]
        if finding["verdict"] == "sensor" and finding["parameter"] in flown
    ]
    return Demo(document, floors(workspace, document, effects), told, lags)


def write_logs(
    folder: Path,
    flights: int,
    seed: int | None,
    noise: int = 0,
    effects: tuple[Effect, ...] | None = None,
    together: bool = False,
) -> list[Path]:
    """Fly the campaign, write one ``.ulg`` file per flight, seal the truth, and return the logs.

    seed : draws the undeclared effects and everything else that is random; None: the Phoenix case
    (docs/method/tracing.md, section "References"), in which `noise` draws everything else. effects
    : in place of the drawn ones. together : whether the body flap follows the speed brake.
    """
    folder.mkdir(parents=True, exist_ok=True)
    if effects is None:
        effects = EFFECTS if seed is None else draw_effects(seed)
    (folder / ENVELOPE).write_text(
        json.dumps([asdict(effect) for effect in effects], indent=1) + "\n", encoding="utf-8"
    )
    drawn = noise if seed is None else seed
    (folder / LAGS).write_text(json.dumps(flown_lags(drawn), indent=1) + "\n", encoding="utf-8")
    paths = []
    for log in fly(drawn, flights, effects, together):
        path = folder / f"{log.name}.ulg"
        write_ulog(
            path,
            log.topics,
            metadata={"sys_name": "PX4", "ver_hw": "AERODB_EXAMPLE"},
            start_utc=log.start_utc,
        )
        paths.append(path)
    return paths


def open_envelope(folder: Path) -> tuple[Effect, ...]:
    """Return the effects that flew."""
    return tuple(
        Effect(**entry) for entry in json.loads((folder / ENVELOPE).read_text(encoding="utf-8"))
    )


def agreement(effect: Effect, findings: list[dict[str, Any]]) -> Agreement:
    """Return whether a true effect was named, is in a finding's explanation set, or was missed."""
    if verdict_on(effect, findings):
        return "named"
    within = {member for finding in findings for member in finding["explanation_set"]}
    own = {
        f"{effect.effect}@{effect.axis}",
        f"{effect.effect}@{effect.axis}:{effect.regressor.removeprefix('delta_')}",
    }
    return "in_set" if own & within else "missed"


def verdict_on(effect: Effect, findings: list[dict[str, Any]]) -> str:
    """Return the verdict of the finding that names a true effect; empty where none does."""
    plain = effect.parameter.partition(" ")[0]
    return next(
        (
            str(f["verdict"])
            for f in findings
            if f["effect"] == effect.effect
            and effect.axis in f["axis"]
            and (f["parameter"] == effect.parameter or f["parameter"].partition(" ")[0] == plain)
        ),
        "",
    )


def floors(
    workspace: Workspace, document: dict[str, Any], effects: tuple[Effect, ...]
) -> dict[str, dict[str, float]]:
    """Return the residual rms of baseline, candidate and true model on the held-out flights.

    All three are compared with the same reconstructed coefficients. Where flights are too few to
    hold any out, each of them is left out in turn, and the rms of the candidate is that of the loop
    without it.
    """
    access = access_workspace(str(workspace.root))
    baseline = access.database(document["baseline"])
    models = {
        "before": baseline,
        "after": access.database(document["candidate"]) if document["candidate"] else baseline,
        "floor": truth(baseline, effects)[0],
    }
    residuals: dict[str, dict[str, list[np.ndarray]]] = {
        axis: {name: [] for name in models} for axis in AXES
    }
    held_out = document["flights"]["held_out"]
    for id in held_out or document["flights"]["identified"]:
        for name, database in models.items():
            comparison = compare_with_database(access, id, database, "").comparison
            for axis in AXES:
                residuals[axis][name].append(comparison.residual(axis)[comparison.usable[axis]])
    errors = {
        axis: {name: rms(np.concatenate(parts)) for name, parts in sides.items()}
        for axis, sides in residuals.items()
    }
    if not held_out:
        for axis, sides in errors.items():
            sides["after"] = document["axes"][axis]["held_out_rms_after"]
    return errors
