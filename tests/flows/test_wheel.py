"""The wheel as users install it: it puts one name on top level and ignores their own `tasks` and
`storage`."""

import os
import re
import shutil
import subprocess
import sys
import urllib.request
import venv
import zipfile
from pathlib import Path

import pytest

from aerodb import Client, evaluate, load_database, open_workspace
from tests.support.console_workspace import TOKEN
from tests.support.paths import ROOT
from tests.support.shared_workspace import SharedWorkspaces
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


@pytest.mark.campaign
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


@pytest.fixture(scope="module")
def program(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The command as pip installs it into an environment of its own; the packages that it needs are
    those of this one."""
    place = tmp_path_factory.mktemp("environment") / "venv"
    venv.create(place, with_pip=False, symlinks=True)
    packages = next(place.glob("lib/python*/site-packages"))
    needs = [path for path in sys.path if path.endswith("site-packages")]
    (packages / "needs.pth").write_text("\n".join(needs) + "\n", encoding="utf-8")
    options = ["--no-deps", "--no-index", "--quiet", "--disable-pip-version-check"]
    python = str(place / "bin" / "python")
    command = [sys.executable, "-m", "pip", "--python", python, "install", *options, str(wheel)]
    subprocess.run(command, check=True, timeout=600)
    return place / "bin" / "aerodb"


@pytest.fixture
def clashing(tmp_path: Path) -> Path:
    """A folder in which every name that the program imports is somebody's own."""
    here = tmp_path / "users own"
    here.mkdir()
    own = "raise SystemExit('the user\\'s own was imported')\n"
    for name in ("flows", "tasks", "storage", "aerodb", "readers", "prefect"):
        (here / name).mkdir()
        (here / name / "__init__.py").write_text(own, encoding="utf-8")
    for name in ("numpy", "scipy", "typer", "json", "units", "catalogue", "errors", "vehicle"):
        (here / f"{name}.py").write_text(own, encoding="utf-8")
    return here


def called(program: Path, here: Path, *words: str) -> str:
    """What the command says in a folder."""
    kept = {n: v for n, v in os.environ.items() if not n.startswith(("AERODB_", "PYTHON"))}
    done = subprocess.run(
        [str(program), *words], cwd=here, env=kept, capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_beside_clashing_names_the_installed_command_exports_and_serves_the_console(
    program: Path, clashing: Path, shared: SharedWorkspaces, tmp_path: Path
) -> None:
    workspace, _ = shared.updated(tmp_path / "w")
    words = ("--workspace", str(workspace.root))
    called(program, clashing, *words, "version", "export", "candidate", "--format", "daveml",
           "--output", "candidate.dml")  # fmt: skip
    exported = load_database(clashing / "candidate.dml")
    version = open_workspace(workspace.root).version("candidate")
    assert evaluate(exported, alpha=0.05)["CZ"] == pytest.approx(version.evaluate(alpha=0.05)["CZ"])
    kept = {n: v for n, v in os.environ.items() if not n.startswith(("AERODB_", "PYTHON"))}
    console = subprocess.Popen(
        [str(program), *words, "web", "--port", "0"],
        cwd=clashing,
        env={**kept, "AERODB_TOKEN": TOKEN, "PYTHONUNBUFFERED": "1"},
        stdout=subprocess.PIPE,
        text=True,
    )
    try:
        assert console.stdout is not None
        address = re.search(r"http://\S+?:\d+", console.stdout.readline())
        assert address
        with Client(address[0], TOKEN) as client:
            assert client.version("candidate")["label"] == "v0002"
        request = urllib.request.Request(f"{address[0]}/")
        request.add_header("Authorization", f"Bearer {TOKEN}")
        with urllib.request.urlopen(request, timeout=300) as answer:
            assert b"<html" in answer.read()
    finally:
        console.kill()
        console.wait(300)


def test_what_the_program_starts_imports_nothing_from_the_present_folder(
    clashing: Path, tmp_path: Path
) -> None:
    """Prefect starts its servers as modules: Python looks for these in the present folder first."""
    code = (
        "import os, subprocess, sys\n"
        "from pathlib import Path\n"
        "from aerodb.flows.processes import environment_of\n"
        "from aerodb.flows.prefect_environment import configure_prefect\n"
        "from aerodb.storage.workspace import Workspace\n"
        "workspace = Workspace.open(Path(sys.argv[1]))\n"
        "module = [sys.executable, '-m', 'json.tool', '--help']\n"
        "os.chdir(sys.argv[2])\n"
        "own = subprocess.run(module, capture_output=True).returncode\n"
        "served = environment_of(workspace, 'http://127.0.0.1:1/api', '')\n"
        "configure_prefect(workspace.root)\n"
        "codes = [subprocess.run(module, env=e, capture_output=True).returncode\n"
        "         for e in (served, None)]\n"
        "print(own, *codes)\n"
    )
    left_out = ("AERODB_", "PREFECT_", "PYTHONSAFEPATH")
    kept = {n: v for n, v in os.environ.items() if not n.startswith(left_out)}
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "w"), str(clashing)],
        cwd=ROOT,
        env=kept,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.stdout.split() == ["1", "0", "0"], done.stderr


@pytest.mark.campaign
def test_beside_clashing_names_the_installed_command_runs_the_demo(
    program: Path, clashing: Path
) -> None:
    said = called(program, clashing, "--workspace", "w", "demo", "--flights", "3")
    assert "ingested 3 logs: stored" in said
    assert {path.name for path in (clashing / "w").iterdir()} >= {"catalogue.sqlite", "reports"}
