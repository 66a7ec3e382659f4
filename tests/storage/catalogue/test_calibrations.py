"""Calibrations: immutable versions of sensor parameters, created explicitly, to which flights are
bound."""

from collections import Counter
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from aerodb.consistency.calibration import Calibration, drift, from_document
from aerodb.consistency.output_error.posterior import SensorEstimates
from aerodb.errors import InputError, UnknownNameError
from aerodb.flows.cli.main import app
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from tests.support.catalogue_samples import V, add_flight, h
from tests.support.command import asked
from tests.support.consistent_flights import NAME, PLANTED, VEHICLE, log, table
from tests.support.terminal import on_terminal

SENSORS = {name: value for name, value in PLANTED.items() if not name.startswith("wind")}


def _calibration(**changes: Any) -> Calibration:
    values = {
        "vehicle": V,
        "names": ("q_bias", "alpha_bias"),
        "values": np.array([0.002, 0.01]),
        "covariance": np.array([[4e-8, 1e-8], [1e-8, 1e-6]]),
        "flights": ("one", "two"),
    }
    return Calibration(**{**values, **changes})


def test_a_calibration_survives_json_and_has_one_identity() -> None:
    """The same content has the same id, whatever the order of its flights; another value
    another."""
    first = _calibration(valid_from=datetime(2026, 1, 2, tzinfo=UTC))
    again = from_document(first.document())
    assert again.id == first.id
    assert again.valid_from == first.valid_from
    np.testing.assert_array_equal(again.covariance, first.covariance)
    assert _calibration(flights=("two", "one")).id == _calibration().id
    assert _calibration(values=np.array([0.002, 0.011])).id != _calibration().id
    assert first.id != _calibration().id


def test_broken_calibrations_are_refused() -> None:
    with pytest.raises(InputError, match="covariance is not positive"):
        _calibration(covariance=np.array([[1.0, 2.0], [2.0, 1.0]]))
    with pytest.raises(InputError, match="2 names"):
        _calibration(values=np.zeros(3))
    with pytest.raises(InputError, match="not a calibration"):
        from_document({"vehicle": V})


def test_validity_is_by_the_start_of_a_flight() -> None:
    bounded = _calibration(
        valid_from=datetime(2026, 1, 2, tzinfo=UTC), valid_until=datetime(2026, 2, 2, tzinfo=UTC)
    )
    for day, valid in ((1, False), (2, True), (30, True)):
        assert bounded.valid_at(datetime(2026, 1, day, tzinfo=UTC)) is valid
    assert not bounded.valid_at(datetime(2026, 2, 2, tzinfo=UTC))
    assert not bounded.valid_at(None)
    assert _calibration().valid_at(None)


def test_knowledge_combines_as_normal_variables_do() -> None:
    """The Kalman update and conditioning against the information form, written out."""
    rng = np.random.default_rng(4)
    root = rng.standard_normal((3, 3))
    found = SensorEstimates(("a", "b", "c"), rng.standard_normal(3), root @ root.T)
    prior, spread = np.array([0.3, -0.2]), np.array([[0.5, 0.1], [0.1, 0.4]])
    combined = found.updated(("c", "a"), prior, spread)
    pick = np.array([[0.0, 0, 1], [1, 0, 0]])
    precision = np.linalg.inv(found.covariance) + pick.T @ np.linalg.inv(spread) @ pick
    expected = np.linalg.solve(
        precision,
        np.linalg.solve(found.covariance, found.values) + pick.T @ np.linalg.solve(spread, prior),
    )
    np.testing.assert_allclose(combined.values, expected)
    np.testing.assert_allclose(combined.covariance, np.linalg.inv(precision))
    exact = found.updated(("b",), np.zeros(1), np.array([[1e-12]]))
    left = found.conditioned_on_zero("b")
    assert left.names == ("a", "c")
    np.testing.assert_allclose(left.values, exact.values[[0, 2]], atol=1e-9)
    np.testing.assert_allclose(left.covariance, exact.covariance[np.ix_([0, 2], [0, 2])], atol=1e-9)


def test_drift_is_beyond_three_standard_errors_of_both() -> None:
    calibration = _calibration()
    assert (
        drift(calibration, ("q_bias", "beta_bias"), np.array([0.0025, 9.0]), np.array([2e-4, 1e-3]))
        == ()
    )
    (found,) = drift(calibration, ("q_bias",), np.array([0.0035]), np.array([2e-4]))
    assert found.distance == pytest.approx(0.0015 / np.hypot(2e-4, 2e-4))
    assert found.because.startswith("recalibrate: q_bias has drifted by 5.3 standard errors")


@pytest.fixture
def catalogue(tmp_path: Path) -> Any:
    with Catalogue.open(tmp_path / "catalogue.sqlite") as opened:
        opened.add_vehicle(V, "text")
        yield opened


def test_the_ledger_keeps_every_calibration_and_the_newest_binding(catalogue: Catalogue) -> None:
    flight = add_flight(catalogue, "f1")
    first, second = _calibration(), _calibration(values=np.array([0.001, 0.02]))
    row = catalogue.add_calibration(first.id, vehicle=V, content=first.document(), reason="first")
    assert (
        catalogue.add_calibration(first.id, vehicle=V, content=first.document(), reason="again")
        == row
    )
    other = catalogue.add_calibration(
        second.id, vehicle=V, content=second.document(), reason="second"
    )
    assert [entry.label for entry in catalogue.calibrations(V)] == ["c0001", "c0002"]
    assert (other.parent, other.reason) == (first.id, "second")
    assert catalogue.calibration(V, "c0002") == catalogue.calibration(V, second.id[:10]) == other
    assert from_document(row.content).id == first.id
    assert catalogue.calibration_of(flight) is None
    for calibration in (first, second, second):
        catalogue.bind_flight(flight, calibration.id)
    bound = catalogue.calibration_of(flight)
    assert bound is not None
    assert bound.label == "c0002"
    assert catalogue.flights_bound_to(second.id) == (flight,)
    assert catalogue.flights_bound_to(first.id) == ()


def test_the_ledger_refuses(catalogue: Catalogue) -> None:
    flight, made = add_flight(catalogue, "f1"), _calibration()
    with pytest.raises(InputError, match="requires a reason"):
        catalogue.add_calibration(made.id, vehicle=V, content=made.document(), reason=" ")
    with pytest.raises(InputError, match="not belong to vehicle"):
        catalogue.bind_flight(flight, h("unknown calibration"))
    with pytest.raises(UnknownNameError, match="unknown calibration 'c0001'"):
        catalogue.calibration(V, "c0001")
    with pytest.raises(UnknownNameError, match="unknown flight"):
        catalogue.bind_flight("nothing", made.id)


@pytest.fixture(scope="module")
def campaign(
    tmp_path_factory: pytest.TempPathFactory,
) -> tuple[Path, Path, list[dict[str, Any]], dict[str, Any]]:
    """Folder, workspace, documents of three flights with the same sensor errors and other winds,
    and of their recalibration."""
    folder = tmp_path_factory.mktemp("campaign")
    (folder / "vehicle.toml").write_text(VEHICLE, encoding="utf-8")
    workspace = folder / "w"
    asked(workspace, "vehicle", "add", str(folder / "vehicle.toml"))
    logs = []
    for number in range(3):
        planted = {**PLANTED, "wind_north": 3.0 * number, "wind_east": -2.0}
        logs.append(
            log(
                folder, f"flight{number}", table(number, planted, seconds=30.0, start=40.0 * number)
            )
        )
    outcomes = asked(workspace, "flight", "ingest", *map(str, logs), "--vehicle", NAME, "--direct")
    made = asked(
        workspace, "recalibrate", "--vehicle", NAME, "--reason", "first campaign", "--direct"
    )
    return folder, workspace, outcomes, made


def _results(workspace: Path) -> dict[str, int]:
    with Catalogue.open(Workspace.open(workspace).catalogue) as catalogue:
        return {row.id: len(catalogue.results_of(row.id)) for row in catalogue.flights(NAME)}


def test_recalibration_finds_what_the_flights_share(campaign: Any) -> None:
    """Every planted sensor error within three standard errors, which are smaller than those of any
    one flight."""
    _, workspace, outcomes, made = campaign
    assert made["label"] == "c0001"
    assert sorted(made["flights"]) == sorted(outcome["flight"] for outcome in outcomes)
    for name, value in SENSORS.items():
        found = made["parameters"][name]
        assert abs(found["value"] - value) < 3 * found["standard_error"], name
        alone = {
            e["parameter"]: e["standard_error"] for e in outcomes[0]["consistency"]["estimates"]
        }
        assert found["standard_error"] < alone[name], name
    assert not [
        name for name in made["parameters"] if name.startswith("wind") or name.endswith("_scale")
    ]
    for flight, document in made["consistency"].items():
        assert document["calibration"] == made["calibration"]
        assert document["drift"] == []
        applied = {e["parameter"]: e["value"] for e in document["estimates"] if e["applied"]}
        assert applied["alpha_bias"] == pytest.approx(made["parameters"]["alpha_bias"]["value"]), (
            flight
        )
    (listed,) = asked(workspace, "calibration", "list")
    assert sorted(listed["bound"]) == sorted(made["flights"])
    shown = asked(workspace, "calibration", "show", "c0001")
    assert (shown["reason"], shown["parent"]) == ("first campaign", None)
    assert shown["parameters"]["q_bias"] == made["parameters"]["q_bias"]


@pytest.mark.parametrize("columns", [80, 120])
def test_a_recalibration_begins_with_what_it_knows_best(campaign: Any, columns: int) -> None:
    _, workspace, _, made = campaign
    words = ("recalibrate", "--vehicle", NAME, "--reason", "once more", "--direct")
    code, lines = on_terminal(workspace, columns, *words)
    assert code == 0
    counts = Counter(document["verdict"] for document in made["consistency"].values())
    verdicts = ", ".join(f"{counts[name]} {name}" for name in sorted(counts))
    assert lines[0] == f"{NAME}: calibration c0001 from 3 flights ({verdicts})"
    (command,) = [k for k, line in enumerate(lines, 1) if line.startswith("  next ")]
    assert command <= 5
    assert lines[command - 1].endswith(f"aerodb close-loop --vehicle {NAME}")
    parameters = made["parameters"]
    best = max(
        parameters, key=lambda n: abs(parameters[n]["value"]) / parameters[n]["standard_error"]
    )
    assert lines[1].split()[2] == best
    rows = {line.split()[0] for line in lines if line.split()[:1]}
    assert rows >= set(parameters), "every error has its line"
    flights = sum(line.split()[1:2] == ["good"] for line in lines)
    assert flights == counts["good"]
    assert len(lines) <= command + 4 + len(parameters) + 2 + 2 * 3 + 1
    _, whole = on_terminal(workspace, columns, *words, "-v")
    assert sum("mismatch before" in line for line in whole) == 3
    assert not any("mismatch before" in line for line in lines)


def test_between_recalibrations_nothing_is_computed_anew(campaign: Any) -> None:
    folder, workspace, outcomes, made = campaign
    before = _results(workspace)
    again = asked(
        workspace,
        "flight",
        "ingest",
        str(folder / "flight0.parquet"),
        "--vehicle",
        NAME,
        "--direct",
    )
    assert again[0]["consistency"]["calibration"] == made["calibration"]
    assert again[0]["consistency"]["key"] != outcomes[0]["consistency"]["key"]
    assert _results(workspace) == before
    same = asked(workspace, "recalibrate", "--vehicle", NAME, "--reason", "once more", "--direct")
    assert same["calibration"] == made["calibration"]
    assert len(asked(workspace, "calibration", "list")) == 1
    assert _results(workspace) == before


def test_later_flights_are_bound_and_drift_is_said(campaign: Any) -> None:
    """A flight with the calibrated sensors agrees; one whose pitch gyro has moved says so in its
    document and on stderr."""
    folder, workspace, _, made = campaign
    good = log(folder, "later", table(11, PLANTED, seconds=30.0, start=200.0))
    moved = log(folder, "moved", table(12, {**PLANTED, "q_bias": 0.004}, seconds=30.0, start=260.0))
    (fine,) = asked(workspace, "flight", "ingest", str(good), "--vehicle", NAME, "--direct")
    assert (fine["consistency"]["calibration"], fine["consistency"]["drift"]) == (
        made["calibration"],
        [],
    )
    done = CliRunner().invoke(
        app,
        [
            "--workspace",
            str(workspace),
            "flight",
            "ingest",
            str(moved),
            "--vehicle",
            NAME,
            "--direct",
        ],
    )
    assert done.exit_code == 0
    assert "recalibrate: q_bias has drifted" in done.stderr
    shown = asked(workspace, "flight", "list")
    assert all(row["verdict"] == "good" for row in shown[:1])


def test_a_flight_processed_before_stays_without(tmp_path: Path) -> None:
    """A calibration made of other flights changes nothing of one that was processed before it,
    until it is recalibrated."""
    (tmp_path / "vehicle.toml").write_text(VEHICLE, encoding="utf-8")
    workspace = tmp_path / "w"
    asked(workspace, "vehicle", "add", str(tmp_path / "vehicle.toml"))
    logs = [
        log(tmp_path, f"f{number}", table(number, seconds=20.0, start=30.0 * number))
        for number in range(2)
    ]
    first, second = asked(
        workspace, "flight", "ingest", *map(str, logs), "--vehicle", NAME, "--direct"
    )
    option = ("--flights", second["flight"][:12], "--reason", "the second alone", "--direct")
    made = asked(workspace, "recalibrate", "--vehicle", NAME, *option)
    assert made["flights"] == [second["flight"]]
    again = asked(workspace, "flight", "ingest", str(logs[0]), "--vehicle", NAME, "--direct")
    assert again[0]["consistency"] == first["consistency"]
    assert again[0]["consistency"]["calibration"] is None


def test_recalibration_without_a_reason_or_flight_is_refused(tmp_path: Path) -> None:
    (tmp_path / "vehicle.toml").write_text(VEHICLE, encoding="utf-8")
    asked(tmp_path / "w", "vehicle", "add", str(tmp_path / "vehicle.toml"))
    for reason, complaint in (("r", "no flight is stored"), (" ", "requires a reason")):
        command = [
            "--workspace",
            str(tmp_path / "w"),
            "recalibrate",
            "--vehicle",
            NAME,
            "--reason",
            reason,
            "--direct",
        ]
        done = CliRunner().invoke(app, command)
        assert isinstance(done.exception, InputError)
        assert complaint in str(done.exception)
