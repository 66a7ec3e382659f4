"""An aerodynamic database: a graph from channels through variables and tables to the six coefficients.

Its readable view are the terms, each an expression on one axis; increments from flights add at the outputs. Where a
database comes from or goes to belongs in `aerodb.exchange`.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.nomenclature import AXES, CHANNELS, FORCE_AXES, axis_description, channel
from aerodb.tables.expression import Expression, check_identifier
from aerodb.tables.functions import Array, Value
from aerodb.tables.increment import Increment
from aerodb.tables.program import Program, compile_program
from aerodb.tables.reference import HAT_RATES, WIND_AXES, Reference, hat_rate, transfer_moments, wind_to_body
from aerodb.tables.table import Table

__all__ = ["CONSTANTS", "AeroDatabase", "Prediction", "Reference", "Term", "Variable", "transfer_moments"]

#: Names that stand for the database's own reference area, chord and span in every expression.
CONSTANTS: Final[dict[str, str]] = {"S_ref": "area", "c_ref": "chord", "b_ref": "span"}


@dataclass(frozen=True)
class Variable:
    """A named expression that terms and other variables use; `unit` as far as the source tells."""

    expression: Expression
    unit: str = "1"
    description: str = ""


@dataclass(frozen=True)
class Term:
    """One contribution to a coefficient axis (CX .. Cn, or C_drag C_side C_lift along the wind axes)."""

    name: str
    axis: str
    expression: Expression
    description: str = ""


@dataclass(frozen=True, eq=False)
class Prediction:
    """Coefficients on the six body axes, each (n,), moments about the database's own moment reference.

    outside : (n,) true where any argument of any table lies outside its breakpoints; `outside_tables`, by table name,
    holds only tables for which that happens at all.
    """

    coefficients: dict[str, Array]
    outside: NDArray[np.bool_]
    outside_tables: Mapping[str, NDArray[np.bool_]]


@dataclass(frozen=True, eq=False)
class AeroDatabase:
    """A database of one vehicle.

    Names in expressions are resolved in this order: `variables`; the constants S_ref [m2], c_ref, b_ref [m];
    `free_inputs` (name -> what it is: quantities that the source uses and that are no channel of this product); channels
    of `aerodb.nomenclature`, where p_hat q_hat r_hat alphadot_hat are made from p q r alphadot, V and this database's own
    lengths unless they are given.

    Raises InputError for an unknown name, table or axis (with the nearest valid one), a wrong number of table
    arguments, and variables that are defined by each other.
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

    def __post_init__(self) -> None:
        object.__setattr__(self, "terms", tuple(self.terms))
        object.__setattr__(self, "increments", tuple(self.increments))
        _check_definitions(self)
        for axis in self._axes:
            _check_axis(axis, self.name)
        names = [term.name for term in self.terms]
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise InputError(f"term '{repeated[0]}' stands twice", f"database {self.name}", "give each term its own name")
        try:
            everything = [v.expression for v in self.variables.values()] + [term.expression for term in self.terms]
            used = set(self._compile(everything).inputs)
        except InputError as error:
            raise InputError(error.what, f"database {self.name}", error.remedy) from None
        for name in sorted(used.union(*(increment.names for increment in self.increments))):
            _check_input(name, self)

    def _compile(self, expressions: Iterable[Expression]) -> Program:
        constants = {name: float(getattr(self.reference, attribute)) for name, attribute in CONSTANTS.items()}
        definitions = {name: variable.expression for name, variable in self.variables.items()}
        return compile_program(expressions, self.tables, definitions, constants)

    @cached_property
    def _program(self) -> Program:
        return self._compile(term.expression for term in self.terms)

    @cached_property
    def _axes(self) -> frozenset[str]:
        return frozenset([term.axis for term in self.terms] + [increment.axis for increment in self.increments])

    @cached_property
    def _needs(self) -> tuple[str, ...]:
        """Names that evaluation uses, hat rates among them."""
        names = set(self._program.inputs).union(*(increment.names for increment in self.increments))
        if self._axes & set(WIND_AXES):
            names |= {"alpha", "beta"}
        return tuple(sorted(names))

    @cached_property
    def inputs(self) -> tuple[str, ...]:
        """Channels and free inputs that `predict` needs, sorted; for a hat rate the rate and V that it is made of."""
        names = set(self._needs) - set(HAT_RATES)
        for hat in set(self._needs) & set(HAT_RATES):
            names |= {HAT_RATES[hat][0], "V"}
        return tuple(sorted(names))

    def _values(self, channels: Mapping[str, Value]) -> dict[str, Any]:
        """Values of all names that evaluation uses; InputError names what is missing."""
        values: dict[str, Any] = {}
        absent: set[str] = set()
        for name in self._needs:
            if name in channels:
                values[name] = channels[name]
                continue
            sources = {HAT_RATES[name][0], "V"} if name in HAT_RATES else {name}
            lacking = {source for source in sources if source not in channels}
            absent |= lacking
            if name in HAT_RATES and not lacking:
                values[name] = hat_rate(name, channels, self.reference)
        if absent:
            shown = [f"{name} ({self.free_inputs[name]})" if name in self.free_inputs else name for name in sorted(absent)]
            remedy = "give them as channels, or bind them to expressions at import"
            raise InputError(f"channels missing: {', '.join(shown)}", f"database {self.name}", remedy)
        return values

    def predict(self, channels: Mapping[str, Value]) -> Prediction:
        """The six coefficients at `channels` (each (n,) or a number, SI and rad); stateless.

        Raises InputError that names missing channels. Arguments that are not finite give coefficients that are not.
        """
        values = self._values(channels)
        n = _length(channels)
        run = self._program.run(values)
        totals = {axis: np.zeros(n) for axis in (*AXES, *WIND_AXES)}
        for term, value in zip(self.terms, run.values, strict=True):
            totals[term.axis] += value
        for increment in self.increments:
            totals[increment.axis] += increment.value(values)
        wind = [totals.pop(axis) for axis in WIND_AXES]
        if self._axes & set(WIND_AXES):
            parts = wind_to_body(wind[0], wind[1], wind[2], values["alpha"], values["beta"])
            for axis, part in zip(FORCE_AXES, parts, strict=True):
                totals[axis] += part
        beyond = {table: np.broadcast_to(where, (n,)) for table, where in run.outside.items()}
        outside = np.zeros(n, dtype=np.bool_)
        for where in beyond.values():
            outside |= where
        return Prediction(totals, outside, beyond)

    def contributions(self, channels: Mapping[str, Value]) -> dict[str, dict[str, Array]]:
        """What each term adds, by term name and body axis, each (n,); only axes on which it acts. Increments are left out."""
        values = self._values(channels)
        n = _length(channels)
        shares: dict[str, dict[str, Array]] = {}
        for term, value in zip(self.terms, self._program.run(values).values, strict=True):
            share = np.zeros(n) + value
            if term.axis in WIND_AXES:
                drag, side, lift = (share if term.axis == axis else 0.0 for axis in WIND_AXES)
                parts = wind_to_body(drag, side, lift, values["alpha"], values["beta"])
                shares[term.name] = dict(zip(FORCE_AXES, parts, strict=True))
            else:
                shares[term.name] = {term.axis: share}
        return shares


def _length(channels: Mapping[str, Value]) -> int:
    return max((np.size(value) for value in channels.values()), default=1)


def _check_definitions(database: AeroDatabase) -> None:
    """Names that a database defines must be identifiers, differ, and hide neither channels nor constants."""
    seen: dict[str, str] = {}
    for kind, names in (("variable", database.variables), ("table", database.tables), ("free input", database.free_inputs)):
        for name in names:
            check_identifier(name)
            other = seen.get(name) or ("channel" if name in CHANNELS else "constant" if name in CONSTANTS else "")
            if other:
                raise InputError(f"{kind} '{name}' has the name of a {other}", f"database {database.name}", "choose another name")
            seen[name] = kind
    for name, table in database.tables.items():
        if table.name != name:
            raise InputError(f"table '{table.name}' is filed under '{name}'", f"database {database.name}")


def _check_axis(axis: str, where: str) -> None:
    try:
        axis_description(axis)
    except UnknownNameError as error:
        raise InputError(error.what, f"database {where}", error.remedy) from None


def _check_input(name: str, database: AeroDatabase) -> None:
    if name in database.free_inputs:
        return
    try:
        channel(name)
    except UnknownNameError:
        known = [*CHANNELS, *CONSTANTS, *database.variables, *database.free_inputs]
        raise InputError(f"unknown name '{name}'", f"database {database.name}", nearest(name, known)) from None
