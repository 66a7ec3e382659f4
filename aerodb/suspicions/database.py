"""A flight against its vehicle's database: sign, size and delay of each control, the level and the
slope of the lift, the factor that all moments share; controls exchanged; mass, CG and thrust;
single rotors.

A wind tunnel may be wrong by a fifth of a lift slope or half of an elevator, and lack an effect. It
is not wrong about the sign of a control, by a factor of four, or by one factor about all axes. A
build-up of parts has all its tails too steep at once; there every derivative must have the factor.
"""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import LARGEST_DELAY, Suspicion
from aerodb.estimation import Regression
from aerodb.flight import Flight
from aerodb.nomenclature import MOMENT_AXES, is_surface
from aerodb.support import SMALL, Array, half_interval
from aerodb.suspicions.changing import RATIOS as SCALES
from aerodb.suspicions.damping import damping_beside_database
from aerodb.suspicions.derivatives import AxisShares, Share, axis_shares, whole_surface
from aerodb.suspicions.equation_error import DELAYS_TRIED, RATE_OF
from aerodb.suspicions.evidence import (
    ERRORS,
    EXPLAINED,
    FEWEST,
    INFLATION,
    LATE,
    LIFTS,
    LIKELIER,
    PART,
    RATIOS,
    SCATTER,
    WELL_EXPLAINED,
    likelier_by,
)
from aerodb.suspicions.exchanged import exchanged_suspicions
from aerodb.suspicions.faults_in_time import faults_in_time
from aerodb.suspicions.loads import (
    FEWEST_MOMENTS,
    POSSIBLE,
    cg_beside,
    force_ratio,
    mass_beside,
    thrust_beside,
    vane_beside,
)
from aerodb.suspicions.mass_events import shift_beside
from aerodb.suspicions.rotors import rotor_suspicions
from aerodb.suspicions.surfaces import role_of
from aerodb.tables import AeroDatabase
from aerodb.vehicle import Vehicle

#: Ratio of a control's effect to the database's below which its unit is another.
LEAST = SMALL
#: The same above which its unit is another; below minus `LEAST` its sign is reversed.
LARGEST = 5.0
#: The same above which no unit makes it: degrees for radians, and `LARGEST` beside.
FURTHEST = float(np.rad2deg(LARGEST))
#: How much a ratio may differ from one (one sigma of a normal distribution).
USUAL = 0.35
#: Lift coefficient by which the levels may differ beside that.
BESIDE = 0.15
#: Least factor that all moments share.
SHARED = 1.25
#: Largest difference of one derivative's factor from that of all moments, natural logarithm, in a
#: build-up: inertia is known to a tenth.
SAME = SMALL
_SLUG_FOOT = 1.3558
#: The axis that a control of each role is for.
AXIS_OF = {"pitch": "Cm", "roll": "Cl", "yaw": "Cn"}
_MEASURED_BY = {axis: RATE_OF[role] for role, axis in AXIS_OF.items()}


def against_database(
    flight: Flight,
    database: AeroDatabase,
    measured: Mapping[str, Array],
    predicted: Mapping[str, Array],
    usable: Mapping[str, NDArray[np.bool_]],
    bandwidth: float | None,
    vehicle: Vehicle,
) -> tuple[Suspicion, ...]:
    """Return what in a flight contradicts its vehicle's database beyond what a wind tunnel can have
    wrong, and what a wrong vehicle file would look like; empty for a good pair.

    flight : with all inputs of the database that it has. measured, predicted, usable : axis ->
    (n,), as `aerodb.coefficients.compare` gives them. bandwidth : Hz, of both moments; None: not
    limited.
    """
    lift = _lift(flight, measured, predicted, usable)
    axes = axis_shares(flight, database, measured, predicted, usable, bandwidth)
    # What acts through a state, such as the flapping of a rotor, has little share of its own.
    held = database.inputs_of_rates if database.rates else frozenset[str]()
    axes = {axis: each for axis, each in axes.items() if held.isdisjoint(each.parts)}
    fits = {axis: fit for axis, each in axes.items() if (fit := each.fit()) is not None}
    axes = {axis: each for axis, each in axes.items() if axis in fits}
    exchanged = exchanged_suspicions(axes, flight)
    surfaces = exchanged or _delays(axes)
    late = {suspicion.channel for suspicion in surfaces}
    if not exchanged:
        surfaces += [each for each in _sizes(axes, fits) if each.channel not in late]
        surfaces += _standing(flight, axes, fits)
    area = database.reference.area
    pushed = thrust_beside(flight, vehicle, area, measured, predicted, usable)
    # Air that no sensor measures moves the vehicle, and its controls answer: dampings seem small,
    # and change as gusts do.
    unmeasured = "V" in flight.estimated
    untold = lift or surfaces or unmeasured
    shared = [] if untold else _shared(axes, fits, bool(database.parts))
    if not (lift or surfaces or shared):
        known = _known(axes, fits)
        moments = [each for each in known if each.axis in MOMENT_AXES]
        shared = mass_beside(measured, predicted, usable, flight.step, moments)
        shared += cg_beside(axes, database.reference)
        shared = shared or vane_beside(axes, fits, known)
    rotors = rotor_suspicions(flight, database, measured, predicted, usable, bandwidth)
    jumps = shift_beside(flight, vehicle, measured, predicted, usable, bandwidth)
    if not (lift or jumps):
        slopes = {axis: each.slopes for axis, each in axes.items()}
        alone = not (surfaces or shared)
        changing = []
        if not unmeasured:
            changing = faults_in_time(flight, vehicle, slopes, measured, predicted, usable, alone)
        constant = {each.channel for each in (*surfaces, *shared)}
        # What changes with time makes constants wrong; no constant looks like it on all axes. Of
        # one channel, a constant has the better size.
        if changing and constant.isdisjoint(each.channel for each in changing):
            surfaces, shared = changing, []
        if not (surfaces or shared):
            surfaces = _scales(axes, fits)
    return (*lift, *surfaces, *pushed, *shared, *rotors, *jumps)


def _lift(
    flight: Flight,
    measured: Mapping[str, Array],
    predicted: Mapping[str, Array],
    usable: Mapping[str, NDArray[np.bool_]],
) -> list[Suspicion]:
    """Return a level, or a slope, of the lift that is far from the database's."""
    axis = "C_lift" if "C_lift" in measured else "CZ"
    if axis not in measured:
        return []
    good = usable[axis] & np.isfinite(measured[axis]) & np.isfinite(predicted[axis])
    if good.sum() < FEWEST or not np.any(predicted.get("CZ", predicted[axis])[good]):
        return []  # a database without lift contradicts none
    cause = (
        ": mass, area, density, airspeed or the angle of attack is wrong, or the log is another"
        " aircraft's"
    )
    here, there = (abs(float(np.median(values[axis][good]))) for values in (measured, predicted))
    evidence = {"measured": here, "predicted": there}
    if not LIFTS[0] * there - BESIDE <= here <= LIFTS[1] * there + BESIDE:
        words = (
            f"the lift coefficient is {here:.3g} in the median of the flight, and the database has"
            f" {there:.3g} for the same angles and deflections{cause}"
        )
        return [Suspicion("mass", "size", words, evidence)]
    ratio = force_ratio(measured[axis], predicted[axis], good, flight.step)
    if ratio is None:
        return []
    low, high = LIFTS[0] - ERRORS * ratio.error, LIFTS[1] + ERRORS * ratio.error
    if not ratio.explained > WELL_EXPLAINED:
        return []
    # Errors of alpha make it small, to no less than r^2 of it (Frisch, 1934).
    if ratio.value <= high and ratio.value / ratio.explained >= low:
        return []
    words = (
        f"the lift changes by {ratio.value:.3g} +- {half_interval(ratio.error):.2g} times what the"
        f" database has for the same angles and deflections{cause}"
    )
    evidence = {"ratio": ratio.value, "standard_error": ratio.error}
    return [Suspicion("mass", "size", words, evidence)]


def _sizes(axes: Mapping[str, AxisShares], fits: Mapping[str, Regression]) -> list[Suspicion]:
    """Return controls whose effect has another sign or another size than the database's; each is
    judged on the axis that tells its effect best."""
    best: dict[str, tuple[float, Share]] = {}
    for axis in (axis for axis in MOMENT_AXES if axis in axes):
        for name in filter(is_surface, axes[axis].parts):
            share = axes[axis].share(fits[axis], name)
            size = max(1.0, abs(share.ratio))
            told = share.vif <= INFLATION and size * share.weight > PART
            least = WELL_EXPLAINED if abs(share.ratio) < LEAST else EXPLAINED
            if told and fits[axis].r_squared > least:
                best[name] = min(best.get(name, (np.inf, share)), (share.error, share), key=_first)
    return [found for _, share in best.values() for found in _size(share)]


def _first(pair: tuple[float, Share]) -> float:
    return pair[0]


def _size(share: Share) -> list[Suspicion]:
    ratio, error, weight = share.ratio, share.error, share.weight
    told = (
        f"{share.variable} gives {ratio:.3g} +- {half_interval(error):.2g} times the {share.axis}"
        " that the database has for it"
    )
    evidence = {"ratio": ratio, "standard_error": error, "weight": weight}
    # What is far larger than the database has it, on another's axis, may be that one's.
    own = AXIS_OF.get(role_of(share.variable), share.axis) == share.axis
    reversed_ = -LARGEST < ratio < -LEAST and ratio + ERRORS * error < 0.0
    if reversed_ and abs(ratio) * weight > PART:
        kind, words = "sign", f"{told}: its sign is flipped, or it is another surface's channel"
    elif own and ratio - ERRORS * error > LARGEST and ratio * weight > PART:
        kind = "unit"
        words = f"{told}: its unit is another (radians taken for degrees)"
        if ratio - ERRORS * error > FURTHEST:
            kind = "size"
            words = (
                f"{told}, more than any unit makes it. It hardly moves, and another channel is"
                " wrong that moves as it does: a flow angle, a rate or another control"
            )
    elif abs(ratio) + ERRORS * error < LEAST and weight > PART:
        kind = "unit"
        words = f"{told}: its unit is another, or it is another surface's channel"
    else:
        return []
    return [Suspicion(share.variable, kind, words, evidence)]


def _scales(axes: Mapping[str, AxisShares], fits: Mapping[str, Regression]) -> list[Suspicion]:
    """Return controls whose effect on their own axis is so far from the database's that their scale
    may be another; a tunnel may have it wrong as well."""
    listed = []
    for axis in axes.keys() & AXIS_OF.values():
        for name in axes[axis].parts:
            if AXIS_OF.get(role_of(name)) != axis or fits[axis].r_squared < WELL_EXPLAINED:
                continue
            share = axes[axis].share(fits[axis], name)
            margin = ERRORS * share.error
            if share.vif > INFLATION or share.weight < PART:
                continue
            if SCALES[0] - margin <= share.ratio <= SCALES[1] + margin:
                continue
            words = (
                f"{name} gives {share.ratio:.3g} +- {half_interval(share.error):.2g} times the"
                f" {axis} that the database has for it: the scale of its channel is another, or the"
                " database's effect is wrong"
            )
            if share.ratio < 1.0:
                words += f". A filter of {_MEASURED_BY[axis]} looks alike"
            evidence = {"ratio": share.ratio, "standard_error": share.error}
            listed.append(Suspicion(name, POSSIBLE, words, evidence))
    return listed


def _delays(axes: Mapping[str, AxisShares]) -> list[Suspicion]:
    """Return controls that are logged late or early; each is judged on the axis of which it makes
    the largest part."""
    judged = [axes[axis] for axis in MOMENT_AXES if axis in axes]
    names = dict.fromkeys(name for each in judged for name in filter(is_surface, each.parts))
    found = []
    for name in names:
        own = max((e for e in judged if name in e.parts), key=lambda each: each.weight(name))
        if own.weight(name) > PART and (late := _delay(own, name)) is not None:
            found.append(late)
    return found


def _delay(axis: AxisShares, name: str) -> Suspicion | None:
    """Return a delay that makes the flight much likelier, by the motion that it explains and by the
    effect of the control being the database's; the claim pays for the lags that are tried."""
    reach, every = int(LARGEST_DELAY / axis.step), max(1, round(0.02 / axis.step))
    view = axis.inside(reach)
    if view.where.sum() < FEWEST:
        return None
    lags = range(-(reach // every) * every, reach + 1, every)
    lag = view.likeliest_lag(name, lags)
    if abs(lag) * axis.step < LATE or abs(lag) >= max(lags):
        return None
    fit, now = view.fit(name, lag), view.fit()
    if fit is None or now is None:
        return None
    share, zero = view.share(fit, name), view.share(now, name)
    gained = (1.0 - now.r_squared) / max(1.0 - fit.r_squared, 1e-12)
    unusual = ((share.ratio - 1.0) ** 2 - (zero.ratio - 1.0) ** 2) / (2.0 * USUAL**2)
    likelier = likelier_by(fit, gained) - unusual
    seconds = lag * axis.step
    if (
        likelier < LIKELIER + DELAYS_TRIED
        or fit.r_squared < EXPLAINED
        or share.vif > INFLATION
        or share.ratio < max(ERRORS * share.error, RATIOS[0])
        or share.ratio > RATIOS[1]
        or share.ratio < zero.ratio  # without its delay a control is seen to do more
        or _flow_lags(view, fit)
    ):
        return None
    how = "late: the motion comes before it" if seconds < 0 else "early: the motion follows it"
    other = f", or {_MEASURED_BY[axis.axis]} is late or filtered" if seconds > 0 else ""
    words = (
        f"{name} is logged {abs(seconds):.2g} s too {how} by the {axis.axis} of the database: its"
        f" clock, or the lag of its servo, is another{other}"
    )
    return Suspicion(name, "delay", words, {"delay": -seconds, "likelier": likelier})


def _flow_lags(axis: AxisShares, delayed: Regression) -> bool:
    """Whether a flow that lags explains as well what the delay of a control explains."""
    fit = axis.beside_lags()
    if fit is None:
        return False
    gained = (1.0 - fit.r_squared) / max(1.0 - delayed.r_squared, 1e-12)
    return likelier_by(delayed, gained) < LIKELIER + DELAYS_TRIED


def _standing(
    flight: Flight, axes: Mapping[str, AxisShares], fits: Mapping[str, Regression]
) -> list[Suspicion]:
    """Return a control of the database whose channel never changes, others' do, and without which
    neither the database nor any of its derivatives in another size explains the motion."""
    travel = {n: float(np.ptp(flight[n])) for n in flight.channels if is_surface(n)}
    if not any(each > 0.0 for each in travel.values()):
        return []
    for role, axis in AXIS_OF.items():
        if axis not in axes:
            continue
        own = [n for n in axes[axis].slopes if is_surface(n) and role_of(n) == role]
        explained, agreement = fits[axis].r_squared, axes[axis].agreement()
        if (
            not own
            or any(travel[n] > 0.0 for n in own)
            or explained > WELL_EXPLAINED
            or agreement > 0.0
        ):
            continue
        name = whole_surface(own[0], flight)
        words = (
            f"{name} was not recorded: it never changes while other surfaces do. The database"
            f" without it explains nothing of {axis} ({100 * explained:.0f} % with derivatives of"
            " any size)"
        )
        evidence = {"explained": explained, "agreement": agreement}
        return [Suspicion(name, "stuck", words, evidence)]
    return []


def _known(axes: Mapping[str, AxisShares], fits: Mapping[str, Regression]) -> list[Share]:
    """Return the derivatives that a flight tells well."""
    return [
        share
        for axis in axes
        for name in axes[axis].parts
        if (share := axes[axis].share(fits[axis], name)).ratio > 0.0
        and ERRORS * share.error < share.ratio
        and share.weight > PART
        and share.vif < INFLATION
    ]


def _shared(
    axes: Mapping[str, AxisShares], fits: Mapping[str, Regression], built: bool
) -> list[Suspicion]:
    """Return a factor by which all moments differ from the database's, or a damping in roll far
    from it. built : of a build-up of parts, whose damping says nothing of the vehicle."""
    found = _shared_factor(axes, fits, built)
    if found or built or "Cl" not in axes:
        return found
    return damping_beside_database(axes["Cl"], fits["Cl"])


def _shared_factor(
    axes: Mapping[str, AxisShares], fits: Mapping[str, Regression], built: bool
) -> list[Suspicion]:
    """Return a factor by which all moments differ from the database's. built : each derivative must
    have it, within its error and the rounding of vehicle data."""
    told = [share for share in _known(axes, fits) if share.axis in MOMENT_AXES]
    if len(told) < FEWEST_MOMENTS or len({share.axis for share in told}) < 2:
        return []
    ratios = np.log([share.ratio for share in told])
    middle = float(np.median(ratios))
    away = np.abs(ratios - middle)
    if abs(middle) < np.log(SHARED) or float(np.median(away)) > SCATTER * abs(middle):
        return []
    # One factor must be likelier than none. Single derivatives of a database may be far off, so
    # that deviations are taken as exponential.
    spread, about = float(np.mean(np.abs(ratios))), float(np.mean(away))
    if not len(ratios) * np.log(spread / max(about, 1e-300)) > LIKELIER:
        return []
    if built:
        errors = np.array([share.error / share.ratio for share in told])
        if np.any(away > ERRORS * errors + SAME):
            return []
    factor = float(np.exp(middle))
    unit = ""
    if abs(np.log(factor * _SLUG_FOOT)) < 0.08:
        unit = " (slug ft^2 taken for kg m^2)"
    elif abs(np.log(factor / _SLUG_FOOT)) < 0.08:
        unit = " (kg m^2 taken for slug ft^2)"
    words = (
        f"all moments are {factor:.3g} times the database's ({len(told)} derivatives about"
        f" {', '.join(dict.fromkeys(share.axis for share in told))}). Ixx, Iyy and Izz are too"
        f" {'small' if factor < 1.0 else 'large'}{unit}, or area, lengths or qbar are wrong"
    )
    return [Suspicion("Ixx", "size", words, {"factor": factor, "derivatives": float(len(told))})]
