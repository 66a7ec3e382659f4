"""Error rates of the closed loop over aircraft and instruments, through the commands.

``python -m tests.campaigns.closed_loop --aircraft 737 --cell declared --flights 3 6 --seed 1``
appends one line of JSON per run to a file; with ``--planted`` an error is planted in the database.
``--report`` prints what the files hold.
"""

import argparse
import json
import shutil
import tempfile
import warnings
import zlib
from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aerodb.signals import rms
from aerodb.tables import AeroDatabase
from aerodb.tasks.steps.loop_flights import StoredFlights
from aerodb.tasks.workspace_access import access_workspace
from tests.campaigns.fleet import CONDITIONS, Airframe, airframe
from tests.campaigns.instruments import CELLS
from tests.campaigns.misstated import MISSTATED
from tests.campaigns.outside import OUTSIDE, changed
from tests.campaigns.planted import (
    PLANTED,
    NotThere,
    Planted,
    as_measured,
    lacks,
    measured_text,
    true_value,
)
from tests.campaigns.runs import Loop, Prepared, channels_of, judged, looped, prepared, record

CLASSES = ("confirmed", "aerodynamic", "unnamed", "sensor")


def run_null(
    aircraft: str, cell: str, flights: Sequence[int], seed: int, folder: Path
) -> Iterable[dict[str, Any]]:
    """The runs of one cell with nothing missing, of the first n flights of the same campaign.

    Folders of runs with a wrong claim are kept.
    """
    craft = airframe(aircraft)
    here = Path(tempfile.mkdtemp(prefix=f"{craft.vehicle}-", dir=folder))
    numbers = [(seed * 5 + k) % 16 for k in range(max(flights))]
    ready = prepared(craft, cell, numbers, seed, here / "all", folder / "flights")
    wrong = False
    for n in flights:
        loop = looped(craft, ready, n, here / f"{n}-flights")
        verdicts = Counter(list(ready.verdicts.values())[:n])
        line: dict[str, Any] = {
            "aircraft": aircraft, "cell": cell, "flights": n, "seed": seed,
            "consistency": dict(verdicts), "loop_cpu": round(loop.cpu, 2),
            "ingest_cpu": round(ready.cpu, 2), "refused": loop.refused,
        }  # fmt: skip
        if loop.found is not None:
            line |= record(judged(loop.found, CELLS[cell])) | {"added": loop.found["added"]}
            line["findings"] = [[f["verdict"], f["hypothesis"]] for f in loop.found["findings"]]
        bad = bool(loop.refused) or any(line.get(name) for name in CLASSES)
        if bad:
            line["folder"] = str(loop.folder)
        else:
            shutil.rmtree(loop.folder)
        wrong = wrong or bad
        yield line
    if not wrong:
        shutil.rmtree(here)


def run_planted(
    aircraft: str,
    kinds: Sequence[str],
    flights: Sequence[int],
    seed: int,
    folder: Path,
    cell: str = "declared",
) -> Iterable[dict[str, Any]]:
    """The runs with one error planted in the database, all on the same flights with the
    instruments of `cell`; mass properties and deflections are measured to 1 %, and wrong by as
    much."""
    craft = airframe(aircraft)
    here = Path(tempfile.mkdtemp(prefix=f"{craft.vehicle}-", dir=folder))
    numbers = [(seed * 5 + k) % 16 for k in range(max(flights))]
    where = (here / "all", folder / "flights")
    ready = prepared(
        craft, cell, numbers, seed, *where, measured_text(craft), measured_wrongly(craft, seed)
    )
    clean = {
        str(number): channels_of(craft, number, CELLS[cell], folder / "flights")
        for number in numbers
    }
    for kind in kinds:
        planted = PLANTED[kind]
        try:
            xml, bindings = planted.file(craft), planted.bindings_of(craft)
        except NotThere:
            continue
        wrong = craft.database(xml, bindings)
        if lacks(craft, wrong, planted.axis, [*clean.values()]) == 0.0:
            continue
        for n in flights:
            loop = looped(craft, ready, n, here / f"{n}-{kind.replace(' ', '-')}", xml, bindings)
            line: dict[str, Any] = {
                "aircraft": aircraft, "planted": kind, "cell": cell, "flights": n, "seed": seed,
                "loop_cpu": round(loop.cpu, 2), "refused": loop.refused, "folder": str(loop.folder),
            }  # fmt: skip
            if loop.found is not None:
                truth = {
                    finding["hypothesis"]: true_value(
                        finding["hypothesis"], craft, wrong, clean, CELLS[cell].step
                    )
                    for finding in loop.found["findings"]
                    if planted.names(finding["hypothesis"])
                }
                line |= power(loop.found, planted, truth) | {"levels": loop.found["levels"]}
                held = [clean[str(ready.flights[f])] for f in loop.found["flights"]["held_out"]]
                before = lacks(craft, wrong, planted.axis, held)
                if loop.candidate is not None and held:
                    after = lacks(craft, loop.candidate, planted.axis, held)
                    line["removed"] = 1.0 - after / before
                    three = (wrong, loop.candidate, craft.database())
                    line["errors"] = errors_of(loop, craft, three, planted.axis)
            yield line


def errors_of(
    loop: Loop, craft: Airframe, databases: Sequence[AeroDatabase], axis: str
) -> list[float]:
    """rms on a body axis that databases leave of a loop's held-out flights as they were measured.

    The whole database leaves what no correction can remove: there the errors of sensors and vehicle
    data are on top, which `lacks` does not know.
    """
    assert loop.found is not None
    access = access_workspace(str(loop.folder / "workspace"))
    source = StoredFlights(access, craft.vehicle, "campaign")
    left = []
    for database in databases:
        flights = [source.comparison(f, database) for f in loop.found["flights"]["held_out"]]
        left.append(rms(np.concatenate([f.residual(axis)[f.usable[axis]] for f in flights])))
    return left


def excess_removed(errors: Sequence[float]) -> float | None:
    """Share of the excess over what the whole database leaves that is gone: of errors before, after
    and of the whole database (`errors_of`). None where there was no excess.

    >>> excess_removed([5.0, 3.0, 3.0]), excess_removed([3.0, 3.0, 3.0])
    (1.0, None)
    """
    before, after, whole = errors
    if before <= whole:
        return None
    return 1.0 - float(np.sqrt(max(after**2 - whole**2, 0.0) / (before**2 - whole**2)))


def measured_wrongly(craft: Airframe, seed: int) -> Callable[[dict[str, Any]], dict[str, Any]]:
    """Log -> log, as wrong in mass properties and deflections as they were measured; the same of
    one seed."""

    def seen(log: dict[str, Any]) -> dict[str, Any]:
        key = [seed, zlib.crc32(craft.name.encode())]
        return as_measured(craft, log, np.random.default_rng(key))

    return seen


def run_outside(
    aircraft: str, kinds: Sequence[str], flights: Sequence[int], seed: int, folder: Path
) -> Iterable[dict[str, Any]]:
    """The runs of an aircraft that flies with a shape outside the library, against its own database.

    The folders are kept.
    """
    for kind in kinds:
        known, shape = airframe(aircraft), kind.replace(" ", "-").replace("^", "")
        here = Path(tempfile.mkdtemp(prefix=f"{known.vehicle}-{shape}-", dir=folder))
        try:
            flies = changed(aircraft, kind, here / "aircraft")
        except NotThere:
            continue
        craft = replace(known, flies=flies, shape=f"-{shape}")
        numbers = [(seed * 5 + k) % 16 for k in range(max(flights))]
        where = (here / "all", folder / "flights")
        try:
            ready = prepared(
                craft,
                "declared",
                numbers,
                seed,
                *where,
                measured_text(craft),
                measured_wrongly(craft, seed),
            )
        except RuntimeError as error:
            yield {"aircraft": aircraft, "outside": kind, "seed": seed, "refused": str(error)}
            continue
        for n in flights:
            loop = looped(craft, ready, n, here / f"{n}-flights")
            line = {"aircraft": aircraft, "outside": kind, "flights": n, "seed": seed}
            line |= _told(
                loop,
                ready,
                n,
                lambda f: f["shape"]["variables"] if f.get("shape") else f.get("variables"),
            )
            yield line


def _told(
    loop: Loop, ready: Prepared, n: int, last: Callable[[dict[str, Any]], Any]
) -> dict[str, Any]:
    """What a line says of a loop over the first n flights; `last`: of a finding, what stands at the
    end of its entry."""
    line: dict[str, Any] = {
        "consistency": dict(Counter(list(ready.verdicts.values())[:n])),
        "loop_cpu": round(loop.cpu, 2), "refused": loop.refused, "folder": str(loop.folder),
    }  # fmt: skip
    if loop.found is not None:
        line["added"] = loop.found["added"]
        line["findings"] = [
            [f["verdict"], f["hypothesis"], f.get("value"), f.get("ci95"), last(f)]
            for f in loop.found["findings"]
        ]
    return line


def run_misstated(
    aircraft: str, kinds: Sequence[str], flights: Sequence[int], seed: int, folder: Path
) -> Iterable[dict[str, Any]]:
    """The runs of an aircraft against its own database, where vehicle data are wrong.

    The folders are kept.
    """
    for kind in kinds:
        wrong = MISSTATED[kind]
        craft = wrong.craft(airframe(aircraft))
        here = Path(
            tempfile.mkdtemp(prefix=f"{craft.vehicle}-{kind.replace(' ', '-')}-", dir=folder)
        )
        numbers = [(seed * 5 + k) % 16 for k in range(max(flights))]
        where = (here / "all", folder / "flights")
        ready = prepared(craft, "declared", numbers, seed, *where, seen=wrong.log)
        for n in flights:
            loop = looped(craft, ready, n, here / f"{n}-flights")
            line = {"aircraft": aircraft, "misstated": kind, "flights": n, "seed": seed}
            line |= _told(loop, ready, n, lambda f: f["explanation_set"])
            if loop.found is not None:
                line["levels"] = loop.found["levels"]
            yield line


def power(
    found: Mapping[str, Any], planted: Planted, truth: Mapping[str, float | None]
) -> dict[str, Any]:
    """How one planted error was met: verdicts of what names it, whether it is in a set, whether the
    interval holds `truth`, what else was claimed. removed : the share by which the candidate comes
    nearer to the whole database along the held-out flights, to be filled in."""
    findings = found["findings"]
    right = [f for f in findings if planted.names(f["hypothesis"])]
    others = [f for f in findings if not planted.names(f["hypothesis"], near=True)]
    members = [name for f in findings for name in (f["hypothesis"], *f["explanation_set"])]
    differs = [
        "differs between flights"
        for entry in found["between_flights"]
        if entry["hypothesis"].startswith(planted.differs)
    ]
    differs += [
        "follows a condition"
        for level in found["levels"]
        for entry in level["conditions"]
        if any(planted.names(effect) for effect in entry["effects"])
    ]
    return {
        "named": [*(f["verdict"] for f in right), *differs],
        "in_set": bool(differs) or any(planted.names(name, near=True) for name in members),
        "covered": [
            f["ci95"][0] <= value <= f["ci95"][1]
            for f in right
            if f["ci95"] and (value := truth[f["hypothesis"]]) is not None
        ],
        "sizes": [[f["value"], *(f["ci95"] or ()), truth[f["hypothesis"]]] for f in right],
        "removed": None,
        "added": found["added"],
        "others": [[f["verdict"], f["hypothesis"]] for f in others],
    }


def report_power(lines: Sequence[dict[str, Any]]) -> str:
    """Per planted error: runs, confirmed, named with any verdict, in a set, covered, and the median
    share of what the database lacked on held-out flights that is gone where something right was
    added; the median and the least share of the excess that is (`excess_removed`)."""
    done = [line for line in lines if not line["refused"]]
    text = [f"{'planted':22} runs conf named inset covered  removed excess least"]
    for kind in ["", *sorted({line["planted"] for line in done})]:
        chosen = [line for line in done if not kind or line["planted"] == kind]
        covered = [hit for line in chosen for hit in line["covered"]]
        gone = sorted(
            line["removed"]
            for line in chosen
            if line["removed"] is not None and "confirmed" in line["named"]
        )
        excess = sorted(
            share
            for line in chosen
            if "confirmed" in line["named"] and line.get("errors")
            if (share := excess_removed(line["errors"])) is not None
        )
        counts = (
            len(chosen),
            sum("confirmed" in line["named"] for line in chosen),
            sum(bool(line["named"]) for line in chosen),
            sum(line["in_set"] for line in chosen),
        )
        median = f"{gone[len(gone) // 2]:.2f}" if gone else "-"
        least = f"{excess[len(excess) // 2]:.2f}   {excess[0]:.2f}" if excess else "-      -"
        share = f"{sum(covered)}/{len(covered)}"
        text.append(
            f"{kind or 'all':22} "
            + " ".join(f"{k:4}" for k in counts)
            + f"  {share:>7}  {median:7} {least}"
        )
    others = Counter(f"{v} {h}" for line in done for v, h in line["others"])
    text.append("beside: " + ", ".join(f"{name} {k}" for name, k in others.most_common(30)))
    return "\n".join(text)


def report(lines: Sequence[dict[str, Any]]) -> str:
    """Counts of wrong claims per cell and pooled, and which they were."""
    done = [line for line in lines if not line["refused"]]
    text = [f"{len(lines)} runs, {len(lines) - len(done)} refused; of {len(done)}:"]

    def counted(name: str, chosen: Sequence[dict[str, Any]]) -> str:
        wrong = [sum(bool(line[kind]) for line in chosen) for kind in CLASSES]
        return f"{name:28} {len(chosen):4}  " + "  ".join(f"{k:4}" for k in wrong)

    text.append(f"{'runs with a wrong claim':28} runs  " + "  ".join(k[:4] for k in CLASSES))
    text.append(counted("all", done))
    for key in ("cell", "aircraft", "flights"):
        for value in sorted({line[key] for line in done}, key=str):
            text.append(counted(f"{value}", [line for line in done if line[key] == value]))
    for kind in CLASSES:
        patterns = Counter(claim.split()[0] for line in done for claim in line[kind])
        text.append(f"{kind}: " + ", ".join(f"{name} {k}" for name, k in patterns.most_common()))
    return "\n".join(text)


def main(arguments: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--aircraft", nargs="+", default=list(CONDITIONS), choices=[*CONDITIONS])
    parser.add_argument("--cell", nargs="+", default=[], choices=[*CELLS])
    parser.add_argument("--planted", nargs="*", default=[], choices=[*PLANTED])
    parser.add_argument("--outside", nargs="*", default=[], choices=[*OUTSIDE])
    parser.add_argument("--misstated", nargs="*", default=[], choices=[*MISSTATED])
    parser.add_argument("--flights", nargs="+", type=int, default=[3, 6, 12])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--folder", type=Path, default=Path("campaign"))
    parser.add_argument("--report", action="store_true")
    chosen = parser.parse_args(arguments)
    if not chosen.report:
        warnings.simplefilter("ignore")
        chosen.folder.mkdir(parents=True, exist_ok=True)
        for aircraft in chosen.aircraft:
            common = (chosen.flights, chosen.seed, chosen.folder)
            if chosen.planted:
                for cell in chosen.cell or ["declared"]:
                    lines = run_planted(aircraft, chosen.planted, *common, cell)
                    _append(chosen.folder, "power", lines)
                continue
            if chosen.outside:
                _append(chosen.folder, "outside", run_outside(aircraft, chosen.outside, *common))
                continue
            if chosen.misstated:
                lines = run_misstated(aircraft, chosen.misstated, *common)
                _append(chosen.folder, "misstated", lines)
                continue
            for cell in chosen.cell or CELLS:
                _append(chosen.folder, "results", run_null(aircraft, cell, *common))
    for name, summary in (("results", report), ("power", report_power)):
        place = chosen.folder / f"{name}.jsonl"
        if place.exists():
            lines = place.read_text(encoding="utf-8").splitlines()
            print(summary([json.loads(line) for line in lines]))


def _append(folder: Path, name: str, lines: Iterable[dict[str, Any]]) -> None:
    for line in lines:
        with (folder / f"{name}.jsonl").open("a", encoding="utf-8") as file:
            file.write(json.dumps(line) + "\n")


if __name__ == "__main__":
    main()
