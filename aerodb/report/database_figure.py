"""The figure of one database: each coefficient over angle of attack or sideslip."""

from typing import Any, Final

import numpy as np
from matplotlib.figure import Figure

from aerodb.nomenclature import AXES, axis_quantity
from aerodb.report.labels import channel_scale
from aerodb.report.style import DATABASE, PAGE_WIDTH, SMALLEST, panel_grid, plain_panel
from aerodb.support import Array
from aerodb.tables import AeroDatabase, breakpoints_over, neutral_point, vary

#: Variable over which a coefficient is drawn, and its range [rad] where no table gives one.
_OVER: Final = {axis: "alpha" if axis in ("CX", "CZ", "Cm") else "beta" for axis in AXES}
_USUAL: Final = {
    "alpha": (np.deg2rad(-5.0), np.deg2rad(15.0)),
    "beta": (np.deg2rad(-10.0), np.deg2rad(10.0)),
}
_POINTS: Final = 161


def database_figure(database: AeroDatabase) -> Figure:
    """Draw one panel per body axis, all other inputs neutral: coefficients [-] against alpha or
    beta [deg] (`channel_scale`); dots are the tables' breakpoints."""
    figure, panels = panel_grid((PAGE_WIDTH, 6.2), 3, 2, left=0.85, between=(0.85, 0.7))
    order = ("CX", "CY", "CZ", "Cl", "Cm", "Cn")
    for panel, axis in zip(panels.ravel(), order, strict=True):
        _curve(panel, axis, _OVER[axis], database)
    return figure


def _curve(panel: Any, axis: str, variable: str, database: AeroDatabase) -> None:
    factor, label = channel_scale(variable)
    marks, at = _points(variable, database)
    point = neutral_point(database, database.increments)
    for where, look in ((at, {"lw": 1.4}), (marks, {"ls": "", "marker": "o", "ms": 3.5})):
        values = database.predict(vary(point, {variable: where})).coefficients[axis]
        panel.plot(factor * where, values, color=DATABASE, **look)
    plain_panel(panel)
    panel.set_title(axis_quantity(axis), fontsize=SMALLEST, loc="left", color="0.35")
    panel.set_xlabel(label)
    panel.set_ylabel(f"{axis} [-]")


def _points(variable: str, database: AeroDatabase) -> tuple[Array, Array]:
    """Breakpoints over the variable, and the sample points of a curve through all of them."""
    known = breakpoints_over(variable, database)
    marks = np.unique(np.concatenate(known)) if known else np.empty(0)
    low, high = (float(marks[0]), float(marks[-1])) if len(marks) > 1 else _USUAL[variable]
    return marks, np.unique(np.concatenate([marks, np.linspace(low, high, _POINTS)]))
