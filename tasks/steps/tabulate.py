"""A version as tables over stated ranges: a version of its own that says its error."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from aerodb.tables import Tabulation, tabulate
from aerodb.tasks.steps.publish import add_version
from aerodb.tasks.workspace_access import access_workspace


def tabulate_version(
    version: str,
    *,
    workspace: str,
    run: str,
    over: Mapping[str, tuple[float, float, int]],
    at: Mapping[str, float],
) -> dict[str, Any]:
    """Make tables of a version (its id) and store them as a version that descends from it.

    over : input -> least and greatest value [SI] and number of nodes. at : values of other inputs.

    Returns a document: version, label, parent, over (input -> nodes), held (input -> value), rates,
    kept (terms), tables, nodes (of each table), points, errors (axis -> largest, rms, span, at).
    Raises InputError as `aerodb.tables.tabulate`.
    """
    access = access_workspace(workspace)
    row = access.catalogue.version_of_id(version)
    database = access.database(version)
    nodes = {name: np.linspace(low, high, count) for name, (low, high, count) in over.items()}
    made = tabulate(database, nodes, at)
    document = _document(made)
    settings = {
        "tabulated": {
            "over": {name: list(ends) for name, ends in over.items()},
            "at": dict(at),
        }
    }
    stored = add_version(
        access,
        made.database,
        row.vehicle,
        row.id,
        [row.id],
        settings,
        {"tabulated": document},
        [],
        run,
    )
    return {"version": stored.id, "label": stored.label, "parent": row.label, **document}


def _document(made: Tabulation) -> dict[str, Any]:
    return {
        "over": {name: axis.tolist() for name, axis in made.over.items()},
        "held": dict(made.held),
        "rates": list(made.rates),
        "kept": list(made.kept),
        "tables": sum(name.startswith("TAB_") for name in made.database.tables),
        "nodes": int(np.prod([len(axis) for axis in made.over.values()])),
        "points": made.points,
        "errors": {
            axis: {
                "largest": error.largest,
                "rms": error.rms,
                "span": error.span,
                "at": dict(error.at),
            }
            for axis, error in made.errors.items()
        },
    }
