"""Tables of a workspace as data frames that a notebook shows by their first columns."""

from collections.abc import Sequence
from html import escape
from typing import Any

import pandas as pd


class Listing(pd.DataFrame):
    """A data frame with all columns, of which a notebook shows those that people look at first;
    what is selected from it is shown as it is."""

    def _repr_html_(self) -> str:
        first = self.attrs["first"]
        others = [str(name) for name in self.columns if name not in first]
        more = f"<p>further columns: {escape(', '.join(others))}</p>" if others else ""
        frame = pd.DataFrame(self[first]).rename(index=_shortened)
        frame = frame.astype(object).where(frame.notna(), "-")
        return f"{frame.to_html(max_rows=60)}{more}"


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
