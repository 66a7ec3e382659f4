"""Reference geometry; dimensionless rates, moment transfer, and rotation between wind and body
axes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from aerodb.errors import InputError
from aerodb.nomenclature import AXES
from aerodb.support import Array

Point = tuple[float, float, float]

#: Airspeed [m/s] below which the angles of the flow and dimensionless rates fade to zero, so that a
#: vehicle with loads flies at V = 0: far below any speed that is measured or perturbed.
STILL_AIR: Final = 1e-6

#: Dimensionless rate -> the rate, and the length of `ReferenceGeometry` that scales it.
HAT_RATES: Final[dict[str, tuple[str, str]]] = {
    "p_hat": ("p", "span"),
    "q_hat": ("q", "chord"),
    "r_hat": ("r", "span"),
    "alphadot_hat": ("alphadot", "chord"),
}

#: Axes of an increment: the body axes, and the wind axes for the forces.
INCREMENT_AXES = (*AXES, "C_lift", "C_drag", "C_side")
#: Coefficients along the wind axes: drag aft, side force right, lift up.
WIND_AXES: Final[tuple[str, ...]] = ("C_drag", "C_side", "C_lift")
#: Wind axis -> the body axes that it acts on at small angles. Evidence from flights on a wind axis
#: counts for these.
BODY_AXES_OF: Final = {"C_drag": ("CX", "CZ"), "C_side": ("CY",), "C_lift": ("CX", "CZ")}


@dataclass(frozen=True)
class ReferenceGeometry:
    """Reference geometry of a database.

    Parameters
    ----------
    area : [m2].
    chord : [m], for Cm.
    span : [m], for Cl and Cn.
    moment_reference : (3,) [m], body axes (x forward, y right, z down) from the vehicle's datum.
    pressure : constant [Pa] that coefficients are over in place of the dynamic pressure, of
        vehicles that hover; None: dynamic pressure.

    Raises InputError unless the lengths and the pressure are positive and the point is finite.
    """

    area: float
    chord: float
    span: float
    moment_reference: Point
    pressure: float | None = None

    def __post_init__(self) -> None:
        for name in ("area", "chord", "span", *(("pressure",) if self.pressure else ())):
            value = float(getattr(self, name))
            if not (np.isfinite(value) and value > 0):
                raise InputError(
                    f"reference {name} is {value:g}", remedy="it must be positive, in SI units"
                )
            object.__setattr__(self, name, value)
        point = tuple(float(x) + 0.0 for x in self.moment_reference)
        if len(point) != 3 or not np.all(np.isfinite(point)):
            raise InputError(
                f"moment reference {self.moment_reference}",
                remedy="three finite numbers, in metres",
            )
        object.__setattr__(self, "moment_reference", point)

    @property
    def speed(self) -> float:
        """Airspeed [m/s] whose dynamic pressure at sea level is the constant pressure; 0 without
        one."""
        return float(np.sqrt(2.0 * (self.pressure or 0.0) / _SEA_LEVEL))


#: Density of the standard atmosphere at sea level [kg/m3].
_SEA_LEVEL: Final = 1.225


def hat_rate(name: str, channels: Mapping[str, Any], reference: ReferenceGeometry) -> Array:
    """Dimensionless rate, such as ``p b/(2V)``.

    Parameters
    ----------
    name : key of `HAT_RATES`.
    channels : the rate [rad/s] and V [m/s], each (n,) or a number.

    Returns
    -------
    (n,) or a scalar array; V = 0 gives inf or NaN. With a constant reference pressure the
    speed is constant too (`ReferenceGeometry.speed`), for else damping would grow without limit.

    References
    ----------
    Klein & Morelli, Aircraft System Identification, 2006, eq. 3.2.
    """
    rate, length = HAT_RATES[name]
    if reference.pressure is not None:
        half = getattr(reference, length) / (2.0 * reference.speed)
        return np.asarray(channels[rate] * half, dtype=np.float64)
    with np.errstate(all="ignore"):
        return np.asarray(
            channels[rate] * (getattr(reference, length) / 2.0) / channels["V"], dtype=np.float64
        )


def transfer_moments(
    coefficients: Mapping[str, Array],
    from_point: ArrayLike,
    to_point: ArrayLike,
    reference: ReferenceGeometry,
) -> dict[str, Array]:
    """Transfer moment coefficients to another point: ``M_to = M_from + (r_from - r_to) x F``.

    Parameters
    ----------
    coefficients : CX CY CZ Cl Cm Cn, each (n,), moments about `from_point`.
    from_point, to_point : (3,), or (n, 3) for a moving point such as the CG, [m], body axes.
    reference : its chord and span make the moments dimensionless.

    Returns
    -------
    The six coefficients, each (n,), moments about `to_point`; forces unchanged.
    """
    arm = np.asarray(from_point, dtype=np.float64) - np.asarray(to_point, dtype=np.float64)
    x, y, z = arm[..., 0], arm[..., 1], arm[..., 2]
    fx, fy, fz = (coefficients[axis] for axis in ("CX", "CY", "CZ"))
    moved = {
        "Cl": coefficients["Cl"] + (y * fz - z * fy) / reference.span,
        "Cm": coefficients["Cm"] + (z * fx - x * fz) / reference.chord,
        "Cn": coefficients["Cn"] + (x * fy - y * fx) / reference.span,
    }
    return {**coefficients, **moved}


def wind_to_body(
    drag: Any, side: Any, lift: Any, alpha: Any, beta: Any
) -> tuple[Array, Array, Array]:
    """Rotate force coefficients from wind to body axes.

    Parameters
    ----------
    drag, side, lift : C_drag, C_side, C_lift, each (n,) or a number.
    alpha, beta : [rad], each (n,) or a number.

    Returns
    -------
    CX, CY, CZ.

    References
    ----------
    Stevens & Lewis, Aircraft Control and Simulation: transposed body-to-wind matrix, applied to
    (-drag, side, -lift).
    """
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    # Force opposite to the projection of the velocity on the plane of symmetry.
    along = drag * cb + side * sb
    return lift * sa - along * ca, side * cb - drag * sb, -along * sa - lift * ca


def body_to_wind(cx: Any, cy: Any, cz: Any, alpha: Any, beta: Any) -> tuple[Array, Array, Array]:
    """Rotate force coefficients from body to wind axes: the inverse of `wind_to_body`.

    Parameters
    ----------
    cx, cy, cz : each (n,) or a number.
    alpha, beta : [rad], each (n,) or a number.

    Returns
    -------
    C_drag, C_side, C_lift.

    >>> import numpy as np
    >>> body = wind_to_body(0.1, 0.2, 0.7, 0.3, -0.2)
    >>> np.allclose(body_to_wind(*body, 0.3, -0.2), (0.1, 0.2, 0.7))
    True
    """
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    with np.errstate(invalid="ignore"):  # what is infinite stays not finite
        along = -cx * ca - cz * sa
        return along * cb - cy * sb, along * sb + cy * cb, cx * sa - cz * ca
