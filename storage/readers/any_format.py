"""A log file of any known format, read by the reader for it.

A reader is imported when a file needs it: each brings a library of its own.
"""

from collections.abc import Collection
from pathlib import Path

from aerodb.errors import InputError
from aerodb.recording import Recording

_ULOG, _MCAP = b"ULog", b"\x89MCAP"


def read_log(path: Path, topics: Collection[str] | None = None) -> Recording:
    """Reads a log of any known format: told by its first bytes, else by its suffix.

    Parameters
    ---------- path : the log file. topics : names of the topics wanted, where the format allows to
    leave out the others (ULog); None for all.

    Raises InputError for a file that is absent, empty, of no known format, or damaged beyond use.
    """
    try:
        with path.open("rb") as handle:
            head = handle.read(8)
        if head.startswith(_ULOG) or path.suffix.lower() in (".ulg", ".ulog"):
            from aerodb.storage.readers.ulog import read_ulog

            return read_ulog(path, topics)
        if head.startswith(_MCAP) or path.suffix.lower() == ".mcap":
            from aerodb.storage.readers.mcap import read_mcap

            return read_mcap(path)
    except OSError as error:
        raise InputError(
            f"cannot be read: {error.strerror or error}",
            str(path),
            "check the name and the permissions",
        ) from error
    from aerodb.storage.readers.tabular import read_tabular

    return read_tabular(path)
