"""`make bench`: the product beside what a user would use instead, as ratios within one run. Nothing
here asserts; the ratios are appended to docs/reference/benchmarks.md.

Each measurement is a process of its own; time and peak memory are taken inside it, after its
imports, so that starting an interpreter counts for neither. Memory is the peak of the whole
process.
"""

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from tests.bench.closed_loop import closed_loop
from tests.bench.commands import commands
from tests.bench.console import console
from tests.bench.estimation import estimation
from tests.bench.generated_log import DATABASE, NAME, VEHICLE, write_log
from tests.bench.online import online
from tests.bench.record import RECORD, append
from tests.bench.running import running
from tests.bench.simulation import simulation
from tests.bench.where_time_goes import where_time_goes

MEASURED = """
import json, os, resource, sys, time
{imports}
start = time.perf_counter()
{body}
seconds = time.perf_counter() - start
def peak(process):  # its own, or that of a process that works on a flight for it
    with open(f"/proc/{{process}}/status") as status:
        peaks = [next(int(line.split()[1]) for line in status if line.startswith("VmHWM")) / 1024]
    for thread in os.listdir(f"/proc/{{process}}/task"):
        with open(f"/proc/{{process}}/task/{{thread}}/children") as children:
            for child in children.read().split():
                if "tasks.workers.server" in open(f"/proc/{{child}}/cmdline").read():
                    peaks.append(peak(child))
    return max(peaks)
try:  # ru_maxrss also holds the peak of the process that started this one
    memory = peak(os.getpid())
except OSError:
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps({{"seconds": seconds, "megabytes": memory, "answer": globals().get("answer")}}))
"""


def measure(imports: str, body: str) -> dict[str, Any]:
    """Seconds and peak megabytes of `body` in a process of its own, and what it calls `answer`."""
    done = subprocess.run(
        [sys.executable, "-c", MEASURED.format(imports=imports, body=body)],
        capture_output=True,
        text=True,
    )
    if done.returncode:
        raise SystemExit(done.stderr)
    result: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return result


def per_flight_run(
    folder: Path, seconds: float, runs: int, ways: Sequence[str] = ("direct", "auto")
) -> dict[str, dict[str, float]]:
    """The whole per-flight run of a generated log beside pyulog's parsing of the same file.

    Returns what was run -> its median seconds and megabytes, and both as ratios to pyulog's.
    """
    log = folder / f"flight-{seconds:g}.ulg"
    write_log(log, seconds)
    print(
        f"per-flight run of a log of {seconds:g} s, {log.stat().st_size / 1e6:.0f} MB, {runs} runs,"
        " medians"
    )
    names = {"direct": "aerodb, direct", "auto": "aerodb, Prefect"}
    rows: dict[str, list[dict[str, float]]] = {
        "pyulog parses": [],
        **{names[how]: [] for how in ways},
    }
    for number in range(runs):
        rows["pyulog parses"].append(measure("from pyulog import ULog", f"ULog({str(log)!r})"))
        for how in ways:
            workspace = folder / f"workspace-{seconds:g}-{how}-{number}"
            imports, body = _ingest(workspace, log, how)
            rows[names[how]].append(measure(imports, body))
            shutil.rmtree(workspace)
    log.unlink()
    base = {
        key: statistics.median(r[key] for r in rows["pyulog parses"])
        for key in ("seconds", "megabytes")
    }
    found = {}
    for name, results in rows.items():
        middle = {key: statistics.median(r[key] for r in results) for key in base}
        ratios = {key: middle[key] / base[key] for key in base}
        found[name] = middle | {f"{key} ratio": value for key, value in ratios.items()}
        print(
            f"  {name:16} {middle['seconds']:7.2f} s ({ratios['seconds']:.2f} x)"
            f" {middle['megabytes']:7.0f} MB ({ratios['megabytes']:.2f} x)"
        )
    return found


def _ingest(workspace: Path, log: Path, how: str) -> tuple[str, str]:
    imports = f"""
from pathlib import Path
from aerodb.flows.flight import flight_flow
from aerodb.flows.importing import import_flow
from aerodb.flows.run import run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from aerodb.tasks.workers import confined, start_workers
from aerodb.tasks.steps import check_consistency, compare_with_version, reconstruct, store_log
start_workers([".ulg"])  # as the command line does: process start is not counted
workspace = Workspace.open(Path({str(workspace)!r}))
Catalogue.open(workspace.catalogue).add_vehicle({NAME!r}, {VEHICLE!r})
handbook = workspace.root / "handbook.toml"
handbook.write_text({DATABASE!r})
run_flow(import_flow, {{"file": str(handbook), "vehicle": {NAME!r}, "bindings": {{}}}}, workspace, "direct")
def nothing(steps, *, workspace, run):
    return None
nothing.role = "read"
confined(len, "", workspace=str(workspace.root), flight="", what="nothing", where="")  # waits until it is ready
run_flow(nothing, {{}}, workspace, {how!r})  # starts Prefect's own server where Prefect runs: process start is not counted
"""
    parameters = {"logs": [str(log)], "vehicle": NAME}
    body = (
        f"outcome = run_flow(flight_flow, {parameters!r}, workspace, {how!r})[0]\nassert"
        " outcome['comparison']['key'], outcome"
    )
    return imports, body


def _measured_data() -> Path:
    return Path(
        os.environ.get("AERODB_TEST_DATA", Path(__file__).resolve().parents[3] / "shared" / "data")
    )


HL20 = """
from pathlib import Path
import numpy as np
from aerodb.exchange.daveml.reader import import_daveml
database = import_daveml(Path({path!r}).read_bytes(), name="HL-20", bindings={{"DLG": "90*delta_landing_gear"}})
rng = np.random.default_rng(1)
def points(n):
    ranges = {{"V": (30, 300), "alpha": (-0.1, 0.5), "mach": (0.3, 4), "height_above_ground": (1, 15)}}
    return {{name: rng.uniform(*ranges.get(name, (-0.5, 0.5)), n) for name in database.inputs}}
"""
HL20_OURS = (
    "at = points({n})\ndatabase.predict(points(10))  # the compiled loop is loaded once per process"
)
HL20_SCIPY = """
from scipy.interpolate import RegularGridInterpolator
from aerodb.tables.expression import TableCall
calls = [v.expression.table for v in database.variables.values() if isinstance(v.expression, TableCall)]
grids = {{name: RegularGridInterpolator(database.tables[name].breakpoints, database.tables[name].values) for name in set(calls)}}
at = {{}}
for name in grids:
    axes = database.tables[name].breakpoints
    key = tuple(axis.tobytes() for axis in axes)  # tables with the same breakpoints are asked at the same points
    at[name] = at[key] = at[key] if key in at else np.column_stack([rng.uniform(axis[0], axis[-1], {n}) for axis in axes])
"""


def coefficients(points: int) -> None:
    """All six HL-20 coefficients, build-up included, beside their look-ups alone through scipy, one
    after the other."""
    file = _measured_data() / "daveml" / "HL20_aero.dml"
    if not file.is_file():
        print("HL-20 coefficients: not measured, the file is not here (set AERODB_TEST_DATA)")
        return
    setup = HL20.format(path=str(file))
    ours = measure(setup + HL20_OURS.format(n=points), "database.predict(at)")
    theirs = measure(
        setup + HL20_SCIPY.format(n=points), "for name in calls:\n    grids[name](at[name])"
    )
    print(f"HL-20, six coefficients at {points} points")
    print(
        f"  scipy, its 241 look-ups one by one {theirs['seconds']:7.2f} s"
        f" {theirs['megabytes']:7.0f} MB"
    )
    ratio = theirs["seconds"] / ours["seconds"]
    print(
        f"  aerodb, predict                    {ours['seconds']:7.2f} s {ours['megabytes']:7.0f} MB"
        f" ({ratio:.1f} times faster)"
    )


ATTAS = """
import os
os.environ["NUMBA_CACHE_DIR"] = {cache!r}
from pathlib import Path
from aerodb.consistency.output_error.reconstruction import reconstruct
from tests.support.consistency_records import ATTAS_BIASES, attas
from tests.support.plain_reconstruction import plain_biases
records = [attas(Path({folder!r}) / f"fAttas{{name}}.mat") for name in ("Elv1", "Ail1", "Rud1")]
def ours():
    result = reconstruct(records, ATTAS_BIASES, initial=())
    return [result[name].value for name in ATTAS_BIASES], [result[name].standard_error for name in ATTAS_BIASES]
"""


def reconstruction() -> dict[str, float]:
    """ATTAS: six biases over three manoeuvres, beside what an engineer writes first; cold counts
    compilation and first import. Returns its figure for the record, if it can be measured."""
    folder = _measured_data() / "attas"
    if not folder.is_dir():
        print("ATTAS reconstruction: not measured, the records are not here (set AERODB_TEST_DATA)")
        return {}
    with tempfile.TemporaryDirectory() as cache:
        setup = ATTAS.format(cache=cache, folder=str(folder))
        subprocess.run(
            [sys.executable, "-m", "aerodb.flows.compile_kernels"],
            env=os.environ | {"NUMBA_CACHE_DIR": cache},
            check=True,
        )
        installed = measure(setup, "answer = ours()")
    with tempfile.TemporaryDirectory() as cache:
        setup = ATTAS.format(cache=cache, folder=str(folder))
        cold = measure(setup, "answer = ours()")
        cached = measure(setup, "answer = ours()")
        warm = measure(setup + "ours()\n", "for _ in range(10):\n    answer = ours()")
        plain = measure(setup, "answer = plain_biases(records).tolist()")
    biases, errors = warm["answer"]
    apart = max(
        abs(a - b) / error for a, b, error in zip(plain["answer"], biases, errors, strict=True)
    )
    print(f"ATTAS, six biases over three manoeuvres: answers {apart:.1g} standard errors apart")
    print(f"  plain numpy loop, Gauss-Newton {plain['seconds']:8.2f} s")
    for name, seconds in (
        ("compiling", cold["seconds"]),
        ("after make install", installed["seconds"]),
        ("compiled before", cached["seconds"]),
        ("warm", warm["seconds"] / 10),
    ):
        print(
            f"  aerodb, {name:22} {seconds:8.3f} s ({plain['seconds'] / seconds:.1f} times faster)"
        )
    return {"uncompiled": cold["seconds"], "installed": installed["seconds"]}


HOUR = """
import numpy as np
from aerodb.consistency.whole_flight import make_consistent
from aerodb.flight import Flight
from aerodb.vehicle import parse_vehicle
from tests.support.simulated_path import DENSITY, simulated
def flight(seconds):
    planted = {{"az_bias": 0.1, "q_bias": 0.002, "alpha_bias": 0.02, "alpha_delay": 0.03, "wind_north": 7.0, "V_scale": 0.02}}
    record = simulated(np.random.default_rng(3), planted, seconds=seconds, step=0.01)
    channels = dict(zip(("ax", "ay", "az", "p", "q", "r"), record.inputs.T, strict=True)) | dict(record.outputs)
    time = 0.01 * np.arange(len(record.inputs))
    return Flight("hour", "hour", time, {{**channels, "rho": np.full(len(time), DENSITY)}})
vehicle = parse_vehicle({vehicle!r})
make_consistent(flight(30.0), vehicle)  # compiled code is loaded once per process
whole = flight({seconds})
"""


def consistency_step(folder: Path, seconds: float) -> dict[str, float]:
    """The consistency step of a flight at 100 Hz beside the parsing of a log of that length; and of
    half of it. Returns the figure for the record: the former."""
    log = folder / "consistency.ulg"
    write_log(log, seconds)
    parsed = measure("from pyulog import ULog", f"ULog({str(log)!r})")["seconds"]
    print(
        f"consistency step of a flight of {seconds:g} s at 100 Hz beside parsing a log of"
        f" {log.stat().st_size / 1e6:.0f} MB"
    )
    print(f"  pyulog parses    {parsed:7.2f} s")
    log.unlink()
    body = (
        "made = make_consistent(whole, vehicle)\nanswer = [len(made.document['estimates']),"
        " made.verdict.word]"
    )
    for part in (0.5, 1.0):
        done = measure(HOUR.format(vehicle=VEHICLE, seconds=part * seconds), body)
        count, word = done["answer"]
        cost = (
            f"{done['seconds']:7.2f} s ({done['seconds'] / parsed:.2f} x)"
            f" {done['megabytes']:7.0f} MB"
        )
        print(f"  aerodb, {part * seconds:6g} s {cost}, {count} estimates, {word}")
    return {"consistency": done["seconds"] / parsed}


#: What can be run by itself.
PARTS = (
    "coefficients",
    "reconstruction",
    "consistency",
    "flight",
    "loop",
    "simulation",
    "estimation",
    "running",
    "online",
    "console",
    "commands",
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=3600.0, help="length of the generated log")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument(
        "--points", type=int, default=1_000_000, help="points at which coefficients are evaluated"
    )
    parser.add_argument(
        "--stored",
        type=int,
        nargs="+",
        default=[10, 100, 1000],
        help="flights stored beside a night's new one",
    )
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS, help="parts to run")
    parser.add_argument(
        "--no-record", action="store_true", help="leave docs/reference/benchmarks.md as it is"
    )
    parser.add_argument(
        "--profile", action="store_true", help="say where the time of a per-flight run goes instead"
    )
    options = parser.parse_args()
    if options.profile:
        with tempfile.TemporaryDirectory() as name:
            lengths = (options.seconds, options.seconds / 6.0)
            where_time_goes(Path(name), lengths, measure, _ingest, not options.no_record)
        return
    figures: dict[str, float] = {}
    if "coefficients" in options.only:
        coefficients(options.points)
    if "reconstruction" in options.only:
        figures |= reconstruction()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if "consistency" in options.only:
            figures |= consistency_step(folder, options.seconds)
        if "flight" in options.only:
            hour = per_flight_run(folder, options.seconds, options.runs)
            short = per_flight_run(folder, options.seconds / 6.0, options.runs, ("direct",))
            figures |= {
                "pyulog": hour["pyulog parses"]["seconds"],
                "hour": hour["aerodb, direct"]["seconds ratio"],
                "hour memory": hour["aerodb, direct"]["megabytes ratio"],
                "hour Prefect": hour["aerodb, Prefect"]["seconds ratio"],
                "ten minutes": short["aerodb, direct"]["seconds ratio"],
            }
        if "loop" in options.only:
            figures |= closed_loop(folder, measure)
        if "simulation" in options.only:
            figures |= simulation()
        if "online" in options.only:
            online()
        if "console" in options.only:
            console(folder, options.seconds)
        if "commands" in options.only:
            commands(folder)
        if "estimation" in options.only:
            figures |= estimation(_measured_data())
        if "running" in options.only:
            running(folder, tuple(options.stored))
    if figures and not options.no_record:
        print(f"appended to {RECORD}:\n{append(figures)}")


if __name__ == "__main__":
    main()
