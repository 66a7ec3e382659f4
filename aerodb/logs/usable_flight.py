"""A recording as a flight that can be used: mapped, its unusable samples flagged, or refused with
what would help."""

from dataclasses import replace

import numpy as np

from aerodb.conditioning import Suspicion, clock_suspicions, flag_unusable, wheel_speed
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.logs.autopilot import wingless_sentence
from aerodb.logs.autopilots import read_autopilot
from aerodb.logs.completeness import airspeed_remedy
from aerodb.logs.found_channels import with_mapped_clock
from aerodb.logs.mapping import map_recording
from aerodb.logs.mapping_file import Mapping
from aerodb.nomenclature import FLAGS
from aerodb.recording import Recording
from aerodb.vehicle import Vehicle

_MOTION = ("ax", "ay", "az", "ax_imu", "ay_imu", "az_imu", "p", "q", "r")


def usable_flight(
    recording: Recording, mapping: Mapping, vehicle: Vehicle, flight_id: str = ""
) -> Flight:
    """Return the conditioned flight of a recording: `map_recording`, with wild points and samples
    on the ground flagged; values stay as measured.

    Raises InputError if no coefficient could be computed from it, and no roll on wheels used.
    """
    try:
        flight = replace(
            map_recording(recording, mapping, vehicle, flight_id=flight_id),
            log_sha256=recording.sha256,
        )
    except InputError as error:
        causes = [suspicion.sentence for suspicion in mapped_clock_suspicions(recording, mapping)]
        raise InputError("; ".join([error.what, *causes]), error.where, error.remedy) from error
    flight = flag_unusable(flight)
    useless = no_axis(recording, mapping, flight)
    if useless is not None:
        raise useless
    return flight


def no_axis(recording: Recording, mapping: Mapping, flight: Flight) -> InputError | None:
    """Return why no coefficient can be computed from a mapped flight, and what would help; None
    where one can, and where rolls on wheels can be used all the same.

    Channels are (n,).
    """
    bits = flight.flags.get("qbar")
    failed = bits is not None and bool(np.all(bits.astype(np.uint16) & FLAGS["failed"]))
    if "qbar" in flight and not failed and any(name in flight for name in _MOTION):
        return None
    if wheel_speed(flight) is not None:  # its rolls tell of the legs
        return None
    what = "no axis can be computed: dynamic pressure with specific force or body rates is needed"
    remedy = f"aerodb log inspect shows what mapping {mapping.name} finds in it"
    kind = read_autopilot(recording)
    if failed:
        what = "the airspeed failed throughout: without dynamic pressure no axis can be computed"
        remedy = "check the pitot tube and its hoses; if a second sensor is logged, map that one"
    elif not kind.described:
        what += f"; {wingless_sentence(kind)}"
    elif kind.rotors.logged:
        what += f"; the log is of a {kind.kind}, whose rotors the vehicle file does not name"
        remedy = "aerodb vehicle init NAME --from LOG writes [rotors] for it, and a database"
    elif "qbar" not in flight and "V" in flight:
        remedy += "; airspeed needs an air density: map it, or static pressure, or an altitude"
    elif "qbar" not in flight:
        remedy = "; ".join([remedy, *airspeed_remedy(("qbar", "V"))])
    return InputError(what, recording.source, remedy)


def mapped_clock_suspicions(recording: Recording, mapping: Mapping) -> tuple[Suspicion, ...]:
    """Return the topics whose time stamps do not overlap the others'; none if the mapping has no
    time.

    Stamps are (n,) [s].
    """
    try:
        return clock_suspicions(with_mapped_clock(recording, mapping))
    except InputError:
        return ()
