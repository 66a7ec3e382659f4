"""How often a pair of rolls has the closed loop claim something of friction that is right, and whether
it finds and repairs friction that is 20 % off.

``python -m tests.campaigns.rolls --folder rolls`` makes pairs of rolls in JSBSim, each in a wind of its own,
from a speed and with brakes of its own, and logs them with noise of instruments. By the commands they are
ingested (`flight ingest`), their friction is estimated (`estimate`), and the loop is closed over each pair
(`close-loop`). Each pair is one line of JSON; ``--report`` prints what the file holds, and a run goes on
where the last one ended.
"""

import argparse
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from tests.support.command import asked
from tests.support.small_glider import write_csv
from tests.support.three_wheels import (
    AS_IN_JSBSIM,
    MASSES,
    ROLLING,
    SIDE,
    SPRING,
    VEHICLE,
    measured,
    rolled_in_jsbsim,
)

#: Friction that JSBSim's vehicle has: what its database should say.
TRUE: Final = {"mu_brake": 0.22, "mu_roll": ROLLING, "mu_side": SIDE}
#: Height at which its legs carry it [m].
LEVEL: Final = 1.2 - MASSES["mass"] * 9.80665 / (3.0 * SPRING)
#: Largest component of the wind [m/s], speeds at the start [m/s], and how late brakes begin [s].
WIND, SPEEDS, LATE = 6.0, (35.0, 62.0), 12.0
#: Brakes of the planted error: 20 % off, either way.
OFF: Final = (1.2, 0.8)
#: Error of a repaired friction at most, as a share.
REPAIRED: Final = 0.02
#: Time for which the vehicle stands still before its log ends [s].
STANDS: Final = 3.0
MODEL: Final = 'parameters = ["mu_brake", "mu_roll", "mu_side"]\n'
_GIVEN: Final = ("--vehicle", "wheels")


def prepared(folder: Path) -> Path:
    """A workspace with the vehicle and, as versions, its database with right friction and with the
    brakes of `OFF`."""
    folder = folder.resolve()
    root = folder / "workspace"
    (folder / "vehicle.toml").write_text(VEHICLE, encoding="utf-8")
    (folder / "model.toml").write_text(MODEL, encoding="utf-8")
    asked(root, "vehicle", "add", str(folder / "vehicle.toml"))
    for number, share in enumerate((1.0, *OFF), 1):
        brakes = "mu_brake = {{ value = {}".format
        assert brakes(TRUE["mu_brake"]) in AS_IN_JSBSIM
        text = AS_IN_JSBSIM.replace(brakes(TRUE["mu_brake"]), brakes(share * TRUE["mu_brake"]))
        file = folder / f"wheels-{share:g}.toml"
        file.write_text(text, encoding="utf-8")
        label = asked(root, "database", "import", str(file), *_GIVEN)["label"]
        assert label == f"v{number:04d}"
    return root


def conditions(seed: int) -> list[dict[str, Any]]:
    """What is drawn of the two rolls of a pair: keywords of `rolled_in_jsbsim`."""
    rng = np.random.default_rng([38, seed])
    return [
        {
            "wind": tuple(rng.uniform(-WIND, WIND, 2)),
            "speed": rng.uniform(*SPEEDS),
            "braking_from": rng.choice([0.0, rng.uniform(2.0, LATE)]),
        }
        for _ in range(2)
    ]


def standing(channels: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Channels (n,) of a roll, and its last sample for `STANDS` more."""
    step = channels["time"][1] - channels["time"][0]
    more = np.arange(1, round(STANDS / step) + 1)
    return {
        name: np.append(values, values[-1] + (step * more if name == "time" else 0.0 * more))
        for name, values in channels.items()
    }


def said(root: Path, folder: Path, seed: int, planted: bool) -> dict[str, Any]:
    """Roll, log, ingest, estimate and close the loop of the pair of a seed: its line."""
    logs = []
    for number, drawn in enumerate(conditions(seed)):
        channels = standing(rolled_in_jsbsim(TRUE["mu_brake"], height=LEVEL, **drawn))
        file = folder / f"roll-{int(planted)}-{seed}-{number}.csv"
        logs.append(str(write_csv(file, measured(channels, 2 * seed + number))))
    ingest = ("flight", "ingest", *logs, *_GIVEN, "--mapping", "canonical")
    flights = [each["flight"] for each in asked(root, *ingest)]
    for log in logs:
        Path(log).unlink()
    named = [word for each in flights for word in ("--flights", each)]
    baseline = ("--baseline", f"v{2 + seed % len(OFF) if planted else 1:04d}")
    loop = asked(root, "close-loop", *_GIVEN, *baseline, "--on-ground", *named)
    model = ("--model", str(folder / "model.toml"), "--method", "output-error")
    (found,) = asked(root, "estimate", *_GIVEN, *baseline, *named, *model)["methods"]
    estimates = {e["name"]: e for e in found.get("estimates", ()) if e["name"] in TRUE}
    return {
        "seed": seed,
        "planted": planted,
        "claims": [
            [e["hypothesis"], e["verdict"], e["value"], e["explanation_set"]]
            for e in loop["findings"]
        ],
        "added": loop["added"],
        "after": {each["name"]: each["after"] for each in loop.get("parameters", ())},
        "off": {  # in standard errors
            name: (each["value"] - TRUE[name]) / each["standard_error"]
            for name, each in estimates.items()
            if each["value"] is not None and each["standard_error"]
        },
    }


def rightly(line: dict[str, Any]) -> bool:
    """Whether nothing is claimed of right friction; of a planted error: it alone is added, and
    repaired."""
    if not line["planted"]:
        return not line["claims"]
    after = line["after"]
    return set(after) == {"mu_brake"} and abs(after["mu_brake"] / TRUE["mu_brake"] - 1.0) < REPAIRED


def grouped(line: dict[str, Any]) -> bool:
    """Whether a planted error is named in a group that its rolls cannot tell apart, and nothing is
    added: brakes that are full all the time are rolling friction as well."""
    sets = [names for _, verdict, _, names in line["claims"] if verdict == "alias_group"]
    named = any("parameter@all:mu_brake" in names for names in sets)
    return line["planted"] and named and not line["added"]


def report(lines: Sequence[dict[str, Any]]) -> str:
    """Counts, and what was said wrongly."""
    told = []
    for planted, what in ((False, "right friction"), (True, "brakes 20 % off")):
        of = [line for line in lines if line["planted"] == planted]
        more = f", {sum(map(grouped, of))} named in a group" if planted else ""
        told.append(f"{what}: {sum(map(rightly, of))} of {len(of)} right{more}")
    off = {name: [x["off"][name] for x in lines if name in x["off"]] for name in TRUE}
    for name, sizes in off.items():
        held = sum(abs(size) < 1.96 for size in sizes)
        told.append(f"estimates of {name}: true value in {held} of {len(sizes)} intervals of 95 %")
    wrong = [line for line in lines if not rightly(line)]
    told += [
        f"  seed {x['seed']}, planted {x['planted']}: {x['claims']}, added {x['after']}"
        for x in wrong
    ]
    return "\n".join(told)


def main() -> None:
    """Run what the file does not hold yet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("rolls"))
    parser.add_argument("--right", type=int, default=100, help="pairs with right friction")
    parser.add_argument("--planted", type=int, default=10, help="pairs with brakes 20 %% off")
    parser.add_argument("--report", action="store_true", help="print what the file holds")
    asked_for = parser.parse_args()
    folder, file = asked_for.folder, asked_for.folder / "pairs.jsonl"
    lines = [json.loads(each) for each in file.read_text().splitlines()] if file.is_file() else []
    if not asked_for.report:
        folder.mkdir(parents=True, exist_ok=True)
        root = folder.resolve() / "workspace"
        root = root if root.is_dir() else prepared(folder)
        held = {(line["seed"], line["planted"]) for line in lines}
        wanted = [(seed, False) for seed in range(1, asked_for.right + 1)]
        wanted += [(1000 + seed, True) for seed in range(1, asked_for.planted + 1)]
        for seed, planted in wanted:
            if (seed, planted) not in held:
                lines.append(said(root, folder, seed, planted))
                with file.open("a") as out:
                    out.write(json.dumps(lines[-1]) + "\n")
    print(report(lines))


if __name__ == "__main__":
    main()
