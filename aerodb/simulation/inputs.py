"""Test inputs that a flight superposes on its control: pulses of known shape."""

from dataclasses import dataclass

import numpy as np

from aerodb.support import Array

#: Pulse widths in units of the event's width, signs alternating.
SHAPES: dict[str, tuple[int, ...]] = {"pulse": (1,), "doublet": (1, 1), "3211": (3, 2, 1, 1)}


@dataclass(frozen=True)
class Event:
    """One test input.

    Parameters
    ----------
    target : name that the controller knows
    start : float, [s]
    width : float, unit pulse width [s]
    amplitude : float, in the unit of the target
    shape : ``pulse``, ``doublet``, ``3211``, or ``hold``, a pulse whose first and last fifth are
        ramps, for slow surfaces

    A 3-2-1-1 is broad-band and simple to fly: Klein & Morelli (2006), chapter 9.
    """

    target: str
    start: float
    width: float
    amplitude: float
    shape: str = "doublet"

    def __call__(self, time: Array) -> Array:
        """Return the value at `time` [s], an array of any shape."""
        since = (time - self.start) / self.width
        if self.shape == "hold":
            return self.amplitude * np.clip(np.minimum(since, 1 - since) * 5, 0.0, 1.0)
        edges = np.concatenate([[0], np.cumsum(SHAPES[self.shape])])
        signs = np.concatenate([[0.0], (-1.0) ** np.arange(len(edges) - 1), [0.0]])
        # A margin of 1e-9 keeps sampling instants on their nominal side of an edge.
        result: Array = self.amplitude * signs[np.searchsorted(edges, since + 1e-9, side="right")]
        return result


def superposed(events: tuple[tuple[Event, ...], ...], target: str, time: Array) -> Array:
    """Return the sum (n, k) of the events of each of k flights on one target.

    Parameters
    ----------
    events : one tuple of events per flight
    target : name of the input
    time : (n,) [s]
    """
    return np.stack(
        [
            sum((e(time) for e in flight if e.target == target), np.zeros_like(time))
            for flight in events
        ],
        axis=1,
    )
