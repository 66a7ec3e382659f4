"""`make bench`: the product beside what a user would use instead, as ratios within one run. Nothing here asserts.

Each measurement is a process of its own; time and peak memory are taken inside it, after its imports, so that starting an
interpreter counts for neither. Memory is the peak of the whole process.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path

VEHICLE = """
name = "bench"
[reference]
area = 0.6
chord = 0.2
span = 3.0
[points]
moment_reference = [-0.5, 0.0, 0.0]
imu = [-0.4, 0.0, 0.05]
[mass]
mass = 6.0
cg = [-0.5, 0.0, 0.0]
Ixx = 0.8
Iyy = 0.6
Izz = 1.2
Ixz = 0.05
[surfaces.elevator]
limits = ["-25 deg", "25 deg"]
scale = "25 deg"
[surfaces.aileron]
limits = ["-25 deg", "25 deg"]
scale = "25 deg"
[surfaces.rudder]
limits = ["-25 deg", "25 deg"]
scale = "25 deg"
"""

DATABASE = """
name = "handbook"
[reference]
area = 0.6
chord = 0.2
span = 3.0
moment_reference = [-0.5, 0.0, 0.0]
[derivatives.CX]
"1" = -0.03
[derivatives.CZ]
"1" = -0.3
q_hat = -6.0
delta_elevator = -0.4
[derivatives.Cm]
q_hat = -12.0
delta_elevator = -1.1
"""

MEASURED = """
import json, resource, sys, time
{imports}
start = time.perf_counter()
{body}
seconds = time.perf_counter() - start
print(json.dumps({{"seconds": seconds, "megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024}}))
"""


def measure(imports: str, body: str) -> dict[str, float]:
    """Seconds and peak megabytes of `body` in a process of its own."""
    done = subprocess.run([sys.executable, "-c", MEASURED.format(imports=imports, body=body)], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(done.stderr)
    result: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return result


def per_flight_run(folder: Path, seconds: float, runs: int) -> None:
    """The whole per-flight run of a generated one-hour log beside pyulog's parsing of the same file."""
    from storage.writers.generated import generated_topics
    from storage.writers.ulog import write_ulog

    log = folder / "hour.ulg"
    write_ulog(log, generated_topics(seconds), metadata={"sys_name": "PX4"})
    print(f"per-flight run of a log of {seconds:g} s, {log.stat().st_size / 1e6:.0f} MB, {runs} runs, medians")
    rows: dict[str, list[dict[str, float]]] = {"pyulog parses": [], "aerodb, direct": [], "aerodb, Prefect": []}
    for number in range(runs):
        rows["pyulog parses"].append(measure("from pyulog import ULog", f"ULog({str(log)!r})"))
        for how in ("direct", "auto"):
            workspace = folder / f"workspace-{how}-{number}"
            imports, body = _ingest(workspace, log, how)
            rows["aerodb, Prefect" if how == "auto" else "aerodb, direct"].append(measure(imports, body))
    base = {key: statistics.median(r[key] for r in rows["pyulog parses"]) for key in ("seconds", "megabytes")}
    for name, results in rows.items():
        middle = {key: statistics.median(r[key] for r in results) for key in base}
        ratios = {key: middle[key] / base[key] for key in base}
        print(
            f"  {name:16} {middle['seconds']:7.2f} s ({ratios['seconds']:.2f} x)"
            f" {middle['megabytes']:7.0f} MB ({ratios['megabytes']:.2f} x)"
        )


def _ingest(workspace: Path, log: Path, how: str) -> tuple[str, str]:
    imports = f"""
from pathlib import Path
from flows.flight import flight_flow
from flows.importing import import_flow
from flows.run import run_flow
from storage.catalogue import Catalogue
from storage.workspace import Workspace
workspace = Workspace.open(Path({str(workspace)!r}))
Catalogue.open(workspace.catalogue).add_vehicle("bench", {VEHICLE!r})
handbook = workspace.root / "handbook.toml"
handbook.write_text({DATABASE!r})
run_flow(import_flow, {{"file": str(handbook), "vehicle": "bench", "bindings": {{}}}}, workspace, "direct")
def nothing(steps, *, workspace, run):
    return None
run_flow(nothing, {{}}, workspace, {how!r})  # starts Prefect's own server where Prefect runs: process start is not counted
"""
    parameters = {"logs": [str(log)], "vehicle": "bench"}
    body = f"outcome = run_flow(flight_flow, {parameters!r}, workspace, {how!r})[0]\nassert outcome['comparison']['key'], outcome"
    return imports, body


HL20 = """
from pathlib import Path
import numpy as np
from aerodb.exchange.daveml import import_daveml
database = import_daveml(Path({path!r}).read_bytes(), name="HL-20", bindings={{"DLG": "90*delta_landing_gear"}})
rng = np.random.default_rng(1)
def points(n):
    ranges = {{"V": (30, 300), "alpha": (-0.1, 0.5), "mach": (0.3, 4), "height_above_ground": (1, 15)}}
    return {{name: rng.uniform(*ranges.get(name, (-0.5, 0.5)), n) for name in database.inputs}}
"""
HL20_OURS = "at = points({n})\ndatabase.predict(points(10))  # the compiled loop is loaded once per process"
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
    """All six HL-20 coefficients, build-up included, beside their look-ups alone through scipy, one after the other."""
    root = Path(os.environ.get("AERODB_TEST_DATA", Path(__file__).resolve().parents[2] / "shared" / "data"))
    file = root / "daveml" / "HL20_aero.dml"
    if not file.is_file():
        print("HL-20 coefficients: not measured, the file is not here (set AERODB_TEST_DATA)")
        return
    setup = HL20.format(path=str(file))
    ours = measure(setup + HL20_OURS.format(n=points), "database.predict(at)")
    theirs = measure(setup + HL20_SCIPY.format(n=points), "for name in calls:\n    grids[name](at[name])")
    print(f"HL-20, six coefficients at {points} points")
    print(f"  scipy, its 241 look-ups one by one {theirs['seconds']:7.2f} s {theirs['megabytes']:7.0f} MB")
    ratio = theirs["seconds"] / ours["seconds"]
    print(f"  aerodb, predict                    {ours['seconds']:7.2f} s {ours['megabytes']:7.0f} MB ({ratio:.1f} times faster)")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=3600.0, help="length of the generated log")
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--points", type=int, default=1_000_000, help="points at which coefficients are evaluated")
    options = parser.parse_args()
    coefficients(options.points)
    with tempfile.TemporaryDirectory() as folder:
        per_flight_run(Path(folder), options.seconds, options.runs)


if __name__ == "__main__":
    main()
