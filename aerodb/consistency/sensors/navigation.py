"""An independent check of a logged navigation solution: is position the integral of velocity, do
air and ground agree?"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from aerodb.consistency.sensors.prediction import earth_to_body
from aerodb.support import Array


@dataclass(frozen=True)
class VelocityCheck:
    """Position differences against velocity: rms [m/s] by axis, and the largest `jump` (speed that
    a position step implies beyond the velocity, m/s)."""

    rms: Mapping[str, float]
    jump: float


def position_against_velocity(time: Array, position: Array, velocity: Array) -> VelocityCheck:
    """Compares the rate of change of position (central differences; for jumps, over single
    intervals) with velocity.

    time (n,) s, increasing; position (n, 3) m and velocity (n, 3) m/s, north, east, down.
    """
    rms = np.sqrt(np.mean((np.gradient(position, time, axis=0) - velocity) ** 2, axis=0))
    single = np.diff(position, axis=0) / np.diff(time)[:, None] - 0.5 * (
        velocity[1:] + velocity[:-1]
    )
    jump = float(np.linalg.norm(single, axis=1).max())
    return VelocityCheck(dict(zip(("north", "east", "down"), map(float, rms), strict=True)), jump)


@dataclass(frozen=True)
class FlowCheck:
    """Measured flow angle against that of (velocity - wind): mean and standard deviation of the
    difference, rad."""

    mean: float
    deviation: float

    @property
    def rms(self) -> float:
        """Root mean square difference, rad."""
        return float(np.hypot(self.mean, self.deviation))


def flow_against_velocity(attitude: Array, velocity: Array, wind: Array, alpha: Array) -> FlowCheck:
    """Angle of attack of the inertial velocity less the wind, minus the probe's.

    attitude (n, 3) phi theta psi, rad; velocity and wind (n, 3) north, east, down, m/s; alpha (n,)
    rad.
    """
    states = np.zeros((9, len(alpha)))
    states[3:6] = attitude.T
    air = np.einsum("ijn,nj->in", earth_to_body(states), velocity - wind)
    difference = np.arctan2(air[2], air[0]) - alpha
    return FlowCheck(float(np.nanmean(difference)), float(np.nanstd(difference)))
