"""PX4's own messages (px4_msgs) in an MCAP file, as the bridge to ROS 2 writes them: the topics of
a ULog under a prefix, such as ``/fmu/out/vehicle_attitude_v1``."""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.recording import Topic

#: What stands before and behind the topic's name in PX4.
_TOPIC: Final = re.compile(r"(?:.*/)?fmu/out/(\w+?)(?:_v\d+)?|.*/(\w+?)(?:_v\d+)?")
_MESSAGES: Final = "px4_msgs/"


def px4_topics(
    topics: Mapping[str, Topic], schemas: Mapping[str, str]
) -> tuple[dict[str, Topic], dict[str, str]]:
    """Return the topics with those of px4_msgs under the names of PX4, and these by the names that
    the file has; empty without any.

    schemas : topic -> name of its message type. Times [s] of such topics are those of the field
    ``timestamp`` [us], counted from the first of all; a topic whose stamps do not increase keeps
    the recorder's. A name that is taken already stays as the file has it.
    """
    ours = [name for name in topics if schemas.get(name, "").startswith(_MESSAGES)]
    stamps = {name: _stamps(topics[name]) for name in ours}
    first = min((float(each[0]) for each in stamps.values() if each is not None), default=0.0)
    found = {name: topic for name, topic in topics.items() if name not in ours}
    named: dict[str, str] = {}
    for name in sorted(ours, key=lambda name: ("fmu/out/" not in name, name)):
        match = _TOPIC.fullmatch(name)
        short = (match[1] or match[2]) if match is not None else name
        key = named[name] = name if short in found else short
        stamp = stamps[name]
        time = topics[name].time if stamp is None else stamp - first
        found[key] = replace(topics[name], name=key, time=time)
    return found, named


def _stamps(topic: Topic) -> np.ndarray | None:
    """Times [s] of the messages' own stamps; None where they are absent or do not increase."""
    stamps = topic.fields.get("timestamp")
    if stamps is None or not len(stamps):
        return None
    seconds = np.asarray(stamps, dtype=np.float64) * 1e-6
    return seconds if seconds[0] > 0 and np.all(np.diff(seconds) >= 0) else None
