"""Notifications that wait to be delivered: one file each, written first and removed after
delivery."""

import json
import secrets
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from aerodb.storage.files import write_document
from aerodb.storage.workspace import Workspace


def post_notification(
    workspace: Workspace, occasion: str, vehicle: str, text: str, details: Mapping[str, Any]
) -> Path:
    """Queue a notification; `text` is one sentence, `details` a small document. Returns its file.
    StoreError on a full or read-only disk."""
    at = datetime.now(UTC)
    message = {
        "occasion": occasion,
        "vehicle": vehicle,
        "text": text,
        "at_utc": at.isoformat(timespec="seconds"),
    }
    path = workspace.outbox / f"{at:%Y%m%dT%H%M%S%f}-{secrets.token_hex(4)}.json"
    write_document(path, {**message, "details": dict(details)})
    return path


def undelivered_notifications(workspace: Workspace) -> Iterator[tuple[Path, dict[str, Any]]]:
    """Yield path and content of each queued notification (`post_notification`), oldest first; one
    that cannot be read raises no error and is left out."""
    for path in sorted(workspace.outbox.glob("*.json")):
        try:
            yield path, json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError):
            continue  # another process has just delivered it
