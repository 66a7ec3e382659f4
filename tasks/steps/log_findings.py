"""What a log that is only inspected shows, found in a process of its own: `aerodb.tasks.steps
.inspect_log` starts it, and imports none of the science that is used here."""

from dataclasses import replace
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from typing import Any, Final

import numpy as np

from aerodb.conditioning import flag_unusable, suspicion_documents, to_document
from aerodb.consistency import unmeasured_angles_outlook
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.logs import (
    Mapping,
    Signals,
    channels_found,
    map_recording,
    mapped_clock_suspicions,
    no_axis,
    numeric_fields,
    read_autopilot,
    stated_units,
    with_mapped_clock,
    zero_channels,
)
from aerodb.nomenclature import POSITIONS, is_surface
from aerodb.physics import HIGHEST_LATITUDE, Earth
from aerodb.recording import Recording
from aerodb.report import decimated, extremes
from aerodb.storage.files import open_recording
from aerodb.support import Array
from aerodb.suspicions import air_suspicions, examine, start_suspicions
from aerodb.tasks.steps.inspect_log import SERVOS, PlottedLog, Wanted, refused
from aerodb.vehicle import LoggedRotor, LogSource, Vehicle, parse_vehicle

#: Most fields of one topic that are plotted unasked.
_MOST_SERVOS: Final = 6
#: Samples of a field that are looked at to see whether it varies.
_LOOKED_AT: Final = 100_000

#: Enough of a vehicle to map a log: sensors count as being at the CG, and commands are not used.
_ANY = """
name = "any"
[reference]
area = 1.0
chord = 1.0
span = 1.0
[points]
moment_reference = "cg"
[mass]
source = "channels"
"""


def looked_over(topics: Path, log: str, mapping: Mapping) -> dict[str, Any]:
    """Return the document of `look_over`."""
    recording = with_mapped_clock(replace(open_recording(topics), source=log), mapping)
    return _found(recording, mapping)[0]


def _found(recording: Recording, mapping: Mapping) -> tuple[dict[str, Any], Flight | None]:
    """Return the document of `look_over`, and the flight. Of a log that cannot become a flight,
    only time stamps are checked."""
    try:
        flight = flag_unusable(map_recording(recording, mapping, _vehicle(recording)))
        unusable = no_axis(recording, mapping, flight)
    except InputError as error:
        if isinstance(error.__cause__, MemoryError):
            raise
        suspicions = suspicion_documents(mapped_clock_suspicions(recording, mapping))
        return refused(error, suspicions), None
    dropped = zero_channels(recording, mapping) if mapping.zero_is_missing else ()
    logged = set(channels_found(recording, mapping)[0]).difference(dropped)
    found = examine(flight, mapped_clock_suspicions(recording, mapping))
    known = {suspicion.channel for suspicion in found.suspicions}
    air = (each for each in air_suspicions(flight) if each.channel not in known)
    start = start_suspicions(recording.start_utc, datetime.now(UTC))
    document = {
        **to_document(replace(found, suspicions=(*found.suspicions, *air, *start))),
        "notes": list(flight.notes),
        "refused": "",
        "unusable": "" if unusable is None else unusable.what,
        "rate": 1.0 / flight.step,
        "duration": flight.duration,
        "computed": [name for name in flight.channels if name not in logged],
        "outlook": unmeasured_angles_outlook(flight),
    }
    return document, flight


def _vehicle(recording: Recording) -> Vehicle:
    """Enough of a vehicle to map a log, with the rotors that the log tells."""
    rotors = {
        rotor.name: LoggedRotor(
            log=LogSource(topic=rotor.topic, field=rotor.field), range=(rotor.low, rotor.high)
        )
        for rotor in read_autopilot(recording).rotors.rotors
        if rotor.topic
    }
    return parse_vehicle(_ANY).model_copy(update={"rotors": rotors})


def plotted(topics: Path, log: str, mapping: Mapping | None, wanted: Wanted) -> PlottedLog:
    """Return what `plot_log` returns: times [s] and lines (n,) in SI."""
    recording, found, flight = replace(open_recording(topics), source=log), None, None
    if mapping is not None:
        try:
            recording = with_mapped_clock(recording, mapping)
            found, flight = _found(recording, mapping)
        except InputError as error:
            found = refused(error, [])
    signals = Signals(recording, flight, stated_units(mapping), wanted.formulas)
    names = wanted.panels or _first_panels(recording, flight, wanted)
    panels = tuple(
        tuple(
            replace(signal, time=time, values=values)
            for signal in map(signals.__getitem__, panel)
            for time, values in [decimated(signal.time, signal.values, wanted.points)]
        )
        for panel in names
    )
    return PlottedLog(found, panels, _track(flight, wanted.points), signals.start)


def _first_panels(
    recording: Recording, flight: Flight | None, wanted: Wanted
) -> list[tuple[str, ...]]:
    """Return the panels of a log of which nothing is named: channels, surfaces, and what the servos
    were told; fields of any topic that vary, where it cannot become a flight."""
    told = next((name for name in SERVOS if name in recording.topics), None)
    servos = [] if told is None else _varying(recording, told)
    if flight is None:
        fields = (x for name in recording.topics for x in _varying(recording, name))
        return [(name,) for name in islice(fields, wanted.most)]
    surfaces = sorted(filter(is_surface, flight.channels))
    names = [*(name for name in wanted.first if name in flight), *surfaces]
    panels: list[tuple[str, ...]] = [(name,) for name in names[: wanted.most - bool(servos)]]
    return [*panels, tuple(servos)] if servos else panels


def _varying(recording: Recording, topic: str) -> list[str]:
    """Return the first numeric fields of a topic that vary, as ``TOPIC:FIELD``."""
    fields = recording.topics[topic].fields
    found = (
        f"{topic}:{name}"
        for name in numeric_fields(recording, topic)
        if len(np.unique(np.asarray(fields[name], dtype=np.float64)[:_LOOKED_AT])) > 1
    )
    return list(islice(found, _MOST_SERVOS))


def _track(flight: Flight | None, points: int) -> Array | None:
    if flight is None:
        return None
    pair = next((p for p in POSITIONS if all(name in flight for name in p)), None)
    if pair is None:
        return None
    path = np.array([flight.time - flight.time[0], *(flight[name] for name in pair)])
    path = path[:, np.isfinite(path).all(axis=0)]
    if not path.shape[1]:
        return None
    if pair[0] == "latitude":
        if abs(path[1, 0]) >= HIGHEST_LATITUDE:
            return None
        path[1:] = Earth(*path[1:, 0]).to_local(path[1], path[2])
    chosen = [extremes(row, points) for row in path[1:]]
    return np.asarray(path[:, np.unique(np.concatenate(chosen))])
