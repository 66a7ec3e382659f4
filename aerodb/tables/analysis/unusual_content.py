"""What in an imported database no aircraft has: drag below zero, damping that excites, side force
with sideslip, moments about a point far from the aircraft, axes or controls exchanged, slopes per
degree.

Each is the mark of a mistake that every check of arithmetic passes: another sign convention,
another unit, columns exchanged.
"""

import math
from collections.abc import Mapping
from typing import Final

import numpy as np

from aerodb.tables.analysis.lacking_effects import ANGLES, ROUNDING, curves, small_angles
from aerodb.tables.analysis.sensitivity import slopes_by, uses
from aerodb.tables.database import AeroDatabase

#: Ratio of a lift slope to that of a wing from which it is per degree, or its inverse per degree of
#: degrees (dimensionless): the middle, by logarithms, of one and 180/pi.
_PER_DEGREE: Final = math.sqrt(math.pi / 180.0)
#: Distance of the moment reference from the CG that no balanced aircraft has [chords]: a CG lies
#: within a fifth of a chord of the neutral point, and tables are made about a point near it.
_FAR: Final = 1.0
#: Share of a wing's lift slope that sideslip, to which both sides answer alike, never has.
_SIDEWAYS: Final = 0.5
#: Dampings: body axis -> its rate, and its name.
_DAMPING: Final = {"Cl": ("p", "roll"), "Cm": ("q", "pitch"), "Cn": ("r", "yaw")}
#: Variables whose slopes are looked at, beside sideslip.
_SLOPES: Final = ("p", "q", "r", "delta_aileron", "delta_rudder")
#: Variable -> axis -> mean slope at small angles.
Slopes = Mapping[str, Mapping[str, float]]


def unusual_content(
    database: AeroDatabase, cg: tuple[float, float, float] | None = None
) -> tuple[str, ...]:
    """Return sentences on what no aircraft has at small angles of attack, each with the likely
    mistake; empty for a usual database, for one whose lift does not change with alpha, and for a
    vehicle that rotors carry.

    cg : of the vehicle file [m, body axes from its datum]; None where it is not known.
    """
    small = curves(database, ANGLES)
    carried = any(part["kind"] == "rotor" for part in database.parts.values())
    carried |= database.reference.pressure is not None
    if not small or carried:
        return ()
    channels = small_angles(database, database.inputs)
    slopes = {
        name: {
            axis: float(np.mean(values))
            for axis, values in slopes_by(database, name, channels).items()
        }
        for name in dict.fromkeys(("beta", *_SLOPES))
        if name == "beta" or name in database.inputs
    }
    sideways = _sideways(database, slopes)
    if not np.ptp(small["C_lift"]) > ROUNDING:
        return tuple(sideways)
    return (
        *sideways,
        *_drag(small["C_drag"]),
        *_lift(database, float(np.ptp(small["C_lift"])), small["C_lift"]),
        *_moments(database, small["Cm"], slopes),
        *_reference(database, cg),
    )


def _drag(drag: np.ndarray) -> list[str]:
    if np.all(np.isfinite(drag)) and float(drag.max()) < 0.0:
        return [f"C_drag is negative ({drag.max():.3g} at most): drag is positive backwards"]
    return []


def _wing(ratio: float) -> float:
    """Lift slope [1/rad] of a wing of this aspect ratio (Helmbold)."""
    return 2.0 * math.pi * ratio / (2.0 + math.hypot(ratio, 2.0))


def _lift(database: AeroDatabase, change: float, lift: np.ndarray) -> list[str]:
    size = database.reference
    slope = math.copysign(change, float(lift[-1] - lift[0])) / float(np.ptp(ANGLES))
    ratio = size.span**2 / size.area
    wing = _wing(ratio)
    shown = f"C_lift_alpha is {slope:.3g} per rad, that of such a wing {wing:.2g}"
    if slope < 0.0:
        return [f"{shown}: lift has the other sign"]
    if 0.0 < slope < _PER_DEGREE * wing:
        return [f"{shown}: slopes per degree were taken as per rad, or the area is too large"]
    if slope > wing / _PER_DEGREE:
        return [f"{shown}: angles in degrees were taken as rad, or the area is too small"]
    return []


def _sideways(database: AeroDatabase, slopes: Slopes) -> list[str]:
    """What lift by sideslip is, and side force that grows with it."""
    beta, size = slopes["beta"], database.reference
    lift = abs(beta.get("CZ", 0.0))
    if lift > _SIDEWAYS * _wing(size.span**2 / size.area):
        return [
            f"C_lift changes with sideslip by {lift:.3g} per rad: alpha and beta are exchanged, or"
            " lift and side force"
        ]
    if (side := beta.get("CY", 0.0)) > ROUNDING:
        return [f"CY_beta is {side:.3g} per rad: side force opposes sideslip, its sign is another"]
    return []


def _moments(database: AeroDatabase, cm: np.ndarray, slopes: Slopes) -> list[str]:
    excited = [
        words
        for axis, (rate, words) in _DAMPING.items()
        if slopes.get(rate, {}).get(axis, 0.0) > 0.0
    ]
    found = []
    if excited:
        what = "dampings are" if len(excited) > 1 else "damping is"
        found.append(
            f"the {', '.join(excited)} {what} positive: a rate is excited instead of damped"
        )
    roll, beta = slopes.get("p", {}), slopes.get("beta", {})
    by_rate = abs(roll.get("Cn", 0.0)) > abs(roll.get("Cl", 0.0))
    by_sideslip = beta.get("Cl", 0.0) > 0.0 > beta.get("Cn", 0.0)
    if by_rate or (by_sideslip and "p" not in slopes):
        found.append(
            "roll rate or sideslip act on Cl as on Cn, and on Cn as on Cl: the two axes are"
            " exchanged"
        )
    pitch = slopes.get("q", {})
    if abs(pitch.get("Cl", 0.0)) > abs(pitch.get("Cm", 0.0)):
        found.append("pitch rate acts on Cl more than on Cm: the two axes are exchanged")
    aileron, rudder = (slopes.get(name, {}) for name in ("delta_aileron", "delta_rudder"))
    if (
        aileron
        and abs(rudder.get("Cl", 0.0)) > abs(aileron.get("Cl", 0.0))
        and abs(aileron.get("Cn", 0.0)) > abs(rudder.get("Cn", 0.0))
    ):
        found.append(
            "the rudder rolls more than the aileron, and the aileron yaws more than the rudder: the"
            " two are exchanged"
        )
    of_pitch = [term for term in database.terms if term.axis in ("Cm", "MY")]
    by_alpha = any("alpha" in uses(database, term.expression) for term in of_pitch)
    if not np.ptp(cm) > 0.0 and not by_alpha:  # a tail in a rotor's wash has none at some points
        found.append("it has lift, and no pitching moment over alpha: Cm is missing")
    return found


def _reference(database: AeroDatabase, cg: tuple[float, float, float] | None) -> list[str]:
    if cg is None or not np.all(np.isfinite(cg)):
        return []
    size = database.reference
    far = float(np.linalg.norm(np.subtract(size.moment_reference, cg))) / size.chord
    if far <= _FAR:
        return []
    point = ", ".join(f"{each:.4g}" for each in size.moment_reference)
    return [
        f"its moments are about ({point}) m, {far:.2g} chords from the CG of the vehicle file: the"
        " point is not given, or the datum is another"
    ]
