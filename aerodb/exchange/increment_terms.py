"""Write increments as plain terms, for formats that have no increments.

Estimates, envelope and envelope rule become expressions that give the same values everywhere,
inside the envelope and beyond it. Such formats cannot hold the covariance and the flights; these
remain with the version in the catalogue.
"""

from dataclasses import replace
from functools import reduce
from typing import Final

from aerodb.nomenclature import CHANNELS
from aerodb.tables import (
    CONSTANTS,
    FUNCTIONS,
    LIFT_INCREMENTS,
    AeroDatabase,
    Call,
    Expression,
    Increment,
    Interval,
    Name,
    Number,
    Term,
    Variable,
    number,
    parse,
    plus,
    substituted,
    times,
)

_RULE: Final = "1 inside and one cell beyond, then to 0 over one further cell"


def with_increments_as_terms(database: AeroDatabase) -> AeroDatabase:
    """Return `database` with a term, and its variables, in place of each increment, and their sum
    in place of `LIFT_INCREMENTS`.

    `predict` gives the same values, dimensionless.
    """
    if not database.increments and not database.depends_on_lift_increments:
        return database
    taken = {
        *CHANNELS,
        *CONSTANTS,
        *FUNCTIONS,
        *database.variables,
        *database.tables,
        *database.free_inputs,
    }
    terms, variables = list(database.terms), dict(database.variables)
    term_names = {term.name for term in terms}
    for k, increment in enumerate(database.increments, start=1):
        stem = _unused(f"increment_{k}", taken)
        added, expression = _rewritten(increment, stem)
        variables |= added
        taken |= added.keys()
        flights = f" from {len(increment.flights)} flights" if increment.flights else ""
        note = f"increment{flights}{f': {increment.full_note}' if increment.full_note else ''}"
        name = _unused(f"{stem}_{increment.axis}", term_names)
        term_names.add(name)
        terms.append(Term(name, increment.axis, expression, note))
    of_lift = [
        term.expression
        for term, increment in zip(terms[len(database.terms) :], database.increments, strict=True)
        if increment.axis == "C_lift" and increment.induces_drag
    ]
    total = {LIFT_INCREMENTS: reduce(plus, of_lift) if of_lift else Number(0)}
    return replace(
        database,
        terms=tuple(
            replace(term, expression=substituted(term.expression, total)) for term in terms
        ),
        variables={
            name: replace(variable, expression=substituted(variable.expression, total))
            for name, variable in variables.items()
        },
        increments=(),
    )


def _unused(stem: str, taken: set[str]) -> str:
    """Return `stem`, extended by underscores until no taken name begins with it."""
    while any(name.startswith(stem) for name in taken):
        stem += "_"
    return stem


def _rewritten(increment: Increment, stem: str) -> tuple[dict[str, Variable], Expression]:
    """Variables for held arguments and weights, and the expression of the increment.

    The expression is the sum of estimate times weight times regressor.
    """
    variables: dict[str, Variable] = {}
    held: dict[str, Expression] = {}
    weights: dict[str, Expression] = {}
    used = frozenset[str]().union(*(regressor.names for regressor in increment.regressors))
    fading = frozenset[str]().union(*map(increment.fading, range(len(increment.regressors))))
    for name, interval in increment.envelope.items():
        if name in used:
            clipped = Call("clip", (Name(name), *map(number, increment.held_between(name))))
            where = "flights have been" if increment.margins is None else "the increment continues"
            variables[f"{stem}_held_{name}"] = Variable(clipped, "", f"{name}, held where {where}")
            held[name] = Name(f"{stem}_held_{name}")
        if name in fading:
            variables[f"{stem}_weight_{name}"] = Variable(
                _weight(name, interval), "1", f"flown range of {name}: {_RULE}"
            )
            weights[name] = Name(f"{stem}_weight_{name}")
    addends = []
    layered = zip(increment.layered, increment.regressors, strict=True)
    for k, (estimate, regressor) in enumerate(layered):
        acting = [weights[name] for name in weights if name in increment.fading(k)]
        if estimate == 0.0:
            continue
        addends.append(
            reduce(times, [substituted(regressor, held), *acting, number(float(estimate))])
        )
    return variables, reduce(plus, addends) if addends else Number(0)


def _weight(name: str, interval: Interval) -> Expression:
    low, high, cell = (
        f"({number(value)})" for value in (interval.low, interval.high, interval.cell)
    )
    if interval.cell == 0.0:
        return parse(f"(1 - step({low} - {name}))*(1 - step({name} - {high}))")
    return parse(f"clip(2 - max({low} - {name}, {name} - {high})/{cell}, 0, 1)")
