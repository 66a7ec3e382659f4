"""Fly closed-loop flights in parallel: airframe, actuators, controller and moving air."""

from collections.abc import Mapping
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


def actuate(surface: Surface, position: Array, command: Array, step: float) -> Array:
    """Return the deflection (k,) [rad] after a step under a held command.

    The command is limited, then passes an exact first-order lag.

    Parameters
    ----------
    surface : limits [rad] and lag [s]
    position : (k,), deflection at the start [rad]
    command : (k,) [rad]
    step : float, [s]

    >>> import numpy as np
    >>> fin = Surface(limits=(-0.3, 0.3), lag=0.1)
    >>> round(float(actuate(fin, np.zeros(1), np.ones(1), 0.1)[0]), 4)  # 0.3 (1 - 1/e)
    0.1896
    """
    target = np.clip(command, *surface.limits)
    if surface.lag == 0.0:
        return target
    return target + (position - target) * np.exp(-step / surface.lag)


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
    state, positions = initial, dict(deflections)
    gust = np.zeros_like(wind)
    active = np.ones(initial.shape[1], dtype=bool)
    samples = np.zeros(initial.shape[1], dtype=np.int64)
    rows: list[tuple[float, dict[str, Array], Mapping[str, Array], Array]] = []
    for number in range(round(duration / step) + 1):
        time = number * step
        channels, rate = airframe.evaluate(state, MovingAir(wind, gust), positions)
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
        halfway = {n: actuate(surfaces[n], x, commands[n], step / 2) for n, x in positions.items()}
        middle = MovingAir(wind, 0.5 * (gust + following))

        def midway(
            _: float, at: Array, air: MovingAir = middle, deflected: Mapping[str, Array] = halfway
        ) -> Array:
            return airframe.state_rate(at, air, deflected)

        moved = midpoint_step(midway, time, state, step, rate)
        # The state of a flight that has ended is frozen, so that its numbers stay finite while the
        # others continue.
        state = np.where(active, moved, state)
        positions = {n: actuate(surfaces[n], x, commands[n], step) for n, x in positions.items()}
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
