"""Compiled loop of the DataFlash reader: each record's header is read once."""

from numba import njit

from aerodb.storage.readers.ulog_kernels import Bytes
from aerodb.support import Integers

#: Message id of FMT, the message that describes the others.
FMT = 128
#: Size of an FMT record with its header [bytes], the same in all logs.
FMT_BYTES = 89


@njit(cache=True)
def walk(
    data: Bytes, length: Integers, kind: Bytes, start: Integers, lost: Integers
) -> tuple[int, int]:
    """Follow the records of a log; return the number of records and of stretches that belong to
    none.

    By message id, `length` (256,) is the size of its records [bytes] with header, 0 before its FMT;
    the first FMT of an id counts. Record k is of the id ``kind[k]`` and begins at ``start[k]``;
    stretch k is ``lost[k]`` (m, 2). Arrays may be empty: then they are not filled.

    A record whose end meets no header, with one inside it that begins a whole record, is lost:
    its own id is damaged.
    """
    n, at, count, gaps = len(data), 0, 0, 0
    while at < n:
        size = _size(data, at, length)
        if size > 0 and at + size <= n and not _is_header(data, at + size, n):
            inside = _next(data, at + 1, length)
            if inside < at + size:
                size = 0
        if size == 0 or at + size > n:
            after = _next(data, at + 1, length)
            if gaps < len(lost):
                lost[gaps, 0], lost[gaps, 1] = at, after
            gaps += 1
            at = after
            continue
        if data[at + 2] == FMT:
            named = data[at + 3]
            if length[named] == 0 and data[at + 4] >= 3:
                length[named] = data[at + 4]
        if count < len(kind):
            kind[count], start[count] = data[at + 2], at
        count += 1
        at += size
    return count, gaps


@njit(cache=True)
def _is_header(data: Bytes, at: int, n: int) -> bool:
    """Return whether a header begins at `at`, or the log ends there."""
    if at == n:
        return True
    if at + 1 == n:
        return bool(data[at] == 0xA3)
    return bool(data[at] == 0xA3 and data[at + 1] == 0x95)


@njit(cache=True)
def _size(data: Bytes, at: int, length: Integers) -> int:
    """Size of the record at `at`; 0 if none of a known id begins there."""
    if at + 3 > len(data) or data[at] != 0xA3 or data[at + 1] != 0x95:
        return 0
    return int(length[data[at + 2]])


@njit(cache=True)
def _next(data: Bytes, at: int, length: Integers) -> int:
    """Return where the next record begins whose end meets a header or the end of the log; the end
    of the log if none does."""
    n = len(data)
    while at < n:
        size = _size(data, at, length)
        if size > 0 and at + size <= n and _is_header(data, at + size, n):
            return at
        at += 1
    return n
