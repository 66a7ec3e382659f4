"""A real console under what ends servers: it answers others meanwhile, and lives on."""

import urllib.request
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

from tests.flows.web.test_console_command import running
from tests.support.command import aerodb
from tests.support.small_glider import NAME, write_files


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
        with urllib.request.urlopen(path, timeout=300) as answer:
            assert b"<fdm_config" in answer.read()
            return str(answer.headers["x-checked"])

    with running(workspace) as (process, address):
        for _ in range(2):
            with ThreadPoolExecutor(3) as threads:
                assert all("pass inside JSBSim" in said for said in threads.map(export, range(3)))
        process.send_signal(15)
        assert process.wait(300) in (0, -15)
