"""Commands of rotors in another order than the database has, and rotors that turn the other way.

The moments about the three axes are regressed on the commands (and on rates, which damp). What each
command does must be what the database has for it. A mixer moves many rotors in few ways; then the
smallest effects that explain the moments are compared, which for a mixer's own are all there are.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from math import lgamma
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.conditioning import Suspicion
from aerodb.estimation import samples_per_independent
from aerodb.flight import Flight
from aerodb.nomenclature import MOMENT_AXES, is_command
from aerodb.support import SMALL, Array
from aerodb.suspicions.evidence import EXPLAINED, LIKELIER, WELL_EXPLAINED
from aerodb.tables import AeroDatabase

#: Change of a command by which its effect is taken.
_STEP: Final = 0.01
#: Least singular value, of the largest, along which commands are said to move: a mixer's own ways.
_MOVED: Final = SMALL


@dataclass(frozen=True)
class _Moments:
    """What commands do about one axis: `measured` and `expected` (k,) per command, both of unit
    length; `response` (m,) and what the commands `made` (m, k) of it; explained share."""

    measured: Array
    expected: Array
    response: Array
    made: Array
    explained: float

    def left(self, order: list[int]) -> Array:
        """What (m,) is left by the database's effects in an order, scaled to fit."""
        column = self.made @ self.expected[order]
        return np.asarray(
            self.response
            - column * max(float(column @ self.response) / float(column @ column), 0.0)
        )


def order_suspicions(
    flight: Flight,
    database: AeroDatabase,
    measured: Mapping[str, Array],
    good: NDArray[np.bool_],
    banded: Callable[[Array], Array],
) -> tuple[Suspicion, ...]:
    """Return the order of commands that a flight shows, if it is not the database's, or the turning
    of all rotors, if it is the other; empty for neither.

    measured : axis -> (n,). good : (n,), samples that count. banded : from (n,) to the samples (m,)
    and frequencies that are compared.
    """
    names = [name for name in database.inputs if is_command(name) and name in flight]
    commands = np.column_stack([banded(flight[name]) for name in names])
    if not np.all(np.ptp(commands, axis=0) > 0.0):
        return ()
    axes = {
        axis: found
        for axis in MOMENT_AXES
        if axis in measured
        and (found := _moments(flight, database, axis, names, commands, measured, good, banded))
    }
    if not {"Cl", "Cm"} <= axes.keys():
        return ()
    alike = {axis: float(each.measured @ each.expected) for axis, each in axes.items()}
    placed = min(alike["Cl"], alike["Cm"]) > WELL_EXPLAINED
    if placed and alike.get("Cn", 0.0) < -WELL_EXPLAINED:
        words = (
            "the drag of the rotors turns the vehicle the other way than the database's: exchange 1"
            " and -1 in `turns` of all its rotors"
        )
        return (Suspicion(names[0], "sign", words, {"agreement": alike["Cn"]}),)
    from scipy.optimize import linear_sum_assignment  # slow to import

    shares = [each.explained * np.outer(each.measured, each.expected) for each in axes.values()]
    share = np.sum(shares, axis=0)
    order = [int(k) for k in linear_sum_assignment(share, maximize=True)[1]]
    pairs = [(names[k], names[j]) for k, j in enumerate(order) if k != j]
    agreement = float(np.trace(share[:, order])) / sum(each.explained for each in axes.values())
    if not pairs or agreement < WELL_EXPLAINED:
        return ()
    gained = sum(_likelier(each, order) for each in axes.values())
    if gained < LIKELIER + lgamma(len(names) + 1):
        return ()
    is_ = ", ".join(f"{one} is its {other}" for one, other in pairs)
    words = (
        "the rotors of the log are in another order than the database's. By the motion,"
        f" {is_}. Exchange the fields of [rotors] in the vehicle file, or the positions"
        " of the parts"
    )
    evidence = {"agreement": agreement, "likelier": gained}
    return (Suspicion(pairs[0][0], "swapped", words, evidence),)


def _likelier(axis: _Moments, order: list[int]) -> float:
    """Logarithm of the ratio of likelihoods of an order and the database's own, about an axis."""
    own, other = (axis.left(each) for each in (list(range(len(order))), order))
    independent = len(own) / max(1.0, samples_per_independent(other))
    return 0.5 * independent * float(np.log(float(own @ own) / max(float(other @ other), 1e-300)))


def _moments(
    flight: Flight,
    database: AeroDatabase,
    axis: str,
    names: list[str],
    commands: Array,
    measured: Mapping[str, Array],
    good: NDArray[np.bool_],
    banded: Callable[[Array], Array],
) -> _Moments | None:
    """The effects of commands (m, k) about an axis; None where they explain little of it."""
    expected = _expected(flight, database, axis, names, good)
    rates = np.column_stack([np.ones(len(commands)), *(banded(flight[n]) for n in "pqr")])
    response, *columns = (
        each - rates @ np.linalg.lstsq(rates, each, rcond=None)[0]
        for each in (banded(measured[axis]), *commands.T)
    )
    made = np.column_stack(columns)
    found = np.linalg.lstsq(made, response, rcond=_MOVED)[0]
    size, length = float(np.linalg.norm(found)), float(np.linalg.norm(expected))
    if not (size > 0.0 and length > 0.0 and float(response @ response) > 0.0):
        return None
    left = response - made @ found
    explained = 1.0 - float(left @ left) / float(response @ response)
    if explained < EXPLAINED:
        return None
    return _Moments(found / size, expected / length, response, made, explained)


def _expected(
    flight: Flight, database: AeroDatabase, axis: str, names: list[str], good: NDArray[np.bool_]
) -> Array:
    """Change (k,) of a coefficient by each command at the middle of what was flown, per
    unit."""
    middle = {
        name: np.full(2 * len(names), float(np.median(flight[name][good])))
        for name in database.inputs
        if name in flight
    }
    for k, name in enumerate(names):
        middle[name][2 * k] += _STEP
        middle[name][2 * k + 1] -= _STEP
    values = np.broadcast_to(database.predict(middle).coefficients[axis], 2 * len(names))
    return np.asarray((values[::2] - values[1::2]) / (2.0 * _STEP))
