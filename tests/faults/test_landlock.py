"""The process that reads a log sees that log only: no other file of the user, no network; where
the system does not see to that, `status` says so."""

import socket
from dataclasses import replace
from pathlib import Path

import pytest
from typer.testing import CliRunner

from aerodb.flows.cli.main import app
from aerodb.storage import confinement
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.landlock import landlock_version, see_only
from aerodb.storage.limits import Limits
from aerodb.storage.no_connections import can_refuse_connections
from aerodb.tasks.workers import parsed_log
from aerodb.tasks.workers.parsing import parsing
from aerodb.tasks.workers.pool import done
from tests.support.small_glider import channels, write_csv

pytestmark = pytest.mark.skipif(not landlock_version(), reason="no Landlock in this kernel")


#: What a reader that a log has taken over would try, after `_read` has confined it.
ATTEMPTS = """
import socket
from pathlib import Path
from aerodb.tasks.workers import parsing

log, folder, secret, port = Path({log!r}), Path({folder!r}), Path({secret!r}), {port}
answers = [parsing._read(log, folder)]
for attempt in (
    lambda: secret.read_bytes(),
    lambda: (log.parent / "made").write_text("x"),
    lambda: list(secret.parent.iterdir()),
    lambda: socket.create_connection(("127.0.0.1", port), 5).close(),
    lambda: socket.socket(socket.AF_INET, socket.SOCK_DGRAM).sendto(b"x", ("127.0.0.1", port)),
    lambda: socket.socket(socket.AF_UNIX).close(),
    lambda: log.read_bytes(),
):
    try:
        attempt()
        answers.append("done")
    except OSError as error:
        answers.append(type(error).__name__)
"""


def test_a_reader_that_was_taken_over_gets_nothing(tmp_path: Path) -> None:
    log = write_csv(tmp_path / "flight.csv", channels(0))
    secret = tmp_path / "private" / "secret.txt"
    secret.parent.mkdir()
    secret.write_text("secret")
    with socket.create_server(("127.0.0.1", 0)) as server:
        port = server.getsockname()[1]
        job = parsing(log, tmp_path / "out", Limits())
        code = ATTEMPTS.format(
            log=str(log), folder=str(tmp_path / "out"), secret=str(secret), port=port
        )
        words = f"(lambda names: (exec({code!r}, names), names['answers'])[1])({{}})"
        answers = done(replace(job, function=eval, arguments=(words,)))
    network = "PermissionError" if can_refuse_connections() else "done"
    assert answers == [None, *3 * ["PermissionError"], *3 * [network], "done"]
    assert (tmp_path / "out" / "topics").is_dir()


def test_a_log_is_read_as_before(tmp_path: Path) -> None:
    log = write_csv(tmp_path / "flight.csv", channels(0))
    (tmp_path / "store").mkdir()
    with parsed_log(log, tmp_path / "store" / "log", Limits()) as parsed:
        assert len(parsed.recording.topics) == 1
        parsed.keep(tmp_path / "store" / "log")
    assert [path.name for path in (tmp_path / "store").iterdir()] == ["log"]


def test_paths_that_are_not_there_are_left_out(tmp_path: Path) -> None:
    job = parsing(tmp_path, tmp_path / "out", Limits())
    assert done(replace(job, function=see_only, arguments=([tmp_path / "no"], []))) is True


def test_what_a_system_does_not_keep_a_reader_from_is_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = [confinement.reader_reach()]
    monkeypatch.setattr(confinement, "landlock_version", lambda: 0)
    kept.append(confinement.reader_reach())
    monkeypatch.setattr(confinement, "can_refuse_connections", lambda: False)
    assert kept == ["", "files that its user may read (no Landlock)"]
    Catalogue.open(tmp_path / "catalogue.sqlite").close()
    told = CliRunner().invoke(app, ["--workspace", str(tmp_path), "status"]).output
    assert "lets the process that reads a log reach files that its user may read" in told
    assert "and connections (no seccomp)" in told
