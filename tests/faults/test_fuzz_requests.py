"""Random requests to the console with the tokens of each role, of a user who was removed, and of
nobody: no fault, no answer without a token, and no name is moved but by the role that may."""

import random
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from aerodb.flows.web.console import part
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.upkeep.verification import verify
from aerodb.tasks.actors import hash_of_token
from tests.flows.web.test_console_api import KNOWN, STRANGE
from tests.support.console_workspace import Made, client_of, made_workspace
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME

_TOKENS = {role: f"a token of the role {role}" for role in ("read", "ingest", "release", "removed")}
_STRANGERS = ("nobody", "guess", "removed")
_BODIES: list[Any] = [None, [], "text", 1e308, {"name": None}, {"name": "released", "reason": ""}]


def _made(shared: SharedWorkspaces, root: Path) -> Made:
    made = made_workspace(shared, root)
    with Catalogue.open(made.workspace.catalogue) as catalogue:
        for role in ("read", "ingest", "release"):
            catalogue.add_user(f"{role}er", role, hash_of_token(_TOKENS[role]), by="test")
        catalogue.add_user("removed", "release", hash_of_token(_TOKENS["removed"]), by="test")
        catalogue.remove_user("removed", by="test")
    return made


class _Sender:
    """Draws requests; each role's client keeps the cookie and the form token of a session."""

    def __init__(self, made: Made, rng: random.Random) -> None:
        self._made, self._rng = made, rng
        tokens: dict[str, str | None] = {**_TOKENS, "nobody": None, "guess": "a guess of a token"}
        self._clients = {who: client_of(made.workspace, token=t) for who, t in tokens.items()}
        described = self._clients["read"].app.openapi()["paths"]  # type: ignore[attr-defined]
        pages = [path.removeprefix("/api") or "/" for path in described]
        self.routes = [
            *((method.upper(), path) for path, said in described.items() for method in said),
            *((method, path) for path in pages for method in ("GET", "POST")),
        ]
        self._forms = {
            who: client.get("/api/session").json()["csrf"]
            for who, client in self._clients.items()
            if who not in _STRANGERS
        }

    def send(self) -> tuple[str, str, str, Any]:
        """Who asked, the method, the path, and the answer."""
        rng = self._rng
        who = rng.choice(list(self._clients))
        if rng.random() < 0.2:  # as a page would: only the role decides
            path = f"/api/versions/{self._made.candidate}/promote"
            body = {"name": f"name-{rng.randrange(100)}", "reason": "proved"}
            head = {"x-csrf-token": self._forms.get(who, "")}
            return who, "POST", path, self._clients[who].post(path, json=body, headers=head)
        method, path = rng.choice(self.routes)
        if rng.random() < 0.3:
            method, path = "POST", "/api/versions/{version}/promote"
        if rng.random() < 0.1:
            method = rng.choice(["PUT", "DELETE", "HEAD", "OPTIONS", "PATCH", "GET", "POST"])
        words = [*KNOWN, self._made.candidate, self._made.flight]
        for name in ("version", "flight", "reference", "table", "path"):
            word = rng.choice(words if rng.random() < 0.8 else STRANGE)
            path = path.replace(f"{{{name}}}", part(word or "x"))
        headers = {}
        if rng.random() < 0.7:
            headers["x-csrf-token"] = self._forms[rng.choice(list(self._forms))]
            if who in self._forms and rng.random() < 0.7:
                headers["x-csrf-token"] = self._forms[who]
        if rng.random() < 0.1:
            headers["origin"] = "https://other.example"
        if rng.random() < 0.05:
            headers["host"] = "other.example"
        given: dict[str, Any] = {"json": rng.choice(_BODIES)}
        if rng.random() < 0.1:
            given = {"content": rng.choice([b"\xff" * 70_000, b"{", b"a=1&a=2", b"[" * 9_000])}
        if rng.random() < 0.1:
            given = {"data": {"name": "released", "reason": "proved", "seen": "x"}}
        query = {rng.choice(["limit", "at", "vehicle", "as_of", "q"]): rng.choice(STRANGE)}
        answer = self._clients[who].request(
            method,
            path,
            headers=headers,
            params=query if rng.random() < 0.3 else None,
            follow_redirects=False,
            **given,
        )
        return who, method, path, answer


@pytest.mark.heavy
def test_no_request_is_a_fault_or_acts_beyond_its_role(
    shared: SharedWorkspaces, tmp_path: Path, trials: Callable[[int, int], int]
) -> None:
    number = trials(200, 3000)
    made = _made(shared, tmp_path / "w")
    sender = _Sender(made, random.Random(None if number > 200 else 8))
    found: Counter[tuple[str, int]] = Counter()
    with Catalogue.open(made.workspace.catalogue) as catalogue:
        known = verify(made.workspace, catalogue).problems
        moves, users = catalogue.name_history(NAME), catalogue.users()
        moved = 0
        for _ in range(number):
            who, method, path, answer = sender.send()
            told = (who, method, path, answer.status_code, answer.text[:300])
            assert answer.status_code < 500 or answer.status_code == 503, told
            if who in _STRANGERS:
                assert answer.status_code in (400, 401, 403, 405, 413, 421, 429), told
            now = catalogue.name_history(NAME)
            assert len(now) == len(moves) or who == "release", told
            moved += len(now) - len(moves)
            moves = now
            found[who, answer.status_code] += 1
        assert catalogue.users() == users
        assert verify(made.workspace, catalogue).problems == known
    print(moved, sorted(found.items()))
    assert moved > 0
    assert {who for who, status in found if status == 200} == {"read", "ingest", "release"}
    assert found["read", 403] > 0
