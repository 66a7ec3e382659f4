"""A recording read through a mapping: fields in SI on cleaned clocks."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.logs.mapping_file import Mapping, Source, matching_topics
from aerodb.logs.sensor_choice import Sensor, chosen, described, healthy
from aerodb.recording import Damage, Recording
from aerodb.signals import clean_clock
from aerodb.support import Array
from aerodb.units import convert


@dataclass(frozen=True)
class _Location:
    """The topic and field of a source, as the recording names them."""

    topic: str
    field: str


@dataclass(frozen=True)
class _Clock:
    """A cleaned clock: mask of the samples to keep, and their times [s]."""

    keep: NDArray[np.bool_]
    time: Array


@dataclass(frozen=True)
class FieldValues:
    """Values of a field on the cleaned clock of its topic; `estimated` as in `Source`."""

    topic: str
    values: Array
    estimated: bool = False


@dataclass
class MappedLog:
    """A recording read through a mapping: fields in SI on cleaned clocks; collects damage."""

    recording: Recording
    mapping: Mapping
    damage: list[Damage] = field(default_factory=list)
    refused: dict[str, InputError] = field(default_factory=dict)
    """Topics whose clock cannot be used -> the error."""
    choices: list[str] = field(default_factory=list)
    """Which of several sensors of a kind was read, where it is not the first throughout."""
    cut: set[str] = field(default_factory=set)
    """Topics of which samples far from the flight are left out."""
    _clocks: dict[str, _Clock | None] = field(default_factory=dict)
    _renamed: str | None = None

    def clock(self, topic: str) -> _Clock | None:
        """Return the cleaned clock of a topic.

        None if the clock cannot be used or a table has no time base of that length.

        Stamps (n,) [s].
        """
        if topic not in self._clocks:
            self._clocks[topic] = self._cleaned(topic)
        return self._clocks[topic]

    def _cleaned(self, topic: str) -> _Clock | None:
        stamps = self.stamps(topic)
        if stamps is None:
            return None
        timed = np.isfinite(stamps)
        if not timed.all() and 2 * timed.sum() > len(timed):
            what = f"{int((~timed).sum())} samples have no time and are left out"
            self.damage.append(Damage("time", what, topic))
        else:
            timed[:] = True
        try:
            clean = clean_clock(stamps[timed], f"{self.recording.source}, topic {topic}")
        except InputError as error:
            self.refused[topic] = error
            self.damage.append(Damage("time", f"{error.what}: the topic is not used", topic))
            return None
        if clean.dropped:
            what = f"{clean.dropped} samples left out whose time does not increase"
            self.damage.append(Damage("time", what, topic, clean.start, clean.end))
        timed[timed] = clean.keep
        return _Clock(timed, stamps[timed])

    def stamps(self, topic: str) -> Array | None:
        """Return logged times [s] of a topic; None if a table has no time base of its length.

        (n,). Raises InputError when the field of ``[time]`` is not there.
        """
        time = self.mapping.time
        if time is None and self.recording.format == "tabular":
            raise InputError(
                "no time: a table has none until its mapping names it",
                f"{self.recording.source}, mapping {self.mapping.name}",
                'add a [time] section: topic = "table", field = "NAME", unit = "s"',
            )
        if time is None:
            stamps = self.recording.topics[topic].time
            return stamps if len(stamps) > 1 else None
        location = self.locate(Source(topic=time.topic, field=time.field))
        if location is None:
            where = f"{self.recording.source}, mapping {self.mapping.name}"
            raise InputError(
                f"no time: topic '{time.topic}' has no field '{time.field}'",
                where,
                "state the field that holds the time in [time] of the mapping file",
            )
        base = self.recording.topics[location.topic]
        values = np.asarray(base.fields[location.field], dtype=np.float64)
        unit = time.unit or base.units.get(location.field, "s")
        same_length = len(next(iter(self.recording.topics[topic].fields.values()))) == len(values)
        return convert(values * time.scale, unit, "s") if same_length else None

    def locate(self, source: Source) -> _Location | None:
        """Return topic and field of a source: the first match that exists and is numeric, (n,), in
        its own unit, or None."""
        for topic in self._topics(source.topic):
            values = self.recording.topics[topic].fields.get(source.field)
            if values is not None and np.asarray(values).dtype.kind in "fiub":
                return _Location(topic, source.field)
        return None

    def _topics(self, pattern: str) -> list[str]:
        """Return the topics that match; the mapping's first topic may have another name."""
        found = matching_topics(pattern, self.recording.topics)
        if found or self.mapping.geometry is None or pattern != self.mapping.detect[0]:
            return found
        if self._renamed is None:
            self._renamed = self.mapping.renamed(self.recording) or ""
        return [self._renamed] if self._renamed else []

    def _chosen(self, source: Source, location: _Location, clock: _Clock) -> Array:
        """Values (n,) of the sensor that the autopilot used, or of a healthy one, on the clock of
        the first."""
        sensors = []
        for name in self._topics(source.topic):
            topic, its = self.recording.topics[name], self.clock(name)
            if its is not None and source.field in topic.fields:
                values = np.asarray(topic.fields[source.field], dtype=np.float64)[its.keep]
                well = healthy(topic.fields, source.healthy, len(its.keep))[its.keep]
                sensors.append(Sensor(name, its.time, values, well))
        stated = self.recording.topics[location.topic].fields.get(source.primary)
        none = np.zeros(len(clock.time))
        values, taken = chosen(sensors, none if stated is None else np.asarray(stated)[clock.keep])
        if words := described(sensors, taken):
            said = f"{location.field} of the sensor that the autopilot used: {', '.join(words)}"
            if said not in self.choices:
                self.choices.append(said)
        return values

    def is_zero(self, source: Source) -> bool:
        """Return whether the field of a source (n,) is there and zero throughout, whatever its
        unit."""
        location = self.locate(source)
        if location is None:
            return False
        values = np.asarray(self.recording.topics[location.topic].fields[location.field])
        return len(values) > 0 and not np.any(values)

    def is_empty(self, source: Source) -> bool:
        """Return whether the field of a source (n,) is there and holds no finite number, whatever
        its unit."""
        location = self.locate(source)
        if location is None:
            return False
        values = self.recording.topics[location.topic].fields[location.field]
        return not np.any(np.isfinite(np.asarray(values, dtype=np.float64)))

    def read(self, source: Source, unit: str) -> FieldValues | None:
        """Return topic and values in `unit` of a source on its cleaned clock.

        None if the field is absent or holds no data.
        """
        location = self.locate(source)
        if location is None or (clock := self.clock(location.topic)) is None:
            return None
        topic = self.recording.topics[location.topic]
        raw = np.asarray(topic.fields[location.field], dtype=np.float64)[clock.keep]
        if source.primary:
            raw = self._chosen(source, location, clock)
        if not np.any(np.isfinite(raw)) or (self.mapping.zero_is_missing and not np.any(raw)):
            return None
        declared = source.unit if source.unit is not None else topic.units.get(location.field)
        if declared is None:
            where = f"{self.recording.source}, field {location.topic}.{location.field}"
            raise InputError(
                "no unit is declared",
                where,
                f"declare the unit in the log, or state it in mapping {self.mapping.name}",
            )
        if source.scale != 1.0 or source.offset:
            raw = source.offset + source.scale * raw
        try:
            return FieldValues(location.topic, convert(raw, declared, unit), source.estimated)
        except InputError as error:
            where = f"{self.recording.source}, field {location.topic}.{location.field}"
            raise InputError(
                error.what, where, error.remedy or f"state its unit in mapping {self.mapping.name}"
            ) from error
