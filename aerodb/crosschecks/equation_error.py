"""Angular accelerations as moment coefficients, and what they are regressed on (equation error)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import low_passed, smooth
from aerodb.crosschecks.in_flight import HUGE, flying, known_masses
from aerodb.crosschecks.surfaces import Control, along
from aerodb.estimation import Regression, least_squares
from aerodb.flight import Flight
from aerodb.support import Array
from aerodb.vehicle import Vehicle

#: Band of manoeuvres [Hz], where the vehicle file states no bandwidth; slower is trim.
SLOWEST, FASTEST = 0.05, 3.0
#: Samples kept per period of the fastest motion.
SAMPLES = 8.0
#: Least motion [rad, rms in the band] of any surface to be a regressor: less is noise; and of one
#: without a role, which only matters where it moves much.
LEAST, LEAST_OTHER = 1e-5, 3e-3
#: Motion that the moment about each axis depends on.
MOTION = {"pitch": ("alpha", "q"), "roll": ("beta", "p", "r"), "yaw": ("beta", "p", "r")}


@dataclass(frozen=True)
class EquationError:
    """What is regressed about one axis: the band-passed moment and its regressors, at every
    `every`-th sample of the flight."""

    role: str
    moment: Array
    motion: Mapping[str, Array]
    controls: Mapping[str, Array]
    where: NDArray[np.bool_]
    step: float
    every: int

    def likeliest_lag(self, name: str, lags: Sequence[int]) -> int:
        """Return the shift (samples) of a control with which the regression explains most."""
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
        """Return the regression; None where it cannot be solved."""
        columns = {**self.motion, **(self.controls if controls is None else controls)}
        matrix = np.column_stack([values[self.where] for values in columns.values()])
        try:
            return least_squares(matrix, self.moment[self.where], tuple(columns))
        except ValueError:
            return None


def equation_errors(
    flight: Flight, vehicle: Vehicle, controls: Mapping[str, Control]
) -> dict[str, EquationError]:
    """Return what is regressed, for each axis on which the flight has rates and controls."""
    known = known_masses(flight, vehicle)
    rates = [name for name in ("p", "q", "r") if name in flight]
    if len(rates) < 3 or not {"V", "qbar"} <= set(flight.channels) or "Izz" not in known:
        return {}
    needed = [*rates, "V", "qbar", *(n for n in ("alpha", "beta") if n in flight)]
    where = flying(flight, needed) & (flight["qbar"] > 0.0)
    step, high = flight.step, min(vehicle.processing.bandwidth or FASTEST, FASTEST)
    high = min(high, 0.4 / step)
    if where.sum() < 100 or where.sum() * step < 5.0 or high < 0.5:
        return {}
    clean = {name: np.where(where, flight[name], np.nan) for name in needed}
    smoothed = {name: smooth(clean[name], step, high) for name in rates}
    p, q, r = (smoothed[name].value for name in "pqr")
    pdot, qdot, rdot = (smoothed[name].rate for name in "pqr")
    ixx, iyy, izz = (np.nan_to_num(known[n], posinf=0.0) for n in ("Ixx", "Iyy", "Izz"))
    ixz = known["Ixz"] if "Ixz" in known else np.zeros_like(ixx)
    size = vehicle.reference
    force = float(np.median(flight["qbar"][where])) * size.area
    speed = float(np.median(flight["V"][where]))
    weight = np.where(where, flight["qbar"], np.nan) * size.area / force
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
    if "alpha" not in states and (load := _load(flight, where)) is not None:
        states["alpha"] = load
    low = max(SLOWEST, 1.5 / (where.sum() * step))

    def banded(values: Array) -> Array:
        slow = low_passed(values, step, low)
        return low_passed(values, step, high) - slow

    raw = {
        name: np.where(where, along(flight, control), np.nan) * weight
        for name, control in controls.items()
    }
    deflected = {name: banded(v) for name, v in raw.items() if np.all(np.abs(v[where]) < HUGE)}
    deflected = {
        name: values
        for name, values in deflected.items()
        if float(np.std(values[where])) > (LEAST if controls[name].role else LEAST_OTHER)
    }
    found = {}
    every = max(1, int(1.0 / (SAMPLES * high * step)))
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
            banded(moments[role])[::every],
            {name: values[::every] for name, values in moves.items()},
            {name: values[::every] for name, values in acting.items()},
            where[::every],
            step * every,
            every,
        )
    return found


def _load(flight: Flight, where: NDArray[np.bool_]) -> Array | None:
    """Return the normal force over dynamic pressure, which stands for a missing alpha."""
    name = next((n for n in ("az", "az_imu") if n in flight), None)
    if name is None or not np.all(np.abs(flight[name][where]) < HUGE):
        return None
    return np.where(where, -flight[name] / np.where(where, flight["qbar"], 1.0), np.nan)
