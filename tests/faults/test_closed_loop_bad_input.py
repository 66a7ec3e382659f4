"""Bad input of the closed loop on the command line: refused in two lines, or answered as far as
possible."""

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from aerodb.errors import InputError
from aerodb.flows.cli.main import app
from aerodb.remarks import of_error, said
from aerodb.tasks.steps.update import _incomparable, _none_usable, _rejected, by_itself
from tests.faults.test_bad_input import everything
from tests.support.command import asked
from tests.support.shared_workspace import SharedWorkspaces
from tests.support.small_glider import MODEL, NAME, channels, write_csv

CLOSE = ("close-loop", "--vehicle", NAME, "--direct")
#: Beside these a bound is not known, and none is printed.
SILENT = {"not_excited", "not_separable", "not_testable"}


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory, shared: SharedWorkspaces) -> Path:
    return shared.ingested(tmp_path_factory.mktemp("made") / "w").root


@pytest.fixture
def workspace(made: Path, tmp_path: Path) -> Path:
    """A copy that a test may change."""
    return Path(shutil.copytree(made, tmp_path / "w"))


def flights_of(workspace: Path) -> list[str]:
    return [row["flight"] for row in asked(workspace, "flight", "list")]


def named(flights: list[str]) -> list[str]:
    return [word for flight in flights for word in ("--flights", flight)]


def refused(workspace: Path, *arguments: str, code: int = 3) -> str:
    """Runs a command that must be refused and must change nothing; what it says."""
    before = everything(workspace)
    result = CliRunner().invoke(app, ["--workspace", str(workspace), *arguments])
    said = result.stderr or str(result.exception)
    assert result.exit_code == code or type(result.exception).__name__ in (
        "InputError",
        "UnknownNameError",
    ), said
    assert len(said.splitlines()) <= 2, said
    assert everything(workspace) == before
    return said


def check_bounds(document: Mapping[str, Any]) -> None:
    """No number without its bound: findings have an interval, what was not found a bound, or it is
    said why there is none."""
    for finding in document["findings"]:
        if finding["verdict"] != "unnamed":
            low, high = finding["ci95"]
            assert low <= finding["value"] <= high
            assert np.isfinite([low, high]).all()
            assert finding["votes"]
    assert document["not_found"]
    for entry in document["not_found"]:
        assert (entry["upper_bound"] is None) == (entry["minimum_detectable"] is None)
        assert entry["upper_bound"] is not None or entry["verdict"] in SILENT


@pytest.mark.parametrize("count", [1, 2])
def test_below_three_flights_nothing_is_confirmed_and_bounds_are_given(
    workspace: Path, count: int
) -> None:
    document = asked(workspace, *CLOSE, *named(flights_of(workspace)[:count]))
    assert document["candidate"] is None
    assert not [
        f for f in document["findings"] if f["verdict"] in ("confirmed", "alias_group", "sensor")
    ]
    assert any("below 3" in remark for remark in document["remarks"])
    check_bounds(document)


def test_flights_that_excite_nothing_claim_nothing(made: Path, tmp_path: Path) -> None:
    """Level flight and sensor noise. What noise of alpha, q and the elevator does to prediction and
    residual alike is seen, and cannot be told from a sensor: no slope, damping or control
    derivative is claimed, and nothing but a constant is added."""
    workspace = Path(shutil.copytree(made, tmp_path / "w"))
    known = set(flights_of(workspace))
    logs = [write_csv(tmp_path / f"level{seed}.csv", _level(seed)) for seed in range(3)]
    asked(workspace, "flight", "ingest", *map(str, logs), "--vehicle", NAME, "--direct")
    steady = [flight for flight in flights_of(workspace) if flight not in known]
    document = asked(workspace, *CLOSE, *named(steady))
    claimed = [
        f
        for f in document["findings"]
        if f["verdict"] not in ("ambiguous_sensor", "sensor", "unnamed")
    ]
    assert {f["effect"] for f in claimed} <= {"zero_offset"}
    assert all(name.startswith("zero_offset") for name in document["added"])
    verdicts = {e["hypothesis"]: e["verdict"] for e in document["not_found"]}
    assert verdicts["roll_damping@Cl"] == "not_excited"
    assert verdicts.get("pitch_damping@Cm", "ambiguous_sensor") in {*SILENT, "ambiguous_sensor"}
    check_bounds(document)


def _level(seed: int) -> dict[str, np.ndarray]:
    """The glider in trim: what moves is noise of the sensors."""
    table, rng = channels(seed), np.random.default_rng(100 + seed)
    for name, size in {
        "alpha": 1e-4,
        "q": 1e-4,
        "delta_elevator": 1e-5,
        "ax": 0.02,
        "az": 0.02,
    }.items():
        table[name] = table[name].mean() * (name != "q") + size * rng.standard_normal(
            len(table["time"])
        )
    return table


def test_all_flights_excluded_is_refused(workspace: Path) -> None:
    for flight in flights_of(workspace):
        asked(workspace, "flight", "retract", flight, "--reason", "static ports iced")
    said = refused(workspace, *CLOSE)
    number = len(flights_of(workspace))
    assert f"no usable flight: {number} of {number} retracted: static ports iced" in said
    assert said.count("iced") == 1
    assert "aerodb flight list --vehicle" in said


def test_one_reason_of_many_flights_is_said_once() -> None:
    """Whatever flight it names, and whatever numbers it holds."""
    errors = {
        f"{k:064x}": InputError(
            "database db needs delta_flap", f"flight {k:064x}"[: 19 if k % 2 else 71], "bind it"
        )
        for k in range(40)
    }
    excluded = [
        _incomparable(
            {
                "flight": flight,
                "reason": str(error),
                "cause": {"what": error.what, "where": error.where, "remedy": error.remedy},
            }
        )
        for flight, error in errors.items()
    ]
    excluded += [_rejected(f"{k:064x}", [said(f"V remains {k} m/s")]) for k in range(40, 50)]
    excluded += [by_itself("a" * 64, "retracted: iced"), by_itself("b" * 64, "retracted: bird")]
    assert str(_none_usable("my-glider", excluded)).splitlines() == [
        "update of my-glider: no usable flight: 40 of 52 database db needs delta_flap; 10 of 52"
        " rejected by the check of consistency; 1 of 52 retracted: iced; 1 other reason",
        "bind it",
        "see them: aerodb flight list --vehicle my-glider, aerodb flight show FLIGHT",
    ]
    assert "none is stored" in str(_none_usable("my-glider", []))
    failed = of_error(InputError("no motion", "V", "look at it"))
    alone = [_rejected("a" * 64, [failed])]
    assert "1 of 1 rejected: V: no motion\nlook at it\nsee them" in str(
        _none_usable("my-glider", alone)
    )


@pytest.mark.campaign
def test_a_library_that_changed_after_looking_is_refused(workspace: Path, tmp_path: Path) -> None:
    close = (*CLOSE, *named(flights_of(workspace)[:4]))
    first = asked(workspace, *close)
    frozen = first["library"]["sha256"]
    assert asked(workspace, *close, "--library", frozen[:12])["findings"] == first["findings"]
    effects = tmp_path / "mine.toml"
    effects.write_text(EFFECT)
    result = CliRunner().invoke(
        app, ["--workspace", str(workspace), *close, "--library", frozen, "--effects", str(effects)]
    )
    said = result.stderr or str(result.exception)
    assert "it changed since it was fixed" in said
    again = asked(workspace, *close, "--effects", str(effects))
    assert again["library"]["sha256"] != frozen
    late = [f for f in again["findings"] if f["effect"] == "square_of_alpha"]
    assert all(finding["verdict"] != "confirmed" for finding in late)
    assert any(
        "traced before with another list of effects" in remark for remark in again["remarks"]
    )
    rivals = {name for finding in again["findings"] for name in finding["explanation_set"]}
    assert "square_of_alpha@CX" in rivals | {entry["hypothesis"] for entry in again["not_found"]}


EFFECT = """\
[[effect]]
name = "square_of_alpha"
axes = ["CX"]
expression = "alpha^2"
plausible = [-5.0, 5.0]
because = "force along x that grows with the square of angle of attack"
"""


def test_a_flight_that_identified_before_never_validates(workspace: Path, tmp_path: Path) -> None:
    model = tmp_path / "model.toml"
    model.write_text(MODEL)
    update = asked(workspace, "update", "--vehicle", NAME, "--model", str(model), "--direct")
    used = update["flights"]["identified"][0]
    said = refused_after_looking(workspace, "--baseline", update["candidate"], "--hold-out", used)
    assert "cannot validate" in said


def test_the_same_flight_twice_is_refused_and_its_copy_has_no_vote(
    workspace: Path, tmp_path: Path
) -> None:
    flights = flights_of(workspace)
    said = refused(workspace, *CLOSE, *named([flights[0], flights[0], flights[1]]))
    assert "the same flight twice" in said
    copy = write_csv(
        tmp_path / "copy.csv", {name: values[:-3] for name, values in channels(0).items()}
    )
    asked(workspace, "flight", "ingest", str(copy), "--vehicle", NAME, "--direct")
    document = asked(workspace, *CLOSE)
    voters = {vote["flight"] for finding in document["findings"] for vote in finding["votes"]}
    excluded = {entry["flight"] for entry in document["flights"]["excluded"]}
    assert len(excluded) == 1
    assert not voters & excluded


def test_an_effect_that_is_not_in_the_library_cannot_be_accepted(workspace: Path) -> None:
    assert "no effect 'pich_damping'" in refused_after_looking(
        workspace, "--accept-suspected", "pich_damping"
    )


def test_an_effect_that_was_not_added_is_said_first(workspace: Path) -> None:
    """It ended with exit code 0, and with a sentence far below."""
    words = ["--workspace", str(workspace), *CLOSE, "--accept-suspected", "yaw_damping"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 1, result.exception
    first = result.output.splitlines()[0]
    assert first.startswith("not added although you asked for it: yaw_damping; ")
    document = json.loads(CliRunner().invoke(app, ["--json", *words]).stdout)
    assert [entry["asked"] for entry in document["not_added"]] == ["yaw_damping"]


def refused_after_looking(workspace: Path, *options: str) -> str:
    """What a refusal says that comes once flights are compared: comparisons are stored, and no
    version."""
    versions = asked(workspace, "version", "list")
    result = CliRunner().invoke(app, ["--workspace", str(workspace), *CLOSE, *options])
    assert result.exit_code != 0
    assert asked(workspace, "version", "list") == versions
    return result.stderr or str(result.exception)
