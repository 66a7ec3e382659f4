"""Errors of sensors that explain what declared increments would change.

A declared increment takes whatever its columns can: a surface whose zero is off, a vane with a
wrong scale. The closed loop asks every sensor whether it explains the residual better than the
aerodynamics does; so does an update before its candidate may be released.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.effects import Hypothesis
from aerodb.loop.accept import Accept
from aerodb.loop.flight_source import FlightSource
from aerodb.loop.frozen_library import Library
from aerodb.loop.rounds import run_loop
from aerodb.tables import AeroDatabase
from aerodb.tracing import Finding

#: Least effect of a sensor's error on an axis, as a part of what the increments change there, with
#: which it is a rival of theirs.
_LEAST: Final = 0.1


@dataclass(frozen=True)
class SensorRival:
    """The error of a sensor that the closed loop finds where increments are declared.

    Parameters
    ----------
    hypothesis, parameter, unit, value, ci95, because : of the finding, SI.
    shares : axis -> rms effect of the error on the prediction, as a part of the rms that the
        increments change there.
    """

    hypothesis: str
    parameter: str
    unit: str
    value: float
    ci95: tuple[float, float]
    because: str
    shares: dict[str, float]


def sensor_rivals(
    source: FlightSource,
    flights: Sequence[str],
    baseline: AeroDatabase,
    candidate: AeroDatabase,
    library: Library,
) -> tuple[SensorRival, ...]:
    """Return the errors of sensors that the loop finds on these flights (ids) compared with
    `baseline`, in SI units, as far as they act on what `candidate` changes. Raises InputError where
    a flight lacks what is needed."""
    loop = run_loop(source, flights, baseline, library, Accept())
    known = {hypothesis.id: hypothesis for hypothesis in library.hypotheses}
    rivals = []
    for finding in loop.findings:
        if finding.verdict == "sensor":
            shares = _shares(
                source, flights, (baseline, candidate), known[finding.hypothesis], finding, library
            )
            if shares:
                rivals.append(_rival(finding, shares))
    return tuple(rivals)


def _shares(
    source: FlightSource,
    flights: Sequence[str],
    databases: tuple[AeroDatabase, AeroDatabase],
    hypothesis: Hypothesis,
    finding: Finding,
    library: Library,
) -> dict[str, float]:
    """Axis -> share (`SensorRival.shares`), where it is at least `_LEAST`."""
    powers: dict[str, tuple[float, float]] = {}
    for id in flights:
        before, after = (
            source.view(id, database, library.settings.bandwidth) for database in databases
        )
        for axis, column in hypothesis.columns(before).items():
            good = before.comparison.usable[axis] & after.comparison.usable[axis]
            changed = (
                after.comparison.predicted[axis][good] - before.comparison.predicted[axis][good]
            )
            own, whole = powers.get(axis, (0.0, 0.0))
            powers[axis] = (
                own + float(np.sum((finding.value * column[good]) ** 2)),
                whole + float(np.sum(changed**2)),
            )
    shares = {axis: float(np.sqrt(own / whole)) for axis, (own, whole) in powers.items() if whole}
    return {axis: share for axis, share in shares.items() if share >= _LEAST}


def _rival(finding: Finding, shares: dict[str, float]) -> SensorRival:
    return SensorRival(
        finding.hypothesis,
        finding.parameter,
        finding.unit,
        finding.value,
        finding.ci95,
        finding.because,
        shares,
    )
