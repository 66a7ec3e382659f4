"""Turbulence and discrete gusts: spectra, covariances and series along a straight path.

The air is a frozen field that the aircraft flies through at the airspeed V: a gust with the scale L
changes with the distance over L. Components are ``u v w`` in body axes [m/s] and ``p q r``, the
rotation of the air over the span b [rad/s], to which the damping of the aircraft answers:

- u, v, w: Dryden's or von Karman's spectra (MIL-F-8785C, 1980, 3.7.1.1 and 3.7.1.2);
- q, r: how w and v change along the path, ``q = -dw/dx`` and ``r = dv/dx``, behind lags of
  ``4 b / (pi V)`` and ``3 b / (pi V)`` (MIL-F-8785C, 3.7.5);
- p: a first-order process, independent of w, with ``1.9 sigma_w / sqrt(L b)`` and the bandwidth
  ``2.6 V / sqrt(L b)`` (Yeager, NASA CR-1998-206937, table 1), within 15 % of 3.7.5 in intensity.

`gust_density` and `gust_covariance` are these in closed form, `gust_series` draws series that have
them exactly at their samples, and `DrydenGusts` those of flights whose speed and height change.
"""

from dataclasses import dataclass
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from aerodb.signals import first_order_lag
from aerodb.support import Array

Form = Literal["dryden", "von_karman"]
FORMS: Final[tuple[str, ...]] = get_args(Form)
#: Components of the velocity of moving air.
GUST_VELOCITIES: Final = ("gust_u", "gust_v", "gust_w")

_FOOT = 0.3048
#: Scale length of gusts above 2000 ft [m], 1750 ft (MIL-F-8785C, 1980, 3.7.2.1).
HIGH_ALTITUDE_LENGTH: Final = 1750.0 * _FOOT
#: One sigma of the air's roll rate in ``sigma_w / sqrt(L b)`` (Yeager, NASA CR-1998-206937, table
#: 1).
_ROLL_SIZE: Final = 1.9
#: Bandwidth of the air's roll rate in ``V / sqrt(L b)`` (the same table).
_ROLL_BANDWIDTH: Final = 2.6
#: Lag of the air's pitch rate behind the gust's rate of change, in spans over (pi V) (MIL-F-8785C,
#: 3.7.5).
PITCH_LAG: Final = 4.0
#: The same of the air's yaw rate.
YAW_LAG: Final = 3.0
#: Distance in scale lengths between two series that are independent.
_APART: Final = 12.0
#: Ratio of von Karman's length to that of his spectrum (MIL-F-8785C, 3.7.1.1).
_KARMAN: Final = 1.339


@dataclass(frozen=True)
class Turbulence:
    """Turbulence of one form: `lengths` L [m] and `intensities` sigma [m/s] of u, v and w."""

    form: Form
    lengths: tuple[float, float, float]
    intensities: tuple[float, float, float]


def turbulence_at(form: Form, height: float, wind_at_6m: float) -> Turbulence:
    """Return the turbulence of the specification at a `height` above ground [m], for the steady
    wind 6 m above ground [m/s]; see `dryden_scales`."""
    lengths, sigma = dryden_scales(np.array([height]), np.array([wind_at_6m]))
    return Turbulence(form, tuple(lengths[:, 0].tolist()), tuple(sigma[:, 0].tolist()))


def gust_density(
    form: Form, component: str, omega: Array, speed: float, length: float, sigma: float = 1.0
) -> Array:
    """Return the one-sided spectrum (n,) of gust u, v or w at `omega` [rad/s], in (m/s)^2/Hz.

    speed : airspeed [m/s]. length : L [m]. sigma : intensity [m/s]. MIL-F-8785C, 3.7.1, whose
    spectra are per rad/m.

    >>> x = gust_density("dryden", "u", np.array([0.0]), 50.0, 500.0)
    >>> bool(np.isclose(x[0], 4.0 * 500.0 / 50.0))
    True
    """
    scale = 2.0 * length / speed * sigma**2
    if form == "dryden":
        x = np.square(omega * length / speed)
        if component == "u":
            return np.asarray(2.0 * scale / (1.0 + x))
        return np.asarray(scale * (1.0 + 3.0 * x) / (1.0 + x) ** 2)
    x = np.square(_KARMAN * omega * length / speed)
    if component == "u":
        return np.asarray(2.0 * scale / (1.0 + x) ** (5.0 / 6.0))
    return np.asarray(scale * (1.0 + 8.0 / 3.0 * x) / (1.0 + x) ** (11.0 / 6.0))


def gust_covariance(form: Form, component: str, distance: Array) -> Array:
    """Return the correlation (n,) of gust u, v or w at two places `distance` scale lengths apart.

    It is the transform of `gust_density`; von Karman's holds Bessel functions (Hinze, Turbulence
    (1975), section 3.4).

    >>> [round(float(x), 6) for x in gust_covariance("von_karman", "w", np.array([0.0, 1.0]))]
    [1.0, 0.196511]
    """
    apart = np.abs(distance)
    if form == "dryden":
        fall = np.exp(-apart)
        return np.asarray(fall if component == "u" else fall * (1.0 - 0.5 * apart))
    from scipy.special import gamma, kv  # slow to import

    x = np.maximum(apart / _KARMAN, 1e-12)
    first = x ** (1.0 / 3.0) * kv(1.0 / 3.0, x)
    if component != "u":
        first = first - 0.5 * x ** (4.0 / 3.0) * kv(2.0 / 3.0, x)
    return np.asarray(2.0 ** (2.0 / 3.0) / gamma(1.0 / 3.0) * first)


def roll_density(omega: Array, speed: float, length: float, span: float) -> Array:
    """Return the one-sided spectrum (n,) [(rad/s)^2/Hz] of the air's roll rate per (m/s)^2 of the
    vertical gusts, at `omega` [rad/s]. speed : [m/s]. length : of vertical gusts [m]. span : [m].
    """
    square, time = _roll(speed, length, span)
    return np.asarray(square * 4.0 * time / (1.0 + (omega * time) ** 2))


def rotation_gain(omega: Array, speed: float, span: float, lag: float) -> Array:
    """Return the factor (n,) [1/s^2] by which the spectrum of a gust's angle becomes that of the
    air's pitch (`PITCH_LAG`) or yaw rate (`YAW_LAG`), at `omega` [rad/s]. span : [m]."""
    return np.asarray(omega**2 / (1.0 + (lag * span * omega / (np.pi * speed)) ** 2))


def _roll(speed: float, length: float, span: float) -> tuple[float, float]:
    """Variance of the air's roll rate per (m/s)^2 of the gusts, and its time constant [s]."""
    root = np.sqrt(length * span)
    return _ROLL_SIZE**2 / (length * span), float(root / (_ROLL_BANDWIDTH * speed))


def gust_series(
    air: Turbulence, time: Array, speed: float, span: float, seed: int
) -> dict[str, Array]:
    """Return a series (n,) of each of `GUST_VELOCITIES` [m/s] and of gust_p, gust_q, gust_r
    [rad/s].

    time : (n,) [s], uniform. speed : airspeed [m/s]. span : [m].

    Series are Gaussian with the covariance of the closed form at all lags, by circulant embedding
    (Davies & Harte, Biometrika 74, 1987); q and r are filtered from w and v.
    """
    step, n = float(time[1] - time[0]), len(time)
    generator = np.random.default_rng(seed)
    longest = max(*air.lengths, float(np.sqrt(air.lengths[2] * span)))
    size = 1 << int(np.ceil(np.log2(n + _APART * longest / (speed * step) + 2)))
    lags = np.minimum(np.arange(size), size - np.arange(size)) * step
    omega = 2.0 * np.pi * np.fft.rfftfreq(size, step)
    square, roll_time = _roll(speed, air.lengths[2], span)

    def drawn(covariance: Array) -> NDArray[np.complex128]:
        power = np.maximum(np.fft.rfft(covariance).real, 0.0)
        return np.asarray(np.sqrt(power) * np.fft.rfft(generator.standard_normal(size)))

    waves = {
        name: drawn(sigma**2 * gust_covariance(air.form, name[-1], speed * lags / length))
        for name, length, sigma in zip(GUST_VELOCITIES, air.lengths, air.intensities, strict=True)
    }
    waves["gust_p"] = drawn(air.intensities[2] ** 2 * square * np.exp(-lags / roll_time))
    for name, of, sign, lag in (
        ("gust_q", "gust_w", -1.0, PITCH_LAG),
        ("gust_r", "gust_v", 1.0, YAW_LAG),
    ):
        filtered = 1j * omega / (1.0 + 1j * omega * lag * span / (np.pi * speed))
        waves[name] = waves[of] * filtered * sign / speed
    return {name: np.fft.irfft(wave, size)[:n] for name, wave in waves.items()}


@dataclass(frozen=True)
class DiscreteGust:
    """A 1-cosine gust, ``U/2 (1 - cos(pi s / H))`` over the distance s from 0 to 2 H.

    component : one of `GUST_VELOCITIES`. amplitude : U [m/s]. gradient : H [m]. start : [s].

    References
    ----------
    MIL-F-8785C (1980), 3.7.1.3, whose gust stays at its peak; CS 25.341 (a), which this one is.
    """

    component: str
    amplitude: float
    gradient: float
    start: float

    def series(self, time: Array, speed: float, span: float) -> dict[str, Array]:
        """Return the gust (n,) [m/s], and of v and w the rate (n,) [rad/s] at which it turns the
        air. time : (n,) [s]. speed : airspeed [m/s]. span : [m]."""
        phase = np.clip((time - self.start) * speed / self.gradient, 0.0, 2.0) * np.pi
        gust = 0.5 * self.amplitude * (1.0 - np.cos(phase))
        found = {self.component: gust}
        turning = {"gust_w": ("gust_q", -1.0, PITCH_LAG), "gust_v": ("gust_r", 1.0, YAW_LAG)}
        if self.component in turning:
            name, sign, lag = turning[self.component]
            slope = 0.5 * self.amplitude * np.pi / self.gradient * np.sin(phase)
            step = float(time[1] - time[0])
            found[name] = sign * first_order_lag(slope, step, lag * span / (np.pi * speed))
        return found


def dryden_scales(height: Array, wind_at_6m: Array) -> tuple[Array, Array]:
    """Return scale lengths and intensities of the gusts u, v, w.

    Below 1000 ft this is the low-altitude model. Above 2000 ft, L = 1750 ft with the intensity at
    the upper end of the low-altitude model; in between, L is linear.

    Parameters
    ----------
    height : (k,), above ground [m]
    wind_at_6m : (k,), steady wind 6 m (20 ft) above ground [m/s]; 15 kt is light, 30 kt moderate
        turbulence

    Returns
    -------
    lengths : (3, k), L [m]
    intensities : (3, k), sigma [m/s]

    References
    ----------
    MIL-F-8785C (1980), 3.7.1 and 3.7.3; MIL-HDBK-1797 for the transition.
    """
    h = np.clip(height / _FOOT, 10.0, 1000.0)
    shape = 0.177 + 0.000823 * h
    sigma_w = 0.1 * wind_at_6m
    low_length, low_sigma = h / shape**1.2, sigma_w / shape**0.4
    fade = np.clip((height / _FOOT - 1000.0) / 1000.0, 0.0, 1.0)
    horizontal = low_length + fade * (HIGH_ALTITUDE_LENGTH / _FOOT - low_length)
    vertical = h + fade * (HIGH_ALTITUDE_LENGTH / _FOOT - h)
    lengths = _FOOT * np.array([horizontal, horizontal, vertical])
    return lengths, np.array([low_sigma, low_sigma, sigma_w + 0 * h])


@dataclass
class DrydenGusts:
    """Gust velocities u, v, w in body axes as white noise through Dryden's forming filters.

    The filters are discretised exactly for the airspeed and scale length of each step, including
    the covariance of the noise, so that the intensity does not depend on the step. The filter of u
    is 1 / (1 + tau s), that of v and w (1 + sqrt(3) tau s) / (1 + tau s)^2, with tau = L / V.

    Parameters
    ----------
    wind_at_6m : (k,), steady wind 6 m above ground [m/s]
    generator : source of the noise

    References
    ----------
    MIL-F-8785C (1980), 3.7.1.2.
    """

    wind_at_6m: Array
    generator: np.random.Generator

    def __post_init__(self) -> None:
        k = self.wind_at_6m.shape[0]
        # Unit-variance states in their stationary distribution: u; then the two cascaded lags of v
        # and of w.
        self._u: Array = self.generator.standard_normal((k,))
        self._first = self.generator.standard_normal((2, k))
        self._second = 0.5 * self._first + 0.5 * self.generator.standard_normal((2, k))

    def advance(self, step: float, airspeed: Array, height: Array) -> Array:
        """Return the gusts (3, k) [m/s] after one more step.

        Parameters
        ----------
        step : float, [s]
        airspeed : (k,) [m/s]
        height : (k,), above ground [m]
        """
        lengths, sigma = dryden_scales(height, self.wind_at_6m)
        ratio = step * airspeed / lengths
        decay = np.exp(-ratio)
        k = airspeed.shape[0]
        self._u = decay[0] * self._u + np.sqrt(1 - decay[0] ** 2) * self.generator.standard_normal(
            k
        )
        # Stationary covariance P = [[1, 1/2], [1/2, 1/2]]; the noise of one step has the covariance
        # P - F P F', with F = d [[1, 0], [x, 1]].
        x, d2 = ratio[1:], decay[1:] ** 2
        q11 = 1 - d2
        q12 = 0.5 - d2 * (x + 0.5)
        q22 = 0.5 - d2 * (x * x + x + 0.5)
        root11 = np.sqrt(q11)
        root21 = q12 / root11
        root22 = np.sqrt(np.maximum(q22 - root21**2, 0.0))
        noise = self.generator.standard_normal((2, 2, k))
        second = (
            decay[1:] * (self._second + x * self._first) + root21 * noise[0] + root22 * noise[1]
        )
        self._first = decay[1:] * self._first + root11 * noise[0]
        self._second = second
        lateral = (np.sqrt(3.0) * self._first + (1 - np.sqrt(3.0)) * self._second) / np.sqrt(2.0)
        result: Array = sigma * np.concatenate([self._u[None], lateral])
        return result
