"""The next manoeuvre: what separates the terms of a model file best, within limits."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.identification import METHODS, REGRESSION, fits_of, with_terms
from aerodb.increments import ModelFile, parse_model_file
from aerodb.simulation import (
    DesignedManoeuvre,
    Trim,
    design_manoeuvre,
    expected_noise,
    manoeuvre_text,
    surface_limits,
)
from aerodb.support import Array
from aerodb.tables import AeroDatabase
from aerodb.tasks.steps.methods import identification_flights
from aerodb.tasks.view import StatedCondition, trim_of
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace

#: Axes that the pitch control drives.
_LONGITUDINAL: Final = frozenset({"CX", "CZ", "Cm", "C_lift", "C_drag"})


def design_flight(
    version: str,
    *,
    workspace: str,
    run: str,
    model: str,
    steady: StatedCondition,
    limits: Mapping[str, tuple[float, float]],
    duration: float,
    flights: Sequence[str] = (),
) -> dict[str, Any]:
    """Design a manoeuvre about a steady flight of a version (its id) for the terms of `model`.

    limits : channel -> least and greatest value [SI]. flights : ids of flights that are flown
    already, whose information on the terms is counted.

    Returns a document: version, manoeuvre (text of its file), parameters (parameter,
    standard_error_before, or None where nothing is known, and _after), separated (the pair of
    parameters most correlated before, and its correlation before and after), reached (channel ->
    least and greatest value), tried, within, feedback, notes.
    """
    access = access_workspace(workspace)
    row = access.catalogue.version_of_id(version)
    declared, database = parse_model_file(model), access.database(version)
    wider, named = with_terms(database, declared)
    trimmed = trim_of(access.catalogue, row, steady, wider)
    known, notes = _known(access, flights, declared, database, list(named.values()), run)
    vehicle = access.vehicle(row.vehicle)[0]
    inputs = trimmed.problem.model.inputs
    deflections = {n: ends for n, ends in surface_limits(vehicle).items() if n in inputs}
    noise, assumed = expected_noise(vehicle)
    found = design_manoeuvre(
        trimmed,
        named,
        deflections,
        limits,
        duration=duration,
        moved=_controls(declared),
        noise=noise,
        known=known,
    )
    if assumed:
        notes.append(f"noise as of a small vehicle: {', '.join(assumed)} (state [sensors] of each)")
    return {"version": version, **_document(found, trimmed, steady), "notes": notes}


def _controls(declared: ModelFile) -> tuple[str, ...]:
    """Controls that drive the declared axes."""
    axes = {entry.axis for entry in declared.increment}
    along = ("pitch",) if axes & _LONGITUDINAL else ()
    return (*along, *(("roll", "yaw") if axes - _LONGITUDINAL else ()))


def _known(
    access: WorkspaceAccess,
    flights: Sequence[str],
    declared: ModelFile,
    database: AeroDatabase,
    names: Sequence[str],
    run: str,
) -> tuple[Array | None, list[str]]:
    """Information (p, p) that flights already hold on the parameters, by regression."""
    if not flights:
        return None, ["no flight counted: nothing is taken as known"]
    given = identification_flights(access, flights, database, run)
    try:
        fits = fits_of(METHODS[REGRESSION], given, declared, database)
    except InputError as error:
        return None, [f"the flights tell nothing of these terms: {error.what}"]
    information = np.zeros((len(names),) * 2)
    for fit in fits:
        good = [n for n in fit.names if n in names and fit[n].standing == "estimated"]
        if not good:
            continue
        inside = [fit.names.index(name) for name in good]
        outside = [names.index(name) for name in good]
        covariance = fit.covariance[np.ix_(inside, inside)]
        scale = np.sqrt(np.diag(covariance))
        inverse = np.linalg.pinv(covariance / np.outer(scale, scale), hermitian=True)
        information[np.ix_(outside, outside)] += inverse / np.outer(scale, scale)
    return information, [f"{len(flights)} flights are counted, by regression"]


def _document(found: DesignedManoeuvre, trimmed: Trim, steady: StatedCondition) -> dict[str, Any]:
    before, after = (np.sqrt(np.diag(c)) for c in (found.before, found.after))
    given = dict(text.split("=", 1) for text in steady.given)
    manoeuvre = replace(found.manoeuvre, given=given)
    return {
        "manoeuvre": manoeuvre_text(manoeuvre),
        "parameters": [
            {
                "parameter": name,
                "standard_error_before": float(b) if np.isfinite(b) else None,
                "standard_error_after": float(a),
            }
            for name, b, a in zip(found.names, before, after, strict=True)
        ],
        "separated": _separated(found),
        "reached": {name: list(ends) for name, ends in found.reached.items()},
        "tried": found.tried,
        "within": found.within,
        "feedback": {f"{name}:{channel}": g for (name, channel), g in found.feedback.items()},
        "alpha": trimmed.channels["alpha"],
    }


def _separated(found: DesignedManoeuvre) -> dict[str, Any] | None:
    """The pair most correlated before, with its correlation before and after."""
    pairs = [
        (abs(_correlation(found.before, i, j)), i, j)
        for i in range(len(found.names))
        for j in range(i)
    ]
    if not pairs:
        return None
    _, i, j = max(pairs)
    return {
        "parameters": [found.names[j], found.names[i]],
        "correlation_before": _correlation(found.before, i, j),
        "correlation_after": _correlation(found.after, i, j),
    }


def _correlation(covariance: Array, i: int, j: int) -> float:
    size = np.sqrt(covariance[i, i] * covariance[j, j])
    return float(covariance[i, j] / size) if 0.0 < size < np.inf else 0.0
