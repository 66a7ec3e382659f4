"""Columns of constant sensor errors that flight-path reconstruction leaves open.

A residual bias looks like an aerodynamic coefficient, and a delayed angle like a rate derivative;
regression on the residual cannot detect either. The columns are those of the sensor hypotheses.
"""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Final

import numpy as np

from aerodb.effects.flight_view import FlightView
from aerodb.effects.hypothesis import Columns
from aerodb.effects.measurement import sensor_accelerometer, sensor_flow_angles, sensor_qbar
from aerodb.effects.measurement.sensor import added, predicted_change
from aerodb.support import Array
from aerodb.tables import WIND_AXES, body_to_wind


def with_wind(view: FlightView, columns: Columns) -> Columns:
    """Add wind-axis columns to body-axis ones; measured and predicted are rotated by the same
    angles.

    Each column is (n,); alpha and beta are in rad.
    """
    if not view.has(["alpha"]):
        return columns
    cx, cy, cz = (columns.get(axis, np.zeros_like(view["alpha"])) for axis in ("CX", "CY", "CZ"))
    beta = view["beta"] if view.has(["beta"]) else np.zeros_like(view["alpha"])
    return {
        **columns,
        **dict(zip(WIND_AXES, body_to_wind(cx, cy, cz, view["alpha"], beta), strict=True)),
    }


def _airspeed(view: FlightView) -> Columns:
    """Columns of an airspeed bias, s/m, with the dynamic pressure computed from it."""
    speed = view["V"]
    relative: Array = 2.0 / speed.clip(min=sensor_flow_angles.SLOWEST)
    scaled = {axis: values * relative for axis, values in sensor_qbar.scale(view).items()}
    return added(scaled, predicted_change(view, V=1.0))


#: Name of an error -> columns of a flight per unit of it, SI.
ERROR_COLUMNS: Final[Mapping[str, Callable[[FlightView], Columns]]] = {
    "V_bias": _airspeed,
    **{
        f"{angle}_bias": partial(sensor_flow_angles.bias, angle=angle)
        for angle in ("alpha", "beta")
    },
    **{
        f"{angle}_delay": partial(sensor_flow_angles.delay, angle=angle)
        for angle in ("alpha", "beta")
    },
    **{f"a{axis}_bias": partial(sensor_accelerometer.bias, axis=axis) for axis in "xyz"},
}
