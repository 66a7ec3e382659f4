"""Conversion of a Recording to a Flight: choice of the mapping, channels, common time grid."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.logs.air_data import complete_air_data
from aerodb.logs.autopilots import with_hover
from aerodb.logs.captive import flag_captive
from aerodb.logs.completeness import consequences_of_missing
from aerodb.logs.derivations import METHODS
from aerodb.logs.found_channels import EXPECTED
from aerodb.logs.fuel import with_fuel_mass
from aerodb.logs.mapped_log import FieldValues, MappedLog
from aerodb.logs.mapping_file import ChannelMapping, Derived, Mapping, Source, parse_mapping
from aerodb.logs.time_grid import LoggedSignal, common_grid, on_grid
from aerodb.nomenclature import POSITIONS, UNNEEDED, WHEELS, channel, hinge_moment_of, is_command
from aerodb.recording import Recording
from aerodb.support import Array
from aerodb.vehicle import (
    Hinge,
    LogSource,
    Vehicle,
    add_combinations,
    air_data_at_cg,
    with_flow_over_ground,
)

__all__ = ["Mapping", "choose_mapping", "consequences_of_missing", "map_recording", "parse_mapping"]


_RATES = ("p", "q", "r")
_OVER_GROUND = ("velocity_north", "velocity_east", *(name for pair in POSITIONS for name in pair))
_ACCELERATIONS = ("ax", "ay", "az", "ax_imu", "ay_imu", "az_imu")
_WRAPPING = ("phi", "psi", "longitude")


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
    states, or a log with neither accelerations nor rates nor, beside commands of wheels, places.
    """
    log = MappedLog(recording, mapping)
    signals, notes = _signals(log, vehicle)
    essential = [s for s in signals.values() if s.name in (*_RATES, *_ACCELERATIONS)]
    if not essential and any(name in signals for name in WHEELS):
        # A roll on wheels needs its place or its velocity over the ground only.
        essential = [s for s in signals.values() if s.name in _OVER_GROUND]
    if not essential:
        what = (
            f"no accelerations and no rates found with mapping {mapping.name}: no coefficient can"
            " be computed"
        )
        raise InputError(
            what, recording.source, "choose another mapping, or write a mapping file for this log"
        )
    grid, note = common_grid(log, essential, vehicle)
    channels, flags = on_grid(log, signals.values(), grid)
    flight = Flight(
        id=flight_id or recording.sha256[:12],
        vehicle=vehicle.name,
        time=grid,
        channels=channels,
        flags=flags,
        notes=(note, *log.choices, *notes),
        damage=(*recording.damage, *log.damage),
        start_utc=recording.start_utc,
        log_sha256=recording.sha256,
        mapping=mapping.name,
        estimated=frozenset(signal.name for signal in signals.values() if signal.estimated),
    )
    return _completed(with_hover(flight, recording, vehicle), mapping, vehicle)


def _signals(log: MappedLog, vehicle: Vehicle) -> tuple[dict[str, LoggedSignal], list[str]]:
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
        elif f"delta_{name}" not in entries and "p" in entries:
            # A field beside the rates that bears the channel's own name is that surface.
            place = Source(topic=entries["p"].sources[0].topic, field=f"delta_{name}")
            entries[f"delta_{name}"] = ChannelMapping(name=f"delta_{name}", sources=(place,))
    calibrated = {f"delta_{name}": surface for name, surface in vehicle.surfaces.items()}
    for name, rotor in vehicle.rotors.items():
        place = Source(topic=rotor.log.topic, field=rotor.log.field, unit="1")
        entries[f"command_{name}"] = ChannelMapping(name=f"command_{name}", sources=(place,))
        calibrated[f"command_{name}"] = rotor.calibration
    for name, surface in vehicle.surfaces.items():
        if surface.hinge is not None and surface.hinge.log is not None:
            channel_name, _ = hinge_moment_of(name)
            entries[channel_name] = ChannelMapping(
                name=channel_name, sources=(_hinge_source(surface.hinge.log, surface.hinge),)
            )
    for name, logged in _named_by_vehicle(vehicle).items():
        sources = (Source(topic=logged.topic, field=logged.field, unit=logged.unit or None),)
        entries[name] = ChannelMapping(name=name, sources=sources)
    signals: dict[str, LoggedSignal] = {}
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
            signals[entry.name] = LoggedSignal(
                entry.name,
                located.topic,
                located.values,
                calibrated.get(entry.name) if entry.command or is_command(entry.name) else None,
                located.estimated,
            )
        elif entry.name in (*_RATES, *_ACCELERATIONS):
            _refuse_broken_clock(log, entry)
    for derived in log.mapping.derived:
        if not any(name in signals for name in derived.channels):
            signals.update({signal.name: signal for signal in _derive(log, derived)})
    return signals, notes


def _hinge_source(logged: LogSource, hinge: Hinge) -> Source:
    """Where a hinge moment [N m] is logged, or a force that is one by its gearing [m]."""
    place = Source(topic=logged.topic, field=logged.field, unit=logged.unit or None)
    if hinge.gearing is None:
        return place
    return place.model_copy(update={"scale": hinge.gearing, "unit": f"{logged.unit} m"})


def _named_by_vehicle(vehicle: Vehicle) -> dict[str, LogSource]:
    """Channel -> its place in the log, of the channels that no mapping knows."""
    places = {} if vehicle.fuel is None else dict(vehicle.fuel.channels)
    for source, solution in vehicle.navigation.items():
        places |= {f"{base}_{source}": place for base, place in solution.channels.items()}
    return places


def _refuse_broken_clock(log: MappedLog, entry: ChannelMapping) -> None:
    """Raise the clock error of a topic that has a rate or acceleration; others are optional."""
    for source in entry.sources:
        location = log.locate(source)
        if location is not None and location.topic in log.refused:
            raise log.refused[location.topic]


def _first(log: MappedLog, entry: ChannelMapping) -> FieldValues | None:
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


def _derive(log: MappedLog, derived: Derived) -> list[LoggedSignal]:
    """Return the channels of a derivation; none unless all of its sources are present."""
    method = METHODS[derived.method]
    unit = method.input_unit or channel(derived.channels[0]).unit
    signals = [log.read(source, unit) for source in derived.sources]
    present = [entry for entry in signals if entry is not None]
    if len(present) < len(signals):
        return []
    results = method.compute(*(entry.values for entry in present))
    topic = present[0].topic
    estimated = any(source.estimated for source in derived.sources)
    return [
        LoggedSignal(
            name, topic, _unwrapped(values) if name in _WRAPPING else values, estimated=estimated
        )
        for name, values in zip(derived.channels, results, strict=True)
    ]


def _unwrapped(values: Array) -> Array:
    """Return angles [rad] without jumps of a full turn; non-finite samples stay as they are."""
    good = np.isfinite(values)
    result = values.copy()
    result[good] = np.unwrap(values[good])
    return result


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
    flight = with_flow_over_ground(air_data_at_cg(flight, vehicle), vehicle)
    flight = flag_captive(complete_air_data(flight))
    known = [
        *(entry.name for entry in mapping.channel),
        *(name for derived in mapping.derived for name in derived.channels),
        *(f"delta_{name}" for name in vehicle.surfaces),
        *(f"command_{name}" for name in vehicle.rotors),
        *(hinge_moment_of(name)[0] for name, each in vehicle.surfaces.items() if each.hinge),
        *_named_by_vehicle(vehicle),
        *EXPECTED,
    ]
    there = {*flight.channels, *UNNEEDED}
    return replace(
        flight, missing=tuple(name for name in dict.fromkeys(known) if name not in there)
    )
