"""Angular accelerations as moment coefficients, and what they are regressed on (equation error)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.fft import prev_fast_len

from aerodb.conditioning import LARGEST_DELAY, SAMPLES_PER_PERIOD, SETTLED
from aerodb.estimation import Regression, least_squares
from aerodb.flight import Flight
from aerodb.signals import band_passed, smooth
from aerodb.support import Array
from aerodb.suspicions.evidence import FEWEST, STILL
from aerodb.suspicions.in_flight import HUGE, flying, known_masses
from aerodb.suspicions.surfaces import Control, along
from aerodb.vehicle import Vehicle

#: Lower edge of the band of manoeuvres [Hz]: slower is trim.
SLOWEST = 0.05
#: Upper edge of the band, where the vehicle file states no bandwidth [Hz].
FASTEST = 3.0
#: Logarithm of how many delays may be taken for one by chance: of motion up to `FASTEST`, two a
#: period are independent.
DELAYS_TRIED = float(np.log(4.0 * FASTEST * LARGEST_DELAY))
#: Rate whose sensor measures the moment about each axis.
RATE_OF = {"pitch": "q", "roll": "p", "yaw": "r"}
#: Motion that the moment about each axis depends on.
MOTION = {"pitch": ("alpha", "q"), "roll": ("beta", "p", "r"), "yaw": ("beta", "p", "r")}


@dataclass(frozen=True)
class EquationError:
    """What is regressed about one axis: the band-passed moment and its regressors, means of `every`
    samples of the flight from its sample `first` on.

    bent : what the moment may depend on as well: the rate of the flow angle (downwash that lags)
    and its product with alpha (a slope that changes)."""

    role: str
    moment: Array
    motion: Mapping[str, Array]
    controls: Mapping[str, Array]
    where: NDArray[np.bool_]
    step: float
    every: int
    bent: Mapping[str, Array]
    first: int = 0

    def thinned(self, values: Array) -> Array:
        """Return a channel of the flight at the samples of the regression.

        values : (n,), of which (m,) are left, as many as in `where`; the unit stays.
        """
        return values[self.first :: self.every][: len(self.where)]

    def likeliest_lag(self, name: str, lags: Sequence[int]) -> int:
        """Return the shift (samples) of a control with which the regression explains most.

        Controls are (m,) [rad].
        """
        others = {**self.motion, **{n: v for n, v in self.controls.items() if n != name}}
        basis = np.linalg.qr(np.column_stack([v[self.where] for v in others.values()]))[0]
        moment = self.moment[self.where]
        rest = moment - basis @ (basis.T @ moment)

        def explained(lag: int) -> float:
            moved = np.roll(self.controls[name], lag)[self.where]
            own = moved - basis @ (basis.T @ moved)
            size = float(own @ own)
            common = float(rest @ own)
            return common * common / size if size > 0.0 else 0.0

        return max(lags, key=explained)

    def fit(self, controls: Mapping[str, Array] | None = None) -> Regression | None:
        """Return the regression; None where it cannot be solved.

        controls : name -> (m,) [rad], in place of its own; columns (m, k).
        """
        columns = {**self.motion, **(self.controls if controls is None else controls)}
        matrix = np.column_stack([values[self.where] for values in columns.values()])
        try:
            return least_squares(matrix, self.moment[self.where], tuple(columns))
        except ValueError:
            return None


def equation_errors(
    flight: Flight, vehicle: Vehicle, controls: Mapping[str, Control]
) -> dict[str, EquationError]:
    """Return what is regressed, for each axis on which the flight has rates and controls.

    Rates [rad/s], deflections [rad], (n,) in the flight. Source: `docs/method/consistency.md`,
    section "Against the vehicle".
    """
    known = known_masses(flight, vehicle)
    rates = [name for name in ("p", "q", "r") if name in flight]
    if len(rates) < 3 or not {"V", "qbar"} <= set(flight.channels) or "Izz" not in known:
        return {}
    needed = [*rates, "V", "qbar", *(n for n in ("alpha", "beta") if n in flight)]
    where = flying(flight, needed) & (flight["qbar"] > 0.0)
    step, high = flight.step, min(vehicle.processing.bandwidth or FASTEST, FASTEST)
    high = min(high, 0.4 / step)
    if where.sum() < FEWEST or where.sum() * step < SETTLED or high < 0.5:
        return {}
    every = max(1, int(1.0 / (SAMPLES_PER_PERIOD * high * step)))
    # Filters end where the flight does: held over a roll, a rate bends at touchdown.
    flown = np.flatnonzero(where)
    first, last = int(flown[0]), int(flown[-1]) + 1

    def mean(values: Array) -> Array:
        return averaged(values[first:last], every)

    raw = {name: np.where(where, along(flight, each), np.nan) for name, each in controls.items()}
    raw = {name: mean(v) for name, v in raw.items() if np.all(np.abs(v[where]) < HUGE)}
    load = None if "alpha" in flight else _load(flight, where)
    clean = {name: mean(np.where(where, flight[name], np.nan)) for name in needed}
    known = {name: mean(values) for name, values in known.items()}
    step, where = step * every, np.isfinite(mean(np.where(where, 0.0, np.nan)))
    smoothed = {name: smooth(clean[name], step, high) for name in rates}
    p, q, r = (smoothed[name].value for name in "pqr")
    pdot, qdot, rdot = (smoothed[name].rate for name in "pqr")
    ixx, iyy, izz = (np.nan_to_num(known[n], posinf=0.0) for n in ("Ixx", "Iyy", "Izz"))
    ixz = known["Ixz"] if "Ixz" in known else np.zeros_like(ixx)
    size = vehicle.reference
    force = float(np.median(clean["qbar"][where])) * size.area
    speed = np.where(where, clean["V"], np.median(clean["V"][where]))
    weight = clean["qbar"] * size.area / force
    moments = {
        "roll": (ixx * pdot - ixz * (rdot + p * q) + (izz - iyy) * q * r) / (force * size.span),
        "pitch": (iyy * qdot + (ixx - izz) * p * r + ixz * (p**2 - r**2)) / (force * size.chord),
        "yaw": (izz * rdot - ixz * (pdot - q * r) + (iyy - ixx) * p * q) / (force * size.span),
    }
    hats = {
        "p": smoothed["p"].value * size.span / (2.0 * speed),
        "q": smoothed["q"].value * size.chord / (2.0 * speed),
        "r": smoothed["r"].value * size.span / (2.0 * speed),
    }
    states: dict[str, Array] = {**hats}
    states |= {name: clean[name] for name in ("alpha", "beta") if name in clean}
    if load is not None:
        states["alpha"] = mean(load)
    low = max(SLOWEST, 1.5 / (where.sum() * step))

    def banded(values: Array) -> Array:
        return band_passed(values, step, low, high)

    deflected = {name: banded(values * weight) for name, values in raw.items()}
    deflected = {
        name: values
        for name, values in deflected.items()
        if float(np.std(values[where])) > (0.0 if controls[name].role else STILL)
    }
    found = {}
    for role, motion in MOTION.items():
        moves = {
            name: banded(states[name] * np.nan_to_num(weight, nan=1.0))
            for name in motion
            if name in states
        }
        lateral = role != "pitch"
        acting = {
            name: values
            for name, values in deflected.items()
            if controls[name].lateral is None or controls[name].lateral == lateral
        }
        found[role] = EquationError(
            role,
            banded(moments[role]),
            moves,
            acting,
            where,
            step,
            every,
            {
                f"{motion[0]} {how}": banded(values * np.nan_to_num(weight, nan=1.0))
                for how, values in _bent(states, motion[0], step).items()
            },
            first,
        )
    return found


def _bent(states: Mapping[str, Array], angle: str, step: float) -> dict[str, Array]:
    """How a moment depends on a flow angle beside in proportion to it: by its rate, and by its
    product with alpha."""
    if angle not in states:
        return {}
    found = {"rate": np.gradient(states[angle], step)}
    if "alpha" in states:
        found["times alpha"] = states[angle] * (states["alpha"] - np.nanmean(states["alpha"]))
    return found


def averaged(values: Array, every: int) -> Array:
    """Return the means of `every` samples each; nan where one of them is.

    The last few (less than 1 %) are dropped, so that the number suits a fast Fourier transform.

    values : (n,), any unit.
    """
    count = int(prev_fast_len(len(values) // every - 1)) + 1
    return values[: count * every].reshape(count, every).mean(axis=1)


def _load(flight: Flight, where: NDArray[np.bool_]) -> Array | None:
    """Return the normal force over dynamic pressure, which stands for a missing alpha."""
    name = next((n for n in ("az", "az_imu") if n in flight), None)
    if name is None or not np.all(np.abs(flight[name][where]) < HUGE):
        return None
    return np.where(where, -flight[name] / np.where(where, flight["qbar"], 1.0), np.nan)
