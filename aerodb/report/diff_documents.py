"""The JSON of a diff of two versions: changed terms, and changes at table nodes."""

from typing import Any

import numpy as np

from aerodb.tables import DatabaseDiff, NodeChanges, TermChange


def diff_document(difference: DatabaseDiff) -> dict[str, Any]:
    """Convert a diff to JSON values.

    ``terms``, ``tables`` (new, gone, of another shape), ``nodes`` and ``not_addressable``. Each
    entry of ``nodes`` is one table and axis with the change, standard error, coverage and flights
    per node; its ``sources`` are groups of flights, to which nodes refer by position. Only nodes
    that change are listed; ``largest`` is the one that changes most.
    """
    return {
        "terms": [_term(entry) for entry in difference.terms],
        "tables": dict(difference.tables),
        "nodes": [_nodes(entry) for entry in difference.nodes],
        "not_addressable": dict(difference.not_addressable),
    }


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
    }


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
