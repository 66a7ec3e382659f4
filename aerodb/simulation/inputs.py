"""Test inputs that a flight superposes on its control: pulses of known shape."""

from dataclasses import dataclass

import numpy as np

from aerodb.support import Array

#: Pulse widths in units of the event's width, signs alternating.
SHAPES: dict[str, tuple[int, ...]] = {"pulse": (1,), "doublet": (1, 1), "3211": (3, 2, 1, 1)}


@dataclass(frozen=True)
class Event:
    """One test input: onto `target` (a name that the controller knows), from `start` [s], unit
    pulse width [s].

    shape : ``pulse``, ``doublet``, ``3211`` (broad-band and simple to fly: Klein & Morelli 2006,
    chapter 9) or ``hold``, a pulse whose first and last fifth are ramps, for surfaces that move
    slowly.
    """

    target: str
    start: float
    width: float
    amplitude: float
    shape: str = "doublet"

    def __call__(self, time: Array) -> Array:
        """Value at `time` [s], any shape."""
        since = (time - self.start) / self.width
        if self.shape == "hold":
            return self.amplitude * np.clip(np.minimum(since, 1 - since) * 5, 0.0, 1.0)
        edges = np.concatenate([[0], np.cumsum(SHAPES[self.shape])])
        signs = np.concatenate([[0.0], (-1.0) ** np.arange(len(edges) - 1), [0.0]])
        # Half an edge of 1e-9 keeps sampling instants on the side that they nominally belong to.
        result: Array = self.amplitude * signs[np.searchsorted(edges, since + 1e-9, side="right")]
        return result


def superposed(events: tuple[tuple[Event, ...], ...], target: str, time: Array) -> Array:
    """Sum (n, k) at `time` (n,) [s] of each of k flights' events onto `target`; `events` holds one
    tuple per flight."""
    return np.stack(
        [
            sum((e(time) for e in flight if e.target == target), np.zeros_like(time))
            for flight in events
        ],
        axis=1,
    )
