"""Limit the errors of air data and reconstructed flow angles by what they would leave in the
residual.

Without a vane no sensor shows the gusts; the smoother then allows for any gust of the assumed
spectrum. But an angle that is wrong by e moves the prediction by ``dC/dalpha e``, on every axis
that depends on it, and whatever else is wrong comes on top: where the residual of one axis has less
power than that, the error is smaller. This is the bound of errors in variables (Klepper & Leamer,
Econometrica 52(1), 1984), one-sided: a residual that a lacking effect makes larger only loosens it.
docs/method/tracing.md, section 18.
"""

from collections.abc import Collection, Mapping
from dataclasses import replace

import numpy as np

from aerodb.consistency import StateNoise
from aerodb.effects import FlightView
from aerodb.nomenclature import is_surface
from aerodb.support import Array
from aerodb.tracing.evidence.low_pass import band_limited, stretches
from aerodb.tracing.settings import TracingSettings
from aerodb.vehicle import Vehicle


def bounded_noise(
    noise: StateNoise,
    view: FlightView,
    settings: TracingSettings,
    most: float = 1.0,
) -> StateNoise:
    """Return the noise with the density of alpha no larger than the flight's residual allows.

    view : of the flight and the current model. most : largest factor on the power that the smoother
    states; above 1 where all that the residual allows shall count, since the smoother may state too
    little for gusts that no sensor showed. What is constant over the flight stays: the intercepts
    take it. So does the noise of beta: airspeed shows how strong the horizontal gusts are; without
    a vane nothing shows the vertical ones. Power is in [rad²].
    """
    if "alpha" not in noise.density:
        return noise
    power = noise.rms("alpha", noise.edges[0], settings.bandwidth) ** 2
    share = min(most, _share(power, view.slope("alpha"), _residual_power(view, settings)))
    return replace(
        noise,
        density={
            **noise.density,
            "alpha": tuple(share * density for density in noise.density["alpha"]),
        },
    )


def with_deflection_noise(
    noise: StateNoise | None, vehicle: Vehicle, channels: Collection[str], step: float
) -> StateNoise | None:
    """Return the noise with that of the deflections that the vehicle file states
    (``[sensors.delta_...] noise``), rad, as white noise of a log with samples every `step` [s].

    A noisy deflection looks like a surface that does not follow its log: the prediction moves, the
    aircraft does not. None where nothing is stated and nothing was reconstructed.
    """
    stated = {
        name: sensor.noise
        for name, sensor in vehicle.sensors.items()
        if name in channels and is_surface(name) and sensor.noise > 0.0
    }
    if not stated:
        return noise
    if noise is None:
        noise = StateNoise("sensor", (1e-9, 0.5 / step), {}, {})
    bands = len(noise.edges) - 1
    return replace(
        noise,
        offset={**noise.offset, **dict.fromkeys(stated, 0.0)},
        density={
            **noise.density,
            **{name: (2.0 * sigma**2 * step,) * bands for name, sigma in stated.items()},
        },
    )


def _share(power: float, slopes: Mapping[str, Array], residual: Mapping[str, float]) -> float:
    """Smallest ratio, over the axes, of residual power to what the angle's error power (rad^2)
    causes.

    1 where no axis depends on the angle.
    """
    caused = {
        axis: power * float(np.mean(np.square(slopes[axis]))) for axis in residual if axis in slopes
    }
    return min(
        (residual[axis] / caused[axis] for axis in caused if caused[axis] > 0.0), default=1.0
    )


def _residual_power(view: FlightView, settings: TracingSettings) -> dict[str, float]:
    """Axis -> variance of the residual in the band of tracing; axes without a usable stretch are
    absent.
    """
    power = {}
    step = view.step
    for axis, usable in view.usable.items():
        values = np.nan_to_num(view.comparison.residual(axis))
        parts = [
            band_limited([values[part]], usable[part], step, settings.bandwidth)
            for part in stretches(usable, step, settings.bandwidth, settings.order)
        ]
        if parts:
            power[axis] = float(np.concatenate(parts).var())
    return power


def with_air_data_noise(
    noise: StateNoise, view: FlightView, settings: TracingSettings
) -> StateNoise:
    """Return the noise with errors of V, alpha and beta as large as the flight itself allows.

    The smoother takes slow noise of a vane for gusts, and then believes the vane. Two bounds hold
    whatever the colour of the noise is: the channel's difference from the path in steady wind,
    which is small in calm air, and what the residual allows, which is small in gusts that are
    really there, since the aircraft answers to them. The smaller of the two is taken, the
    smoother's own spectrum at least.

    view : of the flight and the current model. Power is in [m²/s²] and [rad²].
    """
    residual = _residual_power(view, settings)
    density = dict(noise.density)
    for name, unsteady in noise.unsteady.items():
        candidate = replace(noise, density={**noise.density, name: unsteady})
        power = candidate.rms(name, noise.edges[0], settings.bandwidth) ** 2
        if name in density and power > 0.0:
            share = min(1.0, _share(power, _slopes(name, view), residual))
            density[name] = tuple(np.maximum(density[name], share * np.asarray(unsteady)).tolist())
    return replace(noise, density=density)


def _slopes(name: str, view: FlightView) -> Mapping[str, Array]:
    """Axis -> change of the residual by the channel (n,); an error of V acts through qbar."""
    if name != "V":
        return view.slope(name)
    return {
        axis: 2.0 * values / view.channels["V"]
        for axis, values in view.comparison.predicted.items()
    }
