"""The commented vehicle file that a user fills in, and what of it is left."""

from typing import Final

from aerodb.vehicle.description import Vehicle


def placeholders(vehicle: Vehicle) -> tuple[str, ...]:
    """Return what still is a template's value, where a whole group of them is: `vehicle_template`
    has a wing of 1 m2 and 5 kg.

    >>> from aerodb.vehicle import parse_vehicle
    >>> placeholders(parse_vehicle(vehicle_template("my-glider")))[1]
    'mass = 5 kg'
    """
    area, chord, span = (getattr(vehicle.reference, k) for k in ("area", "chord", "span"))
    mass = vehicle.mass
    inertia = (mass.Ixx, mass.Iyy, mass.Izz) == (0.4, 0.5, 0.8)
    found = []
    if (area, chord, span) == (1.0, 0.2, 2.0):
        found.append("reference area = 1 m2, chord = 0.2 m, span = 2 m")
    if mass.mass == 5.0 and (inertia or mass.cg == (-0.5, 0.0, 0.0)):
        found.append("mass = 5 kg")
    if inertia:
        found.append("Ixx, Iyy, Izz = 0.4, 0.5, 0.8 kg m2")
    if (mass.Ixx, mass.Iyy, mass.Izz) == UNKNOWN_INERTIA:
        found.append("Ixx, Iyy, Izz = 0.01, 0.01, 0.02 kg m2")
    return tuple(found)


#: Inertia [kg m2] about x, y, z of a multicopter that nothing tells.
UNKNOWN_INERTIA: Final = (0.01, 0.01, 0.02)


def vehicle_template(name: str) -> str:
    """Return a commented vehicle file to fill in, for a vehicle called `name`.

    >>> from aerodb.vehicle import parse_vehicle
    >>> parse_vehicle(vehicle_template("my-glider")).name
    'my-glider'
    """
    return _TEMPLATE.replace("NAME", name)


_TEMPLATE = """\
# Vehicle file of aerodb. Numbers are in SI; text with a unit ("6.5 ft", "-25 deg") is converted.
# Positions are in body axes (x forward, y right, z down) from a datum of your choice.
name = "NAME"
description = ""

[reference]
area = "1.0 m^2"       # reference area of CX CY CZ
chord = "0.2 m"        # reference length of Cm and q_hat
span = "2.0 m"         # full span: reference length of Cl, Cn, p_hat, r_hat

[points]
datum_note = "nose"
moment_reference = [-0.5, 0.0, 0.0]   # or "cg": moments about the moving CG
imu = [-0.45, 0.0, 0.0]               # where the accelerometers are, or "cg"
# air_data = [0.3, 0.0, 0.0]          # where V, alpha and beta are measured, when not at the CG
# gps = [-0.2, 0.0, -0.1]             # point of the logged position and velocity: GPS antenna, or
#                                     # the reference point of the navigation filter

[mass]
source = "constant"    # or "fuel_table" (lists over fuel_mass), or "channels" (logged)
mass = "5.0 kg"
cg = [-0.5, 0.0, 0.0]
Ixx = 0.4              # kg m2
Iyy = 0.5
Izz = 0.8
Ixz = 0.02

# One block per surface. If the log holds commands, state scale, offset and lag:
# deflection = offset + scale * command, then a first-order lag.
[surfaces.elevator]
limits = ["-25 deg", "25 deg"]
scale = "25 deg"
lag = "0.05 s"
# log = {topic = "actuator_servos", field = "control[1]"}

[thrust]
source = "unknown"     # "none" for a glider, "channel" if thrust is logged
# [thrust.engines.left]              # if each engine is logged: thrust_left, thrust_right
# point = [-1.2, -2.0, -0.3]
# direction = [1.0, 0.0, 0.0]

# [sensors.p]          # standard deviation of the noise; estimated from the data if not stated
# noise = "0.1 deg/s"

# [air_data]           # installation of the air-data probe
# orientation = ["0 deg", "0 deg", "0 deg"]   # roll, pitch, yaw of the boom
# upwash = [0.0, 0.0]  # fraction by which alpha and beta at the probe exceed the free stream's
# beta = "sideslip"    # or "flank", atan2(v, u), as measured by a free vane

# [processing]
# bandwidth = "5 Hz"   # of differentiated rates: about five times the short-period frequency

# [measured]           # what was measured outside flight: one sigma, in m for the CG, else a share.
# mass = {sigma = "0.2 %", by = "scales, 2026-03-01"}   # Tracing blames no error beyond three sigma
# cg_x = {sigma = "3 mm", by = "weighed"}               # on it.
# delta_elevator = {sigma = "0.5 %", by = "rig"}        # scale of the deflection

# [configuration]      # channels that are not logged and were constant
# delta_flap = 0.0
"""
