"""A workspace as the commands have filled it: flights, versions, evaluation. It is only read."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from aerodb.consistency import from_document
from aerodb.flows.library.evaluation import EvaluatedPoints, evaluate
from aerodb.flows.library.logs import Log, log_of
from aerodb.flows.library.views import Summary, html_of
from aerodb.storage.catalogue import VersionRow
from aerodb.storage.files import read_recording
from aerodb.storage.workspace import Workspace as Folder
from aerodb.tables import AeroDatabase
from aerodb.tasks.references import vehicle_of, version_of
from aerodb.tasks.steps import mapping_of
from aerodb.tasks.view import (
    database_of,
    finding_document,
    findings_page,
    findings_words,
    flight_details,
    flights_document,
    flights_words,
    held_out_words,
    version_details,
    versions_document,
)
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace

if TYPE_CHECKING:
    import pandas as pd

#: What a notebook shows of flights and of versions.
_OF_FLIGHTS: Final = ("file", "name", "start_utc", "duration", "verdict", "counts")
_OF_VERSIONS: Final = ("created_utc", "names", "findings", "axes", "tags")
_HEADER: Final = ("vehicle", "version", "made", "names", "held-out error", "flights", "added")
#: Most versions of a vehicle that are shown with the workspace.
_NEWEST: Final = 10


@dataclass(frozen=True, eq=False)
class Version:
    """A version of a vehicle's database.

    document : as ``aerodb version show`` gives it; listed : its entry in ``aerodb version list``.
    """

    label: str
    id: str
    vehicle: str
    database: AeroDatabase
    document: dict[str, Any]
    listed: dict[str, Any]

    def evaluate(self, units: dict[str, str] | None = None, **inputs: Any) -> EvaluatedPoints:
        """Evaluate the version at points, as `evaluate` does a database: coefficients (n,),
        dimensionless; InputError for an unknown input or unit."""
        return evaluate(self.database, units, **inputs)

    def __repr__(self) -> str:
        return f"<version {self.label} ({self.id[:12]}) of {self.vehicle}>"

    def _repr_html_(self) -> str:
        """Return what a list says of the version, as a notebook shows it."""
        said = list(zip(_HEADER[2:], _row(self.vehicle, self.listed)[2:], strict=True))
        facts = [("id", self.id[:12]), *said, ("inputs", ", ".join(self.database.inputs))]
        title = f"version {self.label} of {self.vehicle}"
        return html_of(Summary(title, facts, remarks=self.document["stale"]))


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
        """Return the flights, of one vehicle or of all, one row each; the index is the flight. A
        notebook shows the first columns. Durations are in [s], starts in UTC; UnknownNameError for
        an unknown vehicle."""
        catalogue = self._access.catalogue
        rows = catalogue.flights(None if vehicle is None else catalogue.vehicle(vehicle).name)
        return _listing(flights_document(catalogue, rows), "flight", _OF_FLIGHTS)

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

    def flight(self, flight: str, vehicle: str | None = None) -> dict[str, Any]:
        """Return the document of a flight, as `Client.flight` does: times [s], figures in SI units.
        UnknownNameError where there is none."""
        access = self._access
        return flight_details(access, access.catalogue.flight(flight, vehicle))

    def findings(self) -> Iterator[dict[str, Any]]:
        """Yield updates and closed loops, newest first, each in one sentence, as `Client.findings`
        does. StoreError where the catalogue cannot be read."""
        place = ""
        while True:
            entries, place = findings_page(self._access, _NEWEST, place)
            yield from entries
            if not place:
                return

    def finding(self, reference: str, vehicle: str | None = None) -> dict[str, Any]:
        """Return the document of an update or a closed loop, as `Client.finding` does, in SI units;
        UnknownNameError where there is none."""
        return finding_document(self._access, reference, vehicle)

    def evaluate(
        self,
        version: str = "released",
        vehicle: str | None = None,
        units: dict[str, str] | None = None,
        **inputs: Any,
    ) -> EvaluatedPoints:
        """Evaluate a version at points, as `Client.evaluate` does at one: coefficients (n,),
        dimensionless; InputError for an unknown input or unit."""
        return self.version(version, vehicle).evaluate(units, **inputs)

    def versions(self, vehicle: str | None = None) -> "pd.DataFrame":
        """Return the versions of a vehicle, one row each; the index is the label. A notebook shows
        the first columns.

        vehicle : its name; None where the workspace has only one. UnknownNameError for an unknown
        vehicle, or for None where there are several; see `vehicle_of`.
        """
        catalogue = self._access.catalogue
        name = vehicle_of(catalogue, vehicle)
        documents = versions_document(catalogue, name, catalogue.versions(name))
        return _listing(documents, "label", _OF_VERSIONS)

    def version(self, reference: str = "released", vehicle: str | None = None) -> Version:
        """Return a version by name (``released``), label (``v0002``) or the beginning of its id.

        vehicle : its name; None where the workspace has only one. Raises UnknownNameError for a
        version that is not stored.
        """
        catalogue = self._access.catalogue
        row: VersionRow = version_of(catalogue, reference, vehicle)
        document = version_details(catalogue, row)
        (listed,) = versions_document(catalogue, row.vehicle, [row])
        database = database_of(catalogue, row)
        return Version(row.label, row.id, row.vehicle, database, document, listed)

    def __repr__(self) -> str:
        return f"<workspace {self.root}: {', '.join(self.vehicles) or 'no vehicle'}>"

    def _repr_html_(self) -> str:
        """Return the vehicles, each with its flights and its newest versions, as a notebook shows
        them."""
        catalogue, rows = self._access.catalogue, list[tuple[str, ...]]()
        facts = []
        for name in self.vehicles:
            versions = catalogue.versions(name)
            facts.append(
                (name, f"{len(catalogue.flights(name))} flights, {len(versions)} versions")
            )
            newest = versions_document(catalogue, name, versions[-_NEWEST:])
            rows += [_row(name, each) for each in newest]
        return html_of(Summary(f"workspace {self.root}", facts, _HEADER, rows))


def _row(vehicle: str, listed: dict[str, Any]) -> tuple[str, ...]:
    """The cells of `_HEADER` of one version."""
    return (
        vehicle,
        listed["label"],
        f"{listed['created_utc'][:16].replace('T', ' ')}",
        ", ".join(listed["names"]),
        held_out_words(listed["held_out"]),
        flights_words(listed["flights"]),
        findings_words(listed),
    )


def _listing(documents: list[dict[str, Any]], index: str, first: Sequence[str]) -> "pd.DataFrame":
    from aerodb.flows.library.listings import listing  # imports pandas, which is slow

    return listing(documents, index, first)


def open_workspace(path: str | Path = "aerodb-workspace") -> Workspace:
    """Open a workspace folder to read it; the commands write to it.

    Raises InputError where the folder is no workspace; StoreError of its catalogue comes with the
    first question.
    """
    return Workspace(Folder.open(Path(path), create=False).root)
