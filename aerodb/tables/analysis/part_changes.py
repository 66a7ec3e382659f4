"""Parts of two databases that differ, key by key as they are written."""

import json
from collections.abc import Mapping
from typing import Any

from aerodb.tables.database import AeroDatabase


def changed_parts(before: AeroDatabase, after: AeroDatabase) -> dict[str, tuple[str, str]]:
    """Return part -> its keys that differ, as text, before and after; empty where a part is not
    there. Values are in the units in which they are written."""
    found = {}
    for name in dict.fromkeys([*before.parts, *after.parts]):
        sides = before.parts.get(name), after.parts.get(name)
        if sides[0] != sides[1]:
            found[name] = (_text(sides[0], sides[1]), _text(sides[1], sides[0]))
    return found


def _text(part: Mapping[str, Any] | None, other: Mapping[str, Any] | None) -> str:
    """The keys of a part that another has otherwise; all of them beside none."""
    if part is None:
        return ""
    own = {key: x for key, x in part.items() if other is None or other.get(key) != x}
    return ", ".join(f"{key} = {json.dumps(x)}" for key, x in own.items())
