"""The point about which an added slope turns a curve: nothing, zero lift, or the flown mean.

Every flight has constants of its own, so that tracing estimates the slope alone. What is added has
a constant too: a lift curve whose slope is wrong by a share turns about its angle of zero lift, and
so does the moment where the neutral point lies elsewhere; a curve whose table was read at another
alpha turns about none. Where a centre of gravity or a surface's zero that is off has hidden that
constant, the slope is added about the mean of what was flown, and the level stays as it was.
docs/method/tracing.md, section 13.
"""

from collections.abc import Sequence, Set
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.effects import WIND_TO_BODY_AXES, from_zero_lift
from aerodb.loop.flight_source import FlightSource
from aerodb.support import in_threads
from aerodb.tables import AeroDatabase, Expression, Name, number, parse, plus

#: Axis of an increment -> body axis that shows its constant.
_SHOWN_ON: Final = {"C_lift": "CZ", "CZ": "CZ", "Cm": "Cm"}
_SLOPE: Final = parse("alpha")


def about_zero_lift(
    source: FlightSource,
    flights: Sequence[str],
    before: AeroDatabase,
    candidate: AeroDatabase,
) -> AeroDatabase:
    """Return the candidate, whose increments since `before` with a slope over alpha turn their
    curves about zero lift on each axis where that leaves these flights (ids) the smaller constant.

    Constants are means over flights of measured - predicted, dimensionless. Raises InputError where
    a flight lacks what is needed.
    """
    turned = parse(from_zero_lift(before))
    for axis, body in _SHOWN_ON.items():
        other = _turned(before, candidate, axis, turned)
        if other is None:
            continue
        constants = [_constant(source, flights, each, body) for each in (candidate, other)]
        if None not in constants and abs(constants[1] or 0.0) < abs(constants[0] or 0.0):
            candidate = other
    return candidate


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


def _turned(
    before: AeroDatabase, candidate: AeroDatabase, axis: str, turned: Expression
) -> AeroDatabase | None:
    """The candidate with the slopes on an axis turned; None where it has none there."""
    first = len(before.increments)
    changed = [
        replace(
            each,
            regressors=tuple(turned if one == _SLOPE else one for one in each.regressors),
            note=f"{each.note}; alpha from zero lift, which leaves the smaller constant",
        )
        if number >= first and each.axis == axis and _SLOPE in each.regressors
        else each
        for number, each in enumerate(candidate.increments)
    ]
    if turned == _SLOPE or changed == [*candidate.increments]:
        return None
    return replace(candidate, increments=tuple(changed))


def _constant(
    source: FlightSource, flights: Sequence[str], database: AeroDatabase, axis: str
) -> float | None:
    """Mean over flights of measured - predicted; None where no flight has a usable sample."""
    compared = in_threads(lambda id: source.comparison(id, database), flights)
    means = [
        float(each.residual(axis)[each.usable[axis]].mean())
        for each in compared
        if axis in each.usable and each.usable[axis].any()
    ]
    return float(np.mean(means)) if means else None
