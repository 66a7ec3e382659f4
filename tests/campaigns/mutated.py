"""Mutated logs, databases and TOML files, by the command line.

``python -m tests.campaigns.mutated --logs 540 --files 363 --seed 7`` mutates files of every format
that is read: bytes flipped, cut, repeated and moved, numbers and words replaced by hostile ones.
Logs are ingested in batches that end with a right one, each other file by the command that reads
it. A case is a fault if the command says that aerodb is at fault, leaves with a code that means so,
takes longer than `LONGEST`, loses the right log of its batch or what was stored, or leaves
something that `verify` finds. Other seeds make other files; ``--keep FOLDER`` keeps those of faults.
"""

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from aerodb.nomenclature import channel
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.upkeep.verification import verify
from aerodb.storage.workspace import Workspace
from tests.campaigns.mutations import Mutated, logs, mutated
from tests.support.end_to_end import environment
from tests.support.forking import run_forked
from tests.support.glider_ulog import ULOG_VEHICLE
from tests.support.paths import ROOT
from tests.support.small_glider import NAME, channels, write_files

#: Seconds that a command may take for one file.
LONGEST = 60.0
#: Words by which a command says that it is at fault itself.
FAULT = ("fault of aerodb", "bug in aerodb", "Traceback (most recent")
#: Exit codes: done, usage, refused, the gate.
CODES = (0, 2, 3, 4)
#: Largest number of mutated logs in a batch.
MOST = 18
_SETTINGS = """\
[serve]
port = 0
[inbox]
settle = "0.2 s"
attempts = 3
[nightly]
cron = "* * * * *"
[loop]
after = 3
run = ["update"]
model = "increments.toml"
[limits]
step = "5 min"
reserve = "1 MB"
[vehicles.small-glider.schedule]
every = "1 h"
[vehicles.small-glider.gate]
identified = 2
"""


@dataclass
class Told:
    """What became of the cases: format and outcome -> how many, the faults, the longest time."""

    cases: Counter[tuple[str, str]] = field(default_factory=Counter)
    faults: list[str] = field(default_factory=list)
    longest: float = 0.0

    def table(self) -> str:
        lines = [f"  {name:12} {what:24} {n:5}" for (name, what), n in sorted(self.cases.items())]
        total = f"{sum(self.cases.values())} cases, {len(self.faults)} faults"
        return "\n".join([*lines, f"{total}, longest command {self.longest:.1f} s", *self.faults])


class Campaign:
    """A folder with a workspace that holds a vehicle, its database and a flight, and copies of it."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder, self.rng, self.told = folder, np.random.default_rng(seed), Told()
        self.files, self.base = folder / "files", folder / "base"
        (folder / "kept").mkdir()
        write_files(self.files, 1)
        (self.files / "settings.toml").write_text(_SETTINGS, encoding="utf-8")
        mapping = ROOT / "storage" / "mappings" / "canonical.toml"
        shutil.copy(mapping, self.files / "mapping.toml")
        (self.files / "ulog.toml").write_text(ULOG_VEHICLE.replace(NAME, _ULOG), encoding="utf-8")
        (self.files / "si.toml").write_text(_si_mapping(), encoding="utf-8")
        for name, file in ((NAME, "vehicle"), (_ULOG, "ulog")):
            self._done(self.base, "vehicle", "add", f"files/{file}.toml")
            self._done(self.base, "database", "import", "files/database.toml", "--vehicle", name)
        self._done(self.base, "flight", "ingest", "files/flight1.csv", *_BESIDE)
        for kind, suffix in EXPORTS.items():
            given = ("--vehicle", NAME, "--output", f"files/{kind}{suffix}", "--format", kind)
            self._done(self.base, "version", "export", "released", *given)

    def logs(self, count: int) -> Told:
        """Mutate logs of all formats, and ingest them in batches of formats that one command takes;
        before that each as it is, so that mutations begin at logs that are read."""
        seeds = logs(self.folder / "logs")
        for names, options in BATCHES:
            for name in names:
                self._done(self._copy(), "flight", "ingest", f"logs/{name}", *options)
        drawn = [BATCHES[int(k)] for k in self.rng.choice(len(BATCHES), count, p=_SHARES)]
        for batch in BATCHES:
            names = self.rng.choice(batch[0], drawn.count(batch))
            made = [(str(name), mutated(seeds[name].read_bytes(), self.rng)) for name in names]
            for start in range(0, len(made), MOST):
                self._ingest(made[start : start + MOST], batch)
        return self.told

    def others(self, count: int) -> Told:
        """Mutate databases and TOML files, and give each to the command that reads it."""
        for number, name in enumerate(self.rng.choice(list(COMMANDS), count)):
            data = mutated((self.files / name).read_bytes(), self.rng)
            place = self.folder / f"mutated-{number}-{name}"
            place.write_bytes(data)
            workspace = self._copy()
            if name == "settings.toml":
                shutil.copy(place, workspace / "settings.toml")
            given = [part.format(file=place) for part in COMMANDS[name]]
            done, seconds = self._timed(workspace, *given)
            (workspace / "settings.toml").unlink(missing_ok=True)
            self.told.cases[name, f"exit code {done.returncode}"] += 1
            found = [*said(done), *self._lost(workspace)]
            found += [f"{seconds:.0f} s"] * (seconds > LONGEST)
            self._fault([place], found)
        return self.told

    def _ingest(self, mutations: list[Mutated], batch: "Batch") -> None:
        names, options = batch
        places = []
        for number, (name, data) in enumerate(mutations):
            places.append(self.folder / f"mutated-{number}-{name}")
            places[-1].write_bytes(data)
        workspace, right = self._copy(), self.folder / "logs" / names[0]
        given = [*map(str, places), str(right), *options]
        done, seconds = self._timed(workspace, "--json", "flight", "ingest", *given)
        found = [*said(done), *self._lost(workspace)]
        found += [f"{seconds:.0f} s"] * (seconds > LONGEST * len(places))
        became = outcomes(done.stdout)
        if became.get(str(right)) != "stored":
            found.append(f"the right log of the batch is {became.get(str(right))}")
        for (name, _), place in zip(mutations, places, strict=True):
            self.told.cases[name, became.get(str(place), "no answer")] += 1
        found += ["no answer"] * any(str(place) not in became for place in places)
        self._fault(places, found)

    def _fault(self, places: list[Path], found: list[str]) -> None:
        for place in places:
            if found:
                shutil.copy(place, self.folder / "kept")
            place.unlink()
        if found:
            self.told.faults.append(f"FAULT {places[0].name}: {'; '.join(found)}")
            print(self.told.faults[-1], flush=True)

    def _copy(self) -> Path:
        shutil.rmtree(self.folder / "w", ignore_errors=True)
        return Path(shutil.copytree(self.base, self.folder / "w"))

    def _lost(self, workspace: Path) -> Iterator[str]:
        """What was stored and is not, and what `verify` finds."""
        before, after = _stored(self.base), _stored(workspace)
        if not before <= after:
            yield f"lost: {sorted(before - after)}"
        opened = Workspace.open(workspace)
        with Catalogue.open(opened.catalogue) as catalogue:
            yield from map(str, verify(opened, catalogue).problems)

    def _timed(
        self, workspace: Path, *given: str
    ) -> tuple[subprocess.CompletedProcess[str], float]:
        begun = time.monotonic()
        done = self._run(workspace, *given)
        seconds = time.monotonic() - begun
        self.told.longest = max(self.told.longest, seconds)
        return done, seconds

    def _run(self, workspace: Path, *given: str) -> subprocess.CompletedProcess[str]:
        return run_forked(["--workspace", str(workspace), *given], environment(), self.folder)

    def _done(self, workspace: Path, *given: str) -> None:
        done = self._run(workspace, *given)
        assert done.returncode == 0, (given, done.stderr)


_ULOG = f"{NAME}-ulog"
_BESIDE = ("--vehicle", NAME, "--direct")
#: Formats that one command takes, the first of which is ingested unmutated with each batch, and the
#: options of the command.
Batch = tuple[tuple[str, ...], tuple[str, ...]]
BATCHES: tuple[Batch, ...] = (
    (("ulog.ulg",), ("--vehicle", _ULOG, "--direct")),
    (("table.csv", "table.parquet", "ros2.mcap", "json.mcap", "protobuf.mcap"), _BESIDE),
    (("v5.mat", "table.h5", "text.txt"), (*_BESIDE, "--mapping", "files/si.toml")),
)
_FORMATS = [len(names) for names, _ in BATCHES]
_SHARES = [formats / sum(_FORMATS) for formats in _FORMATS]
_IMPORT = ("database", "import", "{file}", "--vehicle", NAME)
EXPORTS = {"daveml": ".dml", "jsbsim": ".xml", "csv": ".csv", "mat": ".mat", "netcdf": ".nc"}
#: File -> the command that reads it.
COMMANDS: Mapping[str, tuple[str, ...]] = {
    **{f"{kind}{suffix}": _IMPORT for kind, suffix in EXPORTS.items()},
    "database.toml": _IMPORT,
    "vehicle.toml": ("vehicle", "add", "{file}"),
    "ulog.toml": ("vehicle", "add", "{file}"),
    "settings.toml": ("status",),
    "model.toml": ("update", "--model", "{file}", *_BESIDE),
    "mapping.toml": ("log", "inspect", "files/flight1.csv", "--mapping", "{file}"),
}


def _si_mapping() -> str:
    """A mapping of the glider's table without declared units: SI."""
    listed = "".join(
        f'[[channel]]\nname = "{name}"\n'
        f'sources = [{{ topic = "table", field = "{name}", unit = "{channel(name).unit}" }}]\n'
        for name in channels(0)
        if name != "time"
    )
    return (
        'name = "si"\nformats = ["tabular"]\ndetect = ["table"]\n'
        f'[time]\ntopic = "table"\nfield = "time"\n{listed}'
    )


def _stored(workspace: Path) -> set[str]:
    with Catalogue.open(Workspace.open(workspace).catalogue) as catalogue:
        versions = {row.id for row in catalogue.versions(NAME)}
        return versions | {row.id for row in catalogue.flights(NAME)}


def said(done: subprocess.CompletedProcess[str]) -> list[str]:
    """What a command says that nobody's file should make it say."""
    found = [word for word in FAULT if word in done.stdout + done.stderr]
    if done.returncode not in CODES:
        found.append(f"exit code {done.returncode}")
    place = max(
        0, min([done.stderr.find(word) for word in FAULT if word in done.stderr] or [0]) - 200
    )
    return [*found, done.stderr[place : place + 3000]] if found else []


def outcomes(output: str) -> dict[str, str]:
    """Log -> what became of it, by the JSON document of an ingest."""
    try:
        document = json.loads(output)
    except ValueError:
        return {}
    return {entry["log"]: entry["status"] for entry in document}


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--logs", type=int, default=0, help="how many logs")
    parser.add_argument("--files", type=int, default=0, help="how many databases and TOML files")
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--keep", type=Path, help="where the files of faults are put")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="mutated-") as made:
        campaign = Campaign(Path(made), asked.seed)
        campaign.logs(asked.logs)
        print(campaign.others(asked.files).table())
        if asked.keep and campaign.told.faults:
            shutil.copytree(Path(made) / "kept", asked.keep, dirs_exist_ok=True)
    sys.exit(bool(campaign.told.faults))


if __name__ == "__main__":
    main()
