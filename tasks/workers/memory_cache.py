"""Memory cache of a process: flights, coefficients and comparisons, by the hash of their inputs.

The cache is bounded in bytes and evicts what was used least recently. Cached arrays are read-only.
"""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from threading import Lock
from typing import Any, Final, TypeVar

import numpy as np
from cachetools import LRUCache

from aerodb.tables import AeroDatabase

Value = TypeVar("Value")

#: Bound of the whole cache [bytes]: about 30 flights of ten minutes at 50 Hz.
_MAX_BYTES: Final = 512 * 2**20
_cache: Final[LRUCache[Hashable, tuple[Any, int]]] = LRUCache(
    _MAX_BYTES, getsizeof=lambda entry: entry[1]
)
_lock: Final = Lock()


def cached(key: Hashable, make: Callable[[], Value]) -> Value:
    """Return the cached value of `key`; on a miss, compute it with `make` and cache it.

    A value larger than a quarter of the bound (`_MAX_BYTES` [bytes]) is not cached. Two threads
    that miss at the same time may both compute the value; the results are equal.
    """
    with _lock:
        entry = _cache.get(key)
    if entry is not None:
        value: Value = entry[0]
        return value
    value = make()
    size = _frozen_size(value)
    if size <= _MAX_BYTES // 4:
        with _lock:
            _cache[key] = (value, size)
    return value


def clear_cache() -> None:
    """Forget everything; the next use reads or computes it again."""
    with _lock:
        _cache.clear()


def file_key(path: Path, *more: Hashable) -> Hashable:
    """Return a cache key for what is read from a file in its present state.

    A file that is rewritten or damaged gets another key: inode, size [bytes] and time [ns] are in
    it. Raises FileNotFoundError.
    """
    status = path.stat()
    return (str(path), status.st_ino, status.st_size, status.st_mtime_ns, *more)


def _frozen_size(value: Any) -> int:
    """Make the arrays of a value read-only, and return their size [bytes].

    Databases are left alone: their arrays are small, and compiled functions know them as writable.
    """
    if isinstance(value, AeroDatabase):
        return 0
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
        return value.nbytes
    if isinstance(value, Mapping):
        return sum(_frozen_size(each) for each in value.values())
    if isinstance(value, (tuple, list)):
        return sum(_frozen_size(each) for each in value)
    if is_dataclass(value):
        return sum(_frozen_size(getattr(value, field.name)) for field in fields(value))
    return 0
