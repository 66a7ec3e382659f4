"""The small glider's flights as ULogs of PX4, and the vehicle file that such logs need."""

from pathlib import Path

import numpy as np

from aerodb.recording import Topic
from aerodb.storage.writers.ulog import write_ulog
from tests.support.small_glider import RHO, VEHICLE, channels

LARGEST = np.deg2rad(25.0)

#: The small glider with its accelerometer at the CG and the elevator's command in its log.
ULOG_VEHICLE = VEHICLE.replace(
    'moment_reference = "cg"', 'moment_reference = "cg"\nimu = "cg"'
).replace(
    '[surfaces.elevator]\nlimits = ["-25 deg", "25 deg"]\n',
    '[surfaces.elevator]\nlimits = ["-25 deg", "25 deg"]\nscale = "25 deg"\nlag = 0.0\n'
    'log = { topic = "actuator_servos", field = "control[0]" }\n',
)


def write_glider_ulog(path: Path, seed: int, seconds: float, rate: float = 50.0) -> None:
    """A flight of `small_glider.channels`, an hour after the autopilot started."""
    flown = channels(seed, seconds, rate)
    time = 3600.0 + flown["time"]
    slow = slice(None, None, 5)
    topics = [
        Topic("vehicle_angular_velocity", time, _xyz(flown, "p", "q", "r")),
        Topic("vehicle_acceleration", time, _xyz(flown, "ax", "ay", "az")),
        Topic("airflow_aoa", time, {"aoa_rad": flown["alpha"].astype(np.float32)}),
        Topic("airflow_slip", time, {"slip_rad": flown["beta"].astype(np.float32)}),
        Topic(
            "airspeed_validated",
            time[slow],
            {"true_airspeed_m_s": flown["V"][slow].astype(np.float32)},
        ),
        Topic("vehicle_air_data", time[slow], {"rho": np.full(len(time[slow]), RHO, np.float32)}),
        Topic(
            "actuator_servos",
            time,
            {"control[0]": (flown["delta_elevator"] / LARGEST).astype(np.float32)},
        ),
    ]
    write_ulog(path, topics, metadata={"sys_name": "PX4"})


def _xyz(flown: dict[str, np.ndarray], *names: str) -> dict[str, np.ndarray]:
    return {f"xyz[{k}]": flown[name].astype(np.float32) for k, name in enumerate(names)}
