"""Export of a version to a simulator: written, read back, and kept only if its check cases pass."""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from aerodb.errors import AeroError, InputError, nearest
from aerodb.exchange import (
    export_csv,
    export_daveml,
    export_jsbsim,
    export_mat,
    export_netcdf,
    from_document,
    import_csv,
    import_daveml,
    import_jsbsim,
    import_mat,
    import_netcdf,
    jsbsim_check_cases,
    states_for_jsbsim,
    without_states,
)
from aerodb.storage.catalogue import Catalogue, VersionRow
from aerodb.storage.limits import Limits
from aerodb.storage.workspace import Workspace, write_for_user
from aerodb.storage.workspace_settings import load_settings
from aerodb.storage.writers import agreement_in_jsbsim, jsbsim_is_installed
from aerodb.tables import AeroDatabase, CheckCase, failed_check_cases, make_check_cases


@dataclass(frozen=True)
class Form:
    """An export format.

    cases : check cases to write with it. write : (database, name, cases) -> file. read : (file,
    name) -> database. receive : runs the receiving program, where it is installed, under the
    workspace's limits, and returns its verdict in one sentence; InputError if it disagrees.
    carried : reduces the database to what the format can carry (no states).
    """

    cases: Callable[[AeroDatabase], Sequence[CheckCase]]
    write: Callable[[AeroDatabase, str, Sequence[CheckCase]], bytes]
    read: Callable[[bytes, str], AeroDatabase]
    receive: Callable[[AeroDatabase, bytes, Sequence[CheckCase], Limits], str] = lambda *_: ""
    carried: Callable[[AeroDatabase], AeroDatabase] = lambda database: database


def _jsbsim(database: AeroDatabase, name: str, cases: Sequence[CheckCase]) -> bytes:
    return export_jsbsim(database, name=name, cases=cases)


def _daveml(database: AeroDatabase, name: str, cases: Sequence[CheckCase]) -> bytes:
    # It writes check cases of its own, which also state the file's internal signals.
    return export_daveml(database, check_cases=len(cases))


def _in_jsbsim(
    database: AeroDatabase, data: bytes, cases: Sequence[CheckCase], limits: Limits
) -> str:
    if not jsbsim_is_installed():
        return "not run in JSBSim, which is not installed here"
    agreement = agreement_in_jsbsim(database, data, cases, limits)
    if not agreement.passed:
        axis = max(agreement.errors, key=lambda name: agreement.errors[name])
        raise InputError(
            f"{axis} differs inside JSBSim by {agreement.errors[axis]:.2g}",
            "export",
            "nothing was written",
        )
    return "and pass inside JSBSim"


#: Formats by the name that users give; an entry per exporter of `aerodb.exchange`.
FORMS: Final[dict[str, Form]] = {
    "jsbsim": Form(
        jsbsim_check_cases,
        _jsbsim,
        lambda data, name: import_jsbsim(data, name=name),
        _in_jsbsim,
        states_for_jsbsim,
    ),
    "csv": Form(
        make_check_cases, lambda database, _, cases: export_csv(database, cases), import_csv
    ),
    "daveml": Form(
        make_check_cases,
        _daveml,
        lambda data, name: import_daveml(data, name=name),
        carried=without_states,
    ),
    "mat": Form(
        make_check_cases, lambda database, _, cases: export_mat(database, cases), import_mat
    ),
    "netcdf": Form(
        make_check_cases, lambda database, _, cases: export_netcdf(database, cases), import_netcdf
    ),
}


def export_version(
    workspace: Workspace, catalogue: Catalogue, version: VersionRow, format: str, output: Path
) -> dict[str, Any]:
    """Write a version to `output`; document: version, label, format, file, bytes, check_cases,
    checked.

    The bytes are first read back by the product's own importer and must reproduce the check cases;
    otherwise nothing is written. Raises InputError for an unknown format (exit 3) and for an export
    that does not reproduce its check cases.
    """
    if format not in FORMS:
        raise InputError(f"no exporter for '{format}'", "--format", nearest(format, FORMS))
    form = FORMS[format]
    database = form.carried(
        from_document(json.loads(catalogue.version_documents(version.id).content))
    )
    name = f"{version.vehicle}-{version.label}"
    cases = form.cases(database)
    data = form.write(database, name, cases)
    _check(form, data, name, cases)
    received = form.receive(database, data, cases, load_settings(workspace.root).limits)
    written = write_for_user(workspace, output, data)
    return {
        "version": version.id,
        "label": version.label,
        "format": format,
        "file": str(written),
        "bytes": len(data),
        "check_cases": len(cases),
        "checked": " ".join(filter(None, (f"read back, {len(cases)} check cases pass", received))),
    }


def _check(form: Form, data: bytes, name: str, cases: Sequence[CheckCase]) -> None:
    where = f"export of {name}"
    try:
        failed = failed_check_cases(form.read(data, name), cases)
    except AeroError as error:
        raise InputError(
            f"cannot be read back: {error.what}",
            where,
            "nothing was written; choose another format",
        ) from error
    if failed:
        what = f"{len(failed)} check values differ when it is read back ({failed[0]})"
        raise InputError(what, where, "nothing was written; choose another format")
