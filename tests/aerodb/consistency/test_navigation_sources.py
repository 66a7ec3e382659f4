"""Tests of several navigation solutions in one flight: planted errors first, then none."""

import numpy as np
import pytest

from aerodb.consistency.whole_flight import make_consistent
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.logs.mapping import map_recording
from aerodb.nomenclature import channel
from aerodb.storage.mappings import load_mapping
from aerodb.storage.readers.any_format import read_log
from aerodb.vehicle import parse_vehicle
from tests.support.consistent_flights import NAME, VEHICLE, log, table

VELOCITY = ("velocity_north", "velocity_east", "velocity_down")
POINT = np.array([3.0, 0.5, -1.0])


def _places(source: str, point: bool = False) -> str:
    lines = [
        f'{name} = {{ topic = "table", field = "{name}_{source}" }}'
        for name in (*VELOCITY, "north", "east", "altitude")
    ]
    at = f"\npoint = {POINT.tolist()}" if point else ""
    return f"\n[navigation.{source}]\n" + "\n".join(lines) + at + "\n"


SEVERAL = parse_vehicle(VEHICLE + _places("ins") + _places("dgps", point=True))


def _columns(seed: int = 1) -> dict[str, np.ndarray]:
    """A flight with a mapped solution, an inertial platform and a receiver that lags by .15 s and
    whose antenna is ahead of the CG; positions are integrals of the true velocities."""
    columns = table(seed, seconds=60.0)
    rng = np.random.default_rng(100 + seed)
    time = columns["time"]
    smooth = {name: _smooth(columns[name]) for name in VELOCITY}
    places = {
        "north": _integral(smooth["velocity_north"], time),
        "east": _integral(smooth["velocity_east"], time),
        "altitude": 500.0 - _integral(smooth["velocity_down"], time),
    }
    turning = np.column_stack([columns[name] for name in ("p", "q", "r")])
    arm = _to_earth(columns, np.broadcast_to(POINT, turning.shape))
    swing = _to_earth(columns, np.cross(turning, POINT))
    for k, (place, name) in enumerate(zip(places, VELOCITY, strict=True)):
        up = -1.0 if place == "altitude" else 1.0
        columns[place] = places[place] + 0.5 * rng.standard_normal(len(time))
        columns[f"{name}_ins"] = columns[name]
        columns[f"{place}_ins"] = columns[place]
        late = np.interp(time - 0.15, time, smooth[name] + swing[:, k])
        columns[f"{name}_dgps"] = late + 0.05 * rng.standard_normal(len(time))
        late = np.interp(time - 0.15, time, places[place] + up * arm[:, k])
        columns[f"{place}_dgps"] = late + 40.0 + 0.5 * rng.standard_normal(len(time))
    return columns


def _smooth(values: np.ndarray) -> np.ndarray:
    return np.convolve(np.pad(values, 12, mode="edge"), np.ones(25) / 25.0, mode="valid")


def _integral(rate: np.ndarray, time: np.ndarray) -> np.ndarray:
    return np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(time))])


def _to_earth(columns: dict[str, np.ndarray], body: np.ndarray) -> np.ndarray:
    phi, theta, psi = (columns[name] for name in ("phi", "theta", "psi"))
    x, y, z = body.T
    y, z = np.cos(phi) * y - np.sin(phi) * z, np.sin(phi) * y + np.cos(phi) * z
    x, z = np.cos(theta) * x + np.sin(theta) * z, -np.sin(theta) * x + np.cos(theta) * z
    x, y = np.cos(psi) * x - np.sin(psi) * y, np.sin(psi) * x + np.cos(psi) * y
    return np.column_stack([x, y, z])


def _flight(columns: dict[str, np.ndarray]) -> Flight:
    channels = {name: values for name, values in columns.items() if name != "time"}
    return Flight("n" * 64, NAME, columns["time"], channels)


def _checks(columns, vehicle=SEVERAL):
    made = make_consistent(_flight(columns), vehicle)
    entries = made.document["navigation"]
    return made, {(e["source"], e["channel"], e["against"]): e for e in entries}


def test_solutions_that_agree_are_good_and_nothing_is_said():
    made, checks = _checks(_columns())
    assert all(entry["good"] for entry in checks.values())
    assert not [remark for remark in made.document["remarks"] if "navigation" in remark]
    for name in VELOCITY:
        assert ("dgps", name, "motion") in checks
        assert ("ins", name, "dgps") in checks
        assert ("mapped", name, "ins") in checks
    assert checks["dgps", "velocity_east", "motion"]["delay"] == pytest.approx(0.15, abs=0.03)
    assert checks["dgps", "east", "motion"]["mean"] == pytest.approx(40.0, abs=3.0)
    for name in ("north", "east", "altitude"):
        assert ("dgps", name, "its velocity") in checks


def test_the_motion_tells_which_of_two_solutions_is_wrong():
    columns = _columns()
    columns["velocity_east_ins"] = columns["velocity_east_ins"] + 2.0
    made, checks = _checks(columns)
    assert not checks["ins", "velocity_east", "motion"]["good"]
    assert not checks["mapped", "velocity_east", "ins"]["good"]
    assert checks["dgps", "velocity_east", "motion"]["good"]
    assert checks["mapped", "velocity_east", "dgps"]["good"]
    said = [remark for remark in made.document["remarks"] if "navigation" in remark]
    assert any(
        "velocity_east of ins differs from the motion of accelerations and rates (2" in each
        for each in said
    )
    assert made.verdict.word == make_consistent(_flight(_columns()), SEVERAL).verdict.word


def test_a_filter_whose_position_runs_away_from_its_velocity_limits_the_flight():
    """With accelerations logged as well; noise of half a metre does not look like it."""
    columns = _columns()
    before, _ = _checks(columns)
    assert not any("integral" in reason for reason in before.verdict.reasons)
    columns["altitude"] = columns["altitude"] + 2.0 * columns["time"]
    made, checks = _checks(columns)
    assert not checks["mapped", "altitude", "its velocity"]["good"]
    assert made.verdict.word == "limited"
    assert any(
        "altitude of the mapped solution is not the integral" in r for r in made.verdict.reasons
    )


def test_climb_rate_and_altitude_have_limits():
    columns = _columns()
    made, _ = _checks(columns)
    limits = {check.channel: check.limit for check in made.verdict.channels}
    assert limits["velocity_down"] == 0.8
    assert limits["altitude"] == 10.0
    stated = SEVERAL.model_copy(
        update={
            "accuracy": SEVERAL.accuracy.model_copy(update={"climb_rate": 0.3, "altitude": 5.0})
        }
    )
    made = make_consistent(_flight(columns), stated)
    limits = {check.channel: check.limit for check in made.verdict.channels}
    assert (limits["velocity_down"], limits["altitude"]) == (0.3, 5.0)


def test_solutions_are_read_from_the_places_that_the_vehicle_file_names(tmp_path):
    columns = _columns()
    path = log(tmp_path, "several", columns)
    flight = map_recording(read_log(path), load_mapping("canonical"), SEVERAL, flight_id="several")
    np.testing.assert_allclose(flight["velocity_north_dgps"], columns["velocity_north_dgps"])
    assert channel("altitude_dgps").unit == "m"
    fewer = {name: values for name, values in columns.items() if name != "altitude_ins"}
    absent = read_log(log(tmp_path, "fewer", fewer))
    flight = map_recording(absent, load_mapping("canonical"), SEVERAL, flight_id="fewer")
    assert "altitude_ins" in flight.missing


def test_a_wrong_name_of_a_solution_or_channel_is_refused():
    with pytest.raises(InputError, match="navigation"):
        parse_vehicle(VEHICLE + _places("ins").replace("velocity_north =", "velocity_nord ="))
    with pytest.raises(InputError, match="navigation"):
        parse_vehicle(VEHICLE + _places("INS-1"))
