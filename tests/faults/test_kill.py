"""kill -9 at random moments of a per-flight run, a closed loop, an update and a promotion, followed
by the same run again.

Every log is stored once, no version is incomplete, verification finds nothing, and all ids, keys,
roles, name moves and files equal those of an undisturbed run.
"""

import json
import os
import signal
from collections import Counter
from pathlib import Path

import pytest

from tests.support.end_to_end import environment
from tests.support.forking import run_forked
from tests.support.paths import ROOT
from tests.support.shared_workspace import SharedWorkspaces

pytestmark = [pytest.mark.campaign, pytest.mark.skipif(os.name == "nt", reason="no SIGKILL")]


def test_whatever_is_killed_is_whole_after_the_next_run(
    shared: SharedWorkspaces, tmp_path: Path
) -> None:
    number = 300
    done = run_forked(
        [str(shared.undisturbed), str(tmp_path), "6", str(number)],
        environment(),
        ROOT,
        timeout=60 + 30 * number,
        code="from tests.faults.killing import main; main()",
    )
    assert done.returncode == 0, done.stderr
    told = [json.loads(line) for line in done.stdout.splitlines()]
    assert len(told) == number
    for entry in told:
        assert entry["code"] == -signal.SIGKILL, entry
        assert entry["bad"] == [], entry
        assert entry["again"] == 0, entry
        assert entry["wrong"] == [], entry
        assert entry["differs"] == [], entry
    stages = ["per_flight", "close_loop", "update", "promotion"]
    assert Counter(entry["stage"] for entry in told) == dict.fromkeys(stages, number // 4)
