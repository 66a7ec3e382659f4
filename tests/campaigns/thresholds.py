"""What each threshold decides: every deciding constant times .8 and 1.25, over reduced campaigns.

``python -m tests.campaigns.thresholds`` varies the constants of `DECIDING`, each in a process of its
own that changes it while the product is imported, and compares outcomes with those of the code as
it is (`threshold_cases`). Lines of JSON are appended to a file, so that an interrupted run goes on.
``--only suspicions`` takes one package; ``--write`` makes docs/reference/thresholds.md from the
file; ``--compare FILE`` prints how outcomes differ from those of another commit, that it left in
``outcomes.json``.
"""

import argparse
import json
import multiprocessing
import os
import subprocess
import sys
import time
import traceback
import warnings
from collections.abc import Mapping, Sequence
from contextlib import suppress
from datetime import date
from importlib import import_module
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from tests.campaigns.constants import (
    NumericConstant,
    change_on_import,
    numeric_constants,
    read_at_import,
    report_on_import,
)

ROOT = Path(__file__).parents[2]
PAGE = ROOT / "docs" / "reference" / "thresholds.md"
FACTORS = (0.8, 1.25)
#: How many of the constants that change most decisions are named at the top of the page.
MOST = 12
#: Package -> parts of it in which verdicts, suspicions, findings and outcomes of the gate are
#: decided, and the parts of the campaign that run it.
DECIDING: Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "support": (
        ("false_alarms", "shares"),
        ("ingest", "beside", "conditioning", "consistency", "loop"),
    ),
    "conditioning": (("",), ("conditioning", "ingest", "beside", "consistency")),
    "suspicions": (("",), ("ingest", "beside")),
    "consistency": (
        ("calibration", "corrected", "navigation_sources", "outlook", "plan", "records", "sensor_noise",
         "verdict", "output_error.installation", "output_error.posterior",
         "output_error.reconciliation", "sensors.expected", "sensors.whiteness"),
        ("consistency",),
    ),
    "tracing": (
        ("decision", "estimates.per_flight", "estimates.significance", "evidence.shape_misfit"),
        ("loop",),
    ),
    "loop": (("",), ("loop",)),
    "increments": (("",), ("loop",)),
}  # fmt: skip
#: Constants of these modules that decide nothing -> why.
NOT_DECIDING: Mapping[str, str] = {
    "conditioning.manoeuvres.DEGREE": "unit",
    "suspicions.hypotheses.DEGREE": "unit",
    "suspicions.database._SLUG_FOOT": "unit",
    "suspicions.loads._POUND_FORCE": "unit",
    "tracing.decision.between_flights._SHOWN": "units of what is shown",
    "increments.chosen_knots._DIGITS": "digits of a text",
    "increments.derivatives._LISTED": "length of a list",
    "increments.derivatives._SAMPLES": "size of a computation",
    "increments.gate._LISTED": "length of a list",
    "increments.gate._ROUNDING": "rounding",
    "loop.levels._SAID": "length of a list",
    "tracing.decision.next_flight.MOST": "length of a list",
    "loop.noise_floor._MOST": "size of a computation",
    "loop.angle_errors._DRAWS": "random draws",
    "loop.noise_floor._DRAWS": "random draws",
    "consistency.corrected.DRAWS": "random draws",
    "consistency.corrected.MOST_DRAWN": "random draws",
    "tracing.decision.functions.RANK": "rounding",
    "tracing.decision.functions._STANDS": "rounding",
    "tracing.decision.functions.TRACE": "rounding",
    "tracing.decision.refinement._TRACE": "rounding",
    "tracing.decision.joint_model._ITERATIONS": "iterations",
    "tracing.estimates.per_flight.KNOWN": "numerical infinity",
    "consistency.plan.NO_WEIGHT": "numerical infinity",
    "suspicions.in_flight.HUGE": "numerical infinity",
    "suspicions.derivatives._POINTS": "size of a computation",
    "tracing.evidence.shape_misfit._POINTS": "size of a computation",
    "loop.stall_windows._POINTS": "size of a computation",
    "conditioning.duplicates.MOST_PAIRS": "size of a computation",
    "conditioning.duplicates.MOST_OFFSETS": "size of a computation",
    "conditioning.duplicates._SINGLE_PRECISION": "rounding",
    "increments.acceptable._LISTED": "length of a list",
    "increments.gate._NAMED": "length of a list",
    "increments.parameters._SETTLED": "iterations",
    "increments.parameters._MOST": "iterations",
    "increments.parameters._SAME": "iterations",
    "increments.parameters._MOST_WEIGHTS": "iterations",
    "increments.parameters._ROUNDING": "rounding",
    "increments.parameters._STILL": "rounding",
    "increments.estimate._INDEPENDENT": "rounding",
    "increments.estimate.LENGTHENINGS": "iterations",
    "suspicions.begin.LEFT": "rounding",
    "conditioning.frozen.ROUNDING": "rounding",
    "suspicions.rotor_order._STEP": "step of a difference",
    "suspicions.rotors._STEP": "step of a difference",
    "increments.unmeasured_air._STEP": "step of a difference",
    "suspicions.over_ground._UNITS": "units",
    "suspicions.over_ground.STEP": "grid",
    "suspicions.over_ground._SECTORS": "grid",
    "suspicions.damping._AGO": "grid",
    "suspicions.angles._DELAYS": "grid",
    "suspicions.angles._FILTERS": "grid",
    "suspicions.sized_faults.STEP": "grid",
    "suspicions.sized_faults.STRETCHES": "grid",
    "suspicions.hypotheses.LONGEST": "size of a computation",
    "conditioning.drifts.MOST_WINDOWS": "size of a computation",
    "conditioning.delay.SAMPLES_PER_PERIOD": "grid",
    "conditioning.duplicates.HEIGHT_STEP": "grid",
    "conditioning.duplicates.TIME_STEP": "grid",
    "loop.consider._COPIES": "random draws",
    "loop.rounds.MOST_ROUNDS": "iterations",
    "consistency.records._SAME": "rounding",
    "consistency.records._LEVEL": "rounding",
    "consistency.plan._START": "numerical infinity",
    "consistency.plan._WINDY": "numerical infinity",
    "tracing.decision.functions._GROUPS": "size of a computation",
    "tracing.decision.functions._TRIED": "size of a computation",
    "tracing.decision.functions._RIDGE": "rounding",
    "tracing.decision.few_flights._TRIED": "size of a computation",
    "tracing.decision.ridge_model._GROUPS": "size of a computation",
    "tracing.decision.ridge_model._RIDGES": "grid",
    "tracing.decision.refinement.RIDGES": "grid",
}


def deciding(root: Path = ROOT, only: Sequence[str] = tuple(DECIDING)) -> list[NumericConstant]:
    """The constants that decide something, of the packages `only`."""
    modules = []
    for package in only:
        for part in DECIDING[package][0]:
            place = root / "aerodb" / package / part.replace(".", "/")
            files = sorted(place.rglob("*.py")) if place.is_dir() else [place.with_suffix(".py")]
            modules += [
                ".".join(file.relative_to(root).with_suffix("").parts)
                for file in files
                if file.stem != "__init__"
            ]
    return [each for each in numeric_constants(root, modules) if each.id not in NOT_DECIDING]


def package_of(constant: NumericConstant) -> str:
    """The package of a constant below `aerodb`."""
    return constant.module.split(".")[1]


def differences(
    before: Mapping[str, Mapping[str, Any]], after: Mapping[str, Mapping[str, Any]]
) -> tuple[int, int, float, list[str]]:
    """How outcomes of the same cases differ: decisions changed, decisions, the largest relative
    change of a value, and which decisions changed."""
    changed, total, largest, which = 0, 0, 0.0, []
    for case, outcome in before.items():
        other = after[case]
        for name in sorted(outcome.keys() | other.keys()):
            one, two = outcome.get(name), other.get(name)
            if isinstance(one, str) or isinstance(two, str):
                total += 1
                if one != two:
                    changed += 1
                    which.append(f"{case}: {name}: {one} -> {two}")
            elif one is not None and two is not None and one != two:
                largest = max(largest, abs(two - one) / max(abs(one), 1e-12))
    return changed, total, largest, which


class Runner:
    """Runs cases in processes that fork from this one, in which other libraries are loaded and the
    product is not."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.context = folder, multiprocessing.get_context("fork")
        for name in self._answer(_loaded):
            with suppress(Exception):
                import_module(name)

    def _answer(self, function: Any, *arguments: Any) -> Any:
        here, there = self.context.Pipe(duplex=False)
        process = self.context.Process(target=_child, args=(there, function, arguments))
        process.start()
        there.close()
        try:
            kind, content = here.recv()
        except EOFError:
            kind, content = "failed", "the process ended"
        process.join()
        if kind == "failed":
            raise RuntimeError(content)
        return content

    def prepare(self, records: Path | None) -> None:
        self._answer(_prepare, self.folder, records)

    def reads(self, parts: Sequence[str]) -> tuple[dict[str, dict[str, Any]], dict[str, list[str]]]:
        """Case -> outcome, and case -> ids of the constants that it reads."""
        answer: tuple[dict[str, dict[str, Any]], dict[str, list[str]]]
        answer = self._answer(_reading, self.folder, parts)
        return answer

    def varied(
        self, constant: NumericConstant, factor: float, parts: Sequence[str], names: Sequence[str]
    ) -> dict[str, dict[str, Any]]:
        """Case -> outcome of these cases with a constant scaled."""
        answer: dict[str, dict[str, Any]]
        answer = self._answer(_varying, self.folder, constant, factor, parts, names)
        return answer


def _child(there: Connection, function: Any, arguments: tuple[Any, ...]) -> None:
    warnings.simplefilter("ignore")
    try:
        there.send(("done", function(*arguments)))
    except BaseException:  # also an exit of a command: the parent says which variation it was
        there.send(("failed", traceback.format_exc()))


def _loaded() -> list[str]:
    import_module("tests.campaigns.threshold_cases")
    own = ("aerodb", "tests", "__main__")
    return [name for name in list(sys.modules) if name.split(".")[0] not in own]


def _prepare(folder: Path, records: Path | None) -> None:
    import_module("tests.campaigns.threshold_cases").prepare(folder, records)


def _reading(
    folder: Path, parts: Sequence[str]
) -> tuple[dict[str, dict[str, Any]], dict[str, list[str]]]:
    seen = report_on_import(ROOT, deciding())
    module = import_module("tests.campaigns.threshold_cases")
    outcomes, reads = {}, {}
    for case in module.cases(folder, parts):
        seen.clear()
        outcomes[f"{case.part}: {case.name}"] = case.outcome()
        reads[f"{case.part}: {case.name}"] = sorted(seen)
    return outcomes, reads


def _varying(
    folder: Path, constant: NumericConstant, factor: float, parts: Sequence[str],
    names: Sequence[str],
) -> dict[str, dict[str, Any]]:  # fmt: skip
    change_on_import(constant, factor)
    module = import_module("tests.campaigns.threshold_cases")
    chosen = set(names)
    outcomes = {}
    for case in module.cases(folder, parts):
        name = f"{case.part}: {case.name}"
        if name in chosen:
            try:
                outcomes[name] = case.outcome()
            except Exception as error:  # a decision as well: the product refuses
                outcomes[name] = {"raised": type(error).__name__}
    return outcomes


def vary(runner: Runner, only: Sequence[str], lines: Path) -> None:
    """Append a line per constant and factor; what the file holds already is not run again."""
    done = {(line["constant"], line["source"], line["factor"]) for line in _lines(lines)}
    for package in only:
        parts = DECIDING[package][1]
        outcomes, reads = runner.reads(parts)
        _keep_outcomes(runner.folder, outcomes)
        for constant in deciding(only=[package]):
            everywhere = read_at_import(ROOT, constant)
            names = [case for case, ids in reads.items() if everywhere or constant.id in ids]
            for factor in FACTORS:
                if (constant.id, constant.source, factor) in done:
                    continue
                start = time.time()
                line: dict[str, Any] = {
                    "constant": constant.id, "source": constant.source, "factor": factor,
                    "cases": len(names), "commit": _commit(),
                }  # fmt: skip
                if names:
                    try:
                        after = runner.varied(constant, factor, parts, names)
                    except RuntimeError as error:
                        line["failed"] = str(error).strip().splitlines()[-1]
                    else:
                        before = {name: outcomes[name] for name in names}
                        changed, total, largest, which = differences(before, after)
                        line |= {
                            "changed": changed, "decisions": total,
                            "value": largest, "which": which[:8],
                        }  # fmt: skip
                line["seconds"] = round(time.time() - start, 1)
                with lines.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(line) + "\n")


def _lines(path: Path) -> list[dict[str, Any]]:
    if not path.exists():
        return []
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def _keep_outcomes(folder: Path, outcomes: Mapping[str, Any]) -> None:
    place = folder / "outcomes.json"
    held = json.loads(place.read_text(encoding="utf-8")) if place.exists() else {}
    place.write_text(json.dumps({**held, **outcomes}, indent=1), encoding="utf-8")


def page(
    lines: Sequence[Mapping[str, Any]], constants: Sequence[NumericConstant], former: str
) -> str:
    """The page of the reference, from the lines of a run and the constants as they are.

    former : the page as it was, from which rows stay whose constant was not run since.
    """
    latest = {(line["constant"], line["source"], line["factor"]): line for line in lines}
    kept = rows(former)
    commits = sorted({line["commit"] for line in lines if "commit" in line})
    said = [line for line in former.splitlines() if line.startswith("Run: ")]
    run = f"Run: {date.today().isoformat()}, commit {', '.join(commits)}." if commits else ""
    text = []
    moved: dict[str, int] = {}
    for package in DECIDING:
        own = [each for each in constants if package_of(each) == package]
        text.append(f"## {package} ({len(own)})\n")
        text.append("| Constant | Value | Unit | Cases | Changed at .8 | at 1.25 | Reason |")
        text.append("| --- | --- | --- | --- | --- | --- | --- |")
        for each in own:
            found = [latest.get((each.id, each.source, factor)) for factor in FACTORS]
            if None in found:
                measured = kept.get((each.id, _cell(each.source)), ("", *2 * ["not run"]))
            else:
                measured = (str(found[0]["cases"]), *map(_moved, found))  # type: ignore[index]
            counts = [int(cell.split()[0]) for cell in measured[1:] if " of " in cell]
            moved |= {each.id: max(counts)} if counts else {}
            cells = (f"`{each.id}`", f"`{each.source}`", each.unit or "-", *measured,
                     each.comment or "-")  # fmt: skip
            text.append("| " + " | ".join(_cell(cell) for cell in cells) + " |")
        text.append("")
    most = sorted((name for name in moved if moved[name]), key=lambda name: -moved[name])
    head = _HEAD.format(
        count=len(constants),
        run=run or (said[0] if said else "Run: never."),
        read=len(moved),
        still=sum(not count for count in moved.values()),
        most="\n".join(f"- `{name}` ({moved[name]})" for name in most[:MOST]) or "- none",
    )
    return "\n".join([head, *text])


def rows(text: str) -> dict[tuple[str, str], tuple[str, ...]]:
    """Id and value of each constant on the page -> cases, changed at each factor."""
    found = {}
    for line in text.splitlines():
        cells = line.removeprefix("| ").split(" | ")
        if line.startswith("| `") and len(cells) > 5:
            found[cells[0].strip("`"), cells[1].strip("`")] = tuple(cells[3:6])
    return found


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def _moved(line: Mapping[str, Any]) -> str:
    """What a variation changed: decisions of all, and the largest relative change of a value."""
    if not line["cases"]:
        return "not read"
    if "failed" in line:
        return "fails"
    value = f", {100 * line['value']:.1g} %" if line["value"] > 0.0005 else ""
    return f"{line['changed']} of {line['decisions']}{value}"


def _commit() -> str:
    told = subprocess.run(
        ["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True
    )
    return told.stdout.strip()


_HEAD = """\
# Thresholds

{count} constants decide what a flight, a finding or a version is called.
Each was multiplied by .8 and by 1.25, alone, and the reduced campaigns were run again:

    python -m tests.campaigns.thresholds          # about an hour of one core; goes on where it ended
    python -m tests.campaigns.thresholds --write  # this page

{run}
On 2026-11-29 there were 317 of them. Shares that decide are levels of `support.shares` since: HALF,
SMALL and others move all that use them at once. Grids, roundings and sizes of computations are not listed.

The campaigns read {read}; {still} of these change no decision at either factor.
Most decisions change with:

{most}

- A case is one flight, one pair of flights or one closed loop; *cases* counts those in which the constant is read.
- *Changed* counts decisions that differ, of all decisions of these cases, then the largest relative change of a reported value.
- *not read*: no case of the reduced campaigns comes to the constant; the full campaigns may.
- A constant of several numbers is scaled as a whole; whole numbers change by one at least.
- A share of .8 or more times 1.25 asks for all or more, and a factor of 1.1 times .8 for none. What they guard is then never, or always, said.
- Cases of `ingest` are right flights and corrupted ones; `beside` compares them with the database of their vehicle.
- Cases of `conditioning` have wild points, late channels and copies; cases of `consistency` have sensor offsets.
- Cases of `loop` are closed loops with nothing or one error planted, with the gate asked about each candidate.
"""


def main(arguments: Sequence[str] | None = None) -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="+", default=list(DECIDING), choices=[*DECIDING])
    parser.add_argument("--folder", type=Path, default=Path("thresholds"))
    parser.add_argument("--write", action="store_true", help="write the page")
    parser.add_argument("--compare", type=Path, help="outcomes.json of another commit")
    asked = parser.parse_args(arguments)
    lines = asked.folder / "lines.jsonl"
    if asked.compare or not asked.write:
        runner = Runner(asked.folder)
        if not (asked.folder / "pairs.pkl").exists():
            records = Path(os.environ.get("AERODB_TEST_DATA", ROOT.parent / "shared" / "data"))
            runner.prepare(records if records.exists() else None)
        if asked.compare:
            parts = dict.fromkeys(part for name in asked.only for part in DECIDING[name][1])
            outcomes, _ = runner.reads(tuple(parts))
            _compare(json.loads(asked.compare.read_text(encoding="utf-8")), outcomes)
            return
        vary(runner, asked.only, lines)
    if asked.write:
        former = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
        PAGE.write_text(page(_lines(lines), deciding(), former), encoding="utf-8")


def _compare(before: Mapping[str, Any], after: Mapping[str, Any]) -> None:
    common = {name: before[name] for name in after if name in before}
    changed, total, largest, which = differences(common, after)
    print("\n".join(which))
    print(f"{changed} of {total} decisions differ; values by {100 * largest:.2g} % at most")


if __name__ == "__main__":
    main()
