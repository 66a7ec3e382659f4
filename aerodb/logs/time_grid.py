"""Channels of several topics on one uniform time grid."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.logs.mapped_log import MappedLog
from aerodb.logs.mapping_file import matching_topics
from aerodb.nomenclature import FLAGS
from aerodb.recording import Damage
from aerodb.signals import (
    Resampler,
    first_order_lag,
    hold,
    interval,
    is_out_of_proportion,
    is_uniform,
    resampler,
    uniform_grid,
)
from aerodb.support import Array
from aerodb.vehicle import Surface, Vehicle

_RATES = ("p", "q", "r")
#: Time constants after which less than 1 % of a first-order lag's initial error remains.
SETTLED = 5.0
#: Largest number of grid samples per logged sample of the reference topic.
_MOST_OVERSAMPLING = 100
#: Grid steps before and after the grid within which samples still count: the anti-aliasing filter
#: reaches 12.
_REACH = 100


@dataclass(frozen=True)
class LoggedSignal:
    """One channel on its topic's clock; `surface` calibrates a command, `estimated` as in
    `Source`."""

    name: str
    topic: str
    values: Array
    surface: Surface | None = None
    estimated: bool = False


def _times(log: MappedLog, topic: str) -> Array:
    clock = log.clock(topic)
    assert clock is not None  # a signal exists only where its clock does
    return clock.time


def common_grid(
    log: MappedLog, essential: Sequence[LoggedSignal], vehicle: Vehicle
) -> tuple[Array, str]:
    """Return the uniform time grid [s] and a note on its origin.

    (n,). Raises InputError when the signals do not overlap, or their clocks cannot be used.
    """
    topics = dict.fromkeys(signal.topic for signal in essential)
    start = max(float(_times(log, topic)[0]) for topic in topics)
    end = min(float(_times(log, topic)[-1]) for topic in topics)
    named = (
        matching_topics(log.mapping.reference_topic, log.recording.topics)
        if log.mapping.reference_topic
        else []
    )
    usable = [topic for topic in named if log.clock(topic) is not None]
    rates = [signal.topic for signal in essential if signal.name in _RATES]
    reference = [*usable, *rates, *topics][0]
    time = _times(log, reference)
    step = interval(time) if vehicle.processing.rate is None else 1.0 / vehicle.processing.rate
    inside = time[(time >= start) & (time <= end)]
    if len(inside) < 2 or end - start < step:
        where = f"{log.recording.source}, topics {', '.join(topics)}"
        raise InputError(
            "accelerations and rates do not overlap in time",
            where,
            "check the clocks of these topics",
        )
    where = f"{log.recording.source}, topic {reference}"
    if is_out_of_proportion(end - start, max(step, interval(time)), len(inside)):
        what = f"{_jump(time)}: a flight of {end - start:.6g} s has only {len(inside)} samples"
        raise InputError(what, where, "split the log there, or repair its time base")
    if (end - start) / step > _MOST_OVERSAMPLING * len(inside) + 1000:
        what = (
            f"its samples are {(end - start) / len(inside):.6g} s apart, more than"
            f" {_MOST_OVERSAMPLING} steps of the grid of {1.0 / step:g} Hz"
        )
        remedy = "check the unit of its time, or lower [processing] rate in the vehicle file"
        raise InputError(what, where, remedy)
    note = (
        f"grid of {1.0 / step:.6g} Hz,"
        f" {'set by the vehicle file' if vehicle.processing.rate else f'that of topic {reference}'}"
    )
    if vehicle.processing.rate is None and is_uniform(inside):
        return inside, note
    return uniform_grid(float(inside[0]), end, step), note


def _jump(time: Array) -> str:
    """Return the largest step of a clock as text."""
    at = int(np.argmax(np.diff(time)))
    size = time[at + 1] - time[at]
    before, after = (f"{round(float(value), 3):.13g}" for value in time[at : at + 2])
    return f"the clock jumps by {size:.6g} s, from {before} to {after} s"


def _beside_grid(log: MappedLog, topic: str, time: Array, grid: Array) -> slice:
    """Return the samples of a topic to use on the grid: all, unless its clock jumps.

    `time` is out of proportion to its samples and to the grid then, and what is far from the grid
    is left out and reported.
    """
    span = float(time[-1] - time[0])
    if not is_out_of_proportion(span, interval(time), max(len(time), len(grid))):
        return slice(0, len(time))
    reach = _REACH * interval(grid)
    first, last = np.searchsorted(time, [grid[0] - reach, grid[-1] + reach])
    lost = len(time) - int(last - first)
    if lost and topic not in log.cut:
        log.cut.add(topic)
        what = f"{_jump(time)}: {lost} of {len(time)} samples are far from the flight and not used"
        log.damage.append(Damage("time", what, topic, float(time[0]), float(time[-1])))
    return slice(int(first), int(last))


def on_grid(
    log: MappedLog, signals: Iterable[LoggedSignal], grid: Array
) -> tuple[dict[str, Array], dict[str, NDArray[np.uint8]]]:
    """Return channels and gap flags on the grid; fields of one topic share one resampler.

    grid : (n,) [s]. Channels (n,) in the unit of their signals, flags (n,) as bits of `FLAGS`.
    """
    shared: dict[str, Resampler] = {}
    channels: dict[str, Array] = {}
    flags: dict[str, NDArray[np.uint8]] = {}
    for signal in signals:
        time, values = _times(log, signal.topic), signal.values
        near = _beside_grid(log, signal.topic, time, grid)
        time, values = time[near], values[near]
        good = np.isfinite(values)
        if not good.any():
            continue
        if good.all():
            if signal.topic not in shared:
                shared[signal.topic] = resampler(time, grid)
            to_grid = shared[signal.topic]
        else:
            to_grid, values = resampler(time[good], grid), values[good]
        channels[signal.name] = (
            to_grid(values)
            if signal.surface is None
            else _deflection(to_grid, values, signal.surface)
        )
        unknown = to_grid.gap
        if signal.surface is not None:
            # The deflection before the log begins is unknown: flag until the lag has settled.
            unknown = unknown | (grid < time[0] + SETTLED * signal.surface.lag)
        if unknown.any():
            flags[signal.name] = unknown * np.uint8(FLAGS["gap"])
    return channels, flags


def _deflection(to_grid: Resampler, command: Array, surface: Surface) -> Array:
    """Return the deflection [rad] on the grid of a command that is held until the next one.

    ``offset + scale * command`` within the surface's limits, then the lag.
    """
    time, grid = to_grid.time, to_grid.grid
    if len(time) > 2 and to_grid.step < 0.9 * to_grid.grid_step:
        base = uniform_grid(float(time[0]), float(time[-1]), to_grid.step)
    else:
        base = grid
    calibrated = np.clip(
        surface.offset + surface.scale * hold(time, command, base), *surface.limits
    )
    lagged = first_order_lag(calibrated, interval(base), surface.lag)
    return lagged if base is grid else resampler(base, grid)(lagged)
