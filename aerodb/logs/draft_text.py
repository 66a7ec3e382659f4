"""Text of a drafted mapping file: channels with ranges, confidence and reasons, questions as
comments, and what is not mapped."""

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from aerodb.logs.clocks import ClockColumn
from aerodb.logs.guesses import Guess
from aerodb.logs.mapping_file import Mapping as LogMapping
from aerodb.recording import Recording
from aerodb.support import Array

_COMMENTS: Final = (
    "# A channel is offset + scale * field in `unit`. Signs: body x forward, y right, z down;",
    "# trailing edge down and rudder left are positive (docs/reference/conventions.md).",
    "# sure: name and unit are stated; likely: the values decide the unit; asked: see above.",
)


@dataclass(frozen=True)
class Frame:
    """What a drafted file says besides its channels. source : name of the log. name : of the
    mapping. clock, derived : lines of the sections of time and of derived channels; notes : on
    both."""

    source: str
    name: str
    format: str
    clock: tuple[str, ...]
    derived: tuple[str, ...]
    notes: tuple[str, ...]

    def text(
        self,
        places: Sequence[tuple[str, str]],
        channels: Iterable[Sequence[str]],
        questions: Iterable[str] = (),
        last: Iterable[str] = (),
    ) -> str:
        """Return the file. places : topic and field of the channels; the first topic is what the
        mapping is told by. channels : lines of each. last : comments at the end."""
        topics = list(dict.fromkeys(topic for topic, _ in places))
        fields = sorted({field for topic, field in places if topic == topics[0]})
        lines = [
            f"# Mapping drafted from {self.source}: check every line.",
            *_COMMENTS,
            *(f"# QUESTION {text}" for text in questions),
            *(f"# NOTE {text}" for text in self.notes),
            f"name = {quoted(self.name)}",
            f"formats = [{quoted(self.format)}]",
            f"detect = [{', '.join(map(quoted, topics[:1]))}]",
            *([f"fields = [{', '.join(map(quoted, fields))}]"] if fields else []),
            *self.clock,
        ]
        for each in channels:
            lines += ["", *each]
        return "\n".join([*lines, *self.derived, *last]) + "\n"


def frame_of(
    recording: Recording,
    name: str,
    clocks: Mapping[str, ClockColumn],
    notes: Iterable[str],
    built_in: LogMapping | None,
) -> Frame:
    """Return what a draft says besides its channels.

    built_in : the mapping that knows the log, whose clock and derived channels are taken.
    """
    return Frame(
        recording.source.rsplit("/", 1)[-1],
        name,
        recording.format,
        tuple(_clock_lines(clocks, built_in)),
        tuple(_derived_lines(built_in) if built_in else ()),
        tuple(notes),
    )


def draft_text(
    frame: Frame,
    clocks: Mapping[str, ClockColumn],
    columns: Mapping[tuple[str, str], Array],
    guesses: Iterable[Guess],
    questions: Iterable[str],
) -> str:
    """Return the text of a mapping file; columns (n,) in the units of the log."""
    listed = list(guesses)
    places = [(g.topic, g.field) for g in listed]
    made = [
        [
            f"# {_range(columns[g.topic, g.field])}; {g.confidence}: {g.reason}",
            *channel_lines(g.channel, g.topic, g.field, g.unit, g.scale),
        ]
        for g in listed
    ]
    mapped = {*places, *((clock.topic, clock.field) for clock in clocks.values())}
    left = [key for key, x in columns.items() if key not in mapped and np.any(np.nan_to_num(x))]
    last = ["", "# Not mapped: what are they?"] if left else []
    last += [f"# {t}.{f}: {_range(columns[t, f])}" for t, f in left[:100]]
    return frame.text(places, made, questions, last)


def channel_lines(name: str, topic: str, field: str, unit: str, scale: float) -> list[str]:
    """The lines of one channel of a mapping file: scale times the field, in its unit."""
    more = "" if scale == 1.0 else f", scale = {scale:g}"
    place = f"topic = {quoted(topic)}, field = {quoted(field)}"
    return [
        "[[channel]]",
        f"name = {quoted(name)}",
        f"sources = [{{ {place}, unit = {quoted(unit)}{more} }}]",
    ]


def _clock_lines(clocks: Mapping[str, ClockColumn], built_in: LogMapping | None) -> list[str]:
    """The section [time]: a built-in mapping's, else the column that is the clock."""
    if built_in is not None:
        if built_in.time is None:
            return []
        time = built_in.time
        lines = ["", "[time]", f"topic = {quoted(time.topic)}", f"field = {quoted(time.field)}"]
        lines += [f"unit = {quoted(time.unit or 's')}"]
        return [*lines, *([f"scale = {time.scale!r}"] if time.scale != 1.0 else [])]
    if not clocks:
        return []
    clock = next(iter(clocks.values()))
    return [
        "",
        f"# {clock.confidence}: {clock.reason}",
        "[time]",
        f"topic = {quoted(clock.topic)}",
        f"field = {quoted(clock.field)}",
        f"unit = {quoted(clock.unit)}",
    ]


def _derived_lines(built_in: LogMapping) -> list[str]:
    """The channels that a built-in mapping computes."""
    lines = []
    for each in built_in.derived:
        sources = [
            f"    {{ topic = {quoted(s.topic)}, field = {quoted(s.field)}"
            + (f", unit = {quoted(s.unit)}" if s.unit is not None else "")
            + (f", scale = {s.scale!r}" if s.scale != 1.0 else "")
            + " },"
            for s in each.sources
        ]
        channels = ", ".join(map(quoted, each.channels))
        lines += ["", "[[derived]]", f"channels = [{channels}]", f"method = {quoted(each.method)}"]
        lines += ["sources = [", *sources, "]"]
    return lines


def _range(values: Array) -> str:
    return f"{np.nanmin(values):.4g} to {np.nanmax(values):.4g}, median {np.nanmedian(values):.4g}"


def quoted(text: Any) -> str:
    """A TOML string."""
    escaped = str(text).replace("\\", "\\\\").replace('"', '\\"')
    return '"' + re.sub(r"[\x00-\x1f\x7f]", " ", escaped) + '"'
