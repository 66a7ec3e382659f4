"""States with a rate expression: their steady values, and their course along a flight."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.support import Array
from aerodb.tables.expression import Expression
from aerodb.tables.functions import Value
from aerodb.tables.instructions import machine
from aerodb.tables.program import AnyTable, Program

#: Steps of Newton's method, and the change at which a steady value is found, over 1 + its size.
_STEPS: Final = 60
_FOUND: Final = 1e-12
#: Step of the differences that give its slopes, over 1 + the size of the state.
_DIFFERENCE: Final = 1e-6
#: Longest step of the integration along a flight [s].
_LONGEST: Final = 0.01


@dataclass(frozen=True)
class Rate:
    """A state whose time derivative is an expression of channels, inputs, variables and states.

    Parameters
    ----------
    rate : in `unit` per second, over SI values. initial : at the beginning of a simulation that is
        not trimmed, and where the search for a steady value begins. unit : of the state.

    Raises InputError for an initial value that is not finite.
    """

    rate: Expression
    initial: float = 0.0
    unit: str = "1"

    def __post_init__(self) -> None:
        if not np.isfinite(self.initial):
            raise InputError(f"initial is {self.initial}", remedy="give a finite number")


def steady_values(
    program: Program, laws: Mapping[str, Rate], values: Mapping[str, Value]
) -> dict[str, Any]:
    """Return the values at which all rates are zero, state -> (n,) or a number, in their units.

    program : the rates, in the order of `laws`. values : its other inputs [SI], (n,) or numbers.
    By Newton's method from the initial values, all states together; NaN where it finds none.
    """
    names = list(laws)
    n = max((np.size(value) for value in values.values()), default=1)
    x = np.repeat([[laws[name].initial] for name in names], n, axis=1)
    found = np.zeros(n, dtype=np.bool_)

    def rates(at: Array) -> Array:
        run = program.run({**values, **dict(zip(names, at, strict=True))})
        return np.array([np.broadcast_to(each, (n,)) for each in run.values])

    with np.errstate(all="ignore"):
        for _ in range(_STEPS):
            now = rates(x)
            slopes = np.empty((n, len(names), len(names)))
            for k in range(len(names)):
                step = _DIFFERENCE * (1.0 + np.abs(x[k]))
                moved = x.copy()
                moved[k] += step
                slopes[:, :, k] = ((rates(moved) - now) / step).T
            good = np.isfinite(now).all(axis=0) & np.isfinite(slopes).all(axis=(1, 2))
            change = np.full_like(x, np.nan)
            if good.any():
                change[:, good] = -np.einsum(
                    "nij,jn->in", np.linalg.pinv(slopes[good]), now[:, good]
                )
            x = np.where(found, x, x + change)
            found |= (np.abs(change) <= _FOUND * (1.0 + np.abs(x))).all(axis=0)
            if found.all() or not good.any():
                break
        left = np.abs(rates(x)).max(axis=0)
    x = np.where(found & (left <= 1e-6 * (1.0 + np.abs(x).max(axis=0))), x, np.nan)
    single = all(np.ndim(value) == 0 for value in values.values())
    return {name: float(x[k, 0]) if single else x[k] for k, name in enumerate(names)}


def along_flight(
    program: Program,
    tables: Mapping[str, AnyTable],
    laws: Mapping[str, Rate],
    time: Array,
    channels: Mapping[str, Array],
) -> dict[str, Array]:
    """Integrate all states along a flight, state -> (n,), from their steady values at its first
    sample, or the initial ones where there are none.

    Parameters
    ----------
    program, laws : as of `steady_values`. tables : of the database.
    time : (n,) [s], uniform. channels : other inputs of the program [SI], each (n,), linear
        between samples; gaps are bridged.
    """
    from aerodb.tables.state_kernel import rates_along  # loads the compiler

    lowered = machine(program, tables)
    names = [name for name in lowered.inputs if name not in laws]
    series = np.array([_bridged(time, channels[name]) for name in names]).reshape(-1, len(time)).T
    start = steady_values(program, laws, dict(zip(names, series[0], strict=True)))
    first = np.array(
        [start[n] if np.isfinite(start[n]) else laws[n].initial for n in laws], dtype=np.float64
    )
    spare = len(lowered.slots)  # of a state that no rate reads
    slots = np.concatenate([lowered.slots, [0.0]])[:, None]
    step = float(time[-1] - time[0]) / max(len(time) - 1, 1)
    result = rates_along(
        lowered.instructions,
        np.ascontiguousarray(slots),
        np.array([lowered.inputs[name] for name in names], dtype=np.int64),
        np.ascontiguousarray(series),
        np.array([lowered.inputs.get(name, spare) for name in laws], dtype=np.int64),
        np.array(lowered.outputs, dtype=np.int64),
        first,
        step,
        max(int(np.ceil(step / _LONGEST)), 1),
    )
    return {name: result[:, k] for k, name in enumerate(laws)}


def _bridged(time: Array, values: Array) -> Array:
    values = np.broadcast_to(np.asarray(values, dtype=np.float64), (len(time),))
    good = np.isfinite(values)
    if good.all() or not good.any():
        return values
    return np.interp(time, time[good], values[good])
