"""Declared increments from flights in memory: an updated database, validated on flights that did
not identify it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerodb.flows.library.fitting import Model, identification_flights, model_of
from aerodb.flows.library.flights import ComparedFlight
from aerodb.flows.library.tracing import flights_in_memory, verdict_of
from aerodb.flows.library.views import Data, Result, Summary, Values, number
from aerodb.identification import REGRESSION, chosen_methods, update_by
from aerodb.increments import (
    AxisValidation,
    Beyond,
    ConsiderParameter,
    HoldOut,
    ModelFile,
    Update,
    choose_hold_out,
    parse_model_file,
)
from aerodb.loop import ByMethod, estimate_declared, validate_declared
from aerodb.report import beyond_remarks, update_document
from aerodb.support import half_interval
from aerodb.tables import AeroDatabase


@dataclass(frozen=True, eq=False, repr=False)
class UpdatedDatabase(Result):
    """A database with declared increments, as ``aerodb update`` makes it.

    baseline : before. estimates : per axis, with covariance (k, k) in SI units. validation : errors
    of each axis before and after. beyond : flights that leave the envelope. hold_out : ids of the
    flights that identified and of those held out. names : flight (id) -> name of its log.
    """

    baseline: AeroDatabase
    estimates: Update
    validation: tuple[AxisValidation, ...]
    beyond: tuple[Beyond, ...]
    hold_out: HoldOut
    names: Mapping[str, str]
    vehicle: str
    method: str = REGRESSION

    @property
    def candidate(self) -> AeroDatabase:
        """The database with the increments, in SI units, covariances (k, k)."""
        return self.estimates.candidate

    @property
    def document(self) -> dict[str, Any]:
        """The document of ``aerodb update`` as far as it needs no store
        (docs/reference/contract.md, section "update and close-loop"), in SI units."""
        return update_document(
            vehicle=self.vehicle,
            baseline=self.baseline.name,
            hold_out=self.hold_out,
            excluded=(),
            looks={},
            update=self.estimates,
            proof=self.validation,
            beyond=self.beyond,
        )

    def headlines(self) -> list[str]:
        """Return the lines that the command prints first, values with their units."""
        return verdict_of(self.document, made=True)

    def summary(self) -> Summary:
        """Return the estimates with their 95 % intervals, in the SI unit of each term, and the rms
        errors (dimensionless) before and after."""
        document = self.document
        rows = [
            (
                entry["axis"],
                term["term"],
                number(term["value"]),
                number(half_interval(term["standard_error"]), 2),
                f"[{number(term['ci95'][0], 3)}, {number(term['ci95'][1], 3)}]",
            )
            for entry in document["increments"]
            for term in entry["terms"]
        ]
        held = self.hold_out.held_out
        facts = [
            ("method", self.method),
            ("flights", f"{len(self.hold_out.identified)} to find, {len(held)} to check"),
        ]
        said = [
            f"{each.axis}: error {number(each.held_out_rms_before or each.rms_before)} ->"
            f" {number(each.held_out_rms_after or each.rms_after)}, {each.outcome}"
            for each in self.validation
        ]
        said += [remark.sentence for remark in beyond_remarks(self.beyond, self.names)]
        header = ("axis", "term", "value", "+-", "95 %")
        title = f"{self.baseline.name} with declared increments"
        return Summary(title, facts, header, rows, [*said, *document["remarks"]])

    def data(self) -> Data:
        """Return the estimates, arrays (n,) by parameter: value, standard error and 95 % interval
        per SI unit of the term."""
        terms = [
            (f"{entry['axis']} {term['term']}", entry["axis"], term)
            for entry in self.document["increments"]
            for term in entry["terms"]
        ]

        def column(values: Sequence[object], kind: type = object) -> Values:
            return Values(("parameter",), np.array(values, dtype=kind))

        return Data(
            "parameter",
            {"parameter": column([name for name, _, _ in terms])},
            {
                "axis": column([axis for _, axis, _ in terms]),
                "value": column([term["value"] for _, _, term in terms], float),
                "standard_error": column([t["standard_error"] for _, _, t in terms], float),
                "low": column([term["ci95"][0] for _, _, term in terms], float),
                "high": column([term["ci95"][1] for _, _, term in terms], float),
                "unit": column(["1/SI" for _ in terms]),
            },
            {"database": self.baseline.name, "method": self.method},
        )


def update(
    flights: Sequence[ComparedFlight],
    model: str | Path | Model,
    *,
    hold_out: Sequence[ComparedFlight] | None = None,
    method: str = REGRESSION,
) -> UpdatedDatabase:
    """Estimate declared increments on the database that flights of one vehicle were compared with,
    and validate them, as ``aerodb update`` does, in memory (docs/method/updates.md).

    Parameters
    ----------
    flights : in the order flown.
    model : a model file (TOML) of increments, its text, or what it holds as a dict.
    hold_out : those that only validate; empty: none; None: by the rule of docs/method/updates.md.
    method : by its name in ``aerodb update``.

    Raises InputError where no declared term is excited, and for an unknown method. Values are in SI
    units.
    """
    source = flights_in_memory(flights)
    baseline, declared = flights[0].database, parse_model_file(model_of(model))
    chosen = chosen_methods([method])[0]
    requested = None if hold_out is None else [each.measured.flight.id for each in hold_out]
    split = choose_hold_out(list(source.flown), {}, requested)

    def estimated(
        ids: Sequence[str],
        given: ModelFile,
        consider: Mapping[str, Sequence[ConsiderParameter]] | None,
    ) -> Update:
        flown = identification_flights([source.flown[id] for id in ids])
        return update_by(chosen, flown, given, baseline, consider)

    by_method: ByMethod | None = None if chosen.name == REGRESSION else estimated
    made = estimate_declared(source, split.identified, declared, baseline, by_method)
    proof, beyond = validate_declared(source, split, made, declared, baseline, by_method)
    names = {id: each.measured.reconstructed.log.name for id, each in source.flown.items()}
    return UpdatedDatabase(
        baseline, made, proof, beyond, split, names, source.vehicle.name, chosen.name
    )
