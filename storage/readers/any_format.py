"""Selection of the reader for a log file.

Readers are imported on demand, because each depends on a library of its own.
"""

from collections.abc import Collection
from pathlib import Path
from typing import Final

from aerodb.errors import InputError
from aerodb.recording import Recording

_ULOG, _MCAP, _DATAFLASH = b"ULog", b"\x89MCAP", b"\xa3\x95"
ULOG_SUFFIXES: Final = (".ulg", ".ulog")
_MCAP_SUFFIX: Final = ".mcap"
DATAFLASH_SUFFIX: Final = ".bin"


def import_reader(suffix: str) -> None:
    """Import the reader of logs with this suffix (lower case), so that processes forked from this
    one have it."""
    if suffix in ULOG_SUFFIXES:
        from aerodb.storage.readers import ulog  # noqa: F401
    elif suffix == _MCAP_SUFFIX:
        from aerodb.storage.readers import mcap  # noqa: F401
    elif suffix == DATAFLASH_SUFFIX:
        from aerodb.storage.readers import dataflash  # noqa: F401
    else:
        from aerodb.storage.readers import tabular  # noqa: F401


def read_log(path: Path, topics: Collection[str] | None = None) -> Recording:
    """Read a log of any known format, recognised by its first bytes, else by its suffix.

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
            head = handle.read(8)
        if head.startswith(_ULOG) or path.suffix.lower() in ULOG_SUFFIXES:
            from aerodb.storage.readers.ulog import read_ulog

            return read_ulog(path, topics)
        if head.startswith(_MCAP) or path.suffix.lower() == _MCAP_SUFFIX:
            from aerodb.storage.readers.mcap import read_mcap

            return read_mcap(path)
        if head.startswith(_DATAFLASH) or path.suffix.lower() == DATAFLASH_SUFFIX:
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
