"""Names of versions: ``released`` only through the gate, everything by logged events, one winner
per step, and the way out."""

import json
import multiprocessing
import sqlite3
from collections.abc import Callable
from dataclasses import asdict, replace
from multiprocessing.synchronize import Barrier
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from aerodb.errors import AeroError, GateRefusal, InputError
from aerodb.exchange.native import database_content_sha256, from_document, read_native, to_document
from aerodb.flows.cli.main import app
from aerodb.remarks import SUSPECTED, Remark
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.catalogue.names import standing_moves
from aerodb.storage.catalogue.rows import NameEvent
from aerodb.storage.catalogue.seal import seal_of
from aerodb.storage.workspace import Workspace, write_for_user
from aerodb.support.identity import canonical_json
from aerodb.tables.analysis.check_cases import make_check_cases
from aerodb.tables.expression import parse
from aerodb.tables.increment import Increment, Interval
from aerodb.tasks.steps.export import FORMS
from aerodb.tasks.steps.release import promote, roll_back
from aerodb.tasks.workspace_access import access_workspace
from aerodb.vehicle import parse_vehicle
from tests.support.catalogue_samples import V, add_version, h
from tests.support.command import aerodb, asked
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import DATABASE, NAME, state_of


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> tuple[Path, Path]:
    """A workspace with a proved candidate on the released handbook; and the folder of its files."""
    workspace, _ = shared.updated(tmp_path_factory.mktemp("flown") / "w")
    return workspace.root, shared.logs[0].parent


def released(workspace: Path) -> str:
    label: str = asked(workspace, "version", "show", "released")["label"]
    return label


def test_what_a_flight_is_only_suspected_of_is_said_at_release(
    tmp_path: Path, shared: SharedWorkspaces
) -> None:
    workspace, _ = shared.updated(tmp_path / "w")
    access = access_workspace(str(workspace.root))
    candidate = access.named(NAME, "candidate")
    use = next(u for u in access.catalogue.version_flights(candidate) if u.role == "identified")
    flight = access.catalogue.flight(use.flight)
    said = Remark(SUSPECTED, ("v0001", "Ixx"), text="a mass would look like this")
    access.catalogue.judge_flight(flight.id, flight.verdict, [*flight.remarks, said])
    done = asked(workspace.root, "version", "promote", "candidate", "--reason", "proved")
    assert done["moved"]
    name = access.name_of(flight)
    assert (
        f"only suspected, of {name}: beside version v0001: a mass would look like this"
        in done["notes"]
    )


DEMANDS = ["", f"[vehicles.{NAME}.gate]\nheld_out = 9\n"]


@pytest.mark.parametrize("demand", DEMANDS, ids=["as it is", "nine flights"])
def test_the_headline_says_what_promote_then_does(
    demand: str, tmp_path: Path, shared: SharedWorkspaces
) -> None:
    """Whatever the gate refuses, also what the update itself knows nothing of: here more flights
    than there are."""
    workspace, _ = shared.updated(tmp_path / "w")
    (workspace.root / "settings.toml").write_text(demand, encoding="utf-8")
    model = str(shared.logs[0].parent / "model.toml")
    options = ("--vehicle", NAME, "--model", model, "--direct", "--json")
    done = aerodb(workspace.root, "update", *options)
    assert done.returncode == 0, done.stderr
    gate = json.loads(done.stdout)["gate"]
    asked_for = ("version", "promote", "candidate", "--reason", "as the headline says")
    moved = aerodb(workspace.root, *asked_for)
    assert gate["passed"] == (moved.returncode == 0), moved.stderr
    refused = [reason for check in gate["checks"] for reason in check["reasons"]]
    assert ("the gate passes it" in done.stderr) != bool(refused)
    assert ("the gate refuses it" in done.stderr) == bool(refused)
    assert bool(demand) <= any("the settings require 9" in reason for reason in refused)
    for reason in refused:
        assert reason in moved.stderr


def test_from_candidate_to_released_and_back(flown: tuple[Path, Path]) -> None:
    workspace, folder = flown
    before = asked(workspace, "version", "history")[-1]["at_utc"]
    done = asked(
        workspace, "version", "promote", "candidate", "--reason", "lift slope proved on two flights"
    )
    assert (done["label"], done["moved"], len(done["checks"])) == ("v0002", True, 12)
    assert (
        asked(workspace, "version", "promote", "candidate", "--reason", "twice")["moved"] is False
    )
    assert released(workspace) == "v0002"
    # v0003 is made on v0002; the gate compares it with what is released at that time.
    model = ("--model", str(folder / "model.toml"), "--direct")
    asked(workspace, "update", "--vehicle", NAME, *model)
    back = asked(
        workspace, "version", "rollback", "--vehicle", NAME, "--reason", "simulator diverges"
    )
    assert (back["label"], back["stale"]) == ("v0001", [])
    refused = aerodb(workspace, "version", "promote", "v0003", "--reason", "all the same")
    assert refused.returncode == 4
    assert refused.stderr.startswith(
        f"aerodb: the gate refused v0003 of {NAME}: its parent v0002 is not released"
    )
    assert len(refused.stderr.splitlines()) == 2
    moves = asked(workspace, "version", "history", "--name", "released")
    assert [move["reason"] for move in moves[1:]] == [
        "lift slope proved on two flights",
        "simulator diverges",
    ]
    assert all(move["user"] for move in moves)
    assert asked(workspace, "version", "show", "released", "--as-of", before)["label"] == "v0001"
    assert (
        asked(workspace, "version", "show", "released", "--as-of", moves[1]["at_utc"])["label"]
        == "v0002"
    )
    assert (
        asked(workspace, "version", "show", "released", "--as-of", moves[2]["at_utc"])["label"]
        == "v0001"
    )
    # Attempts are runs, also those that were refused, with their reasons.
    with Catalogue.open(workspace / "catalogue.sqlite") as catalogue:
        attempts = [
            (run.flow, run.state, run.error)
            for run in catalogue.runs()
            if run.flow != "update_flow"
        ][:4]
    assert [entry[:2] for entry in attempts[:2]] == [
        ("promote_flow", "failed"),
        ("roll_back_flow", "completed"),
    ]
    assert "its parent v0002 is not released" in attempts[0][2]


def test_a_stale_version_is_refused_and_says_why(tmp_path: Path, shared: SharedWorkspaces) -> None:
    opened, made = shared.updated(tmp_path / "w")
    workspace = opened.root
    asked(
        workspace,
        "flight",
        "retract",
        made["flights"]["held_out"][0][:12],
        "--reason",
        "pitot cover left on",
    )
    refused = aerodb(workspace, "version", "promote", "candidate", "--reason", "r")
    assert refused.returncode == 4
    assert "pitot cover left on" in refused.stderr
    assert released(workspace) == "v0001"
    unexplained = aerodb(workspace, "version", "promote", "candidate", "--reason", " ")
    assert (unexplained.returncode, "requires a reason" in unexplained.stderr) == (3, True)
    # A name of the user's own needs no gate, and moves by events all the same.
    assert asked(
        workspace, "version", "promote", "candidate", "--name", "wind-tunnel-2", "--reason", "mine"
    )["moved"]
    assert asked(workspace, "version", "show", "wind-tunnel-2")["label"] == "v0002"


# Rolling back


def _events(*versions: str) -> tuple[NameEvent, ...]:
    with_previous = zip(versions, (None, *versions), strict=False)
    when: Any = None
    return tuple(
        NameEvent(k, V, "released", k, v, p, when, "me", "r")
        for k, (v, p) in enumerate(with_previous, start=1)
    )


@pytest.mark.parametrize(
    ("moves", "standing"),
    [
        ("a", "a"),
        ("abc", "abc"),
        ("abcb", "ab"),
        ("abcba", "a"),  # two rollbacks: not there and forth
        ("abcbd", "abd"),
        ("abac", "ac"),
        ("", ""),
    ],
)
def test_what_is_left_of_a_history_after_rollbacks(moves: str, standing: str) -> None:
    assert "".join(event.version for event in standing_moves(_events(*moves))) == standing


@pytest.fixture
def workspace(tmp_path: Path) -> Workspace:
    made = Workspace.open(tmp_path / "w")
    with Catalogue.open(made.catalogue) as catalogue:
        catalogue.add_vehicle(V, "text")
    return made


def provable(
    catalogue: Catalogue,
    name: str,
    parent: str | None,
    value: float = -0.02,
    derivatives: Any = (),
) -> str:
    """A version that passes the gate: the glider's handbook with an increment on CZ, and a report
    that proves it."""
    base = read_native(DATABASE)
    envelope = {"alpha": Interval(0.0, 0.1, 0.07)}
    increment = Increment(
        "CZ", (parse("1"),), np.array([value]), np.array([[1e-6]]), envelope, ("f1",)
    )
    increments = (
        from_document(json.loads(catalogue.version_documents(parent).content)).increments
        if parent
        else ()
    )
    database = replace(base, increments=(*increments, increment))
    axis = {
        "held_out_rms_before": 0.02,
        "held_out_rms_after": 0.01,
        "noise_floor": 0.001,
        "repeatability": 0.001,
    }
    report = {
        "axes": {"CZ": {**axis, "excess_before": 0.02, "excess_after": 0.01}},
        "check_cases": [asdict(case) for case in make_check_cases(database)],
        "derivatives": derivatives,
    }
    return add_version(
        catalogue,
        name,
        parent,
        content=canonical_json(to_document(database)).decode(),
        content_sha256=database_content_sha256(database),
        report=report,
    )


def test_rollback_goes_back_step_by_step_and_not_beyond(workspace: Workspace) -> None:
    place = {"workspace": str(workspace.root), "run": "", "name": "released", "reason": "r"}
    with Catalogue.open(workspace.catalogue) as catalogue:
        first = provable(catalogue, "first", None)
        catalogue.move_name(V, "released", first, user="me", reason="import", expected=None)
        second = provable(catalogue, "second", first)
        promote(second, **place)
        third = provable(catalogue, "third", second)
        promote(third, **place)
        back = roll_back(V, **place)
        again = roll_back(V, **place)  # the command was killed, and runs again
        assert (back["version"], back["moved"]) == (second, True)
        assert (again["version"], again["moved"]) == (second, False)
        assert again["event"] == back["event"]
        assert roll_back(V, **{**place, "reason": "further"})["version"] == first
        with pytest.raises(InputError, match="no version to go back to"):
            roll_back(V, **{**place, "reason": "beyond"})
        assert promote(second, **place)["previous"] == first
        assert [event.version for event in catalogue.name_history(V)] == [
            first,
            second,
            third,
            second,
            first,
            second,
        ]


def test_a_version_whose_content_was_changed_by_hand_is_refused(workspace: Workspace) -> None:
    place = {"workspace": str(workspace.root), "run": "", "name": "released", "reason": "r"}
    with Catalogue.open(workspace.catalogue) as catalogue:
        first = provable(catalogue, "first", None)
        catalogue.move_name(V, "released", first, user="me", reason="import", expected=None)
        second = provable(catalogue, "second", first)
        promote(second, **place)
        third, fourth = provable(catalogue, "third", second), provable(catalogue, "fourth", second)
    seal_of(workspace.catalogue).unlink(missing_ok=True)
    raw = sqlite3.connect(workspace.catalogue)
    raw.execute("DROP TRIGGER versions_no_update")
    raw.execute(
        "UPDATE versions SET content = replace(content, '-0.65', '-0.66') WHERE id IN (?, ?)",
        (third, first),
    )
    raw.execute("UPDATE versions SET content = 'x' WHERE id = ?", (fourth,))
    raw.commit()
    raw.close()
    with pytest.raises(GateRefusal, match=r"its numbers have the hash .*check case") as refusal:
        promote(third, **place)
    assert "CZ is" in str(refusal.value)
    with pytest.raises(GateRefusal, match="cannot be read"):
        promote(fourth, **place)
    with pytest.raises(GateRefusal, match="has changed since it was stored"):
        roll_back(V, **place)


REVERSED = {"axis": "Cm", "variable": "delta_elevator", "before": -1.1, "after": 1.0, "share": 0.8}


def test_a_reversed_control_is_refused_until_a_person_accepts_it_with_a_reason(
    workspace: Workspace,
) -> None:
    place = {"workspace": str(workspace.root), "run": "", "name": "released"}
    with Catalogue.open(workspace.catalogue) as catalogue:
        first = provable(catalogue, "first", None)
        catalogue.move_name(V, "released", first, user="me", reason="import", expected=None)
        second = provable(catalogue, "second", first, derivatives=[REVERSED])
        old = provable(catalogue, "old", first, derivatives=None)
        with pytest.raises(GateRefusal, match=r"Cm_delta_elevator goes from -1\.1 to 1 .*round"):
            promote(second, **place, reason="r")
        with pytest.raises(InputError, match="nothing to accept under Cm_delta_rudder"):
            promote(second, **place, reason="r", accept=["Cm_delta_rudder"])
        with pytest.raises(GateRefusal, match="does not list its derivatives: create"):
            promote(old, **place, reason="r")
        assert catalogue.named(V, "released").version == first
        promote(second, **place, reason="the tunnel's sign was wrong", accept=["Cm_delta_elevator"])
        assert catalogue.name_history(V)[-1].reason == (
            "the tunnel's sign was wrong (accepted: Cm_delta_elevator)"
        )


# Races


def _worker(root: str, number: int, rounds: int, barrier: Barrier, outcomes: Any) -> None:
    """In each round all make a version on what is released, and promote it at the same moment."""
    won = []
    workspace = Workspace(Path(root))
    with Catalogue.open(workspace.catalogue) as catalogue:
        for k in range(rounds):
            barrier.wait(300)
            event = catalogue.named(V, "released")
            assert event is not None
            # Up and down in turn: increments of one sign would add up to a new lift peak, which the
            # gate refuses.
            mine = provable(
                catalogue, f"{number}/{k}", event.version, 0.001 * (number + 1) * (-1) ** k
            )
            barrier.wait(300)
            try:
                promote(
                    mine, workspace=root, run="", name="released", reason=f"round {k} of {number}"
                )
                won.append((k, mine))
            except GateRefusal:
                pass
    outcomes.put((number, won))


@pytest.mark.heavy
def test_eight_processes_promote_at_once_and_each_step_has_one_winner(
    workspace: Workspace, trials: Callable[[int, int], int]
) -> None:
    """1,000 promotions in full: 125 rounds in which eight processes race for the same step, through
    the whole gate."""
    rounds = trials(3, 125)
    with Catalogue.open(workspace.catalogue) as catalogue:
        first = provable(catalogue, "first", None)
        catalogue.move_name(V, "released", first, user="me", reason="import", expected=None)
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(
        ["tests.tasks.test_promotion"]
    )  # eight processes, and what they import once
    barrier, outcomes = context.Barrier(8), context.Queue()
    arguments = [(str(workspace.root), number, rounds, barrier, outcomes) for number in range(8)]
    processes = [context.Process(target=_worker, args=given) for given in arguments]
    for process in processes:
        process.start()
    winners = [win for _ in processes for win in outcomes.get(timeout=1800)[1]]
    for process in processes:
        process.join(300)
        assert process.exitcode == 0
    assert sorted(k for k, _ in winners) == list(range(rounds))
    with Catalogue.open(workspace.catalogue) as catalogue:
        history = catalogue.name_history(V, "released")
        parents = {row.id: row.parent for row in catalogue.versions(V)}
    assert [event.version for event in history] == [
        first,
        *(version for _, version in sorted(winners)),
    ]
    assert [event.step for event in history] == list(range(1, rounds + 2))
    assert [event.previous for event in history] == [
        None,
        *(event.version for event in history[:-1]),
    ]
    # No winner undid another: each stands on the one before.
    assert [parents[event.version] for event in history] == [event.previous for event in history]
    assert len(parents) == 1 + 8 * rounds


# Out


def test_propellers_of_a_version_without_rotors_are_refused(
    flown: tuple[Path, Path], tmp_path: Path
) -> None:
    words = ("--format", "propeller", "--output", str(tmp_path / "out.xml"))
    done = aerodb(flown[0], "version", "export", "v0002", *words)
    assert done.returncode == 3
    assert "without rotors" in done.stderr
    assert "--format jsbsim" in done.stderr
    assert not (tmp_path / "out.xml").exists()


#: Of rotors alone; `tests/aerodb/exchange/test_propellers.py` flies it in JSBSim.
WITHOUT_WING = {"propeller"}


@pytest.mark.parametrize("format", sorted(FORMS.keys() - WITHOUT_WING))
def test_an_export_is_read_back_with_its_check_cases(
    flown: tuple[Path, Path], tmp_path: Path, format: str
) -> None:
    target = tmp_path / f"out.{format}"
    done = asked(
        flown[0], "version", "export", "v0002", "--format", format, "--output", str(target)
    )
    assert done["check_cases"] >= 10
    form = FORMS[format]
    database = form.read(target.read_bytes(), "again")
    with Catalogue.open(flown[0] / "catalogue.sqlite") as catalogue:
        stored = from_document(json.loads(catalogue.version_documents(done["version"]).content))
        row = catalogue.version(NAME, done["version"])
        described = parse_vehicle(catalogue.vehicle(row.vehicle).text, row.vehicle)
    if form.project is not None:  # what carries its own model only, the nearest to the version
        stored = form.project(stored, described)
        assert max(done["differences"].values()) > 0.0
    point = {
        "alpha": np.linspace(-0.2, 0.4, 500),
        "V": 25.0,
        "q": 0.1,
        "beta": 0.02,
        "p": 0.0,
        "r": 0.0,
        "delta_elevator": 0.1,
    }
    given, wanted = (each.predict(point).coefficients for each in (database, stored))
    for axis in wanted:
        np.testing.assert_allclose(given[axis], wanted[axis], rtol=0, atol=1e-12)


def test_an_export_that_fails_its_check_cases_leaves_nothing(
    flown: tuple[Path, Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    other = read_native(DATABASE.replace("-0.65", "-0.66"))
    monkeypatch.setitem(FORMS, "csv", replace(FORMS["csv"], read=lambda data, name: other))
    refused = invoked(
        flown[0],
        "version",
        "export",
        "v0001",
        "--format",
        "csv",
        "--output",
        str(tmp_path / "out.zip"),
    )
    assert isinstance(refused.exception, InputError)
    assert "check values differ when it is read back" in str(refused.exception)
    assert list(tmp_path.iterdir()) == []


def invoked(workspace: Path, *arguments: str) -> Any:
    return CliRunner().invoke(app, ["--workspace", str(workspace), *arguments])


HOSTILE = [
    "../x",
    "'; DROP TABLE versions; --",
    "a\nb",
    "\ud800",
    "x" * 5000,
    "",
    "v0001",
    "Released",
    "\x1b[31m",
]


@pytest.mark.parametrize("name", HOSTILE, ids=range(len(HOSTILE)))
def test_hostile_names_move_nothing(flown: tuple[Path, Path], name: str) -> None:
    workspace = flown[0]
    history, files = asked(workspace, "version", "history"), state_of(workspace)
    reference = "v9" if name == "v0001" else name
    for arguments in (
        ["promote", "v0001", "--name", name, "--reason", "r"],
        ["rollback", "--vehicle", NAME, "--name", name, "--reason", "r"],
        ["promote", reference, "--reason", "r"],
        ["diff", "v0001", reference],
        ["lineage", reference],
        ["export", "v0001", "--format", name, "--output", "x"],
        ["export", reference, "--format", "csv", "--output", "x"],
        ["history", "--name", name],
    ):
        assert isinstance(invoked(workspace, "version", *arguments).exception, AeroError), arguments
    assert asked(workspace, "version", "history") == history
    assert state_of(workspace) == files


def test_output_never_lands_on_the_workspaces_own_files(
    flown: tuple[Path, Path], tmp_path: Path
) -> None:
    workspace = flown[0]
    before = state_of(workspace, but=("prefect",))
    (tmp_path / "link.xml").symlink_to(workspace / "catalogue.sqlite")
    (tmp_path / "folder").mkdir()
    targets = [
        workspace / "catalogue.sqlite",
        workspace / "results" / ".." / "catalogue.sqlite",
        tmp_path / "link.xml",
        tmp_path / "folder",
        tmp_path / "absent" / "x.xml",
        Path("x" * 3000),
        Path("a\0b"),
    ]
    for target in targets:
        with pytest.raises(InputError):
            write_for_user(Workspace(workspace), target, b"x")
    assert state_of(workspace, but=("prefect",)) == before
    assert (
        write_for_user(Workspace(workspace), workspace / "reports" / "x.xml", b"x").read_bytes()
        == b"x"
    )
    (workspace / "reports" / "x.xml").unlink()
    assert (
        aerodb(
            workspace, "version", "export", "v0001", "--format", "xls", "--output", "x"
        ).returncode
        == 3
    )


def test_the_names_of_a_vehicle_are_found_without_their_history(workspace: Workspace) -> None:
    with Catalogue.open(workspace.catalogue) as catalogue:
        a, b = add_version(catalogue, "a"), add_version(catalogue, "b")
        for name in ("released", "candidate", "mine"):
            catalogue.move_name(V, name, a, user="me", reason="r", expected=None)
            catalogue.move_name(V, name, b, user="me", reason="r", expected=a)
        catalogue.move_name(V, "mine", a, user="me", reason="r", expected=b)
        assert catalogue.names(V) == {"released": b, "candidate": b, "mine": a}
        assert [event.name for event in catalogue.name_history(V, limit=2)] == ["mine", "mine"]
        assert [event.version for event in catalogue.name_history(V, "mine", limit=1)] == [a]
        assert [event.sequence for event in catalogue.moves_to(V, [a])] == [1, 3, 5, 7]
        assert catalogue.named(V, "nobody") is None
        assert h("a") == a
