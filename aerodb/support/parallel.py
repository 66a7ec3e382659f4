"""One function over many items in threads on all cores; array code releases the interpreter's lock.

BLAS is limited to one thread meanwhile: two threads per core would wait for each other.
"""

import os
import sys
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import AbstractContextManager
from functools import lru_cache
from typing import TypeVar

from threadpoolctl import ThreadpoolController

Item = TypeVar("Item")
Result = TypeVar("Result")


def one_blas_thread() -> AbstractContextManager[object]:
    """Limit BLAS to one thread within a ``with`` statement."""
    return _blas(len(sys.modules)).limit(limits=1, user_api="blas")


@lru_cache(maxsize=1)
def _blas(_modules: int) -> ThreadpoolController:
    """The BLAS libraries in memory, which take 6 ms to find; an import may add one."""
    return ThreadpoolController()


def in_threads(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Return `function` of each item, in order.

    The first error is raised once all calls that have started have ended; MemoryError where there
    is no room for the stack of a thread.
    """
    todo = list(items)
    workers = min(len(todo), os.cpu_count() or 1)
    if workers < 2:
        return [function(item) for item in todo]
    with one_blas_thread(), ThreadPoolExecutor(workers) as pool:
        try:
            calls = pool.map(function, todo)
        except RuntimeError as error:  # "can't start new thread"
            raise MemoryError(str(error)) from error
        return list(calls)


class Threads:
    """Persistent pool of threads, one per core together with the caller's.

    For many short pieces of compiled code that do not call BLAS. The threads end when the pool is
    garbage-collected.
    """

    def __init__(self) -> None:
        self._helpers = (os.cpu_count() or 1) - 1
        self._pool = ThreadPoolExecutor(max(1, self._helpers))

    def each(self, function: Callable[[Item], object], items: Sequence[Item]) -> None:
        """Call `function` for each item; `function` must not call this method again.

        An error is raised once all calls that have started have ended.
        """
        todo = deque(items)

        def work() -> None:
            while True:
                try:
                    item = todo.popleft()
                except IndexError:
                    return
                function(item)

        begun = [self._pool.submit(work) for _ in range(min(self._helpers, len(items) - 1))]
        try:
            work()
        finally:
            wait(begun)
        for helper in begun:
            helper.result()
