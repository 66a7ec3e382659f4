"""Simulated flight beside JSBSim: the same aircraft, the same step, outputs logged."""

import json
import subprocess
import sys
from typing import Final

AIRCRAFT: Final = ("f16", "c172p", "737", "DHC6", "T37")

#: One process: JSBSim's loop with its own CSV output and without any, then the engine over what
#: JSBSim flew. Times are in microseconds per step and the least of three.
BODY: Final = """
import json, sys, tempfile, time
from pathlib import Path
import jsbsim
import numpy as np
import tests.aerodb.simulation.test_engine_jsbsim as cases
from aerodb.simulation import flight_model, simulate

name, cases.STEP = sys.argv[1], 1.0 / 120.0
flown = cases.fly_jsbsim(name)
n = len(flown.time)

LOGGED = '''<?xml version="1.0"?>
<output name="{file}" type="CSV" rate="120">
<velocities>ON</velocities><position>ON</position><rates>ON</rates><forces>ON</forces>
<moments>ON</moments><aerosurfaces>ON</aerosurfaces><coefficients>ON</coefficients></output>'''

def theirs(logged):
    root = Path(jsbsim.get_default_root_dir())
    program = jsbsim.FGFDMExec(str(root))
    program.set_debug_level(0)
    program.load_model(name)
    program.set_dt(cases.STEP)
    program["ic/h-sl-ft"], program["ic/vc-kts"] = 8000.0, cases.AIRCRAFT[name][0]
    if logged:
        folder = tempfile.mkdtemp()
        directive = Path(folder) / "output.xml"
        directive.write_text(LOGGED.format(file=str(Path(folder) / "log.csv")))
        program.set_output_directive(str(directive))
    program.run_ic()
    program["propulsion/set-running"] = -1
    start = time.perf_counter()
    for _ in range(n):
        program.run()
    return time.perf_counter() - start

def ours(k, method):
    start = dict(flown.start)
    start["V"] = start["V"] + np.zeros(k)
    begin = time.perf_counter()
    simulate(flown.model, flown.time, start, flown.series, method=method)
    return time.perf_counter() - begin

begin = time.perf_counter()
ours(1, 4)
first = time.perf_counter() - begin
def least(function, *given):
    return min(function(*given) for _ in range(3)) / n * 1e6
print(json.dumps({
    "first": first,
    "logged": least(theirs, True), "silent": least(theirs, False),
    "one": least(ours, 1, 2), "one RK4": least(ours, 1, 4),
    "many": least(ours, 64, 2), "many RK4": least(ours, 64, 4),
}))
"""


def simulation() -> dict[str, float]:
    """Time of a step of five aircraft, one run and 64 parameter sets, beside JSBSim."""
    print("simulation at 120 Hz, microseconds per step; ratio of JSBSim's time to ours")
    print(
        f"  {'':6} {'JSBSim, CSV':>12} {'no output':>10} {'one run':>9} {'ratio':>6} {'RK4':>6}"
        f" {'64 runs':>9} {'ratio':>6} {'RK4':>6} {'first [s]':>9}"
    )
    worst = {"one": float("inf"), "many": float("inf")}
    for name in AIRCRAFT:
        done = subprocess.run(
            [sys.executable, "-c", BODY, name], capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise SystemExit(done.stderr)
        t = json.loads(done.stdout.splitlines()[-1])
        one, many = t["logged"] / t["one"], 64.0 * t["logged"] / t["many"]
        worst = {"one": min(worst["one"], one), "many": min(worst["many"], many)}
        print(
            f"  {name:6} {t['logged']:12.1f} {t['silent']:10.1f} {t['one']:9.1f} {one:6.1f}"
            f" {t['logged'] / t['one RK4']:6.1f} {t['many']:9.1f} {many:6.1f}"
            f" {64.0 * t['logged'] / t['many RK4']:6.1f} {t['first']:9.2f}"
        )
    return {"one run": worst["one"], "64 runs": worst["many"]}
