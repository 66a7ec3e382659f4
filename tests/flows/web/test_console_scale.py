"""Lists for any number of flights and versions: a page costs the same work in a catalogue many
times larger, counted in steps of SQLite's virtual machine, never in time."""

import re
import sqlite3
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest
from starlette.testclient import TestClient

from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.flight_pages import LOOKED_THROUGH
from aerodb.storage.catalogue.seal import seal_of
from aerodb.storage.workspace import Workspace
from aerodb.tasks.workspace_access import access_workspace
from tests.storage.test_scale import counted
from tests.support.catalogue_samples import h
from tests.support.console_workspace import client_of
from tests.support.small_glider import NAME, VEHICLE

_START = datetime(2026, 1, 1, tzinfo=UTC)
_REPORT = '{"axes":{},"findings":[],"increments":[],"validation":{"kind":"held-out"},"flights":{"held_out":[]}}'


#: Versions of the small catalogue: more than the longest page holds.
SMALL = 600


def _moments(count: int) -> list[str]:
    return [(_START + timedelta(seconds=k)).strftime("%Y-%m-%dT%H:%M:%S.%fZ") for k in range(count)]


def crowd(path: Path, versions: int, flights: int) -> None:
    """Rows as the catalogue would have written them: flights of which one in a hundred is rejected,
    versions made by updates, a move of a name to each. In one go: through the catalogue it would
    take minutes."""
    seal_of(path).unlink(missing_ok=True)
    raw = sqlite3.connect(path)
    raw.execute("PRAGMA synchronous = OFF")

    def insert(table: str, columns: str, rows: list[tuple[Any, ...]]) -> None:
        places = ", ".join("?" * len(columns.split(",")))
        raw.executemany(f"INSERT INTO {table} ({columns}) VALUES ({places})", rows)

    at, ids = _moments(flights), [h(f"crowd-{k}") for k in range(flights)]
    logs = [
        (id, f"log {k}.ulg", 10, "ulog", "stored", "", "[]", moment)
        for k, (id, moment) in enumerate(zip(ids, at, strict=True))
    ]
    insert("log_files", "sha256, name, size, format, status, reason, damage, added_utc", logs)
    names = [f"crowd-{k}" for k in range(flights)]
    insert(
        "flights",
        "id, vehicle, name, log_sha256, added_utc",
        [(i, NAME, n, i, a) for i, n, a in zip(ids, names, at, strict=True)],
    )
    records = [
        (id, "px4", None, 20.0, 1001, 0.02, moment) for id, moment in zip(ids, at, strict=True)
    ]
    insert(
        "flight_records", "flight, mapping, start_utc, duration, samples, step, added_utc", records
    )
    judged = [
        (id, "verdict", "rejected" if k % 100 == 7 else "good", "[]", at[k])
        for k, id in enumerate(ids)
    ]
    insert("flight_events", "flight, kind, verdict, reasons, at_utc", judged)
    keys, made = [h(f"version-{k}") for k in range(versions)], _moments(versions)
    runs = [
        (
            key[:32],
            "update_flow",
            "direct",
            made[k],
            made[k],
            "completed",
            f'{{"vehicle":"{NAME}"}}',
            "",
            "",
        )
        for k, key in enumerate(keys)
    ]
    insert(
        "runs",
        "id, flow, how, started_utc, ended_utc, state, parameters, code_version, error",
        runs,
    )
    others = [
        (h(f"run-{k}")[:32], "flight_flow", "direct", at[k], at[k], "completed", "{}", "", "")
        for k in range(0, flights, 10)
    ]
    insert(
        "runs",
        "id, flow, how, started_utc, ended_utc, state, parameters, code_version, error",
        others,
    )
    rows = [
        (
            key,
            NAME,
            k + 1,
            keys[k - 1] if k % 10 else None,
            "{}",
            h(k),
            "{}",
            _REPORT,
            key[:32],
            made[k],
        )
        for k, key in enumerate(keys)
    ]
    insert(
        "versions",
        "id, vehicle, number, parent, content, content_sha256, settings, report, run, created_utc",
        rows,
    )
    insert("run_versions", "run, version", [(key[:32], key) for key in keys])
    per = flights // versions
    insert(
        "version_flights",
        "version, flight, role, reason",
        [(keys[min(k // per, versions - 1)], id, "identified", "") for k, id in enumerate(ids)],
    )
    moves = [
        (NAME, "crowd", k + 1, key, keys[k - 1] if k else None, made[k], "me", "r")
        for k, key in enumerate(keys)
    ]
    insert("name_events", 'vehicle, name, step, version, previous, at_utc, "user", reason', moves)
    raw.commit()
    raw.execute("ANALYZE")
    raw.close()


@pytest.fixture(scope="module")
def workspaces(
    tmp_path_factory: pytest.TempPathFactory, trials: Callable[[int, int], int]
) -> dict[str, Workspace]:
    sizes = {
        "small": (SMALL, LOOKED_THROUGH * 2),
        "large": (trials(3_000, 10_000), trials(24_000, 100_000)),
    }
    made = {}
    for size, (versions, flights) in sizes.items():
        workspace = Workspace.open(tmp_path_factory.mktemp("scale") / size)
        with Catalogue.open(workspace.catalogue) as catalogue:
            catalogue.add_vehicle(NAME, VEHICLE)
        crowd(workspace.catalogue, versions, flights)
        made[size] = workspace
    return made


LISTS = (
    "/",
    "/flights",
    f"/flights?vehicle={NAME}",
    "/flights?verdict=rejected",
    "/flights?verdict=retracted",
    "/flights?text=nothing+is+called+so",
    "/flights?text=crowd-17",
    "/api/flights?limit=500",
    "/versions",
    "/api/versions?limit=500",
    "/history",
    "/history?name=crowd",
    "/findings",
    "/api/vehicles",
)


@pytest.mark.heavy
@pytest.mark.parametrize("address", LISTS)
def test_a_page_of_a_list_does_the_same_work_however_long_the_list(
    workspaces: dict[str, Workspace], address: str
) -> None:
    steps, statements = {}, {}
    for size, workspace in workspaces.items():
        with client_of(workspace) as client:
            client.get(address)  # what is loaded once is loaded
            with counted(access_workspace(str(workspace.root)).catalogue) as work:
                assert client.get(address).status_code == 200
        steps[size], statements[size] = work.steps, len(work.statements)
    assert statements["large"] == statements["small"]
    assert steps["large"] <= 1.3 * steps["small"] + 20, steps


def _all(client: TestClient, address: str) -> list[dict[str, Any]]:
    """Every entry of a list, page by page as its headers lead."""
    found: list[dict[str, Any]] = []
    while address:
        answer = client.get(address)
        assert answer.status_code == 200, answer.text
        found += answer.json()
        link = re.fullmatch(r'<([^>]+)>; rel="next"', answer.headers.get("link", ""))
        address = link[1] if link else ""
    return found


def test_pages_hold_every_entry_once_and_in_order(workspaces: dict[str, Workspace]) -> None:
    with client_of(workspaces["small"]) as client:
        flights = _all(client, "/api/flights?limit=450")
        assert [entry["name"] for entry in flights] == [
            f"crowd-{k}" for k in reversed(range(2 * LOOKED_THROUGH))
        ]
        rejected = _all(client, "/api/flights?verdict=rejected&limit=30")
        assert [entry["name"] for entry in rejected] == [
            e["name"] for e in flights if int(e["name"][6:]) % 100 == 7
        ]
        named = {entry["name"] for entry in _all(client, "/api/flights?text=CROWD-77")}
        assert named == {e["name"] for e in flights if "crowd-77" in e["name"]}
        one, *_ = client.get(f"/api/flights?text={h('crowd-3')[:9]}").json()
        assert one["name"] == "crowd-3"  # wherever it stands in the list
        versions = _all(client, "/api/versions?limit=70")
        assert sorted(entry["label"] for entry in versions) == [
            f"v{k:04d}" for k in range(1, SMALL + 1)
        ]
        assert sorted(entry["to"] for entry in _all(client, "/api/history?limit=90")) == sorted(
            e["version"] for e in versions
        )
        findings = _all(client, "/api/findings?limit=110")
        assert [entry["reference"] for entry in findings] == [
            h(f"version-{k}") for k in reversed(range(SMALL))
        ]


def test_flights_of_one_moment_and_of_several_vehicles_are_paged_too(tmp_path: Path) -> None:
    workspace = Workspace.open(tmp_path / "several")
    with Catalogue.open(workspace.catalogue) as catalogue:
        for vehicle in ("one", "two"):
            catalogue.add_vehicle(vehicle, "text")
    seal_of(workspace.catalogue).unlink(missing_ok=True)
    raw = sqlite3.connect(workspace.catalogue)
    expected = []
    for k in range(60):
        id, at = h(f"f{k}"), _moments(4)[k % 4]
        raw.execute(
            "INSERT INTO log_files VALUES (?, ?, 1, 'ulog', 'stored', '', '[]', ?)",
            (id, f"l{k}", at),
        )
        raw.execute(
            "INSERT INTO flights (id, vehicle, log_sha256, added_utc) VALUES (?, ?, ?, ?)",
            (id, ("one", "two")[k % 3 == 0], id, at),
        )
        columns = "flight, mapping, duration, samples, step, added_utc"
        raw.execute(
            f"INSERT INTO flight_records ({columns}) VALUES (?, 'px4', 1.0, 2, 1.0, ?)", (id, at)
        )
        expected.append((at, id))
    raw.commit()
    raw.close()
    ordered = [
        id for _, id in sorted(expected, key=lambda place: (-_moments(4).index(place[0]), place[1]))
    ]
    with client_of(workspace) as client:
        for limit in (1, 7, 60, 61):
            assert [
                entry["flight"] for entry in _all(client, f"/api/flights?limit={limit}")
            ] == ordered
            assert [
                e["flight"] for e in _all(client, f"/api/flights?limit={limit}&verdict=unchecked")
            ] == ordered
        assert {entry["vehicle"] for entry in _all(client, "/api/flights?vehicle=two&limit=7")} == {
            "two"
        }
