"""Checks of what a database defines: names must be identifiers, differ, and hide no channel and
no constant."""

import math
from collections.abc import Container, Iterable, Mapping
from typing import Final

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.nomenclature import CHANNELS, axis_description, channel
from aerodb.tables.expression import Expression, Negation, Number, check_identifier
from aerodb.tables.loads import LOAD_AXES, coefficient_axis
from aerodb.tables.parameter import Parameter
from aerodb.tables.program import AnyTable
from aerodb.tables.rate_state import Rate
from aerodb.tables.state_model import StateModel
from aerodb.tables.uncertainty import Uncertainty, check_bounds

#: Names that stand for the database's own reference area, chord and span in every expression.
CONSTANTS: Final[dict[str, str]] = {"S_ref": "area", "c_ref": "chord", "b_ref": "span"}

#: Name that stands, in every expression, for the sum of the database's increments on C_lift: what
#: depends on the total lift (an induced drag ``k CL^2``) adds it to the lift of the terms.
LIFT_INCREMENTS: Final = "C_lift_increments"

#: The channel that state models compute; a state of any other name needs a free input of that name.
STATE_CHANNEL: Final = "flow_attachment"


def check_uncertainties(
    database: str, variables: Mapping[str, Uncertainty | None], tables: Iterable[AnyTable]
) -> None:
    """Raise InputError where a bound names a variable that does not exist, or where a variable has
    bounds per node.

    database : its name, for messages. variables : name -> declared uncertainty, None where there is
    none. tables : all tables, on grids and on scattered points (n, k).
    """
    carriers = [*variables.items(), *((table.name, table.uncertainty) for table in tables)]
    for name, uncertainty in carriers:
        if uncertainty is None:
            continue
        where = f"database {database}: uncertainty of {name}"
        for bound in sorted(uncertainty.names - variables.keys()):
            raise InputError(f"no variable '{bound}'", where, nearest(bound, variables))
        if name in variables:
            try:
                check_bounds(uncertainty, 0)
            except InputError as error:
                raise InputError(error.what, where) from None


def check_parameters(
    database: str,
    parameters: Mapping[str, tuple[Expression, Parameter | None, Uncertainty | None]],
) -> None:
    """Raise InputError for a parameter that is no number, lies outside its bounds, or whose
    uncertainty is not additive and normal with a number as its bound.

    database : its name, for messages. parameters : name -> expression (a scalar), the parameter,
    its uncertainty.
    """
    for name, (expression, parameter, uncertainty) in parameters.items():
        where = f"database {database}: parameter {name}"
        value = value_of(expression)
        if not math.isfinite(value):
            raise InputError(
                f"'{expression}' is no number", where, "a parameter is one number; use a variable"
            )
        try:
            if parameter is not None:
                parameter.check(value)
        except InputError as error:
            raise InputError(error.what, where, error.remedy) from None
        if uncertainty is not None and (
            (uncertainty.effect, uncertainty.distribution) != ("additive", "normal")
            or not isinstance(uncertainty.bounds[0], float)
        ):
            raise InputError(
                "its uncertainty is not additive and normal", where, "give prior_sigma"
            )


def value_of(expression: Expression) -> float:
    """The value of an expression that is a number; NaN for any other. It has the number's unit."""
    if isinstance(expression, Negation) and isinstance(expression.operand, Number):
        return -expression.operand.value
    return expression.value if isinstance(expression, Number) else math.nan


def check_definitions(
    database: str,
    variables: Mapping[str, str],
    tables: Iterable[tuple[str, AnyTable]],
    free_inputs: Iterable[str],
) -> None:
    """Raise InputError unless all defined names are identifiers, differ from each other and hide
    neither channels nor constants.

    database : its name, for messages. variables : name -> ``variable`` or ``parameter``.
    tables : key and table, on grids and on scattered points.
    free_inputs : one with the name of a channel is that channel. Names: `check_identifier`.
    """
    defined: dict[str, str] = {}
    tables = list(tables)
    definitions = (
        *variables.items(),
        *((name, "table") for name, _ in tables),
        *((name, "free input") for name in free_inputs),
    )
    for name, kind in definitions:
        check_identifier(name)
        hidden = name in CHANNELS and kind != "free input"  # which would be that channel
        other = defined.get(name) or (
            "channel" if hidden else "constant" if name in CONSTANTS else ""
        )
        if other:
            raise InputError(
                f"{kind} '{name}' has the name of a {other}",
                f"database {database}",
                "choose another name",
            )
        defined[name] = kind
    for name, table in tables:
        if table.name != name:
            raise InputError(
                f"table '{table.name}' is stored under the key '{name}'", f"database {database}"
            )


def check_states(database: str, states: Iterable[StateModel], free_inputs: Container[str]) -> None:
    """Raise InputError for a state model that is defined twice, or whose name is neither
    `STATE_CHANNEL` nor a free input; that of a state with a rate hides no channel."""
    states = list(states)
    names = [state.name for state in states]
    for state in states:
        name = state.name
        if isinstance(state.law, Rate) and name in CHANNELS and name != STATE_CHANNEL:
            raise InputError(
                f"state '{name}' has the name of a channel",
                f"database {database}: states.{name}",
                "choose another name",
            )
        if names.count(name) > 1:
            raise InputError(
                f"state '{name}' is defined twice", f"database {database}", "keep one of them"
            )
        if name != STATE_CHANNEL and name not in free_inputs:
            remedy = f"call it {STATE_CHANNEL}, or declare a free input of that name"
            raise InputError(
                f"state '{name}' computes no channel that terms can use",
                f"database {database}",
                remedy,
            )


def check_axis(axis: str, database: str) -> None:
    """Raise InputError, with the nearest valid name, for an unknown axis of coefficients or
    loads (`axis_description`)."""
    try:
        axis_description(axis)
    except UnknownNameError as error:
        raise InputError(error.what, f"database {database}", error.remedy) from None


def check_increment_axis(axis: str, database: str) -> None:
    """Raise InputError for an increment on a load (`aerodb.tables.loads`): flights identify
    coefficients."""
    if axis in LOAD_AXES:
        raise InputError(
            f"an increment on {axis}",
            f"database {database}",
            f"increments are on coefficients: {coefficient_axis(axis)}",
        )


def check_input(
    name: str, database: str, variables: Iterable[str], free_inputs: Iterable[str]
) -> None:
    """Raise InputError, with the nearest valid name, for a name that is neither a free input nor a
    channel (`CHANNELS`)."""
    if name in free_inputs or name == LIFT_INCREMENTS:
        return
    try:
        channel(name)
    except UnknownNameError:
        known = [*CHANNELS, *CONSTANTS, *variables, *free_inputs]
        raise InputError(
            f"unknown name '{name}'", f"database {database}", nearest(name, known)
        ) from None
