"""Samples of flights for declared increments: regressors and residual, axis by axis."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from aerodb.coefficients import Comparison, band_limited, rate_bandwidth, with_flow_rates
from aerodb.flight import Flight
from aerodb.increments.model_file import (
    DeclaredIncrement,
    ModelFile,
    Regressor,
    check_channels,
    expand,
)
from aerodb.nomenclature import MOMENT_AXES
from aerodb.signals import low_passed_rate
from aerodb.support import Array, Mask
from aerodb.tables import HAT_RATES, AeroDatabase, evaluate, hat_rate


@dataclass(frozen=True, eq=False)
class AxisSamples:
    """One flight's samples for one declared increment with k regressors.

    channels : name -> (n,). good : (n,) samples that are used. columns : (n, k), regressors,
    band-limited like the residual that they explain. comparison : measured and predicted
    coefficients.
    """

    channels: Mapping[str, Array]
    good: Mask
    columns: Array
    comparison: Comparison

    @property
    def count(self) -> int:
        """Number of samples that are used: the true ones of `good` (n,)."""
        return int(self.good.sum())


def with_model_rates(
    flights: Sequence[Flight], comparisons: Sequence[Comparison], model: ModelFile
) -> list[Flight]:
    """Return the flights with the rates of their flow angles, (n,) [rad/s], that the model declares
    and the logs lack."""
    pairs = zip(flights, comparisons, strict=True)
    return [_with_declared_rates(flight, comparison, model) for flight, comparison in pairs]


def channels_of(
    flights: Sequence[Flight], model: ModelFile, database: AeroDatabase
) -> list[dict[str, Array]]:
    """Channels of each flight, with the dimensionless rates.

    Raises InputError for a term that names a channel that a flight lacks.
    """
    channels = [_with_hat_rates(flight.channels, database) for flight in flights]
    check_channels(model, set.intersection(*(set(c) for c in channels)) if channels else set())
    return channels


def axis_samples(
    declared: DeclaredIncrement,
    flights: Sequence[Flight],
    channels: Sequence[Mapping[str, Array]],
    comparisons: Sequence[Comparison],
) -> list[AxisSamples]:
    """Samples of the flights that have usable ones on the axis.

    channels : of `channels_of`.

    Columns (n, k) in the SI units of the channels. A flight without a usable sample is left out.
    """
    axis, regressors = declared.axis, expand(declared)
    found = []
    for flight, named, comparison in zip(flights, channels, comparisons, strict=True):
        if axis not in comparison.usable:
            continue
        good = comparison.usable[axis] & _clean(flight, regressors)
        if good.any():
            columns = columns_of(axis, regressors, named, comparison)
            found.append(AxisSamples(named, good, columns, comparison))
    return found


def _with_declared_rates(flight: Flight, comparison: Comparison, model: ModelFile) -> Flight:
    """The flight with the rates of its flow angles that the model declares and the log lacks."""
    names = {
        name
        for declared in model.increment
        for regressor in expand(declared)
        for name in regressor.expression.names
    }
    wanted = {HAT_RATES[name][0] if name in HAT_RATES else name for name in names}
    return with_flow_rates(flight, rate_bandwidth(flight, comparison.bandwidth), wanted)[0]


def _with_hat_rates(channels: Mapping[str, Array], database: AeroDatabase) -> dict[str, Array]:
    """The channels, and the dimensionless rates computed from them with the database's lengths."""
    hats = {
        name: hat_rate(name, channels, database.reference)
        for name, (rate, _) in HAT_RATES.items()
        if {rate, "V"} <= set(channels)
    }
    return {**channels, **{name: values for name, values in hats.items() if name not in channels}}


def _clean(flight: Flight, regressors: Sequence[Regressor]) -> Mask:
    """(n,) where all channels of the declared terms are usable; a comparison covers only the
    channels that the database needs."""
    names = {name for regressor in regressors for name in regressor.expression.names}
    logged = {
        part
        for name in names
        for part in ((HAT_RATES[name][0], "V") if name in HAT_RATES else (name,))
    }
    return flight.usable(sorted(name for name in logged | names if name in flight))


def columns_of(
    axis: str,
    regressors: Sequence[Regressor],
    channels: Mapping[str, Array],
    comparison: Comparison,
) -> Array:
    """Return the regressors (n, k) of one flight, in SI units of its channels (n,), band-limited
    like the residual that they explain."""
    n = len(comparison.time)
    columns = [
        np.broadcast_to(evaluate(regressor.expression, channels), (n,)) for regressor in regressors
    ]
    columns = [as_compared(axis, column, comparison) for column in columns]
    return np.column_stack(columns)


def as_compared(axis: str, values: Array, comparison: Comparison) -> Array:
    """Return what is predicted on an axis (n,), dimensionless, band-limited like what is measured
    there: moments of differentiated rates by that derivative, and once more by the comparison."""
    bandwidth = comparison.bandwidth
    if axis not in MOMENT_AXES or bandwidth is None:
        return values
    if not np.any(np.isfinite(values) & (values != 0.0)):
        return values  # nothing stays nothing
    step = float(comparison.time[-1] - comparison.time[0]) / (len(comparison.time) - 1)
    return band_limited(low_passed_rate(values, step, bandwidth), step, bandwidth)


def excited(matrix: Array, regressors: Sequence[Regressor]) -> Mask:
    """Return the mask (k,) of columns of the matrix (n, k) that are excited: a constant always is;
    others must vary about their mean by more than rounding. The limit 1e-9 is relative,
    dimensionless."""
    constant = np.array([not regressor.expression.names for regressor in regressors])
    spread = matrix.std(axis=0)
    return constant | (spread > 1e-9 * np.maximum(np.abs(matrix).max(axis=0), 1e-12))
