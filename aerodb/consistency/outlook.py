"""What flight-path reconstruction can give a flight, before it is run."""

from aerodb.consistency.plan import TURN, turn_of
from aerodb.flight import Flight

#: Channels without which no path is integrated (`records.inertial_inputs`); either specific force.
_FORCES = (("ax", "ay", "az"), ("ax_imu", "ay_imu", "az_imu"))
_MOTION = ("p", "q", "r", "phi", "theta")
#: With these the wind is told from the motion, so that flow angles follow without a vane.
_PATH = ("V", "velocity_north", "velocity_east", "velocity_down")


def unmeasured_angles_outlook(flight: Flight) -> dict[str, dict[str, object]]:
    """Return what becomes of the flow angles that a flight lacks.

    Angle -> ``expected``, whether reconstruction can give it; ``lacking``, the channels without
    which it cannot; and for beta ``turn``, by how much the track turns, and ``turn_needed``
    [rad]. Whether its standard error is small enough shows only when it is run
    (docs/method/consistency.md, section "What a flight becomes").
    """
    forces = min(([name for name in names if name not in flight] for names in _FORCES), key=len)
    lacking = [*forces, *(name for name in (*_MOTION, *_PATH) if name not in flight)]
    turn = turn_of(flight.channels)
    found: dict[str, dict[str, object]] = {}
    if "alpha" not in flight and "probe_dp_alpha" not in flight:
        found["alpha"] = {"expected": not lacking, "lacking": lacking}
    if "beta" not in flight and "probe_dp_beta" not in flight:
        enough = not lacking and turn > TURN
        turned = {"turn": turn, "turn_needed": TURN}
        found["beta"] = {"expected": enough, "lacking": lacking, **turned}
    return found
