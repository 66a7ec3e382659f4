"""An increment: a correction identified from flights, with covariance and flown envelope."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.nomenclature import is_surface
from aerodb.support import Array
from aerodb.tables.expression import Expression
from aerodb.tables.functions import Value
from aerodb.tables.program import Program, compile_program

#: Variables whose envelope limits every regressor, even one that does not depend on them.
BASE_VARIABLES: Final[tuple[str, ...]] = ("alpha", "beta", "mach")


@dataclass(frozen=True)
class Interval:
    """The flown interval of one variable, `low` to `high`, and the width `cell` of a table cell,
    all in its SI unit."""

    low: float
    high: float
    cell: float

    def __post_init__(self) -> None:
        if not (
            np.all(np.isfinite((self.low, self.high, self.cell)))
            and self.low <= self.high
            and self.cell >= 0
        ):
            raise InputError(
                f"flown range from {self.low:g} to {self.high:g} with a cell of {self.cell:g}"
            )
        for name in ("low", "high", "cell"):
            object.__setattr__(self, name, float(getattr(self, name)) + 0.0)

    def contains(self, x: Value) -> NDArray[np.bool_]:
        """Return whether x lies inside the interval. x : (n,) or a number, in the unit of the
        variable."""
        return np.asarray((np.asarray(x) >= self.low) & (np.asarray(x) <= self.high))

    def weight(self, x: Value) -> Array:
        """Weight of an increment at x: 1 inside and up to one cell beyond, then linearly to 0 over
        one further cell (docs/method/updates.md, section "Envelope").

        x : (n,) or a number, in the unit of the variable.
        """
        if self.cell == 0.0:
            return self.contains(x).astype(np.float64)
        beyond = np.maximum(self.low - np.asarray(x), np.asarray(x) - self.high)
        with np.errstate(over="ignore"):  # far beyond a very small cell
            return np.clip(2.0 - beyond / self.cell, 0.0, 1.0)


def _in_words(name: str, margin: float) -> str:
    angle = is_surface(name) or name in ("alpha", "beta")
    return f"{name} by {np.degrees(margin):.3g} deg" if angle else f"{name} by {margin:.3g}"


class IncrementValue(NamedTuple):
    """Value and standard error of an increment, and where all variables lie inside its envelope;
    each (n,)."""

    value: Array
    standard_error: Array
    inside: NDArray[np.bool_]


@dataclass(frozen=True)
class RefinedShape:
    """A term with a finer shape than its template: its gain varies over nodes of `variables`.

    Parameters
    ----------
    hypothesis : its id.
    axis : body or wind axis of the term.
    fall : fraction by which the residual error falls on flights that were left out.
    """

    hypothesis: str
    axis: str
    variables: tuple[str, ...]
    fall: float


@dataclass(frozen=True)
class Refit:
    """Record of a refit: the gains were fitted again together with the rest of the candidate, and
    `shapes` are the terms whose shapes were refined."""

    shapes: tuple[RefinedShape, ...] = ()

    def __str__(self) -> str:
        """The text for notes and reports."""
        finer = [
            f"{shape.hypothesis} over {', '.join(shape.variables)} (left-out flights:"
            f" {shape.fall:.1%} less error)"
            for shape in self.shapes
        ]
        return "gain fitted once more beside the rest" + (
            f", shape refined of {'; '.join(finer)}" if finer else ""
        )


@dataclass(frozen=True, eq=False)
class Increment:
    """A correction of one coefficient, ``sum of estimates x regressors``.

    Parameters
    ----------
    axis : of the coefficient, body or wind.
    regressors : k expressions over channels.
    estimates, covariance : (k,) and (k, k).
    envelope : variable -> flown interval.
    flights : ids of the flights that it was identified from.
    note : its origin.
    folded : (k,) name of the table that already contains the regressor's contribution; empty where
        it acts as a layer (`consolidate`). Covariance, envelope and flights remain with the
        increment in either form.
    refit : record of a refit; None where there was none.
    lengthened_cells : number of table cells of alpha over which it is held and faded; 0 for the one
        cell of the envelope rule.
    induces_drag : on C_lift: whether what depends on the total lift follows (`LIFT_INCREMENTS`);
        False where an increment of the drag was estimated that holds what the lift induces.
    margins : where the database has nothing else on the axis (`aerodb.tables.continued`): variable
        of the envelope -> how far beyond it the regressors continue, in its unit, before they are
        held; nothing fades. None: regressors are held at the envelope's edge, and fade.

    Raises InputError where shapes do not match or a regressor calls a table.
    """

    axis: str
    regressors: tuple[Expression, ...]
    estimates: Array
    covariance: Array
    envelope: Mapping[str, Interval] = field(default_factory=dict)
    flights: tuple[str, ...] = ()
    note: str = ""
    folded: tuple[str, ...] = ()
    refit: Refit | None = None
    lengthened_cells: int = 0
    induces_drag: bool = True
    margins: Mapping[str, float] | None = None

    def __post_init__(self) -> None:
        k, where = len(self.regressors), f"increment on {self.axis}"
        estimates = np.array(self.estimates, dtype=np.float64) + 0.0
        covariance = np.array(self.covariance, dtype=np.float64) + 0.0
        if k == 0 or estimates.shape != (k,) or covariance.shape != (k, k):
            raise InputError(
                f"{k} regressors, estimates {estimates.shape}, covariance {covariance.shape}", where
            )
        if not (np.all(np.isfinite(estimates)) and np.all(np.isfinite(covariance))):
            raise InputError("estimates or covariance are not finite", where)
        estimates.flags.writeable = covariance.flags.writeable = False
        object.__setattr__(self, "estimates", estimates)
        object.__setattr__(self, "covariance", covariance)
        object.__setattr__(self, "regressors", tuple(self.regressors))
        object.__setattr__(self, "flights", tuple(self.flights))
        object.__setattr__(self, "folded", tuple(self.folded) or ("",) * k)
        if self.margins is not None:
            for name, margin in self.margins.items():
                if name not in self.envelope or not (np.isfinite(margin) and margin >= 0.0):
                    raise InputError(
                        f"margin of {margin:g} beyond the flown range of {name}", where
                    )
        if len(self.folded) != k:
            raise InputError(f"{k} regressors, {len(self.folded)} entries in 'folded'", where)
        object.__setattr__(self, "_program", compile_program(self.regressors, {}))

    _program: Program = field(init=False, repr=False)

    @property
    def full_note(self) -> str:
        """The note, the refit and the lengthened fade as text, for reports and exported files."""
        parts = [self.note, "" if self.refit is None else str(self.refit)]
        if self.lengthened_cells:
            cells = f"held and faded over {self.lengthened_cells} table cells of alpha each"
            parts.append(f"{cells}: over one, a slope would change sign outside the data")
        if self.margins is not None:
            far = [_in_words(name, margin) for name, margin in self.margins.items() if margin]
            how = (
                f"continued beyond its flown range, {', '.join(far)}, then held" if far else "held"
            )
            parts.append(f"{how} without fading: the database has nothing else on this axis")
        return "; ".join(filter(None, parts))

    @cached_property
    def names(self) -> frozenset[str]:
        """Channels, (n,) in SI units, of its regressors and of its envelope."""
        return frozenset(self._program.inputs) | frozenset(self.envelope)

    @cached_property
    def layered(self) -> Array:
        """(k,) estimates that act as a layer: zero where a regressor is folded into a table.

        Each is per unit of its regressor.
        """
        return np.where([bool(table) for table in self.folded], 0.0, self.estimates)

    @cached_property
    def acts_as_layer(self) -> bool:
        """Whether any regressor acts as a layer."""
        return bool(np.any(self.layered))

    def limiting(self, regressor: int) -> frozenset[str]:
        """Return the variables whose envelope (SI units) limits a regressor, by its number: its own
        and `BASE_VARIABLES`."""
        return self.regressors[regressor].names.union(BASE_VARIABLES) & self.envelope.keys()

    def fading(self, regressor: int) -> frozenset[str]:
        """Return the variables over whose envelope (SI units) a regressor, by its number, fades:
        those of `limiting`, or none where it continues."""
        return self.limiting(regressor) if self.margins is None else frozenset()

    def held_between(self, name: str) -> tuple[float, float]:
        """Return between which values of a variable of the envelope, in its unit, regressors
        change: those of the envelope, and its margin beyond."""
        interval, margin = self.envelope[name], (self.margins or {}).get(name, 0.0)
        return interval.low - margin, interval.high + margin

    def evaluate(self, channels: Mapping[str, Value]) -> IncrementValue:
        """Value and standard error under the envelope rule, whether folded or not.

        channels : `names`, each (n,) or a number.

        Beyond the envelope a regressor's variables are held at its edge, and its weight is the
        product over `fading`. The part of the correction that has faded is an error of the baseline
        there, so that its square is added to the variance: fully faded, the standard error is the
        baseline's error as far as the flights show it. Where regressors continue (`margins`), no
        flight tells whether they should: what straight continuation adds to the value at the
        envelope's edge is such an error.

        Raises InputError naming missing channels.
        """
        absent = sorted(self.names - set(channels))
        if absent:
            raise InputError(f"no value for {', '.join(absent)}", f"increment on {self.axis}")
        columns, weights = self.columns(channels)
        inside = np.ones(len(columns), dtype=np.bool_)
        for name, interval in self.envelope.items():
            inside &= interval.contains(channels[name])
        if self.margins is None:
            doubted = columns * (1.0 - weights)
        else:
            held = {n: (i.low, i.high) for n, i in self.envelope.items()}
            doubted = self._values(channels, {}) - self._values(channels, held)
        acting = columns * weights
        variance = np.einsum("nk,kl,nl->n", acting, self.covariance, acting)
        variance += (doubted @ self.estimates) ** 2
        error = np.sqrt(np.maximum(variance, 0.0))
        return IncrementValue(acting @ self.estimates, error, inside)

    def weight(self, channels: Mapping[str, Value]) -> Array:
        """(n,) weight of the flights' evidence: 1 inside the envelope and one cell beyond, 0 where
        it has faded.

        Channels are (n,): angles [rad], speeds [m/s], Mach number [-].
        """
        weight = np.ones(max((np.size(channels[name]) for name in self.names), default=1))
        for name, interval in self.envelope.items():
            weight *= interval.weight(channels[name])
        return weight

    def value(self, channels: Mapping[str, Value]) -> Array:
        """(n,) value of the layer: `evaluate` without standard error and without folded
        regressors."""
        columns, weights = self.columns(channels)
        return np.asarray((columns * weights) @ self.layered, dtype=np.float64)

    def columns(self, channels: Mapping[str, Value]) -> tuple[Array, Array]:
        """(n, k) regressors with variables held at the envelope's edge, or `margins` beyond, and
        (n, k) their weights.

        Channels are (n,): angles [rad], speeds [m/s], Mach number [-].
        """
        columns = self._values(channels, {name: self.held_between(name) for name in self.envelope})
        weights = np.ones(columns.shape)
        for k in range(columns.shape[1]):
            for name in self.fading(k):
                weights[:, k] *= self.envelope[name].weight(channels[name])
        return columns, weights

    def _values(
        self, channels: Mapping[str, Value], held: Mapping[str, tuple[float, float]]
    ) -> Array:
        """(n, k) regressors, with variables `held` between two values each."""
        n = max((np.size(channels[name]) for name in self.names), default=1)
        given: dict[str, Any] = {
            name: np.clip(channels[name], *held[name]) if name in held else channels[name]
            for name in self._program.inputs
        }
        columns = np.empty((n, len(self.regressors)))
        for k, values in enumerate(self._program.run(given).values):
            columns[:, k] = values
        return columns
