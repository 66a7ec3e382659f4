"""Runs of the small glider through the real flows, and what the catalogue holds afterwards."""

from pathlib import Path
from typing import Any

import sqlalchemy as sa

from aerodb.flows.flight import flight_flow
from aerodb.flows.importing import import_flow
from aerodb.flows.run import run_flow
from aerodb.flows.update import update_flow
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from tests.support.small_glider import MODEL, NAME, VEHICLE

#: Rows that any second run may add: that it ran, and what it used.
OF_RUNS = {"runs", "run_results", "run_versions"}


def prepared(root: Path, folder: Path) -> Workspace:
    """A workspace with the vehicle and its handbook database, made without the orchestrator."""
    workspace = Workspace.open(root)
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_vehicle(NAME, VEHICLE)
    run_flow(
        import_flow,
        {"file": str(folder / "database.toml"), "vehicle": NAME, "bindings": {}},
        workspace,
        "direct",
    )
    return workspace


def stored(workspace: Workspace) -> dict[str, Any]:
    """Everything that a second way must store under the same names, read from the catalogue
    itself."""
    with Catalogue.open(workspace.catalogue) as catalogue:
        flights = [row.id for row in catalogue.flights(NAME)]
        results = {
            flight: sorted((r.step, r.key) for r in catalogue.results_of(flight))
            for flight in flights
        }
        versions = [(row.label, row.id, row.content_sha256) for row in catalogue.versions(NAME)]
        roles = {
            id: sorted((use.flight, use.role) for use in catalogue.version_flights(id))
            for _, id, _ in versions
        }
        return {
            "flights": sorted(flights),
            "results": results,
            "versions": versions,
            "roles": roles,
        }


def ways(workspace: Workspace) -> list[tuple[str, str, str]]:
    """Flow, how it ran, and how it ended, of every run."""
    with Catalogue.open(workspace.catalogue) as catalogue:
        return sorted((row.flow, row.how, row.state) for row in catalogue.runs())


def rows(workspace: Workspace) -> dict[str, int]:
    """Table -> number of rows, without the tables about runs."""
    with (
        Catalogue.open(workspace.catalogue) as catalogue,
        catalogue._database.reading() as connection,
    ):
        tables = [name for name in sa.inspect(connection).get_table_names() if name not in OF_RUNS]
        counts = {
            name: connection.execute(sa.text(f'SELECT count(*) FROM "{name}"')).scalar()
            for name in tables
        }
    return {name: int(count or 0) for name, count in counts.items()}


def ingest_and_update(workspace: Workspace, logs: list[Path]) -> dict[str, Any]:
    """Takes the logs in and updates the released database, without the orchestrator; returns the
    update's document."""
    return update(workspace, ingest(workspace, logs))


def ingest(workspace: Workspace, logs: list[Path]) -> list[str]:
    """Takes the logs in, without the orchestrator; returns the flights."""
    parameters: dict[str, Any] = {"logs": [str(log) for log in logs], "vehicle": NAME}
    outcomes = run_flow(flight_flow, parameters, workspace, "direct")
    return [outcome["flight"] for outcome in outcomes if outcome["flight"]]


def update(workspace: Workspace, flights: list[str]) -> dict[str, Any]:
    """Updates the released database with these flights, without the orchestrator; returns the
    update's document."""
    with Catalogue.open(workspace.catalogue) as catalogue:
        baseline = catalogue.version(NAME, "released").id
    parameters = {"vehicle": NAME, "baseline": baseline, "flights": flights, "model": MODEL}
    document: dict[str, Any] = run_flow(update_flow, parameters, workspace, "direct")
    return document
