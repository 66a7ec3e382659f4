"""Thrust of a flight: its loads on the aircraft, and the axes that are unknown without it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import bridge
from aerodb.flight import Flight
from aerodb.nomenclature import AXES, FORCE_AXES, MOMENT_AXES
from aerodb.physics import GRAVITY
from aerodb.support import Array
from aerodb.tables import Reference, transfer_moments
from aerodb.vehicle import Thrust, Vehicle, cg_positions, mass_channels

#: What a user does about a flight whose thrust is not known.
THRUST_REMEDY: Final = (
    "map the channel thrust, or state its value in [configuration] of the vehicle file if it was"
    " constant (0 with the engine off)"
)


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

    def loaded(self, sigma: Mapping[str, Array]) -> tuple[str, ...]:
        """Axes on which a thrust as large as the weight exceeds the noise `sigma` (axis -> (n,)),
        both rms; a smaller share of the thrust is not seen."""
        return tuple(axis for axis in AXES if axis in sigma and self._exceeds(axis, sigma[axis]))

    def moved(
        self, factor: Mapping[str, float], from_point: Array, to_point: Array, reference: Reference
    ) -> "ThrustShare":
        """The same for coefficients in another geometry: each axis times its `factor`, moments
        about `to_point` (`aerodb.tables.transfer_moments`)."""
        scaled = {axis: values * factor[axis] for axis, values in self.loads.items()}
        return ThrustShare(transfer_moments(scaled, from_point, to_point, reference), self.known)

    def _exceeds(self, axis: str, sigma: Array) -> bool:
        load = self.loads[axis]
        good = np.isfinite(load) & np.isfinite(sigma)
        return bool(np.any(good) and np.mean(load[good] ** 2) > np.mean(sigma[good] ** 2))


def thrust_share(flight: Flight, vehicle: Vehicle, point: Array) -> ThrustShare | None:
    """Return what the thrust adds to each axis; None unless it is logged by the vehicle file.

    point : (n, 3) [m], body axes from the datum; moments refer to it. Raises InputError as
    `aerodb.vehicle.mass_channels` does.
    """
    if vehicle.thrust.source != "channel":
        return None
    qbar, cg = bridge(flight["qbar"]), cg_positions(flight, vehicle)
    area, chord, span = vehicle.reference.area, vehicle.reference.chord, vehicle.reference.span
    weight = mass_channels(flight, vehicle)["mass"] * GRAVITY
    with np.errstate(divide="ignore", invalid="ignore"):
        force = np.where(qbar > 0, weight / (qbar * area), np.nan)[:, None] * _direction(
            vehicle.thrust
        )
    moment = _moment(vehicle.thrust, force, cg)
    loads = {axis: force[:, k] for k, axis in enumerate(FORCE_AXES)}
    for k, (axis, length) in enumerate(zip(MOMENT_AXES, (span, chord, span), strict=True)):
        loads[axis] = moment[:, k] / length
    known = flight.usable(["thrust"]) if "thrust" in flight else np.zeros(len(qbar), dtype=np.bool_)
    geometry = Reference(area, chord, span, (0.0, 0.0, 0.0))
    return ThrustShare(transfer_moments(loads, cg, point, geometry), known)


def thrust_loads(
    flight: Flight, thrust: Thrust, cg: Array, notes: list[str]
) -> tuple[Array, Array]:
    """Thrust force and its moment about the CG, in body axes.

    Parameters
    ----------
    thrust : source, direction and point of the thrust line.
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
    if "thrust" not in flight or not flight.usable(["thrust"]).any():
        return none, none
    force = bridge(flight["thrust"])[:, None] * _direction(thrust)
    if thrust.point is None:
        notes.append("thrust line not given in [thrust] point: its moment is left in Cm and Cn")
    return force, _moment(thrust, force, cg)


def without_thrust(axes: tuple[str, ...]) -> str:
    """Say that a flight gives nothing on `axes` because its thrust is not known."""
    return (
        f"{', '.join(axes)} left out: they contain thrust, which [thrust] of the vehicle file says"
        f" is logged and this flight lacks; {THRUST_REMEDY}"
    )


def _direction(thrust: Thrust) -> Array:
    return np.asarray(thrust.direction) / np.linalg.norm(thrust.direction)


def _moment(thrust: Thrust, force: Array, cg: Array) -> Array:
    """Moment (n, 3) [N m] about the CG of a thrust (n, 3) [N]; zero where its line is not given."""
    if thrust.point is None:
        return np.zeros_like(force)
    return np.cross(np.asarray(thrust.point) - cg, force)
