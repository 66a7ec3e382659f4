"""Admission of a log: whether what is named beside it can be used, and its flight can be stored."""

from aerodb.errors import InputError
from aerodb.logs import Mapping
from aerodb.storage.encoding import FLIGHT_NAME, checked
from aerodb.storage.mappings import load_mapping
from aerodb.storage.workspace_settings import SettingsError
from aerodb.tasks.workspace_access import WorkspaceAccess


def usable_mapping(access: WorkspaceAccess, vehicle: str, mapping: str | None) -> Mapping | None:
    """Return the requested mapping; SettingsError if it or the vehicle's file cannot be used.

    Reads the vehicle and the mapping (`load_mapping`).
    """
    try:
        access.vehicle(vehicle)
        return load_mapping(mapping) if mapping else None
    except InputError as error:
        raise SettingsError(error.what, error.where, error.remedy) from error


def inadmissible(
    access: WorkspaceAccess, sha256: str, vehicle: str, name: str | None
) -> InputError | None:
    """Return the InputError with which the catalogue would refuse these bytes as a flight of this
    name, or None; see `Catalogue.flights`.

    The log is not at fault, so it is not quarantined.
    """
    for row in access.catalogue.flights(log_sha256=sha256):
        if row.vehicle != vehicle or name not in (None, row.name):
            return InputError(
                f"already stored for vehicle '{row.vehicle}' as '{row.label}'", "", "use that one"
            )
    if name is None:
        return None
    try:
        checked(name, FLIGHT_NAME, "the name of a flight")
    except InputError as error:
        return error
    taken = [
        row
        for row in access.catalogue.flights(vehicle)
        if row.name == name and row.log_sha256 != sha256
    ]
    return (
        InputError(
            f"'{name}' is already the name of flight {taken[0].id[:12]}", "", "choose another name"
        )
        if taken
        else None
    )
