"""Output error of linear models in the frequency domain: transforms of measured outputs against the
transforms of the model's, over a band.

Between finite Fourier transforms at the harmonics of a record of n samples, the model
``x[i+1] = F x[i] + f[i]``, ``y[i] = C x[i] + g[i]`` is algebra: ``X = (z - F)^-1 (f~ + z d)``,
``Y = C X + g~``, with ``z = exp(j w dt)`` and the state that the record gained, ``d = x[0] -
x[n]``. That is exact. Nothing is integrated, so that an unstable motion stays bounded; constants
and what lies beside the band do not matter. d is estimated for each record.
Weights are the same over the band: those of an estimated spectrum made intervals too narrow.

Klein & Morelli, *Aircraft System Identification*, 2006, section 7.3; Pintelon & Schoukens, *System
Identification: A Frequency Domain Approach*, 2012, section 6.3 (d, the transient).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.estimation.dynamic_model import DynamicModel, ModelAround, Values
from aerodb.estimation.fit import Fit, ParameterEstimate
from aerodb.estimation.linear_models import (
    FROM_SUBSPACE,
    DelayedStateSpace,
    LinearModel,
    StateSpace,
    with_regressed_start_values,
    with_start_values,
)
from aerodb.estimation.output_error.gauss_newton import likelihood_of_start, search
from aerodb.estimation.output_error.likelihood import Beside, MeasuredOutputs, Noise, whitened
from aerodb.estimation.output_error.output_error import checked_records, fit_of
from aerodb.estimation.output_error.sensitivities import ModelResponse
from aerodb.estimation.parameters import Parameter, Parameters
from aerodb.estimation.regression import band_limits, smoothed_spectrum
from aerodb.estimation.time_history import TimeHistory, elapsed
from aerodb.signals import theil
from aerodb.support import Array, Integers

METHOD: Final = "frequency-domain-output-error"
ASSUMES = (
    "The motion is deterministic within the band: turbulence there biases the estimates."
    " What white noise of deflections does is taken off.",
    "The spectrum of the outputs' noise changes slowly over the band, the same in every record."
    " Noise of different outputs is uncorrelated.",
)
_FROM_REGRESSION = "The search began at values from regression."
Transforms = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class _InBand(ModelAround):
    """A linear model whose outputs are transforms: n rows for n samples, in pairs of real and
    imaginary part of one harmonic after the other, from the mean on.

    model : in time. parameters : its own, and the transient of each record. band : record ->
    numbers of its harmonics (m,).
    """

    model: LinearModel
    parameters: Parameters
    band: Mapping[str, Integers]

    def simulated(self, values: Values, record: TimeHistory) -> Array:
        """Rows (n, o, k), in SI units; 0 beside the band, NaN for a model that is not finite."""
        runs = max(np.size(value) for value in values.values())
        with np.errstate(all="ignore"):
            first, drive, observation, direct = self.model.discrete(values, record, runs)
        n, number = len(record.time), self.band[record.name]
        z = np.exp(2j * np.pi * number / n)
        # the last sample drives what comes after the record: it is part of the transient
        driven = np.fft.fft(drive - drive.mean(axis=0), n, axis=0)[number]
        names = [_transient(state, record.name) for state in self.states]
        gained = np.stack([np.broadcast_to(values[name], runs) for name in names])
        right = np.moveaxis(driven + z[:, None, None] * gained, 2, 1)
        matrix = z[:, None, None, None] * np.eye(len(names)) - np.moveaxis(first, 2, 0)
        finite = np.isfinite(matrix).all(axis=(0, 2, 3))
        matrix[:, ~finite] = np.eye(len(names))
        state = np.linalg.solve(matrix, right[..., None])[..., 0]
        state[:, ~finite] = np.nan
        seen = np.einsum("osk,mks->mok", observation, state)
        found = seen + np.fft.fft(direct - direct.mean(axis=0), axis=0)[number]
        return _rows(found, number, n)

    def transformed(self, record: TimeHistory) -> TimeHistory:
        """The record with rows of the model's kind for measured outputs; NaN beside the band."""
        n, number = len(record.time), self.band[record.name]
        spectra = np.fft.fft(record.stacked(self.outputs), axis=0)[number]
        rows = np.full((n, len(self.outputs)), np.nan)
        at = _places(number)
        rows[at] = _rows(spectra, number, n)[at]
        return replace(record, outputs=dict(zip(self.outputs, rows.T, strict=True)))

    def in_time(self, rows: Array, record: TimeHistory) -> Array:
        """Histories (n, o) of rows (n, o): what the band holds of them."""
        n, number = len(rows), self.band[record.name]
        at = _places(number)
        spectra = np.zeros((n // 2 + 1, rows.shape[1]), dtype=np.complex128)
        pairs = rows[at].reshape(len(number), 2, -1)
        spectra[number] = (pairs[:, 0] + 1j * pairs[:, 1]) * np.sqrt(0.5 * n)
        return np.asarray(np.fft.irfft(spectra, n, axis=0))


def frequency_domain_output_error(
    model: DynamicModel, records: Sequence[TimeHistory], *, band: Sequence[float] | None = None
) -> Fit:
    """Estimate a linear model's parameters from transforms of its outputs over a band.

    Maximises the likelihood of output error (`output_error`) over harmonics in place of samples.
    Standard errors hold for coloured residuals: they use the residuals' spectrum, smoothed.

    Parameters
    ----------
    model : linear; inputs may be late. It starts as in `output_error`.
    records : with all of the model's outputs at every sample.
    band : lowest and highest frequency [Hz]; None: from two cycles in the longest record to where
        95 % of the motion of every input and output lies below.

    Constants of the model act at no harmonic: they are left out. Histories of the fit are what the
    band holds of them. Values are in SI units.

    Raises InputError for a model that is not linear or measures late, for gaps, and for a band that
    the records do not hold.
    """
    where = "output error in the frequency domain"
    if band is not None and len(band) != 2:
        raise InputError(f"a band of {len(band)} frequencies", where, "state two, lowest first")
    if not isinstance(model, StateSpace | DelayedStateSpace):
        raise InputError(
            "it needs a linear model", where, "write one ([state_space]), or use output-error"
        )
    checked_records(model, records, where)
    for record in records:
        if gaps := [o for o in model.outputs if not np.isfinite(record.outputs[o]).all()]:
            raise InputError(
                f"{', '.join(gaps)} has gaps, and a transform needs every sample",
                f"record {record.name}",
                "bridge them, cut the record there, or use output-error",
            )
    numbers = _harmonics(model, records, band, where)
    starts: list[tuple[LinearModel, str]] = [(model, "")]
    if (regressed := with_regressed_start_values(model, records)) is not None:
        starts.append((regressed, _FROM_REGRESSION))

    def placed(start: LinearModel) -> _InBand:
        return _InBand(start, _parameters(start, records), numbers)

    def height(start: tuple[LinearModel, str]) -> float:
        found = placed(start[0])
        return likelihood_of_start(found, [found.transformed(r) for r in records], "diagonal")

    started, note = max(starts, key=height)
    fit = _fitted(placed(started), records, note)
    if not fit.converged:
        try:
            other = _fitted(placed(with_start_values(model, records)), records, FROM_SUBSPACE)
        except InputError:
            return fit
        fit = other if other.converged else fit
    return fit


def _fitted(given: _InBand, records: Sequence[TimeHistory], note: str) -> Fit:
    rows = [given.transformed(record) for record in records]
    solution = search(given, rows)

    def coloured(
        measured: Sequence[MeasuredOutputs],
        responses: Sequence[ModelResponse],
        noise: Noise,
        unknowns: int,
        beside: Beside,
    ) -> tuple[Array, float]:
        return _information(given, records, measured, responses, noise, unknowns)

    fit = fit_of(METHOD, given, rows, solution, ASSUMES, coloured=coloured)
    return _told(fit, given, records, rows, note)


def _information(
    given: _InBand,
    records: Sequence[TimeHistory],
    measured: Sequence[MeasuredOutputs],
    responses: Sequence[ModelResponse],
    noise: Noise,
    unknowns: int,
) -> tuple[Array, float]:
    """``sum S' R^-1 s S`` (f, f) over rows with slopes S, where s is the spectrum of the residuals
    over its mean; and how many independent rows they count as.

    The spectrum is smoothed (`smoothed_spectrum`), with what the estimates take up of each row.
    """
    whites, slopes, frequencies = list[Array](), list[Array](), list[Array]()
    for record, own, response in zip(records, measured, responses, strict=True):
        white, slope = whitened(own, own.residual(response.outputs), response.slopes, noise)
        number = given.band[record.name]
        at, wide = _places(number), np.zeros((*white.shape, unknowns))
        wide[:, :, response.columns] = slope
        whites.append(white[at].reshape(len(number), 2, -1))
        slopes.append(wide[at].reshape(len(number), 2, -1, unknowns))
        frequencies.append(number / (len(record.time) * record.step))
    order = np.argsort(np.concatenate(frequencies), kind="stable")
    white, slope = np.concatenate(whites)[order], np.concatenate(slopes)[order]
    frequency = np.concatenate(frequencies)[order]
    flat = slope.reshape(-1, unknowns)
    inverse = np.linalg.pinv(flat.T @ flat, hermitian=True)
    taken = np.einsum("mcof,fg,mcog->mo", slope, inverse, slope, optimize=True) / 2.0
    power, left = np.mean(white**2, axis=1), np.maximum(1.0 - taken, 0.0)
    longest = max(len(record.time) * record.step for record in records)
    total, independent = np.zeros((unknowns, unknowns)), 0.0
    for j in range(white.shape[2]):
        shape = smoothed_spectrum(power[:, j], left[:, j], frequency, longest)
        shape = shape * left[:, j].sum() / max(float(shape @ left[:, j]), 1e-300)
        total += np.einsum("mcf,m,mcg->fg", slope[:, :, j], shape, slope[:, :, j], optimize=True)
        independent += 2.0 * float(shape.sum() ** 2 / np.sum(shape**2))
    return total, independent


def _told(
    fit: Fit, given: _InBand, records: Sequence[TimeHistory], rows: Sequence[TimeHistory], note: str
) -> Fit:
    """The fit with the model's own parameters, histories in time, and what constants are worth."""
    items = [item for item in given.model.parameters.items if not _is_start(item.name)]
    names = {item.name for item in items}
    kept = [j for j, name in enumerate(fit.names) if name in names]
    constant = _constants(given.model)
    estimates = tuple(
        replace(
            each,
            value=np.nan,
            standing="left out",
            reason="a constant acts at no frequency of a band; output-error estimates it",
        )
        if each.name.split("[", 1)[0] in constant and _is_free(items, each)
        else each
        for each in fit.estimates
        if each.name in names
    )
    fitted, left, agreement = {}, {}, {}
    for record, row in zip(records, rows, strict=True):
        made = np.column_stack([fit.fitted[record.name][name] for name in given.outputs])
        model, seen = (given.in_time(each, record) for each in (made, row.stacked(given.outputs)))
        fitted[record.name] = dict(zip(given.outputs, model.T, strict=True))
        left[record.name] = dict(zip(given.outputs, (seen - model).T, strict=True))
        agreement[record.name] = {
            name: theil(model[:, j], seen[:, j])
            for j, name in enumerate(given.outputs)
            if np.isfinite(model[:, j]).all()
        }
    lows, highs = zip(
        *(
            np.array([given.band[r.name][0], given.band[r.name][-1]]) / (len(r.time) * r.step)
            for r in records
        ),
        strict=True,
    )
    count = sum(len(each) for each in given.band.values())
    band = f"{count} frequencies from {min(lows):.3g} to {max(highs):.3g} Hz."
    return replace(
        fit,
        estimates=estimates,
        names=tuple(fit.names[j] for j in kept),
        covariance=fit.covariance[np.ix_(kept, kept)],
        residuals=left,
        fitted=fitted,
        times=elapsed(records),
        theil=agreement,
        notes=(*fit.notes, band, *([note] if note else [])),
    )


def _is_free(items: Sequence[Parameter], estimate: ParameterEstimate) -> bool:
    return any(item.name == estimate.name and item.free for item in items)


def _harmonics(
    model: LinearModel, records: Sequence[TimeHistory], band: Sequence[float] | None, where: str
) -> dict[str, Integers]:
    """Numbers (m,) of the harmonics of each record within the band. Raises InputError for a record
    with none."""
    columns = [
        (
            record.time,
            np.column_stack(
                [*(record.inputs[i] for i in model.inputs), record.stacked(model.outputs)]
            ),
        )
        for record in records
    ]
    given = (None, None) if band is None else band
    low, high = band_limits(columns, given[0], given[1], where)
    found = dict[str, Integers]()
    for record in records:
        length = len(record.time) * record.step
        first = max(int(np.ceil(low * length - 1e-6)), 1)
        last = min(int(np.floor(high * length + 1e-6)), (len(record.time) - 1) // 2)
        if last < first:
            raise InputError(
                f"no frequency from {low:.3g} to {high:.3g} Hz in {length:.3g} s",
                f"record {record.name}",
                "leave it out, or state a wider band",
            )
        found[record.name] = np.arange(first, last + 1)
    return found


def _parameters(model: LinearModel, records: Sequence[TimeHistory]) -> Parameters:
    """Those of the model, of which constants and first states are held, and the transients."""
    constant = _constants(model)
    items = [
        replace(item, free=False)
        if _is_start(item.name) or item.name.split("[", 1)[0] in constant
        else item
        for item in model.parameters.items
    ]
    more = [
        Parameter(_transient(state, record.name), 0.0)
        for record in records
        for state in model.states
    ]
    return Parameters((*items, *more))


def _constants(model: LinearModel) -> set[str]:
    """Names of the entries that stand in biases alone."""
    inner = model.model if isinstance(model, DelayedStateSpace) else model
    acting = {name for each in (inner.a, inner.b, inner.c, inner.d) for name in each.slopes}
    return {*inner.state_bias.slopes, *inner.output_bias.slopes} - acting


def _is_start(name: str) -> bool:
    return name.startswith("initial_")


def _transient(state: str, record: str) -> str:
    return f"transient_{state}[{record}]"


def _places(number: Integers) -> Integers:
    """Rows (2 m,) of harmonics (m,): real part, imaginary part."""
    return (2 * number[:, None] + np.array([-1, 0])).ravel()


def _rows(spectra: Transforms, number: Integers, n: int) -> Array:
    """Rows (n, ...) of transforms (m, ...), 0 beside the band; white noise of a series has the same
    variance in them."""
    rows = np.zeros((n, *spectra.shape[1:]))
    parts = np.stack([spectra.real, spectra.imag], axis=1) * np.sqrt(2.0 / n)
    rows[_places(number)] = parts.reshape(-1, *spectra.shape[1:])
    return rows
