"""A version flown through a described manoeuvre, from trim."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from aerodb.errors import InputError, nearest
from aerodb.exchange import in_wake
from aerodb.parts import beyond_tilt, felt_at_places
from aerodb.physics import VortexPair, air_at_centre, air_at_stations, quaternion_from_euler
from aerodb.report import FlownStretch, response_report
from aerodb.simulation import (
    RESPONSES,
    FlightModel,
    FlightStretch,
    Manoeuvre,
    Simulation,
    parse_manoeuvre,
    simulate,
    stabilising_feedback,
    standstill,
    with_feedback,
)
from aerodb.storage.catalogue import Catalogue, VersionRow
from aerodb.storage.files import read_results, write_results
from aerodb.support import Array
from aerodb.tables import AeroDatabase
from aerodb.tasks.actors import user
from aerodb.tasks.page_head import head_of_result
from aerodb.tasks.stored_steps import StoredResult
from aerodb.tasks.view import StatedCondition, trim_document, trim_of
from aerodb.tasks.workspace_access import access_workspace

#: Integration step [s].
STEP = 0.01
#: Most passes through a wake, and the change of the path [m] at which it stays.
_PASSES = 40
_STAYS = 1e-3


def fly_manoeuvre(
    version: str,
    *,
    workspace: str,
    run: str,
    manoeuvre: str,
    stabilise: bool = True,
    page: bool = False,
    beside: str = "",
) -> dict[str, Any]:
    """Trim a version (its id), fly a manoeuvre (text of its file), and store the responses.

    beside : as of `WorkspaceAccess.flown_database`, or a version of a wake, which is met.

    Returns a document: version, with (`beside`, where there is one), key, manoeuvre, trim
    (`trim_document`), feedback, moved (input -> least and greatest value), responses (channel ->
    start, least, greatest), ended [s], notes, of a run that ends so ``standstill`` (time [s],
    distance [m]), and the HTML ``page`` if asked for.
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
    inputs = {"version": version, **({"beside": beside} if beside else {})}
    result = StoredResult(access, "fly", "simulation", inputs, settings)
    path = result.stored()
    if path is None:
        pair = access.wake(beside)
        if pair is not None:
            stated = in_stated_wake(stated, pair)
        database = access.flown_database(version, "" if pair else beside)
        document, table = _flown(access.catalogue, row, stated, stabilise, database)
        document |= {"key": result.key, **({"with": beside} if beside else {})}
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
    return {**document, "page": "".join(response_report(row.label, "", None, [drawn], head))}


def in_stated_wake(stated: Manoeuvre, pair: VortexPair) -> Manoeuvre:
    """Return a manoeuvre through a wake [SI] whose place counts from where the run begins.

    Raises InputError where the manoeuvre states a wake of its own.
    """
    if stated.wake is not None:
        raise InputError("a second wake", f"manoeuvre {stated.name}", "leave [wake] or --with out")
    north, east, up = pair.place
    placed = replace(pair, place=(north, east, stated.condition.altitude + up))
    return replace(stated, wake=placed)


def _flown(
    catalogue: Catalogue,
    row: VersionRow,
    stated: Manoeuvre,
    stabilise: bool,
    database: AeroDatabase,
) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    steady = StatedCondition(
        stated.condition,
        [f"{name}={value}" for name, value in stated.given.items()],
        thrust=stated.thrust or None,
    )
    trimmed = trim_of(catalogue, row, steady, database)
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
    if stated.wake is not None:
        at_places = felt_at_places(database)
        if at_places:
            # Trimmed with the wake, it would begin with another attitude than outside of it.
            inside = in_wake(database, stated.wake)
            model = with_feedback(trim_of(catalogue, row, steady, inside).problem.model, gains)
        span = model.database.reference.span
        met = air_at_centre if at_places else partial(air_at_stations, span=span)
        run, air = _through_wake(stated.wake, met, model, trimmed.start, series, run, air)
    stands = standstill(run, model.database, [series[f"cg_{axis}"][0] for axis in "xyz"])
    ended = float(time[run.ended[0] - 1]) if stands is None else stands.time
    time = time if stands is None else time[: stands.samples]
    simulated = {name: run.channels[name][: len(time), 0] for name in (*RESPONSES, *moved)}
    held = {name: np.full(len(time), value) for name, value in trimmed.channels.items()}
    tilted = beyond_tilt(
        model.database, {**held, **{n: v[: len(time), 0] for n, v in run.channels.items()}}
    )
    document: dict[str, Any] = {
        "version": row.id,
        "manoeuvre": stated.name,
        "trim": trim_document(catalogue, row, steady, database),
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
        "notes": [*trimmed.notes, *run.notes(), *tilted.values()],
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


def _through_wake(
    pair: VortexPair,
    met_by: Callable[..., dict[str, Array]],
    model: FlightModel,
    start: Mapping[str, float],
    series: Mapping[str, Array],
    run: Simulation,
    air: Mapping[str, Array],
) -> tuple[Simulation, dict[str, Array]]:
    """The run through a wake, and its air: the path decides what is met, and that decides the path.

    met_by : what the vehicle feels of the pair as gusts, such as `air_at_stations`. Each pass flies
    through the air along the path of the one before, until the path stays.
    """
    time = run.time
    for _ in range(_PASSES):
        place = np.stack([run.channels[name][:, 0] for name in ("north", "east", "altitude")])
        if not np.isfinite(place).all():
            raise InputError(
                "the flight ends in the wake", "manoeuvre, [wake]", "a weaker wake, or farther away"
            )
        attitude = quaternion_from_euler(
            *(run.channels[name][:, 0] for name in ("phi", "theta", "psi"))
        )
        met = met_by(pair, place, attitude)
        felt = {name: values + air.get(name, 0.0) for name, values in met.items()}
        run = simulate(model, time, start, {**series, **felt})
        after = np.stack([run.channels[name][:, 0] for name in ("north", "east", "altitude")])
        if np.abs(after - place).max() < _STAYS:
            return run, felt
    raise InputError(
        "the path through the wake was not found", "manoeuvre, [wake]", "a shorter manoeuvre"
    )


def _rounded(value: float) -> float:
    """Rounding errors of a motion that stays at zero are zero."""
    return float(np.round(value, 12)) + 0.0
