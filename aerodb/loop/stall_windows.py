"""How well a flight's stall is predicted by what the other flights that stall agree with.

A stall lasts from its onset, where the angle of attack last rises through nine tenths of its
maximum (`NEAR`), to the attached flow that it comes back to: its minimum in the ten seconds that
follow. What is faster than the flow separates and attaches is buffet: errors are low-passed at
V/(30 c), because flow follows the angle of attack within some 20 to 30 chords (Jategaonkar 2015:
Tau2 = 21).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.coefficients import Comparison, band_limited
from aerodb.flight import Flight
from aerodb.increments import with_extrapolated_slopes
from aerodb.loop.flight_source import FlightSource
from aerodb.loop.stall import NEAR
from aerodb.signals import bridge, rms
from aerodb.support import Array
from aerodb.tables import AeroDatabase

_AXES: Final = ("C_lift", "C_drag", "Cm")
#: Longest time [s] from the largest angle of attack to attached flow.
_BACK: Final = 10.0
#: Length of the flow's memory that bounds the band, in chords.
_CHORDS: Final = 30.0
#: Most points of a series for a figure.
_POINTS: Final = 200


@dataclass(frozen=True)
class StallWindow:
    """A flight's stall, predicted by the other flights.

    Parameters
    ----------
    start, end : of the window, s from the flight's first sample. band : Hz, of the low pass.
    before, held, extrapolated : axis -> rms error in the window with the baseline, and with the
        stall that the others agree with, corrections held at the edge of their envelope or
        extrapolated.
    series : for a figure, at most 200 samples each: time [s], alpha [rad], and the lift measured,
        with the baseline (before) and predicted (held).
    """

    flight: str
    start: float
    end: float
    band: float
    before: Mapping[str, float]
    held: Mapping[str, float]
    extrapolated: Mapping[str, float]
    series: Mapping[str, tuple[float, ...]]


def stall_windows(
    source: FlightSource, baseline: AeroDatabase, predictors: Mapping[str, AeroDatabase]
) -> tuple[StallWindow, ...]:
    """Return the errors in the stall of each flight.

    predictors : flight (its id) -> the database that the other flights give it.

    Coefficients are dimensionless; the low pass is that of this module (Jategaonkar 2015).
    """
    found = []
    for flight, database in predictors.items():
        databases = (baseline, database, with_extrapolated_slopes(database))
        compared = [source.comparison(flight, each) for each in databases]
        found.append(_window(source.flight(flight), compared, baseline.reference.chord))
    return tuple(found)


def _window(flight: Flight, comparisons: Sequence[Comparison], chord: float) -> StallWindow:
    alpha = bridge(np.where(flight.usable(["alpha"]), flight["alpha"], np.nan))
    where = _stall(alpha, flight.step)
    speed = float(np.nanmean(flight["V"][where]))
    band = speed / (_CHORDS * chord)
    axes = [axis for axis in _AXES if all(axis in each.usable for each in comparisons)]

    def smooth(values: Array) -> Array:
        return band_limited(np.nan_to_num(values), flight.step, band)[where]

    errors = [{axis: rms(smooth(each.residual(axis))) for axis in axes} for each in comparisons]
    time = flight.time[where] - flight.time[0]
    before, held, _ = comparisons
    series = {"time": time, "alpha": alpha[where]}
    if "C_lift" in axes:
        series |= {
            "measured": smooth(before.measured["C_lift"]),
            "before": smooth(before.predicted["C_lift"]),
            "held": smooth(held.predicted["C_lift"]),
        }
    every = slice(None, None, -(-len(time) // _POINTS))
    thinned = {name: tuple(values[every].tolist()) for name, values in series.items()}
    start, end = float(time[0]), float(time[-1])
    return StallWindow(flight.id, start, end, band, errors[0], errors[1], errors[2], thinned)


def _stall(alpha: Array, step: float) -> slice:
    """Samples from onset to attached flow."""
    peak = int(np.argmax(alpha))
    below = np.flatnonzero(alpha[:peak] < NEAR * alpha[peak])
    onset = int(below[-1]) + 1 if len(below) else 0
    back = peak + int(np.argmin(alpha[peak : peak + max(1, round(_BACK / step))]))
    return slice(onset, back + 1)
