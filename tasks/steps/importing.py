"""Import a database file as a version: read it by its content, run its own check cases, and say
what its inputs still need."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np

from aerodb.coefficients import with_held_inputs, without_values
from aerodb.errors import InputError, OpenQuestionsError, Question
from aerodb.exchange import (
    CSV_HEAD,
    FileChecks,
    KnownVehicle,
    check_file,
    code_of,
    import_code,
    import_csv,
    import_daveml,
    import_jsbsim,
    import_mat,
    import_netcdf,
    is_daveml,
    is_own_mat,
    joined,
    read_alone,
    read_native,
)
from aerodb.storage.catalogue import VersionRow
from aerodb.storage.files import files_beside
from aerodb.tables import AeroDatabase, ReferenceGeometry, curves, lacking_effects, unusual_content
from aerodb.tasks.result_versions import JSBSIM_IMPORT, RELEASED, RESULT_VERSION
from aerodb.tasks.steps.inputs import flights_of, inputs_document
from aerodb.tasks.steps.publish import add_version, move
from aerodb.tasks.steps.release import promote
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace
from aerodb.vehicle import Vehicle, full_travels

#: Formats that mark their files: where, with which bytes, and what reads them.
_BY_MARK: Final[tuple[tuple[int, bytes, Callable[[bytes, str], AeroDatabase]], ...]] = (
    (0, b"PK\x03\x04", import_csv),
    (0, CSV_HEAD, import_csv),
    (0, b"CDF", import_netcdf),
    (126, b"IM", import_mat),
    (126, b"MI", import_mat),
)


def import_database(
    file: str,
    *,
    workspace: str,
    run: str,
    vehicle: str,
    bindings: Mapping[str, str] | None = None,
    accept_proposals: bool = False,
    replace_reason: str = "",
    accept: tuple[str, ...] = (),
    ask: bool = False,
    further: tuple[str, ...] = (),
) -> dict[str, Any]:
    """Import a database file as a version without parent.

    A vehicle's first import becomes ``released``, and so does the same file imported again while
    nothing was made of the first; neither does if the check cases of the file fail, or if a
    coefficient has no finite value at some point (`without_values`), if it divides by an input that
    no flight has, or if it holds what no aircraft has (`unusual_content`).

    further : files that are read with the first as one database (runs of an aerodynamic code).

    accept_proposals : hold inputs that no flight has at zero. replace_reason : why this import
    replaces the released one, through the gate, which `accept` concerns (`release.promote`); ''
    leaves it. Returns a document: version, label, database, inputs, released (whether it now is),
    replaced (label of the import that it replaced, or None), held (what it holds at zero),
    without_values (coefficients that are not finite at some point of usual flight), unusual (what
    no aircraft has, in sentences), read_as (how the file was read), lacks
    (what the database does not know, `lacking_effects`), curves (C_lift, C_drag, Cm over alpha),
    file_checks (None for formats that are refused if they fail), and those of `inputs_document`.
    ask : where inputs leave questions, store nothing and return them (questions: each an
    `aerodb.errors.Question` as JSON).
    """
    access, path = access_workspace(workspace), Path(file)
    access.catalogue.vehicle(vehicle)
    data = path.read_bytes()
    more = [(Path(each).name, Path(each).read_bytes()) for each in further]
    inputs = {hashlib.sha256(each).hexdigest() for each in (data, *(other for _, other in more))}

    def part(name: str) -> bytes:
        beside = files_beside(path)(name)
        inputs.add(
            hashlib.sha256(beside).hexdigest()
        )  # what a file is made of belongs to the version's identity
        return beside

    try:
        database = read_database(
            data, path.name, bindings or {}, part, more, known_vehicle(access.vehicle(vehicle)[0])
        )
    except OpenQuestionsError as error:
        if not ask:
            raise
        return {"questions": [asdict(question) for question in error.questions]}
    checks = _file_checks(data, path.name, database)
    settings = {"bindings": dict(bindings or {}), "importer": RESULT_VERSION["import"]}
    if path.suffix.lower() == ".xml":
        settings["jsbsim"] = JSBSIM_IMPORT
    flights = flights_of(access, vehicle, run)
    known = inputs_document(access, vehicle, database, flights, bindings or {})
    if ask and not accept_proposals and known["proposals"]:
        return {"questions": [asdict(question) for question in _questions(known)]}
    held = known["lacking"] if accept_proposals else []
    if held and known["dividing"]:
        raise _cannot_be_zero(known, path.name)
    if held:
        database = with_held_inputs(database, held)
        known = inputs_document(access, vehicle, database, flights, bindings or {})
        settings["held"] = held
    outcome, gone = _outcome(checks), list(without_values(database))
    cg = _cg_of(access.vehicle(vehicle)[0])
    unusual = [] if gone or database.line else list(unusual_content(database, cg))
    report = {
        "imported_from": path.name,
        **({"without_values": gone} if gone else {}),
        **({"unusual": unusual} if unusual else {}),
        **({"held_at_zero": held} if held else {}),
        **({"further_files": [each for each, _ in more]} if more else {}),
        **({"file_checks": outcome} if outcome else {}),
    }
    version = add_version(
        access, database, vehicle, None, sorted(inputs), settings, report, [], run
    )
    name = access.line_name(RELEASED, version.id)
    released = access.named(vehicle, name)
    if replace_reason:
        promote(
            version.id,
            workspace=workspace,
            run=run,
            name=name,
            reason=replace_reason,
            accept=accept,
        )
    elif (checks is None or checks.passed) and not (gone or unusual or known["dividing"]):
        _release(access, version, name, released, path.name)
    replaced = access.catalogue.version_of_id(released).label if released else None
    now = access.named(vehicle, name)
    return {
        "version": version.id,
        "label": version.label,
        "database": database.name,
        "released": now == version.id,
        "replaced": replaced if now == version.id and released != version.id else None,
        "held": held,
        "without_values": gone,
        "unusual": unusual,
        "file_checks": outcome,
        "read_as": database.description.splitlines() if is_of_code(data, path.name) else [],
        "lacks": list(lacking_effects(database)) if not (gone or database.line) else [],
        "curves": _curves(database) if not (gone or database.line) else {},
        **known,
    }


#: Angles of attack of the curves that an import shows [deg].
_SHOWN: Final = (-4.0, -2.0, 0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0)


def _curves(database: AeroDatabase) -> dict[str, list[float]]:
    """Coefficients over `_SHOWN`, as JSON; alpha in rad."""
    alpha = np.deg2rad(_SHOWN)
    found = {axis: values.tolist() for axis, values in curves(database, alpha).items()}
    return {"alpha": alpha.tolist(), **found} if found else {}


def _cg_of(vehicle: Vehicle) -> tuple[float, float, float] | None:
    """Return the CG of a vehicle file [m, body axes] where it is one point, else the moment
    reference where that is one."""
    fixed = vehicle.points.moment_reference
    point = vehicle.mass.cg if vehicle.mass.source == "constant" else fixed
    match point:
        case (float(x), float(y), float(z)):
            return (x, y, z)
    return None


def known_vehicle(vehicle: Vehicle) -> KnownVehicle:
    """Return what an import proposes from a vehicle file: lengths and moment reference [m, body
    axes], full travels [rad]."""
    point = vehicle.points.moment_reference
    fixed = point if point != "cg" else (0.0, 0.0, 0.0)
    own = vehicle.reference
    reference = ReferenceGeometry(own.area, own.chord, own.span, fixed, own.pressure)
    return KnownVehicle(reference, point != "cg", full_travels(vehicle))


def _cannot_be_zero(known: Mapping[str, Any], where: str) -> OpenQuestionsError:
    """The refusal to hold at zero what a coefficient is divided by."""
    asked = [
        Question(
            f"zero for {known['written'][name]} leaves a coefficient without a value: what is it?",
            known["written"][name],
            tuple((expression, "") for expression in known["expressions"][name]),
        )
        for name in known["dividing"]
    ]
    names = ", ".join(known["written"][name] for name in known["dividing"])
    remedy = f"state it in the unit of the file: --bind {asked[0].name}=NUMBER"
    return OpenQuestionsError(f"the database divides by {names}", where, remedy, asked)


def _questions(known: Mapping[str, Any]) -> list[Question]:
    """The inputs of an `inputs_document` that the file alone knows, as questions."""
    sentences = {use["channel"] or use["name"]: use["sentence"] for use in known["uses"]}
    return [
        Question(
            f"no flight has {sentences.get(name, known['written'][name])}",
            known["written"][name],
            tuple((expression, "") for expression in expressions),
        )
        for name, expressions in known["expressions"].items()
    ]


def _release(
    access: WorkspaceAccess, version: VersionRow, name: str, released: str | None, file: str
) -> None:
    """Point the released `name` of its line at an import where there is none, or an untouched
    import of this file."""
    if released is None:
        move(access, version.vehicle, name, version.id, f"first imported database ({file})")
    elif _is_untouched_import(access, version.vehicle, released, file):
        move(access, version.vehicle, name, version.id, f"imported again ({file})")


def _is_untouched_import(access: WorkspaceAccess, vehicle: str, version: str, name: str) -> bool:
    """Return whether a version (its id) was imported from a file of this name, and nothing was made
    of it."""
    catalogue = access.catalogue
    report = catalogue.version_documents(version).report
    made = any(row.parent == version for row in catalogue.versions(vehicle))
    return report.get("imported_from") == name and not made


def _file_checks(data: bytes, name: str, database: AeroDatabase) -> FileChecks | None:
    """Return what came of the check cases of a file; None for formats that refuse a file which
    fails them, or that have none."""
    return check_file(data, name, database) if Path(name).suffix.lower() in _XML else None


_XML: Final = (".dml", ".xml")


def _outcome(checks: FileChecks | None) -> dict[str, Any] | None:
    """The outcome as JSON: its fields, whether it passed, and a sentence."""
    if checks is None:
        return None
    return {**asdict(checks), "passed": checks.passed, "sentence": str(checks)}


#: Suffixes of tables that may be sweeps.
_TABLES: Final = (".csv", ".txt", ".dat", ".tsv", ".xlsx")


def is_of_code(data: bytes, name: str) -> bool:
    """Return whether a file is output of an aerodynamic code, or a sweep, and no own export."""
    if code_of(data):
        return True
    if data[126:128] in (b"IM", b"MI"):
        return not is_own_mat(data)
    suffix = Path(name).suffix.lower()
    marked = any(data[at : at + len(mark)] == mark for at, mark, _ in _BY_MARK)
    return suffix == ".xlsx" or (suffix in _TABLES and not marked)


def read_database(
    data: bytes,
    name: str,
    bindings: Mapping[str, str],
    part: Callable[[str], bytes] | None = None,
    more: Sequence[tuple[str, bytes]] = (),
    vehicle: KnownVehicle | None = None,
) -> AeroDatabase:
    """Parse a database file by its suffix and content: DAVE-ML 2.0 (AIAA S-119), JSBSim, native
    TOML, CSV, MAT, NetCDF, output of aerodynamic codes, sweeps; tables become SI units.

    part : returns the bytes of a file that this one names. more : further files (name, content) of
    the same code, or native TOML that is joined to the database. vehicle : for proposals. Raises
    InputError for a format that cannot be read.
    """
    suffix = Path(name).suffix.lower()
    if is_of_code(data, name):
        for other, content in more:
            if code_of(content) != code_of(data):
                raise InputError(f"not a file of {code_of(data)}", other, "import it alone")
        return import_code(
            [(name, data), *more], Path(name).stem, bindings=bindings, vehicle=vehicle
        )
    if more:
        database = read_database(data, name, bindings, part, vehicle=vehicle)
        for other, content in more:
            if Path(other).suffix.lower() != ".toml":
                raise InputError(
                    "only native TOML is joined to another file", other, "import it alone"
                )
            database = joined(database, _text(content, other), other)
        return database
    if suffix in _XML and is_daveml(data):
        return import_daveml(data, bindings=bindings, name=Path(name).stem)
    if suffix == ".xml":
        return import_jsbsim(data, bindings=bindings, name=Path(name).stem, loader=part)
    if suffix == ".toml":
        text = _text(data, name)
        lengths = None if vehicle is None else vehicle.reference
        alone = None if lengths is None else read_alone(text, name, lengths)
        return alone or read_native(text, name)
    for at, mark, importer in _BY_MARK:
        if data[at : at + len(mark)] == mark:
            return importer(data, name)
    remedy = (
        "known: .dml or .xml (DAVE-ML), .xml (JSBSim), .toml (native), .zip (CSV), .mat, .nc"
        " (NetCDF); aerodynamic codes: docs/reference/aerodynamic-codes.md"
    )
    raise InputError(f"no importer for '{suffix or 'a file without suffix'}'", name, remedy)


def _text(data: bytes, name: str) -> str:
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError("not UTF-8 text", name, "save it as UTF-8") from error
