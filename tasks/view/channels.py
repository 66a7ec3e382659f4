"""Channels of a stored flight for plotting: any time window, decimated, with true extremes kept.

Only the columns and row groups of the window are read: an hour at 100 Hz opens as quickly as a
minute.
"""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import AeroError, InputError, UnknownNameError, nearest
from aerodb.nomenclature import axis_description, channel, is_surface
from aerodb.report import channel_scale, decimated, flagged_stretches
from aerodb.storage.catalogue import FlightRow
from aerodb.storage.files import StoredSeries
from aerodb.support import Array
from aerodb.tasks.workspace_access import WorkspaceAccess

#: Channels shown first, in this order, if the flight has them; surfaces follow.
FIRST: Final = ("V", "alpha", "beta", "p", "q", "r", "ax", "ay", "az", "phi", "theta", "altitude")
PANELS: Final = 12
#: Bounds of the number of points of one series; most series of one answer.
FEWEST_POINTS, MOST_POINTS, MOST_SERIES = 10, 20_000, 40
_STRETCHES: Final = 100


@dataclass(frozen=True, eq=False)
class Series:
    """One line of a plot.

    source : ``measured``, ``reconstructed``, ``flight`` or ``database`` (coefficients). time : (n,)
    [s]. values : (n,) in `unit` (SI); `factor` converts them to the unit in `label`. flagged :
    intervals [s] that are not used.
    """

    name: str
    source: str
    unit: str
    label: str
    factor: float
    time: Array
    values: Array
    flagged: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class Record:
    """Available channels and axes of a flight by name, those shown first, and its start and end
    [s]."""

    channels: tuple[str, ...]
    axes: tuple[str, ...]
    first: tuple[str, ...]
    start: float
    end: float
    samples: int


@dataclass(frozen=True, eq=False)
class _Stored:
    """Stored files of a flight: the mapped channels, those that consistency changed, the last
    comparison."""

    flight: StoredSeries
    consistent: StoredSeries | None
    comparison: StoredSeries | None

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes of the comparison, in stored order; each has as many rows as the flight."""
        if self.comparison is None:
            return ()
        n, count = self.flight.rows, self.comparison.rows // self.flight.rows
        return tuple(
            str(self.comparison.read(["axis"], k * n, k * n + 1)["axis"][0]) for k in range(count)
        )


def record_of(access: WorkspaceAccess, row: FlightRow) -> Record:
    """Return what can be plotted of a flight; InputError if its file is missing or damaged."""
    stored = _open(access, row)
    names = tuple(stored.flight.metadata["channels"])
    surfaces = sorted(name for name in names if is_surface(name))
    chosen = [name for name in FIRST if name in names][: PANELS - min(len(surfaces), 3)]
    first = (*chosen, *surfaces)[:PANELS] or names[:PANELS]
    start, end = stored.flight.ends()
    return Record(names, stored.axes, tuple(first), start, end, stored.flight.rows)


def series_of(
    access: WorkspaceAccess,
    row: FlightRow,
    names: Sequence[str],
    start: float,
    end: float,
    points: int,
) -> tuple[list[Series], tuple[float, float]]:
    """Return the lines of the channels and axes `names` from `start` to `end` [s], and the flight's
    ends.

    Each line has at most `points` + 2 samples. A channel is given as measured and, if consistency
    corrected it, as reconstructed; an axis as flown and as the database predicts it. Raises
    UnknownNameError for a name that the flight lacks, InputError if the number of points or names
    is out of bounds.
    """
    if not FEWEST_POINTS <= points <= MOST_POINTS:
        raise InputError(f"{points} points", "points", f"from {FEWEST_POINTS} to {MOST_POINTS}")
    if len(names) > MOST_SERIES:
        raise InputError(f"{len(names)} names", "names", f"at most {MOST_SERIES} at once")
    if not start <= end:
        raise InputError(
            f"from {start:g} to {end:g} is not a time interval",
            "from, to",
            "give the earlier time first",
        )
    stored = _open(access, row)
    known = [*stored.flight.metadata["channels"], *stored.axes]
    for name in names:
        if name not in known:
            raise UnknownNameError(
                f"no channel '{name[:80]}'", f"flight {row.label}", nearest(name[:80], known)
            )
    window = _window(stored.flight, start, end)
    wanted = list(dict.fromkeys(names))
    channels = [name for name in wanted if name not in stored.axes]
    lines = [
        *_channels(stored, channels, window, points),
        *_coefficients(stored, wanted, window, points),
    ]
    return sorted(lines, key=lambda line: wanted.index(line.name)), stored.flight.ends()


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
            stored = _open(access, row)
            names = [name for name in ENVELOPE if name in stored.flight.metadata["channels"]]
            for line in _whole(stored, names):
                envelopes[row.id][line[0]] = [float(np.min(line[1])), float(np.max(line[1]))]
    return envelopes


def _whole(stored: _Stored, names: Sequence[str]) -> Iterator[tuple[str, Array]]:
    """Yield the usable samples of channels; reconstructed values where consistency corrected
    them."""
    flags = [name for name in stored.flight.metadata["flags"] if name in names or name == "flight"]
    columns = stored.flight.read([*names, *(f"flags_{name}" for name in flags)])
    moved = [
        name
        for name in names
        if stored.consistent is not None and name in stored.consistent.columns
    ]
    columns |= stored.consistent.read(moved) if stored.consistent is not None and moved else {}
    for name in names:
        good = np.isfinite(columns[name])
        for flag in flags:
            if flag in (name, "flight"):
                good &= columns[f"flags_{flag}"] == 0
        if good.any():
            yield name, columns[name][good]


def _open(access: WorkspaceAccess, row: FlightRow) -> _Stored:
    results = access.catalogue.results_of(row.id)
    by_step = {
        step: [r for r in results if r.step == step]
        for step in ("ingest", "consistency", "compare")
    }
    if not by_step["ingest"]:
        raise InputError(
            "its channels are not stored", f"flight {row.label}", "ingest its log again"
        )
    flight = StoredSeries.open(access.file_of(by_step["ingest"][-1].path), "flight")
    consistent = _newest(access, by_step["consistency"], flight.rows)
    released = access.named(row.vehicle, "released")
    compared = [
        StoredSeries.open(access.file_of(r.path), "result") for r in by_step["compare"][-8:]
    ]
    beside = [
        c
        for c in compared
        if c.metadata["metadata"]["version"] == released and c.rows % max(1, flight.rows) == 0
    ]
    return _Stored(flight, consistent, beside[-1] if beside else None)


def _newest(access: WorkspaceAccess, results: Sequence[Any], rows: int) -> StoredSeries | None:
    """Return the newest result with series on the flight's own time grid."""
    for result in reversed(results):
        series = StoredSeries.open(access.file_of(result.path), "result")
        if "time" in series.columns and series.rows == rows:
            return series
    return None


def _window(flight: StoredSeries, start: float, end: float) -> tuple[int, int]:
    """Return the rows of the time window and one more on either side; the grid is uniform."""
    n, (first, last) = flight.rows, flight.ends()
    step = (last - first) / max(1, n - 1) or 1.0
    low, high = (float(np.clip((t - first) / step, -1.0, n + 1.0)) for t in (start, end))
    return max(0, int(np.floor(low)) - 1), min(n, int(np.ceil(high)) + 2)


def _channels(
    stored: _Stored, names: Sequence[str], window: tuple[int, int], points: int
) -> Iterator[Series]:
    if not names:
        return
    flags = [name for name in stored.flight.metadata["flags"] if name in names or name == "flight"]
    columns = stored.flight.read(["time", *names, *(f"flags_{name}" for name in flags)], *window)
    moved: dict[str, Any] = {}
    if stored.consistent is not None:
        changed = [name for name in names if name in stored.consistent.columns]
        moved = stored.consistent.read(changed, *window) if changed else {}
    time = columns["time"]
    everywhere = _flagged(time, [columns["flags_flight"]] if "flight" in flags else [])
    for name in names:
        own = [columns[f"flags_{flag}"] for flag in flags if flag in (name, "flight")]
        flagged = _flagged(time, own) if name in flags else everywhere
        factor, label = channel_scale(name)
        look = (channel(name).unit, label, factor)
        if name in moved:
            yield Series(name, "measured", *look, *decimated(time, columns[name], points))
            yield Series(
                name, "reconstructed", *look, *decimated(time, moved[name], points), flagged
            )
        else:
            yield Series(name, "measured", *look, *decimated(time, columns[name], points), flagged)


def _flagged(
    time: Array, flags: Sequence[NDArray[np.unsignedinteger[Any]]]
) -> tuple[tuple[float, float], ...]:
    """Return the intervals [s] in which any of `flags` (each (n,)) marks a sample as unused."""
    if not flags or not len(time):
        return ()
    return tuple(
        flagged_stretches(time, np.logical_or.reduce([bits != 0 for bits in flags]), _STRETCHES)
    )


def _coefficients(
    stored: _Stored, names: Sequence[str], window: tuple[int, int], points: int
) -> Iterator[Series]:
    n = stored.flight.rows
    for place, axis in enumerate(stored.axes):
        if axis not in names or stored.comparison is None:
            continue
        first, last = (place * n + k for k in window)
        columns = stored.comparison.read(["time", "measured", "predicted", "usable"], first, last)
        label = f"{axis} [-] {axis_description(axis)}"
        for source, name in (("flight", "measured"), ("database", "predicted")):
            values = np.where(columns["usable"], columns[name], np.nan)
            yield Series(axis, source, "1", label, 1.0, *decimated(columns["time"], values, points))
