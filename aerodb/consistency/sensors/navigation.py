"""Check a logged navigation solution against itself: position against velocity, and flow angles
against velocity and wind."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from aerodb.consistency.sensors.prediction import earth_to_body
from aerodb.support import Array


@dataclass(frozen=True)
class VelocityCheck:
    """Rate of change of position minus velocity: rms [m/s] by axis, and the largest `jump` [m/s]
    over one sampling interval."""

    rms: Mapping[str, float]
    jump: float


def position_against_velocity(time: Array, position: Array, velocity: Array) -> VelocityCheck:
    """Compare the rate of change of position with velocity.

    Central differences give the rms, single intervals the largest jump.

    Parameters
    ----------
    time : (n,), increasing [s].
    position : (n, 3), north, east, down [m].
    velocity : (n, 3), north, east, down [m/s].
    """
    rms = np.sqrt(np.mean((np.gradient(position, time, axis=0) - velocity) ** 2, axis=0))
    single = np.diff(position, axis=0) / np.diff(time)[:, None] - 0.5 * (
        velocity[1:] + velocity[:-1]
    )
    jump = float(np.linalg.norm(single, axis=1).max())
    return VelocityCheck(dict(zip(("north", "east", "down"), map(float, rms), strict=True)), jump)


@dataclass(frozen=True)
class FlowCheck:
    """Flow angle of velocity minus wind, less the measured one: mean and standard deviation of the
    difference, rad."""

    mean: float
    deviation: float

    @property
    def rms(self) -> float:
        """Root mean square difference [rad], a scalar."""
        return float(np.hypot(self.mean, self.deviation))


def flow_against_velocity(attitude: Array, velocity: Array, wind: Array, alpha: Array) -> FlowCheck:
    """Compare the angle of attack of velocity minus wind with the probe's.

    Parameters
    ----------
    attitude : (n, 3), phi, theta, psi [rad].
    velocity : (n, 3), over the earth, north, east, down [m/s].
    wind : (n, 3), north, east, down [m/s].
    alpha : (n,), measured angle of attack [rad].
    """
    states = np.zeros((9, len(alpha)))
    states[3:6] = attitude.T
    air = np.einsum("ijn,nj->in", earth_to_body(states), velocity - wind)
    difference = np.arctan2(air[2], air[0]) - alpha
    return FlowCheck(float(np.nanmean(difference)), float(np.nanstd(difference)))
