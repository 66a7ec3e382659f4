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
        own: dict[str, tuple[ParameterSamples, list[tuple[Mask | slice, Array]]]] = {}
        for (each, chosen), x in zip(parts, columns, strict=True):
            if each.comparison.flight == flight:
                own.setdefault(each.axis, (each, []))[1].append((chosen, gain @ x.T))
        flow = _flow(comparison)
        unknown = 1.0 / np.sqrt(3.0)  # of a correlation that is even between -1 and 1
        left = {axis: _slow(each) for axis, (each, _) in own.items()}
        for component, slopes in enumerate(_slopes(comparison, present)):
            size = _largest({axis: each for axis, (each, _) in own.items()}, left, slopes)
            motion = flow[component] / (rms(flow[component]) or 1.0)
            for share, shape in ((1.0, np.ones_like(motion)), (unknown, motion)):
                moved = np.zeros(count)
                for axis, (each, runs) in own.items():
                    made = share * size / each.size * slopes[axis]
                    change = np.nan_to_num(as_compared(axis, made * shape, comparison))
                    for chosen, gained in runs:
                        here = change[chosen]
                        moved += gained @ (here - here.mean() if each.centred else here)
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


def _slow(samples: "ParameterSamples") -> float:
    """What is left on an axis where a vehicle follows the air, rms."""
    step = float(np.median(np.diff(samples.comparison.time)))
    left, good = samples.residual, samples.good
    left = left - (left[good].mean() if samples.centred else 0.0)
    return rms(low_passed(np.where(good, left, np.nan), step, _FOLLOWS)[good])


def _largest(
    samples: "Mapping[str, ParameterSamples]",
    left: Mapping[str, float],
    slopes: Mapping[str, Array],
) -> float:
    """The largest air [m/s, rms] that all axes allow: what is left on them is not less than what it
    makes there."""
    made = {axis: rms(slopes[axis][each.good]) for axis, each in samples.items()}
    return min((left[axis] / size for axis, size in made.items() if size > 0.0), default=0.0)
