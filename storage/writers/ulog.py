"""ULog writer: topics as a PX4 log file that PX4's own tools can read.

The built-in example and the benchmarks write their flights with it, so that they are read like any
other log.
"""

import os
import re
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.recording import Topic

_TYPES = {
    **{f"i{n}": f"int{8 * n}_t" for n in (1, 2, 4, 8)},
    **{f"u{n}": f"uint{8 * n}_t" for n in (1, 2, 4, 8)},
    **{"f4": "float", "f8": "double", "b1": "bool"},
}
_FIELD = re.compile(r"([A-Za-z]\w*)(?:\[(\d+)\])?", re.ASCII)
_TOPIC = re.compile(r"([A-Za-z][A-Za-z0-9_]*)(?:\.(\d{1,3}))?", re.ASCII)
#: Messages that are laid out in memory at a time.
_BLOCK = 1 << 18


@dataclass(frozen=True)
class _Series:
    """One topic ready to be written: complete messages (n,) as packed records, and their timestamps
    in us (n,)."""

    name: str
    instance: int
    format: str
    stamps: NDArray[np.int64]
    messages: NDArray[Any]


def write_ulog(
    path: Path,
    topics: Iterable[Topic],
    *,
    metadata: Mapping[str, str | int | float] | None = None,
    parameters: Mapping[str, float | int] | None = None,
    start_utc: datetime | None = None,
) -> None:
    """Write topics as a ULog file, with the messages of all topics in the order of time.

    Parameters
    ----------
    path :
        The file; it appears complete or not at all.
    topics :
        Times [s] (written as whole microseconds) and fields (n,) of integer, float32, float64 or
        bool. Fields ``q[0] q[1] ...`` become one array; a topic named ``name.2`` is instance 2 of
        ``name``.
    metadata :
        Information messages (``sys_name``, ``ver_hw``, ``ver_sw`` are PX4's own).
    parameters :
        int32 or float32, as in PX4.
    start_utc :
        UTC at the first message; written as information ``start_utc``.

    Raises
    ------
    InputError
        For names, types or times that the format cannot represent.

    References
    ----------
    ULog file format, docs.px4.io.
    """
    series = [_series(topic, identity) for identity, topic in enumerate(topics)]
    start = min((int(s.stamps.min()) for s in series if len(s.stamps)), default=0)
    information = dict(metadata or {})
    if start_utc is not None:
        information["start_utc"] = start_utc.astimezone(UTC).isoformat()
    descriptor, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(descriptor, "wb") as out:
            out.write(
                b"ULog\x01\x12\x35\x01" + start.to_bytes(8, "little") + _message("B", bytes(40))
            )
            out.writelines(_message("F", text.encode()) for text in _formats(series))
            out.writelines(
                _message("I", _key_value(key, value)) for key, value in information.items()
            )
            out.writelines(
                _message("P", _parameter(key, value)) for key, value in (parameters or {}).items()
            )
            for identity, s in enumerate(series):
                out.write(
                    _message(
                        "A", bytes([s.instance]) + identity.to_bytes(2, "little") + s.name.encode()
                    )
                )
            _write_interleaved(out, series)
            out.flush()
            os.fsync(out.fileno())
        os.replace(temporary, path)
    except BaseException:
        os.unlink(temporary)
        raise


def _message(kind: str, body: bytes) -> bytes:
    if len(body) > 0xFFFF:
        raise InputError(
            f"{len(body)} bytes do not fit into one message",
            remedy="shorten the text or split the topic",
        )
    return len(body).to_bytes(2, "little") + kind.encode() + body


def _key_value(key: str, value: str | int | float) -> bytes:
    if isinstance(value, str):
        content = value.encode()
        kind = f"char[{len(content)}]"
    elif isinstance(value, int):
        small = -(2**31) <= value < 2**31
        kind, content = (
            ("int32_t", value.to_bytes(4, "little", signed=True))
            if small
            else ("int64_t", np.int64(value).tobytes())
        )
    else:
        kind, content = "double", np.float64(value).tobytes()
    return _keyed(kind, key, content)


def _parameter(key: str, value: float | int) -> bytes:
    if isinstance(value, int):
        return _keyed("int32_t", key, value.to_bytes(4, "little", signed=True))
    return _keyed("float", key, np.float32(value).tobytes())


def _keyed(kind: str, key: str, content: bytes) -> bytes:
    text = f"{kind} {key}".encode()
    if not re.fullmatch(r"[\w\-.]+", key, re.ASCII) or len(text) > 255:
        raise InputError(
            f"'{key}' is not allowed as a key in ULog",
            remedy="use letters, digits, '_', '-' and '.', at most 200",
        )
    return bytes([len(text)]) + text + content


def _series(topic: Topic, identity: int) -> _Series:
    """A topic as messages ready to be written: header, message id, timestamp, fields."""
    named = _TOPIC.fullmatch(topic.name)
    if named is None or int(named[2] or 0) > 255:
        raise InputError(
            f"'{topic.name}' is not allowed as a topic in ULog",
            remedy="use letters, digits and '_', then '.instance'",
        )
    ordered = sorted(
        topic.fields, key=lambda f: _split(topic.name, f)[1]
    )  # stable: array elements by index
    groups: dict[str, list[str]] = {}
    for name in ordered:
        groups.setdefault(_split(topic.name, name)[0], []).append(name)
    text = f"{named[1]}:uint64_t timestamp;" + "".join(
        _declare(topic, base, names) for base, names in groups.items()
    )
    kinds = [
        (name, topic.fields[name].dtype.newbyteorder("<"))
        for names in groups.values()
        for name in names
    ]
    record = np.dtype(
        [(":size", "<u2"), (":type", "u1"), (":id", "<u2"), (":stamp", "<u8"), *kinds]
    )
    stamps = _stamps(topic)
    messages = np.empty(len(stamps), dtype=record)
    if record.itemsize - 3 > 0xFFFF:
        raise InputError(
            f"{record.itemsize} bytes do not fit into one message", topic.name, "split the topic"
        )
    messages[":size"], messages[":type"], messages[":id"] = record.itemsize - 3, ord("D"), identity
    messages[":stamp"] = stamps
    for name, _ in kinds:
        if topic.fields[name].shape != stamps.shape:
            raise InputError(
                f"{topic.fields[name].shape} values for {len(stamps)} times",
                f"{topic.name}, field {name}",
            )
        messages[name] = topic.fields[name]
    return _Series(named[1], int(named[2] or 0), text, stamps, messages)


def _split(topic: str, name: str) -> tuple[str, int]:
    """``q[2]`` as ``("q", 2)``, a plain field as ``(name, -1)``."""
    match = _FIELD.fullmatch(name)
    if match is None or match[1] == "timestamp":
        raise InputError(
            f"'{name}' is not allowed as a field in ULog",
            topic,
            "use letters, digits and '_', then '[index]'",
        )
    return match[1], int(match[2]) if match[2] is not None else -1


def _declare(topic: Topic, base: str, names: Sequence[str]) -> str:
    """``float[4] q;`` or ``float V;``"""
    kinds = {
        f"{topic.fields[name].dtype.kind}{topic.fields[name].dtype.itemsize}" for name in names
    }
    kind = _TYPES.get(next(iter(kinds)))
    if len(kinds) > 1 or kind is None:
        raise InputError(
            f"field '{base}' has type {', '.join(sorted(kinds))}",
            topic.name,
            "use one integer, float or bool type",
        )
    if names == [base]:
        return f"{kind} {base};"
    if list(names) != [f"{base}[{k}]" for k in range(len(names))]:
        raise InputError(
            f"array '{base}' has gaps: {', '.join(names)}", topic.name, "number its elements from 0"
        )
    return f"{kind}[{len(names)}] {base};"


def _stamps(topic: Topic) -> NDArray[np.int64]:
    microseconds = np.round(np.asarray(topic.time, dtype=np.float64) * 1e6)
    if not np.all(np.isfinite(microseconds)) or np.any(
        (microseconds < 0) | (microseconds > 2.0**62)
    ):
        raise InputError(
            "times must be finite and not negative",
            topic.name,
            "give times in seconds from the start of the log",
        )
    return microseconds.astype(np.int64)


def _formats(series: Sequence[_Series]) -> list[str]:
    formats: dict[str, str] = {}
    for s in series:
        if formats.setdefault(s.name, s.format) != s.format:
            raise InputError(
                "instances of one topic differ in their fields", s.name, "give them different names"
            )
    return list(formats.values())


def _write_interleaved(out: BinaryIO, series: Sequence[_Series]) -> None:
    """All messages in the order of time; each topic keeps its own order even where its clock runs
    backwards."""
    if not series:
        return
    keys = np.concatenate([np.maximum.accumulate(s.stamps) for s in series])
    owner = np.repeat(np.arange(len(series), dtype=np.uint16), [len(s.stamps) for s in series])
    owner = owner[np.argsort(keys, kind="stable")]
    lengths = np.array([s.messages.itemsize for s in series], dtype=np.int64)
    cursor = np.zeros(len(series), dtype=np.int64)
    for first in range(0, len(owner), _BLOCK):
        whose = owner[first : first + _BLOCK]
        ends = np.cumsum(lengths[whose])
        block = np.empty(int(ends[-1]), dtype=np.uint8)
        for k in np.unique(whose):
            s, size = series[k], int(lengths[k])
            places = ends[whose == k] - size
            chunk = s.messages[cursor[k] : cursor[k] + len(places)].view(f"V{size}")
            # One record may start at any byte: a view with stride one, into which whole records are
            # put.
            np.ndarray(len(block) - size + 1, f"V{size}", block, strides=(1,))[places] = chunk
            cursor[k] += len(places)
        out.write(block.tobytes())
