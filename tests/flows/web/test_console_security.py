"""Who may ask, and who may change: foreign names, missing tokens, forged forms. And what the gate
says is shown."""

import base64
import json
from pathlib import Path
from typing import Any, get_args

import pytest
from starlette.testclient import TestClient
from typer.testing import CliRunner

from aerodb.errors import InputError
from aerodb.flows.cli.main import app
from aerodb.flows.web.access_log import REFUSED
from aerodb.flows.web.bodies import LARGEST_BODY
from aerodb.flows.web.guard import Guard, guard_of
from aerodb.flows.web.sessions import COOKIE
from aerodb.flows.web.tokens import MOST_WRONG, Attempts
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.rows import NameEvent, UserRole
from aerodb.tasks.actors import hash_of_token, new_token
from tests.support.console_workspace import TOKEN, Made, add_child, client_of, made_workspace
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Made:
    return made_workspace(shared, tmp_path_factory.mktemp("console") / "workspace")


def moves(made: Made) -> tuple[NameEvent, ...]:
    with Catalogue.open(made.workspace.catalogue) as catalogue:
        return catalogue.name_history(NAME)


def runs(made: Made) -> int:
    with Catalogue.open(made.workspace.catalogue) as catalogue:
        return len(catalogue.runs(limit=10_000))


def csrf_of(client: TestClient) -> str:
    return str(client.get("/api/session").json()["csrf"])


@pytest.mark.parametrize(
    ("host", "status"),
    [
        ("127.0.0.1:8050", 200),
        ("localhost", 200),
        ("[::1]:99", 200),
        ("LOCALHOST:1", 200),
        ("evil.example", 421),
        ("127.0.0.1.evil.example:8050", 421),
        ("localhost@evil.example", 421),
        ("evil.example#localhost", 421),
        ("", 421),
        ("10.0.0.7:8050", 421),
    ],
)
def test_only_our_own_names_are_answered(prepared: Made, host: str, status: int) -> None:
    with client_of(prepared.workspace) as client:
        answer = client.get("/api/vehicles", headers={"host": host})
        assert answer.status_code == status
        assert (NAME in answer.text) == (status == 200)


def test_a_console_that_others_reach_needs_a_token(prepared: Made) -> None:
    for host in ("0.0.0.0", "192.168.1.5", "aircraft.example", "::"):
        with pytest.raises(InputError, match="without a token"):
            guard_of(host, 8050, (), {})
        assert guard_of(host, 8050, (), {"AERODB_TOKEN": TOKEN}).token == TOKEN
    with pytest.raises(InputError, match="fewer than 16 characters"):
        guard_of("127.0.0.1", 8050, (), {"AERODB_TOKEN": "short"})
    result = CliRunner().invoke(
        app,
        ["--workspace", str(prepared.workspace.root), "web", "--host", "0.0.0.0", "--port", "0"],
    )
    assert isinstance(result.exception, InputError)
    assert "without a token" in str(result.exception)


def test_a_token_is_asked_for_everywhere(prepared: Made) -> None:
    def basic(word: str) -> str:
        return "Basic " + base64.b64encode(f"anyone:{word}".encode()).decode()

    with client_of(prepared.workspace, "0.0.0.0", None) as client:
        for path in ("/", "/api/flights", "/static/console.css", "/openapi.json", "/nothing"):
            answer = client.get(path)
            assert answer.status_code == 401
            assert answer.headers["www-authenticate"].startswith("Basic")
            assert NAME not in answer.text
        for wrong in (
            basic("wrong"),
            basic(TOKEN + "x"),
            "Bearer",
            "Basic ###",
            f"Digest {TOKEN}",
            "Basic /w==",
            TOKEN,
        ):
            assert client.get("/", headers={"authorization": wrong}).status_code == 401, wrong
        for right in (basic(TOKEN), f"Bearer {TOKEN}"):
            assert client.get("/", headers={"authorization": right}).status_code == 200
        for name in ("10.1.2.3:8050", "[fe80::1]:8050"):
            assert (
                client.get("/", headers={"authorization": basic(TOKEN), "host": name}).status_code
                == 200
            )
        assert (
            client.get(
                "/", headers={"authorization": basic(TOKEN), "host": "evil.example"}
            ).status_code
            == 421
        )


def test_a_name_that_is_said_is_answered() -> None:
    guard = guard_of("127.0.0.1", 8050, ("Console.Example",), {})
    assert guard.knows("console.example:443")
    assert not guard.knows("console.example.evil.example")
    assert not guard.knows("192.0.2.1")


def test_every_answer_carries_its_headers(prepared: Made) -> None:
    with client_of(prepared.workspace) as client:
        for path in ("/", "/api/flights", "/nothing", "/static/console.css", "/openapi.json"):
            headers = client.get(path).headers
            assert headers["x-content-type-options"] == "nosniff"
            assert "frame-ancestors 'none'" in headers["content-security-policy"]
            assert "access-control-allow-origin" not in headers
        cookie = client_of(prepared.workspace).get("/").headers["set-cookie"].lower()
        assert "httponly" in cookie
        assert "samesite=strict" in cookie


@pytest.mark.parametrize("wrong", ["none", "empty", "other", "stolen", "form"])
def test_a_change_without_its_token_changes_nothing(prepared: Made, wrong: str) -> None:
    before, ran = moves(prepared), runs(prepared)
    with client_of(prepared.workspace) as client, client_of(prepared.workspace) as other:
        token = {
            "none": None,
            "empty": "",
            "other": "0" * 64,
            "stolen": csrf_of(other),
            "form": csrf_of(client),
        }[wrong]
        if wrong == "form":
            client.cookies.delete(COOKIE)
        fields = {
            "reason": "because",
            "name": "released",
            "seen": prepared.baseline,
            "vehicle": NAME,
        }
        fields |= {} if token is None else {"csrf": token}
        headers = {} if token is None else {"x-csrf-token": token}
        for path in (f"/versions/{prepared.candidate}/promote", "/rollback"):
            assert client.post(path, data=fields).status_code == 403
        for path in (f"/api/versions/{prepared.candidate}/promote", "/api/rollback"):
            answer = client.post(path, json={"reason": "because"}, headers=headers)
            assert answer.status_code == 403
            assert answer.json()["error"]["remedy"]
    assert moves(prepared) == before
    assert runs(prepared) == ran


def test_a_change_from_another_page_is_refused_before_it_is_read(prepared: Made) -> None:
    before = moves(prepared)
    with client_of(prepared.workspace) as client:
        headers = {"x-csrf-token": csrf_of(client)}
        path = f"/api/versions/{prepared.candidate}/promote"
        for origin in (
            {"origin": "https://evil.example"},
            {"origin": "null"},
            {"sec-fetch-site": "cross-site"},
        ):
            assert (
                client.post(path, json={"reason": "r"}, headers={**headers, **origin}).status_code
                == 403
            )
        large = "x" * (LARGEST_BODY + 1)
        assert client.post(path, content=large, headers=headers).status_code == 413
        assert client.get(path).status_code == 405
    assert moves(prepared) == before


def test_promotion_and_roll_back_through_their_pages(
    shared: SharedWorkspaces, tmp_path: Path
) -> None:
    made = made_workspace(shared, tmp_path / "workspace")
    with client_of(made.workspace) as client:
        page = client.get(f"/versions/{made.candidate}/promote").text
        csrf = page.partition('name="csrf" value="')[2].partition('"')[0]
        fields: dict[str, Any] = {
            "csrf": csrf,
            "name": "released",
            "seen": made.baseline,
            "reason": " ",
        }
        path = f"/versions/{made.candidate}/promote"
        assert client.post(path, data=fields).status_code == 422  # no reason
        assert (
            client.post(path, data={**fields, "reason": "r", "seen": made.candidate}).status_code
            == 409
        )  # moved meanwhile
        assert len(moves(made)) == 2
        answer = client.post(path, data={**fields, "reason": "proved <b>twice</b>"})
        assert answer.status_code == 200, answer.text
        assert "released of" in answer.text
        assert "now points to v0002" in answer.text
        assert "Checks passed by the gate" in answer.text
        assert "proved &lt;b&gt;twice&lt;/b&gt;" in answer.text
        assert moves(made)[-1].version == made.candidate
        assert "from v0002 to v0001?" in " ".join(client.get("/rollback").text.split()).replace(
            "back ", ""
        )
        back = {
            "csrf": csrf,
            "name": "released",
            "seen": made.candidate,
            "vehicle": NAME,
            "reason": "diverges",
        }
        assert "now points to v0001" in client.post("/rollback", data=back).text
        assert [(m.version, m.reason) for m in moves(made)[-2:]] == [
            (made.candidate, "proved <b>twice</b>"),
            (made.baseline, "diverges"),
        ]
        assert (
            client.post(
                "/rollback", data={**back, "seen": made.baseline, "reason": "again"}
            ).status_code
            == 422
        )  # nothing before


def test_the_gate_refuses_with_its_reasons(prepared: Made) -> None:
    with Catalogue.open(prepared.workspace.catalogue) as catalogue:
        child = add_child(catalogue, prepared.baseline, "unproved", [prepared.flight])
    before = moves(prepared)
    with client_of(prepared.workspace) as client:
        csrf = csrf_of(client)
        headers, path = {"x-csrf-token": csrf}, f"/api/versions/{child}/promote"
        fields = {"csrf": csrf, "name": "released", "seen": prepared.baseline, "reason": "try"}
        answer = client.post(f"/versions/{child}/promote", data=fields)
        assert answer.status_code == 409
        assert "The gate refused; nothing was changed" in answer.text
        refused = client.post(path, json={"reason": "try"}, headers=headers)
        assert refused.status_code == 409
        for reason in refused.json()["error"]["what"].split("; "):
            assert reason.split("'")[0] in answer.text.replace("&#39;", "'")
        named = client.post(
            f"/api/versions/{child}/promote",
            json={"reason": "try", "name": "mine"},
            headers={"x-csrf-token": csrf},
        )
        assert named.json()["moved"]
        assert client.post(path, json={"reason": 3}, headers=headers).status_code == 422
    assert moves(prepared)[:-1] == before


def users(made: Made) -> dict[str, str]:
    """A user of each role, and the token."""
    tokens = {role: new_token() for role in get_args(UserRole)}
    with Catalogue.open(made.workspace.catalogue) as catalogue:
        for role in get_args(UserRole):
            catalogue.add_user(f"{role}er", role, hash_of_token(tokens[role]), by="test")
    return tokens


def test_only_the_role_release_moves_a_name(shared: SharedWorkspaces, tmp_path: Path) -> None:
    made = made_workspace(shared, tmp_path / "workspace")
    before = moves(made)
    for role, token in users(made).items():
        with client_of(made.workspace, token=token) as client:
            for path in ("/", "/api/flights", f"/versions/{made.candidate}"):
                assert client.get(path).status_code == 200
            path = f"/api/versions/{made.candidate}/promote"
            headers = {"x-csrf-token": csrf_of(client)}
            answer = client.post(path, json={"reason": "r", "name": "mine"}, headers=headers)
            assert answer.status_code == (200 if role == "release" else 403), answer.text
            if role != "release":
                assert f"{role}er has the role {role}" in answer.json()["error"]["what"]
                assert moves(made) == before
    assert [(event.name, event.user) for event in moves(made)[len(before) :]] == [
        ("mine", "releaseer")
    ]
    log = [json.loads(line) for line in made.workspace.access_log.read_text().splitlines()]
    posts = [
        (line["user"], line["role"], line["status"]) for line in log if line["method"] == "POST"
    ]
    assert posts == [
        ("reader", "read", 403),
        ("ingester", "ingest", 403),
        ("releaseer", "release", 200),
    ]


def test_guesses_are_counted_held_up_and_written_down(
    shared: SharedWorkspaces, tmp_path: Path
) -> None:
    made = made_workspace(shared, tmp_path / "workspace")
    with client_of(made.workspace) as client:
        assert client.get("/").status_code == 200
        answers = [
            client.get("/", headers={"authorization": f"Bearer guess {k}"}).status_code
            for k in range(1000)
        ]
        # Not all in one minute, perhaps.
        assert MOST_WRONG <= answers.count(401) <= 5 * MOST_WRONG
        assert answers.count(401) + answers.count(429) == 1000
        assert client.get("/").status_code == 200  # a token that was right before
        later = client.get("/", headers={"authorization": "Bearer guess 1000"})
        assert later.headers["retry-after"] == "60"
        elsewhere = TestClient(client.app, "http://127.0.0.1:8050", client=("192.0.2.7", 1))
        wrong = elsewhere.get("/", headers={"authorization": "Bearer guess 1001"})
        assert wrong.status_code == 401
    log = [json.loads(line) for line in made.workspace.access_log.read_text().splitlines()]
    refused = [line for line in log if line["status"] in (401, 429)]
    assert len(refused) + sum(line.get("left_out_before", 0) for line in log) >= 900
    assert len(refused) <= 5 * REFUSED
    assert {line["user"] for line in refused} == {""}
    assert "guess" not in made.workspace.access_log.read_text()


def test_attempts_are_forgotten_in_the_order_of_their_age() -> None:
    attempts = Attempts()
    for address in ("192.0.2.1", "2001:db8::1"):
        for k in range(MOST_WRONG):
            assert attempts.may_try(address, f"{k}")
            attempts.note(address, f"{k}", is_right=False)
    for address in ("192.0.2.1", "2001:db8::2"):  # IPv6: the network
        assert not attempts.may_try(address, "further")
    assert attempts.may_try("192.0.2.2", "further")
    for k in range(20_000):
        attempts.note(f"10.0.{k // 256}.{k % 256}", "wrong", is_right=False)
    assert attempts.may_try("192.0.2.1", "further")


def test_tokens_of_two_processes_differ() -> None:
    one, other = guard_of("127.0.0.1", 1, (), {}), guard_of("127.0.0.1", 1, (), {})
    assert isinstance(one, Guard)
    assert one.csrf_token("s", "anna") != other.csrf_token("s", "anna")
    assert one.csrf_token("s", "anna") != one.csrf_token("t", "anna")


def test_the_session_of_one_user_is_of_no_use_to_another(
    shared: SharedWorkspaces, tmp_path: Path
) -> None:
    """A cookie can be planted from another port or a parent domain, with the token that fits it."""
    made = made_workspace(shared, tmp_path / "workspace")
    tokens: dict[UserRole, str] = {role: new_token() for role in get_args(UserRole)}
    with Catalogue.open(made.workspace.catalogue) as catalogue:
        for role, token in tokens.items():
            catalogue.add_user(f"{role}er", role, hash_of_token(token), by="test")
    before = moves(made)
    with client_of(made.workspace, token=tokens["read"]) as reader:
        csrf, cookie = csrf_of(reader), reader.cookies[COOKIE]
    with client_of(made.workspace, token=tokens["release"]) as releaser:
        releaser.cookies.set(COOKIE, cookie)
        answer = releaser.post(
            f"/api/versions/{made.candidate}/promote",
            json={"name": "planted", "reason": "a planted cookie"},
            headers={"x-csrf-token": csrf},
        )
        assert answer.status_code == 403
        assert "does not belong to this session" in answer.text
    assert moves(made) == before


def test_two_tokens_are_none(prepared: Made) -> None:
    """A proxy and the console would not take the same one."""
    right, wrong = ("authorization", f"Bearer {TOKEN}"), ("authorization", "Bearer wrong")
    with client_of(prepared.workspace, token=None) as client:
        assert client.get("/api/vehicles", headers=[right]).status_code == 200
        for both in ([right, wrong], [wrong, right], [right, right]):
            assert client.get("/api/vehicles", headers=both).status_code == 401
