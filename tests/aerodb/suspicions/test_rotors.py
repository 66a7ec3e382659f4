"""A weak rotor is named, and nothing in sound flights: flights of equations of their own.

The database is the draft of another flight, with the true lumped parameters in place of what an
estimate would give.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aerodb.coefficients import rotors_beside
from aerodb.conditioning import Suspicion
from aerodb.exchange.native import read_native
from aerodb.logs import draft_rotorcraft, map_recording, read_autopilot
from aerodb.parts import command_ranges
from aerodb.storage.mappings import load_mapping
from aerodb.storage.readers.ulog import read_ulog
from aerodb.suspicions import rotors
from aerodb.tables import AeroDatabase, with_parameters
from aerodb.vehicle import Vehicle, parse_vehicle, with_mass_channels
from tests.support.multicopter_flight import (
    CQ,
    CT0,
    CT1,
    DIAMETER,
    FASTEST,
    MASS,
    ROTOR_DRAG,
    fly,
    write_px4,
)

TRUE = {
    "rotor_cT0": CT0 * DIAMETER**4 * FASTEST**2 / MASS,
    "rotor_cT1": CT1 * DIAMETER**3 * FASTEST / MASS,
    "rotor_cQ": CQ * DIAMETER**5 * FASTEST**2 / MASS,
    "rotor_drag": ROTOR_DRAG * FASTEST / MASS,
}
WEAK = (1.0, 1.0, 0.92, 1.0)
#: Share of the voltage lost at ten times of a flight, in which a cell fails.
FAILS = (0.0,) * 6 + (0.1,) * 4


@pytest.fixture(scope="module")
def quad(tmp_path_factory: pytest.TempPathFactory) -> tuple[Vehicle, AeroDatabase]:
    return drafted(tmp_path_factory.mktemp("draft") / "sound.ulg")


def drafted(log: Path, turning: int = 1, factor: str = "") -> tuple[Vehicle, AeroDatabase]:
    """The drafts of a flight, with the true values; `turning` -1 turns all rotors the other way.

    factor : of the speed of each rotor.
    """
    write_px4(log, fly([7], 30.0))
    recording = read_ulog(log)
    found = read_autopilot(recording)
    turned = tuple(replace(each, turns=turning * each.turns) for each in found.rotors.rotors)
    found = replace(found, rotors=replace(found.rotors, rotors=turned))
    vehicle, database = draft_rotorcraft("quad", recording, found)
    if factor:
        database, changed = re.subn(r'(speed = "command_\d)', rf"\1*{factor}", database)
        assert changed == 4
    return parse_vehicle(vehicle), with_parameters(read_native(database), TRUE)


def named(
    quad: tuple[Vehicle, AeroDatabase],
    folder: Path,
    seeds: Sequence[int],
    order: Sequence[int] = (0, 1, 2, 3),
    voltage: bool = True,
    **flown: Any,
) -> list[tuple[Suspicion, ...]]:
    """What is said of one flight per seed, whose log has the rotors of PX4 in an order, and the
    `voltage` of the battery or not."""
    vehicle, database = quad
    flights, found = fly(seeds, 30.0, **flown), []
    flights.commands[:] = flights.commands[:, order]
    for column, seed in enumerate(seeds):
        log = folder / f"{seed}.ulg"
        write_px4(log, flights, column)
        read = read_ulog(log)
        if not voltage:
            kept = {name: each for name, each in read.topics.items() if name != "battery_status"}
            read = replace(read, topics=kept)
        flight = map_recording(read, load_mapping("px4"), vehicle, flight_id=str(seed))
        assert ("battery_voltage" in flight) == voltage
        assert "battery_voltage" not in flight.missing
        flight = with_mass_channels(flight, vehicle)
        found.append(rotors_beside(flight, vehicle, database))
    return found


def test_a_weak_rotor_is_named_in_wind(
    quad: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And not where its interval holds what rotors of a kind differ by."""
    ((found,),) = named(quad, tmp_path, [300], strength=WEAK, wind=(2.0, 1.0))
    assert (found.channel, found.kind) == ("rotor_3", "thrust")
    assert found.evidence["share"] == pytest.approx(-0.08, abs=0.025)
    assert "8 % less" in found.sentence or "less than that of the others" in found.sentence
    inside = abs(found.evidence["share"]) - found.evidence["standard_error"]
    monkeypatch.setattr(rotors, "LEAST", inside)
    assert named(quad, tmp_path, [300], strength=WEAK, wind=(2.0, 1.0)) == [()]


@pytest.mark.parametrize(
    "flown",
    [
        {"wind": (2.0, 1.0)},
        {"sag": 0.06, "voltage": False},
        {"sag": 0.1, "regulated": True},
        {"sag": FAILS, "regulated": True, "wind": (2.0, 1.0)},
        {"offset": (0.004, 0.003, 0.0)},
        {"strength": WEAK, "busy": 0.0},
    ],
    ids=[
        "wind",
        "battery that is not logged",
        "speed that the voltage does not change",
        "speed that a failed cell does not change",
        "shifted CG",
        "hover alone cannot tell",
    ],
)
def test_nothing_is_named(quad: Any, tmp_path: Path, flown: dict[str, Any]) -> None:
    assert named(quad, tmp_path, [400], **flown) == [()]


@pytest.mark.parametrize("sag", [0.1, FAILS], ids=["falls", "a cell fails"])
@pytest.mark.parametrize("strength", [(1.0,) * 4, WEAK], ids=["sound", "weak"])
def test_a_sag_is_the_battery_s(quad: Any, tmp_path: Path, sag: Any, strength: Any) -> None:
    (found,) = named(quad, tmp_path, [400], sag=sag, strength=strength, wind=(2.0, 1.0))
    weak = [("rotor_3", "thrust")] if strength == WEAK else []
    assert [(each.channel, each.kind) for each in found] == [*weak, ("battery_voltage", "sag")]
    if weak:
        assert found[0].evidence["share"] == pytest.approx(-0.08, abs=0.025)
    # Thrust goes with the square of the voltage; the share is of that at the mean.
    mean = 1.0 - (0.05 if sag == 0.1 else float(np.mean(sag)))
    error = 3.0 * found[-1].evidence["standard_error"]
    assert found[-1].evidence["share"] == pytest.approx(-0.2 / mean, abs=error)
    assert error < 0.1
    assert "Multiply `speed` of the rotors" in found[-1].sentence


def test_a_weak_rotor_is_named_where_the_voltage_is_not_logged(quad: Any, tmp_path: Path) -> None:
    flown: dict[str, Any] = {"strength": WEAK, "sag": 0.1, "voltage": False}
    ((found,),) = named(quad, tmp_path, [400], **flown)
    assert (found.channel, found.kind) == ("rotor_3", "thrust")


def test_a_database_that_knows_the_voltage_is_not_contradicted(tmp_path: Path) -> None:
    known = drafted(tmp_path / "sound.ulg", factor="(battery_voltage/16.0)")
    assert named(known, tmp_path, [400], sag=0.1) == [()]
    # The voltage is no command: nothing that trims a hover moves it.
    assert command_ranges(known[1]) == {f"command_{k}": (0.0, 1.0) for k in (1, 2, 3, 4)}


def test_rotors_in_the_order_of_another_frame_are_named(quad: Any, tmp_path: Path) -> None:
    betaflight = (3, 0, 1, 2)  # rear right, front right, rear left, front left
    ((found,),) = named(quad, tmp_path, [500], order=betaflight, wind=(2.0, 1.0))
    assert (found.channel, found.kind) == ("command_1", "swapped")
    assert "command_1 is its command_4" in found.sentence
    assert "command_4 is its command_3" in found.sentence


def test_rotors_that_turn_the_other_way_are_named(tmp_path: Path) -> None:
    ((found,),) = named(drafted(tmp_path / "sound.ulg", -1), tmp_path, [501])
    assert (found.kind, "`turns`" in found.sentence) == ("sign", True)


@pytest.mark.campaign
def test_rates(quad: Any, tmp_path: Path) -> None:
    weak = named(quad, tmp_path, range(300, 310), strength=WEAK, wind=(2.0, 1.0))
    assert sum([each.channel for each in one] == ["rotor_3"] for one in weak) >= 9
    sound: tuple[dict[str, Any], ...] = (
        {"wind": (2.0, 1.0)},
        {"sag": 0.06, "voltage": False},
        {"sag": 0.1, "regulated": True, "gusts": 0.8},
        {"offset": (0.004, 0.003, 0.0)},
    )
    for flown in sound:
        assert named(quad, tmp_path, range(400, 430), **flown) == [()] * 30
    both = named(quad, tmp_path, range(300, 310), strength=WEAK, sag=0.1)
    assert sum([e.channel for e in one] == ["rotor_3", "battery_voltage"] for one in both) >= 9
    alone = named(quad, tmp_path, range(400, 410), sag=0.1)
    assert sum([each.channel for each in one] == ["battery_voltage"] for one in alone) >= 9
