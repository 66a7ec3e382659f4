"""The console behind nginx with the configuration that docs/security.md prints: TLS in front, and the
same rules behind it."""

import re
import shutil
import ssl
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.tasks.actors import hash_of_token, new_token
from tests.flows.web.test_console_command import running
from tests.support.console_workspace import Made, made_workspace
from tests.support.paths import ROOT
from tests.support.ports import free_port
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME

NGINX = shutil.which("nginx") or shutil.which("nginx", path="/usr/sbin")
OPENSSL = shutil.which("openssl")
pytestmark = pytest.mark.skipif(not (NGINX and OPENSSL), reason="nginx or openssl is not installed")
HOST = "aero.example"


def configuration(folder: Path, port: int, console: str) -> str:
    """What docs/security.md prints, with this test's places, as a whole file."""
    text = (ROOT / "docs" / "security.md").read_text()
    found = re.search(r"```nginx\n(.*?)```", text, re.DOTALL)
    assert found
    server = found[1]
    for printed, ours in (
        ("443 ssl", f"127.0.0.1:{port} ssl"),
        ("http://127.0.0.1:8050", console),
        ("/etc/ssl/aero.example.pem", str(folder / "certificate.pem")),
        ("/etc/ssl/private/aero.example.key", str(folder / "key.pem")),
    ):
        assert printed in server
        server = server.replace(printed, ours)
    places = "".join(
        f"{name}_temp_path {folder}/{name};\n"
        for name in ("client_body", "proxy", "fastcgi", "uwsgi", "scgi")
    )
    return (
        f"daemon off; pid {folder}/pid; error_log {folder}/error.log;\nevents {{}}\n"
        f"http {{ access_log off;\n{places}{server}}}\n"
    )


@pytest.fixture
def made(shared: SharedWorkspaces, tmp_path: Path) -> Made:
    return made_workspace(shared, tmp_path / "workspace")


@pytest.fixture
def proxied(made: Made, tmp_path: Path) -> Iterator[tuple[str, ssl.SSLContext]]:
    """The address of nginx before a console, and the certificates to trust."""
    subprocess.run(
        [
            *(str(OPENSSL), "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2"),
            *("-subj", f"/CN={HOST}", "-addext", f"subjectAltName=DNS:{HOST}"),
            *("-keyout", str(tmp_path / "key.pem"), "-out", str(tmp_path / "certificate.pem")),
        ],
        check=True,
        capture_output=True,
    )
    port = free_port()
    with running(made.workspace.root, "--known-as", HOST) as (_, console):
        file = tmp_path / "nginx.conf"
        file.write_text(configuration(tmp_path, port, console))
        nginx = subprocess.Popen([str(NGINX), "-p", str(tmp_path), "-c", str(file)])
        try:
            trusted = ssl.create_default_context(cafile=str(tmp_path / "certificate.pem"))
            yield f"https://127.0.0.1:{port}", trusted
        finally:
            nginx.terminate()
            nginx.wait(300)


def test_a_user_reads_and_releases_over_tls(
    made: Made, proxied: tuple[str, ssl.SSLContext]
) -> None:
    token = new_token()
    with Catalogue.open(made.workspace.catalogue) as catalogue:
        catalogue.add_user("anna", "release", hash_of_token(token), by="test")
    address, trusted = proxied
    headers = {"host": HOST, "authorization": f"Bearer {token}"}
    with httpx.Client(base_url=address, headers=headers, verify=trusted, timeout=60) as client:

        def ask(method: str, path: str, **more: object) -> httpx.Response:
            request = client.build_request(method, path, **more)  # type: ignore[arg-type]
            request.extensions["sni_hostname"] = HOST
            return client.send(request)

        until = time.monotonic() + 300
        while True:
            try:
                page = ask("GET", f"/versions/{made.candidate}/promote")
                break
            except httpx.ConnectError:
                assert time.monotonic() < until
        assert page.status_code == 200
        csrf = page.text.partition('name="csrf" value="')[2].partition('"')[0]
        cookie = {"cookie": page.headers["set-cookie"].partition(";")[0]}
        fields = {"csrf": csrf, "name": "mine", "seen": "nothing", "reason": "over TLS"}
        path = f"/versions/{made.candidate}/promote"
        foreign = {**cookie, "origin": "https://evil.example"}
        assert ask("POST", path, data=fields, headers=foreign).status_code == 403
        own = {**cookie, "origin": f"https://{HOST}"}
        assert ask("POST", path, data=fields, headers=own).status_code == 200
        assert ask("GET", "/", headers={"authorization": "Bearer guess"}).status_code == 401
        assert ask("POST", path, content=b"x" * 100_000, headers=own).status_code == 413
    with Catalogue.open(made.workspace.catalogue) as catalogue:
        event = catalogue.named(NAME, "mine")
    assert event is not None
    assert (event.user, event.reason) == ("anna", "over TLS")
