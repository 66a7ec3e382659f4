"""How often the gate refuses a right update, and releases a harmful one, by commands.

``python -m tests.campaigns.gate --aircraft 737 f16 --folder FOLDER`` prepares five flights of each
aircraft, makes updates and asks the gate. Right updates correct an error planted in the database,
from flights with the errors that the vehicle file states. Where the gate refuses one, the command
that it names is run with a reason. Harmful ones are declared on a right database, from flights
whose sensors, surfaces or vehicle data are wrong; nobody states a reason for them. ``--unstated``
makes right ones of flights of which the vehicle file states nothing. One line of JSON per update is
appended to ``updates.jsonl``; ``--report`` prints its table, with bounds of 95 % (Clopper &
Pearson, 1934).
"""

import argparse
import json
import shlex
import shutil
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import beta
from typer.testing import CliRunner

from aerodb.flows.cli.main import app
from aerodb.support import Array
from aerodb.tables.database import AeroDatabase
from aerodb.tasks.workspace_access import access_workspace
from tests.campaigns.closed_loop import measured_wrongly
from tests.campaigns.fleet import Airframe, airframe
from tests.campaigns.instruments import CELLS
from tests.campaigns.planted import PLANTED, NotThere, lacks, measured_text
from tests.campaigns.runs import _import, channels_of, prepared
from tests.support.command import document

Log = dict[str, Array]
FLIGHTS = 5
#: Part of the motion of an axis from which a wrong change of it does harm.
HARM = 0.05
#: Planted errors of the database, and what is declared to correct each.
RIGHT: Mapping[str, Mapping[str, Sequence[str]]] = {
    "lift slope 15 %": {"C_lift": ("1", "alpha")},
    "lift 15 %": {"C_lift": ("1", "alpha")},
    "offset of lift": {"C_lift": ("1",)},
    "offset of Cm": {"Cm": ("1",)},
    "Cm_alpha 20 %": {"Cm": ("1", "alpha")},
    "Cm_de 25 %": {"Cm": ("1", "alpha", "q_hat", "delta_elevator")},
    "pitch damping 40 %": {"Cm": ("1", "q_hat")},
    "Cl_da 25 %": {"Cl": ("p_hat", "delta_aileron")},
    "Cn_dr 25 %": {"Cn": ("beta", "delta_rudder")},
}


@dataclass(frozen=True)
class Harmful:
    """What is wrong in the logs of a right aircraft, and what is declared on its right database."""

    log: Callable[[Log, Airframe], Log]
    declared: Mapping[str, Sequence[str]]


def _scaled(channel: str, factor: float) -> Callable[[Log, Airframe], Log]:
    return lambda log, craft: {**log, channel: factor * log[channel]}


def _offset(channel: str, degrees: float) -> Callable[[Log, Airframe], Log]:
    return lambda log, craft: {**log, channel: log[channel] + np.deg2rad(degrees)}


def _cg(chords: float) -> Callable[[Log, Airframe], Log]:
    def log(channels: Log, craft: Airframe) -> Log:
        return {**channels, "cg_x": channels["cg_x"] + chords * craft.database().reference.chord}

    return log


_LONGITUDINAL = {"Cm": ("1", "alpha")}
_PITCH = {"Cm": ("1", "alpha", "q_hat", "delta_elevator")}
_LATERAL = {"Cl": ("beta", "p_hat", "delta_aileron"), "Cn": ("beta", "r_hat", "delta_rudder")}
HARMFUL: Mapping[str, Harmful] = {
    "elevator zero 5 deg": Harmful(_offset("delta_elevator", 5.0), _LONGITUDINAL),
    "elevator zero -2 deg": Harmful(_offset("delta_elevator", -2.0), _PITCH),
    "elevator scale 1.3": Harmful(_scaled("delta_elevator", 1.3), _PITCH),
    "aileron scale .75": Harmful(_scaled("delta_aileron", 0.75), _LATERAL),
    "rudder scale 1.3": Harmful(_scaled("delta_rudder", 1.3), _LATERAL),
    "rudder zero 3 deg": Harmful(_offset("delta_rudder", 3.0), {"Cn": ("1", "beta")}),
    "CG .1 chord": Harmful(_cg(0.1), _LONGITUDINAL),
    "CG -.05 chord": Harmful(_cg(-0.05), _PITCH),
    "mass 1.1": Harmful(_scaled("mass", 1.1), {"CZ": ("1", "alpha")}),
    "alpha scale 1.15": Harmful(_scaled("alpha", 1.15), {"CZ": ("1", "alpha"), **_LONGITUDINAL}),
    "alpha zero 1.5 deg": Harmful(_offset("alpha", 1.5), {"CZ": ("1",), "Cm": ("1",)}),
    "beta scale 1.2": Harmful(_scaled("beta", 1.2), {"CY": ("beta",), **_LATERAL}),
    "qbar scale 1.15": Harmful(_scaled("qbar", 1.15), {"CZ": ("1", "alpha")}),
    "Ixx 1.2": Harmful(_scaled("Ixx", 1.2), {"Cl": ("beta", "p_hat", "delta_aileron")}),
    "Iyy .85": Harmful(_scaled("Iyy", 0.85), _PITCH),
}


def model_text(declared: Mapping[str, Sequence[str]]) -> str:
    """The model file that declares these terms."""
    return "".join(
        f'[[increment]]\naxis = "{axis}"\nterms = {json.dumps([*terms])}\n'
        for axis, terms in declared.items()
    )


def asked_gate(
    workspace: Path, vehicle: str, model: str, baseline: str = "", reason: str = ""
) -> dict[str, Any]:
    """An update of a workspace by commands, and what the gate says of it; with a reason, also what
    comes of the command that the gate names where it refuses."""
    file = workspace.parent / "model.toml"
    file.write_text(model)

    def ran(*words: str) -> Any:
        result = CliRunner().invoke(app, ["--workspace", str(workspace), "--json", *words])
        if not result.stdout.strip():
            return {"refused": (result.stderr or repr(result.exception))[:400]}
        return document(result.stdout)

    start = time.process_time()
    words = ("--baseline", baseline) if baseline else ()
    update = ran("update", "--vehicle", vehicle, "--model", str(file), "--direct", *words)
    cpu = time.process_time() - start
    if "refused" in update or not update.get("candidate"):
        return {"released": False, "failed": ["no update"], "why": [update.get("refused", "")]}
    gate = ran("version", "gate", update["label"], "--vehicle", vehicle)
    checks = [check for check in gate["checks"] if not check["passed"]]
    return {
        "released": gate["passed"],
        "failed": [check["label"] for check in checks],
        "why": [each for check in checks for each in check["reasons"]][:6],
        "rivals": {each["hypothesis"]: each["value"] for each in update["rivals"]},
        "acceptable": gate["acceptable"],
        "lifted": bool(
            reason and not gate["passed"] and _lifts(workspace, vehicle, update["label"], reason)
        ),
        "candidate": update["candidate"],
        "cpu": round(cpu, 2),
    }


def _lifts(workspace: Path, vehicle: str, label: str, reason: str) -> bool:
    """Whether the command that the gate prints for people releases the version that it refuses."""
    place = ["--workspace", str(workspace)]
    gate = ["version", "gate", label, "--vehicle", vehicle]
    told = CliRunner().invoke(app, [*place, *gate]).stdout.splitlines()
    named = [line.split(maxsplit=1)[1] for line in told if line.startswith("  next ")]
    words = [reason if word == "..." else word for word in shlex.split(named[0])]
    if words[:3] != ["aerodb", "version", "promote"]:
        return False
    return CliRunner().invoke(app, [*place, *words[1:]]).exit_code == 0


def errors(
    database: AeroDatabase, truth: AeroDatabase, logs: Sequence[Mapping[str, Array]]
) -> dict[str, float]:
    """Axis -> rms difference of two databases along flights without errors (channels (n,)), as a
    part of the motion of the axis; a dimensionless scalar."""
    wrong: dict[str, list[Array]] = {}
    whole: dict[str, list[Array]] = {}
    for log in logs:
        steady = {"alphadot": 0.0 * log["V"], "betadot": 0.0 * log["V"], **log}
        found, true = (each.predict(steady).coefficients for each in (database, truth))
        for axis, values in true.items():
            wrong.setdefault(axis, []).append(found[axis] - values)
            whole.setdefault(axis, []).append(values)
    return {
        axis: float(
            np.sqrt(np.mean(np.concatenate(wrong[axis]) ** 2)) / np.std(np.concatenate(values))
        )
        for axis, values in whole.items()
    }


def _workspace(
    craft: Airframe, name: str, folder: Path, seed: int, more: str, seen: Callable[[Log], Log]
) -> Path:
    """A prepared workspace, kept in `folder`, in a copy for one update."""
    kept, copy = folder / f"{craft.vehicle}-{name}-{seed}", folder / "now"
    if not (kept / "workspace").exists():
        shutil.rmtree(kept, ignore_errors=True)
        numbers = [(seed * 5 + k) % 16 for k in range(FLIGHTS)]
        prepared(craft, "declared", numbers, seed, kept, folder / "flights", more, seen)
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(kept, copy)
    return copy / "workspace"


def right(
    craft: Airframe, folder: Path, seed: int, stated: bool, kinds: Sequence[str]
) -> Iterator[dict[str, Any]]:
    """Right updates of one aircraft: the planted error is released first, then corrected."""
    more, seen = (measured_text(craft), measured_wrongly(craft, seed)) if stated else ("", dict)
    clean = [
        channels_of(craft, number, CELLS["declared"], folder / "flights") for number in range(3)
    ]
    for kind in kinds:
        planted = PLANTED[kind]
        try:
            xml, bindings = planted.file(craft), planted.bindings_of(craft)
        except NotThere:
            continue
        wrong = craft.database(xml, bindings)
        if lacks(craft, wrong, planted.axis, clean) == 0.0:
            continue
        name = "stated" if stated else "unstated"
        workspace = _workspace(craft, name, folder, seed, more, seen)
        version = _import(craft, workspace.parent, workspace, xml, bindings)
        CliRunner().invoke(
            app,
            ["--workspace", str(workspace), "version", "promote", version, "--vehicle",
             craft.vehicle, "--reason", "planted"],
        )  # fmt: skip
        model = model_text(RIGHT[kind])
        found = asked_gate(workspace, craft.vehicle, model, version, "measured on the ground")
        before = errors(wrong, craft.database(), clean)
        yield {
            "set": f"right, {name}",
            "kind": kind,
            **_judged(found, workspace, craft, before, clean),
        }


def harmful(
    craft: Airframe, folder: Path, seed: int, kinds: Sequence[str]
) -> Iterator[dict[str, Any]]:
    """Updates of one aircraft from flights that are wrong, on its right database."""
    clean = [
        channels_of(craft, number, CELLS["declared"], folder / "flights") for number in range(3)
    ]
    for kind in kinds:
        case = HARMFUL[kind]
        name = kind.replace(" ", "-")
        channel = [*_touched(case, craft)]
        if not channel:
            continue
        workspace = _workspace(
            craft, name, folder, seed, "", lambda log, case=case: case.log(log, craft)
        )
        found = asked_gate(workspace, craft.vehicle, model_text(case.declared))
        before = errors(craft.database(), craft.database(), clean)
        yield {"set": "harmful", "kind": kind, **_judged(found, workspace, craft, before, clean)}


def _touched(case: Harmful, craft: Airframe) -> list[str]:
    """What of the log it changes, if the aircraft has it."""
    made = {name: np.ones(2) for name in (*craft.channels, "mass", "cg_x", "alpha", "beta", "qbar",
                                          "Ixx", "Iyy")}  # fmt: skip
    try:
        changed = case.log(made, craft)
    except KeyError:
        return []
    return [name for name, values in changed.items() if not np.array_equal(values, made[name])]


def _judged(
    found: dict[str, Any],
    workspace: Path,
    craft: Airframe,
    before: Mapping[str, float],
    clean: Sequence[Mapping[str, Array]],
) -> dict[str, Any]:
    after = dict(before)
    if candidate := found.pop("candidate", ""):
        database = access_workspace(str(workspace)).database(candidate)
        after = errors(database, craft.database(), clean)
    worst = max(after, key=lambda axis: after[axis] - before[axis])
    harm = after[worst] - before[worst]
    return {"aircraft": craft.name, **found, "harm": round(harm, 4), "on": worst,
            "error": [round(max(before.values()), 4), round(max(after.values()), 4)]}  # fmt: skip


def bounds(count: int, of: int) -> tuple[float, float]:
    """Interval of 95 % of a rate (Clopper & Pearson, Biometrika 26, 1934)."""
    low = float(beta.ppf(0.025, count, of - count + 1)) if count else 0.0
    return low, float(beta.ppf(0.975, count + 1, of - count)) if count < of else 1.0


def _is_right(line: Mapping[str, Any]) -> bool:
    """Whether an update turned out right: at least half of the error is gone, and no axis is worse.
    Where a flight tells two effects apart badly, it does not."""
    before, after = line["error"]
    return bool(line["harm"] < HARM and after < 0.5 * before)


def table(lines: Sequence[Mapping[str, Any]]) -> str:
    """Set, then kind -> how many were released; of harmful ones those that do harm."""
    rows = []
    for name in dict.fromkeys(line["set"] for line in lines):
        part = [line for line in lines if line["set"] == name]
        wanted = name != "harmful"
        part = [line for line in part if (_is_right(line) if wanted else line["harm"] > HARM)]
        for kind in (*dict.fromkeys(line["kind"] for line in part), ""):
            own = [line for line in part if line["kind"] == kind or not kind]
            refused = [line for line in own if not line["released"]]
            why = ", ".join(sorted({label for line in refused for label in line["failed"]}))
            counts = {"released": len(own) - len(refused)}
            if wanted:
                still = sum(not line.get("lifted") for line in refused)
                counts = {"refused": len(refused), "also with a reason": still}
            said = "; ".join(_share(word, count, len(own)) for word, count in counts.items())
            rows.append(f"{name:16} {kind or 'all':24} {said} {why}")
    return "\n".join(rows)


def _share(word: str, count: int, of: int) -> str:
    low, high = bounds(count, of)
    return f"{word} {count} of {of} ({low:.1%} to {high:.1%})"


def main() -> None:
    """Run parts of the campaign, or print what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--aircraft", nargs="*", default=["737", "f16", "T38", "A4", "B747"])
    parser.add_argument("--folder", type=Path, required=True)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", nargs="*", default=[*RIGHT, *HARMFUL])
    parser.add_argument("--unstated", action="store_true")
    parser.add_argument("--report", action="store_true")
    given = parser.parse_args()
    place = given.folder / "updates.jsonl"
    given.folder.mkdir(parents=True, exist_ok=True)
    if not given.report:
        for name in given.aircraft:
            craft = airframe(name)
            rights = [kind for kind in given.kinds if kind in RIGHT]
            harms = [kind for kind in given.kinds if kind in HARMFUL]
            for line in chain(
                right(craft, given.folder, given.seed, not given.unstated, rights),
                harmful(craft, given.folder, given.seed, harms),
            ):
                with place.open("a") as file:
                    file.write(json.dumps({**line, "seed": given.seed}) + "\n")
    print(table([json.loads(line) for line in place.read_text().splitlines()]))


if __name__ == "__main__":
    main()
