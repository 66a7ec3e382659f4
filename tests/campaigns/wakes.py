"""How often a wake is found with its right size and law, and how often one is claimed that is not there.

``python -m tests.campaigns.wakes --file wakes.jsonl`` draws encounters with vortex pairs of other aircraft. A lattice of 200 strips
(`tests.support.two_hundred_strips`) flies each in Dryden's turbulence, and `identify_wake` has the air at the nose with noise of vanes.
Four encounters in a row meet a pair that decays and whose core grows. Flights through turbulence alone follow. Each is one line of
JSON; ``--report`` prints what the file holds, and a run goes on where the last one ended.
"""

import argparse
import json
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from aerodb.identification import identify_wake
from aerodb.physics import CORES, Turbulence, gust_series
from tests.support.two_hundred_strips import SPEED, through, to_earth, wake

#: Place of the vanes [m], their noise [m/s], and the span [m].
NOSE, NOISE, SPAN = np.array([4.0, 0.0, 0.0]), 0.05, 12.0
#: Least and greatest spacing [m]; circulation [m2/s], core radius over spacing, angle to the axis [deg] and distance
#: of the axis above or below [m]; rms of gusts [m/s].
SPACING, CIRCULATION, CORE, ANGLE, ABOVE, GUSTS = (
    (12.0, 35.0),
    (100.0, 400.0),
    (0.04, 0.1),
    (3.0, 90.0),
    (-1.5, 1.5),
    (0.1, 1.0),
)
#: From one encounter of a row to the next: circulation falls, and the core grows, by these shares.
DECAY, GROWTH = (0.1, 0.25), (0.1, 0.3)
IN_A_ROW: Final = 4
#: Error of circulation and core radius at most, as a share.
RIGHT: Final = 0.1


def met(seed: int, number: int) -> dict[str, Any]:
    """What is drawn of an encounter of a row: the pair is that of the row, decayed."""
    rng = np.random.default_rng([42, seed])
    spacing = rng.uniform(*SPACING)
    pair = {
        "circulation": rng.uniform(*CIRCULATION), "core_radius": rng.uniform(*CORE) * spacing, "spacing": spacing,
        "core": str(rng.choice(CORES)),
    }  # fmt: skip
    for _ in range(number):
        pair["circulation"] *= 1.0 - rng.uniform(*DECAY)
        pair["core_radius"] *= 1.0 + rng.uniform(*GROWTH)
    own = np.random.default_rng([42, seed, number])
    angle = float(np.deg2rad(own.uniform(*ANGLE)))
    return {
        "pair": pair,
        "angle": angle,
        "above": own.uniform(*ABOVE),
        "gusts": own.uniform(*GUSTS),
    }


def seen(moved: np.ndarray, gusts: float, seed: Sequence[int]) -> np.ndarray:
    """Air (3, n) as vanes show it: with wind, Dryden's turbulence and noise."""
    rng = np.random.default_rng([*seed, 1])
    time = 0.02 * np.arange(moved.shape[1])
    air = Turbulence("dryden", (300.0,) * 3, (gusts,) * 3)
    blown = gust_series(air, time, SPEED, SPAN, int(rng.integers(2**31)))
    wind = rng.uniform(-5.0, 5.0, (3, 1)) * np.array([[1.0], [1.0], [0.0]])
    turbulence = np.stack([blown[f"gust_{name}"] for name in "uvw"])
    return moved + wind + turbulence + NOISE * rng.standard_normal(moved.shape)


def encounter(seed: int, number: int) -> dict[str, Any]:
    """Fly and estimate one: its line."""
    drawn = met(seed, number)
    air = wake(**drawn["pair"])
    seconds = float(np.clip(120.0 / (SPEED * np.sin(drawn["angle"])), 4.0, 9.0))
    flown = through(air, drawn["angle"], seconds, drawn["above"])
    nose = np.array([
        place + to_earth(*attitude) @ NOSE
        for place, attitude in zip(flown["place"].T, flown["attitude"].T, strict=True)
    ])  # fmt: skip
    measured = seen(air(nose).T, drawn["gusts"], (seed, number))
    begun = time.process_time()
    found = identify_wake(measured, nose.T * np.array([[1.0], [1.0], [-1.0]]))
    took = time.process_time() - begun
    across, below = np.abs(nose[:, 1]) - 0.5 * drawn["pair"]["spacing"], nose[:, 2]
    return {
        "seed": seed, "number": number, **drawn, "found": bool(found.found), "named": found.core, "took": took,
        "nearest": float(np.hypot(across, below).min() / drawn["pair"]["core_radius"]),
        **{
            name: [getattr(found.pair, name), found.errors[name]]
            for name in ("circulation", "core_radius", "spacing")
        },
    }  # fmt: skip


def still(seed: int) -> dict[str, Any]:
    """A flight of 10 s through turbulence alone: its line."""
    path = np.stack([SPEED * 0.02 * np.arange(500), np.zeros(500), np.full(500, 1000.0)])
    gusts = np.random.default_rng([43, seed]).uniform(*GUSTS)
    found = identify_wake(seen(np.zeros((3, 500)), gusts, (43, seed)), path)
    return {"seed": seed, "gusts": gusts, "pair": None, "found": bool(found.found)}


def report(lines: Sequence[dict[str, Any]]) -> str:
    """Counts, shares and times."""
    alone = [line for line in lines if line["pair"] is None]
    met = [line for line in lines if line["pair"] is not None]
    found = [line for line in met if line["found"]]
    near = [line for line in found if line["nearest"] < 1.0]
    told = [
        f"turbulence alone: nothing claimed in {sum(not line['found'] for line in alone)} of {len(alone)}",
        f"encounters: {len(found)} of {len(met)} found",
        f"law: {sum(line['named'] == line['pair']['core'] for line in found)} named rightly,"
        f" {sum(line['named'] not in ('', line['pair']['core']) for line in found)} wrongly, of {len(found)}",
    ]
    for of, which in (("all", found), ("the nose within a core radius", near)):
        for name in ("circulation", "core_radius", "spacing"):
            off = [line[name][0] / line["pair"][name] - 1.0 for line in which]
            within = sum(abs(each) < RIGHT for each in off)
            told.append(f"{name}, {of}: {within} of {len(off)} within {RIGHT:.0%}")
    for name in ("circulation", "core_radius"):
        held = sum(abs(line[name][0] - line["pair"][name]) < 1.96 * line[name][1] for line in found)
        told.append(f"{name}: true value in {held} of {len(found)} intervals")
    rows = {
        line["seed"]: [each for each in found if each["seed"] == line["seed"]] for line in found
    }
    whole = [
        sorted(row, key=lambda each: each["number"])
        for row in rows.values()
        if len(row) == IN_A_ROW
    ]
    for name, sign in (("circulation", -1.0), ("core_radius", 1.0)):
        right = sum(
            bool(np.all(sign * np.diff([line[name][0] for line in row]) > 0.0)) for row in whole
        )
        told.append(f"{name} monotone in {right} of {len(whole)} rows of {IN_A_ROW}")
    if met:
        told.append(f"processor time of one: {max(line['took'] for line in met):.1f} s at most")
    return "\n".join(told)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--file", type=Path, required=True, help="lines of JSON")
    parser.add_argument("--rows", type=int, default=25, help=f"rows of {IN_A_ROW} encounters")
    parser.add_argument("--still", type=int, default=100, help="flights through turbulence alone")
    parser.add_argument("--report", action="store_true", help="print what the file holds")
    asked = parser.parse_args()
    file = asked.file
    lines = [json.loads(each) for each in file.read_text().splitlines()] if file.is_file() else []
    if not asked.report:
        held = {(line["seed"], line.get("number", -1)) for line in lines}
        wanted = [(seed, k) for seed in range(1, asked.rows + 1) for k in range(IN_A_ROW)]
        wanted += [(seed, -1) for seed in range(1, asked.still + 1)]
        for seed, number in wanted:
            if (seed, number) not in held:
                lines.append(still(seed) if number < 0 else encounter(seed, number))
                with file.open("a") as out:
                    out.write(json.dumps(lines[-1]) + "\n")
    print(report(lines))


if __name__ == "__main__":
    main()
