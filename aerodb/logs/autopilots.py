"""What a log says of its aircraft, by the autopilot that wrote it."""

from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.flight import Flight
from aerodb.logs.ardupilot import ardupilot_hover, is_ardupilot, read_ardupilot
from aerodb.logs.autopilot import LoggedAircraft, only_hovers, px4_hover, read_px4
from aerodb.recording import Recording
from aerodb.vehicle import Vehicle

#: What a pitot tube and vanes tell.
_AIR: Final = ("V", "calibrated_airspeed", "qbar", "mach", "alpha", "beta")


def read_autopilot(recording: Recording) -> LoggedAircraft:
    """Return what the parameters of a PX4 or ArduPilot log say; empty for a log without parameters.

    Speeds [m/s], points (3,) [m]; see `read_px4`, `read_ardupilot`.
    """
    return read_ardupilot(recording) if is_ardupilot(recording) else read_px4(recording)


def hover_times(recording: Recording) -> tuple[tuple[float, float], ...]:
    """Return from when to when [s] rotors carry an aircraft that also has wings, by its autopilot's
    modes; empty where the log does not say."""
    if "VTOL" not in read_autopilot(recording).kind:
        return ()
    return ardupilot_hover(recording) if is_ardupilot(recording) else px4_hover(recording)


def with_hover(flight: Flight, recording: Recording, vehicle: Vehicle) -> Flight:
    """Return the flight with ``hover`` flagged for all channels where rotors carry the aircraft
    (`hover_times`); flags are (n,).

    Where the vehicle has rotors and the log only hovers, its hover counts, without the air data: a
    tube that points forward does not measure the flow of a hover.
    """
    if vehicle.rotors and only_hovers(recording):
        gone = [name for name in _AIR if name in flight]
        note = f"{', '.join(gone)} not used: the log only hovers, by the modes of its autopilot"
        return replace(
            flight,
            channels={k: values for k, values in flight.channels.items() if k not in gone},
            flags={k: bits for k, bits in flight.flags.items() if k not in gone},
            notes=(*flight.notes, note) if gone else flight.notes,
        )
    held = np.zeros(len(flight.time), dtype=bool)
    for start, end in hover_times(recording):
        held |= (flight.time >= start) & (flight.time <= end)
    return flight.with_flag("flight", "hover", held) if held.any() else flight
