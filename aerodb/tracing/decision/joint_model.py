"""Fit one model to several manoeuvres at once, and whiten them by what the model leaves."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from aerodb.effects import Hypothesis
from aerodb.support import SMALL, Array
from aerodb.tracing.decision.selection import CrossFlightTests
from aerodb.tracing.estimates import campaign
from aerodb.tracing.evidence import (
    NUISANCE,
    BandLimitedFlight,
    Evidence,
    FlightNormalEquations,
    Records,
    in_band,
    normal_equations_of_band,
    without_shape_terms,
)
from aerodb.tracing.settings import TracingSettings

#: A manoeuvre is short and made of square pulses: up to the third harmonic of the band's edge they
#: excite.
HARMONIC: Final = 3.0
#: One Dutch roll moves all lateral variables alike: in a joint model standard errors judge, not the
#: VIF.
INFLATION_LIMIT: Final = 1e4
#: Share of the best unit's information that a unit needs to take part in a test. Flights of one
#: programme are flown alike, manoeuvres are not. One made for another axis would add only noise to
#: those made for this one: all units count alike in the mean.
LEAST_SHARE: Final = SMALL
#: Iterations of the weights of the fit.
_ITERATIONS = 5


@dataclass(frozen=True)
class JointModel:
    """A model of several units.

    terms : indices in the library; values : (k,), SI; normal_equations : of the whole residuals,
    whitened by what the model leaves; tests : over these units.
    """

    terms: tuple[int, ...]
    values: Array
    normal_equations: tuple[FlightNormalEquations, ...]
    tests: CrossFlightTests

    def value(self, index: int) -> float:
        """Return the common value (scalar, SI unit of its hypothesis) of one of the terms;
        ValueError for others."""
        return float(self.values[self.terms.index(index)])


def joint_bands(
    evidence: Sequence[Evidence], hypotheses: Sequence[Hypothesis], settings: TracingSettings
) -> tuple[list[BandLimitedFlight], TracingSettings]:
    """Return the units (flights or parts) in the band of manoeuvres, records (m, k + 2), with a
    column for each of k hypotheses, and their settings. Units without a usable stretch are left
    out.
    """
    wide = replace(
        settings,
        bandwidth=HARMONIC * settings.bandwidth,
        inflation_limit=INFLATION_LIMIT,
        least_share=max(LEAST_SHARE, settings.least_share),
    )
    bands = [_ordered(in_band(without_shape_terms(each), wide), hypotheses) for each in evidence]
    return [band for band in bands if band.records], wide


def joint_fit(
    bands: Sequence[BandLimitedFlight],
    terms: Sequence[int],
    hypotheses: Sequence[Hypothesis],
    settings: TracingSettings,
) -> JointModel:
    """Fit common values of the terms to all units by weighted least squares.

    Each unit has a constant of its own per axis, and each axis of a unit the weight of what remains
    of it. The whitening filters are fitted to the remaining residual; the normal equations are
    those of the whole residual, ``y = y' + X theta``, by algebra. Values (t,) are in the unit of
    each term.
    """
    columns = [index + 1 for index in terms]
    rows = {
        (u, axis): _level(records, columns)
        for u, band in enumerate(bands)
        for axis, records in band.records.items()
    }
    products = {key: each.T @ each for key, each in rows.items()}
    weight = dict.fromkeys(rows, 1.0)
    values = np.zeros(len(columns))
    for _ in range(_ITERATIONS):
        total = np.sum([weight[key] * each for key, each in products.items()], axis=0)
        square, right = total[:-1, :-1], total[:-1, -1]
        scale = np.sqrt(np.where(np.diag(square) > 0.0, np.diag(square), 1.0))
        values = (
            np.linalg.lstsq(square / np.outer(scale, scale), right / scale, rcond=1e-10)[0] / scale
        )
        taken = np.r_[-values, 1.0]
        spread = {
            key: float(taken @ each @ taken) / len(rows[key]) for key, each in products.items()
        }
        weight = {key: 1.0 / each if each > 0.0 else 0.0 for key, each in spread.items()}
    normal_equations = tuple(_about(band, columns, values, settings) for band in bands)
    return JointModel(
        tuple(terms),
        values,
        normal_equations,
        CrossFlightTests(
            campaign(normal_equations, hypotheses, extrapolated=False),
            tuple(range(len(bands))),
            settings,
        ),
    )


def under(joint: JointModel, evidence: Sequence[Evidence]) -> CrossFlightTests:
    """Return the tests of other units (parts of the same flights) under the same model.

    Whitened by the noise that it leaves in them; units too short to be traced stay out. Records are
    (m, k + 2): intercept, k hypotheses, residual.
    """
    hypotheses, settings = joint.tests.campaign.hypotheses, joint.tests.settings
    bands = [
        _ordered(in_band(without_shape_terms(each), settings), hypotheses) for each in evidence
    ]
    columns = [index + 1 for index in joint.terms]
    normal_equations = [
        _about(band, columns, joint.values, settings) for band in bands if band.records
    ]
    return CrossFlightTests(
        campaign(normal_equations, hypotheses, extrapolated=False),
        tuple(range(len(normal_equations))),
        settings,
    )


def _level(records: Sequence[Array], columns: Sequence[int]) -> Array:
    """The columns and the residual of one unit's axis (m, k + 1), each without its mean."""
    rows = np.concatenate([record[:, [*columns, -1]] for record in records])
    return np.asarray(rows - rows.mean(axis=0))


def _about(
    band: BandLimitedFlight, columns: Sequence[int], values: Array, settings: TracingSettings
) -> FlightNormalEquations:
    def left(records: Records) -> dict[str, list[Array]]:
        return {
            axis: [
                np.column_stack([record[:, :-1], record[:, -1] - record[:, columns] @ values])
                for record in records_of_axis
            ]
            for axis, records_of_axis in records.items()
        }

    noisy = tuple(left(copy) for copy in band.noisy)
    equations = normal_equations_of_band(
        replace(band, records=left(band.records), noisy=noisy, instruments={}), settings
    )
    back = np.eye(len(equations.matrix))
    back[[len(equations.axes) + column - 1 for column in columns], -1] = values
    again = None if equations.noisy is None else back.T @ equations.noisy @ back
    return replace(equations, matrix=back.T @ equations.matrix @ back, noisy=again)


def _ordered(band: BandLimitedFlight, hypotheses: Sequence[Hypothesis]) -> BandLimitedFlight:
    """The band with a column for every hypothesis, in the library's order, zero where the unit
    lacks it, and then its nuisances.
    """
    nuisances = (name for name in band.names if name.startswith(NUISANCE))
    names = (*(hypothesis.id for hypothesis in hypotheses), *nuisances)
    indices = [0, *(names.index(name) + 1 for name in band.names), len(names) + 1]

    def wide(records: Records) -> dict[str, list[Array]]:
        ordered = {
            axis: [np.zeros((len(record), len(names) + 2)) for record in each]
            for axis, each in records.items()
        }
        for axis, each in records.items():
            for target, record in zip(ordered[axis], each, strict=True):
                target[:, indices] = record
        return ordered

    noisy = tuple(wide(copy) for copy in band.noisy)
    return replace(band, names=names, records=wide(band.records), noisy=noisy, instruments={})
