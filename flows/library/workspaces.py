"""A workspace as the commands have filled it: flights, versions, evaluation. It is only read."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from aerodb.consistency import from_document
from aerodb.flows.library.evaluation import EvaluatedPoints, evaluate
from aerodb.flows.library.logs import Log, log_of
from aerodb.storage.catalogue import VersionRow
from aerodb.storage.files import read_recording
from aerodb.storage.workspace import Workspace as Folder
from aerodb.tables import AeroDatabase
from aerodb.tasks.references import vehicle_of, version_of
from aerodb.tasks.steps import mapping_of
from aerodb.tasks.view import database_of, flights_document, version_details, versions_document
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True, eq=False)
class Version:
    """A version of a vehicle's database."""

    label: str
    id: str
    vehicle: str
    database: AeroDatabase
    document: dict[str, Any]

    def evaluate(self, units: dict[str, str] | None = None, **inputs: Any) -> EvaluatedPoints:
        """Evaluate the version at points, as `evaluate` does a database."""
        return evaluate(self.database, units, **inputs)

    def __repr__(self) -> str:
        return f"<version {self.label} ({self.id[:12]}) of {self.vehicle}>"


@dataclass(frozen=True, eq=False)
class Workspace:
    """A workspace folder, opened to be read."""

    root: Path

    @property
    def _access(self) -> WorkspaceAccess:
        return access_workspace(str(self.root))

    @property
    def vehicles(self) -> tuple[str, ...]:
        """Names of the vehicles."""
        return tuple(row.name for row in self._access.catalogue.vehicles())

    def flights(self, vehicle: str | None = None) -> "pd.DataFrame":
        """Return the flights, of one vehicle or of all, one row each; the index is the flight."""
        catalogue = self._access.catalogue
        rows = catalogue.flights(None if vehicle is None else catalogue.vehicle(vehicle).name)
        return _frame(flights_document(catalogue, rows), "flight")

    def log(self, flight: str, vehicle: str | None = None) -> Log:
        """Return a stored flight as its log was, under the vehicle's present file and the flight's
        calibration: what `load` returns for a file.

        flight : name, or the beginning of its id. Raises UnknownNameError for one that is not
        stored.
        """
        access = self._access
        row = access.catalogue.flight(flight, vehicle)
        bound = access.catalogue.calibration_of(row.id)
        return log_of(
            read_recording(access.topics_of(row.log_sha256)),
            access.vehicle(row.vehicle)[0],
            mapping_of(access, row),
            row.label,
            None if bound is None else from_document(bound.content),
        )

    def versions(self, vehicle: str | None = None) -> "pd.DataFrame":
        """Return the versions of a vehicle, one row each; the index is the label.

        vehicle : its name; None where the workspace has only one.
        """
        catalogue = self._access.catalogue
        name = vehicle_of(catalogue, vehicle)
        return _frame(versions_document(catalogue, name, catalogue.versions(name)), "label")

    def version(self, reference: str = "released", vehicle: str | None = None) -> Version:
        """Return a version by name (``released``), label (``v0002``) or the beginning of its id.

        vehicle : its name; None where the workspace has only one. Raises UnknownNameError for a
        version that is not stored.
        """
        catalogue = self._access.catalogue
        row: VersionRow = version_of(catalogue, reference, vehicle)
        document = version_details(catalogue, row)
        return Version(row.label, row.id, row.vehicle, database_of(catalogue, row), document)

    def __repr__(self) -> str:
        return f"<workspace {self.root}: {', '.join(self.vehicles) or 'no vehicle'}>"


def _frame(documents: list[dict[str, Any]], index: str) -> "pd.DataFrame":
    import pandas as pd  # slow to import

    return pd.DataFrame(documents, columns=None if documents else [index]).set_index(index)


def open_workspace(path: str | Path = "aerodb-workspace") -> Workspace:
    """Open a workspace folder to read it; the commands write to it.

    Raises InputError where the folder is no workspace.
    """
    return Workspace(Folder.open(Path(path), create=False).root)
