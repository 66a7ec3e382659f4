"""The note of an increment in a stored document: one text, which says also what the increment's
structured fields hold.

Documents carry that structure in keys of its own (``refit``, ``lengthened_cells``). Documents of
earlier releases have the text alone; it is decode_note here, and nowhere else.
"""

import re
from typing import Final

from aerodb.tables import Increment, RefinedShape, Refit

_REFIT: Final = re.compile(
    r"(?:^|; )gain fitted once more beside the rest(?:, shape refined of (?P<shapes>.*))?$"
)
_SHAPE: Final = re.compile(r"(?:^|; )(.+?) over (.+?) \(left-out flights: (-?[\d.]+)% less error\)")
_LENGTHENED: Final = re.compile(r"(?:^|; )held and faded over (\d+) table cells of alpha each: .*$")


def note_without_structure(text: str, bare: Increment) -> str:
    """The note without what the other fields say: `text` is the whole of it, `bare` the increment
    without any note."""
    said = bare.full_note
    return "" if text == said else text.removesuffix(f"; {said}") if said else text


def decode_note(text: str) -> tuple[str, Refit | None, int]:
    """Own note, refit and lengthened cells of a text from a document that holds nothing else about
    them."""
    lengthened = _LENGTHENED.search(text)
    text = text[: lengthened.start()] if lengthened else text
    refit = _REFIT.search(text)
    cells = int(lengthened[1]) if lengthened else 0
    if refit is None:
        return text, None, cells
    return (
        text[: refit.start()],
        Refit(tuple(_shape(*found) for found in _SHAPE.findall(refit["shapes"] or ""))),
        cells,
    )


def _shape(hypothesis: str, variables: str, percent: str) -> RefinedShape:
    axis = hypothesis.partition("@")[2].partition(":")[0]  # an id is effect@axis:subject
    return RefinedShape(
        hypothesis, axis, tuple(variables.split(", ")), round(float(percent) / 100.0, 3)
    )
