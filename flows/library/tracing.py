"""Tracing flights in memory: what their residuals have in common, and a candidate database."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from aerodb.coefficients import Comparison, compare
from aerodb.conditioning import Segment
from aerodb.errors import InputError
from aerodb.exchange import database_document_sha256
from aerodb.flight import Flight
from aerodb.flows.library.flights import ComparedFlight
from aerodb.flows.library.logs import read_text
from aerodb.flows.library.views import Data, Result, Summary, Values, number
from aerodb.increments import AxisValidation, HoldOut, choose_hold_out
from aerodb.loop import (
    Accept,
    LoopResult,
    ReconstructionErrors,
    WithoutStore,
    freeze_library,
    run_loop,
    unexplained_residuals,
    until_all_gain,
    validate_loop,
    with_model_error,
)
from aerodb.report import decision, loop_document
from aerodb.support import one_blas_thread
from aerodb.tables import AeroDatabase
from aerodb.tasks.steps import reconstruction_of
from aerodb.tracing import Finding, UnexplainedResidual
from aerodb.vehicle import Vehicle

#: Lines of a decision that need no store.
_TOLD: Final = ("found", "strongest", "proved", "also", "left")


@dataclass(frozen=True, eq=False, repr=False)
class TracedFlights(Result):
    """What a model lacks, by the residuals of several flights.

    loop : findings of all rounds, those added, and the candidate. validation : error of each axis
    before and after on flights that did not identify. unexplained : what stays predictable and has
    no name. names : flight -> name of its log. library_sha256 : of the hypotheses, which were fixed
    before any residual was read. hold_out : ids of the flights that identified and of those held
    out.
    """

    loop: LoopResult
    validation: tuple[AxisValidation, ...]
    unexplained: tuple[UnexplainedResidual, ...]
    names: Mapping[str, str]
    library_sha256: str
    hold_out: HoldOut
    vehicle: str

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All findings, with verdict, value and interval (2,) in the unit of each, and votes of the
        flights (docs/method/tracing.md, section 12)."""
        return self.loop.findings

    @property
    def candidate(self) -> AeroDatabase:
        """The database with what was added; the baseline where nothing was. Values are in SI units,
        covariances (k, k)."""
        return self.loop.candidate

    @property
    def document(self) -> dict[str, Any]:
        """The document of ``aerodb close-loop`` as far as it needs no store
        (docs/reference/contract.md, section "update and close-loop"), in SI units."""
        loop = self.loop
        return loop_document(
            vehicle=self.vehicle,
            baseline=loop.baseline.name,
            hold_out=self.hold_out,
            excluded=(),
            looks={},
            library=self.library_sha256,
            rounds=loop.rounds,
            traced=loop.traced,
            findings=loop.findings,
            added=loop.added,
            left=self.unexplained,
            without_gain=loop.without_gain,
            axis_models=[asdict(model) for model in loop.axis_models],
            proof=self.validation,
            remarks=loop.remarks,
            within_flights=self.hold_out.kind == "cross-validated" and not loop.separates,
        )

    def headlines(self) -> list[str]:
        """Return the lines that the command prints first, values with their units."""
        return verdict_of(self.document, made=bool(self.loop.added))

    def summary(self) -> Summary:
        """Return the findings, values and intervals (low, high) in the unit of each, with the rms
        errors (dimensionless scalars) before and after."""
        added = {finding.hypothesis for finding in self.loop.added}
        rows = [
            (
                each.effect,
                " ".join(each.axis),
                each.verdict.replace("_", " "),
                f"{number(each.value)} [{number(each.ci95[0], 3)}, {number(each.ci95[1], 3)}]",
                each.unit,
                "yes" if each.hypothesis in added else "no",
            )
            for each in self.findings
        ]
        remarks = [f"{each.effect}: {each.because}" for each in self.findings]
        remarks += [
            f"{each.axis}: error on flights that did not identify"
            f" {number(each.held_out_rms_before)} -> {number(each.held_out_rms_after)}"
            for each in self.validation
            if each.held_out_rms_before != each.held_out_rms_after
        ]
        remarks += [f"{each.axis}: {each.because}" for each in self.unexplained if each.found]
        return Summary(
            f"{len(self.names)} flights beside {self.loop.baseline.name}",
            [("library", self.library_sha256[:12]), ("rounds", str(self.loop.rounds))],
            ("effect", "axes", "verdict", "value [95 %]", "unit", "added"),
            rows,
            [*remarks, *self.loop.remarks],
        )

    def data(self) -> Data:
        """Return the findings, arrays (n,) by hypothesis: value and interval in the unit of each,
        and adjusted p (dimensionless)."""
        found = self.findings
        interval = np.array([each.ci95 for each in found]).reshape(-1, 2)

        def column(values: Sequence[object], kind: type = object) -> Values:
            return Values(("hypothesis",), np.array(values, dtype=kind))

        quantities = {
            "effect": column([each.effect for each in found]),
            "axes": column([" ".join(each.axis) for each in found]),
            "verdict": column([each.verdict for each in found]),
            "value": column([each.value for each in found], float),
            "low": column(list(interval[:, 0]), float),
            "high": column(list(interval[:, 1]), float),
            "unit": column([each.unit for each in found]),
            "p_adjusted": column([each.p_adjusted for each in found], float),
        }
        names = column([each.hypothesis for each in found])
        return Data("hypothesis", {"hypothesis": names}, quantities)


def trace(
    flights: Sequence[ComparedFlight],
    *,
    hold_out: Sequence[ComparedFlight] | None = None,
    effects: str | Path | None = None,
    measured: Sequence[str] = (),
    accept: Accept | None = None,
) -> TracedFlights:
    """Trace the residuals of several flights of one vehicle, compared with one database, to the
    effects that the database lacks or the sensors have, and validate the candidate.

    The same closed loop as ``aerodb close-loop``, in memory (docs/method/tracing.md).

    Parameters
    ----------
    flights : in the order flown.
    hold_out : those that only validate; None: by the rule of docs/method/updates.md.
    effects : a file of user templates (TOML).
    measured : what was measured outside flight, ``NAME=SIGMA, BY`` each.
    accept : effects to add although their verdict alone does not admit them.

    Raises InputError for flights of several vehicles, or compared with several databases. Values
    are in SI units.
    """
    source = flights_in_memory(flights)
    baseline, accept = flights[0].database, accept or Accept()
    requested = None if hold_out is None else [each.measured.flight.id for each in hold_out]
    split = choose_hold_out(list(source.flown), {}, requested)
    templates = "" if effects is None else read_text(effects)
    with one_blas_thread():  # more of them wait for each other
        library = freeze_library(source, split.identified, baseline, templates, measured=measured)
        loop, (validation,), left = until_all_gain(
            lambda out: run_loop(source, split.identified, baseline, library, accept, out),
            lambda loop: (validate_loop(source, split, library, loop, accept),),
            lambda loop: unexplained_residuals(source, split.identified, loop.candidate, library),
        )
        loop = replace(loop, candidate=with_model_error(source, split.identified, loop, library))
    names = {each.measured.flight.id: each.measured.reconstructed.log.name for each in flights}
    return TracedFlights(
        loop,
        tuple(validation),
        tuple(left),
        names,
        library.sha256,
        split,
        source.vehicle.name,
    )


def verdict_of(document: Mapping[str, Any], made: bool) -> list[str]:
    """Return the lines to decide on of a document that is not stored, values with their units;
    see `aerodb.report.decision`. made : whether there is a candidate."""
    given = {**document, "candidate": "candidate" if made else None, "label": "candidate"}
    told = decision(given, rest="report()")
    lines = [
        (label if k == 0 else "", text.replace("\u2212", "-"))
        for label, texts in told.lines
        for k, text in enumerate(texts)
        if label in _TOLD
    ]
    width = max((len(label) for label, _ in lines), default=0)
    return [told.verdict, *(f"  {label:<{width}}  {text}" for label, text in lines)]


def several(flights: Sequence[Any]) -> Sequence[Any]:
    """Return flights as they are; InputError for one flight that is not in a list."""
    if isinstance(flights, Result):
        raise InputError("one flight where several are asked for", "flights", "write [flight]")
    return flights


def flights_in_memory(flights: Sequence[ComparedFlight]) -> "FlightsInMemory":
    """Return compared flights as a `FlightSource` for the closed loop.

    Raises InputError where there are none, for flights of several vehicles or databases, and for
    one that is there twice.
    """
    if not flights:
        raise InputError("no flights", "trace", "compare flights with a database first")
    flights = several(flights)
    by_id = {each.measured.flight.id: each for each in flights}
    vehicles = {each.measured.reconstructed.vehicle.name for each in flights}
    if len(vehicles) > 1:
        what = f"the flights are of several vehicles: {', '.join(sorted(vehicles))}"
        raise InputError(what, "flights", "give flights of one vehicle")
    if len({database_document_sha256(each.database) for each in flights}) > 1:
        raise InputError(
            "the flights are compared with different databases",
            "flights",
            "compare them with one database",
        )
    if len(by_id) < len(flights):
        raise InputError("a flight is there twice", "flights", "give each flight once")
    return FlightsInMemory(flights[0].measured.reconstructed.vehicle, by_id)


@dataclass(frozen=True, eq=False)
class FlightsInMemory(WithoutStore):
    """Compared flights by id; implements `aerodb.loop.FlightSource`."""

    vehicle: Vehicle
    flown: Mapping[str, ComparedFlight]

    def flight(self, flight: str) -> Flight:
        """Return the channels of a flight after reconstruction, (n,) in SI units; KeyError for an
        unknown id."""
        return self.flown[flight].measured.flight

    def reconstruction(self, flight: str) -> ReconstructionErrors:
        """Return the results of the reconstruction of a flight, errors in SI units; KeyError for an
        unknown id."""
        return reconstruction_of(self.flown[flight].measured.reconstructed.document)

    def segments(self, flight: str) -> tuple[Segment, ...]:
        """Return manoeuvres and states of a flight, start and end [s] from its first sample;
        KeyError for an unknown id."""
        return segments_of(self.flown[flight])

    def comparison(self, flight: str, database: AeroDatabase) -> Comparison:
        """Return the comparison of a flight with any database, coefficients (n,) dimensionless.
        InputError where the flight lacks an input of it."""
        one = self.flown[flight]
        if database is one.database:
            return one.comparison
        measured, reference = one.measured, self.vehicle.reference
        return compare(measured.flight, measured.coefficients, database, reference)


def segments_of(flight: ComparedFlight) -> tuple[Segment, ...]:
    """Return the segments of a flight (`Segment`), start and end [s] from its first sample."""
    first = float(flight.measured.flight.time[0])
    return tuple(
        replace(each, start=each.start - first, end=each.end - first)
        for each in flight.measured.reconstructed.log.conditioning.segments
    )
