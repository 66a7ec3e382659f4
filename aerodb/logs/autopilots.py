"""What a log says of its aircraft, by the autopilot that wrote it."""

from aerodb.logs.ardupilot import is_ardupilot, read_ardupilot
from aerodb.logs.autopilot import LoggedAircraft, read_px4
from aerodb.recording import Recording


def read_autopilot(recording: Recording) -> LoggedAircraft:
    """Return what the parameters of a PX4 or ArduPilot log say; empty for a log without parameters.

    Speeds [m/s], points (3,) [m]; see `read_px4`, `read_ardupilot`.
    """
    return read_ardupilot(recording) if is_ardupilot(recording) else read_px4(recording)
