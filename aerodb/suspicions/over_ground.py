"""Airspeed against the speed over ground of a turning flight, with a wind that is steady.

Over a turn the velocities over ground lie on a circle: its middle is the wind, its radius the
airspeed. Airspeed indicators are calibrated so, by legs in several directions.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import STEADY_WIND_ALTITUDE, STEADY_WIND_TIME, Suspicion
from aerodb.estimation import samples_per_independent
from aerodb.flight import Flight
from aerodb.physics import DENSITY_0
from aerodb.support import LARGE, NOTABLE, Array
from aerodb.suspicions.evidence import ERRORS

#: Least share of all directions that the track of a turn covers: over less, a wind that changes
#: looks like an airspeed that does.
COVERED: Final = LARGE
#: Least factor of the airspeed that is said: tubes beside a fuselage or propeller err by less.
WRONG: Final = 1.25
#: Largest rms of what the circle leaves, as a share of the airspeed: gusts of a rough day.
LEFT: Final = NOTABLE
#: Step [s] at which samples are compared: the motion of a turn is slower.
STEP: Final = 1.0
#: Sectors into which directions are counted, of 30 deg each.
_SECTORS: Final = 12
#: Factors that are units: what a speed in this unit is times one in m/s.
_UNITS: Final = {"kt": 1.943844, "km/h": 3.6, "mph": 2.236936, "ft/s": 3.28084}

Rows = NDArray[np.intp]


@dataclass(frozen=True)
class _Turn:
    """What one turn says: logged airspeed over the true one, and its standard error."""

    start: float
    end: float
    ratio: float
    error: float

    @property
    def contradicts(self) -> bool:
        return abs(np.log(self.ratio)) - ERRORS * self.error / self.ratio > np.log(WRONG)


def over_ground_suspicions(flight: Flight) -> tuple[Suspicion, ...]:
    """Return the contradiction of airspeed and speed over ground, by a factor in all turns or in
    some; empty where the track does not turn (`COVERED`) or one of the two is not logged.

    Speeds [m/s], channels (n,). Source: `docs/method/consistency.md`, section "Against the
    vehicle".
    """
    needed = ("V", "velocity_north", "velocity_east")
    if any(name not in flight for name in needed):
        return ()
    turns = list(_turns(flight))
    wrong = [turn for turn in turns if turn.contradicts]
    if not wrong or len({turn.ratio > 1.0 for turn in wrong}) > 1:
        return ()
    ratio = float(np.median([turn.ratio for turn in wrong]))
    some = f", from {wrong[0].start:.0f} to {wrong[-1].end:.0f} s"
    when = some if len(wrong) < len(turns) else ""
    words = (
        f"V is {ratio:.2f} times the airspeed that speed over ground gives in turns, with a steady"
        f" wind{when}: {_cause(flight, ratio)}"
    )
    return (Suspicion("V", "scale", words, {"ratio": ratio, "turns": float(len(wrong))}),)


def _cause(flight: Flight, ratio: float) -> str:
    unit = next((name for name, size in _UNITS.items() if abs(ratio / size - 1.0) < 0.05), "")
    if unit:
        return f"it may be in {unit}"
    if "rho" in flight and np.isfinite(rho := float(np.nanmedian(flight["rho"]))) and rho > 0.0:
        calibrated = float(np.sqrt(rho / DENSITY_0))
        if abs(ratio / calibrated - 1.0) < 0.05:
            return "it may be calibrated airspeed, not true airspeed"
    return "the scale of its sensor, or its tube, is wrong"


def _turns(flight: Flight) -> Iterator[_Turn]:
    """The turns of a flight, each with what it says; stretches follow each other."""
    names = [n for n in ("V", "velocity_north", "velocity_east") if n in flight]
    good = flight.usable(names, despite=("implausible", "stuck"))
    rows = np.flatnonzero(good)[:: max(1, round(STEP / flight.step))]
    time, height = flight.time[rows], _height(flight, rows)
    first = 0
    for last in range(1, len(rows) + 1):
        inside = slice(first, last)
        full = last == len(rows) or time[last] - time[first] > STEADY_WIND_TIME
        if full or np.ptp(np.append(height[inside], height[last])) > STEADY_WIND_ALTITUDE:
            turn = _turn(flight, rows[inside])
            if turn is not None:
                yield turn
            first = last


def _height(flight: Flight, rows: Rows) -> Array:
    name = next((n for n in ("altitude", "height_above_ground") if n in flight), None)
    return np.zeros(len(rows)) if name is None else np.nan_to_num(flight[name][rows])


def _turn(flight: Flight, rows: Rows) -> _Turn | None:
    """What one stretch says; None where its track does not turn, or no circle fits."""
    shown, north, east = (flight[n][rows] for n in ("V", "velocity_north", "velocity_east"))
    down = flight["velocity_down"][rows] if "velocity_down" in flight else np.zeros(len(rows))
    ground = np.hypot(north, east)
    moving = (ground > 0.0) & (shown > 0.5 * np.quantile(shown, 0.95)) & np.isfinite(down)
    shown, north, east, down = (each[moving] for each in (shown, north, east, down))
    if len(shown) < 2 * _SECTORS:
        return None
    scale = float(np.mean(shown)) / max(float(np.mean(ground)), 1e-9)
    start = np.array([np.mean(north), np.mean(east), scale])

    def left(x: Array) -> Array:
        true = np.sqrt((north - x[0]) ** 2 + (east - x[1]) ** 2 + down**2)
        return np.asarray(shown - x[2] * true)

    from scipy.optimize import least_squares  # here: a log that is inspected needs none

    fit = least_squares(left, start)
    ratio, residual = float(fit.x[2]), np.asarray(fit.fun)
    heading = np.arctan2(east - fit.x[1], north - fit.x[0])
    sectors = np.unique(np.floor((heading + np.pi) / (2 * np.pi) * _SECTORS)).size
    if not (ratio > 0.0 and sectors >= COVERED * _SECTORS):
        return None
    if float(np.sqrt(np.mean(residual**2))) > LEFT * float(np.mean(shown)):
        return None
    independent = len(residual) / samples_per_independent(residual)
    slopes = np.asarray(fit.jac, dtype=np.float64)
    spread = float(np.linalg.pinv(slopes.T @ slopes)[2, 2])
    error = float(np.sqrt(spread * np.sum(residual**2) / independent))
    times = flight.time[rows]
    return _Turn(float(times[0]), float(times[-1]), ratio, error)
