"""Freed memory goes back to the system."""

import platform
from pathlib import Path

import numpy as np
import pytest

from aerodb.tasks.workers import return_freed_memory


def _resident() -> float:
    """Memory that this process has, MB."""
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    return next(float(line.split()[1]) for line in lines if line.startswith("VmRSS")) / 1024


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="only glibc keeps what was freed")
def test_holes_between_arrays_that_stay_are_returned() -> None:
    arrays = [np.ones(8000) for _ in range(2000)]  # 64 kB each, from the heap
    kept = arrays[::40]
    del arrays
    before = _resident()
    return_freed_memory()
    assert before - _resident() > 60.0
    assert sum(float(each.sum()) for each in kept) == 50 * 8000.0
