"""What was read or computed stays at hand for a while, by what it is made of: flights,
coefficients, comparisons.

Within a bound of memory, the least recently used go first. Arrays that are kept cannot be written
to.
"""

from collections.abc import Callable, Hashable, Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from threading import Lock
from typing import Any, Final, TypeVar

import numpy as np
from cachetools import LRUCache

Value = TypeVar("Value")

#: Bytes that all kept values may take together: some 30 flights of ten minutes at 50 Hz.
_ROOM: Final = 512 * 2**20
_kept: Final[LRUCache[Hashable, tuple[Any, int]]] = LRUCache(
    _ROOM, getsizeof=lambda entry: entry[1]
)
_lock: Final = Lock()


def kept(key: Hashable, make: Callable[[], Value]) -> Value:
    """The value of `key`, as it was made before or as `make` makes it now; what is larger than a
    quarter of the room is not kept.

    Two threads that ask at once may both make it: they make the same.
    """
    with _lock:
        found = _kept.get(key)
    if found is not None:
        value: Value = found[0]
        return value
    value = make()
    size = _sealed_size(value)
    if size <= _ROOM // 4:
        with _lock:
            _kept[key] = (value, size)
    return value


def of_file(path: Path, *more: Hashable) -> Hashable:
    """A key for what is made of a file as it is now: one that is written anew, or damaged, has
    another."""
    found = path.stat()
    return (str(path), found.st_ino, found.st_size, found.st_mtime_ns, *more)


def _sealed_size(value: Any) -> int:
    """Bytes of the arrays in a value, which can be read only from now on."""
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
        return value.nbytes
    if isinstance(value, Mapping):
        return sum(_sealed_size(each) for each in value.values())
    if isinstance(value, (tuple, list)):
        return sum(_sealed_size(each) for each in value)
    if is_dataclass(value):
        return sum(_sealed_size(getattr(value, field.name)) for field in fields(value))
    return 0
