"""Runs disturbed at random moments, then repeated: ``python -m tests.faults.faulting UNDISTURBED
FOLDER SEED TRIALS FAULT...``; what the runs end as is in UNDISTURBED (`make_undisturbed`).

Faults: the disk is full, the disk becomes read-only (as ext4 does after a disk error), the clock is
set back by a day. Each run is a fork of this process. Prints one JSON line per trial, or one line
that says so if a fault cannot be produced on this machine.
"""

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np

from aerodb.errors import StoreError
from aerodb.storage.workspace import Workspace
from tests.faults.killing import (
    HARMLESS,
    STAGES,
    Undisturbed,
    begun,
    cleared,
    forked,
    picture,
    problems,
)
from tests.support.forking import fork_for_flights
from tests.support.set_clock import set_clock

_SIZE = 32_000_000
#: The room that is left on a full disk is somewhere below this.
_ROOM = 60_000
_DAY = 86_400
Do = Callable[[], None]


def _nothing() -> None:
    pass


class Disk:
    """A small file system of its own; `kind` as mount knows it. `usable` where it could be had."""

    def __init__(self, folder: Path, kind: str, generator: np.random.Generator) -> None:
        self.folder, self._kind, self._generator = folder, kind, generator
        self._image = folder.with_suffix(".img")
        folder.mkdir()
        if kind == "ext4":
            self._image.write_bytes(b"")
            os.truncate(self._image, _SIZE)
            subprocess.run(["mkfs.ext4", "-q", self._image], capture_output=True)
        self.usable = self._mount()

    def _mount(self) -> bool:
        options = (
            ["-o", f"size={_SIZE}", "tmpfs"]
            if self._kind == "tmpfs"
            else ["-o", "loop,errors=remount-ro", self._image]
        )
        return (
            subprocess.run(
                ["mount", "-t", self._kind, *options, self.folder], capture_output=True
            ).returncode
            == 0
        )

    def fill(self) -> None:
        state = os.statvfs(self.folder)
        leave = int(self._generator.uniform(0.0, _ROOM))
        with (
            suppress(OSError),
            (self.folder / "filler").open("wb") as file,
        ):  # the run takes some of the room meanwhile
            file.write(bytes(max(state.f_bavail * state.f_frsize - leave, 0)))

    def empty(self) -> None:
        (self.folder / "filler").unlink()

    @property
    def trigger(self) -> Path:
        """Where the system takes orders to break an ext4 file system."""
        number = os.stat(self.folder).st_dev
        device = os.path.realpath(f"/sys/dev/block/{os.major(number)}:{os.minor(number)}")
        return Path("/sys/fs/ext4") / Path(device).name / "trigger_fs_error"

    def break_down(self) -> None:
        """An error of the disk, as its driver reports it: nothing more is written, also to files
        that are open."""
        self.trigger.write_text("an error that a test wants")

    def repair(self) -> None:
        """As after a start of the machine: what was not on the disk is lost, the file system is
        checked, and mounted again."""
        until = time.monotonic() + 300.0
        while subprocess.run(
            ["umount", self.folder], capture_output=True
        ).returncode:  # a process that ends still has files open
            assert time.monotonic() < until, "the disk stays busy"
            time.sleep(0.1)
        subprocess.run(["e2fsck", "-p", self._image], capture_output=True)
        assert self._mount()

    def remove(self) -> None:
        subprocess.run(["umount", "-l", self.folder], check=True, capture_output=True)
        self.folder.rmdir()


@contextmanager
def full(folder: Path, generator: np.random.Generator) -> Iterator[tuple[Path, Do, Do]]:
    """Where to work, what is done in the course of a run, and before the next one."""
    disk = Disk(folder / "full", "tmpfs", generator)
    if not disk.usable:
        raise NotImplementedError("may not mount a file system here")
    try:
        yield disk.folder, disk.fill, disk.empty
    finally:
        disk.remove()


@contextmanager
def read_only(folder: Path, generator: np.random.Generator) -> Iterator[tuple[Path, Do, Do]]:
    disk = Disk(folder / "broken", "ext4", generator)
    if not disk.usable:
        raise NotImplementedError("may not mount an ext4 file system in a file here")
    if not os.access(disk.trigger, os.W_OK):
        disk.remove()
        raise NotImplementedError("may not break a file system here")
    try:
        yield disk.folder, disk.break_down, disk.repair
    finally:
        disk.remove()


@contextmanager
def set_back(folder: Path, generator: np.random.Generator) -> Iterator[tuple[Path, Do, Do]]:
    clock = os.environ.get("AERODB_TEST_CLOCK")
    if clock is None:
        raise NotImplementedError("no C compiler here to make a clock that can be set")
    place, before = folder / "set-back", time.time()
    place.mkdir()
    try:
        yield place, lambda: set_clock(Path(clock), -_DAY), _nothing
        assert time.time() < before, "the clock was meant to stand back"
    finally:
        set_clock(Path(clock), 0)
        cleared(place)


FAULTS: dict[str, Any] = {"full": full, "read_only": read_only, "set_back": set_back}


def trial(
    at: tuple[Path, Do, Do],
    before: Path,
    name: str,
    logs: list[Path],
    moment: float,
    wanted: dict[str, Any],
) -> dict[str, Any]:
    """One disturbed run and the run after it: how each ended, what was wrong after each, and what
    differs at the end."""
    place, disturb, heal = at
    workspace = Workspace.open(Path(shutil.copytree(before, place / "w")))
    (workspace.root / "settings.toml").write_text("[limits]\nreserve = 0\n", encoding="utf-8")
    subprocess.run(["sync", "-f", workspace.root], check=True)  # it has been there for long
    child = begun(STAGES[name], workspace, logs)
    time.sleep(moment)
    if os.waitid(
        os.P_PID, child, os.WEXITED | os.WNOHANG | os.WNOWAIT
    ):  # it was quicker than the undisturbed one: earlier
        os.waitpid(child, 0)
        cleared(workspace.root)
        return trial(at, before, name, logs, 0.7 * moment, wanted)
    disturb()
    code = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    try:
        left = problems(workspace)
    except StoreError as error:
        left = [("not now", "", str(error))]
    heal()
    _, again = forked(STAGES[name], workspace, logs)
    shown, wrong = picture(workspace), problems(workspace)
    differs = [key for key in wanted if shown[key] != wanted[key]]
    bad = [entry for entry in left if entry[0] not in HARMLESS]
    cleared(workspace.root)
    return {
        "stage": name,
        "code": code,
        "bad": bad,
        "again": again,
        "wrong": wrong,
        "differs": differs,
    }


def main() -> None:
    fork_for_flights()
    undisturbed, folder = Undisturbed.read(Path(sys.argv[1])), Path(sys.argv[2])
    generator, trials = np.random.default_rng(int(sys.argv[3])), int(sys.argv[4])
    logs, expected = undisturbed.logs, undisturbed.stages
    for first, fault in enumerate(sys.argv[5:]):
        try:
            with FAULTS[fault](folder, generator) as at:
                for number in range(trials):
                    name = list(STAGES)[
                        (number + 2 * first) % len(STAGES)
                    ]  # two of each give all four
                    before, seconds, wanted = expected[name]
                    told = trial(
                        at, before, name, logs, float(generator.uniform(0.0, 1.0)) * seconds, wanted
                    )
                    print(json.dumps({"fault": fault, **told}), flush=True)
        except NotImplementedError as error:
            print(json.dumps({"fault": fault, "cannot": str(error)}), flush=True)


if __name__ == "__main__":
    main()
