"""Which systems the program runs on: said in words before anything of another system fails."""

import os
import sys
from typing import Final

from aerodb.errors import AeroError

#: Environment variable with which a user tries a system on which nothing was tested.
UNTESTED: Final = "AERODB_UNTESTED_SYSTEM"


def require_supported_system() -> None:
    """Raise AeroError on a system that is not Linux: on Windows always, as processes with limits
    need POSIX; elsewhere unless `UNTESTED` is set."""
    if sys.platform == "linux":
        return
    if sys.platform in ("win32", "cygwin"):
        raise AeroError(
            "aerodb does not run on Windows itself",
            "this system",
            "install WSL 2 (wsl --install), and aerodb inside it; or use its container",
        )
    if not os.environ.get(UNTESTED):
        raise AeroError(
            f"aerodb was never tested on {sys.platform}",
            "this system",
            f"use its container (flows/deploy/Containerfile), or try it with {UNTESTED}=1; there"
            " the limit of memory may not hold",
        )
