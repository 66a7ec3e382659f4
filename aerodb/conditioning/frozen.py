"""Stretches in which a whole record stands still, or jumps: its recorder failed, not a sensor."""

from typing import Final

import numpy as np
from scipy.ndimage import maximum_filter1d, uniform_filter1d
from scipy.special import bdtrc

from aerodb.conditioning.pitot import SHORTEST
from aerodb.flight import Flight
from aerodb.signals import runs
from aerodb.support import CLAIM, HINT, standard_errors

#: What an aircraft in flight cannot change within a sample.
_ANGLES: Final = ("phi", "theta", "psi")
_RATES: Final = ("p", "q", "r")
_STEADY: Final = (*_ANGLES, *_RATES, "alpha", "beta", "V")
#: Share of these that jump at once where a recorder does; gusts and contact with the ground move
#: half of them.
AT_ONCE: Final = 0.6
#: How many times the rms of a channel's changes within `NEAR` [s] a jump is.
JUMP: Final = standard_errors(HINT)
#: Time over which a motion keeps its size, and a recorder its fault [s].
NEAR: Final = 10.0
#: Part of a channel's range below which a change is rounding: what is logged slower is held, or
#: lies on a straight line.
ROUNDING: Final = 1e-9
#: What an aircraft in flight changes with every sample.
_MOTION: Final = ("p", "q", "r", "phi", "theta", "psi", "alpha", "beta", "ax", "ay", "az")


def frozen(flight: Flight) -> list[tuple[int, int]]:
    """Return the first and the last sample of each stretch in which all rates, angles and
    accelerations that change in the flight repeat their values, and after which they go on.

    A simulated flight may begin in perfect trim. Channels are (n,) in any unit; fewer than four
    that move tell nothing.
    """
    moving = [n for n in flight.channels if n in _MOTION or n.removesuffix("_imu") in _MOTION]
    moving = [name for name in moving if np.ptp(flight[name]) > 0.0]
    least = max(2, round(SHORTEST / flight.step))
    if len(moving) < 4:
        return []
    same = np.ones(len(flight.time) - 1, dtype=bool)
    for name in moving:
        values = flight[name]
        same &= values[1:] == values[:-1]
    return [
        (first, last + 1)
        for first, last in runs(same, least)
        if first > 0 and last + 2 < len(flight.time)
    ]


def torn(flight: Flight) -> list[tuple[int, int]]:
    """Return the first and the last sample of each stretch in which most angles, rates and the
    airspeed jump at once, and again within `NEAR`: samples are repeated, or in another order.

    Angles are (n,) [rad], rates (n,) [rad/s], other channels in any unit. Each sample's change is
    compared with those beside it that are not zero: a channel may be logged slower than others. An
    aircraft that is pushed jumps in all channels too, but turns no farther than its rates say.
    Next to samples that are not usable nothing is told, nor without rates and angles, nor where so
    few channels move that noise makes two such jumps by chance.
    """
    moving = [name for name in _STEADY if name in flight and np.ptp(flight[name]) > 0.0]
    votes, width = np.zeros(max(len(flight.time) - 3, 0)), max(1, round(NEAR / flight.step))
    # Two jumps within `NEAR` are made by chance as often as a claim may be wrong.
    rare = np.sqrt(CLAIM / (max(len(votes), 1) * width))
    by_chance = bdtrc(np.arange(len(moving) + 1), len(moving), HINT)  # more than so many jump
    least = max(int(AT_ONCE * len(moving)), int(np.argmax(by_chance <= rare))) + 1
    if least > len(moving) or not len(votes) or not {"theta", *_RATES} <= set(moving):
        return []
    rate = np.sqrt(sum(np.nan_to_num(flight[name]) ** 2 for name in _RATES))
    fastest = maximum_filter1d(rate, width)[1:-2]
    turned = np.zeros(len(votes), dtype=bool)
    for name in moving:
        change = np.nan_to_num(np.diff(flight[name]))
        jump = np.abs(change[1:-1] - 0.5 * (change[:-2] + change[2:]))
        jump[np.minimum(np.abs(change[1:-1]), jump) < ROUNDING * np.ptp(flight[name])] = 0.0
        squares, there = uniform_filter1d(np.array([jump**2, jump > 0.0]), width)
        jumps = jump**2 * there > JUMP**2 * np.maximum(squares, 0.0)
        votes += jumps
        if name in _ANGLES:  # one that is logged slower catches up at each of its samples
            turn = np.abs(np.sin(0.5 * change[1:-1])) * np.cos(np.nan_to_num(flight["theta"][1:-2]))
            turned |= jumps & (2.0 * turn * np.mean(jump > 0.0) > fastest * flight.step)
    good = flight.usable(moving, despite=("on_ground", "hover", "stuck", "failed"))
    good = good[:-3] & good[1:-2] & good[2:-1] & good[3:] & turned
    at = np.flatnonzero(good & (votes >= least)) + 2
    chains = np.split(at, np.flatnonzero(np.diff(at) > width) + 1)
    apart = SHORTEST / flight.step
    return [(int(c[0]), int(c[-1])) for c in chains if c.size and c[-1] - c[0] > apart]
