"""First-order propagation of declared uncertainties from tables and variables to coefficients."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from aerodb.nomenclature import FORCE_AXES
from aerodb.support import Array
from aerodb.tables.algebra import plus, times
from aerodb.tables.analysis.arguments import rebuilt
from aerodb.tables.analysis.linear_terms import depends_on
from aerodb.tables.database import AeroDatabase
from aerodb.tables.expression import Call, Expression, Name, Operation, TableCall, number
from aerodb.tables.program import AnyTable
from aerodb.tables.reference import WIND_AXES
from aerodb.tables.uncertainty import Bound, Uncertainty


def deviation(
    nominal: Expression, uncertainty: Uncertainty, bounds: Sequence[Expression]
) -> Expression:
    """Standard deviation of a value with a declared uncertainty, as an expression.

    Parameters
    ----------
    nominal : the value; the deviation has its unit.
    uncertainty : its declaration.
    bounds : one expression per declared bound. By effect, a bound is a distance from the value
        (additive), a distance in percent of it (percentage), a factor on it (multiplicative), or a
        value itself (absolute).

    The bound of a normal distribution lies `sigmas` standard deviations from the value; a uniform
    distribution between low and high has (high - low)/sqrt(12).

    References
    ----------
    AIAA S-119 (DAVE-ML 2.0), "Statistical information encoding". It leaves open what one
    multiplicative or absolute bound means for a distribution; taken here as the distance from the
    value to the bound.
    """
    scale: Expression = (
        nominal if uncertainty.effect in ("multiplicative", "percentage") else number(1.0)
    )
    if uncertainty.effect == "percentage":
        scale = Operation("/", scale, number(100.0))
    between = uncertainty.effect in ("absolute", "multiplicative")
    if len(bounds) == 2:
        low, high = bounds if between else (Call("abs", (bounds[0],)), Call("abs", (bounds[1],)))
        half: Expression = Operation(
            "/", Operation("-", high, low) if between else plus(low, high), number(2.0)
        )
    elif between:
        half = Operation(
            "-", bounds[0], number(1.0) if uncertainty.effect == "multiplicative" else nominal
        )
    else:
        half = bounds[0]
    divisor = uncertainty.sigmas if uncertainty.distribution == "normal" else math.sqrt(3.0)
    return Call("abs", (Operation("/", times(half, scale), number(divisor)),))


@dataclass(frozen=True)
class _Shifted:
    """Definitions of a database with one uncertain value shifted by a standard deviation."""

    terms: tuple[Expression, ...]
    variables: Mapping[str, Expression]
    tables: Mapping[str, AnyTable]


def declared_variance(
    database: AeroDatabase,
    values: Mapping[str, Any],
    rotation: Mapping[str, Mapping[str, Array]],
    n: int,
) -> tuple[dict[str, Array], frozenset[str]]:
    """Variance per body axis due to the declared uncertainties, and the axes of terms that any of
    them affects.

    Parameters
    ----------
    values : resolved inputs, each (n,) or a number.
    rotation : ``rotation[wind axis][force axis]``, each (n,); empty without wind axes.
    n : number of points.

    Every uncertain table or variable is shifted by one standard deviation, and the squared changes
    of the coefficients are summed. Declared correlations between sources are not used.
    """
    variance = {axis: np.zeros(n) for axis in database.axes}
    shifts = _shifts(database)
    nominal = _totals(database, _definitions(database), values, n) if shifts else {}
    for shifted in shifts.values():
        moved = _totals(database, shifted, values, n)
        for axis, change in _rotated(
            {axis: moved[axis] - nominal[axis] for axis in moved}, rotation
        ).items():
            variance[axis] += change**2
    acts = {
        term.axis
        for term in database.coefficient_terms
        if depends_on(term.expression, database) & shifts.keys()
    }
    return variance, frozenset(acts)


def _definitions(database: AeroDatabase) -> _Shifted:
    variables = {name: variable.expression for name, variable in database.variables.items()}
    return _Shifted(
        tuple(term.expression for term in database.coefficient_terms),
        variables,
        {**database.tables, **database.scattered},
    )


def _shifts(database: AeroDatabase) -> dict[str, _Shifted]:
    """Shifted definitions, by the name of every uncertain variable or table."""
    plain, shifts = _definitions(database), dict[str, _Shifted]()
    for name, variable in database.variables.items():
        if variable.uncertainty is not None:
            bounds = [_expression(bound) for bound in variable.uncertainty.bounds]
            spread = deviation(variable.expression, variable.uncertainty, bounds)
            shifts[name] = replace(
                plain, variables={**plain.variables, name: plus(variable.expression, spread)}
            )
    tables: Mapping[str, AnyTable] = {**database.tables, **database.scattered}
    for name, table in tables.items():
        if table.uncertainty is not None:
            shifts[name] = _table_shifted(database, plain, name)
    return shifts


def _table_shifted(database: AeroDatabase, plain: _Shifted, name: str) -> _Shifted:
    """Definitions with one standard deviation added to every call of a table; bounds per node
    become tables of their own."""
    table: Any = {**database.tables, **database.scattered}[name]
    uncertainty: Uncertainty = table.uncertainty
    tables = dict(plain.tables)
    for k, bound in enumerate(uncertainty.bounds):
        if isinstance(bound, tuple):
            values = np.array(bound).reshape(table.values.shape)
            tables[f"{name}_bound{k}_"] = replace(table, values=values, uncertainty=None)

    def shifted(node: Expression) -> Expression:
        if not isinstance(node, TableCall) or node.table != name:
            return node

        bounds = [
            TableCall(f"{name}_bound{k}_", node.arguments)
            if isinstance(bound, tuple)
            else _expression(bound)
            for k, bound in enumerate(uncertainty.bounds)
        ]
        return plus(node, deviation(node, uncertainty, bounds))

    terms = tuple(rebuilt(expression, shifted) for expression in plain.terms)
    return _Shifted(
        terms,
        {n: rebuilt(expression, shifted) for n, expression in plain.variables.items()},
        tables,
    )


def _expression(bound: Bound) -> Expression:
    if isinstance(bound, tuple):
        raise TypeError("bounds per node belong to a table")
    return Name(bound) if isinstance(bound, str) else number(float(bound))


def _totals(
    database: AeroDatabase, definitions: _Shifted, values: Mapping[str, Any], n: int
) -> dict[str, Array]:
    """Sum of the terms on every body and wind axis, each (n,), without increments."""
    program = database.compiled(definitions.terms, definitions.variables, definitions.tables)
    totals = {axis: np.zeros(n) for axis in (*database.axes, *WIND_AXES)}
    for term, value in zip(database.coefficient_terms, program.run(values).values, strict=True):
        totals[term.axis] += value
    return totals


def _rotated(
    change: Mapping[str, Array], rotation: Mapping[str, Mapping[str, Array]]
) -> dict[str, Array]:
    """Rotate changes on body and wind axes to changes on the body axes."""
    total = {axis: each for axis, each in change.items() if axis not in WIND_AXES}
    for axis in FORCE_AXES:
        for wind, parts in rotation.items():
            total[axis] = total[axis] + parts[axis] * change[wind]
    return total
