"""A draft has the battery's voltage in its speeds where its log tells so, and only there."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from aerodb.exchange.native import read_native
from aerodb.logs import read_autopilot
from aerodb.storage.readers.ulog import read_ulog
from aerodb.tasks.steps import drafted_rotorcraft
from tests.support.multicopter_flight import fly, write_px4

#: Share of the voltage lost at ten times of a flight, in which a cell fails.
FAILS = (0.0,) * 6 + (0.1,) * 4


def drafted(folder: Path, seed: int, voltage: bool = True, **flown: Any) -> tuple[str, str]:
    """Text of the database and factor of the battery, of one flight."""
    log = folder / f"{seed}.ulg"
    write_px4(log, fly([seed], 30.0, **flown))
    recording = read_ulog(log)
    if not voltage:
        kept = {name: each for name, each in recording.topics.items() if name != "battery_status"}
        recording = replace(recording, topics=kept)
    _, database, factor = drafted_rotorcraft("quad", recording, read_autopilot(recording))
    return database, factor


@pytest.mark.parametrize("sag", [0.1, FAILS], ids=["falls", "a cell fails"])
@pytest.mark.parametrize("seed", [400, pytest.param(401, marks=pytest.mark.campaign)])
def test_speeds_go_with_a_battery_that_falls(tmp_path: Path, sag: Any, seed: int) -> None:
    text, factor = drafted(tmp_path, seed, sag=sag, wind=(2.0, 1.0))
    voltage, _, power = factor.removeprefix("(battery_voltage/").partition(")")
    assert float(voltage) == pytest.approx(16.0 * (0.95 if sag == 0.1 else 0.96), abs=0.2)
    assert 0.7 < float(power.removeprefix("^") or 1.0) < 1.3
    assert text.count('speed = "(command_') == text.count(f"*{factor}") == 4
    assert "battery_voltage" in read_native(text).inputs


@pytest.mark.parametrize(
    "flown",
    [
        {"wind": (2.0, 1.0)},
        {"sag": 0.1, "voltage": False},
        {"sag": 0.1, "regulated": True},
        {"sag": FAILS, "regulated": True, "wind": (2.0, 1.0)},
    ],
    ids=["sound", "not logged", "regulated", "regulated and a cell fails"],
)
@pytest.mark.parametrize("seed", [400, pytest.param(401, marks=pytest.mark.campaign)])
def test_no_voltage_is_written_where_speeds_do_not_go_with_it(
    tmp_path: Path, flown: dict[str, Any], seed: int
) -> None:
    text, factor = drafted(tmp_path, seed, **flown)
    assert factor == ""
    assert "battery_voltage" not in text
