"""Search for the single fault of sign, unit or wiring that explains disagreement with kinematics.

Every attitude, flow angle, airspeed and altitude is compared with the integral of its kinematic
rate. If one disagrees, single faults are corrected one after the other; the one whose correction
makes all channels agree is the likely cause.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

import numpy as np
from scipy.fft import prev_fast_len

from aerodb.conditioning import BAND, KINEMATICS, OPTIONAL
from aerodb.physics import GRAVITY
from aerodb.signals import low_passed
from aerodb.support import SUBSTANTIAL, Array
from aerodb.suspicions.evidence import STILL, WELL_EXPLAINED

Channels = Mapping[str, Array]

#: Longest stretch examined, the one with most motion [s].
LONGEST = 600.0
#: Agreement at most before the correction of a fault.
DISAGREES = SUBSTANTIAL
#: Faults whose total agreement differs by less than this cannot be distinguished; radians declared
#: as degrees, which are rarer than the reverse, cost as much.
ALIKE = 0.35
#: Least motion (rms in the band; V m/s, altitude m; angles: `STILL`) for a comparison.
LEAST_MOTION: Final = {"V": 0.5, "altitude": 1.0}
DEGREE = np.pi / 180

#: Channels that can be compared with their kinematics, and the channels that each comparison uses.
ALL: Final = (*KINEMATICS, "altitude")
_INVOLVED: Final = {
    name: {name, *needed, *OPTIONAL.get(name, ())} for name, (_, needed) in KINEMATICS.items()
} | {"altitude": {"altitude", "V", "theta", "alpha", "phi"}}
_ANGLES = ("p", "q", "r", "phi", "theta", "psi", "alpha", "beta")
_SIGNED = (*_ANGLES, "ax", "ay", "az")
_PAIRS = (("q", "r"), ("p", "q"), ("p", "r"), ("alpha", "beta"), ("ay", "az"), ("ax", "az"))


@dataclass(frozen=True)
class SingleFault:
    """A single fault: kind, channels affected, description, and the function that corrects it.

    Kinds: ``sign degrees radians swapped unit``.
    """

    kind: str
    channels: tuple[str, ...]
    words: str
    undo: Callable[[Channels], dict[str, Array]]


@dataclass(frozen=True)
class FaultExplanation:
    """A fault that explains a disagreement.

    alike : faults that would explain it equally well. disagreed : channels that disagreed. before,
    after : their agreement without and with the fault corrected (1: equal, 0: unrelated, -1:
    opposite).
    """

    fault: SingleFault
    alike: tuple[SingleFault, ...]
    disagreed: tuple[str, ...]
    before: float
    after: float


def agreement(
    channels: Channels,
    step: float,
    names: Iterable[str] = ALL,
    shown: Mapping[str, Array] = MappingProxyType({}),
) -> dict[str, float]:
    """Return the agreement of each channel with its kinematics, ``2 y.Y / (y.y + Y.Y)``.

    y is the measured and Y the kinematic channel in the band. 1: equal, 0: unrelated or of another
    size, -1: opposite. Channels with little motion are left out.

    Parameters
    ----------
    channels : name -> (n,), SI, all finite; accelerations as ``ax ay az``
    step : s
    names : channels to compare
    shown : some channels (n,) in the band, where they are known already
    """
    agreements = {}
    for name in names:
        path = _path(name, channels, step)
        if path is None:
            continue
        ours = shown[name] if name in shown else _passed(channels[name], step)
        theirs = _passed(path, step)
        size = float(ours @ ours + theirs @ theirs)
        moving = float(np.sqrt(size / len(ours))) > LEAST_MOTION.get(name, STILL)
        if np.isfinite(size) and moving:
            agreements[name] = 2.0 * float(ours @ theirs) / size
    return agreements


def explain(channels: Channels, step: float) -> FaultExplanation | None:
    """Return the single fault whose correction makes disagreeing channels agree.

    None if all channels agree, or if no single fault explains the disagreement.

    Parameters
    ----------
    channels : name -> (n,), as for `agreement`
    step : s
    """
    channels, step = _liveliest(channels, step)
    before = agreement(channels, step)
    bad = tuple(name for name, value in before.items() if value < DISAGREES)
    if not bad:
        return None
    shown = {name: _passed(channels[name], step) for name in before}
    tried: list[tuple[float, float, SingleFault]] = []
    for fault in _faults(channels):
        after = _undone(channels, fault, before, step, shown, bad)
        mended = [
            name
            for name in bad
            if after.get(name, -1.0) > WELL_EXPLAINED and after[name] - before[name] > 0.5
        ]
        if mended:
            after = _undone(channels, fault, before, step, shown)
            total = sum(after.get(name, 0.0) for name in before) - ALIKE * (fault.kind == "radians")
            tried.append((total, max(after[name] for name in mended), fault))
    if not tried:
        return None
    tried.sort(key=lambda entry: -entry[0])
    alike = tuple(fault for total, _, fault in tried[1:] if tried[0][0] - total < ALIKE)
    return FaultExplanation(tried[0][2], alike, bad, min(before[name] for name in bad), tried[0][1])


def _undone(
    channels: Channels,
    fault: SingleFault,
    before: dict[str, float],
    step: float,
    shown: Mapping[str, Array],
    among: Iterable[str] = ALL,
) -> dict[str, float]:
    """Return the agreement with a fault corrected; recomputed only for the channels affected that
    are asked for."""
    changed = fault.undo(channels)
    concerned = [name for name in among if not changed.keys().isdisjoint(_INVOLVED[name])]
    kept = {name: value for name, value in before.items() if name not in concerned}
    same = {name: values for name, values in shown.items() if name not in changed}
    return {**kept, **agreement({**channels, **changed}, step, concerned, same)}


def _faults(channels: Channels) -> list[SingleFault]:
    """Return every single fault that these channels could have."""
    faults = []
    for name in _SIGNED:
        if name in channels:
            faults.append(
                SingleFault("sign", (name,), f"the sign of {name} is flipped", _scaled(name, -1.0))
            )
    for name in _ANGLES:
        if name in channels:
            per = " per second" if name in "pqr" else ""
            words = f"{name} is in degrees{per}, declared as radians{per}"
            faults.append(SingleFault("degrees", (name,), words, _scaled(name, DEGREE)))
            words = f"{name} is in radians{per}, declared as degrees{per}"
            faults.append(SingleFault("radians", (name,), words, _scaled(name, 1.0 / DEGREE)))
    if {"p", "q", "r"} <= channels.keys():
        words = "p, q and r are in degrees per second, declared as radians per second"
        faults.append(
            SingleFault("degrees", ("p", "q", "r"), words, _all_scaled(("p", "q", "r"), DEGREE))
        )
    if {"phi", "theta"} <= channels.keys():
        names = tuple(name for name in ("phi", "theta", "psi") if name in channels)
        words = f"{' and '.join(names)} are in degrees, declared as radians"
        faults.append(SingleFault("degrees", names, words, _all_scaled(names, DEGREE)))
    for name in ("ax", "ay"):
        if name in channels:
            faults.append(
                SingleFault(
                    "unit", (name,), f"{name} is in g, declared as m/s^2", _scaled(name, GRAVITY)
                )
            )
    for one, other in _PAIRS:
        if one in channels and other in channels:
            faults.append(
                SingleFault(
                    "swapped",
                    (one, other),
                    f"{one} and {other} are swapped",
                    _exchanged(one, other),
                )
            )
    return faults


def _scaled(name: str, factor: float) -> Callable[[Channels], dict[str, Array]]:
    return lambda channels: {name: factor * channels[name]}


def _all_scaled(names: tuple[str, ...], factor: float) -> Callable[[Channels], dict[str, Array]]:
    return lambda channels: {name: factor * channels[name] for name in names}


def _exchanged(one: str, other: str) -> Callable[[Channels], dict[str, Array]]:
    return lambda channels: {one: channels[other], other: channels[one]}


def _path(name: str, channels: Channels, step: float) -> Array | None:
    """Return a channel integrated from its kinematics, up to a constant; None without inputs."""
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
    from scipy.integrate import cumulative_simpson

    path: Array = cumulative_simpson(np.nan_to_num(rate), dx=step, initial=0.0)
    return path


def _passed(values: Array, step: float) -> Array:
    """Return `values` (n,) band-passed with zero phase."""
    fast = low_passed(values, step, min(BAND[1], 0.4 / step))
    result: Array = fast - low_passed(fast, step, max(BAND[0], 1.0 / (len(values) * step)))
    return result


def _liveliest(channels: Channels, step: float) -> tuple[dict[str, Array], float]:
    """Return the stretch of at most LONGEST seconds with most motion in the air, and `step`."""
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
