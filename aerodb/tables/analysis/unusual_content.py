"""What in an imported database no aircraft has: drag below zero, damping that excites, moments
about a point far from the aircraft, axes exchanged, slopes per degree.

Each is the mark of a mistake that every check of arithmetic passes: another sign convention,
another unit, columns exchanged.
"""

import math
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
#: Dampings: body axis -> its rate, and its name.
_DAMPING: Final = {"Cl": ("p", "roll"), "Cm": ("q", "pitch"), "Cn": ("r", "yaw")}


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
    if not small or carried or not np.ptp(small["C_lift"]) > ROUNDING:
        return ()
    return (
        *_drag(small["C_drag"]),
        *_lift(database, float(np.ptp(small["C_lift"])), small["C_lift"]),
        *_moments(database, small["Cm"]),
        *_reference(database, cg),
    )


def _drag(drag: np.ndarray) -> list[str]:
    if np.all(np.isfinite(drag)) and float(drag.max()) < 0.0:
        return [f"C_drag is negative ({drag.max():.3g} at most): drag is positive backwards"]
    return []


def _lift(database: AeroDatabase, change: float, lift: np.ndarray) -> list[str]:
    size = database.reference
    slope = math.copysign(change, float(lift[-1] - lift[0])) / float(np.ptp(ANGLES))
    ratio = size.span**2 / size.area
    wing = 2.0 * math.pi * ratio / (2.0 + math.hypot(ratio, 2.0))  # Helmbold
    shown = f"C_lift_alpha is {slope:.3g} per rad, that of such a wing {wing:.2g}"
    if slope < 0.0:
        return [f"{shown}: lift has the other sign"]
    if 0.0 < slope < _PER_DEGREE * wing:
        return [f"{shown}: slopes per degree were taken as per rad, or the area is too large"]
    if slope > wing / _PER_DEGREE:
        return [f"{shown}: angles in degrees were taken as rad, or the area is too small"]
    return []


def _moments(database: AeroDatabase, cm: np.ndarray) -> list[str]:
    channels = small_angles(database, database.inputs)
    slopes: dict[str, dict[str, float]] = {
        name: {
            axis: float(np.mean(values))
            for axis, values in slopes_by(database, name, channels).items()
        }
        for name in ("beta", "p", "q", "r")
        if name == "beta" or name in database.inputs
    }
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
