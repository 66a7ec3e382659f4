"""The same for many items at once, on all cores: arrays are worked on outside the interpreter's
lock.

Meanwhile linear algebra has no threads of its own: two on every core would wait for one another.
"""

import os
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from typing import TypeVar

from threadpoolctl import threadpool_limits

Item = TypeVar("Item")
Result = TypeVar("Result")


def in_threads(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """`function` of each item, in their order; the first error is raised once what was begun has
    ended."""
    todo = list(items)
    workers = min(len(todo), os.cpu_count() or 1)
    if workers < 2:
        return [function(item) for item in todo]
    with threadpool_limits(1, user_api="blas"), ThreadPoolExecutor(workers) as pool:
        return list(pool.map(function, todo))


class Threads:
    """Threads that stay, with the caller's one a core: for many short pieces of compiled work
    without a library's linear algebra.

    They end when nobody holds this any more.
    """

    def __init__(self) -> None:
        self._helpers = (os.cpu_count() or 1) - 1
        self._pool = ThreadPoolExecutor(max(1, self._helpers))

    def each(self, function: Callable[[Item], object], items: Sequence[Item]) -> None:
        """`function` of each item, which must not come back here; an error is raised once what was
        begun has ended."""
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
