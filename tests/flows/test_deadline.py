"""A run that takes longer than it may ends, says so, and what it stored stays."""

import threading
import time
from pathlib import Path
from typing import Any

import pytest

from aerodb.flows.deadline import OutOfTimeError, at_most
from aerodb.flows.run import Steps, requires, run_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from tests.support.clusters import noting, slow


@requires("read")
def hanging(steps: Steps, *, workspace: str, run: str) -> None:
    """A flow that deals with every error of its steps, as the sweep does with those of logs."""
    where: dict[str, Any] = {"workspace": workspace, "run": run}
    steps.map(noting, [1], **where)
    try:
        steps.map(slow, [0.2] * 3000, **where)
    except Exception:
        steps.map(noting, [2], **where)


def test_a_run_ends_in_time_whatever_it_would_deal_with(tmp_path: Path) -> None:
    workspace = Workspace.open(tmp_path)
    Catalogue.open(workspace.catalogue).close()
    (tmp_path / "settings.toml").write_text('[limits]\nrun = "3 s"\n', encoding="utf-8")
    begun = time.monotonic()
    with pytest.raises(OutOfTimeError, match="took longer than 3 s"):
        run_flow(hanging, {}, workspace, "direct")
    assert time.monotonic() - begun < 150.0
    assert (tmp_path / "begun.txt").read_text() == "1\n"
    with Catalogue.open(workspace.catalogue) as catalogue:
        (run,) = catalogue.runs()
    assert run.state == "failed"
    assert "[limits] run" in run.error
    assert not list((tmp_path / "locks").glob("run-*"))


def test_what_is_done_in_time_is_left_alone_and_nothing_rings_later() -> None:
    with at_most(1.0, "here"):
        pass
    time.sleep(1.2)
    made = []
    worker = threading.Thread(target=lambda: made.append(_in_a_thread()))
    worker.start()
    worker.join()
    assert made == [True]


def _in_a_thread() -> bool:
    """Only the main thread can be interrupted: another one is let be."""
    with at_most(0.05, "there"):
        time.sleep(0.2)
    return True
