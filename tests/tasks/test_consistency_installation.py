"""What a vehicle file says of its sensors' installation, through the real commands: errors planted
behind an antenna's arm, the holes of a probe, the ports and a turning earth come back within their
errors, and nothing where nothing is."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from aerodb.consistency import records
from aerodb.consistency.pressures import angles_from_holes, correct_port_errors, recalibrated
from aerodb.consistency.records import air_data_at_probe, inertial_inputs, records_from_flight
from aerodb.flight import Flight
from aerodb.nomenclature import FLAGS
from aerodb.physics.geodesy import EARTH_RATE, normal_gravity
from aerodb.storage.files.flights import read_results
from aerodb.tasks.steps.consistency import load_consistent
from aerodb.tasks.workspace_access import access_workspace
from aerodb.vehicle import parse_vehicle
from aerodb.vehicle.probe import air_data_at_cg
from tests.support.command import asked
from tests.support.consistent_flights import NAME, log, stored_sigma
from tests.support.installed_flights import (
    BIASES,
    POINTS,
    PORT,
    PRESSURES,
    VANES,
    around_the_earth,
    exact_at_cg,
    table,
    vehicle,
)
from tests.support.instrumented_path import GPS, NOISE, PROBE, motion
from tests.support.sweeps import HERE

CALIBRATION = {
    "probe_alpha_offset": 0.01, "probe_alpha_slope": 0.08, "probe_alpha_cross": 1.5, "probe_beta_offset": -0.02,
    "probe_beta_slope": -0.05,
}  # fmt: skip
GEAR_DOWN = f"""
[[air_data.configurations]]
channel = "delta_landing_gear"
above = 0.5
[air_data.configurations.five_hole.alpha]
slope = {PROBE.alpha.slope}
offset = 0.03
break_angle = {PROBE.alpha.break_angle}
[air_data.configurations.five_hole.beta]
slope = {PROBE.beta.slope}
"""
WITH_HEIGHT = (*VANES, "pressure_altitude")


def _ingested(
    folder: Path, text: str, columns: dict[str, np.ndarray]
) -> tuple[dict[str, Any], Path]:
    """The answer of ``aerodb flight ingest`` on these columns under this vehicle file, and the
    workspace."""
    folder.mkdir(exist_ok=True)
    (folder / "vehicle.toml").write_text(text, encoding="utf-8")
    asked(folder / "w", "vehicle", "add", str(folder / "vehicle.toml"))
    flown = str(log(folder, "one", columns))
    (outcome,) = asked(folder / "w", "flight", "ingest", flown, "--vehicle", NAME, "--direct")
    return outcome, folder / "w"


def _consistent(outcome: dict[str, Any], workspace: Path) -> tuple[Flight, dict[str, np.ndarray]]:
    """The consistent flight as it is stored, and its standard errors."""
    access = access_workspace(str(workspace))
    loaded = load_consistent(access, access.catalogue.flight(outcome["flight"]), "")
    return loaded.flight, stored_sigma(access, loaded.key)


def _estimates(outcome: dict[str, Any]) -> dict[str, dict[str, Any]]:
    return {entry["parameter"]: entry for entry in outcome["consistency"]["estimates"]}


def _recovered(
    outcome: dict[str, Any], planted: dict[str, float], more: tuple[str, ...] = ()
) -> None:
    """All that was planted was estimated, all that was estimated is within 3.5 standard errors, and
    nothing else was freed but what every flight has."""
    found = _estimates(outcome)
    usual = {f"{name}_bias" for name in ("ax", "ay", "az", "p", "q", "r", "alpha", "beta")} | {
        "wind_north",
        "wind_east",
    }
    assert set(planted) <= set(found) <= {*planted, *usual, *more}
    for name, entry in found.items():
        if name not in more:
            assert abs(entry["value"] - planted.get(name, 0.0)) < 3.5 * entry["standard_error"], (
                name
            )


def test_an_antenna_off_the_cg_that_is_late(tmp_path: Path) -> None:
    """Position and velocity are the antenna's, .12 s late: with its place in the vehicle file one
    delay explains them down to the receiver's noise; without it, they cannot be."""
    planted = {**BIASES, "gps_delay": 0.12}
    columns = table(planted)
    outcome, _ = _ingested(tmp_path / "known", vehicle(), columns)
    _recovered(outcome, planted)
    assert outcome["consistency"]["verdict"] == "good"
    assert _estimates(outcome)["gps_delay"]["standard_error"] < 0.002
    known = {entry["channel"]: entry["after"] for entry in outcome["consistency"]["channels"]}
    for name in ("velocity_north", "velocity_east", "velocity_down", "north", "east"):
        assert known[name] < NOISE[name], name
    unknown, _ = _ingested(tmp_path / "unknown", vehicle(antenna=False), columns)
    rest = {entry["channel"]: entry["after"] for entry in unknown["consistency"]["channels"]}
    assert "gps_delay" not in _estimates(unknown)
    assert rest["velocity_north"] > 1.5 * known["velocity_north"]
    assert rest["north"] > 5 * known["north"]


def test_a_five_hole_probe_is_calibrated_from_its_raw_pressures(tmp_path: Path) -> None:
    """No alpha, no beta in the log: they come from pressures whose calibration is off in offset,
    slope and dependence on the other angle. All of it is found, and the angles at the CG are nearer
    the truth than the noise of the holes."""
    planted = {**BIASES, **CALIBRATION}
    columns = table(planted, PRESSURES)
    outcome, workspace = _ingested(tmp_path, vehicle(holes=True), columns)
    _recovered(outcome, planted)
    assert outcome["consistency"]["verdict"] == "good"
    checked = {entry["channel"]: entry for entry in outcome["consistency"]["channels"]}
    limit = np.deg2rad(0.5)
    assert {"alpha", "beta"} <= set(checked)
    assert all(
        checked[name]["limit"] == pytest.approx(limit) and checked[name]["after"] < 0.3 * limit
        for name in ("alpha", "beta")
    )
    flight, sigma = _consistent(outcome, workspace)
    exact = exact_at_cg(columns)
    for name in ("alpha", "beta"):
        error = flight[name] - exact[name]
        assert np.sqrt(np.mean(error**2)) < 0.001, name
        assert np.mean(np.abs(error) < 3 * sigma[name]) > 0.99, name


def test_a_gear_that_moves_in_flight_disturbs_the_probe_as_the_vehicle_file_says(
    tmp_path: Path,
) -> None:
    """The gear comes down at 30 s, and with it the flow at the probe: with its configuration stated
    only what else is off is found, in both; without it, angles stay wrong."""
    still, lowered = {**BIASES, **CALIBRATION}, {**BIASES, **CALIBRATION}
    lowered["probe_alpha_offset"] += 0.03
    columns = table(still, PRESSURES)
    down = columns["time"] >= 30.0
    other = table(lowered, PRESSURES)
    columns["probe_dp_alpha"] = np.where(down, other["probe_dp_alpha"], columns["probe_dp_alpha"])
    columns["delta_landing_gear"] = down.astype(float)
    exact, off = exact_at_cg(columns), dict[str, float]()
    for name, more in (("stated", GEAR_DOWN), ("not stated", "")):
        outcome, workspace = _ingested(tmp_path / name, vehicle(holes=True) + more, columns)
        flight, _ = _consistent(outcome, workspace)
        off[name] = float(np.sqrt(np.mean((flight["alpha"] - exact["alpha"]) ** 2)))
        if more:
            assert outcome["consistency"]["verdict"] == "good"
            found = _estimates(outcome)
            for each, value in CALIBRATION.items():
                assert abs(found[each]["value"] - value) < 3.5 * found[each]["standard_error"], each
    assert off["stated"] < 0.0015
    assert off["not stated"] > 5.0 * off["stated"]


def test_recalibrated_angles_are_the_true_ones() -> None:
    """Without noise: the pressures that a probe of another calibration shows, and what is left of
    its error: nothing."""
    time = 0.02 * np.arange(1500)
    shown = motion(time, CALIBRATION)
    described = parse_vehicle(vehicle(holes=True))
    channels = {
        name: shown[name]
        for name in (
            "probe_dp_alpha",
            "probe_dp_beta",
            "qbar",
            "V",
            "p",
            "q",
            "r",
            "ax",
            "ay",
            "az",
        )
    }
    raw = Flight(
        "f",
        NAME,
        time,
        {**channels, "phi": shown["phi"], "theta": shown["theta"], "rho": np.full(1500, 1.1)},
    )
    flight = air_data_at_cg(raw, described)
    seen = air_data_at_probe(flight, inertial_inputs(flight, described))
    assert np.abs(seen["alpha"] - shown["alpha"]).max() > 0.01
    assert angles_from_holes(flight, described, seen)
    assert not angles_from_holes(flight, described, {**seen, "alpha": seen["alpha"] + 0.01})
    cured = described.model_copy(update={"air_data": recalibrated(described.air_data, CALIBRATION)})
    again = air_data_at_probe(air_data_at_cg(raw, cured), inertial_inputs(flight, described))
    for name in ("alpha", "beta"):
        np.testing.assert_allclose(again[name], shown[name], atol=1e-9)


def test_what_stands_behind_ports_in_error() -> None:
    """The air data of `instrumented_path`, whose density rests on the static pressure in error,
    turned round."""
    time = 0.02 * np.arange(500)
    planted = {"static_port_error": PORT, "static_port_offset": 40.0, "total_port_error": -0.02}
    shown, true = motion(time, planted), motion(time, {})
    air = correct_port_errors(shown["V"], np.full(500, 1.1), np.full(500, 9e4), planted)
    np.testing.assert_allclose(air.V, true["V"], rtol=1e-9)
    np.testing.assert_allclose(air.q, 0.5 * air.rho * true["V"] ** 2, rtol=1e-12)


@pytest.mark.parametrize("gusts", [0.0, 1.0])
def test_the_phoenix_dynamic_pressure_error_end_to_end(tmp_path: Path, gusts: float) -> None:
    """003, eq. 5, qbar = 1.101907 qbar_m: beside a GPS altitude the pressure altitude, off by an
    unknown weather, shows that it is the static port; airspeed, dynamic pressure and density of the
    stored flight are right again, in gusts as well."""
    planted = {**BIASES, "static_port_error": PORT}
    columns = table(planted, WITH_HEIGHT, weather=40.0, gusts=gusts)
    outcome, workspace = _ingested(tmp_path, vehicle(), columns)
    _recovered(outcome, planted, ("pressure_altitude_bias", "pressure_altitude_scale"))
    found = _estimates(outcome)
    assert found["static_port_error"]["applied"]
    assert 1.0 / (1.0 - found["static_port_error"]["value"]) == pytest.approx(1.101907, abs=0.004)
    flight, _ = _consistent(outcome, workspace)
    ratio = np.mean(flight["qbar"]) / np.mean(columns["qbar"])
    assert ratio == pytest.approx(1.101907, abs=0.004)
    if not gusts:
        exact = exact_at_cg(columns)
        true = 0.5 * np.mean(flight["rho"]) * exact["V"] ** 2
        assert np.mean(flight["qbar"] / true) == pytest.approx(1.0, abs=0.003)
        assert outcome["consistency"]["verdict"] == "good"


def test_without_a_second_height_the_same_error_is_a_scale_of_the_airspeed(tmp_path: Path) -> None:
    """Total and static port are then one: V shows sqrt(1/1.101907) of the truth, and the stored
    qbar is right."""
    columns = table({**BIASES, "static_port_error": PORT})
    outcome, workspace = _ingested(tmp_path, vehicle(), columns)
    found = _estimates(outcome)
    assert not {"static_port_error", "total_port_error", "qbar_scale"} & set(found)
    scale = found["V_scale"]
    assert (
        abs(scale["value"] - (1.101907**-0.5 - 1.0)) < 3.5 * scale["standard_error"] + 1e-3
    )  # density is off by .2 % as well
    flight, _ = _consistent(outcome, workspace)
    assert np.mean(flight["qbar"]) / np.mean(columns["qbar"]) == pytest.approx(1.101907, abs=0.006)


@pytest.mark.parametrize("holes", [False, True], ids=["vanes", "holes"])
def test_where_nothing_is_planted_nothing_is_freed(tmp_path: Path, holes: bool) -> None:
    """All sensors at once, none in error: no delay, port, slope or scale is kept, no bias is beyond
    its error."""
    channels = (*(PRESSURES if holes else VANES), "pressure_altitude")
    outcome, workspace = _ingested(tmp_path, vehicle(holes=holes), table({}, channels))
    usual = ("probe_alpha_offset", "probe_beta_offset") if holes else ()
    _recovered(
        outcome, dict.fromkeys(usual, 0.0), ("pressure_altitude_bias", "pressure_altitude_scale")
    )
    assert abs(_estimates(outcome)["pressure_altitude_bias"]["value"]) < 5.0
    assert outcome["consistency"]["verdict"] == "good"
    flight, _ = _consistent(outcome, workspace)
    exact = exact_at_cg(table({}, channels))
    assert np.sqrt(np.mean((flight["alpha"] - exact["alpha"]) ** 2)) < 0.001


def test_captive_flight_tells_of_the_sensors_and_not_of_the_aircraft(tmp_path: Path) -> None:
    """A carrier holds the vehicle for the first 30 s: its motion says as much of the biases as the
    rest, which alone says less, and no coefficient rests on it."""
    columns = table(BIASES)
    held = columns["time"] < 30.0
    outcome, workspace = _ingested(
        tmp_path / "held", vehicle(), {**columns, "captive": np.where(held, 1.0, 0.0)}
    )
    _recovered(outcome, BIASES)
    free, _ = _ingested(tmp_path / "free", vehicle(), columns)
    for name, entry in _estimates(free).items():
        assert entry["standard_error"] == pytest.approx(
            _estimates(outcome)[name]["standard_error"], rel=0.02
        ), name
    access = access_workspace(str(workspace))
    flight, _ = _consistent(outcome, workspace)
    assert np.array_equal((flight.flags["flight"] & FLAGS["captive"]) > 0, held)
    row = next(
        r for r in access.catalogue.results_of(outcome["flight"]) if r.step == "coefficients"
    )
    stored = read_results(access.workspace.resolve(row.path))[0]
    assert not stored["usable"][stored["time"] < 29.9].any()
    assert stored["usable"][stored["time"] > 31.0].mean() > 0.9


@pytest.mark.campaign
def test_a_long_flight_is_taken_over_a_turning_earth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Eleven minutes at 52 deg with quiet gyros: their biases come out right, where a flat earth
    has its own rate in them."""
    planted = {"p_bias": 0.001, "q_bias": -0.0005, "r_bias": 0.0004, "ax_bias": 0.02}
    columns = around_the_earth(1, 0.9, 660.0, planted)
    text = vehicle(antenna=False).replace(POINTS, 'moment_reference = "cg"\n')
    outcome, _ = _ingested(tmp_path / "turning", text, columns)
    _recovered(outcome, planted)
    monkeypatch.setattr(records, "ROTATING_EARTH_DURATION", np.inf)
    (tmp_path / "flat" / "w").mkdir(parents=True)
    (tmp_path / "flat" / "w" / "settings.toml").write_text(HERE, encoding="utf-8")
    flat, _ = _ingested(tmp_path / "flat", text, columns)
    wrong = max(
        abs(_estimates(flat)[f"{name}_bias"]["value"] - planted[f"{name}_bias"]) for name in "pqr"
    )
    right = max(
        abs(_estimates(outcome)[f"{name}_bias"]["value"] - planted[f"{name}_bias"])
        for name in "pqr"
    )
    assert right < 0.15 * EARTH_RATE < 0.3 * EARTH_RATE < wrong


def test_gravity_is_that_of_the_place_in_a_short_flight_too(tmp_path: Path) -> None:
    """At the equator gravity is .027 m/s2 less than standard gravity, which without a latitude
    stands in the bias of az: .3 percent of lift."""
    planted = {"az_bias": 0.03, "ax_bias": 0.02}
    columns = around_the_earth(3, 0.01, 90.0, planted)
    text = vehicle(antenna=False).replace(POINTS, 'moment_reference = "cg"\n')
    found = {}
    for name, table_of in (
        ("known", columns),
        ("unknown", {n: x for n, x in columns.items() if n not in ("latitude", "longitude")}),
    ):
        outcome, _ = _ingested(tmp_path / name, text, table_of)
        found[name] = _estimates(outcome)["az_bias"]["value"]
    assert found["known"] == pytest.approx(planted["az_bias"], abs=0.005)
    assert found["unknown"] == pytest.approx(planted["az_bias"] + 9.80665 - 9.78033, abs=0.005)


def test_records_know_where_things_are() -> None:
    """The arm of the antenna from the CG, the earth of a long flight and of no other, and one
    dynamic pressure of one sensor."""
    described = parse_vehicle(vehicle())
    columns = table({}, seconds=20.0)
    place = {"latitude": np.full(1000, 0.9), "longitude": np.full(1000, 0.1)}
    flight = Flight(
        "f", NAME, columns["time"], {**{n: x for n, x in columns.items() if n != "time"}, **place}
    )
    moved = air_data_at_cg(flight, described)
    (record,) = records_from_flight(moved, described)
    assert record.installation.gps == GPS
    assert record.earth is None
    height = float(np.median(columns["altitude"]))
    assert record.gravity == pytest.approx(normal_gravity(0.9, height).gravity, abs=1e-9)
    assert "qbar" not in record.outputs  # it is that of the airspeed at the probe
    late = Flight("g", NAME, 40.0 * flight.time, flight.channels)
    (longer,) = records_from_flight(late, described, seconds=1e4)
    assert longer.earth is not None
    assert longer.earth.latitude == pytest.approx(0.9)
