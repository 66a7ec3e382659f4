"""Sideslip table with the wrong symmetry or sign: the column is the table itself.

Reversing sideslip reverses CY, Cl and Cn of a symmetric aircraft and leaves CX, CZ and Cm
unchanged. For a table that violates this, the model is ``C += k T_wrong`` with the part of wrong
symmetry, on the lateral axes ``T_wrong(beta) = (T(beta) + T(-beta))/2``; k = -1 removes it, and
`beta_slope` restores the slope that a lost sign took away. For a table that complies, the model is
``C += k T``, and k = -2 reverses its sign. A table times a lateral control has the other symmetry,
as the control is reversed too; of it only the sign is asked. Where the table is linear in beta near
zero, it is exactly aliased with `beta_even`.

Data needed: sideslip in both directions.

>>> from aerodb.tables.table import Table
>>> table = Table("Clb", ("beta",), (np.array([-0.1, 0.0, 0.1]),), np.array([0.04, 0.0, 0.04]))
>>> wrong_part(table, 0, odd=True)[1].tolist()
[0.0, 0.04]
"""

from dataclasses import dataclass

import numpy as np

from aerodb.effects.hypothesis import Hypothesis
from aerodb.effects.interpolation_terms import as_expression
from aerodb.effects.surfaces import role_of
from aerodb.effects.template import AXIS_WORDS, LibraryContext, Template, on_axis
from aerodb.nomenclature import CHANNELS, is_surface
from aerodb.support import Array
from aerodb.tables import (
    MAX_LENGTH,
    Call,
    Expression,
    LinearTable,
    Name,
    Table,
    linear_tables,
    number,
    times,
)

SOURCE = "DHC6.xml, table Clb, against the Twin Otter records"
#: Part of the wrong symmetry, relative to the table's largest value, below which a table counts as
#: right.
_RIGHT = 0.01


@dataclass(frozen=True)
class Defect:
    """What of a table may be wrong: the regressor, whether it is only a part (else all of it),
    where it acts."""

    site: LinearTable
    regressor: Expression
    part: bool


def wrong_part(table: Table, axis: int, odd: bool) -> tuple[Array, Array]:
    """Breakpoints >= 0 along `axis` and the part (in the table's shape over them) that should
    vanish.

    odd : whether the table should be odd along that axis; its even part is then wrong, else its odd
    part.
    """
    points = np.unique(np.abs(np.append(table.breakpoints[axis], 0.0)))
    axes = [*table.breakpoints]
    axes[axis] = points
    mesh = [grid.ravel() for grid in np.meshgrid(*axes, indexing="ij")]
    mirrored = [-grid if k == axis else grid for k, grid in enumerate(mesh)]
    sign = 1.0 if odd else -1.0
    values = 0.5 * (table.evaluate(*mesh) + sign * table.evaluate(*mirrored))
    return points, values.reshape([len(points) for points in axes])


def defects(context: LibraryContext) -> list[Defect]:
    """Return the tables with sideslip among their own arguments that enter a coefficient linearly,
    and what may be wrong with them."""
    listed = []
    for site in linear_tables(context.database):
        names = [channel.name if channel else None for channel in site.channels]
        table = context.database.tables[site.table]
        if (
            None in names
            or "beta" not in names
            or not _usable_factors(site)
            or {"p", "r"} & set(names)
        ):
            continue
        k = names.index("beta")
        behind = site.channels[k]
        if (
            behind is None
            or behind.offset != 0.0
            or table.breakpoints[k][0] >= 0
            or table.breakpoints[k][-1] <= 0
        ):
            continue  # given for one side only: its symmetry is in the argument
        lateral = sum(_is_lateral(factor, context) for factor in site.factors) % 2 == 1
        odd = (site.axis in ("CY", "Cl", "Cn", "C_side")) != lateral
        points, wrong = wrong_part(table, k, odd)
        part = bool(np.max(np.abs(wrong)) > _RIGHT * np.max(np.abs(table.values))) and not lateral
        regressor = _regressor(site, table, (k, points, wrong) if part and odd else None)
        if len(str(regressor)) <= MAX_LENGTH:
            listed.append(Defect(site, regressor, part))
    return listed


def _is_lateral(factor: Expression, context: LibraryContext) -> bool:
    """Return whether a factor is a deflection that the aircraft's mirror image has reversed."""
    if not isinstance(factor, Name) or not is_surface(factor.name):
        return False
    opposed = {surface.channel for surface in context.surfaces if surface.opposed}
    return factor.name in opposed or role_of(factor.name) in ("roll", "yaw")


def _usable_factors(site: LinearTable) -> bool:
    """Return whether the factor of the table is even in sideslip and made of channels alone."""
    names = frozenset[str]().union(*(factor.names for factor in site.factors))
    channels = all(name in CHANNELS or is_surface(name) for name in names)
    return (
        channels
        and not any(factor.tables for factor in site.factors)
        and not names & {"beta", "p", "r", "betadot"}
    )


def _regressor(
    site: LinearTable, table: Table, even: tuple[int, Array, Array] | None
) -> Expression:
    """The table (or its even part along one axis) with its factors, over channels."""
    arguments, axes, values = [], [], table.values if even is None else even[2]
    for k, behind in enumerate(site.channels):
        assert behind is not None
        points = table.breakpoints[k] if even is None or k != even[0] else even[1]
        inner: Expression = Name(behind.name)
        scaled = behind.channel(points)
        if even is not None and k == even[0]:
            inner, scaled = Call("abs", (inner,)), np.abs(scaled)
        if scaled.size > 1 and scaled[0] > scaled[-1]:
            scaled, values = scaled[::-1], np.flip(values, k)
        arguments.append(inner)
        axes.append(np.asarray(scaled))
    total = as_expression(arguments, axes, values)
    for factor in site.factors:
        total = times(factor, total)
    return total if site.constant == 1.0 else times(number(site.constant), total)


def _hypotheses(context: LibraryContext) -> list[Hypothesis]:
    return [_one(defect) for defect in defects(context)]


def _one(defect: Defect) -> Hypothesis:
    axis, table = defect.site.axis, defect.site.table
    fault = "a part that is the same for sideslip to either side" if defect.part else "a sign"
    return on_axis(
        "table_sign",
        axis,
        defect.regressor,
        unit="1",
        plausible=(-2.5, 0.5) if defect.part else (-2.5, -1.5),
        because=f"{AXIS_WORDS[axis]}: table {table} has {fault} that flight does not show",
        parameter=f"{axis}_{table}",
        subject=table,
        source=SOURCE,
    )


TEMPLATE = Template(
    "table_sign",
    "aerodynamic",
    "C += k*T, or k*T_wrong where its symmetry is wrong",
    SOURCE,
    _hypotheses,
)
