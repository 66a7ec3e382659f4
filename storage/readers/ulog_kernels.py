"""Compiled loops of the ULog reader: each message header is read once, each payload copied once.

A block is a contiguous part of the file as bytes; `at` is a position in it. Tables are
indexed by message id (65536,).
"""

import numpy as np
from numba import njit
from numpy.typing import NDArray

from aerodb.support import Integers

Bytes = NDArray[np.uint8]


@njit(cache=True)
def walk(
    block: Bytes,
    at: int,
    low: Integers,
    high: Integers,
    stamp: Integers,
    count: Integers,
    latest: Integers,
    back: Integers,
    last: int,
) -> tuple[int, int]:
    """Follow data messages from `at`; stop at the first message that is not complete, of the right
    size and of a known topic.

    By message id: `count` of messages, `latest` timestamp [us], and ``back[id]``: how often time
    ran backwards, and from which timestamp first.
    """
    n = len(block)
    while at + 5 <= n and block[at + 2] == 68:
        size = block[at] + 256 * block[at + 1]
        identity = block[at + 3] + 256 * block[at + 4]
        if (
            size < 2
            or at + 3 + size > n
            or low[identity] < 0
            or size - 2 < low[identity]
            or size - 2 > high[identity]
        ):
            break
        count[identity] += 1
        if stamp[identity] >= 0:
            now = np.int64(0)
            for k in range(8):
                now |= np.int64(block[at + 5 + stamp[identity] + k]) << (8 * k)
            if now < latest[identity]:
                back[identity, 0] += 1
                if back[identity, 0] == 1:
                    back[identity, 1] = latest[identity]
            latest[identity] = now
            if now > 0:  # some messages are logged without a time
                last = int(now)
        at += 3 + size
    return at, last


@njit(cache=True)
def candidate(block: Bytes, at: int, low: Integers, high: Integers) -> int:
    """The next position that could be a header, judged by a few bytes; -1 if there is none in the
    window."""
    n = len(block)
    while at + 5 <= n:
        size, kind = block[at] + 256 * block[at + 1], block[at + 2]
        if size >= 2 and at + 3 + size <= n:
            first, second = block[at + 3], block[at + 4]
            if kind == 68:
                identity = first + 256 * second
                if low[identity] >= 0 and low[identity] <= size - 2 <= high[identity]:
                    return at
            elif kind == 76 or kind == 67:  # L C: the level is a digit
                if size >= 9 and 48 <= first <= 55:
                    return at
            elif kind == 79 or kind == 82:  # O R
                if size == 2:
                    return at
            elif kind == 83:  # S
                if size == 8 and first == 0x2F and second == 0x73:
                    return at
            elif kind == 73 or kind == 80:  # I P: length of the key, then the key's type
                if first < size and 97 <= second <= 122:
                    return at
            elif kind == 77 or kind == 81:  # M Q: one byte more
                if second < size and size > 3 and 97 <= block[at + 5] <= 122:
                    return at
            elif kind == 70:  # F
                if 48 <= first <= 122 and 45 <= second <= 122:
                    return at
            elif kind == 65 and size > 3 and 48 <= block[at + 6] <= 122:  # A
                return at
        at += 1
    return -1


@njit(cache=True)
def copy(
    block: Bytes, at: int, take: Integers, cursor: Integers, limit: Integers, flat: Bytes
) -> int:
    """Copy the first `take[id]` data bytes of every message from `at` on to ``flat[cursor[id]:]``;
    returns the end."""
    n = len(block)
    while at + 3 <= n:
        size = block[at] + 256 * block[at + 1]
        if at + 3 + size > n:
            break
        if block[at + 2] == 68:
            identity = block[at + 3] + 256 * block[at + 4]
            into, amount = cursor[identity], take[identity]
            if amount > 0 and amount <= size - 2 and into + amount <= limit[identity]:
                for k in range(amount):
                    flat[into + k] = block[at + 5 + k]
                cursor[identity] = into + amount
        at += 3 + size
    return at
