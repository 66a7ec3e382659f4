"""What a database may define: names that are identifiers, differ, and hide neither channels nor
constants."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.nomenclature import CHANNELS, axis_description, channel
from aerodb.tables.expression import check_identifier
from aerodb.tables.uncertainty import Uncertainty, check_bounds

if TYPE_CHECKING:
    from aerodb.tables.database import AeroDatabase
    from aerodb.tables.program import AnyTable

#: Names that stand for the database's own reference area, chord and span in every expression.
CONSTANTS: Final[dict[str, str]] = {"S_ref": "area", "c_ref": "chord", "b_ref": "span"}

#: The channel that states make; others make free inputs.
STATE_CHANNEL: Final = "flow_attachment"


def check_uncertainties(database: "AeroDatabase") -> None:
    """Bounds that a variable gives must have that variable; what has no nodes has no bounds per
    node."""
    carriers: list[tuple[str, Uncertainty | None]] = []
    for group in (database.variables, database.tables, database.scattered):
        carriers += [(name, carrier.uncertainty) for name, carrier in group.items()]
    for name, uncertainty in carriers:
        if uncertainty is None:
            continue
        where = f"database {database.name}: uncertainty of {name}"
        for bound in sorted(uncertainty.names - database.variables.keys()):
            raise InputError(f"no variable '{bound}'", where, nearest(bound, database.variables))
        if name in database.variables:
            try:
                check_bounds(uncertainty, 0)
            except InputError as error:
                raise InputError(error.what, where) from None


def check_definitions(database: "AeroDatabase") -> None:
    """Names that a database defines must be identifiers, differ, and hide neither channels nor
    constants."""
    seen: dict[str, str] = {}
    definitions: tuple[tuple[str, Iterable[str]], ...] = (
        ("variable", database.variables),
        ("table", database.tables),
        ("table", database.scattered),
        ("free input", database.free_inputs),
    )
    for kind, names in definitions:
        for name in names:
            check_identifier(name)
            other = seen.get(name) or (
                "channel" if name in CHANNELS else "constant" if name in CONSTANTS else ""
            )
            if other:
                raise InputError(
                    f"{kind} '{name}' has the name of a {other}",
                    f"database {database.name}",
                    "choose another name",
                )
            seen[name] = kind
    tables: dict[str, AnyTable] = {**database.tables, **database.scattered}
    for name, table in tables.items():
        if table.name != name:
            raise InputError(
                f"table '{table.name}' is filed under '{name}'", f"database {database.name}"
            )
    _check_states(database)


def _check_states(database: "AeroDatabase") -> None:
    made = [state.name for state in database.states]
    for name in made:
        if made.count(name) > 1:
            raise InputError(
                f"state '{name}' stands twice", f"database {database.name}", "keep one of them"
            )
        if name != STATE_CHANNEL and name not in database.free_inputs:
            remedy = f"call it {STATE_CHANNEL}, or declare a free input of that name"
            raise InputError(
                f"state '{name}' makes no channel that terms can use",
                f"database {database.name}",
                remedy,
            )


def check_axis(axis: str, where: str) -> None:
    try:
        axis_description(axis)
    except UnknownNameError as error:
        raise InputError(error.what, f"database {where}", error.remedy) from None


def check_input(name: str, database: "AeroDatabase") -> None:
    if name in database.free_inputs:
        return
    try:
        channel(name)
    except UnknownNameError:
        known = [*CHANNELS, *CONSTANTS, *database.variables, *database.free_inputs]
        raise InputError(
            f"unknown name '{name}'", f"database {database.name}", nearest(name, known)
        ) from None
