"""The seal of SQLite's file: any bit that flips while nobody writes is found, and no writer, however
it ends, makes a seal that does not fit."""

import lzma
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from pathlib import Path

import pytest

from aerodb.errors import AeroError
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.seal import is_intact, seal, seal_of
from aerodb.storage.upkeep.audit import Audit
from tests.support.paths import ROOT


@pytest.fixture
def path(tmp_path: Path) -> Path:
    then = Path(__file__).parent / "former" / "r0007.sql.xz"  # of a real demonstration
    with closing(sqlite3.connect(tmp_path / "catalogue.sqlite")) as raw:
        raw.executescript(lzma.decompress(then.read_bytes()).decode("utf-8"))
    Catalogue.open(tmp_path / "catalogue.sqlite").close()
    return tmp_path / "catalogue.sqlite"


def _problems(path: Path) -> list[str]:
    try:
        with Catalogue.open(path, create=False) as catalogue:
            return [problem.what for problem in Audit.of(catalogue).problems(lambda *_: None)]
    except AeroError as error:
        return [error.what]


@pytest.mark.heavy
def test_every_flipped_bit_is_found(
    path: Path, tmp_path: Path, trials: Callable[[int, int], int]
) -> None:
    flips = trials(16, 80)
    rng, data = random.Random(7), path.read_bytes()
    other = tmp_path / "other" / path.name
    by_seal_alone = 0
    for _ in range(flips):
        shutil.rmtree(other.parent, ignore_errors=True)
        other.parent.mkdir()
        flipped = bytearray(data)
        flipped[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        other.write_bytes(flipped)
        shutil.copy(seal_of(path), seal_of(other))
        found = _problems(other)
        assert found
        by_seal_alone += found[0].startswith("its bytes changed after aerodb had closed it")
    assert 0 < by_seal_alone < flips
    assert _problems(path) == []


def test_writers_break_the_seal_and_the_last_one_seals(path: Path) -> None:
    assert is_intact(path)
    with Catalogue.open(path) as catalogue, Catalogue.open(path) as other:
        catalogue.vehicles()
        assert is_intact(path), "who reads only leaves the seal"
        catalogue.start_run("flow", how="direct")
        assert is_intact(path) is None
        catalogue.close()
        assert is_intact(path), "though another has it open"
        other.start_run("flow", how="direct")
        assert is_intact(path) is None
    assert is_intact(path)
    assert _problems(path) == []


def test_another_program_that_writes_is_found(path: Path) -> None:
    with closing(sqlite3.connect(path)) as raw:
        raw.execute("PRAGMA user_version = 7")
    assert not is_intact(path)
    (what,) = _problems(path)
    assert "another program wrote to it" in what


_KILLED = """
import os, signal, sys
from pathlib import Path
from aerodb.storage.catalogue.catalogue import Catalogue
catalogue = Catalogue.open(Path(sys.argv[1]))
for _ in range(20):
    catalogue.start_run("flow", how="direct")
if sys.argv[2] == "kill":
    os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.mark.parametrize("end", ["kill", "exit"])
def test_a_process_that_does_not_close_leaves_no_seal_that_is_wrong(path: Path, end: str) -> None:
    command = [sys.executable, "-c", _KILLED, str(path), end]
    code = subprocess.run(command, cwd=ROOT, check=False, timeout=300).returncode
    assert code == (-signal.SIGKILL if end == "kill" else 0)
    assert is_intact(path) is (None if end == "kill" else True)
    assert _problems(path) == []
    assert seal(path)
    assert is_intact(path)


def test_the_seal_of_many_writers_fits(path: Path) -> None:
    def write(_: int) -> None:
        for _ in range(10):
            with Catalogue.open(path) as catalogue:
                catalogue.start_run("flow", how="direct")
                assert is_intact(path) is not False

    with ThreadPoolExecutor(4) as threads:
        list(threads.map(write, range(4)))
    with Catalogue.open(path) as catalogue:
        catalogue.start_run("flow", how="direct")
    assert is_intact(path)
    assert _problems(path) == []


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write everywhere")
def test_a_folder_that_cannot_be_written_has_no_seal(path: Path) -> None:
    seal_of(path).unlink()
    path.parent.chmod(0o500)
    try:
        assert not seal(path)
    finally:
        path.parent.chmod(0o700)
