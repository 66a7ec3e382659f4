"""Gyro bias and scale-factor error: a constant or proportional error of one body rate.

The rate error acts through the rate derivatives of the prediction, the measured moment ``I wdot + w
x (I w)``, the transfer of specific force from the accelerometer to the CG, and the transfer of air
data from the probe to the CG. Accelerations in the tangent are those of the model. Believable size:
1e-3 rad/s bias, a few parts per thousand of scale. Source: 003, eqs. 1-4.
"""

from functools import partial

import numpy as np

from aerodb.effects.flight_view import FlightView
from aerodb.effects.hypothesis import Columns, Hypothesis
from aerodb.effects.measurement.sensor import added, bias_prior, predicted_change, sensor
from aerodb.effects.measurement.sensor_flow_angles import SLOWEST, flow_changes
from aerodb.effects.template import LibraryContext, Template
from aerodb.physics import inertial_moment, specific_force_at_cg
from aerodb.support import Array

SOURCE = "003, eqs. 1-4"
WORDS = {"p": "roll", "q": "pitch", "r": "yaw"}


def bias(view: FlightView, rate: str) -> Columns:
    """Columns of gyro_bias, s/rad. Each column is (n,)."""
    change = np.zeros_like(view.rates)
    change[:, "pqr".index(rate)] = 1.0
    return wrong_rates(view, change, np.zeros_like(change))


def scale(view: FlightView, rate: str) -> Columns:
    """Columns of gyro_scale. Each column is (n,), dimensionless."""
    only = np.eye(3)["pqr".index(rate)]
    return wrong_rates(view, view.rates * only, view.angular_acceleration * only)


def wrong_rates(view: FlightView, change: Array, acceleration_change: Array) -> dict[str, Array]:
    """Columns of rates that read `change` (n, 3) and angular accelerations that read
    `acceleration_change` too much.

    Force and moment are quadratic in the rates: half the difference between more and less is the
    derivative, exactly.
    """
    inertia = {name: view[name] for name in ("Ixx", "Iyy", "Izz", "Ixz")}
    rates, acceleration = view.rates, view.angular_acceleration
    force, moment = np.zeros_like(rates), np.zeros_like(rates)
    for sign in (0.5, -0.5):
        turn, speeding = rates + 2 * sign * change, acceleration + 2 * sign * acceleration_change
        force += (
            sign
            * view["mass"][:, None]
            * specific_force_at_cg(np.zeros_like(rates), turn, speeding, view.imu_arm)
        )
        moment += sign * inertial_moment(turn, speeding, inertia)
    changes = dict(zip("pqr", change.T, strict=True))
    if view.air_data_arm.any():
        air = -np.cross(change, view.air_data_arm).T
        changes |= flow_changes(air, np.maximum(view["V"], SLOWEST), view["alpha"], view["beta"])
    return added(view.as_coefficients(force, moment), predicted_change(view, **changes))


def _template(kind: str) -> Template:
    effect, formula = (
        f"gyro_{kind}",
        "d(I wdot + w x I w, m a at CG)/drate - dC/drate - dC/dalpha*dalpha/drate",
    )
    tangent, unit, size, natural = (
        (bias, "rad/s", 0.03, 0.001) if kind == "bias" else (scale, "1", 0.2, 0.005)
    )
    how = "by a constant" if kind == "bias" else "in proportion"

    def hypotheses(context: LibraryContext) -> list[Hypothesis]:
        return [
            sensor(
                context,
                effect,
                f"{rate}_{kind}",
                partial(tangent, rate=rate),
                unit=unit,
                plausible=(-size, size),
                declared=bias_prior(context, rate) if kind == "bias" else 0.0,
                natural=natural,
                because=f"the {words} rate reads too high or too low {how}",
                formula=formula,
                needs=("p", "q", "r", "qbar"),
                source=SOURCE,
                subject=rate,
            )
            for rate, words in WORDS.items()
        ]

    return Template(effect, "sensor", formula, SOURCE, hypotheses)


TEMPLATES = (_template("bias"), _template("scale"))
