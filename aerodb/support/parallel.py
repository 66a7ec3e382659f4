"""One function over many items on all cores: in threads, where array code releases the
interpreter's lock, or in forks of this process.

BLAS is limited to one thread in threads: two threads per core would wait for each other.
"""

import gc
import os
import pickle
import sys
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor, wait
from contextlib import AbstractContextManager
from functools import lru_cache
from typing import Any, NoReturn, TypeVar

from threadpoolctl import ThreadpoolController

Item = TypeVar("Item")
Result = TypeVar("Result")

#: What a fork of this process does first; None where it must not be forked.
_first: Callable[[], object] | None = None
#: Whether this process is such a fork, and has one core.
_forked = False


def let_fork(first: Callable[[], object]) -> None:
    """Let `in_processes` fork this process: no thread of it holds a lock while that is called.
    first : what each fork does before its work."""
    global _first
    _first = first


def _cores() -> int:
    return 1 if _forked else os.cpu_count() or 1


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
    workers = min(len(todo), _cores())
    if workers < 2:
        return [function(item) for item in todo]
    with one_blas_thread(), ThreadPoolExecutor(workers) as pool:
        try:
            calls = pool.map(function, todo)
        except RuntimeError as error:  # "can't start new thread"
            raise MemoryError(str(error)) from error
        return list(calls)


def in_processes(function: Callable[[Item], Result], items: Iterable[Item]) -> list[Result]:
    """Return `function` of each item, in order, from forks of this process, one per core; from this
    process alone where it must not be forked (`let_fork`).

    For work on arrays that holds the interpreter's lock. A fork has all that this process has
    loaded, and what it loads itself is lost with it; its results come back through pickle. What a
    fork that died had to do is done here. Of several errors that of the first item is raised.
    """
    todo = list(items)
    workers = min(len(todo), _cores()) if _first else 1
    if workers < 2:
        return [function(item) for item in todo]
    parts = [todo[number::workers] for number in range(workers)]
    gc.freeze()  # a fork shares what nobody touches
    try:
        others = [_begun(function, part) for part in parts[1:]]
    finally:
        gc.unfreeze()
    outcomes = [_outcomes(function, parts[0])]
    for part, (process, answer) in zip(parts[1:], others, strict=True):
        with os.fdopen(answer, "rb") as pipe:
            content = pipe.read()
        ended = os.waitstatus_to_exitcode(os.waitpid(process, 0)[1])
        outcomes.append(pickle.loads(content) if ended == 0 else _outcomes(function, part))
    results = list[Result]()
    for place in range(len(todo)):
        made, result, error = outcomes[place % workers][place // workers]
        if not made:
            raise error
        results.append(result)
    return results


def _outcomes(function: Callable[[Item], Result], items: Sequence[Item]) -> list[Any]:
    """Whether there is a result, the result and the error of each item, up to the first error."""
    outcomes = list[Any]()
    for item in items:
        try:
            outcomes.append((True, function(item), None))
        except Exception as error:
            return [*outcomes, (False, None, error)]
    return outcomes


def _begun(function: Callable[[Item], Result], items: Sequence[Item]) -> tuple[int, int]:
    """The id of a fork that works on these items, and the file descriptor of its answer."""
    answer, ours = os.pipe()
    process = os.fork()
    if process:
        os.close(ours)
        return process, answer
    _answer(function, items, ours)


def _answer(function: Callable[[Item], Result], items: Sequence[Item], pipe: int) -> NoReturn:
    """In a fork: write the outcomes, and exit without returning."""
    global _forked
    try:
        _forked = True
        gc.disable()
        if _first:
            _first()
        with os.fdopen(pipe, "wb") as file:
            file.write(pickle.dumps(_outcomes(function, items), pickle.HIGHEST_PROTOCOL))
        os._exit(0)
    finally:
        os._exit(1)


class Threads:
    """Persistent pool of threads, one per core together with the caller's.

    For many short pieces of compiled code that do not call BLAS. The threads end when the pool is
    garbage-collected.
    """

    def __init__(self) -> None:
        self._owner, self._helpers = os.getpid(), _cores() - 1
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

        helpers = min(self._helpers, len(items) - 1)
        if os.getpid() != self._owner:  # threads are not forked
            helpers = 0
        begun = [self._pool.submit(work) for _ in range(helpers)]
        try:
            work()
        finally:
            wait(begun)
        for helper in begun:
            helper.result()
