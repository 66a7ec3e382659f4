"""Rotation of the air itself, which no gyro shows and the aerodynamic damping feels.

A gust that varies along the aircraft rotates the air about it (MIL-F-8785C, 1980, section 3.7.5):
a vertical gust w, met at the speed V, pitches the air by ``-dw/dx``, and a lateral gust v yaws it
by ``dv/dx``. To the aircraft this is the gust's own rate of change, which flow angles show against
the inertial motion, behind a first-order lag over the span. Damping acts on the rate relative to
the air; and a term with alphadot, which stands for the lag of the downwash, need not answer a gust
as it answers the aircraft's own heaving. Without these columns severe turbulence looks like an
error of the damping or of alphadot, in every flight alike.

The columns belong to no hypothesis: they are nuisance parameters of each flight, about which
nothing is claimed. How much of the rotation an aircraft feels is known roughly only; so each has a
share of its own, whose prior is zero with a standard deviation of the whole effect.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np

from aerodb.conditioning import alpha_rate, beta_rate
from aerodb.effects.flight_view import FlightView
from aerodb.effects.hypothesis import Columns
from aerodb.effects.measurement.sensor import predicted_change
from aerodb.effects.measurement.sensor_flow_angles import SLOWEST
from aerodb.nomenclature import FORCE_AXES
from aerodb.physics import PITCH_LAG, YAW_LAG
from aerodb.signals import first_order_lag, smooth
from aerodb.support import Array

#: Channels from which the inertial rates of the flow angles follow.
_NEEDED: Final = ("V", "alpha", "p", "q", "r", "phi", "theta", "qbar", "mass", "alphadot")


def air_rotation_columns(view: FlightView, measured: Mapping[str, Array]) -> Mapping[str, Columns]:
    """Columns of a flight's nuisance parameters: name -> body axis -> (n,), for a share of one.

    measured : body axis -> (n,) total coefficients over the database's reference geometry; their
    forces give the inertial motion. Empty where the flight lacks a force, a rate or its attitude;
    without a column where the model does not depend on the rate.

    Columns are dimensionless.
    """
    if not view.has(_NEEDED) or not set(FORCE_AXES) <= measured.keys():
        return {}
    alpha, beta = _gust_rates(view, measured)
    span = view.reference.span / (np.pi * max(float(np.median(view["V"])), SLOWEST))
    of_the_air = {
        "q": first_order_lag(alpha, view.step, PITCH_LAG * span),
        "alphadot": alpha,
        "r": -first_order_lag(beta, view.step, YAW_LAG * span),
        "betadot": beta,
    }
    return {
        f"air_rotation:{name}": {
            axis: column
            for axis, column in predicted_change(view, **{name: change}).items()
            if axis in view.usable
        }
        for name, change in of_the_air.items()
        if view.slope(name)
    }


def _gust_rates(view: FlightView, measured: Mapping[str, Array]) -> tuple[Array, Array]:
    """Rates (n,) [rad/s] of alpha and beta that the inertial motion does not explain; zero for an
    angle that was not measured.
    """
    force = np.column_stack([np.nan_to_num(measured[axis]) for axis in FORCE_AXES])
    force = force * (view.pressure * view.reference.area)[:, None] + view.thrust
    at_cg = dict(zip(("ax", "ay", "az"), (force / view["mass"][:, None]).T, strict=True))
    flying = {**view.channels, "V": np.maximum(view["V"], SLOWEST), **at_cg}
    alphadot, betadot = (
        smooth(rate(flying), view.step, view.bandwidth).value for rate in (alpha_rate, beta_rate)
    )
    return view["alphadot"] - alphadot, view.channels.get("betadot", betadot) - betadot
