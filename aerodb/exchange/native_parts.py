"""Parts in the native forms of a database: read as they are written, and written as they were."""

from collections.abc import Mapping
from typing import Any

from aerodb.tables import AeroDatabase, ReferenceGeometry, Term, Variable


def made_of(
    parts: Mapping[str, Any], reference: ReferenceGeometry, known: Mapping[str, str]
) -> tuple[Mapping[str, Variable], tuple[Term, ...]]:
    """Return the variables and load terms that parts are in a database, in SI units; none of none.

    known : names that the database has beside them -> what each is. Raises InputError as
    `aerodb.parts.expand`.
    """
    if not parts:
        return {}, ()
    from aerodb.parts import expand  # most databases have none, and a query does not wait for it

    made = expand(parts, reference, known)
    return made.variables, made.terms


def written_parts(database: AeroDatabase) -> dict[str, Any]:
    """Return the parts of a database as they were written; empty where something has changed what
    they are, so that their variables and terms [SI] are what counts."""
    if not database.parts:
        return {}
    own = {name: v for name, v in database.variables.items() if not v.part}
    names = (*own, *database.tables, *database.scattered, *database.free_inputs)
    known = dict.fromkeys(names, "the database")
    variables, terms = made_of(database.parts, database.reference, known)
    made = {name: v for name, v in database.variables.items() if v.part}
    same = made == variables and terms == tuple(t for t in database.terms if t.part)
    return {name: dict(entry) for name, entry in database.parts.items()} if same else {}
