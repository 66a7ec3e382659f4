"""Dynamic-pressure errors: scale-factor error (pitot coefficient) and offset (zero shift).

Tangents: ``qbar_scale``: ``-C - qbar dC/dqbar``; ``qbar_offset``: ``-C/qbar - dC/dqbar``; the
second term only where the database depends on qbar. C is predicted by the model. Over a constant
reference pressure the first terms are zero. All coefficients
shrink together, which no single aerodynamic effect does. Believable size: 2 % (the limit of 003),
although 003 found 10.19 % on one flight. Source: 003, eq. 5; docs/method/tracing.md, section 4.
"""

from aerodb.effects.flight_view import FlightView
from aerodb.effects.hypothesis import Columns, Hypothesis
from aerodb.effects.measurement.sensor import added, bias_prior, predicted_change, sensor
from aerodb.effects.template import LibraryContext, Template
from aerodb.support import Array

SOURCE = "003, eq. 5"


def scale(view: FlightView) -> Columns:
    """Columns of qbar_scale. Each column is (n,), dimensionless."""
    share = 0.0 if view.reference.pressure is not None else 1.0
    direct: dict[str, Array] = {axis: -share * values for axis, values in view.predicted.items()}
    return added(direct, predicted_change(view, qbar=view["qbar"]))


def offset(view: FlightView) -> Columns:
    """Columns of qbar_offset, 1/Pa. Each column is (n,), in the unit 1/Pa."""
    over = 0.0 if view.reference.pressure is not None else view.inverse_pressure
    direct = {axis: -values * over for axis, values in view.predicted.items()}
    return added(direct, predicted_change(view, qbar=1.0))


def _scale(context: LibraryContext) -> list[Hypothesis]:
    return [
        sensor(
            context,
            "qbar_scale",
            "qbar_scale",
            scale,
            unit="1",
            plausible=(-0.2, 0.2),
            natural=context.vehicle.accuracy.qbar_fraction,
            because="dynamic pressure reads in proportion too high or too low",
            formula="-C - qbar*dC/dqbar",
            needs=("qbar",),
            source=SOURCE,
        )
    ]


def _offset(context: LibraryContext) -> list[Hypothesis]:
    return [
        sensor(
            context,
            "qbar_offset",
            "qbar_offset",
            offset,
            unit="Pa",
            plausible=(-300.0, 300.0),
            declared=bias_prior(context, "qbar"),
            natural=20.0,
            because="dynamic pressure reads too high or too low by a constant",
            formula="-C/qbar - dC/dqbar",
            needs=("qbar",),
            source=SOURCE,
        )
    ]


SCALE = Template("qbar_scale", "sensor", "-C - qbar*dC/dqbar", SOURCE, _scale)
OFFSET = Template("qbar_offset", "sensor", "-C/qbar - dC/dqbar", SOURCE, _offset)
TEMPLATES = (SCALE, OFFSET)
