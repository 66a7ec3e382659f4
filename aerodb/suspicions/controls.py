"""Each control surface against the motion that it causes: size, sign, effect and delay.

Angular accelerations, as moment coefficients without the gyroscopic part, are regressed on flow
angle, rates and all deflections (equation error: Klein & Morelli, Aircraft System Identification,
2006, chapter 5) in the band of manoeuvres, with standard errors for coloured residuals. A control
loop moves surfaces with the motion, mostly as a damper does; its surface follows the motion, and
opposes it, so that what it adds has the sign of a right surface. Claims need a fit that explains
the motion, a surface that no other regressor imitates, and a margin of many standard errors.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from aerodb.conditioning import LARGEST_DELAY, Suspicion
from aerodb.estimation import Regression
from aerodb.flight import Flight
from aerodb.support import half_interval
from aerodb.suspicions.assignment import assignment_suspicions
from aerodb.suspicions.changing import changing_suspicions
from aerodb.suspicions.damping import damping_beside_vehicle
from aerodb.suspicions.equation_error import (
    DELAYS_TRIED,
    MOTION,
    RATE_OF,
    EquationError,
    equation_errors,
)
from aerodb.suspicions.evidence import (
    CAUSED,
    ERRORS,
    EXPLAINED,
    FEWEST,
    INFLATION,
    LATE,
    LIKELIER,
    SWING,
    WELL_EXPLAINED,
    likelier_by,
)
from aerodb.suspicions.sides import side_suspicions
from aerodb.suspicions.surfaces import Control, along, by_role, copied_suspicions, size_suspicions
from aerodb.vehicle import Vehicle, lacks_airspeed

#: Least and largest effect per rad of a whole control of this role. dCm/d delta of tailed aircraft
#: is .5 to 3, dCl .03 to .4, dCn .03 to .3 (Roskam, Airplane Flight Dynamics, 1979, appendix C).
EFFECT = {"pitch": (0.03, 12.0), "roll": (0.006, 1.6), "yaw": (0.006, 1.6)}
#: Kind of suspicion of a surface that may have stood still: said, but no fault of the flight.
UNMOVED = "unmoved"
_SAYS = {
    "pitch": "trailing edge down must pitch the nose down",
    "roll": "right trailing edge down must roll to the left",
    "yaw": "trailing edge left must yaw the nose to the left",
}


def control_suspicions(flight: Flight, vehicle: Vehicle) -> tuple[Suspicion, ...]:
    """Return surfaces whose size, sign, effect or delay contradicts the motion; one per surface.

    Signs are those of the conventions (trailing edge down positive, rudder left), for surfaces that
    the vehicle file declares so: elevators, ailerons and rudders by their names, and combinations.
    Where rotors carry the vehicle and no airspeed is measured, only sizes and copies are looked at.

    Deflections (n,) [rad], effects per rad. Source: `docs/method/consistency.md`, section "Against
    the vehicle".
    """
    listed = [*size_suspicions(flight, vehicle), *copied_suspicions(flight, vehicle)]
    if lacks_airspeed(flight, vehicle):  # rotors turn it, and surfaces that follow get their effect
        return tuple(listed)
    unusable = {suspicion.channel for suspicion in listed}
    controls = by_role(flight, vehicle, unusable)
    axes = equation_errors(flight, vehicle, controls)
    fits = {role: fit for role, axis in axes.items() if (fit := axis.fit()) is not None}
    exchanged = _exchanged(axes, fits, controls)
    if exchanged is not None:
        return (*listed, exchanged)
    claims = []
    for role, fit in fits.items():
        own = {name: control for name, control in controls.items() if control.role == role}
        claims += _claims(axes[role], fit, own)
    sides = side_suspicions(flight, vehicle, controls)
    if not sides and all(claim.kind in ("unit", "sign") for claim in claims):
        assigned = assignment_suspicions(axes, controls)
        if assigned:
            return (*listed, *assigned)
    listed += claims
    said = {each.channel for each in listed}
    listed += [s for s in changing_suspicions(flight, axes, controls) if s.channel not in said]
    said = {each.channel for each in listed}
    listed += [s for s in sides if s.channel not in said]
    standing = [
        s for role, fit in fits.items() for s in _standing(flight, axes[role], fit, controls)
    ]
    listed += [each for each in standing if each.kind != UNMOVED]
    if not listed and "roll" in fits and not vehicle.rotors:  # which damp it more than wings do
        listed += damping_beside_vehicle(axes["roll"], fits["roll"], vehicle)
    return (*listed, *(each for each in standing if each.kind == UNMOVED))


def _claims(axis: EquationError, fit: Regression, own: Mapping[str, Control]) -> list[Suspicion]:
    """Return what is wrong with the surfaces of one role, by the fit about its axis."""
    listed = []
    least, largest = EFFECT[axis.role]
    total = float(np.std(axis.moment[axis.where]))
    for name, control in own.items():
        if name not in fit.names or not total > 0.0:
            continue
        k = fit.names.index(name)
        effect, error = float(fit.estimates[k]), float(fit.standard_errors[k])
        moved = float(np.std(axis.controls[name][axis.where]))
        evidence = {"effect": effect, "standard_error": error, "explained": fit.r_squared}
        told = f"{name} gives {effect:.3g} +- {half_interval(error):.2g} per rad"
        if fit.vif[k] > INFLATION:
            continue
        caused = abs(effect) * moved / total
        shift = _late(axis, fit, name, control)
        if shift is not None:
            listed.append(shift)
        elif (
            control.signed
            and effect > max(ERRORS * error, least)
            and fit.r_squared > EXPLAINED
            and caused > CAUSED
        ):
            words = (
                f"{told} about the {axis.role} axis, and {_SAYS[axis.role]}: its sign is flipped"
            )
            listed.append(Suspicion(name, "sign", words, evidence))
        elif (
            abs(effect) - ERRORS * error > largest and fit.r_squared > EXPLAINED and caused > CAUSED
        ):
            words = (
                f"{told} about the {axis.role} axis, and no surface gives more than {largest:g}:"
                " its unit (degrees, radians), an inertia or a length is another"
            )
            listed.append(Suspicion(name, "unit", words, evidence))
        elif abs(effect) + ERRORS * error < least and moved > SWING and control.alone:
            words = (
                f"{told} about the {axis.role} axis, and no surface gives less than {least:g}: its"
                " unit is another, it is disconnected, or it is another surface's channel"
            )
            listed.append(Suspicion(name, "unit", words, evidence))
    return listed


def _standing(
    flight: Flight, axis: EquationError, fit: Regression, controls: Mapping[str, Control]
) -> list[Suspicion]:
    """Return a surface whose channel never changes although the aircraft turns about its axis and
    others are recorded: not recorded, where neither the motion nor any of them explains what turns
    it; otherwise unmoved or not recorded, which the flight cannot tell."""
    where = axis.where
    own = {name: control for name, control in controls.items() if control.role == axis.role}
    travel = {n: float(np.ptp(axis.thinned(along(flight, c))[where])) for n, c in controls.items()}
    still = [name for name in own if travel[name] == 0.0]
    recorded = any(each > 0.0 for each in travel.values())
    rate = axis.thinned(flight[RATE_OF[axis.role]])[where]
    if not still or len(still) < len(own) or not recorded:
        return []
    if float(np.std(rate)) < SWING:
        return []
    evidence = {"explained": fit.r_squared}
    if fit.r_squared > WELL_EXPLAINED:
        words = (
            f"{still[0]} never changes while other surfaces do and the aircraft turns about the"
            f" {axis.role} axis: it stood still or was not recorded. Its effect, sign and delay"
            " stay unknown"
        )
        return [Suspicion(still[0], UNMOVED, words, evidence)]
    words = (
        f"{still[0]} never changes while other surfaces do, and only"
        f" {100 * fit.r_squared:.0f} % of the motion about the {axis.role} axis is explained"
        " without it: it was not recorded"
    )
    return [Suspicion(still[0], "stuck", words, evidence)]


def _late(axis: EquationError, fit: Regression, name: str, control: Control) -> Suspicion | None:
    """Return a delay between a surface and its motion that makes the fit much likelier; the claim
    pays for the lags that are tried."""
    if not control.signed or not set(MOTION[axis.role]) <= axis.motion.keys():
        return None
    reach = int(LARGEST_DELAY / axis.step)
    every = max(1, round(0.02 / axis.step))
    inner = axis.where.copy()
    inner[:reach], inner[len(inner) - reach :] = False, False
    if inner.sum() < FEWEST:
        return None
    view = replace(axis, where=inner)
    lags = range(-(reach // every) * every, reach + 1, every)
    best = view.likeliest_lag(name, lags)
    chosen = view.fit({**axis.controls, name: np.roll(axis.controls[name], best)})
    zero = view.fit()
    if chosen is None or zero is None:
        return None
    k = chosen.names.index(name)
    effect, error = float(chosen.estimates[k]), float(chosen.standard_errors[k])
    unexplained = (1.0 - zero.r_squared) / max(1.0 - chosen.r_squared, 1e-12)
    likelier = likelier_by(chosen, unexplained)
    seconds = best * axis.step
    if (
        abs(seconds) < LATE
        or abs(best) >= max(lags)
        or chosen.r_squared < EXPLAINED
        or likelier < LIKELIER + DELAYS_TRIED
        or not effect < -max(ERRORS * error, EFFECT[axis.role][0])
        or chosen.vif[k] > INFLATION
        or _bends(view, chosen)
    ):
        return None
    how = "late: the motion comes before it" if seconds < 0 else "early: the motion follows it"
    other = f", or {RATE_OF[axis.role]} is late or filtered" if seconds > 0 else ""
    words = (
        f"{name} is logged {abs(seconds):.2g} s too {how}, which no surface does:"
        f" its clock, or the lag of its servo, is another{other}"
    )
    evidence = {"delay": -seconds, "likelier": likelier, "explained": chosen.r_squared}
    return Suspicion(name, "delay", words, evidence)


def _bends(axis: EquationError, delayed: Regression) -> bool:
    """Whether the flow angle explains as well, by its rate and a slope that changes, what a delay
    explains of the moment."""
    fit = axis.fit({**axis.controls, **axis.bent})
    if fit is None:
        return False
    unexplained = (1.0 - fit.r_squared) / max(1.0 - delayed.r_squared, 1e-12)
    return likelier_by(delayed, unexplained) < LIKELIER + DELAYS_TRIED


def _exchanged(
    axes: Mapping[str, EquationError],
    fits: Mapping[str, Regression],
    controls: Mapping[str, Control],
) -> Suspicion | None:
    """Return two controls that act each about the other's axis."""
    if not {"roll", "yaw"} <= fits.keys():
        return None
    for one in (n for n, c in controls.items() if c.role == "roll"):
        for other in (n for n, c in controls.items() if c.role == "yaw"):
            if any(n not in fits["roll"].names or n not in fits["yaw"].names for n in (one, other)):
                continue
            sizes = {
                (name, role): _size(fits[role], name)
                for name in (one, other)
                for role in fits
                if role != "pitch"
            }
            crossed = (sizes[other, "roll"], sizes[one, "yaw"])
            if not all(clear for _, clear in crossed):
                continue
            if (
                crossed[0][0] > 2.0 * sizes[one, "roll"][0]
                and crossed[1][0] > 2.0 * sizes[other, "yaw"][0]
            ):
                words = (
                    f"{one} yaws the aircraft and {other} rolls it: the two channels are swapped,"
                    " or p and r are"
                )
                return Suspicion(one, "swapped", words, {"ratio": crossed[0][0]})
    return None


def _size(fit: Regression, name: str) -> tuple[float, bool]:
    k = fit.names.index(name)
    effect, error = abs(float(fit.estimates[k])), float(fit.standard_errors[k])
    return effect, effect > ERRORS * error and fit.vif[k] < INFLATION
