"""Draft of a vehicle file from a log: what its autopilot states is filled in."""

from aerodb.logs.autopilot import LoggedAircraft, LoggedSurface
from aerodb.logs.inspection import median_interval
from aerodb.recording import Recording
from aerodb.vehicle import vehicle_template

_FIRST = "# One block per surface."
_END = "[thrust]\n"
_RATES = (
    *("vehicle_angular_velocity", "vehicle_acceleration", "sensor_combined"),
    *("airspeed_validated", "airspeed", "vehicle_local_position", "vehicle_attitude"),
    *("actuator_servos", "actuator_controls_0", "airflow_aoa", "airflow_slip"),
    *("IMU", "ATT", "ARSP", "BARO", "XKF1", "AETR", "RCOU"),
)


def draft_vehicle(name: str, recording: Recording, autopilot: LoggedAircraft) -> str:
    """Return the text of a vehicle file for the aircraft of a log.

    Geometry, masses and travel of the surfaces are in no log: they stay the template's, and
    `aerodb.vehicle.placeholders` names them until they are filled in.
    """
    text = vehicle_template(name)
    before, rest = text.split(_FIRST, 1)
    after = rest[rest.index(_END) :]
    middle = surface_blocks(autopilot) if autopilot.surfaces else _FIRST + rest[: rest.index(_END)]
    said = "".join(f"# {line}\n" for line in _said(recording, autopilot))
    return said + _with_points(before, autopilot) + middle + after


def _said(recording: Recording, autopilot: LoggedAircraft) -> list[str]:
    lines = [f"From the log {recording.source.rsplit('/', 1)[-1]}."]
    if autopilot.kind:
        lines.append(f"Airframe: {autopilot.kind}.")
    if autopilot.airspeeds:
        shown = ", ".join(f"{k.lower()} {v:g}" for k, v in autopilot.airspeeds.items())
        lines.append(f"Airspeeds of the autopilot [m/s]: {shown}.")
    lines += [f"{note}." for note in autopilot.notes]
    rates = [
        f"{topic} {1.0 / interval:.3g}"
        for topic in _RATES
        if topic in recording.topics
        and (interval := median_interval(recording.topics[topic].time)) == interval
    ]
    if rates:
        lines.append(f"Rates in the log [Hz]: {', '.join(rates)}.")
    return lines


def _with_points(text: str, autopilot: LoggedAircraft) -> str:
    for name, (x, y, z) in autopilot.points.items():
        note = f"# By the autopilot's parameters: {name} at {x:g}, {y:g}, {z:g} m from the CG\n"
        text = text.replace("[points]\n", f"[points]\n{note}")
    return text


def surface_blocks(autopilot: LoggedAircraft) -> str:
    """Return the text of the surfaces and combinations of a log; travel [deg] is a placeholder."""
    head = (
        "# Surfaces as the autopilot commands them: deflection = offset + scale * command, then a\n"
        "# first-order lag. Measure limits and scale: 25 deg is a placeholder. Trailing edge down\n"
        "# and left are positive here; autopilots command up and right, hence the minus.\n"
    )
    parts = [_surface(surface) for surface in autopilot.surfaces]
    for name, kind, right, left in autopilot.combinations:
        parts.append(
            f'[combinations.{name}]\nkind = "{kind}"\nright = "{right}"\nleft = "{left}"\n'
        )
    return head + "\n".join(parts) + "\n"


def _surface(surface: LoggedSurface) -> str:
    scale = "25 deg" if surface.sign > 0 else "-25 deg"
    doubt = "" if surface.stated else "   # sign: check it, the parameters do not state it"
    log = (
        f'log = {{topic = "{surface.topic}", field = "{surface.field}"}}\n' if surface.topic else ""
    )
    return (
        f'[surfaces.{surface.name}]\nlimits = ["-25 deg", "25 deg"]\nscale = "{scale}"{doubt}\n'
        f'lag = "0.05 s"\n{log}'
    )
