"""Estimates on line: time per sample of a log that arrives, at 100 Hz with three axes."""

import json
import subprocess
import sys
from typing import Final

#: One process: a log of the small glider goes through the stream, the equations and the estimator;
#: times are in microseconds per sample.
BODY: Final = """
import json, sys, tempfile, time
from pathlib import Path
import numpy as np
from aerodb.estimation import Parameter, Parameters, RecursiveLeastSquares
from aerodb.identification import ONLINE_METHODS, OnlineEstimation, OnlineSettings
from aerodb.increments import parse_model_file
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers import UlogStream
from aerodb.vehicle import parse_vehicle
from tests.flows.test_estimate_online import MODEL
from tests.support.glider_ulog import ULOG_VEHICLE, write_glider_ulog

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "flight.ulg"
    write_glider_ulog(path, 3, 120.0, 100.0)
    data = path.read_bytes()

def through(method):
    online = OnlineEstimation(
        parse_model_file(MODEL), parse_vehicle(ULOG_VEHICLE), builtin_mappings()["px4"], None,
        OnlineSettings(method),
    )
    stream, worst = UlogStream("bench"), 0.0
    begin = time.perf_counter()
    for at in range(0, len(data), 4096):
        stream.feed(data[at : at + 4096])
        if stream.latest - max(online.reached, stream.first) >= online.latency + 1.0:
            start = time.perf_counter()
            taken = online.take(stream.recording())
            stream.forget(online.needed)
            worst = max(worst, (time.perf_counter() - start) / max(taken, 1))
    return (time.perf_counter() - begin) / online.samples, worst

through("recursive")
found = {method: [1e6 * value for value in through(method)] for method in ONLINE_METHODS}
estimator = RecursiveLeastSquares(Parameters(tuple(Parameter(f"p{k}", 0.0) for k in range(8))))
rows = np.random.default_rng(1).standard_normal((5000, 8))
start = time.perf_counter()
for row in rows:
    estimator.update(row, 1.0)
found["update"] = 1e6 * (time.perf_counter() - start) / len(rows)
print(json.dumps(found))
"""


def online() -> None:
    """Print microseconds per sample: of the whole chain, mean and worst second, and of one update
    of recursive least squares with eight parameters."""
    done = subprocess.run([sys.executable, "-c", BODY], capture_output=True, text=True)
    if done.returncode:
        raise SystemExit(done.stderr)
    found = json.loads(done.stdout.splitlines()[-1])
    print(f"on line: one update of 8 parameters {found.pop('update'):.0f} us; whole chain, 3 axes")
    for method, (mean, worst) in found.items():
        print(f"  {method:22} {mean:6.0f} us a sample, {worst:6.0f} in the worst second")
