"""All checks of a flight against its vehicle."""

from collections.abc import Collection

from aerodb.conditioning import Suspicion
from aerodb.crosschecks.air import air_suspicions
from aerodb.crosschecks.controls import control_suspicions
from aerodb.crosschecks.lift import lift_suspicions
from aerodb.crosschecks.masses import mass_suspicions
from aerodb.crosschecks.surfaces import size_suspicions
from aerodb.flight import Flight
from aerodb.nomenclature import is_surface
from aerodb.vehicle import Vehicle

#: Channels from which lift and moments follow: with one of them wrong, nothing more is concluded.
_MOTION = frozenset(
    ("p", "q", "r", "alpha", "beta", "ax", "ay", "az", "ax_imu", "ay_imu", "az_imu", "V", "qbar")
)
#: What flight-path reconstruction cannot judge: it uses neither forces nor moments.
_OUT_OF_REACH = frozenset(
    ("rho", "temperature", "static_pressure", "qbar", "area", "mass", "Ixx", "Iyy", "Izz", "Ixz")
) | frozenset(("cg_x", "cg_y", "cg_z"))


def against_vehicle(
    flight: Flight, vehicle: Vehicle, suspected: Collection[str] = ()
) -> tuple[Suspicion, ...]:
    """Return what contradicts physics in a flight and its vehicle file; empty for a good pair.

    flight : mapped and conditioned, with deflections calibrated by `vehicle`. suspected : channels
    that other checks suspect, of which nothing is said again. Lift and the effect of surfaces are
    judged if no channel of the motion is suspected, and the effect of surfaces if air and masses
    are right: correct what is named and run again.
    """
    listed = [*air_suspicions(flight), *mass_suspicions(flight, vehicle)]
    moving = _MOTION.isdisjoint(suspected)
    if moving and not listed:
        listed += lift_suspicions(flight, vehicle)
    if moving and not listed:
        listed += control_suspicions(flight, vehicle)
    else:
        listed += size_suspicions(flight, vehicle)
    return tuple(each for each in listed if each.channel not in suspected)


def limits_flight(suspicion: Suspicion) -> bool:
    """Whether a suspicion limits the verdict on a flight: flight-path reconstruction judges motion,
    and a surface, the density, masses and sizes are beyond its reach."""
    return is_surface(suspicion.channel) or suspicion.channel in _OUT_OF_REACH
