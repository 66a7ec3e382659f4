"""Runs: nothing twice, one bad log stops no other, and every run is recorded with its end."""

import hashlib
import threading
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aerodb.coefficients.total import total_coefficients
from aerodb.errors import InputError
from aerodb.flows.flight import flight_flow
from aerodb.flows.importing import import_flow
from aerodb.flows.run import DirectSteps, run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from aerodb.tasks.steps.coefficients import load_coefficients
from aerodb.tasks.steps.ingest import load_flight
from aerodb.tasks.workspace_access import access_workspace
from tests.support import small_glider
from tests.support.glider_runs import ingest_and_update, rows, stored, ways
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME, state_of


@pytest.fixture(scope="module")
def direct(
    tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces
) -> tuple[Workspace, dict[str, Any]]:
    """Workspace and update's document of the run of three flights without Prefect."""
    return shared.updated(tmp_path_factory.mktemp("direct"), flights=3)


def test_everything_a_second_time_changes_nothing(
    logs: list[Path], direct: tuple[Workspace, dict[str, Any]]
) -> None:
    workspace, document = direct
    ingest_and_update(workspace, logs[:3])  # its report names this workspace, a copy
    files, counted, kept = state_of(workspace.root), rows(workspace), stored(workspace)
    assert any(name.startswith("reports/") for name in files)
    again = ingest_and_update(workspace, logs[:3])
    assert again == document
    assert state_of(workspace.root) == files
    assert rows(workspace) == counted
    assert stored(workspace) == kept
    database = {"file": str(logs[0].parent / "database.toml"), "vehicle": NAME, "bindings": {}}
    run_flow(import_flow, database, workspace, "direct")
    assert rows(workspace) == counted


def test_one_bad_log_stops_no_other(
    tmp_path: Path, logs: list[Path], shared: SharedWorkspaces
) -> None:
    """Also one that is fine but belongs to another vehicle: its refusal once came as an exception
    and ended the run."""
    workspace = shared.prepared(tmp_path / "w")
    other = small_glider.VEHICLE.replace(NAME, "other-glider")
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_vehicle("other-glider", other)
    run_flow(flight_flow, {"logs": [str(logs[0])], "vehicle": "other-glider"}, workspace, "direct")
    empty, absent = tmp_path / "empty.csv", tmp_path / "absent.csv"
    empty.write_bytes(b"")
    given = [str(path) for path in (empty, logs[1], logs[0], absent, tmp_path, logs[2])]
    outcomes = run_flow(flight_flow, {"logs": given, "vehicle": NAME}, workspace, "direct")
    assert [outcome["log"] for outcome in outcomes] == given
    assert [outcome["status"] for outcome in outcomes] == [
        "refused",
        "stored",
        "refused",
        "refused",
        "refused",
        "stored",
    ]
    assert "already stored for vehicle 'other-glider'" in outcomes[2]["what"]
    assert all(
        outcome["comparison"]["key"] for outcome in outcomes if outcome["status"] == "stored"
    )
    held = [path.parent.name for path in (workspace.root / "quarantine").glob("*/reason.json")]
    assert held == [hashlib.sha256(b"").hexdigest()], (
        "only what is wrong with the bytes themselves goes to quarantine"
    )
    assert [entry[2] for entry in ways(workspace)] == ["completed"] * 3


class ThreadedSteps(DirectSteps):
    """All items of a step at once, as an orchestrator may run them."""

    def map(
        self, step: Callable[..., Any], items: Iterable[Any], *args: Any, **keywords: Any
    ) -> list[Any]:
        todo = list(items)
        together = threading.Barrier(max(len(todo), 1))

        def one(item: Any) -> Any:
            together.wait(timeout=300)
            return step(item, *args, **keywords)

        with ThreadPoolExecutor(max(len(todo), 1)) as pool:
            return list(pool.map(one, todo))


def test_the_same_bytes_under_several_names_at_once_are_one_flight(
    tmp_path: Path, logs: list[Path], shared: SharedWorkspaces
) -> None:
    """Copies of a log taken in side by side once met in the store, and the later ones died with an
    error of the disk."""
    workspace = shared.prepared(tmp_path / "w")
    names = [tmp_path / f"{k}.csv" for k in range(6)] + [
        tmp_path / f"empty{k}.csv" for k in range(3)
    ]
    for name in names:
        name.write_bytes(b"" if name.name.startswith("empty") else logs[0].read_bytes())
    given = {"workspace": str(workspace.root), "run": _run_of(workspace), "vehicle": NAME}
    outcomes = flight_flow(ThreadedSteps(), logs=[str(name) for name in names], **given)
    assert {outcome["status"] for outcome in outcomes[:6]} <= {"stored", "duplicate"}
    assert [outcome["status"] for outcome in outcomes[6:]] == ["refused"] * 3
    alone = shared.prepared(tmp_path / "alone")
    run_flow(flight_flow, {"logs": [str(logs[0])], "vehicle": NAME}, alone, "direct")
    assert stored(workspace) == stored(alone)
    files = state_of(workspace.root)
    assert set(files) == set(state_of(alone.root)), "and no temporary file is left"
    assert len(list((workspace.root / "quarantine").iterdir())) == 1


def _run_of(workspace: Workspace) -> str:
    with Catalogue.open(workspace.catalogue) as catalogue:
        return catalogue.start_run("flight_flow", how="direct").id


def test_a_run_that_fails_is_recorded_with_its_error(
    tmp_path: Path, logs: list[Path], shared: SharedWorkspaces
) -> None:
    workspace = shared.prepared(tmp_path / "w")
    kept = stored(workspace)
    missing = {"file": str(tmp_path / "database.xyz"), "vehicle": NAME, "bindings": {}}
    (tmp_path / "database.xyz").write_text("x")
    with pytest.raises(InputError, match="no importer"):
        run_flow(import_flow, missing, workspace, "direct")
    with Catalogue.open(workspace.catalogue) as catalogue:
        failed = catalogue.runs("failed")
    assert len(failed) == 1
    assert "no importer for '.xyz'" in failed[0].error
    assert failed[0].ended_utc is not None
    assert failed[0].ended_utc >= failed[0].started_utc
    assert stored(workspace) == kept


def test_progress_is_told_step_by_step(
    tmp_path: Path, logs: list[Path], shared: SharedWorkspaces
) -> None:
    told: list[tuple[str, int, int]] = []
    workspace = shared.prepared(tmp_path / "w")
    parameters = {"logs": [str(log) for log in logs[:2]], "vehicle": NAME}
    run_flow(
        flight_flow,
        parameters,
        workspace,
        "direct",
        lambda step, done, total: told.append((step, done, total)),
    )
    steps = (
        "ingest.store_log",
        "consistency.check_consistency",
        "coefficients.reconstruct",
        "compare.compare_with_version",
    )
    assert told == [(step, done, 2) for step in steps for done in (0, 1, 2)]


def test_the_mapping_that_was_asked_for_last_counts(
    tmp_path: Path, logs: list[Path], shared: SharedWorkspaces
) -> None:
    """Mapped one way, then another, then the first again: the flight once stayed on the second."""
    workspace = shared.prepared(tmp_path / "w")
    text = (files("aerodb.storage.mappings") / "canonical.toml").read_text(encoding="utf-8")
    other = tmp_path / "halved.toml"
    doubled = text.replace('name = "canonical"', 'name = "halved"')
    other.write_text(doubled.replace('field = "az"', 'field = "az", scale = 0.5'), encoding="utf-8")
    assert other.read_text(encoding="utf-8") != doubled

    def ingested(mapping: str) -> float:
        parameters = {"logs": [str(logs[0])], "vehicle": NAME, "mapping": mapping}
        (outcome,) = run_flow(flight_flow, parameters, workspace, "direct")
        access = access_workspace(str(workspace.root))
        return float(
            load_flight(access, access.catalogue.flight(outcome["flight"]), "")[0]["az"].mean()
        )

    first, second = ingested("canonical"), ingested(str(other))
    assert second == pytest.approx(0.5 * first)
    assert ingested("canonical") == first


def test_stored_coefficients_are_read_back_as_they_were_computed(
    direct: tuple[Workspace, dict[str, Any]],
) -> None:
    workspace, document = direct
    access = access_workspace(str(workspace.root))
    row = access.catalogue.flight(document["flights"]["identified"][0])
    loaded = load_coefficients(access, row, "")
    read, made = loaded.coefficients, total_coefficients(loaded.flight, access.vehicle(NAME)[0])
    assert list(read.values) == list(made.values)
    for axis in made.values:
        for side in ("values", "sigma", "usable"):
            np.testing.assert_array_equal(getattr(read, side)[axis], getattr(made, side)[axis])
    np.testing.assert_array_equal(read.moment_reference, made.moment_reference)
    assert (read.bandwidth, read.notes, read.flight) == (made.bandwidth, made.notes, made.flight)
