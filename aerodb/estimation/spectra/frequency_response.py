"""Frequency responses with coherence: windowed averages, several inputs, several window lengths.

Spectra are averages over overlapping Hann windows (Welch 1967), evaluated at any frequency. Windows
of several lengths are combined by their random errors: long ones resolve low frequencies, short
ones average more at high ones. With several inputs, each response is conditioned on the others.

Bendat & Piersol, *Random Data*, 2010, chapters 7 and 9; Tischler & Remple, *Aircraft and Rotorcraft
System Identification*, 2012, chapters 7, 9 and 10.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.signal import detrend, get_window

from aerodb.errors import InputError
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array, Mask

Complex = NDArray[np.complex128]

#: Coherence from which a response is used (Tischler & Remple, section 7.5).
COHERENT: Final = 0.6
#: Independent windows below which a coherence means nothing.
FEWEST_WINDOWS: Final = 5.0
#: Window lengths as shares of the shortest record.
_WINDOWS = (0.3, 0.22, 0.15, 0.1, 0.07)
#: Overlap of windows, as a share of their length.
_OVERLAP = 0.8
#: Cycles of a frequency that a window must hold.
_CYCLES = 2.0
#: Frequencies of a response.
_COUNT = 80
#: Frequencies over which a coherence is averaged before it selects or weights.
_NEIGHBOURS = 11
#: Least random error of a magnitude: a coherence of 1 would have none.
_LEAST_ERROR = 1e-9
#: Share of an input that the other inputs must leave for a response to it.
_LEFT_OVER = 1e-3
#: Highest frequency, as a share of the Nyquist frequency.
_NYQUIST_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class FrequencyResponse:
    """Response of an output to one input, conditioned on the other ones.

    Parameters
    ----------
    omega : (m,) [rad/s].
    response : (m,) complex, unit of the output per unit of the input; NaN where the other inputs
        leave nothing of this one.
    coherence : (m,), partial with several inputs; ``1 / averages`` is what chance gives.
    averages : (m,), windows that count as independent.
    window : (m,) [s], length of the windows that rule there.
    """

    input: str
    output: str
    omega: Array
    response: Complex
    coherence: Array
    averages: Array
    window: Array

    @property
    def smooth_coherence(self) -> Array:
        """Coherence (m,) without what chance adds, averaged over neighbouring frequencies: chosen
        or weighted by its own coherence, a response would be taken where noise enlarged it, without
        unit, 0 to 1."""
        return _smooth(self.coherence, self.averages)

    @property
    def random_error(self) -> Array:
        """Standard deviation (m,) of the magnitude, relative, and of the phase [rad]; inf where
        there is no coherence (Bendat & Piersol, eq. 9.90)."""
        coherence = self.smooth_coherence
        with np.errstate(divide="ignore", invalid="ignore"):
            error = np.sqrt((1.0 - coherence) / (2.0 * self.averages * coherence))
        return np.where(coherence > 0.0, np.maximum(error, _LEAST_ERROR), np.inf)

    @property
    def usable(self) -> Mask:
        """Mask (m,) of frequencies where the coherence suffices (`COHERENT`, dimensionless), and
        enough windows say so."""
        enough = (self.smooth_coherence >= COHERENT) & (self.averages >= FEWEST_WINDOWS)
        return np.asarray(enough & np.isfinite(self.response))


def frequency_responses(
    records: Sequence[TimeHistory],
    inputs: Sequence[str],
    output: str,
    *,
    lowest: float | None = None,
    highest: float | None = None,
) -> tuple[FrequencyResponse, ...]:
    """Responses of `output` to each of the inputs over all records.

    Parameters
    ----------
    inputs, output : names in `TimeHistory.inputs` or `outputs`.
    lowest, highest : [rad/s]; None: two cycles in a third of the shortest record, and half the
        Nyquist frequency.

    Raises InputError for names that the records lack, records too short for the frequencies, and
    fewer independent windows than inputs.
    """
    columns = [_columns(record, (*inputs, output)) for record in records]
    shortest = min(len(each) * record.step for each, record in zip(columns, records, strict=True))
    low = 2.0 * np.pi * _CYCLES / (_WINDOWS[0] * shortest) if lowest is None else lowest
    limit = min(np.pi / record.step for record in records)
    high = _NYQUIST_SHARE * limit if highest is None else highest
    if not 0.0 < low < high <= limit:
        raise InputError(
            f"no frequencies from {low:.3g} to {high:.3g} rad/s in records of {shortest:.3g} s",
            "frequency response",
            "state a band above two cycles in a third of the shortest record",
        )
    omega = np.geomspace(low, high, _COUNT)
    made = (_spectra(columns, records, omega, share * shortest) for share in _WINDOWS)
    parts = [part for part in made if part is not None]
    if not parts:
        raise InputError(
            "the records are too short for windows", "frequency response", "fly longer"
        )
    return tuple(
        _combined([_conditioned(part, k) for part in parts], omega, name, output, parts)
        for k, name in enumerate(inputs)
    )


def _columns(record: TimeHistory, names: Sequence[str]) -> Array:
    known = {**record.outputs, **record.inputs}
    absent = [name for name in names if name not in known]
    if absent:
        raise InputError(f"no {', '.join(absent)}", f"record {record.name}", "name its channels")
    columns = np.column_stack([known[name] for name in names])
    if not np.isfinite(columns).all():
        raise InputError("values are not finite", f"record {record.name}", "bridge their gaps")
    return np.asarray(detrend(columns, axis=0))


@dataclass(frozen=True, eq=False)
class _Spectra:
    """Spectral matrices (m, c, c) of the columns, averages that count as independent, the window's
    length [s], and where it holds enough cycles (m,)."""

    matrix: Complex
    averages: float
    length: float
    holds: Mask


def _spectra(
    columns: Sequence[Array], records: Sequence[TimeHistory], omega: Array, length: float
) -> _Spectra | None:
    c = columns[0].shape[1]
    total, independent, count = np.zeros((len(omega), c, c), dtype=np.complex128), 0.0, 0
    for each, record in zip(columns, records, strict=True):
        size = round(length / record.step)
        if size < 8:
            return None
        window = get_window("hann", size)
        hop = max(1, round((1.0 - _OVERLAP) * size))
        blocks = sliding_window_view(each, size, axis=0)[::hop]
        blocks = (blocks - blocks.mean(axis=2, keepdims=True)) * window
        turn = np.exp(-1j * np.outer(omega, record.step * np.arange(size)))
        rows = blocks.reshape(-1, size).T
        lines = (turn.real @ rows + 1j * (turn.imag @ rows)).reshape(len(omega), -1, c)
        energy = np.sum(window**2) / record.step
        total += lines.conj().transpose(0, 2, 1) @ lines / energy
        count += len(blocks)
        independent += _independent(window, hop, len(blocks))
    holds = omega * length >= 2.0 * np.pi * _CYCLES * (1.0 - 1e-9)
    return _Spectra(total / max(count, 1), independent, length, holds)


def _independent(window: Array, hop: int, count: int) -> float:
    """Return how many independent windows `count` overlapping ones are worth (Welch 1967)."""
    energy, shared = float(np.sum(window**2)), 0.0
    for lag in range(1, min(count, int(np.ceil(len(window) / hop)))):
        common = float(np.sum(window[: -lag * hop] * window[lag * hop :])) / energy
        shared += 2.0 * (1.0 - lag / count) * common**2
    return count / (1.0 + shared)


@dataclass(frozen=True, eq=False)
class _Conditioned:
    """Spectra (m,) of one input and of the output, without what the other inputs explain; and the
    random error of their response."""

    input: Array
    output: Array
    cross: Complex
    averages: float
    error: Array
    left: Mask


def _conditioned(spectra: _Spectra, k: int) -> _Conditioned:
    """Bendat & Piersol, section 7.3: conditioned spectra as Schur complements."""
    matrix = spectra.matrix
    c = matrix.shape[1]
    others = [j for j in range(c - 1) if j != k]
    own = matrix[:, [k, c - 1]][:, :, [k, c - 1]]
    before = own[:, 0, 0].real.copy()
    if others:
        cross = matrix[:, others][:, :, [k, c - 1]]
        inner = matrix[:, others][:, :, others]
        size = np.trace(inner, axis1=1, axis2=2).real[:, None, None]
        inner = inner + 1e-12 * np.maximum(size, 1e-300) * np.eye(len(others))
        own = own - cross.conj().transpose(0, 2, 1) @ np.linalg.solve(inner, cross)
    averages = max(spectra.averages - len(others), 1.0)
    gxx, gyy, gxy = own[:, 0, 0].real, own[:, 1, 1].real, own[:, 0, 1]
    left = gxx > _LEFT_OVER * before
    coherence = _coherence(gxx, gyy, gxy)
    with np.errstate(divide="ignore", invalid="ignore"):
        error = np.sqrt((1.0 - coherence) / (2.0 * averages * coherence))
    error = np.where(
        spectra.holds & left & (coherence > 0.0), np.maximum(error, _LEAST_ERROR), np.inf
    )
    return _Conditioned(gxx, gyy, gxy, averages, error, left & spectra.holds)


def _smooth(coherence: Array, averages: Array | float) -> Array:
    """Coherence (m,) less its mean where there is none, ``1 / averages``, over neighbours."""
    count = np.maximum(averages, 1.0 + 1e-9)
    real = np.clip((count * coherence - 1.0) / (count - 1.0), 0.0, 1.0)
    kernel = np.ones(min(_NEIGHBOURS, len(coherence)))
    return np.asarray(
        np.convolve(real, kernel, "same") / np.convolve(np.ones(len(real)), kernel, "same")
    )


def _coherence(gxx: Array, gyy: Array, gxy: Complex) -> Array:
    size = gxx * gyy
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = np.abs(gxy) ** 2 / size
    return np.asarray(np.clip(np.where(size > 0.0, ratio, 0.0), 0.0, 1.0))


def _combined(
    parts: Sequence[_Conditioned],
    omega: Array,
    name: str,
    output: str,
    spectra: Sequence[_Spectra],
) -> FrequencyResponse:
    """Windows combined by their random errors: weights ``(error / least error)^-4`` on the spectra
    (Tischler & Remple, eqs. 10.5-10.8)."""
    errors = np.array([part.error for part in parts])
    least = errors.min(axis=0)
    known = np.isfinite(least)
    with np.errstate(invalid="ignore", divide="ignore"):
        weight = np.where(np.isfinite(errors), (errors / least) ** -4.0, 0.0)
    weight = np.where(known, weight, 0.0)
    total = np.maximum(weight.sum(axis=0), 1e-300)

    def mean(values: Sequence[Array | Complex]) -> Complex:
        return np.asarray(np.sum(weight * np.array(values), axis=0) / total, dtype=np.complex128)

    gxx, gyy = mean([p.input for p in parts]).real, mean([p.output for p in parts]).real
    gxy = mean([p.cross for p in parts])
    with np.errstate(invalid="ignore", divide="ignore"):
        response = np.where(known & (gxx > 0.0), gxy / gxx, np.nan)
    averages = mean([np.full(len(omega), p.averages) for p in parts]).real
    window = mean([np.full(len(omega), s.length) for s in spectra]).real
    coherence = np.where(known, _coherence(gxx, gyy, gxy), 0.0)
    return FrequencyResponse(name, output, omega, response, coherence, averages, window)
