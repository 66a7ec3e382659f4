"""The error of what a loop added as a model: what its shapes miss, whatever may explain it.

docs/method/tracing.md, section 26.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aerodb.effects import WIND_TO_BODY_AXES
from aerodb.loop.flight_source import FlightSource, on_each
from aerodb.loop.frozen_library import Library
from aerodb.loop.rounds import LoopResult
from aerodb.loop.shapes import shape_variables
from aerodb.tables import AeroDatabase, Increment, Number
from aerodb.tracing import FEWEST_SHAPED, Finding, FlightResidual, evidence_of, model_errors


def with_model_error(
    source: FlightSource, flights: Sequence[str], loop: LoopResult, library: Library
) -> AeroDatabase:
    """Return the candidate of a loop; the bands of what it added contain the error of its shapes.

    Two errors are not in the covariance of the estimates, as flights that agree on a wrong shape
    give it narrow bands. Where the estimates of single flights scatter by more than their standard
    errors, the effect of a flight to come differs from the mean: the variance between flights is
    added to that of the estimate (DerSimonian & Laird, Control. Clin. Trials 7, 1986). What
    functions of one or two variables still predict of the residual of the candidate, on flights
    left out, becomes the standard error of a constant whose value is zero. Values and verdicts
    stay. What a sensor could explain counts as error too.

    flights : ids of those that identify.
    """
    earlier = {id(increment) for increment in loop.baseline.increments}
    added = [each for each in loop.candidate.increments if id(each) not in earlier]
    axes = sorted({axis for each in added for axis in _body_axes(each)})
    if not axes:
        return loop.candidate
    settings = library.settings

    def residual(flight: str) -> FlightResidual:
        view = source.view(flight, loop.candidate, settings.bandwidth)
        return FlightResidual(evidence_of(view, []), shape_variables(view))

    errors = model_errors(on_each(source, flights, residual), axes, settings)
    known = {hypothesis.id: hypothesis for hypothesis in library.hypotheses}
    between = {
        (axis, regressor): between_flights(finding)
        for finding in loop.added
        if finding.hypothesis in known
        for axis, regressor in known[finding.hypothesis].increment
    }

    def widened(increment: Increment) -> Increment:
        variances = [between.get((increment.axis, each), 0.0) for each in increment.regressors]
        # a term that was fitted once more stands twice: it differs between flights once
        once = [
            0.0 if regressor in increment.regressors[:place] else variances[place]
            for place, regressor in enumerate(increment.regressors)
        ]
        wider = replace(increment, covariance=increment.covariance + np.diag(once))
        return _with_error(wider, max(errors[axis] for axis in _body_axes(increment)))

    return replace(
        loop.candidate,
        increments=tuple(
            each if id(each) in earlier else widened(each) for each in loop.candidate.increments
        ),
    )


def between_flights(finding: Finding) -> float:
    """Return the variance of an effect between flights: that of the estimates of single flights
    less that of their errors, in squared units of the parameter. Estimator: DerSimonian & Laird
    (1986)."""
    values = np.array([vote.value for vote in finding.votes])
    if len(values) < FEWEST_SHAPED:
        return 0.0
    errors = np.array([vote.se for vote in finding.votes])
    weight = errors**-2.0
    mean = float(weight @ values) / float(weight.sum())
    excess = float(weight @ (values - mean) ** 2) - (len(values) - 1.0)
    scale = float(weight.sum()) - float(weight @ weight) / float(weight.sum())
    return max(0.0, excess / scale)


def _body_axes(increment: Increment) -> tuple[str, ...]:
    return tuple(WIND_TO_BODY_AXES.get(increment.axis, (increment.axis,)))


def _with_error(increment: Increment, error: float) -> Increment:
    """The increment with a constant of value zero and this standard error [coefficient]."""
    if error == 0.0:
        return increment
    count = len(increment.estimates)
    covariance = np.zeros((count + 1, count + 1))
    covariance[:count, :count] = increment.covariance
    covariance[count, count] = error**2
    return replace(
        increment,
        regressors=(*increment.regressors, Number(1.0)),
        estimates=np.r_[increment.estimates, 0.0],
        covariance=covariance,
        folded=(*increment.folded, ""),
    )
