"""Models of simulators as databases, and databases as such models.

A model is a set of named numbers in a formula of the simulator (`sitl`, `gazebo`). Read, its
numbers become variables under their own names, and the formula terms. A database that is such a
model, and not corrected since, gives the same numbers when it is written. Of any other one, the
nearest model is written: its slopes at small angles. What flight has added to a model that was read
is added to its numbers.
"""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.native import to_document
from aerodb.support import Array
from aerodb.tables import (
    AeroDatabase,
    ReferenceGeometry,
    Term,
    Variable,
    neutral_point,
    number,
    value_of,
)

#: Angles of attack [rad] over which curves are taken as linear lift and a parabola of drag: those
#: that wings without stall share.
_ALPHAS: Final = np.deg2rad(np.linspace(-4.0, 8.0, 13))
#: Angle of attack [rad] at which slopes by everything else are taken: the middle of `_ALPHAS`.
_AT: Final = math.radians(2.0)
_STEP: Final = 1e-4  # rad, or of a rate without dimension: rounding leaves 1e-12 of a slope
#: Sideslip [rad] up to which a model is compared: what is linear in it holds as far.
_SIDESLIP: Final = math.radians(3.0)
#: Angles of attack [rad] at which the lift is searched for its largest value, and the stall that is
#: written where it has none up to the end of its tables.
_STALLS: Final = np.deg2rad(np.linspace(8.0, 30.0, 221))
#: Span efficiency that is written where drag does not grow with lift: no induced drag.
_NO_INDUCED: Final = 1e6
_BIND: Final = re.compile(r"bind:\s*(\w+)\s*=\s*(\S.*?)\s*$")


@dataclass(frozen=True)
class Model:
    """Numbers of a simulator's formula.

    numbers : by their names. reference : of the coefficients. controls : name in the file -> its
    variable, in the file's unit.
    """

    numbers: Mapping[str, float]
    reference: ReferenceGeometry
    controls: Mapping[str, Variable]

    @property
    def variables(self) -> dict[str, Variable]:
        """Numbers and controls as variables of a database."""
        fixed = {n: Variable(number(float(x)), "1") for n, x in self.numbers.items()}
        return {**fixed, **self.controls}


@dataclass(frozen=True)
class Slopes:
    """What a formula of derivatives has of a database.

    polar : lift at zero alpha, its slope [1/rad], drag at zero lift, and factor of lift squared.
    stall : [rad]. pitch : Cm at zero alpha, and its slope [1/rad]. by : (axis, input) ->
    derivative, per rad or unit, at `_AT`; the input "1" is the value at zero sideslip and rates.
    """

    polar: tuple[float, float, float, float]
    stall: float
    pitch: tuple[float, float]
    by: Mapping[tuple[str, str], float]


Builder = Callable[[Model, str], AeroDatabase]


def stated_answers(text: str) -> dict[str, str]:
    """Return what comments of a written file say about its inputs: name -> expression.

    >>> stated_answers("# bind: elevator = -delta_elevator/0.3")
    {'elevator': '-delta_elevator/0.3'}
    """
    found = (_BIND.search(line.removesuffix("-->").rstrip()) for line in text.splitlines())
    return {match[1]: match[2] for match in found if match}


def bind_lines(model: Model) -> list[str]:
    """Return the lines that tell a reader what the inputs and the moment point are (SI)."""
    point = zip(("x_ref", "y_ref", "z_ref"), model.reference.moment_reference, strict=True)
    return [
        *(f"bind: {n} = {variable.expression}" for n, variable in model.controls.items()),
        *(f"bind: {n} = {at!r}" for n, at in point),
    ]


def model_in(database: AeroDatabase, names: Sequence[str], build: Builder) -> Model | None:
    """Return the model that a database without its increments is, to the last digit; None where it
    is none. names : of the numbers that do not belong to a control."""
    if not all(n in database.variables for n in names):
        return None
    values = {n: value_of(v.expression) for n, v in database.variables.items()}
    numbers = {n: x for n, x in values.items() if math.isfinite(x)}
    controls = {n: v for n, v in database.variables.items() if CONTROL in v.declared}
    if not all(n in numbers for n in names):
        return None
    model = Model(
        {n: x for n, x in numbers.items() if n not in controls}, database.reference, controls
    )
    try:
        same = build(model, database.name)
    except (InputError, KeyError):
        return None
    plain = to_document(replace(database, increments=()))
    return model if all(to_document(same)[k] == plain[k] for k in _SAME) else None


#: What the variable of a control declares: its name in the file; and keys that make a model.
CONTROL: Final = "control"
_SAME: Final = ("terms", "tables", "variables", "free_inputs")


def slopes_of(database: AeroDatabase) -> Slopes:
    """Return the slopes of a database, with everything else zero; see `Slopes`.

    Raises InputError where it has no finite value there.
    """
    curves = _at(database, {"alpha": _ALPHAS})
    lift = np.polynomial.polynomial.polyfit(_ALPHAS, curves["C_lift"], 1)
    drag = np.polynomial.polynomial.polyfit(curves["C_lift"] ** 2, curves["C_drag"], 1)
    pitch = np.polynomial.polynomial.polyfit(_ALPHAS, curves["Cm"], 1)
    high = _at(database, {"alpha": _STALLS})["C_lift"]
    top = int(np.argmax(high))
    by = {}
    for name in inputs_of(database):
        pair = _at(database, {name: np.array([-_STEP, _STEP]), "alpha": np.full(2, _AT)})
        for axis, values in pair.items():
            by[axis, name] = float(values[1] - values[0]) / (2.0 * _STEP)
    for axis, values in _at(database, {"alpha": np.array([_AT])}).items():
        by[axis, "1"] = float(values[0])
    held = 0 < top < len(high) - 1
    return Slopes(
        (float(lift[0]), float(lift[1]), float(drag[0]), float(drag[1])),
        float(_STALLS[top] if held else _STALLS[-1]),
        (float(pitch[0]), float(pitch[1])),
        by,
    )


def inputs_of(database: AeroDatabase) -> tuple[str, ...]:
    """Return what slopes are by: sideslip, rates without dimension, and deflections."""
    deflections = [n for n in database.inputs if n.startswith("delta_")]
    return ("beta", "p_hat", "q_hat", "r_hat", *deflections)


def _at(database: AeroDatabase, given: Mapping[str, Array]) -> dict[str, Array]:
    """Lift and drag in the plane of symmetry, CY, moments and hinge moments, at airspeed 1 m/s."""
    size = len(next(iter(given.values())))
    point = {n: np.full(size, x) for n, x in neutral_point(database).items()}
    point |= {n: np.zeros(size) for n in ("alpha", "beta")}
    lengths = {"p": database.reference.span, "q": database.reference.chord}
    lengths["r"] = database.reference.span
    point |= {n: np.asarray(x, dtype=np.float64) for n, x in given.items()}
    point["V"] = np.ones(size)
    for rate, length in lengths.items():
        point[rate] = point.get(f"{rate}_hat", np.zeros(size)) * 2.0 / length
    values = database.predict(point).coefficients
    if not all(np.all(np.isfinite(x)) for x in values.values()):
        raise InputError(
            "no finite coefficient at small angles",
            f"database {database.name}",
            "choose another format",
        )
    ca, sa = np.cos(point["alpha"]), np.sin(point["alpha"])
    return {
        "C_lift": values["CX"] * sa - values["CZ"] * ca,
        "C_drag": -values["CX"] * ca - values["CZ"] * sa,
        **{axis: values[axis] for axis in database.axes if axis not in ("CX", "CZ")},
    }


def per_unit(control: Variable) -> tuple[str, float]:
    """Return the channel of a control, and how much of it [SI] is one unit of the control; '' and
    0 where it is made of none, or of several."""
    names = sorted(control.expression.names)
    if len(names) != 1:
        return "", 0.0
    alone = AeroDatabase(
        "control",
        ReferenceGeometry(1.0, 1.0, 1.0, (0.0, 0.0, 0.0)),
        terms=(Term("c", "Cm", control.expression),),
    )
    low, high = alone.predict({names[0]: np.array([0.0, 1.0])}).coefficients["Cm"]
    return (names[0], float(1.0 / (high - low))) if high != low else ("", 0.0)


def differences(database: AeroDatabase, model: AeroDatabase) -> dict[str, float]:
    """Return what a model cannot hold of a database: axis -> largest difference over `_ALPHAS` and
    sideslip up to `_SIDESLIP`, everything else zero."""
    alpha, beta = (x.ravel() for x in np.meshgrid(_ALPHAS, (-_SIDESLIP, 0.0, _SIDESLIP)))
    before, after = (_at(each, {"alpha": alpha, "beta": beta}) for each in (database, model))
    return {axis: float(np.max(np.abs(x - after.get(axis, 0.0)))) for axis, x in before.items()}


def efficiency(factor: float, aspect: float) -> float:
    """Return the span efficiency of a factor of lift squared; no induced drag where it is not
    positive."""
    return 1.0 / (math.pi * aspect * factor) if factor > 1e-6 else _NO_INDUCED


def induced(model: Model, name: str, aspect: float) -> float:
    """Return the factor of lift squared of a model, whose span efficiency is `name`."""
    return 1.0 / (math.pi * aspect * model.numbers[name])


def by_difference(full: Slopes, plain: Slopes) -> Slopes:
    """Return what increments add: the slopes with them less those without; the stall stays."""
    return Slopes(
        (
            full.polar[0] - plain.polar[0],
            full.polar[1] - plain.polar[1],
            full.polar[2] - plain.polar[2],
            full.polar[3] - plain.polar[3],
        ),
        plain.stall,
        (full.pitch[0] - plain.pitch[0], full.pitch[1] - plain.pitch[1]),
        {key: value - plain.by.get(key, 0.0) for key, value in full.by.items()},
    )
