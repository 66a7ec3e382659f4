"""Files of the store as objects of an S3 service: each under its path and the sha256 of its bytes,
put once, never changed.

Two who write the same file differently make two objects: the catalogue's row says which one counts.
An object that is damaged, or was put half, is told by its name and refused. Where the service is,
and who we are, the environment variables of AWS say.
"""

import hashlib
import os
import re
import tomllib
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
from aerodb.storage.workspace_settings import FILE, SettingsError, Store
from aerodb.support import validated

_BLOCK: Final = 8 << 20
#: What is sent in one request, which the service takes whole or not at all: less than the library's
#: parts of an upload.
_AT_ONCE: Final = 4 << 20
#: The service copies no more than this.
_COPIED: Final = 5 << 30
#: Seconds until a connection, and until an answer.
_CONNECT, _ANSWER, _ATTEMPTS = 5.0, 30.0, 3
_NAMED: Final = re.compile(r"AWS Error ([A-Z_0-9]+)(?: \(HTTP status (\d+)\))?")
_PASSING: Final = re.compile(
    r"NETWORK_CONNECTION|SLOW_DOWN|THROTTLING|REQUEST_TIMEOUT|SERVICE_UNAVAILABLE|INTERNAL_FAILURE"
)
_REFUSED: Final = re.compile(r"ACCESS|SIGNATURE|TOKEN|CLIENT|EXPIRED|OPT_IN")
#: The library says the same of what we have no right to and of what is archived.
_WHO: Final = (
    "see $AWS_ACCESS_KEY_ID, $AWS_SECRET_ACCESS_KEY and the rights that they have there, and that"
    " the object is in no archive (class GLACIER, say: restore it, and keep the bucket's rules from"
    " archiving this prefix), then run again"
)
_WHERE: Final = (
    f"make the bucket, or mend [store] url in {FILE}; $AWS_ENDPOINT_URL and $AWS_REGION say where"
    " it is"
)
_HASH: Final = re.compile(r"(.+)\.([0-9a-f]{64})")


class DamagedObject(StoreError):
    """An object whose bytes are not those that were stored: it alone is at fault, not the service
    and not the way to it."""


@dataclass(frozen=True)
class Objects:
    """The objects below `url` (``s3://bucket/prefix``); safe to use from several threads."""

    url: str
    _service: Any

    def put(self, path: Path, place: str, sha256: str = "", is_new: bool = False) -> StoredFile:
        """Puts the file at `path` as that of the store at `place` (relative); there is nothing of
        it, or all of it.

        sha256 : what its bytes must be, where that is known: InputError when they are not. is_new :
        its object is not there, or not whole, as a list says; else that is asked, for what is whole
        is never sent again. Raises StoreBusyError when the service is out of reach, StoreError when
        it refuses.
        """
        with path.open("rb") as file:  # one file from here on, whoever puts another at its path
            stored = StoredFile(place, hashlib.file_digest(file, "sha256").hexdigest(), file.tell())
            if sha256 and stored.sha256 != sha256:
                raise InputError(
                    "the file changed while it was read",
                    str(path),
                    "wait until it is completely written",
                )
            file.seek(0)
            if is_new or not self._is_whole(stored):
                self._upload(file, stored)
        return stored

    def _upload(self, file: BinaryIO, stored: StoredFile) -> None:
        """Closing the library's stream completes what was sent until then, an error or not: so what
        takes several requests is sent under a name of its own, and copied on the service once it is
        whole (if that copies as much)."""
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
        """Puts the object of a file at `place`, with the bytes that were stored or not at all;
        whether there is one.

        Raises DamagedObject when its bytes are not those that were stored, StoreError when the disk
        or the service refuses, StoreBusyError when the service is out of reach.
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
        """The bytes of a file's object, block by block, None where there is none; raises as
        `fetch`, at the end at the latest."""
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
            while block := stream.read(_BLOCK):
                digest.update(block)
                yield block
        if digest.hexdigest() != stored.sha256:
            remedy = "`aerodb verify --fetch` says how what it held comes back"
            raise DamagedObject(
                "its bytes are not those that were stored", self.address(stored), remedy
            )

    def has(self, stored: StoredFile) -> bool:
        """Whether the object of a file is there, whole."""
        is_whole = self._is_whole(stored)
        if not is_whole:
            self.require_bucket()
        return is_whole

    def _is_whole(self, stored: StoredFile) -> bool:
        with self._faults(stored):
            found = self._service.get_file_info(self._name(stored))
        return bool(found.is_file and found.size == stored.size)

    def require_bucket(self) -> None:
        """StoreError when the bucket is not there: a file that is not found means nothing then."""
        bucket = self._root.partition("/")[0]
        with self._faults(None):
            if not self._service.get_file_info(bucket).type:  # NotFound is 0
                raise StoreError("there is no such bucket", self.url, _WHERE)

    def below(self, folder: str) -> dict[str, tuple[StoredFile, float]]:
        """Address -> file, and when its object was put [s since 1970], for all below a `folder` of
        the store.

        What bears no hash is no file of ours: its `path` is the object's own then, and its hash is
        empty.
        """
        found = {}
        for entry in self._listed(folder, recursive=True):
            if entry.is_file:
                name = entry.path.removeprefix(f"{self._root}/")
                parts = _HASH.fullmatch(name)
                file = (
                    StoredFile(parts[1], parts[2], entry.size)
                    if parts
                    else StoredFile(name, "", entry.size)
                )
                found[f"s3://{entry.path}"] = (file, entry.mtime_ns / 1e9)
        return found

    def folders(self, folder: str) -> list[str]:
        """The folders in a `folder` of the store: those of its fan-out."""
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
        """The object of a file as the tools of S3 call it."""
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


@contextmanager
def translated_object_errors(where: str) -> Iterator[None]:
    """Turns what an S3 service, or the way to it, says into a StoreError that says what to do."""
    try:
        yield
    except OSError as error:
        if isinstance(error, FileNotFoundError):
            raise StoreBusyError(
                "this object went away while it was read", where, "run again"
            ) from error
        if isinstance(error, AeroError) or error.errno:  # the disk's, not the service's
            raise
        text = str(error).splitlines()[0]
        named = _NAMED.search(text)
        name, status = (named[1], named[2] or "") if named else ("", "")
        if _PASSING.search(name) or status.startswith("5") or "curlCode" in text:
            why = text.rpartition("Details: ")[2][:200]
            remedy = "see to the network and the service, then run again"
            raise StoreBusyError(
                f"the object store is out of reach now: {why}", where, remedy
            ) from error
        if name == "NO_SUCH_BUCKET":
            raise StoreError("there is no such bucket", where, _WHERE) from error
        if _REFUSED.search(name) or status in ("401", "403"):
            raise StoreError(f"the object store refuses us ({name})", where, _WHO) from error
        raise StoreError(f"the object store cannot do this: {text[:300]}", where, _WHERE) from error


def objects_of(root: Path) -> Objects | None:
    """The object store of the workspace folder `root`, as its settings say; None where the folder
    itself is the store.

    Raises SettingsError for settings that cannot be used, StoreError for an environment that
    cannot.
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
def _store(root: Path, _written: int) -> Store:
    """The section ``[store]`` alone: what is wrong in another one keeps nobody from the store."""
    path = root / FILE
    try:
        return validated(
            Store,
            tomllib.loads(path.read_text(encoding="utf-8")).get("store", {}),
            f"{path}: store",
        )
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise _unreadable(path, error) from error
    except InputError as error:
        raise SettingsError(error.what, error.where, error.remedy) from error


def _unreadable(path: Path, error: Exception) -> SettingsError:
    return SettingsError(
        f"cannot be read: {error}", str(path), "mend it: it may say where the store is"
    )


def opened(url: str, environment: Mapping[str, str]) -> Objects:
    """The objects below `url`, at the service and with the credentials that `environment` names."""
    who = {name: value for name, value in environment.items() if name.startswith("AWS_")}
    return Objects(url, _connected(tuple(sorted(who.items())), os.getpid()))


@lru_cache(maxsize=4)
def _connected(who: tuple[tuple[str, str], ...], _process: int) -> Any:
    """One connection per process and environment: a process that was forked must not use its
    parent's."""
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
            "is no address like https://host:port",
            "$AWS_ENDPOINT_URL",
            "mend it, or leave it out for AWS itself",
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
