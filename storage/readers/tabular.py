"""Reader of tables: MAT v5-v7.3, Parquet, CSV, and whitespace-separated ASCII (.asc .dat .txt).

A table has no clock until a mapping file names its time field, so `Topic.time` is the sample index
here. The mapping file is chosen by `aerodb.logs.mapping.choose_mapping`.
"""

import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.recording import Damage, Recording, Topic
from aerodb.storage.readers.mat import MOST_BYTES, Variables, read_hdf5, read_mat5
from aerodb.storage.readers.mission_planner import converted, is_converted
from aerodb.storage.readers.text import read_text, split_unit
from aerodb.storage.readers.text_cells import Cells, numbers_of
from aerodb.support import is_mat5

#: Topic of a file that holds one table, and of the vectors of a MAT file.
TABLE: Final = "table"
#: A matrix this many times wider than high holds its samples along the rows.
_LYING: Final = 10
#: Names of the cells of texts that name the columns of a matrix, or their endings.
_NAMES: Final = ("label", "labels", "names", "columns", "header", "headers", "varnames", "signals")
_HDF5: Final = b"\x89HDF\r\n\x1a\n"
_TEXT_SUFFIXES = (".csv", ".tsv", ".asc", ".dat", ".txt", ".lvm")
SUFFIXES: Final = (".mat", ".h5", ".hdf5", ".parquet", *_TEXT_SUFFIXES)


def read_tabular(path: Path) -> Recording:
    """Read a table file as a Recording of format ``tabular``; its kind is recognised by its first
    bytes, else by its suffix.

    CSV, ASCII and Parquet give one topic ``table`` whose fields are the named columns, or ``"1"``,
    ``"2"``, ... without a header. In a MAT file, each numeric matrix is a topic with fields
    ``"1"``, ``"2"``, ... (its columns, counted from 1; its rows if it is far wider than high),
    members of structs have dotted names, all vectors of the longest length are fields of the topic
    ``table`` (of another length n: ``table_n``), and numbers and texts are metadata. `Topic.time`
    is the sample index.

    A log that Mission Planner converted is one of format ``dataflash`` where its messages are
    enough for that. Units come from the field metadata ``unit`` of Parquet and from headers such as
    ``alpha [deg]`` or ``alpha (deg)``. Raises InputError for a file that is empty, of another type,
    ragged, or without a table; a truncated end is reported as damage, and the rows before it are
    kept.
    """
    where = str(path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(
            f"the log cannot be read: {error.strerror or error}",
            where,
            "check its path and permissions",
        ) from error
    if not data:
        raise InputError("the file is empty", where, "copy the log again")
    topics, metadata, damage = _parse(data, path.suffix.lower(), where)
    if not topics:
        what = "the file contains no table of numbers" + (f" ({damage[0].what})" if damage else "")
        remedy = str(metadata.get("remarks", "")) or (
            "a table needs at least two rows and one column of numbers"
        )
        raise InputError(what, where, remedy)
    digest, kind = hashlib.sha256(data).hexdigest(), "tabular"
    if is_converted(topics):
        topics, is_log = converted(topics)
        kind = "dataflash" if is_log else kind
    return Recording(where, kind, digest, len(data), topics, metadata, tuple(damage))


Parsed = tuple[dict[str, Topic], dict[str, str | int | float], list[Damage]]


def _parse(data: bytes, suffix: str, where: str) -> Parsed:
    if data[:4] == b"PAR1":
        return _parquet(data, where)
    if data[:8] == _HDF5 or data[512:520] == _HDF5:
        return _from_variables(read_hdf5(data, where))
    if is_mat5(data):
        return _from_variables(read_mat5(data))
    if suffix in _TEXT_SUFFIXES:
        table = read_text(data, where)
        return {TABLE: _topic(TABLE, table.columns, table.units)}, table.metadata, table.damage
    if suffix in SUFFIXES:
        what = f"not a {suffix} file of a known version: it begins with {data[:8]!r}"
        raise InputError(
            what, where, "save a MAT file with version 5 or later; give text a suffix such as .csv"
        )
    kind = f"unknown kind of table '{suffix}'" if suffix else "no suffix, and unknown first bytes"
    raise InputError(kind, where, f"known: {', '.join(SUFFIXES)}")


def _topic(
    name: str, fields: Mapping[str, NDArray[Any]], units: Mapping[str, str] | None = None
) -> Topic:
    length = len(next(iter(fields.values())))
    return Topic(name, np.arange(length, dtype=np.float64), fields, units or {})


def _from_variables(variables: Variables) -> Parsed:
    """Topics from variables: matrices as separate topics, vectors grouped by length, numbers and
    texts as metadata."""
    topics: dict[str, Topic] = {}
    metadata: dict[str, str | int | float] = {}
    vectors: dict[int, dict[str, NDArray[Any]]] = {}
    skipped, used = list(variables.skipped), set[str]()
    for name, value in variables.values.items():
        if isinstance(value, str):
            metadata[name] = value
        elif value.size == 1:
            metadata[name] = value.ravel()[0].item()
        elif value.ndim <= 2 and value.size and value.size == max(value.shape):
            vectors.setdefault(value.size, {})[name] = value.ravel(order="F")
        elif value.ndim == 2 and value.size:
            upright = value.T if value.shape[1] > _LYING * value.shape[0] else value
            names, units = _labels(variables.labels, name, upright.shape[1], used)
            fields = dict(zip(names, upright.T, strict=True))
            stated = {own: unit for own, unit in zip(names, units, strict=True) if unit}
            topics[name] = _topic(name, fields, stated)
        elif value.size:
            skipped.append(name)
    for length in sorted(vectors, reverse=True):
        name = TABLE if length == max(vectors) else f"{TABLE}_{length}"
        while name in topics:
            name += "_vectors"
        topics[name] = _topic(name, vectors[length])
    skipped += [name for name in variables.labels if name not in used]
    if skipped:
        metadata["skipped"] = ", ".join(skipped)
    if variables.remarks:
        metadata["remarks"] = "; ".join(variables.remarks)
    return topics, metadata, variables.damage


def _labels(
    known: Mapping[str, list[str]], name: str, width: int, used: set[str]
) -> tuple[list[str], list[str]]:
    """Names and units of the columns of a matrix, from the cell of texts beside it; numbers without
    one. It is ``ATT_label`` of Mission Planner, or ``names`` and ``units`` in the same struct.

    used : labels that were taken, to which these are added.
    """
    before = name.rpartition(".")[0]
    parent = f"{before}." if before else ""

    def beside(endings: tuple[str, ...]) -> list[str]:
        places = [f"{name}_{end}" for end in endings] + [f"{parent}{end}" for end in endings]
        place = next((p for p in places if len(known.get(p, ())) == width), "")
        used.update({place} if place else ())
        return known.get(place, [])

    names, units = beside(_NAMES), beside(("units", "unit"))
    split = [split_unit(label) for label in names]
    unique = len({short for short, _ in split}) == width and all(short for short, _ in split)
    if not unique:
        split = [(str(k + 1), "") for k in range(width)]
    stated = [unit or own for unit, (_, own) in zip(units or [""] * width, split, strict=True)]
    return [short for short, _ in split], stated


def _parquet(data: bytes, where: str) -> Parsed:
    try:
        file = pq.ParquetFile(pa.BufferReader(data))
        rows, width = file.metadata.num_rows, file.metadata.num_columns
        if (
            max(
                rows * width * 8,
                sum(file.metadata.row_group(k).total_byte_size for k in range(file.num_row_groups)),
            )
            > MOST_BYTES
        ):
            raise InputError(
                f"{rows} rows of {width} columns are too large", where, "split the log"
            )
        table = file.read()
    except (InputError, MemoryError):
        raise
    except Exception as error:  # Arrow raises its own types, OSError, and more on damaged metadata
        what = f"not readable as Parquet: {str(error)[:200]}"
        raise InputError(
            what, where, "copy the log again: a cut Parquet file has lost its index"
        ) from error
    fields: dict[str, NDArray[Any]] = {}
    units: dict[str, str] = {}
    skipped, remarks = [], []
    for column, declared in zip(table.columns, table.schema, strict=True):
        values = _numbers(column)
        said = _texts_as_numbers(column) if values is None else None
        if said is not None:
            values = said.values
            remarks.append(f"{declared.name}: {said.read_as or 'numbers stored as text'}")
        if values is None or not len(values):
            skipped.append(declared.name)
            continue
        fields[declared.name] = values
        unit = (declared.metadata or {}).get(b"unit")
        if pa.types.is_temporal(declared.type):
            units[declared.name] = "s"
        elif said is not None and said.unit:
            units[declared.name] = said.unit
        elif unit is not None:
            units[declared.name] = unit.decode("utf-8", errors="replace")
    metadata: dict[str, str | int | float] = {"skipped": ", ".join(skipped)} if skipped else {}
    if remarks:
        metadata["remarks"] = "; ".join(remarks)
    return {TABLE: _topic(TABLE, fields, units)} if fields else {}, metadata, []


def _numbers(column: pa.ChunkedArray) -> NDArray[Any] | None:
    """A Parquet column as numbers (nulls as NaN, times in s since 1970, durations and times of day
    in s); None if it contains anything else."""
    kind = column.type
    if pa.types.is_dictionary(kind):
        column = column.cast(kind.value_type)
        kind = column.type
    if pa.types.is_timestamp(kind):
        nanoseconds = column.cast(pa.timestamp("ns", kind.tz), safe=False).cast(pa.int64())
        return np.asarray(nanoseconds.to_numpy(), dtype=np.float64) * 1e-9
    if pa.types.is_duration(kind):
        nanoseconds = column.cast(pa.duration("ns"), safe=False).cast(pa.int64())
        return np.asarray(nanoseconds.to_numpy(), dtype=np.float64) * 1e-9
    if pa.types.is_time(kind):
        scale = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[kind.unit]
        whole = column.cast(pa.int32() if pa.types.is_time32(kind) else pa.int64())
        return np.asarray(whole.to_numpy(), dtype=np.float64) * scale
    if pa.types.is_decimal(kind):
        return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(), dtype=np.float64)
    if pa.types.is_boolean(kind) or pa.types.is_integer(kind) or pa.types.is_floating(kind):
        values = column.to_numpy()
        return values if values.dtype.kind in "fiu" else np.asarray(values, dtype=np.float64)
    return None


def _texts_as_numbers(column: pa.ChunkedArray) -> Cells | None:
    """A Parquet column of texts as the numbers or times that they say; None if they say none."""
    kind = column.type.value_type if pa.types.is_dictionary(column.type) else column.type
    if not (pa.types.is_string(kind) or pa.types.is_large_string(kind)):
        return None
    return numbers_of(column.cast(pa.string()).to_pandas(), comma=False)
