"""Place and axes of a part: the velocity there, and the loads that it puts on the aircraft.

The velocity at a part is ``v + w x r``, in its own axes; a load of it is turned into body axes and
has the moment ``r x F`` about the moment reference. Damping by rates follows from the two.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.support import Array
from aerodb.tables import Expression, Name, Negation, Number, Operation, plus, times

#: Coefficients of sines and cosines below this are rounding.
_ROUNDING: Final = 1e-12

#: Variables of the aircraft's velocity through the air in body axes [m/s].
MOTION: Final = {
    "air_u": "V*cos(alpha)*cos(beta)",
    "air_v": "V*sin(beta)",
    "air_w": "V*sin(alpha)*cos(beta)",
}


@dataclass(frozen=True, eq=False)
class Frame:
    """Place and axes of a part.

    Parameters
    ----------
    arm : (3,) [m], body axes, from the moment reference.
    axes : (3, 3), columns: the part's x, y and z axis in body axes.
    """

    arm: Array
    axes: Array

    def velocity(self, k: int) -> Expression:
        """Return the velocity [m/s] of the part through still air along its axis `k`."""
        axis = self.axes[:, k]
        names = (*MOTION, "p", "q", "r")
        values = (*axis, *np.cross(self.arm, axis))
        return combination(values, [Name(name) for name in names])

    def rotation(self, k: int) -> Expression:
        """Return the part of `velocity` [m/s] that is due to the rates p, q and r."""
        return combination(
            np.cross(self.arm, self.axes[:, k]).tolist(), [Name(name) for name in "pqr"]
        )

    def loads(
        self, forces: Sequence[Expression | None], moments: Sequence[Expression | None]
    ) -> dict[str, Expression]:
        """Return load axis -> expression [N, N m], body axes about the moment reference; axes on
        which nothing acts are left out.

        forces, moments : along and about the part's axes [N, N m]; None where there is none.
        """
        found = {}
        for k, axis in enumerate(("FX", "FY", "FZ", "MX", "MY", "MZ")):
            values: list[float] = []
            acting: list[Expression] = []
            for j, (force, moment) in enumerate(zip(forces, moments, strict=True)):
                own = self.axes[:, j]
                if force is not None:
                    values.append(own[k] if k < 3 else np.cross(self.arm, own)[k - 3])
                    acting.append(force)
                if moment is not None and k >= 3:
                    values.append(own[k - 3])
                    acting.append(moment)
            total = combination(values, acting)
            if total != Number(0.0):
                found[axis] = total
        return found


def combination(values: Sequence[float], parts: Sequence[Expression]) -> Expression:
    """Return the sum of `values` times `parts`, without those that are zero.

    >>> str(combination([1.0, -2.5, 0.0], [Name("p"), Name("q"), Name("r")]))
    'p - 2.5*q'
    """
    total: Expression | None = None
    for value, part in zip(values, parts, strict=True):
        if abs(value) < _ROUNDING:
            continue
        size = abs(float(value))
        scaled = part if abs(size - 1.0) < _ROUNDING else times(Number(size), part)
        if total is None:
            total = Negation(scaled) if value < 0 else scaled
        else:
            total = Operation("-", total, scaled) if value < 0 else plus(total, scaled)
    return Number(0.0) if total is None else total


def turned(roll: float, pitch: float, yaw: float) -> Array:
    """Return the axes (3, 3) of a part that is turned by `yaw`, then `pitch`, then `roll` [rad].

    Euler angles 3-2-1, as of the aircraft's attitude; columns are the part's axes in body axes.
    """
    (cr, cp, cy), (sr, sp, sy) = np.cos([roll, pitch, yaw]), np.sin([roll, pitch, yaw])
    return np.array(
        [
            [cp * cy, sr * sp * cy - cr * sy, cr * sp * cy + sr * sy],
            [cp * sy, sr * sp * sy + cr * cy, cr * sp * sy - sr * cy],
            [-sp, sr * cp, cr * cp],
        ]
    )


def along(direction: Sequence[float]) -> Array:
    """Return axes (3, 3) whose x axis has a direction (3,) in body axes, and whose y axis is level.

    >>> along((1.0, 0.0, 0.0)).tolist()
    [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    """
    x = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
    level = np.array([0.0, 0.0, 1.0]) if abs(x[2]) < 0.999 else np.array([-np.sign(x[2]), 0.0, 0.0])
    y = np.cross(level, x)
    y = y / np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)]) + 0.0


def across(direction: Sequence[float], tilt_axis: Sequence[float]) -> Array:
    """Return axes (3, 3) whose x axis has a direction (3,) in body axes, and whose y axis is the
    part of `tilt_axis` (3,) across it; as `along` where there is none.

    >>> across((0.0, 0.0, -1.0), (0.0, 1.0, 0.0)).tolist()
    [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]]
    """
    x = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
    y = np.asarray(tilt_axis, dtype=np.float64) - np.dot(tilt_axis, x) * x
    if np.linalg.norm(y) < 1e-6 * np.linalg.norm(tilt_axis):
        return along(direction)
    y = y / np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)]) + 0.0


def lifting(side: float, dihedral: float, sweep: float) -> Array:
    """Return the axes (3, 3) of a strip of a lifting surface: x forward and normal to its span, y
    along its span, to the right, z normal to both.

    side : 1 right of the middle or on it, -1 left. dihedral, sweep : tip up and tip aft [rad]; a
    fin has a dihedral of 90 deg, its z axis is to the right.

    >>> lifting(1.0, np.pi / 2, 0.0).round(12)[:, 2].tolist()
    [0.0, 1.0, 0.0]
    """
    up = side * dihedral
    x = np.array([1.0, 0.0, 0.0])
    y = np.array([0.0, np.cos(up), -np.sin(up)])
    z = np.array([0.0, np.sin(up), np.cos(up)])
    x, y = (
        np.cos(sweep) * x + side * np.sin(sweep) * y,
        np.cos(sweep) * y - side * np.sin(sweep) * x,
    )
    return np.column_stack([x, y, z])
