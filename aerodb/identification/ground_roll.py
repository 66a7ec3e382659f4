"""A roll on the ground as a model with unknown parameters.

A vehicle rolls on its legs from a speed, a drift, a heading and a yaw rate that are unknown, in a
steady wind that is unknown, up to its standstill and a moment longer. What flights tell of the
legs' parameters, such as rolling friction and brake efficiency, is in the way that it comes, and in
the heading at which it holds its track against the wind. Its height and attitude on its springs at
the start are those at which the legs carry it.

References
----------
Data Analysis of Phoenix Reusable Launch Vehicle Demonstrator Flight Test, section on the ground
roll: friction, steady wind and initial values from positions.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation import Fit, Parameters, TimeHistory, Values
from aerodb.physics import quaternion_from_euler, to_body
from aerodb.simulation import FlightModel, Simulation, simulate
from aerodb.support import Array
from aerodb.tables import AeroDatabase, depends_on

#: What a roll may be compared with, and the unit of each.
OUTPUTS: Final = {
    "north": "m", "east": "m", "velocity_north": "m/s", "velocity_east": "m/s", "psi": "rad",
    "V": "m/s",
}  # fmt: skip
#: How a roll begins: speed along and across the heading, over the ground; heading; yaw rate; place.
START: Final = {
    "speed": "m/s", "drift": "m/s", "psi": "rad", "r": "rad/s", "north": "m", "east": "m",
}  # fmt: skip
#: Longest integration step [s]: friction changes its sign within 1/40 s.
_LONGEST_STEP: Final = 0.02
#: Steady crosswinds [m/s] from which a search may begin: runways are hardly used in more. A tyre
#: leaves its straight slope within a degree or two, so from further away than one step a search
#: ends where tyres hardly hold.
_CROSSWINDS: Final = np.linspace(-20.0, 20.0, 41)
#: Multiples of a parameter of the legs from which a search may begin: a tenth apart, up to 2.6.
_MULTIPLES: Final = 1.1 ** np.arange(-10, 11)
#: Share of the squared error along the runway that a multiple must leave at most to be taken
#: (dimensionless): what hardly slows a roll, such as the side force, stays as it is.
_SLOWS: Final = 0.25


def ground_parameters(names: Sequence[str], database: AeroDatabase) -> bool:
    """Return whether parameters of a database act through its legs alone, so that only a roll on
    the ground tells of them.

    Raises InputError for a mixture of these and others.
    """
    own = [name for name in leg_parameters(database) if name in names]
    if own and len(own) < len(names):
        others = ", ".join(sorted({*names} - {*own}))
        raise InputError(
            f"{', '.join(own)} act on the ground only, {others} in flight too",
            "model file",
            "write two model files: the ground and the air are two estimates",
        )
    return bool(own)


def leg_parameters(database: AeroDatabase) -> tuple[str, ...]:
    """Names of the k parameters that act through the legs of a database alone, a tuple (k,)."""
    loads = {f"{leg}_load" for leg in _legs(database)}
    acting: dict[str, list[bool]] = {name: [] for name in database.parameters}
    for term in database.coefficient_terms:
        read = depends_on(term.expression, database)
        for name in read & acting.keys():
            acting[name].append(not loads.isdisjoint(read))
    return tuple(name for name, found in acting.items() if found and all(found))


def _legs(database: AeroDatabase) -> list[str]:
    """Names of the legs' variables, without their ending."""
    ending = "_compression"
    return [name.removesuffix(ending) for name in database.variables if name.endswith(ending)]


@dataclass(frozen=True, eq=False)
class GroundRoll:
    """Rolls on the ground as a `DynamicModel`.

    Unknowns by name: parameters of the database; of each record ``wind_north[...]`` and
    ``wind_east[...]`` [m/s], and ``initial_<how it began>[...]``.

    Parameters
    ----------
    flight : what rolls.
    parameters : all parameters.
    outputs : among north, east, velocity_north, velocity_east, psi and V.
    starts : record -> altitude [m], phi, theta [rad] at the start.
    """

    flight: FlightModel
    parameters: Parameters
    outputs: tuple[str, ...]
    starts: Mapping[str, Mapping[str, float]]
    states: tuple[str, ...] = tuple(START)

    def initial_state(self, values: Values, record: TimeHistory) -> Array:
        """State at the first sample, (s, k), in SI units and rad."""
        rows = [np.atleast_1d(values[f"initial_{name}[{record.name}]"]) for name in START]
        return np.stack(np.broadcast_arrays(*rows))

    def rates(self, values: Values, record: TimeHistory, sample: float, state: Array) -> Array:
        """NaN (s, k), SI units per second: compressions are further states, which no filter
        knows."""
        return np.full_like(state, np.nan)

    def observed(self, values: Values, record: TimeHistory, sample: int, state: Array) -> Array:
        """NaN (o, k), SI units, as `rates`."""
        return np.full((len(self.outputs), state.shape[1]), np.nan)

    def flown(self, values: Values, record: TimeHistory) -> Simulation:
        """Return the k runs of n samples from the start on, SI units; NaN after a divergence."""
        wind = [np.atleast_1d(values[f"wind_{way}[{record.name}]"]) for way in ("north", "east")]
        state = self.initial_state(values, record)
        k = max(state.shape[1], *(len(each) for each in wind))
        speed, drift, psi, r, north, east = np.broadcast_to(state, (len(state), k))
        at = self.starts[record.name]
        phi, theta = (np.full(k, at[name]) for name in ("phi", "theta"))
        attitude = quaternion_from_euler(phi, theta, psi)
        u, v, w = to_body(
            attitude,
            np.stack(
                [
                    speed * np.cos(psi) - drift * np.sin(psi) - wind[0],
                    speed * np.sin(psi) + drift * np.cos(psi) - wind[1],
                    np.zeros(k),
                ]
            ),
        )
        V = np.sqrt(u**2 + v**2 + w**2)
        start = {
            "V": V, "alpha": np.arctan2(w, u), "beta": np.arcsin(v / np.maximum(V, 1e-9)),
            "phi": phi, "theta": theta, "psi": psi, "r": r, "north": north, "east": east,
            "altitude": np.full(k, at["altitude"]),
        }  # fmt: skip
        series: dict[str, Any] = {**record.inputs}
        n = len(record.time)
        for way, blown in zip(("north", "east"), wind, strict=True):
            series[f"wind_{way}"] = np.broadcast_to(blown, (n, k))
        return simulate(
            self.flight,
            record.time,
            start,
            series,
            parts=max(1, int(np.ceil(record.step / _LONGEST_STEP - 1e-9))),
            parameters={name: values[name] for name in self.flight.parameters if name in values},
        )

    def simulated(self, values: Values, record: TimeHistory) -> Array:
        """Return outputs (n, o, k), SI units and rad, from the start on; NaN after a divergence."""
        run = self.flown(values, record)
        rows = {name: run.channels[name] for name in self.outputs}
        if "psi" in rows:  # from -180 to 180 deg: made continuous
            turned = np.unwrap(rows["psi"], axis=0)
            rows["psi"] = turned - turned[0] + values[f"initial_psi[{record.name}]"]
        return np.stack(np.broadcast_arrays(*rows.values()), axis=1)


def fitted_roll(
    function: Callable[..., Fit],
    model: GroundRoll,
    records: Sequence[TimeHistory],
    start: Mapping[str, float] | None = None,
) -> Fit:
    """Return the fit of a method that flies: first of wind and start alone, at the multiple of each
    of the database's parameters and from the crosswind that explain the rolls best, then of all.

    From a wind of zero, parameters would first take what the wind does. SI units.

    start : parameter -> value from which to search, of an earlier fit of the same rolls: their wind
    and start are not searched first.
    """
    if start is not None:
        known = {name: value for name, value in start.items() if name in model.parameters.names}
        return function(replace(model, parameters=model.parameters.changed(known)), records)
    own = [name for name in model.flight.parameters if name in model.parameters.names]
    begun = _in_crosswinds(_near_friction(model, records), records)
    if not any(begun.parameters[name].free for name in own):
        return function(begun, records)
    held = tuple(
        replace(item, free=False) if item.name in own else item for item in begun.parameters.items
    )
    first = function(replace(begun, parameters=Parameters(held)), records)
    if not first.converged:
        return function(begun, records)
    found = {e.name: e.value for e in first.estimates if e.name not in own}
    known = {name: value for name, value in found.items() if np.isfinite(value)}
    return function(replace(begun, parameters=begun.parameters.changed(known)), records)


def _near_friction(model: GroundRoll, records: Sequence[TimeHistory]) -> GroundRoll:
    """The model with each free parameter of the legs at that multiple of its value with which the
    rolls slow down as they did, where its own value is off by twice as much.

    With too much friction a run stands still long before the roll does. From there a search ends
    where speed and start make up for it.
    """
    own = [name for name in model.flight.parameters if name in model.parameters.names]
    for name in [name for name in own if model.parameters[name].free] * 2:
        item = model.parameters[name]
        tried = np.clip(item.value * _MULTIPLES, item.lower, item.upper)
        off = np.sum([_off_along(model, record, {name: tried}) for record in records], axis=0)
        best = int(np.argmin(off))
        if off[best] < _SLOWS * off[len(tried) // 2]:
            changed = model.parameters.changed({name: float(tried[best])})
            model = replace(model, parameters=changed)
    return model


def _flown_beside(model: GroundRoll, record: TimeHistory, changed: Values) -> Array:
    """Measured less flown outputs (n, o, k), 0 where not measured, where some of the parameters
    have k values in place of their own; infinite after a divergence."""
    values = {item.name: np.array([item.value]) for item in model.parameters.items}
    measured = np.stack([record.outputs[name] for name in model.outputs], axis=1)
    left = measured[:, :, None] - model.simulated({**values, **changed}, record)
    return np.where(np.isfinite(measured)[:, :, None], np.nan_to_num(left, nan=np.inf), 0.0)


def _off_along(model: GroundRoll, record: TimeHistory, changed: Values) -> Array:
    """Sum (k,) of the squared errors along the runway [m2, or m2/s2 where no place is known], as
    `_flown_beside`."""
    beside = _flown_beside(model, record, changed)
    left = {name: beside[:, at] for at, name in enumerate(model.outputs)}
    psi = model.parameters[f"initial_psi[{record.name}]"].value
    for north, east in (("north", "east"), ("velocity_north", "velocity_east")):
        if north in left and east in left and left[north].any():
            along = left[north] * np.cos(psi) + left[east] * np.sin(psi)
            return np.nan_to_num((along**2).sum(axis=0), nan=np.inf)
    flown = left["V"] if "V" in left else np.zeros_like(beside[:, 0])
    return np.asarray((flown**2).sum(axis=0))


def _in_crosswinds(model: GroundRoll, records: Sequence[TimeHistory]) -> GroundRoll:
    """The model with each unknown wind at the crosswind that explains its roll best, all else as
    it was measured."""
    found: dict[str, float] = {}
    for record in records:
        north, east = (f"wind_{way}[{record.name}]" for way in ("north", "east"))
        if not (model.parameters[north].free and model.parameters[east].free):
            continue
        values = {item.name: np.array([item.value]) for item in model.parameters.items}
        psi = values[f"initial_psi[{record.name}]"][0]
        measured = np.stack([record.outputs[name] for name in model.outputs], axis=1)
        blown = {north: -np.sin(psi) * _CROSSWINDS, east: np.cos(psi) * _CROSSWINDS}
        wrong = (_flown_beside(model, record, blown) ** 2).sum(axis=0)
        sizes = wrong[np.isfinite(measured).any(axis=0)]
        best = int(np.argmin(np.log(sizes).sum(axis=0)))
        found |= {name: float(values[best]) for name, values in blown.items()}
    return replace(model, parameters=model.parameters.changed(found))
