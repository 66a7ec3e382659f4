"""Flights that lack the thrust which the vehicle file says is logged: nothing is learnt from them on
the axes that contain it, the other axes go on, and the documents say so."""

import numpy as np
import pytest

from tests.support.command import asked
from tests.support.small_glider import (
    DATABASE,
    MASS,
    MODEL,
    NAME,
    TRUTH,
    VEHICLE,
    channels,
    write_csv,
)

THRUST = '[thrust]\nsource = "channel"\n'
ABOVE = THRUST + "point = [0.0, 0.0, -0.1]\n"


def powered(seed, thrust=True):
    """A flight of the glider with an engine; without `thrust` the log does not hold its thrust."""
    table = channels(seed)
    newtons = 20.0 + 8.0 * np.sin(0.9 * table["time"] + seed)
    table["ax"] = table["ax"] + newtons / MASS
    return {**table, "thrust": newtons} if thrust else table


@pytest.fixture
def workspace(tmp_path):
    """Makes a workspace of the flights given; returns it with the ids of the flights."""

    def make(flights, thrust=THRUST, start="w"):
        for name, text in (
            ("vehicle.toml", VEHICLE.replace('[thrust]\nsource = "none"\n', thrust)),
            ("database.toml", DATABASE),
            ("model.toml", MODEL),
        ):
            (tmp_path / name).write_text(text, encoding="utf-8")
        root = tmp_path / start
        asked(root, "vehicle", "add", str(tmp_path / "vehicle.toml"))
        asked(root, "database", "import", str(tmp_path / "database.toml"), "--vehicle", NAME)
        logs = [str(write_csv(tmp_path / f"{name}.csv", table)) for name, table in flights.items()]
        answer = asked(root, "flight", "ingest", *logs, "--vehicle", NAME, "--direct")
        return root, [entry["flight"] for entry in answer]

    return make


def increments(document):
    return {
        (entry["axis"], term["term"]): (term["value"], term["standard_error"])
        for entry in document["increments"]
        for term in entry["terms"]
    }


def update(root, tmp_path):
    model = str(tmp_path / "model.toml")
    return asked(
        root, "update", "--vehicle", NAME, "--model", model, "--hold-out", "none", "--direct"
    )


def test_update_learns_no_drag_from_a_flight_without_thrust(workspace, tmp_path):
    flights = {f"a{k}": powered(k) for k in range(4)}
    alone = update(workspace(flights, start="without")[0], tmp_path)
    root, ids = workspace({**flights, "lacking": powered(9, thrust=False)})
    document = update(root, tmp_path)
    found, without = increments(document), increments(alone)
    for term, truth in TRUTH["CX"].items():
        assert found["CX", term] == pytest.approx(without["CX", term], rel=1e-9)
        value, error = found["CX", term]
        assert abs(value - truth) < 4.0 * error + 0.002
    for term in TRUTH["CZ"]:  # the flight counts where thrust has no share
        assert found["CZ", term][0] != without["CZ", term][0]
        assert found["CZ", term][1] < without["CZ", term][1]
    assert ids[-1] in document["flights"]["identified"]
    said = [remark for remark in document["remarks"] if "thrust" in remark]
    assert len(said) == 1
    assert said[0].startswith("CX, C_drag, C_side, C_lift of flight lacking.csv were left out")
    assert "[configuration]" in said[0]
    assert not [remark for remark in alone["remarks"] if "thrust" in remark]


@pytest.mark.campaign
def test_closed_loop_learns_no_drag_from_a_flight_without_thrust(workspace):
    flights = {f"a{k}": powered(k) for k in range(3)}
    root, _ = workspace({**flights, "lacking": powered(9, thrust=False)})
    document = asked(root, "close-loop", "--vehicle", NAME, "--direct", "--hold-out", "none")
    assert [r for r in document["remarks"] if "of flight lacking.csv were left out" in r]
    alone, _ = workspace(flights, start="without")
    without = asked(alone, "close-loop", "--vehicle", NAME, "--direct", "--hold-out", "none")
    for figure in ("rms_before", "rms_after", "noise_floor"):
        with_it = document["axes"]["CX"][figure]
        assert with_it == pytest.approx(without["axes"]["CX"][figure], rel=1e-9)
        assert document["axes"]["CZ"][figure] != without["axes"]["CZ"][figure]


def test_thrust_line_off_the_centre_of_gravity_takes_the_pitching_moment_along(workspace, tmp_path):
    flights = {"a0": powered(0), "lacking": powered(9, thrust=False)}
    root, _ = workspace(flights, thrust=ABOVE)
    document = update(root, tmp_path)
    assert [r for r in document["remarks"] if r.startswith("CX, Cm, C_drag, C_side, C_lift of")]


@pytest.mark.campaign
def test_samples_without_thrust_are_not_used_for_drag(workspace, tmp_path):
    table = powered(0)
    table["thrust"][:150] = np.nan
    root, _ = workspace({"a0": table, "a1": powered(1)})
    found = increments(update(root, tmp_path))
    for term, truth in TRUTH["CX"].items():
        value, error = found["CX", term]
        assert abs(value - truth) < 4.0 * error + 0.002


@pytest.mark.campaign
def test_constant_thrust_of_the_vehicle_file_is_a_remedy(workspace, tmp_path):
    off = {f"a{k}": channels(k) for k in range(2)}  # the engine is off
    root, _ = workspace(off, thrust=f"{THRUST}[configuration]\nthrust = 0.0\n")
    document = update(root, tmp_path)
    assert not [remark for remark in document["remarks"] if "thrust" in remark]
    assert ("CX", "alpha") in increments(document)
