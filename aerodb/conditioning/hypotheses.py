"""Which single fault of sign, unit or wiring would make the channels of a record agree with their
kinematics.

Every attitude, air angle, airspeed and altitude is compared with the integral of its own kinematic
rate. Where one disagrees, single faults are undone one after the other; the one that brings
agreement everywhere is the likely cause.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.fft import prev_fast_len
from scipy.integrate import cumulative_simpson

from aerodb.conditioning.channel_rates import GRAVITY, KINEMATICS, OPTIONAL
from aerodb.conditioning.differentiation import low_passed
from aerodb.support import Array

Channels = Mapping[str, Array]

#: Hz, where manoeuvres are; longest stretch [s] looked at, the liveliest of the record.
BAND, LONGEST = (0.05, 1.0), 600.0
#: Agreement at most before and at least after a fault is undone, and how much any other that held
#: before may lose.
DISAGREES, AGREES, HELD, MAY_LOSE = 0.3, 0.85, 0.5, 0.2
#: Faults whose total agreement differs by less than this cannot be told apart; radians taken for
#: degrees are rarer than the reverse by this much agreement.
ALIKE, RARE = 0.35, 0.3
#: Least motion (rms in the band, rad; V m/s; altitude m) that can tell anything.
LEAST_MOTION: Final = {"V": 0.5, "altitude": 1.0}
LEAST_ANGLE = 2e-3
DEGREE = np.pi / 180

#: Channels that can be compared with their kinematics, and what takes part in each comparison.
ALL: Final = (*KINEMATICS, "altitude")
_INVOLVED: Final = {
    name: {name, *needed, *OPTIONAL.get(name, ())} for name, (_, needed) in KINEMATICS.items()
} | {"altitude": {"altitude", "V", "theta", "alpha", "phi"}}
_ANGLES = ("p", "q", "r", "phi", "theta", "psi", "alpha", "beta")
_SIGNED = (*_ANGLES, "ax", "ay", "az")
_PAIRS = (("q", "r"), ("p", "q"), ("p", "r"), ("alpha", "beta"), ("ay", "az"), ("ax", "az"))


@dataclass(frozen=True)
class Fault:
    """A single fault: kind (``sign degrees radians swapped unit``), the channels it concerns, and
    what it does in words."""

    kind: str
    channels: tuple[str, ...]
    words: str
    undo: Callable[[Channels], dict[str, Array]]


@dataclass(frozen=True)
class Explanation:
    """A fault that explains a disagreement, those that would explain it as well, the channels that
    disagreed, and their agreement before and after (1: equal, 0: unrelated, -1: opposite)."""

    fault: Fault
    alike: tuple[Fault, ...]
    disagreed: tuple[str, ...]
    before: float
    after: float


def agreement(channels: Channels, step: float, names: Iterable[str] = ALL) -> dict[str, float]:
    """Agreement of each channel with its kinematics: ``2 y.Y / (y.y + Y.Y)`` of measured y and
    kinematic Y in the band.

    channels : name -> (n,), SI, all finite; accelerations as ``ax ay az``. step : s. Channels that
    hardly move are left out. 1: equal, 0: unrelated or of another size, -1: opposite. names : those
    of the channels to compare.
    """
    found = {}
    for name in names:
        path = _path(name, channels, step)
        if path is None:
            continue
        ours, theirs = _passed(channels[name], step), _passed(path, step)
        size = float(ours @ ours + theirs @ theirs)
        moving = float(np.sqrt(size / len(ours))) > LEAST_MOTION.get(name, LEAST_ANGLE)
        if np.isfinite(size) and moving:
            found[name] = 2.0 * float(ours @ theirs) / size
    return found


def explain(channels: Channels, step: float) -> Explanation | None:
    """The single fault that makes disagreeing channels (n,) at `step` [s] agree; None when all
    agree, or none does."""
    channels, step = _liveliest(channels, step)
    before = agreement(channels, step)
    bad = tuple(name for name, value in before.items() if value < DISAGREES)
    if not bad:
        return None
    tried: list[tuple[float, float, Fault]] = []
    for fault in _faults(channels):
        after = _undone(channels, fault, before, step)
        mended = [
            name
            for name in bad
            if after.get(name, -1.0) > AGREES and after[name] - before[name] > 0.5
        ]
        lost = max(
            (value - after.get(name, value) for name, value in before.items() if value > HELD),
            default=0.0,
        )
        if mended and lost < MAY_LOSE:
            total = sum(after.get(name, 0.0) for name in before) - RARE * (fault.kind == "radians")
            tried.append((total, max(after[name] for name in mended), fault))
    if not tried:
        return None
    tried.sort(key=lambda entry: -entry[0])
    alike = tuple(fault for total, _, fault in tried[1:] if tried[0][0] - total < ALIKE)
    return Explanation(tried[0][2], alike, bad, min(before[name] for name in bad), tried[0][1])


def _undone(
    channels: Channels, fault: Fault, before: dict[str, float], step: float
) -> dict[str, float]:
    """Agreement with a fault undone; computed anew only for channels that it has to do with."""
    changed = fault.undo(channels)
    concerned = [name for name in ALL if not changed.keys().isdisjoint(_INVOLVED[name])]
    kept = {name: value for name, value in before.items() if name not in concerned}
    return {**kept, **agreement({**channels, **changed}, step, concerned)}


def _faults(channels: Channels) -> list[Fault]:
    """Every single fault that these channels could have."""
    found = []
    for name in _SIGNED:
        if name in channels:
            found.append(
                Fault("sign", (name,), f"the sign of {name} is flipped", _scaled(name, -1.0))
            )
    for name in _ANGLES:
        if name in channels:
            per = " per second" if name in "pqr" else ""
            words = f"{name} is in degrees{per}, declared as radians{per}"
            found.append(Fault("degrees", (name,), words, _scaled(name, DEGREE)))
            words = f"{name} is in radians{per}, declared as degrees{per}"
            found.append(Fault("radians", (name,), words, _scaled(name, 1.0 / DEGREE)))
    if {"p", "q", "r"} <= channels.keys():
        words = "p, q and r are in degrees per second, declared as radians per second"
        found.append(Fault("degrees", ("p", "q", "r"), words, _all_scaled(("p", "q", "r"), DEGREE)))
    if {"phi", "theta"} <= channels.keys():
        names = tuple(name for name in ("phi", "theta", "psi") if name in channels)
        words = f"{' and '.join(names)} are in degrees, declared as radians"
        found.append(Fault("degrees", names, words, _all_scaled(names, DEGREE)))
    for name in ("ax", "ay"):
        if name in channels:
            found.append(
                Fault("unit", (name,), f"{name} is in g, declared as m/s^2", _scaled(name, GRAVITY))
            )
    for one, other in _PAIRS:
        if one in channels and other in channels:
            found.append(
                Fault(
                    "swapped",
                    (one, other),
                    f"{one} and {other} are swapped",
                    _exchanged(one, other),
                )
            )
    return found


def _scaled(name: str, factor: float) -> Callable[[Channels], dict[str, Array]]:
    return lambda channels: {name: factor * channels[name]}


def _all_scaled(names: tuple[str, ...], factor: float) -> Callable[[Channels], dict[str, Array]]:
    return lambda channels: {name: factor * channels[name] for name in names}


def _exchanged(one: str, other: str) -> Callable[[Channels], dict[str, Array]]:
    return lambda channels: {one: channels[other], other: channels[one]}


def _path(name: str, channels: Channels, step: float) -> Array | None:
    """What the kinematics say of a channel, up to a constant; None where they lack something."""
    if name == "altitude":
        if not {"altitude", "V", "theta"} <= channels.keys():
            return None
        climb = channels["theta"] - channels.get(
            "alpha", np.zeros_like(channels["theta"])
        ) * np.cos(channels.get("phi", 0.0))
        rate = channels["V"] * np.sin(climb)
    else:
        rate_of, needed = KINEMATICS[name]
        if not set(needed) <= channels.keys():
            return None
        rate = rate_of(channels)
    path: Array = cumulative_simpson(np.nan_to_num(rate), dx=step, initial=0.0)
    return path


def _passed(values: Array, step: float) -> Array:
    """In the band, zero phase."""
    fast = low_passed(values, step, min(BAND[1], 0.4 / step))
    result: Array = fast - low_passed(fast, step, max(BAND[0], 1.0 / (len(values) * step)))
    return result


def _liveliest(channels: Channels, step: float) -> tuple[dict[str, Array], float]:
    """The stretch of at most LONGEST seconds with most motion in the air."""
    n = len(next(iter(channels.values())))
    size = prev_fast_len(round(LONGEST / step)) + 1
    if n <= size:
        return dict(channels), step
    motion = np.zeros(n)
    for name in ("p", "q", "r", "phi", "theta"):
        if name in channels and (spread := float(np.std(channels[name]))) > 0:
            motion += np.minimum((np.abs(np.gradient(channels[name])) / spread), 1.0)
    if "V" in channels:
        motion *= channels["V"] > 0.4 * np.max(channels["V"])
    total = np.concatenate([[0.0], np.cumsum(motion)])
    start = int(np.argmax(total[size:] - total[:-size]))
    return {name: values[start : start + size] for name, values in channels.items()}, step
