"""Work in threads that stay, and in forks: each piece once, errors come back."""

import gc
import os
import subprocess
import sys
import threading

import numpy as np
import pytest

from aerodb.support.parallel import Threads, in_processes, in_threads


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


def _in_a_worker(body: str) -> str:
    """What a process prints that may be forked, as workers may."""
    start = "import os\nfrom aerodb.support import in_processes, let_fork\nlet_fork(lambda: None)\n"
    done = subprocess.run(
        [sys.executable, "-c", start + body], capture_output=True, text=True, timeout=120.0
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_items_are_worked_on_in_forks_and_results_keep_their_order() -> None:
    told = _in_a_worker(
        "os.cpu_count = lambda: 3\n"
        "found = in_processes(lambda item: (item, os.getpid()), range(7))\n"
        "print([item for item, _ in found], len({process for _, process in found}),"
        " found[0][1] == os.getpid())"
    )
    assert told.split("\n")[0] == "[0, 1, 2, 3, 4, 5, 6] 3 True"


def test_a_fork_is_not_forked_again_and_threads_of_its_parent_are_not_waited_for() -> None:
    told = _in_a_worker(
        "os.cpu_count = lambda: 2\nfrom aerodb.support import Threads\n"
        "threads, done = Threads(), []\nthreads.each(done.append, range(5))\n"
        "def inner(item):\n"
        "    threads.each(done.append, range(5))\n"
        "    return len(set(in_processes(lambda _: os.getpid(), range(4)))), len(done)\n"
        "print(in_processes(inner, range(2))[1])"
    )
    assert told.strip() == "(1, 10)"


def test_of_several_errors_the_first_items_is_raised() -> None:
    told = _in_a_worker(
        "os.cpu_count = lambda: 2\n"
        "def fail(item):\n"
        "    if item in (3, 4):\n"
        "        raise KeyError(item)\n"
        "try:\n    in_processes(fail, range(6))\nexcept KeyError as error:\n    print(error)"
    )
    assert told.strip() == "3"


def test_what_a_fork_that_dies_had_to_do_is_done_here() -> None:
    told = _in_a_worker(
        "import signal\nos.cpu_count = lambda: 2\nhere = os.getpid()\n"
        "def die(item):\n"
        "    if os.getpid() != here:\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
        "    return item * item\n"
        "print(in_processes(die, range(5)))"
    )
    assert told.strip() == "[0, 1, 4, 9, 16]"


def test_a_process_that_may_have_threads_is_not_forked() -> None:
    assert set(in_processes(lambda _: os.getpid(), range(4))) == {os.getpid()}
