"""JSON documents in the store: what a flow answered, kept beside its results."""

import json
from pathlib import Path
from typing import Any

from aerodb.errors import InputError
from aerodb.storage.workspace import write_atomically
from aerodb.support import canonical_json


def write_document(path: Path, document: Any) -> None:
    """Stores a document in its canonical form, whole or not at all."""
    text = canonical_json(document).decode()

    def write(temporary: Path) -> None:
        temporary.write_text(text, encoding="utf-8")

    write_atomically(path, write)


def read_document(path: Path) -> Any:
    """A stored document; InputError when it is missing or damaged."""
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise InputError("no stored document here", str(path), "run again what made it") from error
