"""Small campaigns, all by the functions or commands that ship, whose outcomes show what a
threshold decides.

An outcome maps a name to a word (a decision) or to a number (a reported value). Cases are prepared
once, with the thresholds as they are, and kept in a folder.
"""

import pickle
import shutil
import tempfile
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from typer.testing import CliRunner

from aerodb.conditioning import fingerprint, flag_unusable, shared_samples
from aerodb.consistency import make_consistent
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.flows.cli.main import app
from aerodb.suspicions import examine
from tests.campaigns.corrupted import fleet, lacking, measured, noticed, noticed_beside, simulated
from tests.campaigns.corruptions import BELIEVABLE, FILES, FLIGHTS, Pair
from tests.campaigns.fleet import airframe
from tests.campaigns.planted import PLANTED, measured_text
from tests.campaigns.runs import Prepared, looped, prepared

Outcome = dict[str, str | float]
#: Flights that corruptions are applied to: short ones of different aircraft and instruments.
SHORT = ("taxi-0", "fAttasAilRud1", "totter_9752ed20", "hfb320_1_10", "t38-0", "a4-0")
#: Aircraft of JSBSim among the right flights.
SIMULATED = ("A4", "T38")
#: How many of them each kind of corruption is applied to.
EACH = 1
#: Samples from which a flight is only conditioned, as it is.
LONGEST = 2500
#: Records whose path is reconstructed.
RECONSTRUCTED = ("fAttasAil1", "totter_f1", "totter_9752ed20", "totter_demo", "hfb320_1_10")
#: Aircraft, cell of instruments and what is planted of each loop; with nothing planted, if empty.
LOOPS = (
    ("F80C", "declared", "Cm_alpha 20 %"),
    ("MD11", "declared", "gear drag"),
)
#: Flights of a loop.
FLIGHTS_OF_LOOP = 6
#: Random seed of everything drawn here.
SEED = 1


@dataclass(frozen=True)
class Case:
    """A run whose outcome is looked at: its part (`ingest`, `beside`, `conditioning`,
    `consistency`, `loop`), its name, and what makes the outcome."""

    part: str
    name: str
    outcome: Callable[[], Outcome]


def prepare(folder: Path, records: Path | None) -> None:
    """Make what the cases need, in `folder`; records : folder of the measured flights."""
    folder.mkdir(parents=True, exist_ok=True)
    pairs = [*simulated(flights=1)]
    pairs += [*measured(records)] if records is not None else []
    pairs += [*fleet(folder / "flights", 1, SIMULATED)]
    _keep(folder / "pairs.pkl", pairs)
    short = [pair for pair in pairs if any(name in pair.name for name in SHORT)]
    made, silent = [], []
    with np.errstate(all="ignore"):
        for number, (kind, corrupt) in enumerate({**FLIGHTS, **FILES, **BELIEVABLE}.items()):
            applied = 0
            for k in range(len(short)):
                pair = short[(number + k) % len(short)]
                wrong = corrupt(pair) if applied < EACH else None
                if wrong is not None:
                    applied += 1
                    made.append(replace(wrong, name=f"{kind}: {pair.name}"))
        silent = [pair for pair in made if not noticed(pair)]
    _keep(folder / "corrupted.pkl", made)
    _keep(folder / "silent.pkl", silent)
    _keep(folder / "lacking.pkl", [*lacking([p for p in pairs if p.name == "t38-0"])])
    for aircraft, cell in dict.fromkeys(loop[:2] for loop in LOOPS):
        place = folder / f"{aircraft}-{cell}"
        shutil.rmtree(place, ignore_errors=True)
        craft = airframe(aircraft)
        numbers = [(SEED * 5 + k) % 16 for k in range(FLIGHTS_OF_LOOP)]
        ready = prepared(
            craft, cell, numbers, SEED, place, folder / "flights", measured_text(craft)
        )
        (ready.workspace / "settings.toml").write_text(
            '[work]\nconfined = false\nengine = "threads"\n', encoding="utf-8"
        )
        _keep(folder / f"{aircraft}-{cell}.pkl", ready)


def _keep(path: Path, content: object) -> None:
    path.write_bytes(pickle.dumps(content))


def _kept(path: Path) -> Any:
    return pickle.loads(path.read_bytes())


def cases(folder: Path, parts: Sequence[str]) -> Iterator[Case]:
    """The cases of some parts, from what `prepare` made in `folder`."""
    pairs = _kept(folder / "pairs.pkl")
    right = [pair for pair in pairs if len(pair.flight.time) < LONGEST]
    if "ingest" in parts:
        for pair in (*right, *_kept(folder / "corrupted.pkl")):
            yield Case("ingest", pair.name, lambda pair=pair: _said(noticed, pair))
    if "beside" in parts:
        beside = (*right, *_kept(folder / "lacking.pkl"), *_kept(folder / "silent.pkl"))
        for pair in beside:
            yield Case("beside", pair.name, lambda pair=pair: _said(noticed_beside, pair))
    if "conditioning" in parts:
        yield from _conditioning(pairs)
    if "consistency" in parts:
        for pair in pairs:
            if any(name in pair.name for name in RECONSTRUCTED):
                yield Case("consistency", pair.name, lambda pair=pair: _reconstructed(pair))
                for channel, error in (("az", 0.4), ("q", 0.004), ("alpha", 0.02), ("V", 2.0)):
                    if channel == ("az", "q", "alpha", "V")[RECONSTRUCTED.index(_of(pair)) % 4]:
                        wrong = _offset(pair, channel, error)
                        yield Case("consistency", wrong.name, lambda p=wrong: _reconstructed(p))
    if "loop" in parts:
        for aircraft, cell, planted in LOOPS:
            ready = _kept(folder / f"{aircraft}-{cell}.pkl")
            yield Case(
                "loop",
                f"{aircraft} {planted or 'nothing planted'}",
                lambda a=aircraft, r=ready, p=planted: _closed(a, r, p),
            )


def _of(pair: Pair) -> str:
    return next(name for name in RECONSTRUCTED if name in pair.name)


def _offset(pair: Pair, channel: str, error: float) -> Pair:
    """A pair with an offset in a channel, or in its like at the sensor [SI]."""
    name = channel if channel in pair.flight else f"{channel}_imu"
    flight = pair.flight.with_channels({name: pair.flight[name] + error})
    return replace(pair, name=f"{pair.name} {name} + {error:g}", flight=flight)


def _said(check: Callable[[Pair], Sequence[Any]], pair: Pair) -> Outcome:
    outcome: Outcome = {"suspected": "no"}
    try:
        with np.errstate(all="ignore"):
            found = check(pair)
    except InputError:
        return {"suspected": "refused"}
    for each in found:
        outcome["suspected"] = "yes"
        outcome[f"{each.channel} {each.kind}"] = "said"
        for name, value in each.evidence.items():
            outcome[f"{each.channel} {each.kind} {name}"] = float(value)
    return outcome


def _conditioning(pairs: Sequence[Pair]) -> Iterator[Case]:
    rng = np.random.default_rng(SEED)
    for pair in pairs:
        bare = replace(pair.flight, flags={})
        spoilt = _with_wild_points(bare, rng)
        late = bare.with_channels(
            {n: np.roll(bare[n], round(0.2 / bare.step)) for n in ("alpha",) if n in bare}
        )
        for word, flight in (("as flown", bare), ("wild points", spoilt), ("alpha late", late)):
            if len(flight.time) < LONGEST or word == "as flown":
                yield Case("conditioning", f"{pair.name} {word}", lambda f=flight: _conditioned(f))
        n = len(bare.time)
        if n < LONGEST:
            part = slice(n // 4, n - n // 5)
            copy = _part(spoilt, part)
            other = next(p for p in pairs if p.name != pair.name)
            for word, two in (("copy", copy), ("another", other.flight)):
                yield Case(
                    "conditioning", f"{pair.name} {word}", lambda a=bare, b=two: _repeated(a, b)
                )


def _part(flight: Flight, part: slice) -> Flight:
    channels = {name: values[part] for name, values in flight.channels.items()}
    return replace(flight, id="copy", time=flight.time[part] + 7.3, channels=channels, flags={})


def _with_wild_points(flight: Flight, rng: np.random.Generator) -> Flight:
    """A flight with single spikes of different sizes and a stuck stretch in some channels."""
    channels = {}
    n = len(flight.time)
    for name in ("alpha", "q", "V", "az", "az_imu", "theta"):
        if name not in flight:
            continue
        values = flight[name].copy()
        usual = float(np.median(np.abs(np.diff(values)))) + 1e-9
        for k, size in enumerate((6.0, 10.0, 20.0, 60.0)):
            values[int(rng.integers(n // 10, n - n // 10)) + k] += size * usual
        begin = int(rng.integers(n // 4, n // 2))
        values[begin : begin + round(0.9 / flight.step)] = values[begin]
        channels[name] = values
    return flight.with_channels(channels)


def _conditioned(flight: Flight) -> Outcome:
    with np.errstate(all="ignore"):
        flagged = flag_unusable(flight)
        found = examine(flagged)
    outcome: Outcome = {"suspected": "yes" if found.suspicions else "no"}
    for name, bits in flagged.flags.items():
        for bit in range(8):
            count = int(np.count_nonzero(bits & np.uint8(1 << bit)))
            if count:
                outcome[f"flag {name} {bit}"] = "set"
                outcome[f"flag {name} {bit} samples"] = float(count)
    for each in found.suspicions:
        outcome[f"{each.channel} {each.kind}"] = "said"
    kinds = [segment.kind for segment in found.segments]
    for kind in set(kinds):
        outcome[f"segments {kind}"] = str(kinds.count(kind))
    for kind in set(kinds):
        outcome[f"segments {kind} seconds"] = float(
            sum(s.end - s.start for s in found.segments if s.kind == kind)
        )
    for delay in found.delays:
        outcome[f"delay {delay.channel}"] = "observable" if delay.observable else "not observable"
        outcome[f"delay {delay.channel} seconds"] = round(float(delay.seconds), 4)
    return outcome


def _repeated(a: Flight, b: Flight) -> Outcome:
    common = len(fingerprint(a) & fingerprint(b))
    shared = shared_samples(a, b)
    return {
        "repeats": str(len(shared)),
        "marks in common": "yes" if common else "no",
        "shared seconds": float(sum(each.end_a - each.start_a for each in shared)),
    }


def _reconstructed(pair: Pair) -> Outcome:
    with np.errstate(all="ignore"):
        consistent = make_consistent(pair.flight, pair.vehicle, None)
    document = consistent.document
    outcome: Outcome = {"verdict": str(document["verdict"])}
    for remark in document["verdict_remarks"]:
        name = f"{remark['kind']} {' '.join(remark.get('subjects', ()))}"
        outcome[name] = "said"
    for entry in document["channels"]:
        outcome[f"{entry['channel']} verdict"] = entry["verdict"]
        if np.isfinite(entry["after"]):
            outcome[f"{entry['channel']} rms"] = float(entry["after"])
    for channel in consistent.changed:
        outcome[f"{channel} corrected"] = "yes"
    return outcome


def _closed(aircraft: str, ready: Prepared, planted: str) -> Outcome:
    """The loop, and the gate asked about its candidate; pictures, which decide nothing, are left
    out."""
    craft = airframe(aircraft)
    with (
        tempfile.TemporaryDirectory(prefix="thresholds-") as place,
        patch("aerodb.report.update_page._pictures", return_value={}),
    ):
        given: tuple[Any, ...] = ()
        if planted:
            given = (PLANTED[planted].file(craft), PLANTED[planted].bindings_of(craft))
        loop = looped(craft, ready, FLIGHTS_OF_LOOP, Path(place) / "loop", *given)
        if loop.found is None:
            return {"loop": f"refused {zlib.crc32(loop.refused.encode()):08x}"}
        outcome: Outcome = {"loop": "done", "added": " ".join(sorted(loop.found["added"]))}
        outcome |= _findings(loop.found)
        if loop.candidate is not None:
            outcome |= _gate(Path(place) / "loop" / "workspace", loop.found["candidate"])
    return outcome


def _findings(found: Mapping[str, Any]) -> Outcome:
    outcome: Outcome = {}
    for finding in found["findings"]:
        name = finding["hypothesis"]
        outcome[f"finding {name}"] = finding["verdict"]
        outcome[f"set of {name}"] = " ".join(sorted(finding.get("explanation_set", ())))
        if finding.get("value") is not None:
            outcome[f"value of {name}"] = float(finding["value"])
    for axis, entry in (found.get("axes") or {}).items():
        if isinstance(entry, Mapping):
            outcome |= {
                f"{axis} {key}": value if isinstance(value, str) else float(value)
                for key, value in entry.items()
                if isinstance(value, str | float | int)
            }
    return outcome


def _gate(workspace: Path, candidate: str) -> Outcome:
    """What the gate says of a candidate."""
    command = ["version", "promote", candidate, "--reason", "a campaign", "--direct"]
    result = CliRunner().invoke(app, ["--workspace", str(workspace), "--json", *command])
    said = result.stdout if result.exit_code == 0 else result.stderr
    return {"gate": f"exit code {result.exit_code}, {len(said.splitlines())} lines"}
