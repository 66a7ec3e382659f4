"""Records of files without a vehicle: the columns that a linear model names, cut at gaps."""

import re
from typing import Final

import numpy as np

from aerodb.conditioning import spikes
from aerodb.errors import InputError
from aerodb.estimation import TimeHistory
from aerodb.signals import clean_clock, interval, is_uniform, uniform_grid
from aerodb.support import Array

#: Steps of time longer than this many sampling intervals are gaps.
_GAP: Final = 3.0
#: Longest stretch of a missing input that is bridged [s].
_BRIDGED: Final = 0.25
#: Fewest samples of a record.
_FEWEST: Final = 10
#: Most decimals of rounded time stamps.
_DECIMALS: Final = 7


def time_histories(
    name: str, time: Array, inputs: dict[str, Array], outputs: dict[str, Array]
) -> tuple[list[TimeHistory], list[str]]:
    """Return the uniformly sampled records of one file, and what was done to it.

    Parameters
    ----------
    name : of the file; records after a gap are numbered.
    time : (n,) [s]. inputs, outputs : name -> (n,), SI; NaN where there is no value.

    Rounded time stamps are taken as even; uneven ones are resampled linearly. Missing inputs are
    bridged for a quarter of a second; a longer gap ends a record. Spikes of the outputs are left
    out.

    Raises InputError where nothing is long enough, or time runs backwards.
    """
    name = re.sub(r"[\[\],]", "_", name)
    kept = clean_clock(time, name).keep
    time = time[kept]
    inputs, outputs = (
        {key: values[kept] for key, values in each.items()} for each in (inputs, outputs)
    )
    notes = [f"{name}: {int(np.sum(~kept))} samples left out whose time does not increase"]
    notes = notes if not kept.all() else []
    for output, values in outputs.items():
        wild = spikes(values)
        if wild.any():
            outputs[output] = np.where(wild, np.nan, values)
            first = f"the first at {time[np.argmax(wild)]:.6g} s"
            notes.append(f"{name}: spikes of {output} left out ({wild.sum()}), {first}")
    there = np.ones(len(time), dtype=bool)
    for values in inputs.values():
        there &= np.isfinite(values)
    usable = there.nonzero()[0]
    step = interval(time)
    if len(usable) < _FEWEST:
        raise InputError("no stretch has all inputs", name, f"it needs {_FEWEST} samples in a row")
    apart = np.diff(time[usable]) > np.maximum(_GAP * step, _BRIDGED)
    pieces = [
        np.arange(part[0], part[-1] + 1)
        for part in np.split(usable, np.flatnonzero(apart) + 1)
        if len(part) >= _FEWEST
    ]
    records, resampled = [], 0
    for number, piece in enumerate(pieces):
        stamps = time[piece]
        grid = _even(stamps)
        uneven = grid is None
        resampled += uneven
        if grid is None:
            grid = uniform_grid(stamps[0], stamps[-1], interval(stamps))
        part_inputs = {key: _at(grid, stamps, x[piece], uneven) for key, x in inputs.items()}
        records.append(
            TimeHistory(
                name if number == 0 else f"{name} {number + 1}",
                grid,
                {key: _bridged(grid, values) for key, values in part_inputs.items()},
                {key: _at(grid, stamps, x[piece], uneven) for key, x in outputs.items()},
            )
        )
    if len(pieces) != 1:
        notes.append(f"{name}: cut at gaps into {len(pieces)} records")
    if resampled:
        notes.append(f"{name}: its time steps are uneven; resampled linearly")
    bridged = sum(len(piece) - int(there[piece].sum()) for piece in pieces)
    if bridged:
        notes.append(f"{name}: {bridged} samples of missing inputs bridged")
    return records, notes


def _even(stamps: Array) -> Array | None:
    """Even stamps that these are, but for the rounding of their last decimal; None if they are
    not."""
    steps = np.arange(len(stamps))
    if is_uniform(stamps):
        return np.linspace(stamps[0], stamps[-1], len(stamps))
    slope, start = np.polyfit(steps, stamps, 1)
    for decimals in range(_DECIMALS):
        unit = 10.0**-decimals
        if np.all(np.abs(stamps - np.round(stamps, decimals)) < 1e-6 * unit):
            fitted = start + slope * steps
            rounded = np.abs(stamps - fitted).max() <= 0.75 * unit and unit < 0.75 * slope
            return np.asarray(fitted) if rounded else None
    return None


def _at(grid: Array, stamps: Array, values: Array, uneven: bool) -> Array:
    """Values at the grid; NaN where they are missing."""
    if not uneven:
        return values
    good = np.isfinite(values)
    if not good.any():
        return np.full(len(grid), np.nan)
    nearest_good = good[np.clip(np.searchsorted(stamps, grid), 0, len(good) - 1)]
    return np.where(nearest_good, np.interp(grid, stamps[good], values[good]), np.nan)


def _bridged(grid: Array, values: Array) -> Array:
    good = np.isfinite(values)
    return values if good.all() else np.interp(grid, grid[good], values[good])
