"""Low-order transfer functions with a delay, fitted to frequency responses.

``H(s) = gain exp(-delay s) prod (s + zero) prod (s^2 + 2 zeta omega s + omega^2) / (the same of
poles)``. Magnitude and phase are weighted by coherence; the cost J is that of Tischler & Remple,
*Aircraft and Rotorcraft System Identification*, 2012, eq. 11.4: below 100 a fit is acceptable,
below 50 it can hardly be told from the flight.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.fft import next_fast_len
from scipy.optimize import OptimizeResult, least_squares

from aerodb.errors import InputError
from aerodb.estimation.fit import Fit, ParameterEstimate, Standing
from aerodb.estimation.spectra.frequency_response import (
    COHERENT,
    FEWEST_WINDOWS,
    FrequencyResponse,
    frequency_responses,
)
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array, half_interval

Complex = NDArray[np.complex128]

#: Cost below which a fit is acceptable.
ACCEPTABLE: Final = 100.0
#: Weight of a squared error of phase [deg2] against one of magnitude [dB2].
_PHASE_WEIGHT = 0.01745
#: Decibels of a gain, per unit of its natural logarithm.
_DECIBEL = 20.0 / np.log(10.0)
#: Longest delay [s]: a longer one is no transport delay of controls or sensors.
_LONGEST = 2.0
#: Largest departure of a mode from the band, as a factor: farther ones do not show in the band.
_BEYOND = 10.0
#: Times that the smoothing by windows is taken out.
_CORRECTIONS = 2
#: Decay times in a record from which a response dies away in it.
_DIES_AWAY = 4.0
#: Relative standard error above which a parameter is not determined.
_LOOSE = 1.0
_UNITS: Final = {"omega": "rad/s", "zeta": "1", "delay": "s", "gain": "1"}


@dataclass(frozen=True)
class TransferFunction:
    """Structure of a transfer function.

    zeros, poles : their factors, 1 for a real one and 2 for a pair: q per elevator of the short
    period is ``zeros=(1,), poles=(2,)``. delay : whether there is one.
    """

    zeros: tuple[int, ...] = ()
    poles: tuple[int, ...] = (2,)
    delay: bool = True

    def __post_init__(self) -> None:
        if not self.poles or any(each not in (1, 2) for each in (*self.zeros, *self.poles)):
            raise InputError(
                "factors of a transfer function are 1 (real) or 2 (a pair), and it has poles",
                remedy="such as zeros (1,) and poles (2,)",
            )

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters: ``gain``, ``zero``, ``pole``, ``omega`` and ``zeta`` of pairs of
        poles, ``zero_omega`` and ``zero_zeta`` of pairs of zeros, numbered from the second on, and
        ``delay``; frequencies [rad/s], delay [s]."""
        names = ["gain"]
        for kind, factors in (("zero", self.zeros), ("pole", self.poles)):
            real, pairs = 0, 0
            for each in factors:
                if each == 1:
                    real += 1
                    names.append(kind + (str(real) if real > 1 else ""))
                else:
                    pairs += 1
                    number = str(pairs) if pairs > 1 else ""
                    prefix = "zero_" if kind == "zero" else ""
                    names += [f"{prefix}omega{number}", f"{prefix}zeta{number}"]
        return (*names, "delay") if self.delay else tuple(names)

    def slowest(self, values: Array) -> float:
        """Return the least decay [1/s] of a mode at values (p,); negative if it grows."""
        at, decays = 1 + sum(self.zeros), []
        for each in self.poles:
            size, damping = values[at], (values[at + 1] if each == 2 else 0.0)
            pair = np.roots([1.0, 2.0 * damping * size, size**2])
            decays.append(float(size) if each == 1 else float(-pair.real.max()))
            at += each
        return min(decays)

    def response(self, values: Array, omega: Array) -> Complex:
        """H (m,) at omega (m,) [rad/s] of the parameters (p,) in the order of `names`."""
        s, at = 1j * omega, 1
        result = np.full(len(omega), values[0], dtype=np.complex128)
        for factors, power in ((self.zeros, 1), (self.poles, -1)):
            for each in factors:
                if each == 1:
                    result *= (s + values[at]) ** power
                else:
                    size, damping = values[at], values[at + 1]
                    result *= (s**2 + 2.0 * damping * size * s + size**2) ** power
                at += each
        return result * np.exp(-values[at] * s) if self.delay else result


def transfer_function_fit(
    records: Sequence[TimeHistory],
    inputs: Sequence[str],
    output: str,
    structure: TransferFunction,
    *,
    lowest: float | None = None,
    highest: float | None = None,
) -> tuple[FrequencyResponse, Fit]:
    """Response of `output` to the first of the inputs, conditioned on the others, and a transfer
    function fitted to its coherent part.

    Parameters
    ----------
    records, inputs, output : as in `frequency_responses`.
    lowest, highest : band [rad/s]; None: that of the response.

    Windows smooth a response: the fitted transfer function is driven by the measured input, its
    response is estimated through the same windows, and what these did to it is taken out of the
    measured one (not for a fit with a slow or unstable mode, which is noted).

    Standard errors follow from the random errors of the response, which neighbouring frequencies
    share by their window, enlarged where the fit is worse than these. Without enough coherent
    frequencies every parameter is ``not excited``.
    """
    response = frequency_responses(records, inputs, output, lowest=lowest, highest=highest)[0]
    used = np.flatnonzero(response.usable)
    if len(used) <= len(structure.names):
        return response, _without_coherence(response, structure.names, len(used))
    problem = _Problem(structure, response, used)
    found = min((problem.solved(start) for start in problem.starts()), key=lambda r: float(r.cost))
    notes = []
    for _ in range(_CORRECTIONS):
        through = _through_windows(records, inputs, output, structure, found.x, response.omega)
        if through is None:
            notes.append("the smoothing by windows was not taken out: a mode is slow or unstable")
            break
        problem = _Problem(structure, response, used, through[used])
        found = problem.solved(found.x)
    return response, _answer(response, problem, used, found, notes)


def _through_windows(
    records: Sequence[TimeHistory],
    inputs: Sequence[str],
    output: str,
    structure: TransferFunction,
    values: Array,
    omega: Array,
) -> Complex | None:
    """Return what windows make of the response of a transfer function to the measured input,
    relative to the transfer function (m,); None where it does not die away within a record."""
    shortest = min(len(record.time) * record.step for record in records)
    if structure.slowest(values) * shortest < _DIES_AWAY:
        return None
    driven = []
    for record in records:
        known = {**record.outputs, **record.inputs}
        u = known[inputs[0]] - known[inputs[0]][0]
        size = next_fast_len(2 * len(u))
        at = np.asarray(2.0 * np.pi * np.fft.rfftfreq(size, record.step), dtype=np.float64)
        y = np.fft.irfft(structure.response(values, at) * np.fft.rfft(u, size), size)[: len(u)]
        driven.append(
            TimeHistory(record.name, record.time, {n: known[n] for n in inputs}, {output: y})
        )
    found = frequency_responses(
        driven, inputs, output, lowest=float(omega[0]), highest=float(omega[-1])
    )[0]
    ratio = found.response / structure.response(values, omega)
    return np.where(np.isfinite(ratio) & (np.abs(ratio) > 0.0), ratio, 1.0)


def _answer(
    response: FrequencyResponse,
    problem: "_Problem",
    used: NDArray[np.intp],
    found: OptimizeResult,
    notes: list[str],
) -> Fit:
    values, cost = np.asarray(found.x), 2.0 * float(found.cost)
    covariance, white, spread = problem.covariance(values)
    names, omega = problem.structure.names, response.omega[used]
    size = np.abs(values)
    if problem.structure.delay:  # a delay of zero is an estimate like any other
        size[-1] = 1.0 / omega.mean()
    numbers = zip(values, np.sqrt(np.diag(covariance)), size, np.sqrt(np.diag(white)), strict=True)
    quality = "acceptable" if cost < ACCEPTABLE else f"not acceptable, {ACCEPTABLE:g} is the limit"
    averages = float(response.averages[used].min())
    told = [
        f"cost J {cost:.1f} over {len(used)} frequencies from {omega[0]:.3g} to {omega[-1]:.3g}"
        f" rad/s: {quality}",
        f"coherence {response.coherence[used].min():.2f} to {response.coherence[used].max():.2f},"
        f" {averages:.1f} independent windows or more",
    ]
    if spread > 2.0:
        told.append(
            f"the structure does not follow the response within its random errors ({spread:.1f}"
            " times them): standard errors were enlarged by that"
        )
    return Fit(
        method="transfer-function",
        estimates=tuple(
            _estimate(name, *(float(each) for each in row))
            for name, row in zip(names, numbers, strict=True)
        ),
        names=names,
        covariance=covariance,
        converged=bool(found.success),
        iterations=int(found.nfev),
        assumes=("the input is measured without noise", "the response is linear in the band"),
        notes=(*told, *notes),
    )


def _estimate(
    name: str, value: float, error: float, size: float, white: float
) -> ParameterEstimate:
    unit = _UNITS.get(name.rstrip("0123456789").removeprefix("zero_"), "rad/s")
    standing: Standing = "estimated"
    reason = ""
    if not error < _LOOSE * size:
        standing = "not identifiable"
        reason = (
            f"the response leaves it open ({value:.3g} +- {half_interval(error):.2g}): drop it, or"
            " widen the band"
        )
        value = error = white = np.nan
    return ParameterEstimate(name, float(value), float(error), unit, standing, reason, float(white))


def _without_coherence(response: FrequencyResponse, names: Sequence[str], count: int) -> Fit:
    reason = (
        f"{response.input} and {response.output} have a coherence of {COHERENT:g} in"
        f" {FEWEST_WINDOWS:g} independent windows at {count} frequencies, and need"
        f" {len(names) + 1}: excite {response.input} longer or more"
    )
    return Fit(
        method="transfer-function",
        estimates=tuple(
            ParameterEstimate(name, np.nan, np.nan, "1", "not excited", reason) for name in names
        ),
        names=(),
        covariance=np.zeros((0, 0)),
        converged=False,
        notes=(reason,),
    )


class _Problem:
    """The weighted errors of magnitude and phase at the frequencies `used`; `through` : what
    windows do to the response there."""

    def __init__(
        self,
        structure: TransferFunction,
        response: FrequencyResponse,
        used: NDArray[np.intp],
        through: Complex | None = None,
    ) -> None:
        self.structure = structure
        self._omega, self._measured = response.omega[used], response.response[used]
        if through is not None:
            self._measured = self._measured / through
        self._error, self._window = response.random_error[used], response.window[used]
        coherence = 1.58 * (1.0 - np.exp(-response.smooth_coherence[used]))
        scale = np.sqrt(20.0 / len(used)) * coherence
        degree = np.sqrt(_PHASE_WEIGHT) * 180.0 / np.pi
        self._weight = np.concatenate([_DECIBEL * scale, degree * scale])

    def errors(self, values: Array) -> Array:
        """Errors (2 m,) of the logarithm of the magnitude and of the phase [rad]."""
        ratio = self._measured / self.structure.response(values, self._omega)
        ratio = np.where(np.isfinite(ratio) & (ratio != 0.0), ratio, 1e6)
        return np.concatenate([np.log(np.abs(ratio)), np.angle(ratio)])

    def weighted(self, values: Array) -> Array:
        """The errors by their weights: their squares sum to J."""
        return np.asarray(self._weight * self.errors(values))

    def solved(self, start: Array) -> OptimizeResult:
        """The optimum from these start values; its cost is J / 2."""
        low, high = self._bounds(start)
        return least_squares(
            self.weighted,
            np.clip(start, low, high),
            bounds=(low, high),
            x_scale=np.maximum(np.abs(start), 1e-3),
            max_nfev=200,
        )

    def _bounds(self, start: Array) -> tuple[Array, Array]:
        low, high = np.full(len(start), -np.inf), np.full(len(start), np.inf)
        for k, name in enumerate(self.structure.names):
            if "omega" in name:
                low[k], high[k] = self._omega[0] / _BEYOND, self._omega[-1] * _BEYOND
            elif "zeta" in name:
                low[k], high[k] = -2.0, 5.0
            elif name == "delay":
                low[k], high[k] = -_LONGEST, _LONGEST
            elif name != "gain":
                low[k], high[k] = -self._omega[-1] * _BEYOND, self._omega[-1] * _BEYOND
        return low, high

    def starts(self) -> list[Array]:
        """Start values: modes at several places of the band, the gain from the response."""
        found = []
        places = np.geomspace(self._omega[0], self._omega[-1], 6)
        for low, high in pairwise(places):
            for sign in (1.0, -1.0):
                middle = np.sqrt(low * high)
                values = np.array([self._start(name, middle) for name in self.structure.names])
                shape = self.structure.response(values, self._omega)
                size = np.exp(np.mean(np.log(np.abs(self._measured / shape))))
                values[0] = sign * size
                found.append(values)
        found.sort(key=lambda values: float(np.sum(self.weighted(values) ** 2)))
        return found[:6]

    @staticmethod
    def _start(name: str, place: float) -> float:
        number = int("".join(c for c in name if c.isdigit()) or 1)
        if "zeta" in name:
            return 0.5
        if name == "delay":
            return 0.01
        return 1.0 if name == "gain" else place * 2.0 ** (number - 1)

    def covariance(self, values: Array) -> tuple[Array, Array, float]:
        """Covariance (p, p) of the estimates, that for independent frequencies, and how many times
        their random errors the response departs from the fit (rms)."""
        jacobian = np.empty((2 * len(self._omega), len(values)))
        for k in range(len(values)):
            step = np.zeros(len(values))
            step[k] = 1e-6 * max(abs(values[k]), 1e-3)
            jacobian[:, k] = (self.errors(values + step) - self.errors(values - step)) / (
                2.0 * step[k]
            )
        scale = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300)
        gain = np.linalg.pinv(self._weight[:, None] * jacobian / scale) * self._weight
        gain = gain / scale[:, None]
        error = np.tile(self._error, 2)
        shared = np.kron(np.eye(2), _shared(self._omega, self._window))
        covariance = (gain * error) @ shared @ (gain * error).T
        white = (gain * error) @ (gain * error).T
        departure = self.errors(values) / error
        spread = float(np.sqrt(np.mean(departure**2)))
        return covariance * max(1.0, spread**2), white, spread


def _shared(omega: Array, window: Array) -> Array:
    """Correlation (m, m) of spectra at two frequencies by their Hann window: the squared transform
    of the squared window."""
    length = np.minimum(window[:, None], window)
    x = np.abs(omega[:, None] - omega) * length / (2.0 * np.pi)
    # The transform of w^2 = 3/8 - cos/2 + cos(2)/8 over the window's length, relative to x = 0.
    total = sum(
        weight * (np.sinc(x - shift) + np.sinc(x + shift))
        for shift, weight in ((0.0, 3.0 / 16.0), (1.0, 1.0 / 4.0), (2.0, 1.0 / 32.0))
    )
    return np.asarray((total / (3.0 / 8.0)) ** 2)
