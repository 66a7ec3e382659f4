"""Tables that people have, by command: what is drafted, what is asked and what is said of them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.support.command import aerodb, asked

TIME = np.arange(60) * 0.05
SWING = np.sin(2.0 * TIME)


def table(path: Path, **columns: Any) -> Path:
    """A CSV file of columns of numbers or texts."""
    cells = [
        [f"{value:.5f}" if isinstance(value, float) else str(value) for value in list(values)]
        for values in columns.values()
    ]
    lines = [",".join(row) for row in zip(*cells, strict=True)]
    path.write_text(",".join(columns) + "\n" + "\n".join(lines) + "\n", encoding="utf-8")
    return path


def iso(times: np.ndarray) -> list[str]:
    return [f"2024-03-12T14:22:{10 + t:06.3f}Z" for t in times]


def drafted(folder: Path, log: Path) -> Any:
    return asked(folder / "w", "mapping", "init", str(log), "--output", str(folder / "m.toml"))


def fields(document: Any) -> dict[str, str]:
    return {guess["channel"]: guess["field"] for guess in document["guesses"]}


@pytest.mark.parametrize(
    "even",
    [
        {"longitude": 8.5 + 1.3e-5 * TIME},
        {"altitude_m": 100.0 + 3.0 * TIME},
        {"frame": np.arange(60)},
        {"LineNo": np.arange(1, 61)},
        {"heading": 10.0 + TIME},
        {"fuel_used": 0.01 * TIME},
    ],
)
def test_a_column_that_only_runs_evenly_is_no_clock(tmp_path: Path, even: dict[str, Any]) -> None:
    log = table(tmp_path / "a.csv", time=iso(TIME), tas_mps=20.0 + SWING, **even)
    assert drafted(tmp_path, log)["clock"]["field"] == "time"
    document = asked(tmp_path / "w", "log", "inspect", str(log))
    assert document["topics"][0]["rate"] == pytest.approx(20.0, rel=1e-5)


@pytest.mark.parametrize("even", [{"frame": np.arange(60)}, {"longitude": 8.5 + 1e-5 * TIME}])
def test_without_a_time_there_is_a_question_and_no_rate(
    tmp_path: Path, even: dict[str, Any]
) -> None:
    log = table(tmp_path / "a.csv", **even, tas_mps=20.0 + SWING, p_rads=SWING)
    document = drafted(tmp_path, log)
    assert document["clock"] is None
    assert any(text.startswith("no column is named as a time") for text in document["questions"])
    assert asked(tmp_path / "w", "log", "inspect", str(log))["topics"][0]["rate"] is None
    refused = aerodb(
        tmp_path / "w", "log", "inspect", str(log), "--mapping", str(tmp_path / "m.toml")
    )
    assert "no time: a table has none until its mapping names it" in refused.stdout


@pytest.mark.parametrize("stamp", ["repeated", "empty", "backward"])
def test_one_odd_stamp_keeps_the_clock(tmp_path: Path, stamp: str) -> None:
    times: list[Any] = [float(t) for t in TIME]
    times[30] = {"repeated": times[29], "empty": "", "backward": times[28]}[stamp]
    log = table(tmp_path / "a.csv", frame=np.arange(60), time=times, p_rads=SWING)
    document = drafted(tmp_path, log)
    assert document["clock"]["field"] == "time"
    assert document["notes"][0].startswith("1 of 60 stamps of time")


@pytest.mark.parametrize(
    ("times", "unit"),
    [
        (TIME, "s"),
        (1000.0 * TIME, "ms"),
        (1e6 * TIME, "us"),
        (45363.59 + TIME / 86400.0, "day"),
        (739323.59 + TIME / 86400.0, "day"),
        (1710253330.0 + TIME, "s"),
        (1710253330e3 + 1e3 * TIME, "ms"),
    ],
)
def test_the_unit_of_a_time_follows_from_its_stamps(
    tmp_path: Path, times: np.ndarray, unit: str
) -> None:
    log = table(tmp_path / "a.csv", time=[repr(float(t)) for t in times], p_rads=SWING)
    clock = drafted(tmp_path, log)["clock"]
    assert (clock["field"], clock["unit"]) == ("time", unit)


def test_exact_names_come_before_others(tmp_path: Path) -> None:
    others = ["target_roll", "desired_airspeed", "cmd_elevator", "home_alt", "Bat_V", "oil_p"]
    others += ["fuel_q", "WndDr", "nav_pitch", "pid_r", "engine_temperature"]
    noise = {name: 50.0 + k + SWING for k, name in enumerate(others)}
    real = {"roll": 9 * SWING, "airspeed": 15 + SWING, "elevator": 5 * SWING, "alt": 600 + SWING}
    log = table(tmp_path / "a.csv", time=TIME, **noise, **real, roll_rate_dps=30 * SWING)
    document = drafted(tmp_path, log)
    assert fields(document) == {
        "phi": "roll",
        "V": "airspeed",
        "delta_elevator": "elevator",
        "altitude": "alt",
        "p": "roll_rate_dps",
    }
    sure = {guess["channel"]: guess["confidence"] for guess in document["guesses"]}
    assert sure["p"] == "sure"
    assert sure["V"] == sure["altitude"] == sure["delta_elevator"] == "asked"
    assert any("true or indicated" in text for text in document["questions"])


def test_a_name_with_other_words_is_asked(tmp_path: Path) -> None:
    log = table(tmp_path / "a.csv", time=TIME, Ahrs1_Pitch=9 * SWING, Ahrs2_Pitch=8 * SWING)
    (guess,) = drafted(tmp_path, log)["guesses"]
    assert (guess["channel"], guess["confidence"]) == ("theta", "asked")


def test_units_that_a_row_states(tmp_path: Path) -> None:
    log = tmp_path / "a.csv"
    rows = "".join(f"{t:.3f},{520.0},{100 + t},{2000 + t},{1 + t / 9},4.0\n" for t in TIME)
    log.write_text("Time,OAT,Airspeed,Altitude,NormAcc,AoA\ns,R,KTAS,ft msl,G,deg\n" + rows)
    document = drafted(tmp_path, log)
    found = {g["channel"]: (g["unit"], g["scale"], g["confidence"]) for g in document["guesses"]}
    assert found == {
        "temperature": ("degR", 1.0, "sure"),
        "V": ("knot", 1.0, "sure"),
        "altitude": ("ft", 1.0, "sure"),
        "az_imu": ("g", -1.0, "sure"),
        "alpha": ("deg", 1.0, "sure"),
    }


def test_a_unit_that_is_not_known_is_named(tmp_path: Path) -> None:
    log = table(tmp_path / "a.csv", **{"time [s]": TIME, "roll [wobbles]": 9 * SWING})
    assert any("its unit 'wobbles' is not known" in q for q in drafted(tmp_path, log)["questions"])


def test_a_quantity_of_another_kind_is_not_the_channel(tmp_path: Path) -> None:
    log = table(tmp_path / "a.csv", **{"time [s]": TIME, "q [kPa]": 2 + SWING, "V [V]": 12 + SWING})
    assert drafted(tmp_path, log)["guesses"] == []


@pytest.mark.parametrize(
    ("field", "values"),
    [
        ("elevator", 1500.0 + 300.0 * SWING),
        ("elevator", 80.0 * SWING),
        ("oat_K", 15.0 + SWING),
        ("az_mps2", 0.1 * SWING),
        ("roll_rate", 8.0 * SWING),
        ("v", 20.0 + SWING),
    ],
)
def test_values_that_a_channel_cannot_have_are_asked(
    tmp_path: Path, field: str, values: np.ndarray
) -> None:
    log = table(tmp_path / "a.csv", time=TIME, **{field: values})
    assert [g["confidence"] for g in drafted(tmp_path, log)["guesses"]] in ([], ["asked"])


def test_what_is_not_read_is_said(tmp_path: Path) -> None:
    log = table(tmp_path / "a.csv", time=iso(TIME), V=20.0 + SWING, pilot=["Ann"] * 60)
    done = aerodb(tmp_path / "w", "log", "inspect", str(log))
    assert "pilot (no numbers)" in done.stdout
    assert "time: dates as seconds" in done.stdout
    assert "20 Hz" in done.stdout
    said = aerodb(tmp_path / "w", "mapping", "init", str(log), "--output", str(tmp_path / "m.toml"))
    assert "note: not read: pilot (no numbers)" in said.stdout


def test_the_draft_of_a_dated_table_becomes_a_flight(tmp_path: Path) -> None:
    """Stamps as texts, through the draft and its clock: 20 Hz from first to last."""
    motion = {"p_rads": SWING, "q_rads": SWING, "r_rads": SWING, "nz_g": 1.0 + 0.1 * SWING}
    log = table(tmp_path / "a.csv", time=iso(TIME), tas_mps=20.0 + SWING, **motion)
    drafted(tmp_path, log)
    looked = asked(
        tmp_path / "w", "log", "inspect", str(log), "--mapping", str(tmp_path / "m.toml")
    )
    assert looked["rate"] == pytest.approx(20.0, rel=1e-5)
    assert looked["duration"] == pytest.approx(2.95, abs=0.06)
    assert {"p", "q", "r", "V", "az_imu"} <= set(looked["channels"])


def test_a_tube_that_is_closed_throughout_is_said_and_no_ground(tmp_path: Path) -> None:
    time = np.arange(1500) * 0.04
    swing = np.sin(0.5 * time)
    columns = {
        "time [s]": time,
        "V [m/s]": 0.2 + 0.1 * swing,
        "velocity_north [m/s]": 25.0 + swing,
        "velocity_east [m/s]": swing,
        "rho [kg/m^3]": 1.2 + 0.0 * time,
        **{f"{rate} [rad/s]": 0.1 * np.roll(swing, k) for k, rate in enumerate("pqr")},
    }
    log = table(tmp_path / "a.csv", **columns)
    document = asked(tmp_path / "w", "log", "inspect", str(log))
    assert not document["usable"]
    assert document["because"] == [
        "the airspeed failed throughout: without dynamic pressure no axis can be computed"
    ]
    flown = table(tmp_path / "b.csv", **{**columns, "V [m/s]": 25.0 + swing})
    assert asked(tmp_path / "w", "log", "inspect", str(flown))["usable"]
