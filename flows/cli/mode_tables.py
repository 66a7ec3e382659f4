"""Tables of modes."""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from aerodb.flows.cli.output import Session

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
    """Print the modes of a document, figures with their standard errors."""
    session.table(
        ["mode", *_FIGURES.values(), ""],
        [
            [
                mode["name"],
                *(with_error(mode["figures"], mode["standard_errors"], name) for name in _FIGURES),
                mode["note"],
            ]
            for mode in found
        ],
        numbers=tuple(range(1, 1 + len(_FIGURES))),
    )


def with_error(
    figures: Mapping[str, float | None], errors: Mapping[str, float] | None, name: str
) -> str:
    """A figure with its standard error, as far as both are known."""
    if name not in figures:
        return ""
    value = figures[name]
    if value is None:
        return "infinite"
    error = (errors or {}).get(name)
    return f"{value:.4g}" if error is None else f"{value:.4g} ± {error:.2g}"
