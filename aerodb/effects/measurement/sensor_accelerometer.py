"""Accelerometer bias: a constant error of specific force along one body axis.

Tangent: ``dC_x = m/(qbar S)`` on the force along the axis, and on the moments through the arm from
the CG to the moment reference; the error grows as dynamic pressure falls. Believable size: .01 to
.2 m/s2. Source: 003, eqs. 1-3; docs/method/tracing.md, section 4.
"""

from functools import partial

import numpy as np

from aerodb.effects.flight_view import FlightView
from aerodb.effects.hypothesis import Columns, Hypothesis
from aerodb.effects.measurement.sensor import bias_prior, sensor
from aerodb.effects.template import LibraryContext, Template

SOURCE = "003, eqs. 1-3"
WORDS = {"x": "longitudinal", "y": "lateral", "z": "normal"}


def bias(view: FlightView, axis: str) -> Columns:
    """Columns of accelerometer_bias along body `axis`, s2/m.

    Each column is (n,), in the unit s2/m.
    """
    force = view["mass"][:, None] * np.eye(3)["xyz".index(axis)]
    return view.as_coefficients(force, np.zeros_like(force))


def _hypotheses(context: LibraryContext) -> list[Hypothesis]:
    return [
        sensor(
            context,
            "accelerometer_bias",
            f"a{axis}_bias",
            partial(bias, axis=axis),
            unit="m/s^2",
            plausible=(-1.0, 1.0),
            declared=bias_prior(context, f"a{axis}_imu", f"a{axis}"),
            natural=0.05,
            because=f"the {words} accelerometer reads too high or too low by a constant",
            formula=f"m/(qbar*S) along {axis}, and its moment about the moment reference",
            needs=("qbar",),
            source=SOURCE,
            subject=axis,
        )
        for axis, words in WORDS.items()
    ]


TEMPLATE = Template(
    "accelerometer_bias", "sensor", "m/(qbar*S), and its moment", SOURCE, _hypotheses
)
