"""Error spectrum of a corrected flight's channels, from which random errors can be drawn.

The effect of state errors on a result (simulation-extrapolation, Cook & Stefanski, JASA 89, 1994)
depends on their spectrum: an error of alpha that lasts seconds acts differently from white noise of
the same size. Given the data, the truth is the smoothed flight plus the smoother's error, whose
draws are exact under its model; the error of any other estimate is therefore its difference from
the smoothed flight minus such a draw. The periodograms of these errors, averaged over draws and
records in bands of constant ratio, are the spectrum. Channels are drawn independently, except qbar,
which follows V.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, Literal

import numpy as np
from scipy.fft import next_fast_len

from aerodb.consistency.kinematics import INPUTS, STATES
from aerodb.consistency.output_error import inertial_noise
from aerodb.consistency.smoother.smoothed_path import SmoothedPath
from aerodb.consistency.smoother.smoothing import SmoothedFlight
from aerodb.errors import InputError
from aerodb.signals import bridge
from aerodb.support import Array

#: Channels whose error spectrum is estimated.
DESCRIBED: Final = ("V", "alpha", "beta", "phi", "theta", "psi", *INPUTS)

#: Channels of the air data, whose sensors' noise looks like gusts.
AIR: Final = ("V", "alpha", "beta")

#: Estimate of the channels: smoothed; reconstructed path in steady wind; corrected sensors (air
#: data and attitude).
Source = Literal["smoother", "path", "sensor"]

#: Number of bands of the spectrum, with a constant frequency ratio.
_BANDS = 24


@dataclass(frozen=True)
class StateNoise:
    """Error spectrum of the channels of one source.

    source : smoother, path or sensor.
    edges : band edges [Hz]; outside of them the density is zero.
    offset : channel -> one sigma of the error that is constant over a record, SI.
    density : channel -> one-sided power spectral density in each band, unit^2/Hz.
    pressure_slope : error of qbar per error of V [Pa s/m]; zero if the air density is unknown.
    unsteady : air-data channel -> density of its difference from the path in steady wind, the same
        bands and unit. It holds gusts and the sensor's noise, which kinematics cannot tell apart:
        an upper bound of the channel's error, whatever its colour.
    """

    source: Source
    edges: tuple[float, ...]
    offset: Mapping[str, float]
    density: Mapping[str, tuple[float, ...]]
    pressure_slope: float = 0.0
    unsteady: Mapping[str, tuple[float, ...]] = field(default_factory=dict)

    def rms(self, channel: str, low: float = 0.0, high: float = np.inf) -> float:
        """One sigma of a channel's error between two frequencies [Hz], including the constant part
        if `low` is zero."""
        edges = np.clip(np.asarray(self.edges), low, high)
        power = float(np.diff(edges) @ np.asarray(self.density[channel]))
        return float(np.sqrt(power + (self.offset[channel] ** 2 if low == 0.0 else 0.0)))

    def draw(self, rng: np.random.Generator, n: int, step: float) -> dict[str, Array]:
        """Draw one realisation of the errors: channel -> (n,), SI, at intervals of `step` [s].

        It is drawn at twice the length or slightly more, because a Fourier sum is periodic.
        Frequencies outside the edges have no power; those below are in the offset.
        """
        size = next_fast_len(2 * n, real=True)
        frequency = np.fft.rfftfreq(size, step)
        band = np.searchsorted(np.asarray(self.edges), frequency, side="right") - 1
        inside = (band >= 0) & (band < len(self.edges) - 1)
        drawn: dict[str, Array] = {}
        for name, density in self.density.items():
            power = np.where(inside, np.asarray(density)[np.clip(band, 0, len(density) - 1)], 0.0)
            phasor = rng.standard_normal(len(frequency)) + 1j * rng.standard_normal(len(frequency))
            series = np.fft.irfft(phasor * np.sqrt(power * size / (4.0 * step)), size)[:n]
            drawn[name] = np.asarray(series + self.offset[name] * rng.standard_normal())
        if self.pressure_slope > 0:
            drawn["qbar"] = self.pressure_slope * drawn["V"]
        return drawn

    def document(self) -> dict[str, Any]:
        """Return it as JSON, densities in unit²/Hz as in the class; `state_noise_from` reads it
        back."""
        return {
            "source": self.source,
            "edges": list(self.edges),
            "offset": dict(self.offset),
            "density": {name: list(values) for name, values in self.density.items()},
            "pressure_slope": self.pressure_slope,
            "unsteady": {name: list(values) for name, values in self.unsteady.items()},
        }


def state_noise_from(document: Mapping[str, Any]) -> StateNoise:
    """The error spectrum in a document written by `StateNoise.document`."""
    density = {name: tuple(values) for name, values in document["density"].items()}
    return StateNoise(
        document["source"],
        tuple(document["edges"]),
        document["offset"],
        density,
        document["pressure_slope"],
        {name: tuple(values) for name, values in document.get("unsteady", {}).items()},
    )


def state_noise(
    smoothed: SmoothedFlight,
    source: Source = "smoother",
    seed: int = 0,
    own: Mapping[str, Source] | None = None,
) -> StateNoise:
    """Estimate the error spectrum of a flight's channels from the draws of its smoother.

    Parameters
    ----------
    smoothed : from `smooth_flight(..., draws=8)` or more draws.
    source : the estimate whose error is sought; for ``sensor``, channels without a sensor are left
        out.
    seed : of the inertial sensors' noise.
    own : channel -> its estimate, where it is another one than `source`.

    Raises InputError when the flight was smoothed without draws.
    """
    if not smoothed.drawn:
        raise InputError(
            "smoothed without draws",
            f"flight {smoothed.flight}",
            "give smooth_flight draws=8 or more",
        )
    own = own or {}
    generator = np.random.default_rng(seed)
    shortest = min(
        len(entry.path.record.inputs) * entry.path.record.step for entry in smoothed.paths
    )
    highest = max(0.5 / entry.path.record.step for entry in smoothed.paths)
    edges = np.geomspace(0.75 / shortest, highest, _BANDS + 1)
    edges[-1] *= 1.0 + 1e-9  # the band of the highest frequency includes it
    offset: dict[str, float] = {}
    density: dict[str, tuple[float, ...]] = {}
    for name in DESCRIBED:
        power, count, constant = np.zeros(_BANDS), np.zeros(_BANDS), []
        for entry in smoothed.paths:
            for error in _errors(entry, smoothed, name, own.get(name, source), generator):
                constant.append(float(error.mean()) ** 2)
                _add_periodogram(error, entry.path.record.step, edges, power, count)
        if constant:
            offset[name] = float(np.sqrt(np.mean(constant)))
            density[name] = tuple(_filled(power, count))
    unsteady: dict[str, tuple[float, ...]] = {}
    for name in AIR:
        power, count = np.zeros(_BANDS), np.zeros(_BANDS)
        for entry in smoothed.paths:
            series = _from_steady_path(entry, smoothed, name, own.get(name, source))
            if series is not None:
                _add_periodogram(series, entry.path.record.step, edges, power, count)
        if count.any():
            unsteady[name] = tuple(_filled(power, count))
    slopes = [
        entry.path.record.density * entry.path.V
        for entry in smoothed.paths
        if entry.path.record.density is not None
    ]
    slope = float(np.mean(np.concatenate(slopes))) if slopes else 0.0
    return StateNoise(source, tuple(edges.tolist()), offset, density, slope, unsteady)


def _from_steady_path(
    entry: SmoothedPath, smoothed: SmoothedFlight, name: str, source: Source
) -> Array | None:
    """Difference (n,) of an air-data channel of the estimate from the path in steady wind; None
    where no sensor measured the channel."""
    measured = entry.path.residuals.get(name)
    if measured is None or not np.isfinite(measured).any():
        return None
    moved = _channel(entry.path, name) - _channel(entry.steady, name)
    if source == "smoother":
        return moved
    return moved + bridge(measured) / (1.0 + smoothed.values.get(f"{name}_scale", 0.0))


def _errors(
    entry: SmoothedPath,
    smoothed: SmoothedFlight,
    name: str,
    source: Source,
    generator: np.random.Generator,
) -> Iterator[Array]:
    """Random draws (n,) of the error (estimate minus truth) of one channel of one record, at the
    record's own rate."""
    n = len(entry.path.record.inputs)
    at, draws = np.arange(n), entry.draws[name]
    if name in INPUTS:
        white = float(inertial_noise(entry.path.record)[INPUTS.index(name)])
        drift = (
            _channel(entry.steady, name) - _channel(entry.path, name)
            if source != "smoother"
            else np.zeros(n)
        )
        for draw in draws:
            yield drift - np.interp(at, entry.grid, draw) + white * generator.standard_normal(n)
        return
    apart: Array = np.zeros(n)
    if source == "path":
        apart = _channel(entry.steady, name) - _channel(entry.path, name)
        apart = np.angle(np.exp(1j * apart)) if name in ("phi", "psi") else apart
    elif source == "sensor":
        left = entry.path.residuals.get(name, np.full(n, np.nan))
        if not np.isfinite(left).any():
            return
        apart = bridge(left) / (1.0 + smoothed.values.get(f"{name}_scale", 0.0))
    for draw in draws:
        yield (
            apart
            - np.interp(at, entry.grid, draw)
            + entry.within[name] * generator.standard_normal(n)
        )


def _channel(path: Any, name: str) -> Array:
    if name in STATES:
        return np.asarray(path.states[STATES.index(name)])
    return np.asarray(path.inputs[:, INPUTS.index(name)] if name in INPUTS else getattr(path, name))


def _add_periodogram(error: Array, step: float, edges: Array, power: Array, count: Array) -> None:
    """Add a series' one-sided periodogram (Hann window, mean removed) to the sums and counts of the
    bands."""
    n = len(error)
    window = np.hanning(n + 2)[1:-1]
    spectrum = (
        np.abs(np.fft.rfft((error - error.mean()) * window)) ** 2 * 2.0 * step / np.sum(window**2)
    )
    band = np.searchsorted(edges, np.fft.rfftfreq(n, step), side="right") - 1
    good = (band >= 0) & (band < len(power))
    power += np.bincount(band[good], spectrum[good], minlength=len(power))
    count += np.bincount(band[good], minlength=len(power))


def _filled(power: Array, count: Array) -> Array:
    """Mean of each band; bands without a frequency are interpolated from their neighbours."""
    known = np.flatnonzero(count)
    return np.asarray(np.interp(np.arange(len(power)), known, power[known] / count[known]))
