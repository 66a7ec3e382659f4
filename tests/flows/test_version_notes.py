"""Versions as people keep them: errors, findings, flights, tags and comments in one list, search,
and failed runs that are dismissed."""

from pathlib import Path
from typing import Any

import pytest

from aerodb.storage.catalogue.catalogue import Catalogue
from tests.support.command import aerodb, asked
from tests.support.console_workspace import client_of
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import NAME


@pytest.fixture
def workspace(tmp_path: Path, shared: SharedWorkspaces) -> Path:
    return shared.updated(tmp_path / "w")[0].root


def test_the_list_has_what_people_choose_by(workspace: Path) -> None:
    asked(workspace, "version", "tag", "v0002", "flight-tested", "good-roll")
    asked(workspace, "version", "tag", "v0002", "good-roll", "flight-tested")  # changes nothing
    asked(workspace, "version", "tag", "v0002", "good-roll", "--remove")
    for _ in range(2):  # the second time as after a kill: there is one
        note = asked(
            workspace, "version", "comment", "candidate", "agrees with the Tunnel\nat 5 deg"
        )
    assert (note["label"], note["tags"], len(note["comments"])) == ("v0002", ["flight-tested"], 1)
    baseline, candidate = asked(workspace, "version", "list")
    assert baseline["held_out"] == {
        "kind": "not held out",
        "axes": {},
        "before": None,
        "after": None,
    }
    report = asked(workspace, "version", "show", "candidate")["report"]
    axis = report["axes"]["CZ"]
    assert next(iter(candidate["held_out"]["axes"])) == "CZ"
    assert candidate["held_out"]["axes"]["CZ"] == [
        axis["held_out_rms_before"],
        axis["held_out_rms_after"],
    ]
    assert candidate["flights"] == {"identified": 4, "held_out": 2}
    assert (candidate["axes"], candidate["tags"]) == (["CZ", "CX"], ["flight-tested"])
    assert candidate["comments"][0]["text"] == "agrees with the Tunnel\nat 5 deg"
    said = aerodb(workspace, "version", "list").stdout
    for words in ("not held out", "4 + 2 held out", "declared: CZ, CX", "#flight-tested"):
        assert words in said
    for words, found in (
        ("tunnel FLIGHT", ["v0002"]),
        ("released", ["v0001"]),
        ("cz", ["v0002"]),
        ("tunnel released", []),
        ("good-roll", []),
    ):
        listed = asked(workspace, "version", "list", "--search", words)
        assert [each["label"] for each in listed] == found, words
    history = asked(workspace, "version", "history")
    noted = [(each["note"], each["reason"]) for each in history if each["name"] is None]
    assert noted == [
        ("tag", "flight-tested"),
        ("tag", "good-roll"),
        ("untag", "good-roll"),
        ("comment", "agrees with the Tunnel\nat 5 deg"),
    ]
    assert "(comment)" in aerodb(workspace, "version", "history").stdout
    assert all(
        each["name"] for each in asked(workspace, "version", "history", "--name", "released")
    )


@pytest.mark.parametrize(
    "arguments", [("tag", "v0002", "Bad Tag"), ("comment", "v0002", " "), ("tag", "v0009", "x")]
)
def test_a_note_that_cannot_stand_is_refused(workspace: Path, arguments: tuple[str, ...]) -> None:
    assert aerodb(workspace, "version", *arguments).returncode in (2, 3)
    assert asked(workspace, "version", "list")[1]["tags"] == []


def failed_run(workspace: Path) -> str:
    with Catalogue.open(workspace / "catalogue.sqlite") as catalogue:
        run = catalogue.start_run("update_flow", how="direct", parameters={"vehicle": NAME}).id
        catalogue.end_run(run, "failed", "no disk")
    return run


def test_a_failed_run_is_dismissed_once_and_not_retried(workspace: Path) -> None:
    run = failed_run(workspace)
    status = asked(workspace, "status")
    assert any(f"aerodb dismiss {run[:12]}" in entry for entry in status["todo"])
    typo = aerodb(workspace, "dismiss", run[:11] + "x", "--reason", "r")
    assert (typo.returncode, run[:12] in typo.stderr) == (2, True)
    assert aerodb(workspace, "dismiss", run, "--reason", " ").returncode == 3
    assert asked(workspace, "dismiss", run[:8], "--reason", "disk replaced")["run"] == run
    assert asked(workspace, "status")["failed"] == []
    assert asked(workspace, "retry", "all", "--direct") == []
    assert aerodb(workspace, "dismiss", run, "--reason", "again").returncode == 2


def test_retry_of_a_typo_fails_at_once_with_what_was_meant(workspace: Path) -> None:
    run, flight = failed_run(workspace), asked(workspace, "flight", "list")[0]["flight"]
    with Catalogue.open(workspace / "catalogue.sqlite") as catalogue:
        before = len(catalogue.runs())
    for word in (run[:11] + "x", flight[:11] + "x", "al"):
        refused = aerodb(workspace, "retry", word)
        assert refused.returncode == 2
        assert "did you mean" in refused.stderr, refused.stderr
    with Catalogue.open(workspace / "catalogue.sqlite") as catalogue:
        assert len(catalogue.runs()) == before, "nothing was tried"


def test_the_console_takes_notes_and_dismissals(workspace: Path, shared: Any) -> None:
    from aerodb.storage.workspace import Workspace

    run = failed_run(workspace)
    with client_of(Workspace(workspace)) as client:
        version = client.get("/api/versions").json()[1]["version"]
        csrf = client.get("/api/session").json()["csrf"]
        fields = {"csrf": csrf, "kind": "comment", "text": "<b>dull</b>"}
        answer = client.post(f"/versions/{version}/notes", data=fields, follow_redirects=False)
        assert (answer.status_code, answer.headers["location"]) == (303, f"/versions/{version}")
        assert "&lt;b&gt;dull&lt;/b&gt;" in client.get(f"/versions/{version}").text
        header = {"x-csrf-token": csrf}
        tagged = client.post(
            f"/api/versions/{version}/notes", json={"kind": "tag", "text": "x"}, headers=header
        )
        assert tagged.json()["tags"] == ["x"]
        assert [v["label"] for v in client.get("/api/versions?search=DULL").json()] == ["v0002"]
        assert "None has these words" in client.get("/versions?search=sharp").text
        for address in (f"/versions/{version}/notes", f"/work/{run}/dismiss"):
            assert client.post(address, data={**fields, "csrf": "no"}).status_code == 403
        assert "Dismiss run" in client.get("/work").text
        data = {"csrf": csrf, "reason": "disk replaced"}
        assert client.post(f"/work/{run}/dismiss", data=data).status_code == 200
        assert client.get("/api/status").json()["failed"] == []
        again = client.post(f"/api/runs/{run}/dismiss", json={"reason": "r"}, headers=header)
        assert again.status_code == 404
