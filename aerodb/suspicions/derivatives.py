"""How much of each derivative of a database a flight shows.

On each axis the measured coefficient is regressed on the predicted part of each variable (the
slope of the database times the variable) in the band of manoeuvres, with what else the database
predicts taken off first. A regression coefficient of one says that the flight agrees.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import SAMPLES_PER_PERIOD, SETTLED
from aerodb.estimation import Regression, least_squares
from aerodb.flight import Flight
from aerodb.nomenclature import is_surface
from aerodb.signals import band_passed
from aerodb.support import Array
from aerodb.suspicions.equation_error import FASTEST, SLOWEST, averaged
from aerodb.suspicions.evidence import FEWEST
from aerodb.suspicions.in_flight import HUGE, flying
from aerodb.tables import AeroDatabase, slopes_by

#: Axes that are looked at: the axial force is the thrust's as much as the air's.
AXES = ("CY", "CZ", "Cl", "Cm", "Cn")
#: Samples at which slopes of the database are taken.
_POINTS = 300
#: Least share of an axis' predicted variation for a motion to be a regressor.
_SMALL = 0.02
_MOTION = ("alpha", "beta", "p", "q", "r")
#: Without its flow angle an axis says nothing: what the angle does would be others'.
_ANGLE = {"CY": "beta", "CZ": "alpha", "Cl": "beta", "Cm": "alpha", "Cn": "beta"}


@dataclass(frozen=True)
class Share:
    """A derivative as a flight shows it, over that of the database.

    ratio, error : the regression coefficient and its standard error. weight : root mean square of
    the predicted part over that of all parts of the axis. vif : variance inflation.
    """

    axis: str
    variable: str
    ratio: float
    error: float
    weight: float
    vif: float


@dataclass(frozen=True)
class AxisShares:
    """One axis: what was measured less what the parts do not predict, and the part of each
    variable, (m,) each, band-passed; means of `every` samples, `step` s apart.

    slopes : variable -> mean dC/dvariable of the database, of all surfaces, moved or not.
    """

    axis: str
    measured: Array
    parts: Mapping[str, Array]
    slopes: Mapping[str, float]
    where: NDArray[np.bool_]
    step: float

    def weight(self, name: str) -> float:
        """Root mean square of a part over that of all parts. A scalar, dimensionless."""
        sizes = {n: float(np.std(part[self.where])) for n, part in self.parts.items()}
        return sizes[name] / float(np.sqrt(sum(size**2 for size in sizes.values())))

    def fit(self, shifted: str = "", lag: int = 0) -> Regression | None:
        """Return the regression, with one part shifted by `lag` samples; None where it cannot be
        solved.

        Columns (m, k) and the coefficient (m,) are dimensionless.
        """
        parts = {n: np.roll(v, lag) if n == shifted else v for n, v in self.parts.items()}
        if not parts:
            return None
        matrix = np.column_stack([values[self.where] for values in parts.values()])
        try:
            fit = least_squares(matrix, self.measured[self.where], tuple(parts))
        except ValueError:
            return None
        return fit if np.all(np.isfinite(fit.standard_errors)) else None

    def beside_lags(self) -> Regression | None:
        """Return the regression with the rate of the flow angle beside it: downwash and sidewash
        lag behind the flow, and the noise of a vane is fast. None where it cannot be solved.

        Columns (m, k) and the coefficient (m,) are dimensionless.
        """
        angle = _ANGLE[self.axis]
        if angle not in self.parts:
            return None
        rate = np.gradient(self.parts[angle], self.step)
        return replace(self, parts={**self.parts, f"{angle} rate": rate}).fit()

    def likeliest_lag(self, name: str, lags: Sequence[int]) -> int:
        """Return the shift (samples) of a part with which the regression explains most.

        Every part is (m,) and dimensionless.
        """
        others = [part[self.where] for n, part in self.parts.items() if n != name]
        rest = self.measured[self.where] - float(np.mean(self.measured[self.where]))
        basis = np.linalg.qr(np.column_stack(others))[0] if others else np.zeros((len(rest), 0))
        rest = rest - basis @ (basis.T @ rest)

        def explained(lag: int) -> float:
            moved = np.roll(self.parts[name], lag)[self.where]
            own = moved - basis @ (basis.T @ moved)
            size = float(own @ own)
            return float(rest @ own) ** 2 / size if size > 0.0 else 0.0

        return max(lags, key=explained)

    def share(self, fit: Regression, name: str) -> Share:
        """Return one derivative of a fit.

        Dimensionless: the ratio of the flight to the database. Raises ValueError for a name that
        the fit lacks.
        """
        k = fit.names.index(name)
        error, vif = float(fit.standard_errors[k]), float(fit.vif[k])
        return Share(self.axis, name, float(fit.estimates[k]), error, self.weight(name), vif)

    def agreement(self) -> float:
        """Return the part of the variation that the database explains as it is; negative where it
        predicts more than there is.

        A scalar, dimensionless, at most 1.
        """
        measured = self.measured[self.where]
        left = measured - sum(part[self.where] for part in self.parts.values())
        return 1.0 - float(np.var(left)) / max(float(np.var(measured)), 1e-300)

    def inside(self, samples: int) -> "AxisShares":
        """Return the axis without its first and last `samples`: the mask (n,) becomes false
        there."""
        where = self.where.copy()
        where[:samples], where[len(where) - samples :] = False, False
        return replace(self, where=where)


def axis_shares(
    flight: Flight,
    database: AeroDatabase,
    measured: Mapping[str, Array],
    predicted: Mapping[str, Array],
    usable: Mapping[str, NDArray[np.bool_]],
    bandwidth: float | None,
) -> dict[str, AxisShares]:
    """Return what is regressed on each axis that can be judged.

    measured, predicted, usable : axis -> (n,), as `aerodb.coefficients.compare` gives them.
    bandwidth : Hz, of both; None: not limited.
    """
    high = min(bandwidth or FASTEST, FASTEST, 0.4 / flight.step)
    where = flying(flight, [n for n in ("V", "qbar") if n in flight])
    if "qbar" not in flight or where.sum() * flight.step < SETTLED or high < 0.5:
        return {}
    names = [name for name in database.inputs if name in flight]
    slopes = _slopes(flight, database, where & flight.usable(names))
    middle = max(float(np.median(flight["qbar"][where])), 1e-9)
    every = max(1, int(1.0 / (SAMPLES_PER_PERIOD * high * flight.step)))
    found = {}
    for axis in AXES:
        angle = _ANGLE[axis]
        if axis not in measured or not slopes.get(axis) or angle not in flight:
            continue
        if not np.ptp(flight[angle][where]) > 0.0:
            continue
        good = where & usable[axis] & np.isfinite(measured[axis]) & np.isfinite(predicted[axis])
        good &= (np.abs(measured[axis]) < HUGE) & (flight["qbar"] > 0.0)
        if good.sum() < FEWEST:
            continue
        banded = _Banded(good, flight["qbar"] / middle, flight.step, every, high)
        found[axis] = _axis(axis, flight, slopes[axis], banded, measured[axis], predicted[axis])
    return {axis: each for axis, each in found.items() if each.parts}


@dataclass(frozen=True)
class _Banded:
    """Channels as they are regressed: weighted by dynamic pressure, averaged, band-passed."""

    good: NDArray[np.bool_]
    weight: Array
    step: float
    every: int
    high: float

    def __call__(self, values: Array) -> Array:
        thin = averaged(np.where(self.good, values * self.weight, np.nan), self.every)
        low = max(SLOWEST, 1.5 / (float(self.good.sum()) * self.step))
        return band_passed(thin, self.step * self.every, low, self.high)

    @property
    def inside(self) -> NDArray[np.bool_]:
        return np.isfinite(averaged(np.where(self.good, 0.0, np.nan), self.every))


def _axis(
    axis: str,
    flight: Flight,
    slopes: Mapping[str, float],
    banded: _Banded,
    measured: Array,
    predicted: Array,
) -> AxisShares:
    inside, good = banded.inside, banded.good
    parts: dict[str, Array] = {}
    for name, slope in slopes.items():
        if slope == 0.0 or not np.all(np.abs(flight[name][good]) < HUGE):
            continue
        part = banded(slope * (flight[name] - float(np.median(flight[name][good]))))
        whole = whole_surface(name, flight)
        parts[whole] = parts[whole] + part if whole in parts else part
    sizes = {name: float(np.std(part[inside])) for name, part in parts.items()}
    total = float(np.sqrt(sum(size**2 for size in sizes.values())))
    parts = {
        name: part
        for name, part in parts.items()
        if sizes[name] > 0.0 and (is_surface(name) or sizes[name] > _SMALL * total)
    }
    rest = banded(predicted) - sum(parts.values())
    step = banded.step * banded.every
    return AxisShares(axis, banded(measured) - rest, parts, slopes, inside, step)


def _slopes(
    flight: Flight, database: AeroDatabase, good: NDArray[np.bool_]
) -> dict[str, dict[str, float]]:
    """Axis -> variable -> mean slope over samples spread over the flight."""
    rows = np.flatnonzero(good)
    if len(rows) < FEWEST:
        return {}
    rows = rows[np.linspace(0, len(rows) - 1, min(len(rows), _POINTS)).astype(int)]
    sampled = {name: flight[name][rows] for name in flight.channels}
    found: dict[str, dict[str, float]] = {}
    for name in _judged(flight.channels):
        for axis, slope in slopes_by(database, name, sampled).items():
            mean = float(np.mean(slope))
            if np.isfinite(mean):
                found.setdefault(axis, {})[name] = mean
    return found


def _judged(names: Iterable[str]) -> list[str]:
    """Variables of which a part is predicted: the motion and surfaces."""
    return [n for n in names if n in _MOTION or (is_surface(n) and n != "delta_landing_gear")]


def whole_surface(name: str, flight: Flight) -> str:
    """Return the name of the surface of which a channel is one of two sides, or the channel's."""
    stem = name.removesuffix("_right").removesuffix("_left")
    both = f"{stem}_right" in flight and f"{stem}_left" in flight
    return stem if stem != name and both else name
