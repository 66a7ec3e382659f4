"""A version flown over stretches of stored flights, and judged by the response."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from importlib import resources
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

import numpy as np

from aerodb.coefficients import Coefficients
from aerodb.conditioning import STATES, Segment
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.physics import GRAVITY
from aerodb.simulation import (
    RESPONSES,
    FlightModel,
    FlightStretch,
    Oscillation,
    Simulation,
    Tolerances,
    at_rest_from,
    check_responses,
    fastest_growth,
    fly_stretch,
    moved_controls,
    oscillation,
    parse_tolerances,
    response_agreement,
    stabilising_feedback,
    stretch_model,
    stretch_of,
    with_trim_offset,
)
from aerodb.storage.catalogue import FlightRow
from aerodb.storage.files import read_results, write_results
from aerodb.support import Array
from aerodb.tables import AeroDatabase
from aerodb.tasks.steps.coefficients import load_coefficients
from aerodb.tasks.steps.segments import segments_of
from aerodb.tasks.stored_steps import StoredResult
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace
from aerodb.vehicle import Vehicle

#: What a manoeuvre is flown with before its start and after its end [s].
BEFORE: Final = 1.0
AFTER: Final = 8.0
#: Least period of a phugoid, as a part of ``sqrt(2) pi V / g`` (Lanchester 1908): that from which
#: segmentation searches it.
PHUGOID_FROM: Final = 0.7
#: Longest stretch of a flight without manoeuvres [s].
LONGEST: Final = 20.0


#: Tolerances beside the default that come with aerodb: name -> file.
SHIPPED: Final = {
    "engine-failure": "engine_failure.toml",
    "normal-landing": "normal_landing.toml",
}


def default_tolerances() -> str:
    """Return the text (TOML) of the tolerances that come with aerodb.

    Source: 14 CFR part 60, appendix A, table A2A, edition of 1 January 2014.
    """
    return _shipped("tolerances.toml")


def _shipped(name: str) -> str:
    return (resources.files("aerodb.simulation") / name).read_text("utf-8")


def read_tolerances(path: Path) -> str:
    """The text of tolerances by the name of some of `SHIPPED`, or of a file; InputError where it
    cannot be read.

    The same form as `default_tolerances`.
    """
    if str(path) in SHIPPED:
        return _shipped(SHIPPED[str(path)])
    try:
        return path.read_text("utf-8")
    except (OSError, UnicodeDecodeError) as error:
        known = ", ".join(SHIPPED)
        raise InputError(
            f"cannot be read: {error}", str(path), f"name a TOML file, or {known}"
        ) from None


def fly_version(
    flight: str,
    *,
    workspace: str,
    run: str,
    version: str,
    since: float | None = None,
    until: float | None = None,
    wind: str = "measured",
    stabilise: bool = True,
    feedback: Mapping[str, float] | None = None,
    trimmed: bool = False,
    tolerances: str = "",
    beside: str = "",
) -> dict[str, Any]:
    """Fly a version (its id) over a flight (its id), and store the responses.

    Parameters
    ----------
    since, until : [s] from the flight's first sample; without them, each manoeuvre with 1 s before
        and 8 s after it; in a flight without manoeuvres, pieces of 20 s.
    wind : ``measured``, as reconstructed, or ``mean`` of each stretch.
    stabilise : close the least stabilising feedback where the vehicle is unstable.
    feedback : ``input:channel`` -> gain, in place of it.
    trimmed : begin each stretch in the flight's trim, by a constant force and moment that hold the
        first second.
    tolerances : text; empty: those that come with aerodb.
    beside : as of `WorkspaceAccess.flown_database`.

    Returns a document: flight, version, with (`beside`, where there is one), key, tolerances,
    standard (`standard_document`), stretches (since, until, kind, condition, controls, feedback,
    correction, responses, oscillations, checks, notes, and where feedback is closed open_loop;
    where it was not flown, reason, and what: the reason without the place).
    """
    access = access_workspace(workspace)
    row = access.catalogue.flight(flight)
    text = tolerances or default_tolerances()
    limits = parse_tolerances(text)
    loaded = load_coefficients(access, row, run)
    windows = flown_windows(access, row, loaded.flight, run, since, until)
    settings: dict[str, Any] = {
        "windows": [list(window) for window in windows],
        "wind": wind,
        "stabilise": stabilise,
        "feedback": dict(feedback or {}),
        "trimmed": trimmed,
        "tolerances": text,
    }
    inputs = {"coefficients": loaded.key, "version": version}
    inputs |= {"beside": beside} if beside else {}
    result = StoredResult(access, "fly", "simulation", inputs, settings, flight=row.id)
    path = result.stored()
    if path is not None:
        return dict(read_results(path, ("time",))[1]["document"])
    vehicle, _ = access.vehicle(row.vehicle)
    gains = {_gain_name(name): value for name, value in (feedback or {}).items()}
    database = access.flown_database(version, beside)
    pieces = [
        fly_window(
            database,
            loaded.flight,
            loaded.coefficients,
            vehicle,
            window,
            wind,
            stabilise,
            gains,
            trimmed,
            limits,
        )
        for window in windows
    ]
    document = {
        "flight": row.id,
        "version": version,
        **({"with": beside} if beside else {}),
        "key": result.key,
        "tolerances": limits.name,
        "standard": standard_document(limits),
        "stretches": [piece for piece, _ in pieces],
    }
    table = _long([columns for _, columns in pieces])
    result.keep(run, lambda path: write_results(path, table, {"document": document}))
    return document


def standard_document(limits: Tolerances) -> dict[str, Any]:
    """Return the standard that tolerances are of: source, unchecked, tests (number, title,
    condition, not_judged, compared); all are text."""
    return {
        "source": limits.source,
        "unchecked": list(limits.unchecked),
        "tests": [asdict(test) for test in limits.tests],
    }


def flown_responses(
    access: WorkspaceAccess, key: str
) -> list[dict[str, tuple[Array, Array, Array]]]:
    """Stored responses of each stretch: response -> time [s], simulated and flown (n,)."""
    path = access.path_of(key)
    if path is None:
        raise InputError("its file is lost", f"result {key[:12]}", "run version fly again")
    table, metadata = read_results(path)
    found: list[dict[str, tuple[Array, Array, Array]]] = []
    for number in range(len(metadata["document"]["stretches"])):
        mine = table["stretch"] == number
        names = table["response"][mine].astype(str)
        columns = [table[name][mine] for name in ("time", "simulated", "flown")]
        found.append(
            {
                name: (
                    columns[0][names == name],
                    columns[1][names == name],
                    columns[2][names == name],
                )
                for name in dict.fromkeys(names)
            }
        )
    return found


def _gain_name(text: str) -> tuple[str, str]:
    surface, colon, channel = text.partition(":")
    if not colon:
        raise InputError(
            f"'{text}' is no feedback", remedy="write INPUT:CHANNEL=GAIN, as delta_e:q=0.3"
        )
    return surface, channel


Window = tuple[float, float, str]


def flown_windows(
    access: WorkspaceAccess,
    row: FlightRow,
    flight: Flight,
    run: str,
    since: float | None = None,
    until: float | None = None,
) -> list[Window]:
    """Return the stretches to fly: from and to [s] from the first sample, and what is flown there
    (`manoeuvre_windows`)."""
    if since is not None or until is not None:
        return [(since or 0.0, flight.duration if until is None else until, "stretch")]
    return manoeuvre_windows(segments_of(access, row.id, run), flight.duration)


def manoeuvre_windows(
    found: Iterable[Segment], duration: float, longest: float = LONGEST
) -> list[Window]:
    """Return the stretches to fly of a flight of `duration` [s]: its manoeuvres with what is flown
    before and after, or the whole flight in pieces where it has none.

    found : its segments, start and end [s] from the first sample. longest : piece [s].
    """
    found = sorted(found, key=lambda segment: segment.start)
    manoeuvres = [segment for segment in found if segment.kind not in STATES]
    windows: list[tuple[float, float, tuple[str, ...]]] = []
    for segment in manoeuvres:
        begin = max(segment.start - BEFORE, 0.0)
        end = min(segment.end + AFTER, duration)
        if windows and segment.start < windows[-1][1] - AFTER:  # they overlap
            last = windows[-1]
            windows[-1] = (last[0], max(last[1], end), (*last[2], segment.kind))
        else:
            if windows and windows[-1][1] > segment.start:
                windows[-1] = (windows[-1][0], segment.start, windows[-1][2])
            windows.append((begin, end, (segment.kind,)))
    if windows:
        return [(a, b, " + ".join(dict.fromkeys(kinds))) for a, b, kinds in windows]
    count = max(1, int(np.ceil(duration / longest - 1e-3)))
    edges = np.linspace(0.0, duration, count + 1)
    return [(float(a), float(b), "stretch") for a, b in pairwise(edges)]


def fly_window(
    database: AeroDatabase,
    flight: Flight,
    coefficients: Coefficients,
    vehicle: Vehicle,
    window: Window,
    wind: str,
    stabilise: bool,
    gains: Mapping[tuple[str, str], float],
    trimmed: bool,
    limits: Tolerances,
) -> tuple[dict[str, Any], dict[str, tuple[Array, Array, Array]]]:
    """Fly a database over one stretch of a flight; parameters as in `fly_version`, of which the
    document has the stretch. Returns it, and response -> time [s], simulated and flown (n,), SI.

    What cannot be flown has its reason in the document. InputError for an unknown kind of wind.
    """
    first = float(flight.time[0])
    document: dict[str, Any] = {"since": window[0], "until": window[1], "kind": window[2]}
    if wind not in ("mean", "measured"):
        raise InputError(f"wind '{wind}' is not known", remedy="mean or measured")

    def prepared(feedback: Mapping[tuple[str, str], float]) -> tuple[FlightModel, FlightStretch]:
        model = stretch_model(database, flight, feedback)
        return model, stretch_of(
            model,
            flight,
            coefficients,
            vehicle,
            first + window[0],
            first + window[1],
            wind="mean" if wind == "mean" else "measured",
        )

    open_loop = None
    try:
        model, stretch = prepared(gains)
        if gains:
            open_loop = prepared({})
        elif stabilise:
            found = stabilising_feedback(model, stretch)
            if found:
                gains, open_loop = found, (model, stretch)
                model, stretch = prepared(found)
    except InputError as error:
        return {**document, "reason": str(error), "what": error.without_place}, {}
    if trimmed:
        stretch, offset = with_trim_offset(model, stretch, BEFORE)
        document["trim_offset"] = asdict(offset)
    flown = fly_stretch(model, stretch)
    simulated = {name: values[:, 0] for name, values in flown.channels.items()}
    controls = moved_controls(model, stretch)
    swings = {} if gains else _oscillations(model, stretch, simulated)
    checks = check_responses(limits, simulated, stretch.flown, controls, stretch.free, swings)
    if open_loop is not None:
        document["open_loop"] = _open_loop(*open_loop, limits, controls, trimmed, first)
    document |= {
        "condition": _condition(flight, stretch),
        "controls": list(controls),
        "feedback": {f"{surface}:{channel}": gain for (surface, channel), gain in gains.items()},
        "correction": _corrections(flown, stretch, {surface for surface, _ in gains}),
        "responses": [
            {
                "channel": each.channel,
                "rms_error": each.rms_error,
                "rms_flown": each.rms_flown,
                "theil": asdict(each.theil),
            }
            for each in response_agreement(simulated, stretch.flown)
        ],
        "oscillations": {
            name: {
                "simulated": None if ours is None else _figures(ours),
                "flown": _figures(theirs),
            }
            for name, (ours, theirs) in swings.items()
        },
        "checks": [asdict(check) for check in checks],
        "notes": [*stretch.notes, *flown.notes()],
        "ended": float(stretch.time[flown.ended[0] - 1]) - first,
    }
    time = stretch.time - first
    return document, {
        name: (time, simulated[name], stretch.flown[name])
        for name in RESPONSES
        if name in stretch.flown
    }


#: Parts of the names of channels that tell the configuration of an aircraft.
_CONFIGURATION: Final = ("flap", "slat", "gear", "brake", "spoiler")


def _condition(flight: Flight, stretch: FlightStretch) -> dict[str, Any]:
    """Condition at the start: V [m/s], altitude [m] or None, mass [kg], and the positions (SI) that
    tell the configuration."""
    at = int(np.searchsorted(flight.time, stretch.time[0]))
    told = [name for name in flight.channels if any(part in name for part in _CONFIGURATION)]
    positions = {name: float(flight[name][at]) for name in sorted(told)}
    return {
        "V": float(stretch.start["V"]),
        "altitude": float(stretch.start["altitude"]) if "altitude" in flight else None,
        "mass": float(stretch.series["mass"][0]),
        "configuration": {name: at for name, at in positions.items() if np.isfinite(at)},
    }


def _open_loop(
    model: FlightModel,
    stretch: FlightStretch,
    limits: Tolerances,
    controls: Iterable[str],
    trimmed: bool,
    first: float,
) -> dict[str, Any]:
    """What the version does without the feedback: checks, when it ended [s], and the time in which
    its fastest motion doubles [s], None where none grows. first : start of the flight [s]."""
    if trimmed:
        stretch, _ = with_trim_offset(model, stretch, BEFORE)
    flown = fly_stretch(model, stretch)
    simulated = {name: values[:, 0] for name, values in flown.channels.items()}
    swings = _oscillations(model, stretch, simulated)
    checks = check_responses(limits, simulated, stretch.flown, controls, stretch.free, swings)
    growth = fastest_growth(model, stretch)
    return {
        "checks": [asdict(check) for check in checks],
        "ended": float(stretch.time[flown.ended[0] - 1]) - first,
        "doubling_time": float(np.log(2.0)) / growth if growth > 0.0 else None,
    }


def _oscillations(
    model: FlightModel, stretch: FlightStretch, simulated: Mapping[str, Array]
) -> dict[str, tuple[Oscillation | None, Oscillation]]:
    """Oscillations of the rates and the airspeed once the controls rest, where the flight has
    them; of the airspeed only a phugoid."""
    inputs = [stretch.series[name] for name in model.inputs]
    rest = slice(at_rest_from(stretch.time, inputs), None)
    found = {}
    for name in "pqrV":
        flown = oscillation(stretch.time[rest], stretch.flown[name][rest])
        if flown is not None and (name != "V" or _is_phugoid(flown, float(stretch.start["V"]))):
            found[name] = (oscillation(stretch.time[rest], simulated[name][rest]), flown)
    return found


def _is_phugoid(swing: Oscillation, speed: float) -> bool:
    """Whether the period [s] is that of a phugoid at a speed [m/s]: a fast swing of the airspeed is
    a gust, or noise."""
    return bool(swing.period > PHUGOID_FROM * np.sqrt(2.0) * np.pi * speed / GRAVITY)


def _figures(found: Oscillation) -> dict[str, float]:
    return {
        "omega": found.omega,
        "zeta": found.zeta,
        "period": found.period,
        "half_time": found.half_time,
        "sigma_omega": found.sigma_omega,
        "sigma_zeta": found.sigma_zeta,
    }


def _corrections(
    flown: Simulation, stretch: FlightStretch, surfaces: Iterable[str]
) -> dict[str, float]:
    """Greatest deflection [rad] that the feedback added to each input."""
    return {
        name: float(np.nanmax(np.abs(flown.channels[name][:, 0] - stretch.series[name])))
        for name in sorted(surfaces)
    }


def _long(pieces: list[dict[str, tuple[Array, Array, Array]]]) -> dict[str, np.ndarray]:
    rows = [
        (number, name, *columns)
        for number, piece in enumerate(pieces)
        for name, columns in piece.items()
    ]

    def joined(parts: list[np.ndarray], kind: type) -> np.ndarray:
        return np.concatenate([np.zeros(0, kind), *parts])

    return {
        "time": joined([row[2] for row in rows], float),
        "stretch": joined([np.full(len(row[2]), row[0]) for row in rows], np.int64),
        "response": np.concatenate(
            [np.zeros(0, "U8"), *(np.full(len(row[2]), row[1], "U8") for row in rows)]
        ),
        "simulated": joined([row[3] for row in rows], float),
        "flown": joined([row[4] for row in rows], float),
    }
