"""The environment of a process for what must not harm this one; it imports nothing, so that such a
process can start first of all."""

import os
from typing import Final

#: Environment variables passed on; a confined process does not get any others.
_PASSED: Final = (
    "PATH",
    "HOME",
    "LANG",
    "LC_ALL",
    "TMPDIR",
    "TZ",
    "LD_LIBRARY_PATH",
    "LD_PRELOAD",
    "SYSTEMROOT",
    "PYTHONPATH",
)
#: Beginnings of those that choose how numbers are computed (which processor's kernels, for one):
#: with others, results would differ in their last digits from those of this process.
_NUMERICAL: Final = ("OPENBLAS_", "MKL_", "BLIS_", "OMP_", "NUMBA_", "NPY_")


def confined_environment() -> dict[str, str]:
    """Return the environment of a confined process: no tokens or passwords, the same numerical
    kernels, one BLAS thread."""
    own = {"OPENBLAS_NUM_THREADS": "1", "PYTHONUTF8": "1"}
    passed = {
        name: value
        for name, value in os.environ.items()
        if name in _PASSED or name.startswith(_NUMERICAL)
    }
    return passed | own
