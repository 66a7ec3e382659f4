"""One channel of several sensors of a kind: that which the autopilot used at the time, or a healthy
one."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from aerodb.support import Array, Mask

Places = NDArray[np.intp]

#: Instance in the name of a topic: ``ARSP.1``; former firmware counted from 2, ``ASP2``.
_INSTANCE: Final = re.compile(r".*?(?:\.(?P<index>\d+)|(?P<number>[2-9]))")
#: Changes from sensor to sensor that are listed.
_LISTED: Final = 3


@dataclass(frozen=True)
class Sensor:
    """A sensor of a kind: its topic, clock [s] and values, (n,) each; healthy : (n,) mask."""

    topic: str
    time: Array
    values: Array
    healthy: Mask


def instance_of(topic: str) -> int:
    """Return which sensor of its kind a topic is of, from 0.

    >>> [instance_of(name) for name in ("ARSP", "ARSP.1", "ASP2")]
    [0, 1, 1]
    """
    match = _INSTANCE.fullmatch(topic)
    if match is None:
        return 0
    return int(match["index"]) if match["index"] else int(match["number"]) - 1


def chosen(sensors: Sequence[Sensor], primary: Array) -> tuple[Array, Places]:
    """Return the values (n,) on the clock of the first sensor, and the place in `sensors` of that
    which each sample is of.

    primary : (n,) number of the sensor that the autopilot used. Where that is not healthy and
    another is, the other counts; where none is, the value is nan. Sensors of which none is ever
    healthy do not say whether they are.
    """
    time = sensors[0].time
    taken = np.zeros(len(time), dtype=np.intp)
    values, healthy = (
        np.full((len(sensors), len(time)), np.nan),
        np.zeros((len(sensors), len(time))),
    )
    for place, sensor in enumerate(sensors):
        near = _nearest(sensor.time, time)
        values[place] = sensor.values[near]
        healthy[place] = sensor.healthy[near] & np.isfinite(values[place])
        taken[primary == instance_of(sensor.topic)] = place
    if not healthy.any():
        healthy = np.isfinite(values).astype(np.float64)
    every = np.arange(len(time))
    ill = healthy[taken, every] == 0
    taken[ill] = np.argmax(healthy[:, ill], axis=0)
    return np.where(healthy[taken, every] > 0, values[taken, every], np.nan), taken


def _nearest(stamps: Array, time: Array) -> Places:
    if len(stamps) < 2:
        return np.zeros(len(time), dtype=np.intp)
    after = np.clip(np.searchsorted(stamps, time), 1, len(stamps) - 1)
    return np.asarray(
        np.where(time - stamps[after - 1] < stamps[after] - time, after - 1, after), np.intp
    )


def described(sensors: Sequence[Sensor], taken: Places) -> list[str]:
    """Return which sensor's values are used from when [s] on, one entry a change; empty where the
    first is throughout."""
    if not taken.any():
        return []
    changes = [0, *(np.flatnonzero(np.diff(taken)) + 1)]
    words = [
        f"{sensors[int(taken[k])].topic} from {float(sensors[0].time[k]):.1f} s on" for k in changes
    ]
    return words if len(words) <= _LISTED else [*words[:_LISTED], f"{len(words) - _LISTED} more"]


def healthy(fields: Mapping[str, Any], name: str, count: int) -> Mask:
    """Return (n,) whether a sensor says that it is healthy: its field is not zero, or is not
    there."""
    values = fields.get(name)
    return np.ones(count, dtype=bool) if values is None else np.asarray(values) != 0
