"""Verification of a workspace against its catalogue: the bytes of every file, every reference and
every id.

Files are checked folder by folder and rows in batches, so memory use does not grow with the store.
Files that another process is writing are told from abandoned ones, so verification can run at any
time.
"""

import time
from pathlib import Path
from typing import Final

from aerodb.errors import InputError
from aerodb.storage.catalogue import Catalogue, StoredFile, measured
from aerodb.storage.disk_errors import is_abandoned, is_temporary
from aerodb.storage.files import INDEX, STORE, files_of, objects_of
from aerodb.storage.upkeep.audit import Audit
from aerodb.storage.upkeep.object_verification import check_objects
from aerodb.storage.upkeep.problems import CHAIN, VerificationReport
from aerodb.storage.workspace import Workspace

#: A file younger than this [s] may still get its row.
_SETTLED: Final = 600.0
_MADE_AGAIN: Final = "remove it: it is recomputed when it is needed next"
_PUT_BACK: Final = (
    "its flight is not affected; put the original log back, from its source or a backup"
)
_TAKE_IN_AGAIN: Final = "remove this folder and ingest the log again"
_NO_LINKS: Final = "remove it, and put the file itself there, from a backup"


def verify(
    workspace: Workspace, catalogue: Catalogue, fetch: bool = False, chain: str = ""
) -> VerificationReport:
    """Verify a workspace: files by size [bytes] and sha256, the catalogue by `Audit`. Raises
    InputError when the catalogue cannot be opened.

    fetch : also read every object of the object store; otherwise only existence and size of the
    objects are checked. chain : hash with which the chain of events ended earlier; it must still
    be in it.
    """
    report, objects = VerificationReport(), objects_of(workspace.root)
    audit = Audit.of(catalogue)
    report.problems.extend(audit.problems(report.count))
    if not report.problems:
        audit.seal()
    report.chain = audit.newest_link()
    if chain and not audit.has_link(chain):
        what = f"the chain of events does not contain {chain[:80]}: events were removed or replaced"
        report.add(CHAIN, what, "table chain", "restore the workspace from a backup")
    for folder in STORE:
        for place in sorted((workspace.root / folder).iterdir()):
            _check_folder(workspace, catalogue, place, report, is_cache=objects is not None)
    for file in catalogue.every_stored_file() if objects is None else ():
        place = workspace.resolve(file.path)
        if not place.is_file():
            remedy = (
                "ingest its log again"
                if file.path.endswith(INDEX)
                else "it is recomputed when it is needed next"
            )
            remedy = _PUT_BACK if file.path.startswith("logs/") else remedy
            what = "this file is missing"
            if place.exists():
                what, remedy = "something else is in its place", f"remove it; then {remedy}"
            report.add("missing", what, file.path, remedy)
    for path in audit.results_without_file():
        report.add("no hash", "no hash of this file is recorded", path, _MADE_AGAIN)
    _check_quarantine(workspace, catalogue, report)
    if objects is not None:
        check_objects(workspace, catalogue, objects, report, fetch)
    return report


def _check_folder(
    workspace: Workspace,
    catalogue: Catalogue,
    place: Path,
    report: VerificationReport,
    is_cache: bool,
) -> None:
    """Check each file of one fan-out folder against its row; files may leave a cache meanwhile."""
    if _is_link(workspace, place, report):
        return
    entries = sorted(place.iterdir()) if place.is_dir() else [place]
    prefix = workspace.relative(place)
    rows = catalogue.stored_files(f"{prefix}/", f"{prefix}0")  # '0' follows '/'
    for entry in entries:
        if _is_link(workspace, entry, report):
            continue
        if is_temporary(entry):
            _check_temporary(workspace, entry, report)
            continue
        path = workspace.relative(entry / INDEX if entry.is_dir() else entry)
        row = rows.get(path) or catalogue.stored_file(path)  # the row may have come meanwhile
        if row is None and path.startswith("logs/") and catalogue.log(entry.name[:64]) is not None:
            row = StoredFile(
                path, entry.name[:64], entry.stat().st_size
            )  # a log's name is its hash
        if entry.is_dir() and catalogue.stored_file(workspace.relative(entry)) is not None:
            continue  # in place of a file, which is missing
        if row is None and entry.is_dir() and catalogue.log(entry.name[:64]) is not None:
            report.add("no hash", "no hash of its topics is recorded", path, _TAKE_IN_AGAIN)
        elif row is None:
            _orphan(workspace, entry, report)
        elif not entry.is_dir():
            _is_sound(entry, row, report, _PUT_BACK if path.startswith("logs/") else _MADE_AGAIN)
        elif _is_sound(entry / INDEX, row, report, _TAKE_IN_AGAIN):
            _check_recording(workspace, entry, report, is_cache)


def _is_link(workspace: Workspace, entry: Path, report: VerificationReport) -> bool:
    """Return whether an entry of the store or the quarantine is a link, which is not followed."""
    if entry.is_symlink():
        what = "it is a link: aerodb follows none here"
        report.add("link", what, workspace.relative(entry), _NO_LINKS)
    return entry.is_symlink()


def _check_temporary(workspace: Workspace, entry: Path, report: VerificationReport) -> None:
    if is_abandoned(entry):
        report.add(
            "half-written",
            "its writer ended before the file was complete",
            workspace.relative(entry),
            "remove it",
        )
    else:
        report.pending += 1


def _orphan(workspace: Workspace, entry: Path, report: VerificationReport) -> None:
    try:
        age = time.time() - entry.stat().st_mtime
    except FileNotFoundError:
        return
    if abs(age) < _SETTLED:
        report.pending += 1
        return
    what = "no row of the catalogue names it: its writer ended before the row was added"
    report.add(
        "orphan",
        what,
        workspace.relative(entry),
        "remove it, or repeat the run that wrote it, which then uses the file as it is",
    )


def _is_sound(path: Path, row: StoredFile, report: VerificationReport, remedy: str) -> bool:
    """Return whether a file has the bytes that its row says. Missing files are reported
    elsewhere."""
    try:
        sha256, size = measured(path)
    except FileNotFoundError:
        return False
    except OSError as error:
        report.add(
            "unreadable",
            error.strerror or str(error),
            row.path,
            "check the disk and the permissions, then verify again",
        )
        return False
    report.count("files")
    report.count("bytes", size)
    if (sha256, size) == (row.sha256, row.size):
        return True
    what = f"its bytes differ from those that were stored ({size} bytes, {row.size} were stored)"
    report.add("changed", what, row.path, remedy)
    return False


def _check_recording(
    workspace: Workspace, folder: Path, report: VerificationReport, is_cache: bool
) -> None:
    before = len(report.problems)
    try:
        _check_topics(workspace, folder, report)
    except (InputError, FileNotFoundError):
        if folder.exists() or not is_cache:
            raise
    if is_cache and not folder.exists():  # it left the cache as a whole: nothing was wrong
        del report.problems[before:]


def _check_topics(workspace: Workspace, folder: Path, report: VerificationReport) -> None:
    """The files of a recording against its index, which is sound."""
    known = files_of(folder)
    for name, (sha256, size) in known.items():
        if _is_link(workspace, folder / name, report):
            continue
        if not sha256:
            report.add(
                "no hash",
                "no hash of this topic is recorded",
                workspace.relative(folder / name),
                _TAKE_IN_AGAIN,
            )
            continue
        row = StoredFile(workspace.relative(folder / name), sha256, size)
        if (
            not _is_sound(folder / name, row, report, _TAKE_IN_AGAIN)
            and not (folder / name).exists()
        ):
            report.add("missing", "this topic of a recording is missing", row.path, _TAKE_IN_AGAIN)
    for entry in sorted(folder.iterdir()):
        if entry.name != INDEX and entry.name not in known:
            report.add(
                "orphan",
                "the index of the recording does not name it",
                workspace.relative(entry),
                "remove it",
            )


def _check_quarantine(
    workspace: Workspace, catalogue: Catalogue, report: VerificationReport
) -> None:
    """Check the quarantine: the name of a folder is the hash of its log, which has a row and a
    reason; links and pipes have a reason."""
    for folder in sorted(
        entry for entry in (workspace.root / "quarantine").iterdir() if entry.is_dir()
    ):
        if _is_link(workspace, folder, report):
            continue
        names = sorted(entry.name for entry in folder.iterdir())
        links = [_is_link(workspace, folder / name, report) for name in names if name != "aside"]
        if any(links):
            continue
        for name in names:
            if is_temporary(folder / name):
                _check_temporary(workspace, folder / name, report)
        log = next((folder / name for name in names if name.startswith("log")), None)
        if (log is None and "aside" not in names) or "reason.json" not in names:
            report.add(
                "missing",
                "the log or its reason is missing",
                workspace.relative(folder),
                _TAKE_IN_AGAIN,
            )
        elif log is not None and catalogue.log(folder.name) is None:
            _orphan(workspace, folder, report)
        elif log is not None:
            _is_sound(
                log,
                StoredFile(workspace.relative(log), folder.name, log.stat().st_size),
                report,
                _TAKE_IN_AGAIN,
            )
