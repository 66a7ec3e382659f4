"""All checks of a flight against its vehicle."""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

from aerodb.conditioning import Conditioning, Suspicion, delays, ground_and_air, segments
from aerodb.flight import Flight
from aerodb.nomenclature import is_command, is_surface
from aerodb.remarks import Remark, sentences
from aerodb.suspicions.air import air_suspicions
from aerodb.suspicions.angles import angle_suspicions
from aerodb.suspicions.changing import CHANGED
from aerodb.suspicions.coarse import COARSE, coarse_suspicions
from aerodb.suspicions.commands import command_suspicions
from aerodb.suspicions.controls import UNMOVED, control_suspicions
from aerodb.suspicions.drag import drag_suspicions
from aerodb.suspicions.failed import FAILED, failed_suspicions
from aerodb.suspicions.faults_in_time import MOVED
from aerodb.suspicions.lift import lift_suspicions
from aerodb.suspicions.loads import POSSIBLE
from aerodb.suspicions.mass_events import mass_event_suspicions
from aerodb.suspicions.masses import mass_suspicions
from aerodb.suspicions.plausibility import suspicions
from aerodb.suspicions.surfaces import size_suspicions
from aerodb.vehicle import Vehicle

#: Channels from which lift and moments follow: with one of them wrong, nothing more is concluded.
_MOTION = frozenset(
    ("p", "q", "r", "alpha", "beta", "ax", "ay", "az", "ax_imu", "ay_imu", "az_imu", "V", "qbar")
)
#: What flight-path reconstruction cannot judge: it uses neither forces nor moments.
_OUT_OF_REACH = frozenset(
    ("rho", "temperature", "static_pressure", "qbar", "area", "mass", "Ixx", "Iyy", "Izz", "Ixz")
) | frozenset(("cg_x", "cg_y", "cg_z", "thrust"))


def against_vehicle(
    flight: Flight, vehicle: Vehicle, suspected: Collection[str] = ()
) -> tuple[Suspicion, ...]:
    """Return what contradicts physics in a flight and its vehicle file; empty for a good pair.

    flight : mapped and conditioned, with deflections calibrated by `vehicle`. suspected : channels
    that other checks suspect, of which nothing is said again. Lift and the effect of surfaces are
    judged if no channel of the motion is suspected, and the effect of surfaces if air and masses
    are right: correct what is named and run again.

    Channels (n,) are in SI units. Source: `docs/method/consistency.md`, section "Against the
    vehicle".
    """
    rotors = command_suspicions(flight, vehicle)
    listed = [*air_suspicions(flight), *mass_suspicions(flight, vehicle)]
    coarse = coarse_suspicions(flight, vehicle)
    moving = _MOTION.isdisjoint(suspected)
    angles = angle_suspicions(flight) if moving else ()
    listed += [each for each in angles if each.kind == "delay"]
    if moving and not listed:
        listed += lift_suspicions(flight, vehicle)
    pushed: tuple[Suspicion, ...] = ()
    if moving and not listed:
        pushed = (
            *drag_suspicions(flight, vehicle),
            *angles,
            *mass_event_suspicions(flight, vehicle),
        )
        listed += control_suspicions(flight, vehicle)
    else:
        listed += size_suspicions(flight, vehicle)
    return tuple(
        each for each in (*coarse, *listed, *pushed, *rotors) if each.channel not in suspected
    )


def limits_flight(suspicion: Suspicion) -> bool:
    """Return whether a suspicion limits the verdict on a flight: flight-path reconstruction judges
    motion with accelerometers and gyros that are in time, and a surface, a rotor's command, the
    density, masses and sizes are beyond its reach. A surface that may have stood still is no fault,
    nor is what aerodynamics may explain as well. Where a sensor failed, the stretch is left out,
    not the flight. Source: docs/method/consistency.md, section Verdict."""
    if suspicion.kind in (UNMOVED, POSSIBLE, FAILED):
        return False
    # seen beside a database, by forces and moments; or as it is recorded
    if suspicion.kind in (CHANGED, MOVED, COARSE):
        return True
    told = is_surface(suspicion.channel) or is_command(suspicion.channel)
    told |= suspicion.kind == "delay"  # of an accelerometer or a gyro
    return told or suspicion.channel in _OUT_OF_REACH


def examine(
    flight: Flight, clocks: tuple[Suspicion, ...] = (), vehicle: Vehicle | None = None
) -> Conditioning:
    """Return the findings on a flight whose unusable samples are flagged: those of conditioning,
    then what contradicts physics beside its vehicle, where that is known (`against_vehicle`).

    clocks : suspicions about the time stamps of its recording (`clock_suspicions`). Delays are
    estimated over the longest airborne stretch. Channels are (n,), sizes in [m].
    """
    size = None if vehicle is None else vehicle.reference
    span, chord = (None, None) if size is None else (size.span, size.chord)
    found = (*clocks, *failed_suspicions(flight), *suspicions(flight, span, chord))
    if vehicle is not None:
        suspected = {each.channel for each in found if each.kind != FAILED}
        found = (*found, *against_vehicle(flight, vehicle, suspected))
    late = delays(flight, during=_longest_in_the_air(flight))
    return Conditioning(found, segments(flight), late)


def _longest_in_the_air(flight: Flight) -> tuple[float, float] | None:
    """Return start and end [s] of the longest airborne stretch; None if airspeed is not known."""
    flown = [segment for segment in ground_and_air(flight) if segment.kind == "airborne"]
    longest = max(flown, key=lambda segment: segment.end - segment.start, default=None)
    return None if longest is None else (longest.start, longest.end)


def limited_document(document: Mapping[str, Any], remarks: Sequence[Remark]) -> dict[str, Any]:
    """Return the document of a consistent flight with what its reconstruction cannot judge as
    reasons: a good flight becomes limited.

    remarks : what contradicts its vehicle or a version, such as suspicions for which
        `limits_flight` holds.
    """
    if not remarks:
        return dict(document)
    word = "limited" if document["verdict"] == "good" else document["verdict"]
    return {
        **document,
        "verdict": word,
        "reasons": [*document["reasons"], *sentences(remarks)],
        "verdict_remarks": [
            *document["verdict_remarks"],
            *(remark.document() for remark in remarks),
        ],
    }
