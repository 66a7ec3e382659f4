"""Residuals and variables of flights in the band of tracing, without what sensors could explain."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from aerodb.support import Array
from aerodb.tracing.decision.functions import RANK
from aerodb.tracing.evidence import Evidence, band_limited, stretches
from aerodb.tracing.settings import TracingSettings


class ResidualRecord(NamedTuple):
    """One axis of a flight in the band.

    variables (m, v), residual (m,), and a basis (m, s) of what sensors could explain; further
    (m, w) : variables over which only functions of one or two are tried.
    """

    variables: Array
    residual: Array
    basis: Array
    further: Array


@dataclass(frozen=True)
class FlightResidual:
    """One flight's residual, compared with the candidate, and the variables that may predict it.

    evidence : its residual has the accepted terms subtracted; its columns are those of the sensors:
    what any of them could explain, whatever its size, is not unexplained. variables : name -> (n,);
    further : likewise, those over which functions of one or two are tried; all where empty.
    """

    evidence: Evidence
    variables: Mapping[str, Array]
    further: Mapping[str, Array] = field(default_factory=dict)


def records_in_band(
    flight: FlightResidual,
    axes: Sequence[str],
    names: Sequence[str],
    more: Sequence[str],
    settings: TracingSettings,
) -> dict[str, ResidualRecord]:
    """Axis -> variables (m, v), residual (m,) and an orthonormal basis (m, s) of its level and of
    what the columns of the evidence (sensors) could explain, in the tracing band; the residual
    without its part in that basis.

    Axes that are usable at the same samples have the same array of variables. The residual is
    dimensionless, variables are in SI units.
    """
    evidence, variables = flight.evidence, [flight.variables[name] for name in names]
    variables += [flight.further[name] for name in more]
    known = np.logical_and.reduce([np.isfinite(row) for row in variables])
    records: dict[str, ResidualRecord] = {}
    for same in evidence.usable_alike(axes):
        usable = evidence.usable[same[0]]
        tangents = {
            axis: [columns[axis] for columns in evidence.columns.values() if axis in columns]
            for axis in same
        }
        rows = [
            *variables,
            *(row for axis in same for row in (evidence.residual[axis], *tangents[axis])),
        ]
        limited = [
            band_limited(
                [row[part] for row in rows],
                (usable & known)[part],
                evidence.step,
                settings.bandwidth,
            )
            for part in stretches(usable, evidence.step, settings.bandwidth, settings.order)
        ]
        joined = np.concatenate(limited) if limited else np.zeros((0, len(rows)))
        shared, first = np.ascontiguousarray(joined[:, : len(names)]), len(variables)
        further = joined[:, len(names) : first]
        for axis in same:
            last = first + 1 + len(tangents[axis])
            records[axis] = _record(shared, joined[:, first], joined[:, first + 1 : last], further)
            first = last
    return records


def _record(variables: Array, residual: Array, tangents: Array, further: Array) -> ResidualRecord:
    if len(residual) == 0:
        return ResidualRecord(variables, residual, np.zeros((0, 0)), further)
    explained = np.column_stack([np.ones(len(residual)), tangents])
    size = np.linalg.norm(explained, axis=0)
    left, singular, _ = np.linalg.svd(
        explained[:, size > 0.0] / size[size > 0.0], full_matrices=False
    )
    basis = left[:, singular > RANK * singular[0]]
    return ResidualRecord(variables, residual - basis @ (basis.T @ residual), basis, further)
