"""Leave out a channel that cannot be reconciled with the others.

Output error estimates the noise of every channel, so that one that disagrees counts for less; what
it still counts is wrong, however, because its error is not noise: a compass that drifts turns into
a bias of the yaw gyro.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from aerodb.consistency.plan import ReconstructionPlan
from aerodb.consistency.reconstructed import Reconstruction
from aerodb.consistency.sensors import channels_of
from aerodb.consistency.verdict import GROSS, disagreements
from aerodb.vehicle import Accuracy

#: Heading residual (rms, rad) from which on a heading says nothing at all.
ASTRAY = 0.5

#: Channels whose failure is the flight's, not their own: nothing is left without them.
_FOUNDATION = ("V", "qbar", "velocity_north", "velocity_east")

_ATTITUDE = ("phi", "theta", "psi")


def reconciled(
    solve: Callable[[ReconstructionPlan], Reconstruction],
    plan: ReconstructionPlan,
    accuracy: Accuracy,
) -> tuple[Reconstruction, ReconstructionPlan]:
    """The reconstruction with a plan, or with one that leaves out the channels that disagree.

    One channel at a time leaves, the worst first, if

    - its residual is beyond `GROSS` limits of the vehicle: with the limit as standard deviation, no
      error of a serviceable sensor;
    - the others determine without it every parameter that they determine with it (standard error
      below the prior);
    - it is not airspeed, dynamic pressure or velocity over the earth, without which nothing is
      determined, and no other attitude angle disagrees or has left: two of them together show an
      error of the rates.

    Parameters that only a channel determines which disagrees so, and which therefore stays, are
    `doubtful` in the plan. If a gross disagreement remains in the end, no channel was the cause,
    and all stay. A heading beyond `ASTRAY` leaves in any case.

    Parameters
    ----------
    solve : the reconstruction with a plan.
    plan : parameters to try.
    accuracy : limits of the vehicle.
    """
    result = solve(plan)
    found = disagreements(result.paths, accuracy, plan.declared_noise)
    lost = found.get("psi", (0.0, np.inf))[0]
    if lost > ASTRAY:
        plan = plan.without_channel("psi", lost)
        result = solve(plan)
    first = (result, plan)
    kept: set[str] = set()
    while True:
        found = _gross(result, plan, accuracy)
        angles = [name for name in _ATTITUDE if name in found or name in plan.left_out]
        open_to = [
            name
            for name in found
            if name not in (*kept, *_FOUNDATION) and not (name in _ATTITUDE and len(angles) > 1)
        ]
        if not open_to:
            return (result, plan) if set(found) <= kept else first
        name = max(open_to, key=lambda each: found[each][0] / found[each][1])
        fewer = plan.without_channel(name, found[name][0])
        rest = solve(fewer)
        lost_with_it = _determined(result.whole, plan, name) - _determined(rest.whole, fewer, name)
        if not lost_with_it:
            result, plan = rest, fewer
        else:
            kept.add(name)
            plan = replace(plan, doubtful=tuple(sorted({*plan.doubtful, *lost_with_it})))


def _gross(
    result: Reconstruction, plan: ReconstructionPlan, accuracy: Accuracy
) -> dict[str, tuple[float, float]]:
    """Channels beyond `GROSS` limits, without those that have left: rms and limit, SI."""
    return {
        name: (size, limit)
        for name, (size, limit) in disagreements(
            result.paths, accuracy, plan.declared_noise
        ).items()
        if name not in plan.left_out and size > GROSS * limit
    }


def _determined(result: Reconstruction, plan: ReconstructionPlan, leaving: str) -> set[str]:
    """Labels of the parameters that are determined better than by their prior, without those of the
    channel that leaves."""
    return {
        entry.parameter.label
        for entry in result.estimates
        if entry.parameter.kind != "initial"
        and channels_of(entry.parameter.name) != (leaving,)
        and entry.standard_error
        < plan.stated_priors.get(entry.parameter.name, entry.parameter.size)
    }
