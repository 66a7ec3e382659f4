"""The notebooks run from their first cell to their last, and say what they promise."""

import json
import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.support.paths import ROOT

FOLDER = ROOT / "docs" / "notebooks"
NAMES = ("px4-glider", "twin-otter", "sealed-envelope")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where all notebooks run: two of them share their flights."""
    return tmp_path_factory.mktemp("notebooks")


def run(name: str, folder: Path, **variables: str) -> str:
    """What a notebook prints and shows."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "MPLBACKEND": "Agg", **variables}
    environment |= {"AERODB_NOTEBOOK_FLIGHTS": "2", "IPYTHONDIR": str(folder / "ipython")}
    done = subprocess.run(
        [sys.executable, "-m", "tests.support.run_notebook", str(FOLDER / f"{name}.ipynb")],
        cwd=folder,
        env=environment,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    return done.stdout


def test_there_are_three_and_their_outputs_are_not_stored() -> None:
    assert {path.stem for path in FOLDER.glob("*.ipynb")} == set(NAMES)
    for name in NAMES:
        cells = json.loads((FOLDER / f"{name}.ipynb").read_text(encoding="utf-8"))["cells"]
        assert not [cell for cell in cells if cell.get("outputs") or cell.get("execution_count")]


@pytest.mark.campaign
def test_a_glider_of_px4_becomes_residuals(folder: Path) -> None:
    shown = run("px4-glider", folder)
    for part in ("log phoenix", "q[0]", "reconstruction of", "sensor error", "rms residual"):
        assert part in shown


@pytest.mark.campaign
def test_the_sealed_envelope_holds_what_was_found(folder: Path) -> None:
    shown = run("sealed-envelope", folder)
    told = [line for line in shown.splitlines() if line.startswith("CZ_alpha = ")]
    assert told
    assert told[0].endswith((": named", ": in_set"))


def test_the_twin_otter_differs_from_its_database(
    folder: Path, measured: Callable[[str], Path]
) -> None:
    data = measured("twin_otter/totter_demo_data.mat").parents[1]
    shown = run("twin-otter", folder, AERODB_TEST_DATA=str(data))
    assert "Cn_beta" in shown
    assert "[[regression]]" in shown


def test_without_the_records_the_notebook_says_where_to_get_them(folder: Path) -> None:
    shown = run("twin-otter", folder, AERODB_TEST_DATA=str(folder / "nothing"))
    assert "needs the records, which are not here" in shown
