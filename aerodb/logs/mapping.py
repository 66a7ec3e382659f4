"""Conversion of a Recording to a Flight: choice of the mapping, channels, common time grid."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import (
    Resampler,
    clean_clock,
    first_order_lag,
    hold,
    interval,
    is_out_of_proportion,
    is_uniform,
    resampler,
    uniform_grid,
)
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.logs.air_data import complete_air_data
from aerodb.logs.captive import flag_captive
from aerodb.logs.completeness import consequences_of_missing
from aerodb.logs.derivations import METHODS
from aerodb.logs.fuel import with_fuel_mass
from aerodb.logs.mapping_file import (
    ChannelMapping,
    Derived,
    Mapping,
    Source,
    matching_topics,
    parse_mapping,
)
from aerodb.logs.probe import air_data_at_cg
from aerodb.nomenclature import FLAGS, channel
from aerodb.recording import Damage, Recording
from aerodb.support import Array
from aerodb.units import convert
from aerodb.vehicle import LogSource, Surface, Vehicle, add_combinations

__all__ = ["Mapping", "choose_mapping", "consequences_of_missing", "map_recording", "parse_mapping"]


_RATES = ("p", "q", "r")
_ACCELERATIONS = ("ax", "ay", "az", "ax_imu", "ay_imu", "az_imu")
#: Channels that every flight should have; reported as missing even if the mapping lacks them.
_EXPECTED = (
    *_ACCELERATIONS,
    *_RATES,
    "V",
    "qbar",
    "rho",
    "mach",
    "alpha",
    "beta",
    "phi",
    "theta",
    "altitude",
)
_WRAPPING = ("phi", "psi", "longitude")
#: Time constants after which less than 1 % of a first-order lag's initial error remains.
SETTLED = 5.0
#: Largest number of grid samples per logged sample of the reference topic.
_MOST_OVERSAMPLING = 100
#: Grid steps before and after the grid within which samples still count: the anti-aliasing filter
#: reaches 12.
_REACH = 100


def choose_mapping(recording: Recording, mappings: Iterable[Mapping]) -> Mapping:
    """Return the one mapping that fits the recording.

    `Recording.layout`, if the reader knows it, decides. Otherwise it is the mapping that fits and
    requires most topics. Raises InputError, with the candidates, if none fits or several fit
    equally well.
    """
    known = {mapping.name: mapping for mapping in mappings}
    if recording.layout in known:
        return known[recording.layout]
    fitting = [mapping for mapping in known.values() if mapping.fits(recording)]
    most = max((len(mapping.detect) for mapping in fitting), default=0)
    best = [mapping for mapping in fitting if len(mapping.detect) == most]
    if len(best) == 1:
        return best[0]
    names = ", ".join(sorted(mapping.name for mapping in best or known.values()))
    if best:
        raise InputError(
            f"several mappings fit: {names}", recording.source, "choose one with --mapping"
        )
    topics = ", ".join(sorted(recording.topics)[:8])
    what = f"no mapping fits this log (topics: {topics})"
    raise InputError(
        what,
        recording.source,
        f"choose one with --mapping, or write a mapping file; known: {names}",
    )


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
class _FieldValues:
    """Values of a field on the cleaned clock of its topic."""

    topic: str
    values: Array


@dataclass
class _Log:
    """A recording read through a mapping: fields in SI on cleaned clocks; collects damage."""

    recording: Recording
    mapping: Mapping
    damage: list[Damage] = field(default_factory=list)
    refused: dict[str, InputError] = field(default_factory=dict)
    """Topics whose clock cannot be used -> the error."""
    _clocks: dict[str, _Clock | None] = field(default_factory=dict)
    _renamed: str | None = None

    def clock(self, topic: str) -> _Clock | None:
        """Return the cleaned clock of a topic.

        None if the clock cannot be used or a table has no time base of that length.
        """
        if topic not in self._clocks:
            self._clocks[topic] = self._cleaned(topic)
        return self._clocks[topic]

    def _cleaned(self, topic: str) -> _Clock | None:
        stamps = self.stamps(topic)
        if stamps is None:
            return None
        try:
            clean = clean_clock(stamps, f"{self.recording.source}, topic {topic}")
        except InputError as error:
            self.refused[topic] = error
            self.damage.append(Damage("time", f"{error.what}: the topic is not used", topic))
            return None
        if clean.dropped:
            what = f"{clean.dropped} samples left out whose time does not increase"
            self.damage.append(Damage("time", what, topic, clean.start, clean.end))
        return _Clock(clean.keep, stamps[clean.keep])

    def stamps(self, topic: str) -> Array | None:
        """Return logged times [s] of a topic; None if a table has no time base of its length."""
        time = self.mapping.time
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
        """Return topic and field of a source: the first match that exists and is numeric."""
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

    def is_zero(self, source: Source) -> bool:
        """Return whether the field of a source is there and zero throughout."""
        location = self.locate(source)
        if location is None:
            return False
        values = np.asarray(self.recording.topics[location.topic].fields[location.field])
        return len(values) > 0 and not np.any(values)

    def is_empty(self, source: Source) -> bool:
        """Return whether the field of a source is there and holds no number."""
        location = self.locate(source)
        if location is None:
            return False
        values = self.recording.topics[location.topic].fields[location.field]
        return not np.any(np.isfinite(np.asarray(values, dtype=np.float64)))

    def read(self, source: Source, unit: str) -> _FieldValues | None:
        """Return topic and values in `unit` of a source on its cleaned clock.

        None if the field is absent or holds no data.
        """
        location = self.locate(source)
        if location is None or (clock := self.clock(location.topic)) is None:
            return None
        topic = self.recording.topics[location.topic]
        raw = np.asarray(topic.fields[location.field], dtype=np.float64)[clock.keep]
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
            return _FieldValues(location.topic, convert(raw, declared, unit))
        except InputError as error:
            where = f"{self.recording.source}, field {location.topic}.{location.field}"
            raise InputError(
                error.what, where, error.remedy or f"state its unit in mapping {self.mapping.name}"
            ) from error


@dataclass(frozen=True)
class _Signal:
    """One channel on its topic's clock; `surface` calibrates a command."""

    name: str
    topic: str
    values: Array
    surface: Surface | None = None


def map_recording(
    recording: Recording, mapping: Mapping, vehicle: Vehicle, flight_id: str = ""
) -> Flight:
    """Return the recording as a Flight: canonical channels in SI on one uniform grid.

    - The mapping selects the sources (a surface's `log` in the vehicle file takes precedence);
      units are converted, clocks cleaned, angles unwrapped.
    - The grid spans the overlap of the topics with accelerations and rates, at the vehicle's
      `processing.rate` or at the rate of the reference topic.
    - A table on one uniform time base is passed on bit for bit. Everything else is resampled
      without aliasing and flagged ``gap`` where its source has no samples.
    - Commands become deflections by the vehicle's scale, offset and lag. Constants of
      `configuration`, combinations and derivable air data are added.

    Missing channels, assumptions and damage are listed in the flight.

    Raises InputError for a clock that runs backwards, a unit that neither the log nor the mapping
    states, or a log with neither accelerations nor rates.
    """
    log = _Log(recording, mapping)
    signals, notes = _signals(log, vehicle)
    essential = [s for s in signals.values() if s.name in (*_RATES, *_ACCELERATIONS)]
    if not essential:
        what = (
            f"no accelerations and no rates found with mapping {mapping.name}: no coefficient can"
            " be computed"
        )
        raise InputError(
            what, recording.source, "choose another mapping, or write a mapping file for this log"
        )
    grid, note = _grid(log, essential, vehicle)
    channels, flags = _on_grid(log, signals.values(), grid)
    flight = Flight(
        id=flight_id or recording.sha256[:12],
        vehicle=vehicle.name,
        time=grid,
        channels=channels,
        flags=flags,
        notes=(note, *notes),
        damage=(*recording.damage, *log.damage),
        start_utc=recording.start_utc,
        log_sha256=recording.sha256,
        mapping=mapping.name,
    )
    return _completed(flight, mapping, vehicle)


def channels_found(
    recording: Recording, mapping: Mapping
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Return the channels that a mapping finds in a recording, and the channels that are missing.

    Missing are channels that the mapping knows, or that every flight should have, and that were not
    found. Only names are compared, so that a log can be inspected without a vehicle file: a channel
    found here may still be empty, and derivable air data count as missing.
    """
    log = _Log(recording, mapping)
    present = [
        entry.name
        for entry in mapping.channel
        if any(log.locate(source) for source in entry.sources)
    ]
    for derived in mapping.derived:
        if all(log.locate(source) for source in derived.sources):
            present += [name for name in derived.channels if name not in present]
    known = [
        *_EXPECTED,
        *(entry.name for entry in mapping.channel),
        *(name for d in mapping.derived for name in d.channels),
    ]
    return tuple(present), tuple(name for name in dict.fromkeys(known) if name not in present)


def zero_channels(recording: Recording, mapping: Mapping) -> tuple[str, ...]:
    """Return the channels whose fields are zero throughout: they were probably not recorded."""
    log = _Log(recording, mapping)
    single = [
        entry.name
        for entry in mapping.channel
        if (places := [source for source in entry.sources if log.locate(source)])
        and all(log.is_zero(source) for source in places)
    ]
    derived = [
        name
        for each in mapping.derived
        if each.method == "sum" and all(log.is_zero(source) for source in each.sources)
        for name in each.channels
    ]
    return tuple(dict.fromkeys([*single, *derived]))


def empty_channels(recording: Recording, mapping: Mapping) -> tuple[str, ...]:
    """Return the channels whose fields are there and hold no number at all."""
    log = _Log(recording, mapping)
    return tuple(
        entry.name
        for entry in mapping.channel
        if (places := [source for source in entry.sources if log.locate(source)])
        and all(log.is_empty(source) for source in places)
    )


def with_mapped_clock(recording: Recording, mapping: Mapping) -> Recording:
    """Return the recording with topic times [s] as the mapping's ``[time]`` defines them.

    For tables, whose reader cannot know which column is the time. Topics without a time base of
    their length keep the sample index; without ``[time]`` nothing changes.
    """
    if mapping.time is None:
        return recording
    log = _Log(recording, mapping)
    clocks = {name: log.stamps(name) for name in recording.topics}
    timed = {
        name: replace(recording.topics[name], time=clock)
        for name, clock in clocks.items()
        if clock is not None
    }
    return replace(recording, topics={**recording.topics, **timed})


def _signals(log: _Log, vehicle: Vehicle) -> tuple[dict[str, _Signal], list[str]]:
    """Return the channels of the log by name, and notes on logged channels that cannot be used."""
    entries = {entry.name: entry for entry in log.mapping.channel}
    for name, surface in vehicle.surfaces.items():
        if surface.log is not None:
            place = Source(
                topic=surface.log.topic, field=surface.log.field, unit=surface.log.unit or None
            )
            entries[f"delta_{name}"] = ChannelMapping(
                name=f"delta_{name}", sources=(place,), command=True
            )
    for name, logged in _named_by_vehicle(vehicle).items():
        sources = (Source(topic=logged.topic, field=logged.field, unit=logged.unit or None),)
        entries[name] = ChannelMapping(name=name, sources=sources)
    signals: dict[str, _Signal] = {}
    notes: list[str] = []
    for entry in entries.values():
        label = entry.name.removeprefix("delta_")
        located = _first(log, entry)
        if located is not None and entry.command and label not in vehicle.surfaces:
            notes.append(
                f"{entry.name} is logged as a command and not used: the vehicle file has no"
                f" [surfaces.{label}]"
            )
        elif located is not None:
            signals[entry.name] = _Signal(
                entry.name,
                located.topic,
                located.values,
                vehicle.surfaces[label] if entry.command else None,
            )
        elif entry.name in (*_RATES, *_ACCELERATIONS):
            _refuse_broken_clock(log, entry)
    for derived in log.mapping.derived:
        if not any(name in signals for name in derived.channels):
            signals.update({signal.name: signal for signal in _derive(log, derived)})
    return signals, notes


def _named_by_vehicle(vehicle: Vehicle) -> dict[str, LogSource]:
    """Channel -> its place in the log, of the channels that no mapping knows."""
    places = {} if vehicle.fuel is None else dict(vehicle.fuel.channels)
    for source, solution in vehicle.navigation.items():
        places |= {f"{base}_{source}": place for base, place in solution.channels.items()}
    return places


def _refuse_broken_clock(log: _Log, entry: ChannelMapping) -> None:
    """Raise the clock error of a topic that has a rate or acceleration; others are optional."""
    for source in entry.sources:
        location = log.locate(source)
        if location is not None and location.topic in log.refused:
            raise log.refused[location.topic]


def _first(log: _Log, entry: ChannelMapping) -> _FieldValues | None:
    for source in entry.sources:
        if entry.command:
            bare = source.unit in (None, "", "1", "-")
            signal = log.read(
                source.model_copy(update={"unit": "1"}) if bare else source, "1" if bare else "rad"
            )
        else:
            signal = log.read(source, channel(entry.name).unit)
        if signal is not None:
            if entry.name in _WRAPPING:
                return replace(signal, values=_unwrapped(signal.values))
            return signal
    return None


def _derive(log: _Log, derived: Derived) -> list[_Signal]:
    """Return the channels of a derivation; none unless all of its sources are present."""
    method = METHODS[derived.method]
    unit = method.input_unit or channel(derived.channels[0]).unit
    signals = [log.read(source, unit) for source in derived.sources]
    present = [entry for entry in signals if entry is not None]
    if len(present) < len(signals):
        return []
    results = method.compute(*(entry.values for entry in present))
    topic = present[0].topic
    return [
        _Signal(name, topic, _unwrapped(values) if name in _WRAPPING else values)
        for name, values in zip(derived.channels, results, strict=True)
    ]


def _unwrapped(values: Array) -> Array:
    """Return angles [rad] without jumps of a full turn; non-finite samples stay as they are."""
    good = np.isfinite(values)
    result = values.copy()
    result[good] = np.unwrap(values[good])
    return result


def _times(log: _Log, topic: str) -> Array:
    clock = log.clock(topic)
    assert clock is not None  # a signal exists only where its clock does
    return clock.time


def _grid(log: _Log, essential: Sequence[_Signal], vehicle: Vehicle) -> tuple[Array, str]:
    """Return the uniform time grid [s] and a note on its origin."""
    topics = dict.fromkeys(signal.topic for signal in essential)
    start = max(float(_times(log, topic)[0]) for topic in topics)
    end = min(float(_times(log, topic)[-1]) for topic in topics)
    named = (
        matching_topics(log.mapping.reference_topic, log.recording.topics)
        if log.mapping.reference_topic
        else []
    )
    usable = [topic for topic in named if log.clock(topic) is not None]
    rates = [signal.topic for signal in essential if signal.name in _RATES]
    reference = [*usable, *rates, *topics][0]
    time = _times(log, reference)
    step = interval(time) if vehicle.processing.rate is None else 1.0 / vehicle.processing.rate
    inside = time[(time >= start) & (time <= end)]
    if len(inside) < 2 or end - start < step:
        where = f"{log.recording.source}, topics {', '.join(topics)}"
        raise InputError(
            "accelerations and rates do not overlap in time",
            where,
            "check the clocks of these topics",
        )
    where = f"{log.recording.source}, topic {reference}"
    if is_out_of_proportion(end - start, max(step, interval(time)), len(inside)):
        what = f"{_jump(time)}: a flight of {end - start:.6g} s has only {len(inside)} samples"
        raise InputError(what, where, "split the log there, or repair its time base")
    if (end - start) / step > _MOST_OVERSAMPLING * len(inside) + 1000:
        what = (
            f"its samples are {(end - start) / len(inside):.6g} s apart, more than"
            f" {_MOST_OVERSAMPLING} steps of the grid of {1.0 / step:g} Hz"
        )
        remedy = "check the unit of its time, or lower [processing] rate in the vehicle file"
        raise InputError(what, where, remedy)
    note = (
        f"grid of {1.0 / step:.6g} Hz,"
        f" {'set by the vehicle file' if vehicle.processing.rate else f'that of topic {reference}'}"
    )
    if vehicle.processing.rate is None and is_uniform(inside):
        return inside, note
    return uniform_grid(float(inside[0]), end, step), note


def _jump(time: Array) -> str:
    """Return the largest step of a clock as text."""
    at = int(np.argmax(np.diff(time)))
    size = time[at + 1] - time[at]
    before, after = (f"{round(float(value), 3):.13g}" for value in time[at : at + 2])
    return f"the clock jumps by {size:.6g} s, from {before} to {after} s"


def _beside_grid(log: _Log, topic: str, time: Array, grid: Array) -> slice:
    """Return the samples of a topic to use on the grid: all, unless its clock jumps.

    `time` is out of proportion to its samples and to the grid then, and what is far from the grid
    is left out and reported.
    """
    span = float(time[-1] - time[0])
    if not is_out_of_proportion(span, interval(time), max(len(time), len(grid))):
        return slice(0, len(time))
    reach = _REACH * interval(grid)
    first, last = np.searchsorted(time, [grid[0] - reach, grid[-1] + reach])
    lost = len(time) - int(last - first)
    if lost and not any(entry.topic == topic and _AWAY in entry.what for entry in log.damage):
        what = f"{_jump(time)}: {lost} of {len(time)} samples {_AWAY}"
        log.damage.append(Damage("time", what, topic, float(time[0]), float(time[-1])))
    return slice(int(first), int(last))


_AWAY = "are far from the flight and not used"


def _on_grid(
    log: _Log, signals: Iterable[_Signal], grid: Array
) -> tuple[dict[str, Array], dict[str, NDArray[np.uint8]]]:
    """Return channels and gap flags on the grid; fields of one topic share one resampler."""
    shared: dict[str, Resampler] = {}
    channels: dict[str, Array] = {}
    flags: dict[str, NDArray[np.uint8]] = {}
    for signal in signals:
        time, values = _times(log, signal.topic), signal.values
        near = _beside_grid(log, signal.topic, time, grid)
        time, values = time[near], values[near]
        good = np.isfinite(values)
        if not good.any():
            continue
        if good.all():
            if signal.topic not in shared:
                shared[signal.topic] = resampler(time, grid)
            to_grid = shared[signal.topic]
        else:
            to_grid, values = resampler(time[good], grid), values[good]
        channels[signal.name] = (
            to_grid(values)
            if signal.surface is None
            else _deflection(to_grid, values, signal.surface)
        )
        unknown = to_grid.gap
        if signal.surface is not None:
            # The deflection before the log begins is unknown: flag until the lag has settled.
            unknown = unknown | (grid < time[0] + SETTLED * signal.surface.lag)
        if unknown.any():
            flags[signal.name] = unknown * np.uint8(FLAGS["gap"])
    return channels, flags


def _deflection(to_grid: Resampler, command: Array, surface: Surface) -> Array:
    """Return the deflection [rad] on the grid of a command that is held until the next one.

    ``offset + scale * command`` within the surface's limits, then the lag.
    """
    time, grid = to_grid.time, to_grid.grid
    if len(time) > 2 and to_grid.step < 0.9 * to_grid.grid_step:
        base = uniform_grid(float(time[0]), float(time[-1]), to_grid.step)
    else:
        base = grid
    calibrated = np.clip(
        surface.offset + surface.scale * hold(time, command, base), *surface.limits
    )
    lagged = first_order_lag(calibrated, interval(base), surface.lag)
    return lagged if base is grid else resampler(base, grid)(lagged)


def _completed(flight: Flight, mapping: Mapping, vehicle: Vehicle) -> Flight:
    """Return the flight with constants of the vehicle file, combinations and derivable air data.

    Lists the channels that are still missing.
    """
    constants = {name: value for name, value in vehicle.configuration.items() if name not in flight}
    flight = flight.with_channels(
        {name: np.full(len(flight.time), value) for name, value in constants.items()}
    )
    notes = (
        *flight.notes,
        *(f"{name} = {value:g} from the vehicle file" for name, value in constants.items()),
    )
    flight = add_combinations(replace(flight, notes=notes), vehicle)
    flight = with_fuel_mass(flight, vehicle)
    flight = flag_captive(complete_air_data(air_data_at_cg(flight, vehicle)))
    known = [
        *(entry.name for entry in mapping.channel),
        *(name for derived in mapping.derived for name in derived.channels),
        *(f"delta_{name}" for name in vehicle.surfaces),
        *_named_by_vehicle(vehicle),
        *_EXPECTED,
    ]
    return replace(
        flight, missing=tuple(name for name in dict.fromkeys(known) if name not in flight)
    )
