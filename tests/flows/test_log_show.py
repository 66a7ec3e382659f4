"""``aerodb log show``: plots of logs without a vehicle, signals and formulas by name, and the page."""

import json
import re
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aerodb.flight import Flight
from aerodb.logs.signals import Signals, parse_formula
from aerodb.recording import Recording, Topic
from tests.support.command import aerodb, asked
from tests.support.glider_ulog import write_glider_ulog
from tests.support.small_glider import channels, write_csv

pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")


@pytest.fixture(scope="module")
def logs(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Two flights as PX4 logs them."""
    folder = tmp_path_factory.mktemp("logs")
    for seed in (1, 2):
        write_glider_ulog(folder / f"flight-{seed}.ulg", seed, 20.0 + seed)
    return [folder / "flight-1.ulg", folder / "flight-2.ulg"]


def samples_of(page: Path) -> dict[str, Any]:
    """What the script on a page reads."""
    found = re.search(r'id="samples">(.*?)</script>', page.read_text("utf-8"), re.DOTALL)
    assert found is not None
    return dict(json.loads(found[1]))


def test_an_unknown_log_is_plotted_in_five_lines_and_seconds(
    logs: list[Path], tmp_path: Path
) -> None:
    began = time.perf_counter()
    done = aerodb(tmp_path / "none", "log", "show", str(logs[0]), folder=tmp_path)
    took = time.perf_counter() - began
    lines = done.stdout.splitlines()
    assert done.returncode == 0, done.stderr
    assert len(lines) <= 5
    page = tmp_path / "flight-1-log.html"
    assert lines[0].startswith(str(page))
    print(f"first plot after {took:.1f} s")  # no assertion: see the rule on times
    assert not (tmp_path / "none").exists()
    text = page.read_text("utf-8")
    assert "USABLE" in text
    assert "://" not in re.sub(r"data:[^\"]+", "", text)
    shown = [panel[0]["label"] for panel in samples_of(page)["panels"]]
    assert shown[:3] == ["V", "alpha", "beta"]


def test_the_value_under_the_cursor_is_the_one_that_was_logged(
    logs: list[Path], tmp_path: Path
) -> None:
    page = tmp_path / "page.html"
    given = ["--signal", "airflow_aoa:aoa_rad", "--output", str(page)]
    asked(tmp_path / "none", "log", "show", str(logs[0]), *given)
    (line,) = samples_of(page)["panels"][0]
    flown = channels(1, 21.0, 50.0)
    assert len(line["time"]) > 600
    values = np.interp(line["time"], flown["time"], flown["alpha"])
    factor = np.rad2deg(1.0) if line["unit"] == "deg" else 1.0
    np.testing.assert_allclose(line["values"], factor * values, atol=2e-5)


def test_signals_share_panels_and_logs_share_axes(logs: list[Path], tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    given = ["--signal", "alpha, q", "--signal", "V,alpha", "--output", str(page)]
    found = asked(tmp_path / "none", "log", "show", *map(str, logs), *given)
    assert found["panels"] == [["alpha", "q"], ["V", "alpha"]]
    assert [each["usable"] for each in found["logs"]] == [True, True]
    first, second = samples_of(page)["panels"]
    assert [line["label"] for line in second] == [
        f"flight-{k}.ulg: {name}" for k in (1, 2) for name in ("V", "alpha")
    ]
    assert {line["unit"] for line in second} == {"m/s", "deg"}
    assert {line["unit"] for line in first} == {"deg", "deg/s"}
    si = second[0]["values"][0]
    asked(tmp_path / "none", "log", "show", *map(str, logs), *given, "--units", "aero")
    knots = samples_of(page)["panels"][1][0]
    assert knots["unit"] == "kt"
    assert knots["values"][0] == pytest.approx(si * 3600 / 1852, rel=1e-6)
    assert samples_of(page)["limits"][1] == pytest.approx(22.0, abs=0.1)


def test_formulas_of_channels_and_fields(logs: list[Path], tmp_path: Path) -> None:
    page = tmp_path / "page.html"
    formulas = ["lag [rad] = alpha - {airflow_aoa:aoa_rad}", "twice [deg] = 2*lag + 0*beta"]
    given = [word for formula in formulas for word in ("--formula", formula)]
    found = asked(tmp_path / "none", "log", "show", str(logs[0]), *given, "--output", str(page))
    assert found["panels"] == [["lag"], ["twice"]]
    lag = [v for v in samples_of(page)["panels"][0][0]["values"] if v is not None]
    assert np.abs(lag).max() < 0.01  # degrees: the channel is the field on the flight's grid


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--signal", "alhpa"], "did you mean 'alpha'?"),
        (["--signal", "airflow_aoa:aoa_red"], "did you mean 'aoa_rad'?"),
        (["--signal", "V,alpha,q"], "put signals of two units at most into one panel"),
        (["--formula", "theta - alpha"], "gamma [rad] = theta - alpha"),
        (["--formula", "x [furlongs/parsnip] = alpha"], "unknown unit"),
        (["--formula", "x = nothing(alpha)", "--signal", "x"], "'nothing'"),
        (["--formula", "x = 1", "--signal", "x"], "names no signal"),
        (["--formula", "x = x + 1", "--signal", "x"], "no signal 'x'"),
        (["--output", "/nowhere/page.html"], "its folder does not exist"),
    ],
)
def test_what_cannot_be_shown_says_what_to_do(
    logs: list[Path], tmp_path: Path, arguments: list[str], words: str
) -> None:
    done = aerodb(tmp_path / "none", "log", "show", str(logs[0]), *arguments, folder=tmp_path)
    assert done.returncode in (2, 3), done.stdout
    assert words in done.stderr
    assert len(done.stderr.splitlines()) <= 2
    assert list(tmp_path.iterdir()) == []


def test_a_table_that_no_mapping_fits_is_plotted_all_the_same(tmp_path: Path) -> None:
    log = tmp_path / "bench.csv"
    log.write_text("t,volts,amps\n" + "".join(f"{k},{k % 7},{2 * k}\n" for k in range(400)))
    done = aerodb(tmp_path / "none", "log", "show", str(log), folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "NOT USABLE" in done.stdout
    shown = samples_of(tmp_path / "bench-log.html")["panels"]
    assert [line["label"] for panel in shown for line in panel] == [
        f"table:{name}" for name in ("t", "volts", "amps")
    ]


def test_samples_of_a_table_without_a_known_time_are_counted(tmp_path: Path) -> None:
    log = tmp_path / "bench.csv"
    log.write_text("volts\n" + "".join(f"{k % 7}\n" for k in range(400)))
    page = tmp_path / "page.html"
    aerodb(tmp_path / "none", "log", "show", str(log), "--output", str(page))
    assert samples_of(page)["unit"] == "samples"
    assert "samples are counted" in page.read_text("utf-8")


def test_nothing_of_a_log_becomes_markup(tmp_path: Path) -> None:
    log = tmp_path / "hostile.csv"
    flown = channels(1, 8.0, 50.0)
    write_csv(log, flown)
    hostile = "</script><script>alert(1)</script>"
    log.write_text(log.read_text().replace("alpha", hostile, 1))
    page = tmp_path / "page.html"
    name = f"table:{hostile}"
    done = aerodb(tmp_path / "n", "log", "show", str(log), "--signal", name, "--output", str(page))
    assert done.returncode == 0, done.stderr
    assert page.read_text("utf-8").count("<script>") == 1


def test_signals_without_a_flight_and_with_a_clock_that_jumps_back() -> None:
    """A topic that begins without a stamp does not move the others."""
    stamps = np.array([10.0, 11.0, np.nan, 10.5, 12.0])
    topic = Topic("t", stamps, {"a": np.arange(5.0), "name": np.array(list("abcde"))}, {"a": "m"})
    lost = Topic("lost", np.array([np.nan, 11.0]), {"b": np.zeros(2)})
    recording = Recording("log", "ulog", "0" * 64, 1, {"lost": lost, "t": topic})
    signal = Signals(recording, None, {})["t:a"]
    assert signal.time.tolist() == [0.0, 0.5, 1.0, 2.0]
    assert signal.values.tolist() == [0.0, 3.0, 1.0, 4.0]
    assert signal.unit == "m"


def test_a_formula_is_named_like_a_channel_that_it_corrects() -> None:
    time = np.linspace(5.0, 6.0, 11)
    flight = Flight("f", "v", time, {"alpha": np.full(11, 0.1)})
    recording = Recording("log", "ulog", "0" * 64, 1, {})
    corrected = parse_formula("alpha [rad] = alpha - 0.02")
    signal = Signals(recording, flight, {}, [corrected])["alpha"]
    np.testing.assert_allclose(signal.values, 0.08)
    assert (signal.time[0], signal.unit) == (0.0, "rad")
