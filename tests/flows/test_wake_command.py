"""A wake that logs of several flights show: from the file, through ingest and reconstruction, to the
vortex pair."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aerodb.physics import (
    Turbulence,
    VortexPair,
    air_at_stations,
    gust_series,
    quaternion_from_euler,
    to_body,
    to_earth,
)  # fmt: skip
from aerodb.simulation import Condition, flight_model, simulate, trim, with_feedback
from aerodb.support import Array
from tests.support.command import aerodb, asked, of_schema
from tests.support.parts import MASSES, RATE, SENSORS, TEXT, VEHICLE, aircraft
from tests.support.small_glider import write_csv

#: Nose boom, from the CG [m].
BOOM = 5.0
#: Circulation [m2/s] and core radius [m] that the flights meet, one after the other.
MET = ((220.0, 1.2), (190.0, 1.5), (160.0, 1.9), (1e-3, 1.5))
#: Turbulence of each flight, rms of each component [m/s].
GUSTS = 0.3
LOGGED = {**SENSORS, **dict.fromkeys(("velocity_north", "velocity_east", "velocity_down"), 0.05)}
GAINS = {("delta_elevator", "theta"): -0.3, ("delta_aileron", "phi"): -0.4}


def crossing(circulation: float, core: float, seed: int) -> dict[str, Array]:
    """Log of 30 s at 60 m/s in turbulence that crosses a wake at 60 deg after 15 s; a boom shows the
    air where it is."""
    time = np.arange(round(30.0 * RATE)) / RATE
    rng = np.random.default_rng(seed)
    model = with_feedback(flight_model(aircraft()), GAINS)
    level = trim(
        flight_model(aircraft()), Condition(60.0, 1000.0), MASSES, thrust="throttle",
        limits={"throttle": (0.0, 1.0)},
    )  # fmt: skip
    pair = VortexPair(circulation, core, 17.0, (900.0, 0.0, 999.0), np.deg2rad(60.0))
    gusts = gust_series(Turbulence("dryden", (200.0,) * 3, (GUSTS,) * 3), time, 60.0, 11.0, seed)
    series = {name: np.full(len(time), value) for name, value in level.series.items()} | gusts
    for _, channel in GAINS:
        series[f"reference_{channel}"] = np.full(len(time), level.channels[channel])
    felt: dict[str, Array] = {}
    sinks = np.inf
    while sinks > 1e-3:  # the path decides what is met, and that decides the path
        met = {name: gusts[name] + values for name, values in felt.items()}
        run = simulate(model, time, level.start, series | met)
        place = np.stack([run.channels[name][:, 0] for name in ("north", "east", "altitude")])
        attitude = quaternion_from_euler(*(run.channels[n][:, 0] for n in ("phi", "theta", "psi")))
        before = felt.get("gust_w", np.full(len(time), np.inf))
        felt = air_at_stations(pair, place, attitude, 11.0)
        sinks = float(np.abs(felt["gust_w"] - before).max())
    channels = {name: values[:, 0].copy() for name, values in run.channels.items()}
    offset = to_earth(attitude, np.broadcast_to(np.array([[BOOM], [0.0], [0.0]]), place.shape))
    air = to_body(attitude, pair.velocity(place + np.stack([offset[0], offset[1], -offset[2]])))
    air = air + np.stack([gusts[f"gust_{name}"] for name in "uvw"])
    over_earth = np.stack([channels[f"velocity_{axis}"] for axis in ("north", "east", "down")])
    turning = np.stack([0.0 * time, channels["r"] * BOOM, -channels["q"] * BOOM])
    u, v, w = to_body(attitude, over_earth) + turning - air
    channels["V"] = np.sqrt(u * u + v * v + w * w)
    channels["alpha"], channels["beta"] = np.arctan2(w, u), np.arcsin(v / channels["V"])
    channels["qbar"] = 0.5 * channels["rho"] * channels["V"] ** 2
    noise = {name: size * rng.standard_normal(len(time)) for name, size in LOGGED.items()}
    return {"time": time, **{name: channels[name] + noise[name] for name in LOGGED}}


@pytest.fixture(scope="module")
def ingested(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[dict[str, Any]]]:
    folder = tmp_path_factory.mktemp("wake")
    boom = VEHICLE.replace("air_data = [-2.0,", f"air_data = [{BOOM - 2.0},")
    (folder / "vehicle.toml").write_text(boom, encoding="utf-8")
    (folder / "parts.toml").write_text(TEXT, encoding="utf-8")
    asked(folder / "w", "vehicle", "add", str(folder / "vehicle.toml"))
    asked(folder / "w", "database", "import", str(folder / "parts.toml"))
    logs = []
    for seed, met in enumerate(MET):
        file = write_csv(folder / f"crossing{seed}.csv", crossing(*met, seed))
        text = file.read_text(encoding="utf-8")
        file.write_text(text.replace("throttle [1]", "throttle [-]"), encoding="utf-8")
        logs.append(str(file))
    given = ("--vehicle", "light-aircraft", "--mapping", "canonical", "--direct")
    return folder / "w", asked(folder / "w", "flight", "ingest", *logs, *given)


@pytest.fixture(scope="module")
def flights(ingested: tuple[Path, list[dict[str, Any]]]) -> tuple[Path, list[str]]:
    workspace, outcomes = ingested
    return workspace, [outcome["flight"] for outcome in outcomes]


def test_a_wake_is_a_rival_of_a_channel_that_seems_to_change(
    ingested: tuple[Path, list[dict[str, Any]]],
) -> None:
    """The boom crosses its axis 15 s after the begin; wings and tail are in other air by then."""
    *crossed, alone = ingested[1]
    for outcome in crossed:
        (said,) = outcome["comparison"]["suspicions"]
        assert said["kind"] == "changed"
        assert said["evidence"]["air_from"] < 15.0 < said["evidence"]["air_until"]
        assert "aerodb flight wake" in said["sentence"]
    assert not alone["comparison"]["suspicions"]
    words = ("--hold-out", "none", "--direct")
    loop = asked(ingested[0], "close-loop", *words)
    told = [each for each in loop["remarks"] if "only a part of the aircraft felt" in each]
    assert len(told) == len(crossed)
    assert not loop["added"]


def test_circulation_and_core_of_each_encounter_and_their_trend(
    flights: tuple[Path, list[str]],
) -> None:
    workspace, ids = flights
    found = asked(workspace, "flight", "wake", *ids[:3])
    for one, (circulation, core) in zip(found["encounters"], MET, strict=False):
        wake = one["wake"]
        assert wake["core"] == "burnham_hallock"
        assert wake["circulation"]["value"] == pytest.approx(circulation, rel=0.1)
        assert wake["core_radius"]["value"] == pytest.approx(core, rel=0.1)
        assert wake["spacing"]["value"] == pytest.approx(17.0, rel=0.1)
        assert wake["heading"]["value"] == pytest.approx(np.deg2rad(60.0), abs=0.05)
    assert found["circulation_falls"]
    assert found["core_grows"]


def test_a_flight_with_one_vane_tells_of_the_wake(
    flights: tuple[Path, list[str]], tmp_path: Path
) -> None:
    """Without beta: that the air is that of a wake, and its sizes where the heading is stated, not
    for a path along it. None is sought without both vanes."""
    workspace, _ = flights
    channels = crossing(*MET[0], seed=8)
    given = ("--vehicle", "light-aircraft", "--mapping", "canonical", "--direct")

    def met(*gone: str) -> Callable[..., dict[str, Any]]:
        left = {name: values for name, values in channels.items() if name not in gone}
        file = write_csv(tmp_path / f"without-{'-'.join(gone)}.csv", left)
        text = file.read_text(encoding="utf-8")
        file.write_text(text.replace("throttle [1]", "throttle [-]"), encoding="utf-8")
        (outcome,) = asked(workspace, "flight", "ingest", str(file), *given)

        def encounter(*words: str) -> dict[str, Any]:
            (one,) = asked(workspace, "flight", "wake", outcome["flight"], *words)["encounters"]
            return dict(one)

        return encounter

    alpha_only = met("beta")
    one = alpha_only()
    assert one["wake"] is None
    assert any("the air is that of a wake" in note for note in one["notes"])
    assert alpha_only("--heading", "5 deg")["wake"] is None
    pair = alpha_only("--heading", "60 deg")["wake"]
    for name, true in (("circulation", 220.0), ("core_radius", 1.2), ("spacing", 17.0)):
        assert pair[name]["value"] == pytest.approx(true, rel=0.1)
    assert pair["below"]["standard_error"] is None
    blind = met("alpha", "beta")()
    assert blind["wake"] is None
    assert any("no wake is sought" in note for note in blind["notes"])


def test_turbulence_alone_is_no_wake(flights: tuple[Path, list[str]]) -> None:
    workspace, ids = flights
    (alone,) = asked(workspace, "flight", "wake", ids[3])["encounters"]
    assert alone["wake"] is None


def test_a_stretch_that_does_not_tell_an_intensity_has_no_value(
    flights: tuple[Path, list[str]],
) -> None:
    """Thirty seconds hold few lengths of 200 m: limits are wide, and open where nothing is told."""
    workspace, ids = flights
    found = asked(workspace, "flight", "turbulence", ids[3])
    for each in found["components"]:
        told = each["intensity"]
        if told["value"] is None:
            assert told["low"] is told["high"] is None
            assert any(f"gust {each['name']}" in note for note in found["notes"])
        else:
            assert (told["low"] or 0.0) < GUSTS < (told["high"] or np.inf), each
    assert any(each["intensity"]["value"] is not None for each in found["components"])
    text = aerodb(workspace, "flight", "turbulence", ids[3]).stdout
    assert "m/s rms" in text.splitlines()[0]
    aero = aerodb(workspace, "flight", "turbulence", ids[3], "--units", "aero").stdout
    assert "kt rms" in aero.splitlines()[0]
    rms = [float(re.search(r"gusts of (\S+) ", said)[1]) for said in (text, aero)]
    assert rms[1] == pytest.approx(rms[0] * 3600.0 / 1852.0, abs=0.02)
    assert "scale ft" in aero


@pytest.mark.parametrize("asks", ["wake", "turbulence"])
def test_what_a_flight_met_is_flown_again_by_the_line_that_is_printed(
    flights: tuple[Path, list[str]], tmp_path: Path, asks: str
) -> None:
    workspace, ids = flights
    printed = aerodb(workspace, "flight", asks, ids[0]).stdout
    (line,) = (line for line in printed.splitlines() if line.strip().startswith("next"))
    stated, _, command = line.strip().removeprefix("next").strip().partition("; then ")
    file = tmp_path / "again.toml"
    (text,) = re.findall(rf"{asks} = {{.*}}", stated)
    file.write_text(f'{text}\n[trim]\nV = "55 m/s"\naltitude = "1000 m"\n', encoding="utf-8")
    words = command.replace("FILE", str(file)).replace("released", "v0001").split()[1:]
    flown = aerodb(workspace, *words)
    assert flown.returncode == 0, flown.stderr


def test_a_wake_is_a_version_of_its_own_line(
    flights: tuple[Path, list[str]], tmp_path: Path
) -> None:
    """Kept, flown through, compared with the next, judged, released and rolled back; the
    aerodynamics stay what they are."""
    workspace, ids = flights
    found = of_schema("flight wake", asked(workspace, "flight", "wake", *ids[:2], "--keep"))
    first, second = found["versions"]
    assert (first["name"], second["name"]) == ("released-wake", "candidate-wake")
    again = asked(workspace, "flight", "wake", *ids[:2], "--keep")["versions"]
    assert [each["version"] for each in again] == [first["version"], second["version"]]

    def named() -> dict[str, str]:
        listed = asked(workspace, "version", "list")
        return {name: each["label"] for each in listed for name in each["names"]}

    assert named()["released"] == "v0001"
    shown = asked(workspace, "version", "show", first["label"])
    assert shown["report"]["wake"]["circulation"] == found["encounters"][0]["wake"]["circulation"]
    edits = asked(workspace, "version", "diff", first["label"], second["label"])["terms"]
    changes = {edit["name"]: edit["change"] for edit in edits if edit["kind"] == "parameter"}
    assert changes["circulation"] == pytest.approx(-30.0, rel=0.2)
    assert changes["core_radius"] == pytest.approx(0.3, rel=0.2)
    gate = asked(workspace, "version", "gate", "candidate-wake")
    told = {each["label"]: each["not_judged"] for each in gate["checks"]}
    assert told["content"] in (None, "does not apply: a wake alone")
    moved = asked(workspace, "version", "promote", "candidate-wake", "--reason", "it is later")
    assert moved["name"] == "released-wake"
    assert named() == {"released": "v0001"} | dict.fromkeys(
        ("released-wake", "candidate-wake"), second["label"]
    )
    asked(workspace, "version", "rollback", "--name", "released-wake", "--reason", "the first")
    assert named()["released-wake"] == first["label"]

    still = '[trim]\nV = "60 m/s"\naltitude = "1000 m"\n'
    file = tmp_path / "through.toml"
    file.write_text(f'name = "through"\nduration = "30 s"\n{still}', encoding="utf-8")
    fly = ("version", "fly", "v0001", "--manoeuvre", str(file))
    met = asked(workspace, *fly, "--with", "released-wake")
    size = met["air"]["gust_w"]
    assert max(map(abs, size)) > 5.0
    assert "air" not in asked(workspace, *fly)
    pair = found["encounters"][0]["wake"]
    north, east, up = pair["place"]
    assert abs(pair["track"]) < 0.02, "the flight begins to the north"
    axis = {name: pair[name]["value"] for name in ("circulation", "core_radius", "spacing")}
    table = (
        f'circulation = "{axis["circulation"]} m^2/s"\ncore_radius = "{axis["core_radius"]} m"\n'
        f'spacing = "{axis["spacing"]} m"\nahead = "{north} m"\nright = "{east} m"\n'
        f'below = "{-up} m"\nheading = "{pair["heading"]["value"]} rad"\n'
        f'slope = "{pair["slope"]["value"]} rad"\ncore = "{pair["core"]}"\n'
    )
    stated = file.read_text(encoding="utf-8") + f"[wake]\n{table}"
    file.write_text(stated, encoding="utf-8")
    assert asked(workspace, *fly)["air"]["gust_w"] == pytest.approx(size, rel=0.05)
    both = aerodb(workspace, *fly, "--with", "released-wake")
    assert "a second wake" in both.stderr
    part = aerodb(workspace, "close-loop", "--with", "released-wake", "--direct")
    assert part.returncode != 0
    assert "version fly" in part.stderr
    asked(workspace, "flight", "retract", ids[1], "--reason", "it was another aircraft")
    assert asked(workspace, "version", "show", second["label"])["stale"], "it was made from it"
