"""Channels of a stored flight for plotting: any time window, decimated, with true extremes kept.

Only the columns and row groups of the window are read: an hour at 100 Hz opens as quickly as a
minute.
"""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import AeroError, InputError, UnknownNameError, nearest
from aerodb.nomenclature import NAVIGATION, POSITIONS, is_surface
from aerodb.physics import Earth
from aerodb.report import decimated, extremes, flagged_stretches
from aerodb.storage.catalogue import FlightRow
from aerodb.storage.files import StoredSeries
from aerodb.support import Array
from aerodb.tasks.view.stored_flight import (
    Source,
    StoredColumn,
    StoredFlight,
    read_together,
    stored_flight,
)
from aerodb.tasks.workspace_access import WorkspaceAccess

#: Groups of channels, as a page offers them; surfaces, coefficients and the rest follow.
GROUPS: Final[Mapping[str, tuple[str, ...]]] = {
    "Air": ("V", "alpha", "beta", "wind_north", "wind_east", "wind_down", "qbar", "mach", "rho"),
    "Motion": ("p", "q", "r", "ax", "ay", "az", "ax_imu", "ay_imu", "az_imu"),
    "Attitude": ("phi", "theta", "psi"),
    "Position": (*NAVIGATION, "latitude", "longitude", "height_above_ground", "pressure_altitude"),
}
#: Channels shown first, in this order, if the flight has them; surfaces follow.
FIRST: Final = ("V", "alpha", "beta", "p", "q", "r", "ax", "ay", "az", "phi", "theta", "altitude")
PANELS: Final = 12
#: Fewest points of one series that can be asked for: fewer show no curve.
FEWEST_POINTS: Final = 10
#: Most points of one series that can be asked for, which bounds the size of an answer.
MOST_POINTS: Final = 20_000
#: Most series of one answer.
MOST_SERIES: Final = 40
_STRETCHES: Final = 100


@dataclass(frozen=True, eq=False)
class Series:
    """One line of a plot.

    source : as in `StoredColumn`, or ``logged``. time : (n,) [s]. values : (n,) in `unit` (SI);
    `factor` converts them to the unit in `label`. flagged : intervals [s] that are not used.
    version : label of the version that predicts the values.
    """

    name: str
    source: Source
    unit: str
    label: str
    factor: float
    time: Array
    values: Array
    flagged: tuple[tuple[float, float], ...] = ()
    version: str = ""


@dataclass(frozen=True)
class PlottedFlight:
    """What can be plotted of a flight: names by group, those shown first, its start and end [s].

    sigmas : names that have a standard error, as ``sigma_NAME``. version : label of the version
    whose prediction is shown with the coefficients. has_track : whether there is a position.
    """

    groups: Mapping[str, tuple[str, ...]]
    first: tuple[str, ...]
    sigmas: tuple[str, ...]
    start: float
    end: float
    samples: int
    version: str
    has_track: bool


@dataclass(frozen=True, eq=False)
class GroundTrack:
    """The path over the ground: time [s], north and east of the local origin and altitude [m], each
    (n,); altitude is empty if the flight has none."""

    time: Array
    north: Array
    east: Array
    altitude: Array


def record_of(access: WorkspaceAccess, row: FlightRow) -> PlottedFlight:
    """Return what can be plotted of a flight, start and end [s]; InputError if its file is missing
    or damaged."""
    stored = stored_flight(access, row)
    names = stored.channels
    surfaces = tuple(sorted(name for name in names if is_surface(name)))
    groups = {
        group: tuple(name for name in members if name in names) for group, members in GROUPS.items()
    }
    groups |= {"Controls": surfaces, "Coefficients": stored.axes}
    grouped = {name for members in groups.values() for name in members}
    groups["Other"] = tuple(name for name in names if name not in grouped)
    chosen = [name for name in FIRST if name in names][: PANELS - min(len(surfaces), 3)]
    first = (*chosen, *surfaces)[:PANELS] or names[:PANELS]
    start, end = stored.flight.ends()
    return PlottedFlight(
        {group: members for group, members in groups.items() if members},
        tuple(first),
        stored.sigmas,
        start,
        end,
        stored.flight.rows,
        stored.version,
        any(all(name in names for name in pair) for pair in POSITIONS),
    )


def series_of(
    access: WorkspaceAccess,
    row: FlightRow,
    names: Sequence[str],
    start: float,
    end: float,
    points: int,
) -> tuple[list[Series], tuple[float, float]]:
    """Return the lines of `names` from `start` to `end` [s], and the flight's ends.

    Each line has at most `points` + 2 samples. A channel is given as measured and as reconstructed;
    an axis as flown and as a version predicts it; ``sigma_NAME`` is a standard error. Raises
    UnknownNameError for a name that the flight lacks, InputError if the number of points or names
    is out of bounds.
    """
    if len(names) > MOST_SERIES:
        raise InputError(f"{len(names)} names", "names", f"at most {MOST_SERIES} at once")
    stored, window = _windowed(access, row, start, end, points)
    found = {name: _columns(stored, row, name) for name in names}
    columns = [column for group in found.values() for column in group]
    flags = [f"flags_{name}" for name in stored.flight.metadata["flags"]]
    own = stored.flight.read(["time", *flags], *window)
    used = {id(_best(group)) for group in found.values()}
    lines = [
        Series(
            column.name,
            column.source,
            column.unit,
            column.label,
            column.factor,
            *decimated(own["time"], values, points),
            _flagged(own, column) if id(column) in used else (),
            column.version,
        )
        for column, values in zip(columns, read_together(columns, *window), strict=True)
    ]
    return lines, stored.flight.ends()


def pair_of(
    access: WorkspaceAccess,
    row: FlightRow,
    names: tuple[str, str],
    start: float,
    end: float,
    points: int,
) -> tuple[StoredColumn, StoredColumn, Array]:
    """Return where the values of two names are, and time [s], x and y at common samples (3, n).

    At most `points` + 2 samples, with the extremes of both; the reconstructed values if there are
    any, otherwise those measured; coefficients as flown. Raises as `series_of`.
    """
    stored, window = _windowed(access, row, start, end, points)
    x, y = (_best(_columns(stored, row, name)) for name in names)
    time = stored.flight.read(["time"], *window)["time"]
    both = np.array([time, *read_together([x, y], *window)])
    return x, y, both[:, _common(both[1:], points)]


def track_of(
    access: WorkspaceAccess, row: FlightRow, start: float, end: float, points: int
) -> GroundTrack:
    """Return the path over the ground between two times [s]; InputError if the flight has none.

    Latitude and longitude are used where the flight has no position in metres; their origin is the
    first known one.
    """
    stored, window = _windowed(access, row, start, end, points)
    pair = next((p for p in POSITIONS if all(n in stored.channels for n in p)), None)
    if pair is None:
        raise InputError(
            "no position is logged", f"flight {row.label}", "map north and east, or coordinates"
        )
    names = [*pair, *(("altitude",) if "altitude" in stored.channels else ())]
    best = [_best(_columns(stored, row, name)) for name in names]
    columns = np.array(read_together(best, *window))
    known = np.flatnonzero(np.isfinite(columns[:2]).all(axis=0))
    if pair[0] == "latitude" and len(known):
        earth = Earth(*columns[:2, known[0]])
        columns[:2] = earth.to_local(columns[0], columns[1])
    time = stored.flight.read(["time"], *window)["time"]
    shown = np.vstack([time, columns])[:, _common(columns, points)]
    altitude = shown[3] if len(shown) > 3 else np.empty(0)
    return GroundTrack(shown[0], shown[1], shown[2], altitude)


def _windowed(
    access: WorkspaceAccess, row: FlightRow, start: float, end: float, points: int
) -> tuple[StoredFlight, tuple[int, int]]:
    """Return the stored flight and the rows of a time window; InputError if they cannot be asked
    for."""
    check_window(start, end, points)
    stored = stored_flight(access, row)
    return stored, _window(stored.flight, start, end)


def check_window(start: float, end: float, points: int) -> None:
    """Raise InputError unless `points` samples between two times [s] can be asked for."""
    if not FEWEST_POINTS <= points <= MOST_POINTS:
        raise InputError(f"{points} points", "points", f"from {FEWEST_POINTS} to {MOST_POINTS}")
    if not start <= end:
        raise InputError(
            f"from {start:g} to {end:g} is not a time interval",
            "from, to",
            "give the earlier time first",
        )


def _columns(stored: StoredFlight, row: FlightRow, name: str) -> list[StoredColumn]:
    columns = stored.columns(name)
    if not columns:
        raise UnknownNameError(
            f"no channel '{name[:80]}'", f"flight {row.label}", nearest(name[:80], stored.names())
        )
    return columns


def _best(columns: Sequence[StoredColumn]) -> StoredColumn:
    """Return the column with what was flown: not a prediction."""
    return [column for column in columns if column.source != "database"][-1]


def _common(values: Array, points: int) -> NDArray[np.intp]:
    """Return indices, at most `points` + 2, with the extremes of each row of `values` (k, n)."""
    chosen = [extremes(row, max(2, points // len(values))) for row in values]
    return np.unique(np.concatenate(chosen))


#: Channels whose range describes the flight's envelope.
ENVELOPE: Final = ("V", "alpha", "beta", "altitude")


def envelopes_of(
    access: WorkspaceAccess, rows: Sequence[FlightRow]
) -> dict[str, dict[str, list[float]]]:
    """Return flight id -> channel -> lowest and highest usable value [SI] of the `ENVELOPE`
    channels.

    A flight whose file is lost has none.
    """
    envelopes: dict[str, dict[str, list[float]]] = {}
    for row in rows:
        envelopes[row.id] = {}
        with suppress(AeroError):
            stored = stored_flight(access, row)
            for name, values in _usable(stored, ENVELOPE):
                envelopes[row.id][name] = [float(np.min(values)), float(np.max(values))]
    return envelopes


def _usable(stored: StoredFlight, names: Sequence[str]) -> Iterator[tuple[str, Array]]:
    """Yield the usable samples of channels that the flight has; corrected values where there are
    any."""
    logged, corrected = stored.flight.metadata["channels"], stored.corrected
    used = [
        stored.columns(name)[-1 if name in corrected else 0]
        for name in names
        if name in logged or name in corrected
    ]
    flags = stored.flight.read([f"flags_{name}" for name in stored.flight.metadata["flags"]])
    for column, values in zip(used, read_together(used, 0, stored.flight.rows), strict=True):
        good = np.isfinite(values) & ~_flags(flags, column.name, len(values))
        if good.any():
            yield column.name, values[good]


def _window(flight: StoredSeries, start: float, end: float) -> tuple[int, int]:
    """Return the rows of the time window and one more on either side; the grid is uniform."""
    n, (first, last) = flight.rows, flight.ends()
    step = (last - first) / max(1, n - 1) or 1.0
    low, high = (float(np.clip((t - first) / step, -1.0, n + 1.0)) for t in (start, end))
    return max(0, int(np.floor(low)) - 1), min(n, int(np.ceil(high)) + 2)


def _flags(columns: Mapping[str, NDArray[Any]], name: str, n: int) -> NDArray[np.bool_]:
    """Return where (n,) samples of a channel must not be used, by its own flags and the flight's;
    columns : ``flags_NAME``."""
    marked = np.zeros(n, dtype=bool)
    for flag in (f"flags_{name}", "flags_flight"):
        if flag in columns:
            marked |= columns[flag] != 0
    return marked


def _flagged(
    columns: Mapping[str, NDArray[Any]], column: StoredColumn
) -> tuple[tuple[float, float], ...]:
    """Return the intervals [s] in which samples of a channel are not used; none for coefficients,
    which have no value there."""
    if column.source not in ("measured", "reconstructed"):
        return ()
    flags = _flags(columns, column.name, len(columns["time"]))
    return tuple(flagged_stretches(columns["time"], flags, _STRETCHES)) if flags.any() else ()
