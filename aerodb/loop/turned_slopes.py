"""The point about which an added slope turns a curve: nothing, zero lift, or the flown mean.

Every flight has constants of its own, so that tracing estimates the slope alone. What is added has
a constant too: a lift curve whose slope is wrong by a share turns about its angle of zero lift, and
so does the moment where the neutral point lies elsewhere; a curve whose table was read at another
alpha turns about none. Where a centre of gravity or a surface's zero that is off has hidden that
constant, the slope is added about the mean of what was flown, and the level stays as it was.
docs/method/tracing.md, section 13.
"""

import operator
from collections.abc import Mapping, Sequence, Set
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.effects import WIND_TO_BODY_AXES, from_zero_lift, lift_curve
from aerodb.loop.flight_source import FlightSource
from aerodb.loop.frozen_library import Library
from aerodb.loop.sensor_share import beside_sensors, compared_with
from aerodb.tables import AeroDatabase, Expression, Name, number, parse, plus

#: Axis of an increment -> body axis that shows its constant.
_SHOWN_ON: Final = {"C_lift": "CZ", "CZ": "CZ", "Cm": "Cm"}
_SLOPE: Final = parse("alpha")


def about_zero_lift(
    source: FlightSource,
    flights: Sequence[str],
    before: AeroDatabase,
    candidate: AeroDatabase,
    library: Library,
    sensors: Mapping[str, float],
) -> AeroDatabase:
    """Return the candidate, whose increments since `before` with a slope over alpha turn their
    curves about zero lift on each axis where that leaves these flights (ids) the smaller constant.

    Constants are means over flights of measured - predicted, dimensionless, without what the
    library's sensors found to be wrong (id -> error, SI) leave: a centre of gravity that is off has
    a constant of its own. Raises InputError where a flight lacks what is needed.
    """
    first = len(before.increments)
    turned = parse(from_zero_lift(before))
    others = {
        parse(from_zero_lift(replace(candidate, increments=candidate.increments[:place])))
        for place in range(first + 1, len(candidate.increments))
    }
    none, zero_lift = _curves(before, library)
    none |= dict.fromkeys({turned, *others}, _SLOPE)
    zero_lift |= dict.fromkeys({_SLOPE, *others}, turned)
    beside: FlightSource | None = None
    for axis, body in _SHOWN_ON.items():
        pair = [_about(candidate, first, axis, each) for each in (none, zero_lift)]
        if pair[0] is pair[1]:
            continue
        if beside is None:  # the two differ by a constant
            beside = beside_sensors(source, flights, candidate, library, sensors)
        constants = [mean_constant(compared_with(beside, flights, each), body) for each in pair]
        if None not in constants:
            candidate = pair[abs(constants[1] or 0.0) < abs(constants[0] or 0.0)]
    return candidate


def _curves(
    database: AeroDatabase, library: Library
) -> tuple[dict[Expression, Expression], dict[Expression, Expression]]:
    """The regressors of `lift_scale` without the curve's constant for those with it, and the other
    way round."""
    none, whole = {}, {}
    for hypothesis in library.hypotheses:
        if hypothesis.effect == "lift_scale":
            ((axis, curve),) = hypothesis.increment
            alpha, values = lift_curve(database, axis)
            with_constant = plus(curve, number(round(float(np.interp(0.0, alpha, values)), 6)))
            none[with_constant], whole[curve] = curve, with_constant
    return none, whole


def about_flown_mean(
    source: FlightSource,
    flights: Sequence[str],
    before: AeroDatabase,
    candidate: AeroDatabase,
    axes: Set[str],
) -> AeroDatabase:
    """Return the candidate, whose increments since `before` on these body axes have slopes over
    channels about the mean of what flights (ids) have flown, so that they leave the level as it is.

    Channels are in SI units. Raises InputError for an unknown flight.
    """
    flown = [source.flight(flight) for flight in flights]

    def turned(regressor: Expression) -> Expression:
        if not isinstance(regressor, Name) or any(regressor.name not in each for each in flown):
            return regressor
        mean = float(np.mean([np.nanmean(each[regressor.name]) for each in flown]))
        return plus(regressor, number(-mean)) if np.isfinite(mean) and mean else regressor

    first = len(before.increments)
    changed = [
        replace(
            each,
            regressors=tuple(map(turned, each.regressors)),
            note=f"{each.note}; slopes about the flown mean, which leaves the level as it was",
        )
        if number_ >= first and not axes.isdisjoint(WIND_TO_BODY_AXES.get(each.axis, (each.axis,)))
        else each
        for number_, each in enumerate(candidate.increments)
    ]
    return replace(candidate, increments=tuple(changed))


def _about(
    candidate: AeroDatabase, first: int, axis: str, turned: Mapping[Expression, Expression]
) -> AeroDatabase:
    """The candidate with other regressors in its increments on an axis, from number `first`."""
    changed = list(candidate.increments)
    for place, each in enumerate(changed):
        regressors = tuple(turned.get(one, one) for one in each.regressors)
        if place >= first and each.axis == axis and regressors != each.regressors:
            changed[place] = replace(each, regressors=regressors)
    same = all(map(operator.is_, changed, candidate.increments))
    return candidate if same else replace(candidate, increments=tuple(changed))


def mean_constant(compared: Mapping[str, Comparison], axis: str) -> float | None:
    """Return the mean over flights of measured - predicted, dimensionless; None where no flight has
    a usable sample of the axis."""
    means = [
        float(each.residual(axis)[each.usable[axis]].mean())
        for each in compared.values()
        if axis in each.usable and each.usable[axis].any()
    ]
    return float(np.mean(means)) if means else None
