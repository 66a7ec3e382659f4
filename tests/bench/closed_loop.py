"""`make bench`, the closed loop: a campaign of long flights as a whole, the decision from stored
normal equations, one flight more."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from aerodb.examples.phoenix import read_example
from aerodb.examples.phoenix.mission import fly
from aerodb.examples.phoenix.truth import draw_effects
from aerodb.flows.flight import flight_flow
from aerodb.flows.importing import import_flow
from aerodb.flows.run import run_flow
from aerodb.recording import Topic
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from aerodb.storage.writers.ulog import write_ulog

#: Runs imports and a body in a process of its own: seconds, megabytes and its ``answer``.
Measure = Callable[[str, str], dict[str, Any]]

#: Seconds between one repetition and the next, and how long the demo's aircraft falls from its
#: carrier: repeated, that would be no flight, for it is captive before it only once.
PAUSE, DROP = 5.0, 5.0

CAMPAIGN = """
import shutil
from dataclasses import replace
from pathlib import Path
import numpy as np
from aerodb.flows.close_loop import close_loop_flow
from aerodb.flows.flight import flight_flow
from aerodb.flows.run import run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.files.normal_equations import read_normal_equations
from aerodb.storage.workspace import Workspace
from aerodb.tracing.decision.verdicts import trace
from aerodb.tasks.steps.update import plan_update
from aerodb.tasks.workspace_access import access_workspace
from aerodb.tasks.steps.trace import freeze_library, trace_flight
folder = Path({folder!r})
workspace = Workspace.open(folder / "workspace")
catalogue = Catalogue.open(workspace.catalogue)
flights = [row.id for row in catalogue.flights("phoenix")]
baseline = catalogue.versions("phoenix")[0].id
asked = {{"vehicle": "phoenix", "baseline": baseline, "flights": flights, "hold_out": []}}
"""

DECISION = """
run = catalogue.start_run("bench", how="direct", parameters={}, code_version="bench").id
where = {"workspace": str(workspace.root), "run": run}
found = [{"flight": flight, "key": flight} for flight in flights]
plan = plan_update(found, **where, vehicle="phoenix", baseline=baseline, model="", hold_out=[])
library, access = freeze_library(plan, **where), access_workspace(str(workspace.root))
database = access.database(baseline)
ten = [trace_flight(flight, **where, library=library, database=database) for flight in flights]
# what is the same flight twice is taken once: each copy differs in the last digits
copies = [(one, 1.0 + 1e-5 * copy, copy) for copy in range(COUNT // 10) for one in ten]
normal_equations = [replace(one, flight=f"{one.flight}-{copy}", matrix=one.matrix * factor) for one, factor, copy in copies]
trace(ten, library.hypotheses, library.settings)
"""


def closed_loop(
    folder: Path, measure: Measure, count: int = 10, seconds: float = 600.0
) -> dict[str, float]:
    """The whole closed loop over flights at 50 Hz, its decision from stored normal equations, and
    what one more flight costs beside many. Returns the figures for the record."""
    folder = folder / "campaign"
    new = _fly(folder, count, seconds)
    print(
        f"closed loop over {count} flights of {seconds:g} s at 50 Hz, the demo's aircraft, full"
        " library"
    )
    setup = CAMPAIGN.format(folder=str(folder))
    figures = {}
    for how in ("direct", "auto"):
        setup_how = (
            setup + f"shutil.copytree(folder / 'workspace', folder / {how!r})\nworkspace ="
            f" Workspace.open(folder / {how!r})\n"
        )
        if how == "auto":
            setup_how += (
                "def nothing(steps, **_):\n    return None\nnothing.role = 'read'\nrun_flow(nothing, {}, workspace,"
                " 'auto')\n"
            )
        done = measure(
            setup_how,
            f"answer = len(run_flow(close_loop_flow, asked, workspace, {how!r})['findings'])",
        )
        if how == "direct":
            figures["ten flights"] = done["seconds"]
        print(
            f"  {'Prefect' if how == 'auto' else 'direct':8} {done['seconds']:7.2f} s"
            f" {done['megabytes']:7.0f} MB"
        )
    # What a new flight costs whatever else is stored, its run and its normal equations: taken once,
    # beside the decisions.
    asked = {"logs": [str(new)], "vehicle": "phoenix"}
    one = f"new = run_flow(flight_flow, {asked!r}, workspace, 'direct')[0]['flight']\nanswer = 0\n"
    one += "trace_flight(new, **where, library=library, database=database)"
    flight = measure(setup + DECISION.replace("COUNT", "10"), one)["seconds"]
    costs = {}
    for many in (10, 200):
        body = (
            "answer = len(trace(normal_equations, library.hypotheses, library.settings).findings)"
        )
        costs[many] = measure(setup + DECISION.replace("COUNT", str(many)), body)["seconds"]
        print(f"  decision from the stored normal equations of {many} flights {costs[many]:.2f} s")
    ratio = (flight + costs[200]) / (flight + costs[10])
    print(
        f"  one flight more, from log to normal equations, {flight:.2f} s; adding it to 200 costs {ratio:.2f}"
        " times adding it to 10"
    )
    return figures | {"one more": ratio}


def _fly(folder: Path, count: int, seconds: float) -> Path:
    """A workspace with `count` flights of a campaign; the log of one more flight is returned."""
    *logs, new = campaign(folder, count + 1, seconds)
    workspace = Workspace.open(folder / "workspace")
    run_flow(
        flight_flow, {"logs": [str(log) for log in logs], "vehicle": "phoenix"}, workspace, "direct"
    )
    return new


def campaign(folder: Path, count: int, seconds: float) -> list[Path]:
    """Logs of `count` flights of the demo, each flown again and again, with pauses, until it lasts
    `seconds`; and the workspace ``folder/workspace`` with their vehicle, at 50 Hz, and its
    database."""
    folder.mkdir()
    workspace = Workspace.open(folder / "workspace")
    Catalogue.open(workspace.catalogue).add_vehicle(
        "phoenix", read_example("vehicle.toml").replace("rate = 100.0", "rate = 50.0")
    )
    (folder / "preflight.toml").write_text(read_example("preflight.toml"))
    asked = {"file": str(folder / "preflight.toml"), "vehicle": "phoenix", "bindings": {}}
    run_flow(import_flow, asked, workspace, "direct")
    logs = []
    for log in fly(5, count, draw_effects(5)):
        first = min(topic.time[0] for topic in log.topics)
        lasts = max(topic.time[-1] for topic in log.topics) - first
        times = range(int(np.ceil(seconds / lasts)))
        topics = [_again(topic, first, lasts, times) for topic in log.topics]
        logs.append(folder / f"{log.name}.ulg")
        write_ulog(
            logs[-1],
            topics,
            metadata={"sys_name": "PX4", "ver_hw": "AERODB_EXAMPLE"},
            start_utc=log.start_utc,
        )
    return logs


def _again(topic: Topic, first: float, lasts: float, times: range) -> Topic:
    """A topic of a log that begins at `first` [s] and `lasts` [s], again and again; only the first
    time from the drop on."""
    free = topic.time > first + DROP
    parts = [(again, slice(None) if again == 0 else free) for again in times]
    return replace(
        topic,
        time=np.concatenate([topic.time[part] + again * (lasts + PAUSE) for again, part in parts]),
        fields={
            name: np.concatenate([values[part] for _, part in parts])
            for name, values in topic.fields.items()
        },
    )
