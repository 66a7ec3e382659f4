"""What is stored of a flight along its time grid: the channels of its log, what reconstruction made
of them, the coefficients flown, and the newest prediction of them.

Coefficients are the flight's own: they are there whichever version is released. A prediction says
of which version it is.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.nomenclature import RESULT_COLUMNS, axis_description, channel
from aerodb.report import channel_scale, for_people
from aerodb.storage.catalogue import FlightRow, ResultRow
from aerodb.storage.files import StoredSeries
from aerodb.support import Array
from aerodb.tasks.result_versions import RELEASED
from aerodb.tasks.workspace_access import WorkspaceAccess

Source = Literal["measured", "reconstructed", "flight", "database", "sigma", "logged"]
_SIGMA: Final = "sigma_"
_STEPS: Final = ("ingest", "consistency", "coefficients", "compare")


@dataclass(frozen=True, eq=False)
class StoredColumn:
    """Where the values of a name are.

    source : ``measured``, ``reconstructed``, ``flight`` or ``database`` (coefficients), ``sigma``
    (one standard error). unit : of the values; `factor` converts them to the unit in `label`.
    first : row of the flight's first sample. usable : column that says which values count, if any.
    version : label of the version that predicts them.
    """

    name: str
    source: Source
    unit: str
    label: str
    factor: float
    series: StoredSeries
    column: str
    first: int = 0
    usable: str = ""
    version: str = ""

    @property
    def stored(self) -> tuple[str, ...]:
        """Columns of `series` that the values are made of."""
        return (self.column, self.usable) if self.usable else (self.column,)

    def values(self, found: Mapping[str, NDArray[Any]]) -> Array:
        """Values (n,) from the columns `stored` of `series`; nan where none counts."""
        values = np.asarray(found[self.column], dtype=np.float64)
        return np.where(found[self.usable], values, np.nan) if self.usable else values


def read_together(columns: Sequence[StoredColumn], first: int, last: int) -> list[Array]:
    """Return the values (n,) of each column, in its unit, at the flight's samples `first` to `last`
    (exclusive); each file is read once."""
    wanted: dict[tuple[int, int], list[StoredColumn]] = {}
    for column in columns:
        wanted.setdefault((id(column.series), column.first), []).append(column)
    found = {
        key: group[0].series.read(
            [name for column in group for name in column.stored], key[1] + first, key[1] + last
        )
        for key, group in wanted.items()
    }
    return [column.values(found[id(column.series), column.first]) for column in columns]


@dataclass(frozen=True, eq=False)
class StoredFlight:
    """Stored files of a flight; those after `flight` may be missing.

    predicted : of `version`, its label.
    """

    flight: StoredSeries
    consistent: StoredSeries | None
    coefficients: StoredSeries | None
    predicted: StoredSeries | None
    version: str

    @property
    def axes(self) -> tuple[str, ...]:
        """Axes with coefficients, in stored order."""
        if self.coefficients is None:
            return ()
        return tuple(self.coefficients.metadata["metadata"]["axes"])

    @property
    def channels(self) -> tuple[str, ...]:
        """Channels of the log, then those that only the reconstruction gives."""
        logged = tuple(self.flight.metadata["channels"])
        return (*logged, *(name for name in self._reconstructed() if name not in logged))

    @property
    def sigmas(self) -> tuple[str, ...]:
        """Channels and axes whose standard errors are stored."""
        columns = () if self.consistent is None else self.consistent.columns
        own = [name.removeprefix(_SIGMA) for name in columns if name.startswith(_SIGMA)]
        return (*own, *self.axes)

    @property
    def corrected(self) -> tuple[str, ...]:
        """Channels that consistency corrected and later steps use."""
        return (
            ()
            if self.consistent is None
            else tuple(self.consistent.metadata["metadata"]["changed"])
        )

    def _reconstructed(self) -> tuple[str, ...]:
        if self.consistent is None:
            return ()
        return tuple(
            name
            for name in self.consistent.columns
            if name != "time" and not name.startswith((_SIGMA, "flags_"))
        )

    def names(self) -> tuple[str, ...]:
        """Everything that `columns` takes."""
        return (*self.channels, *self.axes, *(f"{_SIGMA}{name}" for name in self.sigmas))

    def columns(self, name: str) -> list[StoredColumn]:
        """Columns with the values of a name, the best ones last; none, and no error, for an unknown
        one. Each has its SI unit, and factor and label for display (`channel_scale`)."""
        if name in self.axes:
            return self._of_axis(name)
        inner = name.removeprefix(_SIGMA)
        if inner != name:
            return self._of_sigma(inner) if inner in self.sigmas else []
        if name not in self.channels:
            return []
        factor, label = channel_scale(name)
        look, found = (channel(name).unit, label, factor), []
        if name in self.flight.metadata["channels"]:
            found.append(StoredColumn(name, "measured", *look, self.flight, name))
        if self.consistent is not None and name in self._reconstructed():
            found.append(StoredColumn(name, "reconstructed", *look, self.consistent, name))
        return found

    def _of_axis(self, axis: str) -> list[StoredColumn]:
        assert self.coefficients is not None
        n, label = self.flight.rows, f"{axis} [-] {axis_description(axis)}"
        first = n * self.axes.index(axis)
        flown = StoredColumn(
            axis, "flight", "1", label, 1.0, self.coefficients, "measured", first, "usable"
        )
        found = [flown]
        if self.predicted is not None:
            for row in range(0, self.predicted.rows, n):
                if self.predicted.read(["axis"], row, row + 1)["axis"][0] == axis:
                    found.append(
                        replace(
                            flown,
                            source="database",
                            series=self.predicted,
                            column="predicted",
                            first=row,
                            version=self.version,
                        )
                    )
        return found

    def _of_sigma(self, name: str) -> list[StoredColumn]:
        own = _SIGMA + name
        if name in self.axes:
            (flown, *_), label = self._of_axis(name), f"{own} [-] one standard error"
            return [replace(flown, name=own, source="sigma", label=label, column="sigma")]
        assert self.consistent is not None
        unit = RESULT_COLUMNS[own].unit
        factor, shown = for_people(unit)
        label = f"{own} [{shown}] one standard error"
        return [StoredColumn(own, "sigma", unit, label, factor, self.consistent, own)]


def stored_flight(access: WorkspaceAccess, row: FlightRow) -> StoredFlight:
    """Open what is stored of a flight (docs/reference/conventions.md, section "Stored files");
    InputError if its channels are missing or damaged."""
    results = access.catalogue.results_of(row.id)
    by_step = {step: [r for r in results if r.step == step] for step in _STEPS}
    if not by_step["ingest"]:
        raise InputError(
            "its channels are not stored", f"flight {row.label}", "ingest its log again"
        )
    flight = StoredSeries.open(access.file_of(by_step["ingest"][-1].path), "flight")
    consistent = next(
        (
            series
            for _, series in _newest_first(access, by_step["consistency"])
            if "time" in series.columns and series.rows == flight.rows
        ),
        None,
    )
    key, coefficients = next(
        (
            (result.key, series)
            for result, series in _newest_first(access, by_step["coefficients"])
            if series.rows == flight.rows * len(series.metadata["metadata"]["axes"])
        ),
        ("", None),
    )
    version, predicted = _prediction(
        access, row, [r for r in by_step["compare"] if key in r.inputs]
    )
    return StoredFlight(flight, consistent, coefficients, predicted, version)


def _newest_first(
    access: WorkspaceAccess, results: Sequence[ResultRow]
) -> Iterator[tuple[ResultRow, StoredSeries]]:
    for result in reversed(results):
        path = access.file_of(result.path)
        if path.is_file():  # a lost result is computed again when a step needs it
            yield result, StoredSeries.open(path, "result")


def _prediction(
    access: WorkspaceAccess, row: FlightRow, results: Sequence[ResultRow]
) -> tuple[str, StoredSeries | None]:
    """Return label and comparison of the released version, if the flight was compared with it, else
    of the version that it was last compared with."""
    released = access.named(row.vehicle, RELEASED)
    beside = [result for result in results if released in result.inputs] or results
    for _, series in _newest_first(access, beside[-1:]):
        version = series.metadata["metadata"]["version"]
        known = access.catalogue.versions_by_id([version]).get(version)
        return (known.label if known is not None else version[:12]), series
    return "", None
