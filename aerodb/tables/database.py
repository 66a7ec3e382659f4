"""An aerodynamic database: a graph from channels through variables and tables to the six
coefficients.

Its readable view are the terms, each an expression on one axis; increments from flights add at the
outputs. Where a database comes from or goes to belongs in `aerodb.exchange`.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.nomenclature import AXES, FORCE_AXES
from aerodb.support import Array
from aerodb.tables.definitions import (
    CONSTANTS,
    check_axis,
    check_definitions,
    check_input,
    check_uncertainties,
)
from aerodb.tables.expression import Expression
from aerodb.tables.functions import Value
from aerodb.tables.increment import Increment
from aerodb.tables.program import AnyTable, Program, compile_program
from aerodb.tables.reference import (
    HAT_RATES,
    WIND_AXES,
    Reference,
    hat_rate,
    transfer_moments,
    wind_to_body,
)
from aerodb.tables.scattered import ScatteredTable
from aerodb.tables.state_model import StateModel
from aerodb.tables.table import Table
from aerodb.tables.uncertainty import Uncertainty

if TYPE_CHECKING:
    from aerodb.tables.evaluation import Evaluation

__all__ = [
    "CONSTANTS",
    "AeroDatabase",
    "Prediction",
    "Reference",
    "Term",
    "Variable",
    "transfer_moments",
]

#: Points that are evaluated at once: more would not fit a processor's cache with all intermediate
#: values. No power of two: rows of that length fall on the same lines of the cache, which doubles
#: the time.
BLOCK: Final = 4000


@dataclass(frozen=True)
class Variable:
    """A named expression that terms and other variables use; `unit` as far as the source tells.

    declared : what the source says of it beyond that, as text: DAVE-ML's id, name, sign, symbol,
    role and alike.
    """

    expression: Expression
    unit: str = "1"
    description: str = ""
    declared: Mapping[str, str] = field(default_factory=dict)
    uncertainty: Uncertainty | None = None


@dataclass(frozen=True)
class Term:
    """One contribution to a coefficient axis (CX .. Cn, or C_drag C_side C_lift along the wind
    axes)."""

    name: str
    axis: str
    expression: Expression
    description: str = ""


@dataclass(frozen=True, eq=False)
class Prediction:
    """Coefficients on the six body axes, each (n,), moments about the database's own moment
    reference.

    outside : (n,) true where any argument of any table lies outside its breakpoints;
    `outside_tables`, by table name, holds only tables for which that happens at all.
    """

    coefficients: dict[str, Array]
    outside: NDArray[np.bool_]
    outside_tables: Mapping[str, NDArray[np.bool_]]


@dataclass(frozen=True, eq=False)
class AeroDatabase:
    """A database of one vehicle.

    Names in expressions are resolved in this order: `variables`; the constants S_ref [m2], c_ref,
    b_ref [m]; `free_inputs` (name -> what it is: quantities that the source uses and that are no
    channel of this product); channels of `aerodb.nomenclature`, where p_hat q_hat r_hat
    alphadot_hat are made from p q r alphadot, V and this database's own lengths unless they are
    given. A channel that one of `states` makes has, unless it is given, the value that it settles
    at: what it is along a flight says `states_along`.

    Raises InputError for an unknown name, table or axis (with the nearest valid one), a wrong
    number of table arguments, and variables that are defined by each other.
    """

    name: str
    reference: Reference
    variables: Mapping[str, Variable] = field(default_factory=dict)
    tables: Mapping[str, Table] = field(default_factory=dict)
    terms: tuple[Term, ...] = ()
    increments: tuple[Increment, ...] = ()
    free_inputs: Mapping[str, str] = field(default_factory=dict)
    description: str = ""
    source: str = ""
    scattered: Mapping[str, ScatteredTable] = field(default_factory=dict)
    states: tuple[StateModel, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "states", tuple(self.states))
        object.__setattr__(self, "terms", tuple(self.terms))
        object.__setattr__(self, "increments", tuple(self.increments))
        check_definitions(self)
        check_uncertainties(self)
        for axis in self._axes:
            check_axis(axis, self.name)
        names = [term.name for term in self.terms]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise InputError(
                f"term '{repeated[0]}' stands twice",
                f"database {self.name}",
                "give each term its own name",
            )
        try:
            everything = [v.expression for v in self.variables.values()] + [
                term.expression for term in self.terms
            ]
            used = set(self._compile(everything).inputs)
        except InputError as error:
            raise InputError(error.what, f"database {self.name}", error.remedy) from None
        for name in sorted(used.union(*(increment.names for increment in self.increments))):
            check_input(name, self)

    def _compile(self, expressions: Iterable[Expression]) -> Program:
        definitions = {name: variable.expression for name, variable in self.variables.items()}
        return self.compiled(expressions, definitions, {**self.tables, **self.scattered})

    def compiled(
        self,
        expressions: Iterable[Expression],
        variables: Mapping[str, Expression],
        tables: Mapping[str, AnyTable],
    ) -> Program:
        """A program of `expressions` with this database's reference lengths and other definitions
        of variables and tables."""
        constants = {
            name: float(getattr(self.reference, attribute)) for name, attribute in CONSTANTS.items()
        }
        return compile_program(expressions, tables, variables, constants)

    @cached_property
    def _program(self) -> Program:
        return self._compile(term.expression for term in self.terms)

    @cached_property
    def _axes(self) -> frozenset[str]:
        return frozenset(
            [term.axis for term in self.terms] + [increment.axis for increment in self.increments]
        )

    @cached_property
    def needs(self) -> tuple[str, ...]:
        """Names that evaluation uses, hat rates among them."""
        names = set(self._program.inputs).union(*(increment.names for increment in self.increments))
        if self.on_wind_axes:
            names |= {"alpha", "beta"}
        return tuple(sorted(names))

    @property
    def on_wind_axes(self) -> bool:
        """Whether any term or increment acts on C_drag, C_side or C_lift."""
        return not self._axes.isdisjoint(WIND_AXES)

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """Channels and free inputs that `predict` needs, sorted; for a hat rate the rate and V that
        it is made of."""
        names = set(self.needs) - set(HAT_RATES)
        for hat in set(self.needs) & set(HAT_RATES):
            names |= {HAT_RATES[hat][0], "V"}
        if names & self._states.keys():
            names.add("alpha")
        return tuple(sorted(names))

    @cached_property
    def flight_inputs(self) -> tuple[str, ...]:
        """Channels and free inputs that a flight must have, sorted: `inputs`, in place of states
        what they are made of."""
        made = [self._states[name] for name in self.inputs if name in self._states]
        return tuple(
            sorted(
                set(self.inputs) - self._states.keys()
                | {name for state in made for name in state.needs}
            )
        )

    @cached_property
    def _states(self) -> dict[str, StateModel]:
        return {state.name: state for state in self.states}

    def states_along(self, time: Array, channels: Mapping[str, Array]) -> dict[str, Array]:
        """The channels that the states make along a flight, by name, each (n,); `channels` as
        `flight_inputs`, each (n,).

        States that `channels` holds, or nothing uses, are left out. Raises InputError naming
        channels that a state lacks.
        """
        wanted = [
            state
            for state in self.states
            if state.name in self.needs and state.name not in channels
        ]
        return {state.name: state.along(time, channels, self.reference.chord) for state in wanted}

    def resolved(self, names: Iterable[str], channels: Mapping[str, Value]) -> dict[str, Any]:
        """Values of channels, hat rates and free inputs by `names`; InputError says which of
        `channels` are missing."""
        values: dict[str, Any] = {}
        absent: set[str] = set()
        for name in names:
            if name in channels:
                values[name] = channels[name]
                continue
            state = self._states.get(name)
            sources = (
                {HAT_RATES[name][0], "V"} if name in HAT_RATES else {"alpha"} if state else {name}
            )
            lacking = {source for source in sources if source not in channels}
            absent |= lacking
            if state is not None and not lacking:
                values[name] = state.settled(channels, self.reference.chord)
            elif name in HAT_RATES and not lacking:
                values[name] = hat_rate(name, channels, self.reference)
        if absent:
            shown = [
                f"{name} ({self.free_inputs[name]})" if name in self.free_inputs else name
                for name in sorted(absent)
            ]
            remedy = "give them as channels, or bind them to expressions at import"
            raise InputError(
                f"channels missing: {', '.join(shown)}", f"database {self.name}", remedy
            )
        return values

    def predict(self, channels: Mapping[str, Value]) -> Prediction:
        """The six coefficients at `channels` (each (n,) or a number, SI and rad); stateless.

        Raises InputError that names missing channels. Arguments that are not finite give
        coefficients that are not.
        """
        n = _length(channels)
        values = self.resolved(self.needs, channels)
        if n <= BLOCK:
            return self._predict_block(values, n)
        return _joined(
            [
                self._predict_block(block, min(BLOCK, n - start))
                for start, block in _blocks(values, n)
            ],
            n,
        )

    def _predict_block(self, values: Mapping[str, Value], n: int) -> Prediction:
        run = self._program.run(values)
        totals = {axis: np.zeros(n) for axis in (*AXES, *WIND_AXES)}
        for term, value in zip(self.terms, run.values, strict=True):
            totals[term.axis] += value
        for increment in self.increments:
            if increment.acts_as_layer:
                totals[increment.axis] += increment.value(values)
        wind = [totals.pop(axis) for axis in WIND_AXES]
        if self.on_wind_axes:
            parts = wind_to_body(wind[0], wind[1], wind[2], values["alpha"], values["beta"])
            for axis, part in zip(FORCE_AXES, parts, strict=True):
                totals[axis] += part
        beyond = {table: np.broadcast_to(where, (n,)) for table, where in run.outside.items()}
        outside = np.zeros(n, dtype=np.bool_)
        for where in beyond.values():
            outside |= where
        return Prediction(totals, outside, beyond)

    def evaluate(self, channels: Mapping[str, Value]) -> "Evaluation":
        """Value, standard error and place on every body axis at `channels`; what they mean stands
        with `evaluation`."""
        from aerodb.tables.evaluation import evaluate  # which needs this module

        return evaluate(self, channels)


def _length(channels: Mapping[str, Value]) -> int:
    return max((np.size(value) for value in channels.values()), default=1)


def _blocks(values: Mapping[str, Value], n: int) -> Iterator[tuple[int, dict[str, Value]]]:
    """Consecutive blocks of values (n,), each with its first sample; numbers as they are."""
    for start in range(0, n, BLOCK):
        part = slice(start, start + BLOCK)
        yield (
            start,
            {
                name: value[part] if isinstance(value, np.ndarray) and value.size > 1 else value
                for name, value in values.items()
            },
        )


def _joined(blocks: list[Prediction], n: int) -> Prediction:
    """Predictions of consecutive blocks as one of (n,)."""
    coefficients = {
        axis: np.concatenate([block.coefficients[axis] for block in blocks]) for axis in AXES
    }
    beyond: dict[str, NDArray[np.bool_]] = {}
    for k, block in enumerate(blocks):
        for table, where in block.outside_tables.items():
            if table not in beyond:
                beyond[table] = np.zeros(n, dtype=np.bool_)
            beyond[table][k * BLOCK : (k + 1) * BLOCK] = where
    return Prediction(coefficients, np.concatenate([block.outside for block in blocks]), beyond)
