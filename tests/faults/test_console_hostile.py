"""A real console under what ends servers: it answers others meanwhile, and lives on."""

import http.client
import json
import resource
import socket
import threading
import time
import urllib.request
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager, suppress
from pathlib import Path
from urllib.parse import urlsplit

import psutil
import pytest

from aerodb.flows.web.access_log import REFUSED
from aerodb.flows.web.bodies import LARGEST_BODY
from aerodb.flows.web.connections import HEAD_SECONDS
from tests.flows.web.test_console_command import running, signed_in
from tests.support.command import aerodb
from tests.support.console_workspace import TOKEN
from tests.support.small_glider import NAME, write_files

CAMPAIGN = pytest.mark.campaign


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A workspace with the glider's handbook database."""
    folder = tmp_path_factory.mktemp("hostile")
    write_files(folder, flights=0)
    root = folder / "w"
    for given in (
        ("vehicle", "add", str(folder / "vehicle.toml")),
        ("database", "import", str(folder / "database.toml"), "--vehicle", NAME),
    ):
        done = aerodb(root, *given)
        assert done.returncode == 0, done.stderr
    return root


def test_parallel_exports_to_jsbsim_end_nobody(workspace: Path) -> None:
    """JSBSim's logger calls Python when its thread ends, which aborted the console."""
    pytest.importorskip("jsbsim")

    def export(_: int) -> str:
        path = f"{address}/api/versions/v0001/export?format=jsbsim"
        with urllib.request.urlopen(signed_in(path), timeout=300) as answer:
            assert b"<fdm_config" in answer.read()
            return str(answer.headers["x-checked"])

    with running(workspace) as (process, address):
        for _ in range(2):
            with ThreadPoolExecutor(3) as threads:
                assert all("pass inside JSBSim" in said for said in threads.map(export, range(3)))
        process.send_signal(15)
        assert process.wait(300) in (0, -15)


@contextmanager
def descriptors_for_us(most: int) -> Iterator[None]:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    if before[1] != resource.RLIM_INFINITY and before[1] < most:
        pytest.skip(f"this machine allows {before[1]} descriptors")
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(most, before[0]), before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)


def place_of(address: str) -> tuple[str, int]:
    parts = urlsplit(address)
    assert parts.hostname
    assert parts.port
    return parts.hostname, parts.port


def seconds_of(address: str, path: str = "/api/vehicles") -> float:
    """The time [s] of one answer to somebody else."""
    began = time.monotonic()
    with urllib.request.urlopen(signed_in(f"{address}{path}"), timeout=300) as answer:
        assert answer.status == 200
        answer.read()
    return time.monotonic() - began


def half_sent(address: str, number: int, sent: bytes) -> list[socket.socket]:
    opened = []
    for _ in range(number):
        with suppress(OSError):
            opened.append(socket.create_connection(place_of(address), timeout=30))
            opened[-1].sendall(sent)
    return opened


HALF = {
    "nothing": b"",
    "head": b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: ",
    "body": (
        f"POST /rollback HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer {TOKEN}\r\n".encode()
        + b"Content-Type: application/x-www-form-urlencoded\r\nContent-Length: 1000\r\n\r\nreason="
    ),
}


@pytest.mark.parametrize("sent", HALF)
def test_half_sent_requests_keep_nobody_out(workspace: Path, tmp_path: Path, sent: str) -> None:
    """1,100 clients that do not finish what they ask, and 1,024 descriptors."""
    with (
        descriptors_for_us(4096),
        (tmp_path / "errors").open("w+b") as errors,
        running(workspace, descriptors=1024, errors=errors) as (process, address),
    ):
        opened = half_sent(address, 1100, HALF[sent])
        try:
            times = [seconds_of(address) for _ in range(20)]
            print(f"others were answered in at most {max(times):.3f} s")
            assert psutil.Process(process.pid).num_fds() < 1024
        finally:
            for connection in opened:
                connection.close()
        assert (tmp_path / "errors").stat().st_size < 10_000


def test_no_descriptor_left_is_said_in_a_few_lines(workspace: Path, tmp_path: Path) -> None:
    """Every failed accept used to write a stack trace: 765 MB in two minutes."""
    with (
        descriptors_for_us(4096),
        (tmp_path / "errors").open("w+b") as errors,
        running(workspace, errors=errors) as (process, address),
    ):
        seconds_of(address)
        console = psutil.Process(process.pid)
        before, (_, hard) = console.num_fds(), console.rlimit(psutil.RLIMIT_NOFILE)
        # Whatever the console reckoned with when it started.
        console.rlimit(psutil.RLIMIT_NOFILE, (before + 40, hard))
        opened = half_sent(address, 150, HALF["head"])
        time.sleep(3.0)
        for connection in opened:
            connection.close()
        console.rlimit(psutil.RLIMIT_NOFILE, (hard, hard))
        until = time.monotonic() + 300
        while True:
            with suppress(OSError):
                seconds_of(address)
                break
            assert time.monotonic() < until
        size = (tmp_path / "errors").stat().st_size
    assert 0 < size < 20_000


@pytest.mark.campaign
def test_clients_that_do_not_go_on_are_left(workspace: Path) -> None:
    """However they drip: the time is for the whole head, or the whole body."""
    with running(workspace) as (_, address), ThreadPoolExecutor(len(HALF)) as threads:
        left = threads.map(lambda sent: _is_left(address, sent), HALF)
        assert dict(zip(HALF, left, strict=True)) == dict.fromkeys(HALF, True)


def _is_left(address: str, sent: str) -> bool:
    """Whether the console ends the connection of a client that drips, or says nothing."""
    (connection,) = half_sent(address, 1, HALF[sent])
    until, ended = time.monotonic() + 12 * HEAD_SECONDS, False
    while not ended and time.monotonic() < until:
        with suppress(TimeoutError, ConnectionError):
            connection.settimeout(0.5)
            if sent != "nothing":
                with suppress(BrokenPipeError):
                    connection.send(b"x")
            try:
                ended = connection.recv(4096) == b""
            except ConnectionResetError:
                ended = True
    connection.close()
    return ended


def test_bad_requests_are_said_in_a_few_lines(workspace: Path, tmp_path: Path) -> None:
    bad = b"\x00\xff nonsense\r\n\r\n"
    upgrade = (
        b"GET /api/vehicles HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: upgrade\r\n"
        b"Upgrade: websocket\r\nSec-WebSocket-Key: AA==\r\n\r\n"
    )
    stranger = b"GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n"
    with (
        (tmp_path / "errors").open("w+b") as errors,
        running(workspace, errors=errors) as (_, address),
    ):
        for sent in (bad, upgrade, stranger) * 500:
            with socket.create_connection(place_of(address), timeout=60) as connection:
                connection.sendall(sent)
                assert connection.recv(100).startswith(b"HTTP/1.1 ")
        seconds_of(address)
        assert 0 < (tmp_path / "errors").stat().st_size < 20_000
    lines = (workspace / "access.log").read_text().splitlines()
    refused = [line for line in map(json.loads, lines) if line["status"] == 421]
    assert 0 < len(refused) <= 10 * REFUSED  # in each minute


@pytest.mark.parametrize("sending", ["length", "chunked", "chunked without end"])
def test_a_body_that_is_too_large_is_refused_as_such(workspace: Path, sending: str) -> None:
    with running(workspace) as (_, address):
        connection = http.client.HTTPConnection(*place_of(address), timeout=60)
        content = {"Content-Type": "application/json", "Authorization": f"Bearer {TOKEN}"}
        path = "/api/rollback"
        if sending == "length":
            connection.request("POST", path, b"x" * (LARGEST_BODY + 1), content)
        else:
            parts = [b"x" * 10_000] * 10
            connection.putrequest("POST", path)
            for name, value in content.items():
                connection.putheader(name, value)
            connection.putheader("Transfer-Encoding", "chunked")
            connection.endheaders()
            for part in parts:
                connection.send(b"%x\r\n%s\r\n" % (len(part), part))
            if sending == "chunked":
                connection.send(b"0\r\n\r\n")
        answer = connection.getresponse()
        assert answer.status == 413
        assert b"larger than" in answer.read()
        seconds_of(address)


def test_a_request_that_states_its_length_twice_smuggles_no_other(workspace: Path) -> None:
    """A proxy may believe the length, and take the second request for the body of the first."""
    head = f"Host: 127.0.0.1\r\nAuthorization: Bearer {TOKEN}\r\n"
    smuggled = f"GET /api/vehicles HTTP/1.1\r\n{head}\r\n"
    body = f"0\r\n\r\n{smuggled}"
    lengths = f"Content-Length: {len(body)}\r\nTransfer-Encoding: chunked\r\n"
    with running(workspace) as (_, address), socket.create_connection(place_of(address)) as opened:
        opened.sendall(f"POST /api/rollback HTTP/1.1\r\n{head}{lengths}\r\n{body}".encode())
        opened.settimeout(60)
        said = b""
        while part := opened.recv(65536):
            said += part
    assert said.startswith(b"HTTP/1.1 400 ")
    assert said.count(b"HTTP/1.1 ") == 1


@pytest.mark.parametrize(
    ("seconds", "clients", "slow"), [(4.0, 20, 50), pytest.param(60.0, 100, 1100, marks=CAMPAIGN)]
)
def test_many_clients_beside_slow_ones(
    workspace: Path, seconds: float, clients: int, slow: int
) -> None:
    """Nothing aborts, everybody is answered, memory stays flat; in the campaign, within 2 s."""
    paths = ("/", "/versions", "/api/versions/v0001", "/work", "/static/console.css", "/nothing")
    longest: list[float] = []
    wrong: list[object] = []
    over = threading.Event()
    carried = {"Authorization": f"Bearer {TOKEN}"}

    def ask(number: int) -> None:
        connection, turn = http.client.HTTPConnection(*place_of(address), timeout=60), number
        while not over.is_set():
            turn += 1
            path = paths[turn % len(paths)]
            began = time.monotonic()
            try:
                connection.request("GET", path, headers=carried)
                answer = connection.getresponse()
                answer.read()
            except (OSError, http.client.HTTPException) as error:
                wrong.append((path, error))
                return
            longest.append(time.monotonic() - began)
            if answer.status != (404 if path == "/nothing" else 200):
                wrong.append((path, answer.status))
            over.wait(1.0)
        connection.close()

    def drip() -> None:
        while not over.is_set():
            opened = half_sent(address, slow, HALF["head"])
            over.wait(1.0)
            for connection in opened:
                connection.close()

    with descriptors_for_us(4096), running(workspace, descriptors=1024) as (process, address):
        threads = [threading.Thread(target=ask, args=(number,)) for number in range(clients)]
        threads.append(threading.Thread(target=drip))
        for thread in threads:
            thread.start()
        sizes = []
        until = time.monotonic() + seconds
        while time.monotonic() < until:
            time.sleep(seconds / 10)
            sizes.append(psutil.Process(process.pid).memory_info().rss / 2**20)
        over.set()
        for thread in threads:
            thread.join(300)
        process.send_signal(15)
        assert process.wait(300) in (0, -15)
    ordered = sorted(longest)
    print(
        f"{len(ordered)} answers, median {ordered[len(ordered) // 2]:.3f} s, longest"
        f" {ordered[-1]:.3f} s; memory [MB] {', '.join(f'{size:.0f}' for size in sizes)}"
    )
    assert not wrong, wrong[:5]
    if seconds >= 60.0:
        assert ordered[-1] < 2.0
        assert sizes[-1] < sizes[len(sizes) // 2] + 30.0
