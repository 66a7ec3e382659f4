"""A program of expressions as arrays of numbers, for loops compiled once for all databases.

`aerodb.tables.program` evaluates many points per operation, which suits a flight's samples. A
simulation evaluates one point after the other, where each call of numpy would cost more than the
operation. There the same program runs as instructions (`aerodb.tables.machine`): no database needs
a compilation of its own.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np

from aerodb.errors import InputError
from aerodb.support import Array, Integers
from aerodb.tables.functions import FUNCTIONS, OPERATORS
from aerodb.tables.program import AnyTable, Program
from aerodb.tables.scattered import ScatteredTable
from aerodb.tables.table import Table


class _Codes(NamedTuple):
    """Operations, in the order of their codes: from `rem` to `ne` those of two operands that are
    rare or slow."""

    add: int
    subtract: int
    multiply: int
    divide: int
    power: int
    negative: int
    abs: int
    min: int
    max: int
    sqrt: int
    exp: int
    log: int
    sin: int
    cos: int
    tan: int
    asin: int
    acos: int
    atan: int
    atan2: int
    sign: int
    step: int
    log10: int
    sinh: int
    cosh: int
    tanh: int
    asinh: int
    acosh: int
    atanh: int
    floor: int
    ceil: int
    rem: int
    root: int
    lt: int
    le: int
    gt: int
    ge: int
    eq: int
    ne: int
    select: int
    lookup: int
    scattered: int


#: The code of each operation by its name: ``CODE.add``, a constant in compiled functions.
CODE: Final = _Codes(*range(len(_Codes._fields)))
_SYMBOLS: Final = {"+": "add", "-": "subtract", "*": "multiply", "/": "divide", "^": "power"}


class Instructions(NamedTuple):
    """A program in numbers; s slots, o instructions, t tables, a table axes.

    code : (o, 5), operation (of `CODE`), slot written, and three operands: slots; for a
        lookup the number of the table and the first of its arguments in `arguments`.
    arguments : slots of the arguments of all lookups, one after another.
    first_axis : (t + 1,), the axes of table k are ``first_axis[k]:first_axis[k + 1]``.
    breaks, starts : breakpoints of all axes; those of axis j are ``starts[j]:starts[j + 1]``.
    strides, modes : (a,), as `Table.axes_packed`.
    low, high : (a,), beyond these a point is outside the table.
    values, first_value : values of all tables, and where those of each begin (t,).
    scattered : numbers of the tables over scattered points, packed by `_scattered`.
    first_scattered : (t,), where the numbers of each begin; -1 for tables on grids.
    """

    code: Integers
    arguments: Integers
    first_axis: Integers
    breaks: Array
    starts: Integers
    strides: Integers
    modes: Integers
    low: Array
    high: Array
    values: Array
    first_value: Integers
    scattered: Array
    first_scattered: Integers


@dataclass(frozen=True, eq=False)
class Machine:
    """Instructions with the places of what goes in and comes out.

    slots : (s,) constants; what an instruction or a caller writes is NaN here.
    inputs : name -> slot. outputs : slots, in the order of the program's expressions.
    tables : names, in the order of the instructions' tables.
    """

    instructions: Instructions
    slots: Array
    inputs: Mapping[str, int]
    outputs: tuple[int, ...]
    tables: tuple[str, ...]


def machine(program: Program, tables: Mapping[str, AnyTable]) -> Machine:
    """Return a compiled program as instructions.

    tables : those that the program calls, by name.
    """
    return _Lowering(program, tables).result()


def _names() -> dict[Callable[..., Any], str]:
    """Function of a program's step -> name of the operation."""
    known = {function.evaluate: name for name, function in FUNCTIONS.items()}
    return (
        known
        | {OPERATORS[symbol]: name for symbol, name in _SYMBOLS.items()}
        | {np.negative: "negative"}
    )


class _Lowering:
    def __init__(self, program: Program, tables: Mapping[str, AnyTable]) -> None:
        self._program = program
        self._slots: list[float] = [np.nan if x is None else x for x in program.constants]
        self._fixed = [x is not None for x in program.constants]
        self._code: list[tuple[int, int, int, int, int]] = []
        self._arguments: list[int] = []
        self._tables: dict[str, AnyTable] = {}
        names = _names()
        for step in program.steps:
            if step.tables:
                for slot, name in zip(step.slots, step.tables, strict=True):
                    self._lookup(slot, name, tables[name], step.arguments)
            else:
                self._operation(names[step.function], step.slots[0], step.arguments)

    def _new(self, value: float = np.nan) -> int:
        self._slots.append(value)
        self._fixed.append(not np.isnan(value))
        return len(self._slots) - 1

    def _emit(self, name: str, slot: int, *operands: int) -> int:
        a, b, c = (*operands, 0, 0, 0)[:3]
        self._code.append((getattr(CODE, name), slot, a, b, c))
        return slot

    def _chain(self, name: str, slot: int, arguments: Iterable[int]) -> int:
        """Write to `slot` an operation of two operands over all arguments, from the left."""
        first, *others = arguments
        for k, other in enumerate(others):
            first = self._emit(name, slot if k == len(others) - 1 else self._new(), first, other)
        return first

    def _operation(self, name: str, slot: int, arguments: tuple[int, ...]) -> None:
        if name in ("min", "max"):
            self._chain(name, slot, arguments)
        elif name == "clip":
            x, low, high = arguments
            self._emit("min", slot, self._emit("max", self._new(), x, low), high)
        elif name in ("and", "or"):
            absolute = [self._emit("abs", self._new(), a) for a in arguments]
            kind = "multiply" if name == "and" else "add"
            self._emit("sign", slot, self._chain(kind, self._new(), absolute))
        elif name == "not":
            sign = self._emit("sign", self._new(), self._emit("abs", self._new(), arguments[0]))
            self._emit("subtract", slot, self._new(1.0), sign)
        elif name == "piecewise":
            result = arguments[-1] if len(arguments) % 2 else self._new()
            pairs = list(zip(arguments[:-1:2], arguments[1::2], strict=True))
            for k, (value, condition) in enumerate(reversed(pairs)):
                target = slot if k == len(pairs) - 1 else self._new()
                result = self._emit("select", target, condition, value, result)
        elif name == "power" and self._fixed[arguments[1]] and self._slots[arguments[1]] == 2.0:
            self._emit("multiply", slot, arguments[0], arguments[0])
        else:
            self._emit(name, slot, *arguments)

    def _lookup(self, slot: int, name: str, table: AnyTable, arguments: tuple[int, ...]) -> None:
        self._tables.setdefault(name, table)
        kind = "scattered" if isinstance(table, ScatteredTable) else "lookup"
        self._emit(kind, slot, list(self._tables).index(name), len(self._arguments))
        self._arguments += arguments

    def result(self) -> Machine:
        breaks, strides, modes, low, high, values = ([np.empty(0)] for _ in range(6))
        starts, first_axis, first_value, first_scattered = [0], [0], [], []
        packed: list[Array] = [np.empty(0)]
        for table in self._tables.values():
            first_value.append(sum(map(len, values)))
            first_axis.append(first_axis[-1])
            if isinstance(table, ScatteredTable):
                first_scattered.append(sum(map(len, packed)))
                packed.append(_scattered(table))
                continue
            first_scattered.append(-1)
            first_axis[-1] += len(table.breakpoints)
            bounds = _bounds(table)
            axes = table.axes_packed
            starts += (starts[-1] + axes[1][1:]).tolist()
            for kept, new in zip(
                (breaks, strides, modes, low, high, values),
                (axes[0], axes[2], axes[3], bounds[:, 0], bounds[:, 1], table.values.ravel()),
                strict=True,
            ):
                kept.append(np.asarray(new))
        instructions = Instructions(
            code=np.array(self._code, dtype=np.int64).reshape(-1, 5),
            arguments=_integers(self._arguments),
            first_axis=_integers(first_axis),
            breaks=np.concatenate(breaks),
            starts=_integers(starts),
            strides=_integers(np.concatenate(strides)),
            modes=_integers(np.concatenate(modes)),
            low=np.concatenate(low),
            high=np.concatenate(high),
            values=np.concatenate(values),
            first_value=_integers(first_value),
            scattered=np.concatenate(packed),
            first_scattered=_integers(first_scattered),
        )
        return Machine(
            instructions,
            np.array(self._slots, dtype=np.float64),
            dict(self._program.inputs),
            tuple(self._program.outputs),
            tuple(self._tables),
        )


def _integers(values: Any) -> Integers:
    return np.asarray(values, dtype=np.int64)


def _bounds(table: Table) -> Array:
    """(N, 2), the ranges of the arguments beyond which a point is outside."""
    extent = table.extent or [(float(a[0]), float(a[-1])) for a in table.breakpoints]
    return np.array([(-np.inf, np.inf) if pair is None else pair for pair in extent])


def _scattered(table: ScatteredTable) -> Array:
    """Numbers of a table over scattered points: N, simplices, facets, extent, centre, facets
    (N + 1 each), then per simplex its transform ((N + 1) N) and the values at its corners."""
    triangulation, (normals, offsets) = table.triangulation, table.hull
    centre = table.points.mean(axis=0) / table.scale
    simplices = np.concatenate(
        [
            triangulation.transform.reshape(len(triangulation.simplices), -1),
            table.values[triangulation.simplices],
        ],
        axis=1,
    )
    head = np.array([table.points.shape[1], len(simplices), len(normals)], dtype=np.float64)
    facets = np.concatenate([normals, offsets[:, None]], axis=1)
    if not np.isfinite(simplices).all():
        raise InputError(
            "a simplex of its triangulation is flat",
            f"table {table.name}",
            "leave out points that nearly coincide",
        )
    return np.concatenate([head, table.scale, centre, facets.ravel(), simplices.ravel()])
