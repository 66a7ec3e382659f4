"""A version flown through a described manoeuvre, from trim."""

from typing import Any

import numpy as np

from aerodb.errors import InputError, nearest
from aerodb.report import FlownStretch, response_report
from aerodb.simulation import (
    RESPONSES,
    FlightStretch,
    Manoeuvre,
    parse_manoeuvre,
    simulate,
    stabilising_feedback,
    standstill,
    with_feedback,
)
from aerodb.storage.catalogue import Catalogue, VersionRow
from aerodb.storage.files import read_results, write_results
from aerodb.support import Array
from aerodb.tasks.actors import user
from aerodb.tasks.page_head import head_of_result
from aerodb.tasks.stored_steps import StoredResult
from aerodb.tasks.view import StatedCondition, trim_document, trim_of
from aerodb.tasks.workspace_access import access_workspace

#: Integration step [s].
STEP = 0.01


def fly_manoeuvre(
    version: str,
    *,
    workspace: str,
    run: str,
    manoeuvre: str,
    stabilise: bool = True,
    page: bool = False,
) -> dict[str, Any]:
    """Trim a version (its id), fly a manoeuvre (text of its file), and store the responses.

    Returns a document: version, key, manoeuvre, trim (`trim_document`), feedback, moved (input ->
    least and greatest value), responses (channel -> start, least, greatest), ended [s], notes, of a
    run that ends so ``standstill`` (time [s], distance [m]), and the HTML ``page`` if asked for.
    """
    access = access_workspace(workspace)
    row = access.catalogue.version_of_id(version)
    stated = parse_manoeuvre(manoeuvre)
    settings = {
        "manoeuvre": manoeuvre,
        "step": STEP,
        "stabilise": stabilise,
        "ground": "outside its effect",
    }
    result = StoredResult(access, "fly", "simulation", {"version": version}, settings)
    path = result.stored()
    if path is None:
        document, table = _flown(access.catalogue, row, stated, stabilise)
        document |= {"key": result.key}
        result.keep(run, lambda path: write_results(path, table, {"document": document}))
    else:
        table, metadata = read_results(path)
        document = dict(metadata["document"])
    if not page:
        return document
    names = table["response"].astype(str)
    series = {
        name: tuple(table[column][names == name] for column in ("time", "simulated", "flown"))
        for name in dict.fromkeys(names)
    }
    stretch = {
        "since": 0.0,
        "until": document["ended"],
        "kind": "manoeuvre",
        "checks": [],
        "correction": {},
        "notes": document["notes"],
    }
    drawn = FlownStretch(stated.name, stretch, series, {})
    stored = access.catalogue.result(result.key)
    head = head_of_result(access, stored, user()) if stored else None
    return {**document, "page": response_report(row.label, "", None, [drawn], head)}


def _flown(
    catalogue: Catalogue, row: VersionRow, stated: Manoeuvre, stabilise: bool
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    steady = StatedCondition(
        stated.condition,
        [f"{name}={value}" for name, value in stated.given.items()],
        thrust=stated.thrust or None,
    )
    trimmed = trim_of(catalogue, row, steady)
    model = trimmed.problem.model
    time: Array = np.arange(round(stated.duration / STEP) + 1, dtype=np.float64) * STEP
    moved = stated.series(time)
    for name in moved:
        if name not in model.inputs:
            raise InputError(
                f"the database does not read '{name}'",
                f"manoeuvre {stated.name}",
                nearest(name, model.inputs),
            )
    series = {name: np.full(len(time), value) for name, value in trimmed.series.items()}
    series |= {name: series[name] + added for name, added in moved.items()}
    air = stated.air(time, model.database.reference.span)
    series |= air
    gains: dict[tuple[str, str], float] = {}
    if stabilise and not stated.condition.ground:
        gains = stabilising_feedback(model, FlightStretch(time, trimmed.start, series, {}, (), {}))
        model = with_feedback(model, gains)
        for _, channel in gains:
            series[f"reference_{channel}"] = np.full(len(time), trimmed.channels[channel])
    run = simulate(model, time, trimmed.start, series)
    stands = standstill(run, model.database)
    ended = float(time[run.ended[0] - 1]) if stands is None else stands.time
    time = time if stands is None else time[: stands.samples]
    simulated = {name: run.channels[name][: len(time), 0] for name in (*RESPONSES, *moved)}
    document: dict[str, Any] = {
        "version": row.id,
        "manoeuvre": stated.name,
        "trim": trim_document(catalogue, row, steady),
        "feedback": {f"{name}:{channel}": gain for (name, channel), gain in gains.items()},
        "moved": {
            name: [float(np.nanmin(simulated[name])), float(np.nanmax(simulated[name]))]
            for name in moved
        },
        "responses": {
            name: [_rounded(values[0]), _rounded(np.nanmin(values)), _rounded(np.nanmax(values))]
            for name, values in simulated.items()
            if name in RESPONSES
        },
        "ended": ended,
        "notes": [*trimmed.notes, *run.notes()],
    }
    if air:
        document["air"] = {
            name: [float(values.min()), float(values.max())] for name, values in air.items()
        }
    if stands is not None:
        document["standstill"] = {"time": stands.time, "distance": stands.distance}
        document["notes"].append(
            f"it stands still at {stands.time:.2f} s, {stands.distance:.1f} m from the start,"
            " which ends the run"
        )
    n, names = len(time), list(simulated)
    table = {
        "time": np.tile(time, len(names)),
        "stretch": np.zeros(n * len(names), np.int64),
        "response": np.repeat(np.array(names), n),
        "simulated": np.concatenate([simulated[name] for name in names]),
        "flown": np.full(n * len(names), np.nan),
    }
    return document, table


def _rounded(value: float) -> float:
    """Rounding errors of a motion that stays at zero are zero."""
    return float(np.round(value, 12)) + 0.0
