"""Versions as documents: `aerodb version list`, `show` and `history`, and the console's API."""

from collections.abc import Sequence
from typing import Any

from aerodb.storage.catalogue import Catalogue, NameEvent, VersionRow


def version_document(row: VersionRow) -> dict[str, Any]:
    """Return a version without its documents."""
    return {
        "version": row.id,
        "label": row.label,
        "vehicle": row.vehicle,
        "parent": row.parent,
        "content_sha256": row.content_sha256,
        "created_utc": row.created_utc.isoformat(),
    }


def versions_document(
    catalogue: Catalogue, vehicle: str, rows: Sequence[VersionRow]
) -> list[dict[str, Any]]:
    """Return versions of a vehicle, each with the names that now point at it."""
    names: dict[str, list[str]] = {}
    for name, version in catalogue.names(vehicle).items():
        names.setdefault(version, []).append(name)
    return [{**version_document(row), "names": names.get(row.id, [])} for row in rows]


def version_details(catalogue: Catalogue, row: VersionRow) -> dict[str, Any]:
    """Return a version with the reasons why it is stale, its report and its settings."""
    documents = catalogue.version_documents(row.id)
    stale = list(catalogue.stale(row.id))
    return {
        **version_document(row),
        "stale": stale,
        "report": documents.report,
        "settings": documents.settings,
    }


def history_document(events: Sequence[NameEvent]) -> list[dict[str, Any]]:
    """Return moves of names: when, which name, to and from which version, by whom, why."""
    return [
        {
            "at_utc": event.at_utc.isoformat(),
            "name": event.name,
            "to": event.version,
            "from": event.previous,
            "user": event.user,
            "reason": event.reason,
        }
        for event in events
    ]
