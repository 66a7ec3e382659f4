"""Fly closed-loop flights in parallel: airframe, actuators, controller and moving air."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from aerodb.simulation.airframe_model import Airframe, MovingAir
from aerodb.simulation.motion import POSITION, QUATERNION, midpoint_step
from aerodb.simulation.turbulence import DrydenGusts
from aerodb.support import Array
from aerodb.vehicle import Surface


class Controller(Protocol):
    """Surface commands [rad] from the channels at a control step, one (k,) array per surface."""

    def __call__(self, time: float, channels: Mapping[str, Array]) -> Mapping[str, Array]: ...


@dataclass(frozen=True)
class History:
    """True channels of k simulated flights.

    Parameters
    ----------
    time : (n,) [s]
    channels : name to (n, k)
    commands : surface to (n, k) [rad], held over the step that begins at each time
    quaternion : (n, 4, k), body to earth
    samples : (k,), number of samples of each flight, including the first on the ground
    """

    time: Array
    channels: Mapping[str, Array]
    commands: Mapping[str, Array]
    quaternion: Array
    samples: NDArray[np.int64]


class Actuators:
    """The actuators of m surfaces, moved together.

    A command is limited, then passes an exact first-order lag.

    Parameters
    ----------
    surfaces : limits [rad] and lag [s] of each
    step : float, [s]

    >>> import numpy as np
    >>> fin = Actuators([Surface(limits=(-0.3, 0.3), lag=0.1)], step=0.1)
    >>> round(float(fin.moved(np.zeros((1, 1)), np.ones((1, 1)))[0, 0]), 4)  # 0.3 (1 - 1/e)
    0.1896
    """

    def __init__(self, surfaces: Sequence[Surface], step: float) -> None:
        self._low, self._high = np.array([s.limits for s in surfaces]).reshape(-1, 2).T[:, :, None]
        self._instant = np.array([[s.lag == 0.0] for s in surfaces])
        self._decay = np.array([[np.exp(-step / s.lag) if s.lag else 0.0] for s in surfaces])

    def moved(self, position: Array, command: Array) -> Array:
        """Return the deflections (m, k) [rad] after a step under held commands.

        Parameters
        ----------
        position : (m, k), deflections at the start [rad]
        command : (m, k) [rad]
        """
        target = np.minimum(np.maximum(command, self._low), self._high)
        return np.where(self._instant, target, target + (position - target) * self._decay)


def fly(
    airframe: Airframe,
    surfaces: Mapping[str, Surface],
    initial: Array,
    deflections: Mapping[str, Array],
    controller: Controller,
    *,
    step: float,
    duration: float,
    wind: Array,
    gusts: DrydenGusts | None = None,
    touchdown_height: float = 0.0,
) -> History:
    """Fly k flights until each is at the touchdown height or the duration is over.

    The integration is the midpoint rule with one control step per `step`. Gusts vary linearly
    within a step.

    Parameters
    ----------
    airframe : the vehicle
    surfaces : name to limits and lag
    initial : (13, k), state as in `aerodb.simulation.motion`
    deflections : surface to (k,), at the start [rad]
    controller : gives the surface commands
    step, duration : float, [s]
    wind : (3, k), velocity of the air north, east, down [m/s]
    gusts : turbulence, none by default
    touchdown_height : float, of the CG above ground [m]

    Returns
    -------
    History
    """
    names = list(deflections)
    half, whole = (Actuators([surfaces[n] for n in names], time) for time in (step / 2, step))
    state, positions = initial, np.array([deflections[n] for n in names])
    gust = np.zeros_like(wind)
    active = np.ones(initial.shape[1], dtype=bool)
    samples = np.zeros(initial.shape[1], dtype=np.int64)
    rows: list[tuple[float, dict[str, Array], Mapping[str, Array], Array]] = []
    for number in range(round(duration / step) + 1):
        time = number * step
        deflected = dict(zip(names, positions, strict=True))
        channels, rate = airframe.evaluate(state, MovingAir(wind, gust), deflected)
        commands = controller(time, channels)
        rows.append((time, channels, commands, state[QUATERNION]))
        samples += active
        active &= -state[POSITION][2] > touchdown_height
        if not active.any():
            break
        following = (
            gusts.advance(step, channels["V"], np.maximum(channels["height_above_ground"], 3.0))
            if gusts
            else gust
        )
        commanded = np.array([commands[n] for n in names])
        halfway = dict(zip(names, half.moved(positions, commanded), strict=True))
        middle = MovingAir(wind, 0.5 * (gust + following))

        def midway(
            _: float, at: Array, air: MovingAir = middle, deflected: Mapping[str, Array] = halfway
        ) -> Array:
            return airframe.state_rate(at, air, deflected)

        moved = midpoint_step(midway, time, state, step, rate)
        # The state of a flight that has ended is frozen, so that its numbers stay finite while the
        # others continue.
        state = np.where(active, moved, state)
        positions = whole.moved(positions, commanded)
        gust = following
    return _history(rows, samples)


def _history(
    rows: list[tuple[float, dict[str, Array], Mapping[str, Array], Array]],
    samples: NDArray[np.int64],
) -> History:
    return History(
        time=np.array([row[0] for row in rows]),
        channels={name: np.stack([row[1][name] for row in rows]) for name in rows[0][1]},
        commands={
            name: np.stack([np.asarray(row[2][name]) for row in rows]) for name in rows[0][2]
        },
        quaternion=np.stack([row[3] for row in rows]),
        samples=samples,
    )
