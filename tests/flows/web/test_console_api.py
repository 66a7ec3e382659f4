"""The API as its own description states it: whatever is sent, the answer is never a fault of the
server."""

import random
from collections.abc import Callable
from typing import Any

import pytest
import schemathesis
from hypothesis import HealthCheck, Phase, given, seed, settings
from starlette.datastructures import Headers
from starlette.testclient import TestClient
from starlette.types import ASGIApp, Receive, Scope, Send

from aerodb.flows.web.app import create_app
from aerodb.flows.web.console import part
from aerodb.flows.web.guard import guard_of
from tests.support.catalogue_samples import h
from tests.support.console_workspace import HOSTILE, TOKEN, Made, made_workspace
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME

#: Words that lead past the first check, and words that should lead nowhere.
KNOWN = [
    "released",
    "candidate",
    "v0001",
    "v0002",
    NAME,
    h("hostile 0"),
    "CZ0",
    "CZ0[2]",
    "alpha=5deg",
    "alpha",
    "V",
    "limited",
]
STRANGE = [
    "",
    "\x00",
    "\ud7ff",
    HOSTILE,
    "9" * 400,
    "../../etc/passwd",
    "%00",
    "alpha=1e400",
    "CZ0[99999]",
    "'; DROP TABLE flights;--",
]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Made:
    return made_workspace(shared, tmp_path_factory.mktemp("console") / "workspace")


@pytest.fixture(scope="module")
def app(made: Made) -> Any:
    guard = guard_of("127.0.0.1", 0, ("testserver",), {"AERODB_TOKEN": TOKEN})
    created = create_app(made.workspace.root, guard)
    created.add_middleware(SignedIn)
    return created


class SignedIn:
    """Middleware that gives every request the token, if it has none."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] == "http" and "authorization" not in Headers(scope=scope):
            scope["headers"].append((b"authorization", f"Bearer {TOKEN}".encode()))
        await self._app(scope, receive, send)


def _operations(app: Any) -> list[Any]:
    description = schemathesis.openapi.from_asgi("/openapi.json", app)
    return [found.ok() for found in description.get_all_operations()]


def test_the_description_names_every_answer(app: Any) -> None:
    operations = _operations(app)
    assert len(operations) >= 18
    for path, methods in app.openapi()["paths"].items():
        assert path.startswith("/api/")
        for said in methods.values():
            assert said["summary"]
            assert said["tags"]


def test_no_request_that_the_description_allows_ends_in_a_fault(
    app: Any, trials: Callable[[int, int], int]
) -> None:
    asked = 0
    for operation in _operations(app):

        @seed(11)
        @settings(
            max_examples=trials(6, 200),
            deadline=None,
            database=None,
            phases=[Phase.generate],
            suppress_health_check=list(HealthCheck),
        )
        @given(case=operation.as_strategy())
        def never_a_fault(case: Any) -> None:
            nonlocal asked
            asked += 1
            answer = case.call()
            assert answer.status_code < 500 or answer.status_code == 503, (
                case.formatted_path,
                answer.status_code,
            )

        never_a_fault()
    assert asked >= len(_operations(app))


def test_no_mixture_of_known_and_strange_words_ends_in_a_fault(
    app: Any, made: Made, trials: Callable[[int, int], int]
) -> None:
    rng = random.Random(5)
    words = [*KNOWN, made.candidate, made.flight]
    with TestClient(app, base_url="http://testserver") as client:
        found: dict[int, int] = {}
        for _ in range(trials(6, 100)):
            for path, methods in app.openapi()["paths"].items():
                for said in [methods["get"]] if "get" in methods else []:
                    asked = {
                        p["name"]: rng.choice(rng.choice([words, STRANGE]))
                        for p in said.get("parameters", ())
                    }
                    inside = {p["name"] for p in said.get("parameters", ()) if p["in"] == "path"}
                    place = path
                    for name in inside:
                        place = place.replace(f"{{{name}}}", part(asked[name] or "x"))
                    query = {
                        name: word
                        for name, word in asked.items()
                        if name not in inside and rng.random() < 0.7
                    }
                    answer = client.get(place, params=query)
                    assert answer.status_code < 500, (place, query, answer.text)
                    found[answer.status_code] = found.get(answer.status_code, 0) + 1
    assert found[200] > 0
    assert found[404] > 0
    assert found[422] > 0
