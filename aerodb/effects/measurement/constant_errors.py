"""Sensor biases and delays as consider parameters: uncertainty that the residual cannot show.

A residual bias looks like an aerodynamic coefficient, and a delayed angle like a rate derivative;
regression on the residual cannot detect either. Flight-path reconstruction knows their standard
errors; the columns are those of the sensor hypotheses.
"""

from collections.abc import Callable, Collection, Mapping
from functools import partial
from typing import Final

import numpy as np

from aerodb.effects.flight_view import FlightView
from aerodb.effects.hypothesis import Columns
from aerodb.effects.measurement import sensor_accelerometer, sensor_flow_angles, sensor_qbar
from aerodb.effects.measurement.sensor import added, predicted_change
from aerodb.increments import ConsiderParameter
from aerodb.support import Array
from aerodb.tables import WIND_AXES, body_to_wind


def sensor_consider_parameters(
    view: FlightView, sigma: Mapping[str, float], own: Collection[str] = ()
) -> tuple[ConsiderParameter, ...]:
    """Consider parameters for the sensor errors left in one flight.

    Parameters
    ----------
    sigma : ``<channel>_bias`` and ``<angle>_delay`` -> standard error of what remains of it, SI.
    own : names of errors of this flight alone; all others are common to all flights of the vehicle,
        like that of a calibration.
    """
    parameters = []
    for name, columns in _COLUMNS.items():
        channel = name.rpartition("_")[0]
        if sigma.get(name, 0.0) > 0 and (
            channel in view.channels or f"{channel}_imu" in view.channels
        ):
            parameters.append(
                ConsiderParameter(
                    name, sigma[name], name not in own, with_wind(view, columns(view))
                )
            )
    return tuple(parameters)


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


_COLUMNS: Final[Mapping[str, Callable[[FlightView], Columns]]] = {
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
