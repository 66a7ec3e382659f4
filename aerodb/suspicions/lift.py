"""The weight and the slope of the lift against what a wing of this size and shape can have.

Lift carries the weight: mass, reference area, density or airspeed that is wrong, or another
aircraft's log, gives a lift coefficient or a slope that no wing has.
"""

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import BAND, Suspicion
from aerodb.errors import InputError
from aerodb.estimation import least_squares
from aerodb.flight import Flight
from aerodb.nomenclature import is_surface
from aerodb.signals import low_passed
from aerodb.support import half_interval
from aerodb.suspicions.evidence import ERRORS, FEWEST, LIFTS, SWING, WELL_EXPLAINED
from aerodb.suspicions.in_flight import flying, known_masses
from aerodb.suspicions.surfaces import role_of
from aerodb.vehicle import Vehicle

#: Least lift coefficient, as a median over a flight: less is a zero-g arc.
LEAST = 0.02
#: Largest such coefficient: more is no wing.
MOST = 3.0
#: What the body adds to the upper ratio of the slope, times the aspect ratio.
BODY = 1.0
#: Angle of attack above which a wing may be stalled [rad].
STALL = 0.17
#: Mach number above which a slope is not that of slow flow.
FASTEST = 0.7


def lift_suspicions(flight: Flight, vehicle: Vehicle) -> tuple[Suspicion, ...]:
    """Return a lift coefficient, or a lift slope, that no wing of this size has.

    The slope is judged by Helmbold's equation, ``2 pi A / (2 + sqrt(A^2 + 4))``, for the aspect
    ratio A = b^2 / S, with compressibility left to the margin.

    Coefficients are dimensionless, the slope is per rad; mass [kg], area [m²], qbar [Pa]. Source:
    `docs/method/consistency.md`, section "Against the vehicle".
    """
    names = [name for name in ("az", "az_imu") if name in flight][:1]
    known = known_masses(flight, vehicle)
    if not names or "qbar" not in flight or "mass" not in known:
        return ()
    if vehicle.reference.pressure is not None:
        return ()  # no wing carries it
    needed = [*names, "qbar", *(["alpha"] if "alpha" in flight else [])]
    where = flying(flight, needed) & np.isfinite(known["mass"]) & (flight["qbar"] > 0.0)
    if int(where.sum()) < FEWEST:
        return ()
    size = vehicle.reference
    force = flight["qbar"][where] * size.area
    normal = -known["mass"][where] * flight[names[0]][where] / force
    level = float(np.median(normal))
    if not LEAST <= abs(level) <= MOST:
        words = (
            f"mass {np.median(known['mass']):.4g} kg, area {size.area:.4g} m^2 and qbar"
            f" {np.median(flight['qbar'][where]):.4g} Pa need a lift coefficient of {level:.3g}"
            f" ({LEAST:g} to {MOST:g} is possible). Mass, area, density or airspeed is wrong, or"
            " the log is another aircraft's"
        )
        return (Suspicion("mass", "size", words, {"lift_coefficient": level}),)
    return _slope(flight, vehicle, names[0], known["mass"])


def _slope(flight: Flight, vehicle: Vehicle, name: str, mass: np.ndarray) -> tuple[Suspicion, ...]:
    if "alpha" not in flight:
        return ()
    size = vehicle.reference
    where = flying(flight, [name, "qbar", "alpha"]) & (flight["qbar"] > 0.0)
    where &= np.isfinite(mass) & (np.abs(flight["alpha"]) < STALL)
    if "mach" in flight:
        where &= ~(flight["mach"] > FASTEST)
    where &= _one_configuration(flight, where)
    if int(where.sum()) < FEWEST:
        return ()
    band = min(BAND[1], 0.4 / flight.step)
    try:
        alpha = low_passed(np.where(where, flight["alpha"], np.nan), flight.step, band)[where]
        raw = -mass * flight[name] / (np.where(where, flight["qbar"], np.nan) * size.area)
        normal = low_passed(np.where(where, raw, np.nan), flight.step, band)[where]
        fit = least_squares(np.column_stack([alpha, np.ones_like(alpha)]), normal, ("alpha", "1"))
    except (ValueError, InputError):
        return ()
    slope, error = float(fit.estimates[0]), float(fit.standard_errors[0])
    if float(np.std(alpha)) < SWING or fit.r_squared < WELL_EXPLAINED:
        return ()
    ratio = size.span**2 / size.area
    expected = helmbold(ratio)
    low, high = (
        LIFTS[0] * expected - ERRORS * error,
        (LIFTS[1] + BODY / ratio) * expected + ERRORS * error,
    )
    # Errors of alpha make the slope small, to no less than r^2 of it (Frisch, 1934).
    if slope <= high and slope / fit.r_squared >= low:
        return ()
    words = (
        f"the normal force grows by {slope:.3g} +- {half_interval(error):.2g} per rad of alpha"
        f" (wing of aspect ratio {ratio:.3g}: {expected:.3g}). Mass, area, density, airspeed or the"
        " scale of alpha is wrong, or the log is another aircraft's"
    )
    return (Suspicion("mass", "size", words, {"slope": slope, "expected": expected}),)


def _one_configuration(flight: Flight, where: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Samples with flaps, brakes and gear where they are most of the time: as they lift, alpha goes
    back, and the slope of all lift over it is none."""
    same = np.ones_like(where)
    for name in flight.channels:
        if is_surface(name) and not role_of(name) and where.any():
            same &= np.abs(flight[name] - np.nanmedian(flight[name][where])) < SWING
    return same


def helmbold(aspect_ratio: float) -> float:
    """Return the lift slope [1/rad] of a straight wing by Helmbold's equation.

    Between pi A / 2 of slender wings and 2 pi of a section:

    >>> round(helmbold(0.01), 4), round(helmbold(1e6), 3)
    (0.0157, 6.283)
    """
    return float(2.0 * np.pi * aspect_ratio / (2.0 + np.sqrt(aspect_ratio**2 + 4.0)))
