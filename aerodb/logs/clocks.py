"""Which column of a table is its time, in which unit, and what of that is to be asked."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.logs.field_names import named, plain_name
from aerodb.recording import Recording, Topic
from aerodb.signals import clean_clock
from aerodb.support import Array
from aerodb.units import conversion, spelled

_OF_LOG: Final = r"elapsed|fly|flight|log|rec(ord)?|recording|boot|system|sys|session|mission|host"
_OF_CLOCK: Final = r"gps|utc|gmt|lcl|local|unix|epoch|date|zulu|abs|rel|absolute|relative|offset"
_OF_RUN: Final = r"totl|total|real|missn|sim(ulation)?|sample|loop"
_BEFORE: Final = f"({_OF_LOG}|{_OF_CLOCK}|{_OF_RUN})"
_CLOCK: Final = (
    r"(t|time|times|time_?stamps?|zeit|uhrzeit|clock|tempo|tiempo|temps"
    r"|h?ora|(date|fecha|data|datum)[_/]?(time|hora|ora|uhrzeit))"
)
#: Names of times, the plainest first; the unit is taken off before (`plain_name`).
_NAMES: Final = tuple(
    re.compile(pattern)
    for pattern in (
        rf"{_CLOCK}(_?(s|sec|ms|us|ns))?",
        rf"({_BEFORE}_?)+{_CLOCK}(_?(s|sec|ms|us|ns))?|{_CLOCK}(_(boot|startup|utc|gps|local|elapsed))+",
        r"(milli|micro|nano)?s(ec(ond)?s?)?|millis|micros|[mun]sec|[mun]s|utc(_?sec)?|elapsed|date"
        r"|fecha|\w+_time_?stamps?",
        r"hh_?mm_?ss|(unix|posix|epoch|stamp|when|datum|zulu|gmt)(_?(s|sec|ms|us|ns))?",
        r"\w+_(time|clock)|x_value|(gps_?|time_?)?i?tow",
    )
)
#: Units of a time, in the order of their size [s].
_UNITS: Final = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
#: Rates of flight logs [Hz]: slower than manoeuvres, faster than any logger on board writes tables.
_RATES: Final = (0.4, 5000.0)
#: POSIX time of 2000 and 2100 [s]: such stamps tell their unit.
_POSIX: Final = (9.4e8, 4.1e9)
#: Days of spreadsheets (since 1900) and of MATLAB (since year 0) from 1982 to 2099.
_DAYS: Final = ((30000.0, 73000.0), (724000.0, 767000.0))
#: A column of days moves by less at each sample: 8.6 s; as seconds that were 10 kHz.
_MOST_DAYS: Final = 1e-4
#: Whole numbers in steps of one are taken for a counter.
_COUNTED: Final = 1.0
#: Difference of what two clocks tell for the length of a log from which they disagree.
_AGREEING: Final = 0.02


@dataclass(frozen=True)
class ClockColumn:
    """The column of a table's time.

    dropped : samples whose stamp repeats, runs back or is empty. open : what is to be answered, ''
    for nothing. reason : why it is the clock, and why in this unit. stated : whether log or name
    state the unit.
    """

    topic: str
    field: str
    unit: str
    reason: str
    open: str = ""
    dropped: int = 0
    stated: bool = False

    @property
    def confidence(self) -> str:
        """As of a guess: ``sure``, ``likely`` or ``asked``."""
        return "asked" if self.open else "sure" if self.stated else "likely"


def clock_columns(
    recording: Recording, columns: Mapping[tuple[str, str], Array]
) -> dict[str, ClockColumn]:
    """Topic -> the column of its time: by name, else one that the log states to be a time, else,
    where columns have no names, the first that runs evenly; the last two are asked.

    columns : (topic, column) -> (n,).

    A time may repeat, run back or be empty at single stamps, as `clean_clock` allows. A column that
    is a channel by its name is none, and a named column that merely runs evenly neither.
    """
    found: dict[str, ClockColumn] = {}
    for topic in recording.topics.values():
        mine = {field: values for (name, field), values in columns.items() if name == topic.name}
        known = [f for f in mine if _rank(f) is not None]
        running = {f: n for f in known if (n := _dropped(mine[f])) is not None}
        for field in sorted(running, key=lambda f: (_rank(f), -len(np.unique(mine[f])))):
            found.setdefault(topic.name, _named_clock(topic, field, mine, running))
        if topic.name not in found and (stated := _stated(topic, mine)):
            found[topic.name] = _named_clock(topic, next(iter(stated)), mine, stated)
        if topic.name not in found and (unnamed := [f for f in mine if f.isdigit()]):
            even = next((f for f in unnamed if _dropped(mine[f]) == 0 and _even(mine[f])), None)
            if even is not None:
                found[topic.name] = _unnamed_clock(topic, even, mine[even])
    return found


def _stated(topic: Topic, columns: Mapping[str, Array]) -> dict[str, int]:
    """Columns that the log states to be times, or texts of which were, though no name says so."""
    return {
        field: dropped
        for field, values in columns.items()
        if _is_time(topic.units.get(field, ""))
        and named(field) is None
        and (dropped := _dropped(values)) is not None
    }


def standing(topic: Topic, columns: Mapping[tuple[str, str], Array]) -> list[str]:
    """Return the columns of a topic that are named as a time but do not run as one.

    columns : (topic, column) -> (n,).
    """
    mine = [field for name, field in columns if name == topic.name]
    return [field for field in mine if _rank(field) is not None]


def counters(topic: Topic, columns: Mapping[tuple[str, str], Array]) -> list[str]:
    """Return the columns of a topic that run evenly and are neither times nor channels by their
    names, as a counter of samples does.

    columns : (topic, column) -> (n,).
    """
    return [
        field
        for (name, field), values in columns.items()
        if name == topic.name
        and not field.isdigit()
        and named(field, topic.units.get(field, "")) is None
        and _rank(field) is None
        and _dropped(values) == 0
        and _even(values)
    ]


def _rank(field: str) -> int | None:
    """How plainly a name is that of a time, from 0; None for another."""
    words = plain_name(field)[0]
    if named(field) is not None:
        return None
    for rank, pattern in enumerate(_NAMES):
        if pattern.fullmatch(words):
            return rank
    return None


def _dropped(values: Array) -> int | None:
    """How many stamps are to be left out of a time; None for a column that does not run as one."""
    if values.size < 3:
        return None
    try:
        return clean_clock(values).dropped
    except InputError:
        return None


def _even(values: Array) -> bool:
    steps = np.diff(values)
    return bool(np.percentile(steps, 95) < 1.5 * np.median(steps))


def _named_clock(
    topic: Topic, field: str, columns: Mapping[str, Array], running: Mapping[str, int]
) -> ClockColumn:
    values = columns[field]
    unit, why, open_ = _unit(topic, field, values)
    length = float(np.nanmax(values) - np.nanmin(values)) * conversion(unit, "s")[0]
    others = []
    for other in running:
        scale = conversion(_unit(topic, other, columns[other])[0], "s")[0]
        span = float(np.nanmax(columns[other]) - np.nanmin(columns[other])) * scale
        if abs(span - length) > _AGREEING * max(length, span):
            others.append(f"by {other} the log is {span:.4g} s long, by {field} {length:.4g} s")
    open_ = open_ or (others[0] if others else "")
    if not open_ and _rank(field) in (None, len(_NAMES) - 1):
        open_ = f"is {field} the time of the samples?"
    stated = _is_time(topic.units.get(field, "")) or _is_time(_of_name(field))
    return ClockColumn(topic.name, field, unit, why, open_, running[field], stated)


def _unnamed_clock(topic: Topic, field: str, values: Array) -> ClockColumn:
    unit, _, _ = _unit(topic, field, values)
    rate = 1.0 / (float(np.median(np.diff(values))) * conversion(unit, "s")[0])
    ask = f"is column {field} the time in {unit} ({rate:.4g} Hz)?"
    if _is_counter(values):
        ask = f"column {field} counts: is it the time, or the number of the sample?"
    return ClockColumn(topic.name, field, unit, "it is the first that runs evenly", ask)


def _is_counter(values: Array) -> bool:
    return bool(np.all(np.diff(values) == _COUNTED))


def _unit(topic: Topic, field: str, values: Array) -> tuple[str, str, str]:
    """Unit of a time, why, and what is to be asked about it."""
    times = values[np.isfinite(values)]
    steps = np.diff(times)
    step = float(np.median(steps[steps > 0]))
    declared = topic.units.get(field, "")
    for stated, why in ((declared, "the log states its unit"), (_of_name(field), "by its name")):
        if stated and _is_time(stated):
            seconds = step * conversion(stated, "s")[0]
            doubt = f"is {field} in {spelled(stated)}? Its steps would be {seconds:.3g} s"
            return spelled(stated), why, doubt if seconds * _RATES[1] < 1.0 else ""
    for low, high in _DAYS:
        if low < times[0] < high and step < _MOST_DAYS:
            return "day", f"from {times[0]:.6g}: days, as spreadsheets and MATLAB count them", ""
    for unit, size in _UNITS.items():
        if _POSIX[0] < times[0] * size < _POSIX[1] and step * size > 1.0 / _RATES[1]:
            return unit, f"from {times[0]:.4g}: seconds since 1970 in {unit}", ""
    likely = [u for u, size in _UNITS.items() if _RATES[0] <= 1.0 / (step * size) <= _RATES[1]]
    if not likely:
        unit = "s" if step <= 2 else "ms" if step < 500 else "us" if step < 1e6 else "ns"
        return unit, f"steps of {step:.4g}", f"is {field} in {unit}? Its steps are {step:.4g}"
    unit, rate = likely[0], 1.0 / (step * _UNITS[likely[0]])
    why = f"steps of {step:.4g}: {rate:.4g} Hz"
    whole = bool(np.all(times == np.round(times)))
    if len(likely) > 1 and whole:
        return unit, why, f"is {field} in {' or '.join(likely)}? Its steps are {step:.4g}"
    return unit, why, ""


def _of_name(field: str) -> str:
    words, unit = plain_name(field)
    found = re.search(
        r"(?:^|_|time|t)(milli|micro|nano|[mun])?s(?:ec(?:ond)?s?)?$|^(milli|micro)s$", words
    )
    if unit or found is None:
        return unit
    prefix = (found[1] or found[2] or "")[:2]
    return {"": "s", "mi": "ms" if "milli" in words else "us", "na": "ns"}.get(prefix, f"{prefix}s")


def _is_time(unit: str) -> bool:
    if not unit:
        return False
    try:
        conversion(unit, "s")
    except InputError:
        return False
    return True


def seconds_of(recording: Recording, topic: str, clocks: Mapping[str, ClockColumn]) -> Array:
    """Time (n,) of a topic, by its column among `clock_columns`, else by its stamps [s]."""
    if topic not in clocks:
        return np.asarray(recording.topics[topic].time, dtype=np.float64)
    clock = clocks[topic]
    values = np.array(recording.topics[topic].fields[clock.field], dtype=np.float64)
    return values * conversion(clock.unit, "s")[0]
