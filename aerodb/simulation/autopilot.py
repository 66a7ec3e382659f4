"""An autopilot for an elevon glider that is unstable in pitch, by dynamic inversion.

It controls angle of attack and bank angle. It feeds back the true motion, without navigation
errors. Guidance is not part of it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from aerodb.nomenclature import AXES
from aerodb.physics import GRAVITY
from aerodb.simulation.flown_vehicle import FlownVehicle
from aerodb.support import Array
from aerodb.tables import transfer_moments


@dataclass(frozen=True)
class ControlDerivatives:
    """Derivatives for which the autopilot is designed.

    They are coefficients about the CG at a design point, per rad; rates are p b/V, q c/V, r b/V.
    """

    Cm: float
    alpha: float
    Cm_alpha: float
    Cm_q: float
    Cm_controls: Mapping[str, float]
    Cl_beta: float
    Cl_p: float
    Cl_aileron: float
    Cn_rudder: float
    CZ: float
    CZ_alpha: float


def control_derivatives(
    flown: FlownVehicle,
    condition: Mapping[str, float],
    pitch: Mapping[str, tuple[str, ...]],
    aileron: tuple[str, ...],
    rudder: str,
) -> ControlDerivatives:
    """Return derivatives of a vehicle's coefficients about the CG at one flight condition.

    They are central differences.

    Parameters
    ----------
    flown : the vehicle with the database
    condition : name to value in SI, every channel that the aerodynamics read
    pitch : name of a pitch control to the channels that move together for it; the first is the
        elevator
    aileron, rudder : channels of the roll and yaw controls
    """
    v, database = condition["V"], flown.model.database
    reference = database.reference
    chord, span = reference.chord, reference.span
    cg = [flown.masses[f"cg_{axis}"] for axis in "xyz"]

    def coefficients(**changed: float) -> Array:
        channels = {name: np.array([changed.get(name, value)]) for name, value in condition.items()}
        about = database.predict(channels).coefficients
        about = transfer_moments(about, database.reference.moment_reference, cg, reference)
        return np.concatenate([about[axis] for axis in AXES])

    def slope(names: tuple[str, ...], step: float) -> Array:
        up = coefficients(**{n: condition[n] + step for n in names})
        result: Array = (up - coefficients(**{n: condition[n] - step for n in names})) / (2 * step)
        return result

    base, alpha, beta = coefficients(), slope(("alpha",), 0.02), slope(("beta",), 0.02)
    return ControlDerivatives(
        Cm=base[4],
        alpha=condition["alpha"],
        Cm_alpha=alpha[4],
        Cm_q=slope(("q",), 0.02)[4] * v / chord,
        Cm_controls={name: slope(channels, 0.02)[4] for name, channels in pitch.items()},
        Cl_beta=beta[3],
        Cl_p=slope(("p",), 0.02)[3] * v / span,
        Cl_aileron=slope(aileron, 0.02)[3],
        Cn_rudder=slope((rudder,), 0.02)[5],
        CZ=base[2],
        CZ_alpha=alpha[2],
    )


@dataclass
class Autopilot:
    """Inner loops of pitch, roll and yaw.

    Parameters
    ----------
    flown : the vehicle
    known : derivatives at the design point
    step : float, control step [s]
    pitch_frequency, roll_frequency : float, [rad/s]
    pitch_damping, roll_damping : float, damping ratio
    pitch_integral : float, integral gain [1/s3]
    yaw_damping : float, yaw-rate gain [1/s]
    integral : (k,), accumulated error of angle of attack [rad s]
    """

    flown: FlownVehicle
    known: ControlDerivatives
    step: float
    pitch_frequency: float = 3.5
    pitch_damping: float = 0.9
    pitch_integral: float = 4.0
    roll_frequency: float = 2.5
    roll_damping: float = 0.9
    yaw_damping: float = 2.0
    integral: Array | float = field(default=0.0)

    def elevator(
        self, channels: Mapping[str, Array], alpha_command: Array, others: Mapping[str, Array]
    ) -> Array:
        """Return the symmetric elevator (k,) [rad] for a commanded angle of attack.

        Parameters
        ----------
        channels : name to (k,)
        alpha_command : (k,) [rad]
        others : further pitch controls, name to (k,) [rad]
        """
        c, k = channels, self.known
        error = alpha_command - c["alpha"]
        self.integral = np.clip(self.integral + self.step * error, -0.15, 0.15)
        weight = GRAVITY * np.cos(c["theta"]) * np.cos(c["phi"])
        path_rate = (-c["az"] - weight) / c["V"]
        commanded = (
            self.pitch_frequency**2 * error
            + self.pitch_integral * self.integral
            - 2 * self.pitch_damping * self.pitch_frequency * (c["q"] - path_rate)
        )
        reference = self.flown.vehicle.reference
        chord = reference.chord
        scale = c["qbar"] * reference.area * chord / self.flown.masses["Iyy"]
        natural = k.Cm + k.Cm_alpha * (c["alpha"] - k.alpha) + k.Cm_q * c["q"] * chord / c["V"]
        natural = natural + sum(k.Cm_controls[name] * value for name, value in others.items())
        elevator = next(iter(k.Cm_controls.values()))
        result: Array = (commanded / scale - natural) / elevator
        return result

    def aileron(self, channels: Mapping[str, Array], bank_command: Array) -> Array:
        """Return the asymmetric deflection (k,) [rad] for a commanded bank angle (k,) [rad]."""
        c, k, span = channels, self.known, self.flown.vehicle.reference.span
        commanded = (
            self.roll_frequency**2 * (bank_command - c["phi"])
            - 2 * self.roll_damping * self.roll_frequency * c["p"]
        )
        scale = c["qbar"] * self.flown.vehicle.reference.area * span / self.flown.masses["Ixx"]
        natural = k.Cl_beta * c["beta"] + k.Cl_p * c["p"] * span / c["V"]
        result: Array = (commanded / scale - natural) / k.Cl_aileron
        return result

    def rudder(self, channels: Mapping[str, Array]) -> Array:
        """Return the rudder (k,) [rad] that damps yaw about the rate of a coordinated turn."""
        c, span = channels, self.flown.vehicle.reference.span
        turn = GRAVITY / c["V"] * np.sin(c["phi"]) * np.cos(c["theta"])
        scale = c["qbar"] * self.flown.vehicle.reference.area * span / self.flown.masses["Izz"]
        result: Array = -self.yaw_damping * (c["r"] - turn) / scale / self.known.Cn_rudder
        return result
