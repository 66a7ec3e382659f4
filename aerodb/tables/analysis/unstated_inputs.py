"""Values of the inputs that a user does not state: a state in which the aircraft can be."""

from collections.abc import Iterable, Mapping
from functools import lru_cache
from typing import Any, Final

import numpy as np

from aerodb.physics import standard_atmosphere
from aerodb.tables.analysis.arguments import breakpoints_over, table_calls
from aerodb.tables.analysis.nodes import air_beside
from aerodb.tables.database import AeroDatabase
from aerodb.tables.increment import Increment

_HEIGHT: Final = "height_above_ground"
#: Heights [spans] that are tried, the highest first. Ground effect is gone one span above ground
#: (McCormick, Aerodynamics, Aeronautics and Flight Mechanics, 1995, section 7.4).
_SPANS: Final = (10.0, 5.0, 3.0, 2.0, 1.5, 1.2, 1.1, 1.0)

#: An airspeed [m/s] that none states: rates that are zero give the same at any.
STAND_IN_SPEED: Final = 1.0
#: Airspeeds [m/s] that are tried, from a model's to the speed of sound.
_SPEEDS: Final = np.geomspace(3.0, 340.0, 60)


@lru_cache(maxsize=16)
def height_outside_ground_effect(database: AeroDatabase) -> float | None:
    """Return a height above ground [m] at which a database has no ground effect: the highest of its
    tables, else the highest of `_SPANS` at which no table is left; None where it has no such input.
    """
    if _HEIGHT not in database.inputs:
        return None
    ends = [float(points[-1]) for points in breakpoints_over(_HEIGHT, database)]
    if ends:
        return max(ends)
    heights = database.reference.span * np.array(_SPANS)
    others = {name: 0.0 for name in database.inputs if name not in ("V", _HEIGHT)}
    if database.has_loads:
        others |= air_beside({"V": 1.0})
    left = [
        set(database.predict({**others, "V": 1.0, _HEIGHT: height}).outside_tables)
        for height in heights.tolist()
    ]
    always = set.intersection(*left)
    inside = [h for h, names in zip(heights.tolist(), left, strict=True) if names == always]
    return float(inside[0] if inside else heights[0])


def unstated_inputs(database: AeroDatabase, stated: Mapping[str, Any]) -> dict[str, Any]:
    """Return input -> value [SI] of the inputs that are not stated: zero; the height above ground
    outside ground effect.

    The airspeed is `STAND_IN_SPEED`. Of a database with loads the air
    is that of `air_beside`. States that follow from the others have no entry.
    """
    settled = {state.name for state in database.states}
    values = {n: 0.0 for n in database.inputs if n not in stated and n not in settled}
    if "V" in values:
        values["V"] = STAND_IN_SPEED
    if _HEIGHT in values:
        values[_HEIGHT] = height_outside_ground_effect(database) or 0.0
    if database.has_loads:
        air = air_beside({"V": values.get("V", STAND_IN_SPEED), **stated})
        values |= {name: air[name] for name in air if name in values}
    return values


def flight_speed(database: AeroDatabase) -> float:
    """Return an airspeed [m/s] at which the aircraft flies: the middle of what the flights of its
    parameters have flown, else of its tables over V, else one within its tables over what V changes
    (Reynolds number), else `STAND_IN_SPEED`."""
    known = [each.parameter for each in database.variables.values() if each.parameter is not None]
    ends = [end for each in known for end in each.flown.get("V", ())]
    ends = ends or [float(end) for points in breakpoints_over("V", database) for end in points]
    return 0.5 * (min(ends) + max(ends)) if ends else _speed_of_tables(database)


@lru_cache(maxsize=16)
def _speed_of_tables(database: AeroDatabase) -> float:
    """The middle of the airspeeds [m/s] that are within a table over what V changes, in the air of
    sea level; `STAND_IN_SPEED` without such a table."""
    definitions = {name: each.expression for name, each in database.variables.items()}
    air = standard_atmosphere(0.0)
    inside = np.zeros(len(_SPEEDS), dtype=bool)
    for call in table_calls(database):
        axes = database.tables[call.table].breakpoints if call.table in database.tables else ()
        for argument, points in zip(call.arguments, axes, strict=False):
            program = database.compiled(
                [argument], definitions, {**database.tables, **database.scattered}
            )
            if "V" not in program.inputs:
                continue
            at = {name: np.zeros(len(_SPEEDS)) for name in program.inputs} | {
                "V": _SPEEDS,
                "temperature": np.full(len(_SPEEDS), float(air.temperature)),
                "static_pressure": np.full(len(_SPEEDS), float(air.pressure)),
                **air_beside({"V": _SPEEDS}),
            }
            at["rho"] = np.full(len(_SPEEDS), at["rho"])
            with np.errstate(all="ignore"):
                values = program.run({name: at[name] for name in program.inputs}).values[0]
            if np.ptp(values) > 0.0:  # not rates of zero over it
                inside |= (values >= np.min(points)) & (values <= np.max(points))
    known = _SPEEDS[inside]
    return float(0.5 * (known[0] + known[-1])) if len(known) else STAND_IN_SPEED


def neutral_point(database: AeroDatabase, increments: Iterable[Increment] = ()) -> dict[str, float]:
    """Return inputs [SI] of `database` where none is stated (`unstated_inputs`), moved to the
    nearest point inside the envelopes of `increments`.

    States are left out, so that they have their steady value. Loads do not scale with the dynamic
    pressure, so that the airspeed of a database with loads is `flight_speed`.
    """
    states = {state.name for state in database.states}
    own = database.has_loads and database.reference.pressure is None and "V" in database.inputs
    stated = {"V": flight_speed(database)} if own else {}
    point: dict[str, float] = {**stated, **unstated_inputs(database, stated)}
    for increment in increments:
        for name, interval in increment.envelope.items():
            if name not in states:
                point[name] = float(np.clip(point.get(name, 0.0), interval.low, interval.high))
    return point
