"""The closed loop on aircraft of JSBSim whose database lacks a term that flies: found, named,
sized, and nothing else."""

from collections.abc import Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytest.importorskip("jsbsim")

from aerodb.flight import Flight
from tests.support.command import asked
from tests.support.jsbsim_campaign import NOISE, STEP, Edit, imported, vehicle_text
from tests.support.jsbsim_cases import CASES, IDENTIFIED, campaign
from tests.support.jsbsim_loop import Closed, closed, judged
from tests.support.small_glider import write_csv
from tests.support.tracing_flights import DEGREE, coloured

GEAR = "737 without the drag of its gear"
STALL = "c172p without the hysteresis of its stall"
#: In the suite: a slope, the hysteresis of a stall, gear and ground effect of two aircraft that
#: nothing was made with, and what gear and flaps do to moments and in sideslip; the other cases run
#: in `make campaign`.
_KEPT = (
    "f16 with an alpha slope 8 % too small",
    STALL,
    "t6texan2 without the drag of its gear",
    "c182 without ground effect",
    "T37 without the side force of its gear in sideslip",
    "t6texan2 without the moments of its gear",
    "pa28 without the pitching moment of its flaps",
)
EACH = [pytest.param(name, marks=[] if name in _KEPT else pytest.mark.campaign) for name in CASES]


@lru_cache(maxsize=8)
def loop(name: str) -> Closed:
    """The closed loop of a case on the database that lacks its term."""
    case = CASES[name]
    vehicle, flights = campaign(name)
    return closed(imported(case.aircraft, case.lacks), vehicle, flights, stall=case.stall)


@pytest.mark.parametrize("name", EACH)
def test_what_the_database_lacks_is_found_named_sized_and_proved(name: str) -> None:
    case, found = CASES[name], loop(name)
    vehicle, flights = campaign(name)
    whole, lacking = imported(case.aircraft), imported(case.aircraft, case.lacks)
    first = [finding.hypothesis for finding in found.rounds[0] if "@all" not in finding.hypothesis]
    assert sorted(first) == sorted(case.effects)
    assert set(case.effects) <= set(found.confirmed)
    for hypothesis, axis in case.effects.items():
        result = judged(axis, whole, lacking, found, vehicle, flights)
        assert result.size == pytest.approx(1.0, abs=0.1), (hypothesis, result)
        assert result.reduction >= 0.8, (hypothesis, result)


@pytest.mark.parametrize("name", EACH)
def test_nothing_is_claimed_beyond_it(name: str) -> None:
    assert sorted(loop(name).confirmed) == sorted(CASES[name].effects)


@pytest.mark.parametrize("name", EACH)
def test_the_same_flights_beside_the_whole_database_show_nothing(name: str) -> None:
    vehicle, flights = campaign(name)
    found = closed(imported(CASES[name].aircraft), vehicle, flights, stall=CASES[name].stall)
    assert not found.aerodynamic


def by_commands(
    name: str,
    folder: Path,
    lacks: Edit | None,
    flights: Sequence[Flight] | None = None,
) -> dict[str, Any]:
    """A case wholly by commands: aircraft file, logs with raw instruments, reconstruction, loop,
    proof; the loop's document.

    lacks : what is taken from the database. flights : as logged; None: those of the case.
    """
    case, workspace = CASES[name], folder / "workspace"
    vehicle, logged = campaign(name)
    (folder / "vehicle.toml").write_text(vehicle_text(case.aircraft, imported(case.aircraft)))
    asked(workspace, "vehicle", "add", str(folder / "vehicle.toml"))
    (folder / "lacking.xml").write_bytes(case.aircraft.file(lacks))
    bindings = [
        word
        for name, text in case.aircraft.bindings.items()
        for word in ("--bind", f"{name}={text}")
    ]
    asked(
        workspace,
        "database",
        "import",
        str(folder / "lacking.xml"),
        "--vehicle",
        vehicle.name,
        *bindings,
    )
    for flight in flights or logged[:IDENTIFIED]:
        log = write_csv(folder / f"{flight.id}.csv", {"time": flight.time, **flight.channels})
        answer = asked(
            workspace, "flight", "ingest", str(log), "--vehicle", vehicle.name, "--direct"
        )
        assert answer[0]["consistency"]["verdict"] == "good" or flights
    found: dict[str, Any] = asked(workspace, "close-loop", "--vehicle", vehicle.name, "--direct")
    return found


@pytest.mark.campaign
def test_by_commands_a_stall_that_is_a_closed_loop_is_told_from_flow_that_separates(
    tmp_path: Path,
) -> None:
    found = by_commands(STALL, tmp_path, CASES[STALL].lacks)
    assert found["added"] == ["stall_hysteresis@C_lift:loop"]
    assert [f["hypothesis"] for f in found["findings"] if f["verdict"] == "confirmed"] == [
        "stall_hysteresis@C_lift:loop"
    ]
    assert found["axes"]["C_lift"]["excess_after"] < 0.2 * found["axes"]["C_lift"]["excess_before"]
    assert any(
        "shape refined of stall_hysteresis@C_lift:loop over alpha" in remark
        for remark in found["remarks"]
    )


@pytest.mark.campaign
def test_by_commands_from_logs_to_proof(tmp_path: Path) -> None:
    """The gear's drag again, from logs with raw instruments on."""
    found = by_commands(GEAR, tmp_path, CASES[GEAR].lacks)
    assert (len(found["flights"]["identified"]), len(found["flights"]["held_out"])) == (4, 2)
    assert found["added"] == ["landing_gear@C_drag"]
    gear, *others = found["findings"]
    assert (gear["effect"], gear["verdict"]) == ("landing_gear", "confirmed")
    assert gear["value"] == pytest.approx(0.015, rel=0.1)
    assert gear["ci95"][0] < 0.015 < gear["ci95"][1]
    assert all(other["verdict"] == "sensor" for other in others)
    for axis in ("CX", "C_drag"):
        assert found["axes"][axis]["excess_after"] < 0.2 * found["axes"][axis]["excess_before"]


def test_a_shape_is_made_finer_where_it_is_wrong_only() -> None:
    """The stall's two branches are no parabola; the gear's drag depends on the gear alone."""
    stall, gear = (
        [made.variables for made in loop(name).shapes if made is not None] for name in (STALL, GEAR)
    )
    assert stall[0] == {"stall_hysteresis@C_lift:loop": ("alpha",)}
    assert not any(gear)


#: Noise that no vehicle file declares: channel -> one sigma and correlation time [s]. The first is
#: in the suite.
UNDECLARED: Mapping[str, Mapping[str, tuple[float, float]]] = {
    "alpha .3 deg": {"alpha": (0.3 * DEGREE, 0.5)},
    "alpha .43 deg": {"alpha": (5.0 * NOISE["alpha"], 0.5)},
    "alpha .1 deg": {"alpha": (0.1 * DEGREE, 1.0)},
    "beta .3 deg": {"beta": (0.3 * DEGREE, 0.5)},
    "rates": {name: (5.0 * NOISE[name], 0.5) for name in ("p", "q", "r")},
    "accelerometers": {f"a{axis}_imu": (5.0 * NOISE[f"a{axis}_imu"], 0.5) for axis in "xyz"},
}


def noisier(flight: Flight, noise: Mapping[str, tuple[float, float]], seed: int) -> Flight:
    """The flight as logged by instruments with this noise besides."""
    rng = np.random.default_rng([seed, int(flight.id.rpartition("-")[2])])
    n = len(flight.time)
    return flight.with_channels(
        {
            name: flight[name] + sigma * coloured(rng, n, lasting, STEP)
            for name, (sigma, lasting) in noise.items()
        }
    )


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("cell", "number"),
    [*((cell, IDENTIFIED) for cell in UNDECLARED), ("alpha .1 deg", 3)],
)
def test_undeclared_coloured_noise_is_no_effect_and_no_fault(
    cell: str, number: int, tmp_path: Path
) -> None:
    """Nothing is lacking, by commands: what ships estimates the noise from the flights alone."""
    flights = [noisier(f, UNDECLARED[cell], 1) for f in campaign(GEAR)[1][:number]]
    found = by_commands(GEAR, tmp_path, None, flights)
    claimed = {"confirmed", "alias_group", "suspected", "sensor", "ambiguous_sensor"}
    assert [f["hypothesis"] for f in found["findings"] if f["verdict"] in claimed] == []
    assert found["added"] == []
