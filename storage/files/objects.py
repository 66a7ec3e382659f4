"""Stored files as objects of an S3 service. The name of an object is the path of its file and the
sha256 of its bytes; it is uploaded once and never changed.

If two writers write different bytes for one file, there are two objects, and the row in the
catalogue says which one counts. A damaged or incomplete object is detected by its name and refused.
Endpoint and credentials are read from the environment variables of AWS.
"""

import hashlib
import os
import re
import time
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, BinaryIO, Final
from urllib.parse import urlsplit

from aerodb.errors import AeroError, InputError, StoreBusyError, StoreError
from aerodb.storage.catalogue import StoredFile
from aerodb.storage.disk_errors import remove, temporary_beside, translated_disk_errors
from aerodb.storage.workspace import put_in_place
from aerodb.storage.workspace_settings import (
    FILE,
    SettingsError,
    StoreSettings,
    unreadable_settings,
)
from aerodb.support import parsed_toml, validated

_BLOCK: Final = 8 << 20
#: Files up to this size are uploaded in one atomic request: less than the part size of the
#: library's multipart upload.
_AT_ONCE: Final = 4 << 20
#: Maximum size of an object that the service copies.
_COPIED: Final = 5 << 30
#: Longest time for a connection [s].
_CONNECT: Final = 5.0
#: Longest time without an answer [s], longer because a large object takes its time.
_ANSWER: Final = 30.0
#: Number of attempts, the first included: a single failure often passes.
_ATTEMPTS: Final = 3
_NAMED: Final = re.compile(r"AWS Error ([A-Z_0-9]+)(?: \(HTTP status (\d+)\))?")
_PASSING: Final = re.compile(
    r"NETWORK_CONNECTION|SLOW_DOWN|THROTTLING|REQUEST_TIMEOUT|SERVICE_UNAVAILABLE|INTERNAL_FAILURE"
)
_REFUSED: Final = re.compile(r"ACCESS|SIGNATURE|TOKEN|CLIENT|EXPIRED|OPT_IN")
#: The library reports the same error for missing permissions and for archived objects.
_WHO: Final = (
    "check $AWS_ACCESS_KEY_ID, $AWS_SECRET_ACCESS_KEY and their permissions. Restore an archived"
    " object (class GLACIER, for example), and exclude this prefix from the bucket's archiving"
    " rules. Then run again"
)
_WHERE: Final = (
    f"create the bucket, or correct [store] url in {FILE}, $AWS_ENDPOINT_URL or $AWS_REGION"
)
#: Said of an archived object; the library has no name for this error.
_ARCHIVED: Final = "object's storage class"
#: The library reads an object into a buffer of its size. A longer answer of the service, an
#: error, does not fit there and is lost; what is left is this text.
_CUT: Final = "flush response stream"
#: Pause before an object is read again [s]: a service that is too busy answers so as well.
_PAUSE: Final = 0.2
_HASH: Final = re.compile(r"(.+)\.([0-9a-f]{64})")


class DamagedObject(StoreError):
    """The bytes of an object differ from those that were stored; the service itself works."""


@dataclass(frozen=True)
class Objects:
    """The objects below `url` (``s3://bucket/prefix``); safe to use from several threads."""

    url: str
    _service: Any

    def put(self, path: Path, place: str, sha256: str = "", is_new: bool = False) -> StoredFile:
        """Upload the file at `path` as the stored file `place` (relative), atomically.

        sha256 : expected hash, where known; InputError when the file has another one. is_new : the
        object is known to be missing or incomplete; otherwise this is checked first, because a
        complete object is never uploaded again. Raises StoreBusyError when the service cannot be
        reached, StoreError when it refuses the request.
        """
        with path.open("rb") as file:  # stays the same file even if its path is replaced
            stored = StoredFile(place, hashlib.file_digest(file, "sha256").hexdigest(), file.tell())
            if sha256 and stored.sha256 != sha256:
                raise InputError(
                    "the file changed while it was read",
                    str(path),
                    "wait until it is written completely",
                )
            file.seek(0)
            if is_new or not self._is_whole(stored):
                self._upload(file, stored)
        return stored

    def _upload(self, file: BinaryIO, stored: StoredFile) -> None:
        """Closing the library's stream completes the upload even after an error. So a file that
        takes several requests is uploaded under a temporary name and copied on the service once it
        is complete (unless it is too large to copy)."""
        name = self._name(stored)
        if stored.size <= _AT_ONCE:
            data = file.read()  # before the stream is opened
            with (
                self._faults(stored),
                self._service.open_output_stream(name, compression=None) as stream,
            ):
                stream.write(data)
            return
        own = f"{name}.{os.urandom(8).hex()}" if stored.size <= _COPIED else name
        try:
            with (
                self._faults(stored),
                self._service.open_output_stream(own, compression=None) as stream,
            ):
                while block := file.read(_BLOCK):
                    stream.write(block)
            if own != name:
                with self._faults(stored):
                    self._service.copy_file(own, name)
        finally:
            if own != name:
                with suppress(OSError):
                    self._service.delete_file(own)

    def fetch(self, stored: StoredFile, place: Path) -> bool:
        """Download the object of a file to `place`, completely or not at all; returns whether there
        is an object.

        Raises DamagedObject when its bytes are not those that were stored, StoreError when the disk
        or the service refuses, StoreBusyError when the service cannot be reached.
        """
        blocks = self.blocks(stored)
        if blocks is None:
            return False
        with translated_disk_errors(place):
            place.parent.mkdir(parents=True, exist_ok=True)
            temporary = temporary_beside(place)
            try:
                with temporary.open("wb") as file:
                    for block in blocks:
                        file.write(block)
                put_in_place(temporary, place)
            except BaseException:
                remove(temporary)
                raise
        return True

    def blocks(self, stored: StoredFile) -> Iterator[bytes] | None:
        """Iterate over the bytes of a file's object in blocks; None if there is no object. Raises
        as `fetch`, at the end at the latest."""
        with self._faults(stored):
            try:
                stream = self._service.open_input_stream(self._name(stored), compression=None)
            except FileNotFoundError:
                self.require_bucket()
                return None
        return self._checked(stream, stored)

    def _checked(self, stream: Any, stored: StoredFile) -> Iterator[bytes]:
        digest = hashlib.sha256()
        with closing(stream), self._faults(stored):
            while block := _read(stream):
                digest.update(block)
                yield block
        if digest.hexdigest() != stored.sha256:
            remedy = "run `aerodb verify --fetch`, which says how to recover the file"
            raise DamagedObject(
                "its bytes differ from those that were stored", self.address(stored), remedy
            )

    def has(self, stored: StoredFile) -> bool:
        """Return whether the complete object of a file (`StoredFile`, its size [bytes]) exists;
        StoreError without the bucket."""
        is_whole = self._is_whole(stored)
        if not is_whole:
            self.require_bucket()
        return is_whole

    def _is_whole(self, stored: StoredFile) -> bool:
        with self._faults(stored):
            status = self._service.get_file_info(self._name(stored))
        return bool(status.is_file and status.size == stored.size)

    def require_bucket(self) -> None:
        """Raise StoreError when the bucket does not exist; a missing object means nothing then.
        StoreBusyError where the service cannot be reached; see `translated_object_errors`."""
        bucket = self._root.partition("/")[0]
        with self._faults(None):
            if not self._service.get_file_info(bucket).type:  # NotFound is 0
                raise StoreError("the bucket does not exist", self.url, _WHERE)

    def below(self, folder: str) -> dict[str, tuple[StoredFile, float]]:
        """Address -> file, and the time of its upload [s since 1970], for all objects below a
        `folder` of the store.

        An object without a hash in its name was not written by aerodb: its `path` is its own name,
        and its hash is empty.
        """
        objects = {}
        for entry in self._listed(folder, recursive=True):
            if entry.is_file:
                name = entry.path.removeprefix(f"{self._root}/")
                parts = _HASH.fullmatch(name)
                file = (
                    StoredFile(parts[1], parts[2], entry.size)
                    if parts
                    else StoredFile(name, "", entry.size)
                )
                objects[f"s3://{entry.path}"] = (file, entry.mtime_ns / 1e9)
        return objects

    def folders(self, folder: str) -> list[str]:
        """Return the subfolders of a `folder` of the store: the folders of its fan-out. StoreError
        as of `require_bucket`."""
        listed = self._listed(folder, recursive=False)
        return sorted(
            entry.path.removeprefix(f"{self._root}/") for entry in listed if not entry.is_file
        )

    def _listed(self, folder: str, recursive: bool) -> list[Any]:
        from pyarrow.fs import FileSelector

        with self._faults(None):
            selected = FileSelector(
                f"{self._root}/{folder}", recursive=recursive, allow_not_found=True
            )
            listed: list[Any] = self._service.get_file_info(selected)
        if not listed:
            self.require_bucket()
        return listed

    def address(self, stored: StoredFile) -> str:
        """Address of a file's object, as used by S3 tools."""
        return f"s3://{self._name(stored)}"

    @property
    def _root(self) -> str:
        return self.url.removeprefix("s3://").rstrip("/")

    def _name(self, stored: StoredFile) -> str:
        return f"{self._root}/{stored.path}.{stored.sha256}"

    @contextmanager
    def _faults(self, stored: StoredFile | None) -> Iterator[None]:
        where = self.url if stored is None else self.address(stored)
        with translated_object_errors(where):
            yield


def _read(stream: Any) -> bytes:
    """The next block of an object; attempted again when the service answered with an error."""
    attempt = 1
    while True:
        try:
            return bytes(stream.read(_BLOCK))
        except OSError as error:
            if _CUT not in str(error) or attempt == _ATTEMPTS:
                raise
        time.sleep(_PAUSE * attempt)
        attempt += 1


@contextmanager
def translated_object_errors(where: str) -> Iterator[None]:
    """Context manager that raises errors of an S3 service as StoreError with a remedy, those that
    pass (HTTP 5xx, network) as StoreBusyError. Errors of the disk stay OSError, for
    `translated_disk_errors`."""
    try:
        yield
    except OSError as error:
        if isinstance(error, FileNotFoundError):
            raise StoreBusyError(
                "this object was deleted while it was read", where, "run again"
            ) from error
        if isinstance(error, AeroError) or error.errno:  # the disk's, not the service's
            raise
        text = str(error).splitlines()[0]
        named = _NAMED.search(text)
        name, status = (named[1], named[2] or "") if named else ("", "")
        if _CUT in text:
            raise StoreError(
                "the object store refuses access or is too busy: it answers with an error that is"
                " longer than the object",
                where,
                _WHO,
            ) from error
        if _PASSING.search(name) or status.startswith("5") or "curlCode" in text:
            why = text.rpartition("Details: ")[2][:200]
            remedy = "check the network and the service, then run again"
            raise StoreBusyError(
                f"the object store cannot be reached: {why}", where, remedy
            ) from error
        if name == "NO_SUCH_BUCKET":
            raise StoreError("the bucket does not exist", where, _WHERE) from error
        if _REFUSED.search(name) or status in ("401", "403") or _ARCHIVED in text:
            why = "storage class" if _ARCHIVED in text else name
            raise StoreError(f"the object store refuses access ({why})", where, _WHO) from error
        raise StoreError(
            f"the object store cannot execute this request: {text[:300]}", where, _WHERE
        ) from error


def objects_of(root: Path) -> Objects | None:
    """The object store that the settings of the workspace folder `root` name; None when files are
    stored in the folder only.

    Raises SettingsError for invalid settings, StoreError for invalid environment variables.
    """
    try:
        written = (root / FILE).stat().st_mtime_ns
    except FileNotFoundError:
        return None
    except OSError as error:
        raise _unreadable(root / FILE, error) from error
    url = _store(root, written).url
    return opened(url, os.environ) if url else None


@lru_cache(maxsize=16)
def _store(root: Path, _written: int) -> StoreSettings:
    """The section ``[store]`` alone: errors in other sections do not block access to the store."""
    path = root / FILE
    try:
        section = parsed_toml(path.read_text(encoding="utf-8"), str(path)).get("store", {})
    except (OSError, UnicodeDecodeError, InputError) as error:
        raise _unreadable(path, error) from error
    try:
        return validated(StoreSettings, section, f"{path}: store")
    except InputError as error:
        raise SettingsError(error.what, error.where, error.remedy) from error


def _unreadable(path: Path, error: Exception) -> SettingsError:
    return unreadable_settings(path, error, "correct them: they may name the object store")


def opened(url: str, environment: Mapping[str, str]) -> Objects:
    """Return the objects below `url`, at the service and with the credentials that `environment`
    names (``AWS_*``); errors come with the first request."""
    who = {name: value for name, value in environment.items() if name.startswith("AWS_")}
    return Objects(url, _connected(tuple(sorted(who.items())), os.getpid()))


@lru_cache(maxsize=4)
def _connected(who: tuple[tuple[str, str], ...], _process: int) -> Any:
    """One connection per process and environment: a forked process must not use its parent's."""
    from pyarrow.fs import AwsStandardS3RetryStrategy, S3FileSystem

    given = dict(who)
    address = given.get("AWS_ENDPOINT_URL_S3") or given.get("AWS_ENDPOINT_URL") or ""
    try:
        place = urlsplit(address)
        usable = (
            place.scheme in ("http", "https")
            and place.hostname
            and place.port != 0
            and not place.path.strip("/")
        )
    except ValueError:  # a bracket or a port that is none
        usable = False
    if address and (not usable or place.username):
        raise StoreError(
            "not an address of the form https://HOST:PORT",
            "$AWS_ENDPOINT_URL",
            "correct it, or unset it to use AWS itself",
        )
    with translated_object_errors(address or "AWS"):
        return S3FileSystem(
            # named here, as the library reads neither the endpoint nor, in all places, the region
            # from the environment
            endpoint_override=place.netloc or None,
            scheme=place.scheme or "https",
            region=given.get("AWS_REGION") or given.get("AWS_DEFAULT_REGION"),
            connect_timeout=_CONNECT,
            request_timeout=_ANSWER,
            retry_strategy=AwsStandardS3RetryStrategy(max_attempts=_ATTEMPTS),
            allow_delayed_open=True,  # a small file costs one request
        )
