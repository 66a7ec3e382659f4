"""Tell white sensor noise from gusts in the residuals.

Output error assumes that only the sensors are random. In turbulence the residuals of the air data
contain the gusts, at about 0.1 to 2 Hz, while attitude still agrees. Where this is so,
output-error estimates of the aerodynamics would be biased.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from aerodb.conditioning import BAND
from aerodb.signals import bridge
from aerodb.support import Array

#: Gust speed (rms, m/s) up to which the air counts as calm for identification.
CALM_GUST_SPEED = 0.2


@dataclass(frozen=True)
class ResidualNoise:
    """A residual's rms, its white part (one sigma, from second differences) and its part in
    `BAND` (rms), in the channel's unit."""

    rms: float
    white: float
    gusts: float


def residual_noise(residual: Array, step: float) -> ResidualNoise:
    """Rms, white part and gust part of a residual.

    White noise of standard deviation s has second differences of variance 6 s^2 (idea: Morelli
    1995; statistic: von Neumann 1941).

    Parameters
    ----------
    residual : (n,), nan where not used.
    step : sampling interval [s].

    Raises ValueError without a finite sample.

    >>> round(residual_noise(np.random.default_rng(0).standard_normal(4000), 0.02).white, 1)
    1.0
    """
    good = np.isfinite(residual)
    values = bridge(residual)
    rms = float(np.sqrt(np.mean(values[good] ** 2)))
    white = float(np.sqrt(np.mean(np.diff(values, 2) ** 2) / 6.0))
    centred = values - values.mean()
    power = np.abs(np.fft.rfft(centred)) ** 2
    frequency = np.fft.rfftfreq(len(values), step)
    inside = power[(frequency >= BAND[0]) & (frequency < BAND[1])].sum() / max(power.sum(), 1e-300)
    square = float(np.mean(centred**2))
    return ResidualNoise(rms, white, float(np.sqrt(square * inside)))


@dataclass(frozen=True)
class ProcessNoise:
    """Gust speeds (rms, m/s) by channel: V, alpha, beta for body x, z, y; whether they `matter`,
    and why."""

    gusts: Mapping[str, float]
    matters: bool
    because: str


def process_noise(residuals: Mapping[str, Array], speed: float, step: float) -> ProcessNoise:
    """Return whether the air moved, from the residuals of V, alpha and beta in the gust band.

    Gusts matter when at least two of these channels exceed `CALM_GUST_SPEED` and twice the effect
    of an attitude error of the observed size.

    Parameters
    ----------
    residuals : channel -> (n,), SI, nan where not used.
    speed : mean true airspeed [m/s].
    step : sampling interval [s].
    """
    present = {
        name: residual_noise(values, step)
        for name, values in residuals.items()
        if np.isfinite(values).any()
    }
    channels: tuple[str, ...] = ("V", "alpha", "beta")
    gusts = {
        name: present[name].gusts * (1.0 if name == "V" else speed)
        for name in channels
        if name in present
    }
    wobble = {name: present[name].gusts * speed for name in ("theta", "psi") if name in present}
    rival = {"V": 0.0, "alpha": wobble.get("theta", 0.0), "beta": wobble.get("psi", 0.0)}
    felt = [
        name for name, size in gusts.items() if size > CALM_GUST_SPEED and size > 2.0 * rival[name]
    ]
    figures = ", ".join(f"{name} {size:.2f}" for name, size in gusts.items())
    if len(felt) >= 2:
        because = (
            f"gusts in {' and '.join(felt)} (m/s rms at {BAND[0]:g}-{BAND[1]:g} Hz: {figures})"
        )
        return ProcessNoise(gusts, True, because)
    return ProcessNoise(
        gusts,
        False,
        f"calm air (m/s rms at {BAND[0]:g}-{BAND[1]:g} Hz: {figures or 'no air data'})",
    )
