"""A log inside an archive (``.zip``, ``.gz``), read as the log itself: exactly one, of bounded
size.

The identity is that of the archive's bytes. What an archive says of its sizes is not believed: what
comes out is counted.
"""

import gzip
import hashlib
import tempfile
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path, PurePosixPath
from typing import IO, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.recording import Recording

ZIP: Final = b"PK\x03\x04"
GZIP: Final = b"\x1f\x8b"
#: Largest log that is unpacked [bytes], and how many times the archive's size it may be: logs of
#: text shrink to a twentieth, what is made to fill a disk to a thousandth.
_LARGEST: Final = 8 << 30
_MOST_TIMES: Final = 100
#: Size [bytes] up to which the ratio is not looked at.
_SMALL: Final = 1 << 20
_CHUNK: Final = 1 << 20
#: Most members of an archive that are looked at, and of those that a sentence names.
_MEMBERS: Final = 10_000
_NAMED: Final = 3
#: Suffixes of logs and tables, by which the one log among other files is known.
LOGS: Final = frozenset(
    (".ulg", ".ulog", ".bin", ".log", ".mcap", ".tlog", ".csv", ".tsv", ".txt", ".asc", ".dat")
) | frozenset((".mat", ".h5", ".hdf5", ".parquet", ".bag", ".db3", ".lvm"))


def read_packed(path: Path, read: Callable[[Path], Recording]) -> Recording:
    """Read the one log in a zip or gzip archive with `read`, unpacked beside nothing of the user's.

    Returns its Recording, times [s], with source, hash and size of the archive.

    Raises InputError for an archive that is damaged, encrypted or too large, that holds no log or
    several, or a log that cannot be read.
    """
    size = path.stat().st_size
    try:
        with tempfile.TemporaryDirectory(prefix="aerodb-") as folder, path.open("rb") as handle:
            packed = handle.read(4) == ZIP
            handle.seek(0)
            if packed:
                with zipfile.ZipFile(handle) as archive:
                    member = _log_of(archive, path)
                    with archive.open(member) as inside:
                        name = PurePosixPath(member.filename.replace("\\", "/")).name
                        log = _unpacked(inside, Path(folder), name, size, path)
            else:
                with gzip.GzipFile(fileobj=handle) as inside:
                    log = _unpacked(inside, Path(folder), path.stem, size, path)
            found = _read(log, read, path)
            handle.seek(0)
            sha256 = hashlib.file_digest(handle, "sha256").hexdigest()
    except (zipfile.BadZipFile, EOFError, zlib.error, gzip.BadGzipFile) as error:
        what = f"a damaged archive: {str(error)[:100]}"
        raise InputError(what, str(path), "copy it again, or unpack it by hand") from error
    except (NotImplementedError, RuntimeError) as error:  # a method of packing, or a password
        what = f"an archive that cannot be unpacked: {str(error)[:100]}"
        raise InputError(what, str(path), "unpack it first: unzip") from error
    return replace(found, source=str(path), sha256=sha256, size=size)


def _read(log: Path, read: Callable[[Path], Recording], path: Path) -> Recording:
    with log.open("rb") as handle:
        head = handle.read(4)
    if head.startswith((ZIP, GZIP)):
        what = "an archive within an archive"
        raise InputError(what, str(path), "unpack it first")
    try:
        found = read(log)
        # The unpacked file goes: what a reader would fetch later is fetched now.
        topics = {
            name: replace(topic, time=np.asarray(topic.time), fields=dict(topic.fields.items()))
            for name, topic in found.topics.items()
        }
        return replace(found, topics=topics)
    except InputError as error:
        raise InputError(f"the log in it: {error.what}", str(path), error.remedy) from error


def _log_of(archive: zipfile.ZipFile, path: Path) -> zipfile.ZipInfo:
    """The one member that is a log."""
    members = archive.infolist()
    if any(member.filename == "[Content_Types].xml" for member in members[:_MEMBERS]):
        what = "an Excel file (.xlsx): not read"
        raise InputError(what, str(path), "save the sheet of the table as CSV")
    files = [
        member
        for member in members[:_MEMBERS]
        if not member.is_dir() and not member.filename.startswith("__MACOSX/")
    ]
    logs = [m for m in files if PurePosixPath(m.filename.lower()).suffix in LOGS]
    found = logs or (files if len(files) == 1 else [])
    if len(found) == 1 and len(members) <= _MEMBERS:
        return found[0]
    named = ", ".join(f"{member.filename:.60}" for member in found[:_NAMED])
    more = f" and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
    if found:
        what = f"an archive that holds {len(found)} logs: {named}{more}"
        raise InputError(what, str(path), "unpack it, and give the logs: unzip")
    what = f"an archive (zip) without a log: {len(files)} files"
    raise InputError(what, str(path), "give the log itself")


def _unpacked(
    inside: IO[bytes] | gzip.GzipFile, folder: Path, name: str, size: int, path: Path
) -> Path:
    """The log, unpacked; InputError if it is larger than any log of an archive of this size."""
    # Nothing of a member's path is used but its last name's suffix.
    suffix = PurePosixPath(name).suffix
    log = folder / f"log{suffix if suffix.lower() in LOGS else ''}"
    most = min(_LARGEST, max(_SMALL, _MOST_TIMES * size))
    written = 0
    with log.open("wb") as out:
        while chunk := inside.read(_CHUNK):
            written += len(chunk)
            if written > most:
                what = f"its content is over {most} bytes, {most / size:.0f} times its own size"
                raise InputError(what, str(path), "no log is packed so well: check its source")
            out.write(chunk)
    return log
