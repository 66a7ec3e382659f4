"""Work in threads that stay: each piece once, errors come back."""

import gc
import threading

import numpy as np
import pytest

from aerodb.support.parallel import Threads, in_threads


@pytest.mark.parametrize("count", [0, 1, 2, 50])
def test_each_piece_is_worked_on_once_however_many_there_are(count: int) -> None:
    done = np.zeros(count)

    def add(place: int) -> None:
        done[place] += 1.0

    threads = Threads()
    for _ in range(3):
        threads.each(add, range(count))
    assert (done == 3.0).all()


def test_an_error_in_any_piece_is_raised_after_the_others() -> None:
    threads = Threads()
    for wrong in range(8):
        with pytest.raises(ZeroDivisionError):
            threads.each(lambda piece, wrong=wrong: 1 // (piece - wrong), range(8))


def test_threads_end_with_what_holds_them() -> None:
    before = set(threading.enumerate())
    threads = Threads()
    threads.each(lambda _: None, range(8))
    own = [
        thread
        for thread in threading.enumerate()
        if thread not in before and thread.name.startswith("ThreadPoolExecutor")
    ]
    del threads
    gc.collect()
    for thread in own:
        thread.join(30.0)
    assert not any(thread.is_alive() for thread in own)


def test_no_room_for_a_thread_is_a_lack_of_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("aerodb.support.parallel.os.cpu_count", lambda: 2)

    def none(thread: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", none)
    with pytest.raises(MemoryError, match="new thread"):
        in_threads(abs, [1, 2])
