"""Replace state models, for formats that cannot hold them.

A state becomes a variable with its steady value; a relay becomes an input that the receiver
provides.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.increment_terms import with_increments_as_terms
from aerodb.nomenclature import CHANNELS
from aerodb.tables import (
    AeroDatabase,
    Expression,
    Name,
    Number,
    Operation,
    Rate,
    Relay,
    StateModel,
    Variable,
    number,
    parse,
    substituted,
)

#: Points at which a rate is tried for being linear in its state.
_SAMPLES: Final = 50


def without_states(database: AeroDatabase) -> AeroDatabase:
    """Return `database` without state models; `predict` gives the same values.

    A state without relaxation becomes a variable that is exact along every flight. A state with
    relaxation, or with a rate that is linear in it, becomes a variable with its steady value, and
    the variable's description says so. The
    channel of a relay remains an input. If there are states, increments become terms, because their
    envelopes may depend on states.

    Raises InputError if the name of the new variable is taken, and for a rate that is not linear in
    its state, whose steady value is no formula.
    """
    if not database.states:
        return database
    flat = with_increments_as_terms(database)
    for state in database.states:
        if not isinstance(state.law, Relay):
            name = state.name if state.name in flat.free_inputs else f"settled_{state.name}"
            free = {key: text for key, text in flat.free_inputs.items() if key != name}
            steady, unit = _steady(flat, state), "1"
            if isinstance(state.law, Rate):
                unit = state.law.unit
            variables = {name: Variable(steady, unit, _note(state)), **flat.variables}
            if name != state.name and name in {
                *flat.variables,
                *flat.tables,
                *flat.scattered,
                *flat.free_inputs,
            }:
                raise InputError(
                    f"the name '{name}' is taken",
                    f"database {database.name}",
                    "rename it in the database",
                )
            flat = replace(flat, variables=variables, free_inputs=free, states=_others(flat, state))
            flat = with_state_replaced(flat, state.name, Name(name))
    return replace(flat, states=())


def settled_states(whole: AeroDatabase, carried: AeroDatabase) -> tuple[str, ...]:
    """Return a sentence for each state of a database that lost its course along a flight in what a
    format carries of it."""
    kept = {state.name for state in carried.states}
    return tuple(
        f"{state.name} is written as its steady value: this format cannot hold its course"
        for state in whole.states
        if not (isinstance(state.law, Relay) or state.exact_steady or state.name in kept)
    )


def quickness(database: AeroDatabase, state: StateModel) -> Expression:
    """Return the part of its distance to the steady value by which a state approaches it, [1/s].

    Raises InputError for a rate that is not linear in its state.
    """
    if isinstance(state.law, Rate):
        zero, one = _at_zero_and_one(database, state.name, state.law)
        return Operation("-", zero, one)
    assert not isinstance(state.law, Relay)
    return parse(f"V/({number(state.law.relaxation)}*c_ref)")


def _steady(database: AeroDatabase, state: StateModel) -> Expression:
    """The value at which a state stands still; of a rate that is linear in it a/(a - b), of its
    values a and b at 0 and 1."""
    if not isinstance(state.law, Rate):
        return state.expression()
    zero, one = _at_zero_and_one(database, state.name, state.law)
    return Operation("/", zero, Operation("-", zero, one))


def _at_zero_and_one(database: AeroDatabase, name: str, law: Rate) -> tuple[Expression, Expression]:
    """A rate where its state is zero and one, of one that is linear in it."""
    own = law.rate
    for _ in range(len(database.variables)):
        by = {n: v.expression for n, v in database.variables.items() if n in own.names}
        used = {n: tree for n, tree in by.items() if _reaches(database, n, name)}
        if not used:
            break
        own = substituted(own, used)
    zero, one, two = (substituted(own, {name: Number(x)}) for x in (0.0, 1.0, 2.0))
    variables = {n: v.expression for n, v in database.variables.items()}
    program = database.compiled(
        [zero, one, two], variables, {**database.tables, **database.scattered}
    )
    rng = np.random.default_rng(0)
    values = {n: rng.uniform(0.05, 2.0, _SAMPLES) for n in program.inputs}
    a, b, c = (np.broadcast_to(each, (_SAMPLES,)) for each in program.run(values).values)
    good = np.isfinite(a) & np.isfinite(b) & np.isfinite(c)
    if not good.any() or (np.abs(c - 2 * b + a)[good] > 1e-9 * (1.0 + np.abs(c[good]))).any():
        raise InputError(
            f"the rate of state '{name}' is not linear in it: its steady value is no formula",
            f"database {database.name}: states.{name} rate",
            "export a version in which a free input takes its place",
        )
    return zero, one


def _reaches(database: AeroDatabase, variable: str, name: str) -> bool:
    """Whether a variable uses a name, itself or through others."""
    pending, seen = [variable], set[str]()
    while pending:
        each = pending.pop()
        if each == name:
            return True
        if each in database.variables and each not in seen:
            seen.add(each)
            pending += database.variables[each].expression.names
    return False


def _others(database: AeroDatabase, state: StateModel) -> tuple[StateModel, ...]:
    return tuple(other for other in database.states if other != state)


def _note(state: StateModel) -> str:
    flow = CHANNELS["flow_attachment"].description
    what = state.description or (state.name if isinstance(state.law, Rate) else flow)
    assert not isinstance(state.law, Relay)
    if state.exact_steady:
        return what
    if isinstance(state.law, Rate):
        return f"{what}; the value at which its rate is zero: its course is not in this file"
    return (
        f"{what}; the value that it settles at: its relaxation over {state.law.relaxation:g} chords"
        " is not in this file"
    )


def with_state_replaced(database: AeroDatabase, name: str, by: Expression) -> AeroDatabase:
    """Return the database with `by` in place of the state `name` in terms and variables; `by` is
    dimensionless as the state is."""
    if by == Name(name):
        return database
    terms = tuple(
        replace(term, expression=substituted(term.expression, {name: by}))
        for term in database.terms
    )
    variables = {
        key: replace(variable, expression=substituted(variable.expression, {name: by}))
        for key, variable in database.variables.items()
    }
    return replace(database, terms=terms, variables=variables)
