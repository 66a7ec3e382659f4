"""Recursive estimation of linear equations, sample by sample with constant memory: recursive least
squares with forgetting, its normalised form, and Fourier transform regression.

Each has ``update`` for one sample and ``fit`` for the estimates so far, which equal those of the
whole record at once: least squares, and `frequency_domain_regression`.

Fourier transform regression: Morelli, "Real-Time Parameter Estimation in the Frequency Domain",
AIAA 99-4043; Phillips et al., AIAA 2009-5723, eqs. 40-42. Recursive least squares: Ljung, *System
Identification*, 1999, section 11.2, here as a triangular factor, which needs no start covariance;
normalised: Ioannou & Sun, *Robust Adaptive Control*, 1996, section 4.3.
"""

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation.fit import Fit
from aerodb.estimation.parameters import Parameters
from aerodb.estimation.regression.finite_fourier import STILL, BandRecord, band_of
from aerodb.estimation.regression.frequency_domain import ASSUMES, band_fit
from aerodb.estimation.regression.linear_equation import LinearEquation
from aerodb.estimation.regression.linear_solution import (
    judged,
    solved,
    undetermined,
    unknowns_of,
    with_histories,
)
from aerodb.support import Array

#: Sums are kept for this many stretches of the record; two neighbours become one when all are in
#: use.
_STRETCHES = 64
#: With forgetting, a stretch lasts at most the memory divided by this.
_OF_MEMORY = 8.0
#: Rows that wait until they enter the triangular factor together.
_ROWS = 16
#: Neighbouring stretches whose sums are taken as correlated.
_CORRELATED = 3
#: Stretches below which standard errors are known to be too small.
_FEWEST_STRETCHES = 20
#: Frequencies of Fourier transform regression: from the highest over this number to the highest, in
#: steps of half the lowest.
_FREQUENCIES = 20


class RecursiveLeastSquares:
    """Least squares with exponential forgetting, one sample after another.

    Parameters
    ----------
    parameters : the k parameters; priors and bounds are applied to the estimates, not to the sums.
    forgetting : weight of a sample relative to the next one, above 0 and at most 1: the memory is
        ``1 / (1 - forgetting)`` samples.
    normalised : divides each equation by ``sqrt(1 + x' x)`` (NRLS), so that samples with large
        regressors do not rule.

    Standard errors hold for coloured residuals: the products of regressors and residual are summed
    over stretches of the record, whose scatter is the covariance (Newey & West 1987, by stretches).
    """

    def __init__(
        self, parameters: Parameters, *, forgetting: float = 1.0, normalised: bool = False
    ) -> None:
        if not 0.0 < forgetting <= 1.0:
            raise InputError(
                f"forgetting {forgetting:g} is not above 0 and at most 1", remedy="such as 0.999"
            )
        self._unknowns = unknowns_of(parameters)
        self._forgetting, self._normalised = forgetting, normalised
        f = self._unknowns.matrix.shape[1]
        self._factor = np.zeros((f + 1, f + 1))
        self._rows, self._waiting = np.zeros((_ROWS, f + 1)), 0
        self._products = np.zeros((_STRETCHES, f, f + 1))
        self._lengths = np.zeros(_STRETCHES, dtype=np.int64)
        self._used, self._longest = 0, 1
        self._weight = 0.0
        memory = np.inf if forgetting == 1.0 else 1.0 / (1.0 - forgetting)
        self._most = max(1.0, memory / _OF_MEMORY)
        self.samples = 0

    def update(self, regressors: Array, response: float) -> None:
        """Add one sample: regressors (k,) and their response, in the units of the equation; a NaN
        would spoil all later estimates."""
        x = regressors @ self._unknowns.matrix
        row = np.empty(len(x) + 1)
        row[:-1], row[-1] = x, response - regressors @ self._unknowns.offset
        if self._normalised:
            row /= np.sqrt(1.0 + x @ x)
        if self._forgetting < 1.0:
            self._factor *= np.sqrt(self._forgetting)
            self._rows[: self._waiting] *= np.sqrt(self._forgetting)
            self._products[: self._used] *= self._forgetting
        self._rows[self._waiting] = row
        self._waiting += 1
        if self._waiting == _ROWS:
            self._absorb()
        self._weight = self._forgetting * self._weight + 1.0
        self.samples += 1
        self._add(row[:-1, None] * row)

    def _absorb(self) -> None:
        """Bring the rows that wait into the triangular factor."""
        stacked = np.vstack([self._factor, self._rows[: self._waiting]])
        self._factor, self._waiting = np.asarray(np.linalg.qr(stacked, mode="r")), 0

    def _add(self, product: Array) -> None:
        """Add the products of one sample to the last stretch, or begin another."""
        if self._used and self._lengths[self._used - 1] < self._longest:
            self._products[self._used - 1] += product
            self._lengths[self._used - 1] += 1
            return
        if self._used == _STRETCHES:
            if 2 * self._longest <= self._most:
                half = _STRETCHES // 2
                self._products[:half] = self._products[::2] + self._products[1::2]
                self._lengths[:half] = self._lengths[::2] + self._lengths[1::2]
                self._used, self._longest = half, 2 * self._longest
            else:  # forgotten
                self._products[:-1], self._lengths[:-1] = self._products[1:], self._lengths[1:]
                self._used -= 1
        self._products[self._used], self._lengths[self._used] = product, 1
        self._used += 1

    def fit(self) -> Fit:
        """Return the estimates so far, in SI units with covariance (f, f); NaN as long as samples
        are too few."""
        self._absorb()
        f = len(self._factor) - 1
        used = self._used
        design, response = self._factor[:f, :f], self._factor[:f, f]
        if self.samples > f:
            size = np.full(f, np.linalg.norm(design))
            solution = solved(design, response, size, self._unknowns.names)
        else:
            solution = undetermined(f, f"{self.samples} samples are too few")
        count = len(solution.determined)
        inverse = solution.gain @ solution.gain.T
        known = np.nan_to_num(solution.values)
        scores = self._products[:used, :, f] - self._products[:used, :, :f] @ known
        middle = scores.T @ scores
        for lag in range(1, min(_CORRELATED, used - 1) + 1):
            pair = scores[lag:].T @ scores[:-lag]
            middle += (1.0 - lag / (_CORRELATED + 1)) * (pair + pair.T)
        covariance = used / max(used - count, 1) * inverse @ middle @ inverse
        left = float(self._factor[f, f] ** 2) / max(self._weight - count, 1.0)
        estimates, found, final = judged(self._unknowns, solution, covariance, left * inverse)
        short = used < _FEWEST_STRETCHES + count
        return Fit(
            method="normalised-recursive" if self._normalised else "recursive",
            estimates=estimates,
            names=found,
            covariance=final,
            degrees_of_freedom=float(max(used / (_CORRELATED + 1) - count, 1.0)),
            assumes=("Regressors are free of error.", *self._memory()),
            notes=("Too short: the standard errors are known to be too small.",) if short else (),
        )

    def _memory(self) -> tuple[str, ...]:
        if self._forgetting == 1.0:
            return ("Parameters do not change.",)
        length = 1.0 / (1.0 - self._forgetting)
        return (f"Parameters change little in {length:.0f} samples.",)


class FourierRegression:
    """Fourier transform regression (FTR): running finite Fourier transforms of all columns, and
    least squares between them whenever asked.

    Parameters
    ----------
    parameters : the k parameters.
    frequencies : (m,) [Hz], evenly spaced.

    Samples may be missing: the transforms of the constant and of the drift miss them as well.
    """

    def __init__(self, parameters: Parameters, frequencies: Array) -> None:
        self._parameters, self._frequencies = parameters, frequencies
        k = len(parameters.items)
        self._turn = -2j * np.pi * frequencies
        self._transforms = np.zeros((len(frequencies), k + 3), dtype=np.complex128)
        self._sum, self._row = np.zeros(k + 3), np.zeros(k + 3)
        self._first: Array | None = None
        self._varies = np.zeros(k, dtype=bool)
        self._start = self._last = 0.0
        self.samples = 0

    def update(self, time: float, regressors: Array, response: float) -> None:
        """Add one sample at `time` [s]: regressors (k,) and their response."""
        if self._first is None:
            self._start, self._first = time, np.array(regressors, dtype=np.float64)
        elif time <= self._last:
            raise InputError(f"time does not increase at {time:g} s", remedy="leave the sample out")
        k = len(self._first)
        elapsed = time - self._start
        row = self._row
        row[:k], row[k], row[k + 1], row[k + 2] = regressors, response, 1.0, elapsed
        self._transforms += np.exp(self._turn * elapsed)[:, None] * row
        self._sum += row
        self._varies |= np.abs(regressors - self._first) > STILL * np.abs(self._first)
        self._last = time
        self.samples += 1

    def record(self) -> BandRecord:
        """The transforms so far at the m frequencies, SI. Raises InputError before the second
        sample."""
        if self.samples < 2:
            raise InputError("one sample is too few", remedy="wait for more")
        step = (self._last - self._start) / (self.samples - 1)
        k = len(self._parameters.items)
        spectra, mean = step * self._transforms, self._sum / self.samples
        return BandRecord(
            spectra[:, :k],
            spectra[:, k],
            spectra[:, k + 1 :],
            mean[:k],
            float(mean[k]),
            self._varies,
            step * self.samples,
        )

    def fit(self) -> Fit:
        """Return the estimates so far, in SI units. Raises InputError before the second sample."""
        return _fourier_fit(self._parameters, [self.record()], self._frequencies)


def running_frequencies(highest: float) -> Array:
    """Return the frequencies [Hz], (m,), of Fourier transform regression up to about `highest`."""
    lowest = highest / _FREQUENCIES
    return np.arange(lowest, highest, 0.5 * lowest)


def fourier_regression(equation: LinearEquation, *, highest: float | None = None) -> Fit:
    """Fourier transform regression of whole records: the running transforms at their ends.

    highest : frequency [Hz]; None: where 95 % of the motion of every regressor lies below. It is
    the batch form of what `FourierRegression` gives while a log is written; the frequencies do not
    depend on the length of the record, as those of `frequency_domain_regression` do.

    Values are in SI units. Raises InputError for a record of one sample, and a band that the
    records do not hold.
    """
    band = band_of(equation, None, highest, None)
    frequencies = running_frequencies(float(band[-1]) if highest is None else highest)
    records = []
    for each in equation.records:
        running = FourierRegression(equation.parameters, frequencies)
        for time, regressors, response in zip(
            each.time, each.regressors, each.response, strict=True
        ):
            running.update(float(time), regressors, float(response))
        records.append(running.record())
    return with_histories(_fourier_fit(equation.parameters, records, frequencies), equation)


def _fourier_fit(parameters: Parameters, records: list[BandRecord], frequencies: Array) -> Fit:
    fit = band_fit(parameters, records, frequencies)
    return Fit(
        method="fourier-regression",
        estimates=fit.estimates,
        names=fit.names,
        covariance=fit.covariance,
        degrees_of_freedom=max(fit.free, 1.0),
        assumes=(*ASSUMES, "Parameters do not change."),
        notes=fit.notes,
    )


def recursive_least_squares(equation: LinearEquation, *, forgetting: float = 1.0) -> Fit:
    """Recursive least squares through all records, one after the other; values in SI units. Raises
    InputError for a forgetting outside 0 to 1."""
    return _through(RecursiveLeastSquares(equation.parameters, forgetting=forgetting), equation)


def normalised_recursive_least_squares(equation: LinearEquation, *, forgetting: float = 1.0) -> Fit:
    """Normalised recursive least squares (NRLS) through all records, one after the other; values in
    SI units. Raises InputError for a forgetting outside 0 to 1."""
    estimator = RecursiveLeastSquares(equation.parameters, forgetting=forgetting, normalised=True)
    return _through(estimator, equation)


def _through(estimator: RecursiveLeastSquares, equation: LinearEquation) -> Fit:
    for record in equation.records:
        for regressors, response in zip(record.regressors, record.response, strict=True):
            estimator.update(regressors, float(response))
    return with_histories(estimator.fit(), equation)
