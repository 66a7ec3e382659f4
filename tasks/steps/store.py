"""The cache of an object store as a step: it is kept as small as the settings say."""

from pathlib import Path
from typing import Any

from aerodb.errors import StoreError
from aerodb.storage.files import trim
from aerodb.storage.workspace_settings import load_settings
from aerodb.tasks.workspace_access import access_workspace


def trim_cache(root: str, *, workspace: str, run: str) -> dict[str, Any]:
    """Removes from the workspace folder `root` what was not used for longest, where the settings
    limit its cache.

    Returns files, bytes, and the error of what could not be done now: it is done the next time,
    nothing else waits for it.
    """
    asked = load_settings(Path(root)).store
    if not (asked.url and asked.cache):
        return {"files": 0, "bytes": 0, "error": ""}
    access = access_workspace(workspace)
    try:
        moved = trim(access.workspace, access.catalogue, asked.cache)
    except StoreError as error:
        return {"files": 0, "bytes": 0, "error": str(error)}
    return {"files": moved.files, "bytes": moved.bytes, "error": ""}
