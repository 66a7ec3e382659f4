"""An update with the terms of its database held, and with all free: what is said of both."""

from collections.abc import Mapping
from typing import Any, Final

#: Variant -> what to do.
_ADVICE: Final = {
    "held": "Keep the terms of the database",
    "free": "Free them: declare these terms in the model file, and update again",
}


def held_or_free_words(found: Mapping[str, Any]) -> tuple[str, ...]:
    """Return which variant to keep and why, and the terms to declare where all are to be free.

    found : the document of `aerodb.tasks.steps.update.beside_all_free`.

    >>> held_or_free_words({"keep": "held", "because": "All free is worse on CY", "terms": {}})
    ('Keep the terms of the database. All free is worse on CY.',)
    """
    words = f"{_ADVICE[found['keep']]}. {found['because']}."
    free = found["terms"] if found["keep"] == "free" else {}
    return words, *(f"{axis}: {', '.join(terms)}" for axis, terms in free.items())
