"""What air that no sensor measures adds to the covariance of estimates.

Where a vehicle has no airspeed, the velocity over the earth stands for its flow. Wind and gusts are
then missing in the flow, and not by chance: a vehicle that hovers drifts with the air and is pushed
back, so that gusts go with its own motion. Least squares take such air for a part of the effect of
the flow, and no residual tells how much. The largest air that the flight allows is told: below the
band of its motion, an axis leaves no more than such air would make there.
"""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.increments.samples import as_compared
from aerodb.signals import low_passed, rms
from aerodb.support import Array, Mask
from aerodb.tables import AeroDatabase, with_own_states

if TYPE_CHECKING:
    from aerodb.increments.parameters import ParameterSamples

#: Frequency [Hz] below which a vehicle follows the air: multicopters hold velocity at .1 to 1 Hz.
#: Above, gusts and motion are independent, and residuals tell.
_FOLLOWS: Final = 1.0
#: Change [m/s] of the flow of which slopes are taken: rounding leaves 1e-10 of them.
_STEP: Final = 0.05


def air_covariance(
    parts: "Sequence[tuple[ParameterSamples, Mask | slice]]", present: AeroDatabase
) -> Array:
    """Return the covariance (k, k) of least-squares estimates of k parameters due to air in flights
    whose flow is that over the ground, in the parameters' units; zero without such flights.

    parts : samples (n,) of the flights beside `present`, near the estimates, and which are used.
    Two shapes of each component of the air count: steady, and as the motion itself. Each moves the
    estimates by ``(X'X)^-1 X' d``, d its change of the residual (consider covariance: Bierman,
    *Factorization Methods*, 1977, chapter VIII).
    """
    count = parts[0][0].slopes.shape[1]
    total = np.zeros((count, count))
    blind = {
        each.comparison.flight: each.comparison
        for each, _ in parts
        if _over_ground(each.comparison)
    }
    if not blind:
        return total
    columns = [each.over(chosen)[0] for each, chosen in parts]
    gain = np.linalg.pinv(sum((x.T @ x for x in columns), total), hermitian=True)
    for flight, comparison in blind.items():
        own = [
            (each, chosen, gain @ x.T)
            for (each, chosen), x in zip(parts, columns, strict=True)
            if each.comparison.flight == flight
        ]
        flow = _flow(comparison)
        unknown = 1.0 / np.sqrt(3.0)  # of a correlation that is even between -1 and 1
        for component, slopes in enumerate(_slopes(comparison, present)):
            size = _largest([each for each, *_ in own], slopes)
            motion = flow[component] / (rms(flow[component]) or 1.0)
            for share, shape in ((1.0, np.ones_like(motion)), (unknown, motion)):
                moved = np.zeros(count)
                for each, chosen, gained in own:
                    change = as_compared(
                        each.axis, share * size * slopes[each.axis] * shape, comparison
                    )[chosen]
                    change = change - change.mean() if each.centred else change
                    moved += gained @ np.nan_to_num(change) / each.size
                total += np.outer(moved, moved)
    return total


def _over_ground(comparison: Comparison) -> bool:
    side = comparison.database_side
    return side is not None and side.over_ground


def _flow(comparison: Comparison) -> Array:
    """Velocity (3, n) [m/s] that stands for that through the air, body axes."""
    assert comparison.database_side is not None
    speed, alpha, beta = (comparison.database_side.channels[x] for x in ("V", "alpha", "beta"))
    along = speed * np.cos(beta)
    return np.stack([along * np.cos(alpha), speed * np.sin(beta), along * np.sin(alpha)])


def _slopes(comparison: Comparison, present: AeroDatabase) -> Sequence[Mapping[str, Array]]:
    """Change (n,) of the residual on each axis per m/s of air along x, y and z."""
    side = comparison.database_side
    assert side is not None
    found = []
    for component in range(3):
        ends = []
        for step in (-_STEP, _STEP):
            u, v, w = _flow(comparison) + step * np.eye(3)[component][:, None]
            channels = {
                **side.channels,
                "V": np.sqrt(u**2 + v**2 + w**2),
                "alpha": np.arctan2(w, u),
                "beta": np.arctan2(v, np.hypot(u, w)),
            }
            if "qbar" in channels and "rho" in channels:
                channels["qbar"] = 0.5 * channels["rho"] * channels["V"] ** 2
            given = with_own_states(present, comparison.time, channels)
            ends.append(present.predict(given).coefficients)
        still = np.zeros(len(comparison.time))
        found.append(
            {axis: still + (ends[1][axis] - ends[0][axis]) / (-2.0 * _STEP) for axis in ends[0]}
        )
    return found


def _largest(samples: "Sequence[ParameterSamples]", slopes: Mapping[str, Array]) -> float:
    """The largest air [m/s, rms] that all axes allow: what is left on them is not less than what it
    makes there."""
    sizes = []
    for each in samples:
        step = float(np.median(np.diff(each.comparison.time)))
        left = each.residual - (each.residual[each.good].mean() if each.centred else 0.0)
        slow = low_passed(np.where(each.good, left, np.nan), step, _FOLLOWS)
        made = rms(slopes[each.axis][each.good])
        if made > 0.0:
            sizes.append(rms(slow[each.good]) / made)
    return float(min(sizes, default=0.0))
