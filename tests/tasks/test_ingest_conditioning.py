"""Conditioning in the per-flight run, through the command line: faults said, segments and delays
kept, repetitions found."""

import sqlite3
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson
from typer.testing import CliRunner

from aerodb.conditioning.channel_rates import KINEMATICS, with_accelerations
from aerodb.conditioning.delay import BAND, delay_between, delays
from aerodb.flight import Flight
from aerodb.flows.cli.main import app
from aerodb.recording import Topic
from aerodb.remarks import said
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.rows import RepeatedStretch, RepeatRow
from aerodb.storage.files.flights import read_flight
from aerodb.storage.workspace import Workspace
from aerodb.storage.writers.ulog import write_ulog
from aerodb.tasks.steps.counting import counted_out
from aerodb.tasks.steps.ingest import load_flight, store_log
from aerodb.tasks.workspace_access import access_workspace
from tests.support.catalogue_samples import V as VEHICLE
from tests.support.catalogue_samples import add_family, h
from tests.support.command import asked
from tests.support.kinematic_flights import kinematic_flight
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME, channels, write_csv, write_files, write_parquet

DEGREE = np.pi / 180


def added(workspace: Path, folder: Path) -> Path:
    """A workspace that knows the glider; nothing of its aerodynamics is asked for here."""
    write_files(folder, flights=0)
    asked(workspace, "vehicle", "add", str(folder / "vehicle.toml"))
    return workspace


def table(flight: Flight) -> dict[str, Any]:
    """A flight as the columns of a log."""
    return {"time": flight.time, **flight.channels}


def ingested(workspace: Path, *logs: Path) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = asked(
        workspace, "flight", "ingest", *map(str, logs), "--vehicle", NAME, "--direct"
    )
    return found


# Bad input: each fault gets its plain sentence


def flipped(flight: Flight) -> Flight:
    return flight.with_channels({"q": -flight["q"]})


def in_degrees(flight: Flight) -> Flight:
    return flight.with_channels({"theta": flight["theta"] / DEGREE})


def without_gravity(flight: Flight) -> Flight:
    return flight.with_channels({"az": flight["az"] + 9.80665})


def swapped(flight: Flight) -> Flight:
    return flight.with_channels({"ay": flight["az"], "az": flight["ay"]})


def stuck(flight: Flight) -> Flight:
    values = flight["alpha"].copy()
    values[600:] = values[600]
    return flight.with_channels({"alpha": values})


FAULTS: dict[str, tuple[Callable[[Flight], Flight], str, str]] = {
    "sign": (flipped, "sign", "the sign of q is flipped"),
    "degrees": (in_degrees, "degrees", "theta reaches"),
    "gravity": (without_gravity, "gravity", "gravity is missing"),
    "swapped": (swapped, "swapped", "y and z of the accelerations are swapped"),
    "stuck": (stuck, "stuck", "its sensor is stuck"),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_of_the_sensors_is_said_in_a_plain_sentence(tmp_path: Path, fault: str) -> None:
    plant, kind, words = FAULTS[fault]
    workspace = added(tmp_path / "w", tmp_path)
    log = write_csv(tmp_path / "flight.csv", table(plant(kinematic_flight(3, rate=25.0))))
    (outcome,) = ingested(workspace, log)
    assert outcome["status"] == "stored", (
        "it is kept: what follows from the fault is for flight-path reconstruction"
    )
    assert kind in [entry["kind"] for entry in outcome["suspicions"]]
    assert any(words in entry["sentence"] for entry in outcome["suspicions"])
    assert (
        asked(workspace, "flight", "show", outcome["flight"])["suspicions"] == outcome["suspicions"]
    )
    looked = asked(tmp_path / "none", "log", "inspect", str(log))
    assert [entry["sentence"] for entry in looked["suspicions"]] == [
        entry["sentence"] for entry in outcome["suspicions"]
    ]
    said = CliRunner().invoke(
        app, ["--workspace", str(workspace), "flight", "show", outcome["flight"]]
    )
    assert f"suspicion: {outcome['suspicions'][0]['sentence']}" in said.stdout
    whole = CliRunner().invoke(
        app, ["--workspace", str(workspace), "flight", "show", outcome["flight"], "-v"]
    )
    assert "details: -v" in said.stdout
    assert all(row in whole.stdout for row in ("from [s]", "step", "conditioning"))
    assert len(whole.stdout.splitlines()) > len(said.stdout.splitlines())


def test_a_sound_flight_raises_no_suspicion_and_repeats_nothing(tmp_path: Path) -> None:
    workspace = added(tmp_path / "w", tmp_path)
    logs = [
        write_csv(tmp_path / f"flight{seed}.csv", table(kinematic_flight(seed, rate=25.0)))
        for seed in (3, 4)
    ]
    for outcome in ingested(workspace, *logs):
        assert (outcome["status"], outcome["suspicions"], outcome["repeats"]) == ("stored", [], [])


def own_mapping(path: Path) -> Path:
    """A mapping for ULogs with the rates in one topic and the rest in another."""
    units = {"V": "m/s", "qbar": "Pa", "alpha": "rad", "theta": "rad"} | dict.fromkeys(
        ("ax", "ay", "az"), "m/s^2"
    )
    text = 'name = "own"\nformats = ["ulog"]\ndetect = ["gyro"]\n'
    for topic, fields in (("gyro", dict.fromkeys("pqr", "rad/s")), ("other", units)):
        for name, unit in fields.items():
            text += (
                f'[[channel]]\nname = "{name}"\nsources = [{{ topic = "{topic}", field = "{name}",'
                f' unit = "{unit}" }}]\n'
            )
    path.write_text(text)
    return path


def two_clocks(path: Path, later: float) -> Path:
    """A ULog whose second topic is stamped `later` [s], and a third on the first clock."""
    flight = kinematic_flight(6, rate=25.0)
    fields = {name: values.astype(np.float32) for name, values in flight.channels.items()}
    rates = {name: fields.pop(name) for name in ("p", "q", "r")}
    topics = [
        Topic("gyro", flight.time + 1.0, rates),
        Topic("status", flight.time + 1.0, {"ok": rates["p"]}),
    ]
    write_ulog(
        path,
        [*topics, Topic("other", flight.time + 1.0 + later, fields)],
        metadata={"sys_name": "TEST"},
    )
    return path


def test_topics_that_do_not_meet_are_named_with_the_likely_cause(tmp_path: Path) -> None:
    workspace, mapping = added(tmp_path / "w", tmp_path), own_mapping(tmp_path / "own.toml")
    log = two_clocks(tmp_path / "clocks.ulg", 1.6e9)
    ingest = [
        "--workspace",
        str(workspace),
        "flight",
        "ingest",
        str(log),
        "--vehicle",
        NAME,
        "--mapping",
        str(mapping),
        "--direct",
    ]
    refused = CliRunner().invoke(app, ingest)
    assert refused.exit_code == 3
    assert "accelerations and rates do not overlap in time; topic other runs from" in refused.stderr
    assert "its time stamps look like UTC" in refused.stderr
    looked = asked(workspace, "log", "inspect", str(log), "--mapping", str(mapping))
    assert "accelerations and rates do not overlap" in looked["refused"]
    (clock,) = [entry for entry in looked["suspicions"] if entry["kind"] == "no_overlap"]
    assert clock["channel"] == "other"
    assert "its time stamps look like UTC" in clock["sentence"]


# What is kept with a flight


def test_wild_points_and_ground_are_flagged_and_segments_are_stored_once(tmp_path: Path) -> None:
    workspace = added(tmp_path / "w", tmp_path)
    flight = kinematic_flight(7, seconds=80.0, rate=25.0)
    time, on_ground = flight.time, flight.time < 20.0
    values = {
        name: np.where(on_ground, x * np.clip(time / 20.0, 0.0, 1.0) ** 4, x)
        for name, x in flight.channels.items()
    }
    values["V"], values["altitude"] = (
        np.where(on_ground, 0.1, flight["V"]),
        np.clip(2.0 * (time - 20.0), 0.0, None),
    )
    values["az"], values["q"] = np.where(on_ground, -9.81, flight["az"]), flight["q"].copy()
    values["q"][1200] += 1.0
    (outcome,) = ingested(workspace, write_csv(tmp_path / "flight.csv", {"time": time, **values}))
    shown = asked(workspace, "flight", "show", outcome["flight"])
    states = [
        (s["kind"], s["start"], s["end"])
        for s in shown["segments"]
        if s["kind"] in ("on_ground", "airborne")
    ]
    assert [kind for kind, *_ in states] == ["on_ground", "airborne"]
    assert states[0][2] == pytest.approx(21.0, abs=1.5), "it rolls until it is four metres up"
    assert all(s["reason"] for s in shown["segments"])
    opened = Catalogue.open(Workspace.open(workspace).catalogue)
    (kept,) = opened.results_of(outcome["flight"], "conditioning")
    ingested(workspace, tmp_path / "flight.csv")
    assert opened.results_of(outcome["flight"], "conditioning") == (kept,)
    (row,) = opened.results_of(outcome["flight"], "ingest")
    stored = read_flight(Workspace.open(workspace).resolve(row.path))
    assert not stored.usable()[time < 19.0].any()
    assert stored.usable()[time > 23.0].all()
    assert np.flatnonzero(stored.flags["q"]).tolist() == [1200]
    assert any("q: 1 spikes, the first at 48 s" in note for note in stored.notes)
    assert stored["q"][1200] == pytest.approx(values["q"][1200]), (
        "what is kept is what was measured"
    )
    used, _ = load_flight(
        access_workspace(str(workspace)), opened.flight(outcome["flight"]), opened.runs()[0].id
    )
    assert used["q"][1200] == pytest.approx(0.5 * (stored["q"][1199] + stored["q"][1201])), (
        "no later step smears it"
    )


def test_a_planted_delay_is_kept_with_the_flight(tmp_path: Path) -> None:
    workspace = added(tmp_path / "w", tmp_path)
    flight = kinematic_flight(8, seconds=90.0)
    late = np.interp(flight.time - 0.06, flight.time, flight["alpha"])
    (outcome,) = ingested(
        workspace, write_csv(tmp_path / "late.csv", table(flight.with_channels({"alpha": late})))
    )
    delays = {
        entry["channel"]: entry
        for entry in asked(workspace, "flight", "show", outcome["flight"])["delays"]
    }
    alpha, theta = delays["alpha"], delays["theta"]
    assert alpha["observable"]
    assert abs(alpha["seconds"] - 0.06) < 4 * alpha["standard_error"] + 1e-3
    assert abs(theta["seconds"]) < 4 * theta["standard_error"] + 1e-3


def test_thinning_before_the_delay_loses_nothing() -> None:
    """At 100 Hz four of five samples go. The delay differs from that of all samples by less than
    its standard error."""

    differences, errors = [], []
    for seed in range(3):
        flight = kinematic_flight(seed, seconds=120.0, rate=100.0)
        whole, thinned = (
            with_accelerations(flight),
            {delay.channel: delay for delay in delays(flight)},
        )
        for name in ("theta", "psi", "V"):
            path = cumulative_simpson(KINEMATICS[name][0](whole), dx=flight.step, initial=0.0)
            full = delay_between(whole[name], path, flight.step, BAND)
            thin = thinned[name]
            differences.append(abs(thin.seconds - full.seconds) / full.standard_error)
            errors.append(thin.standard_error / full.standard_error)
    assert max(differences) < 1.0
    assert np.sqrt(np.mean(np.square(differences))) < 0.5
    assert 0.7 < min(errors) <= max(errors) < 1.3


# The same flight in another file


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Path:
    """A workspace with the six flights of the small glider."""
    return shared.ingested(tmp_path_factory.mktemp("made") / "w").root


@pytest.mark.campaign
def test_a_repetition_is_kept_said_and_left_out_of_updates_until_the_other_is_retracted(
    flown: Path, tmp_path: Path
) -> None:
    rows = asked(flown, "flight", "list")
    assert all(row["counts"] for row in rows)
    third = channels(2)
    again = write_parquet(tmp_path / "third.parquet", third)
    part = write_csv(tmp_path / "part.csv", {name: values[40:] for name, values in third.items()})
    (whole,), (partly,) = (
        ingested(flown, again),
        ingested(flown, part),
    )  # one after the other: the first that is stored counts
    original = next(row["flight"] for row in rows if row["flight"] == whole["repeats"][0]["flight"])
    assert whole["status"] == partly["status"] == "duplicate"
    assert whole["repeats"][0]["share"] == 1.0
    (stretch,) = partly["repeats"][0]["stretches"]
    assert stretch["original_start"] - stretch["start"] == pytest.approx(0.0, abs=1e-6)
    assert stretch["end"] - stretch["start"] > 10.0
    model = tmp_path / "model.toml"
    model.write_text('[[increment]]\naxis = "CZ"\nterms = ["1", "alpha", "q_hat"]\n')
    update = ["update", "--vehicle", NAME, "--model", str(model), "--direct"]
    excluded = {
        entry["flight"]: entry["reason"] for entry in asked(flown, *update)["flights"]["excluded"]
    }
    assert set(excluded) == {whole["flight"], partly["flight"]}
    assert excluded[whole["flight"]] == (
        f"repeats flight flight3.csv ({original[:12]}) from 0 to 11.96 s"
    )
    shown = (
        CliRunner()
        .invoke(app, ["--workspace", str(flown), "flight", "show", whole["flight"]])
        .stdout
    )
    assert f"repeats flight {original[:12]}: 0 to 11.96 s match its 0 to 11.96 s" in shown
    assert "left out of updates" in shown
    listed = {row["flight"]: row["counts"] for row in asked(flown, "flight", "list")}
    assert [flight for flight, counts in listed.items() if not counts] == [
        f for f in listed if f in excluded
    ]
    asked(flown, "flight", "retract", original, "--reason", "its file is not the original")
    excluded = {
        entry["flight"]: entry["reason"] for entry in asked(flown, *update)["flights"]["excluded"]
    }
    assert set(excluded) == {
        original,
        partly["flight"],
    }, "the copy counts now, and its part does not"


def test_attas_ail_rud_is_recognised_through_the_command_line(
    measured: Callable[[str], Path], tmp_path: Path
) -> None:
    workspace = added(tmp_path / "w", tmp_path)
    ail, rud = ingested(
        workspace, *(measured(f"attas/fAttas{name}1.mat") for name in ("Ail", "Rud"))
    )
    (both,) = ingested(workspace, measured("attas/fAttasAilRud1.mat"))
    assert (ail["status"], rud["status"], both["status"]) == ("stored", "stored", "duplicate")
    assert [entry["flight"] for entry in both["repeats"]] == [ail["flight"], rud["flight"]]
    places = [(s["start"], s["end"]) for entry in both["repeats"] for s in entry["stretches"]]
    assert places == [
        pytest.approx((50.08, 80.08), abs=0.1),
        pytest.approx((110.16, 140.16), abs=0.1),
    ]
    assert all(entry["share"] == pytest.approx(0.5, abs=0.005) for entry in both["repeats"])
    assert ail["repeats"] == rud["repeats"] == []


def test_two_files_of_one_flight_that_come_at_once_do_not_both_count(tmp_path: Path) -> None:
    workspace = added(tmp_path / "w", tmp_path)
    flight = table(kinematic_flight(9, rate=25.0))
    logs = [write_csv(tmp_path / "a.csv", flight), write_parquet(tmp_path / "b.parquet", flight)]
    catalogue = Catalogue.open(Workspace.open(workspace).catalogue)
    run = catalogue.start_run("test", how="direct").id
    with ThreadPoolExecutor(2) as pool:
        outcomes = list(
            pool.map(
                lambda log: store_log(str(log), workspace=str(workspace), run=run, vehicle=NAME),
                logs,
            )
        )
    assert sorted(outcome["status"] for outcome in outcomes) == ["duplicate", "stored"]
    assert len(counted_out(catalogue, NAME)) == 1


def test_a_look_up_of_marks_reads_an_index_only(flown: Path) -> None:
    """However many flights are stored: the search is by mark, and nothing is scanned."""
    raw = sqlite3.connect(Workspace.open(flown).catalogue)
    plan = raw.execute(
        "EXPLAIN QUERY PLAN SELECT flight, count(*) FROM flight_fingerprints WHERE mark IN (1, 2)"
        " GROUP BY flight"
    )
    steps = [row[3] for row in plan]
    assert "SEARCH flight_fingerprints USING PRIMARY KEY (mark=?)" in steps
    assert not any(step.startswith("SCAN") for step in steps)
    assert raw.execute("SELECT count(*) FROM flight_fingerprints").fetchone()[0] > 50
    raw.close()


def test_of_a_chain_of_repetitions_the_first_counts_and_what_repeats_only_the_second(
    tmp_path: Path,
) -> None:
    """f2 repeats f1 and contains f3: f1 and f3 share nothing, so both count. A retracted f1 lets f2
    count instead of f3."""
    with Catalogue.open(tmp_path / "catalogue.sqlite") as catalogue:
        catalogue.add_vehicle(VEHICLE, "text")
        add_family(catalogue)
        part = (RepeatedStretch(1.0, 2.0, 3.0, 4.0, 50, 0.0),)
        for flight, original in (("f2", "f1"), ("f3", "f2")):
            catalogue.add_repeat(RepeatRow(h(flight), h(original), 0.5, part))
            catalogue.add_repeat(RepeatRow(h(flight), h(original), 0.5, part))
        assert len(catalogue.repeats(vehicle=VEHICLE)) == 2
        assert set(counted_out(catalogue, VEHICLE)) == {h("f2")}
        catalogue.retract_flight(h("f1"), "wrong")
        assert set(counted_out(catalogue, VEHICLE)) == {h("f3")}
        catalogue.judge_flight(h("f2"), "rejected", [said("wrong too")])
        assert counted_out(catalogue, VEHICLE) == {}
