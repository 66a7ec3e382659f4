"""What is taken from JSBSim's aircraft and how they are flown to show it."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache
from xml.etree import ElementTree

import numpy as np

from aerodb.flight import Flight
from aerodb.vehicle import Vehicle
from tests.support.jsbsim_campaign import (
    PUSHER,
    Aircraft,
    Edit,
    Plan,
    as_logged,
    doublet,
    flown,
    imported,
    ladder,
    one_branch,
    pulses,
    pushed,
    ramp,
    scaled_slope,
    set_to_one,
    together,
    vehicle_of,
    without,
)
from tests.support.jsbsim_flights import INCH

IDENTIFIED, FLOWN = 6, 8

_GEAR = {"delta_landing_gear": ("gear/gear-pos-norm", 1.0)}
F16 = Aircraft(
    "f16",
    {
        "delta_aileron": ("fcs/aileron-pos-rad", 1.0),
        "delta_flaperon": ("fcs/flaperon-mix-rad", 1.0),
        "delta_leading_edge_flap": ("fcs/lef-pos-rad", 1.0),
        "delta_speedbrake": ("fcs/speedbrake-pos-rad", 1.0),
        **_GEAR,
    },
    {
        "fcs/aileron-pos-rad": "delta_aileron",
        "fcs/flaperon-mix-rad": "delta_flaperon",
        "fcs/lef-pos-rad": "delta_leading_edge_flap",
    },
    ("propulsion/engine/thrust-lbs",),
    (0.0, 0.0, 0.0),
)
B737 = Aircraft(
    "737",
    {
        "delta_aileron": ("fcs/left-aileron-pos-rad", -1.0),
        "delta_flap": ("fcs/flap-pos-norm", 1.0),
        "delta_speed_brake": ("fcs/speedbrake-pos-norm", 1.0),
        **_GEAR,
    },
    {
        "fcs/flap-pos-norm": "delta_flap",
        "fcs/speedbrake-pos-norm": "delta_speed_brake",
        "fcs/spoiler-pos-norm": "0",
    },
    ("propulsion/engine[0]/thrust-lbs", "propulsion/engine[1]/thrust-lbs"),
    (-540 * INCH, 0.0, 40 * INCH),
)
C172P = Aircraft(
    "c172p",
    {"delta_aileron": ("fcs/left-aileron-pos-rad", -1.0), "delta_flap": ("fcs/flap-pos-rad", 1.0)},
    {},
    (PUSHER,),
    (37.7 * INCH, 0.0, -26.6 * INCH),
    pushed,
)
TEXAN = Aircraft(
    "t6texan2",
    {
        "delta_aileron": ("fcs/left-aileron-pos-rad", -1.0),
        "delta_flap": ("fcs/flap-pos-rad", 1.0),
        **_GEAR,
    },
    {},
    (PUSHER,),
    (-12.0 * INCH, 0.0, 0.0),
    pushed,
)
A320 = Aircraft(
    "A320",
    {**B737.channels, "delta_flap": ("fcs/flap-pos-deg", float(np.pi / 180.0))},
    {"fcs/speedbrake-pos-norm": "delta_speed_brake"},
    B737.thrust,
    (-670 * INCH, 0.0, 45 * INCH),
)
PA28 = Aircraft("pa28", {**C172P.channels, **_GEAR}, {}, (PUSHER,), (-4.0 * INCH, 0.0, 0.0), pushed)
C182 = Aircraft("c182", C172P.channels, {}, (PUSHER,), C172P.thrust_point, pushed)


def upsetting_gear(root: ElementTree.Element) -> None:
    """Pushed, and with a gear that pitches down and takes from the stability in yaw: few of
    JSBSim's files have the one, none the other."""
    pushed(root)
    for axis, name, size, *factors in (
        ("PITCH", "Cmgear", "-0.02", "metrics/cbarw-ft"),
        ("YAW", "Cnbgear", "-0.03", "metrics/bw-ft", "aero/beta-rad"),
    ):
        (found,) = (each for each in root.iter("axis") if each.get("name") == axis)
        made = ElementTree.SubElement(found, "function", name=f"aero/coefficient/{name}")
        product = ElementTree.SubElement(made, "product")
        for factor in ("aero/qbar-psf", "metrics/Sw-sqft", "gear/gear-pos-norm", *factors):
            ElementTree.SubElement(product, "property").text = factor
        ElementTree.SubElement(product, "value").text = size


T37 = Aircraft(
    "T37",
    B737.channels,
    {
        "fcs/flap-pos-norm": "delta_flap",
        "fcs/speedbrake-pos-norm": "delta_speed_brake",
        "fcs/mag-elevator-pos-rad": "abs(delta_elevator)",
    },
    B737.thrust,
    (-40 * INCH, 0.0, 0.0),
)


def _sign(number: int) -> int:
    return 1 - 2 * (number % 2)


def braking(number: int) -> Plan:
    """Speed brakes out and in at one angle of attack, as the template asks for."""
    s, start = (
        _sign(number),
        {"ic/h-sl-ft": 10000.0 + 1000 * (number % 3), "ic/vc-kts": 200.0 + 4 * (number % 4)},
    )
    return Plan(
        start | {"gear/gear-cmd-norm": 0.0},
        60.0,
        elevator=together(ladder(3, 0.8, 0.08 * s), ladder(44, 1.0, -0.08 * s)),
        aileron=together(doublet(12, 1, 0.12 * s), doublet(39, 1, -0.1 * s)),
        rudder=together(doublet(9, 2, s), doublet(27, 1.5, s), doublet(53, 2, s)),
        hold_alpha=True,
        other={
            "fcs/speedbrake-cmd-norm": pulses(
                (16 + number / 2, 1), (20 + number / 2, 0), (33, 1), (36.5, 0)
            )
        },
    )


def pitching(number: int) -> Plan:
    """Angle of attack up and down within the band of the short period, at dynamic pressures far
    apart: what grows with alpha must be told from what grows with alpha and Mach number."""
    s, start = (
        _sign(number),
        {"ic/h-sl-ft": 8000.0 + 1500 * (number % 4), "ic/vc-kts": 190.0 + 27 * (2 * number % 5)},
    )
    pulls = (
        ladder(2, 1.4, 0.2 * s),
        ladder(15, 1.0, -0.25 * s),
        ladder(31, 1.2, 0.22 * s),
        ladder(46, 1.1, -0.22 * s),
    )
    return Plan(
        start | {"gear/gear-cmd-norm": 0.0},
        60.0,
        elevator=together(*pulls),
        aileron=together(doublet(13, 1, 0.12 * s), doublet(43, 1, -0.1 * s)),
        rudder=together(doublet(26, 1.5, s), doublet(55, 2, s)),
        other={"fcs/speedbrake-cmd-norm": pulses((24, 1), (28, 0))},
    )


def lowering(number: int) -> Plan:
    """Landing gear down and up, twice; no two flights alike, or they would count as one."""
    s, late = _sign(number), 0.7 * number
    start = {"ic/h-sl-ft": 6000.0 + 1000 * (number % 3), "ic/vc-kts": 200.0 + 7 * number % 30}
    cycle = pulses((8 + number, 1), (22 + number, 0), (48 - number, 1), (60 - number, 0))
    return Plan(
        start | {"gear/gear-cmd-norm": 0.0},
        70.0,
        elevator=together(ladder(2 + late, 1.0, 0.1 * s), ladder(32 + late, 0.8, -0.12 * s)),
        aileron=together(doublet(12 + late, 1.5, 0.25 * s), doublet(48 + late, 1.5, -0.25 * s)),
        rudder=together(doublet(17 + late, 1.2, 0.3 * s), doublet(54 + late, 1, 0.3 * s)),
        other={
            "gear/gear-cmd-norm": cycle,
            "fcs/speedbrake-cmd-norm": pulses((25 + late, 0.05), (29 + late, 0)),
        },
    )


def lowering_slowly(number: int) -> Plan:
    """The same of a trainer, pushed."""
    start = {"ic/h-sl-ft": 4000.0 + 500 * (number % 3), "ic/vt-fps": 240.0 + 8 * (number % 4)}
    angles = {"ic/alpha-deg": 3.0, "ic/theta-deg": 3.0}
    plan = lowering(number)
    gear = {"gear/gear-cmd-norm": plan.other["gear/gear-cmd-norm"]}
    return replace(plan, start=start | angles, pushed=600.0, other=gear)


def slipping(number: int) -> Plan:
    """Sideslip with the gear down and with it up."""
    s, plan = _sign(number), lowering(number)
    at = (4, 17, 30, 41, 53, 64)
    return replace(
        plan,
        rudder=together(*(doublet(t + 0.3 * number, 1.3, 0.35 * s) for t in at)),
        other={"gear/gear-cmd-norm": plan.other["gear/gear-cmd-norm"]},
    )


def slipping_slowly(number: int) -> Plan:
    """The same of a trainer, pushed."""
    return replace(lowering_slowly(number), rudder=slipping(number).rudder)


def approaching(number: int) -> Plan:
    """Down to a wing's height and along the ground, at several speeds, and up again."""
    s, incidence = _sign(number), 5.5 - 0.9 * (number % 4)
    start = {
        "ic/h-sl-ft": 50.0,
        "ic/vt-fps": 104.0 + 6 * (number % 4),
        "ic/alpha-deg": incidence,
        "ic/theta-deg": incidence,
    }
    return Plan(
        start,
        75.0,
        elevator=together(
            ladder(4, 0.5, 0.06 * s),
            ladder(33, 0.5, 0.04 * s),
            ladder(43, 0.7, -0.04 * s),
            ladder(66, 0.5, 0.06 * s),
        ),
        aileron=together(doublet(9, 0.8, 0.08 * s), doublet(43, 0.8, -0.08 * s)),
        rudder=together(
            doublet(12, 1, 0.25 * s), doublet(47, 1, 0.25 * s), doublet(68, 1, -0.2 * s)
        ),
        height=pulses((-9, 45), (12 + number, 7.3 + 0.4 * (number % 3)), (51 + number, 55)),
        pushed=200.0,
    )


def approaching_faster(number: int) -> Plan:
    """The same of a heavier aircraft."""
    incidence = 5.0 - 0.7 * (number % 4)
    start = {
        "ic/h-sl-ft": 50.0,
        "ic/vt-fps": 125.0 + 7 * (number % 4),
        "ic/alpha-deg": incidence,
        "ic/theta-deg": incidence,
    }
    return replace(approaching(number), start=start, pushed=280.0)


def with_flaps(number: int) -> Plan:
    """Flaps down by a third on approaches to a fly-by, and up again."""
    flaps = pulses((7 + number, 1 / 3), (28 + number, 0.0), (46 + number / 2, 1 / 3), (64, 0.0))
    height = pulses((-9, 60), (12 + number, 25), (51 + number, 70))
    plan = approaching_faster(number)
    return replace(plan, height=height, other={"fcs/flap-cmd-norm": flaps})


def stalling(number: int) -> Plan:
    """Twice up beyond the stall, the last part with full elevator, and back."""
    s, first, second = _sign(number), 10 + number / 2, 44 - number / 2
    start = {
        "ic/h-sl-ft": 5000.0,
        "ic/vt-fps": 140.0 + 2 * (number % 4),
        "ic/alpha-deg": 4.0,
        "ic/theta-deg": 4.0,
    }
    pulls = (pulses((begin + 3.5, -1.0), (begin + 9, 0.0)) for begin in (first, second))
    return Plan(
        start,
        80.0,
        elevator=together(ladder(3, 0.6, 0.06 * s), *pulls),
        pitch=together(*(ramp(begin, begin + 6, begin + 9.5, 0.36) for begin in (first, second))),
        aileron=doublet(34, 0.8, 0.05 * s),
        rudder=together(doublet(37, 1, 0.1 * s), doublet(72, 1, 0.15 * s)),
        hold_alpha=True,
        pushed=120.0,
    )


@dataclass(frozen=True)
class Case:
    """An aircraft whose imported database lacks what `lacks` takes away; `effects`: hypotheses that
    must be confirmed, each with the axis on which its size is judged. seed : of the noise. stall :
    whether a loop of the lift is fitted and sought."""

    aircraft: Aircraft
    plan: Callable[[int], Plan]
    lacks: Edit
    effects: dict[str, str]
    seed: int = 1
    stall: bool = False


CASES = {
    "f16 without the drag of its speed brake": Case(
        F16, braking, without("aero/coefficient/CDDsb"), {"speed_brake@C_drag": "C_drag"}
    ),
    "737 without the drag of its gear": Case(
        B737, lowering, without("aero/coefficient/CDgear"), {"landing_gear@C_drag": "C_drag"}
    ),
    "t6texan2 without the drag of its gear": Case(
        TEXAN,
        lowering_slowly,
        without("aero/coefficient/CDgear"),
        {"landing_gear@C_drag": "C_drag"},
    ),
    "A320 without the drag of its gear": Case(
        A320, lowering, without("aero/coefficient/CDgear"), {"landing_gear@C_drag": "C_drag"}
    ),
    "pa28 without ground effect": Case(
        PA28,
        approaching_faster,
        set_to_one("aero/function/kCLge"),
        {"ground_effect@C_lift": "C_lift"},
    ),
    "T37 without the side force of its gear in sideslip": Case(
        T37,
        slipping,
        without("aero/coefficient/DCYbdf"),
        {"landing_gear_beta@C_side": "C_side"},
    ),
    "t6texan2 without the moments of its gear": Case(
        replace(TEXAN, edit=upsetting_gear),
        slipping_slowly,
        without("aero/coefficient/Cmgear", "aero/coefficient/Cnbgear"),
        {"landing_gear@Cm": "Cm", "landing_gear_beta@Cn": "Cn"},
    ),
    "pa28 without the pitching moment of its flaps": Case(
        PA28, with_flaps, without("aero/coefficient/CmDf"), {"flap@Cm": "Cm"}
    ),
    "c182 without ground effect": Case(
        C182,
        approaching_faster,
        set_to_one("aero/function/kCLge"),
        {"ground_effect@C_lift": "C_lift"},
    ),
    "f16 with an alpha slope 8 % too small": Case(
        F16,
        pitching,
        scaled_slope("aero/coefficient/CLDh", 1 / 1.08),
        {"alpha_slope@C_lift": "C_lift"},
    ),
    "c172p without ground effect": Case(
        C172P,
        approaching,
        set_to_one("aero/function/kCLge", "aero/function/kCDge"),
        {"ground_effect@C_lift": "C_lift", "ground_effect@C_drag": "C_drag"},
    ),
    "c172p without the hysteresis of its stall": Case(
        C172P,
        stalling,
        one_branch("aero/coefficient/CLwbh", "aero/stall-hyst-norm"),
        {"stall_hysteresis@C_lift:loop": "C_lift"},
        stall=True,
    ),
}


@lru_cache(maxsize=8)
def campaign(name: str) -> tuple[Vehicle, tuple[Flight, ...]]:
    """The vehicle of a case and its flights as logged, the last FLOWN - IDENTIFIED of them to be
    held out."""
    case = CASES[name]
    vehicle = vehicle_of(case.aircraft, imported(case.aircraft))
    flights = []
    for number in range(FLOWN):
        channels = flown(case.aircraft, case.plan(number))
        flights.append(
            as_logged(
                channels,
                f"{vehicle.name}-{number}",
                vehicle.name,
                np.random.default_rng(7 * number + case.seed),
            )
        )
    return vehicle, tuple(flights)
