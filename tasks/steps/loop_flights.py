"""Flights of a workspace as a source for the closed loop; missing results are computed and
stored."""

import os
from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar

from aerodb.coefficients import Comparison
from aerodb.conditioning import Segment, selected
from aerodb.effects import FlightView, view_of
from aerodb.exchange import database_document_sha256
from aerodb.flight import Flight
from aerodb.increments import NoiseFloor
from aerodb.loop import Library, ReconstructionErrors, noise_floors_of, normal_equations_beside
from aerodb.storage.files import read_normal_equations, write_normal_equations
from aerodb.tables import AeroDatabase
from aerodb.tasks.steps.coefficients import FlightCoefficients, load_coefficients
from aerodb.tasks.steps.compare import compare_loaded
from aerodb.tasks.steps.consistency import (
    applied_errors,
    load_consistent,
    noise_of,
    reconstructed_angles,
    remaining_errors,
)
from aerodb.tasks.steps.segments import segments_of
from aerodb.tasks.stored_steps import StoredResult
from aerodb.tasks.workers import cached, file_key
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace
from aerodb.tracing import FlightNormalEquations, thinned
from aerodb.vehicle import Vehicle

Value = TypeVar("Value")

#: Step and kind under which normal equations are stored.
_STORED: Final = "gram"


def reconstruction_of(document: Mapping[str, Any]) -> ReconstructionErrors:
    """Return what the closed loop needs of a reconstruction, from the document of a consistent
    flight: errors in SI units, noise as `noise_of` gives it."""
    return ReconstructionErrors(
        noise=noise_of(document),
        angles=reconstructed_angles(document),
        errors={e["parameter"]: e["standard_error"] for e in document.get("estimates", ())},
        known=remaining_errors(document),
        applied=tuple(applied_errors(document)),
        calibrated=bool(document.get("calibration")),
    )


@dataclass(frozen=True)
class StoredFlights:
    """Flights of the vehicle `vehicle_name` in a workspace; new results are stored as made by
    `run`.

    Implements `aerodb.loop.FlightSource`. What was read once is remembered (`memory_cache`): all
    steps of a run see its flights as they were when the first asked for them. select : conditions
    of the samples that count (`aerodb.conditioning.selected`).
    """

    opened: WorkspaceAccess
    vehicle_name: str
    run: str
    select: tuple[str, ...] = ()
    process: int = field(default_factory=os.getpid, init=False, repr=False)

    @property
    def access(self) -> WorkspaceAccess:
        """The workspace; a fork of the process that opened its catalogue has a connection of its
        own."""
        if os.getpid() == self.process:
            return self.opened
        return access_workspace(str(self.opened.workspace.root))

    @property
    def vehicle(self) -> Vehicle:
        """The vehicle (lengths [m], masses [kg]), from its present file and settings;
        UnknownNameError where it is not known."""
        return self._once(lambda: self.access.vehicle(self.vehicle_name)[0], "vehicle")

    def _once(self, make: Callable[[], Value], *what: Hashable) -> Value:
        where = str(self.opened.workspace.root)
        return cached((where, self.vehicle_name, self.run, self.select, *what), make)

    def _loaded(self, flight: str) -> FlightCoefficients:
        return self._once(lambda: self._selected(flight), "coefficients", flight)

    def _selected(self, flight: str) -> FlightCoefficients:
        """The coefficients, usable where all conditions hold."""
        loaded = load_coefficients(self.access, self.access.catalogue.flight(flight), self.run)
        if not self.select:
            return loaded
        mask = selected(loaded.flight, self.select)
        usable = {axis: each & mask for axis, each in loaded.coefficients.usable.items()}
        return replace(loaded, coefficients=replace(loaded.coefficients, usable=usable))

    def flight(self, flight: str) -> Flight:
        """Return the consistent flight from which the coefficients are computed.

        Samples (n,), SI. Raises UnknownNameError for an unknown flight.
        """
        return self._loaded(flight).flight

    def reconstruction(self, flight: str) -> ReconstructionErrors:
        """Return the reconstruction, in SI units, from the stored document of the consistent
        flight. Raises UnknownNameError for an unknown id."""
        return self._once(lambda: self._reconstruction(flight), "reconstruction", flight)

    def _reconstruction(self, flight: str) -> ReconstructionErrors:
        row = self.access.catalogue.flight(flight)
        return reconstruction_of(load_consistent(self.access, row, self.run).document)

    def segments(self, flight: str) -> tuple[Segment, ...]:
        """Return the segments that conditioning found.

        Times [s] from the first sample. Raises UnknownNameError for an unknown flight.
        """
        return self._once(lambda: segments_of(self.access, flight, self.run), "segments", flight)

    def comparison(self, flight: str, database: AeroDatabase) -> Comparison:
        """Return the comparison of a flight with a database; cached in memory, not stored.

        Coefficients (n,). Raises UnknownNameError for an unknown flight.
        """
        return compare_loaded(self._loaded(flight), database, self.vehicle, self.select)

    def view(
        self, flight: str, database: AeroDatabase, bandwidth: float | None = None
    ) -> FlightView:
        """Return a flight compared with a database, at the rate that tracing at `bandwidth` [Hz]
        needs."""
        given = self.flight(flight), self.comparison(flight, database)
        if bandwidth is not None:
            given = self._once(
                lambda: thinned(*given, bandwidth),
                "thinned",
                flight,
                database_document_sha256(database),
                bandwidth,
            )
        return view_of(*given, database, self.vehicle)

    def noise_floors(
        self, flights: Sequence[str], database: AeroDatabase
    ) -> dict[str, Mapping[str, NoiseFloor]]:
        """Return flight (id) -> axis -> error that remains if a database is right, dimensionless;
        what several steps of a run ask is calculated once."""
        return self._once(
            lambda: noise_floors_of(self, flights, database),
            "noise floors",
            tuple(flights),
            database_document_sha256(database),
        )

    def normal_equations(
        self, flights: Sequence[str], database: AeroDatabase, library: Library
    ) -> list[FlightNormalEquations]:
        """Return the normal equations of flights; read back if stored, else computed and stored.

        Matrices (k, k). Raises UnknownNameError for an unknown flight, InputError as
        `load_coefficients` does.
        """
        results = {flight: self._stored(flight, database, library) for flight in flights}
        paths = {flight: result.stored() for flight, result in results.items()}
        missing = [flight for flight in results if paths[flight] is None]
        made = dict(
            zip(missing, normal_equations_beside(self, missing, database, library), strict=True)
        )
        for flight, equations in made.items():
            results[flight].keep(self.run, partial(write_normal_equations, equations=equations))
        return [
            made[flight] if (path := paths[flight]) is None else _equations(path)
            for flight in flights
        ]

    def _stored(self, flight: str, database: AeroDatabase, library: Library) -> StoredResult:
        """Where the normal equations of a flight are, or will be."""
        inputs = {
            "coefficients": self._loaded(flight).key,
            "database": database_document_sha256(database),
        }
        settings = {"library": library.sha256, "tracing": library.settings.sha256}
        if self.select:
            settings["select"] = " and ".join(self.select)
        if flight in library.stall:
            settings["stall"] = str(library.stall[flight])
        if flight in library.lift_hysteresis:
            settings["loop"] = str(library.lift_hysteresis[flight])
        return StoredResult(self.access, _STORED, _STORED, inputs, settings, flight=flight)

    def looked_before(self, flights: Sequence[str], library: Library) -> frozenset[str] | None:
        """Return the hypotheses that earlier libraries tested on all these flights, from stored
        results."""
        known: frozenset[str] | None = None
        for flight in flights:
            for result in self.access.catalogue.results_of(flight, _STORED):
                if result.settings["library"] != library.sha256:
                    ids = frozenset(
                        read_normal_equations(self.access.file_of(result.path)).hypotheses
                    )
                    known = ids if known is None else known & ids
        return known


def _equations(path: Path) -> FlightNormalEquations:
    return cached(file_key(path), lambda: read_normal_equations(path))


def flights_of(workspace: str, vehicle: str, run: str, select: Sequence[str] = ()) -> StoredFlights:
    """Return the flights of a vehicle (its name) in a workspace; of their samples (n,) those count
    for which all conditions of `select` hold."""
    return StoredFlights(access_workspace(workspace), vehicle, run, tuple(select))
