"""Conditioning findings of a log that is only inspected: nothing is stored, no vehicle is
needed."""

from dataclasses import replace
from typing import Any

from aerodb.conditioning import examine, flag_unusable, suspicion_documents, to_document
from aerodb.crosschecks import air_suspicions
from aerodb.errors import InputError
from aerodb.logs import Mapping, map_recording
from aerodb.recording import Recording
from aerodb.tasks.steps.conditioning import clocks_of
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


def look_over(recording: Recording, mapping: Mapping) -> dict[str, Any]:
    """Return likely faults, segments and delays of a recording, and notes on its channels.

    If it cannot become a flight, only its time stamps are checked, and ``refused`` says why.
    """
    try:
        flight = flag_unusable(map_recording(recording, mapping, parse_vehicle(_ANY)))
    except InputError as error:
        clocks = suspicion_documents(clocks_of(recording, mapping))
        return {
            "suspicions": clocks,
            "segments": [],
            "delays": [],
            "notes": [],
            "refused": str(error),
        }
    found = examine(flight, clocks_of(recording, mapping))
    known = {suspicion.channel for suspicion in found.suspicions}
    air = (each for each in air_suspicions(flight) if each.channel not in known)
    return {
        **to_document(replace(found, suspicions=(*found.suspicions, *air))),
        "notes": list(flight.notes),
        "refused": "",
    }
