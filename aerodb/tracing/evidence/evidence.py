"""Residual and regressor columns of one flight.

Nothing is conditioned here: `normal_equations_of` low-passes, decimates and whitens all columns
alike, and adds the intercepts.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.support import Array, Mask
from aerodb.tracing.evidence.sampling_unit import SamplingUnit

Columns = Mapping[str, Mapping[str, Array]]

#: Beginning of the names of columns that belong to no hypothesis: nuisance parameters of one
#: flight, whose prior has one standard deviation of one.
NUISANCE: Final = "air_rotation:"


@dataclass(frozen=True)
class Evidence:
    """One flight (or one manoeuvre of it) on its own uniform time grid.

    flight : id of the flight or of the unit. step : s. residual : axis -> (n,), measured -
    predicted, dimensionless. usable : axis -> (n,). columns : hypothesis id -> axis -> (n,),
    derivative of (measured - predicted) by the hypothesis' one parameter, aerodynamic and sensors
    alike; those named NUISANCE are eliminated from the flight's normal equations; an axis on which
    it does not act may be missing, and so may a hypothesis that this flight
    cannot show. noisy : the same flight with the reconstruction's state noise added once more
    (SIMEX: Cook & Stefanski, JASA 89, 1994); optional. instruments : like columns, the columns as
    commanded inputs alone predict them; optional.

    Raises InputError when lengths differ or a column is not finite where its axis is usable.
    """

    flight: str
    step: float
    residual: Mapping[str, Array]
    usable: Mapping[str, Mask]
    columns: Columns
    noisy: tuple["Evidence", ...] = ()
    instruments: Columns = field(default_factory=dict)

    def __post_init__(self) -> None:
        lengths = {len(values) for values in self.residual.values()}
        if len(lengths) != 1 or set(self.residual) - set(self.usable):
            raise InputError(
                "residuals need one length and a usable mask on every axis",
                self.flight,
                "give each axis both",
            )
        if not self.step > 0.0:
            raise InputError(
                f"a step of {self.step} s", self.flight, "give a positive sampling interval"
            )
        length = lengths.pop()
        for axis, values in self.residual.items():
            _check(values, length, self.usable[axis], self.flight, "residual", axis)
        for columns in (self.columns, self.instruments):
            for name, by_axis in columns.items():
                for axis, values in by_axis.items():
                    if axis in self.residual:
                        _check(values, length, self.usable[axis], self.flight, name, axis)

    @property
    def samples(self) -> int:
        """Number n of samples in each array (n,) of the flight; the grid's step is in seconds."""
        return len(next(iter(self.residual.values())))

    def usable_alike(self, axes: Iterable[str]) -> list[list[str]]:
        """Return the axes in groups that are usable at the same samples, so that a group is
        filtered at once.
        """
        groups: dict[bytes, list[str]] = {}
        for axis in axes:
            groups.setdefault(self.usable[axis].tobytes(), []).append(axis)
        return list(groups.values())


def _check(values: Array, length: int, usable: Mask, where: str, name: str, axis: str) -> None:
    """Refuse a residual or a column (n,) on an axis that is not as long as its flight, or not
    finite where it is used."""
    if len(values) != length or len(usable) != length:
        raise InputError(
            f"{name} on {axis} has {len(values)} samples, the flight {length}",
            where,
            "put it on the flight's grid",
        )
    if math.isfinite(np.dot(values, values)):
        return  # as every sample is
    finite = np.isfinite(values)
    if not finite.all() and not finite[usable].all():
        raise InputError(
            f"{name} on {axis} is not finite where the axis is usable",
            where,
            "mark such samples unusable on this axis",
        )


def units(
    evidence: Evidence, windows: Sequence[tuple[float, float]], correlation_time: float
) -> tuple[Evidence, ...]:
    """Cut a flight into its manoeuvres, as units that may count as independent.

    windows : (start, end) [s] from the first sample, in order. A window that begins less than five
    `correlation_time` [s] of the residual after the end of the last one taken is left out, since
    neighbours would share noise. Each unit has its own intercepts. Its name is that of its
    `SamplingUnit`, ``flight@start-end``. State in the result that manoeuvres were the units.
    """
    parts: list[Evidence] = []
    whole, free_from = SamplingUnit.parse(evidence.flight), -np.inf
    for start, end in windows:
        if start < free_from or end <= start:
            continue
        first, last = max(0, round(start / evidence.step)), round(end / evidence.step) + 1
        parts.append(_cut(evidence, slice(first, last), str(whole.part(start, end))))
        free_from = end + 5.0 * correlation_time
    return tuple(parts)


def halves(
    evidence: Evidence, hypothesis: str, noise: Mapping[str, float], correlation_time: float
) -> tuple[Evidence, ...]:
    """Cut a unit in two where it has shown half of its information about a hypothesis (its id).

    The halves are five `correlation_time` [s] apart. noise : axis -> standard deviation of the
    remaining residual, coefficient units. Empty where one half would hold nothing.
    """
    shown = np.zeros(evidence.samples)
    for axis, column in evidence.columns.get(hypothesis, {}).items():
        usable = evidence.usable[axis]
        if axis in noise and usable.any():
            shown[usable] += np.square((column[usable] - column[usable].mean()) / noise[axis])
    middle = float(np.searchsorted(np.cumsum(shown), 0.5 * shown.sum())) * evidence.step
    gap, end = 2.5 * correlation_time, (evidence.samples - 1) * evidence.step
    if not shown.any() or middle - gap <= 0.0 or middle + gap >= end:
        return ()
    return units(evidence, [(0.0, middle - gap), (middle + gap, end)], 0.0)


def _cut(evidence: Evidence, part: slice, name: str) -> Evidence:
    """The samples `part` of the evidence under a new name; noisy copies alike."""

    def columns(source: Columns) -> dict[str, dict[str, Array]]:
        return {
            key: {axis: values[part] for axis, values in by_axis.items()}
            for key, by_axis in source.items()
        }

    return replace(
        evidence,
        flight=name,
        residual={axis: values[part] for axis, values in evidence.residual.items()},
        usable={axis: values[part] for axis, values in evidence.usable.items()},
        columns=columns(evidence.columns),
        noisy=tuple(_cut(other, part, name) for other in evidence.noisy),
        instruments=columns(evidence.instruments),
    )
