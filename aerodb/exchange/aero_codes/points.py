"""Points of a sweep, made tables: coefficients over whatever conditions vary.

Forces may be given along wind, stability or body axes; they are turned at each point, whose angles
are known, so that tables hold them exactly.
"""

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.aero_codes.runs import distinct
from aerodb.support import Array
from aerodb.tables import AeroDatabase, ReferenceGeometry, Table, Term, Variable, parse

#: Conditions in the order of a table's axes; controls follow.
_ORDER: Final = ("alpha", "beta", "mach")


def in_wind_axes(coefficients: Mapping[str, Array], beta: Array) -> dict[str, Array]:
    """Return lift, drag and the body's side force as forces along wind axes.

    coefficients : C_lift and C_drag in the plane of symmetry and CY, each (n,); others are kept.
    beta : (n,) [rad].

    >>> import numpy as np
    >>> flat = {"C_drag": np.array([0.1]), "CY": np.array([0.0]), "C_lift": np.array([1.0])}
    >>> sorted(in_wind_axes(flat, np.array([0.0])))
    ['C_drag', 'C_lift', 'C_side']
    """
    made = {axis: values for axis, values in coefficients.items() if axis != "CY"}
    drag, side = coefficients["C_drag"], coefficients.get("CY", np.zeros(len(beta)))
    made["C_drag"] = drag * np.cos(beta) - side * np.sin(beta)
    made["C_side"] = drag * np.sin(beta) + side * np.cos(beta)
    return made


def about_body_axes(coefficients: Mapping[str, Array], alpha: Array) -> dict[str, Array]:
    """Return rolling and yawing moments about stability axes as Cl and Cn about body axes, each
    (n,). alpha : (n,) [rad]."""
    zero = np.zeros(len(alpha))
    roll, yaw = coefficients.get("Cl", zero), coefficients.get("Cn", zero)
    ca, sa = np.cos(alpha), np.sin(alpha)
    return {**coefficients, "Cl": ca * roll - sa * yaw, "Cn": sa * roll + ca * yaw}


def database_of_points(
    where: str,
    name: str,
    conditions: Mapping[str, Array],
    coefficients: Mapping[str, Array],
    reference: ReferenceGeometry,
    source: str,
    notes: Sequence[str],
    controls: Mapping[str, Variable] | None = None,
) -> AeroDatabase:
    """Return the database of points that fill a grid.

    conditions : alpha, beta [rad], mach, and controls in the unit of the file, each (n,).
    coefficients : axis -> (n,). controls : name -> variable. Raises InputError where alpha does not
    vary, and where points are missing from the grid or repeated.
    """
    axes = {
        n: distinct(conditions[n].tolist()) for n in (*_ORDER, *(controls or {})) if n in conditions
    }
    over = {n: points for n, points in axes.items() if len(points) > 1}
    if "alpha" not in over:
        raise InputError("the angle of attack does not vary", where, "give a sweep over it")
    shape = tuple(map(len, over.values()))
    place = np.ravel_multi_index(
        [np.argmin(np.abs(conditions[n][:, None] - points), axis=1) for n, points in over.items()],
        shape,
    )
    count, size = np.unique(place).size, int(np.prod(shape))
    grid = " x ".join(f"{len(points)} {n}" for n, points in over.items())
    if count != len(place):
        raise InputError(
            f"{len(place) - count} points stand twice in the grid of {grid}",
            where,
            "give each combination once, or import the sweeps that differ in something else alone",
        )
    if count != size:
        raise InputError(
            f"{count} points for a grid of {grid}",
            where,
            "give each combination, or import a sweep over alpha alone",
        )
    tables, terms = {}, []
    for axis, values in coefficients.items():
        if not np.any(values != 0.0):
            continue
        label, ordered = f"{axis}_table", np.empty(size)
        ordered[place] = values
        tables[label] = Table(label, tuple(over), tuple(over.values()), ordered.reshape(shape))
        terms.append(Term(axis, axis, parse(f"{label}({', '.join(over)})")))
    fixed = [
        f"{n} = {np.rad2deg(x[0]):g} deg" if n in ("alpha", "beta") else f"{n} = {x[0]:g}"
        for n, x in axes.items()
        if n not in over and x[0] != 0.0
    ]
    told = [*notes, *([f"throughout {', '.join(fixed)}"] if fixed else [])]
    used = {n: variable for n, variable in (controls or {}).items() if n in over}
    return AeroDatabase(
        name, reference, used, tables, tuple(terms), source=source, description="\n".join(told)
    )
