"""Lineage both ways: from a number to its sources, and from a flight to the versions based on it.

A table node or a point of a version leads to increments, flights, logs, settings and runs. A
retracted flight leads to the versions to rebuild, in order.
"""

import io
import json
from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError, nearest
from aerodb.report import curve_document, diff_document
from aerodb.storage.catalogue import Catalogue, Impact, VersionRow
from aerodb.storage.writers import prov_json
from aerodb.tables import (
    NodeShare,
    Parameter,
    diff,
    neutral_point,
    node_lineage,
    point_lineage,
    sigma_of,
    value_of,
)
from aerodb.tasks.references import node_of, point_of
from aerodb.tasks.result_versions import RESULT_VERSION
from aerodb.tasks.view.evaluation import database_of

FIGURE_KINDS: Final = ("png", "svg", "pdf")


def origins_document(
    catalogue: Catalogue, version: VersionRow, node: str | None, at: str
) -> dict[str, Any]:
    """Return the increments behind a table node ``TABLE[i,j]`` or a point ``NAME=VALUE,...``, or
    the flights behind a parameter ``NAME``.

    The document has version, at and increments, for a parameter also ``parameter``. Values are in
    SI units; InputError for a node or a point that cannot be read.
    """
    database = database_of(catalogue, version)
    if node is not None and node in database.parameters:
        entry = parameter_origin(catalogue, version, node)
        return {"version": version.id, "at": node, "increments": [], "parameter": entry}
    if node is not None:
        origins = origin_of_node(catalogue, version, *node_of(node))
    else:
        origins = origin_of_point(catalogue, version, point_of(at, inputs_of(catalogue, version)))
    return {"version": version.id, "at": at if node is None else node, "increments": origins}


def parameter_origin(catalogue: Catalogue, version: VersionRow, name: str) -> dict[str, Any]:
    """Return the value of a parameter (its unit), what is known of it, and where it comes from: the
    version on the line that gave it, with flights and run, or none where it was imported."""
    variable = database_of(catalogue, version).variables[name]
    known = variable.parameter or Parameter()
    maker = version
    for row in catalogue.lineage(version.id).line[1:]:
        if database_of(catalogue, row).variables.get(name) != variable:
            break
        maker = row
    origin = _origin(catalogue, maker, known.flights) if known.flights else {"flights": []}
    return {
        "value": value_of(variable.expression),
        "unit": variable.unit,
        "standard_error": sigma_of(variable.uncertainty),
        "bounds": [bound if np.isfinite(bound) else None for bound in known.bounds],
        "flown": {name: list(ends) for name, ends in known.flown.items()},
        **origin,
    }


def impact_document(flight: str, uses: Sequence[Impact]) -> dict[str, Any]:
    """Return the versions based on a flight (its id): version, role of the flight, and through
    which one."""
    versions = [
        {"version": use.version.id, "role": use.role, "through": use.through} for use in uses
    ]
    return {"flight": flight, "versions": versions}


def inputs_of(catalogue: Catalogue, version: VersionRow) -> tuple[str, ...]:
    """Return the channels and free inputs that a version needs."""
    return database_of(catalogue, version).inputs


def compare_versions(catalogue: Catalogue, before: VersionRow, after: VersionRow) -> dict[str, Any]:
    """Return the differences between two versions, in SI units."""
    old, new = database_of(catalogue, before), database_of(catalogue, after)
    return {
        "before": before.id,
        "after": after.id,
        **diff_document(diff(old, new)),
        "curve": curve_document(old, new),
    }


def draw_differences(
    catalogue: Catalogue,
    before: VersionRow,
    after: VersionRow,
    suffix: str,
    on_phone: bool = False,
) -> bytes:
    """Return slices through two versions as a figure of a kind that `suffix` names, like ``.png``;
    on_phone : as wide as a phone. Raises InputError for another kind."""
    kind = suffix.lower().removeprefix(".")
    if kind not in FIGURE_KINDS:
        raise InputError(
            f"unknown figure format '{suffix}'", "--figure", nearest(kind, FIGURE_KINDS)
        )
    from aerodb.report import PAGE_WIDTH, PHONE_WIDTH, diff_figure

    old, new = database_of(catalogue, before), database_of(catalogue, after)
    figure = diff_figure(
        old,
        new,
        (before.label, after.label),
        f"{after.vehicle}: {before.label} and {after.label}",
        width=PHONE_WIDTH if on_phone else PAGE_WIDTH,
    )
    drawn = io.BytesIO()
    figure.savefig(drawn, format=kind, dpi=130)
    return drawn.getvalue()


def origin_of_node(
    catalogue: Catalogue, version: VersionRow, table: str, index: tuple[int, ...]
) -> list[dict[str, Any]]:
    """Return the increments behind a table node, each with `_origin`; empty for an imported value.
    UnknownNameError for an unknown table, InputError for an index beyond its axes."""
    return _origins(catalogue, version, node_lineage(database_of(catalogue, version), table, index))


def origin_of_point(
    catalogue: Catalogue, version: VersionRow, point: Mapping[str, float]
) -> list[dict[str, Any]]:
    """Return the increments that act at a point, each with `_origin`.

    point : channel -> value [SI]; missing channels are neutral.
    """
    database = database_of(catalogue, version)
    return _origins(
        catalogue, version, point_lineage(database, {**neutral_point(database), **point})
    )


def prov_of(catalogue: Catalogue, version: VersionRow) -> bytes:
    """Return the lineage of a version as PROV-JSON (W3C, 2013; `prov_json`). Raises
    UnknownNameError for an unknown version."""
    lineage = catalogue.lineage(version.id)
    line = [row.id for row in lineage.line]
    return prov_json(
        lineage, catalogue.settings_of(line), catalogue.moves_to(version.vehicle, line)
    )


def rebuilds(catalogue: Catalogue, stale: Sequence[Impact]) -> list[dict[str, Any]]:
    """Return how to rebuild stale versions, ancestors first: version, label, and the command.

    The command is empty if no update made the version. It takes the version's own model and
    flights, without those retracted, on its parent; if the parent is stale too, on the version that
    the previous step rebuilds.
    """
    made_again: dict[str, str] = {}
    settings = catalogue.settings_of(entry.version.id for entry in stale)
    commands = []
    for entry in stale:
        row = entry.version
        if "model" not in settings[row.id]:
            commands.append({"version": row.id, "label": row.label, "command": ""})
            continue
        baseline = row.parent or ""
        if baseline in made_again:
            # `candidate` points at what was made last: named by itself, unless another branch came
            # between.
            baseline = "candidate" if commands[-1]["version"] == baseline else made_again[baseline]
        elif baseline:
            baseline = catalogue.version_of_id(baseline).label
        command = f"aerodb update --vehicle {row.vehicle} --like {row.label} --baseline {baseline}"
        made_again[row.id] = f"NEW-{row.label}"
        commands.append({"version": row.id, "label": row.label, "command": command})
    return commands


def _origins(
    catalogue: Catalogue, version: VersionRow, shares: Sequence[NodeShare]
) -> list[dict[str, Any]]:
    makers = _makers(catalogue, version)
    return [
        {
            "axis": share.axis,
            "regressors": list(share.regressors),
            "value": share.value,
            "standard_error": share.standard_error,
            **_origin(catalogue, makers[share.increment], share.flights),
        }
        for share in shares
    ]


def _makers(catalogue: Catalogue, version: VersionRow) -> list[VersionRow]:
    """Return, for each increment of a version, the ancestor (or itself) that introduced it."""
    line = catalogue.lineage(version.id).line
    wanted = [_identity(entry) for entry in _increments(catalogue, version)]
    makers = [version] * len(wanted)
    for row in line[1:]:
        there = {_identity(entry) for entry in _increments(catalogue, row)}
        if there.isdisjoint(wanted):
            break
        makers = [
            row if identity in there else maker
            for identity, maker in zip(wanted, makers, strict=True)
        ]
    return makers


def _increments(catalogue: Catalogue, version: VersionRow) -> list[dict[str, Any]]:
    entries: list[dict[str, Any]] = json.loads(catalogue.version_documents(version.id).content)[
        "increments"
    ]
    return entries


def _identity(increment: Mapping[str, Any]) -> str:
    """Return what stays the same of an increment when it is folded into a table."""
    kept = ("axis", "regressors", "estimates", "covariance", "envelope", "flights")
    return json.dumps([increment[key] for key in kept], sort_keys=True)


def _origin(catalogue: Catalogue, maker: VersionRow, flights: Sequence[str]) -> dict[str, Any]:
    """Return the version that introduced an increment, with settings, step versions, run and
    flights."""
    rows, names = catalogue.flights_by_id(flights), catalogue.flight_labels(flights)
    roles = {use.flight: use.role for use in catalogue.version_flights(maker.id)}
    run = catalogue.run(maker.run) if maker.run is not None else None
    settings = catalogue.settings_of([maker.id])[maker.id]
    steps = {step: list(numbers) for step, numbers in catalogue.steps_behind(maker.id).items()}
    return {
        "made_by": maker.id,
        "label": maker.label,
        "settings": dict(settings),
        "step_versions": {
            **steps,
            **{step: [settings[step]] for step in RESULT_VERSION if step in settings},
        },
        "run": run.id if run is not None else None,
        "code_version": run.code_version if run is not None else None,
        "flights": [
            {
                "flight": flight,
                "name": names[flight],
                "role": roles.get(flight, "identified"),
                "log_sha256": rows[flight].log_sha256,
                "retracted": rows[flight].retract_reason or None,
            }
            for flight in flights
        ],
    }
