"""Keys that all kinds of parts share."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from aerodb.parts.frame import Frame
from aerodb.parts.writing import Writer
from aerodb.quantities import Point
from aerodb.support import Strict
from aerodb.tables import LOAD_AXES, Expression


def _as_text(value: Any) -> Any:
    return repr(value) if isinstance(value, (int, float)) and not isinstance(value, bool) else value


#: A formula over local names and the aircraft's; a number is one too.
Formula = Annotated[str, BeforeValidator(_as_text), Field(min_length=1)]


def text_or_table(value: Any) -> str:
    """Return whether a value of a file is a ``text`` (or a number) or a ``table``."""
    return "text" if isinstance(value, (str, int, float)) else "table"


class Load(Strict):
    """A load in the axes of a part: `axis` FX FY FZ [N] or MX MY MZ [N m], and its expression."""

    axis: Literal["FX", "FY", "FZ", "MX", "MY", "MZ"]
    expression: Formula


class Entry(Strict):
    """A part as it is written.

    description : for people. load : further loads in its own axes, at its position. mirror : the
    part stands on the right, and its mirror image on the left, as ``<part>_right`` and ``_left``.
    """

    kind: str
    description: str = ""
    mirror: bool = False
    load: tuple[Load, ...] = ()


class Placed(Entry):
    """A part at a point: `position` [m], body axes from the vehicle's datum."""

    position: Point


class Slipstreamed(Entry):
    """A part that stands in a slipstream. slipstream : name of the engine; empty: in none."""

    slipstream: str = ""


@dataclass(frozen=True, eq=False)
class Disc:
    """The disc of an engine that has one: its centre (3,) [m] from the moment reference, its axis
    (3,) and radius [m], and the velocity induced there [m/s]. A disc that tilts has its axis turned
    about the y axis of the frame by `tilt` [rad]."""

    frame: Frame
    radius: float
    induced: Expression
    tilt: Expression | None = None


#: Engine -> its disc.
Discs = Mapping[str, Disc]


def write_loads(entry: Entry, writer: Writer, frame: Frame) -> None:
    """Add the further loads of a part, which are at its position and in its axes [N, N m].

    Raises InputError for a formula that cannot be read, with its place.
    """
    for number, load in enumerate(entry.load, 1):
        key = f"load {number}"
        expression = writer.read(load.expression, key)
        acting = [expression if axis == load.axis else None for axis in LOAD_AXES]
        writer.act(frame, tuple(acting[:3]), tuple(acting[3:]), f"_load_{number}", key)
