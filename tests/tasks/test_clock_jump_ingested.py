"""A log whose clock jumps, or was set wrong, is ingested beside others, and its outcome says so."""

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from aerodb.flows.flight import flight_flow
from aerodb.flows.run import run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from aerodb.storage.writers.ulog import write_ulog
from aerodb.tasks.view.flight_documents import flight_details
from aerodb.tasks.workspace_access import access_workspace
from tests.aerodb.logs.test_clock_jumps import VEHICLE, jumping, recording


def test_outcome_names_the_jump(tmp_path):
    workspace = Workspace.open(tmp_path / "w")
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_vehicle("glider", VEHICLE)
    recordings = [recording(), jumping({"actuator_controls_0"}, 1.7e9)]
    logs = []
    for number, log in enumerate(recordings):
        logs.append(str(tmp_path / f"{number}.ulg"))
        write_ulog(tmp_path / f"{number}.ulg", log.topics.values(), metadata={"sys_name": "PX4"})
    given = {"logs": logs, "vehicle": "glider"}
    sound, jumped = run_flow(flight_flow, given, workspace, "direct")
    assert sound["flight"]
    assert sound["damage"] == []
    assert jumped["flight"]
    (damage,) = jumped["damage"]
    assert damage["topic"] == "actuator_controls_0"
    assert "the clock jumps by 1.7e+09 s" in damage["what"]
    assert np.isclose(damage["end"], 1.7e9 + 60.0, atol=1.0)


def test_a_start_in_the_future_is_a_suspicion_of_the_clock_and_stays_one(tmp_path):
    workspace = Workspace.open(tmp_path / "w")
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_vehicle("glider", VEHICLE)
    now, log = datetime.now(UTC), recording()
    starts = [now + timedelta(days=40), now + timedelta(hours=14)]  # the second: a time zone
    logs = []
    for number, start in enumerate(starts):
        logs.append(str(tmp_path / f"{number}.ulg"))
        metadata = {"sys_name": "PX4", "ver_hw": str(number)}
        write_ulog(Path(logs[-1]), log.topics.values(), metadata=metadata, start_utc=start)
    given = {"logs": logs, "vehicle": "glider"}
    for _ in ("taken in", "known"):
        ahead, zone = run_flow(flight_flow, given, workspace, "direct")
        (said,) = (each for each in ahead["suspicions"] if each["channel"] == "start_utc")
        assert "40 days after it was read: its clock was set wrong" in said["sentence"]
        assert [each for each in zone["suspicions"] if each["channel"] == "start_utc"] == []
    access = access_workspace(str(workspace.root))
    shown = flight_details(access, access.catalogue.flight(ahead["flight"]))
    assert said in shown["suspicions"]
    assert shown["start_utc"] == starts[0].isoformat(timespec="microseconds")
