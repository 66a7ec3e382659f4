"""Choose the parameters that a reconstruction estimates, from the logged channels and the vehicle
file."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from aerodb.consistency.kinematics import INPUTS
from aerodb.consistency.outlook import TURN, turn_of
from aerodb.consistency.pressures import HOLES
from aerodb.consistency.sensors import AIR_DATA, PER_FLIGHT, FlightRecord, channels_of, parameter
from aerodb.remarks import Remark
from aerodb.vehicle import Accuracy, Sensor, Vehicle, VerticalAir

#: Prior of initial states, in natural sizes: they start from noisy first samples.
_START = 10.0

#: Prior of winds and weather, in natural sizes.
_WINDY = 5.0

#: Smallest credible noise of a channel, and smallest effect on it that is looked at, as a fraction
#: of its accuracy limit.
TRUST: Final = 0.2

#: Noise (SI) of a channel that has left the estimate: none of its samples weighs anything.
NO_WEIGHT: Final = 1e4

_EARTH: Final = ("velocity_north", "velocity_east", "velocity_down", "north", "east")


@dataclass(frozen=True)
class ReconstructionPlan:
    """What a reconstruction estimates.

    free : names of the sensor parameters and winds to estimate.
    initial : states whose initial value is estimated, per record.
    stated_priors : name -> standard deviation about zero, SI, from the vehicle file, and for the
        biases of inertial sensors and vanes in any case. These are always kept; all other
        parameters only where they are significant.
    not_estimated : what could not be estimated and why, in sentences.
    moving_air : whether parameters were left out because the air moved.
    noise_floor : channel -> smallest credible noise (one sigma), SI.
    declared_noise : channel -> white noise of its sensor as the vehicle file declares it (one
        sigma), SI.
    removed : parameter that was estimated and removed as insignificant -> its estimate and
        standard error before, SI.
    left_out : channel that has left the estimate -> its rms disagreement before, SI.
    doubtful : parameters that only a channel determines which disagrees grossly, and which stays
        because of them.
    remarks : what else the estimates say of the sensors, in sentences.
    misplaced : where the vanes seem to be, in a sentence; empty: where the vehicle file says.
    beyond : errors as large as they may be, which no serviceable sensor has, and which are removed.
    vertical_air : prior of the vertical motion of the air.
    """

    free: tuple[str, ...]
    initial: tuple[str, ...]
    stated_priors: Mapping[str, float]
    not_estimated: tuple[str, ...]
    moving_air: bool = False
    noise_floor: Mapping[str, float] = field(default_factory=dict)
    declared_noise: Mapping[str, float] = field(default_factory=dict)
    removed: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    left_out: Mapping[str, float] = field(default_factory=dict)
    doubtful: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    misplaced: str = ""
    beyond: tuple[Remark, ...] = ()
    vertical_air: VerticalAir = field(default_factory=lambda: VerticalAir(sigma=0.0))

    @property
    def priors(self) -> dict[str, float]:
        """Name -> weak prior (standard deviation about zero, a scalar in SI units) for every
        estimated parameter: several natural sizes for initial states and winds, one for sensors."""
        sizes = {
            name: parameter(name).size * (_WINDY if parameter(name).kind in PER_FLIGHT else 1.0)
            for name in self.free
        }
        return sizes | {
            f"initial_{name}": _START * parameter(f"initial_{name}").size for name in self.initial
        }

    @property
    def bounds(self) -> dict[str, tuple[float, float]]:
        """Bounds of scales [-] and delays [s]; a value beyond them means some other error."""
        bounded = [
            parameter(name) for name in self.free if parameter(name).kind in ("scale", "delay")
        ]
        return {item.name: (-item.size, item.size) for item in bounded}

    def only(self, names: Collection[str]) -> "ReconstructionPlan":
        """Return the plan with these parameters alone, and with those of the flight (wind,
        weather)."""
        return replace(
            self,
            free=tuple(
                name for name in self.free if name in names or parameter(name).kind in PER_FLIGHT
            ),
        )

    def without(
        self, names: Collection[str], remarks: Sequence[str] = (), misplaced: str = ""
    ) -> "ReconstructionPlan":
        """Return the plan without these parameters, with remarks on why, and where the vanes seem
        to be."""
        return replace(
            self,
            free=tuple(name for name in self.free if name not in names),
            remarks=(*self.remarks, *remarks),
            misplaced=misplaced or self.misplaced,
        )

    def with_noise_floor(self, noise_floor: Mapping[str, float]) -> "ReconstructionPlan":
        """Return the plan with a noise floor (channel -> one sigma, a scalar in SI units) added; a
        channel that has left the estimate stays out."""
        added = {name: size for name, size in noise_floor.items() if name not in self.left_out}
        return replace(self, noise_floor={**self.noise_floor, **added})

    def without_channel(self, name: str, disagreement: float) -> "ReconstructionPlan":
        """The plan in which a channel has no weight and its own errors are not sought.

        disagreement : rms of its residual while it had weight, SI.

        Its noise floor becomes `NO_WEIGHT`.
        """
        own = [each for each in self.free if channels_of(each) == (name,)]
        return replace(
            self,
            free=tuple(each for each in self.free if each not in own),
            stated_priors={
                each: sigma for each, sigma in self.stated_priors.items() if each not in own
            },
            noise_floor={**self.noise_floor, name: NO_WEIGHT},
            left_out={**self.left_out, name: disagreement},
        )

    def in_moving_air(self) -> "ReconstructionPlan":
        """Return the plan without delays and scales of the air data. Port errors stay: turns and
        the altitude show them."""
        shape = ("scale", "delay", "probe")
        late = [
            name
            for name in self.free
            if set(channels_of(name)) & set(AIR_DATA) and parameter(name).kind in shape
        ]
        late = [name for name in late if not name.endswith("_offset")]
        sentence = (
            "turbulence: delays and scales of the air data are not estimated, as the response to"
            " gusts looks like them"
        )
        rest = tuple(name for name in self.free if name not in late)
        return replace(
            self,
            free=rest,
            moving_air=True,
            not_estimated=(*self.not_estimated, sentence) if late else self.not_estimated,
        )

    def with_calibration(
        self, names: Sequence[str], logged: Collection[str]
    ) -> "ReconstructionPlan":
        """Return the plan with the parameters `names` of a calibration whose channels are logged,
        and those for which the vehicle file states a prior. Raises UnknownNameError for a name that
        is no parameter."""
        shown = {*INPUTS, *logged} - set(self.left_out)
        known = [name for name in names if set(channels_of(name)) & shown]
        own = [
            name
            for name in self.free
            if parameter(name).kind in PER_FLIGHT or name in self.stated_priors
        ]
        plan = replace(self, free=tuple(dict.fromkeys([*known, *own])))
        return plan.in_moving_air() if self.moving_air else plan


def make_plan(records: Sequence[FlightRecord], vehicle: Vehicle) -> ReconstructionPlan:
    """Return the plan for records of one or several flights of a vehicle.

    Which parameters are free follows from the channels that any record has and from whether a
    record turns; priors and noise come from the vehicle file.

    Priors and noise floors are in the unit of their channel ([rad/s], [m/s²], [rad], [m/s], [Pa]),
    delays in [s]. Source: `docs/method/consistency.md`, section "Model".
    """
    logged = {name for record in records for name in record.outputs}
    earth = any(name in logged for name in _EARTH)
    turned = earth and any(_turned(record) for record in records)
    wanted = [f"{name}_bias" for name in INPUTS]
    wanted += [
        f"{name}_{kind}"
        for name in ("alpha", "beta")
        if name in logged
        for kind in ("bias", "scale", "delay")
    ]
    for pair in (pair for pair in HOLES if pair in logged):
        wanted += [*_calibration(HOLES[pair], records), f"{pair}_delay"]
    wanted += _airspeed(logged, turned)
    wanted += _late(logged, vehicle)
    stated_priors = {}
    for name in (*INPUTS, *sorted(logged)):
        sensor = _sensor(vehicle, name)
        if sensor.bias_prior > 0 and not (
            name in ("north", "east", "altitude") or (name == "psi" and not earth)
        ):
            stated_priors[f"{name}_bias"] = sensor.bias_prior
        if sensor.delay_prior > 0 and name in logged:
            stated_priors[f"{name}_delay"] = sensor.delay_prior
    winds = ("wind_north", "wind_east") if earth and "V" in logged else ()
    weather = (
        ("pressure_altitude_bias", "pressure_altitude_scale")
        if "pressure_altitude" in logged
        else ()
    )
    initial = ["u", "v", "w", "phi", "theta"]
    initial += ["psi"] if earth or "psi" in logged else []
    initial += [name for name in ("north", "east", "altitude") if name in logged]
    for name in (
        *INPUTS,
        *(angle for angle in ("alpha", "beta") if angle in logged),
    ):  # each of these has a bias
        stated_priors.setdefault(f"{name}_bias", parameter(f"{name}_bias").size)
    for pair, angle in HOLES.items():  # and so has each pair of holes
        if pair in logged:
            stated_priors[f"probe_{angle}_offset"] = (
                _sensor(vehicle, angle).bias_prior or parameter(f"probe_{angle}_offset").size
            )
    least = _least_noise(vehicle.accuracy) | _least_pressures(records, vehicle.accuracy)
    noise_floor = {
        name: value for name, value in least.items() if _sensor(vehicle, name).noise == 0.0
    }
    free = tuple(dict.fromkeys([*wanted, *stated_priors, *winds, *weather]))
    return ReconstructionPlan(
        free,
        tuple(initial),
        stated_priors,
        _left_out(logged, earth, turned),
        noise_floor=noise_floor,
        declared_noise={name: _sensor(vehicle, name).noise for name in sorted(logged)},
        vertical_air=vehicle.vertical_air,
    )


def _calibration(angle: str, records: Sequence[FlightRecord]) -> list[str]:
    """Calibration parameters of a pair of holes; the bend only where the vehicle file has one."""
    probes = [record.installation.five_hole for record in records]
    bent = any(probe is not None and getattr(probe, angle).break_angle > 0 for probe in probes)
    return [
        f"probe_{angle}_{part}"
        for part in ("offset", "slope", "square", "cross", *(("bend",) if bent else ()))
    ]


def _airspeed(logged: Collection[str], turned: bool) -> list[str]:
    """Parameters of airspeed and dynamic pressure errors.

    Port errors where the pressure altitude shows the static port and another altitude is logged;
    otherwise a scale of each channel. All need a turn, to be separated from the wind.
    """
    if not turned:
        return []
    if "pressure_altitude" in logged and "V" in logged:
        return ["static_port_error", "total_port_error"]
    return [f"{name}_scale" for name in ("V", "qbar") if name in logged]


def _late(logged: Collection[str], vehicle: Vehicle) -> list[str]:
    """Delays of velocity over the earth and position: one common delay for a declared antenna, with
    one more for the altitude, which may be another sensor's; otherwise one per velocity."""
    if vehicle.points.gps is None or not any(name in logged for name in _EARTH):
        return [f"{name}_delay" for name in _EARTH[:3] if name in logged]
    return ["gps_delay", *(["altitude_delay"] if "altitude" in logged else [])]


def _least_pressures(records: Sequence[FlightRecord], accuracy: Accuracy) -> dict[str, float]:
    """Smallest credible noise of five-hole probe pressures: that of the flow angles at the mean
    dynamic pressure."""
    least: dict[str, float] = {}
    for record in records:
        probe, speed = record.installation.five_hole, record.outputs.get("V")
        if probe is not None and speed is not None and record.density is not None:
            q = float(np.nanmean(0.5 * record.density * speed**2))
            sizes = {
                pair: TRUST * accuracy.flow_angle * q * getattr(probe, angle).slope
                for pair, angle in HOLES.items()
            }
            least |= {pair: min(size, least.get(pair, size)) for pair, size in sizes.items()}
    return least


def _least_noise(accuracy: Accuracy) -> dict[str, float]:
    """Smallest credible noise of channels whose noise the vehicle file does not state: smooth
    residuals do not prove accuracy."""
    return {
        **dict.fromkeys(("phi", "theta", "psi"), TRUST * accuracy.attitude),
        **dict.fromkeys(("alpha", "beta"), TRUST * accuracy.flow_angle),
        **dict.fromkeys(
            ("velocity_north", "velocity_east", "velocity_down"),
            TRUST * accuracy.horizontal_velocity,
        ),
    }


def _sensor(vehicle: Vehicle, name: str) -> Sensor:
    sensor = vehicle.sensors.get(name) or vehicle.sensors.get(f"{name}_imu")
    return sensor if sensor is not None else Sensor()


def _turned(record: FlightRecord) -> bool:
    """Return whether the track turns far enough within a record to separate wind from airspeed
    error."""
    return turn_of(record.outputs) > TURN


def _left_out(logged: set[str], earth: bool, turned: bool) -> tuple[str, ...]:
    sentences = []
    if earth and not turned:
        sentences.append("no turn: the scale of the airspeed is not told from the wind")
    if not earth:
        sentences.append("no velocity or position over the earth: the wind is not estimated")
    for name, what in (("alpha", "angle of attack"), ("beta", "sideslip")):
        if name not in logged and f"probe_dp_{name}" not in logged:
            sentences.append(f"{what} is not measured")
    if "psi" not in logged:
        sentences.append("heading is not measured")
    return tuple(sentences)
