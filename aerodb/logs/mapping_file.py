"""Mapping file (TOML): which field of a log is which canonical channel.

`aerodb.logs.mapping` applies it to a recording.
"""

from collections.abc import Iterable
from fnmatch import fnmatchcase
from typing import Annotated, Any, Self

import numpy as np
from pydantic import (
    AfterValidator,
    Field,
    SerializerFunctionWrapHandler,
    model_serializer,
    model_validator,
)

from aerodb.errors import UnknownNameError, nearest
from aerodb.logs.derivations import METHODS
from aerodb.nomenclature import channel
from aerodb.recording import Recording, Topic
from aerodb.support import Strict, validated_toml


def _registered(name: str) -> str:
    try:
        channel(name)
    except UnknownNameError as error:
        raise ValueError(f"{error.what}; {error.remedy}") from None
    return name


ChannelName = Annotated[str, AfterValidator(_registered)]


class Source(Strict):
    """One field of a log; `topic` may contain ``*`` and alternatives ``a|b`` (first that exists).

    The value is ``offset + scale * field`` in `unit`; without `unit`, in the unit that the log
    declares. `estimated`: no sensor's value, but one that an estimator on board made of others.
    `primary`: field that says which of several sensors, the topics that match, the autopilot used
    (0: the first); `healthy`: field that is zero while a sensor is not.
    """

    topic: str
    field: str
    unit: str | None = None
    scale: float = 1.0
    offset: float = 0.0
    estimated: bool = False
    primary: str = ""
    healthy: str = ""

    @model_serializer(mode="wrap")
    def _without_default(self, serialize: SerializerFunctionWrapHandler) -> Any:
        """A sensor's source is written as before `estimated` and `primary` were: results made with
        it keep their keys."""
        written, later = serialize(self), ("estimated", "primary", "healthy")
        return {k: v for k, v in written.items() if k not in later or v}


class Clock(Strict):
    """Field that holds the time of a table, which its reader cannot know; `unit` as in `Source`."""

    topic: str
    field: str
    unit: str | None = None
    scale: float = 1.0


class ChannelMapping(Strict):
    """A canonical channel and its possible sources; the first that the log has is used.

    `command`: the value is the command to a surface; scale, offset and lag of the vehicle file
    convert it to a deflection.
    """

    name: ChannelName
    sources: tuple[Source, ...] = Field(min_length=1)
    command: bool = False


class Derived(Strict):
    """Channels computed from fields of one topic by a method of `aerodb.logs.derivations`.

    Used only if no channel entry provides one of them. `sources` are in the order of the method's
    arguments.
    """

    channels: tuple[ChannelName, ...] = Field(min_length=1)
    method: str
    sources: tuple[Source, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _known(self) -> Self:
        if self.method not in METHODS:
            raise ValueError(f"unknown method '{self.method}'; {nearest(self.method, METHODS)}")
        method = METHODS[self.method]
        if method.inputs not in (0, len(self.sources)) or len(method.outputs) not in (
            0,
            len(self.channels),
        ):
            raise ValueError(
                f"method '{self.method}' needs {method.inputs} sources and"
                f" {len(method.outputs)} channels"
            )
        if len({source.topic for source in self.sources}) > 1:
            raise ValueError(f"all sources of '{self.method}' must be fields of one topic")
        return self


class Geometry(Strict):
    """Fields of a matrix that hold the wing's area, span and chord, constant, in one system of
    units: by them a matrix is known whatever its variable is called."""

    area: str
    span: str
    chord: str

    def describes(self, topic: Topic) -> bool:
        """Return whether these fields of a topic can be a wing: constant, positive, and the area
        about the product of span and chord.

        Fields are (n,); area [m^2], span and chord [m].
        """
        values = []
        for name in (self.area, self.span, self.chord):
            field = topic.fields.get(name)
            column = None if field is None else np.asarray(field)
            if column is None or column.dtype.kind not in "fiu" or not len(column):
                return False
            if not (np.all(column == column[0]) and column[0] > 0.0):
                return False
            values.append(float(column[0]))
        area, span, chord = values
        return _LEAST_FILLED < area / (span * chord) < _MOST_FILLED


#: Least area of a wing over the product of its span and chord: of deltas and high taper (a mean
#: aerodynamic chord exceeds the mean one).
_LEAST_FILLED = 0.5
#: Largest such ratio: of rectangles, with what fuselages are counted in.
_MOST_FILLED = 1.2


class Mapping(Strict):
    """Contents of a mapping file.

    detect : topics that must all be present (``*`` and ``a|b`` allowed). columns, fields : number
    of fields of the first of them, and fields that it must have. reference_topic : sets the rate of
    the grid (default: the topic of p, q, r). zero_is_missing : a field that is zero throughout was
    not recorded. geometry : by which the first of `detect` is known under another name as well.
    """

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,62}$")
    description: str = ""
    formats: tuple[str, ...] = Field(min_length=1)
    detect: tuple[str, ...] = ()
    columns: int | None = None
    fields: tuple[str, ...] = ()
    reference_topic: str | None = None
    zero_is_missing: bool = False
    geometry: Geometry | None = None
    time: Clock | None = None
    channel: tuple[ChannelMapping, ...] = Field(min_length=1)
    derived: tuple[Derived, ...] = ()

    @model_serializer(mode="wrap")
    def _without_absent_geometry(self, serialize: SerializerFunctionWrapHandler) -> Any:
        """A mapping without `geometry` is written as before there was one: results made with it
        keep their keys."""
        written = serialize(self)
        return {k: v for k, v in written.items() if k != "geometry" or v is not None}

    @model_validator(mode="after")
    def _once(self) -> Self:
        names = [entry.name for entry in self.channel]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(
                f"channel {', '.join(twice)} is listed twice; list its fields as several sources of"
                " one channel"
            )
        return self

    def fits(self, recording: Recording) -> bool:
        """Return whether the recording has the format and topics of this mapping.

        Always false for a mapping without `detect`.
        """
        if recording.format not in self.formats or not self.detect:
            return False
        matches = [matching_topics(pattern, recording.topics) for pattern in self.detect]
        if not matches[0] and (other := self.renamed(recording)):
            matches[0] = [other]
        if not all(matches):
            return False
        return any(self._fits_topic(recording.topics[name]) for name in matches[0])

    def renamed(self, recording: Recording) -> str | None:
        """Return the topic that is the first of `detect` under another name: of its `columns`, with
        a time that increases and a wing's `geometry`. None if there is none, or one of that
        name."""
        if self.geometry is None or matching_topics(self.detect[0], recording.topics):
            return None
        for name, topic in recording.topics.items():
            if self._fits_topic(topic) and self.geometry.describes(topic) and self._runs(topic):
                return name
        return None

    def _runs(self, topic: Topic) -> bool:
        """Return whether the field of the time increases, where the mapping names one."""
        if self.time is None:
            return True
        stamps = topic.fields.get(self.time.field)
        return stamps is not None and bool(np.all(np.diff(np.asarray(stamps, np.float64)) > 0.0))

    def _fits_topic(self, topic: Topic) -> bool:
        return (self.columns is None or len(topic.fields) == self.columns) and all(
            name in topic.fields for name in self.fields
        )


def parse_mapping(text: str, where: str = "mapping file") -> Mapping:
    """Return the Mapping that a TOML text describes.

    Raises InputError with the key, the reason and the nearest known key. Every source states its
    unit; values become SI.
    """
    return validated_toml(Mapping, text, where)


def matching_topics(pattern: str, topics: Iterable[str]) -> list[str]:
    """Return the `topics` that match a pattern such as ``"new_name|old_*"``, in pattern order.

    >>> matching_topics("b|a*", ["a1", "b", "c"])
    ['b', 'a1']
    """
    names = list(topics)
    return [
        name for part in pattern.split("|") for name in names if fnmatchcase(name, part.strip())
    ]
