"""Generator of a long log with the topics of a fixed-wing PX4 flight, for benchmarks. Size and
rates are realistic, the physics is not."""

from collections.abc import Iterator

import numpy as np

from aerodb.recording import Topic

# name, rate [Hz], fields: together about 140 kB per second of flight in 40 topics.
_CORE: tuple[tuple[str, float, tuple[str, ...]], ...] = (
    ("vehicle_angular_velocity", 100.0, ("xyz[0]", "xyz[1]", "xyz[2]")),
    ("vehicle_acceleration", 100.0, ("xyz[0]", "xyz[1]", "xyz[2]")),
    ("vehicle_attitude", 100.0, ("q[0]", "q[1]", "q[2]", "q[3]")),
    ("airspeed_validated", 100.0, ("calibrated_airspeed_m_s", "true_airspeed_m_s")),
    ("airflow_aoa", 100.0, ("aoa_rad",)),
    ("airflow_slip", 100.0, ("slip_rad",)),
    (
        "vehicle_air_data",
        50.0,
        ("rho", "baro_pressure_pa", "baro_alt_meter", "ambient_temperature"),
    ),
    ("vehicle_local_position", 50.0, ("x", "y", "z", "vx", "vy", "vz")),
    ("vehicle_torque_setpoint", 100.0, ("xyz[0]", "xyz[1]", "xyz[2]")),
)
_FILLERS = 31
_LEVEL = {
    "xyz[2]": -9.8,
    "q[0]": 1.0,
    "calibrated_airspeed_m_s": 28.0,
    "true_airspeed_m_s": 30.0,
    "aoa_rad": 0.05,
    "rho": 1.1,
    "baro_pressure_pa": 9e4,
    "baro_alt_meter": 1000.0,
    "ambient_temperature": 12.0,
    "vx": 30.0,
}


def generated_topics(duration: float, seed: int = 0) -> Iterator[Topic]:
    """40 topics over `duration` [s]: nine that a PX4 flight is made of, and fillers; about 140 kB
    per second.

    An hour makes about 500 MB in 6.9 million messages. Values are smooth with float32 noise.
    """
    generator = np.random.default_rng(seed)
    fillers = [
        (f"filler_{k}", 100.0 if k < 9 else 10.0, tuple(f"value[{i}]" for i in range(24)))
        for k in range(_FILLERS)
    ]
    for name, rate, fields in (*_CORE, *fillers):
        time = np.arange(1, int(duration * rate) + 1) / rate
        wave = np.sin(0.3 * time).astype(np.float32)
        noise = generator.standard_normal(len(time), dtype=np.float32)
        values = {}
        for k, field in enumerate(fields):
            level = (
                0.0
                if name != "vehicle_acceleration" and field.startswith("xyz")
                else _LEVEL.get(field, 0.0)
            )
            values[field] = (
                np.float32(level)
                + np.float32(0.05) * wave
                + np.float32(0.002) * np.roll(noise, 7 * k)
            )
        yield Topic(name, time, values)
