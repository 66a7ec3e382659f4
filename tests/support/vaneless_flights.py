"""The guide's glider without vanes, taken in through the real flows: what tracing and declared
updates make of its flights.

What flies is always the same; what is wrong is the database that the flights are compared with, so
that one bank of flights serves all cases.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from aerodb.exchange.native import read_native
from aerodb.flight import Flight
from aerodb.flows.flight import flight_flow
from aerodb.flows.importing import import_flow
from aerodb.flows.run import run_flow
from aerodb.increments.estimate import Update, estimate_increments
from aerodb.increments.model_file import parse_model_file
from aerodb.increments.validation import HoldOut
from aerodb.loop import Library, consider_parameters, noisier_flights
from aerodb.loop.angle_errors import with_attenuation
from aerodb.storage.catalogue.catalogue import Catalogue
from aerodb.storage.workspace import Workspace
from aerodb.support import Array
from aerodb.tasks.steps.compare import load_comparison
from aerodb.tasks.steps.consistency import load_consistent, noise_of
from aerodb.tasks.steps.loop_flights import StoredFlights
from aerodb.tasks.steps.trace import freeze_library, trace_flight
from aerodb.tasks.steps.update import UpdatePlan
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace
from aerodb.tracing.decision.findings import Traced
from aerodb.tracing.decision.verdicts import trace
from aerodb.tracing.settings import TracingSettings
from aerodb.vehicle import parse_vehicle
from tests.support.guide_flights import Flown, blocks, fly_glider, instruments, steeper, write_logs
from tests.support.paths import ROOT

NAME = "my-glider"
GUIDE = ROOT / "docs" / "guides" / "px4-without-vanes.md"
#: Database -> what of the flown one it has wrong; and the hypothesis that says so, with its value.
WRONG: Mapping[str, tuple[str, str]] = {
    "nothing": ("", ""),
    "lift": ("alpha = -6.0", "alpha = -5.0"),
    "elevator": ("delta_elevator = -1.0", "delta_elevator = -0.8"),
    "lift by elevator": ("delta_elevator = -0.4", "delta_elevator = -0.2"),
}
PLANTED: Mapping[str, tuple[str, float]] = {
    "lift": ("alpha_slope@CZ", -1.0),
    "elevator": ("control_effectiveness@Cm:elevator", -0.2),
    "lift by elevator": ("control_effectiveness@CZ:elevator", -0.2),
}


@dataclass(frozen=True)
class Fleet:
    """Flights taken in: ids of those that got alpha and beta, versions by what is wrong, and the
    true alpha at their times."""

    access: WorkspaceAccess
    run: str
    flights: tuple[str, ...]
    versions: Mapping[str, str]
    true_alpha: Mapping[str, Array]

    def plan(self, wrong: str) -> UpdatePlan:
        """All flights identify."""
        return UpdatePlan(
            NAME, self.versions[wrong], "", HoldOut(self.flights, (), "cross-validated"), (), ()
        )

    def library(self, wrong: str) -> Library:
        """The library of these flights beside a database."""
        return freeze_library(
            self.plan(wrong), workspace=str(self.access.workspace.root), run=self.run
        )

    def traced(self, wrong: str, groups: Sequence[Sequence[int]]) -> list[Traced]:
        """What is found from each group of flights (places)."""
        where = {"workspace": str(self.access.workspace.root), "run": self.run}
        library, database = self.library(wrong), self.access.database(self.versions[wrong])
        normal_equations = [
            trace_flight(flight, **where, library=library, database=database)
            for flight in self.flights
        ]
        return [
            trace([normal_equations[i] for i in group], library.hypotheses, library.settings)
            for group in groups
        ]

    def updated(self, wrong: str, groups: Sequence[Sequence[int]]) -> Iterator[Update]:
        """The guide's declared increments, estimated as `aerodb update` does from each group of
        flights (places)."""
        database, vehicle = self.access.database(self.versions[wrong]), self.access.vehicle(NAME)[0]
        loaded = [
            load_comparison(self.access, flight, self.versions[wrong], self.run)
            for flight in self.flights
        ]
        flights = [entry.flight for entry in loaded]
        comparisons = [entry.comparison for entry in loaded]
        source = StoredFlights(self.access, NAME, self.run)
        about = (
            {id: source.reconstruction(id) for id in self.flights},
            vehicle,
            database,
            flights,
            comparisons,
        )
        doubts, again = consider_parameters(*about), noisier_flights(*about)
        model = parse_model_file(guide_files()["increments.toml"])
        for group in groups:
            chosen = [flights[i] for i in group], [comparisons[i] for i in group]
            update = estimate_increments(*chosen, model, database, doubts)
            others = [([each[i][0] for i in group], [each[i][1] for i in group]) for each in again]
            noisier = [estimate_increments(*other, model, database) for other in others]
            yield with_attenuation(update, noisier, TracingSettings().shift_factor)

    def consistent(self, flight: str) -> tuple[Flight, dict[str, Any]]:
        """A flight after its reconstruction, and the document of that."""
        loaded = load_consistent(self.access, self.access.catalogue.flight(flight), self.run)
        return loaded.flight, loaded.document

    def error_of_alpha(self, flight: str) -> tuple[float, float]:
        """Root mean squares about the level: of the true error of a reconstructed alpha, and of
        what the smoother allows for."""
        found, document = self.consistent(flight)
        noise = noise_of(document)
        assert noise is not None
        error = found["alpha"] - self.true_alpha[flight]
        return float(np.nanstd(error)), noise.rms("alpha", noise.edges[0])


def guide_files() -> dict[str, str]:
    """Title -> text of the files that the guide shows."""
    return {title: text for _, title, text in blocks(GUIDE.read_text(encoding="utf-8")) if title}


@lru_cache(maxsize=1)
def _flown(flights: int, seed: int) -> Flown:
    files = guide_files()
    vehicle, handbook = parse_vehicle(files["my-glider.toml"]), files["handbook.toml"]
    return fly_glider(vehicle, read_native(handbook), read_native(steeper(handbook)), flights, seed)


def fleet(folder: Path, flights: int, seed: int, heave_bias: float = 0.01) -> Fleet:
    """Flies, writes logs into `folder`, and takes them in. heave_bias : of the accelerometer along
    z, m/s^2."""
    files = guide_files()
    handbook, flown = files["handbook.toml"], _flown(flights, seed)
    logs = write_logs(
        folder,
        flown,
        instruments(parse_vehicle(files["my-glider.toml"]), heave_bias=heave_bias),
        seed,
    )
    workspace = Workspace.open(folder / "workspace")
    with Catalogue.open(workspace.catalogue) as catalogue:
        catalogue.add_vehicle(NAME, files["my-glider.toml"])
    versions = {}
    for name, (right, wrong) in WRONG.items():
        path = folder / "database.toml"
        path.write_text(
            steeper(handbook).replace(right, wrong) if right else steeper(handbook),
            encoding="utf-8",
        )
        asked = {"file": str(path), "vehicle": NAME, "bindings": {}}
        versions[name] = run_flow(import_flow, asked, workspace, "direct")["version"]
    outcomes = run_flow(
        flight_flow, {"logs": [str(log) for log in logs], "vehicle": NAME}, workspace, "direct"
    )
    access = access_workspace(str(workspace.root))
    run = access.catalogue.start_run("tracing", how="direct").id
    true_alpha, ids = {}, []
    for number, outcome in enumerate(outcomes):
        row = access.catalogue.flight(outcome["flight"])
        found = load_consistent(access, row, run).flight
        if (
            "alpha" in found and "beta" in found
        ):  # others cannot be compared with the database, and are left out
            clock, alpha = flown.true("alpha", number)
            ids.append(outcome["flight"])
            true_alpha[ids[-1]] = np.interp(found.time - found.time[0], clock, alpha)
    return Fleet(access, run, tuple(ids), versions, true_alpha)


def groups(of: int, size: int, count: int) -> list[list[int]]:
    """`count` seeded choices of `size` flights out of `of`."""
    drawn = (
        np.random.default_rng([5, number, size]).choice(of, size, replace=False)
        for number in range(count)
    )
    return [[int(i) for i in chosen] for chosen in drawn]
