"""Flow angles from the raw pressure differences of a five-hole probe.

The calibration is ``dp / q = K (x + offset + square x^2 + across y + cross y^2 + bend
dead_zone(x))`` with x the flow angle of that pair of holes, y the other flow angle, q the dynamic
pressure and ``dead_zone(x)`` the part of x beyond +-`break_angle`. K = `slope` alone is the usual
``x = dp / (K q)``; the Phoenix flight tests found it too coarse, and alpha to depend on the
sideslip ("Data Analysis of Phoenix Reusable Launch Vehicle Demonstrator Flight Test", section III;
see docs/method/tracing.md, "References").
"""

import numpy as np
from pydantic import Field

from aerodb.quantities import Number, Radians
from aerodb.support import Array, Dual, Strict, dead_zone

#: Newton steps from the linear solution.
_STEPS = 20
#: Residual angle at which the solution has converged [rad].
_TOLERANCE = 1e-9


class Curve(Strict):
    """Calibration of one pair of holes.

    slope : K, per rad. offset : rad. square, cross : coefficients of x^2 and y^2, per rad. across :
    of y. bend : relative change of the slope beyond +-`break_angle` [rad]; bend_below : below the
    lower one, where it is another.
    """

    slope: Number = Field(gt=0)
    offset: Radians = 0.0
    square: Number = 0.0
    cross: Number = 0.0
    across: Number = 0.0
    bend: Number = Field(default=0.0, gt=-1)
    bend_below: Number | None = Field(default=None, gt=-1)
    break_angle: Radians = Field(default=0.0, ge=0)


class FiveHole(Strict):
    """Calibrations of both pairs of holes."""

    alpha: Curve
    beta: Curve


def flow_angles(dp_alpha: Array, dp_beta: Array, q: Array, probe: FiveHole) -> tuple[Array, Array]:
    """Return angles of attack and sideslip at the probe from its pressure differences.

    Parameters
    ----------
    dp_alpha, dp_beta : (n,), lower less upper and right less left hole, Pa
    q : (n,), dynamic pressure, Pa
    probe : calibrations of both pairs of holes

    Returns
    -------
    alpha, beta : (n,) each, rad; nan where q is not positive, or where no angle within 90 deg of
        the probe's axis fits both differences
    """
    with np.errstate(invalid="ignore", divide="ignore"):
        wanted = [
            np.where(q > 0, dp / q, np.nan) / c.slope
            for dp, c in ((dp_alpha, probe.alpha), (dp_beta, probe.beta))
        ]
    angles = [part - c.offset for part, c in zip(wanted, (probe.alpha, probe.beta), strict=True)]
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        for _ in range(_STEPS):
            x, y = Dual(angles[0], {"x": 1.0}), Dual(angles[1], {"y": 1.0})
            shown = (pressure_ratio(x, y, probe.alpha), pressure_ratio(y, x, probe.beta))
            off = [got.value - want for got, want in zip(shown, wanted, strict=True)]
            (a, b), (c, d) = ([np.asarray(got.by.get(name, 0.0)) for name in "xy"] for got in shown)
            determinant = a * d - b * c
            angles[0] = angles[0] - (d * off[0] - b * off[1]) / determinant
            angles[1] = angles[1] - (a * off[1] - c * off[0]) / determinant
        converged = (
            (np.abs(off[0]) < _TOLERANCE)
            & (np.abs(off[1]) < _TOLERANCE)
            & (np.hypot(*angles) < np.pi / 2)
        )
    return np.where(converged, angles[0], np.nan), np.where(converged, angles[1], np.nan)


def pressure_ratio(x: Dual, y: Dual, curve: Curve) -> Dual:
    """Return ``dp / (K q)`` of a pair of holes; x its own flow angle, y the other one [rad].

    Values are (n,) or scalar; the ratio [rad] is an angle in the linear case.
    """
    below = curve.bend if curve.bend_below is None else curve.bend_below
    return (
        x
        + curve.offset
        + x * x * curve.square
        + y * curve.across
        + y * y * curve.cross
        + dead_zone(x, curve.break_angle) * np.where(x.value < 0.0, below, curve.bend)
    )
