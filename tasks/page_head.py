"""The head of a report: when its result was made, by whom, with which program and where."""

from collections.abc import Sequence
from datetime import UTC, datetime
from pathlib import Path

from aerodb.report import Head
from aerodb.storage.catalogue import ResultRow, VersionRow
from aerodb.tasks.actors import user
from aerodb.tasks.provenance import code_version
from aerodb.tasks.workspace_access import WorkspaceAccess


def head_of_version(access: WorkspaceAccess, version: VersionRow) -> Head:
    """Return the head of a page about a version: the run that made it, and who moved the first name
    to it."""
    moves = access.catalogue.moves_to(version.vehicle, [version.id])
    program = access.catalogue.run(version.run).code_version if version.run else ""
    return Head(
        version.created_utc,
        moves[0].user if moves else "",
        program,
        str(access.workspace.root),
    )


def head_of_result(access: WorkspaceAccess, result: ResultRow, author: str = "") -> Head:
    """Return the head of a page about a stored result."""
    return Head(result.created_utc, author, result.code_version, str(access.workspace.root))


def head_of_files(files: Sequence[Path]) -> Head:
    """Return the head of a page made now from files, which no workspace keeps."""
    return Head(datetime.now(UTC), user(), code_version(), "", tuple(map(str, files)))
