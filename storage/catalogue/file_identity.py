"""What identifies a stored file: its path, hash and size."""

import hashlib
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class StoredFile:
    """A file of the store by its `path` (relative to the workspace), with the sha256 and size that
    it was stored with."""

    path: str
    sha256: str
    size: int


def measured(path: Path) -> tuple[str, int]:
    """Return sha256 and size [bytes] of a file as it is now; read in blocks, whatever its size.
    Raises OSError."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest(), file.tell()
