"""Drafts of a vehicle that rotors carry, with what its log tells of the battery."""

from aerodb.coefficients import rotors_beside
from aerodb.conditioning import without_wild_points
from aerodb.errors import InputError
from aerodb.exchange import read_native
from aerodb.logs import LoggedAircraft, choose_mapping, draft_rotorcraft, usable_flight
from aerodb.recording import Recording
from aerodb.storage.mappings import builtin_mappings
from aerodb.suspicions import BATTERY, speed_by_voltage
from aerodb.vehicle import parse_vehicle, with_mass_channels


def drafted_rotorcraft(
    name: str, recording: Recording, autopilot: LoggedAircraft
) -> tuple[str, str, str]:
    """Return the text of a vehicle file and of a database (`draft_rotorcraft`), and the factor of
    the rotors' speed by the voltage of the battery [V]: empty unless the log itself tells it.

    The evidence is that by which `flight ingest` says that a battery takes thrust from all rotors
    (`rotor_suspicions`), of this log beside the draft without the factor.
    """
    vehicle, database = draft_rotorcraft(name, recording, autopilot)
    factor = _battery_factor(recording, vehicle, database)
    if factor:
        vehicle, database = draft_rotorcraft(name, recording, autopilot, factor)
    return vehicle, database, factor


def _battery_factor(recording: Recording, vehicle_text: str, database_text: str) -> str:
    vehicle, database = parse_vehicle(vehicle_text), read_native(database_text)
    mapping = choose_mapping(recording, builtin_mappings().values())
    try:
        flight = without_wild_points(usable_flight(recording, mapping, vehicle))
        flight = with_mass_channels(flight, vehicle)
        if BATTERY not in flight:
            return ""
        return speed_by_voltage(flight, rotors_beside(flight, vehicle, database))
    except InputError:
        return ""  # a log of which no coefficient can be computed tells nothing
