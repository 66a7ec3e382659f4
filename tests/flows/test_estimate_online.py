"""``aerodb estimate-online``: a log that a process writes into a pipe gives the estimates of the whole
log, which are what was flown."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from aerodb.coefficients import compare, total_coefficients
from aerodb.conditioning import flag_unusable
from aerodb.errors import InputError
from aerodb.estimation import frequency_domain_regression, regression
from aerodb.flows.cli.main import app
from aerodb.identification.equations import axis_equations, no_database
from aerodb.increments import parse_model_file
from aerodb.logs import map_recording
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.ulog import read_ulog
from aerodb.tables import ReferenceGeometry
from aerodb.vehicle import parse_vehicle
from tests.support.command import aerodb, asked, of_schema
from tests.support.glider_ulog import ULOG_VEHICLE, write_glider_ulog
from tests.support.small_glider import AREA, CHORD, NAME

MODEL = """\
[[increment]]
axis = "CZ"
terms = ["1", "alpha", "q_hat"]
[[increment]]
axis = "CX"
terms = ["1", "alpha"]
[[increment]]
axis = "Cm"
terms = ["1", "alpha", "q_hat", "delta_elevator"]
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A workspace with the glider, the model file, and a log of 40 s."""
    folder = tmp_path_factory.mktemp("online")
    (folder / "vehicle.toml").write_text(ULOG_VEHICLE, encoding="utf-8")
    (folder / "model.toml").write_text(MODEL, encoding="utf-8")
    write_glider_ulog(folder / "flight.ulg", seed=3, seconds=40.0)
    asked(folder / "w", "vehicle", "add", str(folder / "vehicle.toml"))
    return folder


@pytest.fixture(scope="module")
def equations(folder: Path):
    """The equations of the whole log, as one flight."""
    vehicle = parse_vehicle(ULOG_VEHICLE)
    recording = read_ulog(folder / "flight.ulg")
    flight = flag_unusable(map_recording(recording, builtin_mappings()["px4"], vehicle))
    coefficients = total_coefficients(flight, vehicle)
    database = no_database(ReferenceGeometry(AREA, CHORD, 3.6, (-0.4, 0.0, 0.0)))
    comparison = compare(flight, coefficients, database, vehicle.reference)
    return axis_equations([flight], [comparison], parse_model_file(MODEL), database)


def _online(folder: Path, log: str, *options: str) -> dict:
    model = str(folder / "model.toml")
    given = ("--vehicle", NAME, "--model", model, "--log", log, *options)
    return of_schema("estimate-online", asked(folder / "w", "estimate-online", *given))


_WRITER = """
import os, sys
data = open(sys.argv[1], "rb").read()
pipe = os.open(sys.argv[2], os.O_WRONLY)
for at in range(0, len(data), 3000):
    os.write(pipe, data[at : at + 3000])
"""


def _piped(folder: Path, log: Path, *options: str) -> dict:
    """The answer to a log that a process writes into a pipe in small pieces."""
    pipe = folder / "pipe"
    os.mkfifo(pipe)

    writer = subprocess.Popen([sys.executable, "-c", _WRITER, str(log), str(pipe)])
    try:
        return _online(folder, str(pipe), *options)
    finally:
        assert writer.wait(60) == 0
        pipe.unlink()


pytestmark = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")


def test_a_pipe_gives_the_estimates_of_the_whole_log(folder, equations):
    answer = _piped(folder, folder / "flight.ulg")
    assert answer["time"] == pytest.approx(3639.98, abs=0.05)
    assert answer["samples"] > 1900
    assert answer["lost"] == 0
    rows = {row["parameter"]: row for row in answer["parameters"]}
    for equation in equations:
        for each in regression(equation).estimates:
            row = rows[each.name]
            assert row["standing"] == each.standing == "estimated"
            assert abs(row["value"] - each.value) < row["standard_error"]
    # What was flown: the handbook's slopes and what the glider has beyond them.
    assert rows["CX_alpha"]["value"] == pytest.approx(
        0.5, abs=4 * rows["CX_alpha"]["standard_error"]
    )


def test_fourier_regression_is_that_of_the_whole_log(folder, equations):
    answer = _piped(
        folder,
        folder / "flight.ulg",
        "--method",
        "fourier-regression",
        "--highest",
        "2",
    )
    rows = {row["parameter"]: row for row in answer["parameters"]}
    for equation in equations:
        batch = frequency_domain_regression(equation, lowest=0.1, highest=1.99, spacing=0.05)
        for each in batch.estimates:
            assert abs(rows[each.name]["value"] - each.value) < each.standard_error


def test_a_file_and_damage(folder):
    """A file that no longer grows is complete; damaged bytes are told and passed over."""
    data = bytearray((folder / "flight.ulg").read_bytes())
    data[len(data) // 2 : len(data) // 2 + 100] = bytes(100)
    damaged = folder / "damaged.ulg"
    damaged.write_bytes(data)
    answer = _online(folder, str(damaged), "--idle", "0")
    assert 0 < answer["lost"] < 400
    whole = _online(folder, str(folder / "flight.ulg"), "--idle", "0", "--from", "3610")
    assert 1400 < whole["samples"] < 1550
    for one, other in zip(answer["parameters"], whole["parameters"], strict=True):
        errors = np.hypot(one["standard_error"], other["standard_error"])
        assert abs(one["value"] - other["value"]) < 3 * errors


def test_lines_for_people_and_what_cannot_be_done(folder):
    given = ["--vehicle", NAME, "--model", str(folder / "model.toml"), "--idle", "0"]
    log = str(folder / "flight.ulg")
    done = aerodb(folder / "w", "estimate-online", *given, "--log", log, "--every", "10")
    assert done.returncode == 0, done.stderr
    lines = [line for line in done.stdout.splitlines() if " s: " in line]
    assert len(lines) >= 3
    assert "CZ_alpha" in lines[0]
    assert "+-" in lines[0]
    (folder / "empty.ulg").write_bytes((folder / "flight.ulg").read_bytes()[:16])
    for options, words in (
        (["--log", str(folder / "empty.ulg")], "without data"),
        (["--log", str(folder / "model.toml")], "not a ULog file"),
        (["--log", str(folder / "none.ulg")], "No such file"),
        (["--log", log, "--method", "recursiv"], "no method"),
    ):
        command = ["--workspace", str(folder / "w"), "estimate-online", *given, *options]
        result = CliRunner().invoke(app, command)
        assert isinstance(result.exception, InputError)
        assert words in str(result.exception)
