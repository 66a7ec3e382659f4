"""A workspace as the commands have filled it: flights, versions, evaluation. It is only read."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, Final

from aerodb.consistency import from_document
from aerodb.flows.library.documents import Document, of_finding, of_flight
from aerodb.flows.library.evaluation import EvaluatedPoints, evaluate
from aerodb.flows.library.logs import Log, log_of
from aerodb.flows.library.views import Summary, html_of
from aerodb.report import version_lines
from aerodb.storage.catalogue import VersionRow
from aerodb.storage.files import read_recording
from aerodb.storage.workspace import Workspace as Folder
from aerodb.tables import AeroDatabase
from aerodb.tasks.references import vehicle_of, version_of
from aerodb.tasks.steps import export_version, mapping_of
from aerodb.tasks.view import (
    database_of,
    finding_document,
    findings_page,
    findings_words,
    flight_details,
    flights_document,
    flights_words,
    held_out_words,
    record_of,
    series_of,
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

    def headlines(self) -> list[tuple[str, str]]:
        """Return what was found, the proof, and what is left, as ``aerodb version show`` says it
        (label and text; errors are rms of coefficients); empty for an import."""
        rest = f'finding("{self.label}")'
        told = version_lines(self.document["report"], self.label, rest=rest)
        return [(name, "; ".join(texts).replace("\u2212", "-")) for name, texts in told]

    def __repr__(self) -> str:
        return f"<version {self.label} ({self.id[:12]}) of {self.vehicle}>"

    def __str__(self) -> str:
        names = f" ({', '.join(self.listed['names'])})" if self.listed["names"] else ""
        said = [f"  {name:<6}  {text}" for name, text in self.headlines()]
        stale = [f"  stale   {reason}" for reason in self.document["stale"]]
        return "\n".join([f"version {self.label} of {self.vehicle}{names}", *said, *stale])

    def _repr_html_(self) -> str:
        """Return what was found and proved, and what a list says of the version, as a notebook
        shows it."""
        said = list(zip(_HEADER[2:], _row(self.vehicle, self.listed)[2:], strict=True))
        facts = [
            *self.headlines(),
            ("id", self.id[:12]),
            *said,
            ("inputs", ", ".join(self.database.inputs)),
        ]
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

    def flight(self, flight: str, vehicle: str | None = None) -> Document:
        """Return the document of a flight, as `Client.flight` does: times [s], figures in SI units;
        ``print`` says its verdict. UnknownNameError where there is none."""
        access = self._access
        return of_flight(flight_details(access, access.catalogue.flight(flight, vehicle)))

    def channels(
        self,
        flight: str,
        names: Sequence[str] | None = None,
        start: float = -1e12,
        end: float = 1e12,
        points: int = 2000,
    ) -> "dict[tuple[str, str], pd.Series[float]]":
        """Return channels of a flight [SI] over time [s], as `Client.channels` does.

        Raises UnknownNameError for a name that the flight lacks.
        """
        import pandas as pd  # slow to import

        access = self._access
        row = access.catalogue.flight(flight)
        wanted = list(names or record_of(access, row).first)
        found: dict[tuple[str, str], pd.Series[float]] = {}
        for line in series_of(access, row, wanted, start, end, points)[0]:
            series = pd.Series(line.values, pd.Index(line.time, name="time"), name=line.name)
            series.attrs["unit"] = line.unit
            found[(line.name, line.source)] = series
        return found

    def export(self, version: str, form: str, vehicle: str | None = None) -> bytes:
        """Return the file that ``aerodb version export`` writes, as `Client.export` does.

        form : ``daveml``, ``jsbsim``, ``csv``, ``mat`` or ``netcdf``. InputError for another form,
        or a database that it cannot hold.
        """
        access = self._access
        row = version_of(access.catalogue, version, vehicle)
        with TemporaryDirectory() as folder:
            target = Path(folder) / f"{row.vehicle}-{row.label}"
            export_version(access.workspace, access.catalogue, row, form, target)
            return target.read_bytes()

    def findings(self) -> Iterator[dict[str, Any]]:
        """Yield updates and closed loops, newest first, each in one sentence, as `Client.findings`
        does. StoreError where the catalogue cannot be read."""
        place = ""
        while True:
            entries, place = findings_page(self._access, _NEWEST, place)
            yield from entries
            if not place:
                return

    def finding(self, reference: str, vehicle: str | None = None) -> Document:
        """Return the document of an update or a closed loop, as `Client.finding` does, in SI units;
        ``print`` says what to decide on. UnknownNameError where there is none."""
        return of_finding(finding_document(self._access, reference, vehicle))

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
