"""Matrices that Mission Planner converts a DataFlash log into (``.mat``): one per message, its
columns named beside it, as ArduPilot logs them.

Units: LogStructure.h of ArduPilot; the converter writes degrees and SI as in the text form.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.recording import Topic

#: Unit -> fields of messages that have it.
_UNITS: Final = {
    "deg": (
        *("ATT.Roll", "ATT.Pitch", "ATT.Yaw", "ATT.DesRoll", "ATT.DesPitch", "ATT.DesYaw"),
        *("GPS.Lat", "GPS.Lng", "POS.Lat", "POS.Lng", "GPS.GCrs", "AHR2.Roll", "AHR2.Pitch"),
        *("AHR2.Yaw", "XKF1.Roll", "XKF1.Pitch", "XKF1.Yaw", "NKF1.Roll", "NKF1.Pitch", "NKF1.Yaw"),
    ),
    "rad/s": ("IMU.GyrX", "IMU.GyrY", "IMU.GyrZ"),
    "m/s^2": ("IMU.AccX", "IMU.AccY", "IMU.AccZ"),
    "m/s": (
        *("ARSP.Airspeed", "GPS.Spd", "GPS.VZ", "XKF1.VN", "XKF1.VE", "XKF1.VD", "NKF1.VN"),
        *("NKF1.VE", "NKF1.VD"),
    ),
    "m": ("GPS.Alt", "POS.Alt", "BARO.Alt"),
    "Pa": ("BARO.Press", "ARSP.DiffPress"),
    "us": ("*.TimeUS",),
}
_UNIT_OF: Final = {name: unit for unit, names in _UNITS.items() for name in names}
#: Number of an instance behind the name of a message.
_INSTANCE: Final = re.compile(r"([A-Z][A-Z0-9]*)[_\[](\d)\]?")
#: Messages by which the mapping of DataFlash logs knows them.
_DETECTED: Final = {"IMU", "ATT"}


def is_converted(topics: Mapping[str, Topic]) -> bool:
    """Return whether topics are messages that Mission Planner converted: numbered lines of the log
    and a time in us."""
    return any({"LineNo", "TimeUS"} <= set(topic.fields) for topic in topics.values())


def converted(topics: Mapping[str, Topic]) -> tuple[dict[str, Topic], bool]:
    """Return such topics with ArduPilot's names and units, and whether they are enough for the
    mapping of DataFlash logs; then their time is `TimeUS` [s], else the number of the sample."""
    named = {}
    for name, topic in topics.items():
        found = _INSTANCE.fullmatch(name)
        message = found[1] if found else name
        own = f"{message}.{found[2]}" if found and found[2] != "0" else message
        units = {
            field: unit
            for field in topic.fields
            if (unit := _UNIT_OF.get(f"{message}.{field}") or _UNIT_OF.get(f"*.{field}"))
        }
        named[own] = replace(topic, name=own, units={**units, **topic.units})
    timed = {
        name: replace(topic, time=np.asarray(topic.fields["TimeUS"], np.float64) * 1e-6)
        for name, topic in named.items()
        if "TimeUS" in topic.fields
    }
    is_log = timed.keys() >= _DETECTED
    return (timed, True) if is_log else (named, False)
