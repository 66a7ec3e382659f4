"""The error of a consistent flight's channels as a process in time: one sigma and colour, from
which more of it can be drawn.

Whoever asks what the states' own error does to a result (simulation-extrapolation, Cook &
Stefanski, JASA 89, 1994) needs errors with the right spectrum: alpha that is wrong for seconds acts
otherwise than white noise of the same size. The truth given the data is the smoothed flight plus
the smoother's error, whose draws are exact under its model; so the error of any other estimate is
its difference from the smoothed flight, less such a draw. Their periodograms, averaged over draws
and records in bands of constant ratio, are the spectrum. Channels are drawn independently, but for
qbar, which follows V.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np
from scipy.fft import next_fast_len

from aerodb.conditioning import bridge
from aerodb.consistency.kinematics import INPUTS, STATES
from aerodb.consistency.output_error import inertial_noise
from aerodb.consistency.smoother.smoothing import Smoothed, SmoothedPath
from aerodb.errors import InputError
from aerodb.support import Array

#: Channels of a consistent flight whose error is described.
DESCRIBED: Final = ("V", "alpha", "beta", "phi", "theta", "psi", *INPUTS)

#: Which estimate: smoothed; the reconstruction's path in steady wind; the air data and attitude as
#: measured, corrected.
Source = Literal["smoother", "path", "sensor"]

#: Bands of the spectrum, equal in ratio of frequencies.
_BANDS = 24


@dataclass(frozen=True)
class StateNoise:
    """Errors of the channels of one `source`: `offset`, one sigma of what is constant over a
    record, and `density`, one-sided power spectral density (unit^2/Hz) in each band between the
    `edges` (Hz), by channel; zero outside the edges. `pressure_slope` (Pa s/m) makes the error of V
    one of qbar; zero where the density of the air is not known."""

    source: Source
    edges: tuple[float, ...]
    offset: Mapping[str, float]
    density: Mapping[str, tuple[float, ...]]
    pressure_slope: float = 0.0

    def rms(self, channel: str, low: float = 0.0, high: float = np.inf) -> float:
        """One sigma of a channel's error between two frequencies (Hz); with the constant part when
        `low` is zero."""
        edges = np.clip(np.asarray(self.edges), low, high)
        power = float(np.diff(edges) @ np.asarray(self.density[channel]))
        return float(np.sqrt(power + (self.offset[channel] ** 2 if low == 0.0 else 0.0)))

    def draw(self, rng: np.random.Generator, n: int, step: float) -> dict[str, Array]:
        """One more realisation of the errors: channel -> (n,) at intervals of `step` seconds, SI.

        Drawn at twice the length or a little more, since a Fourier sum repeats itself. Frequencies
        beyond the edges have no power: those below are in the offset.
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
        """As plain values for JSON; `state_noise_from` reads it back."""
        return {
            "source": self.source,
            "edges": list(self.edges),
            "offset": dict(self.offset),
            "density": {name: list(values) for name, values in self.density.items()},
            "pressure_slope": self.pressure_slope,
        }


def state_noise_from(document: Mapping[str, Any]) -> StateNoise:
    """The errors that `StateNoise.document` wrote."""
    density = {name: tuple(values) for name, values in document["density"].items()}
    return StateNoise(
        document["source"],
        tuple(document["edges"]),
        document["offset"],
        density,
        document["pressure_slope"],
    )


def state_noise(smoothed: Smoothed, source: Source = "smoother", seed: int = 0) -> StateNoise:
    """The errors of a flight's channels, from the draws of its smoother (`smooth_flight(...,
    draws=8)` or more).

    With source ``sensor``, channels without a sensor are left out. seed : of the inertial sensors'
    noise. Raises InputError when the flight was smoothed without draws.
    """
    if not smoothed.drawn:
        raise InputError(
            "smoothed without draws",
            f"flight {smoothed.flight}",
            "give smooth_flight draws=8 or more",
        )
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
            for error in _errors(entry, smoothed, name, source, generator):
                constant.append(float(error.mean()) ** 2)
                _add_periodogram(error, entry.path.record.step, edges, power, count)
        if constant:
            offset[name] = float(np.sqrt(np.mean(constant)))
            density[name] = tuple(_filled(power, count))
    slopes = [
        entry.path.record.density * entry.path.V
        for entry in smoothed.paths
        if entry.path.record.density is not None
    ]
    slope = float(np.mean(np.concatenate(slopes))) if slopes else 0.0
    return StateNoise(source, tuple(edges.tolist()), offset, density, slope)


def _errors(
    entry: SmoothedPath,
    smoothed: Smoothed,
    name: str,
    source: Source,
    generator: np.random.Generator,
) -> Iterator[Array]:
    """Random samples (n,) of the error of one channel of one record, estimate minus truth, at the
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
    """Adds a series' one-sided periodogram under a Hann window, its mean removed, to the bands'
    sums and counts."""
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
    """Mean of each band; bands too narrow to hold a frequency take their neighbours'."""
    known = np.flatnonzero(count)
    return np.asarray(np.interp(np.arange(len(power)), known, power[known] / count[known]))
