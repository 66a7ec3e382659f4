"""Tests, and what they share."""

import os

# One thread of BLAS per process, before numpy is loaded: the suite runs a process per core, and the
# matrices are small, so that further threads only wait for one another, which took a quarter of the
# processor time.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
