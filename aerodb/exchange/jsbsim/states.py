"""State models for JSBSim: its one relay (``hysteresis_limits``), which it runs itself, and states
with memory, which a system of the file runs.

A state is a property that the system moves towards the state's steady value, a function of the
aerodynamics, of the last time step: ``x' = s + (x - s) exp(-c dt)``. While a run begins, where no
time passes, it is that function itself.
"""

from collections.abc import Iterable
from copy import deepcopy
from dataclasses import dataclass, replace
from typing import Final

from aerodb.errors import InputError
from aerodb.exchange.jsbsim.elements import Element, node, prop, value
from aerodb.exchange.jsbsim.properties import (
    OWN_STATE,
    OWN_VARIABLE,
    STALL_HYSTERESIS,
    TIME_PASSES,
    hysteresis_description,
    property_identifier,
)
from aerodb.exchange.state_terms import quickness, with_state_replaced, without_states
from aerodb.tables import AeroDatabase, Name, Relay, Variable, parse, substituted

_RELAY_INPUT: Final = property_identifier(STALL_HYSTERESIS)
#: Property of the time step [s].
_STEP: Final = "simulation/dt"


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


@dataclass(frozen=True)
class Memory:
    """A state with memory in an exported file.

    path : property that holds it. name : free input of that property. steady, quick : variables,
    its steady value and how quickly it approaches that [1/s].
    """

    path: str
    name: str
    steady: str
    quick: str


def with_memories(database: AeroDatabase) -> tuple[AeroDatabase, dict[str, str], list[Memory]]:
    """Return `states_for_jsbsim` of `database` with free inputs, 0 where nothing runs, for its
    states that have memory and for whether time passes; the property of each; and these states.

    Raises InputError as `states_for_jsbsim`.
    """
    flat, memories = states_for_jsbsim(database), list[Memory]()
    running = _unused(flat, "time_passes")
    settled = {
        state.name: held
        for state in database.states
        if (held := f"settled_{state.name}") in flat.variables
    }
    for state in database.states:
        if isinstance(state.law, Relay) or state.exact_steady:
            continue
        held = settled.get(state.name, state.name)
        quick = substituted(quickness(database, state), {n: Name(v) for n, v in settled.items()})
        names = [_unused(flat, f"{word}_{state.name}") for word in ("moving", "steady", "quick")]
        memory = Memory(f"{OWN_STATE}{state.name}", *names)
        whole = flat.variables[held]
        now = parse(f"{memory.steady} + {running}*({memory.name} - {memory.steady})")
        variables = {
            memory.steady: whole,
            memory.quick: Variable(quick, "1/s", f"quickness of {state.name}"),
            **flat.variables,
            held: replace(whole, expression=now),
        }
        free = {memory.name: f"{state.name} along the run", running: "1 while time passes"}
        flat = replace(flat, variables=variables, free_inputs={**flat.free_inputs, **free})
        memories.append(memory)
    paths = {memory.name: memory.path for memory in memories}
    return flat, (paths | {running: TIME_PASSES} if memories else {}), memories


def _unused(database: AeroDatabase, wanted: str) -> str:
    taken = {*database.variables, *database.free_inputs, *database.tables, *database.scattered}
    while wanted in taken:
        wanted += "_"
    return wanted


def memory_channel(memories: Iterable[Memory]) -> Element:
    """Return the channel of a system that runs states with memory."""
    runs = node("gt", prop(_STEP), value(0.0))
    components = [(TIME_PASSES, runs)]
    for memory in memories:
        steady, now = prop(f"{OWN_VARIABLE}{memory.steady}"), prop(memory.path)
        passed = node("product", value(-1.0), prop(f"{OWN_VARIABLE}{memory.quick}"), prop(_STEP))
        left = node("product", node("difference", now, deepcopy(steady)), node("exp", passed))
        kept = node("ifthen", deepcopy(runs), left, value(0.0))
        components.append((memory.path, node("sum", steady, kept)))
    return node(
        "channel",
        *[
            node("fcs_function", node("function", operation), name=path)
            for path, operation in components
        ],
        name="states with memory",
    )
