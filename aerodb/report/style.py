"""Style of all displayed results: colours, display units, names as text, figures as SVG."""

import base64
import io
import re
import threading
import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import matplotlib
from matplotlib.figure import Figure

#: Okabe & Ito's colours, which colour-blind readers can tell apart. Colours and line styles mean
#: the same in every figure; line styles survive a print in black and white.
FLIGHT: Final = "#000000"
DATABASE: Final = "#D55E00"
UPDATED: Final = "#0072B2"
MEASURED: Final = "#9A9A9A"
FLAGGED: Final = "#F3E3C3"
DATABASE_LINE: Final = (0, (4, 1.5))

#: Width [in] of a figure on A4 less its margins: a figure of this size is printed as it is, so
#: that its type keeps its size.
PAGE_WIDTH: Final = 7.1
#: Width of a figure that is read on a phone [in].
PHONE_WIDTH: Final = 3.6
#: Largest height [in] of such a figure.
PAGE_HEIGHT: Final = 9.2
#: Smallest type of a figure [pt].
SMALLEST: Final = 8


# Matplotlib's settings and its font measures are global: pictures are written one at a time.
_writing = threading.Lock()
_LOOK: Final[Any] = {
    "svg.fonttype": "none",  # text stays text: any script, searchable, small
    "svg.hashsalt": "aerodb",
    "font.family": "sans-serif",
}
_PATH = re.compile(r'( d="[^"]*")')
_DIGITS = re.compile(r"(\.\d)\d+")  # a tenth of a point is finer than any print


@dataclass(frozen=True)
class Picture:
    """A figure with its alternative text (`alt`) and caption. `draw` makes the figure when it is
    first asked for: a page that is sent in pieces begins before its figures are drawn."""

    draw: Callable[[], Figure]
    alt: str
    caption: str = ""

    @cached_property
    def svg(self) -> str:
        """The figure as SVG; the same figure gives the same bytes."""
        figure, buffer = self.draw(), io.StringIO()
        with _writing, matplotlib.rc_context(_LOOK), warnings.catch_warnings():
            # the viewer's fonts draw what the fonts here do not have
            warnings.filterwarnings("ignore", message="Glyph .* missing from")
            with _drawn_once(figure):
                figure.savefig(
                    buffer,
                    format="svg",
                    metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")),
                    dpi=150,
                )
        svg = _PATH.sub(lambda found: _DIGITS.sub(r"\1", found[1]), buffer.getvalue())
        return svg[svg.index("<svg") :]

    @property
    def source(self) -> str:
        """Data URL of the picture: nothing is fetched, and its ids are unique on a page."""
        return "data:image/svg+xml;base64," + base64.b64encode(
            self.svg.encode("utf-8", "replace")
        ).decode("ascii")


@contextmanager
def _drawn_once(figure: Figure) -> Iterator[None]:
    """Halve the drawing in `Figure.savefig`, with the same result.

    For a figure with a layout engine, savefig draws twice: first without output, so that the
    engine runs, then into the file with the positions found. Here the first time only runs the
    engine.
    """
    draw, engine = figure.draw, figure.get_layout_engine()
    if engine is None:
        yield
        return

    def lay_out(_renderer: Any) -> None:
        vars(figure)["draw"] = draw
        with suppress(ValueError):  # as Figure.draw does
            engine.execute(figure)

    vars(figure)["draw"] = lay_out
    try:
        yield
    finally:
        del vars(figure)["draw"]


def panel_grid(
    size: tuple[float, float],
    rows: int,
    columns: int,
    *,
    left: float = 0.75,
    right: float = 0.25,
    top: float = 0.3,
    bottom: float = 0.45,
    between: tuple[float, float] = (0.75, 0.45),
    **options: Any,
) -> tuple[Figure, Any]:
    """A figure with its panels (rows, columns) at fixed places, for labels of known size.

    Matplotlib's constrained layout, which measures every label, takes as long as the drawing; it is
    for labels whose length is unknown.

    Parameters
    ----------
    size : width and height of the figure [in].
    left, right, top, bottom : margins outside the panels [in].
    between : gaps between columns and between rows [in].
    options : as in `matplotlib.figure.Figure.subplots`.
    """
    (width, height), (across, down) = size, between
    panel_width = (width - left - right - across * (columns - 1)) / columns
    panel_height = (height - top - bottom - down * (rows - 1)) / rows
    figure = Figure(figsize=size)
    figure.subplots_adjust(
        left / width,
        bottom / height,
        1.0 - right / width,
        1.0 - top / height,
        across / panel_width,
        down / panel_height,
    )
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def plain_panel(panel: Any) -> None:
    """Apply the plain style: no frame at the top and right, a light grid, small ticks."""
    panel.spines[["top", "right"]].set_visible(False)
    panel.grid(True, color="0.9", lw=0.5)
    panel.set_axisbelow(True)
    panel.tick_params(labelsize=8, length=3)
    panel.xaxis.label.set_size(9)
    panel.yaxis.label.set_size(9)
