"""Faults that come, go or grow during a flight, and faults of shape: of servos, of filters, of
converters and of clocks. Each is made in the channels of a right flight, which is conditioned anew.
"""

import re
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from aerodb.conditioning import AIR, flag_unusable
from aerodb.nomenclature import FLAGS
from aerodb.signals import played
from aerodb.vehicle import add_combinations
from tests.campaigns.corruptions import Corruption, Pair, determined, of_role

#: Values of a channel, shares of the flight that are over (0 to 1), step [s] -> what is logged.
Change = Callable[[np.ndarray, np.ndarray, float], np.ndarray]
#: Where faults that come during a flight begin, as a share of it.
BEGIN = 0.4


def conditioned(pair: Pair, made: dict[str, np.ndarray]) -> Pair | None:
    """The flight with other channels, without the flags of the right ones and flagged anew; None
    where nothing changes."""
    if all(np.array_equal(values, pair.flight[name]) for name, values in made.items()):
        return None
    flags = pair.flight.flags
    again = FLAGS["stuck"] | FLAGS["wild_point"] | FLAGS["failed"]
    bits = {name: each.astype(np.uint16) & ~np.uint16(again) for name, each in flags.items()}
    flight = replace(pair.flight, flags=bits).with_channels(made)
    return replace(pair, flight=flag_unusable(add_combinations(flight, pair.vehicle)))


def _over(pair: Pair) -> np.ndarray:
    time = pair.flight.time
    return np.asarray((time - time[0]) / np.ptp(time))


def surface(role: str, change: Change) -> Corruption:
    """All channels of a role, where the flight tells their effect to a fifth."""

    def corrupt(pair: Pair) -> Pair | None:
        if determined(pair.flight, pair.vehicle, role) > 0.2:
            return None
        over, step = _over(pair), pair.flight.step
        names = of_role(pair, role)
        return conditioned(pair, {n: change(pair.flight[n], over, step) for n in names})

    return corrupt


def sensor(names: Sequence[str], change: Change) -> Corruption:
    """Each of these channels that the flight has and that moves."""

    def corrupt(pair: Pair) -> Pair | None:
        flight, over = pair.flight, _over(pair)
        there = [n for n in names if n in flight and np.nanstd(flight[n]) > 0.0]
        return conditioned(pair, {n: change(flight[n], over, flight.step) for n in there})

    return corrupt


def all_channels(change: Change) -> Corruption:
    """Every channel alike: what a recorder does."""

    def corrupt(pair: Pair) -> Pair | None:
        over, step = _over(pair), pair.flight.step
        made = {n: change(v, over, step) for n, v in pair.flight.channels.items()}
        return conditioned(pair, made)

    return corrupt


def exchanged(one: str, other: str, begin: float) -> Corruption:
    """Two channels exchanged from a share of the flight on."""

    def corrupt(pair: Pair) -> Pair | None:
        flight, late = pair.flight, _over(pair) > begin
        if one not in flight or other not in flight:
            return None
        a, b = flight[one], flight[other]
        return conditioned(pair, {one: np.where(late, b, a), other: np.where(late, a, b)})

    return corrupt


def exchanged_surfaces(pair: Pair) -> Pair | None:
    """Aileron and rudder exchanged from `BEGIN` on, where the flight tells both."""
    names = {role: of_role(pair, role) for role in ("roll", "yaw")}
    if any(determined(pair.flight, pair.vehicle, role) > 0.2 for role in names):
        return None
    if len(names["yaw"]) != 1 or not names["roll"]:
        return None
    late, flight, (rudder,) = _over(pair) > BEGIN, pair.flight, names["yaw"]
    made = {rudder: np.where(late, flight[names["roll"][0]], flight[rudder])}
    for k, name in enumerate(names["roll"]):
        made[name] = np.where(late, (-1.0) ** k * flight[rudder], flight[name])
    return conditioned(pair, made)


def scaled(factor: float, begin: float = 0.0) -> Change:
    return lambda v, over, step: np.where(over >= begin, factor * v, v)


def ramp(last: float) -> Change:
    """A gain that grows evenly from one."""
    return lambda v, over, step: v * (1.0 + (last - 1.0) * over)


def drift(change: float) -> Change:
    return lambda v, over, step: v + change * over


def jump(change: float) -> Change:
    return lambda v, over, step: v + change * (over > BEGIN)


def delayed(seconds: float, begin: float = 0.0) -> Change:
    def change(v: np.ndarray, over: np.ndarray, step: float) -> np.ndarray:
        index = np.clip(np.arange(len(v)) - round(seconds / step), 0, len(v) - 1)
        return np.where(over >= begin, v[index], v)

    return change


def play(width: float) -> Change:
    """A loose linkage of the sensor, of this width [rad] in all."""
    return lambda v, over, step: played(v, 0.5 * width)


def slow(share: float) -> Change:
    """A servo that turns at most at this share of the largest rate of the record."""

    def change(v: np.ndarray, over: np.ndarray, step: float) -> np.ndarray:
        most = share * float(np.quantile(np.abs(np.diff(v)), 0.995))
        made = v.copy()
        for k in range(1, len(v)):
            made[k] = made[k - 1] + np.clip(v[k] - made[k - 1], -most, most)
        return made

    return change


def filtered(seconds: float) -> Change:
    """A filter of first order."""

    def change(v: np.ndarray, over: np.ndarray, step: float) -> np.ndarray:
        made, gain = v.copy(), 1.0 - np.exp(-step / seconds)
        for k in range(1, len(v)):
            made[k] = made[k - 1] + gain * (v[k] - made[k - 1])
        return made

    return change


def rounded(size: float) -> Change:
    return lambda v, over, step: size * np.round(v / size)


def clipped(share: float) -> Change:
    """Within a share of its largest deviation from the median."""

    def change(v: np.ndarray, over: np.ndarray, step: float) -> np.ndarray:
        middle = float(np.nanmedian(v))
        most = share * float(np.nanquantile(np.abs(v - middle), 0.99))
        return np.clip(v, middle - most, middle + most)

    return change


def spiked(every: int, sizes: float) -> Change:
    """Every n-th sample off by a multiple of the channel's standard deviation."""

    def change(v: np.ndarray, over: np.ndarray, step: float) -> np.ndarray:
        made = v.copy()
        made[every // 2 :: every] += sizes * float(np.nanstd(v))
        return made

    return change


def swapped_blocks(seconds: float) -> Change:
    """Blocks of a recorder written in pairs in the wrong order, in the middle fifth."""

    def change(v: np.ndarray, over: np.ndarray, step: float) -> np.ndarray:
        made, n = v.copy(), max(1, round(seconds / step))
        first, last = int(np.argmax(over > BEGIN)), int(np.argmax(over > 0.6))
        for k in range(first, last - 2 * n + 1, 2 * n):
            made[k : k + n], made[k + n : k + 2 * n] = v[k + n : k + 2 * n], v[k : k + n]
        return made

    return change


def held(seconds: float) -> Change:
    """The last value for some time."""

    def change(v: np.ndarray, over: np.ndarray, step: float) -> np.ndarray:
        made, first = v.copy(), int(np.argmax(over > BEGIN))
        made[first : first + round(seconds / step)] = v[first]
        return made

    return change


def repeated(seconds: float) -> Change:
    """A stretch of the record written twice, over what came after it."""

    def change(v: np.ndarray, over: np.ndarray, step: float) -> np.ndarray:
        made, n, first = v.copy(), round(seconds / step), int(np.argmax(over > BEGIN))
        part = v[max(first - n, 0) : first]
        made[first : first + len(part)] = part[: len(made) - first]
        return made

    return change


def between(change: Change, begin: float = BEGIN, end: float = 0.6) -> Change:
    """A change in the middle of the flight that goes again."""
    return lambda v, over, step: np.where((over > begin) & (over < end), change(v, over, step), v)


def held_from(begin: float) -> Change:
    """The last value to the end."""

    def change(v: np.ndarray, over: np.ndarray, step: float) -> np.ndarray:
        made, first = v.copy(), int(np.argmax(over > begin))
        made[first:] = v[first]
        return made

    return change


def dead_band(width: float) -> Change:
    """A channel that shows its median within a band of this width about it."""

    def change(v: np.ndarray, over: np.ndarray, step: float) -> np.ndarray:
        middle = float(np.nanmedian(v))
        return np.where(np.abs(v - middle) < 0.5 * width, middle, v)

    return change


def one_sided(above: float) -> Change:
    """Another gain above its median: -1 folds it, 1.6 is a bridge of two unlike halves."""

    def change(v: np.ndarray, over: np.ndarray, step: float) -> np.ndarray:
        middle = float(np.nanmedian(v))
        return np.where(v > middle, middle + above * (v - middle), v)

    return change


def jittered(seconds: float) -> Change:
    """Each sample from a time of its own, up to so much off; the same errors every time."""

    def change(v: np.ndarray, over: np.ndarray, step: float) -> np.ndarray:
        n = np.arange(len(v))
        late = np.random.default_rng(41).integers(-1, 2, len(v)) * round(seconds / step)
        return v[np.clip(n + late, 0, len(v) - 1)]

    return change


def fast_clock(share: float) -> Change:
    """A clock that gains: the record is read ever further ahead."""

    def change(v: np.ndarray, over: np.ndarray, step: float) -> np.ndarray:
        n = np.arange(len(v), dtype=float)
        return np.interp(n * (1.0 + share), n, v)

    return change


DEGREE = np.pi / 180.0
Z = ("az", "az_imu")
Y = ("ay", "ay_imu")
#: Kinds of surfaces: their channels, servos and calibrations.
SURFACES: dict[str, Corruption] = {
    "elevator x .5": surface("pitch", scaled(0.5)),
    "elevator x 2": surface("pitch", scaled(2.0)),
    "aileron x .5": surface("roll", scaled(0.5)),
    "rudder x .5": surface("yaw", scaled(0.5)),
    "elevator x .5 from .4 on": surface("pitch", scaled(0.5, BEGIN)),
    "elevator reversed from .4 on": surface("pitch", scaled(-1.0, BEGIN)),
    "rudder reversed from .4 on": surface("yaw", scaled(-1.0, BEGIN)),
    "elevator gain 1 to 2": surface("pitch", ramp(2.0)),
    "aileron gain 1 to 2": surface("roll", ramp(2.0)),
    "elevator drifts 4 deg": surface("pitch", drift(4.0 * DEGREE)),
    "elevator jumps 4 deg": surface("pitch", jump(4.0 * DEGREE)),
    "rudder jumps 4 deg": surface("yaw", jump(4.0 * DEGREE)),
    "elevator .3 s late from .4 on": surface("pitch", delayed(0.3, BEGIN)),
    "elevator .3 s early from .4 on": surface("pitch", delayed(-0.3, BEGIN)),
    "aileron .3 s late from .4 on": surface("roll", delayed(0.3, BEGIN)),
    "elevator's clock gains 1 %": surface("pitch", fast_clock(0.01)),
    "elevator with 1 deg of play": surface("pitch", play(DEGREE)),
    "elevator with 3 deg of play": surface("pitch", play(3.0 * DEGREE)),
    "aileron with 3 deg of play": surface("roll", play(3.0 * DEGREE)),
    "elevator servo slow": surface("pitch", slow(0.3)),
    "aileron servo slow": surface("roll", slow(0.3)),
    "elevator filtered 1 s": surface("pitch", filtered(1.0)),
    "elevator in steps of 2 deg": surface("pitch", rounded(2.0 * DEGREE)),
    "elevator clipped": surface("pitch", clipped(0.4)),
    "elevator held 3 s": surface("pitch", held(3.0)),
    "elevator's blocks of 1 s swapped": surface("pitch", swapped_blocks(1.0)),
    "elevator's every 20th sample off": surface("pitch", spiked(20, 3.0)),
    "aileron and rudder swapped from .4 on": exchanged_surfaces,
    "elevator reversed from .4 to .6": surface("pitch", between(scaled(-1.0))),
    "elevator x 1.6 from .4 to .6": surface("pitch", between(scaled(1.6))),
    "elevator held from .7 on": surface("pitch", held_from(0.7)),
    "elevator .3 s early": surface("pitch", delayed(-0.3)),
    "aileron reversed from .4 on": surface("roll", scaled(-1.0, BEGIN)),
    "aileron jumps 3 deg": surface("roll", jump(3.0 * DEGREE)),
    "aileron filtered .7 s": surface("roll", filtered(0.7)),
    "rudder drifts 5 deg": surface("yaw", drift(5.0 * DEGREE)),
    "rudder x 2 from .4 on": surface("yaw", scaled(2.0, BEGIN)),
    "rudder filtered .7 s": surface("yaw", filtered(0.7)),
    "rudder held from .5 on": surface("yaw", held_from(0.5)),
    "rudder clipped": surface("yaw", clipped(0.4)),
    "rudder .3 s late": surface("yaw", delayed(0.3)),
    "elevator with a dead band of 3 deg": surface("pitch", dead_band(3.0 * DEGREE)),
    "aileron's samples .3 s off": surface("roll", jittered(0.3)),
}
#: Kinds of sensors and recorders.
SENSORS: dict[str, Corruption] = {
    "record held 3 s": all_channels(held(3.0)),
    "record repeated 5 s": all_channels(repeated(5.0)),
    "record's blocks of 1 s swapped": all_channels(swapped_blocks(1.0)),
    "alpha reversed from .4 on": sensor(("alpha",), scaled(-1.0, BEGIN)),
    "beta reversed from .4 on": sensor(("beta",), scaled(-1.0, BEGIN)),
    "q reversed from .4 on": sensor(("q",), scaled(-1.0, BEGIN)),
    "p reversed from .4 on": sensor(("p",), scaled(-1.0, BEGIN)),
    "ay reversed from .4 on": sensor(Y, scaled(-1.0, BEGIN)),
    "p and r swapped from .4 on": exchanged("p", "r", BEGIN),
    "p and r swapped": exchanged("p", "r", -1.0),
    "alpha and beta swapped from .4 on": exchanged("alpha", "beta", BEGIN),
    "alpha jumps 4 deg": sensor(("alpha",), jump(4.0 * DEGREE)),
    "beta drifts 4 deg": sensor(("beta",), drift(4.0 * DEGREE)),
    "alpha gain 1 to 1.5": sensor(("alpha",), ramp(1.5)),
    "q gain 1 to 1.4": sensor(("q",), ramp(1.4)),
    "az gain 1 to 1.3": sensor(Z, ramp(1.3)),
    "airspeed gain 1 to 1.3": sensor(AIR[:1], ramp(1.3)),
    "airspeed and qbar gain 1 to 1.3": sensor(AIR, ramp(1.3)),
    "alpha filtered 2 s": sensor(("alpha",), filtered(2.0)),
    "beta filtered 2 s": sensor(("beta",), filtered(2.0)),
    "q filtered .5 s": sensor(("q",), filtered(0.5)),
    "az filtered 1 s": sensor(Z, filtered(1.0)),
    "alpha in steps of 2 deg": sensor(("alpha",), rounded(2.0 * DEGREE)),
    "q clipped": sensor(("q",), clipped(0.4)),
    "p clipped": sensor(("p",), clipped(0.4)),
    "alpha clipped": sensor(("alpha",), clipped(0.4)),
    "az clipped": sensor(Z, clipped(0.4)),
    "alpha .4 s late from .4 on": sensor(("alpha",), delayed(0.4, BEGIN)),
    "q .3 s late from .4 on": sensor(("q",), delayed(0.3, BEGIN)),
    "all rates .3 s late": sensor(("p", "q", "r"), delayed(0.3)),
    "alpha's blocks of 1 s swapped": sensor(("alpha",), swapped_blocks(1.0)),
    "beta's blocks of 1 s swapped": sensor(("beta",), swapped_blocks(1.0)),
    "alpha filtered 1 s from .4 to .6": sensor(("alpha",), between(filtered(1.0))),
    "az's every 20th sample off": sensor(Z, spiked(20, 3.0)),
    "q's every 20th sample off": sensor(("q",), spiked(20, 3.0)),
    "alpha held 3 s": sensor(("alpha",), held(3.0)),
    "q held 3 s": sensor(("q",), held(3.0)),
    "ay filtered 1 s": sensor(Y, filtered(1.0)),
    "r filtered .5 s": sensor(("r",), filtered(0.5)),
    "p .3 s late": sensor(("p",), delayed(0.3)),
    "alpha .4 s late": sensor(("alpha",), delayed(0.4)),
    "beta .4 s late": sensor(("beta",), delayed(0.4)),
    "alpha x 1.5 from .4 to .6": sensor(("alpha",), between(scaled(1.5))),
    "beta x .6 from .4 on": sensor(("beta",), scaled(0.6, BEGIN)),
    "alpha held from .6 on": sensor(("alpha",), held_from(0.6)),
    "beta held from .6 on": sensor(("beta",), held_from(0.6)),
    "az jumps 3 m/s2": sensor(Z, jump(3.0)),
    "ay jumps 1 m/s2": sensor(Y, jump(1.0)),
    "q jumps 5 deg/s": sensor(("q",), jump(5.0 * DEGREE)),
    "p drifts 8 deg/s": sensor(("p",), drift(8.0 * DEGREE)),
    "air data held from .5 on": sensor(AIR, held_from(0.5)),
    "p x .7 from .4 on": sensor(("p",), scaled(0.7, BEGIN)),
    "r gain 1 to 1.5": sensor(("r",), ramp(1.5)),
    "alpha in steps of 1.5 deg": sensor(("alpha",), rounded(1.5 * DEGREE)),
    "beta's every 20th sample off": sensor(("beta",), spiked(20, 3.0)),
    "alpha and theta swapped from .4 on": exchanged("alpha", "theta", BEGIN),
    "q and r swapped from .4 on": exchanged("q", "r", BEGIN),
    "alpha folded": sensor(("alpha",), one_sided(-1.0)),
    "p x 1.6 to one side": sensor(("p",), one_sided(1.6)),
    "airspeed and qbar filtered 3 s": sensor(AIR, filtered(3.0)),
    "r off by 6 deg/s from .4 to .6": sensor(("r",), between(lambda v, over, step: v + 0.105)),
}


def is_named(right: Pair, wrong: Pair, sentence: str) -> bool:
    """Whether a suspicion names a channel that differs between two flights, alone or in a group,
    or the record where most channels do."""
    before, after = right.flight.channels, wrong.flight.channels
    names = [n for n in before if not np.array_equal(before[n], after[n], equal_nan=True)]
    if 2 * len(names) > len(before):
        names = ["the record"]
    names += [name.removesuffix("_imu") for name in names]
    names += [name.removesuffix("_left").removesuffix("_right") for name in names]
    names += ["airspeed"] if set(AIR) & set(names) else []
    names += ["angle of attack"] if "alpha" in names else []
    names += ["flow angle"] if {"alpha", "beta"} & set(names) else []
    names += ["a rate"] if {"p", "q", "r"} & set(names) else []
    return any(re.search(rf"\b{name}\b", sentence) for name in names)
