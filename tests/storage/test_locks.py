"""Locks: the holder is known, and a process that has ended holds none."""

import subprocess
import sys
import threading
from pathlib import Path

import pytest

from aerodb.storage.locks import holding, is_held, note_of, take
from tests.support.paths import ROOT

fcntl = pytest.importorskip("fcntl", reason="locks of POSIX")


def test_a_lock_ends_with_its_holder(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    assert not is_held(path)
    with holding(path):
        assert is_held(path)
        assert take(path) is None
    assert not is_held(path)
    code = (
        "import sys, time; from pathlib import Path; from aerodb.storage.locks import take;"
        " take(Path(sys.argv[1]));"
    )
    command = [sys.executable, "-c", code + "print(1, flush=True); time.sleep(600)", str(path)]
    holder = subprocess.Popen(command, stdout=subprocess.PIPE, cwd=ROOT)
    assert holder.stdout is not None
    holder.stdout.readline()
    assert is_held(path)
    holder.kill()
    holder.wait()
    holder.stdout.close()
    assert not is_held(path)


def test_a_note_is_read_while_its_lock_is_held(tmp_path: Path) -> None:
    with holding(tmp_path / "lock") as lock:
        lock.note({"pid": 12345, "url": "a long address that is replaced by a shorter one"})
        lock.note({"pid": 1})
        assert note_of(tmp_path / "lock") == {"pid": 1}
    assert note_of(tmp_path / "lock") == {}
    assert note_of(tmp_path / "absent") == {}


def test_who_only_looks_keeps_nobody_from_taking_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A look that lasts a moment (that of `is_held` is such a one) is waited for; who holds it is
    not."""
    path = tmp_path / "lock"
    path.touch()
    monkeypatch.setattr(
        "aerodb.storage.locks._PROBE_SECONDS", 300.0
    )  # on a busy machine, the timer below may come late
    with path.open("rb") as looking:
        fcntl.flock(looking, fcntl.LOCK_SH)
        over = threading.Timer(0.3, fcntl.flock, (looking, fcntl.LOCK_UN))
        over.start()
        lock = take(path)
        over.join()
    assert lock is not None
    lock.release()
