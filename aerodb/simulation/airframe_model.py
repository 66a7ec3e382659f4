"""A vehicle in the air: state, wind and surfaces become canonical channels, specific force and
moment about the CG."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from aerodb.errors import InputError
from aerodb.physics import euler_321_from_quaternion, speed_of_sound, standard_atmosphere
from aerodb.simulation.motion import (
    POSITION,
    QUATERNION,
    RATES,
    VELOCITY,
    angular_acceleration,
    cross,
    derivative,
    inertia_matrix,
    to_body,
    to_earth,
)
from aerodb.support import Array
from aerodb.vehicle import Vehicle

#: Canonical channels (each (k,)) in, coefficients CX CY CZ Cl Cm Cn (each (k,)) out.
Aerodynamics = Callable[[Mapping[str, Array]], Mapping[str, Array]]


class _Prediction(Protocol):
    @property
    def coefficients(self) -> Mapping[str, Array]: ...


class _Reference(Protocol):
    @property
    def moment_reference(self) -> tuple[float, float, float]: ...


class Database(Protocol):
    """What the simulation needs of an aerodynamic database."""

    @property
    def reference(self) -> _Reference: ...

    def predict(self, channels: Mapping[str, Array]) -> _Prediction: ...


@dataclass(frozen=True)
class MovingAir:
    """Wind over ground (north, east, down) [m/s] and gust in body axes [m/s], each (3, k): velocity
    of the air."""

    wind: Array
    gust: Array


@dataclass(frozen=True)
class Airframe:
    """Constant mass properties, reference geometry and aerodynamics of a vehicle in gliding flight.

    mass [kg]; inertia (3, 3) [kg m2] at the CG; area [m2]; lengths (3,) = span, chord, span [m];
    `reference_arm` (3,) [m]: from the CG to the point that the coefficients' moments are about;
    ground_altitude [m] above sea level; combinations: deflections made of two surfaces, name ->
    (sign, right, left).
    """

    mass: float
    inertia: Array
    area: float
    lengths: Array
    reference_arm: Array
    aerodynamics: Aerodynamics
    combinations: Mapping[str, tuple[float, str, str]]
    ground_altitude: float = 0.0

    def channels(
        self, state: Array, air: MovingAir, surfaces: Mapping[str, Array]
    ) -> dict[str, Array]:
        """Canonical channels (k,) of a state (13, k): air-relative motion, rates, height,
        deflections, air properties.

        `surfaces` holds deflections [rad] by their names in the vehicle file.
        """
        velocity = state[VELOCITY] - to_body(state[QUATERNION], air.wind) - air.gust
        u, v, w = velocity
        speed = np.sqrt(u * u + v * v + w * w)
        height = -state[POSITION][2]
        atmosphere = standard_atmosphere(self.ground_altitude + height)
        found = {
            "V": speed,
            "alpha": np.arctan2(w, u),
            "beta": np.arcsin(v / speed),
            "p": state[3],
            "q": state[4],
            "r": state[5],
            "rho": atmosphere.density,
            "temperature": atmosphere.temperature,
            "static_pressure": atmosphere.pressure,
            "qbar": 0.5 * atmosphere.density * speed * speed,
            "mach": speed / speed_of_sound(atmosphere.temperature),
            "altitude": self.ground_altitude + height,
            "height_above_ground": height,
        }
        found.update({f"delta_{name}": value for name, value in surfaces.items()})
        for name, (sign, right, left) in self.combinations.items():
            found[f"delta_{name}"] = 0.5 * (surfaces[right] + sign * surfaces[left])
        return found

    def loads(self, channels: Mapping[str, Array]) -> tuple[Array, Array]:
        """Specific force (3, k) [m/s2] and moment about the CG (3, k) [N m] of the aerodynamics;
        nothing else acts."""
        c = self.aerodynamics(channels)
        scale = channels["qbar"] * self.area
        force = scale * np.stack([c["CX"], c["CY"], c["CZ"]])
        moment = scale * self.lengths[:, None] * np.stack([c["Cl"], c["Cm"], c["Cn"]])
        return force / self.mass, moment + cross(self.reference_arm[:, None] + 0 * force, force)

    def state_rate(self, state: Array, air: MovingAir, surfaces: Mapping[str, Array]) -> Array:
        """Time derivative (13, k) of the state."""
        force, moment = self.loads(self.channels(state, air, surfaces))
        return derivative(state, force, moment, self.inertia)

    def evaluate(
        self, state: Array, air: MovingAir, surfaces: Mapping[str, Array]
    ) -> tuple[dict[str, Array], Array]:
        """All channels of a simulated instant, inertial motion and loads included, and the state's
        derivative."""
        found = self.channels(state, air, surfaces)
        force, moment = self.loads(found)
        acceleration = angular_acceleration(state[RATES], moment, self.inertia)
        earth = to_earth(state[QUATERNION], state[VELOCITY])
        angles = euler_321_from_quaternion(*state[QUATERNION])
        found.update(zip(("ax", "ay", "az"), force, strict=True))
        found.update(zip(("pdot", "qdot", "rdot"), acceleration, strict=True))
        found.update(zip(("phi", "theta", "psi"), angles, strict=True))
        found.update(zip(("velocity_north", "velocity_east", "velocity_down"), earth, strict=True))
        found.update(zip(("north", "east"), state[POSITION], strict=False))
        return found, derivative(state, force, moment, self.inertia)


def airframe(vehicle: Vehicle, database: Database, ground_altitude: float = 0.0) -> Airframe:
    """An Airframe from a vehicle file with constant mass and a database about its own moment
    reference.

    Raises InputError when the mass is not constant or the vehicle has thrust: neither is simulated.
    """
    properties = vehicle.mass
    if properties.source != "constant" or vehicle.thrust.source != "none":
        raise InputError(
            "only gliding flight at constant mass is simulated",
            vehicle.name,
            "use [mass] source = 'constant' and no thrust",
        )
    mass, *inertia = (
        float(np.asarray(v))
        for v in (
            properties.mass,
            *(getattr(properties, f"I{a}") for a in ("xx", "yy", "zz", "xz")),
        )
    )
    chord, span = vehicle.reference.chord, vehicle.reference.span
    return Airframe(
        mass=mass,
        inertia=inertia_matrix(*inertia),
        area=vehicle.reference.area,
        lengths=np.array([span, chord, span]),
        reference_arm=np.asarray(database.reference.moment_reference)
        - np.asarray(properties.cg, dtype=np.float64),
        aerodynamics=lambda channels: database.predict(channels).coefficients,
        combinations={
            n: (1.0 if c.kind == "symmetric" else -1.0, c.right, c.left)
            for n, c in vehicle.combinations.items()
        },
        ground_altitude=ground_altitude,
    )
