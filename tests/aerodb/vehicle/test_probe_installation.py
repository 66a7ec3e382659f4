"""From what an air-data probe shows to V, alpha and beta at the CG; captive flight."""

import numpy as np
import pytest

from aerodb.coefficients.total import total_coefficients
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.logs.captive import flag_captive
from aerodb.nomenclature import FLAGS
from aerodb.storage.files.flights import read_flight, write_flight
from aerodb.vehicle import parse_vehicle
from aerodb.vehicle.five_hole import Curve, FiveHole, flow_angles
from aerodb.vehicle.probe import air_data_at_cg
from tests.support.instrumented_path import BOOM, motion
from tests.support.simulated_path import truth

VEHICLE = """
name = "probed"
[reference]
area = 10.0
chord = 1.0
span = 10.0
[points]
moment_reference = "cg"
air_data = [4.0, 0.0, 0.2]
[air_data]
orientation = ["3 deg", "-2 deg", "1 deg"]
upwash = [0.12, 0.05]
beta = "flank"
[air_data.five_hole.alpha]
slope = "0.08 1/deg"
offset = "0.5 deg"
square = 0.3
cross = 0.4
bend = -0.1
break_angle = "6 deg"
[air_data.five_hole.beta]
slope = 4.2
[mass]
mass = 1000.0
cg = [1.0, 0.0, 0.0]
Ixx = 1000.0
Iyy = 2000.0
Izz = 2500.0
Ixz = 50.0
"""
TIME = 0.02 * np.arange(1000)
MOUNT = {
    "air_data_roll": np.deg2rad(3.0),
    "air_data_pitch": np.deg2rad(-2.0),
    "air_data_yaw": np.deg2rad(1.0),
}


def _shown() -> dict[str, np.ndarray]:
    """What a probe mounted so, off the CG by BOOM, has at its place; flow angles in its own
    axes."""
    return motion(TIME, MOUNT)


def test_pressures_give_the_angles_that_made_them():
    """Forward by the formula written out, over +-25 deg; and the linear case by hand."""
    alpha, beta = np.deg2rad(np.meshgrid(np.linspace(-15, 25, 21), np.linspace(-20, 20, 21)))
    c = Curve(slope=4.6, offset=0.01, square=0.2, cross=-0.3, bend=0.15, break_angle=0.12)
    d = Curve(slope=4.0, square=0.1, cross=0.2)
    over = np.where(alpha > 0.12, alpha - 0.12, np.where(alpha < -0.12, alpha + 0.12, 0.0))
    shown = (
        4.6 * (alpha + 0.01 + 0.2 * alpha**2 - 0.3 * beta**2 + 0.15 * over),
        4.0 * (beta + 0.1 * beta**2 + 0.2 * alpha**2),
    )
    found = flow_angles(
        1500.0 * shown[0],
        1500.0 * shown[1],
        np.full(alpha.shape, 1500.0),
        FiveHole(alpha=c, beta=d),
    )
    np.testing.assert_allclose(found[0], alpha, atol=1e-9)
    np.testing.assert_allclose(found[1], beta, atol=1e-9)
    plain = FiveHole(alpha=Curve(slope=4.0), beta=Curve(slope=5.0))
    assert [
        float(x) for x in flow_angles(np.array(400.0), np.array(-500.0), np.array(1000.0), plain)
    ] == pytest.approx([0.1, -0.1])
    lost = flow_angles(np.array([1.0, 1e6]), np.array([1.0, 1e6]), np.array([0.0, 10.0]), plain)
    assert np.isnan(lost).all()


def test_phoenix_calibration_and_errors_that_differ_to_either_side():
    """alpha = p_da / (K qc) + korr p_db / qc + offset, as DLR's probe of Phoenix was calibrated; and
    straight pieces with one slope above, another below."""
    rng = np.random.default_rng(3)
    p_da, p_db = rng.uniform(-600.0, 900.0, (2, 200))
    qc, gain, other, korr, offset = np.full(200, 1800.0), 4.4, 4.1, 0.012, 0.008
    probe = FiveHole(
        alpha=Curve(slope=gain, across=-korr * other, offset=-offset), beta=Curve(slope=other)
    )
    alpha, beta = flow_angles(p_da, p_db, qc, probe)
    np.testing.assert_allclose(alpha, p_da / (gain * qc) + korr * p_db / qc + offset, atol=1e-9)
    np.testing.assert_allclose(beta, p_db / (other * qc), atol=1e-9)

    x = np.linspace(-0.3, 0.3, 101)
    above, below = np.maximum(x - 0.1, 0.0), np.minimum(x + 0.1, 0.0)
    bent = Curve(slope=gain, bend=0.2, bend_below=-0.15, break_angle=0.1)
    plain = FiveHole(alpha=bent, beta=Curve(slope=other))
    shown = 1800.0 * gain * (x + 0.2 * above - 0.15 * below)
    np.testing.assert_allclose(
        flow_angles(shown, 0.0 * x, np.full(101, 1800.0), plain)[0], x, atol=1e-9
    )


def test_a_boom_mounted_askew_with_upwash_and_a_flank_vane():
    """Alpha and beta at the CG to the last digits from what such a boom shows."""
    vehicle = parse_vehicle(VEHICLE)
    shown, exact = _shown(), truth(TIME)
    vanes = {
        "V": shown["V"],
        "alpha": 1.12 * shown["alpha"],
        "beta": 1.05 * np.arctan(np.tan(shown["beta"]) / np.cos(shown["alpha"])),
    }
    flight = air_data_at_cg(
        Flight("f", "probed", TIME, {**vanes, **{name: exact[name] for name in "pqr"}}), vehicle
    )
    for name in ("V", "alpha", "beta"):
        np.testing.assert_allclose(
            flight[name], exact[name], atol=1e-12 * (60 if name == "V" else 1), err_msg=name
        )
    assert BOOM == (3.0, 0.0, 0.2)  # air_data less the CG
    assert "corrected for the probe as declared in [air_data]" in flight.notes[0]
    assert "transferred from the probe to the CG" in flight.notes[1]


def test_raw_pressures_become_air_data():
    """Without alpha and beta in the log they come from the pressures; a flagged pressure flags
    both."""
    text = VEHICLE.replace("upwash = [0.12, 0.05]", "").replace('beta = "flank"', "")
    vehicle = parse_vehicle(text)
    shown, exact = _shown(), truth(TIME)
    probe = vehicle.air_data.five_hole
    alpha, beta = shown["alpha"], shown["beta"]
    edge = np.deg2rad(6.0)
    over = np.maximum(alpha - edge, 0.0) + np.minimum(alpha + edge, 0.0)
    dp = (
        0.08 * 180 / np.pi * (alpha + np.deg2rad(0.5) + 0.3 * alpha**2 + 0.4 * beta**2 - 0.1 * over)
    )
    channels = {
        "probe_dp_alpha": shown["qbar"] * dp,
        "probe_dp_beta": shown["qbar"] * 4.2 * beta,
        "qbar": shown["qbar"],
    }
    channels |= {"V": shown["V"], **{name: exact[name] for name in "pqr"}}
    raw = Flight("f", "probed", TIME, channels).with_flag(
        "probe_dp_beta", "wild_point", np.arange(1000) == 7
    )
    flight = air_data_at_cg(raw, vehicle)
    assert probe.alpha.slope == pytest.approx(4.58366, abs=1e-5)
    for name in ("alpha", "beta"):
        np.testing.assert_allclose(flight[name], exact[name], atol=1e-8)
        assert np.flatnonzero(~flight.usable((name,))).tolist() == [7]


def test_a_plain_vehicle_changes_nothing():
    plain = parse_vehicle(
        VEHICLE[: VEHICLE.index("air_data =")] + VEHICLE[VEHICLE.index("[mass]") :]
    )
    flight = Flight("f", "probed", TIME, {"alpha": np.zeros(1000), "V": np.ones(1000)})
    assert air_data_at_cg(flight, plain) is flight


def test_what_a_probe_must_be_is_said():
    with pytest.raises(InputError, match=r"air_data.five_hole.alpha.slope.*greater than 0"):
        parse_vehicle(VEHICLE.replace('slope = "0.08 1/deg"', "slope = 0.0"))
    with pytest.raises(InputError, match="did you mean 'upwash'"):
        parse_vehicle(VEHICLE.replace("upwash", "upwas"))


def test_captive_flight_is_no_aerodynamics(tmp_path):
    """From its channel, unknown taken as held, and from declared times; stored and read back;
    kinematics may use it."""
    vehicle = parse_vehicle(
        VEHICLE[: VEHICLE.index("air_data =")] + VEHICLE[VEHICLE.index("[mass]") :]
    )
    exact = truth(TIME)
    channels = {name: exact[name] for name in ("ax", "ay", "az", "p", "q", "r", "qbar")}
    held = np.where(TIME < 5.0, 1.0, 0.0)
    held[260] = np.nan
    flight = flag_captive(
        Flight("f", "probed", TIME, {**channels, "captive": held}), times=[(18.0, 19.0)]
    )
    expected = (TIME < 5.0) | (np.arange(1000) == 260) | ((TIME >= 18.0) & (TIME <= 19.0))
    assert np.array_equal(~flight.usable(), expected)
    assert flight.usable(despite=("captive",)).all()
    both = flight.with_flag("flight", "on_ground", TIME < 1.0)
    assert np.array_equal(~both.usable(despite=("captive",)), TIME < 1.0)
    found = total_coefficients(flight, vehicle)
    assert not found.usable["CZ"][expected].any()
    assert found.usable["CZ"][~expected].all()
    path = tmp_path / "flight.parquet"
    write_flight(path, both)
    assert np.array_equal(read_flight(path).flags["flight"], both.flags["flight"])
    assert both.flags["flight"].max() == FLAGS["captive"] | FLAGS["on_ground"]
    free = Flight("g", "probed", TIME, channels)
    assert flag_captive(free) is free
    assert free.with_flag("q", "gap", TIME < 1.0).flags["q"].dtype == np.uint8


GEAR = """
[[air_data.configurations]]
channel = "delta_landing_gear"
above = 0.5
upwash = [0.18, 0.02]
[air_data.configurations.five_hole.alpha]
slope = "0.075 1/deg"
offset = "0.9 deg"
[air_data.configurations.five_hole.beta]
slope = 4.0
[[air_data.configurations]]
channel = "delta_flap"
above = "10 deg"
upwash = [0.16, 0.05]
"""


def test_a_probe_whose_calibration_depends_on_gear_and_flaps():
    """The gear moves within the flight: each sample is corrected as it was spoiled, by the formulas
    written out. What a configuration does not state stays; the first that holds counts."""
    head, tail = VEHICLE.split("[mass]")
    vehicle = parse_vehicle(
        (head + GEAR + "[mass]" + tail)
        .replace("bend = -0.1\n", "")
        .replace("square = 0.3\ncross = 0.4\n", "")
    )
    shown, exact = _shown(), truth(TIME)
    gear = np.where(TIME > 12.0, 1.0, 0.0)
    flap = np.deg2rad(np.where(TIME > 7.0, 20.0, 0.0))
    clean, flaps = (TIME <= 7.0), (TIME > 7.0) & (TIME <= 12.0)
    upwash = [
        np.select([clean, flaps], [a, b], c) for a, b, c in ((0.12, 0.16, 0.18), (0.05, 0.05, 0.02))
    ]
    alpha = (1.0 + upwash[0]) * shown["alpha"]
    beta = (1.0 + upwash[1]) * np.arctan(np.tan(shown["beta"]) / np.cos(shown["alpha"]))
    slope = 180.0 / np.pi * np.where(gear > 0.5, 0.075, 0.08)
    offset = np.deg2rad(np.where(gear > 0.5, 0.9, 0.5))
    channels = {
        "V": shown["V"],
        "qbar": shown["qbar"],
        "probe_dp_alpha": shown["qbar"] * slope * (alpha + offset),
        "probe_dp_beta": shown["qbar"] * np.where(gear > 0.5, 4.0, 4.2) * beta,
        "delta_landing_gear": gear,
        "delta_flap": flap,
        **{name: exact[name] for name in "pqr"},
    }
    flight = air_data_at_cg(Flight("f", "probed", TIME, channels), vehicle)
    for name in ("alpha", "beta"):
        np.testing.assert_allclose(flight[name], exact[name], atol=1e-9, err_msg=name)
    assert not [note for note in flight.notes if "taken as" in note]

    plain = parse_vehicle(
        VEHICLE.replace("bend = -0.1\n", "").replace("square = 0.3\ncross = 0.4\n", "")
    )
    one = air_data_at_cg(Flight("f", "probed", TIME, channels), plain)
    assert np.abs(one["alpha"] - exact["alpha"])[clean].max() < 1e-9
    assert np.abs(one["alpha"] - exact["alpha"])[gear > 0.5].min() > 0.003

    del channels["delta_landing_gear"]
    told = air_data_at_cg(Flight("f", "probed", TIME, channels), vehicle)
    assert "delta_landing_gear not logged: the probe is taken as without" in " ".join(told.notes)
    assert np.abs(told["alpha"] - exact["alpha"])[clean].max() < 1e-9


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (GEAR.replace("delta_landing_gear", "delta_gaer!"), "gaer"),
        (GEAR.replace("above = 0.5\n", ""), "state above, below or both"),
        (
            GEAR.replace('above = "10 deg"\nupwash = [0.16, 0.05]', "above = 1"),
            "it changes nothing",
        ),
    ],
)
def test_a_configuration_that_tells_nothing_is_refused(wrong, said):
    head, tail = VEHICLE.split("[mass]")
    with pytest.raises(InputError) as error:
        parse_vehicle(head + wrong + "[mass]" + tail)
    assert said in str(error.value)
