"""Draft of a mapping file from any log: guesses by name, unit, range and derivative relations, each
with its reason, and the questions that only the owner of the log can answer."""

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.logs.clocks import ClockColumn, clock_columns, counters, seconds_of, standing
from aerodb.logs.draft_text import Frame, draft_text, frame_of
from aerodb.logs.field_names import Named, named, plain_name
from aerodb.logs.field_units import Sized, believable, unit_by_size
from aerodb.logs.guesses import Guess, in_si
from aerodb.logs.mapping_file import Mapping as LogMapping
from aerodb.logs.mapping_file import matching_topics
from aerodb.logs.signs import HEADED, UPWARD, reversed_signs
from aerodb.logs.ties import FASTEST_SOUND, SLOWEST_SOUND, slope, untied
from aerodb.nomenclature import channel, is_surface
from aerodb.recording import Recording, Topic
from aerodb.support import Array
from aerodb.units import conversion, spelled

#: Tables of fewer rows than this share of the longest are not along the flight.
_LEAST_SHARE: Final = 0.1
#: Difference of two columns, over the range of one, up to which they hold the same.
_SAME: Final = 1e-3
#: Names of a normal load, which is positive upwards whatever the axes are.
_LOADS: Final = re.compile(r"(n_?z|norm|load|g|lastviel|fac?tt?(e?ur|or))")
#: Units that a mapping file writes as people do.
_WRITTEN: Final = {"g0": "g", "dimensionless": "1"}
#: Names of which one, beside ``v``, makes that a component of velocity.
_COMPONENTS: Final = {"u", "w"}
#: Channels that a logger writes alike: if the size of one speaks against its unit or its kind,
#: those behind are asked too.
_ALIKE: Final = (
    ("latitude", "longitude"),
    ("longitude", "latitude"),
    ("az_imu", "ax_imu", "ay_imu"),
)
#: The same of angles and rates whose unit nobody states.
_ANGLES: Final = ("phi", "theta", "psi", "p", "q", "r")
#: Letters that stand for rates together; one alone may be a gain, a radius, a pressure.
_RATE_LETTERS: Final = frozenset("pqr")


@dataclass(frozen=True)
class MappingDraft:
    """Text of a mapping file, what it says besides channels, its guesses, and the questions that
    stay open. clock : the column of the time of a table's first topic that has one."""

    text: str
    frame: Frame
    guesses: tuple[Guess, ...]
    questions: tuple[str, ...]
    clock: ClockColumn | None = None

    @property
    def notes(self) -> tuple[str, ...]:
        """What is left out of a clock."""
        return self.frame.notes


def draft_mapping(
    recording: Recording, name: str, built_in: LogMapping | None = None
) -> MappingDraft:
    """Return a commented mapping for a log.

    built_in : a mapping that fits the log; what it finds is taken from it.

    A channel is the field of its own name, else of a synonym, else the one whose name has other
    words beside, which is asked. Units come from the log, from the names of fields, or from the
    size of the values; where none of them decides, SI is written and a question is asked. Empty
    columns, and those that are zero throughout, are never mapped.

    Columns (n,) in the units of the log.
    """
    columns = {
        (topic.name, field): values
        for topic in recording.topics.values()
        for field, values in numeric_columns(topic)
    }
    clocks = clock_columns(recording, columns) if recording.format == "tabular" else {}
    times = {(clock.topic, clock.field) for clock in clocks.values()}
    usable = {
        key: values
        for key, values in columns.items()
        if np.any(np.isfinite(values)) and np.any(values) and key not in times
    }
    guesses: dict[str, Guess] = {}
    for guess in _known(recording, built_in) if built_in else ():
        if (guess.topic, guess.field) in usable:
            guesses.setdefault(guess.channel, guess)
    is_known = bool(guesses)  # the built-in mapping knows better than names
    if not is_known:
        guesses = _by_names(recording, usable)
        guesses = {known: _settled(guess, guesses, usable) for known, guess in guesses.items()}
        guesses |= dict(reversed_signs(recording, guesses, clocks, usable))
        guesses |= {each.channel: each for each in untied(recording, guesses, clocks, usable)}
    questions = [_asked(guess) for guess in guesses.values() if guess.confidence == "asked"]
    notes: list[str] = []
    if not is_known:
        questions += _directions(guesses)
        questions += _relations(recording, clocks, usable)
        if recording.format == "tabular":
            asked, notes = _about_clocks(recording, clocks, columns)
            questions = asked + questions
    empty = [f"{t}.{f}" for (t, f) in columns if (t, f) not in usable and (t, f) not in times]
    if empty:
        questions.append(
            f"not mapped, as empty or zero throughout: {', '.join(sorted(empty)[:20])}"
        )
    frame = frame_of(recording, name, clocks, notes, built_in if is_known else None)
    text = draft_text(frame, clocks, columns, guesses.values(), questions)
    first = next(iter(clocks.values()), None)
    return MappingDraft(text, frame, tuple(guesses.values()), tuple(questions), first)


def _asked(guess: Guess) -> str:
    """The question about a guess."""
    if not guess.open:
        return f"is {guess.field} ({guess.channel}) in {guess.unit}? {guess.reason}"
    unit = f"; is it in {guess.unit}? {guess.reason}" if guess.assumed else ""
    return f"{guess.field} ({guess.channel}): {guess.open}{unit}"


def _about_clocks(
    recording: Recording,
    clocks: Mapping[str, ClockColumn],
    columns: Mapping[tuple[str, str], Array],
) -> tuple[list[str], list[str]]:
    """Questions about the time of a table, and notes on stamps that are left out."""
    questions = [f"time: {clock.open}" for clock in clocks.values() if clock.open]
    notes = [
        f"{clock.dropped} of {recording.topics[clock.topic].time.size} stamps of {clock.field}"
        " repeat, run back or are empty: these samples are left out"
        for clock in clocks.values()
        if clock.dropped
    ]
    if not clocks:
        even = [f for topic in recording.topics.values() for f in counters(topic, columns)]
        hint = f" ({', '.join(even[:3])} runs evenly, but may be a counter)" if even else ""
        still = [f for topic in recording.topics.values() for f in standing(topic, columns)]
        why = "no column is named as a time"
        if still:
            why = f"{', '.join(still[:3])} repeats, runs back or is empty in too many rows"
        questions.append(f"{why}: which is the time? Add a [time] section{hint}")
    return questions, notes


def _by_names(recording: Recording, usable: Mapping[tuple[str, str], Array]) -> dict[str, Guess]:
    """Channel -> the field whose name is nearest to it; others that are as near are asked about."""
    most = max((len(topic.time) for topic in recording.topics.values()), default=0)
    found: dict[str, list[Guess]] = {}
    for (topic, field), values in usable.items():
        if values.size < _LEAST_SHARE * most and recording.format == "tabular":
            continue
        if field == "v" and _COMPONENTS & set(recording.topics[topic].fields):
            continue
        guess = guess_by_name(recording.topics[topic], field, values)
        if guess is not None and _is_letter_alone(guess, recording.topics[topic]):
            guess = replace(guess, open="is it a turn rate? No other of p, q and r is beside it")
        if guess is not None and guess.channel == "beta" and _of_xplane(recording.topics[topic]):
            guess = replace(guess, open=guess.open or HEADED)
        if guess is not None:
            found.setdefault(guess.channel, []).append(guess)
    order = ("exact", "synonym", "part")
    chosen: dict[str, Guess] = {}
    for known, candidates in found.items():
        best = min(candidates, key=lambda g: order.index(g.how))
        alike = [g for g in candidates if g.how == best.how]
        best = min(alike, key=lambda g: (bool(g.open), not g.stated))
        values = in_si(best, usable)
        others = [g.field for g in alike if g != best and not _same(values, in_si(g, usable))]
        if others:
            ask = f"or is it {' or '.join(others[:3])}?"
            best = replace(best, open=f"{best.open} {ask}".strip())
        chosen[known] = best
    upward = chosen.get("az_imu")
    if upward is not None and upward.scale < 0 and not _LOADS.match(upward.field.lower()):
        for known in ("ay_imu", "q", "r", "beta", "theta", "psi"):
            if known in chosen and not chosen[known].open:
                ask = f"{upward.field} {UPWARD}"
                chosen[known] = replace(chosen[known], open=ask, by_axis=True)
    for first, *others in _ALIKE:
        if first in chosen and believable(first, in_si(chosen[first], usable)):
            ask = f"{chosen[first].field} is not believable: is this column written as it is?"
            _ask_alike(chosen, chosen[first].topic, others, ask)
    for angle in [chosen[each] for each in _ANGLES if each in chosen]:
        if not angle.stated and angle.assumed and angle.unit.startswith("deg"):
            unstated = [each for each in _ANGLES if each in chosen and not chosen[each].stated]
            ask = (
                f"{angle.field} is too large for {angle.unit}: is this column in a part of it too?"
            )
            _ask_alike(chosen, angle.topic, unstated, ask)
    return chosen


def _ask_alike(chosen: dict[str, Guess], topic: str, channels: Iterable[str], ask: str) -> None:
    """Ask about channels of a topic that nothing is asked about yet."""
    for each in channels:
        if each in chosen and chosen[each].topic == topic and chosen[each].confidence != "asked":
            chosen[each] = replace(chosen[each], open=ask)


def _of_xplane(topic: Topic) -> bool:
    """Whether columns are those of X-Plane: its datarefs, or its Data.txt."""
    return any(re.match(r"sim/|[hv]path\b|_?[hv]path,", field) for field in topic.fields)


def _is_letter_alone(guess: Guess, topic: Topic) -> bool:
    """Whether only a letter tells a rate, and neither its unit nor the other two letters do."""
    letter = plain_name(guess.field)[0]
    beside = {plain_name(field)[0] for field in topic.fields} & _RATE_LETTERS
    return letter in _RATE_LETTERS and len(beside) == 1 and guess.confidence == "likely"


def _same(values: Array, others: Array) -> bool:
    """Whether two columns hold the same, within the digits that were written."""
    if values.size != others.size:
        return False
    spread = float(np.nanmax(values) - np.nanmin(values))
    return bool(np.nanmax(np.abs(values - others)) <= _SAME * max(spread, 1e-12))


def _directions(guesses: Mapping[str, Guess]) -> list[str]:
    """The question about signs of surfaces, which no table states."""
    said = []
    surfaces = [g.field for k, g in guesses.items() if is_surface(k) and k != "delta_flap"]
    if surfaces:
        said.append(f"{', '.join(surfaces)}: is trailing edge down, and rudder left, positive?")
    return said


def _known(recording: Recording, built_in: LogMapping) -> Iterator[Guess]:
    """Return what a built-in mapping finds."""
    for entry in built_in.channel:
        for source in entry.sources:
            for topic in matching_topics(source.topic, recording.topics):
                if source.field in recording.topics[topic].fields and source.unit is not None:
                    why = f"built-in mapping {built_in.name}"
                    yield Guess(entry.name, topic, source.field, source.unit, source.scale, why)


def _settled(
    guess: Guess, guesses: Mapping[str, Guess], columns: Mapping[tuple[str, str], Array]
) -> Guess:
    """A guess whose unit another channel decides: the airspeed by the Mach number, the longitude by
    the latitude."""
    other = guesses.get({"V": "mach", "longitude": "latitude"}.get(guess.channel, ""))
    if other is None or other.topic != guess.topic or not guess.assumed:
        return guess
    if guess.channel == "longitude":
        return replace(guess, unit=other.unit, reason="in the unit of the latitude", assumed=False)
    speed, mach = (columns[each.topic, each.field] for each in (guess, other))
    moving = mach > 0.5 * float(np.nanmax(mach))
    sound = float(np.nanmedian(speed[moving] / mach[moving])) if np.any(moving) else 0.0
    for unit in ("m/s", "knot", "ft/s", "km/h"):
        if SLOWEST_SOUND < sound * conversion(unit, "m/s")[0] < FASTEST_SOUND:
            why = f"a speed of sound of {sound:.4g} {unit} beside the Mach number"
            return replace(guess, unit=unit, reason=why, assumed=False)
    return guess


def numeric_columns(topic: Topic) -> Iterator[tuple[str, Array]]:
    """Names and values (n,) of the columns of numbers.

    In the unit of the log; columns of text or of more dimensions are left out.
    """
    for field, values in topic.fields.items():
        column = np.asarray(values)
        if column.dtype.kind in "fiub" and column.ndim == 1:
            yield field, column.astype(np.float64)


def guess_by_name(topic: Topic, field: str, values: Array) -> Guess | None:
    """The channel that a field is by its name, with its unit; None for a name of none.

    values : (n,), in the unit of the log; the guess names that unit.
    """
    declared = topic.units.get(field, "")
    meant = named(field, declared)
    if meant is None:
        return None
    si, open_ = channel(meant.channel).unit, meant.open
    for given, who in ((declared, "log"), (meant.unit, "name")):
        if not given:
            continue
        unit = _WRITTEN.get(spelled(given), spelled(given))
        if unit == "percent" and si == "rad":
            return None  # pint counts angles as numbers
        if unit == "1" and si == "rad":
            open_ = open_ or "it has no unit: is it a share of full travel?"
        elif _fits(unit, si):
            sized = Sized(unit, f"the {who} states the unit")
            return _checked(meant, topic, field, values, sized, stated=True)
        if _is_unit(unit):
            return None  # a quantity of another kind
        open_ = open_ or f"its unit '{given}' is not known"
    size = float(np.nanpercentile(np.abs(values), 99.0))
    sized = unit_by_size(meant.channel, si, size, values)
    return _checked(replace(meant, open=open_), topic, field, values, sized, stated=False)


def _checked(
    meant: Named, topic: Topic, field: str, values: Array, sized: Sized, stated: bool
) -> Guess:
    """A guess with the sign of its channel, and what its name or its values leave open."""
    open_, why, scale = meant.open, sized.reason, sized.scale * meant.sign
    if meant.how == "part" and not open_:
        open_ = "its name says more: is it the measured value?"
    factor, offset = conversion(sized.unit, channel(meant.channel).unit)
    doubt = believable(meant.channel, factor * sized.scale * values + offset)
    if doubt and not open_:
        open_ = f"{doubt} in {sized.unit}: is it this channel, in this unit?"
    if meant.channel == "az_imu" and float(np.nanmedian(values)) > 0:
        scale = -scale
    if meant.sign < 0:
        why = f"{why}; positive upwards by its name"
    return Guess(
        meant.channel,
        topic.name,
        field,
        sized.unit,
        scale,
        why,
        sized.assumed,
        open_,
        stated,
        meant.how,
    )


def _fits(unit: str, si: str) -> bool:
    try:
        conversion(unit, si)
    except InputError:
        return False
    return True


def _is_unit(unit: str) -> bool:
    return _fits(unit, unit)


def _relations(
    recording: Recording,
    clocks: Mapping[str, ClockColumn],
    columns: Mapping[tuple[str, str], Array],
) -> list[str]:
    """Which columns that nobody named are derivatives of others."""
    said = []
    unnamed = [key for key in columns if key[1].isdigit()][:60]
    for one in unnamed:
        time = seconds_of(recording, one[0], clocks)
        for other in unnamed:
            ratio = (
                _ratio(time, columns[one], columns[other])
                if one != other and one[0] == other[0]
                else None
            )
            if ratio is not None:
                said.append(f"column {other[1]} is {ratio:.3g} times the derivative of {one[1]}")
    return said[:40]


def _ratio(time: Array, angle: Array, rate: Array) -> float | None:
    """Slope of a rate over the derivative of an angle; None where they do not move together."""
    good = np.isfinite(time) & np.isfinite(angle) & np.isfinite(rate)
    if good.sum() < 20 or np.any(np.diff(time[good]) <= 0):
        return None
    return slope(time[good], np.gradient(angle[good], time[good]), rate[good])
