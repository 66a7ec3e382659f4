"""Check cases of an export, and how JSBSim itself is brought to their conditions.

The caller provides JSBSim as its ``FGFDMExec`` with the exported aircraft loaded, so this module
does not depend on the package. JSBSim accepts speed, angles, rates, attitude, height, surfaces,
density and temperature as exact initial conditions; the rest of its state (the derivatives of alpha
and beta, calibrated airspeed, the centre of gravity) follows from them. Therefore the inputs are
read back after each run, and the database is evaluated at exactly the inputs that JSBSim had.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.jsbsim.metrics import read_number, read_root
from aerodb.exchange.jsbsim.properties import CHANNEL_PROPERTIES, FOOT, INCH, SLUG_PER_FT3
from aerodb.nomenclature import AXES, is_surface
from aerodb.support import Array
from aerodb.tables import (
    AeroDatabase,
    CheckCase,
    Expression,
    Name,
    ReferenceGeometry,
    TableCall,
    transfer_moments,
)

#: Required relative agreement, and the coefficient below which it is absolute.
TOLERANCE: Final = 1e-9
SMALLEST: Final = 1e-3

#: Inputs that JSBSim derives from others and that cannot be set.
DERIVED_INPUTS: Final = ("alphadot", "betadot", "calibrated_airspeed", "cg_x", "cg_y", "cg_z")
#: Inputs that initial conditions determine.
_STATE: Final = {
    *("V", "alpha", "beta", "mach", "rho", "qbar", "p", "q", "r"),
    *("altitude", "height_above_ground", "phi", "theta"),
    *DERIVED_INPUTS,
}

_RANGES: Final[dict[str, tuple[float, float]]] = {
    "alpha": (-0.25, 0.45),
    "beta": (-0.2, 0.2),
    "mach": (0.2, 0.9),
    "V": (60.0, 250.0),
    "rho": (0.4, 1.2),
    "qbar": (1000.0, 20000.0),
    "height_above_ground": (5.0, 300.0),
    "altitude": (400.0, 5000.0),
    **dict.fromkeys("pqr", (-0.5, 0.5)),
    **dict.fromkeys(("phi", "theta"), (-0.5, 0.5)),
}
_SURFACE_RANGE: Final = (-0.4, 0.4)
_OTHER_RANGE: Final = (0.0, 1.0)
_SOUND: Final = 340.0  # m/s; speeds are drawn so that the temperature occurs in the atmosphere
_LEAST_SPEED: Final = 1e-3  # m/s
_KELVIN: Final = 1.8  # degrees Rankine


@dataclass(frozen=True, eq=False)
class JsbsimRun:
    """Inputs and results of JSBSim.

    inputs, coefficients : (n,) by name; moments about the database's reference.
    """

    inputs: dict[str, Array]
    coefficients: dict[str, Array]


@dataclass(frozen=True)
class JsbsimAgreement:
    """Agreement of JSBSim with the database.

    errors : largest error per axis over ``max(|C|, 1e-3)``. reached : inputs that JSBSim had
    exactly as the cases state them. followed : the others.
    """

    cases: int
    errors: dict[str, float]
    reached: tuple[str, ...]
    followed: tuple[str, ...]

    @property
    def passed(self) -> bool:
        """Whether every axis agrees within `TOLERANCE`, of dimensionless coefficients."""
        return all(error <= TOLERANCE for error in self.errors.values())


def jsbsim_check_cases(database: AeroDatabase, n: int = 20, seed: int = 0) -> list[CheckCase]:
    """Return `n` random check cases; equal seeds give equal cases.

    They cover the breakpoints of the tables and a margin beyond. Speed, density, dynamic pressure
    and Mach number are consistent in each case. Points where a coefficient is not finite are left
    out, so that there may be fewer. Inputs are scalars in SI units.
    """
    rng = np.random.default_rng(seed)
    ranges = _ranges(database)
    drawn = {name: rng.uniform(*ranges[name], n) for name in sorted(ranges)}
    if "V" in drawn and "mach" in drawn:
        drawn["V"] = drawn["mach"] * _SOUND * rng.uniform(0.88, 1.0, n)
    if {"qbar", "rho"} <= drawn.keys():
        drawn["qbar"] = drawn["rho"] * drawn.setdefault("V", rng.uniform(*_RANGES["V"], n)) ** 2 / 2
    drawn |= {name: np.zeros(n) for name in DERIVED_INPUTS if name in drawn}
    predicted = database.predict(drawn).coefficients
    coefficients = {axis: np.broadcast_to(predicted[axis], n) for axis in AXES}
    return [
        CheckCase(
            {name: float(values[k]) for name, values in drawn.items()},
            {axis: float(coefficients[axis][k]) for axis in AXES},
        )
        for k in range(n)
        if all(np.isfinite(values[k]) for values in coefficients.values())
    ]


def read_jsbsim_cases(xml: bytes, name: str) -> tuple[CheckCase, ...]:
    """Return the check cases that an export wrote to a JSBSim file; empty if it has none. Inputs
    are in SI units, outputs dimensionless (`CheckCase`).

    name : shown in errors. Raises InputError for XML that cannot be read, or a case without one
    number per axis.
    """
    cases: list[CheckCase] = []
    for element in read_root(xml, name).iterfind("check_cases/case"):
        where = f"{name}: check case {len(cases) + 1}"
        given, found = (
            {e.get(key, ""): read_number(e.text or "", where) for e in element.iterfind(tag)}
            for tag, key in (("input", "name"), ("output", "axis"))
        )
        if set(found) != set(AXES):
            raise InputError("not one output per axis", where, "export the database again")
        cases.append(CheckCase(given, found))
    return tuple(cases)


def _ranges(database: AeroDatabase) -> dict[str, tuple[float, float]]:
    """Range from which each input is drawn.

    It is that of the breakpoints of tables over this input, otherwise a usual range.
    """
    hulls: dict[str, tuple[float, float]] = {}
    trees = [term.expression for term in database.terms] + [
        variable.expression for variable in database.variables.values()
    ]
    for call in (each for tree in trees for each in _calls(tree)):
        if call.table not in database.tables:  # on scattered points, which no JSBSim table holds
            continue
        for argument, axis in zip(
            call.arguments, database.tables[call.table].breakpoints, strict=True
        ):
            if isinstance(argument, Name) and axis.size > 1:
                low, high = hulls.get(argument.name, (np.inf, -np.inf))
                hulls[argument.name] = (min(low, float(axis[0])), max(high, float(axis[-1])))
    for increment in database.increments:
        for name, interval in increment.envelope.items():
            low, high = hulls.get(name, (np.inf, -np.inf))
            hulls[name] = (
                min(low, interval.low - 3 * interval.cell),
                max(high, interval.high + 3 * interval.cell),
            )
    return {name: _range(name, hulls.get(name)) for name in database.inputs}


def _range(name: str, hull: tuple[float, float] | None) -> tuple[float, float]:
    """`hull` with a margin, as far as JSBSim can fly there; otherwise a usual range."""
    usual = _RANGES.get(name, _SURFACE_RANGE if is_surface(name) else _OTHER_RANGE)
    if hull is None:
        return usual
    margin = 0.0 if name in _POSITIVE else 0.1 * (hull[1] - hull[0])
    low, high = (
        max(hull[0] - margin, _LEAST.get(name, -np.inf)),
        min(hull[1] + margin, _MOST.get(name, np.inf)),
    )
    return (low, high) if low < high else usual


_POSITIVE: Final = ("V", "mach", "rho", "qbar")
_LEAST: Final = {
    "alpha": -1.5,
    "beta": -1.5,
    "mach": 0.05,
    "V": 10.0,
    "rho": 0.01,
    "qbar": 10.0,
    "height_above_ground": 1.0,
}
_MOST: Final = {"alpha": 1.5, "beta": 1.5}


def _calls(tree: Expression) -> Iterable[TableCall]:
    pending = [tree]
    while pending:
        node = pending.pop()
        if isinstance(node, TableCall):
            yield node
        pending.extend(node.children)


def fly_cases(
    executive: Any,
    conditions: Sequence[Mapping[str, float]],
    properties: Mapping[str, tuple[str, float]],
    reference: ReferenceGeometry,
) -> JsbsimRun:
    """Bring `executive` to each of `conditions`; return inputs, forces and moments read back.

    executive : JSBSim's FGFDMExec with the aircraft loaded. conditions : inputs in SI; missing ones
    keep a usual value. properties : input -> property and scale, as `input_properties` returns
    them. Moments are transferred from JSBSim's centre of gravity to the moment reference of
    `reference`.

    Raises InputError if JSBSim has no positive dynamic pressure.
    """
    inputs: dict[str, list[float]] = {name: [] for name in properties}
    rows, centres = [], []
    for condition in conditions:
        _set(executive, condition, properties)
        executive.run_ic()
        for name, (path, scale) in properties.items():
            inputs[name].append(executive[path] * scale)
        rows.append(_coefficients(executive))
        x, y, z = (executive[f"inertia/cg-{axis}-in"] * INCH for axis in "xyz")
        centres.append((-x, y, -z))
    coefficients = {axis: np.array([row[k] for row in rows]) for k, axis in enumerate(AXES)}
    moved = transfer_moments(coefficients, np.array(centres), reference.moment_reference, reference)
    return JsbsimRun({name: np.array(values) for name, values in inputs.items()}, moved)


def _coefficients(executive: Any) -> list[float]:
    force = executive["aero/qbar-psf"] * executive["metrics/Sw-sqft"]
    if not (np.isfinite(force) and force > 0):
        raise InputError(
            f"JSBSim has a dynamic pressure of {executive['aero/qbar-psf']} psf", "check case"
        )
    lengths = [executive[f"metrics/{name}"] for name in ("bw-ft", "cbarw-ft", "bw-ft")]
    forces = [executive[f"forces/fb{axis}-aero-lbs"] / force for axis in "xyz"]
    moments = [
        executive[f"moments/{axis}-aero-lbsft"] / force / length
        for axis, length in zip("lmn", lengths, strict=True)
    ]
    return forces + moments


def _set(
    executive: Any, condition: Mapping[str, float], properties: Mapping[str, tuple[str, float]]
) -> None:
    """Set initial conditions and properties of one case.

    There are no coefficients at rest: such a case gets a very low speed.
    """
    speed = max(
        condition.get("V", _SOUND * condition["mach"] if "mach" in condition else 100.0),
        _LEAST_SPEED,
    )
    mach = max(condition.get("mach", speed / _SOUND), _LEAST_SPEED / _SOUND)
    density = condition.get("rho", 2 * condition["qbar"] / speed**2 if "qbar" in condition else 1.0)
    height = condition.get("height_above_ground", 1000.0)
    altitude = condition.get("altitude", height)
    # JSBSim changes angles one after another: starting from the previous case, they could leave
    # their range.
    for name, value in (
        ("u-fps", speed / FOOT),
        ("v-fps", 0.0),
        ("w-fps", 0.0),
        ("phi-rad", 0.0),
        ("theta-rad", 0.0),
    ):
        executive[f"ic/{name}"] = value
    executive["atmosphere/override/density"] = density / SLUG_PER_FT3
    executive["atmosphere/override/temperature"] = _temperature(executive, speed, mach)
    executive["ic/terrain-elevation-ft"] = (altitude - height) / FOOT
    executive["ic/h-sl-ft"] = altitude / FOOT
    executive["ic/vt-fps"] = speed / FOOT
    for angle in ("alpha", "beta", "phi", "theta"):
        executive[f"ic/{angle}-rad"] = condition.get(angle, 0.0)
    for rate in "pqr":
        executive[f"ic/{rate}-rad_sec"] = condition.get(rate, 0.0)
    for name, (path, scale) in properties.items():
        if name in condition and not (name in _STATE and CHANNEL_PROPERTIES[name][0] == path):
            executive[path] = condition[name] / scale


def _temperature(executive: Any, speed: float, mach: float) -> float:
    """Temperature [R] at which `speed` is `mach`.

    The speed of sound is proportional to its square root."""
    executive["atmosphere/override/temperature"] = 288.15 * _KELVIN
    executive.run_ic()
    sound = executive["atmosphere/a-fps"] * FOOT
    return float(executive["atmosphere/T-R"] * (speed / mach / sound) ** 2)


def check_in_jsbsim(
    database: AeroDatabase,
    executive: Any,
    cases: Sequence[CheckCase],
    properties: Mapping[str, tuple[str, float]],
) -> JsbsimAgreement:
    """Compare the coefficients of JSBSim with those of `database` at check cases, to `TOLERANCE`.

    The database is evaluated at the inputs that JSBSim had. Where these are the case's own, the
    stored coefficients of the case are used, so that a file is tested against the check cases it
    contains. Parameters as in `fly_cases`.

    Raises InputError if there are no cases.
    """
    if not cases:
        raise InputError("no check cases", f"database {database.name}")
    run = fly_cases(executive, [case.inputs for case in cases], properties, database.reference)
    wanted = {
        name: np.array([case.inputs[name] for case in cases])
        for name in database.inputs
        if name in cases[0].inputs
    }
    reached = sorted(
        name
        for name, values in wanted.items()
        if np.allclose(run.inputs[name], values, rtol=1e-9, atol=1e-12)
    )
    followed = sorted(set(database.inputs) - set(reached))
    predicted = database.predict(run.inputs).coefficients
    errors = {}
    for axis in AXES:
        stored = np.array([case.coefficients[axis] for case in cases])
        expected = predicted[axis] if followed else stored
        errors[axis] = float(
            np.max(
                np.abs(run.coefficients[axis] - expected) / np.maximum(np.abs(expected), SMALLEST)
            )
        )
    return JsbsimAgreement(len(cases), errors, tuple(reached), tuple(followed))
