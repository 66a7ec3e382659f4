"""What an update changes of the derivatives inside the data, and which changes need a person.

A control that acts the wrong way round fits the flights of the log that has it wrong as well as a
right one fits a right log. No error on flights that were not used shows it. The wind tunnel does:
its signs, and within a factor its sizes, are right.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Final

import numpy as np

from aerodb.coefficients import as_inputs
from aerodb.flight import Flight
from aerodb.increments.gate import GateCheck, Measure
from aerodb.support import NEGLIGIBLE, SLIGHT, SMALL, Array
from aerodb.tables import AeroDatabase, slopes_by

#: Rates whose own moment damps them: axis -> rate.
DAMPING: Final = {"Cl": "p", "Cm": "q", "Cn": "r"}
#: Least share of an axis' variation in the baseline that a control's sign must have to count.
#: Smaller ones are not known from the wind tunnel either.
_SIGN_COUNTS = SLIGHT
#: The same for the size of any derivative.
_SIZE_COUNTS = SMALL
#: Samples per flight at which derivatives are evaluated.
_SAMPLES: Final = 300
#: Derivatives that differ by less than this part are not listed.
_LEAST = NEGLIGIBLE
#: Most derivatives that are listed.
_LISTED = 12


@dataclass(frozen=True)
class DerivativeChange:
    """The mean derivative dC/dvariable over the flights' samples, before and after an update.

    Parameters
    ----------
    axis, variable : body axis and input.
    before, after : SI (1/rad, s/rad, ...).
    share : standard deviation of the variable in the data times ``before``, as a part of the root
        sum square of all these products on the axis, 0 to 1.
    """

    axis: str
    variable: str
    before: float
    after: float
    share: float

    @property
    def name(self) -> str:
        """As people write it: ``Cm_delta_elevator``, ``Cl_p``."""
        return f"{self.axis}_{self.variable}"

    @property
    def relative(self) -> float:
        """Dimensionless change (scalar) as a part of the derivative before; infinite where there
        was none."""
        return abs(self.after - self.before) / abs(self.before) if self.before else np.inf

    @property
    def reversal(self) -> str:
        """Sentence on a damping or a control that becomes its opposite; empty where none does
        (`DAMPING`, and share from 0.05 on)."""
        if DAMPING.get(self.axis) == self.variable and self.before <= 0.0 < self.after:
            return f"{self._change}: its damping becomes an excitation"
        reversed_ = self.before * self.after < 0.0
        if reversed_ and self.variable.startswith("delta_") and self.share >= _SIGN_COUNTS:
            return f"{self._change}: the control acts the other way round"
        return ""

    def refusal(self, largest: float) -> str:
        """Return why the gate refuses it unless a person accepts it; empty where it does not.

        largest : greatest relative change (dimensionless) that needs no person.
        """
        if not self.reversal and self.share >= _SIZE_COUNTS and self.relative > largest:
            return f"{self._change}, by more than {largest:.0%}"
        return self.reversal

    @property
    def _change(self) -> str:
        return f"{self.name} goes from {self.before:.3g} to {self.after:.3g} inside the data"


def derivative_changes(
    flights: Sequence[Flight], baseline: AeroDatabase, candidate: AeroDatabase
) -> tuple[DerivativeChange, ...]:
    """Return the changes of the derivatives inside the data, those that change an axis most first.

    flights : those that the candidate comes from. Samples without a finite prediction do not count.

    Each is the mean over samples (n,) in SI units (1/rad, s/rad).
    """
    sampled = [_sampled(flight, baseline, candidate) for flight in flights]
    variables = sorted(
        {name for each in sampled for name in each}
        & {"alpha", "beta", "p", "q", "r", *(n for each in sampled for n in each if "delta_" in n)}
    )
    spread = {name: _spread([each[name] for each in sampled if name in each]) for name in variables}
    means = {
        name: [_mean_slopes(database, name, sampled) for database in (baseline, candidate)]
        for name in variables
    }
    changes: list[tuple[float, DerivativeChange]] = []
    for axis in candidate.axes:
        products = {name: means[name][0].get(axis, 0.0) * spread[name] for name in variables}
        total = float(np.sqrt(sum(each**2 for each in products.values())))
        for name in variables:
            before, after = (each.get(axis, 0.0) for each in means[name])
            if abs(after - before) > _LEAST * max(abs(before), abs(after)):
                share = abs(products[name]) / total if total else 0.0
                weight = abs(after - before) * spread[name] / total if total else 0.0
                changes.append((weight, DerivativeChange(axis, name, before, after, share)))
    changes.sort(key=lambda each: -each[0])
    return tuple(change for _, change in changes)


def derivatives_document(
    changes: Sequence[DerivativeChange], largest: float = np.inf
) -> list[dict[str, Any]]:
    """Return the largest changes, and all that the gate may refuse, as JSON: derivatives in SI
    units (1/rad, s/rad), docs/reference/contract.md."""
    kept = [
        change
        for number, change in enumerate(changes)
        if number < _LISTED or change.share >= _SIGN_COUNTS or change.refusal(largest)
    ]
    return [asdict(change) for change in kept]


def judge_derivatives(
    listed: Sequence[Mapping[str, Any]] | None, largest: float, accepted: Collection[str]
) -> GateCheck:
    """Return the gate's check of a version's changed derivatives.

    listed : from its report; None where it has none. largest : greatest relative change,
    dimensionless. accepted : names of changes that a person accepts, with a reason. The gate
    refuses with these reasons; see docs/method/updates.md, section Gate.
    """
    name = "no unaccepted change of a control, a damping or a main derivative inside the data"
    if listed is None:
        return GateCheck(
            name,
            ("its report does not list its derivatives: create the version again",),
            "derivatives",
        )
    changes = [DerivativeChange(**each) for each in listed]
    refused = [
        (change, reason)
        for change in changes
        if change.name not in accepted and (reason := change.refusal(largest))
    ]
    return GateCheck(
        name,
        tuple(
            f"{reason} (if that is right: --accept {change.name}, and the --reason)"
            for change, reason in refused
        ),
        "derivatives",
        tuple(
            Measure(change.name, change.relative, largest)
            for change in changes
            if change.share >= _SIZE_COUNTS
        ),
        tuple(change.name for change, _ in refused),
    )


def _sampled(flight: Flight, baseline: AeroDatabase, candidate: AeroDatabase) -> dict[str, Array]:
    """Channels at evenly spread samples at which all of the inputs that the flight has are good."""
    flight = as_inputs(flight, candidate)
    inputs = {*baseline.inputs, *candidate.inputs}
    good = np.flatnonzero(flight.usable([name for name in inputs if name in flight]))
    if not len(good):
        return {}
    rows = good[np.linspace(0, len(good) - 1, min(len(good), _SAMPLES)).astype(int)]
    return {name: flight[name][rows] for name in flight.channels}


def _spread(parts: Sequence[Array]) -> float:
    """Standard deviation over all flights."""
    return float(np.nanstd(np.concatenate(parts)))


def _mean_slopes(
    database: AeroDatabase, variable: str, sampled: Sequence[Mapping[str, Array]]
) -> dict[str, float]:
    """Body axis -> mean of dC/dvariable over all samples; empty where it does not depend on it."""
    parts: dict[str, list[Array]] = {}
    for channels in sampled:
        for axis, slope in slopes_by(database, variable, channels).items():
            parts.setdefault(axis, []).append(slope)
    return {axis: float(np.nanmean(np.concatenate(each))) for axis, each in parts.items()}
