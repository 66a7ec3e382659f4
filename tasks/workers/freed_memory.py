"""Memory that Python has freed and the C library keeps: back to the system."""

import ctypes
import sys
from collections.abc import Callable
from functools import cache


def return_freed_memory() -> None:
    """Return freed memory to the system, where the C library can (glibc).

    Arrays of a few megabytes leave holes between those that stay; of an hour's flight they add up
    to its own size at each step. It takes milliseconds.
    """
    _trim()(0)


@cache
def _trim() -> Callable[[int], object]:
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None) if sys.platform == "linux" else None
    return trim if trim is not None else lambda _: None
