"""The client of the console's API against a real server: documents of the commands, pages, changes
through the gate, and refusals as errors."""

from collections.abc import Iterator
from pathlib import Path

import httpx
import numpy as np
import pytest

import aerodb
from aerodb.errors import GateRefusal, InputError, StoreError, UnknownNameError
from aerodb.flows.library.client import _refusal
from aerodb.storage.catalogue.catalogue import Catalogue
from tests.support.command import asked
from tests.support.console_workspace import HOSTILE, TOKEN, Made, add_child, made_workspace, served
from tests.support.ports import free_port
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Made:
    return made_workspace(shared, tmp_path_factory.mktemp("client") / "w")


@pytest.fixture(scope="module")
def client(made: Made) -> Iterator[aerodb.Client]:
    with served(made.workspace) as address, aerodb.Client(address, TOKEN) as client:
        yield client


def test_documents_are_those_of_the_commands(
    client: aerodb.Client, made: Made, tmp_path: Path
) -> None:
    root = made.workspace.root
    assert [each["vehicle"] for each in client.vehicles()] == [NAME]
    assert client.flight(made.flight) == asked(root, "flight", "show", made.flight)
    assert client.version("candidate") == asked(root, "version", "show", "candidate")
    said = asked(root, "version", "evaluate", "released", "--at", "alpha=4deg,V=20")
    assert client.evaluate("released", alpha="4 deg", V=20)["coefficients"] == said["coefficients"]
    assert client.finding("candidate")["candidate"] == made.candidate
    assert len(list(client.findings())) == 2
    exported = tmp_path / "handbook.nc"
    exported.write_bytes(client.export("v0001", "netcdf"))
    handbook = aerodb.load_database(exported)
    version = aerodb.open_workspace(root).version("v0001")
    assert aerodb.evaluate(handbook, alpha=0.1)["CZ"] == version.evaluate(alpha=0.1)["CZ"]


def test_lists_are_read_over_all_pages(client: aerodb.Client, made: Made) -> None:
    every = [each["flight"] for each in client.flights()]
    assert len(every) == len(set(every)) == 8
    assert [each["flight"] for each in client.pages("/api/flights", limit=3)] == every
    assert [each["label"] for each in client.versions()] == ["v0001", "v0002"]
    rejected = [each["flight"] for each in client.flights(verdict="rejected", text=HOSTILE)]
    assert len(rejected) == 1


def test_channels_come_as_series_with_units(client: aerodb.Client, made: Made) -> None:
    found = client.channels(made.flight, ["alpha", "CZ"], start=2.0, end=6.0)
    assert set(found) == {("alpha", "measured"), ("CZ", "flight"), ("CZ", "database")}
    log = aerodb.open_workspace(made.workspace.root).log(made.flight).to_pandas()
    alpha = found["alpha", "measured"]
    assert alpha.attrs["unit"] == "rad"
    np.testing.assert_array_equal(alpha, log.loc[alpha.index, "alpha"])


def test_a_change_goes_through_the_gate(client: aerodb.Client, made: Made) -> None:
    with pytest.raises(InputError, match="no version to go back to"):
        client.roll_back("nothing to go back to", vehicle=NAME)
    with Catalogue.open(made.workspace.catalogue) as catalogue:
        child = add_child(catalogue, made.baseline, "unproved", [made.flight])
    with pytest.raises(GateRefusal):
        client.promote(child, "try")
    moved = client.promote("candidate", "checked in a notebook", name="trial")
    assert moved["name"] == "trial"
    assert asked(made.workspace.root, "version", "show", "trial")["version"] == made.candidate


def test_a_refusal_of_the_gate_has_the_reason_that_the_console_gives() -> None:
    error = {"what": "released was moved", "where": "vehicle x", "remedy": "decide again"}
    refusal = _refusal(httpx.Response(409, json={"error": error}), "http://console")
    assert isinstance(refusal, GateRefusal)
    assert refusal.reasons == ("released was moved",)
    assert str(refusal) == "vehicle x: released was moved\ndecide again"


def test_refusals_are_the_errors_of_the_commands(client: aerodb.Client) -> None:
    with pytest.raises(UnknownNameError, match="no-such"):
        client.version("no-such")
    with pytest.raises(InputError, match="alhpa"):
        client.evaluate("released", alhpa=1.0)
    with pytest.raises(UnknownNameError):
        client.flight("../../etc/passwd")
    with (
        aerodb.Client(client.url, "a wrong token") as stranger,
        pytest.raises(InputError) as refusal,
    ):
        stranger.vehicles()
    assert "token" in str(refusal.value)
    nobody = aerodb.Client(f"http://127.0.0.1:{free_port()}", TOKEN)
    with nobody, pytest.raises(StoreError, match="does not answer"):
        nobody.vehicles()
