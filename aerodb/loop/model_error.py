"""The error of what a loop added as a model: what its shapes miss, whatever may explain it.

docs/method/tracing.md, section 26.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aerodb.effects import WIND_TO_BODY_AXES, view_of
from aerodb.loop.flights import FlightSource, thinned_comparison
from aerodb.loop.library import Library
from aerodb.loop.rounds import LoopResult
from aerodb.loop.shapes import shape_variables
from aerodb.support import in_threads
from aerodb.tables import AeroDatabase, Increment, Number
from aerodb.tracing import FlightResidual, evidence_of, model_errors


def with_model_error(
    source: FlightSource, flights: Sequence[str], loop: LoopResult, library: Library
) -> AeroDatabase:
    """Return the candidate of a loop; the bands of what it added contain the error of its shapes.

    What functions of one or two variables still predict of the residual beside the candidate, on
    flights left out, is an error that the covariance of the estimates does not know: flights that
    agree on a wrong shape give it narrow bands. Each increment on such an axis gets a constant
    whose value is zero and whose standard error is the rms of what is predicted. Values and
    verdicts stay. What a sensor could explain counts as error too.

    flights : ids of those that identify.
    """
    earlier = {id(increment) for increment in loop.baseline.increments}
    added = [each for each in loop.candidate.increments if id(each) not in earlier]
    axes = sorted({axis for each in added for axis in _body_axes(each)})
    if not axes:
        return loop.candidate
    settings = library.settings

    def residual(flight: str) -> FlightResidual:
        given = thinned_comparison(source, flight, loop.candidate, settings.bandwidth)
        view = view_of(*given, loop.candidate, source.vehicle)
        evidence = evidence_of(*given, loop.candidate, source.vehicle, [], view=view)
        return FlightResidual(evidence, shape_variables(view))

    errors = model_errors(in_threads(residual, flights), axes, settings)
    return replace(
        loop.candidate,
        increments=tuple(
            each
            if id(each) in earlier
            else _with_error(each, max(errors[axis] for axis in _body_axes(each)))
            for each in loop.candidate.increments
        ),
    )


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
