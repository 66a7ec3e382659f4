"""Selection of the reader for a log file.

Readers are imported on demand, because each depends on a library of its own.
"""

import re
import tempfile
from collections.abc import Collection
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.recording import Recording, Topic
from aerodb.storage.files import write_topics
from aerodb.storage.readers.foreign_formats import refuse_foreign
from aerodb.storage.readers.mavlink import is_telemetry, read_tlog
from aerodb.storage.readers.packed import GZIP, ZIP, read_packed
from aerodb.storage.writers import write_ulog

#: First bytes of the files.
_ULOG: Final = b"ULog"
_MCAP: Final = b"\x89MCAP"
#: Bags of ROS 1, and of ROS 2 in SQLite.
ROSBAG: Final = b"#ROSBAG V2.0\n"
SQLITE: Final = b"SQLite format 3\x00"
_DATAFLASH: Final = b"\xa3\x95"
#: First line of a DataFlash log as text: the description of descriptions.
FIRST_LINE: Final = re.compile(rb"\s*FMT,\s*128,\s*89,\s*FMT,")
_ULOG_SUFFIXES: Final = (".ulg", ".ulog")
_MCAP_SUFFIX: Final = ".mcap"
_DATAFLASH_SUFFIX: Final = ".bin"


@cache
def prepare_reader(suffix: str) -> None:
    """Import the reader of logs with this suffix (lower case), once, so that processes forked from
    this one have it; for ULog and DataFlash, read a log of our own, which loads the compiled
    loops. The ULog has lost its tail, as the search behind damage is compiled too."""
    if suffix in _ULOG_SUFFIXES:
        with tempfile.TemporaryDirectory() as folder:
            log, time = Path(folder) / "own.ulg", np.arange(1, 50, dtype=np.float64) * 0.02
            write_ulog(log, [Topic("own", time, {"x": time, "y": time.astype(np.float32)})])
            log.write_bytes(log.read_bytes()[:-17])
            write_topics(Path(folder) / "topics", read_log(log))
    elif suffix == _MCAP_SUFFIX:
        from aerodb.storage.readers import mcap, rosbag  # noqa: F401
    elif suffix == _DATAFLASH_SUFFIX:
        from aerodb.storage.readers.dataflash import framed

        framed(np.zeros(4, dtype=np.uint8))
    else:
        from aerodb.storage.readers import tabular  # noqa: F401


def prepare_reader_of(path: Path) -> None:
    """Import what the log at `path` is read with, by its first bytes, whatever its name says; an
    OSError is left to `read_log`."""
    with suppress(OSError), path.open("rb") as handle:
        head = handle.read(64)
        packed = head.startswith((ZIP, GZIP))
        if packed or head.startswith(_ULOG):
            prepare_reader(_ULOG_SUFFIXES[0])
        if packed or head.startswith(_DATAFLASH) or FIRST_LINE.match(head):
            prepare_reader(_DATAFLASH_SUFFIX)
        if packed or head.startswith((_MCAP, ROSBAG, SQLITE)):
            prepare_reader(_MCAP_SUFFIX)


def read_log(path: Path, topics: Collection[str] | None = None) -> Recording:
    """Read a log of any known format, recognised by its first bytes, else by its suffix: ULog,
    MCAP, bags of ROS, DataFlash, else tables; times in [s], fields (n,) in the log's own units.

    Parameters
    ----------
    path :
        The log file.
    topics :
        Names of the topics to read, for formats that allow it (ULog); None for all.

    Raises
    ------
    InputError
        For a file that is missing, empty, of unknown format, or damaged beyond use.
    """
    try:
        with path.open("rb") as handle:
            head = handle.read(64)
        if FIRST_LINE.match(head):
            from aerodb.storage.readers.dataflash_text import read_dataflash_text

            return read_dataflash_text(path)
        if head.startswith((ZIP, GZIP)):
            return read_packed(path, lambda log: read_log(log, topics))
        if is_telemetry(head):
            return read_tlog(path)
        refuse_foreign(path, head)
        if head.startswith((ROSBAG, SQLITE)):
            from aerodb.storage.readers.rosbag import read_rosbag1, read_rosbag2

            return read_rosbag2(path) if head.startswith(SQLITE) else read_rosbag1(path)
        if head.startswith(_ULOG) or path.suffix.lower() in _ULOG_SUFFIXES:
            from aerodb.storage.readers.ulog import read_ulog

            return read_ulog(path, topics)
        if head.startswith(_MCAP) or path.suffix.lower() == _MCAP_SUFFIX:
            from aerodb.storage.readers.mcap import read_mcap

            return read_mcap(path)
        if head.startswith(_DATAFLASH) or path.suffix.lower() == _DATAFLASH_SUFFIX:
            from aerodb.storage.readers.dataflash import read_dataflash

            return read_dataflash(path)
    except OSError as error:
        raise InputError(
            f"the log cannot be read: {error.strerror or error}",
            str(path),
            "check its name and permissions",
        ) from error
    from aerodb.storage.readers.tabular import read_tabular

    return read_tabular(path)
