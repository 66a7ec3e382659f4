"""The step of the installation that compiles the kernels."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.support.paths import ROOT


@pytest.mark.campaign
def test_the_kernels_of_an_ingest_are_compiled_once(tmp_path: Path) -> None:
    """Into an empty cache: the long compilations are there afterwards."""
    subprocess.run(
        [sys.executable, "-m", "aerodb.flows.compile_kernels"],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)},
        cwd=ROOT,
        check=True,
        timeout=600,
    )
    found = {file.name.partition("-")[0] for file in tmp_path.rglob("*.nbc")}
    wanted = {"motion.march", "kinematics._march", "kalman._forward", "kalman._backward"}
    assert wanted <= found
