"""Databases flown over the manoeuvres of flights in memory, and their responses judged."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from aerodb.flows.library.flights import ComparedFlight
from aerodb.flows.library.tracing import TracedFlights, flights_in_memory, segments_of
from aerodb.flows.library.updating import UpdatedDatabase
from aerodb.flows.library.views import Data, Result, Summary, Values, number
from aerodb.report import count_within, display_unit
from aerodb.simulation import parse_tolerances
from aerodb.support import counted
from aerodb.tables import AeroDatabase
from aerodb.tasks.steps import (
    default_tolerances,
    fly_window,
    manoeuvre_windows,
    read_tolerances,
    responses_summary,
    standard_document,
)


@dataclass(frozen=True, eq=False, repr=False)
class ValidatedDatabase(Result):
    """How a database flew the manoeuvres of flights.

    document : as ``aerodb version validate`` gives it (rms in SI units). independent : whether no
    flight identified the database; None where that is not known.
    """

    database: AeroDatabase
    document: Mapping[str, Any]
    independent: bool | None

    @property
    def passed(self) -> bool:
        """Whether all checks of all manoeuvres are within tolerance."""
        return bool(self.document["passed"])

    def headlines(self) -> list[str]:
        """Return how many checks are within tolerance (a share of the time, dimensionless), and
        those that are not."""
        found = self.document
        name = self.database.name if self.independent is None else "candidate"
        flights = counted(len(found["flights"]), "flight")
        lines = [
            f"{name}: checks within tolerance: {count_within(found)};"
            f" {counted(found['manoeuvres'], 'manoeuvre')} of {flights}"
            if found["checks"]
            else f"{name}: no manoeuvre of {flights} could be judged"
        ]
        lines += [
            f"  outside  {each['name']}, {each['since']:.1f} to {each['until']:.1f} s:"
            f" {each['check']}, {each['share']:.0%} of the time inside"
            for each in found["failed"][:3]
        ]
        lines += [
            f"  not flown  {each['name']}, {each['since']:.1f} to {each['until']:.1f} s:"
            f" {each['reason']}"
            for each in (() if found["checks"] else found["not_flown"][:1])
        ]
        if self.independent is False:
            lines.append("  not independent: flights identified this database")
        return lines

    def summary(self) -> Summary:
        """Return the checks, shares of the time inside (dimensionless), and what could not be
        flown."""
        found = self.document
        rows = [
            (
                check["check"],
                f"{check['passed']} of {check['manoeuvres']}",
                number(check["share"], 3),
                "" if check["before"] is None else f"{check['before']['passed']}",
            )
            for check in found["checks"]
        ]
        said = [
            f"{each['name']}, {each['since']:.1f} to {each['until']:.1f} s not flown:"
            f" {each['reason']}"
            for each in found["not_flown"]
        ]
        facts = [
            ("tolerances", str(found["tolerances"])),
            ("manoeuvres", f"{found['manoeuvres']}, {found['stabilised']} with feedback closed"),
        ]
        header = ("check", "within tolerance", "share of the time", "baseline within")
        return Summary(f"responses of {self.database.name}", facts, header, rows, said)

    def data(self) -> Data:
        """Return the responses, arrays (n,) by channel: rms flown and rms error in display units
        (`aerodb.report.display_unit`), and the fit [%]."""
        told = [each for each in self.document["responses"] if each["manoeuvres"]]
        scales = [display_unit(each["channel"]) for each in told]

        def column(values: Sequence[object], kind: type = object) -> Values:
            return Values(("response",), np.array(values, dtype=kind))

        scaled = list(zip(told, scales, strict=True))
        return Data(
            "response",
            {"response": column([each["channel"] for each in told])},
            {
                "rms_flown": column([f * each["rms_flown"] for each, (f, _) in scaled], float),
                "rms_error": column([f * each["rms_error"] for each, (f, _) in scaled], float),
                "fit": column([each["theil"]["fit_percent"] for each in told], float),
                "unit": column([unit or "-" for _, unit in scales]),
            },
            {"database": self.database.name},
        )


def validate(
    flights: Sequence[ComparedFlight],
    database: AeroDatabase | UpdatedDatabase | TracedFlights,
    *,
    against: AeroDatabase | None = None,
    wind: Literal["measured", "mean"] = "measured",
    stabilise: bool = True,
    trimmed: bool = False,
    tolerances: str | Path | None = None,
) -> ValidatedDatabase:
    """Fly a database over the manoeuvres of flights of one vehicle, and judge its responses, as
    ``aerodb version validate`` does, in memory (docs/method/simulation.md).

    Parameters
    ----------
    flights : those that were held out, for an independent proof.
    database : or what `update` or `trace` returned, whose candidate flies.
    against : flown beside it; None: its baseline, where a result is given.
    wind, stabilise, trimmed : as the options of the command.
    tolerances : a file of tolerances (TOML), its text, ``engine-failure`` or
        ``normal-landing``; None: 14 CFR 60 appendix A.

    Raises InputError for flights of several vehicles, and for tolerances that cannot be read.
    Responses are in SI units.
    """
    source = flights_in_memory(flights)
    flown, independent = database, None
    if isinstance(database, UpdatedDatabase):
        flown, against = database.candidate, against or database.baseline
        independent = not set(database.hold_out.identified) & set(source.flown)
    elif isinstance(database, TracedFlights):
        flown, against = database.candidate, against or database.loop.baseline
        independent = not set(database.hold_out.identified) & set(source.flown)
    assert isinstance(flown, AeroDatabase)
    text = default_tolerances() if tolerances is None else _text(tolerances)
    limits = parse_tolerances(text)

    def over(one: AeroDatabase, id: str) -> dict[str, Any]:
        flight = source.flown[id]
        channels, coefficients = flight.measured.flight, flight.measured.coefficients
        windows = manoeuvre_windows(segments_of(flight), channels.duration)
        stretches = [
            fly_window(
                one, channels, coefficients, source.vehicle, window, wind, stabilise, {}, trimmed,
                limits,
            )[0]
            for window in windows
        ]  # fmt: skip
        return {
            "flight": id,
            "version": one.name,
            "tolerances": limits.name,
            "standard": standard_document(limits),
            "stretches": stretches,
        }

    after = [over(flown, id) for id in source.flown]
    before = [] if against is None else [over(against, id) for id in source.flown]
    names = {id: each.measured.reconstructed.log.name for id, each in source.flown.items()}
    document = responses_summary(after, before, names, bool(independent))
    return ValidatedDatabase(flown, document, independent)


def _text(tolerances: str | Path) -> str:
    if isinstance(tolerances, str) and "\n" in tolerances:
        return tolerances
    return read_tolerances(Path(tolerances))
