"""The instruments of the example vehicle, as the topics and fields of a PX4 log.

Noise is that of vehicle.toml. Biases are drawn once per vehicle from the priors of vehicle.toml.
Time stamps have no jitter. Not simulated: scale-factor errors, misalignment, and quantisation
beyond float32.
"""

import numpy as np

from aerodb.simulation import History, Instrument, SensorSignal
from aerodb.support import Array
from aerodb.vehicle import Vehicle

SERVOS = (
    *(
        "elevon_outboard_right",
        "elevon_outboard_left",
        "elevon_inboard_right",
        "elevon_inboard_left",
    ),
    *("rudder", "body_flap", "speed_brake"),
)


def instruments(vehicle: Vehicle, generator: np.random.Generator) -> tuple[Instrument, ...]:
    """Return all topics of a log.

    Biases are uniform within the prior's sigma: the vehicle is calibrated, not faulty.

    vehicle : its sensors, with noise and prior of bias, SI, and of delay [s]. Raises KeyError where
    one is not declared.
    """

    def signal(
        field: str, channel: str, sensor: str, scale: float = 1.0, offset: float = 0.0
    ) -> SensorSignal:
        declared = vehicle.sensors[sensor]
        bias = declared.bias_prior * generator.uniform(-1.0, 1.0)
        return SensorSignal(field, channel, declared.noise, bias, scale, offset)

    def delay(sensor: str) -> float:
        return vehicle.sensors[sensor].delay_prior * generator.uniform(0.5, 1.0)

    # A small rotation changes the quaternion by half its angle.
    half = 0.5 * vehicle.sensors["phi"].noise
    velocity = zip(
        ("vx", "vy", "vz"), ("velocity_north", "velocity_east", "velocity_down"), strict=True
    )
    return (
        Instrument(
            "vehicle_angular_velocity",
            100.0,
            tuple(signal(f"xyz[{n}]", x, x) for n, x in enumerate("pqr")),
        ),
        Instrument(
            "vehicle_acceleration",
            100.0,
            tuple(signal(f"xyz[{n}]", f"a{x}_imu", f"a{x}_imu") for n, x in enumerate("xyz")),
        ),
        Instrument(
            "vehicle_attitude",
            50.0,
            tuple(SensorSignal(f"q[{n}]", f"q{n}", half) for n in range(4)),
            phase=0.003,
        ),
        Instrument(
            "airspeed_validated",
            50.0,
            (
                signal("true_airspeed_m_s", "V_probe", "V"),
                signal("calibrated_airspeed_m_s", "calibrated_airspeed", "V"),
            ),
            delay("V"),
            0.004,
        ),
        Instrument(
            "airflow_aoa",
            100.0,
            (signal("aoa_rad", "alpha_probe", "alpha"),),
            delay("alpha"),
            0.002,
        ),
        Instrument(
            "airflow_slip", 100.0, (signal("slip_rad", "beta_probe", "beta"),), delay("beta"), 0.002
        ),
        Instrument(
            "vehicle_air_data",
            20.0,
            (
                signal("rho", "rho", "rho"),
                signal("baro_pressure_pa", "static_pressure", "static_pressure"),
                signal("ambient_temperature", "temperature", "temperature", offset=-273.15),
                signal("baro_alt_meter", "altitude", "altitude"),
            ),
            phase=0.007,
        ),
        Instrument(
            "vehicle_local_position",
            20.0,
            (
                signal("x", "north", "north"),
                signal("y", "east", "east"),
                signal("z", "height_above_ground", "altitude", scale=-1.0),
                *(signal(field, channel, channel) for field, channel in velocity),
                signal("dist_bottom", "height_above_ground", "height_above_ground"),
            ),
            delay("north"),
            0.001,
        ),
        Instrument(
            "actuator_servos",
            100.0,
            tuple(SensorSignal(f"control[{n}]", f"servo_{n}", held=True) for n in range(8)),
        ),
        Instrument(
            "landing_gear",
            50.0,
            (SensorSignal("landing_gear", "gear_command", dtype="int8", held=True),),
        ),
    )


def servo_channels(vehicle: Vehicle, history: History) -> dict[str, Array]:
    """Return the channels (n, k) of normalised commands and attitude.

    ``servo_0 .. servo_7`` are the commands within the limits (the last is not connected: nan, as in
    PX4 logs), ``gear_command`` is 1 up or -1 down, and ``q0 .. q3`` is the attitude quaternion.
    """
    channels = {}
    for number, name in enumerate(SERVOS):
        surface = vehicle.surfaces[name]
        commanded = np.clip(history.commands[name], *surface.limits)
        channels[f"servo_{number}"] = (commanded - surface.offset) / surface.scale
    gear = vehicle.surfaces["landing_gear"]
    channels["servo_7"] = np.full_like(channels["servo_0"], np.nan)
    channels["gear_command"] = (history.commands["landing_gear"] - gear.offset) / gear.scale
    channels |= {f"q{n}": history.quaternion[:, n] for n in range(4)}
    return channels


def lags(vehicle: Vehicle, generator: np.random.Generator) -> dict[str, float]:
    """Return the lags [s] of the air-data sensors that `instruments` draws, by sensor parameter."""
    return {
        f"{signal.channel.removesuffix('_probe')}_delay": instrument.delay
        for instrument in instruments(vehicle, generator)
        for signal in instrument.signals
        if signal.channel.endswith("_probe")
    }
