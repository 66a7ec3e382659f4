"""Packages are installed by hash, by uv where it is at hand, else by pip."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest

from tests.support.paths import ROOT

SCRIPT = ROOT / "flows" / "deploy" / "install.py"


@pytest.fixture
def wheel(tmp_path: Path) -> Path:
    """A package of one module, in a folder of its own."""
    file = tmp_path / "wheels" / "lonely_wing-1.0-py3-none-any.whl"
    file.parent.mkdir()
    with zipfile.ZipFile(file, "w") as packed:
        packed.writestr("lonely_wing.py", "span = 3.0\n")
        about = "lonely_wing-1.0.dist-info"
        packed.writestr(
            f"{about}/METADATA", "Metadata-Version: 2.1\nName: lonely-wing\nVersion: 1.0\n"
        )
        packed.writestr(
            f"{about}/WHEEL", "Wheel-Version: 1.0\nRoot-Is-Purelib: true\nTag: py3-none-any\n"
        )
        names = [*packed.namelist(), f"{about}/RECORD"]
        packed.writestr(f"{about}/RECORD", "".join(f"{name},,\n" for name in names))
    return file


def pinned(wheel: Path, digest: str = "") -> Path:
    """A file of pins with the wheel's hash, or another one."""
    digest = digest or hashlib.sha256(wheel.read_bytes()).hexdigest()
    file = wheel.parents[1] / "pins.txt"
    file.write_text(f"lonely-wing==1.0 \\\n    --hash=sha256:{digest}\n")
    return file


@pytest.fixture(scope="module")
def environment(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A new environment, with pip alone."""
    home = tmp_path_factory.mktemp("install") / "environment"
    subprocess.run([sys.executable, "-m", "venv", str(home)], check=True)
    return home


def installed(file: Path, wheel: Path, home: Path, uv: Path | None) -> tuple[int, str]:
    """Exit code, and who installed the package in an environment (empty where nobody did)."""
    for old in home.glob("lib/python*/site-packages/lonely_wing*"):
        shutil.rmtree(old) if old.is_dir() else old.unlink()
    shutil.rmtree(home / "uv", ignore_errors=True)
    if uv is not None:
        (home / "uv" / "bin").mkdir(parents=True)
        (home / "uv" / "bin" / "uv").symlink_to(uv)
    own = ("PIP_", "UV_")
    given = {name: value for name, value in os.environ.items() if not name.startswith(own)}
    given |= {
        "PIP_NO_INDEX": "1",
        "PIP_FIND_LINKS": str(wheel.parent),
        "PIP_CONFIG_FILE": os.devnull,
    }
    done = subprocess.run(
        [str(home / "bin" / "python"), str(SCRIPT), str(file)], env=given, capture_output=True
    )
    found = list(home.glob("lib/python*/site-packages/lonely_wing-1.0.dist-info/INSTALLER"))
    return done.returncode, found[0].read_text().strip() if found else ""


def at_hand() -> Path:
    uv = Path(sys.prefix) / "uv" / "bin" / "uv"
    if not uv.exists():
        pytest.skip("uv could not be had when this environment was made")
    return uv


def test_without_uv_pip_installs(wheel: Path, environment: Path) -> None:
    assert installed(pinned(wheel), wheel, environment, None) == (0, "pip")


def test_uv_asks_where_pip_would(wheel: Path, environment: Path) -> None:
    assert installed(pinned(wheel), wheel, environment, at_hand()) == (0, "uv")


def test_a_uv_that_fails_leaves_it_to_pip(wheel: Path, environment: Path) -> None:
    assert installed(pinned(wheel), wheel, environment, Path("/bin/false")) == (0, "pip")


def test_another_hash_is_refused_by_both(wheel: Path, environment: Path) -> None:
    code, by = installed(pinned(wheel, "0" * 64), wheel, environment, at_hand())
    assert code
    assert not by


def test_the_last_of_pips_settings_counts() -> None:
    listed = """:env:.find-links='/a /b'
global.index-url='first'
user.index-url='second'
global.timeout='15'
install.no-compile='true'
"""
    asked = (
        f"import sys, json; sys.path.insert(0, {str(SCRIPT.parent)!r}); import install; "
        f"print(json.dumps(install.settings_for_uv({listed!r}, {{'UV_FIND_LINKS': 'own'}})))"
    )
    told = json.loads(subprocess.check_output([sys.executable, "-c", asked], text=True))
    assert told == {"UV_FIND_LINKS": "own", "UV_DEFAULT_INDEX": "second"}
