"""Parsing of a log in a process of its own, so that a bad log does no harm here.

That process reads the log and writes its topics in the format of the store; this process reads them
on demand.
"""

import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

from aerodb.errors import InputError, StoreError
from aerodb.recording import Recording
from aerodb.storage.confined_environment import confined_environment
from aerodb.storage.disk_errors import remove, temporary_beside, translated_disk_errors
from aerodb.storage.files import open_recording, write_topics
from aerodb.storage.landlock import see_only
from aerodb.storage.limits import Limits
from aerodb.storage.no_connections import refuse_connections
from aerodb.storage.readers import prepare_reader_of, read_log
from aerodb.storage.workspace import put_in_place
from aerodb.tasks.workers.pool import Job, OverLimitError, done

#: Where the topics are in the folder of a parsing; beside them it unpacks archives.
_TOPICS: Final = "topics"


@dataclass(frozen=True)
class Parsed:
    """A parsed log; its topics are in the temporary folder `folder` until `keep` moves them into
    place."""

    folder: Path
    recording: Recording

    def keep(self, place: Path) -> None:
        """Move the topics to `place`; topics that another process has put there in the meantime
        stay. StoreError on a full disk."""
        put_in_place(self.folder, place, keep=True)


@contextmanager
def parsed_log(path: Path, place: Path, limits: Limits) -> Iterator[Parsed]:
    """Parse the log at `path` in another process; its topics are written to a temporary folder next
    to `place`.

    The temporary folder is removed at the end unless its topics were kept. Raises InputError for a
    log that is damaged beyond use or exceeds its `limits`; only the process that parsed it may have
    died. Raises StoreError when the topics cannot be written.
    """
    limits.check_size(path.stat().st_size, str(path))
    folder = temporary_beside(place)
    try:
        with translated_disk_errors(folder):
            _parse(path, folder.absolute(), limits)
        topics = folder / _TOPICS
        yield Parsed(topics, replace(open_recording(topics), source=str(path)))
    finally:
        remove(folder)


def _parse(log: Path, folder: Path, limits: Limits) -> None:
    """Have a log parsed into a folder, and raise its error if it failed."""
    try:
        refused = done(parsing(log, folder, limits))
    except OverLimitError as error:
        raise InputError(error.what, error.where, error.remedy) from None
    if refused is not None:
        is_disk = refused.pop("store")
        raise (StoreError if is_disk else InputError)(**refused)


def parsing(log: Path, folder: Path, limits: Limits) -> Job:
    """Return the job that parses a log and writes its topics to a folder: in a process that gets
    nothing of this environment, and ends with it."""
    return Job(
        _read,
        (log, folder),
        limits,
        flight="",
        what="its parsing",
        where=str(log),
        program="the reader",
        again="ingest it again",
        actor=None,
        environment=confined_environment(),
        needs=(log.suffix.lower(),),
        once=True,
        scratch=str(folder),
    )


def _read(log: Path, folder: Path) -> dict[str, str | bool] | None:
    """Read a log and write its topics; return the texts of the error if it failed. Runs in the
    process for this log alone, whose answer is JSON and which sees no other file of the user."""
    # What libraries print is not for the user.
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)
    try:
        with translated_disk_errors(folder):
            folder.mkdir()
        tempfile.tempdir = str(folder)
        prepare_reader_of(log)
        see_only([log, *_program()], [folder, Path(os.devnull)])
        refuse_connections()
        # Stored data do not depend on the location of the log.
        recording = replace(read_log(log), source=log.name)
        with translated_disk_errors(folder):
            write_topics(folder / _TOPICS, recording)
    except (InputError, StoreError) as error:
        return _refusal(error.what, error.where, error.remedy, isinstance(error, StoreError))
    except MemoryError:
        raise
    except RecursionError:
        remedy = "no recorder writes such a log: check its source"
        return _refusal("its content is nested too deeply", str(log), remedy)
    # A library fails on bytes that it does not expect: only this log cannot be used.
    except Exception as error:
        what = f"its parsing failed: {type(error).__name__}: {str(error)[:200]}"
        return _refusal(what, str(log), "report it, with the log, as a bug of aerodb")
    return None


def _program() -> list[Path]:
    """What the program itself reads: its code, the interpreter's, libraries, time zones, its own
    memory."""
    system = ("/usr", "/lib", "/lib64", "/etc/localtime", "/etc/ld.so.cache", "/proc/self")
    own = (str(Path(__file__).resolve().parents[2]), sys.prefix, sys.base_prefix, *sys.path)
    return [Path(each) for each in (*own, *system, "/dev/urandom") if each]


def _refusal(what: str, where: str, remedy: str, store: bool = False) -> dict[str, str | bool]:
    return {"what": what, "where": where, "remedy": remedy, "store": store}
