"""A vehicle in the air: channels, specific force and moment from state, wind and surfaces."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from aerodb.errors import InputError
from aerodb.physics import (
    cross,
    euler_321_from_quaternion,
    speed_of_sound,
    standard_atmosphere,
    to_body,
)
from aerodb.simulation.motion import (
    POSITION,
    QUATERNION,
    RATES,
    VELOCITY,
    derivative,
    inertia_matrix,
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
    """The parts of an aerodynamic database that the simulation needs."""

    @property
    def reference(self) -> _Reference: ...

    def predict(self, channels: Mapping[str, Array]) -> _Prediction: ...


@dataclass(frozen=True)
class MovingAir:
    """Velocity of the air.

    wind : (3, k), over ground (north, east, down) [m/s]. gust : (3, k), body axes [m/s].
    """

    wind: Array
    gust: Array


@dataclass(frozen=True)
class Airframe:
    """Constant mass properties, reference geometry and aerodynamics of a gliding vehicle.

    Parameters
    ----------
    mass : float, [kg]
    inertia : (3, 3), about the CG [kg m2]
    area : float, [m2]
    lengths : (3,), span, chord, span [m]
    reference_arm : (3,), from the CG to the reference point of the moment coefficients [m]
    aerodynamics : channels to coefficients
    combinations : name to (sign, right, left), deflections made of two surfaces
    ground_altitude : float, above sea level [m]
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
        """Return the canonical channels of a state.

        They are air-relative motion, rates, height, deflections and air properties.

        Parameters
        ----------
        state : (13, k), as in `aerodb.simulation.motion`
        air : wind and gust
        surfaces : name in the vehicle file to deflection (k,) [rad]

        Returns
        -------
        name to (k,)
        """
        velocity = state[VELOCITY] - to_body(state[QUATERNION], air.wind) - air.gust
        u, v, w = velocity
        speed = np.sqrt(u * u + v * v + w * w)
        height = -state[POSITION][2]
        atmosphere = standard_atmosphere(self.ground_altitude + height)
        values = {
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
        values.update({f"delta_{name}": value for name, value in surfaces.items()})
        for name, (sign, right, left) in self.combinations.items():
            values[f"delta_{name}"] = 0.5 * (surfaces[right] + sign * surfaces[left])
        return values

    def loads(self, channels: Mapping[str, Array]) -> tuple[Array, Array]:
        """Return the loads of the aerodynamics; nothing else acts.

        Parameters
        ----------
        channels : name to (k,)

        Returns
        -------
        specific force : (3, k) [m/s2]
        moment about the CG : (3, k) [N m]
        """
        c = self.aerodynamics(channels)
        scale = channels["qbar"] * self.area
        force = scale * np.array([c["CX"], c["CY"], c["CZ"]])
        moment = scale * self.lengths[:, None] * np.array([c["Cl"], c["Cm"], c["Cn"]])
        return force / self.mass, moment + cross(self.reference_arm[:, None] + 0 * force, force)

    def state_rate(self, state: Array, air: MovingAir, surfaces: Mapping[str, Array]) -> Array:
        """Return the time derivative (13, k) of the state."""
        force, moment = self.loads(self.channels(state, air, surfaces))
        return derivative(state, force, moment, self.inertia)

    def evaluate(
        self, state: Array, air: MovingAir, surfaces: Mapping[str, Array]
    ) -> tuple[dict[str, Array], Array]:
        """Return all channels of a simulated instant, and the time derivative (13, k) of the state.

        The channels (k,) include inertial motion and loads. Parameters as in `channels`.
        """
        channels = self.channels(state, air, surfaces)
        force, moment = self.loads(channels)
        rate = derivative(state, force, moment, self.inertia)
        angles = euler_321_from_quaternion(*state[QUATERNION])
        channels.update(zip(("ax", "ay", "az"), force, strict=True))
        channels.update(zip(("pdot", "qdot", "rdot"), rate[RATES], strict=True))
        channels.update(zip(("phi", "theta", "psi"), angles, strict=True))
        channels.update(
            zip(("velocity_north", "velocity_east", "velocity_down"), rate[POSITION], strict=True)
        )
        channels.update(zip(("north", "east"), state[POSITION], strict=False))
        return channels, rate


def airframe(vehicle: Vehicle, database: Database, ground_altitude: float = 0.0) -> Airframe:
    """Return the Airframe of a vehicle file and a database about its own moment reference.

    Parameters
    ----------
    vehicle : constant mass, no thrust
    database : aerodynamic database
    ground_altitude : float, above sea level [m]

    Raises InputError if the mass is not constant or the vehicle has thrust: neither is simulated.
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
