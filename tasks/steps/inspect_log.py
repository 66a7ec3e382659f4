"""Conditioning findings of a log that is only inspected: nothing is stored, no vehicle is
needed."""

from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from aerodb.conditioning import flag_unusable, suspicion_documents, to_document
from aerodb.consistency import unmeasured_angles_outlook
from aerodb.errors import InputError
from aerodb.logs import (
    Mapping,
    channels_found,
    map_recording,
    mapped_clock_suspicions,
    no_axis,
    with_mapped_clock,
    zero_channels,
)
from aerodb.storage.files import open_recording
from aerodb.suspicions import air_suspicions, examine, start_suspicions
from aerodb.tasks.workers import confined
from aerodb.vehicle import parse_vehicle

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


def look_over(topics: Path, log: str, mapping: Mapping, workspace: str) -> dict[str, Any]:
    """Return likely faults, segments and delays of a parsed log, and notes on its channels.

    topics : folder of its topics. log : its name, for errors. If it cannot become a flight within
    the limits of the workspace, ``refused`` says why; ``unusable``, why it gives no coefficient.
    ``rate`` [Hz] and ``duration`` [s] are of the flight, ``computed`` its channels that no field
    holds, ``outlook`` that of its flow angles (`aerodb.consistency.unmeasured_angles_outlook`).
    """
    try:
        return confined(
            _looked_over,
            topics,
            log,
            mapping,
            workspace=workspace,
            flight=log,
            what="the conversion into a flight",
            where=log,
        )
    except InputError as error:
        return _refused(error, [])


def _refused(error: InputError, suspicions: list[dict[str, Any]]) -> dict[str, Any]:
    return {
        "unusable": error.what,
        "rate": None,
        "duration": None,
        "computed": [],
        "outlook": {},
        "suspicions": suspicions,
        "segments": [],
        "delays": [],
        "notes": [],
        "refused": str(error),
    }


def _looked_over(topics: Path, log: str, mapping: Mapping) -> dict[str, Any]:
    """Return the document of `look_over`; the work of a confined process. Of a log that cannot
    become a flight, only time stamps are checked."""
    recording = with_mapped_clock(replace(open_recording(topics), source=log), mapping)
    try:
        flight = flag_unusable(map_recording(recording, mapping, parse_vehicle(_ANY)))
        unusable = no_axis(recording, mapping, flight)
    except InputError as error:
        if isinstance(error.__cause__, MemoryError):
            raise
        return _refused(error, suspicion_documents(mapped_clock_suspicions(recording, mapping)))
    dropped = zero_channels(recording, mapping) if mapping.zero_is_missing else ()
    logged = set(channels_found(recording, mapping)[0]).difference(dropped)
    found = examine(flight, mapped_clock_suspicions(recording, mapping))
    known = {suspicion.channel for suspicion in found.suspicions}
    air = (each for each in air_suspicions(flight) if each.channel not in known)
    start = start_suspicions(recording.start_utc, datetime.now(UTC))
    return {
        **to_document(replace(found, suspicions=(*found.suspicions, *air, *start))),
        "notes": list(flight.notes),
        "refused": "",
        "unusable": "" if unusable is None else unusable.what,
        "rate": 1.0 / flight.step,
        "duration": flight.duration,
        "computed": [name for name in flight.channels if name not in logged],
        "outlook": unmeasured_angles_outlook(flight),
    }
