"""A drafted mapping as lines to answer: each a channel, its field, unit and scale, with what the
field then shows; and the mapping file of the answers."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.logs.draft_text import Frame, channel_lines
from aerodb.logs.mapping_draft import MappingDraft, numeric_columns
from aerodb.logs.mapping_file import parse_mapping
from aerodb.nomenclature import channel
from aerodb.recording import Recording
from aerodb.support import Array
from aerodb.units import conversion

#: Samples of a column that are kept for its picture.
_POINTS: Final = 300
#: Most columns from which a form lets choose, besides those that are drafted: the first of a log.
MOST_COLUMNS: Final = 300


@dataclass(frozen=True)
class FormLine:
    """One channel of a mapping as it is answered. channel : '' where the field is not used. place :
    topic and field. unit : of the field. scale : by which its values are multiplied in that unit.
    confidence, reason : of the draft; '' for a line that was added."""

    channel: str
    place: tuple[str, str]
    unit: str
    scale: float = 1.0
    confidence: str = ""
    reason: str = ""


@dataclass(frozen=True)
class MappingForm:
    """A draft to answer. text : the file as drafted. frame : what it says besides channels. columns
    : topic and field -> times [s] and values (n,) as logged, a few of them. clock : which column is
    the time, and why; '' for none."""

    text: str
    frame: Frame
    lines: tuple[FormLine, ...]
    questions: tuple[str, ...]
    columns: Mapping[tuple[str, str], tuple[Array, Array]]
    clock: str = ""


def mapping_form(recording: Recording, draft: MappingDraft) -> MappingForm:
    """Return a draft of a recording as a form, values (n,) in the units of the log."""
    columns: dict[tuple[str, str], tuple[Array, Array]] = {}
    wanted = {(guess.topic, guess.field) for guess in draft.guesses}
    for topic in recording.topics.values():
        for field, values in numeric_columns(topic):
            if len(columns) < MOST_COLUMNS or (topic.name, field) in wanted:
                kept = np.linspace(0, len(values) - 1, min(len(values), _POINTS)).astype(np.intp)
                columns[topic.name, field] = (topic.time[kept], values[kept])
    lines = tuple(
        FormLine(g.channel, (g.topic, g.field), g.unit, g.scale, g.confidence, g.reason)
        for g in draft.guesses
    )
    clock = draft.clock
    said = (
        ""
        if clock is None
        else (f"{clock.topic}.{clock.field} in {clock.unit}; {clock.confidence}: {clock.reason}")
    )
    return MappingForm(draft.text, draft.frame, lines, draft.questions, columns, said)


def in_si(form: MappingForm, line: FormLine) -> tuple[Array, Array]:
    """Return times [s] and values (n,) of a line in the SI unit of its channel.

    Raises InputError for an unknown channel or field, and for a unit of another quantity.
    """
    if line.place not in form.columns:
        raise InputError(f"no field {'.'.join(line.place)}", line.channel, "choose one of the log")
    scale, offset = conversion(line.unit, channel(line.channel).unit)
    time, values = form.columns[line.place]
    return time, scale * line.scale * values + offset


def answered(form: MappingForm, lines: Sequence[FormLine]) -> MappingForm:
    """Return the form with these lines in place of its own, and the mapping file that they make.

    Raises InputError where they make no mapping: an unknown channel or unit, a channel twice.
    """
    used = [line for line in lines if line.channel]
    named = [line.channel for line in used]
    twice = next((name for name in named if named.count(name) > 1), None)
    if twice is not None:
        raise InputError(f"two fields for {twice}", "the form", "leave the channel of one empty")
    for line in used:
        in_si(form, line)
    made = []
    for line in used:
        why = f"{line.confidence}: {line.reason}" if line.confidence else "answered in the form"
        made.append([f"# {why}", *channel_lines(line.channel, *line.place, line.unit, line.scale)])
    text = form.frame.text([line.place for line in used], made)
    parse_mapping(text, "the form")
    return replace(form, text=text, lines=tuple(lines))
