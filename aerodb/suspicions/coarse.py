"""Flow angles and deflections that are recorded in steps coarser than they must be known."""

from typing import Final

import numpy as np

from aerodb.conditioning import Suspicion
from aerodb.flight import Flight
from aerodb.nomenclature import is_surface
from aerodb.support import Array
from aerodb.suspicions.surfaces import role_of
from aerodb.vehicle import Vehicle

#: Kind of a suspicion of such a channel.
COARSE: Final = "steps"
#: Fewest values that tell the step of a recorder: fewer are no motion.
FEWEST_LEVELS: Final = 3
#: The same of a deflection, which a pilot may move between a few values.
FEWEST_MOVED: Final = 6
#: Part of a step by which a value may be off a multiple of it, as units are converted.
OFF: Final = 0.02
#: Coarsest step of a deflection [rad]: half of it is a tenth of a usual input of 5 deg.
COARSEST: Final = float(np.deg2rad(1.0))


def coarse_suspicions(flight: Flight, vehicle: Vehicle) -> tuple[Suspicion, ...]:
    """Return flow angles of which half a step is beyond the limit of `[accuracy]`, and deflections
    in steps of a degree or more.

    Channels are (n,) [rad]. Two samples that differ by less than a step clear a channel.
    """
    most = dict.fromkeys(("alpha", "beta"), 2.0 * vehicle.accuracy.flow_angle)
    most |= {name: COARSEST for name in flight.channels if is_surface(name) and role_of(name)}
    said = []
    for name, limit in most.items():
        if name not in flight.channels or name in flight.estimated:
            continue
        fewest = FEWEST_MOVED if is_surface(name) else FEWEST_LEVELS
        step = _step(flight[name][flight.usable([name])], fewest)
        if step > limit:
            words = (
                f"{name} is recorded in steps of {np.rad2deg(step):.3g} deg, which leave errors of"
                f" {np.rad2deg(0.5 * step):.2g} deg: log it more finely"
            )
            said.append(Suspicion(name, COARSE, words, {"step": step}))
    return tuple(said)


def _step(values: Array, fewest: int) -> float:
    """The step of which all values (m,) are multiples; 0 where there is none, or too few values."""
    levels = np.unique(values)
    gaps = np.diff(levels)
    if len(levels) < fewest:
        return 0.0
    step = float(gaps.min())
    parts = gaps / step
    whole = bool(np.all(np.abs(parts - np.round(parts)) < OFF * np.maximum(parts, 1.0)))
    return step if whole else 0.0
