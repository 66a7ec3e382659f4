"""Constants that flights share and nothing explains, with the errors that would explain them.

A constant of an axis is in every flight's intercept: tracing cannot tell a wrong zero term from a
trim tab, a surface's zero, the centre of gravity or a biased accelerometer. So it is said, with
these. docs/method/tracing.md, section 14.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.effects import FlightView
from aerodb.increments import NoiseFloor
from aerodb.loop.flight_source import FlightSource
from aerodb.loop.frozen_library import Library
from aerodb.loop.noise_floor import noise_floors
from aerodb.nomenclature import AXES
from aerodb.signals import rms
from aerodb.support import in_threads
from aerodb.tables import AeroDatabase
from aerodb.tracing import CrossFlightTests, agreement, cross_flight_tests, may_be_off_by

#: A constant of this many noise floors is one that the right database would hardly leave.
_FLOORS: Final = 3.0
#: Part of an axis' mean square error from which its constant is worth a sentence.
_SHARE: Final = 0.3
#: Part of the mean square of what an error leaves that is its constant, where it looks like one.
_CONSTANT: Final = 0.7
#: At most, rivals that are said.
_SAID: Final = 3
#: Agreement (chi-square of one error) from which what varies within flights shows the error too:
#: 95 %.
_SHOWN: Final = 3.84


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
class UnexplainedLevel:
    """The constant of an axis that the candidate leaves.

    constant : mean over flights of measured - predicted. spread : its standard deviation between
    flights, None with one. share : part of the axis' mean square error that it is. floor : rms that
    the right database would leave. rivals : believable ones, the least unlikely first.
    """

    axis: str
    constant: float
    spread: float | None
    share: float
    floor: float
    rivals: tuple[LevelRival, ...]


def unexplained_levels(
    source: FlightSource, flights: Sequence[str], candidate: AeroDatabase, library: Library
) -> tuple[UnexplainedLevel, ...]:
    """Return the large constants that these flights (ids) share beside the candidate.

    Dimensionless. Raises InputError where a flight lacks what is needed.
    """
    compared = in_threads(lambda id: source.comparison(id, candidate), flights)
    found: list[UnexplainedLevel] = []
    floors: dict[str, dict[str, NoiseFloor]] = {}  # sought where a level is large: they take long
    for axis in AXES:
        residuals = [
            each.residual(axis)[each.usable[axis]]
            for each in compared
            if axis in each.usable and each.usable[axis].any()
        ]
        if not residuals:
            continue
        means = np.array([each.mean() for each in residuals])
        level, error = float(means.mean()), rms(np.concatenate(residuals))
        if level**2 <= _SHARE * error**2:
            continue
        floors = floors or noise_floors(source, flights, candidate)
        floor = rms(np.array([each[axis].total for each in floors.values() if axis in each]))
        if abs(level) <= _FLOORS * floor:
            continue
        spread = float(means.std(ddof=1)) if len(means) > 1 else None
        views = in_threads(
            lambda id: source.view(id, candidate, library.settings.bandwidth), flights
        )
        normal_equations = in_threads(
            lambda id: source.normal_equations(id, candidate, library), flights
        )
        tests = cross_flight_tests(normal_equations, library.hypotheses, library.settings)
        rivals = _rivals(axis, level, views, tests)
        found.append(UnexplainedLevel(axis, level, spread, level**2 / error**2, floor, rivals))
    return tuple(found)


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
