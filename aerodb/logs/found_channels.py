"""What a mapping finds in a recording, without a vehicle: channels, zeros, empty fields, the
clock."""

from dataclasses import replace

from aerodb.logs.mapped_log import MappedLog
from aerodb.logs.mapping_file import Mapping
from aerodb.nomenclature import UNNEEDED, channel
from aerodb.recording import Recording

#: Channels that every flight should have; reported as missing even if the mapping lacks them.
EXPECTED = (
    "ax",
    "ay",
    "az",
    "ax_imu",
    "ay_imu",
    "az_imu",
    "p",
    "q",
    "r",
    "V",
    "qbar",
    "rho",
    "mach",
    "alpha",
    "beta",
    "phi",
    "theta",
    "altitude",
)


def channels_found(
    recording: Recording, mapping: Mapping
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the channels that a mapping finds in a recording, and the channels that are missing.

    Missing are channels that the mapping knows, or that every flight should have, and that were not
    found. Only names are compared, so that a log can be inspected without a vehicle file: a channel
    found here may still be empty, and derivable air data count as missing. Units are not looked at
    (`MappedLog.locate`).
    """
    log = MappedLog(recording, mapping)
    present = [
        entry.name
        for entry in mapping.channel
        if any(log.locate(source) for source in entry.sources)
    ]
    for derived in mapping.derived:
        if all(log.locate(source) for source in derived.sources):
            present += [name for name in derived.channels if name not in present]
    known = [
        *EXPECTED,
        *(entry.name for entry in mapping.channel),
        *(name for d in mapping.derived for name in d.channels),
    ]
    there = {*present, *UNNEEDED}
    return tuple(present), tuple(name for name in dict.fromkeys(known) if name not in there)


def zero_channels(recording: Recording, mapping: Mapping) -> tuple[str, ...]:
    """Return the channels whose fields (n,) are zero throughout, in any unit: they were probably
    not recorded."""
    log = MappedLog(recording, mapping)
    single = [
        entry.name
        for entry in mapping.channel
        if (places := [source for source in entry.sources if log.locate(source)])
        and all(log.is_zero(source) for source in places)
    ]
    derived = [
        name
        for each in mapping.derived
        if each.method == "sum" and all(log.is_zero(source) for source in each.sources)
        for name in each.channels
    ]
    return tuple(dict.fromkeys([*single, *derived]))


def empty_channels(recording: Recording, mapping: Mapping) -> tuple[str, ...]:
    """Return the channels whose fields (n,) are there and hold no number at all
    (`MappedLog.is_empty`)."""
    log = MappedLog(recording, mapping)
    return tuple(
        entry.name
        for entry in mapping.channel
        if (places := [source for source in entry.sources if log.locate(source)])
        and all(log.is_empty(source) for source in places)
    )


def sensor_choices(recording: Recording, mapping: Mapping) -> tuple[str, ...]:
    """Return which of several sensors of a kind is read, from when [s] on; empty where it is the
    first throughout. Fields are (n,)."""
    log = MappedLog(recording, mapping)
    for entry in mapping.channel:
        for source in entry.sources:
            if source.primary:
                log.read(source, channel(entry.name).unit)
    return tuple(log.choices)


def with_mapped_clock(recording: Recording, mapping: Mapping) -> Recording:
    """Return the recording with topic times [s] as the mapping's ``[time]`` defines them.

    For tables, whose reader cannot know which column is the time. Topics without a time base of
    their length keep the sample index; without ``[time]`` nothing changes.

    Times are (n,). Raises InputError when the field of ``[time]`` is not there.
    """
    if mapping.time is None:
        return recording
    log = MappedLog(recording, mapping)
    clocks = {name: log.stamps(name) for name in recording.topics}
    timed = {
        name: replace(recording.topics[name], time=clock)
        for name, clock in clocks.items()
        if clock is not None
    }
    return replace(recording, topics={**recording.topics, **timed})
