"""What every task starts with: the workspace's stores, and the vehicle, flight or database that it is about."""

import json
from dataclasses import dataclass
from pathlib import Path

from aerodb.exchange.native import from_document
from aerodb.tables.database import AeroDatabase
from aerodb.vehicle import Vehicle, parse_vehicle
from storage.catalogue import Catalogue
from storage.workspace import Workspace


@dataclass(frozen=True)
class Stores:
    """The workspace folder and its catalogue."""

    workspace: Workspace
    catalogue: Catalogue

    def vehicle(self, name: str) -> tuple[Vehicle, str]:
        """A vehicle and the sha256 of the text that describes it."""
        row = self.catalogue.vehicle(name)
        return parse_vehicle(row.text, f"vehicle {name}"), row.sha256

    def database(self, version: str) -> AeroDatabase:
        """The database of a version, by its full id."""
        return from_document(json.loads(self.catalogue.version_documents(version).content))

    def named(self, vehicle: str, name: str) -> str | None:
        """The id of the version that a name such as ``released`` points at, None while it points nowhere."""
        event = self.catalogue.named(vehicle, name)
        return event.version if event is not None else None

    def path_of(self, key: str) -> Path | None:
        """The file of the result stored under `key`, when there is one."""
        row = self.catalogue.result(key)
        return None if row is None else self.workspace.resolve(row.path)


def stores(workspace: str) -> Stores:
    """Opens the stores of the workspace folder `workspace`."""
    opened = Workspace.open(Path(workspace))
    return Stores(opened, Catalogue.open(opened.catalogue))
