"""Columns of a log by the names that a model gives them, in SI, without a mapping file."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError, nearest
from aerodb.logs.clocks import clock_columns, seconds_of
from aerodb.logs.field_names import plain_name
from aerodb.logs.mapping_draft import guess_by_name, numeric_columns
from aerodb.nomenclature import CHANNELS, channel, is_surface
from aerodb.recording import Recording, Topic
from aerodb.support import Array
from aerodb.units import conversion, quantity, si_conversion

#: Name under which the time column is given.
TIME: Final = "time"
#: ``column [unit]``.
_SOURCE = re.compile(r"\s*(?P<field>.*?)\s*(?:\[(?P<unit>[^\]]*)\])?\s*")


@dataclass(frozen=True, eq=False)
class Columns:
    """Columns of one topic.

    Parameters
    ----------
    time : (n,) [s], increasing where the log is in order.
    values : name -> (n,), SI.
    notes : which column each is and in which unit it was taken, where the file does not say so.
    """

    time: Array
    values: Mapping[str, Array]
    notes: tuple[str, ...]


def find_columns(recording: Recording, names: Sequence[str], given: Mapping[str, str]) -> Columns:
    """Return the columns of these names, from the topic that has all of them; matrices and vectors
    of one length in a table's file are one topic, in which column 2 of matrix z is ``z.2``.

    Parameters
    ----------
    names : of channels or anything else.
    given : name (or ``time``) -> ``"column"`` or ``"column [unit]"``; the time may be a sampling
        interval, such as ``"0.02 s"``. A name that is not given is
        found by the column's name: the same, the same but for its unit, or another name of the same
        channel (``da`` for ``delta_aileron``).

    The unit is the one given, else declared by the log, else stated by the column's name, else SI
    unless the values are too large for it.

    Raises InputError for a name without a column, a unit that a channel of this name cannot have,
    and a topic without a clock.
    """
    recording = _joined(recording)
    found = {topic: _matched(each, names, given) for topic, each in recording.topics.items()}
    best = max(found, key=lambda topic: len(found[topic]))
    lacking = [name for name in names if name not in found[best]]
    if lacking:
        fields = [field for field, _ in numeric_columns(recording.topics[best])]
        skipped = recording.metadata.get("skipped", "")
        without = f"; without numbers: {skipped}" if skipped else ""
        raise InputError(
            f"no column '{lacking[0]}' (columns: {', '.join(fields[:20])}{without})",
            recording.source,
            f"{nearest(lacking[0], fields)}; name it in the model file: [columns]"
            f' {lacking[0]} = "column [unit]"',
        )
    topic = recording.topics[best]
    values, notes = {}, []
    for name in names:
        field, unit = found[best][name]
        series = np.asarray(topic.fields[field], dtype=np.float64)
        unit, said = (unit, "") if unit else _unit(topic, name, field, series)
        known = name in CHANNELS or is_surface(name)
        try:
            scale, offset = conversion(unit, channel(name).unit) if known else si_conversion(unit)
        except InputError as error:
            raise InputError(
                f"column '{field}': {error.what}",
                recording.source,
                f'state its unit in the model file: [columns] {name} = "{field} [unit]"',
            ) from error
        values[name] = series * scale + offset
        if said:
            notes.append(f"{name} is column {field}, taken in {unit}: {said}")
    return Columns(_time(recording, topic, given.get(TIME)), values, tuple(notes))


def with_named_clock(recording: Recording) -> Recording:
    """Return a table's recording with topic times [s] (n,) of the column that is named as a time
    and leaves nothing open; without one, nothing changes."""
    if recording.format != "tabular":
        return recording
    columns = {
        (topic.name, field): values
        for topic in recording.topics.values()
        for field, values in numeric_columns(topic)
    }
    clocks = clock_columns(recording, columns)
    timed = {
        name: replace(recording.topics[name], time=seconds_of(recording, name, clocks))
        for name, clock in clocks.items()
        if not clock.open
    }
    return replace(recording, topics={**recording.topics, **timed})


def _joined(recording: Recording) -> Recording:
    """A table's file with one topic for each length of its columns; a column is known by its own
    name where no other has it, and by that of its topic and its own."""
    if recording.format != "tabular" or len(recording.topics) == 1:
        return recording
    topics: dict[str, Topic] = {}
    for length in dict.fromkeys(len(topic.time) for topic in recording.topics.values()):
        alike = [topic for topic in recording.topics.values() if len(topic.time) == length]
        names = [field for topic in alike for field in topic.fields]
        fields, units = dict[str, Any](), dict[str, str]()
        for topic in alike:
            for field, values in topic.fields.items():
                own = [f"{topic.name}.{field}", *([field] if names.count(field) == 1 else [])]
                fields |= dict.fromkeys(own, values)
                units |= {name: topic.units[field] for name in own if field in topic.units}
        topics[alike[0].name] = replace(alike[0], fields=fields, units=units)
    return replace(recording, topics=topics)


def _matched(
    topic: Topic, names: Sequence[str], given: Mapping[str, str]
) -> dict[str, tuple[str, str]]:
    """Name -> column and its unit, '' where it is not given, of those that are there."""
    fields = dict(numeric_columns(topic))
    made: dict[str, tuple[str, str]] = {}
    for name in names:
        if name in given:
            source = _SOURCE.fullmatch(given[name])
            field, unit = (source["field"], source["unit"] or "") if source else ("", "")
            if field in fields:
                made[name] = (field, unit)
            continue
        for same in (_same, _same_words, _same_channel):
            alike = [field for field, values in fields.items() if same(topic, field, values, name)]
            if alike:
                made[name] = (alike[0], "")
                break
    return made


def _same(topic: Topic, field: str, values: Array, name: str) -> bool:
    return field == name


def _same_words(topic: Topic, field: str, values: Array, name: str) -> bool:
    return plain_name(field)[0] == plain_name(name)[0]


def _same_channel(topic: Topic, field: str, values: Array, name: str) -> bool:
    channels = [guess_by_name(topic, each, values) for each in (field, name)]
    return None not in channels and len({guess.channel for guess in channels if guess}) == 1


def _unit(topic: Topic, name: str, field: str, values: Array) -> tuple[str, str]:
    """Unit of a column, and why, '' where the log or its name says so."""
    stated = topic.units.get(field, "") or plain_name(field)[1]
    if stated:
        return stated, ""
    known = next((guess_by_name(topic, each, values) for each in (name, field)), None)
    if known is not None and np.isfinite(values).any():
        return known.unit, known.reason
    unit = channel(name).unit if name in CHANNELS or is_surface(name) else "1"
    return unit, "neither the log nor the name states a unit, so that it counts as SI"


def _time(recording: Recording, topic: Topic, given: str | None) -> Array:
    """Time [s] of a topic: the column given, else the one that runs as a time does, else the log's
    own stamps."""
    fields = dict(numeric_columns(topic))
    if given is not None:
        source = _SOURCE.fullmatch(given)
        if source is None or source["field"] not in fields:
            try:
                return quantity(given, "s") * np.arange(len(topic.time), dtype=np.float64)
            except InputError as error:
                raise InputError(
                    f"no column '{given}'", recording.source, nearest(given, list(fields))
                ) from error
        return fields[source["field"]] * si_conversion(source["unit"] or "s")[0]
    if recording.format != "tabular":
        return np.asarray(topic.time, dtype=np.float64)
    clocks = clock_columns(recording, {(topic.name, f): v for f, v in fields.items()})
    if topic.name not in clocks:
        raise InputError(
            "no column runs as a time does",
            recording.source,
            'name it in the model file: [columns] time = "column [s]", or state the sampling'
            ' interval: time = "0.02 s"',
        )
    return seconds_of(recording, topic.name, clocks)
