"""Turbulence against the specification's formulas, JSBSim's turbulence, and its own series."""

from pathlib import Path

import jsbsim
import numpy as np
import pytest
from scipy.signal import csd, welch

from aerodb.physics import (
    PITCH_LAG,
    YAW_LAG,
    DiscreteGust,
    Turbulence,
    gust_covariance,
    gust_density,
    gust_series,
    roll_density,
    rotation_gain,
)

FOOT = 0.3048
SPEED, SPAN = 60.0, 11.0
AIR = Turbulence("dryden", (400.0, 350.0, 300.0), (1.6, 1.4, 1.2))
#: A mass without aerodynamics, which a force carries against gravity: JSBSim's air alone is seen.
MASS = """<?xml version="1.0"?>
<fdm_config name="mass" version="2.0">
<metrics><wingarea unit="FT2">100</wingarea><wingspan unit="FT">36</wingspan><chord unit="FT">5</chord>
<htailarea unit="FT2">0</htailarea><htailarm unit="FT">0</htailarm><vtailarea unit="FT2">0</vtailarea>
<vtailarm unit="FT">0</vtailarm><location name="AERORP" unit="IN"><x>0</x><y>0</y><z>0</z></location></metrics>
<mass_balance><ixx unit="SLUG*FT2">1e7</ixx><iyy unit="SLUG*FT2">1e7</iyy><izz unit="SLUG*FT2">1e7</izz>
<emptywt unit="LBS">1e5</emptywt><location name="CG" unit="IN"><x>0</x><y>0</y><z>0</z></location></mass_balance>
<ground_reactions/><propulsion/>
<external_reactions><force name="lift" frame="LOCAL"><location unit="IN"><x>0</x><y>0</y><z>0</z></location>
<direction><x>0</x><y>0</y><z>-1</z></direction></force></external_reactions>
<aerodynamics><axis name="LIFT"/></aerodynamics>
</fdm_config>"""


def _specification(form: str, component: str, wave: np.ndarray, length: float) -> np.ndarray:
    """MIL-F-8785C, 3.7.1.1 and 3.7.1.2, per rad/m for an intensity of 1 m/s, one-sided."""
    if form == "dryden":
        x = (length * wave) ** 2
        if component == "u":
            return 2 * length / np.pi / (1 + x)
        return length / np.pi * (1 + 3 * x) / (1 + x) ** 2
    x = (1.339 * length * wave) ** 2
    if component == "u":
        return 2 * length / np.pi / (1 + x) ** (5 / 6)
    return length / np.pi * (1 + 8 / 3 * x) / (1 + x) ** (11 / 6)


@pytest.mark.parametrize("form", ["dryden", "von_karman"])
@pytest.mark.parametrize("component", ["u", "v", "w"])
def test_spectra_and_covariances_are_the_specifications(form: str, component: str) -> None:
    """The spectrum per Hz is that per rad/m times 2 pi/V; its transform is the covariance."""
    omega = np.geomspace(1e-3, 50.0, 200)
    density = gust_density(form, component, omega, SPEED, 300.0, 2.0)
    expected = 4.0 * _specification(form, component, omega / SPEED, 300.0) * 2 * np.pi / SPEED
    assert density == pytest.approx(expected, rel=1e-12)
    # The transform of the covariance, on lags that are dense and long enough.
    step = 0.02
    lags = step * np.arange(200_000)
    covariance = 4.0 * gust_covariance(form, component, SPEED * lags / 300.0)
    for k in (0.2, 1.0, 3.0):
        integral = 4.0 * np.trapezoid(covariance * np.cos(k * lags), lags)
        exact = gust_density(form, component, np.array([k]), SPEED, 300.0, 2.0)[0]
        assert integral == pytest.approx(exact, rel=0.02)


def test_rotation_of_the_air_is_the_specifications() -> None:
    """3.7.5: Phi_q = W^2/(1 + (4 b W/pi)^2) Phi_w with W = omega/V, 3 b for r; the intensity of p
    is within 15 % of 0.8 (pi L/4b)^(1/3) / (1 + (4 b W/pi)^2) sigma^2/L."""
    omega = np.geomspace(1e-2, 50.0, 100)
    wave = omega / SPEED
    for lag in (PITCH_LAG, YAW_LAG):
        ours = rotation_gain(omega, SPEED, SPAN, lag) / SPEED**2
        assert ours == pytest.approx(wave**2 / (1 + (lag * SPAN * wave / np.pi) ** 2))
    ratio = (np.pi * 533.4 / 4 / SPAN) ** (1 / 3)
    variance = 0.8 * ratio / 533.4 * np.pi**2 / (8 * SPAN)
    frequency = np.linspace(0, 200.0, 200_000)
    ours = np.trapezoid(roll_density(2 * np.pi * frequency, SPEED, 533.4, SPAN), frequency)
    assert np.sqrt(ours / variance) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("form", ["dryden", "von_karman"])
def test_series_have_the_spectra(form: str) -> None:
    """u, v, w and p, q, r of a long series by Welch's estimate; q and r follow from w and v."""
    air = Turbulence(form, AIR.lengths, AIR.intensities)  # type: ignore[arg-type]
    step = 0.02
    time = step * np.arange(400_000)
    series = gust_series(air, time, SPEED, SPAN, seed=3)
    expected = {}
    for name, sigma in zip(("gust_u", "gust_v", "gust_w"), air.intensities, strict=True):
        assert series[name].std() == pytest.approx(sigma, rel=0.03)
    frequency, _ = welch(series["gust_u"], 1 / step, nperseg=8192)
    omega = 2 * np.pi * frequency
    for name, length, sigma in zip("uvw", air.lengths, air.intensities, strict=True):
        expected[f"gust_{name}"] = gust_density(air.form, name, omega, SPEED, length, sigma)
    expected["gust_p"] = air.intensities[2] ** 2 * roll_density(omega, SPEED, air.lengths[2], SPAN)
    for name, of, lag in (("q", "w", PITCH_LAG), ("r", "v", YAW_LAG)):
        gain = rotation_gain(omega, SPEED, SPAN, lag) / SPEED**2
        expected[f"gust_{name}"] = expected[f"gust_{of}"] * gain
    band = (frequency > 0.02) & (frequency < 2.0)
    for name, model in expected.items():
        _, density = welch(series[name], 1 / step, nperseg=8192)
        assert np.mean(density[band] / model[band]) == pytest.approx(1.0, abs=0.05), name
    assert np.corrcoef(series["gust_w"], series["gust_v"])[0, 1] == pytest.approx(0, abs=0.05)
    slow = (frequency > 0.02) & (frequency < 0.3)
    for name, of, sign in (("gust_q", "gust_w", -1.0), ("gust_r", "gust_v", 1.0)):
        slope = sign * np.gradient(series[of], step) / SPEED
        _, together = csd(slope, series[name], 1 / step, nperseg=8192)
        assert np.abs(np.angle(together[slow])).max() < 0.5


@pytest.fixture(scope="module")
def jsbsim_air(tmp_path_factory: pytest.TempPathFactory) -> dict[str, np.ndarray]:
    """What JSBSim's Milspec turbulence blows at 20000 ft and 300 ft/s: 4000 s at 50 Hz, SI. Type 4
    is discretised after Tustin; type 3 has 26 to 45 % too much of v, w, q, r above 0.1 Hz."""
    folder: Path = tmp_path_factory.mktemp("mass")
    (folder / "aircraft" / "mass").mkdir(parents=True)
    (folder / "aircraft" / "mass" / "mass.xml").write_text(MASS)
    jsbsim.FGJSBBase().debug_lvl = 0
    flown = jsbsim.FGFDMExec(str(folder))
    flown.load_model("mass")
    flown.set_dt(0.02)
    start = {"ic/h-sl-ft": 20000, "ic/u-fps": 300, "ic/lat-geod-deg": 0, "ic/long-gc-deg": 0}
    for name, value in start.items():
        flown[name] = value
    flown.run_ic()
    flown["atmosphere/turbulence/milspec/windspeed_at_20ft_AGL-fps"] = 50
    flown["atmosphere/turbulence/milspec/severity"] = 4
    flown["atmosphere/turb-type"] = 4
    names = [f"atmosphere/turb-{axis}-fps" for axis in ("north", "east", "down")]
    names += [f"atmosphere/{rate}-turb-rad_sec" for rate in "pqr"]
    names += ["velocities/vt-fps", "position/h-sl-ft"]
    kept = np.zeros((200_000, len(names)))
    for row in kept:
        sunk = 20000.0 - flown["position/h-sl-ft"]
        rising = flown["velocities/h-dot-fps"]
        flown["external_reactions/lift/magnitude"] = (
            flown["inertia/weight-lbs"] + 280.0 * sunk - 1300.0 * rising
        )
        flown.run()
        row[:] = [flown[name] for name in names]
    assert np.abs(kept[:, 7] - 20000.0).max() < 2000.0
    short = ("gust_u", "gust_v", "gust_w", "gust_p", "gust_q", "gust_r")
    scale = np.array([FOOT] * 3 + [1.0] * 3)
    return {
        **dict(zip(short, (kept[:, :6] * scale).T, strict=True)),
        "V": kept[:, 6] * FOOT,
    }


def test_spectra_are_those_of_jsbsims_milspec(jsbsim_air: dict[str, np.ndarray]) -> None:
    """JSBSim draws Dryden's u, v, w and Yeager's p with L = 1750 ft, from other code."""
    speed, length, span = float(jsbsim_air["V"].mean()), 1750.0 * FOOT, 36.0 * FOOT
    sigma = jsbsim_air["gust_w"].std()
    frequency, _ = welch(jsbsim_air["gust_u"], 50.0, nperseg=8192)
    omega = 2 * np.pi * frequency
    expected = {
        f"gust_{name}": gust_density("dryden", name, omega, speed, length, sigma) for name in "uvw"
    }
    expected["gust_p"] = sigma**2 * roll_density(omega, speed, length, span)
    for name, of, lag in (("q", "w", PITCH_LAG), ("r", "v", YAW_LAG)):
        gain = rotation_gain(omega, speed, span, lag) / speed**2
        expected[f"gust_{name}"] = expected[f"gust_{of}"] * gain
    for low, high in ((0.02, 0.1), (0.1, 0.5), (0.5, 2.0)):
        band = (frequency > low) & (frequency < high)
        for name, model in expected.items():
            _, density = welch(jsbsim_air[name], 50.0, nperseg=8192)
            ratio = float(np.mean(density[band] / model[band]))
            assert ratio == pytest.approx(1.0, abs=0.1), (name, low, high)


def test_a_discrete_gust_is_one_minus_cosine_and_turns_the_air() -> None:
    gust = DiscreteGust("gust_w", 8.0, 60.0, 2.0)
    time = 0.01 * np.arange(1000)
    series = gust.series(time, SPEED, SPAN)
    w = series["gust_w"]
    assert w[[200, 250, 300, 400]] == pytest.approx([0.0, 4.0, 8.0, 0.0], abs=1e-9)
    assert np.trapezoid(w, time) == pytest.approx(8.0)  # U/2 times its length over V
    # What turns the air, integrated, is zero; its size is that of the lagged slope.
    assert np.trapezoid(series["gust_q"], time) == pytest.approx(0.0, abs=1e-3)
    lag = PITCH_LAG * SPAN / (np.pi * SPEED)
    rate = np.pi * SPEED / 60.0
    assert np.abs(series["gust_q"]).max() == pytest.approx(
        8.0 / 2 * np.pi / 60.0 / np.sqrt(1 + (rate * lag) ** 2), rel=0.2
    )
