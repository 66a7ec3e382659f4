"""Output error: ATTAS lateral beside a textbook's form in numpy, and six degrees of freedom."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Final

#: One process: both forms from the same start, and how far their answers lie apart. Times are the
#: least of five (of two for the textbook); processor time beside them, for a machine that has other
#: things to do.
LATERAL: Final = """
import json, sys, time
from aerodb.estimation import output_error
from tests.support.output_error_cases import ATTAS_LATERAL, attas_model, attas_records
from tests.support.textbook_output_error import attas_textbook

records, model = attas_records(sys.argv[1]), attas_model()

def timed(function, times):
    found, taken, spent = None, [], []
    for _ in range(times):
        begun, used = time.perf_counter(), time.process_time()
        found = function()
        taken.append(time.perf_counter() - begun)
        spent.append(time.process_time() - used)
    return found, min(taken), min(spent)

_, first, _ = timed(lambda: output_error(model, records), 1)
fit, ours, ours_cpu = timed(lambda: output_error(model, records), 5)
(plain, bounds), theirs, theirs_cpu = timed(
    lambda: attas_textbook(records, ATTAS_LATERAL, model.parameters.start()), 2
)
apart = max(abs(plain[name] - fit[name].value) / bounds[name] for name in plain)
print(json.dumps({"first": first, "ours": ours, "theirs": theirs, "ours cpu": ours_cpu,
                  "theirs cpu": theirs_cpu, "apart": apart, "iterations": fit.iterations}))
"""

#: Twenty unknowns: 13 derivatives, alpha and theta at the start of three flights, a delay.
SIX: Final = """
import json, time
import numpy as np
from aerodb.estimation import output_error
from aerodb.identification import flight_dynamics
from tests.support.flying_increments import TRUTH, light_aircraft, stretches

flights = stretches(np.random.default_rng(0), 3, 60.0, 0.02)
guess = light_aircraft(
    {axis: {name: 0.7 * value for name, value in own.items()} for axis, own in TRUTH.items()}
)
model, records = flight_dynamics(
    guess, flights, tuple(guess.parameters), initial=("alpha", "theta"), delays=("alpha",)
)
taken, spent = [], []
for _ in range(3):
    begun, used = time.perf_counter(), time.process_time()
    fit = output_error(model, records)
    taken.append(time.perf_counter() - begun)
    spent.append(time.process_time() - used)
print(json.dumps({"first": taken[0], "ours": min(taken), "ours cpu": min(spent),
                  "unknowns": len(fit.names), "samples": sum(len(r.time) for r in records),
                  "iterations": fit.iterations, "converged": fit.converged}))
"""

#: A short period in turbulence, 401 samples: eight unknowns of the model and four of the noise.
FILTERS: Final = """
import json, time
from aerodb.estimation import extended_kalman, filter_error, unscented_kalman
from tests.support import short_period

truth = short_period.STABLE
record = short_period.flown(truth, 0.02, 1)
model = short_period.model({name: 0.8 * value for name, value in truth.items()})
figures = {}
for method in (filter_error, extended_kalman, unscented_kalman):
    method(model, [record], process_noise=("g1",))
    begun, used = time.perf_counter(), time.process_time()
    method(model, [record], process_noise=("g1",))
    figures[method.__name__] = time.perf_counter() - begun
    figures[method.__name__ + " cpu"] = time.process_time() - used
print(json.dumps(figures))
"""


def _run(body: str, *given: str) -> dict[str, float]:
    done = subprocess.run(
        [sys.executable, "-c", body, *given], capture_output=True, text=True, check=False
    )
    if done.returncode:
        raise SystemExit(done.stderr)
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found


def estimation(measured: Path) -> dict[str, float]:
    """Returns the figures for the record."""
    figures: dict[str, float] = {}
    file = measured / "attas" / "fAttasAilRud1.mat"
    if file.is_file():
        t = _run(LATERAL, str(file))
        print(f"ATTAS lateral output error: answers {t['apart']:.1g} Cramer-Rao bounds apart")
        print(f"  textbook form in numpy {t['theirs']:8.2f} s (processor {t['theirs cpu']:.2f} s)")
        print(
            f"  aerodb, warm           {t['ours']:8.4f} s (processor {t['ours cpu']:.4f} s),"
            f" {t['iterations']} steps: {t['theirs'] / t['ours']:.0f} times faster (processor"
            f" {t['theirs cpu'] / t['ours cpu']:.0f}); first {t['first']:.2f} s"
        )
        figures["output error"] = t["theirs"] / t["ours"]
    else:
        print("ATTAS output error: not measured, the record is not here (set AERODB_TEST_DATA)")
    t = _run(SIX)
    print(
        f"six degrees of freedom, {t['unknowns']} unknowns, three flights of 60 s at 50 Hz:"
        f" {t['ours']:.2f} s (processor {t['ours cpu']:.2f} s), {t['iterations']} steps,"
        f" converged {bool(t['converged'])}; first {t['first']:.2f} s"
    )
    figures["six degrees"] = t["ours"]
    t = _run(FILTERS)
    for name in ("filter_error", "extended_kalman", "unscented_kalman"):
        print(
            f"short period in turbulence, {name}: {t[name]:.2f} s (processor {t[f'{name} cpu']:.2f} s)"
        )
    return figures
