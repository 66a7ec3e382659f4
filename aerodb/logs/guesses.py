"""What a draft of a mapping guesses of a field."""

from collections.abc import Mapping
from dataclasses import dataclass

from aerodb.nomenclature import channel
from aerodb.support import Array
from aerodb.units import conversion


@dataclass(frozen=True)
class Guess:
    """A channel, the field that may be it, and why.

    unit : '' where it stays open. assumed : whether nothing but its size speaks for the unit.
    open : what else is to be answered, '' for nothing. stated : whether log or name state the unit.
    how : as in `Named`, or ``built-in``. by_axis : whether it is asked only as another axis points
    up, which the flight itself may answer.
    """

    channel: str
    topic: str
    field: str
    unit: str
    scale: float
    reason: str
    assumed: bool = False
    open: str = ""
    stated: bool = False
    how: str = "built-in"
    by_axis: bool = False

    @property
    def confidence(self) -> str:
        """``sure`` (name and unit are stated), ``likely`` (the values decide the unit), or
        ``asked``."""
        if self.assumed or self.open:
            return "asked"
        return "sure" if self.stated or self.how == "built-in" else "likely"


def in_si(guess: Guess, columns: Mapping[tuple[str, str], Array]) -> Array:
    """The values (n,) [SI] of a guess; `columns` as logged."""
    scale, offset = conversion(guess.unit, channel(guess.channel).unit)
    return scale * guess.scale * columns[guess.topic, guess.field] + offset
