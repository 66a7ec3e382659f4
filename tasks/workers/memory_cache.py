"""Memory cache of a process: flights, coefficients and comparisons, by the hash of their inputs.

The cache is bounded in bytes and evicts what was used least recently. Cached arrays are read-only.
"""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass
from pathlib import Path
from threading import Lock
from typing import Any, Final, TypeVar

import numpy as np

from aerodb.tables import AeroDatabase

Value = TypeVar("Value")

#: Bound of the whole cache [bytes]: about 30 flights of ten minutes at 50 Hz.
_MAX_BYTES: Final = 512 * 2**20


@dataclass
class _Entries:
    """Values in the order of their last use, and the memory that they hold.

    values : key -> value and its memory (`_held_by`). holders : block of memory -> how many values
    hold it; what flights, coefficients and comparisons share counts once. size : bytes.
    """

    values: OrderedDict[Hashable, tuple[Any, dict[int, int]]] = field(default_factory=OrderedDict)
    holders: dict[int, int] = field(default_factory=dict)
    size: int = 0

    def used(self, key: Hashable) -> tuple[Any, dict[int, int]] | None:
        """Return an entry, which is then the last used; None where there is none."""
        if key in self.values:
            self.values.move_to_end(key)
        return self.values.get(key)

    def add(self, key: Hashable, value: Any, held: dict[int, int]) -> None:
        """Keep a value, and forget those used least recently until the bound is met."""
        if key in self.values:
            self._forget(key)
        self.values[key] = value, held
        for block, size in held.items():
            self.holders[block] = self.holders.get(block, 0) + 1
            self.size += size if self.holders[block] == 1 else 0
        while self.size > _MAX_BYTES:
            self._forget(next(iter(self.values)))

    def _forget(self, key: Hashable) -> None:
        _, held = self.values.pop(key)
        for block, size in held.items():
            self.holders[block] -= 1
            if not self.holders[block]:
                del self.holders[block]
                self.size -= size


_entries = _Entries()
_lock: Final = Lock()


def cached(key: Hashable, make: Callable[[], Value]) -> Value:
    """Return the cached value of `key`; on a miss, compute it with `make` and cache it.

    A value larger than a quarter of the bound (`_MAX_BYTES` [bytes]) is not cached. Two threads
    that miss at the same time may both compute the value; the results are equal.
    """
    with _lock:
        entry = _entries.used(key)
    if entry is not None:
        value: Value = entry[0]
        return value
    value = make()
    held = dict(_held_by(value))
    if sum(held.values()) <= _MAX_BYTES // 4:
        with _lock:
            _entries.add(key, value, held)
    return value


def clear_cache() -> None:
    """Forget everything; the next use reads or computes it again."""
    global _entries
    with _lock:
        _entries = _Entries()


def file_key(path: Path, *more: Hashable) -> Hashable:
    """Return a cache key for what is read from a file in its present state.

    A file that is rewritten or damaged gets another key: inode, size [bytes] and time [ns] are in
    it. Raises FileNotFoundError.
    """
    status = path.stat()
    return (str(path), status.st_ino, status.st_size, status.st_mtime_ns, *more)


def _held_by(value: Any) -> Iterator[tuple[int, int]]:
    """Make the arrays of a value read-only, and yield the blocks of memory that they are parts of,
    each with its size [bytes].

    Databases are left alone: their arrays are small, and compiled functions know them as writable.
    """
    if isinstance(value, AeroDatabase):
        return
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
        while isinstance(value.base, np.ndarray):
            value = value.base
        yield id(value), value.nbytes
    elif isinstance(value, Mapping):
        for each in value.values():
            yield from _held_by(each)
    elif isinstance(value, (tuple, list)):
        for each in value:
            yield from _held_by(each)
    elif is_dataclass(value):
        for each in fields(value):
            yield from _held_by(getattr(value, each.name))
