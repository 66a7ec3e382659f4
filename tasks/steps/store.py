"""Trim the cache of an object store to the size that the settings allow."""

from pathlib import Path
from typing import Any

from aerodb.errors import StoreError
from aerodb.storage.files import trim
from aerodb.storage.workspace_settings import load_settings
from aerodb.tasks.workspace_access import access_workspace


def trim_cache(root: str, *, workspace: str, run: str) -> dict[str, Any]:
    """Remove the least recently used files from the workspace folder `root`, if its cache is
    limited.

    Returns files, bytes, and the error if the cache could not be trimmed now: the next call tries
    again, and nothing waits for it.
    """
    settings = load_settings(Path(root)).store
    if not (settings.url and settings.cache):
        return {"files": 0, "bytes": 0, "error": ""}
    access = access_workspace(workspace)
    try:
        moved = trim(access.workspace, access.catalogue, settings.cache)
    except StoreError as error:
        return {"files": 0, "bytes": 0, "error": str(error)}
    return {"files": moved.files, "bytes": moved.bytes, "error": ""}
