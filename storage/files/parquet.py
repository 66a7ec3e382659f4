"""Parquet format of stored files: settings, metadata and the exact round trip with NumPy.

Settings as measured on an hour of flight data: zstd level 3, no dictionary, BYTE_STREAM_SPLIT for
floats, DELTA_BINARY_PACKED for wide integers. The same arrays give the same bytes (with the same
pyarrow). Pages and metadata carry checksums: a flipped bit is an error, never another number.
The meaning of columns is defined elsewhere.
"""

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from numpy.typing import NDArray

from aerodb.errors import InputError, UnknownNameError, nearest

#: Rows of a row group. Strided views are copied one group at a time, which bounds memory.
_GROUP_ROWS = 1 << 17
#: Bytes of text that 32-bit offsets reach.
_MOST_TEXT = (1 << 31) - 1
_KEY = b"aerodb"
_CHECK = b"aerodb.sha256"
#: What the library says where memory lacks for the stack of a thread: it has no type for it.
_NO_THREAD: Final = "launch worker thread"


@dataclass(frozen=True)
class Column:
    """One column: its name, values (n,), and optional metadata (unit, description)."""

    name: str
    values: NDArray[Any]
    notes: Mapping[str, str]


def write_columns(path: Path, columns: Sequence[Column], metadata: Mapping[str, Any]) -> None:
    """Write columns of one length to `path`, with `metadata` (JSON) in the schema.

    Values: bool, integers, floats, text or bytes, of any byte order. Other types raise InputError,
    unequal lengths ValueError.
    """
    rows = len(columns[0].values) if columns else 0
    for c in columns:
        if c.values.shape != (rows,):
            raise ValueError(
                f"column {c.name[:80]!r} has shape {c.values.shape}, the first one {(rows,)}"
            )
    fields = [pa.field(c.name, _arrow_type(c), metadata=c.notes) for c in columns]
    document = json_text(
        {**metadata, "dtypes": {c.name: c.values.dtype.str for c in columns}}
    ).encode("ascii")
    schema = pa.schema(
        fields, metadata={_KEY: document, _CHECK: hashlib.sha256(document).hexdigest()}
    )
    with pq.ParquetWriter(
        path,
        schema,
        compression="zstd",
        compression_level=3,
        use_dictionary=False,
        column_encoding={f.name: _encoding(f.type) for f in fields},
        write_page_checksum=True,
        store_schema=True,
    ) as writer:
        for start in range(0, max(rows, 1), _GROUP_ROWS):
            part = slice(start, start + _GROUP_ROWS)
            arrays = [
                _to_arrow(c.values[part], f.type, c.name)
                for c, f in zip(columns, fields, strict=True)
            ]
            writer.write_table(
                pa.Table.from_arrays(arrays, schema=schema), row_group_size=_GROUP_ROWS
            )


def read_metadata(path: Path, kind: str) -> dict[str, Any]:
    """The metadata given to `write_columns`; InputError when the file is missing, damaged or of
    another kind."""
    return metadata_of(opened(path).schema_arrow, path, kind)


def read_columns(
    path: Path, kind: str, names: Iterable[str] | None = None
) -> tuple[dict[str, NDArray[Any]], dict[str, Any]]:
    """Columns (all, or the named ones) in stored order with their own dtypes, and the metadata.

    Raises InputError when the file is missing, damaged or not of this `kind`, UnknownNameError for
    an unknown column.
    """
    file = opened(path)
    schema = file.schema_arrow
    metadata = metadata_of(schema, path, kind)
    stored = dict.fromkeys(schema.names)
    wanted = stored if names is None else dict.fromkeys(names)
    for name in wanted:
        if name not in stored:
            raise UnknownNameError(f"no column '{name}'", str(path), nearest(name, stored))
    try:
        table = file.read(columns=list(wanted))
    except (pa.ArrowException, OSError) as error:
        raise damaged(path, error) from error
    dtypes = metadata["dtypes"]
    return {
        n: from_arrow(table.column(n), np.dtype(dtypes[n])) for n in stored if n in wanted
    }, metadata


def json_text(value: Any) -> str:
    """Return `value` as ASCII JSON with sorted keys: unlike RFC 8785 it raises no error for, and
    keeps, NaN, integers beyond 2^53 and broken text of a log.

    >>> json_text({"b": float("nan"), "a": 2**60})
    '{"a":1152921504606846976,"b":NaN}'
    """
    return json.dumps(value, sort_keys=True, separators=(",", ":"), default=_plain)


def _plain(value: Any) -> Any:
    if isinstance(value, np.generic):
        return value.item()
    raise TypeError(f"{type(value).__name__} cannot be stored as metadata")


def opened(path: Path) -> Any:
    """Return the Parquet file of a path, its pages checked as they are read; InputError when it is
    missing or damaged."""
    try:
        # Strings are read as dictionary arrays, so the few different axis names of a million rows
        # are created once.
        schema = pq.read_schema(path)
        text = [
            name
            for name, kind in zip(schema.names, schema.types, strict=True)
            if pa.types.is_string(kind)
        ]
        return pq.ParquetFile(path, read_dictionary=text or None, page_checksum_verification=True)
    except FileNotFoundError as error:
        raise InputError("the stored file is missing", str(path), "ingest the log again") from error
    except (pa.ArrowException, OSError, UnicodeDecodeError) as error:
        raise damaged(path, error) from error


def damaged(path: Path, error: Exception) -> InputError:
    """Return what is said of a stored file that cannot be read.

    Raises MemoryError where memory for it, or for a thread's stack, is lacking: it may be sound.
    """
    if isinstance(error, MemoryError) or _NO_THREAD in str(error):
        raise MemoryError(str(error)) from error
    return InputError(
        f"stored file cannot be read: {str(error).splitlines()[0][:200]}",
        str(path),
        "ingest the log again",
    )


def metadata_of(schema: Any, path: Path, kind: str) -> dict[str, Any]:
    """Return the metadata given to `write_columns` from a file's schema; InputError when it is
    damaged or of another kind."""
    stored = schema.metadata or {}
    text = stored.get(_KEY, b"{}")
    if stored.get(_CHECK, b"").decode("ascii", "replace") != hashlib.sha256(text).hexdigest():
        raise damaged(path, ValueError("it is damaged, or another program wrote it"))
    metadata: dict[str, Any] = json.loads(text)
    if metadata["kind"] != kind:
        raise InputError(
            f"this file is not a stored {kind}", str(path), f"name a file that contains a {kind}"
        )
    if list(metadata["dtypes"]) != sorted(schema.names):
        raise damaged(path, ValueError("its columns are not those that were written"))
    return metadata


def _arrow_type(column: Column) -> Any:
    dtype = column.values.dtype
    if dtype.kind in "biuf" and dtype.itemsize <= 8:
        return pa.from_numpy_dtype(dtype.newbyteorder("="))
    kinds = set(map(type, column.values.tolist())) if dtype.kind == "O" else set()
    if dtype.kind == "U" or (dtype.kind == "O" and all(issubclass(kind, str) for kind in kinds)):
        return pa.string()
    if dtype.kind == "S":
        return pa.binary()
    raise InputError(
        f"values of type {dtype} cannot be stored",
        column.name,
        "convert them to numbers or text in the reader",
    )


def _encoding(kind: Any) -> str:
    if pa.types.is_floating(kind):
        return "BYTE_STREAM_SPLIT"
    return "DELTA_BINARY_PACKED" if kind in (pa.int64(), pa.uint64()) else "PLAIN"


def _to_arrow(values: NDArray[Any], kind: Any, name: str) -> Any:
    if values.dtype.kind in "UOS":
        try:
            return _text(values, kind)
        except UnicodeEncodeError as error:
            raise InputError(
                "text is not valid Unicode", name, "decode it with errors='replace' in the reader"
            ) from error
    native = np.ascontiguousarray(values, dtype=values.dtype.newbyteorder("="))
    if native.dtype.kind == "b":
        native = np.packbits(native, bitorder="little")
    # `pa.array` and `to_numpy` import pandas, which takes longer than writing or reading ten
    # minutes of flight.
    return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(native)])


def _text(values: NDArray[Any], kind: Any) -> Any:
    """Text or bytes as an array of Arrow; UnicodeEncodeError for text that is not valid Unicode."""
    words = values.tolist()
    if values.dtype.kind == "S":
        whole = b"".join(words)
    else:
        joined = "".join(words)
        whole = joined.encode("utf-8")
        if len(whole) != len(joined):
            words = [word.encode("utf-8") for word in words]
    if len(whole) > _MOST_TEXT:
        return pa.array(words, type=kind)
    ends = np.zeros(len(words) + 1, dtype=np.int32)
    np.cumsum(np.fromiter(map(len, words), np.int64, len(words)), out=ends[1:])
    return pa.Array.from_buffers(kind, len(words), [None, pa.py_buffer(ends), pa.py_buffer(whole)])


def from_arrow(column: Any, dtype: np.dtype[Any]) -> NDArray[Any]:
    """Return a column of a file from `opened` as it was written, (rows,)."""
    if not len(column):
        return np.empty(0, dtype)
    if dtype.kind in "UO":
        encoded = column.combine_chunks() if column.num_chunks != 1 else column.chunk(0)
        words = np.array(encoded.dictionary.to_pylist(), dtype=dtype)
        found: NDArray[Any] = words[np.from_dlpack(encoded.indices)]  # to_numpy() imports pandas
        return found
    if dtype.kind == "S":
        return np.array(column.to_pylist(), dtype=dtype)
    whole = column.combine_chunks()
    if dtype.kind == "b":
        bits = np.frombuffer(whole.buffers()[1], dtype=np.uint8)
        return np.unpackbits(bits, bitorder="little")[
            whole.offset : whole.offset + len(whole)
        ].astype(dtype)
    values: NDArray[Any] = (
        np.from_dlpack(whole) if dtype.kind in "iuf" else whole.to_numpy(zero_copy_only=False)
    )
    return values.astype(dtype, copy=False)
