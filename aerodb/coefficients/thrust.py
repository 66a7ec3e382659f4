"""Thrust of a flight: its loads on the aircraft, and the axes that are unknown without it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.flight import Flight
from aerodb.nomenclature import AXES, FORCE_AXES, MOMENT_AXES
from aerodb.physics import GRAVITY
from aerodb.signals import bridge
from aerodb.support import Array
from aerodb.tables import ReferenceGeometry, transfer_moments
from aerodb.vehicle import Thrust, ThrustLine, Vehicle, cg_positions, mass_channels

#: What a user does about a flight whose thrust is not known.
THRUST_REMEDY: Final = (
    "map the channel thrust (thrust_<engine> with [thrust.engines]), or state a constant"
    " value in [configuration] of the vehicle file (0 with the engine off)"
)
#: Part of the weight that an unknown thrust may be: that of level flight at a ratio of lift to drag
#: of four, the least of aircraft that fly on their wings.
LEVEL: Final = 0.25


@dataclass(frozen=True)
class ThrustShare:
    """Where the thrust of a flight is known, and what it can add to each axis.

    Parameters
    ----------
    loads : axis -> (n,), coefficient of a thrust as large as the weight, moments about the point
        that the coefficients refer to.
    known : (n,) where the thrust is known.
    """

    loads: Mapping[str, Array]
    known: NDArray[np.bool_]

    def loaded(self, measured: Mapping[str, Array]) -> tuple[str, ...]:
        """Axes on which a thrust of the part `LEVEL` of the weight would be larger than what is
        measured there, `measured` (axis -> (n,)) about its mean, both rms."""
        return tuple(
            axis for axis in AXES if axis in measured and self._exceeds(axis, measured[axis])
        )

    def moved(
        self,
        factor: Mapping[str, float],
        from_point: Array,
        to_point: Array,
        reference: ReferenceGeometry,
    ) -> "ThrustShare":
        """The same for coefficients in another geometry: each axis times its `factor`, moments
        about `to_point` (`aerodb.tables.transfer_moments`).

        Points (3,) [m], loads (n,) as coefficients.
        """
        scaled = {axis: values * factor[axis] for axis, values in self.loads.items()}
        return ThrustShare(transfer_moments(scaled, from_point, to_point, reference), self.known)

    def _exceeds(self, axis: str, measured: Array) -> bool:
        load = self.loads[axis]
        good = np.isfinite(load) & np.isfinite(measured)
        return bool(np.any(good) and LEVEL**2 * np.mean(load[good] ** 2) > np.var(measured[good]))


def thrust_share(flight: Flight, vehicle: Vehicle, point: Array) -> ThrustShare | None:
    """Return what the thrust adds to each axis; None unless it is logged by the vehicle file.

    point : (n, 3) [m], body axes from the datum; moments refer to it. Raises InputError as
    `aerodb.vehicle.mass_channels` does.
    """
    if vehicle.thrust.source != "channel":
        return None
    constant, cg = vehicle.reference.pressure, cg_positions(flight, vehicle)
    qbar = bridge(flight["qbar"]) if constant is None else np.full(len(flight.time), constant)
    area, chord, span = vehicle.reference.area, vehicle.reference.chord, vehicle.reference.span
    weight = mass_channels(flight, vehicle)["mass"] * GRAVITY
    lines = vehicle.thrust.lines
    with np.errstate(divide="ignore", invalid="ignore"):
        size = np.where(qbar > 0, weight / (qbar * area), np.nan)[:, None] / len(lines)
    # Moments of two engines may cancel, but one alone may be what is not known: the largest counts.
    forces = [size * _direction(line) for line in lines.values()]
    force = np.sum(forces, axis=0)
    moments = [_moment(line, each, cg) for line, each in zip(lines.values(), forces, strict=True)]
    moment = (
        len(lines)
        * np.take_along_axis(np.stack(moments), np.abs(moments).argmax(axis=0)[None], axis=0)[0]
    )
    loads = {axis: force[:, k] for k, axis in enumerate(FORCE_AXES)}
    for k, (axis, length) in enumerate(zip(MOMENT_AXES, (span, chord, span), strict=True)):
        loads[axis] = moment[:, k] / length
    logged = all(name in flight for name in lines)
    known = flight.usable(lines) if logged else np.zeros(len(qbar), dtype=np.bool_)
    geometry = ReferenceGeometry(area, chord, span, (0.0, 0.0, 0.0))
    return ThrustShare(transfer_moments(loads, cg, point, geometry), known)


def thrust_loads(
    flight: Flight, thrust: Thrust, cg: Array, notes: list[str]
) -> tuple[Array, Array]:
    """Thrust force and its moment about the CG, in body axes.

    Parameters
    ----------
    thrust : source, and direction and point of each thrust line.
    cg : (n, 3) [m], body axes from the datum.
    notes : what is unknown is appended.

    Returns
    -------
    Force (n, 3) [N] and moment (n, 3) [N m]; zero where not known.
    """
    none = np.zeros_like(cg)
    if thrust.source == "none":
        return none, none
    if thrust.source == "unknown":
        notes.append("thrust is not known: CX, CZ and Cm contain it")
        return none, none
    lines = thrust.lines
    if not all(name in flight for name in lines) or not flight.usable(lines).any():
        return none, none
    forces = {
        name: bridge(flight[name])[:, None] * _direction(line) for name, line in lines.items()
    }
    if any(line.point is None for line in lines.values()):
        notes.append("thrust line not given in [thrust] point: its moment is left in Cm and Cn")
    moments = [_moment(line, forces[name], cg) for name, line in lines.items()]
    return np.sum(list(forces.values()), axis=0), np.sum(moments, axis=0)


def without_thrust(axes: tuple[str, ...]) -> str:
    """Say that a flight gives nothing on `axes` because its thrust is not known."""
    return (
        f"{', '.join(axes)} left out: they contain thrust, which [thrust] of the vehicle file says"
        f" is logged and this flight lacks; {THRUST_REMEDY}"
    )


def _direction(line: ThrustLine) -> Array:
    return np.asarray(line.direction) / np.linalg.norm(line.direction)


def _moment(line: ThrustLine, force: Array, cg: Array) -> Array:
    """Moment (n, 3) [N m] about the CG of a thrust (n, 3) [N]; zero where its line is not given."""
    if line.point is None:
        return np.zeros_like(force)
    return np.cross(np.asarray(line.point) - cg, force)
