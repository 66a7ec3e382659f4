"""`vehicle init --from`: a vehicle file from a measured PX4 log, and what is said of multicopters."""

import os
from pathlib import Path

from tests.support.command import aerodb, asked


def test_a_vtol_log_gives_a_file_that_can_be_added(measured, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    log = str(measured("px4_ulog/sample_log_small.ulg"))
    filled = asked(tmp_path / "w", "vehicle", "init", "cub", "--from", log)
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
