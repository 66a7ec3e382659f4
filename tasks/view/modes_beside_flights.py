"""Modes of versions beside those of a linear model that `aerodb estimate` fitted to flights."""

from collections.abc import Mapping, Sequence
from typing import Any

from aerodb.errors import InputError, nearest
from aerodb.report import mode_table, mode_words
from aerodb.storage.catalogue import Catalogue, VersionRow
from aerodb.tasks.view.trimming import StatedCondition, modes_document


def flown_modes(document: Any, method: str | None, where: str) -> tuple[str, list[dict[str, Any]]]:
    """Return the method and the modes, SI, of the JSON answer of `aerodb estimate`; without a
    `method` those of the one to believe, else of the first with modes.

    Raises InputError for a document without modes, and for a method that gave none.
    """
    entries = document.get("methods", ()) if isinstance(document, dict) else ()
    found = {each["method"]: each["modes"] for each in entries if each.get("modes")}
    if not found:
        raise InputError(
            "it holds no modes of a linear model",
            where,
            "write it with: aerodb --json estimate --model MODEL --record TABLE > FILE",
        )
    if method is not None and method not in found:
        raise InputError(f"it has no modes by '{method}'", where, nearest(method, found))
    preferred = method or document.get("believe") or document.get("preferred")
    name = preferred if preferred in found else next(iter(found))
    return name, list(found[name])


def modes_beside_flights(
    catalogue: Catalogue,
    rows: Sequence[VersionRow],
    flight: StatedCondition,
    flown: tuple[str, Sequence[Mapping[str, Any]]],
) -> dict[str, Any]:
    """Return the modes of versions about a steady flight beside those of flights.

    flown : of `flown_modes`. Returns a document: method, labels (of the versions), V and altitude
    (SI), rows (of `mode_table`), said (`mode_words`). Raises NoTrimError.
    """
    method, modes = flown
    sides = {row.label: modes_document(catalogue, row, flight)["modes"] for row in rows}
    table = mode_table(modes, sides)
    return {
        "method": method,
        "labels": list(sides),
        "V": flight.condition.V,
        "altitude": flight.condition.altitude,
        "rows": table,
        "said": mode_words(table),
    }
