"""State models for JSBSim, which has one relay of its own (``hysteresis_limits``) and runs it."""

from dataclasses import replace
from typing import Final

from aerodb.errors import InputError
from aerodb.exchange.jsbsim.properties import (
    STALL_HYSTERESIS,
    hysteresis_description,
    property_identifier,
)
from aerodb.exchange.state_terms import with_state_replaced, without_states
from aerodb.tables import AeroDatabase, Relay, parse

_RELAY_INPUT: Final = property_identifier(STALL_HYSTERESIS)


def states_for_jsbsim(database: AeroDatabase) -> AeroDatabase:
    """Return `without_states` of `database`, with its relay as the one that JSBSim runs itself.

    Raises InputError for a second relay, and for a relay with a limit of zero: JSBSim's relay does
    not switch at zero.
    """
    relays = [state for state in database.states if isinstance(state.law, Relay)]
    flat = without_states(database)
    if len(relays) > 1:
        names = ", ".join(state.name for state in relays)
        raise InputError(
            f"relays {names}: JSBSim has only one",
            f"database {database.name}",
            "export to a format that takes relays as inputs",
        )
    for state in relays:
        assert isinstance(state.law, Relay)
        if state.law.low == 0.0 or state.law.high == 0.0:
            what = f"relay {state.name} has a limit of 0, at which JSBSim's relay does not switch"
            raise InputError(
                what, f"database {database.name}", "export to a format that takes relays as inputs"
            )
        free = {key: text for key, text in flat.free_inputs.items() if key != state.name}
        free[_RELAY_INPUT] = hysteresis_description(state.law.low, state.law.high)
        if state.name != _RELAY_INPUT:
            flat = replace(flat, free_inputs={**flat.free_inputs, **free})
            flat = with_state_replaced(
                flat,
                state.name,
                parse(_RELAY_INPUT if state.law.separated else f"(1 - {_RELAY_INPUT})"),
            )
        flat = replace(flat, free_inputs=free)
    return flat
