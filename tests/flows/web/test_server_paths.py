"""A reader of the console learns no path of the server: in pages, documents and errors."""

import re
import shutil
from pathlib import Path

import pytest
from fastapi.routing import APIRoute, APIRouter
from starlette.testclient import TestClient

from aerodb.flows.web import app as web
from aerodb.flows.web.app import create_app
from aerodb.flows.web.guard import guard_of
from aerodb.flows.web.server_paths import without_server_paths
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.tasks.actors import hash_of_token, new_token
from tests.support.console_workspace import Made, made_workspace
from tests.support.shared_workspace import SharedWorkspaces


def readable(made: Made) -> list[str]:
    """Every address that can be read, of things that are there."""
    known = {
        "flight": made.flight,
        "id": made.flight,
        "version": made.candidate,
        "reference": made.candidate,
        "vehicle": str(made.document["vehicle"]),
    }
    pages = [
        part for part in vars(web).values() if isinstance(getattr(part, "router", None), APIRouter)
    ]
    routes = [route for part in pages for route in part.router.routes]
    paths = [r.path for r in routes if isinstance(r, APIRoute) and "GET" in r.methods]
    return [
        re.sub(r"{(\w+)(:\w+)?}", lambda m: known.get(m[1], made.candidate), path) for path in paths
    ]


def answers(made: Made, role: str) -> dict[str, str]:
    """Address -> what somebody of a role reads there; and the answer to a change."""
    token = new_token()
    with Catalogue.open(made.workspace.catalogue) as catalogue:
        catalogue.add_user(f"a-{role}", role, hash_of_token(token), by="test")  # type: ignore[arg-type]
    app = create_app(made.workspace.root, guard_of("127.0.0.1", 8050, (), {}))
    headers = {"authorization": f"Bearer {token}"}
    with TestClient(
        app, "http://127.0.0.1:8050", headers=headers, raise_server_exceptions=False
    ) as client:
        found = {path: client.get(path).text for path in readable(made)}
        csrf = client.get("/api/session").json()
        change = f"/api/versions/{made.candidate}/promote"
        named = {"name": "mine", "reason": "r"}
        held = next(v for k, v in csrf.items() if "csrf" in k or "token" in k)
        found[change] = client.post(change, json=named, headers={"x-csrf-token": held}).text
    return found


@pytest.mark.parametrize("lost", [False, True])
def test_a_reader_learns_no_path_of_the_server(
    shared: SharedWorkspaces, tmp_path: Path, lost: bool
) -> None:
    made = made_workspace(shared, tmp_path / "workspace")
    if lost:  # every file of the store: pages become errors
        for folder in ("results", "flights", "reports"):
            shutil.rmtree(made.workspace.root / folder, ignore_errors=True)
    read = answers(made, "read")
    assert len(read) > 20
    assert [path for path, text in read.items() if str(tmp_path) in text] == []


def test_paths_of_the_machine_become_names_and_addresses_stay(tmp_path: Path) -> None:
    text = f"no file at {tmp_path}/flights/a.parquet; see /api/flights, or {tmp_path}"
    assert (
        without_server_paths(text) == f"no file at a.parquet; see /api/flights, or {tmp_path.name}"
    )
    assert without_server_paths("C:\\data\\a.csv and 3/4 of 5/6") == "a.csv and 3/4 of 5/6"
