"""Each step of the per-flight chain, and each error that it can raise on one flight: the others get all
their results, the flight says which file and what to do, and its log ends in one place."""

import hashlib
import importlib
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aerodb.flows.flight import flight_flow
from aerodb.flows.inbox import sweep_flow
from aerodb.flows.run import run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from aerodb.tasks.steps import ingest
from aerodb.tasks.steps.inbox import in_quarantine
from aerodb.tasks.view.status import status_of
from aerodb.tasks.workers import memory_cache
from aerodb.tasks.workspace_access import access_workspace
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME
from tests.support.sweeps import HERE, QUICK, events, kinds, left

STEPS = "aerodb.tasks.steps"
#: Function that fails -> where the flight is afterwards; "measured": rejected, with coefficients of the
#: channels as they were measured.
POINTS = {
    "aerodb.logs.usable_flight.map_recording": "quarantined",
    "aerodb.logs.usable_flight.flag_unusable": "quarantined",
    f"{STEPS}.ingest.examined": "quarantined",
    "aerodb.suspicions.every.against_vehicle": "quarantined",
    f"{STEPS}.ingest.fingerprint": "quarantined",
    f"{STEPS}.consistency.make_consistent": "rejected",
    "aerodb.consistency.whole_flight.decimated_records": "measured",
    f"{STEPS}.consistency.load_conditioning": "rejected",
    f"{STEPS}.coefficients.bandwidth_of": "rejected",
    f"{STEPS}.coefficients.total_coefficients": "rejected",
    f"{STEPS}.coefficients.with_mass_channels": "rejected",
    f"{STEPS}.compare.compare": "kept",
}
ERRORS = {
    "linear algebra": np.linalg.LinAlgError("SVD did not converge"),
    "division": ZeroDivisionError("float division by zero"),
    "floating point": FloatingPointError("overflow encountered in exp"),
    "index": IndexError("index 7 is out of bounds"),
    "recursion": RecursionError("maximum recursion depth exceeded"),
    "runtime": RuntimeError("no convergence"),
}
BAD, GOOD = "flight2.csv", ["flight1.csv", "flight3.csv"]


@pytest.fixture
def workspace(tmp_path: Path, shared: SharedWorkspaces) -> Workspace:
    memory_cache.clear_cache()  # a comparison that is remembered would not fail
    made = shared.prepared(tmp_path / "w")
    (made.root / "settings.toml").write_text(QUICK + HERE, encoding="utf-8")
    (made.inbox / NAME).mkdir()
    return made


def fail(patched: pytest.MonkeyPatch, name: str, sha256: str, error: BaseException) -> list[int]:
    """Let a function raise for the flight of one log; the list counts how often it did."""
    module, _, attribute = name.rpartition(".")
    within = importlib.import_module(module)
    original: Callable[..., Any] = getattr(within, attribute)
    count: list[int] = []

    def failing(*args: Any, **keywords: Any) -> Any:
        marks = {getattr(arg, key, None) for arg in args for key in ("log_sha256", "sha256")}
        if sha256 in marks:
            count.append(1)
            raise error
        return original(*args, **keywords)

    patched.setattr(within, attribute, failing)
    return count


def state(workspace: Workspace) -> dict[str, tuple[str, str]]:
    """Log -> verdict and reasons of its flight."""
    with Catalogue.open(workspace.catalogue) as catalogue:
        return {
            catalogue.log(row.log_sha256).name: (row.verdict, "; ".join(row.reasons))
            for row in catalogue.flights(NAME)
        }


def sha256_of(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()


def check(
    workspace: Workspace, outcomes: dict[str, dict[str, Any]], expected: str, error: str
) -> None:
    for name in GOOD:
        outcome = outcomes[name]
        assert outcome["status"] == "stored"
        assert outcome["coefficients"]["key"]
        assert outcome["comparison"]["key"]
        assert outcome["consistency"]["key"]
    found, bad = state(workspace), outcomes[BAD]
    assert set(found) >= set(GOOD)
    assert not any(error in reasons for name, (_, reasons) in found.items() if name in GOOD)
    access = access_workspace(str(workspace.root))
    aside = [entry.name for entry in in_quarantine(access)]
    if expected == "quarantined":
        assert bad["status"] == "refused"
        assert error in bad["what"]
        assert BAD in bad["where"]
        assert "fault of aerodb" in bad["remedy"]
        assert BAD not in found
        assert aside == [BAD]
        return
    assert bad["status"] == "stored"
    assert aside == []
    if expected in ("rejected", "measured"):
        assert found[BAD][0] == "rejected"
        assert error in found[BAD][1]
        assert "fault of aerodb" in found[BAD][1]
        (shown,) = status_of(access)["vehicles"][0]["rejected"]
        assert (shown["log"], shown["reason"]) == (BAD, found[BAD][1])
        assert (bad["coefficients"]["key"] is None) == (expected == "rejected")
    else:
        reasons = [found[BAD][1], *(str((bad[step] or {}).get("reason")) for step in _LATER)]
        assert any(error in reason and "fault of aerodb" in reason for reason in reasons)


_LATER = ("coefficients", "comparison")


@pytest.mark.parametrize(("point", "kind"), [
    pytest.param(
        point, list(ERRORS)[(k + shift) % len(ERRORS)], marks=pytest.mark.campaign if shift else []
    )
    for k, point in enumerate(POINTS) for shift in (0, 3)
])  # fmt: skip
def test_one_flight_that_a_step_cannot_bear(
    workspace: Workspace,
    logs: list[Path],
    monkeypatch: pytest.MonkeyPatch,
    point: str,
    kind: str,
) -> None:
    called = fail(monkeypatch, point, sha256_of(logs[1]), ERRORS[kind])
    given = {"logs": [str(path) for path in logs[:3]], "vehicle": NAME}
    documents = run_flow(flight_flow, given, workspace, "direct")
    assert called
    outcomes = {Path(document["log"]).name: document for document in documents}
    check(workspace, outcomes, POINTS[point], type(ERRORS[kind]).__name__)


@pytest.mark.parametrize(
    "point",
    [
        pytest.param(point, marks=pytest.mark.campaign if k % 3 else [])
        for k, point in enumerate(POINTS)
    ],
)
def test_log_of_the_inbox_ends_in_one_place(
    workspace: Workspace, logs: list[Path], monkeypatch: pytest.MonkeyPatch, point: str
) -> None:
    for path in logs[:3]:
        shutil.copy(path, workspace.inbox / NAME)
    called = fail(monkeypatch, point, sha256_of(logs[1]), ERRORS["linear algebra"])
    document = run_flow(sweep_flow, {}, workspace, "direct")
    assert called
    expected = "quarantined" if POINTS[point] == "quarantined" else "stored"
    assert kinds(document) == {BAD: expected, **dict.fromkeys(GOOD, "stored")}
    assert left(workspace) == []
    with Catalogue.open(workspace.catalogue) as catalogue:
        flights = catalogue.flights(NAME, log_sha256=sha256_of(logs[1]))
    aside = status_of(access_workspace(str(workspace.root)))["quarantined"]
    assert len(flights) + aside["count"] == 1
    assert [entry["name"] for entry in aside["newest"]] == [BAD] * (expected == "quarantined")


def test_error_that_no_step_foresees_stays_with_its_flight(
    workspace: Workspace, logs: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It ended the batch, and after three tries the log was quarantined beside its flight."""

    class Unforeseen(Exception):
        pass

    for path in logs[:3]:
        shutil.copy(path, workspace.inbox / NAME)
    bad = sha256_of(logs[1])
    fail(monkeypatch, f"{STEPS}.consistency.make_consistent", bad, Unforeseen("x"))
    document = run_flow(sweep_flow, {}, workspace, "direct")
    assert kinds(document) == dict.fromkeys([BAD, *GOOD], "stored")
    assert left(workspace) == []
    assert events(workspace, "quarantined") == []
    assert events(workspace, "failed") == []
    assert len(events(workspace, "stored")) == 3
    found = state(workspace)
    assert found[BAD][0] == "rejected"
    assert f"({BAD}): the consistency step failed (Unforeseen: x)" in found[BAD][1]
    assert {found[name][0] for name in GOOD} <= {"good", "limited"}
    status = status_of(access_workspace(str(workspace.root)))
    assert status["quarantined"]["count"] == 0
    assert not list((workspace.root / "quarantine").iterdir())


@pytest.mark.parametrize("name", ["usable_flight", "write_flight", "repeat_documents"])
def test_error_that_no_step_foresees_ends_no_batch_of_the_command_line(
    workspace: Workspace, logs: list[Path], monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Also where a step keeps its result, which nothing watched."""

    class Unforeseen(Exception):
        pass

    bad, original = sha256_of(logs[1]), getattr(ingest, name)

    def failing(*args: Any, **keywords: Any) -> Any:
        if bad in [getattr(arg, "log_sha256", getattr(arg, "sha256", arg)) for arg in args]:
            raise Unforeseen("x")
        return original(*args, **keywords)

    monkeypatch.setattr(ingest, name, failing)
    given = {"logs": [str(path) for path in logs[:3]], "vehicle": NAME}
    first, refused, last = run_flow(flight_flow, given, workspace, "direct")
    for outcome in (first, last):
        assert outcome["status"] == "stored"
        assert outcome["coefficients"]["key"]
    assert refused["status"] == "refused"
    assert "failed (Unforeseen: x)" in refused["what"]
    assert Path(refused["where"]).name == BAD


def test_log_that_gets_no_memory_waits_and_holds_nobody_up(
    workspace: Workspace, logs: list[Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    for path in logs[:3]:
        shutil.copy(path, workspace.inbox / NAME)
    with monkeypatch.context() as patched:
        asked = MemoryError("Unable to allocate 659. GiB")
        fail(patched, "aerodb.logs.usable_flight.map_recording", sha256_of(logs[1]), asked)
        document = run_flow(sweep_flow, {}, workspace, "direct")
    assert kinds(document) == {BAD: "failed", **dict.fromkeys(GOOD, "stored")}
    (reason,) = [entry["reason"] for entry in document["files"] if entry["kind"] == "failed"]
    assert "gets no memory (MemoryError: Unable to allocate 659. GiB)" in reason
    assert left(workspace) == [f"{NAME}/{BAD}"]
    assert kinds(run_flow(sweep_flow, {}, workspace, "direct")) == {BAD: "stored"}


@pytest.mark.parametrize("step", ["consistency.make_consistent", "coefficients.total_coefficients"])
def test_flight_that_gets_no_memory_is_done_when_there_is_some(
    workspace: Workspace, logs: list[Path], monkeypatch: pytest.MonkeyPatch, step: str
) -> None:
    given = {"logs": [str(path) for path in logs[:3]], "vehicle": NAME}
    with monkeypatch.context() as patched:
        fail(patched, f"{STEPS}.{step}", sha256_of(logs[1]), MemoryError("Unable to allocate"))
        documents = run_flow(flight_flow, given, workspace, "direct")
    assert [bool(document["coefficients"]["key"]) for document in documents] == [True, False, True]
    assert state(workspace)[BAD][0] == "rejected"
    documents = run_flow(flight_flow, given, workspace, "direct")
    assert all(document["coefficients"]["key"] for document in documents)
    assert state(workspace)[BAD][0] != "rejected"
