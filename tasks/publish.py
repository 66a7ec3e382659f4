"""A version into the catalogue: an imported baseline, or the candidate of an update with its proof."""

import getpass
import hashlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from aerodb.errors import InputError
from aerodb.exchange.jsbsim import import_jsbsim
from aerodb.exchange.native import database_content_sha256, read_native, to_document
from aerodb.identity import canonical_json, key_of
from aerodb.proof import AxisProof
from aerodb.report.document import update_document
from aerodb.tables.database import AeroDatabase
from aerodb.update import Update
from storage.rows import FlightRole, VersionRow
from tasks.deltas import Plan
from tasks.open import Stores, stores
from tasks.settings import RESULT_VERSION

RELEASED, CANDIDATE = "released", "candidate"


def import_database(
    file: str, *, workspace: str, run: str, vehicle: str, bindings: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Imports a database file as a version without parent; the vehicle's first becomes ``released``."""
    opened, path = stores(workspace), Path(file)
    opened.catalogue.vehicle(vehicle)
    data = path.read_bytes()
    database = read_database(data, path.name, bindings or {})
    settings = {"bindings": dict(bindings or {}), "importer": RESULT_VERSION["import"]}
    digest = hashlib.sha256(data).hexdigest()
    version = _add(opened, database, vehicle, None, [digest], settings, {"imported_from": path.name}, [], run)
    if opened.named(vehicle, RELEASED) is None:
        move(opened, vehicle, RELEASED, version.id, f"first imported database ({path.name})")
    return {"version": version.id, "label": version.label, "database": database.name, "inputs": list(database.inputs)}


def read_database(data: bytes, name: str, bindings: Mapping[str, str]) -> AeroDatabase:
    """A database from the bytes of a file, by its suffix; InputError for a kind that cannot be read."""
    suffix = Path(name).suffix.lower()
    if suffix == ".xml":
        return import_jsbsim(data, bindings=bindings, name=Path(name).stem)
    if suffix == ".toml":
        try:
            return read_native(data.decode("utf-8"), name)
        except UnicodeDecodeError as error:
            raise InputError("not UTF-8 text", name, "save it as UTF-8") from error
    raise InputError(f"no importer for '{suffix or 'a file without suffix'}'", name, "known: .xml (JSBSim), .toml (native)")


def publish_candidate(plan: Plan, update: Update, proof: tuple[AxisProof, ...], *, workspace: str, run: str) -> dict[str, Any]:
    """Stores the update's candidate with its proof and points ``candidate`` at it; returns the update's document."""
    opened = stores(workspace)
    document = update_document(
        vehicle=plan.vehicle,
        baseline=plan.baseline,
        hold_out=plan.hold_out,
        excluded=plan.excluded,
        looks={flight: _looks(opened, flight) for flight in plan.hold_out.held_out},
        update=update,
        proof=proof,
    )
    settings = {
        "model": plan.model,
        "identified": list(plan.hold_out.identified),
        "held_out": list(plan.hold_out.held_out),
        "update": RESULT_VERSION["update"],
    }
    roles = [FlightRole(flight, "identified") for flight in plan.hold_out.identified]
    roles += [FlightRole(flight, "held_out") for flight in plan.hold_out.held_out]
    roles += [FlightRole(flight, "excluded", reason) for flight, reason in plan.excluded]
    document["candidate"] = version_id(plan.vehicle, plan.baseline, list(plan.keys), settings)
    version = _add(opened, update.candidate, plan.vehicle, plan.baseline, list(plan.keys), settings, document, roles, run)
    move(opened, plan.vehicle, CANDIDATE, version.id, "declared increments estimated")
    # Where the same update was made before, the stored report is the one that counts.
    return {**opened.catalogue.version_documents(version.id).report, "label": version.label}


def move(opened: Stores, vehicle: str, name: str, version: str, reason: str) -> None:
    """Points a name at a version (its id) from wherever it points now; nothing happens when it is there already."""
    current = opened.named(vehicle, name)
    if current != version:
        opened.catalogue.move_name(vehicle, name, version, user=_user(), reason=reason, expected=current)


def version_id(vehicle: str, parent: str | None, inputs: list[str], settings: Mapping[str, Any]) -> str:
    """A version's identity: the same wherever the same is made from the same (CONVENTIONS, "Names and identities")."""
    return key_of({"vehicle": vehicle, "parent": parent, "inputs": sorted(inputs), "settings": dict(settings)})


def _add(
    opened: Stores,
    database: AeroDatabase,
    vehicle: str,
    parent: str | None,
    inputs: list[str],
    settings: Mapping[str, Any],
    report: Mapping[str, Any],
    roles: list[FlightRole],
    run: str,
) -> VersionRow:
    return opened.catalogue.add_version(
        version_id(vehicle, parent, inputs, settings),
        vehicle=vehicle,
        parent=parent,
        content=canonical_json(to_document(database)).decode(),
        content_sha256=database_content_sha256(database),
        settings=settings,
        report=report,
        flights=roles,
        inputs=inputs,
        run=run,
    )


def _looks(opened: Stores, flight: str) -> int:
    """How many versions of this vehicle a flight has validated already."""
    return sum(
        1 for impact in opened.catalogue.impact(flight) if impact.role == "held_out" and impact.through == impact.version.id
    )


def _user() -> str:
    try:
        return getpass.getuser()
    except (OSError, KeyError):
        return "unknown"
