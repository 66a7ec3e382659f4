"""Verification of the object store against the catalogue: every file has a complete object, and
there are no others; the bytes of the objects on request."""

import time
from dataclasses import replace
from typing import Final

from aerodb.storage.catalogue import Catalogue, StoredFile
from aerodb.storage.files import INDEX, DamagedObject, Objects, Part, concurrently, is_sound, parts
from aerodb.storage.upkeep.problems import ORPHAN_OBJECT, VerificationReport
from aerodb.storage.workspace import Workspace

#: An object younger than this [s] may still get its row.
_SETTLED: Final = 600.0
_LOCAL: Final = ("changed", "unreadable", "missing")


def check_objects(
    workspace: Workspace,
    catalogue: Catalogue,
    objects: Objects,
    report: VerificationReport,
    fetch: bool,
) -> None:
    """Add the problems of the object store to `report`, which already has those of the folder.

    fetch : also read every object; otherwise only size and existence are checked, which costs one
    request per thousand objects. StoreError where the store cannot be asked.
    """
    for part in parts(workspace, catalogue, objects):
        whole = [file for file in part.files if part.has(objects.address(file), file)]
        damaged = _damaged(objects, whole) if fetch else set()
        for file in filter(
            lambda file: file.sha256, part.files
        ):  # a missing hash is reported elsewhere
            _check(workspace, objects, part, file, damaged, report)
        _heal({file.path for file in whole} - damaged, report)
        _check_others(objects, part, report)


def _damaged(objects: Objects, files: list[StoredFile]) -> set[str]:
    """Paths of the files whose objects are damaged."""
    damaged: set[str] = set()

    def read(file: StoredFile) -> None:
        try:
            for _ in objects.blocks(file) or ():
                pass
        except DamagedObject:
            damaged.add(file.path)

    concurrently(read, files)
    return damaged


def _check(
    workspace: Workspace,
    objects: Objects,
    part: Part,
    file: StoredFile,
    damaged: set[str],
    report: VerificationReport,
) -> None:
    address = objects.address(file)
    if part.has(address, file) and file.path not in damaged:
        report.count("objects")
        return
    is_here = is_sound(workspace, file)
    if address in part.objects:
        again = "run `aerodb store push`" if is_here else _back(file)
        report.add(
            "changed",
            "the object's bytes differ from those that were stored",
            address,
            f"remove it, then {again}",
        )
    elif is_here:
        report.add(
            "not put", "this file is not in the object store", file.path, "run `aerodb store push`"
        )
    else:
        report.add(
            "missing",
            "this file is neither in the folder nor in the object store",
            file.path,
            _back(file),
        )


def _back(file: StoredFile) -> str:
    """Remedy for a lost file."""
    if file.path.startswith("logs/"):
        return (
            "put the log back into the inbox, from its source or a backup; its flight is not"
            " affected"
        )
    if file.path.endswith(f"/{INDEX}"):
        return "ingest its log again"
    if ".topics/" in file.path:
        return "remove its folder in the workspace, if there is one, and ingest its log again"
    return "repeat a run that needs it: it is recomputed"


def _heal(whole: set[str], report: VerificationReport) -> None:
    """Set the remedy of files that are damaged in the folder but complete in the object store: just
    remove them."""
    for number, problem in enumerate(report.problems):
        if problem.kind in _LOCAL and problem.where in whole:
            of = "the folder that it is in" if ".topics/" in problem.where else "it"
            remedy = f"remove {of}: it is downloaded from the object store when it is needed next"
            report.problems[number] = replace(problem, remedy=remedy)


def _check_others(objects: Objects, part: Part, report: VerificationReport) -> None:
    """Objects that no row names, except topics of recordings whose index cannot be read."""
    known = {objects.address(file) for file in part.files}
    for address, (file, put) in part.objects.items():
        if address in known or file.path.startswith(part.unread):
            continue
        if abs(time.time() - put) < _SETTLED:
            report.pending += 1
        else:
            what = (
                "no row of the catalogue names it: its writer ended before the row was added, or"
                " another writer stored the same file"
            )
            report.add(
                ORPHAN_OBJECT,
                what,
                address,
                "remove it, unless another workspace stores its files below this prefix too",
            )
