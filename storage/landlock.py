"""A process that sees a few files only, by Landlock (Linux 5.13 and later, landlock(7)).

The kernel refuses every other file, and from Linux 6.7 on every TCP connection, to this process
and to those that it starts, for as long as they live; no privilege is needed.
"""

import ctypes
import os
import struct
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

_CREATE, _ADD, _RESTRICT = 444, 445, 446  # numbers of the system calls, alike on all processors
_VERSION: Final = 1  # LANDLOCK_CREATE_RULESET_VERSION
_BENEATH: Final = 1  # LANDLOCK_RULE_PATH_BENEATH
_NO_NEW_PRIVILEGES: Final = 38  # PR_SET_NO_NEW_PRIVS of prctl(2)
#: Rights by the version of the interface that brought them: execute, write and read files, list
#: folders, remove and make (13 kinds); then move, truncate and control devices.
_RIGHTS: Final = {1: (1 << 13) - 1, 2: 1 << 13, 3: 1 << 14, 5: 1 << 15}
_READ: Final = 0b1101  # execute, read files, list folders
_OF_FILES: Final = 0b111 | 1 << 14 | 1 << 15  # those that a file, not a folder, can be given
_CONNECTIONS: Final = 0b11  # to bind and to connect TCP
_SCOPES: Final = 0b11  # abstract sockets and signals of other processes


def landlock_version() -> int:
    """Return the version of the kernel's interface; 0 where the system has none."""
    if sys.platform != "linux":
        return 0
    return max(0, int(_call(_CREATE, None, 0, _VERSION)))


def see_only(read: Iterable[Path], write: Iterable[Path]) -> bool:
    """Let this process, from now on, read only what is at or under `read`, and also write what is
    under `write`; return whether the system does so.

    Paths that do not exist are left out. OSError where the kernel has Landlock and refuses.
    """
    version = landlock_version()
    if not version:
        return False
    rights = sum(right for since, right in _RIGHTS.items() if since <= version)
    connections, scopes = _CONNECTIONS * (version >= 4), _SCOPES * (version >= 6)
    size = 8 if version < 4 else 16 if version < 6 else 24
    ruleset = _checked(
        _call(_CREATE, struct.pack("=QQQ", rights, connections, scopes)[:size], size, 0)
    )
    try:
        for paths, allowed in ((read, rights & _READ), (write, rights)):
            for path in paths:
                with suppress(FileNotFoundError):
                    _allow(ruleset, path, allowed)
        _checked(ctypes.CDLL(None).prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0))
        _checked(_call(_RESTRICT, ruleset, 0))
    finally:
        os.close(ruleset)
    return True


def _allow(ruleset: int, path: Path, allowed: int) -> None:
    place = os.open(path, os.O_PATH | os.O_CLOEXEC)
    try:
        kept = allowed if path.is_dir() else allowed & _OF_FILES
        _checked(_call(_ADD, ruleset, _BENEATH, struct.pack("=Qi", kept, place), 0))
    finally:
        os.close(place)


def _call(number: int, *arguments: Any) -> int:
    return int(ctypes.CDLL(None, use_errno=True).syscall(ctypes.c_long(number), *arguments))


def _checked(result: int) -> int:
    if result < 0:
        raise OSError(ctypes.get_errno(), f"Landlock: {os.strerror(ctypes.get_errno())}")
    return result
