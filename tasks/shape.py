"""What the loop adds, fitted once more beside the candidate that has it: gains, and shapes inside the envelope."""

from collections.abc import Sequence

from aerodb.effects import FELT_ON, Hypothesis
from aerodb.support import in_threads
from aerodb.tables import AeroDatabase
from aerodb.tasks.steps import Library, thinned_beside
from aerodb.tasks.workspace_access import Stores
from aerodb.tracing import Refined, refined

#: How the note of an increment that was fitted once more goes on, and if its shape is no longer the template's.
AGAIN = "; gain fitted once more beside the rest"
REFINED = ", shape refined of "


def fitted_again(
    opened: Stores, candidate: AeroDatabase, library: Library, accepted: Sequence[Hypothesis], flights: Sequence[str], run: str
) -> Refined | None:
    """New gains and finer shapes of terms that `candidate` holds already; None where left-out flights do not ask for them.

    flights : ids of those that have the channels of all terms.
    """
    compared = in_threads(lambda id: thinned_beside(opened, id, candidate, library, run), flights)
    if not compared:
        return None
    vehicle, _ = opened.vehicle(compared[0][0].vehicle)
    sensors = [hypothesis for hypothesis in library.hypotheses if hypothesis.kind == "sensor"]
    return refined(compared, candidate, vehicle, accepted, sensors, library.settings)


def said_of(finer: Refined) -> str:
    """The end of an increment's note."""
    over = [
        f"{id} over {', '.join(variables)} (left-out flights: {finer.fall[id]:.1%} less error)"
        for id, variables in sorted(finer.variables.items())
    ]
    return AGAIN + (f"{REFINED}{'; '.join(over)}" if over else "")


def wrong_shapes(database: AeroDatabase) -> frozenset[str]:
    """Body axes on which a term was added whose template's shape was wrong."""
    said = {inc.note.partition(REFINED)[2] for inc in database.increments if REFINED in inc.note}
    ids = {part.partition(" over ")[0] for text in said for part in text.split("; ") if " over " in part and "@" in part}
    axes = {id.partition("@")[2].partition(":")[0] for id in ids}
    return frozenset(body for axis in axes for body in FELT_ON.get(axis, (axis,)))


def remarks_on_shapes(database: AeroDatabase) -> tuple[str, ...]:
    """One plain sentence on what was fitted once more; none where nothing was."""
    notes = dict.fromkeys(inc.note for inc in database.increments if AGAIN in inc.note)
    if not notes:
        return ()
    text = " ".join(f"[{note.removeprefix('traced: ')}]" for note in notes)
    return (f"Gains and shapes were fitted once more where that predicts left-out flights better: {text}.",)
