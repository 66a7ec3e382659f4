"""The wheel as users install it: it puts one name on top level and ignores their own `tasks` and
`storage`."""

import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.support.paths import ROOT
from tests.support.small_glider import NAME, write_files


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel of this checkout, built without a look at any package index."""
    folder, source = tmp_path_factory.mktemp("wheel"), tmp_path_factory.mktemp("source")
    for part in ("aerodb", "flows", "tasks", "storage"):
        shutil.copytree(ROOT / part, source / part, ignore=shutil.ignore_patterns("__pycache__"))
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source / name)
    options = ["--no-deps", "--no-build-isolation", "--no-index", "--quiet"]
    command = [
        sys.executable,
        "-m",
        "pip",
        "wheel",
        *options,
        "--wheel-dir",
        str(folder),
        str(source),
    ]
    subprocess.run(command, check=True, timeout=600)
    return next(folder.glob("*.whl"))


def test_the_wheel_has_one_package_on_top_level_and_all_its_data(wheel: Path) -> None:
    with zipfile.ZipFile(wheel) as archive:
        names = set(archive.namelist())
    assert {name.split("/")[0] for name in names if ".dist-info/" not in name} == {"aerodb"}
    for part in ("flows", "tasks", "storage"):
        for path in (ROOT / part).rglob("*"):
            if path.is_file() and "__pycache__" not in path.parts:
                assert f"aerodb/{path.relative_to(ROOT).as_posix()}" in names, path
    for path in (ROOT / "aerodb").rglob("*"):
        if path.is_file() and "__pycache__" not in path.parts:
            assert path.relative_to(ROOT).as_posix() in names, path


def test_a_folder_full_of_clashing_names_changes_nothing(wheel: Path, tmp_path: Path) -> None:
    site, here = tmp_path / "site", tmp_path / "users own"
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(site)
    logs = write_files(here / "logs")
    for name in ("flows", "tasks", "readers"):
        (here / name).mkdir()
        (here / name / "__init__.py").write_text(
            "raise SystemExit('the user\\'s own was imported')\n"
        )
    for name in ("storage", "units", "catalogue", "errors", "vehicle"):
        (here / f"{name}.py").write_text("raise SystemExit('the user\\'s own was imported')\n")
    kept = {name: value for name, value in os.environ.items() if not name.startswith("AERODB_")}
    environment = {**kept, "PYTHONPATH": str(site), "PYTHONUTF8": "1"}

    def run(code: str, *arguments: str) -> str:
        command = [sys.executable, "-c", code, *arguments]
        done = subprocess.run(
            command, cwd=here, env=environment, capture_output=True, text=True, timeout=600
        )
        assert done.returncode == 0, done.stderr
        return done.stdout

    where = run("import aerodb.flows.run, aerodb.storage.readers as r; print(r.__file__)")
    assert where.strip().startswith(str(site))
    command = "from aerodb.flows.cli import main; main()"
    workspace = ("--workspace", str(tmp_path / "w"))
    run(command, *workspace, "vehicle", "add", "logs/vehicle.toml")
    run(command, *workspace, "flight", "ingest", str(logs[0]), "--vehicle", NAME, "--direct")
    assert NAME in run(command, *workspace, "flight", "list", "--vehicle", NAME)
