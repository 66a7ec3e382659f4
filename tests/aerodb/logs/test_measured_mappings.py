"""Measured files through the built-in mappings, against their own columns and against physics."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from aerodb.flight import Flight
from aerodb.logs.completeness import consequences_of_missing
from aerodb.logs.mapping import choose_mapping, map_recording
from aerodb.signals.differentiation import low_passed
from aerodb.storage.mappings import builtin_mappings
from aerodb.storage.readers.tabular import read_tabular
from tests.aerodb.logs.test_mapping import SURFACES, vehicle_with_elevator


def _flight(path: Path, extra: str = "") -> Flight:
    recording = read_tabular(path)
    return map_recording(
        recording,
        choose_mapping(recording, builtin_mappings().values()),
        vehicle_with_elevator(extra),
    )


def test_twin_otter_columns_become_channels(measured: Callable[[str], Path]) -> None:
    path = measured("twin_otter/totter_f1_017_data.mat")
    flight = _flight(path)
    columns = {
        name: np.asarray(values)
        for name, values in read_tabular(path).topics["fdata"].fields.items()
    }
    assert flight.mapping == "sidpac_fdata"
    np.testing.assert_array_equal(flight.time, columns["1"])
    for name, column, factor in (
        ("V", "2", 0.3048),
        ("beta", "3", np.pi / 180),
        ("az", "13", 9.80665),
        ("qbar", "27", 47.880258980335840),
        ("rho", "29", 515.3788183932),
        ("cg_x", "45", -0.0254),
        ("cg_z", "47", -0.0254),
        ("mass", "48", 14.593902937206),
        ("Ixz", "52", 1.3558179483314),
        ("thrust_left", "38", 4.4482216152605),
    ):
        np.testing.assert_allclose(flight[name], columns[column] * factor, rtol=1e-9)
    np.testing.assert_allclose(
        flight["thrust"], flight["thrust_left"] + flight["thrust_right"], rtol=1e-12
    )
    np.testing.assert_allclose(flight["qbar"], 0.5 * flight["rho"] * flight["V"] ** 2, rtol=5e-3)
    assert flight.flags == {}


def test_twin_otter_units_give_the_published_moments(measured: Callable[[str], Path]) -> None:
    """NASA's own Cl and Cn follow from rates and inertias only with the right units and the right
    sign of Ixz."""
    path = measured("twin_otter/totter_f1_017_data.mat")
    f, published = _flight(path), read_tabular(path).topics["fdata"].fields
    lever = f["qbar"] * (422.48 * 0.3048**2) * (64.99 * 0.3048)
    roll = (
        f["Ixx"] * f["pdot"]
        - f["Ixz"] * (f["p"] * f["q"] + f["rdot"])
        + (f["Izz"] - f["Iyy"]) * f["q"] * f["r"]
    )
    yaw = (
        f["Izz"] * f["rdot"]
        - f["Ixz"] * (f["pdot"] - f["q"] * f["r"])
        + (f["Iyy"] - f["Ixx"]) * f["p"] * f["q"]
    )
    np.testing.assert_allclose(roll / lever, published["64"], atol=1e-5)
    np.testing.assert_allclose(yaw / lever, published["66"], atol=1e-5)


@pytest.mark.parametrize("record", ["totter_demo_data.mat", "totter_f1_017_data.mat"])
def test_twin_otter_sensor_follows_the_cg(measured: Callable[[str], Path], record: str) -> None:
    """The lever arm from CG to accelerometer, estimated from the two sets of accelerations, ends at
    the same point of the airframe in both records although the CG moved: so the signs of the CG
    columns are right."""
    f = _flight(measured(f"twin_otter/{record}"))
    p, q, r, pdot, qdot, rdot = (f[name] for name in ("p", "q", "r", "pdot", "qdot", "rdot"))
    zero, one = np.zeros_like(p), np.ones_like(p)
    rows = [
        np.column_stack([-(q * q) - r * r, p * q - rdot, p * r + qdot, one, zero, zero]),
        np.column_stack([p * q + rdot, -(p * p) - r * r, q * r - pdot, zero, one, zero]),
        np.column_stack([p * r - qdot, q * r + pdot, -(p * p) - q * q, zero, zero, one]),
    ]
    difference = np.concatenate([f[f"a{axis}_imu"] - f[f"a{axis}"] for axis in "xyz"])
    lever = np.linalg.lstsq(np.vstack(rows), difference)[0][:3]
    cg = np.array([f["cg_x"][0], f["cg_y"][0], f["cg_z"][0]])
    np.testing.assert_allclose(cg + lever, np.array([-193.0, -16.0, 12.0]) * 0.0254, atol=0.004)


def test_columns_of_zeros_are_missing(measured: Callable[[str], Path]) -> None:
    flight = _flight(measured("twin_otter/totter_9752ed20_data.mat"))
    assert {"thrust", "thrust_left", "ax_imu", "psi"} <= set(flight.missing)
    assert "rho from dynamic pressure and airspeed" in flight.notes
    np.testing.assert_allclose(flight["qbar"], 0.5 * flight["rho"] * flight["V"] ** 2, rtol=1e-12)
    assert consequences_of_missing(flight.missing)[-1].startswith("no thrust")


def test_attas_units_differ_between_its_two_kinds_of_files(measured: Callable[[str], Path]) -> None:
    for name, mapping in (("fAttasElv1.mat", "attas"), ("fAttas_qst01.asc", "attas_quasi_steady")):
        flight = _flight(measured(f"attas/{name}"))
        assert flight.mapping == mapping
        gas = flight["static_pressure"] / (287.05287 * flight["temperature"])
        np.testing.assert_allclose(flight["rho"], gas, rtol=2e-3)
        assert np.all(
            np.abs(
                flight["calibrated_airspeed"] / (flight["V"] * np.sqrt(flight["rho"] / 1.225)) - 1.0
            )
            < 0.05
        )
        assert np.all((flight["altitude"] > 4500.0) & (flight["altitude"] < 6000.0))
    assert ("ax_imu" in flight, "alphadot" in flight) == (True, True)


def test_attas_gap_is_flagged_and_what_was_recorded_is_kept(
    measured: Callable[[str], Path],
) -> None:
    path = measured("attas/fAttasAilRud1.mat")
    flight = _flight(path, SURFACES)
    raw = np.asarray(read_tabular(path).topics["fAttasAilRud1"].fields["13"]) * np.pi / 180
    good = flight.usable(["alpha"])
    assert len(flight.time) == 2253
    assert good.sum() == 1502
    np.testing.assert_allclose(flight["alpha"][good], raw, rtol=1e-12)
    np.testing.assert_allclose(
        flight["delta_aileron"], (flight["delta_aileron_right"] - flight["delta_aileron_left"]) / 2
    )


def test_hfb320_and_citation(measured: Callable[[str], Path]) -> None:
    hfb = _flight(measured("hfb320/hfb320_1_10.asc"))
    assert hfb["az"].mean() == pytest.approx(-9.9, abs=0.1)
    assert hfb["rho"].mean() == pytest.approx(
        0.792, abs=0.005
    )  # the published constant of that flight
    citation = _flight(measured("citation/flight_2019-03-12.parquet"))
    assert citation.step == pytest.approx(0.1)
    airborne = citation["V"] > 60.0
    assert citation["az_imu"][airborne].mean() == pytest.approx(-9.9, abs=0.3)
    compressible = (
        0.7 * citation["mach"] ** 2 * citation["rho"] * 287.05287 * citation["temperature"]
    )
    np.testing.assert_allclose(citation["qbar"][airborne], compressible[airborne], rtol=0.02)
    assert "beta" in citation.missing


def test_attas_accelerations_of_the_stalls_are_those_of_the_manoeuvres(
    measured: Callable[[str], Path],
) -> None:
    """The pack's text has them at the CG. The cockpit's accelerometers (columns 5 and 6) are as far
    ahead of columns 3 and 4 as in the elevator manoeuvre, 7.3 m; ahead of the CG they are 6.2 m."""
    for name in ("fAttas_qst01", "fAttas_qst02"):
        table = np.loadtxt(measured(f"attas/{name}.asc"))
        time, (p, q, r) = table[:, 0], np.radians(table[:, 6:9]).T
        pdot, qdot, rdot = (np.gradient(rate, time) for rate in (p, q, r))
        ones = np.ones_like(time)
        for difference, arms in (
            (table[:, 5] - table[:, 3], [p * r - qdot, q * r + pdot, ones]),
            (table[:, 4] - table[:, 2], [p * q + rdot, -(p * p + r * r), ones]),
        ):
            slow = [low_passed(each, time[1] - time[0], 2.0) for each in (difference, *arms[:2])]
            columns = np.column_stack([*slow[1:], ones])
            ahead = np.linalg.lstsq(columns, slow[0], rcond=None)[0][0]
            assert ahead == pytest.approx(7.4, abs=0.5)
