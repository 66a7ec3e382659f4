"""Tables of other axes and of units that several sizes share: what their names do not say is
asked, and nothing is asked where the flight shows the usual signs."""

from pathlib import Path

import numpy as np
import pytest

from aerodb.logs import draft_mapping
from aerodb.storage.readers.tabular import read_tabular
from tests.support.log_tables import T, Tool, c, judged, number, plain, write


def turning(rate: float = 25.0) -> dict[str, np.ndarray]:
    """A flight of coordinated turns and of climbs, with the forces that they take: accelerations
    along x and z are those of its motion."""
    t = np.arange(int(60 * rate)) / rate
    gravity, speed = 9.81, 40.0
    phi = np.deg2rad(25.0) * np.sin(2 * np.pi * t / 20.0 + 1.0)
    beta = np.deg2rad(2.0) * np.sin(2 * np.pi * t / 9.0)
    climb = np.deg2rad(4.0) * np.sin(2 * np.pi * t / 15.0)
    speed = speed - 3.0 * np.sin(2 * np.pi * t / 15.0 - 1.0)
    lift = gravity / np.cos(phi) + speed * np.gradient(climb, t)
    alpha = np.deg2rad(0.4) * lift
    psi = 0.5 + np.cumsum(gravity * np.tan(phi) / speed) / rate
    theta = climb + alpha * np.cos(phi)
    roll, pitch, turn = (np.gradient(angle, t) for angle in (phi, theta, psi))
    q = pitch * np.cos(phi) + turn * np.cos(theta) * np.sin(phi)
    u, w = speed * np.cos(alpha), speed * np.sin(alpha)
    return {
        **{"time": t, "phi": phi, "theta": theta, "psi": psi, "alpha": alpha, "beta": beta},
        "p": roll - turn * np.sin(theta),
        "q": q,
        "r": -pitch * np.sin(phi) + turn * np.cos(theta) * np.cos(phi),
        "altitude": 600.0 + np.cumsum(speed * np.sin(climb)) / rate,
        **{"velocity_down": -speed * np.sin(climb), "V": speed, "ay_imu": -30.0 * beta},
        "ax_imu": np.gradient(u, t) + q * w + gravity * np.sin(theta),
        "az_imu": np.gradient(w, t) - q * u - gravity * np.cos(theta) * np.cos(phi),
    }


#: Column, channel and unit of a table that states units and no signs.
COLUMNS = {
    **{"phi": ("roll [deg]", "deg"), "theta": ("pitch [deg]", "deg"), "psi": ("yaw [deg]", "deg")},
    **{"p": ("p [deg/s]", "deg/s"), "q": ("q [deg/s]", "deg/s"), "r": ("r [deg/s]", "deg/s")},
    **{"alpha": ("alpha [deg]", "deg"), "beta": ("beta [deg]", "deg"), "V": ("tas [m/s]", "m/s")},
    **{"altitude": ("altitude_msl [m]", "m"), "velocity_down": ("v_down [m/s]", "m/s")},
    **{k: (f"{k[:2]} [m/s^2]", "m/s^2") for k in ("ax_imu", "ay_imu", "az_imu")},
}


def signed(against: str, without: str) -> Tool:
    """A table whose channels `against` have the other sign."""
    kept = {k: v for k, v in COLUMNS.items() if k not in without.split()}
    columns = [
        (name, c(k, unit, -1.0 if k in against.split() else 1.0))
        for k, (name, unit) in kept.items()
    ]
    columns += [("time", T)]
    return Tool(tuple(columns), plain, number)


#: Channels with the other sign, columns that are not there, and channels of which one is asked.
SIGNS = [
    ("phi p", "", "phi"),
    ("phi p", "psi", "phi"),
    ("phi", "p psi", "phi"),
    ("theta q", "velocity_down", "theta"),
    ("theta q", "altitude", "theta"),
    ("theta q", "velocity_down altitude", "theta q"),
    ("theta q", "velocity_down altitude phi", "theta q"),
    ("theta q", "velocity_down altitude ax_imu", "theta q"),
    ("theta", "velocity_down altitude q", "theta"),
    ("theta q psi r beta ay_imu az_imu", "velocity_down altitude V", "theta psi q r"),
    ("psi", "", "psi"),
    ("psi r", "", "psi"),
    ("r", "psi", "r"),
    ("alpha", "", "alpha"),
    ("beta", "", "beta"),
    ("theta psi q r beta ay_imu az_imu", "velocity_down", "theta psi q r beta ay_imu"),
]


@pytest.mark.parametrize(("against", "without", "asked"), SIGNS)
def test_the_other_sign_is_asked(tmp_path: Path, against: str, without: str, asked: str) -> None:
    tool = signed(against, without)
    write(tmp_path / "a.csv", tool, turning(), 1)
    guesses = {g.channel: g for g in draft_mapping(read_tabular(tmp_path / "a.csv"), "own").guesses}
    for name in asked.split():
        assert guesses[name].confidence == "asked", guesses[name]


@pytest.mark.parametrize(
    "without", ["", "psi", "altitude", "velocity_down", "r psi", "altitude velocity_down"]
)
def test_nothing_is_asked_about_the_usual_signs(tmp_path: Path, without: str) -> None:
    tool = signed("", without)
    truth = turning()
    write(tmp_path / "a.csv", tool, truth, 1)
    draft = draft_mapping(read_tabular(tmp_path / "a.csv"), "own")
    assert [g for g in draft.guesses if g.confidence == "asked"] == []
    assert judged(tmp_path / "a.csv", tool, truth)["right"] == len(tool.columns)


@pytest.mark.parametrize(
    ("name", "unit", "value", "asked"),
    [
        ("static_pressure", "kPa", 101.3, True),
        ("static_pressure", "mmHg", 760.0, True),
        ("static_pressure", "psi", 14.7, True),
        ("static_pressure", "hPa", 1013.0, False),
        ("static_pressure", "inHg", 29.9, False),
        ("rho", "lb/ft^3", 0.0765, True),
        ("rho", "kg/m^3", 1.2, False),
    ],
)
def test_sizes_that_several_units_share_are_asked(
    tmp_path: Path, name: str, unit: str, value: float, asked: bool
) -> None:
    """The standard atmosphere at sea level, in units that the table does not state."""
    times = np.arange(50) / 10.0
    rows = [f"{t:.1f},{value * (1.0 - 1e-4 * t):.6g}\n" for t in times]
    (tmp_path / "a.csv").write_text(f"time,{name}\n" + "".join(rows))
    (guess,) = draft_mapping(read_tabular(tmp_path / "a.csv"), "own").guesses
    assert (guess.confidence == "asked") is asked, guess
    assert asked or guess.unit == unit


@pytest.mark.parametrize(
    ("beside", "asked"),
    [("sim/flightmodel/position/hpath", True), ("hpath", True), ("course_made_good", False)],
)
def test_the_sideslip_of_xplane_is_asked(tmp_path: Path, beside: str, asked: bool) -> None:
    """It is the heading relative to the path there, which is minus the sideslip."""
    name = "sim/flightmodel/position/beta" if "/" in beside else "beta"
    times = np.arange(100) / 10.0
    rows = [f"{t:.1f},{3.0 * np.sin(t):.4f},{40.0 + t:.2f}\n" for t in times]
    (tmp_path / "a.csv").write_text(f"time,{name},{beside}\n" + "".join(rows))
    guesses = draft_mapping(read_tabular(tmp_path / "a.csv"), "own").guesses
    (beta,) = [guess for guess in guesses if guess.channel == "beta"]
    assert (beta.confidence == "asked") is asked, beta


@pytest.mark.parametrize(
    ("name", "cell"),
    [("iTOW", "{:.0f}"), ("Datum/Uhrzeit", "2024-05-01 10:00:{:06.3f}"), ("time_tow", "{:.0f}")],
)
def test_more_names_of_a_time(tmp_path: Path, name: str, cell: str) -> None:
    stamps = np.arange(100) * 0.05 * (1000.0 if "tow" in name.lower() else 1.0)
    rows = [f"{cell.format(t)},{30.0 + 0.1 * k:.2f}\n" for k, t in enumerate(stamps)]
    (tmp_path / "a.csv").write_text(f"{name},tas_mps\n" + "".join(rows))
    clock = draft_mapping(read_tabular(tmp_path / "a.csv"), "own").clock
    assert clock is not None
    assert (clock.field, clock.unit) == (name, "ms" if "tow" in name.lower() else "s")
