"""Equation error in the frequency domain: linear equations between finite Fourier transforms.

The finite Fourier transform keeps a linear equation linear. Least squares over a band of
frequencies leaves out what lies beside it: sensor noise and structural modes above, drift below. A
constant and a drift of each record have known transforms and are estimated along, so that neither
leaks into the band, whatever the record's ends are.

Klein & Morelli, *Aircraft System Identification*, 2006, section 7.2.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.signal import czt

from aerodb.estimation.fit import Fit, ParameterEstimate, Standing
from aerodb.estimation.parameters import Parameters
from aerodb.estimation.regression.finite_fourier import BandRecord, Transform, band_of, transformed
from aerodb.estimation.regression.linear_equation import LinearEquation
from aerodb.estimation.regression.linear_solution import (
    LinearSolution,
    Unknowns,
    judged,
    solved,
    undetermined,
    unknowns_of,
    with_histories,
)
from aerodb.support import Array, Mask

#: Half width of the window that smooths the spectrum of the residual, as a share of the band.
_SMOOTHED_SHARE = 0.25
#: Least half width of it, in resolvable frequencies.
_SMOOTHED_BINS = 4.0
#: Degrees of freedom of the residual below which 95 % intervals are known to be too narrow.
FEWEST_FREE: Final = 20.0

ASSUMES = (
    "Regressors are free of error within the band.",
    "The spectrum of the equation's error changes slowly over the band.",
)


@dataclass(frozen=True, eq=False)
class BandFit:
    """Estimates from transforms.

    names : of the unknowns that have an estimate, and their `covariance`. free : degrees of
    freedom of the residual in the band. has_constants : whether an estimate rests on the means.
    """

    estimates: tuple[ParameterEstimate, ...]
    names: tuple[str, ...]
    covariance: Array
    free: float
    has_constants: bool

    @property
    def notes(self) -> tuple[str, ...]:
        """Sentences that the user must know of it: too few degrees of freedom (`FEWEST_FREE`), and
        how constants were estimated."""
        told = []
        if self.free < FEWEST_FREE:
            told.append(
                f"too short: {max(self.free, 0.0):.0f} degrees of freedom are left in the band, and"
                f" below {FEWEST_FREE:g} the standard errors are known to be too small"
            )
        if self.has_constants:
            told.append(
                "constants follow from the means of the records; for their standard errors, the"
                " error's spectrum at the band's lower edge holds below it"
            )
        return tuple(told)


def frequency_domain_regression(
    equation: LinearEquation,
    *,
    lowest: float | None = None,
    highest: float | None = None,
    spacing: float | None = None,
) -> Fit:
    """Least squares over a band of frequencies.

    Parameters
    ----------
    lowest, highest : of the band [Hz]; None: two cycles in the longest record, and where 95 % of
        the motion of every regressor lies below.
    spacing : of the frequencies [Hz]; None: half of what the longest record resolves.

    The constants of the equation lie in no band: they follow from the means of the records.
    Standard errors hold for coloured residuals: they use the spectrum of the residual, smoothed
    over a quarter of the band, with the degrees of freedom that the fit takes from each frequency.

    Raises InputError for a band that the records do not hold.
    """
    frequencies = band_of(equation, lowest, highest, spacing)
    records = [transformed(record, frequencies) for record in equation.records]
    fit = band_fit(equation.parameters, records, frequencies)
    found = Fit(
        method="frequency-domain",
        estimates=fit.estimates,
        names=fit.names,
        covariance=fit.covariance,
        degrees_of_freedom=max(fit.free, 1.0),
        assumes=ASSUMES,
        notes=(
            f"{len(frequencies)} frequencies from {frequencies[0]:.3g} to {frequencies[-1]:.3g} Hz",
            *fit.notes,
        ),
    )
    return with_histories(found, equation)


def band_fit(parameters: Parameters, records: Sequence[BandRecord], frequencies: Array) -> BandFit:
    """Estimates from the transforms of records at common frequencies (m,) [Hz]."""
    unknowns = unknowns_of(parameters)
    varies = np.any([record.varies for record in records], axis=0)
    slopes = np.any(unknowns.matrix[varies] != 0.0, axis=0)
    names = np.array(unknowns.names, dtype=object)
    matrix = unknowns.matrix[:, slopes]
    band = frequencies[-1] - frequencies[0] + 1.0 / max(r.duration for r in records)
    total_time = sum(record.duration for record in records)
    free = 2.0 * band * total_time - int(slopes.sum()) - 2 * len(records)
    drifts = [np.linalg.qr(_real(record.drift))[0] for record in records]
    whole = [_real(record.regressors @ matrix) for record in records]
    parts = [_without(part, q) for part, q in zip(whole, drifts, strict=True)]
    design = np.concatenate(parts)
    response = np.concatenate(
        [
            _without(_real(record.response - record.regressors @ unknowns.offset), q)
            for record, q in zip(records, drifts, strict=True)
        ]
    )
    sizes = np.linalg.norm(np.concatenate(whole), axis=0) + sum(
        record.duration * np.abs(record.mean_regressors @ matrix) for record in records
    )
    slope = solved(design, response, sizes, list(names[slopes]))
    if free < 1.0:
        slope = undetermined(int(slopes.sum()), "the record is too short for this band")
        slope = replace(slope, gain=np.zeros_like(design.T))
    known = np.nan_to_num(slope.values)
    taken = np.sum(design * slope.gain.T, axis=1) + np.concatenate(
        [np.sum(q**2, axis=1) for q in drifts]
    )
    spectra = _residual_spectra(response - design @ known, taken, records, frequencies)
    covariance, white = _covariance(slope.gain, records, frequencies, spectra)
    solution, total, bare = _with_constants(
        unknowns, slopes, slope, covariance, white, records, spectra[:, 0]
    )
    estimates, found, final = judged(unknowns, solution, total, bare)
    return BandFit(estimates, found, final, float(free), not slopes.all())


def _real(values: Transform) -> Array:
    """Real parts, then imaginary parts, of m complex rows."""
    return np.concatenate([values.real, values.imag])


def _without(values: Array, basis: Array) -> Array:
    return np.asarray(values - basis @ (basis.T @ values))


def _residual_spectra(
    residual: Array, taken: Array, records: Sequence[BandRecord], frequencies: Array
) -> Array:
    """Spectral density of the residual (records, m) [unit2/Hz], smoothed over frequency.

    residual : of the real rows of all records. taken : degrees of freedom that the fit took from
    each of them. A power law with curvature is fitted, and the ratio to it is smoothed: a steep
    spectrum is not flattened.
    """
    m = len(frequencies)
    longest = max(record.duration for record in records)
    apart = frequencies[1] - frequencies[0] if m > 1 else 1.0 / longest
    power, left = np.zeros((len(records), m)), np.zeros((len(records), m))
    for k, record in enumerate(records):
        rows = slice(2 * m * k, 2 * m * (k + 1))
        squares = (residual[rows] ** 2).reshape(2, m).sum(axis=0) / record.duration
        # A row holds less than one independent value where frequencies are closer than resolvable.
        independent = min(apart * record.duration, 1.0)
        lost = 0.5 * taken[rows].reshape(2, m).sum(axis=0)
        power[k] = independent * squares
        left[k] = np.maximum(independent - lost, 0.0)
    shape = smoothed_spectrum(power.sum(axis=0), left.sum(axis=0), frequencies, longest)
    level = power.sum(axis=1) / np.maximum(left @ shape, np.finfo(float).tiny)
    return np.asarray(level[:, None] * shape)


def smoothed_spectrum(power: Array, left: Array, frequencies: Array, longest: float) -> Array:
    """Return the spectrum (m,) whose product with `left` (m,), the independent values at ascending
    frequencies (m,) [Hz], is the expectation of `power` (m,), in its unit.

    A power law with curvature is fitted, and the ratio to it is smoothed over a quarter of the
    band. longest : record [s].
    """
    law = _power_law(power, left, frequencies)
    reach = max(_SMOOTHED_SHARE * (frequencies[-1] - frequencies[0]), _SMOOTHED_BINS / longest)
    weight = np.maximum(1.0 - np.abs(frequencies[:, None] - frequencies) / reach, 0.0)
    return np.asarray(law * (weight @ (power / law)) / np.maximum(weight @ left, 1e-9))


def _power_law(power: Array, left: Array, frequencies: Array) -> Array:
    """``exp(a + b ln f + c ln2 f)`` (m,) by Whittle's likelihood, Gauss-Newton from a flat one.

    power : (m,), whose expectation is the spectrum times `left`, the independent values there.
    """
    mean = power.sum() / max(float(left.sum()), 1e-9)
    if len(frequencies) < 4 or mean <= 0.0 or left.sum() < 1.0:
        return np.full(len(frequencies), max(mean, np.finfo(float).tiny))
    place = np.log(frequencies / frequencies[0])
    place = 2.0 * place / place[-1] - 1.0
    basis = np.column_stack([np.ones_like(place), place, place**2 - 1.0 / 3.0])
    # A weak pull to a flat spectrum: a hundredth of an independent value.
    hessian = (basis * left[:, None]).T @ basis + np.diag([0.0, 0.01, 0.01])
    found = np.array([np.log(mean), 0.0, 0.0])
    for _ in range(50):
        density = np.exp(np.clip(basis @ found, -700.0, 700.0))
        step = np.linalg.solve(
            hessian, basis.T @ (power / density - left) - [0.0, 0.01 * found[1], 0.01 * found[2]]
        )
        step *= min(1.0, 2.0 / max(float(np.abs(basis @ step).max()), 1e-300))
        found = found + step
        if np.abs(step).max() < 1e-8:
            break
    return np.asarray(np.exp(np.clip(basis @ found, -700.0, 700.0)))


def _covariance(
    gain: Array, records: Sequence[BandRecord], frequencies: Array, spectra: Array
) -> tuple[Array, Array]:
    """Covariance (f, f) of the slopes for residuals of these spectra; and as if they were flat.

    An estimate is ``integral of L(t) v(t) dt`` over the error v of each record, with L
    band-limited; its variance is ``integral of |L(f)|^2 S(f) df``.
    """
    f, m = len(gain), len(frequencies)
    total, flat = np.zeros((f, f)), np.zeros((f, f))
    level = float(spectra.mean())
    for k, record in enumerate(records):
        rows = gain[:, 2 * m * k : 2 * m * (k + 1)]
        weights = rows[:, :m] + 1j * rows[:, m:]
        count = int(np.ceil(8.0 * frequencies[-1] * record.duration)) + 1
        step = record.duration / count
        apart = frequencies[1] - frequencies[0] if m > 1 else 0.0
        turned = czt(weights, m=count, w=np.exp(2j * np.pi * apart * step), axis=1)
        kernel = (turned * np.exp(2j * np.pi * frequencies[0] * step * np.arange(count))).real
        cross = np.fft.rfft(kernel, 2 * count, axis=1)
        density = np.interp(np.fft.rfftfreq(2 * count, step), frequencies, spectra[k])
        density[1:-1] *= 2.0
        total += step / (2 * count) * ((cross * density) @ cross.conj().T).real
        flat += level * step * kernel @ kernel.T
    return total, flat


def _with_constants(
    unknowns: Unknowns,
    slopes: Mask,
    slope: LinearSolution,
    covariance: Array,
    white: Array,
    records: Sequence[BandRecord],
    lowest: Array,
) -> tuple[LinearSolution, Array, Array]:
    """The solution for all unknowns: constants from what the slopes leave of the means.

    lowest : spectral density of each record's residual at the lowest frequency.
    """
    f = len(slopes)
    values, bare, total = np.full(f, np.nan), np.zeros((f, f)), np.zeros((f, f))
    standing: list[Standing] = ["estimated"] * f
    reason = [""] * f
    for place, k in enumerate(np.flatnonzero(slopes)):
        values[k] = slope.values[place]
        standing[k], reason[k] = slope.standing[place], slope.reason[place]
    total[np.ix_(slopes, slopes)], bare[np.ix_(slopes, slopes)] = covariance, white
    if not slopes.all():
        weight = np.sqrt([record.duration for record in records])
        means = np.array([record.mean_regressors for record in records])
        flat = weight[:, None] * means @ unknowns.matrix[:, ~slopes]
        moved = weight[:, None] * means @ unknowns.matrix[:, slopes]
        known = np.nan_to_num(slope.values)
        offset = np.array([record.mean_response for record in records]) - means @ unknowns.offset
        wanted = weight * offset - moved @ known
        found = solved(
            flat,
            wanted,
            np.linalg.norm(flat, axis=0) + 1e-300,
            list(np.array(unknowns.names)[~slopes]),
        )
        left = wanted - flat @ np.nan_to_num(found.values)
        spare = len(records) - len(found.determined)
        # Constants that differ between records by more than their noise: one constant is uncertain.
        scatter = float(left @ left) / spare if spare > 0 else 0.0
        own = found.gain @ np.diag(np.maximum(lowest, scatter)) @ found.gain.T
        through = found.gain @ moved
        total[np.ix_(~slopes, ~slopes)] = own + through @ covariance @ through.T
        total[np.ix_(~slopes, slopes)] = -through @ covariance
        total[np.ix_(slopes, ~slopes)] = total[np.ix_(~slopes, slopes)].T
        bare[np.ix_(~slopes, ~slopes)] = own + through @ white @ through.T
        for place, k in enumerate(np.flatnonzero(~slopes)):
            values[k] = found.values[place]
            standing[k], reason[k] = found.standing[place], found.reason[place]
    return LinearSolution(values, np.zeros((f, 0)), tuple(standing), tuple(reason)), total, bare
