"""The next permitted point of a version, with what flights tell of declared terms."""

from collections.abc import Sequence
from typing import Any

from aerodb.identification import METHODS, REGRESSION, fits_of, parameter_name, with_known_terms
from aerodb.increments import expand, parse_model_file
from aerodb.simulation import Growth, Margins
from aerodb.tasks.steps.methods import identification_flights
from aerodb.tasks.view import StatedCondition, expansion_document
from aerodb.tasks.workspace_access import access_workspace


def expand_flight(
    version: str,
    *,
    workspace: str,
    run: str,
    steady: StatedCondition,
    variable: str,
    reach: tuple[float, float],
    largest_step: float,
    margins: Margins,
    growth: Sequence[Growth] = (),
    model: str | None = None,
    flights: Sequence[str] = (),
) -> dict[str, Any]:
    """The next permitted point of a version (its id) from the edge of what has been flown towards a
    target (`reach`) [SI].

    model : text of a model file, whose terms are estimated on the version from all `flights` (ids)
        by regression with its priors; None: the version's own increments are what is known.

    Returns the document of `expansion_document`, with ``known`` (parameter, value, standard_error)
    of the declared terms.
    """
    access = access_workspace(workspace)
    row = access.catalogue.version_of_id(version)
    database, known = access.database(version), list[dict[str, Any]]()
    if model is not None:
        declared = parse_model_file(model)
        fits = (
            fits_of(
                METHODS[REGRESSION],
                identification_flights(access, flights, database, run),
                declared,
                database,
            )
            if flights
            else []
        )
        first = len(database.increments)
        database = with_known_terms(database, declared, fits)
        known = [
            {
                "parameter": parameter_name(entry.axis, term.name),
                "value": float(value),
                "standard_error": float(variance) ** 0.5,
            }
            for entry, each in zip(declared.increment, database.increments[first:], strict=True)
            for term, value, variance in zip(
                expand(entry), each.estimates, each.covariance.diagonal(), strict=True
            )
        ]
    found = expansion_document(
        access.catalogue, row, steady, variable, reach, largest_step, margins, growth, database
    )
    return {**found, "known": known}
