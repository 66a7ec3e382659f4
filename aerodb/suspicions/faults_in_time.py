"""Channels that part from the database with time: a gain, a zero or a delay that changes.

A fault of a channel reaches every axis on which the database lets the channel act, with one size.
Of what the database leaves of each axis, everything that motion, speed and surfaces explain is
taken off: errors of a database are functions of these, and of no time. Faults are ranked by the
likelihood of all axes together (a change point: Chow, Econometrica 28, 1960, with the place
searched for), with the samples that are independent in what the likeliest one leaves. Faults that
the flight cannot tell apart are named together.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import SETTLED, Suspicion
from aerodb.estimation import samples_per_independent
from aerodb.flight import Flight
from aerodb.nomenclature import is_surface
from aerodb.signals import runs
from aerodb.support import HALF, NEARLY_ALL, NOTABLE, Array
from aerodb.suspicions.angles import off_motion
from aerodb.suspicions.changing import CHANGED, LOUDER, MISSED
from aerodb.suspicions.equation_error import RATE_OF, averaged
from aerodb.suspicions.evidence import FEWEST, LIKELIER
from aerodb.suspicions.in_flight import HUGE, flying, known_masses
from aerodb.suspicions.shapes import HELD, SLOW, fast, is_off, lacked, most_explained, slack, still
from aerodb.suspicions.sized_faults import (
    ACCELERATIONS,
    ALWAYS,
    EVENLY,
    LEAST_OFFSET,
    RATES,
    SEEN,
    SHAPES,
    STEP,
    Axis,
    Fault,
    first_sample,
    likeliest_stretch,
    makers,
    sized,
)
from aerodb.suspicions.surfaces import role_of
from aerodb.vehicle import Vehicle

#: Kind of a suspicion of a zero that moves.
MOVED: Final = "zero"
#: Share of the gain of the likeliest fault from which on another is named with it. The slopes by
#: which the axes share a fault are a database's.
ALIKE: Final = HALF
#: Flow angle up to which most of a flight must be for changes of its forces to be sought [rad]: an
#: aircraft that hovers has any, and no slope over it.
STEEP: Final = float(np.deg2rad(30.0))
#: Part of a flight that is most of it.
MOST_OF: Final = NEARLY_ALL
#: Longest time in which an aircraft crosses the wake of another, or a gust [s]; it goes along none
#: for longer unless it means to.
CROSSED: Final = 5.0
#: Least share of what a fault leaves that falls into such a time, and of what it explains that is
#: left there, for air to look like the fault.
UNEXPLAINED: Final = HALF
#: Motion and speed on which an error of a database may depend, as they are and squared.
STATES: Final = ("alpha", "beta", "V", "mach", "p", "q", "r", "thrust")
_ANGLE_OF: Final = {"CY": "beta", "CZ": "alpha"}
_MEASURED_BY: Final = {**dict(zip(("Cl", "Cm", "Cn"), RATES, strict=True)), "CY": "ay", "CZ": "az"}


def faults_in_time(
    flight: Flight,
    vehicle: Vehicle,
    slopes: Mapping[str, Mapping[str, float]],
    measured: Mapping[str, Array],
    predicted: Mapping[str, Array],
    usable: Mapping[str, NDArray[np.bool_]],
    alone: bool,
) -> list[Suspicion]:
    """Return channels that stand still while the motion goes on, or the likeliest fault that
    changes with time; empty where nothing does.

    vehicle : for its mass [kg] and area [m^2]. slopes : axis -> variable -> dC/dvariable per rad.
    measured, predicted, usable : axis -> (n,). alone : whether no constant fault is said. Source:
    `docs/method/consistency.md`, section "Against the database".
    """
    every = max(1, round(STEP / flight.step))
    judged = _judged(flight, slopes, measured, predicted, usable)
    if not judged:
        return []
    good = np.logical_and.reduce(list(judged.values()))
    rests = {a: averaged(np.where(good, measured[a] - predicted[a], np.nan), every) for a in judged}
    wholes = {a: averaged(np.where(good, predicted[a], np.nan), every) for a in judged}
    thin = {
        name: averaged(flight[name], every)
        for name in flight.channels
        if name in STATES or is_surface(name)
    }
    listed = (*rests.values(), *wholes.values(), *thin.values())
    inside = np.logical_and.reduce([np.abs(values) < HUGE for values in listed])
    if inside.sum() <= SETTLED / STEP:
        return []
    t = averaged(flight.time, every)[inside]
    thin = {name: values[inside] for name, values in thin.items()}
    moving = {name: values for name, values in thin.items() if np.ptp(values) > 0.0}
    held = [
        each
        for axis in judged
        if (each := _held(axis, slopes[axis], rests[axis][inside], moving, t)) is not None
    ]
    if held:
        return held
    basis = _basis(moving, len(t))
    axes = {axis: _axis(rests[axis][inside], basis, wholes[axis][inside]) for axis in judged}
    per_acceleration = {
        name: averaged(values, every)[inside]
        for name, values in _coefficients_per_acceleration(flight, vehicle, axes).items()
    }
    readings, shown_by = {}, {}
    for axis, name in _MEASURED_BY.items():
        if name in per_acceleration:
            shown = shown_by[name] = averaged(_reading(flight, name), every)[inside]
            arms = per_acceleration[name] * shown - averaged(measured[axis], every)[inside]
            readings[name] = axes[axis].explained(wholes[axis][inside] + arms)
    vanes = {name: values[inside] for name, values in off_motion(flight, every).items()}
    more = _Columns(vanes, per_acceleration, readings, shown_by)
    return _likeliest(axes, slopes, moving, more, t, alone)


@dataclass(frozen=True, eq=False)
class _Columns:
    """What is no channel: how far vanes are from the motion (m,) [rad], by their names; and of each
    accelerometer the coefficient that 1 m/s2 of it makes of its axis (m,), what it reads of the
    database's force and of the turning about it, as a coefficient (m,), and itself (m,) [m/s2]."""

    off_motion: Mapping[str, Array]
    per_acceleration: Mapping[str, Array]
    readings: Mapping[str, Array]
    accelerations: Mapping[str, Array]


def _reading(flight: Flight, name: str) -> Array:
    """An accelerometer (n,) [m/s2], at the CG or where it sits."""
    return flight[name if name in flight else f"{name}_imu"]


def _coefficients_per_acceleration(
    flight: Flight, vehicle: Vehicle, axes: Iterable[str]
) -> dict[str, Array]:
    """Coefficient (n,) per m/s2 of ay and az: mass over area and dynamic pressure."""
    mass = known_masses(flight, vehicle).get("mass")
    if mass is None or "qbar" not in flight:
        return {}
    with np.errstate(all="ignore"):
        force = mass / (vehicle.reference.area * flight["qbar"])
    return {
        name: np.nan_to_num(force, posinf=0.0, neginf=0.0)
        for axis, name in _MEASURED_BY.items()
        if axis in axes and name in ACCELERATIONS and {name, f"{name}_imu"} & set(flight.channels)
    }


def _judged(
    flight: Flight,
    slopes: Mapping[str, Mapping[str, float]],
    measured: Mapping[str, Array],
    predicted: Mapping[str, Array],
    usable: Mapping[str, NDArray[np.bool_]],
) -> dict[str, NDArray[np.bool_]]:
    """Axis -> where it can be judged (n,), for axes that can be for as long as most."""
    flown, found = flying(flight, ()), {}
    for axis in _MEASURED_BY:
        if axis in measured and slopes.get(axis):
            good = usable[axis] & flown & np.isfinite(measured[axis] - predicted[axis])
            if not _is_steep(flight, _ANGLE_OF.get(axis, ""), good):
                found[axis] = good
    most = max((int(good.sum()) for good in found.values()), default=0)
    return {axis: good for axis, good in found.items() if 2 * int(good.sum()) > most}


def _is_steep(flight: Flight, angle: str, good: NDArray[np.bool_]) -> bool:
    """Whether the flow angle of an axis, if it has one, is beyond `STEEP` for a part of the flight
    that matters."""
    if not angle or angle not in flight.channels or not good.any():
        return False
    return bool(np.nanquantile(np.abs(flight[angle][good]), MOST_OF) > STEEP)


def _axis(rest: Array, basis: Array, whole: Array) -> Axis:
    left = rest - basis @ (basis.T @ rest)
    independent = len(rest) / samples_per_independent(left)
    axis = Axis(rest, left, basis, whole, independent)
    return replace(axis, whole=axis.explained(whole))


def _likeliest(
    axes: Mapping[str, Axis],
    slopes: Mapping[str, Mapping[str, float]],
    moving: Mapping[str, Array],
    more: _Columns,
    t: Array,
    alone: bool,
) -> list[Suspicion]:
    """The likeliest fault, if it pays for all that were tried, with those that are nearly so."""
    lacks = lacked(moving, more.off_motion, t)
    basis = next(iter(axes.values())).basis  # of all axes
    most = most_explained(lacks, basis, {axis: each.left for axis, each in axes.items()})
    faults = _ranked(_faults(axes, slopes, moving, more, t))
    found = next(iter(_large(faults, axes, most, alone)), None)
    if found is None:
        return []
    # What is independent is known with the fault.
    axes = {axis: each.with_fault(found, axis) for axis, each in axes.items()}
    faults = _ranked(_faults(axes, slopes, moving, more, t))
    large = _large(faults, axes, most, alone)
    best = next((each for each in large if each.is_certain(len(faults))), None)
    if best is None:
        return []
    least = min(ALIKE * best.likelier, best.likelier - LIKELIER)
    near = {best.channel: best}
    for each in faults:
        if each.likelier > least and any(abs(each.shares.get(a, 0.0)) > SEEN for a in best.axes):
            near.setdefault(each.channel, each)
    effect = best.what == "gain" and best.channel not in _MEASURED_BY.values()
    turned = effect or (best.what == "zero" and best.channel not in ACCELERATIONS)
    change = -best.size if turned else best.size
    evidence = {"change": change, "standard_error": best.error, "likelier": best.likelier}
    kind = MOVED if best.what == "zero" else CHANGED
    axis = best.axes[0]
    words = _words(best, list(near.values())[1:], makers(slopes[axis], moving))
    if (air := _crossed(axes[axis], best.size * best.columns[axis], t)) is not None:
        evidence |= {"air_from": air[0], "air_until": air[1]}
        words += (
            f". Most that it leaves of {axis} falls between {air[0]:.1f} and {air[1]:.1f} s. Air"
            " that only a part of the aircraft met, such as a wake, would do that (aerodb flight"
            " wake)"
        )
    return [Suspicion(best.channel, kind, words, evidence)]


def _crossed(axis: Axis, fault: Array, t: Array) -> tuple[float, float] | None:
    """When air that no channel shows may have acted on an axis [s]; None where a fault (m,), as a
    coefficient, leaves little, or no more in a short time than in others.

    Wings and tail that are in other air than the vanes have loads of their own, which no fault of a
    channel makes on all of it.
    """
    rest = axis.left - axis.own(fault)
    longest = max(1, min(round(CROSSED / STEP), round(NOTABLE * len(t))))
    within = np.convolve(rest * rest, np.ones(longest), "valid")
    at = int(np.argmax(within))
    explained = float(axis.left @ axis.left - rest @ rest)
    if not (explained > 0.0 and within[at] > UNEXPLAINED * max(float(rest @ rest), explained)):
        return None
    return float(t[at]), float(t[at + longest - 1])


def _large(
    faults: Sequence[Fault], axes: Mapping[str, Axis], most: Mapping[str, float], alone: bool
) -> list[Fault]:
    """Those of faults, the likeliest first, that are large enough to be said. most : axis -> share
    that something which the database may lack explains of it."""
    likeliest = next((fault for fault in faults if not fault.is_rival_only), None)
    return [
        fault
        for fault in faults
        if fault.is_large(fault is likeliest, alone, fault.is_likelier(axes, most))
        and fault.is_borne_out(axes)
    ]


def _ranked(faults: Iterable[Fault]) -> list[Fault]:
    """The likeliest time of each kind of fault of each channel, the likeliest fault first."""
    likeliest: dict[tuple[str, str], Fault] = {}
    for fault in sorted(faults, key=lambda fault: fault.likelier, reverse=True):
        likeliest.setdefault((fault.channel, fault.what), fault)
    return list(likeliest.values())


def _added(
    axes: Mapping[str, Axis],
    slopes: Mapping[str, Mapping[str, float]],
    moving: Mapping[str, Array],
    more: _Columns,
) -> Iterator[tuple[str, str, dict[str, Array]]]:
    """Channel, what is wrong with it, and axis -> what this adds to what the database leaves (m,),
    per unit of the fault: what is logged is the truth and the fault."""
    measured = {_MEASURED_BY[axis]: axis for axis in axes}
    names = [name for name in moving if name in STATES or is_surface(name)]
    for name in dict.fromkeys((*names, *measured)):
        acts = {axis: -slopes[axis][name] for axis in axes if slopes[axis].get(name)}
        acts = acts if name in moving else {}
        own = measured.get(name)
        kinds: dict[str, Callable[[Array], Iterable[Array]]] = {
            "gain": lambda values: [values],
            "delay": lambda values: [np.gradient(values, STEP)],
        }
        if is_surface(name) and not role_of(name):  # flaps and brakes change what others do
            kinds = {}
        if acts and (own is None or name in RATES):
            kinds["zero"] = lambda values: [np.ones_like(values)]
        if acts and name not in RATES:
            kinds["still"] = lambda values: filter(is_off, still(values))
        if acts and role_of(name):
            kinds["play"] = slack
            kinds["fast"] = lambda values: filter(is_off, fast(values))
        for what, change in kinds.items():
            changed = list(change(moving[name])) if acts else []
            listed = [{axis: slope * v for axis, slope in acts.items()} for v in changed]
            if own is not None and what != "zero":  # a moment follows from the rate's change
                shown = more.readings.get(name, axes[own].whole)
                listed = listed or [{}]
                for added, values in zip(listed, change(shown), strict=True):
                    added[own] = added.get(own, 0.0) + values
            for added in listed:
                if added:
                    yield name, what, added
    for name, angle in more.off_motion.items():
        acts = {axis: -slopes[axis][name] for axis in axes if slopes[axis].get(name)}
        if acts:
            yield name, "motion", {axis: slope * angle for axis, slope in acts.items()}
    for name, force in more.per_acceleration.items():
        if measured.get(name):
            yield name, "zero", {measured[name]: force}
            for values in still(more.accelerations[name]):
                if is_off(values, LEAST_OFFSET):
                    yield name, "still", {measured[name]: force * values}
    yield "qbar", "gain", {axis: -each.whole for axis, each in axes.items()}
    turning = {
        axis: np.sum([slopes[axis][rate] * moving[rate] for rate in rates], axis=0)
        for axis in axes
        if (rates := [rate for rate in RATES if rate in moving and slopes[axis].get(rate)])
    }
    if turning:
        yield "V", "gain", turning


def _faults(
    axes: Mapping[str, Axis],
    slopes: Mapping[str, Mapping[str, float]],
    moving: Mapping[str, Array],
    more: _Columns,
    t: Array,
) -> Iterator[Fault]:
    """Every fault that may be: all the time, evenly over the flight, from a sample on, or within a
    stretch."""
    ramp = (t - t[0]) / (t[-1] - t[0])
    for name, what, added in _added(axes, slopes, moving, more):
        own = {axis: axes[axis] for axis in added}
        if what == "motion":
            yield from _off_motion(own, name, added, t)
            continue
        kinematic = name in RATES and what == "delay"
        if what in ("delay", *SHAPES) and not kinematic:
            yield from sized(own, name, what, ALWAYS, added)
        if what in SHAPES:
            continue
        if kinematic:
            # A delay that changes is more than one that the flight has all the time.
            own = {axis: each.beside(added[axis]) for axis, each in own.items()}
        evenly = {axis: values * ramp for axis, values in added.items()}
        yield from sized(own, name, what, EVENLY, evenly)
        at = first_sample(own, added)
        later = {axis: values * (np.arange(len(t)) >= at) for axis, values in added.items()}
        when = f"at {t[at]:.1f} s" if what == "zero" else f"from {t[at]:.1f} s on"
        found = list(sized(own, name, what, when, later))
        yield from found
        if what == "zero":  # a stall moves a moment and lets it go; a zero that moved stays
            continue
        first, last = likeliest_stretch(own, added)
        sample = np.arange(len(t))
        part = {axis: v * ((sample >= first) & (sample < last)) for axis, v in added.items()}
        when = f"from {t[first]:.1f} to {t[last - 1]:.1f} s"
        # An end is one more time that is sought.
        needed = max((fault.likelier for fault in found), default=0.0) + LIKELIER
        for fault in sized(own, name, what, when, part):
            if fault.likelier > needed:
                yield replace(fault, is_stretch=True)


def _off_motion(
    axes: Mapping[str, Axis], name: str, added: Mapping[str, Array], t: Array
) -> Iterator[Fault]:
    """A vane that leaves the motion within a stretch. Noise parts the two all the time: it gains as
    much in any other stretch, and the stretch by so much less than the flight."""
    always = sum(fault.likelier for fault in sized(axes, name, "motion", ALWAYS, added))
    first, last = likeliest_stretch(axes, added)
    sample, most = np.arange(len(t)), 0.5 * (1.0 + (last - first) / len(t))
    part = {axis: v * ((sample >= first) & (sample < last)) for axis, v in added.items()}
    when = f"from {t[first]:.1f} to {t[last - 1]:.1f} s"
    for fault in sized(axes, name, "motion", when, part):
        if fault.likelier > most * always + LIKELIER:
            yield fault


def _words(best: Fault, near: Sequence[Fault], made_of: Sequence[str]) -> str:
    """made_of : channels of which the database makes the axis on which the fault acts most."""
    name = best.channel
    on = ", ".join(best.axes)
    rivals = "".join(f", or {each.channel} {_how(each)}" for each in near)
    if best.what == "zero":
        how = "drifts" if best.when == EVENLY else "jumps"
        force = name in ACCELERATIONS
        size = f"{best.size:.2g} m/s2" if force else f"{np.rad2deg(-best.size):.2g} deg"
        other = "the mass" if best.axes[0] in _ANGLE_OF else "the CG moved"
        return (
            f"what the database leaves of {on} {how} {best.when} by as much as {size} of {name}."
            f" No motion explains it: the zero of the channel changed, or {other}{rivals}"
        )
    if best.what == "play":
        # What goes before the channel, instead of after it, is as far from a rate that is late.
        late = f", or {RATE_OF[role_of(name)]} is late or filtered" if best.size > 0.0 else ""
        return (
            f"{name} and its surface part by {2.0 * np.rad2deg(abs(best.size)):.2g} deg where the"
            f" motion turns, by the {on} of the database: a linkage has play{late}{rivals}"
        )
    if best.what == "still":
        return (
            f"{name} stands still where the {on} of the database goes on{rivals}. Its channel is"
            " clipped or in steps, or was not recorded"
        )
    if best.what == "fast":
        return (
            f"{abs(best.size):.2g} times what {name} shows within {SLOW * STEP:.1g} s is not in the"
            f" {on} of the database{rivals}: its samples are wild, or off in time"
        )
    if best.what == "delay":
        return (
            f"{best.when} {name} is {abs(best.size):.2g} s {_how(best)} by the {on} of the"
            f" database{rivals}: a clock, a filter or a servo"
        )
    if best.what == "motion":
        return (
            f"{best.when} {name} is not what rates and accelerations make it. {on} of the database"
            f" follow the motion: the vane or its channel is wrong there{rivals}"
        )
    if name in _MEASURED_BY.values():
        made = [n for n in made_of if n != name and all(n != each.channel for each in near)]
        by = f", or what the database makes {best.axes[0]} of ({', '.join(made)})" if made else ""
        return (
            f"{best.when} the measured {on} is another, by {best.size:.2g} times the database's:"
            f" {name}{rivals}, the channel or its calibration changed{by}"
        )
    return (
        f"{best.when} the effect of {name} on {on} is another, by {-best.size:.2g} times the"
        f" database's: the channel or its calibration changed{rivals}"
    )


def _how(fault: Fault) -> str:
    """What is wrong with a channel, after its name."""
    if fault.what == "delay":
        return "late" if fault.size < 0.0 else "early"
    words = {"play": "with play", "still": "that stands still", "fast": "with wild samples"}
    return words.get(fault.what, f"with another {fault.what}")


def _held(
    axis: str, slopes: Mapping[str, float], rest: Array, moving: Mapping[str, Array], t: Array
) -> Suspicion | None:
    """A surface or a vane whose channel stands still for stretches in which its axis goes on
    without it."""
    sensor, angle = _MEASURED_BY[axis], _ANGLE_OF.get(axis)
    own = {n: s for n, s in slopes.items() if n == angle or RATE_OF.get(role_of(n)) == sensor}
    name = max(own.keys() & moving.keys(), key=lambda n: abs(own[n]), default="")
    same = np.diff(moving[name]) == 0.0 if name else np.zeros(0, dtype=bool)
    still = np.zeros(len(t), dtype=bool)
    for first, last in runs(same, HELD):
        still[first : last + 2] = True
    if min(int(still.sum()), int((~still).sum())) < FEWEST // 4:
        return None
    # Motion explains as much of the rest where the channel moves as where it does not.
    columns = np.column_stack([np.ones_like(t), *moving.values()])
    left = rest - columns @ np.linalg.lstsq(columns[~still], rest[~still])[0]
    here, elsewhere = (float(np.sqrt(np.mean(left[where] ** 2))) for where in (still, ~still))
    does = abs(sum(own.values())) * float(np.std(moving[name][~still]))
    if not here > max(LOUDER * elsewhere, MISSED * does):
        return None
    since = float(t[int(np.argmax(still))])
    seconds = STEP * float(still.sum())
    words = (
        f"{name} stands still for {seconds:.1f} s in all, first at {since:.1f} s, and there"
        f" {here / elsewhere:.2g} times as much of {axis} is left. Its channel is clipped, or was"
        " not recorded"
    )
    return Suspicion(name, "stuck", words, {"from": since, "seconds": seconds})


def _basis(columns: Mapping[str, Array], n: int) -> Array:
    """Orthonormal columns (n, k) that span a constant, the columns and the squares of `STATES`."""
    scaled = {name: (values - values.mean()) / np.std(values) for name, values in columns.items()}
    squares = [values * values for name, values in scaled.items() if name in STATES]
    whole = np.column_stack([np.ones(n), *scaled.values(), *squares])
    own, sizes, _ = np.linalg.svd(whole, full_matrices=False)
    return np.asarray(own[:, sizes > 1e-6 * sizes[0]])
