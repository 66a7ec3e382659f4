"""What the checks share: the samples in flight, and mass properties where they are known."""

from collections.abc import Iterable, Mapping

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.support import HALF, Array
from aerodb.suspicions.evidence import FEWEST
from aerodb.vehicle import Vehicle, mass_channels

#: No usable value in SI units is larger.
HUGE = 1e9
#: Least share of its largest airspeed or root of dynamic pressure at which an aircraft flies.
FLYING = HALF


def flying(flight: Flight, names: Iterable[str]) -> NDArray[np.bool_]:
    """Return the samples (n,) in flight at which all of these channels are usable.

    Values flagged as implausible or stuck count: they are the evidence.

    Speeds [m/s].
    """
    there = [name for name in names if name in flight]
    good = flight.usable(there, despite=("implausible", "stuck"))
    for name in there:
        good = good & (np.abs(flight[name]) < HUGE)
    if "V" in flight:
        speed: Array | None = flight["V"]
    elif "qbar" in flight:
        speed = np.sqrt(np.maximum(flight["qbar"], 0.0))
    else:
        speed = None
    if speed is None or not np.any(good & np.isfinite(speed)):
        return np.zeros_like(good)
    fast = np.abs(np.where(np.isfinite(speed), speed, 0.0))
    return np.asarray(good & (fast > FLYING * float(np.quantile(fast[good], 0.99))))


def middle(values: Array, where: NDArray[np.bool_]) -> float:
    """Return the median of `values` there; nan where there are too few.

    values, where : (n,); few are less than `FEWEST`. The unit stays.
    """
    return float(np.median(values[where])) if int(where.sum()) >= FEWEST else float("nan")


def known_masses(flight: Flight, vehicle: Vehicle) -> Mapping[str, Array]:
    """Return mass, CG and inertia at each sample; none where the log should have them and has not.

    Mass [kg], CG [m], inertia [kg m^2], (n,) each.
    """
    try:
        return mass_channels(flight, vehicle)
    except InputError:
        return {name: flight[name] for name in ("mass", "Ixx", "Iyy", "Izz") if name in flight}
