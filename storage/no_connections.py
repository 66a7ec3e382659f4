"""A process that makes no connection: the kernel refuses it every socket (seccomp(2), Linux 3.17).

Landlock refuses TCP alone and from Linux 6.7 on; this refuses UDP and all other kinds too. What the
process has open already stays usable, and no privilege is needed.
"""

import ctypes
import errno
import os
import struct
import sys
from typing import Final

_NO_NEW_PRIVILEGES: Final = 38  # PR_SET_NO_NEW_PRIVS of prctl(2)
_SECCOMP, _FILTER, _READ_MODE = 22, 2, 21  # PR_SET_SECCOMP, SECCOMP_MODE_FILTER, PR_GET_SECCOMP
#: Machine -> what the kernel calls it (AUDIT_ARCH_*), and the number of its call `socket`.
_MACHINES: Final = {"x86_64": (0xC000003E, 41), "aarch64": (0xC00000B7, 198)}
_IO_URING: Final = 425  # io_uring_setup, alike on all machines: its requests open sockets too
_OTHER_TABLE: Final = 0x40000000  # from here on calls of x32, another table of the same machine
#: Instructions of a filter (bpf(4)): load a word, compare with it, answer.
_LOAD, _EQUAL, _AT_LEAST, _ANSWER = 0x20, 0x15, 0x35, 0x06
_ALLOW, _REFUSE = 0x7FFF0000, 0x00050000 | errno.EACCES


def can_refuse_connections() -> bool:
    """Return whether the kernel of this system takes such a filter, and its calls are known."""
    return (
        sys.platform == "linux"
        and os.uname().machine in _MACHINES
        and ctypes.CDLL(None).prctl(_READ_MODE, 0, 0, 0, 0) >= 0
    )


def refuse_connections() -> bool:
    """Let this process, and those that it starts, open no socket from now on; return whether the
    system does so. OSError where the kernel knows such filters and refuses this one."""
    if not can_refuse_connections():
        return False
    machine, socket = _MACHINES[os.uname().machine]
    # Code, lines to skip where true and where false, value.
    lines = (
        (_LOAD, 0, 0, 4),  # the machine of the call
        (_EQUAL, 0, 4, machine),
        (_LOAD, 0, 0, 0),  # the number of the call
        (_AT_LEAST, 2, 0, _OTHER_TABLE),
        (_EQUAL, 1, 0, socket),
        (_EQUAL, 0, 1, _IO_URING),
        (_ANSWER, 0, 0, _REFUSE),
        (_ANSWER, 0, 0, _ALLOW),
    )
    program = ctypes.create_string_buffer(b"".join(struct.pack("=HBBI", *line) for line in lines))
    header = struct.pack("@HP", len(lines), ctypes.addressof(program))
    library = ctypes.CDLL(None, use_errno=True)
    for words in ((_NO_NEW_PRIVILEGES, 1, 0, 0, 0), (_SECCOMP, _FILTER, header, 0, 0)):
        if library.prctl(*words):
            raise OSError(ctypes.get_errno(), f"seccomp: {os.strerror(ctypes.get_errno())}")
    return True
