"""A log leaves the inbox only after its own bytes are archived; a file placed there meanwhile
stays, and a damaged archived copy is replaced."""

import hashlib
import os
from pathlib import Path

import pytest

from aerodb.errors import InputError
from aerodb.storage.inbox.folders import InboxFile, archive_log, archived_path, scan_inbox
from aerodb.storage.workspace import Workspace

LOG, CORRECTED = b"time,az\n0,x\n", b"time,az\n0,1\n"
SHA256 = hashlib.sha256(LOG).hexdigest()


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    made = Workspace.open(tmp_path / "w")
    (made.inbox / "glider").mkdir()
    return made


def waiting(workspace: Workspace, data: bytes = LOG) -> InboxFile:
    (workspace.inbox / "glider" / "a.csv").write_bytes(data)
    (entry,) = scan_inbox(workspace.inbox, ["glider"], settle=0.0)
    return entry


@pytest.mark.parametrize("how", ["renamed", "rewritten"])
@pytest.mark.parametrize("held", [True, False])
def test_a_corrected_log_put_there_meanwhile_stays(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch, how: str, held: bool
) -> None:
    path, reason = waiting(workspace).path, Workspace.write_reason
    if held:
        workspace.quarantine(path, SHA256, "no numbers")
        waiting(workspace)
    os.utime(path, ns=(1, 1))

    def meanwhile(self: Workspace, *arguments: str) -> None:
        if how == "renamed":
            path.with_name(".a.csv.part").write_bytes(CORRECTED)
            os.utime(path.with_name(".a.csv.part"), ns=(1, 1))
            os.replace(path.with_name(".a.csv.part"), path)
        else:
            path.write_bytes(CORRECTED)
        reason(self, *arguments)

    monkeypatch.setattr(Workspace, "write_reason", meanwhile)
    kept = workspace.quarantine(path, SHA256, "no numbers")
    assert (kept.read_bytes(), path.read_bytes()) == (LOG, CORRECTED)
    monkeypatch.undo()
    workspace.quarantine(waiting(workspace).path, SHA256, "no numbers")
    assert not path.exists(), "the log itself leaves"


def test_a_corrected_log_put_there_before_the_quarantine_stays(workspace: Workspace) -> None:
    workspace.quarantine(waiting(workspace).path, SHA256, "no numbers")
    path = waiting(workspace, CORRECTED).path
    kept = workspace.quarantine(path, SHA256, "no numbers")
    assert (kept.read_bytes(), path.read_bytes()) == (LOG, CORRECTED)


def test_a_damaged_log_in_quarantine_is_replaced_by_its_own_bytes_only(
    workspace: Workspace,
) -> None:
    kept = workspace.quarantine(waiting(workspace).path, SHA256, "no numbers")
    kept.write_bytes(LOG.upper())
    path = waiting(workspace, CORRECTED).path
    with pytest.raises(InputError, match="changed while it was read"):
        workspace.quarantine(path, SHA256, "no numbers")
    assert (kept.read_bytes(), path.read_bytes()) == (LOG.upper(), CORRECTED)
    assert workspace.quarantine(waiting(workspace).path, SHA256, "no numbers") == kept
    assert (kept.read_bytes(), path.exists()) == (LOG, False)


@pytest.mark.parametrize("suffix", [".csv", ".txt"])
@pytest.mark.parametrize("damaged", [True, False])
def test_a_damaged_copy_gives_way_and_a_sound_one_stays(
    workspace: Workspace, suffix: str, damaged: bool
) -> None:
    """The same size is not the same log; also where it came under another suffix before."""
    copy = workspace.log_path(SHA256, suffix)
    copy.write_bytes(LOG.upper() if damaged else LOG)
    before, entry = copy.stat().st_ino, waiting(workspace)
    assert archived_path(workspace, entry, SHA256) == copy
    archive_log(entry, copy, SHA256)
    assert (copy.read_bytes(), entry.path.exists()) == (LOG, False)
    assert (copy.stat().st_ino != before) is damaged
