"""Backup and restore of a workspace: one consistent state of the catalogue, and every file that it
names.

The catalogue is copied first (one consistent state, while others may write), always into an SQLite
file; so a backup can be restored into another database, which moves a catalogue between SQLite and
PostgreSQL. Stored files exist before their rows and do not change, so everything that the copy
names can be copied afterwards. A further backup into the same folder copies only new files. The
manifest defines the backup; it is written last and contains its own hash. An interrupted backup has
no manifest, or still that of the previous backup, which remains complete.
"""

import hashlib
import json
import shutil
import sqlite3
from collections.abc import Collection, Iterable, Iterator
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from itertools import chain
from pathlib import Path
from typing import Any, Final

from aerodb.errors import InputError, StoreError
from aerodb.storage.catalogue import (
    HEAD,
    Catalogue,
    CatalogueLocation,
    StoredFile,
    catalogue_location,
    connected_to_read,
    copy_catalogue,
    measured,
)
from aerodb.storage.disk_errors import translated_disk_errors
from aerodb.storage.files import INDEX, STORE, DamagedObject, Objects, files_of, objects_of, push
from aerodb.storage.inbox import REASON
from aerodb.storage.upkeep.audit import Audit
from aerodb.storage.upkeep.problems import CHAIN, ORPHAN_OBJECT, WorkspaceProblem, require_clean
from aerodb.storage.upkeep.restored_settings import quiet
from aerodb.storage.upkeep.verification import verify
from aerodb.storage.workspace import Workspace, has_link, has_sha256, write_atomically
from aerodb.storage.workspace_settings import FILE as SETTINGS

_MANIFEST: Final = "backup.json"
_PARTIAL: Final = "catalogue.partial"
_FORMAT: Final = 2


@dataclass(frozen=True)
class Backup:
    """Content of a backup: number of files and bytes, number of files copied this time, and files
    that differ from what was stored (`problems`). sha256 : of its manifest, which holds the hash of
    the catalogue, which holds those of the files; who notes it elsewhere can later tell whether the
    backup is still this one."""

    files: int
    bytes: int
    copied: int
    problems: tuple[WorkspaceProblem, ...]
    sha256: str = ""


def back_up(workspace: Workspace, target: Path) -> Backup:
    """Copy the workspace to the folder `target`, which is new or contains an earlier backup.

    A file whose bytes differ from those that were stored is named in `problems` and not copied; a
    copy in an earlier backup is kept. Links and pipes in quarantine are not copied, because they do
    not belong to the workspace. Raises InputError for a folder with other content, StoreError when
    the disk is full.
    """
    _claim(workspace, target)
    with translated_disk_errors(target):
        partial = target / _PARTIAL
        _copy_catalogue(catalogue_location(workspace.catalogue), partial)
        quarantine = list(_in_quarantine(workspace.root))
        with Catalogue.in_file(partial) as snapshot:
            copy = _copy_files(
                workspace, chain(_named(workspace.root, snapshot, target), quarantine), target
            )
        _as_one_file(partial)
        settings = workspace.root / SETTINGS
        if settings.is_file():
            write_atomically(target / SETTINGS, lambda temporary: _copy(settings, temporary))
        sha256, size = measured(partial)
        name = f"catalogue-{sha256[:16]}.backup"
        partial.rename(target / name)
        manifest = {
            "format": _FORMAT,
            "made_utc": datetime.now(UTC).isoformat(timespec="seconds"),
            "workspace": str(workspace.root),
            "schema": HEAD,
            "catalogue": {"name": name, "sha256": sha256, "size": size},
            "files": copy.files,
            "bytes": copy.bytes,
            "problems": [problem.where for problem in copy.problems],
            "quarantine": [file.path for file in quarantine],
            "settings": _text_of(target / SETTINGS) if settings.is_file() else None,
        }
        write_atomically(target / _MANIFEST, lambda temporary: _write(temporary, _sealed(manifest)))
        for older in target.glob("catalogue-*.backup"):
            if older.name != name:
                older.unlink()
    return replace(copy, sha256=_hash(manifest))


def restore(
    source: Path, root: Path, settings: Path | None = None, sha256: str = ""
) -> dict[str, Any]:
    """Restore the backup in the folder `source` as the workspace `root`, which must not exist yet.

    settings : file that replaces the settings of the backup; of those, the ones that run commands
    or connect elsewhere are left out (`restored_settings`). The catalogue goes into the database
    that `settings` name, which must be empty. sha256 : of the manifest, as `back_up` gave it.
    Everything is verified before the folder gets its name. Returns the manifest with `problems`
    (`WorkspaceProblem` as dictionaries), differences that already existed when the backup was made,
    its `sha256`, and `left_off`, settings that are to be confirmed. Raises InputError for an
    incomplete backup, another one than `sha256` says, and an existing target; nothing is changed
    then.
    """
    manifest = manifest_of(source)
    found = _hash(manifest)
    if sha256 and sha256 != found:
        raise InputError(
            f"this is not the backup that was meant: the hash of its manifest is {found}",
            str(source / _MANIFEST),
            "use the backup whose hash was noted",
        )
    _require_free(root)
    if not root.absolute().parent.is_dir():
        raise InputError(
            "its parent folder does not exist", str(root), "name a path in an existing folder"
        )
    own, left_off = ("", ()) if settings else _own_settings(source, manifest)
    left: list[WorkspaceProblem] = []
    inodes: list[int] = []

    def write(temporary: Path) -> None:
        workspace = Workspace.open(temporary)
        if settings is not None:
            _copy(settings, workspace.root / SETTINGS)
        elif own:
            (workspace.root / SETTINGS).write_bytes(own.encode("utf-8", "surrogateescape"))
        objects = objects_of(workspace.root)
        place = catalogue_location(workspace.catalogue)
        file = workspace.root / _PARTIAL if place.url else workspace.catalogue
        _copy(_catalogue_file(source, manifest), file)
        with Catalogue.in_file(file) as snapshot:
            for named in _named(source, snapshot, source):
                _take(source, workspace, named, manifest["problems"])
            for path in manifest["quarantine"]:
                held = _inside(source, path, ("quarantine",))
                workspace.resolve(path).parent.mkdir(
                    exist_ok=True
                )  # a folder whose files are gone is found by what follows
                _take(source, workspace, _quarantined(held, source), manifest["problems"])
            if objects is not None:
                push(workspace, snapshot)
            with _moved(snapshot, place) as catalogue:
                # Objects newer than the backup do not belong to any of its rows.
                problems = [
                    problem
                    for problem in verify(workspace, catalogue).problems
                    if problem.kind != ORPHAN_OBJECT
                ]
                left.extend(
                    problem
                    for problem in problems
                    # A history that was rewritten before the backup is told, and kept.
                    if problem.kind == CHAIN or _is_known(problem, workspace, manifest["problems"])
                )
                require_clean([problem for problem in problems if problem not in left], str(source))
        if place.url:
            file.unlink()
        inodes.append(temporary.stat().st_ino)

    write_atomically(root.absolute(), write, keep=True)
    if root.stat().st_ino != inodes[0]:  # somebody else put a folder there meanwhile, which stays
        _require_free(root)
    problems = [asdict(problem) for problem in left]
    manifest.pop("settings", None)
    return {**manifest, "problems": problems, "sha256": found, "left_off": list(left_off)}


def _own_settings(source: Path, manifest: dict[str, Any]) -> tuple[str, tuple[str, ...]]:
    """The settings of a backup without what has to be confirmed, and that; a backup of before has
    them in a file only."""
    file = _inside(source, SETTINGS)
    text = manifest.get("settings")
    if "settings" not in manifest and file.is_file():
        text = _text_of(file)
    return quiet(text, str(file)) if isinstance(text, str) else ("", ())


def _text_of(path: Path) -> str:
    return path.read_bytes().decode("utf-8", "surrogateescape")


def _catalogue_file(source: Path, manifest: dict[str, Any]) -> Path:
    """Path of the catalogue in a backup; InputError if its bytes differ from those that were
    written."""
    stated = manifest["catalogue"]
    file = _inside(source, Path(stated["name"]).name)
    if not file.is_file() or measured(file) != (stated["sha256"], stated["size"]):
        raise InputError(
            "its catalogue differs from the one that was written", str(source), "use another backup"
        )
    return file


@contextmanager
def _moved(snapshot: Catalogue, place: CatalogueLocation) -> Iterator[Catalogue]:
    """The catalogue of the new workspace: the file itself, or its rows in a database, which remain
    there if all is well."""
    if not place.url:
        yield snapshot
        return
    with Catalogue.open(place.path) as catalogue, catalogue.transaction():
        copy_catalogue(snapshot, catalogue)
        yield catalogue


def manifest_of(folder: Path) -> dict[str, Any]:
    """Return the manifest of a backup (JSON, `_MANIFEST`, sizes [bytes]); InputError if the folder
    has none, or if the backup was interrupted or is damaged."""
    try:
        text = (folder / _MANIFEST).read_bytes()
    except OSError as error:
        if (folder / _PARTIAL).exists():
            raise InputError(
                "this backup was interrupted",
                str(folder),
                "run it again: files that are complete are not copied again",
            ) from error
        raise InputError(
            "there is no backup here", str(folder), "name the folder that `aerodb backup` wrote"
        ) from error
    try:
        manifest: dict[str, Any] = json.loads(text.decode("ascii"))
        stated = manifest.pop("sha256", None)
    except (ValueError, AttributeError, TypeError):
        manifest, stated = {}, None
    if manifest.get("format") == 1 and stated is None:
        remedy = "run `aerodb backup` into it again: only what is new is copied"
        raise InputError("this backup has an older format", str(folder), remedy)
    if _sealed(manifest) != text:
        remedy = (
            "use another backup, or, if the workspace still exists, back up into this folder again"
        )
        raise InputError(
            "its manifest differs from the one that was written", str(folder / _MANIFEST), remedy
        )
    if manifest.get("format") != _FORMAT:
        raise InputError("this backup has a newer format", str(folder), "update aerodb")
    return manifest


def _sealed(manifest: dict[str, Any]) -> bytes:
    """A manifest as it is written, with a hash of its content, so that any change is detected."""
    return (json.dumps({**manifest, "sha256": _hash(manifest)}, indent=1) + "\n").encode("ascii")


def _hash(manifest: dict[str, Any]) -> str:
    return hashlib.sha256(json.dumps(manifest, indent=1).encode("ascii")).hexdigest()


def _require_free(root: Path) -> None:
    if root.exists() or root.is_symlink():
        raise InputError(
            "this path already exists",
            str(root),
            "name a folder that does not exist yet",
        )


def _is_known(problem: WorkspaceProblem, workspace: Workspace, listed: Collection[str]) -> bool:
    """Return whether a problem already existed when the backup was made: in the file, in its
    content, or in the index of its recording."""
    if problem.kind == "catalogue":
        return False
    if problem.kind == "no hash":  # the catalogue and the index say so, and they are sound
        return workspace.resolve(problem.where).is_file()
    folder = problem.where.rpartition("/")[0]
    if problem.kind == "not put" and problem.where.endswith(
        f"/{INDEX}"
    ):  # nor is the topic that it needs
        return any(where.startswith(f"{folder}/") for where in listed)
    return f"{folder}/{INDEX}" in listed or any(
        f"{where}/".startswith(f"{problem.where}/") for where in listed
    )


def _claim(workspace: Workspace, target: Path) -> None:
    """Create the folder, or check that it contains nothing but an earlier backup."""
    here, there = workspace.root.resolve(), target.resolve()
    if there.is_relative_to(here) or here.is_relative_to(there):
        raise InputError(
            "a backup cannot be inside its own workspace, or contain it",
            str(target),
            "choose another folder, best on another disk",
        )
    try:
        with translated_disk_errors(target):
            target.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        raise InputError("not a folder", str(target), "choose another one") from error
    if (
        any(target.iterdir())
        and not (target / _PARTIAL).exists()
        and not (target / _MANIFEST).exists()
    ):
        raise InputError(
            "the folder is not empty and not a backup", str(target), "choose a new one"
        )


def _copy_catalogue(place: CatalogueLocation, target: Path) -> None:
    """Copy one consistent state of a database into a file; others may write to the database
    meanwhile."""
    for left in (
        target,
        target.with_name(f"{target.name}-wal"),
        target.with_name(f"{target.name}-shm"),
    ):
        left.unlink(missing_ok=True)  # the log of an interrupted copy does not belong to this one
    if place.url:
        with Catalogue.open(place.path, create=False) as live, Catalogue.in_file(target) as copy:
            return copy_catalogue(live, copy)
    source = place.path
    try:
        with closing(connected_to_read(source)) as reading, closing(sqlite3.connect(target)) as to:
            reading.backup(to)
    except sqlite3.OperationalError as error:
        raise StoreError(
            f"the catalogue cannot be copied: {error}",
            str(source),
            "free disk space, then run the backup again",
        ) from error


def _as_one_file(catalogue: Path) -> None:
    """Merge the write-ahead log into the file."""
    connection = sqlite3.connect(catalogue)
    connection.execute("PRAGMA journal_mode = DELETE")
    connection.close()


def _named(root: Path, catalogue: Catalogue, copied: Path) -> Iterator[StoredFile]:
    """All files of the store that a catalogue names, relative to `root`; `sha256` is empty if
    unknown.

    copied : folder in which the index of a recording is found after the caller has processed it;
    the index names the following files.
    """
    for file in catalogue.every_stored_file():
        yield file
        if file.path.endswith(f"/{INDEX}") and has_sha256(copied / file.path, file.sha256):
            folder = file.path.removesuffix(INDEX)
            for name, (sha256, size) in files_of(copied / folder).items():
                yield StoredFile(folder + name, sha256, size)
    for path in Audit.of(catalogue).results_without_file():
        yield StoredFile(path, "", _size(root / path))


def _in_quarantine(root: Path) -> Iterator[StoredFile]:
    """The files that each folder in quarantine contains or should contain: a log and the reason;
    nothing for a link or a pipe."""
    for folder in sorted(
        entry
        for entry in (root / "quarantine").iterdir()
        if entry.is_dir() and not entry.is_symlink()
    ):
        held = next(
            (path for path in sorted(folder.iterdir()) if path.name.startswith(("aside", "log"))),
            folder / "log",
        )
        if held.name != "aside" or (held.is_file() and not held.is_symlink()):
            yield _quarantined(held, root)
            yield _quarantined(folder / REASON, root)


def _quarantined(path: Path, root: Path) -> StoredFile:
    sha256 = path.parent.name if path.name.startswith("log") else ""
    return StoredFile(path.relative_to(root).as_posix(), sha256, _size(path))


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0


def _take(source: Path, workspace: Workspace, file: StoredFile, listed: Collection[str]) -> None:
    """Copy a file from a backup, unless it was damaged when the backup was made, or is missing;
    verification reports these."""
    copy = _inside(source, file.path, (*STORE, "quarantine"))
    place = workspace.resolve(file.path)
    if copy.is_file() and (
        file.path not in listed or not file.sha256 or has_sha256(copy, file.sha256)
    ):
        place.parent.mkdir(parents=True, exist_ok=True)
        _copy(copy, place)


def _inside(source: Path, name: str, folders: Collection[str] = ()) -> Path:
    """Return the path of a file of the backup `source`, below one of `folders` where there are any.

    InputError for a link, whose bytes were never backed up, and for a name that leads elsewhere:
    restoring it would replace the settings, say.
    """
    path = source / name
    parts = path.relative_to(source).parts if path.is_relative_to(source) else ()
    if not parts or ".." in parts or (folders and parts[0] not in folders):
        what = "it names a file that is none of a workspace's store"
    elif has_link(path, source):
        what = "a link is in place of a file of this backup"
    else:
        return path
    remedy = "use another backup: this one was changed after it was written"
    raise InputError(what, str(path)[:200], remedy)


def _copy_files(workspace: Workspace, named: Iterable[StoredFile], target: Path) -> Backup:
    files, size, copied = 0, 0, 0
    problems: list[WorkspaceProblem] = []
    objects = objects_of(workspace.root)
    for file in named:
        source, place = workspace.resolve(file.path), target / file.path
        files, size = files + 1, size + file.size
        if _is_copied(source, place) or (
            objects is not None and not source.exists() and has_sha256(place, file.sha256)
        ):
            continue
        what = _copied_wrongly(workspace.root, source, place, file)
        if what and objects is not None and file.sha256:
            what = _fetched_wrongly(objects, place, file, what)
        if what:
            problems.append(
                WorkspaceProblem(
                    "changed", what, file.path, "run `aerodb verify`, which says how to repair it"
                )
            )
        else:
            copied += 1
    return Backup(files, size, copied, tuple(problems))


def _is_copied(source: Path, place: Path) -> bool:
    """Return whether an earlier backup copied this file; a file that was written again is newer
    than its copy."""
    if not (source.is_file() and place.is_file()) or source.is_symlink() or place.is_symlink():
        return False
    one, other = source.stat(), place.stat()
    return (one.st_size, one.st_mtime_ns) == (other.st_size, other.st_mtime_ns)


def _copied_wrongly(root: Path, source: Path, place: Path, file: StoredFile) -> str:
    """Copy a file if it has the bytes that were stored; otherwise return what is wrong."""
    if not source.is_file() or has_link(source, root / file.path.partition("/")[0]):
        return "it is missing in the store, or a link is in its place"
    try:
        sha256, _ = measured(source)
    except OSError as error:
        return f"it cannot be read: {error.strerror or error}"
    if file.sha256 and sha256 != file.sha256:
        return "its bytes differ from those that were stored"
    place.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(place, lambda temporary: _copy(source, temporary))
    return ""


def _fetched_wrongly(objects: Objects, place: Path, file: StoredFile, what: str) -> str:
    """Download a file that is missing or damaged in the folder (`what` says which); otherwise
    return what is wrong in both places."""
    try:
        return "" if objects.fetch(file, place) else f"{what}, and it is not in the object store"
    except DamagedObject as error:
        return f"{what}; in the object store, {error.what}"


def _copy(source: Path, target: Path) -> None:
    shutil.copy2(source, target)


def _write(path: Path, text: bytes) -> None:
    path.write_bytes(text)
