"""One run of a campaign, wholly by commands: vehicle, database, logs, closed loop."""

import shutil
import time
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from typer.testing import CliRunner

from aerodb.flows.cli.main import app
from aerodb.tables.database import AeroDatabase
from aerodb.tasks.workspace_access import access_workspace
from tests.campaigns.fleet import Airframe, vehicle_text
from tests.campaigns.instruments import CELLS, Cell, biases_of, noise_of, shown
from tests.campaigns.pilot import CONTROL_STEP, SECONDS, flown
from tests.support.command import asked, document
from tests.support.jsbsim_campaign import MARGIN, SETTLING
from tests.support.jsbsim_flights import aircraft_file
from tests.support.small_glider import write_csv

SENSED = ("p", "q", "phi", "theta")
CLAIMS = ("confirmed", "suspected", "alias_group", "ambiguous_sensor")


@dataclass(frozen=True)
class Prepared:
    """A workspace with the vehicle and its ingested flights.

    flights : id -> number of the flight. verdicts : id -> of the consistency check. cpu : s per
    flight that was ingested.
    """

    folder: Path
    flights: Mapping[str, int]
    verdicts: Mapping[str, str]
    cpu: float

    @property
    def workspace(self) -> Path:
        return self.folder / "workspace"


def channels_of(
    craft: Airframe, number: int, cell: Cell, cache: Path, sensed: Mapping[str, Any] | None = None
) -> dict[str, np.ndarray]:
    """A flight without noise, from the folder `cache` where it was flown before."""
    if sensed is not None:
        return flown(craft, number, step=cell.step, air=cell.air, sensed=sensed)
    place = cache / f"{craft.vehicle}{craft.shape}-{cell.air}-{cell.step:g}-{number}.npz"
    if not place.exists():
        cache.mkdir(parents=True, exist_ok=True)
        made = flown(craft, number, step=cell.step, air=cell.air)
        np.savez(place, **made)
    return dict(np.load(place))


def prepared(
    craft: Airframe, name: str, numbers: Sequence[int], seed: int, folder: Path, cache: Path,
    more: str = "", seen: Callable[[dict[str, np.ndarray]], dict[str, np.ndarray]] = lambda log: log,
) -> Prepared:  # fmt: skip
    """The workspace of a cell with these flights, new in `folder`.

    more : appended to the vehicle file. seen : log -> log, what else is wrong in it.
    """
    cell, workspace = CELLS[name], folder / "workspace"
    folder.mkdir(parents=True)
    (folder / "vehicle.toml").write_text(vehicle_text(craft) + cell.more + more)
    asked(workspace, "vehicle", "add", str(folder / "vehicle.toml"))
    _import(craft, folder, workspace, aircraft_file(craft.name), craft.bindings)
    key = [seed, zlib.crc32(craft.name.encode()), zlib.crc32(name.encode())]
    biases = biases_of(cell, np.random.default_rng(key))
    # `seen` has drawn the zeros that `more` states.
    biases = {name: value for name, value in biases.items() if f"[sensors.{name}]" not in more}
    files = []
    for number in numbers:
        rng = np.random.default_rng([*key, number])
        if cell.fed:
            ahead = round(SETTLING / CONTROL_STEP)
            n = ahead + round((SECONDS + MARGIN) / CONTROL_STEP)
            whole = noise_of(cell, SENSED, n, rng)
            channels = channels_of(craft, number, cell, cache, whole)
            rest = tuple(set(channels) - set(SENSED))
            noise = noise_of(cell, rest, len(channels["V"]), rng)
            noise |= {channel: values[ahead:] for channel, values in whole.items()}
        else:
            channels = channels_of(craft, number, cell, cache)
            noise = noise_of(cell, tuple(channels), len(channels["V"]), rng)
        log = seen(shown(channels, noise, biases, cell))
        t = cell.step * np.arange(len(log["V"]))
        files.append(write_csv(folder / f"{craft.vehicle}-{number}.csv", {"time": t, **log}))
    start = time.process_time()
    answers = asked(
        workspace, "flight", "ingest", *map(str, files), "--vehicle", craft.vehicle, "--direct"
    )
    flights = {answer["flight"]: number for answer, number in zip(answers, numbers, strict=True)}
    verdicts = {answer["flight"]: answer["consistency"]["verdict"] for answer in answers}
    cpu = (time.process_time() - start) / max(len(numbers), 1)
    return Prepared(folder, flights, verdicts, cpu)


def _import(
    craft: Airframe, folder: Path, workspace: Path, xml: bytes, bindings: Mapping[str, str]
) -> str:
    place = folder / f"database-{zlib.crc32(xml):08x}.xml"
    place.write_bytes(xml)
    words = [word for name, text in bindings.items() for word in ("--bind", f"{name}={text}")]
    command = ("database", "import", str(place), "--vehicle", craft.vehicle, *words)
    return str(asked(workspace, *command)["version"])


@dataclass(frozen=True)
class Loop:
    """What `close-loop` answered: its document, or why it refused; CPU s; the candidate version's
    database, None where nothing was added."""

    folder: Path
    found: dict[str, Any] | None
    refused: str
    cpu: float
    candidate: AeroDatabase | None = None


def looped(
    craft: Airframe, ready: Prepared, n: int, folder: Path,
    xml: bytes | None = None, bindings: Mapping[str, str] | None = None,
) -> Loop:  # fmt: skip
    """The loop of the first n flights of a prepared workspace, in a copy of it in `folder`.

    A copy, because a workspace remembers which hypotheses its flights were asked for before. xml :
    of a database to trace against instead of the aircraft's own.
    """
    workspace = folder / "workspace"
    folder.mkdir(parents=True)
    shutil.copytree(ready.workspace, workspace)
    words = [w for flight in list(ready.flights)[:n] for w in ("--flights", flight)]
    if xml is not None:
        version = _import(craft, folder, workspace, xml, bindings or {})
        words += ["--baseline", version]
    start = time.process_time()
    command = ["close-loop", "--vehicle", craft.vehicle, "--direct", *words]
    result = CliRunner().invoke(app, ["--workspace", str(workspace), "--json", *command])
    cpu = time.process_time() - start
    if result.exit_code:
        return Loop(folder, None, (result.stderr or repr(result.exception))[:600], cpu)
    (folder / "document.json").write_text(result.stdout)
    found = document(result.stdout)
    version = found["candidate"]
    candidate = access_workspace(str(workspace)).database(version) if version else None
    return Loop(folder, found, "", cpu, candidate)


@dataclass(frozen=True)
class Judged:
    """Claims of a run in which nothing was missing, by class; each as hypothesis and p."""

    confirmed: tuple[str, ...]
    aerodynamic: tuple[str, ...]
    unnamed: tuple[str, ...]
    sensor: tuple[str, ...]


def judged(found: Mapping[str, Any], cell: Cell, true: frozenset[str] = frozenset()) -> Judged:
    """The wrong claims. true : hypotheses that are right to claim."""
    classes: dict[str, list[str]] = {name: [] for name in Judged.__dataclass_fields__}
    for finding in found["findings"]:
        verdict, hypothesis = finding["verdict"], finding["hypothesis"]
        members = set(finding.get("explanation_set", ()))
        if hypothesis in true or true & members:
            continue
        if verdict == "ambiguous_sensor" and cell.wrong() & {m.split("@")[0] for m in members}:
            continue
        p = finding.get("p_adjusted")
        text = f"{hypothesis} {verdict}" + (f" p={p:.1e}" if p is not None else "")
        if verdict == "unnamed":
            classes["unnamed"].append(f"{text} {'+'.join(finding.get('variables', ()))}")
        elif "@all" in hypothesis:
            if finding["effect"] not in cell.wrong():
                classes["sensor"].append(text)
        elif verdict in CLAIMS:
            value, (low, high) = finding["value"], finding["ci95"]
            text += f" {value:.3g} [{low:.3g}, {high:.3g}]"
            classes["aerodynamic"].append(text)
            if verdict == "confirmed":
                classes["confirmed"].append(text)
    return Judged(**{name: tuple(listed) for name, listed in classes.items()})


def record(judgement: Judged) -> dict[str, list[str]]:
    """Its JSON."""
    return {name: list(listed) for name, listed in asdict(judgement).items()}
