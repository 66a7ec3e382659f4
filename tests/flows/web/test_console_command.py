"""``aerodb web`` as the shell runs it: it says where it is, answers, ends when told to, and refuses
in one sentence."""

import json
import os
import re
import signal
import socket
import tempfile
import urllib.error
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import pytest

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from tests.support.command import aerodb
from tests.support.forking import Forked
from tests.support.paths import ROOT

TOKEN = "a token of some length"


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    opened = Workspace.open(tmp_path / "w")
    with Catalogue.open(opened.catalogue) as catalogue:
        catalogue.add_vehicle("glider", "text")
    return opened.root


@contextmanager
def running(
    workspace: Path,
    *options: str,
    token: str = "",
    descriptors: int = 0,
    errors: IO[bytes] | None = None,
) -> Iterator[tuple[Forked, str]]:
    """The command with a port of its own, and the address that it says.

    descriptors : hard limit of open ones (0: as it is). errors : file for what it says on stderr.
    """
    kept = {name: value for name, value in os.environ.items() if not name.startswith("AERODB_")}
    environment = {**kept, "PYTHONPATH": str(ROOT), "PYTHONUNBUFFERED": "1"}
    environment |= {"AERODB_TOKEN": token} if token else {}
    given = ["--workspace", str(workspace), "web", "--port", "0", *options]
    limit = f"import resource as r; r.setrlimit(r.RLIMIT_NOFILE, ({descriptors}, {descriptors}))\n"
    code = f"{limit if descriptors else ''}from aerodb.flows.cli import main; main()"
    reading, writing = os.pipe()
    with open(reading) as output, tempfile.TemporaryFile() as unnamed:
        errors = errors or unnamed
        with open(writing, "wb") as written:
            process = Forked(given, environment, written, errors, code=code)
        with process:
            try:
                said = output.readline()
                found = re.search(r"http://\S+?:(\d+)/", said)
                errors.seek(0)
                assert found, (said, errors.read())
                yield process, f"http://127.0.0.1:{found[1]}"
            finally:
                process.kill()
                process.wait(300)


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT])
def test_it_answers_until_it_is_told_to_stop(workspace: Path, how: signal.Signals) -> None:
    with running(workspace) as (process, address):
        with urllib.request.urlopen(f"{address}/api/vehicles", timeout=300) as answer:
            assert json.load(answer)[0]["vehicle"] == "glider"
            assert "server" not in answer.headers
        process.send_signal(how)
        process.wait(300)
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(f"{address}/", timeout=120)


def test_on_all_addresses_it_asks_for_the_token(workspace: Path) -> None:
    with running(workspace, "--host", "0.0.0.0", token=TOKEN) as (_, address):
        with pytest.raises(urllib.error.HTTPError, match="401"):
            urllib.request.urlopen(f"{address}/api/vehicles", timeout=300)
        request = urllib.request.Request(
            f"{address}/api/vehicles", headers={"Authorization": f"Bearer {TOKEN}"}
        )
        assert urllib.request.urlopen(request, timeout=300).status == 200


def test_what_it_cannot_do_is_said_in_a_sentence(workspace: Path, tmp_path: Path) -> None:
    without = aerodb(workspace, "web", "--host", "0.0.0.0")
    assert (
        without.returncode,
        "without a token" in without.stderr,
        "Traceback" in without.stderr,
    ) == (3, True, False)
    nowhere = aerodb(tmp_path / "nowhere", "web")
    assert (nowhere.returncode, "no workspace here" in nowhere.stderr) == (3, True)
    assert not (tmp_path / "nowhere").exists()
    with socket.create_server(("127.0.0.1", 0)) as taken:
        busy = aerodb(workspace, "web", "--port", str(taken.getsockname()[1]))
    assert busy.returncode == 1
    assert "cannot listen there" in busy.stderr
    assert "--port 0" in busy.stderr
