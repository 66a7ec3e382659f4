"""Drafts of a vehicle that rotors carry, with what its log tells of the battery."""

import math

import numpy as np

from aerodb.coefficients import as_inputs, compare, total_coefficients
from aerodb.conditioning import without_wild_points
from aerodb.errors import InputError
from aerodb.exchange import read_native
from aerodb.logs import LoggedAircraft, choose_mapping, draft_rotorcraft, usable_flight
from aerodb.recording import Recording
from aerodb.storage.mappings import builtin_mappings
from aerodb.support import half_interval
from aerodb.suspicions import BATTERY, rotor_suspicions
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
        coefficients = total_coefficients(flight, vehicle)
        beside = compare(flight, coefficients, database, vehicle.reference)
    except InputError:
        return ""  # a log of which no coefficient can be computed tells nothing
    found = rotor_suspicions(
        as_inputs(flight, database, beside.bandwidth),
        database,
        beside.measured,
        beside.predicted,
        beside.usable,
        beside.bandwidth,
    )
    told = [each.evidence for each in found if each.channel == BATTERY and each.kind == "sag"]
    if not told:
        return ""
    voltage = flight[BATTERY][flight.usable([BATTERY]) & (flight[BATTERY] > 0.0)]
    middle = float(f"{np.mean(voltage):.3g}")
    # Thrust goes with the square of the speed, and that of a plain motor with the voltage.
    power, share = float(told[0]["power"]), float(told[0]["share"])
    spread = half_interval(abs(power * float(told[0]["standard_error"]) / share))
    exponent = "" if math.isclose(power, 2.0, abs_tol=spread) else f"^{0.5 * power:.2g}"
    return f"({BATTERY}/{middle:g}){exponent}"
