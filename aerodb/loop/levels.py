"""Constants that flights share and nothing explains, with the errors that would explain them.

A constant of an axis is in every flight's intercept: tracing cannot tell a wrong zero term from a
trim tab, a surface's zero, the centre of gravity or a biased accelerometer. So it is said, with
these. Where the constants differ from flight to flight as a flight condition does, this is said
instead: an effect that hardly changes within a flight is in nothing else.
docs/method/tracing.md, section 14.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from scipy.special import chdtrc, fdtrc

from aerodb.effects import FlightView, Hypothesis
from aerodb.increments import NoiseFloor
from aerodb.loop.between_flights import conditions_of
from aerodb.loop.flight_source import FlightSource
from aerodb.loop.frozen_library import Library
from aerodb.nomenclature import AXES
from aerodb.signals import rms
from aerodb.support import DIFFERENCE, HINT, SUBSTANTIAL, TWO_SIDED, Array
from aerodb.tables import AeroDatabase
from aerodb.tracing import CrossFlightTests, agreement, cross_flight_tests, may_be_off_by

#: A constant of this many noise floors is one that the right database would hardly leave.
_FLOORS: Final = 3.0
#: Part of an axis' mean square error from which its constant is worth a sentence.
_SHARE: Final = SUBSTANTIAL
#: Part of the mean square of what an error leaves that is its constant, where it looks like one.
_CONSTANT: Final = 0.7
#: At most, rivals that are said.
_SAID: Final = 3
#: Flights from which levels may follow a condition: two lie on every line.
_FLIGHTS: Final = 3
#: Agreement (chi-square of one error) from which what varies within flights shows the error too:
#: 95 %.
_SHOWN: Final = TWO_SIDED**2


@dataclass(frozen=True)
class LevelRival:
    """An error of a sensor or of the vehicle file that would leave the level: id of its hypothesis,
    and the value that it would need, in `unit` (SI). varies : whether what varies within the
    flights shows the error as well."""

    hypothesis: str
    value: float
    unit: str
    varies: bool


@dataclass(frozen=True)
class LevelCondition:
    """A condition of the flights that their levels follow on a straight line.

    condition : channel whose mean differs between the flights, SI. slope : of the level per unit of
    it, with one standard error. levels : (mean condition, level) of each flight, in order of the
    condition. effects : ids of hypotheses that change the axis by it.
    """

    condition: str
    slope: float
    standard_error: float
    levels: tuple[tuple[float, float], ...]
    effects: tuple[str, ...]


@dataclass(frozen=True)
class UnexplainedLevel:
    """The constant of an axis that the candidate leaves.

    constant : mean over flights of measured - predicted. spread : its standard deviation between
    flights, None with one. share : part of the axis' mean square error that it is, or that the
    flights' constants are where they follow a condition. floor : rms that the right database would
    leave. rivals : believable ones, the least unlikely first. conditions : what the constants
    follow, the best first; empty where they are alike, or follow none.
    """

    axis: str
    constant: float
    spread: float | None
    share: float
    floor: float
    rivals: tuple[LevelRival, ...]
    conditions: tuple[LevelCondition, ...] = ()


def unexplained_levels(
    source: FlightSource, flights: Sequence[str], candidate: AeroDatabase, library: Library
) -> tuple[UnexplainedLevel, ...]:
    """Return the large constants that these flights (ids) share beside the candidate.

    Dimensionless. Raises InputError where a flight lacks what is needed.
    """
    compared = [source.comparison(id, candidate) for id in flights]
    found: list[UnexplainedLevel] = []
    # sought where a level is large: they take long
    floors: dict[str, Mapping[str, NoiseFloor]] = {}
    for axis in AXES:
        shown = {
            id: each.residual(axis)[each.usable[axis]]
            for id, each in zip(flights, compared, strict=True)
            if axis in each.usable and each.usable[axis].any()
        }
        if not shown:
            continue
        residuals = list(shown.values())
        means = np.array([each.mean() for each in residuals])
        level, error = float(means.mean()), rms(np.concatenate(residuals))
        if rms(means) ** 2 <= _SHARE * error**2:
            continue
        floors = floors or source.noise_floors(flights, candidate)
        floor = rms(np.array([each[axis].total for each in floors.values() if axis in each]))
        if rms(means) <= _FLOORS * floor:
            continue
        spread = float(means.std(ddof=1)) if len(means) > 1 else None
        views = [source.view(id, candidate, library.settings.bandwidth) for id in flights]
        sigma = np.array([floors[flight][axis].total for flight in shown])
        seen = [view for view in views if view.flight in shown]
        conditions = _conditions(axis, means, sigma, seen, library.hypotheses)
        told = rms(means) if conditions else abs(level)
        if told**2 <= _SHARE * error**2 or told <= _FLOORS * floor:
            continue
        normal_equations = source.normal_equations(flights, candidate, library)
        tests = cross_flight_tests(normal_equations, library.hypotheses, library.settings)
        rivals = () if conditions else _rivals(axis, level, views, tests)
        share = told**2 / error**2
        found.append(UnexplainedLevel(axis, level, spread, share, floor, rivals, conditions))
    return tuple(found)


def _conditions(
    axis: str,
    levels: Array,
    sigma: Array,
    views: Sequence[FlightView],
    hypotheses: Sequence[Hypothesis],
) -> tuple[LevelCondition, ...]:
    """What the levels (g,) of an axis in these flights follow, known to sigma (g,): conditions
    beside which they are alike, while without they are not; or beside which little of their spread
    is left.

    Weighted least squares. The first are tests of chi-square with known variances, the second an F
    test (Bevington & Robinson, Data Reduction and Error Analysis, 3rd ed., chapters 6 and 11).
    """
    weight, dof = sigma**-2, len(levels) - 2
    apart = levels - weight @ levels / weight.sum()
    spread = float(weight @ apart**2)
    if len(levels) < _FLIGHTS or chdtrc(dof + 1, spread) > DIFFERENCE:
        return ()
    found = []
    for name, means in conditions_of(views).items():
        if len(means) < len(views):
            continue
        at = np.array([means[view.flight] for view in views])
        off = at - weight @ at / weight.sum()
        slope = float(weight @ (off * apart) / (weight @ off**2))
        left = float(weight @ (apart - slope * off) ** 2)
        differs = chdtrc(dof, left) < HINT
        if differs and fdtrc(1, dof, dof * (spread - left) / left) > DIFFERENCE:
            continue
        pairs = tuple((float(x), float(y)) for x, y in sorted(zip(at, levels, strict=True)))
        error = float((max(1.0, left / dof) / (weight @ off**2)) ** 0.5)
        effects = _driven_by(name, axis, views[0], hypotheses)
        found.append((left, LevelCondition(name, slope, error, pairs, effects)))
    return tuple(condition for _, condition in sorted(found, key=lambda pair: pair[0]))


def _driven_by(
    condition: str, axis: str, view: FlightView, hypotheses: Sequence[Hypothesis]
) -> tuple[str, ...]:
    """Ids of the aerodynamic hypotheses that change an axis, above all others, by a condition,
    alone or with the angle of attack."""

    def acts_most_on(hypothesis: Hypothesis) -> str:
        sizes = {on: rms(column) for on, column in hypothesis.columns(view).items()}
        return max(sizes, key=sizes.__getitem__)

    return tuple(
        each.id
        for each in hypotheses
        if each.kind == "aerodynamic"
        and condition in each.drivers
        and {*each.drivers} <= {condition, "alpha"}
        and axis in each.axes
        and acts_most_on(each) == axis
    )


def _rivals(
    axis: str, level: float, views: Sequence[FlightView], tests: CrossFlightTests
) -> tuple[LevelRival, ...]:
    """Errors of believable size that would leave this level on an axis, and little else there, and
    which what varies within the flights does not exclude.

    The likeliest first: what varies counts against how well the error is known.
    """
    test, rivals = tests.tested((), (), 1), []
    for index in tests.campaign.sensors:
        each = tests.campaign.hypotheses[index]
        columns = [each.columns(view).get(axis) for view in views]
        seen = np.concatenate([np.zeros(0), *(column for column in columns if column is not None)])
        slope = float(seen.mean()) if len(seen) else 0.0
        if slope == 0.0 or slope**2 < _CONSTANT * float(np.mean(seen**2)):
            continue
        value = level / slope
        if may_be_off_by(tests, test, index, value):
            shown = agreement(test, index, value)
            unlikely = (value / (each.prior_sigma or np.inf)) ** 2 - shown
            rivals.append((unlikely, LevelRival(each.id, value, each.unit, shown > _SHOWN)))
    return tuple(rival for _, rival in sorted(rivals, key=lambda pair: pair[0])[:_SAID])
