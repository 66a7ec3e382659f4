"""Finite Fourier transforms of the records of a linear equation, over a band of frequencies.

``x(f) = sum_i x_i exp(-2 pi j f t_i) dt``, by the chirp-z transform at any frequencies: Morelli,
"High Accuracy Evaluation of the Finite Fourier Transform Using Sampled Data", NASA TM 110340, 1997.
His cubic interpolation between samples is not used: all columns of an equation would get the same
factor.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.signal import czt

from aerodb.errors import InputError
from aerodb.estimation.regression.linear_equation import EquationRecord, LinearEquation
from aerodb.support import Array, Mask

Transform = NDArray[np.complex128]

#: Variation, as a share of the largest value, below which a regressor is a constant.
STILL = 1e-9
#: The band begins at this many cycles in the longest record.
CYCLES = 2.0
#: It ends where this share of the motion of every regressor is inside.
MOTION = 0.95
#: It ends at the latest at this share of the Nyquist frequency.
NYQUIST_SHARE = 0.8
#: Frequencies per resolvable one (the reciprocal of the longest record).
_OVERSAMPLING = 2.0


@dataclass(frozen=True, eq=False)
class BandRecord:
    """Finite Fourier transforms of one record at m frequencies.

    regressors : (m, k). response : (m,). drift : (m, 2), of a constant and of the time from the
    first sample. mean_regressors : (k,) and mean_response, over time. varies : (k,), whether a
    regressor varied. duration : samples times their interval [s].
    """

    regressors: Transform
    response: Transform
    drift: Transform
    mean_regressors: Array
    mean_response: float
    varies: Mask
    duration: float


def band_of(
    equation: LinearEquation, lowest: float | None, highest: float | None, spacing: float | None
) -> Array:
    """Frequencies (m,) [Hz], evenly spaced; what is None follows from the records."""
    where = f"equation of {equation.response}"
    longest = max(duration_of(record) for record in equation.records)
    columns = [(record.time, record.regressors) for record in equation.records]
    low, high = band_limits(columns, lowest, highest, where)
    apart = 1.0 / (_OVERSAMPLING * longest) if spacing is None else spacing
    if not apart > 0.0:
        raise InputError(f"frequencies {apart:.3g} Hz apart", where, "state a spacing above 0")
    return np.asarray(low + apart * np.arange(int(np.floor((high - low) / apart + 1e-6)) + 1))


def band_limits(
    records: Sequence[tuple[Array, Array]], lowest: float | None, highest: float | None, where: str
) -> tuple[float, float]:
    """Return lowest and highest frequency [Hz] of records, time (n,) [s] and columns (n, k); what
    is None follows from them: two cycles in the longest, and where the motion of each column ends.

    Raises InputError for a band that the records do not hold; where : what it says of the place.
    """
    steps = [float(time[-1] - time[0]) / (len(time) - 1) for time, _ in records]
    longest = max(len(time) * step for (time, _), step in zip(records, steps, strict=True))
    nyquist = min(0.5 / step for step in steps)
    low = CYCLES / longest if lowest is None else lowest
    high = _motion_ends(records, low, NYQUIST_SHARE * nyquist) if highest is None else highest
    if not 0.0 < low < high <= nyquist:
        raise InputError(
            f"no band from {low:.3g} to {high:.3g} Hz in a record of {longest:.3g} s sampled at"
            f" {2.0 * nyquist:.3g} Hz",
            where,
            "state a band between the reciprocal of the record's length and half its sampling rate",
        )
    return low, high


def step_of(record: EquationRecord) -> float:
    """Sampling interval [s]. Raises InputError for a single sample."""
    if len(record.time) < 2:
        raise InputError("one sample is too few", f"record {record.name}", "leave it out")
    return float(record.time[-1] - record.time[0]) / (len(record.time) - 1)


def duration_of(record: EquationRecord) -> float:
    """Length of a record [s], with the interval of its last sample. Raises InputError for a single
    sample."""
    return len(record.time) * step_of(record)


def _motion_ends(records: Sequence[tuple[Array, Array]], low: float, limit: float) -> float:
    """Frequency [Hz] below which MOTION of the power of every column above `low` lies."""
    ends = low
    for time, columns in records:
        n, step = len(time), float(time[-1] - time[0]) / (len(time) - 1)
        line = np.column_stack([np.ones(n), np.linspace(-1.0, 1.0, n)])
        moved = columns - line @ np.linalg.lstsq(line, columns, rcond=None)[0]
        frequency = np.fft.rfftfreq(n, step)
        power = np.abs(np.fft.rfft(moved, axis=0)) ** 2 * (frequency >= low)[:, None]
        moves = np.ptp(columns, axis=0) > STILL * np.abs(columns).max(axis=0)
        for share in np.cumsum(power[:, moves], axis=0).T:
            if share[-1] > 0.0:
                ends = max(ends, frequency[np.searchsorted(share, MOTION * share[-1])])
    return float(min(max(ends, 2.0 * low), limit))


def transformed(record: EquationRecord, frequencies: Array) -> BandRecord:
    """Finite Fourier transforms of a record by the chirp-z transform.

    frequencies : (m,) [Hz], evenly spaced.
    """
    n, step = len(record.time), step_of(record)
    columns = np.column_stack([record.regressors, record.response, np.ones(n), step * np.arange(n)])
    apart = frequencies[1] - frequencies[0] if len(frequencies) > 1 else 0.0
    spectra = step * czt(
        columns,
        m=len(frequencies),
        w=np.exp(-2j * np.pi * apart * step),
        a=np.exp(2j * np.pi * frequencies[0] * step),
        axis=0,
    ).astype(np.complex128)
    k = record.regressors.shape[1]
    return BandRecord(
        spectra[:, :k],
        spectra[:, k],
        spectra[:, k + 1 :],
        record.regressors.mean(axis=0),
        float(record.response.mean()),
        np.ptp(record.regressors, axis=0) > STILL * np.abs(record.regressors).max(axis=0),
        n * step,
    )
