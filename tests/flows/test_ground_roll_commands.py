"""Friction of legs by the commands: JSBSim's rolls, with 3 m of noise, from a log to estimates."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from lxml import html

from aerodb.storage.workspace import Workspace
from tests.support.command import aerodb, asked
from tests.support.console_workspace import client_of
from tests.support.small_glider import write_csv
from tests.support.three_wheels import (
    AS_IN_JSBSIM,
    MASSES,
    SIDE,
    SPRING,
    VEHICLE,
    WITH_AIR,
    measured,
    rolled_in_jsbsim,
)

BRAKES = 0.22
#: What the database believes before the rolls.
BELIEVED = {"mu_brake = { value = 0.22": "0.25", "mu_side = { value = 4.2972": "3.5"}
LEVEL = 1.2 - MASSES["mass"] * 9.80665 / (3.0 * SPRING)
#: Seeds in the suite and in full.
REDUCED, FULL = 1, 10
MODELS = {
    "brakes": 'parameters = ["mu_brake"]\nwind = [0.0, 0.0]\n',
    "both": 'parameters = ["mu_brake", "mu_side"]\n',
}


@pytest.fixture(scope="module")
def workspace(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("jsbsim")
    folder = tmp_path_factory.mktemp("rolls")
    text = WITH_AIR
    for start, value in BELIEVED.items():
        assert start in text
        text = text.replace(start, f"{start.rpartition(' ')[0]} {value}")
    files = {"vehicle": VEHICLE, "wheels": text, **MODELS}
    for name, content in files.items():
        (folder / f"{name}.toml").write_text(content, encoding="utf-8")
    asked(folder / "w", "vehicle", "add", str(folder / "vehicle.toml"))
    asked(folder / "w", "database", "import", str(folder / "wheels.toml"))
    return folder


def ingested(folder: Path, wind: float, seeds: int, braking_from: float = 0.0) -> list[str]:
    """Flights of JSBSim's roll in a wind from the west [m/s], with brakes from a time [s] on."""
    channels = rolled_in_jsbsim(BRAKES, (0.0, wind), LEVEL, braking_from=braking_from)
    name = f"roll-{wind:g}-{braking_from:g}"
    logs = [
        str(write_csv(folder / f"{name}-{seed}.csv", measured(channels, seed)))
        for seed in range(seeds)
    ]
    given = ("--vehicle", "wheels", "--mapping", "canonical", "--direct")
    outcomes = asked(folder / "w", "flight", "ingest", *logs, *given)
    return [outcome["flight"] for outcome in outcomes]


def estimated(folder: Path, model: str, flight: str) -> dict[str, dict[str, Any]]:
    given = ("--baseline", "v0001", "--method", "output-error", "--flights", flight)
    found = asked(folder / "w", "estimate", "--model", str(folder / f"{model}.toml"), *given)
    return {each["name"]: each for each in found["methods"][0]["estimates"]}


@pytest.mark.heavy
def test_friction_from_a_log_in_calm_and_in_a_crosswind(
    workspace: Path, trials: Callable[[int, int], int]
) -> None:
    """Brakes within .5 % in a known calm and 2 % in an unknown wind. Side force within 5 % in a
    crosswind, and in calm with bounds alone, which hold the true value in 95 of 100."""
    seeds, held = trials(REDUCED, FULL), 0
    for flight in ingested(workspace, 0.0, seeds):
        brakes = estimated(workspace, "brakes", flight)["mu_brake"]
        assert brakes["value"] == pytest.approx(BRAKES, rel=5e-3)
        assert abs(brakes["value"] - BRAKES) < 4.0 * brakes["standard_error"]
        both = estimated(workspace, "both", flight)
        assert both["mu_brake"]["value"] == pytest.approx(BRAKES, rel=0.02)
        assert (both["mu_side"]["standing"], both["mu_side"]["value"]) == ("not excited", None)
        said = both["mu_side"]["reason"].split(" (95 %)")[0].split()
        low = float(said[said.index("above") + 1]) if "above" in said else 0.0
        high = float(said[said.index("below") + 1]) if "below" in said else 20.0
        held += low < SIDE < high
        print(f"calm: brakes {brakes['value']:.5f}, {both['mu_brake']['value']:.5f}; {said}")
    assert held >= seeds - 1 - seeds // 20
    for flight in ingested(workspace, 5.0, seeds):
        both = estimated(workspace, "both", flight)
        print("crosswind:", *(f"{both[n]['value']:.5f}" for n in ("mu_brake", "mu_side")))
        assert both["mu_brake"]["value"] == pytest.approx(BRAKES, rel=0.02)
        assert both["mu_side"]["value"] == pytest.approx(SIDE, rel=0.05)
        wind = next(each for name, each in both.items() if name.startswith("wind_east"))
        assert wind["value"] == pytest.approx(5.0, abs=0.3)


#: What a log may lack, all but position, heading and commands of wheels.
LACKING = {
    "no-airspeed": ("V", "alpha", "beta"),
    "no-motion": ("V", "alpha", "beta", "p", "q", "r", "ax", "phi", "theta"),
}


@pytest.mark.parametrize("name", LACKING)
def test_a_roll_without_airspeed_still_tells_of_its_brakes(workspace: Path, name: str) -> None:
    channels = measured(rolled_in_jsbsim(BRAKES, (0.0, 0.0), LEVEL), 4)
    left = {key: values for key, values in channels.items() if key not in LACKING[name]}
    log = str(write_csv(workspace / f"{name}.csv", left))
    given = ("--vehicle", "wheels", "--mapping", "canonical", "--direct")
    (outcome,) = asked(workspace / "w", "flight", "ingest", log, *given)
    assert outcome["consistency"]["verdict"] == "rejected"
    assert outcome["coefficients"]["key"] is None
    brakes = estimated(workspace, "brakes", outcome["flight"])["mu_brake"]
    assert brakes["value"] == pytest.approx(BRAKES, rel=5e-3)
    assert abs(brakes["value"] - BRAKES) < 4.0 * brakes["standard_error"]


def test_a_roll_without_its_brakes_says_how_it_slows_down(workspace: Path) -> None:
    """No friction is estimated; the standstill and two phases are seen, and the next command is one
    that works."""
    channels = measured(rolled_in_jsbsim(BRAKES, (0.0, 0.0), LEVEL, braking_from=8.0), 7)
    said, flights = {}, {}
    for name in ("brakes-known", "brakes-unknown"):
        left = {k: v for k, v in channels.items() if k != "brake" or name == "brakes-known"}
        log = str(write_csv(workspace / f"{name}.csv", left))
        given = ("--vehicle", "wheels", "--mapping", "canonical", "--direct")
        done = aerodb(workspace / "w", "flight", "ingest", log, *given)
        said[name] = next(line for line in done.stdout.splitlines() if "next" in line)
        shown = asked(workspace / "w", "flight", "show", f"{name}.csv")
        flights[name] = shown["flight"][:12]
        (roll,) = shown["rolls"]
        assert roll["stands"]
        assert roll["distance"] == pytest.approx(1110.0, abs=6.0)
        assert [each["end"] for each in roll["phases"]] == pytest.approx([8.0, 34.3], abs=1.0)
        assert roll["phases"][0]["effective"] < 0.15 < 0.17 < roll["phases"][1]["effective"]
    assert "aerodb close-loop --vehicle wheels" in said["brakes-known"]
    assert said["brakes-unknown"].endswith(f"aerodb flight show {flights['brakes-unknown']}")
    again = aerodb(workspace / "w", "flight", "show", flights["brakes-unknown"]).stdout
    assert "g\n" in again
    assert "rolling friction, brakes, drag and slope together" in again
    both = [word for flight in flights.values() for word in ("--flights", flight)]
    given = ("estimate", "--model", str(workspace / "brakes.toml"), "--baseline", "v0001")
    (unused,) = asked(workspace / "w", *given, *both)["left_out"].items()
    assert unused[0].startswith(flights["brakes-unknown"])
    assert "lacks brake" in unused[1]
    assert "left out" in aerodb(workspace / "w", *given, *both).stdout
    model = ("--model", str(workspace / "brakes.toml"), "--flights", flights["brakes-unknown"])
    found = asked(workspace / "w", "estimate", *model, "--baseline", "v0001")
    assert "lacks brake" in found["methods"][0]["reason"]
    assert f"aerodb flight show {flights['brakes-unknown']}" in found["methods"][0]["reason"]


@pytest.mark.parametrize("way", ["no height", "a slope, and the altitude alone", "a bounce"])
def test_of_a_log_that_is_lacking_what_can_be_said_is_said(workspace: Path, way: str) -> None:
    """Where height does not tell the roll from flight, the slow part of it is used, and each answer
    names the command that does. A hop of 1.2 m is left out."""
    channels = measured(rolled_in_jsbsim(BRAKES, (0.0, 3.0), LEVEL, braking_from=8.0), 8)
    height, time = channels["height_above_ground"], channels["time"]
    if way == "a bounce":
        hop = np.clip(1.0 - ((time - 3.8) / 0.8) ** 2, 0.0, None) * 1.2
        channels |= {"height_above_ground": height + hop, "altitude": height + hop}
    else:
        del channels["height_above_ground"]
        climbs = np.cumsum(channels["V"]) * (time[1] - time[0])
        channels["altitude"] = channels["altitude"] + 0.01 * climbs
    if way == "no height":
        del channels["altitude"]
    log = str(write_csv(workspace / f"{way}.csv", channels))
    given = ("--vehicle", "wheels", "--mapping", "canonical", "--direct")
    told = aerodb(workspace / "w", "flight", "ingest", log, *given).stdout
    loop = ("close-loop", "--vehicle", "wheels", "--baseline", "v0001", "--flights", f"{way}.csv")
    if way != "a bounce":
        assert "--on-ground" in next(line for line in told.splitlines() if "next" in line)
        refused = aerodb(workspace / "w", *loop)
        assert refused.returncode == 3
        assert "aerodb close-loop --on-ground" in refused.stderr
    found = asked(workspace / "w", *loop, "--on-ground", "--direct")
    said = " ".join(found["remarks"])
    assert {
        "no height": "slope is not known: 1 % of climb",
        "a bounce": "it leaves the ground for 1.",
    }.get(way, "the runway climbs by 1.") in said
    assert any("mu_" in each["parameter"] for each in (*found["findings"], *found["not_found"]))


def test_the_console_draws_how_a_roll_slows_down(workspace: Path) -> None:
    """Of brakes from 8 s on: the picture has the phases' speeds at their places, in every unit."""
    (flight,) = ingested(workspace, 3.0, 1, 8.0)
    (roll,) = asked(workspace / "w", "flight", "show", flight)["rolls"]
    with client_of(Workspace.open(workspace / "w")) as client:
        page = html.fromstring(client.get(f"/flights/{flight}").text)
        (seen, ahead) = page.xpath("//svg[contains(@aria-label, 'Speed over')]/polyline/@points")
        points = np.array([each.split(",") for each in seen.split()], dtype=float)
        times = [roll["start"], *(each["end"] for each in roll["phases"])]
        speeds = [roll["phases"][0]["fast"], *(each["slow"] for each in roll["phases"])]
        assert len(times) == 3
        for found, known in zip(points.T, (times, speeds), strict=True):
            scale = np.polyfit(known, found, 1)
            assert found == pytest.approx(np.polyval(scale, known), abs=0.1)
        assert page.xpath("//svg[contains(@aria-label, 'Speed over')]/circle/@cx") == [
            f"{points[1, 0]:.1f}"
        ]
        stop = float(ahead.split()[-1].split(",")[0])
        slope, at = np.polyfit(times, points[:, 0], 1)
        assert (stop - at) / slope == pytest.approx(roll["start"] + roll["time"], abs=0.1)
        (rows,) = page.xpath("//table[caption[contains(., 'each phase')]]/tbody")
        cells = [[cell.text for cell in row.xpath("td")] for row in rows]
        assert [float(row[3]) for row in cells] == pytest.approx(speeds[1:], rel=6e-3)
        assert [float(row[4].split()[0]) for row in cells] == pytest.approx(
            [each["effective"] for each in roll["phases"]], rel=6e-3
        )
        assert "stands still after" in page.xpath("//h3")[0].text


def test_a_roll_is_within_tolerance_with_its_friction_and_outside_with_another(
    workspace: Path,
) -> None:
    """JSBSim's roll in calm, flown again without feedback: brakes that are 20 % wrong leave the
    airspeed's 3 kt, those that another roll shows do not; nor is it thrown off its springs."""
    first, second = ingested(workspace, 0.0, 2, 6.0)
    far = workspace / "far.toml"
    text = (workspace / "wheels.toml").read_text(encoding="utf-8")
    assert "mu_brake = { value = 0.25" in text
    far.write_text(
        text.replace("mu_brake = { value = 0.25", f"mu_brake = {{ value = {1.2 * BRAKES}")
    )
    imported = asked(workspace / "w", "database", "import", str(far), "--vehicle", "wheels")[
        "label"
    ]
    given = ("--model", str(workspace / "brakes.toml"), "--baseline", imported, "--flights", first)
    found = asked(workspace / "w", "update", *given, "--direct")
    how = ("--from", "0", "--to", "33", "--no-stabilise", "--tolerances", "engine-failure")
    within = {}
    for label in (imported, found["label"]):
        flown = asked(workspace / "w", "version", "fly", label, "--flight", second, *how)
        (stretch,) = flown["stretches"]
        checks = {each["check"].rpartition(" ")[2]: each for each in stretch["checks"]}
        assert set(checks) == {"airspeed", "altitude", "attitude", "bank"}
        assert all(each["passed"] for name, each in checks.items() if name != "airspeed")
        within[label] = checks["airspeed"]
    assert not within[imported]["passed"]
    assert within[imported]["bands"][0]["limit"] == pytest.approx(3.0 * 1852.0 / 3600.0)
    assert within[found["label"]]["passed"]
    assert within[found["label"]]["share"] > 0.99
    landed = (*how[:-1], "normal-landing")
    flown = asked(workspace / "w", "version", "fly", found["label"], "--flight", second, *landed)
    checks = flown["stretches"][0]["checks"]
    assert [each["test"] for each in checks] == ["2.e.1"] * 4
    limits = {band["channel"]: band["limit"] for each in checks for band in each["bands"]}
    angle = np.deg2rad(1.5)
    assert limits == pytest.approx(
        {"V": 3.0 * 1852.0 / 3600.0, "theta": angle, "alpha": angle, "altitude": 3.048}
    )
    assert checks[0]["passed"]
    assert flown["standard"]["unchecked"][0] == "AC 120-40C"


def test_a_log_without_wheels_and_airspeed_is_refused_as_before(workspace: Path) -> None:
    channels = measured(rolled_in_jsbsim(BRAKES, (0.0, 0.0), LEVEL), 5)
    gone = {*LACKING["no-airspeed"], "brake", "steering"}
    left = {key: values for key, values in channels.items() if key not in gone}
    log = str(write_csv(workspace / "no-wheels.csv", left))
    given = ("--vehicle", "wheels", "--mapping", "canonical", "--direct")
    with pytest.raises(AssertionError, match="no axis can be computed"):
        asked(workspace / "w", "flight", "ingest", log, *given)


@pytest.mark.heavy
def test_friction_becomes_a_version_that_is_held_out_and_released(workspace: Path) -> None:
    """Three rolls in a crosswind, each predicted from the others: brakes and side force are those
    of JSBSim's vehicle, which stands still where its log says."""
    flights = ingested(workspace, 5.0, 3)
    accepted = ("--accept", "content", "--reason", "it only rolls")
    asked(workspace / "w", "version", "promote", "v0001", "--name", "released", *accepted)
    named = [word for flight in flights for word in ("--flights", flight)]
    given = ("--model", str(workspace / "both.toml"), "--direct")
    found = asked(workspace / "w", "update", *given, *named)
    changes = {each["name"]: each for each in found["parameters"]}
    for name, true, bound in (("mu_brake", BRAKES, 0.02), ("mu_side", SIDE, 0.05)):
        assert changes[name]["after"] == pytest.approx(true, rel=bound)
        assert abs(changes[name]["after"] - true) < 4.0 * changes[name]["standard_error"]
    assert found["validation"]["kind"] == "cross-validated"
    along = found["axes"]["along"]
    assert along["unit"] == "m"
    assert along["held_out_rms_before"] > 1.4 * along["held_out_rms_after"]
    assert along["noise_floor"] == pytest.approx(3.0, rel=0.05)
    assert along["outcome"] == found["axes"]["psi"]["outcome"] == "at noise floor"
    for roll in found["rolls"]:
        assert roll["after"]["distance"] == pytest.approx(roll["stopped"]["distance"], abs=4.0)
        assert roll["after"]["time"] == pytest.approx(roll["stopped"]["time"], abs=0.6)
        assert roll["before"]["distance"] < roll["after"]["distance"] - 20.0
        assert roll["wind"] == pytest.approx([0.0, 5.0], abs=0.5)
    assert found["gate"]["passed"]
    node = asked(workspace / "w", "version", "lineage", found["label"], "--node", "mu_brake")
    assert node["parameter"]["made_by"] == found["candidate"]
    assert node["parameter"]["flown"]["brake"] == [1.0, 1.0]
    page = Path(found["page"]).read_text(encoding="utf-8")
    assert "along [m]" in page
    assert "across [m]" in page


def test_an_update_of_the_legs_says_what_rolls_do_not_determine(workspace: Path) -> None:
    """In calm the side force keeps its value, with bounds: brakes alone are updated."""
    (flight,) = ingested(workspace, 0.0, 1)
    given = ("--model", str(workspace / "both.toml"), "--direct", "--flights", flight)
    found = asked(workspace / "w", "update", "--baseline", "v0001", *given)
    assert [each["name"] for each in found["parameters"]] == ["mu_brake"]
    assert any("mu_side stays as it is: these records tell only" in s for s in found["remarks"])
    assert found["validation"]["kind"] == "not validated"
    assert not found["gate"]["passed"]


@pytest.mark.heavy
def test_a_closed_loop_of_rolls_finds_what_is_wrong_and_leaves_the_rest(workspace: Path) -> None:
    """Two rolls that begin without brakes: brakes and side force are wrong, rolling friction is
    not."""
    flights = ingested(workspace, 5.0, 2, braking_from=8.0)
    named = [word for flight in flights for word in ("--flights", flight)]
    given = ("--baseline", "v0001", "--direct", *named)
    found = asked(workspace / "w", "close-loop", *given)
    assert {*found["added"]} == {"parameter@all:mu_brake", "parameter@all:mu_side"}
    changes = {each["name"]: each["after"] for each in found["parameters"]}
    assert changes["mu_brake"] == pytest.approx(BRAKES, rel=0.02)
    assert changes["mu_side"] == pytest.approx(SIDE, rel=0.05)
    (left,) = found["not_found"]
    assert (left["parameter"], left["verdict"]) == ("mu_roll", "not_detected")
    for finding in found["findings"]:
        low, high = finding["ci95"]
        assert low < finding["value"] < high
        assert len(finding["votes"]) == 2
    along = found["axes"]["along"]
    assert along["held_out_rms_after"] < along["held_out_rms_before"]
    assert Path(found["page"]).is_file()


@pytest.mark.heavy
def test_what_two_rolls_tell_only_together_is_not_added(workspace: Path) -> None:
    """Rolls that late brakes leave long and straight: beside a database whose main wheels hold more
    before the brakes than JSBSim's, the side force differs by 3 %, at odds of one in a thousand,
    and neither roll tells of it alone. Beside JSBSim's own nothing is claimed."""
    given, labels = ("--vehicle", "wheels"), []
    for name, text in (("more", WITH_AIR), ("right", AS_IN_JSBSIM)):
        wheels = workspace / f"{name}.toml"
        wheels.write_text(text, encoding="utf-8")
        labels += [asked(workspace / "w", "database", "import", str(wheels), *given)["label"]]
    assert WITH_AIR != AS_IN_JSBSIM
    channels = rolled_in_jsbsim(BRAKES, (0.846, -4.715), LEVEL, 56.768, braking_from=10.0)
    logs = [
        str(write_csv(workspace / f"late-{seed}.csv", measured(channels, seed)))
        for seed in (180, 181)
    ]
    ingest = ("flight", "ingest", *logs, *given, "--mapping", "canonical", "--direct")
    named = [
        word for each in asked(workspace / "w", *ingest) for word in ("--flights", each["flight"])
    ]
    more, right = (
        asked(workspace / "w", "close-loop", "--baseline", label, "--direct", *named)
        for label in labels
    )
    assert more["added"] == []
    assert [each["verdict"] for each in more["findings"]] == ["suspected"]
    assert right["findings"] == []
