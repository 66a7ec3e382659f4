"""Decode the note of an increment in a stored document.

The note is one text that repeats the increment's structured fields in words. Documents hold these
fields under their own keys (``refit``, ``lengthened_cells``). Documents of earlier releases hold
the text alone; only this module decodes it.
"""

import re
from dataclasses import dataclass
from typing import Final

from aerodb.tables import Increment, RefinedShape, Refit

_REFIT: Final = re.compile(
    r"(?:^|; )gain fitted once more beside the rest(?:, shape refined of (?P<shapes>.*))?$"
)
_SHAPE: Final = re.compile(r"(?:^|; )(.+?) over (.+?) \(left-out flights: (-?[\d.]+)% less error\)")
_LENGTHENED: Final = re.compile(r"(?:^|; )held and faded over (\d+) table cells of alpha each: .*$")


@dataclass(frozen=True)
class DecodedNote:
    """What a note says: its free text, the refit if any, and the number of lengthened cells."""

    text: str
    refit: Refit | None
    lengthened_cells: int


def note_without_structure(text: str, bare: Increment) -> str:
    """Return the note without the words that repeat other fields.

    text : the whole note. bare : the increment without a note.
    """
    repeated = bare.full_note
    if text == repeated:
        return ""
    return text.removesuffix(f"; {repeated}") if repeated else text


def decode_note(text: str) -> DecodedNote:
    """Return what a note says.

    The note is that of an earlier release's document, which has no other fields for them.
    """
    lengthened = _LENGTHENED.search(text)
    text = text[: lengthened.start()] if lengthened else text
    refit = _REFIT.search(text)
    cells = int(lengthened[1]) if lengthened else 0
    if refit is None:
        return DecodedNote(text, None, cells)
    shapes = tuple(_shape(*match) for match in _SHAPE.findall(refit["shapes"] or ""))
    return DecodedNote(text[: refit.start()], Refit(shapes), cells)


def _shape(hypothesis: str, variables: str, percent: str) -> RefinedShape:
    axis = hypothesis.partition("@")[2].partition(":")[0]  # an id is effect@axis:subject
    return RefinedShape(
        hypothesis, axis, tuple(variables.split(", ")), round(float(percent) / 100.0, 3)
    )
