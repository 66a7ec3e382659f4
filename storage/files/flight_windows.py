"""Parts of stored time series: reads only the requested columns and the row groups of the requested
rows."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.storage.files.parquet import damaged, from_arrow, metadata_of, opened

_REMEDY: Final = "ingest the log again"


@dataclass(frozen=True, eq=False)
class StoredSeries:
    """A stored file of columns over time, with its `metadata` and the names of its `columns`."""

    path: Path
    metadata: dict[str, Any]
    columns: tuple[str, ...]
    _file: Any

    @classmethod
    def open(cls, path: Path, kind: str) -> "StoredSeries":
        """The file at `path`; InputError when it is absent, damaged or not of this `kind`
        (``flight``, ``result``)."""
        file = opened(path)
        schema = file.schema_arrow
        return cls(path, metadata_of(schema, path, kind), tuple(schema.names), file)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return int(self._file.metadata.num_rows)

    def ends(self) -> tuple[float, float]:
        """First and last ``time`` [s] of a series on one increasing time grid, from the statistics
        in the file: no column is read."""
        place = self.columns.index("time")
        groups = [
            self._file.metadata.row_group(k).column(place).statistics
            for k in range(self._file.num_row_groups)
        ]
        known = [group for group in groups if group is not None and group.has_min_max]
        if not known:
            raise InputError("the file has no statistics of its times", str(self.path), _REMEDY)
        return float(known[0].min), float(known[-1].max)

    def read(
        self, names: Iterable[str], first: int = 0, last: int | None = None
    ) -> dict[str, NDArray[Any]]:
        """Rows `first` to `last` (exclusive) of the columns `names`, each (rows,) with its own
        dtype.

        Raises UnknownNameError for an unknown column, InputError for a damaged file.
        """
        wanted = list(dict.fromkeys(names))
        for name in wanted:
            if name not in self.columns:
                raise UnknownNameError(
                    f"no column '{name}'", str(self.path.name), nearest(name, self.columns)
                )
        last = self.rows if last is None else min(last, self.rows)
        sizes = [
            self._file.metadata.row_group(k).num_rows for k in range(self._file.num_row_groups)
        ]
        starts = np.concatenate([[0], np.cumsum(sizes)])
        groups = [k for k in range(len(sizes)) if starts[k] < last and starts[k + 1] > first]
        if not groups or not wanted:
            return {name: np.empty(0) for name in wanted}
        try:
            table = self._file.read_row_groups(groups, columns=wanted)
        except (pa.ArrowException, OSError) as error:
            raise damaged(self.path, error) from error
        part = slice(int(first - starts[groups[0]]), int(last - starts[groups[0]]))
        dtypes = self.metadata["dtypes"]
        return {
            name: from_arrow(table.column(name), np.dtype(dtypes[name]))[part] for name in wanted
        }
