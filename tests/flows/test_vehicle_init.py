"""`vehicle init --from`: a vehicle file from a measured PX4 log, and what is said of multicopters."""

import os
from pathlib import Path

from tests.support.command import aerodb, asked, of_schema


def test_a_vtol_log_gives_a_file_that_can_be_added(measured, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    log = str(measured("px4_ulog/sample_log_small.ulg"))
    filled = asked(tmp_path / "w", "vehicle", "init", "cub", "--from", log)
    of_schema("vehicle init", filled)
    assert (filled["airframe"], filled["airspeeds"]["TRIM"]) == ("VTOL", 23.0)
    added = asked(tmp_path / "w", "vehicle", "add", filled["file"])
    assert len(added["placeholders"]) == 3
    assert "placeholder" in aerodb(tmp_path / "w", "vehicle", "add", filled["file"]).stdout


def test_a_multicopter_is_named_as_one(measured, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    log = str(measured("px4_ulog/sample.ulg"))
    done = aerodb(tmp_path / "w", "vehicle", "init", "quad", "--from", log)
    assert (done.returncode, "quadrotor" in done.stderr) == (3, True)
    assert not os.path.exists("quad.toml")
    assert "the log is of a quadrotor" in aerodb(tmp_path / "w", "log", "inspect", log).stdout


def test_a_templates_placeholders_are_no_aircraft_to_ingest_for(
    tmp_path: Path, monkeypatch, logs: list[Path]
) -> None:
    monkeypatch.chdir(tmp_path)
    asked(tmp_path / "w", "vehicle", "init", "glider")
    asked(tmp_path / "w", "vehicle", "add", "glider.toml")
    words = ("flight", "ingest", str(logs[0]), "--vehicle", "glider", "--direct")
    refused = aerodb(tmp_path / "w", *words)
    assert (refused.returncode, "mass = 5 kg" in refused.stderr) == (3, True)
    assert asked(tmp_path / "w", "flight", "list") == []
    taken = aerodb(tmp_path / "w", *words, "--accept-placeholders")
    assert (taken.returncode, "WARNING" in taken.stdout) == (0, True)
