"""What a database does not know of an aircraft, and its curves over the angle of attack."""

from collections.abc import Iterable, Mapping
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.nomenclature import is_command, is_surface
from aerodb.physics import standard_atmosphere
from aerodb.support import Array
from aerodb.tables.analysis.nodes import air_beside
from aerodb.tables.analysis.sensitivity import slopes_by
from aerodb.tables.analysis.unstated_inputs import (
    flight_speed,
    height_outside_ground_effect,
    unstated_inputs,
)
from aerodb.tables.database import AeroDatabase

#: What flight mechanics needs -> the body axis, and the inputs that it is by: any of them.
_EFFECTS: Final[dict[str, tuple[str, tuple[str, ...]]]] = {
    "pitching moment over alpha": ("Cm", ("alpha",)),
    "rolling moment over sideslip": ("Cl", ("beta",)),
    "yawing moment over sideslip": ("Cn", ("beta",)),
    "pitch damping": ("Cm", ("q",)),
    "roll damping": ("Cl", ("p",)),
    "yaw damping": ("Cn", ("r",)),
}
#: The same of controls: any deflection or free input that acts on the axis.
_CONTROLS: Final = {"elevator": "Cm", "aileron": "Cl", "rudder": "Cn"}
#: Size up to which there is no such coefficient: turning axes leaves this much of others.
ROUNDING: Final = 1e-9
#: Share of its largest moment from which a control counts for another axis, too: elevons have two
#: alike, the yaw of ailerons is a tenth of their roll.
_ACTS: Final = 0.3
#: Angles of attack [rad] at which the database is asked: attached flow of any wing.
ANGLES: Final = np.deg2rad([-2.0, 1.0, 4.0])


def lacking_effects(database: AeroDatabase) -> tuple[str, ...]:
    """Return what no term of a database gives at small angles of attack, in words: damping,
    stability, controls; "drag" and "lift over alpha" where they are zero. What is not finite there
    is not said to be lacking."""
    states = {state.name for state in database.states}
    inputs = [name for name in database.inputs if name not in states]
    channels = small_angles(database, inputs)
    sizes: dict[str, dict[str, float]] = {
        name: {
            axis: float(np.max(np.abs(values)))
            for axis, values in slopes_by(database, name, channels).items()
        }
        for name in {*inputs, "alpha", "beta"}
    }
    rotors = any(is_command(name) for name in inputs)  # which hold and control it about all axes
    lacking = [
        text
        for text, (axis, names) in _EFFECTS.items()
        if not (rotors and {*names} <= {"alpha", "beta"})
        and all(sizes.get(name, {}).get(axis, 0.0) <= ROUNDING for name in names)
    ]
    own = [n for n in inputs if is_surface(n) or n in database.free_inputs]
    lacking += [
        name
        for name, axis in _CONTROLS.items()
        if not rotors and not any(_acts_on(axis, sizes.get(control, {})) for control in own)
    ]
    small = curves(database, ANGLES)
    drag, lift = small.get("C_drag"), small.get("C_lift")
    forces = (
        *(("drag",) if drag is not None and np.all(np.abs(drag) <= ROUNDING) else ()),
        *(("lift over alpha",) if lift is not None and np.ptp(lift) <= ROUNDING else ()),
    )
    return (*forces, *lacking)


def small_angles(database: AeroDatabase, inputs: Iterable[str]) -> dict[str, Array]:
    """Return input -> values (k,) [SI] at which slopes are asked: `ANGLES`, and a little of all
    else, outside ground effect, at `flight_speed`, in the air of sea level."""
    at = {name: np.full(len(ANGLES), 0.01) for name in inputs}
    if (height := height_outside_ground_effect(database)) is not None:
        at["height_above_ground"] = np.full(len(ANGLES), height)
    air = _air(database)
    return at | {name: np.full(len(ANGLES), air[name]) for name in air} | {"alpha": ANGLES}


def _air(database: AeroDatabase) -> dict[str, float]:
    """Return input -> value [SI] of an airspeed at which it flies, and of the air of sea level that
    a database reads: terms may divide by its pressure or temperature."""
    level = standard_atmosphere(0.0)
    air = {"temperature": float(level.temperature), "static_pressure": float(level.pressure)}
    speed = flight_speed(database)
    air |= air_beside({"V": speed})
    read = {*database.inputs, *(("rho", "qbar") if database.has_loads else ())}
    return {"V": speed} | {name: value for name, value in air.items() if name in read}


def _acts_on(axis: str, sizes: Mapping[str, float]) -> bool:
    """Whether a control is there for a moment, not beside another."""
    largest = max((sizes.get(each, 0.0) for each in _CONTROLS.values()), default=0.0)
    return largest > 0.0 and sizes.get(axis, 0.0) >= _ACTS * largest


def curves(database: AeroDatabase, alpha: Array) -> dict[str, Array]:
    """Return C_lift, C_drag and Cm (n,) over `alpha` (n,) [rad], everything else zero, at
    `flight_speed`, outside ground effect, in the air of sea level; empty where nothing can be
    evaluated so."""
    neutral = unstated_inputs(database, {}) | _air(database)
    point = {name: np.full(len(alpha), value) for name, value in neutral.items()}
    point["alpha"] = alpha
    try:
        values = database.predict(point).coefficients
    except InputError:
        return {}
    ca, sa = np.cos(alpha), np.sin(alpha)
    return {
        "C_lift": values["CX"] * sa - values["CZ"] * ca,
        "C_drag": -values["CX"] * ca - values["CZ"] * sa,
        "Cm": values["Cm"],
    }
