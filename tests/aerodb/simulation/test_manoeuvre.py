"""Described manoeuvres: their shapes, and what is wrong in a file."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.simulation import parse_manoeuvre

TIME = np.arange(0.0, 20.0, 0.005)
START = '[trim]\nV = "120 kt"\naltitude = "5000 ft"\n'


def described(shape: str, **more: str) -> str:
    lines = {"target": '"delta_elevator"', "shape": f'"{shape}"', "amplitude": '"2 deg"', **more}
    return START + "[[input]]\n" + "\n".join(f"{name} = {value}" for name, value in lines.items())


def moved(text: str) -> np.ndarray:
    return np.rad2deg(parse_manoeuvre(text).series(TIME)["delta_elevator"])


def test_units_are_converted() -> None:
    manoeuvre = parse_manoeuvre(START)
    assert pytest.approx(61.733, abs=1e-3) == manoeuvre.condition.V
    assert manoeuvre.condition.altitude == pytest.approx(1524.0)
    assert manoeuvre.condition.climb == 0.0
    assert parse_manoeuvre(START + "glide = true").condition.climb is None


def test_moving_air_is_that_of_the_file() -> None:
    text = START + '[turbulence]\nwind_at_6m = "15 kt"\nform = "von_karman"\nseed = 4\n'
    still = parse_manoeuvre(START)
    assert still.air(TIME, 10.0) == {}
    manoeuvre = parse_manoeuvre(text + '[[gust]]\ncomponent = "u"\namplitude = 9\ngradient = 30')
    air = manoeuvre.air(TIME, 10.0)
    without = parse_manoeuvre(text).air(TIME, 10.0)
    assert set(air) == {f"gust_{name}" for name in "uvwpqr"}
    added = air["gust_u"] - without["gust_u"]
    assert added.max() == pytest.approx(9.0, rel=1e-3)
    np.testing.assert_array_equal(air["gust_w"], without["gust_w"])
    # 5000 ft are above the low-altitude model: L = 1750 ft, sigma_w = 0.1 of the wind.
    assert manoeuvre.turbulence is not None
    assert manoeuvre.turbulence.lengths == pytest.approx([1750 * 0.3048] * 3)
    assert manoeuvre.turbulence.intensities[2] == pytest.approx(0.1 * 15 * 0.514444, rel=1e-5)


def test_pulses_have_their_widths_and_signs() -> None:
    pulse = moved(described("3211", start="2", width='"0.5 s"'))
    for at, value in ((1.9, 0.0), (3.4, 2.0), (3.6, -2.0), (4.6, 2.0), (5.1, -2.0), (5.6, 0.0)):
        assert pulse[np.searchsorted(TIME, at)] == pytest.approx(value), at
    step = moved(described("step", start="2"))
    assert step[-1] == pytest.approx(2.0)
    assert step[0] == 0.0


def test_a_sweep_runs_through_its_band() -> None:
    sweep = moved(described("sweep", start="0", duration="20", band='["0.2 Hz", "2 Hz"]'))
    crossings = TIME[1:][np.diff(np.sign(sweep)) > 0]
    # Period at a time t: 1 / (0.2 * 10^(t / 20)).
    middle = np.diff(crossings)
    expected = 1.0 / (0.2 * 10.0 ** (0.5 * (crossings[1:] + crossings[:-1]) / 20.0))
    np.testing.assert_allclose(middle, expected, rtol=0.02)
    assert np.abs(sweep).max() == pytest.approx(2.0, abs=1e-3)


def test_a_multisine_has_its_band_only_and_a_low_peak() -> None:
    wave = moved(described("multisine", start="0", duration="20", band='["0.2 Hz", "2 Hz"]'))
    power = np.abs(np.fft.rfft(wave)) ** 2
    frequency = np.fft.rfftfreq(len(wave), 0.005)
    band = (frequency > 0.19) & (frequency < 2.01)
    assert power[band].sum() > 0.999 * power.sum()
    rms = float(np.sqrt(np.mean(wave**2)))
    assert rms == pytest.approx(2.0 / np.sqrt(2.0), rel=1e-3)
    assert np.abs(wave).max() / rms < 2.2  # a sine has 1.41, equal phases 8.6


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no \\[trim\\]"),
        ("x = ", "no TOML"),
        (START + "Vv = 3", "unknown key 'Vv'"),
        (described("dublet"), "unknown shape 'dublet'"),
        (described("sweep"), "has no band"),
        (described("sweep", band='["2 Hz", "1 Hz"]'), "band 2 to 1 Hz"),
        (described("doublet", width="0"), "width is 0"),
        (described("doublet", amplitude='"2 kg"'), "kg"),
        ('duration = "2 h"\n' + START, "lasts 7200 s"),
        (START + "[turbulence]\nseed = 1", "either intensity or wind_at_6m"),
        (START + '[turbulence]\nform = "karman"', "unknown form 'karman'"),
        (START + "[turbulence]\nintensity = [1, 2]", "2 values"),
        (START + "[turbulence]\nintensity = 1\nseed = -1", "seed is -1"),
        (START + "[turbulence]\nintensity = 1\nscale = 0", "not positive"),
        (START + "ground = true\n[turbulence]\nintensity = 1", "a start in flight"),
        (START + '[[gust]]\ncomponent = "x"\namplitude = 1\ngradient = 2', "component 'x'"),
        (START + '[[gust]]\ncomponent = "w"\namplitude = 1', "has no gradient"),
    ],
)
def test_wrong_manoeuvres_are_named(text: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        parse_manoeuvre(text)
