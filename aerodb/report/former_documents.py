"""What stored documents of earlier releases say in sentences alone, as data.

A stored document is never changed: those of before have no ``remark_data``, and older ones no
``within_flights``. Only this module reads their sentences.
"""

from collections.abc import Mapping
from itertools import chain, repeat
from typing import Any, Final

from aerodb.remarks import LEAVES_ENVELOPE, REFUSED, SAID

#: Words of earlier releases -> the kind of the remark that they are in.
_KINDS: Final = {
    "The gate will refuse this version: ": REFUSED,
    " leaves the flown envelope on ": LEAVES_ENVELOPE,
}
_WITHIN_FLIGHTS: Final = "(cross-validated within flights)"


def _former_kinds(document: Mapping[str, Any]) -> list[str]:
    """Return the kinds of a former document's remarks, from their words; `SAID` where none is
    known."""
    return [
        next((kind for words, kind in _KINDS.items() if words in remark), SAID)
        for remark in document["remarks"]
    ]


def former_within_flights(document: Mapping[str, Any]) -> bool:
    """Return whether a former document's validation predicted parts of flights from the rest."""
    said = any(_WITHIN_FLIGHTS in remark for remark in document["remarks"])
    return said and document["validation"]["kind"] == "cross-validated"


def remarks_of(document: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return kind and sentence of each remark in a document; those without data are just said
    (`SAID`)."""
    data = document.get("remark_data")
    kinds = _former_kinds(document) if data is None else [each["kind"] for each in data]
    return list(zip(chain(kinds, repeat(SAID)), document["remarks"], strict=False))
