"""Sensor models: the true quantity behind each output, in states, rates and unknowns.

Derivatives are carried along automatically (`aerodb.support.dual_numbers`).

Air data are those of the air-data point, ``v - C w + omega x r`` with the wind w, attitude C and
arm r from the CG, in axes of the boom; ``alpha = atan2(w, u)``, ``beta = asin(v / V)``, ``qbar =
rho V^2 / 2`` (Klein & Morelli 2006, section 10.2; Jategaonkar 2015, section 10.3). Velocity over
the earth and position are those of the antenna. A five-hole probe shows the same angles as vanes
there would, by the pressure differences of `five_hole`.

The pressures behind V, qbar and pressure altitude share their errors (003, eq. 5): the static port
shows ``p + e_s qbar + o_s``, the total port ``p + (1 + e_t) qbar``, so ``qbar_m = (1 + e_t - e_s)
qbar - o_s``, ``V_m = sqrt(2 qbar_m / rho)`` and pressure altitude is low by ``(e_s qbar + o_s) /
(rho g)``. Exact below the compressible range; above, e stands for its mean effect.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from aerodb.errors import InputError
from aerodb.support import (
    Array,
    Dual,
    Triple,
    angle,
    arcsine,
    body_to_earth,
    cross,
    dead_zone,
    dot,
    root,
    sine,
)
from aerodb.vehicle import Curve, FiveHole, Vehicle, pressure_ratio

_PORTS = ("static_port_error", "static_port_offset", "total_port_error")


@dataclass(frozen=True)
class Installation:
    """How the sensors behind a record's outputs are installed.

    None of these effects has been removed from the outputs yet.

    gps : (3,), antenna relative to the CG, body axes [m].
    boom : (3,), roll, pitch, yaw of the air-data probe relative to the body axes [rad].
    upwash : (2,), relative increase of alpha and beta.
    flank : beta is the flank angle atan2(v, u), as a free vane measures it.
    five_hole : calibration of a five-hole probe, for raw pressures.
    beam : (2,), tilt of the slant range's beam from body z, forward and to the right [rad].
    """

    gps: tuple[float, float, float] = (0.0, 0.0, 0.0)
    boom: tuple[float, float, float] = (0.0, 0.0, 0.0)
    upwash: tuple[float, float] = (0.0, 0.0)
    flank: bool = False
    five_hole: FiveHole | None = None
    beam: tuple[float, float] = (0.0, 0.0)


def installation_from_vehicle(
    vehicle: Vehicle, cg: Array, raw: bool, configuration: int = 0
) -> Installation:
    """The sensor installation that a vehicle file declares.

    Parameters
    ----------
    vehicle : the vehicle.
    cg : (3,), mean CG relative to the datum, body axes [m].
    raw : whether air data are as the probe shows them; otherwise boom, upwash and calibration have
        already been removed (`aerodb.vehicle.probe.air_data_at_cg`).
    configuration : number of the probe's (`AirData.alternatives`).
    """
    gps = (
        (0.0, 0.0, 0.0)
        if vehicle.points.gps is None
        else tuple(float(x) for x in np.asarray(vehicle.points.gps) - cg)
    )
    probe = vehicle.air_data.alternatives()[configuration]
    arm = (gps[0], gps[1], gps[2])
    if not raw:
        return Installation(arm)
    return Installation(
        arm, probe.orientation, probe.upwash, probe.beta == "flank", probe.five_hole
    )


class SensorModels:
    """The sensor models of one record: `channel(name)` is the true quantity behind an output.

    Parameters
    ----------
    states : name -> signal (n,), with its derivative by itself.
    rates : p, q, r likewise [rad/s]. Over a rotating earth they include the earth's rate, whose
        contribution to ``omega x r`` (7e-5 m/s per metre) is not removed.
    values : parameter name -> value, SI.
    free : parameter names by which to differentiate.
    arm : (3,), air-data point relative to the CG, body axes [m].
    installation : of the other sensors.
    gravity : [m/s2].
    density : (n,), [kg/m3].
    pressure : (n,), measured static pressure that the density was computed from [Pa]; None: the
        density is correct.
    """

    def __init__(
        self,
        states: Mapping[str, Dual],
        rates: Triple,
        values: Mapping[str, float],
        free: frozenset[str],
        arm: tuple[float, float, float],
        installation: Installation,
        gravity: float,
        density: Array | None = None,
        pressure: Array | None = None,
    ) -> None:
        self.states, self.rates = states, rates
        self.values, self.free = values, free
        self.arm, self.installation = arm, installation
        self.gravity, self.density, self.pressure = gravity, density, pressure

    def unknown(self, name: str, declared: float = 0.0) -> Dual:
        """The declared value plus a parameter, SI, with its derivative 1 if the parameter is free:
        a scalar."""
        return Dual(declared + self.values.get(name, 0.0), {name: 1.0} if name in self.free else {})

    def acts(self, *names: str) -> bool:
        """Return whether any of these parameters (scalars, SI units) is free or differs from
        zero."""
        return any(name in self.free or self.values.get(name, 0.0) != 0.0 for name in names)

    def channel(self, name: str) -> Dual:
        """The true quantity behind an output, SI, with its derivatives.

        (n,). Raises KeyError for a name that is no output.
        """
        if name in ("north", "east", "altitude"):
            return self._position(name)
        if name in self.states:
            return self.states[name]
        if name.startswith("velocity_"):
            return self.over_earth[("velocity_north", "velocity_east", "velocity_down").index(name)]
        models: dict[str, Callable[[], Dual]] = {
            "V": lambda: self.shown_speed,
            "alpha": lambda: self.vanes[0],
            "beta": lambda: self.vanes[1],
            "qbar": lambda: self.shown_pressure,
            "pressure_altitude": self._pressure_altitude,
            "height_above_ground": lambda: self.height,
            "slant_range": self._slant_range,
            "probe_dp_alpha": lambda: self._difference("alpha"),
            "probe_dp_beta": lambda: self._difference("beta"),
        }
        return models[name]()

    @cached_property
    def rotation(self) -> tuple[Triple, Triple, Triple]:
        """Rotation matrix from body to earth axes (north, east, down), by rows.

        Euler angles 3-2-1 [rad]; every element (n,).
        """
        return body_to_earth(self.states["phi"], self.states["theta"], self.states["psi"])

    @property
    def velocity(self) -> Triple:
        """Velocity (u, v, w) of the CG over the earth, body axes, (n,) each [m/s]."""
        return self.states["u"], self.states["v"], self.states["w"]

    @cached_property
    def air(self) -> Triple:
        """Velocity of the CG through the air, body axes, (n,) each [m/s]."""
        names = ("wind_north", "wind_east", "wind_down")
        if not self.acts(*names):
            return self.velocity
        north, east, down = (self.unknown(name) for name in names)
        a, b, c = (
            speed - (row[0] * north + row[1] * east + row[2] * down)
            for speed, row in zip(self.velocity, zip(*self.rotation, strict=True), strict=True)
        )
        return a, b, c

    def _arm(self, point: str, declared: tuple[float, float, float]) -> Triple | None:
        """Position of a point from the CG, body axes; None when it is the CG and stays there."""
        names = [f"{point}_{axis}" for axis in "xyz"]
        if not any(declared) and not self.acts(*names):
            return None
        x, y, z = (self.unknown(name, known) for name, known in zip(names, declared, strict=True))
        return x, y, z

    def _moved(self, velocity: Triple, arm: Triple | None) -> Triple:
        if arm is None:
            return velocity
        a, b, c = (v + w for v, w in zip(velocity, cross(self.rates, arm), strict=True))
        return a, b, c

    @cached_property
    def probe(self) -> Triple:
        """Velocity of the air-data point through the air, in axes of the boom, (n,) each [m/s]."""
        moved = self._moved(self.air, self._arm("air_data", self.arm))
        names = ("air_data_roll", "air_data_pitch", "air_data_yaw")
        if not any(self.installation.boom) and not self.acts(*names):
            return moved
        roll, pitch, yaw = (
            self.unknown(name, known)
            for name, known in zip(names, self.installation.boom, strict=True)
        )
        a, b, c = (
            dot(column, moved) for column in zip(*body_to_earth(roll, pitch, yaw), strict=True)
        )
        return a, b, c

    @cached_property
    def speed(self) -> Dual:
        """True airspeed at the air-data point, (n,) [m/s]."""
        a, b, c = self.probe
        return root(a * a + b * b + c * c)

    @cached_property
    def flow(self) -> tuple[Dual, Dual]:
        """Angles of attack and sideslip at the air-data point, (n,) each [rad]."""
        a, b, c = self.probe
        return angle(c, a), arcsine(b / self.speed)

    @cached_property
    def vanes(self) -> tuple[Dual, Dual]:
        """Angles of attack and sideslip as vanes at the air-data point show them, (n,) each [rad].

        They contain upwash, and the flank angle in place of sideslip where the vane measures it.
        """
        a, b, _ = self.probe
        slip = angle(b, a) if self.installation.flank else self.flow[1]
        return self.flow[0] * (1.0 + self.installation.upwash[0]), slip * (
            1.0 + self.installation.upwash[1]
        )

    @cached_property
    def over_earth(self) -> Triple:
        """Velocity of the antenna over the earth, north, east, down, (n,) each [m/s]."""
        moved = self._moved(self.velocity, self._arm("gps", self.installation.gps))
        north, east, down = (dot(row, moved) for row in self.rotation)
        return north, east, down

    def _position(self, name: str) -> Dual:
        arm = self._arm("gps", self.installation.gps)
        if arm is None:
            return self.states[name]
        offset = dot(self.rotation[("north", "east", "altitude").index(name)], arm)
        return self.states[name] + (-offset if name == "altitude" else offset)

    @cached_property
    def dynamic_pressure(self) -> Dual:
        """True dynamic pressure at the air-data point, (n,) [Pa].

        Density is solved for with it if it was computed from the measured static pressure.
        """
        incompressible = self.speed * self.speed * (0.5 * self._density())
        if self.pressure is None or not self.acts(*_PORTS):
            return incompressible
        share = 1.0 - self.unknown("static_port_offset") / self.pressure
        return (
            incompressible
            * share
            / (1.0 + self.unknown("static_port_error") * incompressible / self.pressure)
        )

    @cached_property
    def shown_pressure(self) -> Dual:
        """Dynamic pressure as the ports show it, (n,) [Pa]."""
        true = self.dynamic_pressure
        if not self.acts(*_PORTS):
            return true
        gain = self.unknown("total_port_error") - self.unknown("static_port_error") + 1.0
        return true * gain - self.unknown("static_port_offset")

    @cached_property
    def shown_speed(self) -> Dual:
        """True airspeed computed from the pressures at the ports, (n,) [m/s].

        Raises InputError when errors of the ports leave no dynamic pressure.
        """
        if not self.acts(*_PORTS):
            return self.speed
        if not np.min(self.shown_pressure.value) > 0.0:
            raise InputError(
                "errors of the pressure ports leave no dynamic pressure",
                "flight-path reconstruction",
                "bound them",
            )
        return root(self.shown_pressure * (2.0 / self._density()))

    def _density(self) -> Array:
        assert self.density is not None  # checked by `prediction.predict_outputs`
        return self.density

    def _pressure_altitude(self) -> Dual:
        height, arm = self.states["altitude"], self._arm("air_data", self.arm)
        if arm is not None:
            height = height - dot(self.rotation[2], arm)
        if not self.acts("static_port_error", "static_port_offset"):
            return height
        excess = self.unknown("static_port_error") * self.dynamic_pressure + self.unknown(
            "static_port_offset"
        )
        return height - excess / (self._density() * self.gravity)

    @cached_property
    def height(self) -> Dual:
        """Height of the CG above the ground, (n,) [m]."""
        return self.states["altitude"] - self.unknown("terrain_elevation")

    def _slant_range(self) -> Dual:
        down = self.rotation[2]
        if not any(self.installation.beam) and not self.acts("beam_forward", "beam_right"):
            return self.height / down[2]
        forward, right = (
            self.unknown(name, known)
            for name, known in zip(
                ("beam_forward", "beam_right"), self.installation.beam, strict=True
            )
        )
        ahead, aside = sine(forward), sine(right)
        beam = (ahead, aside, root(1.0 - ahead * ahead - aside * aside))
        return self.height / dot(down, beam)

    def _difference(self, which: str) -> Dual:
        """Pressure difference between a pair of holes of a five-hole probe, Pa."""
        assert self.installation.five_hole is not None  # checked by `prediction.FlightRecord`
        curve: Curve = getattr(self.installation.five_hole, which)
        x, y = self.vanes if which == "alpha" else self.vanes[::-1]
        shape = pressure_ratio(x, y, curve)
        name = f"probe_{which}"
        shape = shape + x * self.unknown(f"{name}_slope") + self.unknown(f"{name}_offset")
        if self.acts(f"{name}_square", f"{name}_cross", f"{name}_bend"):
            shape = shape + self._shape(name, x, y, curve)
        return self.dynamic_pressure * shape * curve.slope

    def _shape(self, name: str, x: Dual, y: Dual, curve: Curve) -> Dual:
        """Estimated corrections of the calibration: curvature, dependence on the other angle, and
        bend."""
        bend = self.unknown(f"{name}_bend") * dead_zone(x, curve.break_angle)
        return x * x * self.unknown(f"{name}_square") + y * y * self.unknown(f"{name}_cross") + bend
