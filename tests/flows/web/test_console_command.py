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
from tests.support.console_workspace import TOKEN
from tests.support.forking import Forked
from tests.support.paths import ROOT


def signed_in(address: str, token: str = TOKEN) -> urllib.request.Request:
    """A request that carries a token."""
    return urllib.request.Request(address, headers={"Authorization": f"Bearer {token}"})


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
    token: str = TOKEN,
    descriptors: int = 0,
    errors: IO[bytes] | None = None,
    said: list[str] | None = None,
) -> Iterator[tuple[Forked, str]]:
    """The command with a port of its own, and the address that it says.

    token : in its environment. descriptors : hard limit of open ones (0: as it is). errors : file for what it says on stderr.
    said : takes three further lines of what it says.
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
                first = output.readline()
                found = re.search(r"http://\S+?:(\d+)/", first)
                errors.seek(0)
                assert found, (first, errors.read())
                if said is not None:
                    said.extend(output.readline().strip() for _ in range(3))
                yield process, f"http://127.0.0.1:{found[1]}"
            finally:
                process.kill()
                process.wait(300)


@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT])
def test_it_answers_until_it_is_told_to_stop(workspace: Path, how: signal.Signals) -> None:
    with running(workspace) as (process, address):
        with urllib.request.urlopen(signed_in(f"{address}/api/vehicles"), timeout=300) as answer:
            assert json.load(answer)[0]["vehicle"] == "glider"
            assert "server" not in answer.headers
        process.send_signal(how)
        process.wait(300)
    with pytest.raises(urllib.error.URLError):
        urllib.request.urlopen(f"{address}/", timeout=120)


def test_on_all_addresses_it_asks_for_the_token(workspace: Path) -> None:
    with running(workspace, "--host", "0.0.0.0") as (_, address):
        with pytest.raises(urllib.error.HTTPError, match="401"):
            urllib.request.urlopen(f"{address}/api/vehicles", timeout=300)
        request = signed_in(f"{address}/api/vehicles")
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


def test_without_users_it_makes_a_token_and_says_it(workspace: Path) -> None:
    said: list[str] = []
    with running(workspace, token="", said=said) as (_, address):
        assert "password" in said[0]
        assert "aerodb user add" in said[2]
        assert len(said[1]) == 43
        for wrong in (f"{address}/", signed_in(f"{address}/", "guess"), signed_in(f"{address}/")):
            with pytest.raises(urllib.error.HTTPError, match="401"):
                urllib.request.urlopen(wrong, timeout=300)
        assert urllib.request.urlopen(signed_in(f"{address}/", said[1]), timeout=300).status == 200
    assert said[1].encode() not in (workspace / "access.log").read_bytes()


def test_users_come_with_tokens_that_are_shown_once(workspace: Path) -> None:
    added = json.loads(aerodb(workspace, "--json", "user", "add", "anna", "--role", "read").stdout)
    twice = aerodb(workspace, "user", "add", "anna", "--role", "read")
    assert (twice.returncode, "aerodb user token anna" in twice.stderr) == (3, True)
    again = json.loads(aerodb(workspace, "--json", "user", "token", "anna").stdout)
    assert again["role"] == "read"
    (listed,) = json.loads(aerodb(workspace, "--json", "user", "list").stdout)
    assert (listed["user"], listed["role"]) == ("anna", "read")
    for file in workspace.rglob("*"):
        if file.is_file():
            assert again["token"].encode() not in file.read_bytes()
    with running(workspace, token="") as (_, address):
        path = f"{address}/api/vehicles"
        with pytest.raises(urllib.error.HTTPError, match="401"):
            urllib.request.urlopen(signed_in(path, added["token"]), timeout=300)
        assert urllib.request.urlopen(signed_in(path, again["token"]), timeout=300).status == 200
        removed = aerodb(workspace, "user", "remove", "anna")
        assert removed.returncode == 0, removed.stderr
        with pytest.raises(urllib.error.HTTPError, match="401"):
            urllib.request.urlopen(signed_in(path, again["token"]), timeout=300)
    for wrong in (("remove", "anna"), ("token", "bert")):
        assert aerodb(workspace, "user", *wrong).returncode == 2
    for name, role in (("anna", "admin"), ("../x", "read")):
        refused = aerodb(workspace, "user", "add", name, "--role", role)
        assert (refused.returncode, "Traceback" in refused.stderr) == (3, False)
