"""What a loop says of its result beside the findings, one plain sentence each."""

from collections.abc import Collection
from typing import Final

from aerodb.tables import STATE_CHANNEL, AeroDatabase

#: Where flights were looked at before with another library.
TRACED_BEFORE: Final = (
    "These flights were traced before with another list of effects: what joined it since is"
    " suspected at most."
)


def on_stall(database: AeroDatabase) -> tuple[str, ...]:
    """Return the law [SI units] and the dimensionless gains of the stall that was added."""
    law = next(state.law for state in database.states if state.name == STATE_CHANNEL)
    gains = [
        f"{increment.axis} {increment.estimates[-1]:.3g}"
        for increment in database.increments
        if increment.regressors and STATE_CHANNEL in increment.regressors[-1].names
    ]
    return (
        (
            "The stall was added with the shape and the gains on which its flights agree:"
            f" {', '.join([str(law), *gains])}."
        ),
    )


def on_shapes(database: AeroDatabase) -> tuple[str, ...]:
    """Return what was fitted once more; nothing where nothing was."""
    notes = dict.fromkeys(
        increment.full_note for increment in database.increments if increment.refit is not None
    )
    if not notes:
        return ()
    text = " ".join(f"[{note}]" for note in notes)
    return (
        (
            "Gains and shapes were fitted once more where that predicts left-out flights better:"
            f" {text}."
        ),
    )


def on_withheld(ids: Collection[str]) -> tuple[str, ...]:
    """Return why findings (ids) that would make their axis worse stayed out."""
    if not ids:
        return ()
    why = (
        "they were estimated beside others that were not admitted, and alone would make their axis"
        " worse"
    )
    return (f"Not added although found: {', '.join(sorted(ids))}; {why}.",)


def on_without_gain(ids: Collection[str]) -> tuple[str, ...]:
    """Return why findings (ids) that lower no error of other flights stayed out. The limit is 1 %
    of their error (`without_gain`); ids as in `Hypothesis.id`."""
    if not ids:
        return ()
    return (
        (
            f"Not added although found: {', '.join(sorted(ids))}. With it the error of other"
            " flights falls by less than 1 %, or by less than the error without a name on its axis."
        ),
    )


def on_linear_terms(ids: Collection[str]) -> tuple[str, ...]:
    """Return which linear terms (ids) were added with what the user accepted (`LINEAR`)."""
    if not ids:
        return ()
    return (
        (
            "With what was accepted, the linear terms beside which it was estimated were added:"
            f" {', '.join(ids)}."
        ),
    )
