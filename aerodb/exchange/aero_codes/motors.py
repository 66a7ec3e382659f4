"""The rotors of a database as Gazebo's motors, and what these cannot hold of it."""

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, replace
from functools import reduce
from typing import TYPE_CHECKING, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.aero_codes.motor_model import Motor, motor_database, shares_of
from aerodb.exchange.increment_terms import with_increments_as_terms
from aerodb.exchange.reference_pressure import over_dynamic_pressure
from aerodb.nomenclature import AXES, is_command
from aerodb.support import Array
from aerodb.tables import LOAD_AXES, AeroDatabase, Expression, Term, neutral_point

if TYPE_CHECKING:
    from aerodb.parts import Rotor

#: Standard density at sea level [kg/m^3], where no flight tells another.
SEA_LEVEL: Final = 1.225
#: Flow [m/s] and shares of the commands' range over which a version without flights is compared.
_FLOWS: Final = (0.0, 5.0, 10.0)
_SHARES: Final = (0.5, 0.75, 1.0)
_TURN: Final = 2.0 * math.pi
_STILL: Final = ("V", "alpha", "beta", "p", "q", "r", "qbar")


@dataclass(frozen=True)
class MotorModel:
    """Motors of a version, and how far they are from it.

    motors : by their number. largest : load axis -> largest difference [N, N m]. notes : sentences
    on what the constants are of, and what the form cannot hold.
    """

    motors: tuple[Motor, ...]
    largest: Mapping[str, float]
    notes: tuple[str, ...]


def has_rotors(database: AeroDatabase) -> bool:
    """Return whether a database has parts that are rotors."""
    return any(part.get("kind") == "rotor" for part in database.parts.values())


@dataclass(frozen=True)
class Rotors:
    """The rotors of a database, in the order of their commands, and where a form of them is made
    and compared.

    entries : name -> part. over, channels, rho : of what differences are, channels (n,) [SI] and
    density [kg/m^3]. point : command -> its middle. ends : the two ends of all commands.
    """

    database: AeroDatabase
    entries: Mapping[str, "Rotor"]
    over: str
    channels: Mapping[str, Array]
    rho: float
    point: Mapping[str, float]
    ends: tuple[Mapping[str, float], Mapping[str, float]]

    def command(self, name: str) -> str:
        """The one command that a rotor's speed is of; empty where there is none, or several."""
        return _command(self.database, name)

    def axis(self, name: str) -> Array:
        """Direction (3,) of the thrust of a rotor."""
        axis = np.array(self.entries[name].axis)
        return np.asarray(axis / np.linalg.norm(axis))

    def about_itself(self, name: str, state: Mapping[str, Array]) -> tuple[Array, Array]:
        """Force and moment (3, n) of a rotor about its own place, in channels (n,)."""
        database = self.database
        arm = np.array(self.entries[name].position) - database.reference.moment_reference
        terms = [each for each in database.terms if each.part and each.description == name]
        loads = loads_of(database, terms, state)
        return loads[:3], loads[3:] - np.cross(arm, loads[:3], axisb=0, axisc=0)

    def fastest(self, name: str) -> float:
        """Largest speed [rev/s] at the ends of the commands."""
        ends = [still(self, end) for end in self.ends]
        return max(float(np.abs(speeds_of(self.database, [name], x)[name][0])) for x in ends)


def rotors_in(
    database: AeroDatabase, flown: tuple[str, Mapping[str, Array]] | None, form: str
) -> Rotors:
    """Return the rotors of a database. flown : a flight's name and its channels, each (n,) [SI];
    a grid of flow without. form : what cannot hold a tilting rotor, which InputError says."""
    from aerodb.parts import command_ranges, rotors_of

    database = with_increments_as_terms(over_dynamic_pressure(database))
    ranges = command_ranges(database)
    over, channels = flown or _grid(ranges)
    entries = rotors_of(database.parts)
    for name, entry in entries.items():
        if entry.tilt is not None:
            raise InputError(
                f"a tilting rotor, which {form} cannot hold",
                f"part {name}",
                "its axis is fixed there; export the version as jsbsim or daveml",
            )
    order = sorted(entries, key=lambda each: _natural(_command(database, each) or each))
    return Rotors(
        database,
        {name: entries[name] for name in order},
        over,
        channels,
        float(np.median(channels["rho"])) if "rho" in channels else SEA_LEVEL,
        {
            name: float(np.median(channels[name])) if flown else 0.5 * (low + high)
            for name, (low, high) in ranges.items()
        },
        ({n: low for n, (low, _) in ranges.items()}, {n: high for n, (_, high) in ranges.items()}),
    )


def still(
    rotors: Rotors, commands: Mapping[str, float], flow: Array | None = None
) -> dict[str, Array]:
    """Return channels (n,) in flows (3, n) [m/s], still air without, without rotation."""
    u, v, w = np.zeros((3, 1)) if flow is None else flow
    point = {n: np.full(len(u), x) for n, x in neutral_point(rotors.database).items()}
    point |= {n: np.zeros(len(u)) for n in _STILL}
    point |= {"rho": np.full(len(u), rotors.rho)} | _flow(u, v, w)
    point["qbar"] = 0.5 * rotors.rho * point["V"] ** 2
    return point | {name: np.full(len(u), value) for name, value in commands.items()}


def project_motors(
    database: AeroDatabase,
    flown: tuple[str, Mapping[str, Array]] | None = None,
    lag_of: Callable[[str], float | None] = lambda _name: None,
) -> MotorModel:
    """Return the motors of a database with rotors. Their constants are those in still air, at the
    middle of the commands.

    flown : a flight's name and its channels, each (n,) [SI], which differences are over; a grid of
        flow without. lag_of : name of a rotor's command -> its lag [s], None if not known.

    Raises InputError for a rotor that tilts, has no thrust in still air or stands there.
    """
    rotors = rotors_in(database, flown, "Gazebo's motor model")
    motors = []
    for name, entry in rotors.entries.items():
        axis = rotors.axis(name)
        across = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
        across /= np.linalg.norm(across)
        flows = np.column_stack([0.0 * across, across])
        state = still(rotors, rotors.point, flows)
        force, moment = rotors.about_itself(name, state)
        turning = _TURN * float(speeds_of(rotors.database, [name], state)[name][0])
        pull = float(force[:, 0] @ axis)
        if not (pull > 0.0 and turning != 0.0):
            raise InputError(
                f"{pull:.3g} N of thrust in still air at the middle of its commands",
                f"part {name}",
                "the motor model needs thrust there; export the version as jsbsim or daveml",
            )
        motors.append(
            Motor(
                name,
                entry.position,
                (float(axis[0]), float(axis[1]), float(axis[2])),
                entry.turns,
                thrust=pull / turning**2,
                moment=-entry.turns * float(moment[:, 0] @ axis) / pull + 0.0,
                drag=-float((force[:, 1] - force[:, 0]) @ across) / abs(turning) + 0.0,
                roll=-float((moment[:, 1] - moment[:, 0]) @ across) / abs(turning) + 0.0,
                fastest=max(abs(turning), _TURN * rotors.fastest(name)),
                lag=lag_of(rotors.command(name).removeprefix("command_")),
            )
        )
    model = motor_database(motors, rotors.database.name, rotors.database.reference)
    largest, held = compared(
        rotors,
        model,
        lambda turning: shares_of(motors, turning),
        "the plugins",
        "beyond the square of speed",
    )
    notes = [
        f"constants are of still air at {rotors.rho:.4g} kg/m^3; the plugin has no density and no"
        " advance ratio",
        *held,
    ]
    if any(each.lag is None for each in motors):
        notes.append(
            "time constants are left to Gazebo; state `lag` of the rotors in the vehicle file"
        )
    order = ", ".join(f"{k} is {each.name}" for k, each in enumerate(motors))
    notes.append(f"motor numbers, in the order of the commands: {order}")
    return MotorModel(tuple(motors), largest, tuple(notes))


def compared(
    rotors: Rotors,
    model: AeroDatabase,
    shares: Callable[[Mapping[str, Array]], Mapping[str, Array]],
    form: str,
    beyond: str,
) -> tuple[dict[str, float], list[str]]:
    """Return the largest differences of a model from the database by load axis [N, N m], and notes
    on them. shares : speeds of rotors [rev/s] (n,) -> inputs of the model. form, beyond : what it
    is in words, and what of its rotors it lacks.
    """
    database, channels = rotors.database, rotors.channels
    size = max(np.size(x) for x in channels.values())
    point = {n: np.full(size, x) for n, x in neutral_point(database).items()}
    point |= {n: np.zeros(size) for n in _STILL} | {"rho": np.full(size, rotors.rho)}
    point |= dict(channels)
    point["qbar"] = 0.5 * point["rho"] * point["V"] ** 2
    turned = shares(speeds_of(database, rotors.entries, point))
    held = loads_of(model, model.terms, {**point, **turned})
    parts = {name: part.get("kind", "") for name, part in database.parts.items()}
    groups = {name: [t for t in database.terms if t.part == name] for name in (*parts, "")}
    loads = {name: loads_of(database, terms, point) for name, terms in groups.items() if terms}
    own = sum((loads.pop(n) for n, kind in parts.items() if kind == "rotor"), np.zeros_like(held))
    total = reduce(np.add, loads.values(), own) - held
    notes = [
        f"what {form} cannot hold over {rotors.over}: {_size(total)}",
        f"of it the rotors' thrust and torque {beyond}: {_size(own - held)}",
    ]
    for name, each in loads.items():
        what = f"the {parts[name]} {name}" if name else "coefficients and increments"
        notes.append(f"of it {what}, which {form} do not hold: {_size(each)}")
    largest = {axis: float(np.max(np.abs(row))) for axis, row in zip(LOAD_AXES, total, strict=True)}
    return largest, notes


def _command(database: AeroDatabase, name: str) -> str:
    used = [n for n in database.variables[f"{name}_n"].expression.names if is_command(n)]
    return used[0] if len(used) == 1 else ""


def _natural(text: str) -> list[tuple[int, str]]:
    """A key that sorts numbers within texts by their values."""
    return [(int(x), "") if x.isdigit() else (-1, x) for x in re.split(r"([0-9]+)", text)]


def _size(loads: Array) -> str:
    """The largest force and moment of loads (6, n), in words."""
    force, moment = (float(np.max(np.linalg.norm(each, axis=0))) for each in (loads[:3], loads[3:]))
    return f"{force:.3g} N, {moment:.3g} N m"


def _grid(ranges: Mapping[str, tuple[float, float]]) -> tuple[str, dict[str, Array]]:
    """Commands together from half to full, in flow from each side."""
    sides = [s * e for e in np.eye(3) for s in (1.0, -1.0)]
    rows = [(share, speed * side) for share in _SHARES for speed in _FLOWS for side in sides]
    u, v, w = np.array([flow for _, flow in rows]).T
    share = np.array([share for share, _ in rows])
    channels = {name: low + share * (high - low) for name, (low, high) in ranges.items()}
    over = f"commands of {_SHARES[0]:g} to 1 of their range, each side's flow to {_FLOWS[-1]:g} m/s"
    return over, {**channels, **_flow(u, v, w)}


def _flow(u: Array, v: Array, w: Array) -> dict[str, Array]:
    """Airspeed [m/s] and angles [rad] of velocities (n,) [m/s] along body axes."""
    return {
        "V": np.sqrt(u**2 + v**2 + w**2),
        "alpha": np.arctan2(w, u),
        "beta": np.arctan2(v, np.hypot(u, w)),
    }


def _values(
    database: AeroDatabase, trees: Iterable[Expression], channels: Mapping[str, Array]
) -> list[Array]:
    definitions = {name: variable.expression for name, variable in database.variables.items()}
    program = database.compiled(trees, definitions, {**database.tables, **database.scattered})
    values = program.run(database.resolved(program.inputs, channels)).values
    size = max(np.size(x) for x in channels.values())
    return [np.broadcast_to(each, (size,)) for each in values]


def speeds_of(
    database: AeroDatabase, names: Iterable[str], channels: Mapping[str, Array]
) -> dict[str, Array]:
    """Return rotor -> (n,) [rev/s] in channels (n,)."""
    names = list(names)
    trees = [database.variables[f"{name}_n"].expression for name in names]
    return dict(zip(names, _values(database, trees, channels), strict=True))


def loads_of(database: AeroDatabase, terms: Iterable[Term], channels: Mapping[str, Array]) -> Array:
    """Return loads (6, n) of terms [N, N m] about the database's moment reference."""
    terms = list(terms)
    loads = [t for t in terms if t.axis in LOAD_AXES]
    total = np.zeros((6, max(np.size(x) for x in channels.values())))
    for term, value in zip(
        loads, _values(database, [t.expression for t in loads], channels), strict=True
    ):
        total[LOAD_AXES.index(term.axis)] += value
    if len(loads) < len(terms):
        rest = replace(database, terms=tuple(t for t in terms if t not in loads), parts={})
        reference = database.reference
        lengths = (1.0, 1.0, 1.0, reference.span, reference.chord, reference.span)
        found = rest.predict(channels).coefficients
        for k, axis in enumerate(AXES):
            total[k] += found[axis] * channels["qbar"] * reference.area * lengths[k]
    return total
