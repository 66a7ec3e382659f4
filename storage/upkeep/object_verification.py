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
    """Adds to `report`, which has what is wrong in the folder already, what is wrong in the object
    store.

    fetch : also reads every object; else size and existence are checked, which costs a request per
    thousand objects.
    """
    for part in parts(workspace, catalogue, objects):
        whole = [file for file in part.files if part.has(objects.address(file), file)]
        damaged = _damaged(objects, whole) if fetch else set()
        for file in filter(
            lambda file: file.sha256, part.files
        ):  # that a hash is not known was said before
            _check(workspace, objects, part, file, damaged, report)
        _heal({file.path for file in whole} - damaged, report)
        _check_others(objects, part, report)


def _damaged(objects: Objects, files: list[StoredFile]) -> set[str]:
    """Paths of those whose objects' bytes are not what was stored."""
    found: set[str] = set()

    def read(file: StoredFile) -> None:
        try:
            for _ in objects.blocks(file) or ():
                pass
        except DamagedObject:
            found.add(file.path)

    concurrently(read, files)
    return found


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
            "the object's bytes are not those that were stored",
            address,
            f"remove it, then {again}",
        )
    elif is_here:
        report.add(
            "not put", "this file is not in the object store", file.path, "run `aerodb store push`"
        )
    else:
        report.add(
            "missing", "this file is neither here nor in the object store", file.path, _back(file)
        )


def _back(file: StoredFile) -> str:
    """How a file that is lost comes back."""
    if file.path.startswith("logs/"):
        return (
            "put the log back into the inbox, from its source or a backup; its flight is not"
            " touched"
        )
    if file.path.endswith(f"/{INDEX}"):
        return "ingest its log again"
    if ".topics/" in file.path:
        return "remove its folder here, if there is one, and ingest its log again"
    return "run what needs it: it is made again"


def _heal(whole: set[str], report: VerificationReport) -> None:
    """What is damaged in the folder, but whole in the object store, needs no more than to be
    removed."""
    for number, problem in enumerate(report.problems):
        if problem.kind in _LOCAL and problem.where in whole:
            of = "the folder that it is in" if ".topics/" in problem.where else "it"
            remedy = f"remove {of}: it is fetched from the object store when it is needed next"
            report.problems[number] = replace(problem, remedy=remedy)


def _check_others(objects: Objects, part: Part, report: VerificationReport) -> None:
    """Objects that no row names; whose index cannot be read, of that recording nobody knows
    them."""
    known = {objects.address(file) for file in part.files}
    for address, (file, put) in part.objects.items():
        if address in known or file.path.startswith(part.unread):
            continue
        if abs(time.time() - put) < _SETTLED:
            report.pending += 1
        else:
            what = (
                "nothing in the catalogue names it: its writer ended before its row was there, or"
                " another wrote the same"
            )
            report.add(
                ORPHAN_OBJECT,
                what,
                address,
                "remove it, unless another workspace keeps its files below this prefix, too",
            )
