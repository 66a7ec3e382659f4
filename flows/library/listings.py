"""Tables of a workspace as data frames that a notebook shows by their first columns."""

from collections.abc import Sequence
from html import escape
from typing import Any, Final

import pandas as pd

#: Most rows, and longest text of a cell [characters], that are shown.
_MOST: Final = 60
_WIDEST: Final = 40


class Listing(pd.DataFrame):
    """A data frame with all columns, of which a notebook shows those that people look at first;
    what is selected from it is shown as it is."""

    def __repr__(self) -> str:
        if "first" not in self.attrs:
            return super().__repr__()
        frame, others = self._looked_at_first()
        more = f"\nfurther columns: {', '.join(others)}" if others else ""
        return f"{frame.to_string(max_rows=_MOST, max_colwidth=_WIDEST)}{more}"

    def _repr_html_(self) -> str:
        frame, others = self._looked_at_first()
        more = f"<p>further columns: {escape(', '.join(others))}</p>" if others else ""
        return f"{frame.to_html(max_rows=_MOST)}{more}"

    def _looked_at_first(self) -> tuple[pd.DataFrame, list[str]]:
        """Those columns, and the names of the others."""
        first = self.attrs["first"]
        frame = pd.DataFrame(self[first]).rename(index=_shortened)
        others = [str(name) for name in self.columns if name not in first]
        return frame.astype(object).where(frame.notna(), "-"), others


def _shortened(key: str) -> str:
    """The beginning of an id (a sha256), by which it is found; other keys as they are."""
    return key[:12] if len(key) == 64 else key


def listing(documents: Sequence[dict[str, Any]], index: str, first: Sequence[str]) -> Listing:
    """Return documents with the same keys, one row each; index : the key of the rows. first : those
    shown, which come first."""
    frame = pd.DataFrame(documents, columns=None if documents else [index, *first])
    frame = frame.set_index(index)
    shown = Listing(frame[[*first, *(name for name in frame.columns if name not in first)]])
    shown.attrs["first"] = list(first)
    return shown
