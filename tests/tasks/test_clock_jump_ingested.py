"""A log with a clock that jumps is ingested beside others, and its outcome says so."""

import numpy as np

from aerodb.flows.flight import flight_flow
from aerodb.flows.run import run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from aerodb.storage.writers.ulog import write_ulog
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
