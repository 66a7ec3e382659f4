"""Vehicle file: reference geometry, points, mass properties, surfaces, thrust, sensors, limits.

Positions are in metres in body axes (x forward, y right, z down) from the vehicle's datum. Numbers
are in SI; text with a unit ("6.5 ft", "-25 deg") is converted when the file is read. An unknown key
is an error that names the nearest known key.
"""

import math
from collections.abc import Sequence
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.nomenclature import channel, is_surface
from aerodb.quantities import Kilograms, Metres, Number, Point, Radians, Seconds, in_unit
from aerodb.support import Strict, validated, validated_toml
from aerodb.units import quantity
from aerodb.vehicle.five_hole import FiveHole
from aerodb.vehicle.mass_properties import MASS_CHANNELS, MassProperties

#: What `[measured]` can state beside deflections and errors of sensors.
_MEASURABLE = (*MASS_CHANNELS, "thrust")
#: Ends of the names of errors: of a sensor, a surface or a mass property.
_ERRORS = ("_bias", "_scale", "_delay", "_offset", "_share")
#: Errors of positions [m].
_POSITION = ("air_data_x", "air_data_z", "thrust_line_y", "thrust_line_z")


#: Name of a navigation solution: channels end on it.
SourceName = Annotated[str, Field(pattern=r"^[a-z][a-z0-9]*$")]


class Reference(Strict):
    """Reference area [m2], chord [m] (Cm, q_hat) and full span [m] (Cl, Cn, p_hat, r_hat).

    pressure : constant [Pa] that coefficients are over in place of the dynamic pressure, of a
    vehicle that hovers; the same in its databases.
    """

    area: Annotated[float, in_unit("m^2"), Field(gt=0)]
    chord: Annotated[float, in_unit("m"), Field(gt=0)]
    span: Annotated[float, in_unit("m"), Field(gt=0)]
    pressure: Annotated[float, in_unit("Pa"), Field(gt=0)] | None = None


class Points(Strict):
    """Named points [m] in body axes from the datum.

    moment_reference : ``"cg"`` for moments about the moving CG. imu : position of the
    accelerometers. air_data : where V, alpha and beta are measured; None: at the CG. gps : the
    point to which the logged position and ground velocity refer: the receiver's antenna, or the
    reference point of a navigation filter (PX4: the IMU); None: the CG.
    """

    moment_reference: Point | Literal["cg"]
    datum_note: str = ""
    imu: Point | Literal["cg"] = "cg"
    air_data: Point | None = None
    gps: Point | None = None


class ProbeConfiguration(Strict):
    """What is another about the flow at the probe while a channel is within limits, such as with
    the gear down or flaps.

    channel : that tells of it. above, below : limits, in its SI unit. upwash, five_hole : as of
    `AirData`; None: as without this configuration.
    """

    channel: str
    above: float = -np.inf
    below: float = np.inf
    upwash: tuple[Number, Number] | None = None
    five_hole: FiveHole | None = None

    @model_validator(mode="before")
    @classmethod
    def _in_the_unit_of_the_channel(cls, data: Any) -> Any:
        if not isinstance(data, dict) or not isinstance(data.get("channel"), str):
            return data
        limits = {
            key: _converted(data["channel"], data[key]) for key in ("above", "below") if key in data
        }
        return {**data, **limits}

    @model_validator(mode="after")
    def _tells_something(self) -> Self:
        try:
            channel(self.channel)
        except UnknownNameError as error:
            raise ValueError(f"{error.what}; {error.remedy}") from None
        if not self.above < self.below or np.isinf([self.above, self.below]).all():
            raise ValueError("state above, below or both, above the lower one")
        if self.upwash is None and self.five_hole is None:
            raise ValueError("it changes nothing: state upwash or five_hole")
        return self


class AirData(Strict):
    """Installation and calibration of the air-data probe.

    orientation : roll, pitch and yaw of the boom relative to the body axes [rad] (3-2-1, pitch nose
    up). upwash : for alpha and beta, the fraction by which the flow angle at the probe exceeds that
    of the free stream. beta : ``sideslip`` asin(v/V), or ``flank`` angle atan2(v, u) as measured by
    a free vane. five_hole : calibration of a five-hole probe's raw pressures. configurations : in
    which these differ; the first that holds counts.
    """

    orientation: tuple[Radians, Radians, Radians] = (0.0, 0.0, 0.0)
    upwash: tuple[Number, Number] = (0.0, 0.0)
    beta: Literal["sideslip", "flank"] = "sideslip"
    five_hole: FiveHole | None = None
    configurations: list[ProbeConfiguration] = []

    @model_validator(mode="after")
    def _holes_without_configuration(self) -> Self:
        if self.five_hole is None and any(each.five_hole for each in self.configurations):
            raise ValueError("state five_hole of the probe without a configuration too")
        return self

    def alternatives(self) -> tuple["AirData", ...]:
        """Return the probe as it is without configurations, then in each (a tuple of c + 1)."""
        plain = self.model_copy(update={"configurations": []})
        return (plain, *(plain.model_copy(update=_changed(each)) for each in self.configurations))


def _changed(given: ProbeConfiguration) -> dict[str, Any]:
    both = {"upwash": given.upwash, "five_hole": given.five_hole}
    return {name: value for name, value in both.items() if value is not None}


class LogSource(Strict):
    """Topic, field and unit of a channel in the log, for channels that the mapping cannot know."""

    topic: str
    field: str
    unit: str = ""


class Hinge(Strict):
    """What makes the moment of the air about a surface's hinge a coefficient, and where it is
    logged.

    area [m2], chord [m] : of the surface behind its hinge line. log : place of the hinge moment, or
    of the force on the control; without it, the mapping's channel ``hinge_moment_<name>`` is used.
    gearing [m] : hinge moment of the air over that force, with its sign; None: `log` is the moment.
    """

    area: Annotated[float, in_unit("m^2"), Field(gt=0)]
    chord: Annotated[float, in_unit("m"), Field(gt=0)]
    log: LogSource | None = None
    gearing: Metres | None = None

    @model_validator(mode="after")
    def _geared(self) -> Self:
        if self.gearing is not None and (self.log is None or not self.log.unit):
            raise ValueError("gearing needs the place and the unit of the force in log")
        if self.gearing == 0.0:
            raise ValueError("gearing is 0: no force tells of the moment")
        return self


#: Limit of a deflection; infinite of what is only said to be beyond its range.
Limit = Annotated[float, in_unit("rad")]


class Surface(Strict):
    """A control surface: its deflection limits, the calibration of logged commands, and its hinge.

    ``deflection = offset + scale * command``, then a first-order lag with time constant `lag` [s].
    `log` names the field in the log; without it, the mapping's channel ``delta_<name>`` is used.
    """

    limits: tuple[Limit, Limit]
    scale: Radians = 1.0
    offset: Radians = 0.0
    lag: Seconds = 0.0
    log: LogSource | None = None
    convention: str = "trailing edge down positive"
    hinge: Hinge | None = None

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if not self.limits[0] < self.limits[1]:
            raise ValueError("limits must be (lower, upper)")
        return self


class LoggedRotor(Strict):
    """Where the command or the speed of a rotor is logged, for its channel ``command_<name>``.

    range : logged values that are commands of 0 and 1 [unit of the log], such as the pulses
    [1100, 1900] or revolutions per minute [0, 9000]. lag [s] : of a first-order lag from the
    command to the speed. reversible : whether it turns backwards, down to a command of -1.
    """

    log: LogSource
    range: tuple[Number, Number] = (0.0, 1.0)
    lag: Seconds = 0.0
    reversible: bool = False

    @model_validator(mode="after")
    def _ranged(self) -> Self:
        if self.range[0] == self.range[1]:
            raise ValueError("range must be two different logged values")
        return self

    @property
    def calibration(self) -> Surface:
        """From what is logged to the command: scale and offset are scalars, without unit."""
        scale = 1.0 / (self.range[1] - self.range[0])
        limits = (-math.inf if self.reversible else 0.0, math.inf)  # what is beyond is said
        return Surface(limits=limits, scale=scale, offset=-scale * self.range[0], lag=self.lag)


class Fuel(Strict):
    """Fuel on board, for logs without the channel ``fuel_mass``.

    initial : mass when the counters of fuel used stood at zero, or at the first sample [kg].
    used : engine -> where the mass that it has used is logged. flow : engine -> where its mass flow
    is logged, which is integrated where `used` is not logged.
    """

    initial: Kilograms
    used: dict[SourceName, LogSource] = {}
    flow: dict[SourceName, LogSource] = {}

    @property
    def channels(self) -> dict[str, LogSource]:
        """Logged channel -> its place in the log."""
        used = {f"fuel_used_{engine}": place for engine, place in self.used.items()}
        return used | {f"fuel_flow_{engine}": place for engine, place in self.flow.items()}

    @model_validator(mode="after")
    def _stated(self) -> Self:
        if not self.channels:
            raise ValueError("[fuel] needs `used` or `flow` of each engine")
        return self


class Combination(Strict):
    """A combined deflection of a right and a left surface.

    Symmetric (R + L)/2 or asymmetric (R - L)/2, as in "Data Analysis of Phoenix Reusable Launch
    Vehicle Demonstrator Flight Test", eq. 6.
    """

    kind: Literal["symmetric", "asymmetric"]
    right: str
    left: str


class ThrustLine(Strict):
    """A thrust acts along `direction` through `point` [m], in body axes from the datum."""

    direction: tuple[Number, Number, Number] = (1.0, 0.0, 0.0)
    point: Point | None = None


class Thrust(ThrustLine):
    """Thrust: none, unknown (flagged), or logged [N].

    ``source = "channel"``: the total is logged as ``thrust`` and acts on one line; with `engines`,
    each engine is logged as ``thrust_<name>`` and has a line of its own.
    """

    source: Literal["none", "unknown", "channel"] = "none"
    engines: dict[str, ThrustLine] = {}

    @property
    def lines(self) -> dict[str, ThrustLine]:
        """Logged channel [N] -> its line: point [m] and direction, (3,) each in body axes."""
        return {f"thrust_{name}": line for name, line in self.engines.items()} or {"thrust": self}

    @model_validator(mode="after")
    def _either(self) -> Self:
        if self.engines and self.source != "channel":
            raise ValueError('engines are logged: they need source = "channel"')
        if self.engines and self.point is not None:
            raise ValueError("point of the total thrust beside engines; give each engine its own")
        return self


class NavigationSource(Strict):
    """A navigation solution other than the one that the mapping takes (INS, DGPS, an on-board
    filter): where its velocities and positions are in the log, and the point [m] they belong to, in
    body axes from the datum (None: the CG)."""

    velocity_north: LogSource | None = None
    velocity_east: LogSource | None = None
    velocity_down: LogSource | None = None
    north: LogSource | None = None
    east: LogSource | None = None
    altitude: LogSource | None = None
    point: Point | None = None

    @property
    def channels(self) -> dict[str, LogSource]:
        """Logged channel, without the source's name, -> its place in the log."""
        places = {
            "velocity_north": self.velocity_north,
            "velocity_east": self.velocity_east,
            "velocity_down": self.velocity_down,
            "north": self.north,
            "east": self.east,
            "altitude": self.altitude,
        }
        return {name: place for name, place in places.items() if place is not None}


class Sensor(Strict):
    """Standard deviations of a sensor, in the channel's SI unit.

    noise : of its white noise. bias_prior, delay_prior [s] : of the prior of its bias and delay.
    """

    noise: Number = Field(default=0.0, ge=0)
    bias_prior: Number = Field(default=0.0, ge=0)
    delay_prior: Seconds = 0.0


class Measured(Strict):
    """How well a mass property, the thrust, a deflection or an error of a sensor was measured
    outside flight.

    The section is named like the quantity, or like the error as reports name it (``alpha_delay``,
    ``delta_elevator_scale``). sigma : one standard deviation; of cg_x, cg_y and cg_z in m, of an
    error in its unit, of all others as a share. by : how and when, for reports.
    """

    sigma: Annotated[float, Field(gt=0)]
    by: str = ""


class Accuracy(Strict):
    """Limits of the consistency verdict.

    Defaults are those of the Phoenix flight tests ("Data Analysis of Phoenix Reusable Launch
    Vehicle Demonstrator Flight Test", section III): docs/reference/conventions.md, "Consistency
    verdicts". That paper states none for climb rate and altitude; theirs are those of the
    horizontal velocity and position.
    """

    attitude: Radians = float(np.deg2rad(0.3))
    flow_angle: Radians = float(np.deg2rad(0.5))
    horizontal_velocity: Annotated[float, in_unit("m/s")] = 0.8
    climb_rate: Annotated[float, in_unit("m/s")] = 0.8
    lateral_position: Metres = 10.0
    altitude: Metres = 10.0
    qbar_fraction: Number = 0.02


class Processing(Strict):
    """Rate of the uniform grid and smoothing bandwidth of the rates, both in Hz.

    rate : None for the own rate of the fastest inertial topic.
    """

    rate: Annotated[float, in_unit("Hz"), Field(gt=0)] | None = None
    bandwidth: Annotated[float, in_unit("Hz"), Field(gt=0)] | None = None


class VerticalAir(Strict):
    """Prior of the slow vertical motion of the air: standard deviation [m/s] and time constant [s].

    The standard deviation is what to expect before a flight (half-normal prior); the flight's own
    residuals say how much it was. .5 m/s is usual in the boundary layer of a day with weak
    convection: .6 of a convective velocity scale of .8 m/s (Stull, An Introduction to Boundary
    Layer Meteorology, 1988), over some km of path. Faster gusts are the smoother's. At 20 m/s this
    is 1.4 deg of angle of attack: slow aircraft need a minute of calm air, or several flights, for
    their vanes. 0: the air stands still.
    """

    sigma: Annotated[float, in_unit("m/s"), Field(ge=0)] = 0.5
    time: Annotated[float, in_unit("s"), Field(ge=1)] = 30.0


class Vehicle(Strict):
    """Contents of a vehicle file."""

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,62}$")
    description: str = ""
    reference: Reference
    points: Points
    mass: MassProperties
    surfaces: dict[str, Surface] = {}
    combinations: dict[str, Combination] = {}
    rotors: dict[Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9_]*$")], LoggedRotor] = {}
    thrust: Thrust = Field(default_factory=Thrust)
    sensors: dict[str, Sensor] = {}
    accuracy: Accuracy = Field(default_factory=Accuracy)
    processing: Processing = Field(default_factory=Processing)
    air_data: AirData = Field(default_factory=AirData)
    vertical_air: VerticalAir = Field(default_factory=VerticalAir)
    configuration: dict[str, Number] = {}
    measured: dict[str, Measured] = {}
    navigation: dict[SourceName, NavigationSource] = {}
    fuel: Fuel | None = None

    def __repr__(self) -> str:
        own = self.reference
        return f"<Vehicle {self.name!r}: S {own.area:g} m2, c {own.chord:g} m, b {own.span:g} m>"

    @model_validator(mode="before")
    @classmethod
    def _channel_units(cls, data: Any) -> Any:
        """Convert noise, priors and fixed channels to the SI unit of the channel they belong to."""
        if not isinstance(data, dict):
            return data
        sensors = data.get("sensors", {})
        if isinstance(sensors, dict):
            sensors = {
                name: _in_unit_of(name, entry) if isinstance(entry, dict) else entry
                for name, entry in sensors.items()
            }
        configuration = data.get("configuration", {})
        if isinstance(configuration, dict):
            configuration = {name: _converted(name, value) for name, value in configuration.items()}
        measured = data.get("measured", {})
        if isinstance(measured, dict):
            measured = {
                name: {**entry, "sigma": _sigma_of(name, entry["sigma"])}
                if isinstance(entry, dict) and "sigma" in entry
                else entry
                for name, entry in measured.items()
            }
        made = {"sensors": sensors, "configuration": configuration, "measured": measured}
        return {**data, **{name: made[name] for name in made if name in data}}

    @model_validator(mode="after")
    def _names(self) -> Self:
        for combination in self.combinations.values():
            for side in (combination.right, combination.left):
                if side not in self.surfaces:
                    raise ValueError(
                        f"combination uses surface '{side}', which is not declared;"
                        f" {nearest(side, self.surfaces)}"
                    )
        for name in self.measured:
            known = name in (*_MEASURABLE, *_POSITION) or is_surface(name)
            if not known and _of_error(name) == name:
                raise ValueError(
                    f"'{name}' in [measured] is no mass property, thrust or deflection, and no"
                    f" error of a sensor; {nearest(name, _MEASURABLE)}"
                )
        quantities = (_of_error(name) for name in self.measured if name not in _POSITION)
        for name in (*self.configuration, *self.sensors, *quantities, *self.thrust.lines):
            try:
                channel(name)
            except UnknownNameError as error:
                raise ValueError(f"{error.what}; {error.remedy}") from None
        return self


def _converted(name: str, value: Any) -> Any:
    try:
        return quantity(value, channel(name).unit) if isinstance(value, str) else value
    except UnknownNameError:
        return value  # `_names` refuses the unknown name later, with the nearest known one


def _of_error(name: str) -> str:
    """The channel that an error is one of; the name itself where it is no error."""
    end = next((end for end in _ERRORS if name.endswith(end)), "")
    return name.removesuffix(end)


def _sigma_of(name: str, value: Any) -> Any:
    if not isinstance(value, str):
        return value
    if name.startswith("cg_") or name in _POSITION:
        return quantity(value, "m")
    if name.endswith("_delay"):
        return quantity(value, "s")
    if name.endswith(("_bias", "_offset")):
        return _converted(_of_error(name), value)
    return quantity(value, "")


def _in_unit_of(name: str, entry: dict[str, Any]) -> dict[str, Any]:
    return {
        key: _converted(name, value) if key in ("noise", "bias_prior") else value
        for key, value in entry.items()
    }


def with_measured(vehicle: Vehicle, stated: Sequence[str]) -> Vehicle:
    """Return the vehicle with more entries in ``[measured]``, which replace those of the same name.

    stated : ``NAME=SIGMA`` each, with a unit if there is one, and after a comma by what it was
    measured: ``"cg_x=3 mm, weighed 2026-03-01"``. Raises InputError for text of another form and
    for what `Measured` cannot state.
    """
    entries: dict[str, Any] = {name: entry.model_dump() for name, entry in vehicle.measured.items()}
    for text in stated:
        name, equals, rest = text.partition("=")
        sigma, _, by = (part.strip() for part in rest.partition(","))
        if not equals or not sigma:
            raise InputError(
                f"'{text}' states no measurement", "measured", 'write "cg_x=3 mm, weighed"'
            )
        try:
            entries[name.strip()] = {"sigma": float(sigma), "by": by}
        except ValueError:
            entries[name.strip()] = {"sigma": sigma, "by": by}
    data = {**vehicle.model_dump(), "measured": entries}
    return validated(Vehicle, data, "measured")


def full_travels(vehicle: Vehicle) -> dict[str, float]:
    """Return the full travel of each surface and combination [rad]; of a combination that of its
    right surface."""
    own = {name: max(map(abs, each.limits)) for name, each in vehicle.surfaces.items()}
    return {name: own[each.right] for name, each in vehicle.combinations.items()} | own


def parse_vehicle(text: str, where: str = "vehicle file") -> Vehicle:
    """Return the Vehicle that a TOML text describes.

    Raises InputError with the key, the reason and the nearest known key.

    Keys: `docs/reference/conventions.md`, section "Vehicle file"; values are SI.
    """
    return validated_toml(Vehicle, text, where)
