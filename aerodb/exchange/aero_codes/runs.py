"""Runs of an aerodynamic code: totals and derivatives about a point, made a database.

One run becomes handbook derivatives about its point. Several runs become tables over alpha (and
Mach, and sideslip where runs vary it on its own): the totals give the curves, so that the
derivatives by these are not needed, and every other derivative is a table too.

Forces are lift, drag and the body's side force, as these codes give them: their drag lies in the
plane of symmetry. `C_drag` lies along the airflow and pushes a sideslipping aircraft sideways;
a term on CY takes that off, so that CY is the code's.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.support import Array
from aerodb.tables import (
    LIFT_INCREMENTS,
    AeroDatabase,
    ReferenceGeometry,
    Table,
    Term,
    Variable,
    parse,
)

#: Axes of totals and derivatives: lift and drag in the plane of symmetry, the others on body axes.
RUN_AXES: Final = ("C_lift", "C_drag", "CY", "Cl", "Cm", "Cn")
#: Motion that derivatives are by: rad, or rates without dimension (docs/reference/conventions.md).
MOTION: Final = ("alpha", "beta", "p_hat", "q_hat", "r_hat", "alphadot_hat")
#: Difference of two conditions that are the same [rad or Mach]: the last digit of printed degrees.
_SAME: Final = 1e-7


@dataclass(frozen=True)
class Run:
    """A run about one point.

    Parameters
    ----------
    where : file and line of its beginning.
    mach : Mach number.
    totals : axis of `RUN_AXES` -> coefficient at the point.
    slopes : axis -> regressor (of `MOTION`, or a control) -> derivative, per rad, per unit of the
        rate without dimension, or per unit of the control in the file.
    state : regressor -> value at the point, in the same units.
    induced : factor of lift squared in the drag, where the code states it; else None.
    """

    where: str
    mach: float
    totals: Mapping[str, float]
    slopes: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    state: Mapping[str, float] = field(default_factory=dict)
    induced: float | None = None

    def without(self, axis: str, names: Sequence[str]) -> float:
        """The coefficient on `axis` where `names` are zero, by the derivatives."""
        slopes = self.slopes.get(axis, {})
        return self.totals[axis] - sum(slopes.get(n, 0.0) * self.state.get(n, 0.0) for n in names)


def database_of_runs(
    runs: Sequence[Run],
    name: str,
    reference: ReferenceGeometry,
    controls: Mapping[str, Variable],
    source: str,
    notes: Sequence[str] = (),
) -> AeroDatabase:
    """Return the database of `runs`, all about the same reference.

    controls : regressor of the runs -> its variable. Raises InputError for runs that fill no grid
    of alpha, sideslip and Mach, and for one run without derivatives.
    """
    if len(runs) == 1:
        return _linear(runs[0], name, reference, controls, source, notes)
    return _tables(runs, name, reference, controls, source, notes)


def _linear(
    run: Run,
    name: str,
    reference: ReferenceGeometry,
    controls: Mapping[str, Variable],
    source: str,
    notes: Sequence[str],
) -> AeroDatabase:
    if "alpha" not in run.slopes.get("C_lift", {}):
        raise InputError(
            "one run without derivatives",
            run.where,
            "add its derivatives, or runs at further angles of attack",
        )
    names = (*MOTION, *controls)
    terms: list[Term] = []
    sums: dict[str, str] = {}
    for axis in RUN_AXES:
        if axis not in run.totals:
            continue
        slopes = {n: run.slopes.get(axis, {}).get(n, 0.0) for n in names}
        parts = [(f"{axis}_0", _number(run.without(axis, names)))]
        parts += [(f"{axis}_{n}", f"{_number(value)}*{n}") for n, value in slopes.items() if value]
        if axis == "C_drag" and run.induced is not None:
            lift = run.totals["C_lift"]
            parts = [
                ("C_drag_0", _number(run.totals[axis] - run.induced * lift**2)),
                ("C_drag_induced", f"{run.induced!r}*(lift + {LIFT_INCREMENTS})^2"),
            ]
        parts = [(n, text) for n, text in parts if text != "0.0" or n == "C_drag_0"]
        terms += [Term(n, axis, parse(text)) for n, text in parts]
        sums[axis] = " + ".join(f"({text})" for _, text in parts) or "0"
    variables = {**_used(controls, sums), "lift": Variable(parse(sums["C_lift"]), "1", "lift")}
    return _finished(terms, variables, {}, sums, name, reference, source, notes)


def _tables(
    runs: Sequence[Run],
    name: str,
    reference: ReferenceGeometry,
    controls: Mapping[str, Variable],
    source: str,
    notes: Sequence[str],
) -> AeroDatabase:
    over, ordered = _grid(runs)
    if "beta" in over:
        ordered = [_along_airflow(run) for run in ordered]
    shape = tuple(len(axis) for axis in over.values())
    tables: dict[str, Table] = {}
    terms: list[Term] = []
    sums: dict[str, str] = {}
    others = [each for each in (*MOTION, *controls) if each not in over]
    for axis in RUN_AXES:
        if not all(axis in run.totals for run in runs):
            continue
        parts = {f"{axis}_0": ([run.without(axis, others) for run in ordered], "")}
        for each in others:
            parts[f"{axis}_{each}"] = (
                [run.slopes.get(axis, {}).get(each, 0.0) for run in ordered],
                f"*{each}",
            )
        written = []
        for label, (values, factor) in parts.items():
            if not any(values):
                continue
            text = _number(values[0])
            if len(set(values)) > 1:
                grid = np.reshape(values, shape)
                tables[label] = Table(label, tuple(over), tuple(over.values()), grid)
                text = f"{label}({', '.join(over)})"
            terms.append(
                Term(f"{label}_term" if label in tables else label, axis, parse(text + factor))
            )
            written.append(text + factor)
        sums[axis] = " + ".join(written) or "0"
    return _finished(terms, _used(controls, sums), tables, sums, name, reference, source, notes)


def _along_airflow(run: Run) -> Run:
    """A run with sideslip whose drag in the plane of symmetry is that part of `C_drag`."""
    share = math.cos(run.state["beta"])
    totals = {**run.totals, "C_drag": run.totals["C_drag"] / share}
    drags = {name: value / share for name, value in run.slopes.get("C_drag", {}).items()}
    return replace(run, totals=totals, slopes={**run.slopes, "C_drag": drags})


def _grid(runs: Sequence[Run]) -> tuple[dict[str, Array], list[Run]]:
    """The axes of a grid of runs, alpha first, and the runs in its order. Sideslip is an axis where
    runs differ in nothing else; else its derivatives take it to zero."""
    every = {
        "alpha": [run.state["alpha"] for run in runs],
        "beta": [run.state.get("beta", 0.0) for run in runs],
        "mach": [run.mach for run in runs],
    }
    places = {
        name: [_place(distinct(values), value) for value in values]
        for name, values in every.items()
    }
    without = set(zip(places["alpha"], places["mach"], strict=True))
    used = [n for n in every if n != "beta" or len(without) < len(runs)]
    nodes: dict[tuple[int, ...], Run] = {}
    for run, *node in zip(runs, *(places[name] for name in used), strict=True):
        if tuple(node) in nodes:
            raise InputError(
                "the same angle of attack, sideslip and Mach number as the run at"
                f" {nodes[tuple(node)].where}",
                run.where,
                "give one run per angle of attack, sideslip and Mach number",
            )
        nodes[tuple(node)] = run
    over = {name: distinct(every[name]) for name in used}
    counts = [len(axis) for axis in over.values()]
    if len(nodes) != math.prod(counts):
        words = {"alpha": "angles of attack", "beta": "sideslips", "mach": "Mach numbers"}
        grid = " by ".join(f"{n} {words[name]}" for name, n in zip(used, counts, strict=True))
        raise InputError(
            f"{len(nodes)} runs for a grid of {grid}",
            runs[0].where,
            "run every angle of attack at every sideslip and Mach number, or import one of these",
        )
    axes = {name: axis for name, axis in over.items() if name == "alpha" or len(axis) > 1}
    return axes, [nodes[node] for node in sorted(nodes)]


def _finished(
    terms: list[Term],
    variables: Mapping[str, Variable],
    tables: Mapping[str, Table],
    sums: Mapping[str, str],
    name: str,
    reference: ReferenceGeometry,
    source: str,
    notes: Sequence[str],
) -> AeroDatabase:
    """The database, with the share of the drag taken off CY."""
    used = dict(variables)
    if "C_drag" in sums and "CY" in sums:
        used["drag"] = Variable(parse(sums["C_drag"]), "1", "drag in the plane of symmetry")
        terms = [*terms, Term("CY_of_drag", "CY", parse("drag*sin(beta)"), "CY without the drag")]
    reached = set().union(*(term.expression.names for term in terms))
    reached |= set().union(*(used[n].expression.names for n in ("drag",) if n in used))
    if "lift" not in reached:
        used.pop("lift", None)
    return AeroDatabase(
        name,
        reference,
        used,
        tables,
        tuple(terms),
        source=source,
        description="\n".join(notes),
    )


def _used(controls: Mapping[str, Variable], sums: Mapping[str, str]) -> dict[str, Variable]:
    names = set().union(*(parse(text).names for text in sums.values()))
    return {name: variable for name, variable in controls.items() if name in names}


def distinct(values: Sequence[float]) -> Array:
    """Return the sorted values (n,) that differ by more than printed digits do."""
    ordered = np.unique(np.asarray(values, dtype=np.float64))
    return ordered[np.concatenate(([True], np.diff(ordered) > _SAME))] if len(ordered) else ordered


def _place(axis: Array, value: float) -> int:
    return int(np.argmin(np.abs(axis - value)))


def _number(value: float) -> str:
    return repr(float(value) + 0.0)


def body_moments(roll: float, yaw: float, alpha: float) -> tuple[float, float]:
    """Return Cl and Cn on body axes of moments about stability axes. alpha : [rad].

    >>> body_moments(1.0, 0.0, 0.0)
    (1.0, 0.0)
    """
    ca, sa = math.cos(alpha), math.sin(alpha)
    return ca * roll - sa * yaw, sa * roll + ca * yaw


def on_body_axes(run: Run) -> Run:
    """Return a run whose rolling and yawing moments and rates are about stability axes (``Cl'``,
    ``p'``), about body axes instead."""
    alpha = run.state["alpha"]
    ca, sa = math.cos(alpha), math.sin(alpha)
    roll, yaw = run.totals.get("Cl", 0.0), run.totals.get("Cn", 0.0)
    totals = dict(run.totals)
    totals["Cl"], totals["Cn"] = body_moments(roll, yaw, alpha)
    slopes = {axis: dict(by) for axis, by in run.slopes.items()}
    names = {n for axis in ("Cl", "Cn") for n in slopes.get(axis, {})}
    rolls, yaws = slopes.setdefault("Cl", {}), slopes.setdefault("Cn", {})
    for n in names:
        rolls[n], yaws[n] = body_moments(rolls.get(n, 0.0), yaws.get(n, 0.0), alpha)
    if "alpha" in names:
        rolls["alpha"] -= sa * roll + ca * yaw
        yaws["alpha"] += ca * roll - sa * yaw
    for by in slopes.values():
        p, r = by.get("p_hat", 0.0), by.get("r_hat", 0.0)
        by["p_hat"], by["r_hat"] = ca * p - sa * r, sa * p + ca * r
    state = dict(run.state)
    p, r = state.get("p_hat", 0.0), state.get("r_hat", 0.0)
    state["p_hat"], state["r_hat"] = ca * p - sa * r, sa * p + ca * r
    return replace(run, totals=totals, slopes=slopes, state=state)


def of_body_forces(
    totals: Mapping[str, float], slopes: Mapping[str, Mapping[str, float]], alpha: float
) -> tuple[dict[str, float], dict[str, dict[str, float]]]:
    """Return totals and slopes with CX and CZ as lift and drag in the plane of symmetry.

    alpha : [rad], of the point; the slopes by alpha turn with it.
    """
    ca, sa = math.cos(alpha), math.sin(alpha)
    x, z = totals["CX"], totals["CZ"]
    made = {axis: value for axis, value in totals.items() if axis not in ("CX", "CZ")}
    made["C_lift"], made["C_drag"] = x * sa - z * ca, -x * ca - z * sa
    turned = {axis: dict(by) for axis, by in slopes.items() if axis not in ("CX", "CZ")}
    names = {n for axis in ("CX", "CZ") for n in slopes.get(axis, {})}
    lifts, drags = turned.setdefault("C_lift", {}), turned.setdefault("C_drag", {})
    for n in names:
        dx, dz = slopes.get("CX", {}).get(n, 0.0), slopes.get("CZ", {}).get(n, 0.0)
        lifts[n], drags[n] = dx * sa - dz * ca, -dx * ca - dz * sa
    if "alpha" in names:
        lifts["alpha"] -= made["C_drag"]
        drags["alpha"] += made["C_lift"]
    return made, turned
