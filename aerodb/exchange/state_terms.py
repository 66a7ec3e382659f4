"""Replace state models, for formats that cannot hold them.

A state becomes a variable with its steady value; a relay becomes an input that the receiver
provides.
"""

from dataclasses import replace

from aerodb.errors import InputError
from aerodb.exchange.increment_terms import with_increments_as_terms
from aerodb.nomenclature import CHANNELS
from aerodb.tables import AeroDatabase, Expression, Name, Relay, StateModel, Variable, substituted


def without_states(database: AeroDatabase) -> AeroDatabase:
    """Return `database` without state models; `predict` gives the same values.

    A state without relaxation becomes a variable that is exact along every flight. A state with
    relaxation becomes a variable with its steady value, and the variable's description says so. The
    channel of a relay remains an input. If there are states, increments become terms, because their
    envelopes may depend on states.

    Raises InputError if the name of the new variable is taken.
    """
    if not database.states:
        return database
    flat = with_increments_as_terms(database)
    for state in database.states:
        if not isinstance(state.law, Relay):
            name = state.name if state.name in flat.free_inputs else f"settled_{state.name}"
            free = {key: text for key, text in flat.free_inputs.items() if key != name}
            variables = {name: Variable(state.expression(), "1", _note(state)), **flat.variables}
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


def _others(database: AeroDatabase, state: StateModel) -> tuple[StateModel, ...]:
    return tuple(other for other in database.states if other != state)


def _note(state: StateModel) -> str:
    what = state.description or CHANNELS["flow_attachment"].description
    assert not isinstance(state.law, Relay)
    if state.exact_steady:
        return what
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
