"""Flights that leave the envelope of the increments that predict them: the error with increments
held, as a version has them, and with their slopes extrapolated."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.coefficients import Comparison, as_inputs
from aerodb.flight import Flight
from aerodb.signals import rms
from aerodb.support import MINUTE, Array
from aerodb.tables import AeroDatabase

#: Least share of a flight's usable samples beyond the envelope that is reported.
_LEAST: Final = MINUTE


@dataclass(frozen=True)
class Excursion:
    """How far a flight leaves the envelope of a variable: its own interval and the envelope's, in
    the variable's SI unit."""

    variable: str
    flight: tuple[float, float]
    envelope: tuple[float, float]


@dataclass(frozen=True)
class Beyond:
    """Error of one flight on one axis where it leaves the envelopes of the increments there.

    Parameters
    ----------
    excursions : per variable that leaves its envelope.
    intervals : stretches of time [s] outside.
    share : of the usable samples that lie outside.
    continued : whether an increment on the axis continues beyond its envelope instead of fading.
    held, extrapolated : rms residual over all usable samples, with the increments held and faded
        as the version has them, and with their slopes extrapolated.
    held_outside, extrapolated_outside : the same over the samples outside.
    held_without_constant, extrapolated_without_constant : over all usable samples, about the mean.
    """

    flight: str
    axis: str
    excursions: tuple[Excursion, ...]
    intervals: tuple[tuple[float, float], ...]
    share: float
    continued: bool
    held: float
    extrapolated: float
    held_outside: float
    extrapolated_outside: float
    held_without_constant: float
    extrapolated_without_constant: float


def with_extrapolated_slopes(database: AeroDatabase) -> AeroDatabase:
    """Return the database whose increments act everywhere as estimated: neither held at the edge of
    their envelope nor faded. No version is stored so: what is beyond the envelope is no evidence.
    See docs/method/updates.md, section Envelope.
    """
    return replace(
        database,
        increments=tuple(replace(each, envelope={}, margins=None) for each in database.increments),
    )


def beyond_envelopes(
    flight: Flight, database: AeroDatabase, held: Comparison, extrapolated: Comparison
) -> tuple[Beyond, ...]:
    """Return the errors of a flight on the axes where it leaves an envelope.

    held : its comparison with `database`. extrapolated : that with `with_extrapolated_slopes`.

    Errors are those of dimensionless coefficients; channels (n,) in SI units. An axis without a
    usable sample is left out.
    """
    flown = as_inputs(flight, database)
    found = []
    for axis in dict.fromkeys(each.axis for each in database.increments):
        good = held.usable.get(axis)
        if good is None or not good.any():
            continue
        outside, excursions = _outside(database, axis, flown.channels, good)
        beyond = outside & good
        if beyond.sum() < _LEAST * good.sum():
            continue
        residuals = [each.residual(axis) for each in (held, extrapolated)]
        found.append(
            Beyond(
                flight.id,
                axis,
                excursions,
                _intervals(flight.time, beyond),
                float(beyond.sum() / good.sum()),
                any(i.margins is not None for i in database.increments if i.axis == axis),
                *(rms(residual[good]) for residual in residuals),
                *(rms(residual[beyond]) for residual in residuals),
                *(float(np.std(residual[good])) for residual in residuals),
            )
        )
    return tuple(found)


def _outside(
    database: AeroDatabase, axis: str, channels: Mapping[str, Array], good: NDArray[np.bool_]
) -> tuple[NDArray[np.bool_], tuple[Excursion, ...]]:
    """Return where (n,) a flight is outside any envelope on an axis, and in which variables."""
    outside = np.zeros(len(good), dtype=np.bool_)
    excursions: dict[str, Excursion] = {}
    for increment in database.increments:
        if increment.axis != axis:
            continue
        values = database.resolved(increment.names, channels)
        acting = frozenset[str]().union(*map(increment.limiting, range(len(increment.regressors))))
        for name in sorted(acting):
            interval = increment.envelope[name]
            value = np.broadcast_to(values[name], good.shape)
            beyond = ~interval.contains(value) & good
            outside |= beyond
            if beyond.any():
                flight = (float(value[good].min()), float(value[good].max()))
                excursions[name] = Excursion(name, flight, (interval.low, interval.high))
    return outside, tuple(excursions.values())


def _intervals(time: Array, where: NDArray[np.bool_]) -> tuple[tuple[float, float], ...]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], where, [False]]).astype(np.int8)))
    return tuple(
        (float(time[first]), float(time[last - 1]))
        for first, last in zip(edges[::2], edges[1::2], strict=True)
    )
