"""Wild points: spikes, stuck values and impossible values become flags; no value is changed."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.flight import Flight
from aerodb.nomenclature import FLAGS, is_surface
from aerodb.signals import bridge
from aerodb.support import SLIGHT, Array, Mask

#: A spike departs from its neighbours by this many times the usual change between samples.
SPIKE_FACTOR = 8.0
#: Spikes are rarer than this share of samples; more frequent departures belong to the channel, such
#: as a coarse converter that toggles.
RAREST = 0.02
#: Longest run of samples that can be a spike; longer departures are motion.
LONGEST_SPIKE = 3
#: Half width [samples] of the neighbourhood whose usual change a spike is compared with.
NEARBY = 12
#: Shortest time over which a constant value is stuck [s].
SHORTEST_STUCK = 0.5
#: Length of a stuck run relative to usual runs of one value.
STUCK_FACTOR = 6.0

#: Physical range of a channel, in its unit, for any aircraft, from small models to winged re-entry.
PHYSICAL: Final[dict[str, tuple[float, float]]] = {
    "V": (-5.0, 9000.0),
    "calibrated_airspeed": (-5.0, 1500.0),
    "alpha": (-np.pi, np.pi),
    "beta": (-np.pi / 2, np.pi / 2),
    "qbar": (-500.0, 5e5),
    "mach": (-0.05, 35.0),
    "rho": (0.0, 2.0),
    "temperature": (120.0, 400.0),
    "static_pressure": (0.0, 1.2e5),
    **dict.fromkeys(("ax", "ay", "az", "ax_imu", "ay_imu", "az_imu"), (-500.0, 500.0)),
    **dict.fromkeys("pqr", (-20.0, 20.0)),
    "theta": (-np.pi / 2 - 1e-6, np.pi / 2 + 1e-6),
    "altitude": (-500.0, 2e5),
    "latitude": (-np.pi / 2, np.pi / 2),
    "delta_landing_gear": (-0.1, 1.1),
    "surface": (-2 * np.pi / 3, 2 * np.pi / 3),  # wings that tilt go a few degrees beyond upright
}
#: Sensors whose output always changes in flight; surfaces, gear and computed channels may be
#: constant.
_MOVING = (
    "V",
    "calibrated_airspeed",
    "alpha",
    "beta",
    "qbar",
    "ax",
    "ay",
    "az",
    "ax_imu",
    "ay_imu",
    "az_imu",
    "p",
    "q",
    "r",
    "phi",
    "theta",
    "psi",
)
#: Air data that are constant at rest, near zero.
_STILL_AT_REST = ("V", "calibrated_airspeed", "qbar")
#: Part of their largest value up to which they may be constant.
_AT_REST = SLIGHT
#: Smallest departure, as part of a channel's physical range, that can be a spike.
_FINEST = 2e-6


@dataclass(frozen=True)
class WildPoints:
    """Unusable samples of one channel: (n,) masks."""

    spike: Mask
    stuck: Mask
    impossible: Mask


def physical_range(name: str) -> tuple[float, float] | None:
    """Return the lowest and highest possible value of a channel, scalars in SI units; None if it
    has no limits."""
    surface = is_surface(name) and name not in PHYSICAL
    return PHYSICAL.get("surface" if surface else name)


def spikes(values: Array, floor: float = 0.0, rarest: float = RAREST) -> Mask:
    """Return a mask (n,) of spikes: up to three samples that depart from both neighbours.

    A run of samples is measured by its least departure from the samples before and after it. This
    is zero on the flank of a step and in a ramp however steep, so that sharp inputs stay. It is
    compared with the usual change between samples that far apart (1.48 times the median, of the 25
    around and of the whole record, whichever is larger), with the quantum of the recording, and
    with the share `rarest` of the largest departures in the record. Smaller departures cannot be
    distinguished from motion.

    Parameters
    ----------
    values : (n,); NaN is never a spike
    floor : smallest departure that can be a spike, same unit
    rarest : share of samples that spikes do not exceed

    References
    ----------
    Hampel identifier on two-sided differences: Davies & Gather, J. Am. Stat. Assoc. 88 (1993).
    """
    result = np.zeros(len(values), dtype=bool)
    for _ in range(2):  # a second round, without what the first found, sees what stood beside it
        index = np.flatnonzero(np.isfinite(values) & ~result)
        wild = (
            _spikes(values[index], floor, rarest)
            if len(index) > 2 * NEARBY
            else np.zeros(len(index), dtype=bool)
        )
        if not wild.any():
            break
        result[index[wild]] = True
    return result


def _spikes(values: Array, floor: float, rarest: float) -> Mask:
    """One round of `spikes` over finite values. Most channels have no candidate; what is costly is
    done for candidates only."""
    n = len(values)
    wild = np.zeros(n, dtype=bool)
    least = floor
    for length in range(1, LONGEST_SPIKE + 1):
        before, after = values[: n - length - 1], values[length + 1 :]
        departure = _departure(values, length, before, after)
        change = np.abs(values[length:] - values[:-length])
        largest = float(np.max(departure))
        if largest <= SPIKE_FACTOR * least or _median_reaches(
            change, largest / (1.4826 * SPIKE_FACTOR)
        ):
            continue
        least = max(least, _quantum(values))
        usual = max(1.4826 * float(np.median(change)), least)
        rare = float(np.quantile(departure, 1.0 - rarest))
        at = np.flatnonzero(departure > max(SPIKE_FACTOR * usual, 2.0 * rare))
        # Where both sides disagree by as much as the run departs there is a step, not a spike.
        at = at[np.abs(after[at] - before[at]) < 0.5 * departure[at]]
        at = at[departure[at] > SPIKE_FACTOR * 1.4826 * _usual_nearby(change, at)]
        for k in range(length):
            wild[at + 1 + k] = True
    return wild


def _departure(values: Array, length: int, before: Array, after: Array) -> Array:
    """(n - length - 1,) least departure of the `length` samples between `before` and `after` to one
    side; 0 for none."""
    n = len(values)
    lowest = highest = values[1 : n - length]
    for k in range(1, length):
        part = values[1 + k : n - length + k]
        lowest, highest = np.minimum(lowest, part), np.maximum(highest, part)
    above = lowest - np.maximum(before, after)
    below = np.minimum(before, after) - highest
    result: Array = np.maximum(np.maximum(above, below), 0.0)
    return result


def _median_reaches(change: Array, level: float) -> bool:
    """Return whether the median of `change` is `level` or more, without sorting."""
    return 2 * int(np.count_nonzero(change >= level)) > len(change)


def _usual_nearby(change: Array, at: NDArray[np.intp]) -> Array:
    """(k,) the larger of the medians of the 25 changes around `at` and around the next; mirrored at
    the ends."""
    padded = np.pad(change, NEARBY, mode="reflect")
    window = np.arange(2 * NEARBY + 1)
    here, there = (np.median(padded[(at + shift)[:, None] + window], axis=1) for shift in (0, 1))
    result: Array = np.maximum(here, there)
    return result


def _quantum(values: Array) -> float:
    """Smallest usual change of a channel that changes at all: the step of a quantised one."""
    change = np.abs(np.diff(values))
    change = change[change > 0]
    return float(np.quantile(change, 0.1)) if len(change) >= 20 else 0.0


def _usual(lengths: NDArray[np.intp]) -> int:
    """Length of the runs in which nine tenths of a record lie that has runs of `lengths`."""
    ordered = np.sort(lengths)
    summed = np.cumsum(ordered)
    return int(ordered[np.searchsorted(summed, 0.9 * summed[-1])]) if ordered.size else 1


def stuck(values: Array, step: float, jump: bool = True) -> Mask:
    """(n,) true where a channel repeats one value for longer than it otherwise ever would.

    values : (n,). step : s. A run of equal samples is stuck when it lasts half a second or more,
    and six times as long as the runs in which nine tenths of the rest of the record lie, without
    others of the same value, as dropouts have (a quantised channel repeats itself in calm air); a
    quantised channel must also jump by more than its quantum where the run begins or ends, else it
    only passed a turning point (`jump` false drops this: for who knows that the aircraft moved). A
    channel that never changes is not judged here: see `plausibility`.
    """
    starts = (
        np.flatnonzero(np.concatenate([[True], values[1:] != values[:-1]]))
        if len(values)
        else np.zeros(0, dtype=int)
    )
    lengths = np.diff(np.append(starts, len(values)))
    result = np.zeros(len(values), dtype=bool)
    if len(starts) < 10:
        return result
    long = np.flatnonzero(lengths * step >= SHORTEST_STUCK)
    if not long.size:
        return result
    quantum = _quantum(values[np.isfinite(values)])
    usual_beside: dict[float, int] = {}
    for run in long:
        value = float(values[starts[run]])
        if value not in usual_beside:
            usual_beside[value] = _usual(np.delete(lengths, long[values[starts[long]] == value]))
        usual = usual_beside[value]
        ends = [k for k in (starts[run], starts[run] + lengths[run]) if 0 < k < len(values)]
        jumped = (
            not jump
            or usual == 1
            or any(abs(values[k] - values[k - 1]) > 3.0 * quantum for k in ends)
        )
        if lengths[run] >= STUCK_FACTOR * usual and lengths[run] >= 5 and jumped:
            result[starts[run] : starts[run] + lengths[run]] = True
    return result


def wild_points(name: str, values: Array, step: float) -> WildPoints:
    """Return the wild points of channel `name` with `values` (n,) [SI] at `step` [s]."""
    limits = physical_range(name)
    none = np.zeros(len(values), dtype=bool)
    finite = np.isfinite(values)
    impossible = none if limits is None else finite & ((values < limits[0]) | (values > limits[1]))
    held = stuck(values, step) & finite if name in _MOVING else none
    if name in _STILL_AT_REST:
        held &= np.abs(values) > _AT_REST * np.max(np.abs(values[finite]), initial=0.0)
    floor = 0.0 if limits is None else _FINEST * (limits[1] - limits[0])
    return WildPoints(spikes(np.where(impossible, np.nan, values), floor), held, impossible)


def flag_wild_points(flight: Flight) -> Flight:
    """Return the flight with spikes, stuck and impossible values flagged.

    The flags are ``wild_point``, ``stuck`` and ``implausible``. Every channel is examined on its
    samples without a flag; values do not change. A note counts what was found.

    Values are (n,), in the unit of their channel, flags (n,) of bits; the ranges are those of
    `physical_range`.
    """
    notes: list[str] = []
    result = flight
    for name, values in flight.channels.items():
        judged = np.where(flight.usable([name]), values, np.nan)
        wild = wild_points(name, judged, flight.step)
        for what, flag, where in (
            ("spikes", "wild_point", wild.spike),
            ("stuck samples", "stuck", wild.stuck),
            ("impossible values", "implausible", wild.impossible),
        ):
            if where.any():
                result = result.with_flag(name, flag, where)
                at = flight.time[np.argmax(where)]
                notes.append(f"{name}: {int(where.sum())} {what}, the first at {at:.6g} s")
    return replace(result, notes=(*result.notes, *notes))


def without_wild_points(flight: Flight) -> Flight:
    """Return the flight with spikes and impossible values interpolated linearly; flags stay.

    Use it before smoothing or differentiation, where a wild point would affect its neighbours.

    Values are (n,) in the unit of their channel, as flagged by `flag_wild_points`.
    """
    wild = np.uint8(FLAGS["wild_point"] | FLAGS["implausible"])
    mended = {}
    for name, bits in flight.flags.items():
        bad = (bits & wild) != 0
        if name in flight and bad.any() and np.isfinite(flight[name][~bad]).any():
            mended[name] = bridge(np.where(bad, np.nan, flight[name]))
    return flight.with_channels(mended) if mended else flight
