"""Estimates that no sensor error explains: a channel that leads the motion, and vanes that are not
where the vehicle file says.

A sensor is late, never early. A vane at a distance x ahead of the assumed point sees, beside the
flow at that point, ``- q x / V`` in alpha and ``+ r x / V`` in beta; the aircraft's own modes turn
this into a delay of about x / V with some scale, so that both are fitted where only the position is
wrong.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.consistency.output_error.gauss_newton import information, make_problem
from aerodb.consistency.output_error.posterior import SIGNIFICANT
from aerodb.consistency.output_error.reconstruction import reconstruct
from aerodb.consistency.plan import TRUST, ReconstructionPlan
from aerodb.consistency.reconstructed import Reconstruction
from aerodb.consistency.sensors import AIR_DATA, FlightRecord, parameter
from aerodb.support import (
    CLAIM,
    DIFFERENCE,
    HINT,
    Array,
    half_interval,
    likelihood_gain,
    standard_errors,
)

#: Standard errors beyond which a lead is evidence for another error.
EVIDENT = standard_errors(HINT)
#: Standard errors beyond which a position is evidence for a vane that is elsewhere.
FAR = standard_errors(CLAIM)

#: Gain of log-likelihood, of independent samples and priors, from which a position explains the
#: air data better than delays and scales.
BETTER = likelihood_gain(DIFFERENCE)

#: Delays and scales that a wrong position of the vanes looks like, and their usual sizes. They are
#: filters of vanes [s] (where the vehicle file states none), upwash beside a fuselage.
ALIKE: Final = {
    "alpha_delay": 0.03,
    "alpha_scale": 0.2,
    "beta_delay": 0.03,
    "beta_scale": 0.2,
}

_POSITION: Final = "air_data_x"


@dataclass(frozen=True)
class VanePosition:
    """A position of the vanes that explains the air data better than delays and scales do.

    ahead : m, of the position that the vehicle file states; negative: behind. standard_error : m.
    instead : delays and scales that were found in its place, name -> value, SI.
    """

    ahead: float
    standard_error: float
    instead: Mapping[str, float]

    @property
    def sentence(self) -> str:
        """The finding [m] and half of its 95 % interval, with what to do about it; delays that
        looked like it are in [s], see `instead`."""
        side = "ahead of" if self.ahead > 0 else "behind"
        looked = [
            f"{name} {value:.2g}{' s' if name.endswith('delay') else ''}"
            for name, value in self.instead.items()
        ]
        instead = f"; {' and '.join(looked)} looked like it: not applied"
        digits = 1 if self.standard_error >= 0.1 else 2
        half = half_interval(self.standard_error)
        metres = f"{abs(self.ahead):.{digits}f} +- {half:.{digits}f} m"
        return (
            f"the vane seems to be {metres} {side} where"
            " the vehicle file says: state its position in [points] air_data (default: the CG)"
            f"{instead if looked else ''}"
        )


def vane_position(
    records: Sequence[FlightRecord],
    result: Reconstruction,
    plan: ReconstructionPlan,
    flow_angle: float,
    independent: Callable[[Array], float],
    calm: Callable[[Reconstruction], bool],
) -> VanePosition | None:
    """Return the position of the vanes along the body if it explains the air data better than the
    delays and scales of a reconstruction; None where it does not.

    A delay is weighed with its usual size: on manoeuvres that cannot separate the two, a usual
    delay is believed rather than a position. What a wrong position adds looks like moving air, and
    an aircraft's answer to gusts like a position: with the position found, the air must stand
    still, which it does not where it moved.

    Parameters
    ----------
    records, plan : of the reconstruction `result`.
    flow_angle : accuracy limit of the flow angles [rad].
    independent : of a residual (n,), its number of independent samples as a part of n.
    calm : of a reconstruction, whether the air stands still.

    References
    ----------
    Klein & Morelli, Aircraft System Identification, 2006, eqs. 10.21: flow angles at a vane.
    """
    vanes = {name for record in records for name in record.outputs} & {"alpha", "beta"}
    if not vanes - plan.left_out.keys():
        return None
    # in still air: what a misplaced vane shows looks like air that rises and sinks as well
    instead = {
        entry.parameter.name: entry.value
        for entry, variance in zip(result.estimates, np.diag(result.still), strict=True)
        if entry.parameter.name in ALIKE and entry.value**2 > SIGNIFICANT**2 * variance
    }
    free = [name for name in plan.free if name not in ALIKE]
    if not instead and not _pulls(records, result, plan):
        return None
    other = reconstruct(
        records,
        [*free, _POSITION],
        initial=plan.initial,
        priors=plan.priors,
        bounds=plan.bounds,
        noise_floor=plan.noise_floor,
        near=result,
        details=False,
    )
    found = other[_POSITION]
    if abs(found.value) < FAR * found.standard_error or not calm(other):
        return None
    if abs(found.value) * _swing(result) < TRUST * flow_angle:
        return None
    evidence = _gain(result, other, independent) + _unusual(result, plan, list(instead))
    if evidence < BETTER:
        return None
    return VanePosition(found.value, found.standard_error, instead)


def _pulls(
    records: Sequence[FlightRecord], result: Reconstruction, plan: ReconstructionPlan
) -> bool:
    """Return whether one step of the search from a reconstruction would move the vanes by more than
    `FAR` standard errors, for white residuals: a score test, which costs one pass over the
    records."""
    problem = make_problem(
        records,
        [*plan.free, _POSITION],
        plan.initial,
        None,
        plan.priors,
        plan.bounds,
        plan.noise_floor,
        [np.array(path.states[:, 0]) for path in result.paths],
    )
    known = {
        entry.parameter.label: entry.value
        for entry in result.estimates
        if entry.parameter.kind != "initial"  # the problem starts from the states themselves
    }
    vector = np.array([known.get(item.label, 0.0) for item in problem.items])
    sums = problem.sums(vector)
    noise = sums.variance(problem.noise_floor)
    slope = -vector / problem.prior**2
    for name in noise:
        slope = slope + sums.gradient[name] / noise[name]
    size = np.array([item.size for item in problem.items])
    spread = np.linalg.pinv(information(problem, sums) * np.outer(size, size), hermitian=True)
    number = [item.name for item in problem.items].index(_POSITION)
    step, variance = spread[number] @ (size * slope), spread[number, number]
    return bool(variance > 0.0 and step * step > FAR**2 * variance)


def _unusual(result: Reconstruction, plan: ReconstructionPlan, names: Sequence[str]) -> float:
    """Minus the log-likelihood of estimated delays and scales under their usual sizes, without its
    constant: half the square of their distance from zero, by usual sizes and errors together."""
    index = [k for k, each in enumerate(result.estimates) if each.parameter.name in names]
    if not index:
        return 0.0
    found = [result.estimates[k] for k in index]
    values = np.array([each.value for each in found])
    usual = [
        plan.stated_priors.get(each.parameter.name, ALIKE[each.parameter.name]) for each in found
    ]
    spread = result.still[np.ix_(index, index)] + np.diag(np.square(usual))
    return 0.5 * float(values @ np.linalg.solve(spread, values))


def _swing(result: Reconstruction) -> float:
    """Root mean square change of the flow angles per metre of the vanes' position [rad/m]: of
    ``q / V`` and ``r / V``."""
    turned = [np.hypot(path.inputs[:, 4], path.inputs[:, 5]) / path.V for path in result.paths]
    return float(np.sqrt(np.mean(np.concatenate(turned) ** 2)))


def _gain(
    one: Reconstruction, other: Reconstruction, independent: Callable[[Array], float]
) -> float:
    """Log-likelihood of `other` over `one`: the sum over the channels of n ln(ratio of rms
    residuals), n the number of independent samples."""
    total = 0.0
    for name in dict.fromkeys(name for path in one.paths for name in path.residuals):
        pairs = [
            (a.residuals[name], b.residuals[name])
            for a, b in zip(one.paths, other.paths, strict=True)
            if name in a.residuals and name in b.residuals
        ]
        both = [np.isfinite(a) & np.isfinite(b) for a, b in pairs]
        first, second = (
            np.concatenate([pair[k][good] for pair, good in zip(pairs, both, strict=True)])
            for k in (0, 1)
        )
        if len(first):
            floor = min(one.noise[name], other.noise[name])
            sizes = [max(float(np.sqrt(np.mean(each**2))), floor) for each in (first, second)]
            total += len(first) * independent(first) * float(np.log(sizes[0] / sizes[1]))
    return total


@dataclass(frozen=True)
class Lead:
    """A channel that seems to lead the motion: its delay (negative) and standard error [s]."""

    name: str
    seconds: float
    standard_error: float

    @property
    def evident(self) -> bool:
        """Whether it leads by more than `EVIDENT` standard errors [s]."""
        return self.seconds < -EVIDENT * self.standard_error


def leads(result: Reconstruction) -> tuple[Lead, ...]:
    """Delays that a reconstruction found to be negative, which no sensor's is.

    One `Lead` for each, delay and standard error [s]; empty if none.
    """
    return tuple(
        Lead(entry.parameter.name, entry.value, entry.standard_error)
        for entry in result.estimates
        if entry.parameter.kind == "delay" and entry.value < 0.0
    )


def lead_sentences(found: Sequence[Lead]) -> tuple[str, ...]:
    """Say which channels lead the motion beyond their errors, by how much [s] (`Lead`), and where
    to look; empty if none does."""
    evident = [lead for lead in found if lead.evident]
    if len(evident) > 1:
        each = ", ".join(f"{_channel(lead)} by {_size(lead)}" for lead in evident)
        return (
            f"several channels seem to lead the motion ({each}), which no sensor does: check the"
            " delay and the clock of accelerations and rates; none is applied",
        )
    return tuple(
        f"{_channel(lead)} seems to lead the motion by {_size(lead)}, which no sensor does: look"
        f" for {_suspects(lead)}; no such delay is applied"
        for lead in evident
    )


def _channel(lead: Lead) -> str:
    return lead.name.removesuffix("_delay")


def _size(lead: Lead) -> str:
    return f"{-1e3 * lead.seconds:.0f} +- {1e3 * half_interval(lead.standard_error):.0f} ms"


def _suspects(lead: Lead) -> str:
    subject = parameter(lead.name).subject
    beside = "the position of the vane" if subject in AIR_DATA else "the scale of its sensor"
    return f"its time stamps, the clock of accelerations and rates, or {beside}"
