"""A flight that the reconstruction cannot bear keeps its verdict and its reason to itself: the others
of its batch are done, whichever way it came."""

import numpy as np
import pytest

from aerodb.errors import InputError, failing_alone
from aerodb.flows.flight import again_flow, flight_flow
from aerodb.flows.inbox import sweep_flow
from aerodb.flows.nightly import nightly_flow
from aerodb.flows.recalibrate import recalibrate_flow
from aerodb.flows.run import run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from aerodb.tasks.view.status import status_of
from aerodb.tasks.workspace_access import access_workspace
from tests.support.consistent_flights import NAME, VEHICLE, log, table

G0, SPEED, RATE = 9.80665, 60.0, 50.0


def steep(top=89.5, seconds=60.0, seed=0):
    """A pull-up to a pitch attitude of `top` [deg] and back at constant speed, with sensor noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(seconds * RATE)) / RATE
    theta = np.deg2rad(top) * np.exp(-(((t - 0.5 * seconds) / 6.0) ** 2))
    theta += np.deg2rad(3.0) * np.sin(1.3 * t)
    q = np.gradient(theta, t)
    exact = {
        "V": np.full_like(t, SPEED),
        "alpha": 0.0 * t,
        "beta": 0.0 * t,
        "phi": 0.0 * t,
        "theta": theta,
        "psi": 0.0 * t,
        "altitude": 1000.0 + np.cumsum(SPEED * np.sin(theta)) / RATE,
        "p": 0.0 * t,
        "q": q,
        "r": 0.0 * t,
        "ax": G0 * np.sin(theta),
        "ay": 0.0 * t,
        "az": -SPEED * q - G0 * np.cos(theta),
    }
    noise = {"V": 0.1, "altitude": 0.3, "ax": 0.02, "ay": 0.02, "az": 0.02}
    noisy = {
        name: values + noise.get(name, 1e-3) * rng.standard_normal(len(t))
        for name, values in exact.items()
    }
    density = np.full_like(t, 1.1)
    return {"time": t, **noisy, "rho": density, "qbar": 0.5 * density * SPEED**2}


@pytest.fixture
def logs(tmp_path):
    """Two sound logs, and between them one that pitches through the vertical."""
    tables = {"first": table(1), "steep": steep(), "last": table(2, start=200.0)}
    return [log(tmp_path, name, columns) for name, columns in tables.items()]


@pytest.fixture
def workspace(tmp_path):
    made = Workspace.open(tmp_path / "w")
    with Catalogue.open(made.catalogue) as catalogue:
        catalogue.add_vehicle(NAME, VEHICLE)
    return made


def verdicts(workspace):
    """Log -> verdict and reasons of its flight, from the catalogue."""
    with Catalogue.open(workspace.catalogue) as catalogue:
        rows = catalogue.flights(NAME)
        names = {row.id: catalogue.log(row.log_sha256).name.partition(".")[0] for row in rows}
        return {names[row.id]: (row.verdict, "; ".join(row.reasons)) for row in rows}


def check(workspace):
    found = verdicts(workspace)
    assert set(found) == {"first", "steep", "last"}
    assert found["first"][0] == found["last"][0] == "good"
    assert found["steep"][0] == "limited"
    assert "pitch attitude leaves +-88 deg" in found["steep"][1]


def test_ingesting_several_logs(workspace, logs):
    given = {"logs": [str(path) for path in logs], "vehicle": NAME}
    outcomes = run_flow(flight_flow, given, workspace, "direct")
    check(workspace)
    assert all(outcome["coefficients"]["key"] for outcome in outcomes)  # as measured


def test_sweep_of_the_inbox_and_night(workspace, logs):
    inbox = workspace.inbox / NAME
    inbox.mkdir(parents=True, exist_ok=True)
    for path in logs:
        path.rename(inbox / path.name)
    (workspace.root / "settings.toml").write_text("[inbox]\nsettle = 0.0\n", encoding="utf-8")
    swept = run_flow(sweep_flow, {}, workspace, "direct")
    assert {entry["kind"] for entry in swept["files"]} == {"stored"}
    check(workspace)
    assert run_flow(nightly_flow, {}, workspace, "direct")["files"] == []


def swapped(columns, one, other):
    return {**columns, one: columns[other], other: columns[one]}


@pytest.mark.campaign
def test_swapped_channels_and_stretched_time_stop_no_other_log_of_the_inbox(workspace, tmp_path):
    """What no reconstruction was made for: each log ends once, the bad ones rejected with a reason
    that `status` shows beside the file, the good ones with all their results."""
    stretched = table(4, start=300.0)
    stretched["time"] = 10.0 * stretched["time"]
    tables = {
        "first": table(1),
        "p_q": swapped(table(2, start=100.0), "p", "q"),
        "p_r": swapped(table(3, start=200.0), "p", "r"),
        "stretched": stretched,
        "last": table(5, start=400.0),
    }
    inbox = workspace.inbox / NAME
    inbox.mkdir(parents=True, exist_ok=True)
    for name, columns in tables.items():
        log(inbox, name, columns)
    (workspace.root / "settings.toml").write_text("[inbox]\nsettle = 0.0\n", encoding="utf-8")
    swept = run_flow(sweep_flow, {}, workspace, "direct")
    assert {entry["kind"] for entry in swept["files"]} == {"stored"}
    assert not [path for path in inbox.iterdir() if path.is_file()]
    found = verdicts(workspace)
    assert {name: verdict for name, (verdict, _) in found.items()} == {
        "first": "good",
        "p_q": "rejected",
        "p_r": "rejected",
        "stretched": "rejected",
        "last": "good",
    }
    assert "p and r are swapped" in found["p_r"][1]
    access = access_workspace(str(workspace.root))
    for row in access.catalogue.flights(NAME):
        assert access.catalogue.results_of(row.id, "coefficients")
    status = status_of(access)
    assert status["quarantined"]["count"] == 0
    shown = {entry["log"] for entry in status["vehicles"][0]["rejected"]}
    assert shown == {"p_q.parquet", "p_r.parquet", "stretched.parquet"}


def test_recalibration_leaves_it_out_and_says_why(workspace, logs):
    given = {"logs": [str(path) for path in logs], "vehicle": NAME}
    flights = [entry["flight"] for entry in run_flow(flight_flow, given, workspace, "direct")]
    parameters = {"vehicle": NAME, "flights": flights, "reason": "after a check of the rig"}
    document = run_flow(recalibrate_flow, parameters, workspace, "direct")
    assert set(document["flights"]) == {flights[0], flights[2]}
    assert [entry["flight"] for entry in document["skipped"]] == [flights[1]]
    assert "pitch attitude" in document["skipped"][0]["reason"]


def test_flight_that_cannot_be_read_any_more_is_rejected_with_its_file_and_the_others_go_on(
    workspace, tmp_path
):
    """The vehicle's file changes after the flights are stored, and does not fit one of them."""
    flapped = table(1)
    flapped["delta_flap"] = np.zeros_like(flapped["time"])
    logs = [log(tmp_path, "flapped", flapped), log(tmp_path, "plain", table(2, start=200.0))]
    given = {"logs": [str(path) for path in logs], "vehicle": NAME}
    flights = [entry["flight"] for entry in run_flow(flight_flow, given, workspace, "direct")]
    assert {verdict for verdict, _ in verdicts(workspace).values()} == {"good"}
    surface = '[surfaces.flap]\nlimits = ["-40 deg", "40 deg"]\n'
    source = '[surfaces.flap.log]\ntopic = "table"\nfield = "delta_flap"\nunit = "furlong"\n'
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_vehicle(NAME, VEHICLE + surface + source)
    run_flow(again_flow, {"flight": flights[0]}, workspace, "direct")
    run_flow(again_flow, {"flight": flights[1]}, workspace, "direct")
    found = verdicts(workspace)
    assert found["plain"][0] == "good"
    assert found["flapped"][0] == "rejected"
    assert "furlong" in found["flapped"][1]


@pytest.mark.parametrize(
    "error", [ZeroDivisionError("x"), np.linalg.LinAlgError("singular"), KeyError("u")]
)
def test_failing_calculation_becomes_an_error_of_its_input(error):
    with pytest.raises(InputError, match=r"log 7: the sum failed \(.*Error: .*\)"):  # noqa: SIM117
        with failing_alone("the sum", "log 7"):
            raise error


def test_memory_is_an_error_of_the_input_only_where_nothing_is_stored():
    with (
        pytest.raises(InputError, match=r"log 7: the sum gets no memory \(MemoryError: 9 GiB\)"),
        failing_alone("the sum", "log 7", memory=True),
    ):
        raise MemoryError("9 GiB")


NO_THREAD = RuntimeError("can't start new thread")


@pytest.mark.parametrize("error", [OSError("full"), MemoryError(), KeyboardInterrupt(), NO_THREAD])
def test_disk_memory_and_interrupts_pass(error):
    with pytest.raises(type(error)), failing_alone("the sum", "log 7"):
        raise error
