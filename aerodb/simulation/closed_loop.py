"""A controller in the loop of the engine: many flights at once, with actuators and moving air."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Protocol

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.parts import contact_points
from aerodb.physics import DrydenGusts
from aerodb.simulation.engine import initial_state
from aerodb.simulation.flown_vehicle import FlownVehicle
from aerodb.simulation.ground import standing
from aerodb.simulation.layout import CHAN, FEEDBACK, LOADS, MOTION, SURROUNDINGS, H, X
from aerodb.support import Array
from aerodb.vehicle import Surface

#: Samples of a control step that the engine is given: its start, middle and end.
_SAMPLES: Final = 3
#: What moves a free input.
_FREE: Final = Surface(limits=(-np.inf, np.inf))
#: Least height at which turbulence is evaluated [m].
_LOWEST: Final = 3.0


class Controller(Protocol):
    """Commands of surfaces [rad] and of free inputs from the channels at a control step, one (k,)
    array each."""

    def __call__(self, time: float, channels: Mapping[str, Array]) -> Mapping[str, Array]: ...


@dataclass(frozen=True)
class History:
    """True channels of k simulated flights.

    Parameters
    ----------
    time : (n,) [s]
    channels : name to (n, k)
    commands : surface [rad] or free input to (n, k), held over the step that begins at each time
    quaternion : (n, 4, k), body to earth
    samples : (k,), number of samples of each flight, including that with which it ends
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


class _Steps:
    """The engine, a control step at a time."""

    def __init__(
        self, flown: FlownVehicle, start: Mapping[str, Any], deflected: Array,
        wind: Array, ground: float, step: float,
    ) -> None:  # fmt: skip
        model, k = flown.model, wind.shape[1]
        machine = model.total.machine
        self._model, self._step = model, step
        self._series = np.zeros((_SAMPLES, len(H) + len(model.inputs) + len(FEEDBACK), k))
        given = {**flown.masses, "density_ratio": 1.0, "ground_altitude": ground}
        for name, value in given.items():
            self._series[:, SURROUNDINGS.index(name)] = value
        self._series[:, H.wind_north : H.wind_down + 1] = wind
        self._slots = np.concatenate(
            [np.repeat(machine.slots[:, None], k, axis=1), np.zeros((1, k))]
        )
        for name, value in model.parameters.items():
            self._slots[machine.inputs[name]] = value
        self._act(0, np.zeros((3, k)), deflected)
        rows = dict(zip((*SURROUNDINGS, *model.inputs), self._series[0], strict=False))
        self.state = initial_state(model, start, rows, k)
        self._rates = np.empty_like(self.state)
        self._recorded = np.empty((_SAMPLES, len(CHAN), k))
        self._kept = np.empty((_SAMPLES, len(self.state) + len(model.inputs), k))
        self._ended, self._left = (
            np.empty(k, np.int64),
            np.empty((len(machine.tables), k), np.int64),
        )
        self._integrate(1)

    def channels(self) -> dict[str, Array]:
        """Motion and loads (k,) at the end of the last step."""
        return dict(zip((*MOTION, *LOADS), self._recorded[self._last].copy(), strict=True))

    def advance(self, gusts: Sequence[Array], deflected: Sequence[Array]) -> None:
        """Go on by a step; gusts (3, k) and the model's inputs (m, k) at its start, middle and
        end."""
        for sample, (gust, deflection) in enumerate(zip(gusts, deflected, strict=True)):
            self._act(sample, gust, deflection)
        self._integrate(_SAMPLES)

    def _act(self, sample: int, gust: Array, deflected: Array) -> None:
        self._series[sample, H.gust_u : H.gust_w + 1] = gust
        self._series[sample, len(H) : len(H) + len(deflected)] = deflected

    def _integrate(self, samples: int) -> None:
        from aerodb.simulation.integration import integrate  # loads the compiler

        self._last = samples - 1
        integrate(
            self._model.numbers, self._series[:samples], self._step / (_SAMPLES - 1), 1, 4,
            self.state, self._slots, self._recorded[:samples], self._kept[:samples], self._ended,
            self._left, self._rates,
        )  # fmt: skip


def fly(
    flown: FlownVehicle,
    start: Mapping[str, Any],
    deflections: Mapping[str, Array],
    controller: Controller,
    *,
    step: float,
    duration: float,
    wind: Array,
    gusts: DrydenGusts | None = None,
    ground_altitude: float = 0.0,
    touchdown_height: float = 0.0,
) -> History:
    """Fly k flights until each is on the ground or the duration is over.

    A flight with legs rolls on them and ends as it stands still (`standing`); one without ends at
    the touchdown height. A control step is two steps of the classical Runge-Kutta rule. Gusts vary
    linearly within a control step, deflections between its start, middle and end.

    Parameters
    ----------
    flown : a vehicle without thrust
    start : as `simulate` takes it
    deflections : surface [rad], or a free input of the database such as ``brake``, to (k,), at the
        start. A free input has no limits and no lag.
    controller : gives the commands of all of these
    step, duration : float, [s]
    wind : (3, k), velocity of the air north, east, down [m/s]
    gusts : turbulence, none by default
    ground_altitude : above sea level [m]
    touchdown_height : float, of the CG above ground [m], for a vehicle without legs

    Raises InputError for a vehicle with thrust, or whose database reads what nothing gives.
    """
    vehicle, names = flown.vehicle, list(deflections)
    if vehicle.thrust.source != "none":
        raise InputError(
            "only gliding flight is simulated in closed loop", vehicle.name, "use no thrust"
        )
    moved = [vehicle.surfaces.get(name, _FREE) for name in names]
    half, whole = (Actuators(moved, t) for t in (step / 2, step))
    positions = np.array([deflections[n] for n in names])

    pairs = list(vehicle.combinations.values())
    right, left = (
        np.array([names.index(getattr(pair, side)) for pair in pairs], dtype=np.int64)
        for side in ("right", "left")
    )
    signs = np.array([[1.0 if pair.kind == "symmetric" else -1.0] for pair in pairs])
    given = [f"delta_{name}" if name in vehicle.surfaces else name for name in names]
    given += [f"delta_{name}" for name in vehicle.combinations]
    absent = [name for name in flown.model.inputs if name not in given]
    if absent:
        raise InputError(f"nothing gives {', '.join(absent)}", vehicle.name)
    read = np.array([given.index(name) for name in flown.model.inputs], dtype=np.int64)

    def deflected(at: Array) -> Array:
        """Everything `given`, from the positions of what moves."""
        if not pairs:
            return at
        return np.concatenate([at, 0.5 * (at[right] + signs * at[left])])

    now = deflected(positions)
    steps = _Steps(flown, start, now[read], wind, ground_altitude, step)
    cg = [flown.masses[f"cg_{axis}"] for axis in "xyz"]
    legs = contact_points(flown.model.database) - cg
    gust = np.zeros_like(wind)
    active = np.ones(wind.shape[1], dtype=bool)
    samples = np.zeros(wind.shape[1], dtype=np.int64)
    rows: list[tuple[float, dict[str, Array], Mapping[str, Array], Array]] = []
    for number in range(round(duration / step) + 1):
        channels = {**steps.channels(), **dict(zip(given, now, strict=True))}
        commands = controller(number * step, channels)
        rows.append((number * step, channels, commands, steps.state[X.e0 : X.e3 + 1].copy()))
        samples += active
        if len(legs):
            active &= ~standing(channels, legs)
        else:
            active &= channels["height_above_ground"] > touchdown_height
        if not active.any():
            break
        height = np.maximum(channels["height_above_ground"], _LOWEST)
        following = gusts.advance(step, channels["V"], height) if gusts else gust
        commanded = np.array([commands[n] for n in names])
        middle, positions = half.moved(positions, commanded), whole.moved(positions, commanded)
        frozen, former, now = steps.state[:, ~active].copy(), now, deflected(positions)
        inputs = (former[read], deflected(middle)[read], now[read])
        steps.advance((gust, 0.5 * (gust + following), following), inputs)
        # A flight that has ended stands still, so that its numbers stay finite while the others
        # continue.
        steps.state[:, ~active] = frozen
        gust = following
    return _history(rows, samples)


def _history(
    rows: list[tuple[float, dict[str, Array], Mapping[str, Array], Array]],
    samples: NDArray[np.int64],
) -> History:
    return History(
        time=np.array([row[0] for row in rows]),
        channels={name: np.array([row[1][name] for row in rows]) for name in rows[0][1]},
        commands={name: np.array([row[2][name] for row in rows]) for name in rows[0][2]},
        quaternion=np.array([row[3] for row in rows]),
        samples=samples,
    )
