"""How often `flight ingest` names a weak rotor, and whether it names one in sound flights.

``python -m tests.campaigns.weak_rotors --folder weak-rotors`` makes a vehicle and its database from the log
of a sound flight by the commands (`vehicle init --from`, `update`, `version promote`). Then it flies 10 flights
with one rotor 8 % weak, 100 sound ones, and 20 sound ones whose motors hold their speed as the voltage falls.
Wind, gusts, decline of the battery, biases of the sensors and the strengths of sound rotors are drawn anew for
each. So the battery does take thrust, but for the last kind: it is named rightly where what is said of it holds
what it took. Each flight is one line of JSON; ``--report`` prints what the file holds, and a run goes on where
the last one ended.
"""

import argparse
import json
from collections.abc import Sequence
from contextlib import chdir
from pathlib import Path
from typing import Any, Final

import numpy as np

from tests.support.command import asked
from tests.support.multicopter_flight import fly, write_px4

#: The rotor that is weak, and its share of the thrust.
WEAK, SHARE = 3, 0.92
#: Length of a flight [s].
SECONDS: Final = 30.0
#: One sigma of what is drawn: wind [m/s] to the north and east, strength of a sound rotor, gyro bias
#: [rad/s], accelerometer bias [m/s2].
WIND, STRENGTH, GYRO, ACCELEROMETER = 3.0, 0.007, 0.01, 0.1
#: Largest standard deviation of gusts [m/s], and share of the speed that the battery may lose.
GUSTS, SAG = 0.8, 0.1
#: Standard errors within which what is said of a battery holds what it took.
HOLDS: Final = 3.0
MODEL = 'parameters = ["rotor_cT0", "rotor_cT1", "rotor_cQ", "rotor_drag"]\nown_constants = false\n'


def prepared(folder: Path) -> Path:
    """A workspace with the vehicle, and a released database that sound flights have corrected."""
    folder = folder.resolve()
    root = folder / "workspace"
    stem, flights = folder / "quad", fly(range(4), SECONDS, gusts=0.1)
    logs = [folder / f"first-{column}.ulg" for column in range(4)]
    for column, log in enumerate(logs):
        write_px4(log, flights, column)
    (folder / "model.toml").write_text(MODEL)
    with chdir(folder):  # files are written where the command runs
        done = asked(root, "vehicle", "init", "quad", "--from", str(logs[0]))
    assert done["rotors"] == 4
    asked(root, "vehicle", "add", f"{stem}.toml")
    asked(root, "database", "import", f"{stem}-rotors.toml", "--vehicle", "quad")
    asked(root, "flight", "ingest", *map(str, logs), "--vehicle", "quad")
    words = ("--vehicle", "quad", "--model", str(folder / "model.toml"))
    made = asked(root, "update", *words)["label"]
    asked(root, "version", "promote", made, "--vehicle", "quad", "--reason", "sound flights")
    return root


def conditions(seed: int) -> dict[str, Any]:
    """What is drawn of a flight: keywords of `fly`, and `biases`."""
    rng = np.random.default_rng([39, seed])
    wind = WIND * rng.standard_normal(2)
    return {
        "wind": (float(wind[0]), float(wind[1])),
        "gusts": float(rng.uniform(0.1, GUSTS)),
        "sag": float(rng.uniform(0.0, SAG)),
        "strength": 1.0 + STRENGTH * rng.standard_normal(4),
        "biases": np.repeat([GYRO, ACCELEROMETER], 3) * rng.standard_normal(6),
    }


def said(
    root: Path, folder: Path, seed: int, weak: bool, regulated: bool = False
) -> dict[str, Any]:
    """Fly, log and ingest a flight of a seed: its line."""
    drawn = {**conditions(seed), "regulated": regulated}
    biases = drawn.pop("biases")
    if weak:
        drawn["strength"][WEAK - 1] *= SHARE
    log = folder / f"{'weak' if weak else 'sound'}-{seed}.ulg"
    write_px4(log, fly([seed], SECONDS, **drawn), biases=biases)
    (document,) = asked(root, "flight", "ingest", str(log), "--vehicle", "quad")
    log.unlink()
    found = [*document["suspicions"], *document["comparison"]["suspicions"]]
    named = [
        [x["channel"], x["kind"], *map(x["evidence"].get, ("share", "standard_error"))]
        for x in found
    ]
    return {"seed": seed, "weak": weak, "regulated": regulated, "named": named}


def is_battery_s(line: dict[str, Any], share: float, error: float) -> bool:
    """Whether a share of the thrust that is said to be lost, with its standard error, holds what the
    battery of a flight took from its motors: the square of what they lost of their speed."""
    left = 1.0 if line["regulated"] else 1.0 - conditions(line["seed"])["sag"]
    return left < 1.0 and abs(share - (left**2 - 1.0)) <= HOLDS * error


def rightly(line: dict[str, Any]) -> bool:
    """Whether the weak rotor is named; of a sound flight: none. The battery may be named beside it,
    as far as it took thrust."""
    names = [each[:2] for each in line["named"] if each[1] != "sag"]
    sags = [each for each in line["named"] if each[1] == "sag"]
    return bool(
        names == ([[f"rotor_{WEAK}", "thrust"]] if line["weak"] else [])
        and all(is_battery_s(line, share, error) for _, _, share, error in sags)
    )


def report(lines: Sequence[dict[str, Any]]) -> str:
    """Counts, and what was said wrongly."""
    told = []
    kinds = (
        (True, False, f"rotor {WEAK} weak"),
        (False, False, "sound"),
        (False, True, "sound, speed held"),
    )
    for weak, regulated, what in kinds:
        of = [x for x in lines if (x["weak"], x["regulated"]) == (weak, regulated)]
        sags = sum(any(each[1] == "sag" for each in x["named"]) for x in of)
        told.append(f"{what}: {sum(map(rightly, of))} of {len(of)} right; battery named in {sags}")
    shares = [
        each[2]
        for x in lines
        if x["weak"] and rightly(x)
        for each in x["named"]
        if each[1] == "thrust"
    ]
    if shares:
        told.append(f"share: {min(shares):.3f} to {max(shares):.3f}, true {SHARE - 1:.3f}")
    wrong = [line for line in lines if not rightly(line)]
    told += [f"  seed {x['seed']}, weak {x['weak']}: {x['named']}" for x in wrong]
    return "\n".join(told)


def main() -> None:
    """Run what the file does not hold yet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, default=Path("weak-rotors"))
    parser.add_argument("--weak", type=int, default=10, help="flights with a weak rotor")
    parser.add_argument("--sound", type=int, default=100, help="sound flights")
    parser.add_argument("--held", type=int, default=20, help="sound flights, speed held")
    parser.add_argument("--report", action="store_true", help="print what the file holds")
    asked_for = parser.parse_args()
    folder, file = asked_for.folder, asked_for.folder / "flights.jsonl"
    lines = [json.loads(each) for each in file.read_text().splitlines()] if file.is_file() else []
    if not asked_for.report:
        folder.mkdir(parents=True, exist_ok=True)
        root = folder / "workspace"
        root = root if root.is_dir() else prepared(folder)
        held = {(x["seed"], x["weak"], x["regulated"]) for x in lines}
        wanted = [(k, True, False) for k in range(1, asked_for.weak + 1)]
        wanted += [(1000 + k, False, False) for k in range(1, asked_for.sound + 1)]
        wanted += [(2000 + k, False, True) for k in range(1, asked_for.held + 1)]
        for each in wanted:
            if each not in held:
                lines.append(said(root, folder, *each))
                with file.open("a") as out:
                    out.write(json.dumps(lines[-1]) + "\n")
    print(report(lines))


if __name__ == "__main__":
    main()
