"""One kill: a command begins on a copy of its workspace, is killed, and is repeated."""

import os
import shutil
import signal
import time
from collections import Counter
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from tests.campaigns.kills import checks
from tests.campaigns.kills.checks import Undisturbed
from tests.campaigns.kills.commands import BASES, COMMANDS, Command
from tests.campaigns.kills.places import Place, cleared, copied, ended, snapshot, until
from tests.campaigns.kills.services import Load
from tests.campaigns.kills.writes import processes_in, strike
from tests.support import consistent_flights
from tests.support.forking import Forked
from tests.support.small_glider import write_files

#: How a run's process in `aerodb serve` is known by its arguments.
_RUN: Final = "prefect.engine"


@dataclass(frozen=True)
class Moment:
    """When a command is killed, and what of it.

    write : ``LABEL#K``, the K-th write of a label in one process; empty: `delay` [s] after the
    command was at work. reach : ``process``, ``group``, ``all``, ``run`` (`writes.strike`).
    """

    reach: str
    write: str = ""
    delay: float = 0.0


def drawn(
    command: Command, expected: Undisturbed, share: float, rng: np.random.Generator
) -> Moment:
    """A moment: at a write (of a label drawn first, so that rare ones are as likely) or a time."""
    is_service = command.done is not None
    reach = str(rng.choice(["process", "all", "run"] if is_service else ["process", "group"]))
    if command.load is COMMANDS["web"].load:
        reach = str(rng.choice(["process", "group"]))
    if expected.writes and rng.integers(2):
        label = str(rng.choice(sorted(expected.writes)))
        most = max(1, round(share * expected.writes[label]))
        return Moment(reach, f"{label}#{1 + int(rng.integers(most))}")
    longest = share * (expected.ends - expected.begins)
    return Moment(reach, delay=round(float(rng.uniform()) * longest, 4))


class Trial:
    """A command in its place, with what is asked of it meanwhile."""

    def __init__(self, command: Command, place: Place) -> None:
        self.command, self.place = command, place
        self._record, self._struck = (
            place.here.parent / name for name in ("writes.txt", "struck.txt")
        )
        self.console: list[str] = []

    def undisturbed(self, record: bool = False) -> tuple[float, float, dict[str, int]]:
        """Run to the end (a service: until it has done its work): seconds until it was at work and
        until the end, and its writes. AssertionError if it fails."""
        self._record.unlink(missing_ok=True)
        watched = {"KILLS_RECORD": str(self._record)} if record else {}
        self.command.ready(self.place)
        seen, start = snapshot(self.place), time.monotonic()
        with (
            self.command.load(self.place) as load,
            self.place.begun(self.command.arguments, **watched) as process,
        ):
            until(lambda: ended(process) or self._at_work(load, seen))
            begins = time.monotonic() - start
            self._finish(process, load)
            ends = time.monotonic() - start
            self._stop(process, load)
        return begins, ends, self._writes()

    def killed(self, moment: Moment) -> bool:
        """Kill it at a moment; false if it ended before."""
        self._struck.unlink(missing_ok=True)
        watched = {
            "KILLS_AT": moment.write,
            "KILLS_REACH": moment.reach,
            "KILLS_STRUCK": str(self._struck),
        }
        self.command.ready(self.place)
        seen = snapshot(self.place)
        with (
            self.command.load(self.place) as load,
            self.place.begun(self.command.arguments, **watched) as process,
        ):
            if not moment.write:
                self._strike_later(process, load, seen, moment)
            if moment.reach == "run" or moment.write:
                self._finish(process, load)
            code = self._stop(process, load, killed=True)
        hit = code == -signal.SIGKILL or self._struck.exists()
        assert code in (-signal.SIGKILL, self.command.code), (code, self.place.said())
        return hit

    def _at_work(self, load: Load | None, seen: Mapping[str, Any]) -> bool:
        if self.command.at_work is not None:
            return self.command.at_work(self.place, load)
        return snapshot(self.place) != seen

    def _strike_later(
        self, process: Forked, load: Load | None, seen: Mapping[str, Any], moment: Moment
    ) -> None:
        """Kill it after a delay, a service when it is at work then."""
        assert until(lambda: ended(process) or self._at_work(load, seen)), self.place.said()
        due = time.monotonic() + moment.delay
        while time.monotonic() < due and not ended(process):
            time.sleep(0.002)
        done = self.command.done
        while done is not None and not ended(process) and not done(self.place, load):
            if self._at_work(load, seen) and (moment.reach != "run" or self._runs()):
                break
            time.sleep(0.01)
        else:
            if done is not None:
                return
        if ended(process):
            return
        if moment.reach == "run":
            for run in self._runs():
                with suppress(ProcessLookupError):
                    os.kill(run, signal.SIGKILL)
            self._struck.touch()
        else:
            strike(process.pid, moment.reach, str(self.place.here))

    def _runs(self) -> list[int]:
        return [p for p, said in processes_in(str(self.place.here)).items() if _RUN in said]

    def _finish(self, process: Forked, load: Load | None) -> None:
        """Wait for its end, or until a service has done its work."""
        done = self.command.done
        if not until(lambda: ended(process) or (done is not None and done(self.place, load))):
            raise TimeoutError(f"not done: {self.place.said()}")

    def _stop(self, process: Forked, load: Load | None, killed: bool = False) -> int:
        """Its exit code; a service that still runs is asked to end."""
        if self.command.done is not None and not ended(process):
            with suppress(ProcessLookupError):
                process.send_signal(signal.SIGTERM)
        code = process.wait(300)
        if load is not None:
            load.stop()
            self.console += load.faults
        assert killed or code == self.command.code, (code, self.place.said())
        return code

    def _writes(self) -> dict[str, int]:
        """Label -> how often, in the process that did it most often."""
        if not self._record.exists():
            return {}
        most: dict[str, int] = {}
        lines = self._record.read_text(encoding="utf-8").splitlines()
        for line, number in Counter(lines).items():
            label = line.partition("\t")[2]
            most[label] = max(most.get(label, 0), number)
        return most


class Campaign:
    """Workspaces to start from and undisturbed runs, each made when it is first needed."""

    def __init__(self, folder: Path, seed: int) -> None:
        self._folder, self._files = folder, folder / "files"
        self._rng = np.random.default_rng(seed)
        self._expected: dict[str, Undisturbed] = {}
        write_files(self._files, 3)
        sensors = self._files / "sensors"
        sensors.mkdir()
        (sensors / "vehicle.toml").write_text(consistent_flights.VEHICLE, encoding="utf-8")
        for number in range(2):
            table = consistent_flights.table(
                number, consistent_flights.PLANTED, seconds=30.0, start=40.0 * number
            )
            consistent_flights.log(sensors, f"flight{number}", table)

    def kill(
        self, name: str, moment: Moment | None = None, in_a_row: int = 1
    ) -> list[dict[str, Any]]:
        """Kill a command at a drawn moment (or at `moment`), `in_a_row` times each where the last
        kill left it, then let it end; returns what was found per kill."""
        command, expected, share = COMMANDS[name], self._undisturbed(name), 1.0
        if command.done is not None or command.base == "inbox":
            in_a_row = 1  # a log that is tried in vain too often is laid aside
        told: list[dict[str, Any]] = []
        failed = ""
        began = time.monotonic()
        while not told:
            place = self.place(command.base)
            command.prepare(place)
            trial = Trial(command, place)
            while len(told) < in_a_row:
                at = moment or drawn(command, expected, share, self._rng)
                try:
                    hit = trial.killed(at)
                except (AssertionError, TimeoutError) as error:  # after a kill it did not work
                    if not told:
                        raise
                    failed, hit = str(error), False
                if not hit:
                    break
                told.append({"command": name, **asdict(at), **self._left_by(trial, at, expected)})
                if command.once and not checks.differences(expected, place):
                    break
            # It ended before: the machine was slower when it was measured.
            assert told or (moment is None and share > 1e-9), f"{name} ends before {moment}"
            share *= 0.7
        last = self._last(trial, expected)
        last["again"] = failed or last["again"]
        for said in told:
            said |= last
            said["lost"] = [
                one
                for kind in ("flights", "versions")
                for one in said["lost"][kind]
                if one not in last["lost"][kind]
            ]
        told[-1]["seconds"] = round(time.monotonic() - began, 1)
        if any(map(checks.wrong, told)):
            kept = self._folder / f"wrong-{time.time_ns()}"
            shutil.copytree(place.here, kept)
            told[-1] |= {"kept": str(kept), "said": place.said()}
        cleared(place.here)
        return told

    def _left_by(self, trial: Trial, at: Moment, expected: Undisturbed) -> dict[str, Any]:
        """What is there after a kill."""
        place = trial.place
        held = list((place.here / "w" / "locks").glob("run-*"))
        said: dict[str, Any] = {
            "of": round(expected.ends - expected.begins, 3),
            "under_way": at.reach == "run" or bool(held and checks.running(place)),
            "integrity": [row[0] for row in checks.asked_sqlite(place, "PRAGMA integrity_check")],
        }
        answered = checks.answers(place)
        found = checks.further_problems(place, expected)
        return said | {
            "wrong_answers": checks.wrong_answers(answered, expected, place),
            "remains": sorted({kind for kind, _ in found if kind in checks.HARMLESS}),
            "bad": [problem for problem in found if problem[0] not in checks.HARMLESS],
            "lost": answered,
        }

    def _last(self, trial: Trial, expected: Undisturbed) -> dict[str, Any]:
        """What is there after the command was repeated, to its end."""
        command, place, again = trial.command, trial.place, ""
        if not (command.once and not checks.differences(expected, place)):
            try:
                trial.undisturbed()
            except (AssertionError, TimeoutError) as error:
                again = str(error)
        last = checks.answers(place)
        return {
            "again": again,
            "differs": checks.differences(expected, place),
            "lost": last,
            "still_running": last["status"].get("running", []),
            "left": place.left(),
            "console": trial.console,
        }

    def place(self, name: str) -> Place:
        """A copy of a workspace to start from."""
        return copied(self._base(name), self._files, self._folder)

    def _base(self, name: str) -> Path:
        base = self._folder / f"base-{name}"
        if not base.exists():
            parent, steps = BASES[name]
            if parent:
                shutil.copytree(self._base(parent), base)
            else:
                base.mkdir()
            place = Place(base, self._files)
            for step in steps:
                if callable(step):
                    step(place)
                    continue
                code, _, errors = place.run(*step)
                assert code == 0, (name, step, errors)
        return base

    def _undisturbed(self, name: str) -> Undisturbed:
        if name not in self._expected:
            command = COMMANDS[name]
            place = self.place(command.base)
            command.prepare(place)
            former = command.base == "former"  # asking would migrate it
            before = None if former else checks.answers(place)
            trial = Trial(command, place)
            begins, ends, writes = trial.undisturbed(record=True)
            after = checks.answers(place)
            self._expected[name] = Undisturbed(
                begins,
                ends,
                writes,
                after if before is None else before,
                after,
                checks.picture(place),
            )
            assert place.left() == [], name
            assert trial.console == [], (name, trial.console)
        return self._expected[name]


def report(lines: Iterable[Mapping[str, Any]]) -> str:
    """The table of kills: per command, and in all."""
    told: dict[str, list[Mapping[str, Any]]] = {}
    for line in lines:
        told.setdefault(line["command"], []).append(line)
    columns: dict[str, Any] = {
        "kills": lambda e: True,
        "at a write": lambda e: e["write"],
        "more than its process": lambda e: e["reach"] not in ("process", "run"),
        "only a run of it": lambda e: e["reach"] == "run",
        "run under way": lambda e: e["under_way"],
        "remains until the next": lambda e: e["remains"],
        "lost": lambda e: e["lost"],
        "damaged": lambda e: set(checks.wrong(e)) & {"bad", "integrity", "again"},
        "differing": lambda e: e["differs"],
        "wrong answers": lambda e: e["wrong_answers"] or e["still_running"] or e["console"],
        "processes left": lambda e: e["left"],
    }
    table = ["| command | " + " | ".join(columns) + " |", "|---" * (len(columns) + 1) + "|"]
    everything = [e for entries in told.values() for e in entries]
    for name, entries in [*sorted(told.items()), ("all", everything)]:
        counts = [str(sum(bool(is_so(e)) for e in entries)) for is_so in columns.values()]
        table.append("| " + " | ".join([name, *counts]) + " |")
    return "\n".join(table)
