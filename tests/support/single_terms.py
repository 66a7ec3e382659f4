"""Single terms of a database: what one of them adds to the coefficients."""

from collections.abc import Mapping
from dataclasses import replace

from aerodb.support import Array
from aerodb.tables.database import AeroDatabase
from aerodb.tables.functions import Value


def of_term(database: AeroDatabase, term: str, channels: Mapping[str, Value]) -> dict[str, Array]:
    """The six coefficients (n,) of a database that has this term alone, and no increment."""
    alone = tuple(entry for entry in database.terms if entry.name == term)
    return replace(database, terms=alone, increments=()).predict(channels).coefficients
