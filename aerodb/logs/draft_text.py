"""Text of a drafted mapping file: channels with ranges, confidence and reasons, questions as
comments, and what is not mapped."""

import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from aerodb.logs.clocks import ClockColumn
from aerodb.logs.mapping_file import Mapping as LogMapping
from aerodb.recording import Recording
from aerodb.support import Array

if TYPE_CHECKING:
    from aerodb.logs.mapping_draft import Guess


def draft_text(
    recording: Recording,
    name: str,
    clocks: Mapping[str, ClockColumn],
    columns: Mapping[tuple[str, str], Array],
    guesses: Mapping[str, "Guess"],
    questions: Iterable[str],
    notes: Iterable[str],
    built_in: LogMapping | None,
) -> str:
    """Return the text of a mapping file; columns (n,) in the units of the log.

    built_in : the mapping that knows the log, whose clock and derived channels are taken.
    """
    topics = list(dict.fromkeys(guess.topic for guess in guesses.values()))
    fields = sorted({g.field for g in guesses.values() if topics and g.topic == topics[0]})
    lines = [
        f"# Mapping drafted from {recording.source.rsplit('/', 1)[-1]}: check every line.",
        "# A channel is offset + scale * field in `unit`. Signs: body x forward, y right, z down;",
        "# trailing edge down and rudder left are positive (docs/reference/conventions.md).",
        "# sure: name and unit are stated; likely: the values decide the unit; asked: see above.",
        *(f"# QUESTION {text}" for text in questions),
        *(f"# NOTE {text}" for text in notes),
        f"name = {_quoted(name)}",
        f"formats = [{_quoted(recording.format)}]",
        f"detect = [{', '.join(map(_quoted, topics[:1]))}]",
        *([f"fields = [{', '.join(map(_quoted, fields))}]"] if fields else []),
    ]
    lines += _clock_lines(clocks, built_in)
    for guess in guesses.values():
        scale = "" if guess.scale == 1.0 else f", scale = {guess.scale:g}"
        lines += [
            "",
            f"# {_range(columns[guess.topic, guess.field])}; {guess.confidence}: {guess.reason}",
            "[[channel]]",
            f"name = {_quoted(guess.channel)}",
            f"sources = [{{ topic = {_quoted(guess.topic)}, field = {_quoted(guess.field)}, unit ="
            f" {_quoted(guess.unit)}{scale} }}]",
        ]
    lines += _derived_lines(built_in) if built_in else []
    mapped = {(g.topic, g.field) for g in guesses.values()}
    mapped |= {(clock.topic, clock.field) for clock in clocks.values()}
    left = [key for key, x in columns.items() if key not in mapped and np.any(np.nan_to_num(x))]
    if left:
        lines += ["", "# Not mapped: what are they?"]
        lines += [f"# {t}.{f}: {_range(columns[t, f])}" for t, f in left[:100]]
    return "\n".join(lines) + "\n"


def _clock_lines(clocks: Mapping[str, ClockColumn], built_in: LogMapping | None) -> list[str]:
    """The section [time]: a built-in mapping's, else the column that is the clock."""
    if built_in is not None:
        if built_in.time is None:
            return []
        time = built_in.time
        lines = ["", "[time]", f"topic = {_quoted(time.topic)}", f"field = {_quoted(time.field)}"]
        lines += [f"unit = {_quoted(time.unit or 's')}"]
        return [*lines, *([f"scale = {time.scale!r}"] if time.scale != 1.0 else [])]
    if not clocks:
        return []
    clock = next(iter(clocks.values()))
    return [
        "",
        f"# {clock.confidence}: {clock.reason}",
        "[time]",
        f"topic = {_quoted(clock.topic)}",
        f"field = {_quoted(clock.field)}",
        f"unit = {_quoted(clock.unit)}",
    ]


def _derived_lines(built_in: LogMapping) -> list[str]:
    """The channels that a built-in mapping computes."""
    lines = []
    for each in built_in.derived:
        sources = [
            f"    {{ topic = {_quoted(s.topic)}, field = {_quoted(s.field)}"
            + (f", unit = {_quoted(s.unit)}" if s.unit is not None else "")
            + (f", scale = {s.scale!r}" if s.scale != 1.0 else "")
            + " },"
            for s in each.sources
        ]
        channels = ", ".join(map(_quoted, each.channels))
        lines += ["", "[[derived]]", f"channels = [{channels}]", f"method = {_quoted(each.method)}"]
        lines += ["sources = [", *sources, "]"]
    return lines


def _range(values: Array) -> str:
    return f"{np.nanmin(values):.4g} to {np.nanmax(values):.4g}, median {np.nanmedian(values):.4g}"


def _quoted(text: Any) -> str:
    """A TOML string."""
    escaped = str(text).replace("\\", "\\\\").replace('"', '\\"')
    return '"' + re.sub(r"[\x00-\x1f\x7f]", " ", escaped) + '"'
