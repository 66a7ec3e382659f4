"""Compile expressions into one sequence of steps, in which each distinct sub-expression is computed
once per call.

A database has some hundred small operations, which a simulation evaluates thousands of times at a
few points. The cost is the overhead per operation, so that names, constants and order are resolved
once, here. Tables with the same breakpoints and arguments are interpolated together.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.support import Array
from aerodb.tables.expression import (
    Call,
    Expression,
    Name,
    Negation,
    Number,
    Operation,
    TableCall,
    unknown_table,
)
from aerodb.tables.functions import FUNCTIONS, OPERATORS, Value
from aerodb.tables.scattered import ScatteredTable
from aerodb.tables.table import Table, TableGroup

AnyTable = Table | ScatteredTable


@dataclass(frozen=True, eq=False)
class Run:
    """Result of one run: a value per output (a number where nothing varies), and by table name the
    points outside its breakpoints."""

    values: list[Any]
    outside: dict[str, NDArray[np.bool_]]


class _Step(NamedTuple):
    """One operation that writes one slot; or, with table names, an interpolation that writes one
    slot per table.

    spent : slots that no later step needs, so that their memory is reused while it is in the cache.
    """

    slots: tuple[int, ...]
    function: Callable[..., Any]
    arguments: tuple[int, ...]
    tables: tuple[str, ...] = ()
    spent: tuple[int, ...] = ()


@dataclass(frozen=True, eq=False)
class Program:
    """Compiled expressions: steps in order of evaluation.

    inputs : names that `run` needs -> their slots. outputs : slots of the results.
    """

    inputs: dict[str, int]
    outputs: tuple[int, ...]
    constants: tuple[float | None, ...]
    steps: tuple[_Step, ...]

    def run(self, values: Mapping[str, Value]) -> Run:
        """Evaluate at `values`, each (n,) or a number. Division by zero and similar give inf or
        NaN, not an error."""
        slots: list[Any] = list(self.constants)
        outside: dict[str, NDArray[np.bool_]] = {}
        for name, slot in self.inputs.items():
            slots[slot] = values[name]
        with np.errstate(all="ignore"):
            for written, function, arguments, tables, spent in self.steps:
                result = function(*[slots[i] for i in arguments])
                for slot in spent:
                    slots[slot] = None
                if not tables:
                    slots[written[0]] = result
                    continue
                if result.beyond:
                    for table in tables:
                        outside[table] = (
                            outside[table] | result.outside if table in outside else result.outside
                        )
                if len(tables) == 1:
                    slots[written[0]] = result.values
                else:
                    for slot, values in zip(written, result.values, strict=True):
                        slots[slot] = values
        return Run([slots[i] for i in self.outputs], outside)


@dataclass
class _Builder:
    """Collects slots and steps while expressions are compiled."""

    tables: Mapping[str, AnyTable]
    variables: Mapping[str, Expression]
    constants: Mapping[str, float]
    slots: list[float | None] = field(default_factory=list)
    steps: list[_Step] = field(default_factory=list)
    inputs: dict[str, int] = field(default_factory=dict)
    known: dict[Any, int] = field(default_factory=dict)
    names: dict[str, int] = field(default_factory=dict)
    resolving: list[str] = field(default_factory=list)

    def slot(self, value: float | None) -> int:
        self.slots.append(value)
        return len(self.slots) - 1

    def add(self, node: Expression) -> int:
        """Slot of the value of `node`, with its steps added."""
        if isinstance(node, Number):
            return self.once((Number, node.value), lambda: self.slot(node.value))
        if isinstance(node, Name):
            return self.name(node.name)
        arguments = tuple([self.add(child) for child in node.children])
        if isinstance(node, TableCall):
            return self.table(node, arguments)
        function = _function(node)
        return self.once((function, arguments), lambda: self.step(function, arguments))

    def once(self, key: Any, make: Callable[[], int]) -> int:
        if key not in self.known:
            self.known[key] = make()
        return self.known[key]

    def step(self, function: Callable[..., Any], arguments: tuple[int, ...]) -> int:
        fixed = [self.slots[i] for i in arguments]
        if None not in fixed:
            with np.errstate(all="ignore"):
                return self.slot(float(function(*fixed)))
        slot = self.slot(None)
        self.steps.append(_Step((slot,), function, arguments))
        return slot

    def table(self, node: TableCall, arguments: tuple[int, ...]) -> int:
        if node.table not in self.tables:
            raise unknown_table(node.table, self.tables)
        table = self.tables[node.table]
        if len(arguments) != len(table.arguments):
            what = (
                f"table '{node.table}' called with {len(arguments)} arguments, it has"
                f" {len(table.arguments)}"
            )
            raise InputError(what, remedy=f"its arguments: {', '.join(table.arguments)}")

        def make() -> int:
            slot = self.slot(None)
            self.steps.append(_Step((slot,), table.lookup, arguments, (node.table,)))
            return slot

        return self.once((node.table, arguments), make)

    def name(self, name: str) -> int:
        if name in self.names:
            return self.names[name]
        if name in self.resolving:
            cycle = " -> ".join([*self.resolving[self.resolving.index(name) :], name])
            raise InputError(
                f"variables are defined by each other: {cycle}", remedy="break the cycle"
            )
        if name in self.variables:
            self.resolving.append(name)
            self.names[name] = self.add(self.variables[name])
            self.resolving.pop()
        elif name in self.constants:
            self.names[name] = self.slot(self.constants[name])
        else:
            self.names[name] = self.inputs[name] = self.slot(None)
        return self.names[name]


def _together(steps: list[_Step], tables: Mapping[str, AnyTable]) -> tuple[_Step, ...]:
    """The same steps, with interpolations that share breakpoints and arguments combined into the
    first of them."""
    groups: dict[Any, list[_Step]] = {}
    keys: dict[int, Any] = {}
    for k, step in enumerate(steps):
        table = tables[step.tables[0]] if step.tables else None
        if isinstance(table, Table) and not table.extent:
            keys[k] = (
                step.arguments,
                tuple(axis.tobytes() for axis in table.breakpoints),
                table.modes.tobytes(),
            )
            groups.setdefault(keys[k], []).append(step)
    done = []
    for k, step in enumerate(steps):
        members = groups.pop(keys[k], []) if k in keys else [step]
        if len(members) > 1:
            group = TableGroup(tuple(tables[member.tables[0]] for member in members))  # type: ignore[misc]
            slots = tuple(member.slots[0] for member in members)
            done.append(
                _Step(
                    slots,
                    group.lookup,
                    step.arguments,
                    tuple(member.tables[0] for member in members),
                )
            )
        else:
            done += members
    return tuple(done)


def _spending(steps: Iterable[_Step], outputs: Iterable[int]) -> tuple[_Step, ...]:
    """The same steps, each with the slots that no later step uses."""
    later, done = set(outputs), []
    for step in reversed(tuple(steps)):
        done.append(step._replace(spent=tuple(set(step.arguments) - later)))
        later |= set(step.arguments)
    return tuple(reversed(done))


def _function(node: Expression) -> Callable[..., Any]:
    if isinstance(node, Call):
        return FUNCTIONS[node.function].evaluate
    if isinstance(node, Operation):
        return OPERATORS[node.operator]
    if isinstance(node, Negation):
        return np.negative
    raise TypeError(f"{type(node).__name__} is not a node of an expression")


def compile_program(
    expressions: Iterable[Expression],
    tables: Mapping[str, AnyTable],
    variables: Mapping[str, Expression] | None = None,
    constants: Mapping[str, float] | None = None,
) -> Program:
    """Compile `expressions` into one program with one output each, in their order.

    A name is looked up in `variables` (which are expressions too), then in `constants`; any other
    name is an input.

    Raises InputError for an unknown table, a wrong number of arguments, and variables that are
    defined by each other.
    """
    builder = _Builder(tables, variables or {}, constants or {})
    try:
        outputs = tuple([builder.add(expression) for expression in expressions])
    except RecursionError:
        raise InputError(
            "variables use each other through too many levels",
            remedy="define them more directly",
        ) from None
    steps = _spending(_together(builder.steps, tables), outputs)
    return Program(builder.inputs, outputs, tuple(builder.slots), steps)


def evaluate(
    expression: Expression,
    values: Mapping[str, Value],
    tables: Mapping[str, AnyTable] | None = None,
) -> Array:
    """Evaluate one expression over `values` (each (n,) or a number): (n,), or () where nothing
    varies.

    Raises InputError for a name without a value and for an unknown table.
    """
    program = compile_program([expression], tables or {})
    absent = sorted(set(program.inputs) - set(values))
    if absent:
        raise InputError(f"no value for {', '.join(absent)} in '{expression}'")
    return np.asarray(program.run(values).values[0], dtype=np.float64)
