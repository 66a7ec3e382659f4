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

from aerodb.flows.flight import flight_flow
from aerodb.flows.run import run_flow
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


def _lines(client: TestClient, flight: str, asked: str) -> dict[tuple[str, str], dict[str, Any]]:
    answer = client.get(f"/api/flights/{flight}/channels?{asked}")
    assert answer.status_code == 200, answer.text
    return {(line["name"], line["source"]): line for line in answer.json()["series"]}


def test_coefficients_stay_whichever_version_is_released(client: TestClient, made: Made) -> None:
    before = _lines(client, made.flight, "names=CZ,sigma_CZ")
    assert before["CZ", "database"]["version"] == "v0001"
    assert all(value > 0 for value in before["sigma_CZ", "sigma"]["values"] if value is not None)
    with Catalogue.open(made.workspace.catalogue) as catalogue:
        for old, new in ((made.baseline, made.candidate), (made.candidate, made.baseline)):
            moved = {"user": "test", "reason": "test", "expected": old}
            catalogue.move_name(NAME, "released", new, **moved)
            after = _lines(client, made.flight, "names=CZ")
            assert after["CZ", "flight"]["values"] == before["CZ", "flight"]["values"]
            assert after["CZ", "database"]["values"]
            assert 'value="CZ"' in client.get(f"/flights/{made.flight}").text


def test_one_channel_over_another_at_common_samples(client: TestClient, made: Made) -> None:
    found = client.get(f"/api/flights/{made.flight}/pairs?x=alpha&y=CZ&points=20000").json()
    assert (found["x"]["label"], found["x"]["factor"]) == ("alpha [deg]", pytest.approx(57.29578))
    alpha, cz = (
        np.array([np.nan if v is None else v for v in found[axis]["values"]]) for axis in "xy"
    )
    known = np.isfinite(alpha) & np.isfinite(cz)
    slope = np.polyfit(alpha[known], cz[known], 1)[0]
    assert slope == pytest.approx(-5.0, abs=1.5)  # the handbook's and a tenth more
    few = client.get(f"/api/flights/{made.flight}/pairs?x=alpha&y=CZ&points=20").json()
    assert len(few["time"]) <= 22
    assert max(few["x"]["values"]) == np.nanmax(alpha)
    unknown = client.get(f"/api/flights/{made.flight}/pairs?x=alhpa&y=CZ")
    assert unknown.status_code == 404
    assert "alpha" in unknown.text
    assert client.get(f"/api/flights/{made.flight}/track").status_code == 422  # no position


def test_every_logged_field_is_there_in_its_own_unit_and_rate(
    client: TestClient, made: Made
) -> None:
    (topic,) = client.get(f"/api/flights/{made.flight}/topics").json()
    assert {"field": "alpha", "unit": "rad"} in topic["fields"]
    asked = f"logged={topic['topic']}:alpha"
    ((key, line),) = _lines(client, made.flight, asked).items()
    assert key == (f"{topic['topic']}:alpha", "logged")
    assert line["label"].endswith("[deg]")
    assert len(line["values"]) == topic["samples"]
    for wrong in (f"{topic['topic']}:alhpa", "tbale:alpha", "alpha"):
        refused = client.get(f"/api/flights/{made.flight}/channels?logged={wrong}")
        assert refused.status_code == 404, wrong
    many = "&".join([asked] * 41)
    assert client.get(f"/api/flights/{made.flight}/channels?{many}").status_code == 422
    assert client.get(f"/api/flights/{h('hostile 0')}/topics").status_code == 422


def test_a_px4_log_says_what_it_holds(
    tmp_path: Path, measured: Any, shared: SharedWorkspaces
) -> None:
    """sample_log_small.ulg: PX4 v1.11.2 of a VTOL on the ground; figures as pyulog's ulog_info and
    ulog_messages print them."""
    workspace = shared.prepared(tmp_path / "workspace")
    log = measured("px4_ulog/sample_log_small.ulg")
    outcome = run_flow(flight_flow, {"logs": [str(log)], "vehicle": NAME}, workspace, "direct")[0]
    with client_of(workspace) as client:
        flight = outcome["flight"]
        said = client.get(f"/api/flights/{flight}/log").json()
        assert said["firmware"] == "PX4 1.11.2 dev, CUBEPILOT_CUBEORANGE"
        assert len(said["parameters"]) == 980
        assert [entry["text"] for entry in said["messages"]] == [
            "[commander] Takeoff detected",
            "[commander] Landing detected",
            "[commander] Disarmed by landing",
        ]
        assert len(client.get(f"/api/flights/{flight}/topics").json()) == 70
        page = client.get(f"/flights/{flight}").text
        for words in ("PX4 1.11.2 dev", "980 parameters", "Takeoff detected", "sample_log_small"):
            assert words in page, words
        ((_, line),) = _lines(client, flight, "logged=battery_status:voltage_v").items()
        assert line["label"] == "battery_status:voltage_v [V]", "as the mapping states it"
        assert 23.0 < min(line["values"]) < max(line["values"]) < 24.0
        ((_, line),) = _lines(client, flight, "logged=battery_status:current_a").items()
        assert line["label"] == "battery_status:current_a [unit not logged]"
