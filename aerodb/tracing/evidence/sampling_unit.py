"""The unit of sampling: a flight, or a stretch of one, and the name by which results carry it."""

import re
from dataclasses import dataclass
from typing import Final

_NUMBER: Final = r"\d+(?:\.\d+)?(?:e[+-]?\d+)?"
_WINDOW: Final = re.compile(rf"(?P<flight>.*)@(?P<start>{_NUMBER})-(?P<end>{_NUMBER})")


@dataclass(frozen=True)
class SamplingUnit:
    """A flight (its id), or a window of it: start and end [s] from the flight's first sample.

    >>> str(SamplingUnit("abc", (0.0, 5.654912)))
    'abc@0-5.65491'
    >>> SamplingUnit.parse("abc@0-5.65491"), SamplingUnit.parse("abc")
    (SamplingUnit(flight='abc', window=(0.0, 5.65491)), SamplingUnit(flight='abc', window=None))
    """

    flight: str
    window: tuple[float, float] | None = None

    @classmethod
    def parse(cls, name: str) -> "SamplingUnit":
        """Return the unit of this name (window in seconds of the flight); a name without a window
        is a whole flight."""
        match = _WINDOW.fullmatch(name)
        return (
            cls(name)
            if match is None
            else cls(match["flight"], (float(match["start"]), float(match["end"])))
        )

    def __str__(self) -> str:
        return (
            self.flight
            if self.window is None
            else f"{self.flight}@{self.window[0]:g}-{self.window[1]:g}"
        )

    @property
    def short(self) -> str:
        """A name for people, with as much of the flight's id as tells flights apart."""
        return str(SamplingUnit(self.flight[:12], self.window))

    def part(self, start: float, end: float) -> "SamplingUnit":
        """Return its stretch from `start` to `end` [s], counted from its own first sample."""
        first = 0.0 if self.window is None else self.window[0]
        return SamplingUnit(self.flight, (first + start, first + end))
