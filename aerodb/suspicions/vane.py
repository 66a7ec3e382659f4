"""The angle of attack of a vane against that of the motion.

What an aircraft turns and climbs is known from gyros and accelerometers: their angle of attack,
integrated in steady air, changes as the vane's does (Stevens, Lewis & Johnson, Aircraft Control and
Simulation, 3rd ed., section 2.5). A vane whose upwash is not corrected, or divided by instead of
multiplied, changes more. Gusts move the vane alone, and the aircraft yields to them: less is
explained, and the vane changes less than the motion. Of that nothing is said.
"""

import numpy as np

from aerodb.conditioning import (
    BAND,
    SAMPLES_PER_PERIOD,
    SCALE_TOLERANCE,
    SETTLED,
    Suspicion,
    alpha_rate,
    with_accelerations,
)
from aerodb.errors import InputError
from aerodb.estimation import least_squares
from aerodb.flight import Flight
from aerodb.signals import band_passed, bridge
from aerodb.support import half_interval
from aerodb.suspicions.equation_error import averaged
from aerodb.suspicions.evidence import ERRORS, SWING, WELL_EXPLAINED
from aerodb.suspicions.in_flight import flying

_NEEDED = ("alpha", "V", "q", "ax", "az", "theta")


def vane_suspicions(flight: Flight) -> tuple[Suspicion, ...]:
    """Return an angle of attack that changes more than the motion makes it change.

    flight : with the upwash that the vehicle file declares taken off.

    Angles (n,) [rad], band in Hz. Source: `docs/method/consistency.md`, section "Against the
    vehicle".
    """
    channels = with_accelerations(flight)
    if not set(_NEEDED) <= channels.keys():
        return ()
    logged = (n for n in (*_NEEDED, "ax_imu", "az_imu") if n in flight)
    where = flying(flight, logged) & (channels["V"] > 0.0)
    every = max(1, int(1.0 / (SAMPLES_PER_PERIOD * BAND[1] * flight.step)))
    step, high = every * flight.step, min(BAND[1], 0.4 / flight.step)
    if where.sum() * flight.step < SETTLED or high < 2.0 * BAND[0] or len(where) < 20 * every:
        return ()
    try:
        rate = averaged(np.where(where, alpha_rate(channels), np.nan), every)
        inside, rate = np.isfinite(rate), bridge(rate)
        turned = np.concatenate([[0.0], np.cumsum(0.5 * step * (rate[1:] + rate[:-1]))])
        shown = averaged(np.where(where, channels["alpha"], np.nan), every)
        x, y = (band_passed(values, step, BAND[0], high)[inside] for values in (turned, shown))
        fit = least_squares(x[:, None], y, ("motion",))
    except (ValueError, InputError):
        return ()
    ratio, error = float(fit.estimates[0]), float(fit.standard_errors[0])
    swings = float(np.std(x))
    if not fit.r_squared > WELL_EXPLAINED or not swings > SWING:
        return ()
    if ratio - 1.0 <= SCALE_TOLERANCE + ERRORS * error:
        return ()
    words = (
        f"alpha changes by {ratio:.3g} +- {half_interval(error):.2g} times what rates and"
        " accelerations make it change. [air_data] upwash of the vehicle file is missing or"
        " inverted, or the vane's scale is another, or that of q"
    )
    return (Suspicion("alpha", "size", words, {"ratio": ratio, "standard_error": error}),)
