"""Reference geometry, and what follows from it alone: hat rates, moments moved between points, wind
to body axes."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from aerodb.errors import InputError
from aerodb.support import Array

Point = tuple[float, float, float]

#: Rate without dimension -> the rate it is made of and the attribute of `Reference` that scales it.
HAT_RATES: Final[dict[str, tuple[str, str]]] = {
    "p_hat": ("p", "span"),
    "q_hat": ("q", "chord"),
    "r_hat": ("r", "span"),
    "alphadot_hat": ("alphadot", "chord"),
}

#: Coefficients along the wind axes: drag aft, side force right, lift up.
WIND_AXES: Final[tuple[str, ...]] = ("C_drag", "C_side", "C_lift")


@dataclass(frozen=True)
class Reference:
    """Reference area [m2], chord [m] (for Cm) and span [m] (for Cl, Cn); moment reference [m] in
    body axes (x forward, y right, z down) from the vehicle's datum. Raises InputError unless the
    first three are positive."""

    area: float
    chord: float
    span: float
    moment_reference: Point

    def __post_init__(self) -> None:
        for name in ("area", "chord", "span"):
            value = float(getattr(self, name))
            if not (np.isfinite(value) and value > 0):
                raise InputError(
                    f"reference {name} is {value:g}", remedy="it must be positive, in metres"
                )
            object.__setattr__(self, name, value)
        point = tuple(float(x) + 0.0 for x in self.moment_reference)
        if len(point) != 3 or not np.all(np.isfinite(point)):
            raise InputError(
                f"moment reference {self.moment_reference}",
                remedy="three finite numbers, in metres",
            )
        object.__setattr__(self, "moment_reference", point)


def hat_rate(name: str, channels: Mapping[str, Any], reference: Reference) -> Array:
    """A rate without dimension, ``p b/(2V)`` and alike, from its rate [rad/s] and V [m/s]; name as
    in `HAT_RATES`.

    Source: Klein & Morelli (2006), eq. 3.2. Division by V = 0 gives inf or NaN.
    """
    rate, length = HAT_RATES[name]
    with np.errstate(all="ignore"):
        return np.asarray(
            channels[rate] * (getattr(reference, length) / 2.0) / channels["V"], dtype=np.float64
        )


def transfer_moments(
    coefficients: Mapping[str, Array],
    from_point: ArrayLike,
    to_point: ArrayLike,
    reference: Reference,
) -> dict[str, Array]:
    """The same forces with moments about another point: ``M_to = M_from + (r_from - r_to) x F``.

    coefficients : the six axes CX .. Cn, each (n,), moments about `from_point`. from_point,
    to_point : (3,) or (n, 3) for a point that moves (a CG), in m, body axes. Lengths of `reference`
    turn moments into coefficients.
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
    """CX, CY, CZ of drag, side force and lift coefficients at `alpha`, `beta` [rad]; all (n,) or
    numbers.

    Source: Stevens & Lewis, Aircraft Control and Simulation, transposed body-to-wind matrix with
    (-drag, side, -lift).
    """
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    along = (
        drag * cb + side * sb
    )  # force against the projection of the velocity on the plane of symmetry
    return lift * sa - along * ca, side * cb - drag * sb, -along * sa - lift * ca


def body_to_wind(cx: Any, cy: Any, cz: Any, alpha: Any, beta: Any) -> tuple[Array, Array, Array]:
    """Drag, side force and lift coefficients of CX, CY, CZ at `alpha`, `beta` [rad]: the inverse of
    `wind_to_body`.

    >>> import numpy as np
    >>> np.allclose(body_to_wind(*wind_to_body(0.1, 0.2, 0.7, 0.3, -0.2), 0.3, -0.2), (0.1, 0.2, 0.7))
    True
    """
    ca, sa, cb, sb = np.cos(alpha), np.sin(alpha), np.cos(beta), np.sin(beta)
    along = -cx * ca - cz * sa
    return along * cb - cy * sb, along * sb + cy * cb, cx * sa - cz * ca
