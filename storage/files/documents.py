"""Stored JSON documents: the answers of flows."""

import json
from pathlib import Path
from typing import Any

from aerodb.errors import InputError
from aerodb.storage.workspace import write_atomically
from aerodb.support import canonical_json


def write_document(path: Path, document: Any) -> None:
    """Store a document as canonical JSON, atomically.

    JSON as in RFC 8785. Raises OSError when the disk refuses it.
    """
    text = canonical_json(document).decode()

    def write(temporary: Path) -> None:
        temporary.write_text(text, encoding="utf-8")

    write_atomically(path, write)


def read_document(path: Path) -> Any:
    """Return a stored document (JSON, UTF-8, as `write_document` writes it); InputError when it is
    missing or damaged."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError(
            "the stored document is missing or damaged", str(path), "repeat the run that wrote it"
        ) from error
