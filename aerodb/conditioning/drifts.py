"""A sensor that drifts or jumps in flight, named by all that the motion says of it.

Each of several channels changes as others make it change: attitude as gyros turn it, airspeed and
flow angles as forces do, height as the flight path climbs. A sensor that goes wrong breaks all of
these relations in which it stands: its own by the rate of its error, those whose rate it enters by
the error itself. The likeliest sensor, form and time is told if it is beyond chance, and likelier
than all other sensors and than air that moves. Parity relations: Patton, Frank & Clark, Issues of
Fault Diagnosis for Dynamic Systems, 2000, chapter 2.
"""

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.conditioning.channel_rates import KINEMATICS, with_accelerations
from aerodb.conditioning.followers import FOLLOWERS
from aerodb.conditioning.pitot import MOST_WIND, speed_over_ground
from aerodb.estimation import samples_per_independent
from aerodb.flight import Flight
from aerodb.nomenclature import channel
from aerodb.signals import integrated
from aerodb.support import CLAIM, HINT, NEARLY_ALL, Array, Mask, likelihood_gain

#: Time [s] over which slopes are compared: several periods of the motion of small aircraft.
WINDOW: Final = 2.5
#: Windows of a flight at most: a longer flight has longer ones.
MOST_WINDOWS: Final = 100
#: Fewest windows in which a relation tells something.
FEWEST_WINDOWS: Final = 6
#: Fewest windows with and without an error, for it to be seen in a relation.
FEWEST_SEEN: Final = 2
#: Share of a window in which all that is needed must be usable.
KNOWN: Final = NEARLY_ALL
#: Least error of an angle that is said [rad]: vanes beside a fuselage and attitude filters in turns
#: err by 2 deg.
LEAST_ANGLE: Final = 0.05
#: Least error of a heading that is said [rad]: a magnetometer beside motors errs by as much.
LEAST_HEADING: Final = 0.2
#: Least error of an airspeed that is said, as a share of it: tubes beside a propeller err by less.
LEAST_AIRSPEED_ERROR: Final = 0.15
#: Least error of a gyro that is said [rad/s]: small ones change by a third of it as they warm up.
LEAST_RATE: Final = 0.02
#: Least error of an accelerometer that is said [m/s2]: vibration moves the zero of small ones by
#: half of it.
LEAST_FORCE: Final = 1.0
#: Least error of a climb rate that is said [m/s].
LEAST_CLIMB: Final = 2.0
_HEIGHTS: Final = ("altitude", "height_above_ground")
#: Sensor -> least error that is said, and the step by which its effect is found, in its unit.
SENSORS: Final[dict[str, float]] = {
    "V": LEAST_AIRSPEED_ERROR,
    **dict.fromkeys(("alpha", "beta", "phi", "theta"), LEAST_ANGLE),
    "psi": LEAST_HEADING,
    **{name: FOLLOWERS[name].least for name in (*_HEIGHTS, "static_pressure", "north", "east")},
    **{name: FOLLOWERS[name].least for name in ("velocity_north", "velocity_east")},
    "velocity_down": LEAST_CLIMB,
    **dict.fromkeys(("p", "q", "r"), LEAST_RATE),
    **dict.fromkeys(("ax", "ay", "az"), LEAST_FORCE),
}


def _climb(f: Mapping[str, Array]) -> Array:
    """Rate of climb [m/s] in air that does not rise: airspeed, attitude and flow angles."""
    zero = np.zeros_like(f["theta"])
    beta, phi = f.get("beta", zero), f.get("phi", zero)
    ahead = np.cos(f["alpha"]) * np.cos(beta) * np.sin(f["theta"])
    across = np.sin(beta) * np.sin(phi) + np.sin(f["alpha"]) * np.cos(beta) * np.cos(phi)
    return np.asarray(f["V"] * (ahead - across * np.cos(f["theta"])))


def _relations() -> Iterator[tuple[str, Callable[[Mapping[str, Array]], Array], tuple[str, ...]]]:
    """Channel, its rate, and what the rate needs."""
    for name, (rate, needs) in KINEMATICS.items():
        yield name, rate, needs
    for name in SENSORS:
        if name not in KINEMATICS and name in FOLLOWERS:
            yield name, FOLLOWERS[name].rate, FOLLOWERS[name].needs
    for name in _HEIGHTS:
        yield name, _climb, ("V", "alpha", "theta")


#: Air that rises, and wind that changes along and across: the relations that it breaks.
_AIR: Final = {
    "rising air": tuple((name, _climb) for name in _HEIGHTS),
    "wind along": (("V", KINEMATICS["V"][0]),),
    "wind across": (("beta", KINEMATICS["beta"][0]),),
}


@dataclass(frozen=True)
class Drift:
    """A sensor that goes wrong from `first` to `last` (samples), by `size` in its unit at most.

    leaps : whether at once rather than evenly. told : channels of the relations that it breaks.
    """

    channel: str
    first: int
    last: int
    size: float
    leaps: bool
    told: tuple[str, ...]

    @property
    def reason(self) -> str:
        """What shows it, in words without a subject."""
        unit, size = channel(self.channel).unit, abs(self.size)
        if unit.startswith("rad"):
            unit, size = unit.replace("rad", "deg"), float(np.rad2deg(size))
        how = "jumps" if self.leaps else "drifts"
        told = ", ".join(self.told)
        return f"it {how} by {size:.2g} {unit}: the changes of {told} do not fit the other sensors"


@dataclass(frozen=True, eq=False)
class _Relation:
    """What the slope of a channel leaves beside its rate, and what an error of 1 of each sensor
    takes from it, (m,), in windows of `step` [s]; where it is known. basis : (k, j), what says
    nothing there: a constant, and a scale of height. samples : how many windows it counts for:
    heights feel the same air."""

    channel: str
    step: float
    known: Mask
    slope: Array
    effects: Mapping[str, Array]
    basis: Array
    samples: float

    def own(self, values: Array) -> Array:
        """What the basis leaves of values (..., m), (..., k)."""
        inside = values[..., self.known]
        return np.asarray(inside - (inside @ self.basis) @ self.basis.T)

    def broken(self, name: str, errors: Array) -> Array | None:
        """What errors of a sensor at the edges of the windows (l, m + 1) make of the slope (l, k);
        None where it has no part in this relation."""
        if name not in self.effects and name != self.channel:
            return None
        middle = 0.5 * (errors[:, 1:] + errors[:, :-1])
        made = middle * -self.effects.get(name, 0.0)
        if name == self.channel:
            made = made + np.diff(errors, axis=1) / self.step
        wrong = (middle[:, self.known] != 0.0).sum(axis=1)
        seen = np.minimum(wrong, self.known.sum() - wrong) >= FEWEST_SEEN
        return self.own(made) * seen[:, None]


@dataclass(frozen=True, eq=False)
class _Fault:
    """The likeliest error of a sensor, between two edges of windows. row : its number. ratios :
    number of a relation -> logarithm of what the error leaves of its squares; left : what it
    leaves, (k,)."""

    name: str
    leaps: bool
    first: int
    last: int
    size: float
    row: int
    ratios: Mapping[int, float]
    left: Mapping[int, Array]

    def gain(
        self, samples: Sequence[float] | Array, within: Collection[int] | None = None
    ) -> float:
        """What the logarithm of the likelihood gains by it, with so many independent samples in
        each relation."""
        return sum(
            -0.5 * samples[k] * ratio
            for k, ratio in self.ratios.items()
            if within is None or k in within
        )


def drift(flight: Flight) -> Drift | None:
    """Return the sensor that drifts or jumps in flight; None where none does, or where it cannot be
    told from others.

    Channels are (n,) in SI units. Source: `docs/method/consistency.md`, section "Sensors that fail
    in flight".
    """
    if len(flight.time) < FEWEST_WINDOWS:
        return None
    every = max(round(WINDOW / flight.step), -(-len(flight.time) // MOST_WINDOWS))
    count = len(flight.time) // every
    if count < FEWEST_WINDOWS:
        return None
    relations = _made(flight, every, count)
    found = [fault for name in (*SENSORS, *_AIR) for fault in _likeliest(name, relations, count)]
    if not found:
        return None
    samples = np.array([each.samples for each in relations])
    best = max(found, key=lambda fault: fault.gain(samples))
    for k, left in best.left.items():
        samples[k] /= samples_per_independent(left)
    best = max(found, key=lambda fault: fault.gain(samples))
    told = [k for k in best.ratios if best.gain(samples, {k}) > likelihood_gain(HINT)]
    rival = max((e.gain(samples, told) for e in found if e.name != best.name), default=0.0)
    least = SENSORS.get(best.name, np.inf)
    if best.name == "V":
        least *= float(np.nanmedian(flight["V"]))
        # A closed tube lacks all of it, and no more. On the ground, height tells nothing.
        if abs(best.size) > float(np.nanmax(flight["V"])):
            return None
    needed = likelihood_gain(CLAIM) + max(rival, np.log(2 * count * len(found)))
    if abs(best.size) < least or best.gain(samples) < needed:
        return None
    name = _logged(flight, best.name)
    ends = [_sample(flight[name], best, edge, every) for edge in (best.first, best.last)]
    named = tuple(dict.fromkeys(relations[k].channel for k in told))
    return Drift(name, ends[0], ends[1] - 1, best.size, best.leaps, named)


def _logged(flight: Flight, name: str) -> str:
    """The name by which a flight has a channel: that of the IMU of an accelerometer, else."""
    return name if name in flight else f"{name}_imu"


def _sample(values: Array, fault: _Fault, edge: int, every: int) -> int:
    """Sample at which an error begins or ends, near the edge of a window: that of a leap, if there
    is one."""
    if (edge + 1) * every > len(values):
        return len(values)
    first = max(0, (edge - 1) * every)
    change = np.abs(np.nan_to_num(np.diff(values[first : (edge + 1) * every])))
    at = int(np.argmax(change))
    return first + at + 1 if change[at] > 0.5 * abs(fault.size) else edge * every


def _finite(values: Array) -> Array:
    """Values (n,), zero where a rate is not defined: at no airspeed."""
    return np.nan_to_num(values, nan=0.0, posinf=0.0, neginf=0.0)


def _made(flight: Flight, every: int, count: int) -> list[_Relation]:
    """The relations of a flight, in `count` windows of so many samples."""
    usable, step, made = with_accelerations(flight), every * flight.step, []

    def thin(values: Array) -> Array:
        return np.asarray(values[: count * every].reshape(count, every).mean(axis=1))

    usable |= {name: np.unwrap(usable[name]) for name in ("phi", "psi") if name in usable}
    means = {name: thin(values) for name, values in usable.items()}
    near, flown = max(1, every // 5), np.ones(len(flight.time), dtype=bool)
    if "V" in usable:
        fast = MOST_WIND * float(np.quantile(usable["V"], 0.95))
        over = speed_over_ground(flight)
        flown = usable["V"] > fast if over is None else np.fmax(usable["V"], over) > fast
    for name, rate, needs in _relations():
        if not {name, *needs} <= usable.keys():
            continue
        good = flown & flight.usable([_logged(flight, n) for n in (name, *needs)], ("stuck",))
        known = thin(good.astype(np.float64)) > KNOWN
        if known.sum() < FEWEST_WINDOWS:
            continue
        with np.errstate(all="ignore"):
            turning, here = _finite(rate(usable)), rate(means)
            effects = {
                each: _finite((rate({**means, each: means[each] + least}) - here) / least)
                for each, least in SENSORS.items()
                if each in means
            }
        effects |= {air: -np.ones(count) for air, moved in _AIR.items() if (name, rate) in moved}
        apart = usable[name] - integrated(turning, flight.step)
        edges = [
            float(np.mean(apart[max(0, k * every - near) : k * every + near + 1]))
            for k in range(count + 1)
        ]
        columns = [np.ones(count)] + ([thin(turning)] if "velocity_down" in needs else [])
        basis, sizes, _ = np.linalg.svd(np.column_stack(columns)[known], full_matrices=False)
        basis = basis[:, sizes > 1e-9 * sizes[0]]
        effects = {each: effect for each, effect in effects.items() if effect.any()}
        samples = known.sum() / (1 + (rate is _climb and set(_HEIGHTS) <= usable.keys()))
        made.append(_Relation(name, step, known, np.diff(edges) / step, effects, basis, samples))
    return made


def _likeliest(name: str, relations: Sequence[_Relation], count: int) -> Iterator[_Fault]:
    """The likeliest jump and the likeliest drift of a sensor, to the end or until it is itself
    again."""
    edge, first = np.arange(count + 1), np.arange(2, count - 1)
    steps = (edge >= first[:, None]).astype(np.float64)
    ramps = np.maximum(edge - first[:, None], 0.0) / (count - first[:, None])
    drifts = _best(name, False, relations, ramps, [(int(k), count) for k in first])
    if drifts is not None:
        yield drifts
    # A leap near the edge of a window is in both.
    at_edge = edge == first[:, None]
    near = np.concatenate([steps - part * at_edge for part in (0.0, 0.25, 0.5, 0.75)])
    begins = np.tile(first, len(near) // len(first))
    leaps = _best(name, True, relations, near, [(int(k), count) for k in begins])
    if leaps is None:
        return
    # It may be over before the end, or have been there before and gone.
    gone, end = None, leaps.row
    apart = np.flatnonzero(np.abs(begins - leaps.first) >= FEWEST_SEEN)
    if apart.size:
        ends = [(min(leaps.first, int(k)), max(leaps.first, int(k))) for k in begins[apart]]
        sign = np.sign(begins[apart] - leaps.first)[:, None]
        gone = _best(name, True, relations, sign * (near[leaps.row] - near[apart]), ends)
    if gone is not None and gone.last > leaps.first:
        end = int(apart[gone.row])
    # What drifted may be itself again at once.
    until = int(begins[end])
    since = first[first <= until - FEWEST_SEEN]
    ramps = np.maximum(edge - since[:, None], 0.0) / (until - since[:, None])
    reset = ramps * (1.0 - near[end])
    ended = _best(name, False, relations, reset, [(int(k), until) for k in since])
    samples = [each.samples for each in relations]
    more = likelihood_gain(CLAIM)
    least = max(each.gain(samples) for each in (leaps, drifts) if each is not None)
    if ended is not None and ended.gain(samples) > least + more:
        yield ended
    if name == "psi":  # a heading wraps, and is aligned anew
        return
    yield leaps
    if gone is not None and gone.gain(samples) > leaps.gain(samples) + more:
        yield gone


def _best(
    name: str,
    leaps: bool,
    relations: Sequence[_Relation],
    errors: Array,
    ends: Sequence[tuple[int, int]],
) -> _Fault | None:
    """The likeliest of errors (l, m + 1) of a sensor that begin and end at edges of windows."""
    if not len(errors):
        return None
    parts = [
        (k, relation.own(relation.slope), made)
        for k, relation in enumerate(relations)
        if (made := relation.broken(name, errors)) is not None
    ]
    if not parts:
        return None
    squares = np.array([max(float(y @ y), 1e-30) for _, y, _ in parts])[:, None]
    along = np.array([made @ y for _, y, made in parts])
    made_squares = np.array([(made * made).sum(axis=1) for _, _, made in parts])
    number = np.array([relations[k].samples for k, _, _ in parts])[:, None]
    rest = np.broadcast_to(squares, along.shape)
    for _ in range(4):  # how far each relation is believed depends on what the error leaves of it
        weight = number / rest
        sizes = (weight * along).sum(axis=0)
        sizes = sizes / np.maximum((weight * made_squares).sum(axis=0), 1e-300)
        rest = np.maximum(squares - 2.0 * sizes * along + sizes**2 * made_squares, 1e-12 * squares)
    ratios = np.log(rest / squares)
    at = int(np.argmin((number * ratios).sum(axis=0)))
    size = float(sizes[at])
    return _Fault(
        name,
        leaps,
        *ends[at],
        size,
        at,
        {k: float(ratios[i, at]) for i, (k, _, _) in enumerate(parts)},
        {k: y - size * made[at] for k, y, made in parts},
    )
