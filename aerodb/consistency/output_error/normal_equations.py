"""Normal equations of a joint reconstruction, summed over the records for each channel.

Kept per channel, they give the solution for every weighting of the channels without another pass
over the samples.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from aerodb.consistency.kinematics import STATES
from aerodb.consistency.sensors import (
    MAX_DELAY,
    FlightRecord,
    RecordPrediction,
    SensorParameter,
    delays_of,
    predict_outputs,
)
from aerodb.errors import InputError
from aerodb.support import Array

#: Multiplications in a matrix product below which BLAS stays on one thread.
_SINGLE_THREAD = 100_000

#: Euler angles are not compared beyond this measured pitch attitude (rad).
VERTICAL = float(np.deg2rad(80.0))


@dataclass(frozen=True)
class ChannelNormalEquations:
    """Sums over all records by channel, for k unknowns, unweighted.

    count : samples used. squares : sum of squared residuals.
    information : (k, k), cross-products of the derivatives.
    gradient : (k,), derivatives times residuals.
    """

    count: Mapping[str, int]
    squares: Mapping[str, float]
    information: Mapping[str, Array]
    gradient: Mapping[str, Array]

    def variance(self, floor: Mapping[str, float]) -> dict[str, float]:
        """Residual variance by channel, SI squared, not below the square of `floor` (name -> one
        sigma, SI)."""
        return {
            name: max(self.squares[name] / n, floor.get(name, 0.0) ** 2, 1e-30)
            for name, n in self.count.items()
        }

    def cost(self, floor: Mapping[str, float]) -> float:
        """Negative log-likelihood with the noise variance estimated, ``sum N/2 (ln R + S/(N R))``.

        Dimensionless scalar, without constants; R as in `variance`. floor : channel -> one sigma,
        SI.
        """
        noise = self.variance(floor)
        return sum(
            0.5 * (n * np.log(noise[name]) + self.squares[name] / noise[name])
            for name, n in self.count.items()
        )


def applies_to(item: SensorParameter, record: FlightRecord) -> bool:
    """Return whether a parameter acts on this record."""
    return item.scope in ("", record.name if item.kind == "initial" else record.flight)


def usable_samples(
    record: FlightRecord, name: str, free: Sequence[SensorParameter], values: Mapping[str, float]
) -> NDArray[np.bool_]:
    """(n,) samples of an output that are used.

    They are finite, `MAX_DELAY` [s] away from the ends of the record if the channel is delayed, and
    no Euler angle near the vertical (`VERTICAL` [rad]), where noise flips bank and heading.
    """
    good = np.isfinite(record.outputs[name])
    delays = delays_of(name)
    if any(values.get(each, 0.0) != 0.0 for each in delays) or any(
        item.name in delays for item in free
    ):
        margin = int(np.ceil(MAX_DELAY / record.step)) + 2
        good[:margin] = False
        good[len(good) - margin :] = False
    if name in ("phi", "theta", "psi") and "theta" in record.outputs:
        good &= ~(np.abs(record.outputs["theta"]) > VERTICAL)
    return good


def residuals(record: FlightRecord, response: RecordPrediction) -> dict[str, Array]:
    """Measured minus reconstructed outputs, (n,) by channel, SI; bank and heading between -pi and
    pi [rad]."""
    differences = {}
    for name, shown in response.outputs.items():
        difference = record.outputs[name] - shown
        differences[name] = (
            np.angle(np.exp(1j * difference)) if name in ("phi", "psi") else difference
        )
    return differences


def record_values(
    items: Sequence[SensorParameter],
    vector: Array,
    record: FlightRecord,
    fixed: Mapping[str, float],
) -> dict[str, float]:
    """Name -> value, SI, of the parameters that act on a record: fixed ones and those in `vector`.

    items : k unknowns. vector : (k,), their values.
    """
    own = {
        item.name: float(v)
        for item, v in zip(items, vector, strict=True)
        if applies_to(item, record)
    }
    return {**fixed, **own}


def first_state(start: Array, values: Mapping[str, float]) -> Array:
    """The record's initial state (9,): `start` plus the corrections ``initial_*``."""
    return start + np.array([values.get(f"initial_{name}", 0.0) for name in STATES])


def accumulate(
    records: Sequence[FlightRecord],
    starts: Sequence[Array],
    items: Sequence[SensorParameter],
    vector: Array,
    fixed: Mapping[str, float],
    drivers: Sequence[FlightRecord] | None = None,
) -> ChannelNormalEquations:
    """Normal equations over all records at the values `vector` (k,) of the unknowns `items`.

    starts : initial states, (9,) each. fixed : other parameters, name -> value, SI. drivers : the
    records at full rate, where `records` are thinned; each sample then counts for those that it
    stands for. Raises InputError when a channel has no usable sample.
    """
    k = len(items)
    count: dict[str, int] = {}
    squares: dict[str, float] = {}
    information: dict[str, Array] = {}
    gradient: dict[str, Array] = {}
    for record, start, driver in zip(records, starts, drivers or records, strict=True):
        index = [number for number, item in enumerate(items) if applies_to(item, record)]
        values = record_values(items, vector, record, fixed)
        response = predict_outputs(
            record,
            values,
            first_state(start, values),
            [items[number] for number in index],
            driver=None if drivers is None else driver,
        )
        weight = round(record.step / driver.step)
        for name, residual in residuals(record, response).items():
            good = usable_samples(record, name, items, values)
            chosen = _as_slice(good)
            slope, error = response.slopes[name][chosen], residual[chosen]
            if name not in count:
                count[name], squares[name] = 0, 0.0
                information[name], gradient[name] = np.zeros((k, k)), np.zeros(k)
            count[name] += weight * len(error)
            squares[name] += weight * float(error @ error)
            information[name][np.ix_(index, index)] += weight * cross_product(slope)
            gradient[name][index] += weight * (slope.T @ error)
    empty = [name for name, n in count.items() if n == 0]
    if empty:
        raise InputError(
            f"no usable sample of {', '.join(empty)}", records[0].name, "leave the channel out"
        )
    return ChannelNormalEquations(count, squares, information, gradient)


def _as_slice(good: NDArray[np.bool_]) -> slice | NDArray[np.bool_]:
    """Return what chooses the same samples, without a copy where they are one stretch."""
    first, count = int(np.argmax(good)), int(np.count_nonzero(good))
    together = bool(good[first : first + count].all())
    return slice(first, first + count) if together else good


def in_blocks(values: Array, blocks: int, size: int) -> Array:
    """Return values (n, c) as (blocks, size, c), zeros after the end; for `cross_product`."""
    padded = np.zeros((blocks * size, values.shape[1]))
    padded[: len(values)] = values
    return padded.reshape(blocks, size, values.shape[1])


def cross_product(slope: Array) -> Array:
    """Return ``slope' slope`` (k, k) of (n, k), in squared units of the slopes, block by block:
    products of this size stay on one BLAS thread; more threads would slow down flights that are
    processed in parallel."""
    size = max(8, _SINGLE_THREAD // max(slope.shape[1], 1) ** 2)
    if len(slope) <= size:
        return np.asarray(slope.T @ slope)
    part = in_blocks(slope, -(-len(slope) // size), size)
    return np.asarray((np.swapaxes(part, 1, 2) @ part).sum(axis=0))
