"""How often an aircraft of parts is read rightly: intervals of its parameters, and claims where its
build-up is right.

``python -m tests.campaigns.build_ups --seeds 1 2 3 --folder build-ups`` flies the aircraft of
`tests.support.parts` a few times per seed. An update corrects a build-up whose parameters are drawn wrong,
and the closed loop looks at the right one. Each seed appends one line of JSON; ``--report`` prints what the
file holds. The flights are in memory, with coloured and white noise on their coefficients. With
``--commands`` they are logs of noisy instruments, read by the commands, which costs five times as much.
"""

import argparse
import json
import math
import shutil
import tempfile
import time
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from aerodb.increments import estimate_increments, parse_model_file
from aerodb.loop import Accept, freeze_library, run_loop
from aerodb.tables import sigma_of
from tests.support.command import asked
from tests.support.parts import TEXT, VEHICLE, aircraft, log
from tests.support.parts import flights as flown
from tests.support.small_glider import write_csv

#: Parameters that are estimated together. Least drag of wing and fuselage is one constant, and lift at no
#: angle of attack another that a bias of the accelerometer is as well; the downwash is one number with
#: the tail's slope.
CORRECTED = (
    "wing_slope", "tail_slope", "fin_slope", "elevator_part", "aileron_part", "rudder_part",
)  # fmt: skip
#: One sigma of what each is wrong by, as a part of its true value.
WRONG_BY = 0.15
FLIGHTS = 3
#: Standard errors on either side of an estimate within which the truth lies in 95 of 100.
_INTERVAL = 1.96
#: Largest normal number that is drawn, so that all are within their bounds.
_MOST = 2.0


def drawn(seed: int) -> dict[str, float]:
    """Wrong values of the parameters, true values times a drawn factor."""
    rng = np.random.default_rng([36, seed])
    off = np.clip(rng.standard_normal(len(CORRECTED)), -_MOST, _MOST)
    true = aircraft().parameters
    return {
        name: float(true[name] * (1.0 + WRONG_BY * each))
        for name, each in zip(CORRECTED, off, strict=True)
    }


def written(values: Mapping[str, float]) -> str:
    """The aircraft's file with other values of some parameters."""
    text = TEXT
    for name, value in values.items():
        true = f"{name} = {{ value = {aircraft().parameters[name]}"
        assert text.count(true) == 1, name
        text = text.replace(true, f"{name} = {{ value = {value!r}")
    return text


def prepared(folder: Path, seed: int, flights: int) -> Path:
    """A workspace with v0001, which is right, v0002, which is wrong, and the flights of a seed."""
    root = folder / "workspace"
    texts = {"vehicle": VEHICLE, "right": TEXT, "wrong": written(drawn(seed))}
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    asked(root, "vehicle", "add", str(folder / "vehicle.toml"))
    for name in ("right", "wrong"):
        asked(root, "database", "import", str(folder / f"{name}.toml"))
    files = []
    for number in range(flights):
        file = write_csv(folder / f"flight{number}.csv", log(1000 * seed + number, aircraft()))
        text = file.read_text(encoding="utf-8")
        file.write_text(text.replace("throttle [1]", "throttle [-]"), encoding="utf-8")
        files.append(str(file))
    asked(root, "flight", "ingest", *files, "--mapping", "canonical", "--direct")
    return root


def by_commands(seed: int, flights: int) -> dict[str, Any]:
    """What `update` and `close-loop` say of logs of the flights."""
    folder = Path(tempfile.mkdtemp(prefix=f"build-up-{seed}-"))
    spent = [time.process_time()]
    root = prepared(folder, seed, flights)
    spent.append(time.process_time())
    model = folder / "parameters.toml"
    model.write_text(f"parameters = {json.dumps(CORRECTED)}\n", encoding="utf-8")
    update = asked(root, "update", "--model", str(model), "--baseline", "v0002", "--direct")
    spent.append(time.process_time())
    loop = asked(root, "close-loop", "--baseline", "v0001", "--direct")
    spent.append(time.process_time())
    shutil.rmtree(folder)
    found = {each["name"]: (each["after"], each["standard_error"]) for each in update["parameters"]}
    findings = [[each["verdict"], each["hypothesis"]] for each in loop["findings"]]
    return _line(seed, flights, found, findings, spent)


def in_memory(seed: int, flights: int) -> dict[str, Any]:
    """The same of flights in memory."""
    spent = [time.process_time()]
    numbers = range(1000 * seed, 1000 * seed + flights)
    source, right, wrong = flown(numbers, aircraft()), aircraft(), aircraft(drawn(seed))
    ids = tuple(source.flown)
    spent.append(time.process_time())
    update = estimate_increments(
        [source.flight(each) for each in ids],
        [source.comparison(each, wrong) for each in ids],
        parse_model_file(f"parameters = {json.dumps(CORRECTED)}"),
        wrong,
        None,
    ).candidate
    spent.append(time.process_time())
    loop = run_loop(source, ids, right, freeze_library(source, ids, right), Accept())
    spent.append(time.process_time())
    found = {
        name: (update.parameters[name], sigma_of(update.variables[name].uncertainty) or 0.0)
        for name in CORRECTED
    }
    findings = [[each.verdict, each.hypothesis] for each in loop.findings]
    return _line(seed, flights, found, findings, spent)


def _line(
    seed: int,
    flights: int,
    found: Mapping[str, tuple[float, float]],
    findings: Sequence[Sequence[str]],
    spent: Sequence[float],
) -> dict[str, Any]:
    """One line. parameters : each one's estimate less its true value, its standard error, and what it was
    wrong by; findings : of the loop, verdict and hypothesis; cpu : s of flights, update and loop."""
    true, wrong = aircraft().parameters, drawn(seed)
    return {
        "seed": seed, "flights": flights, "findings": findings,
        "parameters": {
            name: [value - true[name], error, wrong[name] - true[name]]
            for name, (value, error) in found.items()
        },
        "cpu": np.diff(spent).round(1).tolist(),
    }  # fmt: skip


def covered(line: Mapping[str, Any]) -> dict[str, bool]:
    """Parameter -> whether its interval of 95 % holds the truth."""
    return {
        name: abs(off) <= _INTERVAL * error for name, (off, error, _) in line["parameters"].items()
    }


def report(lines: Sequence[Mapping[str, Any]]) -> str:
    """Coverage per parameter and of all, what is left of the errors, and false claims."""
    text = [f"{len(lines)} seeds", f"{'parameter':16} covered  left of the error, rms"]
    hits = [covered(line) for line in lines]
    for name in sorted({name for each in hits for name in each}):
        own = [each[name] for each in hits if name in each]
        values = np.array(
            [line["parameters"][name] for line in lines if name in line["parameters"]]
        )
        left = math.sqrt(float((values[:, 0] ** 2).mean() / (values[:, 2] ** 2).mean()))
        text.append(f"{name:16} {sum(own):3}/{len(own):3}  {100 * left:5.1f} %")
    every = [hit for each in hits for hit in each.values()]
    text.append(
        f"{'all':16} {sum(every):3}/{len(every):3}  ({100 * sum(every) / len(every):.1f} %)"
    )
    false = [[h for v, h in line["findings"] if v == "confirmed"] for line in lines]
    text.append(f"right build-up: {sum(map(bool, false))} of {len(lines)} runs confirm something")
    told = Counter(f"{verdict} {name}" for line in lines for verdict, name in line["findings"])
    text.append("beside it: " + (", ".join(f"{n} {k}" for n, k in told.most_common()) or "nothing"))
    text.append(
        f"CPU s a seed: {np.mean([line['cpu'] for line in lines], axis=0).round(1).tolist()}"
    )
    return "\n".join(text)


def main(arguments: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", nargs="*", type=int, default=[])
    parser.add_argument("--flights", type=int, default=FLIGHTS)
    parser.add_argument("--folder", type=Path, default=Path("build-ups"))
    parser.add_argument("--commands", action="store_true")
    parser.add_argument("--report", action="store_true")
    chosen = parser.parse_args(arguments)
    chosen.folder.mkdir(parents=True, exist_ok=True)
    place = chosen.folder / ("by_commands.jsonl" if chosen.commands else "in_memory.jsonl")
    warnings.simplefilter("ignore")
    for seed in chosen.seeds:
        line = (by_commands if chosen.commands else in_memory)(seed, chosen.flights)
        with place.open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")
    if chosen.report:
        lines = place.read_text(encoding="utf-8").splitlines()
        print(report([json.loads(line) for line in lines]))


if __name__ == "__main__":
    main()
