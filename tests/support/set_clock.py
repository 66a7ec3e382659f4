"""A clock that tests can set: processes that are started with it see the time of the machine and
what the tests add to it.

A library of a few lines, compiled here, that the system loads before the C library. Only the time
of day is changed, as by an administrator or NTP; what measures durations goes on.
"""

import shutil
import struct
import subprocess
from pathlib import Path

_SOURCE = r"""
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <stdint.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <time.h>

static int (*machine)(clockid_t, struct timespec *);
static volatile int64_t *added;

__attribute__((constructor)) static void begin(void) {
    int file = open(ADDED, O_RDONLY | O_CLOEXEC);
    void *page = file < 0 ? MAP_FAILED : mmap(0, 8, PROT_READ, MAP_SHARED, file, 0);
    machine = dlsym(RTLD_NEXT, "clock_gettime");
    if (page != MAP_FAILED) added = page;
}

int clock_gettime(clockid_t clock, struct timespec *now) {
    if (!machine) begin();
    int failed = machine(clock, now);
    if (!failed && added && (clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE)) now->tv_sec += *added;
    return failed;
}

int gettimeofday(struct timeval *restrict now, void *restrict zone) {
    struct timespec exact;
    int failed = clock_gettime(CLOCK_REALTIME, &exact);
    (void)zone;
    now->tv_sec = exact.tv_sec;
    now->tv_usec = exact.tv_nsec / 1000;
    return failed;
}

time_t time(time_t *now) {
    struct timespec exact;
    clock_gettime(CLOCK_REALTIME, &exact);
    if (now) *now = exact.tv_sec;
    return exact.tv_sec;
}
"""


class Clock:
    """The clock of all processes that are given its `environment`; it is set for all of them at
    once."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True)
        library, source = folder / "clock.so", folder / "clock.c"
        source.write_text(_SOURCE, encoding="ascii")
        self.added = (folder / "added").absolute()
        # The path stands in the library: processes for logs get no environment.
        command = ["cc", "-shared", "-fPIC", "-O2", f'-DADDED="{self.added}"']
        subprocess.run([*command, "-o", library, source, "-ldl"], check=True, capture_output=True)
        self.added.write_bytes(bytes(8))
        self.environment = {"LD_PRELOAD": str(library), "AERODB_TEST_CLOCK": str(self.added)}


def set_clock(added: Path, seconds: int) -> None:
    """Sets a clock (its `added`) to that of the machine and so many seconds more; fewer, below
    zero."""
    with added.open("r+b") as file:
        file.write(struct.pack("=q", seconds))


def can_be_set() -> bool:
    """Whether there is what the library is made with."""
    return shutil.which("cc") is not None
