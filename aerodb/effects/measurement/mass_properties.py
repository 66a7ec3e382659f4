"""Errors of mass, centre of gravity, moments of inertia and thrust.

Tangents: mass ``(C qbar S + T)/(qbar S)`` per unit share, on the forces and through the arm on the
moments; CG: the moment of the forces about the displaced point, and the transfer of accelerometer
and air data over the changed arms; inertia ``dI wdot + w x (dI w)``; thrust: minus the thrust and
its moment; its line: minus the moment of the thrust about the displaced point. Forces and
accelerations are those of the model: with the measured ones, these columns would span any residual
(docs/method/tracing.md, section 4).

Believable size: mass 1-2 %, CG 1-2 cm, inertia 3-10 %, thrust 3-10 %, its line
1-5 cm. Source: 003, eqs. 1-4.
"""

from functools import partial

import numpy as np

from aerodb.effects.flight_view import FlightView
from aerodb.effects.hypothesis import Columns, Hypothesis
from aerodb.effects.measurement.sensor import added, predicted_change, sensor
from aerodb.effects.measurement.sensor_flow_angles import moved_probe
from aerodb.effects.template import LibraryContext, Template
from aerodb.physics import inertial_moment, specific_force_at_cg

SOURCE = "003, eqs. 1-4"
INERTIAS = ("Ixx", "Iyy", "Izz", "Ixz")
#: Chords by which the CG and the thrust line are off, one sigma: drawings and weighings leave a
#: centimetre or two.
_PLACED = 0.005
#: Chords by which the thrust line may be off at most: a pod taken above the wing that is below it.
_FARTHEST_LINE = 0.5


def mass(view: FlightView) -> Columns:
    """Columns of mass_error, the share by which the assumed mass is too large.

    Each column is (n,), dimensionless.
    """
    return view.as_coefficients(view.force, np.zeros_like(view.force))


def centre_of_gravity(view: FlightView, axis: str) -> Columns:
    """Columns of cg_offset, 1/m: the CG is assumed further along body `axis` than it is.

    Each column is (n,), in the unit 1/m.
    """
    unit = np.broadcast_to(np.eye(3)["xyz".index(axis)], view.cg.shape)
    force = np.zeros_like(view.cg)
    if view.imu_arm.any():
        moved = specific_force_at_cg(
            np.zeros_like(view.cg), view.rates, view.angular_acceleration, -unit
        )
        force = view["mass"][:, None] * moved
    placed = view.force if view.thrust_moment.any() else view.force - view.thrust
    columns = view.as_coefficients(force, np.cross(unit, placed))
    if not view.air_data_arm.any():
        return columns
    return added(columns, predicted_change(view, **moved_probe(view, axis)))


def inertia(view: FlightView, name: str) -> Columns:
    """Columns of inertia_error, the share by which the assumed `name` is too large; of Ixz a share
    of sqrt(Ixx Izz)."""
    only = {other: np.zeros(len(view.time)) for other in INERTIAS}
    only[name] = np.sqrt(view["Ixx"] * view["Izz"]) if name == "Ixz" else view[name]
    moment = inertial_moment(view.rates, view.angular_acceleration, only)
    return view.as_coefficients(np.zeros_like(moment), moment)


def thrust(view: FlightView) -> Columns:
    """Columns of thrust_scale, the share by which the assumed thrust is too large.

    Each column is (n,), dimensionless.
    """
    return view.as_coefficients(-view.thrust, -view.thrust_moment)


def thrust_line(view: FlightView, axis: str) -> Columns:
    """Columns of thrust_line_offset, 1/m: the thrust is assumed to act further along body `axis`
    than it does.

    Each column is (n,), in the unit 1/m.
    """
    unit = np.eye(3)["xyz".index(axis)]
    return view.as_coefficients(np.zeros_like(view.thrust), np.cross(view.thrust, unit))


def _mass(context: LibraryContext) -> list[Hypothesis]:
    return [
        sensor(
            context,
            "mass_error",
            "mass_share",
            mass,
            unit="1",
            plausible=(-0.2, 0.2),
            natural=0.01,
            because="the vehicle is lighter or heavier than assumed",
            formula="(C*qbar*S + T)/(qbar*S), and its moment about the moment reference",
            needs=("qbar",),
            source=SOURCE,
            measured=("mass",),
        )
    ]


def _centre_of_gravity(context: LibraryContext) -> list[Hypothesis]:
    chord = context.vehicle.reference.chord
    return [
        sensor(
            context,
            "cg_offset",
            f"cg_{axis}_offset",
            partial(centre_of_gravity, axis=axis),
            unit="m",
            plausible=(-round(0.2 * chord, 6), round(0.2 * chord, 6)),
            natural=round(_PLACED * chord, 6),
            because=f"the centre of gravity lies elsewhere along {axis} than assumed",
            formula=f"e_{axis} x (F + T)/(qbar*S*l), and what accelerometer and probe are moved by",
            needs=("p", "q", "r", "qbar"),
            source=SOURCE,
            subject=axis,
            measured=(f"cg_{axis}",),
        )
        for axis in "xyz"
    ]


def _inertia(context: LibraryContext) -> list[Hypothesis]:
    return [
        sensor(
            context,
            "inertia_error",
            f"{name}_share",
            partial(inertia, name=name),
            unit="1",
            plausible=(-0.4, 0.4),
            natural=0.02 if name == "Ixz" else 0.03,
            because=f"the moment of inertia {name} is other than assumed",
            formula="(dI*wdot + w x dI*w)/(qbar*S*l)",
            needs=("p", "q", "r", "qbar"),
            source=SOURCE,
            subject=name,
            measured=(name,),
        )
        for name in INERTIAS
    ]


def _thrust(context: LibraryContext) -> list[Hypothesis]:
    if context.vehicle.thrust.source != "channel":
        return []
    return [
        sensor(
            context,
            "thrust_scale",
            "thrust_scale",
            thrust,
            unit="1",
            plausible=(-0.6, 0.6),
            natural=0.05,
            because="thrust is smaller or larger than assumed",
            formula="-T/(qbar*S), and its moment",
            needs=("thrust", "qbar"),
            source=SOURCE,
            measured=("thrust",),
        )
    ]


def _thrust_line(context: LibraryContext) -> list[Hypothesis]:
    """Across the line only: along it, which is nearly x, nothing changes."""
    if context.vehicle.thrust.source != "channel":
        return []
    chord = context.vehicle.reference.chord
    farthest = round(_FARTHEST_LINE * chord, 6)
    return [
        sensor(
            context,
            "thrust_line_offset",
            f"thrust_line_{axis}",
            partial(thrust_line, axis=axis),
            unit="m",
            plausible=(-farthest, farthest),
            natural=round(_PLACED * chord, 6),
            because=f"the thrust line lies elsewhere along {axis} than assumed",
            formula=f"T x e_{axis}/(qbar*S*l)",
            needs=("thrust", "qbar"),
            source=SOURCE,
            subject=axis,
        )
        for axis in "yz"
    ]


MASS = Template("mass_error", "sensor", "(C*qbar*S + T)/(qbar*S), and its moment", SOURCE, _mass)
CG = Template(
    "cg_offset", "sensor", "e x (F + T)/(qbar*S*l), and the arms", SOURCE, _centre_of_gravity
)
INERTIA = Template("inertia_error", "sensor", "(dI*wdot + w x dI*w)/(qbar*S*l)", SOURCE, _inertia)
THRUST = Template("thrust_scale", "sensor", "-T/(qbar*S), and its moment", SOURCE, _thrust)
THRUST_LINE = Template("thrust_line_offset", "sensor", "T x e/(qbar*S*l)", SOURCE, _thrust_line)
TEMPLATES = (MASS, CG, INERTIA, THRUST, THRUST_LINE)
