"""Records on the screen: true extremes in few points, every sample where it is near, what a flight
has covered."""

import json
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from starlette.testclient import TestClient

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from tests.support.catalogue_samples import h
from tests.support.console_workspace import Made, add_long_flight, client_of, made_workspace
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Made:
    return made_workspace(shared, tmp_path_factory.mktemp("console") / "workspace")


@pytest.fixture(scope="module")
def client(made: Made) -> Iterator[TestClient]:
    with client_of(made.workspace) as opened:
        yield opened


def _unpacked(data: bytes) -> tuple[dict[str, Any], dict[str, tuple[np.ndarray, np.ndarray]]]:
    (length,) = struct.unpack_from("<I", data)
    heading, offset = json.loads(data[4 : 4 + length]), 4 + length
    lines = {}
    for line in heading["series"]:
        n = line["samples"]
        both = np.frombuffer(data, "<f8", 2 * n, offset)
        lines[line["name"]] = (both[:n], both[n:])
        offset += 16 * n
    assert offset == len(data)
    return heading, lines


def test_an_hour_comes_decimated_with_its_extremes_and_whole_where_it_is_near(
    tmp_path: Path,
) -> None:
    workspace = Workspace.open(tmp_path / "long")
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_vehicle(NAME, "name = 'x'")
    id, flight = add_long_flight(workspace)
    spike = int(np.argmax(flight["alpha"]))
    with client_of(workspace) as client:
        address = f"/api/flights/{id}/channels?points=2000"
        heading, lines = _unpacked(client.get(f"{address}&format=binary").content)
        assert list(lines) == [
            "V",
            "alpha",
            "beta",
            "p",
            "q",
            "r",
            "ax",
            "ay",
            "az",
            "phi",
            "theta",
            "altitude",
        ]
        for name, (time, values) in lines.items():
            assert len(time) <= 2002
            assert (values.min(), values.max()) == (flight[name].min(), flight[name].max())
            assert np.all(np.diff(time) > 0)
        assert heading["series"][1]["flagged"] == [[0.0, 9.99]]
        assert heading["series"][1]["label"] == "alpha [deg]"
        near = client.get(
            f"{address}&names=alpha&from={flight.time[spike] - 2}&to={flight.time[spike] + 2}"
        ).json()
        (line,) = near["series"]
        here = slice(spike - 201, spike + 202)
        assert line["time"] == pytest.approx(flight.time[here])
        assert line["values"] == flight["alpha"][here].tolist()
        for edge in ("from=-5&to=-1", "from=1e9&to=2e9", "from=0&to=0", "from=3599.99&to=1e300"):
            assert client.get(f"{address}&names=V&{edge}").status_code == 200
        assert client.get(f"{address}&names=V&from=nan").status_code == 422


def test_coefficients_of_a_record_are_those_of_the_comparison(
    client: TestClient, made: Made
) -> None:
    found = client.get(f"/api/flights/{made.flight}/channels?names=CZ,alpha").json()
    assert [(line["name"], line["source"]) for line in found["series"]] == [
        ("CZ", "flight"),
        ("CZ", "database"),
        ("alpha", "measured"),
    ]
    flown, predicted = (np.array(line["values"], dtype=float) for line in found["series"][:2])
    assert np.sqrt(np.nanmean((flown - predicted) ** 2)) == pytest.approx(
        0.056, rel=0.3
    )  # what the update then removes


def test_envelopes_leave_out_what_does_not_count(client: TestClient, made: Made) -> None:
    found = client.get(
        f"/api/envelopes?flight={made.flight}&flight={h('hostile 0')}&flight=nothing"
    ).json()
    assert found[made.flight]["V"] == pytest.approx([25.0, 25.0])
    assert 0 < found[made.flight]["alpha"][0] < found[made.flight]["alpha"][1] < 0.2
    assert found[h("hostile 0")] == {}
    assert "nothing" not in found
