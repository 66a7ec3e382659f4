"""The closed loop on flights of JSBSim, before any store: traced, added, fitted once more, and
judged on flights not used."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerodb.coefficients.comparison import Comparison, compare
from aerodb.coefficients.total import Coefficients, total_coefficients
from aerodb.effects.adding import add_effects, envelopes_of
from aerodb.effects.aerodynamic.lift_like import zero_lift_alpha
from aerodb.effects.flight_view import view_of
from aerodb.effects.library import hypotheses_for
from aerodb.effects.stall import lift_hysteresis
from aerodb.effects.stall.lift_hysteresis import fitted
from aerodb.effects.stall.stall_shape import StallFlight
from aerodb.flight import Flight
from aerodb.tables.database import AeroDatabase
from aerodb.tables.state_model import Relay
from aerodb.tracing.decision.covariance import joint_covariance
from aerodb.tracing.decision.findings import Finding
from aerodb.tracing.decision.refinement import Refined, downgraded_on_axes, refine
from aerodb.tracing.decision.verdicts import trace
from aerodb.tracing.evidence.bandwidth import tracing_bandwidth
from aerodb.tracing.evidence.flight_evidence import evidence_of
from aerodb.tracing.evidence.normal_equations import normal_equations_of
from aerodb.tracing.evidence.shape_misfit import with_shape_terms
from aerodb.tracing.settings import TracingSettings
from aerodb.vehicle import Vehicle
from tests.support.jsbsim_cases import IDENTIFIED

#: What a flight-path reconstruction gives; its noise is added once more for the systematic bound
#: (SIMEX).
STATES = ("V", "qbar", "alpha", "beta", "p", "q", "r")
COPIES, MOST_ROUNDS = 2, 4


@dataclass(frozen=True)
class Closed:
    """Where the loop ended: the database, what was found round by round, and the flights'
    coefficients."""

    database: AeroDatabase
    rounds: tuple[tuple[Finding, ...], ...]
    coefficients: tuple[Coefficients, ...]
    shapes: tuple[Refined | None, ...]

    @property
    def confirmed(self) -> list[str]:
        """Hypotheses that were added, in the order in which they were found."""
        return [
            finding.hypothesis
            for found in self.rounds
            for finding in found
            if finding.verdict == "confirmed"
        ]

    @property
    def aerodynamic(self) -> list[tuple[str, str]]:
        """Every finding of any verdict that is not about a sensor, with its verdict."""
        return [
            (finding.hypothesis, finding.verdict)
            for found in self.rounds
            for finding in found
            if "@all" not in finding.hypothesis
        ]


def closed(
    database: AeroDatabase, vehicle: Vehicle, flights: Sequence[Flight], *, stall: bool = False
) -> Closed:
    """Traces the first IDENTIFIED flights, adds what is confirmed, and again until nothing is.

    stall : whether a loop of the lift is fitted, for each flight on the others, and joins the
    library.
    """
    law, others = _loops(database, vehicle, flights[:IDENTIFIED]) if stall else (None, {})
    user = [] if law is None else [lift_hysteresis.template(law, others)]
    hypotheses = hypotheses_for(database, vehicle, set(flights[0].channels), user=user)
    known = {hypothesis.id: hypothesis for hypothesis in hypotheses}
    settings = TracingSettings(bandwidth=tracing_bandwidth(database, vehicle, flights))
    coefficients = tuple(total_coefficients(flight, vehicle) for flight in flights)
    rounds: list[tuple[Finding, ...]] = []
    shapes: list[Refined | None] = []
    earlier: dict[str, float] = {}
    wrong = set[str]()
    for _ in range(MOST_ROUNDS):
        normal_equations, views = [], []
        for number, (flight, made) in enumerate(
            zip(flights[:IDENTIFIED], coefficients, strict=False)
        ):
            comparison = compare(flight, made, database, vehicle.reference)
            noisy = [
                _noisier(flight, database, vehicle, 100 * number + copy) for copy in range(COPIES)
            ]
            view = view_of(flight, comparison, database, vehicle)
            evidence = evidence_of(view, hypotheses, noisy, rotating_air=False)
            normal_equations.append(
                normal_equations_of(with_shape_terms(evidence, flight, hypotheses), settings)
            )
            views.append(view)
        rounds.append(
            downgraded_on_axes(
                trace(normal_equations, hypotheses, settings, earlier).findings, wrong
            )
        )
        new = [finding for finding in rounds[-1] if finding.verdict == "confirmed"]
        if not new:
            break
        accepted, values = (
            [known[finding.hypothesis] for finding in new],
            np.array([finding.value for finding in new]),
        )
        if law is not None and any(
            hypothesis.subject == lift_hysteresis.SUBJECT for hypothesis in accepted
        ):
            database = lift_hysteresis.with_state(database, law)
            state = database.states[-1]
            along = [
                state.along(view.time, view.channels, database.reference.chord) for view in views
            ]
            views = [
                replace(view, channels={**view.channels, state.name: x})
                for view, x in zip(views, along, strict=True)
            ]
        earlier |= {finding.hypothesis: finding.value for finding in new}
        covariance, ids = (
            joint_covariance(new, settings.prior_dof),
            [flight.id for flight in flights[:IDENTIFIED]],
        )
        candidate = add_effects(
            database, accepted, values, covariance, envelopes_of(accepted, views, database), ids
        )
        pairs = zip(flights[:IDENTIFIED], coefficients, strict=False)
        beside = [
            view_of(
                flight,
                compare(flight, made, candidate, vehicle.reference),
                candidate,
                vehicle,
            )
            for flight, made in pairs
        ]
        finer = refine(
            beside,
            accepted,
            [h for h in hypotheses if h.kind == "sensor"],
            settings,
        )
        if finer is not None:
            values, covariance = finer.beside(values, covariance)
            candidate = add_effects(
                database,
                finer.terms,
                values,
                covariance,
                envelopes_of(finer.terms, views, database),
                ids,
            )
            wrong |= {
                axis
                for hypothesis in accepted
                if hypothesis.id in finer.variables
                for axis in hypothesis.axes
            }
        shapes.append(finer)
        database = candidate
    return Closed(database, tuple(rounds), coefficients, tuple(shapes))


def _loops(
    database: AeroDatabase, vehicle: Vehicle, flights: Sequence[Flight]
) -> tuple[Relay, dict[str, Relay]]:
    """The loop of all flights, and for each that of the others."""
    seen = []
    for flight in flights:
        comparison = compare(
            flight, total_coefficients(flight, vehicle), database, vehicle.reference
        )
        residual, usable = {"C_lift": comparison.residual("C_lift")}, comparison.usable["C_lift"]
        motion = (flight.time, flight["alpha"], flight["V"], vehicle.reference.chord)
        seen.append(
            StallFlight(flight.id, *motion, residual, {}, usable, zero_lift_alpha(database))
        )
    return fitted(seen), {
        one.flight: fitted([other for other in seen if other is not one]) for one in seen
    }


def _noisier(
    flight: Flight, database: AeroDatabase, vehicle: Vehicle, seed: int
) -> tuple[Flight, Comparison]:
    """The flight with the noise of its states once more, as its vehicle file declares it: white."""
    rng = np.random.default_rng(seed)
    noisy = flight.with_channels(
        {
            name: flight[name] + vehicle.sensors[name].noise * rng.standard_normal(len(flight.time))
            for name in STATES
        }
    )
    return noisy, compare(noisy, total_coefficients(noisy, vehicle), database, vehicle.reference)


@dataclass(frozen=True)
class Judged:
    """One axis on the held-out flights. size : rms of what was added over rms of what was lacking,
    along these flights. floor, before, after : rms of the residual beside the whole, the lacking
    and the candidate database."""

    size: float
    floor: float
    before: float
    after: float

    @property
    def reduction(self) -> float:
        """Share by which the excess error fell."""
        return 1.0 - self.excess(self.after) / self.excess(self.before)

    def excess(self, error: float) -> float:
        return float(np.sqrt(max(error**2 - self.floor**2, 0.0)))


def judged(
    axis: str,
    whole: AeroDatabase,
    lacking: AeroDatabase,
    found: Closed,
    vehicle: Vehicle,
    flights: Sequence[Flight],
) -> Judged:
    """Error and size on `axis` over the flights that did not identify."""
    parts: dict[str, list[np.ndarray]] = {
        name: [] for name in ("truth", "added", "floor", "before", "after")
    }
    for flight, made in zip(flights[IDENTIFIED:], found.coefficients[IDENTIFIED:], strict=True):
        true, old, new = (
            compare(flight, made, database, vehicle.reference)
            for database in (whole, lacking, found.database)
        )
        good = true.usable[axis] & old.usable[axis] & new.usable[axis]
        parts["truth"].append((true.predicted[axis] - old.predicted[axis])[good])
        parts["added"].append((new.predicted[axis] - old.predicted[axis])[good])
        for name, comparison in (("floor", true), ("before", old), ("after", new)):
            parts[name].append(comparison.residual(axis)[good])
    size = {
        name: float(np.sqrt(np.mean(np.concatenate(values) ** 2))) for name, values in parts.items()
    }
    return Judged(size["added"] / size["truth"], size["floor"], size["before"], size["after"])
