"""The JSON of a diff of two versions: changed terms, and changes at table nodes."""

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from aerodb.report.numbers import display_unit
from aerodb.report.terms import as_constant, term_name, term_unit
from aerodb.support import half_interval
from aerodb.tables import (
    HAT_RATES,
    AeroDatabase,
    DatabaseDiff,
    NodeChanges,
    Parameter,
    TermChange,
    Variable,
    changed_parameters,
    sigma_of,
    slice_over,
    slices,
    value_of,
)
from aerodb.units import SI

#: Most steps of a variable in a table across a terminal of 80 columns.
_MOST_STEPS: Final = 7
#: Round numbers from 1 to 10.
_ROUND: Final = (1.0, 2.0, 2.5, 4.0, 5.0, 8.0, 10.0)
#: A coefficient that is zero everywhere has no size to compare with.
_SMALLEST: Final = 1e-9


def diff_document(difference: DatabaseDiff) -> dict[str, Any]:
    """Convert a diff to JSON values.

    ``terms``, ``tables`` (new, gone, of another shape), ``nodes`` and ``not_addressable``;
    ``edited_tables`` and ``unchanged_tables`` count tables as they are stored. Each entry of
    ``terms`` that is a regressor of an increment has its name in words (``what``), its unit, its
    ``envelope`` (variable -> ``low``, ``high``, and ``gone_below``, ``gone_above``, where it has
    faded, null where it does not fade; SI) and its ``share`` of the axis (`TermChange`). Each entry
    of ``nodes`` is one table and axis with the change, standard error, coverage and flights
    per node; its ``sources`` are groups of flights, to which nodes refer by position. Only nodes
    that change are listed; ``largest`` is the one that changes most.
    """
    return {
        "terms": [_term(entry) for entry in difference.terms],
        "tables": dict(difference.tables),
        "nodes": [_nodes(entry) for entry in difference.nodes],
        "not_addressable": dict(difference.not_addressable),
        "edited_tables": list(difference.edited),
        "unchanged_tables": difference.kept,
    }


def parameter_changes(before: AeroDatabase, after: AeroDatabase) -> list[dict[str, Any]]:
    """Return the parameters whose value differs: name, unit, value before and after, and the
    standard error of the latter, in their units; None where it is not known."""
    return [
        {
            "name": name,
            "unit": after.variables[name].unit,
            "before": before.parameters[name],
            "after": after.parameters[name],
            "standard_error": sigma_of(after.variables[name].uncertainty),
        }
        for name in changed_parameters(before, after)
    ]


def parameter_row(name: str, variable: Variable) -> list[str]:
    """Return a parameter as a row of text: name, value and half of the 95 % interval of what is
    known, in its unit, the unit, bounds, and the number of flights that estimated it."""
    known, sigma = variable.parameter or Parameter(), sigma_of(variable.uncertainty)
    low, high = (f"{bound:g}" if np.isfinite(bound) else "" for bound in known.bounds)
    return [
        name,
        f"{value_of(variable.expression):.5g}",
        "" if sigma is None else f"{half_interval(sigma):.2g}",
        "" if variable.unit == "1" else variable.unit,
        f"{low} to {high}" if low or high else "",
        str(len(known.flights) or ""),
    ]


def faded_at(document: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return where the edits of a diff's document hold: an entry per range that flights have
    covered, with ``variable``, ``low``, ``high``, ``gone_below``, ``gone_above`` (SI; the last two
    null where nothing fades), and the ``axes`` that it limits."""
    axes: dict[tuple[Any, ...], list[str]] = {}
    for term in document["terms"]:
        for name, reach in term["envelope"].items() if term["change"] != 0.0 else ():
            of = axes.setdefault((name, *reach.values()), [])
            of += [term["axis"]] if term["axis"] not in of else []
    keys = ("variable", "low", "high", "gone_below", "gone_above")
    return [{**dict(zip(keys, each, strict=True)), "axes": of} for each, of in sorted(axes.items())]


def edits_of(document: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the ``terms`` of a diff's document that change, those with the largest share of their
    axis first. A constant that is counted the other way has its own sign."""
    changed = [_signed(term) for term in document["terms"] if term["change"] != 0.0]
    return sorted(changed, key=lambda term: -(term["share"] or 0.0))


def _signed(term: Mapping[str, Any]) -> Mapping[str, Any]:
    factor = as_constant(term["name"]) if term["kind"] == "increment" else None
    if factor is None:
        return term
    return {**term, "what": "constant", "change": factor * term["change"]}


def _term(entry: TermChange) -> dict[str, Any]:
    return {
        "kind": entry.kind,
        "name": entry.name,
        "axis": entry.axis,
        "before": entry.before,
        "after": entry.after,
        "change": entry.change,
        "sigma": entry.sigma,
        "flights": list(entry.flights),
        "what": term_name(entry.name) if entry.kind == "increment" else entry.name,
        "unit": term_unit(entry.name) if entry.kind == "increment" else entry.unit or None,
        "envelope": {
            name: {
                "low": each.low,
                "high": each.high,
                "gone_below": each.low - 2.0 * each.cell if entry.fades else None,
                "gone_above": each.high + 2.0 * each.cell if entry.fades else None,
            }
            for name, each in entry.envelope.items()
        },
        "share": entry.share,
    }


def curve_document(before: AeroDatabase, after: AeroDatabase) -> dict[str, Any] | None:
    """Return the slice on which two databases differ most for its axis, at round values of its
    variable; None where no slice differs. Dimensionless rates are left to the list of terms.

    ``axis``, ``variable``, ``unit`` (of `display_unit`) and ``factor`` to it, ``held`` (other
    inputs, SI), ``share`` (its largest change where flights have been, as a part of the largest
    coefficient before on any slice of the axis), and ``points`` with ``at`` (SI), ``before``,
    ``change``, ``sigma`` and ``inside_data``.
    """
    cuts = [cut for cut in slices(before, after) if cut.variable not in HAT_RATES]
    if not cuts:
        return None
    sizes = dict.fromkeys((cut.axis for cut in cuts), _SMALLEST)
    for cut in cuts:
        sizes[cut.axis] = max(sizes[cut.axis], float(np.max(np.abs(cut.before))))
    most = max(cuts, key=lambda cut: cut.largest / sizes[cut.axis])
    factor, unit = display_unit(most.variable, SI)
    low, high = factor * float(most.at[0]), factor * float(most.at[-1])
    step = _round_step((high - low) / _MOST_STEPS)
    values = step * np.arange(np.ceil(low / step), np.floor(high / step) + 1.0) + 0.0
    cut = slice_over(before, after, most.axis, most.variable, values / factor)
    columns = zip(
        cut.at.tolist(),
        cut.before.tolist(),
        cut.change.tolist(),
        cut.error.tolist(),
        cut.inside.tolist(),
        strict=True,
    )
    names = ("at", "before", "change", "sigma", "inside_data")
    return {
        "axis": cut.axis,
        "variable": cut.variable,
        "unit": unit,
        "factor": factor,
        "held": dict(cut.held),
        "share": most.largest / sizes[most.axis],
        "points": [dict(zip(names, point, strict=True)) for point in columns],
    }


def _round_step(least: float) -> float:
    """Return the smallest round number that is not below `least`.

    >>> [_round_step(least) for least in (0.013, 2.4, 4.5)]
    [0.02, 2.5, 5.0]
    """
    power = 10.0 ** math.floor(math.log10(least))
    return next(power * factor for factor in _ROUND if power * factor >= least)


def _nodes(entry: NodeChanges) -> dict[str, Any]:
    changed = np.flatnonzero((entry.change != 0.0).ravel())
    nodes = [_node(entry, int(k)) for k in changed]
    return {
        "table": entry.grid.table,
        "axis": entry.axis,
        "channels": list(entry.grid.channels),
        "sources": [list(flights) for flights in entry.sources],
        "unchanged": int(entry.change.size - changed.size),
        "largest": max(nodes, key=lambda node: abs(node["change"])),
        "nodes": nodes,
    }


def _node(entry: NodeChanges, k: int) -> dict[str, Any]:
    index = tuple(int(i) for i in np.unravel_index(k, entry.grid.shape))
    return {
        "index": list(index),
        "at": entry.grid.node(index),
        "change": float(entry.change[index]),
        "sigma": float(entry.sigma[index]),
        "inside_data": bool(entry.inside[index]),
        "sources": np.flatnonzero(entry.acting[:, k]).tolist(),
    }
