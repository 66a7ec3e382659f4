"""Code version of a result: provenance, never part of a key."""

import subprocess
from functools import lru_cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path


@lru_cache(maxsize=1)
def code_version() -> str:
    """Return the package version, with the commit if the code is a git checkout: ``0.1.0+1a2b3c4``.
    Without git, or after 5 [s], the version alone: no error is raised."""
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
