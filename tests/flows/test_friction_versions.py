"""Friction as a line of versions of its own, by the commands: legs alone, composed with aerodynamics
where they roll, updated from JSBSim's rolls, judged, released and rolled back."""

from pathlib import Path
from typing import Any

import pytest

from aerodb.storage.workspace import Workspace
from tests.support.command import aerodb, asked, of_schema
from tests.support.console_workspace import client_of
from tests.support.small_glider import write_csv
from tests.support.three_wheels import (
    MASSES,
    SPRING,
    THREE_WHEELS,
    VEHICLE,
    WITH_AIR,
    measured,
    rolled_in_jsbsim,
)

BRAKES, BELIEVED = 0.22, 0.26
LEVEL = 1.2 - MASSES["mass"] * 9.80665 / (3.0 * SPRING)
#: The wheels without lengths, which are those of the vehicle; the air without wheels.
LEGS = 'name = "runway and tyre"\n' + THREE_WHEELS[THREE_WHEELS.index("[free_inputs]") :]
AIR = 'name = "air"\n' + WITH_AIR[WITH_AIR.index("[reference]") : WITH_AIR.index("[free_inputs]")]
AIR += WITH_AIR[WITH_AIR.index("[derivatives.CX]") :]
#: Wind north and east [m/s], and when brakes begin [s], of each roll.
ROLLS = (((1.0, 3.0), 5.0), ((-2.0, 4.0), 8.0), ((2.0, -3.0), 4.0))
MODEL = 'parameters = ["mu_brake"]\n'


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Aerodynamics v0001, released; legs v0002 with wrong brakes, released as friction."""
    pytest.importorskip("jsbsim")
    folder = tmp_path_factory.mktemp("friction")
    legs = LEGS.replace(f"value = {BRAKES}", f"value = {BELIEVED}")
    assert legs != LEGS
    for name, text in (("vehicle", VEHICLE), ("air", AIR), ("legs", legs), ("model", MODEL)):
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")
    w = folder / "w"
    asked(w, "vehicle", "add", str(folder / "vehicle.toml"))
    asked(w, "database", "import", str(folder / "air.toml"))
    accepted = ("--accept", "content", "--reason", "it only rolls")
    asked(w, "version", "promote", "v0001", *accepted)
    found = asked(w, "database", "import", str(folder / "legs.toml"))
    assert (found["label"], found["released"], found["lacks"]) == ("v0002", True, [])
    logs = [
        str(
            write_csv(
                folder / f"{number}.csv",
                measured(rolled_in_jsbsim(BRAKES, wind, LEVEL, braking_from=late), number),
            )
        )
        for number, (wind, late) in enumerate(ROLLS)
    ]
    done = aerodb(w, "flight", "ingest", *logs, "--mapping", "canonical")
    assert "close-loop --vehicle wheels --with released-friction" in done.stdout
    return folder


def names(folder: Path) -> dict[str, str]:
    listed = asked(folder / "w", "version", "list")
    return {name: each["label"] for each in listed for name in each["names"]}


def updated(folder: Path, *given: str) -> dict[str, Any]:
    model = ("--model", str(folder / "model.toml"), "--with", "released-friction")
    return dict(of_schema("update", asked(folder / "w", "update", *model, *given)))


def test_legs_alone_do_not_take_the_name_of_the_aerodynamics(workspace: Path) -> None:
    found = names(workspace)
    assert (found["released"], found["released-friction"]) == ("v0001", "v0002")
    before = asked(workspace / "w", "version", "show", "v0002")
    assert set(before["report"]) >= {"imported_from", "check_cases"}


@pytest.mark.heavy
def test_rolls_become_a_version_of_friction_that_is_judged_released_and_rolled_back(
    workspace: Path,
) -> None:
    w = workspace / "w"
    found = updated(workspace, "--hold-out", "2.csv")
    (change,) = found["parameters"]
    assert change["name"] == "mu_brake"
    assert change["after"] == pytest.approx(BRAKES, rel=0.01)
    assert found["with"]["label"] == "v0001"
    made = found["label"]
    assert names(workspace)["candidate-friction"] == made
    assert "candidate" not in names(workspace)
    shown = asked(w, "version", "show", made)
    v0002 = asked(w, "version", "show", "v0002")
    assert shown["parent"] == v0002["version"]
    assert shown["settings"]["with"] == asked(w, "version", "show", "v0001")["version"]

    gate = asked(w, "version", "gate", made)
    assert gate["passed"]
    told = {each["label"]: each for each in gate["checks"]}
    assert told["held-out error"]["measures"][0]["of"] == "all axes"
    assert told["sign changes"]["not_judged"] == "does not apply: legs alone"
    assert "does not apply" in aerodb(w, "version", "gate", made).stdout
    status = asked(w, "status")
    (vehicle,) = status["vehicles"]
    assert (vehicle["released-friction"], vehicle["candidate-friction"]) == ("v0002", made)
    assert f"{made} of wheels waits for a decision" in " ".join(status["todo"])
    said = aerodb(w, "status").stdout
    assert (
        f"released v0001, candidate -, released-friction v0002, candidate-friction {made}" in said
    )
    (edit,) = asked(w, "version", "diff", "v0002", made)["terms"]
    assert (edit["kind"], edit["name"]) == ("parameter", "mu_brake")
    node = asked(w, "version", "lineage", made, "--node", "mu_brake")["parameter"]
    assert len(node["flights"]) == 2
    assert node["flown"]["brake"] == [0.0, 1.0]
    line = asked(w, "version", "lineage", made)
    assert [each["label"] for each in line["line"]] == [made, "v0002"]
    assert shown["settings"]["with"] in line["inputs"][line["version"]]

    asked(w, "version", "promote", made, "--reason", "two rolls, one held out")
    assert names(workspace)["released-friction"] == made
    assert names(workspace)["released"] == "v0001"
    with client_of(Workspace.open(w)) as client:
        own = f"/versions/{shown['version']}"
        for page in (own, f"{own}/promote", "/work"):
            answer = client.get(page)
            assert answer.status_code == 200
            assert made in answer.text
    page = Path(found["page"]).read_text(encoding="utf-8")
    assert "mu_brake" in page
    assert "along [m]" in page
    back = ("--name", "released-friction", "--reason", "another tyre")
    assert asked(w, "version", "rollback", *back)["label"] == "v0002"
    again = asked(w, "update", "--like", made)
    assert again["label"] == made


@pytest.mark.heavy
def test_a_loop_adds_what_rolls_confirm_to_the_line_of_friction(workspace: Path) -> None:
    w = workspace / "w"
    found = asked(w, "close-loop", "--with", "released-friction")
    after = {each["name"]: each["after"] for each in found["parameters"]}
    assert after["mu_brake"] == pytest.approx(BRAKES, rel=0.01)
    shown = asked(w, "version", "show", found["label"])
    assert shown["parent"] == asked(w, "version", "show", "v0002")["version"]
    given = ("--model", str(workspace / "model.toml"), "--method", "output-error")
    for pair in (("v0001", found["label"]), (found["label"], "v0001")):
        versions = ("--baseline", pair[0], "--with", pair[1])
        (method,) = asked(w, "estimate", *given, *versions)["methods"]
        (brakes,) = (each for each in method["estimates"] if each["name"] == "mu_brake")
        assert brakes["value"] == pytest.approx(BRAKES, rel=0.01)


def test_a_roll_flown_with_two_versions_is_that_of_one_with_both(workspace: Path) -> None:
    w = workspace / "w"
    whole = workspace / "whole.toml"
    whole.write_text(WITH_AIR.replace(f"value = {BRAKES}", f"value = {BELIEVED}"), encoding="utf-8")
    both = asked(w, "database", "import", str(whole), "--vehicle", "wheels")["label"]
    how = ("--flight", "0.csv", "--from", "0", "--to", "20", "--no-stabilise")
    flown = [
        of_schema("version fly", asked(w, "version", "fly", *words, *how))["stretches"]
        for words in ((both,), ("v0001", "--with", "v0002"), ("v0002", "--with", "v0001"))
    ]
    assert flown[0] == flown[1] == flown[2]
    assert {each["channel"] for each in flown[0][0]["responses"]} >= {"V", "psi"}
    assert names(workspace)["released-friction"] == "v0002"


def test_a_manoeuvre_rolls_with_two_versions_as_with_one_that_has_both(workspace: Path) -> None:
    """From 40 m/s with full brakes to the standstill, in the JSON answer by its schema."""
    w = workspace / "w"
    whole, braked = workspace / "both.toml", workspace / "braked.toml"
    whole.write_text(WITH_AIR.replace(f"value = {BRAKES}", f"value = {BELIEVED}"), encoding="utf-8")
    braked.write_text(
        'duration = "60 s"\n[trim]\nV = "40 m/s"\naltitude = 0.0\nground = true\n[set]\nbrake = 1.0\n',
        encoding="utf-8",
    )
    both = asked(w, "database", "import", str(whole), "--vehicle", "wheels")["label"]
    flown = [
        of_schema("version fly", asked(w, "version", "fly", *words, "--manoeuvre", str(braked)))
        for words in ((both,), ("v0001", "--with", "v0002"), ("v0002", "--with", "v0001"))
    ]
    assert flown[0]["standstill"]["distance"] > 100.0
    assert flown[0]["standstill"] == flown[1]["standstill"] == flown[2]["standstill"]
    assert flown[0]["responses"] == flown[1]["responses"] == flown[2]["responses"]
    assert "with" not in flown[0]
    assert flown[1]["with"] == asked(w, "version", "show", "v0002")["version"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("version", "fly", "v0002", "--flight", "0.csv"), "--with VERSION"),
        (("version", "fly", "v0002", "--manoeuvre", "braked.toml"), "--with VERSION"),
        (("version", "fly", "v0001", "--with", "v0001", "--flight", "0.csv"), "none is of legs"),
        (
            ("version", "validate", "v0002", "--with", "v0002", "--flight", "0.csv"),
            "both are legs alone",
        ),
        (("close-loop", "--baseline", "v0002"), "--with VERSION"),
        (("close-loop", "--baseline", "v0002", "--with", "v0002"), "both are legs alone"),
        (("version", "promote", "v0001", "--name", "released-friction", "--reason", "x"), "legs"),
    ],
)
def test_what_cannot_be_composed_is_refused_with_what_to_do(
    workspace: Path, words: tuple[str, ...], said: str
) -> None:
    (workspace / "braked.toml").write_text(
        "[trim]\nV = 40.0\naltitude = 0.0\nground = true\n", encoding="utf-8"
    )
    words = tuple(str(workspace / word) if word.endswith(".toml") else word for word in words)
    done = aerodb(workspace / "w", *words)
    assert done.returncode not in (0, 1)
    assert said in done.stderr
    assert "Traceback" not in done.stderr
