"""A stretch of a flight, and which kinds of it are states."""

from dataclasses import dataclass
from typing import Final

#: Kinds that are no manoeuvres.
STATES: Final = ("on_ground", "airborne", "hover", "failed", "configuration", "steady")


@dataclass(frozen=True)
class Segment:
    """A stretch of a flight: kind, `start` and `end` [s], reason in words, surface channel if any.

    Kinds: ``on_ground airborne hover``; ``failed`` (a sensor, whose stretch is left out);
    ``configuration``; ``pulse step doublet 2-1-1 1-2-1 3-2-1-1 sweep multistep``; ``stall pull_up
    low_g slow_oscillation spiral``; ``steady``.
    """

    kind: str
    start: float
    end: float
    reason: str
    channel: str = ""
