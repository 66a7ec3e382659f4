"""Fit what the loop adds once more, beside the candidate that holds it: gains, and shapes inside
the envelope.
"""

from collections.abc import Sequence

from aerodb.effects import WIND_TO_BODY_AXES, Hypothesis
from aerodb.loop.flight_source import FlightSource
from aerodb.loop.frozen_library import Library
from aerodb.tables import AeroDatabase, RefinedShape, Refit
from aerodb.tracing import Refined, refine


def refit_terms(
    source: FlightSource,
    candidate: AeroDatabase,
    library: Library,
    accepted: Sequence[Hypothesis],
    flights: Sequence[str],
) -> Refined | None:
    """Return new gains and finer shapes of terms that `candidate` holds already.

    None where left-out flights do not support them. flights : ids of those that have the channels
    of all terms. Values (k,) and covariance (k, k) are in SI units. Raises InputError where a
    flight lacks what is needed.
    """
    views = [source.view(id, candidate, library.settings.bandwidth) for id in flights]
    if not views:
        return None
    sensors = [hypothesis for hypothesis in library.hypotheses if hypothesis.kind == "sensor"]
    return refine(views, accepted, sensors, library.settings)


def refit_of(finer: Refined) -> Refit:
    """Return what an increment notes of its refit; shapes in the order of their ids."""
    axes = {term.id: term.written_on[0] for term in finer.terms}
    shapes = [
        RefinedShape(id, axes[id], tuple(over), finer.fall[id])
        for id, over in sorted(finer.variables.items())
    ]
    return Refit(tuple(shapes))


def axes_of_misfit_shapes(database: AeroDatabase) -> frozenset[str]:
    """Return the body axes on which a term was added whose template's shape was wrong, as
    `Increment.refit` notes."""
    axes = {
        shape.axis
        for increment in database.increments
        if increment.refit
        for shape in increment.refit.shapes
    }
    return frozenset(body for axis in axes for body in WIND_TO_BODY_AXES.get(axis, (axis,)))
