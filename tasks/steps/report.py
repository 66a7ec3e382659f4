"""HTML reports of a flight, of an update or closed loop, and of a version."""

import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.nomenclature import is_surface
from aerodb.report import Graph, Head, Relative, lineage_graph
from aerodb.storage.catalogue import VersionRow
from aerodb.storage.files import read_document
from aerodb.storage.workspace import write_atomically
from aerodb.support import Array
from aerodb.tables import HAT_RATES, AeroDatabase, hat_rate
from aerodb.tasks.actors import user
from aerodb.tasks.page_head import head_of_result, head_of_version
from aerodb.tasks.steps.compare import compare_with_database, load_comparison
from aerodb.tasks.steps.conditioning import load_conditioning, suspicions_of
from aerodb.tasks.steps.consistency import load_consistent
from aerodb.tasks.steps.ingest import load_flight
from aerodb.tasks.steps.loop_options import options_of_result
from aerodb.tasks.steps.release import judge_version, with_gate
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace

_KEY: Final = re.compile(r"[0-9a-f]{64}")

#: Most ancestors drawn, so that the figure stays readable; the lineage query lists all.
_ANCESTORS: Final = 5
#: Most children drawn, the newest, for the same reason.
_CHILDREN: Final = 6


def flight_page(
    flight: str, *, workspace: str, run: str, version: str = "", in_pieces: bool = False
) -> str | Iterator[str]:
    """Return the report (HTML, display units as [deg]) of a flight (its id) compared with a version
    (its id; empty: none); in_pieces : as an iterator, which draws each figure when it comes to it.

    Reads the flight, its consistency and comparison. Raises UnknownNameError for an unknown id.
    """
    # Drawing is imported here, and below, because it is slow to import and most runs draw nothing.
    from aerodb.report import FlightStory, flight_report

    access = access_workspace(workspace)
    row = access.catalogue.flight(flight)
    measured, key = load_flight(access, row, run)
    consistent = load_consistent(access, row, run)
    comparison, why = (
        None,
        "This vehicle has no released database yet: import one, then make this page again.",
    )
    if version:
        try:
            comparison = load_comparison(access, row.id, version, run).comparison
        except InputError as error:
            why = f"There are none: {error}."
    versions = access.catalogue.versions_by_id([version] if version else [])
    conditioning, _ = load_conditioning(access, row, measured, key, run)
    result = access.catalogue.result(consistent.key)
    page = flight_report(
        FlightStory(
            id=row.id,
            label=access.catalogue.flight_labels([row.id])[row.id],
            vehicle=row.vehicle,
            log=_log_name(access, row.log_sha256),
            start_utc=row.start_utc,
            verdict=row.verdict,
            remarks=row.remarks,
            retracted=row.retract_reason if row.retracted_utc else "",
            consistency=consistent.document,
            measured=measured,
            flight=consistent.flight,
            comparison=comparison,
            database=access.database(version) if version else None,
            version=versions[version].label if version else "",
            no_comparison=why,
            versions=[(use.version.label, use.role) for use in access.catalogue.impact(row.id)],
            suspicions=suspicions_of(row, conditioning),
            segments=conditioning.segments,
            head=head_of_result(access, result, user()) if result else None,
        )
    )
    return page if in_pieces else "".join(page)


def update_page(
    reference: str, *, workspace: str, run: str, in_pieces: bool = False
) -> str | Iterator[str]:
    """Return the report (HTML, display units as [deg]) of an update or closed loop, by its version
    (id) or the key of its report; in_pieces : see `flight_page`.

    Raises InputError for a version that no update made, UnknownNameError for an unknown reference.
    """
    from aerodb.report import UpdateStory, update_report

    access = access_workspace(workspace)
    document = with_gate(_document(access, reference), workspace=workspace, run=run)
    ids = [id for id in (document["baseline"], document["candidate"]) if id]
    rows = access.catalogue.versions_by_id(ids)
    roles = document["flights"]
    excluded = [entry["flight"] for entry in roles["excluded"]]
    labels = access.catalogue.flight_labels((*roles["identified"], *roles["held_out"], *excluded))
    candidate = rows[document["candidate"]].label if document["candidate"] else None
    baseline = rows[document["baseline"]].label
    databases = (
        access.database(document["baseline"]),
        access.database(document["candidate"] or document["baseline"]),
    )
    # Rolls on the ground have no coefficients.
    shown = [] if "rolls" in document else roles["held_out"] or roles["identified"]
    before = {
        flight: compare_with_database(access, flight, databases[0], run).comparison
        for flight in shown
    }
    after = {
        flight: compare_with_database(access, flight, databases[1], run).comparison
        for flight in shown
        if candidate
    }
    channels = {
        flight: _variables(_consistent(access, flight, run), databases[1]) for flight in shown
    }
    page = update_report(
        UpdateStory(
            document,
            labels,
            baseline,
            candidate,
            databases,
            before,
            after,
            channels,
            _head(access, reference, document, rows.get(document["candidate"])),
            options_of_result(access.catalogue, reference),
        )
    )
    return page if in_pieces else "".join(page)


def _head(
    access: WorkspaceAccess,
    reference: str,
    document: Mapping[str, Any],
    candidate: VersionRow | None,
) -> Head:
    """Head of the page of an update or closed loop; candidate : the version that it made."""
    if candidate is not None:
        return head_of_version(access, candidate)
    result = access.catalogue.result(reference)
    assert result is not None
    return head_of_result(access, result, document.get("by", ""))


def write_update_page(document: dict[str, Any], *, workspace: str, run: str) -> str:
    """Write the report of an update or closed loop to the workspace's reports, and return the file.

    Reads and raises what `update_page` does: InputError, UnknownNameError.
    """
    access = access_workspace(workspace)
    reference = document.get("report") or document["candidate"]
    page = update_page(reference, workspace=workspace, run=run)
    path = (
        access.workspace.reports
        / f"{document['vehicle']}-{document['label'] or 'nothing-added'}-{reference[:12]}.html"
    )

    def write(temporary: Path) -> None:
        temporary.write_text("".join(page), encoding="utf-8")

    write_atomically(path, write)
    return str(path)


def version_page(
    version: str,
    *,
    workspace: str,
    run: str,
    modes: dict[str, Any] | None = None,
    in_pieces: bool = False,
) -> str | Iterator[str]:
    """Return the report (HTML, display units as [deg]) of a version (its id); modes : of
    `modes_beside_flights`, for a section of their own; in_pieces : see `flight_page`.

    Reads version, report and flights from the catalogue. Raises UnknownNameError for an unknown id.
    """
    from aerodb.report import NameMove, UsedFlight, VersionStory, version_report
    from aerodb.tasks.steps.validate_responses import known_responses
    from aerodb.tasks.view import trim_changes

    access = access_workspace(workspace)
    catalogue = access.catalogue
    row = catalogue.version_of_id(version)
    report = catalogue.version_documents(row.id).report
    roles = catalogue.version_flights(row.id)
    flights = catalogue.flights_by_id(use.flight for use in roles)
    labels = catalogue.flight_labels(flights)
    database = access.database(row.id)
    parent = (
        (catalogue.version_of_id(row.parent).label, access.database(row.parent))
        if row.parent
        else None
    )
    names = catalogue.names(row.vehicle)
    page = version_report(
        VersionStory(
            id=row.id,
            label=row.label,
            vehicle=row.vehicle,
            content_sha256=row.content_sha256,
            names=sorted(name for name, id in names.items() if id == row.id),
            stale=catalogue.stale(row.id),
            report=report,
            gate=judge_version(row.id, workspace=workspace, run=run, fly=False),
            trim=trim_changes(access, catalogue.version_of_id(row.parent), row)
            if row.parent
            else (),
            moves=[
                NameMove(m.at_utc, m.name, m.user, m.reason)
                for m in catalogue.moves_to(row.vehicle, [row.id])
            ],
            flights=[
                UsedFlight(
                    labels[use.flight],
                    use.role,
                    flights[use.flight].log_sha256,
                    flights[use.flight].retract_reason,
                )
                for use in roles
            ],
            database=database,
            parent=parent,
            graph=lineage_of(access, row),
            head=head_of_version(access, row),
            responses=known_responses(access, row, row.parent),
            modes=modes,
        )
    )
    return page if in_pieces else "".join(page)


def lineage_of(access: WorkspaceAccess, row: VersionRow) -> Graph:
    """Return the graph (places in px, `lineage_graph`) of a version, its nearest ancestors and its
    children."""
    names = access.catalogue.names(row.vehicle)
    line = list(reversed(access.catalogue.lineage(row.id).line[: _ANCESTORS + 1]))
    children = [
        entry for entry in access.catalogue.versions(row.vehicle) if entry.parent == row.id
    ][-_CHILDREN:]
    family = []
    for entry in (*line, *children):
        roles = [use.role for use in access.catalogue.version_flights(entry.id)]
        family.append(
            Relative(
                id=entry.id,
                label=entry.label,
                parent=entry.parent,
                created=f"{entry.created_utc:%Y-%m-%d %H:%M}",
                names=tuple(sorted(name for name, id in names.items() if id == entry.id)),
                flights={role: roles.count(role) for role in dict.fromkeys(roles)},
                stale=bool(access.catalogue.stale(entry.id)),
            )
        )
    return lineage_graph(family, row.id)


def _document(access: WorkspaceAccess, reference: str) -> dict[str, Any]:
    """Return the document of an update or closed loop, by its version's id or its report's key."""
    result = access.catalogue.result(reference) if _KEY.fullmatch(reference) else None
    if result is not None and result.step == "close_loop":
        document: dict[str, Any] = read_document(access.file_of(result.path))
        return document
    report = dict(access.catalogue.version_documents(reference).report)
    if "axes" not in report:
        what, remedy = (
            "was imported, not made by an update",
            "report: aerodb report version",
        )
        raise InputError(what, f"version {access.catalogue.version_of_id(reference).label}", remedy)
    return report


def _consistent(access: WorkspaceAccess, flight: str, run: str) -> Flight:
    return load_consistent(access, access.catalogue.flight(flight), run).flight


def _variables(flight: Flight, database: AeroDatabase) -> dict[str, Array]:
    """Return the variables that residuals are plotted over; unusable samples are NaN.

    These are the database's inputs, the flow angles, the surfaces and the non-dimensional rates.
    """
    names = {
        *database.flight_inputs,
        "alpha",
        "beta",
        *(name for name in flight.channels if is_surface(name)),
    }
    shown = {
        name: np.where(flight.usable([name]), flight[name], np.nan)
        for name in sorted(names)
        if name in flight
    }
    for name, (rate, _) in HAT_RATES.items():
        if rate in flight and "V" in flight:
            shown[name] = hat_rate(name, flight.channels, database.reference)
    return shown


def _log_name(access: WorkspaceAccess, sha256: str) -> str:
    log = access.catalogue.log(sha256)
    return log.name if log else sha256[:12]
