"""Export of a version to a simulator: written, read back, and kept only if its check cases pass."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from aerodb.errors import AeroError, InputError, nearest
from aerodb.exchange import (
    MassBalance,
    differences,
    export_csv,
    export_csv_table,
    export_daveml,
    export_gazebo,
    export_jsbsim,
    export_mat,
    export_motors,
    export_netcdf,
    export_propellers,
    export_sitl,
    from_document,
    has_rotors,
    import_code,
    import_csv,
    import_daveml,
    import_jsbsim,
    import_mat,
    import_netcdf,
    jsbsim_check_cases,
    mass_balance_of,
    merge_jsbsim,
    motor_database,
    over_dynamic_pressure,
    project_gazebo,
    project_motors,
    project_propellers,
    project_sitl,
    propeller_database,
    read_motors,
    read_propellers,
    settled_states,
    states_for_jsbsim,
    without_states,
)
from aerodb.storage.catalogue import Catalogue, VersionRow
from aerodb.storage.files import files_beside, read_flight
from aerodb.storage.limits import Limits
from aerodb.storage.workspace import Workspace, write_for_user
from aerodb.storage.workspace_settings import load_settings
from aerodb.storage.writers import agreement_in_jsbsim, jsbsim_is_installed
from aerodb.support import Array
from aerodb.tables import AeroDatabase, CheckCase, failed_check_cases, make_check_cases
from aerodb.tasks.workspace_access import WorkspaceAccess
from aerodb.vehicle import MASS_CHANNELS, Vehicle, full_travels, parse_vehicle


@dataclass(frozen=True)
class Form:
    """An export format.

    cases : check cases to write with it. write : (database, name, cases, mass of the vehicle) ->
    file. read : (file, name) -> database. receive : runs the receiving program, where it is
    installed, under the workspace's limits, and returns its verdict in one sentence; InputError if
    it disagrees.
    carried : reduces the database to what the format can carry. project : makes of it
    the model of the format, with the vehicle's surfaces; what that cannot hold is told.
    """

    cases: Callable[[AeroDatabase], Sequence[CheckCase]]
    write: Callable[[AeroDatabase, str, Sequence[CheckCase], MassBalance | None], bytes]
    read: Callable[[bytes, str], AeroDatabase]
    receive: Callable[[AeroDatabase, bytes, Sequence[CheckCase], Limits], str] = lambda *_: ""
    carried: Callable[[AeroDatabase], AeroDatabase] = lambda database: database
    project: Callable[[AeroDatabase, Vehicle], AeroDatabase] | None = None


def _jsbsim(
    database: AeroDatabase, name: str, cases: Sequence[CheckCase], mass: MassBalance | None
) -> bytes:
    return export_jsbsim(database, name=name, cases=cases, mass=mass)


def _daveml(
    database: AeroDatabase, name: str, cases: Sequence[CheckCase], mass: MassBalance | None
) -> bytes:
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


def _no_rotors(*_given: object) -> bytes:
    raise InputError("a version without rotors", "--format propeller", "choose --format jsbsim")


def _model_of(data: bytes, name: str) -> AeroDatabase:
    return import_code([(name, data)], name)


#: Formats by the name that users give; an entry per exporter of `aerodb.exchange`.
FORMS: Final[dict[str, Form]] = {
    "jsbsim": Form(
        lambda database: jsbsim_check_cases(states_for_jsbsim(database)),
        _jsbsim,
        lambda data, name: import_jsbsim(data, name=name),
        lambda database, *given: _in_jsbsim(states_for_jsbsim(database), *given),
        over_dynamic_pressure,
    ),
    "csv": Form(
        make_check_cases,
        lambda database, _name, cases, _mass: export_csv_table(database, cases),
        import_csv,
    ),
    "daveml": Form(
        make_check_cases,
        _daveml,
        lambda data, name: import_daveml(data, name=name),
        carried=lambda database: without_states(over_dynamic_pressure(database)),
    ),
    "gazebo": Form(
        make_check_cases,
        lambda database, _name, _cases, _mass: export_gazebo(database),
        _model_of,
        carried=over_dynamic_pressure,
        project=lambda database, _vehicle: project_gazebo(database),
    ),
    "mat": Form(
        make_check_cases,
        lambda database, _name, cases, _mass: export_mat(database, cases),
        import_mat,
    ),
    "netcdf": Form(
        make_check_cases,
        lambda database, _name, cases, _mass: export_netcdf(database, cases),
        import_netcdf,
    ),
    "propeller": Form(make_check_cases, _no_rotors, _model_of),
    "sitl": Form(
        make_check_cases,
        lambda database, _name, _cases, _mass: export_sitl(database),
        _model_of,
        carried=over_dynamic_pressure,
        project=lambda database, vehicle: project_sitl(database, full_travels(vehicle)),
    ),
}


def _as_motors(
    database: AeroDatabase, name: str, *given: Any
) -> tuple[dict[str, float], tuple[str, ...], Form, AeroDatabase]:
    made = project_motors(database, *given)
    form = Form(
        make_check_cases,
        lambda _database, name, _cases, _mass: export_motors(made.motors, name, made.notes),
        read_motors,
    )
    return dict(made.largest), made.notes, form, motor_database(made.motors, name)


def _as_propellers(
    database: AeroDatabase, name: str, *given: Any
) -> tuple[dict[str, float], tuple[str, ...], Form, AeroDatabase]:
    made = project_propellers(database, *given)
    form = Form(
        make_check_cases,
        lambda _database, name, _cases, _mass: export_propellers(made.propellers, name, made.notes),
        read_propellers,
    )
    return dict(made.largest), made.notes, form, propeller_database(made.propellers, name)


#: Formats that hold the rotors of a database: the differences, notes, form and database of them.
_ROTOR_FORMS: Final = {"gazebo": _as_motors, "propeller": _as_propellers}

#: Formats of more than one file, by name and suffix: the archive of CSV files.
_ARCHIVES: Final = {("csv", ".zip"): export_csv}


def export_version(
    workspace: Workspace,
    catalogue: Catalogue,
    version: VersionRow,
    format: str,
    output: Path | None,
    into: Path | None = None,
) -> dict[str, Any]:
    """Write a version to `output`; document: version, label, format, file, bytes, check_cases,
    checked, differences (axis -> largest), notes (sentences on rotors in the format, and on states
    that the format lacks), and for JSBSim mass (kg, cg, inertia, source; None if not known) and
    into.

    into : a JSBSim aircraft file whose aerodynamics are replaced in what is written; `output` None:
    beside it, with the version's label in its name. `into` in the document: the file, lost (what
    other parts of it read and only the former aerodynamics defined) and moved (its AERORP, m).

    The bytes are first read back by the product's own importer and must reproduce the check cases;
    otherwise nothing is written. Raises InputError for an unknown format (exit 3) and for an export
    that does not reproduce its check cases.
    """
    if format not in FORMS:
        raise InputError(f"no exporter for '{format}'", "--format", nearest(format, FORMS))
    if into is not None and format != "jsbsim":
        raise InputError("only JSBSim aircraft take an export", "--into", "--format jsbsim")
    if output is None:
        if into is None:
            raise InputError("no file to write", "--output", "name it: --output FILE")
        output = into.with_name(f"{into.stem}-{version.label}{into.suffix}")
    form = FORMS[format]
    archive = _ARCHIVES.get((format, output.suffix.lower()))
    whole = from_document(json.loads(catalogue.version_documents(version.id).content))
    database = form.carried(whole)
    held: dict[str, float] = {}
    notes: tuple[str, ...] = ()
    name = f"{version.vehicle}-{version.label}"
    if format in _ROTOR_FORMS and has_rotors(database):
        rotors = _ROTOR_FORMS[format]
        described = parse_vehicle(catalogue.vehicle(version.vehicle).text, version.vehicle)
        lags = {rotor: logged.lag for rotor, logged in described.rotors.items() if logged.lag}
        flown = _flown(workspace, catalogue, version.vehicle, database)
        held, notes, form, database = rotors(database, name, flown, lags.get)
    elif form.project is not None:
        described = parse_vehicle(catalogue.vehicle(version.vehicle).text, version.vehicle)
        model = form.project(database, described)
        held, database = differences(database, model), model
    cases = form.cases(database)
    mass = _mass(workspace, catalogue, version.vehicle) if format == "jsbsim" else None
    data = archive(database, cases) if archive else form.write(database, name, cases, mass)
    received = form.receive(database, data, cases, load_settings(workspace.root).limits)
    merged = None
    if into is not None:
        aircraft = _aircraft(into)
        merged = merge_jsbsim(aircraft, data, into.name, files_beside(into))
        data = merged.xml
    _check(form, data, name, cases)
    written = write_for_user(workspace, output, data)
    document = {
        "version": version.id,
        "label": version.label,
        "format": format,
        "file": str(written),
        "bytes": len(data),
        "check_cases": len(cases),
        "checked": " ".join(filter(None, (f"read back, {len(cases)} check cases pass", received))),
        "differences": held,
        "notes": [*notes, *settled_states(whole, database)],
    }
    if format == "jsbsim":
        document["mass"] = None if mass is None else asdict(mass)
        document["into"] = merged and {
            "file": str(into),
            "lost": merged.lost,
            "moved": merged.moved,
        }
    return document


def _aircraft(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except (OSError, ValueError) as error:
        raise InputError(
            f"it cannot be read: {error}", str(path)[:200], "name a JSBSim aircraft file"
        ) from error


def _flown(
    workspace: Workspace, catalogue: Catalogue, vehicle: str, database: AeroDatabase
) -> tuple[str, dict[str, Array]] | None:
    """Name and channels (n,) of the newest flight that has all inputs of a database; None without
    such a flight."""
    access = WorkspaceAccess(workspace, catalogue)
    needed = database.flight_inputs
    for flight in reversed(catalogue.flights(vehicle)):
        stored = catalogue.results_of(flight.id, "ingest")
        if flight.retracted_utc is not None or not stored:
            continue
        recorded = read_flight(access.file_of(stored[-1].path))
        if all(name in recorded for name in needed):
            values = {name: np.asarray(recorded[name]) for name in needed}
            known = np.all([np.isfinite(x) for x in values.values()], axis=0)
            if np.any(known):
                over = f"{np.count_nonzero(known)} samples of {access.name_of(flight)}"
                return over, {name: x[known] for name, x in values.items()}
    return None


def _mass(workspace: Workspace, catalogue: Catalogue, vehicle: str) -> MassBalance | None:
    """Mass, CG and inertia of a vehicle: of its file, else the medians of its newest flight."""
    row = catalogue.vehicle(vehicle)
    properties = parse_vehicle(row.text, f"vehicle {vehicle}").mass
    stated = mass_balance_of(properties, f"vehicle file {vehicle} of {row.added_utc:%Y-%m-%d}")
    if stated is not None:
        return stated
    access = WorkspaceAccess(workspace, catalogue)
    for flight in reversed(catalogue.flights(vehicle)):
        stored = catalogue.results_of(flight.id, "ingest")
        if flight.retracted_utc is not None or not stored:
            continue
        recorded = read_flight(access.file_of(stored[-1].path))
        if all(name in recorded for name in MASS_CHANNELS):
            mass, x, y, z, *inertia = (
                float(np.nanmedian(recorded[name])) for name in MASS_CHANNELS
            )
            ixx, iyy, izz, ixz = inertia
            source = f"medians of {access.name_of(flight)}"
            return MassBalance(mass, (x, y, z), (ixx, iyy, izz, ixz), source)
    return None


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
