"""Tables of modes."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from aerodb.flows.cli.output import HALF_INTERVAL, Session, plus_minus

#: Figures of a mode and their headings.
_FIGURES: Final = {
    "omega": "omega [rad/s]",
    "zeta": "zeta",
    "period": "period [s]",
    "time_constant": "T [s]",
    "time_to_half": "half [s]",
    "time_to_double": "double [s]",
}


def print_modes(session: Session, found: Sequence[Mapping[str, Any]]) -> None:
    """Print the modes of a document, figures +- half of their 95 % intervals."""
    session.table(
        ["mode", *_FIGURES.values(), ""],
        [
            [
                mode["name"],
                *(_with_error(mode["figures"], mode["standard_errors"], name) for name in _FIGURES),
                mode["note"],
            ]
            for mode in found
        ],
        numbers=tuple(range(1, 1 + len(_FIGURES))),
    )
    if any(mode["standard_errors"] for mode in found):
        session.say(HALF_INTERVAL)


def _with_error(
    figures: Mapping[str, float | None], errors: Mapping[str, float] | None, name: str
) -> str:
    """A figure +- half of its 95 % interval, as far as both are known."""
    if name not in figures:
        return ""
    value = figures[name]
    if value is None:
        return "infinite"
    return plus_minus(value, (errors or {}).get(name))
