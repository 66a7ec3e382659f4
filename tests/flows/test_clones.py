"""Two clones agree: the same inputs, settings and steps give the same version id, and the same
values to 1e-9.

Each workspace is filled by a process of its own, with another seed of hashes, time zone, locale,
number of threads, order of logs and folder names.
"""

import json
import os
import shutil
import subprocess
import sys
from typing import Any

import numpy as np
import pytest

from aerodb.storage.catalogue.catalogue import Catalogue
from tests.support.paths import ROOT
from tests.support.small_glider import NAME, write_files

_COMMANDS = """
import sys
from pathlib import Path
from aerodb.flows.cli.main import app
folder, workspace, *logs = sys.argv[1:]
for command in (
    ["vehicle", "add", f"{folder}/vehicle.toml"],
    ["database", "import", f"{folder}/database.toml", "--vehicle", "small-glider"],
    ["flight", "ingest", *logs, "--vehicle", "small-glider", "--direct"],
    ["update", "--vehicle", "small-glider", "--model", f"{folder}/model.toml", "--direct"],
):
    assert not app(["--workspace", workspace, *command], standalone_mode=False)
"""
_PLACES = (
    {"PYTHONHASHSEED": "1", "TZ": "Pacific/Auckland", "LC_ALL": "C", "OPENBLAS_NUM_THREADS": "1"},
    {
        "PYTHONHASHSEED": "2",
        "TZ": "America/St_Johns",
        "LC_ALL": "C.UTF-8",
        "OPENBLAS_NUM_THREADS": "2",
    },
)

pytestmark = pytest.mark.campaign


@pytest.fixture(scope="module")
def clones(tmp_path_factory: pytest.TempPathFactory) -> list[list[Any]]:
    """Of each clone the versions: id, content hash, content and report."""
    made, logs = [], write_files(tmp_path_factory.mktemp("logs"), flights=3)
    root = ROOT
    for number, place in enumerate(_PLACES):
        folder = tmp_path_factory.mktemp(f"clone{number}") / f"files {number}"
        shutil.copytree(logs[0].parent, folder)
        copies = [str(folder / log.name) for log in logs]
        environment = {**os.environ, **place, "PYTHONPATH": str(root), "PYTHONUTF8": "1"}
        workspace = folder.parent / "w"
        command = [
            sys.executable,
            "-c",
            _COMMANDS,
            str(folder),
            str(workspace),
            *(copies if number else reversed(copies)),
        ]
        subprocess.run(command, check=True, capture_output=True, env=environment, timeout=600)
        with Catalogue.open(workspace / "catalogue.sqlite") as catalogue:
            rows = catalogue.versions(NAME)
            made.append(
                [(row.id, row.content_sha256, catalogue.version_documents(row.id)) for row in rows]
            )
    return made


def _numbers(value: Any) -> list[float]:
    """All numbers of a document, in its order."""
    if isinstance(value, dict):
        return [x for key in sorted(value) for x in _numbers(value[key])]
    if isinstance(value, list):
        return [x for entry in value for x in _numbers(entry)]
    return [float(value)] if isinstance(value, (int, float)) else []


def test_the_same_version_id_on_two_clones(clones: list[list[Any]]) -> None:
    one, other = clones
    assert len(one) == 2
    assert [entry[0] for entry in one] == [entry[0] for entry in other]
    assert one[0][1] == other[0][1]


def test_and_the_same_values_to_a_billionth(clones: list[list[Any]]) -> None:
    for one, other in zip(*clones, strict=True):
        contents = [_numbers(json.loads(entry[2].content)) for entry in (one, other)]
        assert len(contents[1]) > 10
        np.testing.assert_allclose(*contents, rtol=1e-9, atol=1e-15)
        cases = [_numbers(entry[2].report["check_cases"]) for entry in (one, other)]
        np.testing.assert_allclose(*cases, rtol=1e-9, atol=1e-12)
