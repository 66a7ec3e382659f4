"""What a user asks of a log by name: channels, logged fields, and formulas of both.

A name is a canonical channel (``alpha``) or a field as logged (``TOPIC:FIELD``). A formula is
``NAME [UNIT] = EXPRESSION``, in the expression language of databases (`aerodb.tables.parse`), with
fields in braces: ``excess [m/s] = V - {airspeed:indicated_airspeed_m_s}``. Channels are in SI.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.flight import Flight
from aerodb.logs.mapping_file import Mapping as LogMapping
from aerodb.nomenclature import channel
from aerodb.recording import Recording
from aerodb.support import Array
from aerodb.tables import Expression, evaluate, parse
from aerodb.units import conversion

_FORMULA: Final = re.compile(
    r"\s*([A-Za-z_]\w*)\s*(?:\[([^\[\]]{1,30})\])?\s*=(?!=)(.*)", re.DOTALL
)
_FIELD: Final = re.compile(r"\{([^{}]*)\}")


@dataclass(frozen=True, eq=False)
class Signal:
    """Values (n,) in `unit` over time (n,) [s], which increases; `unit` is empty where neither log
    nor mapping states one."""

    name: str
    unit: str
    time: Array
    values: Array


@dataclass(frozen=True)
class Formula:
    """A formula of channels and fields; `fields` : name in the expression -> ``TOPIC:FIELD``."""

    name: str
    unit: str
    expression: Expression
    fields: Mapping[str, str]


def parse_formula(text: str) -> Formula:
    """Return the formula ``NAME [UNIT] = EXPRESSION``; without a unit, its result has none.

    >>> parse_formula("gamma [rad] = theta - alpha").unit
    'rad'

    Raises InputError for anything else, and for a unit that is unknown.
    """
    found = _FORMULA.fullmatch(text)
    if found is None:
        raise InputError(
            f"'{text[:80]}' is not a formula",
            "--formula",
            'write NAME [UNIT] = EXPRESSION, such as "gamma [rad] = theta - alpha"',
        )
    name, unit, right = found[1], (found[2] or "").strip(), found[3]
    conversion(unit, unit)
    fields: dict[str, str] = {}

    def named(field: "re.Match[str]") -> str:
        known = {place: key for key, place in fields.items()}
        key = known.get(field[1], f"logged_{len(fields)}")
        fields[key] = field[1]
        return key

    return Formula(name, unit, parse(_FIELD.sub(named, right)), fields)


class Signals:
    """The signals of a log: channels of its flight, fields as logged, and formulas.

    recording : on the clock of its mapping. flight : None where the log cannot become one. Times
    count from `start` [s], the first sample of the flight, or of the log.
    """

    def __init__(
        self,
        recording: Recording,
        flight: Flight | None,
        units: Mapping[tuple[str, str], str],
        formulas: Iterable[Formula] = (),
    ) -> None:
        self._recording, self._flight, self._units = recording, flight, units
        self._formulas = {each.name: each for each in formulas}
        self._known: dict[str, Signal] = {}
        first = (float(t.time[0]) for t in recording.topics.values() if len(t.time))
        begun = min(filter(np.isfinite, first), default=0.0)
        self.start = float(flight.time[0]) if flight is not None else begun

    def __getitem__(self, name: str) -> Signal:
        """Return the signal of a name; UnknownNameError with the nearest, InputError for a formula
        that uses itself."""
        if name not in self._known:
            self._known[name] = self._made(name)
        return self._known[name]

    def _made(self, name: str) -> Signal:
        if name in self._formulas:
            return self._computed(self._formulas.pop(name))
        if self._flight is not None and name in self._flight:
            unit, time = channel(name).unit, self._flight.time - self.start
            return Signal(name, unit, time, self._flight[name])
        if ":" in name:
            return self._logged(name)
        known = [*self._formulas, *(self._flight.channels if self._flight else ())]
        raise UnknownNameError(
            f"no signal '{name[:80]}'", self._recording.source, nearest(name[:80], known)
        )

    def _logged(self, name: str) -> Signal:
        topics, source = self._recording.topics, self._recording.source
        for topic in sorted(topics, key=len, reverse=True):
            if not name.startswith(f"{topic}:"):
                continue
            field, values = name[len(topic) + 1 :], topics[topic].fields
            numeric = numeric_fields(self._recording, topic)
            if field not in numeric:
                raise UnknownNameError(
                    f"no field '{field[:80]}' in topic '{topic[:80]}'",
                    source,
                    nearest(field, numeric),
                )
            time = np.asarray(topics[topic].time, dtype=np.float64) - self.start
            time, (read,) = in_order(time, np.asarray(values[field], dtype=np.float64))
            unit = topics[topic].units.get(field) or self._units.get(
                (topic.partition(".")[0], field), ""
            )
            return Signal(name, unit, time, read)
        topic = name.partition(":")[0][:80]
        raise UnknownNameError(f"no topic '{topic}'", source, nearest(topic, topics))

    def _computed(self, formula: Formula) -> Signal:
        names = sorted(formula.expression.names)
        parts = {name: self[formula.fields.get(name, name)] for name in names}
        if not parts:
            raise InputError(f"formula '{formula.name}' names no signal", "--formula")
        on_grid = [part for name, part in parts.items() if name not in formula.fields]
        time = (on_grid or list(parts.values()))[0].time
        values = {
            name: part.values
            if part.time is time or np.array_equal(part.time, time)
            else np.interp(time, part.time, part.values, left=np.nan, right=np.nan)
            for name, part in parts.items()
            if len(part.time)
        }
        with np.errstate(all="ignore"):
            found = np.broadcast_to(evaluate(formula.expression, values), time.shape)
        return Signal(formula.name, formula.unit, time, np.array(found))


def numeric_fields(recording: Recording, topic: str) -> list[str]:
    """Return the fields of a topic, arrays (n,) in their own units, that hold numbers; KeyError
    for an unknown topic."""
    fields = recording.topics[topic].fields
    return [name for name, values in fields.items() if np.asarray(values).dtype.kind in "biuf"]


def stated_units(mapping: LogMapping | None) -> dict[tuple[str, str], str]:
    """Return (topic, field) -> unit, as a mapping states it for logs that state none; empty without
    a mapping."""
    if mapping is None:
        return {}
    sources = [source for channel in mapping.channel for source in channel.sources]
    sources += [source for derived in mapping.derived for source in derived.sources]
    return {
        (topic, source.field): source.unit
        for source in sources
        if source.unit and source.scale == 1.0 and source.offset == 0.0
        for topic in source.topic.split("|")
    }


def in_order(time: Array, *values: Array) -> tuple[Array, tuple[Array, ...]]:
    """Return samples (n,) in the order of their times [s]; a logged clock may jump back, or be no
    number, and such stamps are left out."""
    if np.all(np.diff(time) >= 0.0):
        return time, values
    order = np.argsort(time, kind="stable")
    order = order[np.isfinite(time[order])]
    return time[order], tuple(each[order] for each in values)
