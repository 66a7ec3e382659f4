"""Which code made a result, and who asked for it: provenance, never part of a key."""

import getpass
import subprocess
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path


@lru_cache(maxsize=1)
def code_version() -> str:
    """Package version and, where the code stands in a git checkout, its commit:
    ``0.1.0+1a2b3c4``."""
    try:
        number = version("aerodb")
    except PackageNotFoundError:
        number = "unknown"
    folder = Path(__file__).resolve().parent.parent
    if not (folder / ".git").exists():
        return number
    command = ["git", "-C", str(folder), "rev-parse", "--short", "HEAD"]
    try:
        commit = subprocess.run(
            command, capture_output=True, text=True, timeout=5, check=True
        ).stdout.strip()
    except (OSError, subprocess.SubprocessError):
        return number
    return f"{number}+{commit}"


def user() -> str:
    """Who runs this, as the system knows them; ``unknown`` where it does not."""
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return "unknown"
