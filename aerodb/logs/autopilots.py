"""What a log says of its aircraft, by the autopilot that wrote it."""

import numpy as np

from aerodb.flight import Flight
from aerodb.logs.ardupilot import ardupilot_hover, is_ardupilot, read_ardupilot
from aerodb.logs.autopilot import LoggedAircraft, px4_hover, read_px4
from aerodb.recording import Recording


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


def flag_hover(flight: Flight, recording: Recording) -> Flight:
    """Return the flight with ``hover`` flagged for all channels where rotors carry the aircraft
    (`hover_times`); flags are (n,)."""
    held = np.zeros(len(flight.time), dtype=bool)
    for start, end in hover_times(recording):
        held |= (flight.time >= start) & (flight.time <= end)
    return flight.with_flag("flight", "hover", held) if held.any() else flight
