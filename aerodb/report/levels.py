"""Words for levels that stay unexplained (`aerodb.loop.unexplained_levels`), from their entries in
the document.
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from aerodb.report.glossary import capital, channel_words, hypothesis_words, listed
from aerodb.report.numbers import display_unit, number
from aerodb.units import UnitSystem

#: Body axis -> axis on which a database declares what follows a condition.
_DECLARED: Final[Mapping[str, str]] = {"CX": "C_drag", "CY": "C_side", "CZ": "C_lift"}
#: Axes that have a slope with angle of attack, which may follow the condition as well.
_SLOPED: Final = frozenset({"CX", "CZ", "Cm"})


def followed(level: Mapping[str, Any], units: UnitSystem | None = None) -> str:
    """Return what the level of an axis follows, as a clause; empty where it follows nothing.

    level : an entry of `levels`, coefficients dimensionless, conditions SI.
    """
    conditions = level.get("conditions") or ()  # not in older documents
    if not conditions:
        return ""
    name = conditions[0]["condition"]
    factor, unit = display_unit(name, units)
    of = f" {unit}" if unit else ""
    pairs = [conditions[0]["levels"][end] for end in (0, -1)]
    ends = [f"{number(size)} at {number(factor * at)}{of}" for at, size in pairs]
    return f"the level of {level['axis']} follows {channel_words(name)}: {' to '.join(ends)}"


def likely(level: Mapping[str, Any]) -> str:
    """Return which effects do this, and which other conditions fit as well, in a sentence; empty
    where none is known."""
    effects = [hypothesis_words(id) for entry in level["conditions"] for id in entry["effects"]]
    also = [channel_words(entry["condition"]) for entry in level["conditions"][1:]]
    clauses = [f"a likely cause is the {' or the '.join(effects)}"] if effects else []
    if also:
        clauses.append(f"{listed(also)} of these flights fits as well")
    return f"{capital('; '.join(clauses))}." if clauses else ""


def to_declare(levels: Sequence[Mapping[str, Any]]) -> str:
    """Return the increments, as a line of a model file, that let an update estimate what these
    levels follow; empty where none follows anything."""
    entries = [_increment(level) for level in levels if level.get("conditions")]
    return f"increment = [{', '.join(entries)}]" if entries else ""


def _increment(level: Mapping[str, Any]) -> str:
    axis, name = level["axis"], level["conditions"][0]["condition"]
    if name == "alpha":
        terms = ["1", "alpha", "alpha^2"]
    else:
        over = "mach^2" if name == "mach" else name
        terms = ["1", "alpha", over, f"alpha*{over}"] if axis in _SLOPED else ["1", over]
    named = ", ".join(f'"{term}"' for term in terms)
    return f'{{ axis = "{_DECLARED.get(axis, axis)}", terms = [{named}] }}'
