"""The mapping file: which field of a log layout is which canonical channel, as data (TOML).

What is done with it stands in `aerodb.logs.mapping`.
"""

import tomllib
from collections.abc import Iterable
from fnmatch import fnmatchcase
from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.logs.derivations import METHODS
from aerodb.nomenclature import channel
from aerodb.recording import Recording, Topic
from aerodb.support import Strict, validated


def _registered(name: str) -> str:
    try:
        channel(name)
    except UnknownNameError as error:
        raise ValueError(f"{error.what}; {error.remedy}") from None
    return name


ChannelName = Annotated[str, AfterValidator(_registered)]


class Source(Strict):
    """One place in a log. `topic` may hold ``*`` and alternatives ``a|b`` (the first that exists).

    The value is ``offset + scale * field``, in `unit`; without `unit` the log's own declaration
    holds.
    """

    topic: str
    field: str
    unit: str | None = None
    scale: float = 1.0
    offset: float = 0.0


class Clock(Strict):
    """Where the time stands in a table: readers of tables cannot know. `unit` as in `Source`."""

    topic: str
    field: str
    unit: str | None = None
    scale: float = 1.0


class ChannelMapping(Strict):
    """A canonical channel and the places where it may stand: the first that the log has is taken.

    `command`: the value is what was commanded to a surface; the vehicle file's scale, offset and
    lag make it a deflection.
    """

    name: ChannelName
    sources: tuple[Source, ...] = Field(min_length=1)
    command: bool = False


class Derived(Strict):
    """Channels computed from fields of one topic by a method of `aerodb.logs.derivations`; used
    where no source gave them.

    `sources` stand in the order of the method's arguments.
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
                f"{self.method} takes {method.inputs} sources and gives {len(method.outputs)}"
                " channels"
            )
        if len({source.topic for source in self.sources}) > 1:
            raise ValueError(f"the sources of {self.method} must stand in one topic")
        return self


class Mapping(Strict):
    """A log layout.

    `detect`: topics that must all be there (``*`` and ``a|b`` allowed); of the first, `columns`
    says how many fields it has and `fields` which it must have. `reference_topic` sets the rate of
    the grid (default: the topic of p, q, r). `zero_is_missing`: a field that is exactly zero
    throughout was not recorded.
    """

    name: str = Field(pattern=r"^[a-z0-9][a-z0-9_-]{0,62}$")
    description: str = ""
    formats: tuple[str, ...] = Field(min_length=1)
    detect: tuple[str, ...] = ()
    columns: int | None = None
    fields: tuple[str, ...] = ()
    reference_topic: str | None = None
    zero_is_missing: bool = False
    time: Clock | None = None
    channel: tuple[ChannelMapping, ...] = Field(min_length=1)
    derived: tuple[Derived, ...] = ()

    @model_validator(mode="after")
    def _once(self) -> Self:
        names = [entry.name for entry in self.channel]
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(
                f"channel {', '.join(twice)} stands twice; list the places as several sources of"
                " one channel"
            )
        return self

    def fits(self, recording: Recording) -> bool:
        """Whether the recording's format and topics are those of this layout; never true for one
        without `detect`."""
        if recording.format not in self.formats or not self.detect:
            return False
        found = [matching_topics(pattern, recording.topics) for pattern in self.detect]
        if not all(found):
            return False
        return any(self._fits_topic(recording.topics[name]) for name in found[0])

    def _fits_topic(self, topic: Topic) -> bool:
        return (self.columns is None or len(topic.fields) == self.columns) and all(
            name in topic.fields for name in self.fields
        )


def parse_mapping(text: str, where: str = "mapping file") -> Mapping:
    """A Mapping from the text of its TOML file; InputError names the key, the reason and the
    nearest known key."""
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"not valid TOML: {error}", where) from error
    return validated(Mapping, data, where)


def matching_topics(pattern: str, topics: Iterable[str]) -> list[str]:
    """Names among `topics` that a pattern such as ``"new_name|old_*"`` means, earlier alternatives
    first.

    >>> matching_topics("b|a*", ["a1", "b", "c"])
    ['b', 'a1']
    """
    names = list(topics)
    return [
        name for part in pattern.split("|") for name in names if fnmatchcase(name, part.strip())
    ]
