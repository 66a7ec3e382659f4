"""Lift slopes of tail planes and the power of their controls, from derivatives of a linear model.

The rates of pitch and yaw move the air at the tail, so that damping tells its lift slope; the force
of its control then tells how much of that slope a deflection has (its effectiveness).

References
----------
"Aerodynamic Model Update Using Parameter Identification Supporting a Cessna Grand Caravan
Engineering Simulation", eqs. 6 to 24; Roskam, Airplane Flight Dynamics and Automatic Flight
Controls, part I, 1982. Equation 8 counts the whole damping of the linear model as that of the pitch
rate. In such a model it contains the damping by the rate of the angle of attack, which the lag of
the downwash brings: its gradient (`TailPlane.downwash`) takes that out.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np

from aerodb.errors import InputError
from aerodb.identification.conversion import Derivatives, LinearisedFlight


@dataclass(frozen=True)
class TailPlane:
    """A horizontal or vertical tail.

    Parameters
    ----------
    name : begins the names of what is found.
    plane : ``horizontal`` or ``vertical``. area : m2. arm : from the CG back to its aerodynamic
        centre [m]. pressure_ratio : dynamic pressure there over that of the flight.
    downwash : gradient of the downwash (or sidewash) by the flow angle, of a linear model whose
        damping contains that by the rate of the angle. 0: as printed.
    control : its surface, such as ``delta_elevator``; empty for none.
    """

    name: str
    plane: Literal["horizontal", "vertical"]
    area: float
    arm: float
    pressure_ratio: float = 1.0
    downwash: float = 0.0
    control: str = ""


def tail_parameters(
    coefficients: Derivatives, flight: LinearisedFlight, tail: TailPlane
) -> Derivatives:
    """Return ``<name>_lift_slope`` [1/rad, on the tail's area] and ``<name>_effectiveness`` of its
    control, with covariance.

    coefficients : with Cm_q_hat (horizontal) or Cn_r_hat (vertical), and CZ or C_lift, or CY, by
    the control.

    Raises InputError for a derivative that is missing, and a damping without a tail's sign.
    """
    horizontal = tail.plane == "horizontal"
    share = tail.pressure_ratio * tail.area / flight.area
    if horizontal:
        damping, length = "Cm_q_hat", flight.chord
        lift = f"C_lift_{tail.control}" in coefficients.names
        force, sign = ("C_lift", 1.0) if lift else ("CZ", -1.0)
    else:
        damping, length, force, sign = "Cn_r_hat", flight.span, "CY", 1.0
    wanted = [damping, *([f"{force}_{tail.control}"] if tail.control else [])]
    missing = [name for name in wanted if name not in coefficients.names]
    if missing:
        raise InputError(
            f"the derivatives give no {missing[0]}",
            f"tail {tail.name}",
            "give the dimensional derivatives that it follows from, such as Mq, Nr with Lr, or Z by"
            " the elevator",
        )
    scale = -1.0 / (2.0 * share * (tail.arm / length) ** 2 * (1.0 + tail.downwash))
    slope = scale * coefficients[damping]
    if not slope > 0.0:
        raise InputError(
            f"{damping} is {coefficients[damping]:.4g}: a tail gives a negative one",
            f"tail {tail.name}",
            "check the sign of the derivative, and give Np and Lr beside Lp and Nr",
        )
    values, names = [slope], [f"{tail.name}_lift_slope"]
    rows = [{damping: scale}]
    if tail.control:
        power = sign / share * coefficients[wanted[1]]
        names.append(f"{tail.name}_effectiveness")
        values.append(power / slope)
        rows.append({wanted[1]: sign / share / slope, damping: -power / slope**2 * scale})
    matrix = np.array([[row.get(name, 0.0) for name in coefficients.names] for row in rows])
    return Derivatives(tuple(names), np.array(values), matrix @ coefficients.covariance @ matrix.T)
