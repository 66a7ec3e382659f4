"""Declared models estimated from flights in memory, by any method."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from aerodb.estimation import Fit, ParameterEstimate
from aerodb.flows.library.flights import ComparedFlight, MeasuredCoefficients, compare
from aerodb.flows.library.logs import read_text
from aerodb.flows.library.tracing import flights_in_memory, segments_of, several
from aerodb.flows.library.views import Data, Result, Summary, Values, number, shown_unit
from aerodb.identification import (
    IdentificationFlight,
    chosen_methods,
    declares_state_space,
    fits_of,
    flight_records,
    no_database_beside,
    parse_state_space,
    state_space_fit,
)
from aerodb.increments import parse_model_file
from aerodb.report import derivative_unit, fit_report
from aerodb.support import half_interval
from aerodb.tasks.steps import manoeuvre_windows

#: What a model file holds, as Python reads it.
Model = Mapping[str, Any]
#: What is said of intervals of methods that take every sample's errors as its own.
_NARROWER = (
    "the intervals leave out the sensor errors that reconstruction is not sure of;"
    " those of update include them, and are wider"
)


@dataclass(frozen=True, eq=False, repr=False)
class FittedModel(Result):
    """A declared model as a method estimates it: one fit per axis, or one of the flights flown."""

    method: str
    fits: tuple[Fit, ...]
    warnings: tuple[str, ...] = ()

    @property
    def estimates(self) -> tuple[ParameterEstimate, ...]:
        """All parameters (scalars in the unit of each), those that were fixed too."""
        return tuple(each for fit in self.fits for each in fit.estimates)

    def __getitem__(self, name: str) -> ParameterEstimate:
        """Return the estimate of this name; KeyError where there is none."""
        return {each.name: each for each in self.estimates}[name]

    def report(self) -> str:
        """Return estimates with standard errors, intervals, correlations and whiteness of the
        residuals as text, in the unit of each parameter; see `fit_report`."""
        return "\n".join([*(fit_report(fit) for fit in self.fits), *self.warnings])

    def headlines(self) -> list[str]:
        """Return the estimates that are known best, in the unit of each, and what to know of
        them."""
        found = [e for e in self.estimates if e.standing == "estimated" and e.standard_error > 0.0]
        found.sort(key=lambda e: -abs(e.value) / e.standard_error)
        converged = all(fit.converged for fit in self.fits)
        lines = [f"fit by {self.method}: {'converged' if converged else 'NOT CONVERGED'}"]
        lines += [
            f"  {e.name}  {number(e.value)} +- {number(half_interval(e.standard_error), 2)}"
            f" {shown_unit(_unit(e))}"
            for e in found[:3]
        ]
        lines += [f"  {text}" for text in self.warnings]
        return lines

    def summary(self) -> Summary:
        """Return the estimates +- half of their 95 % intervals, scalars in the unit of each."""
        rows = [
            (
                e.name,
                number(e.value),
                number(half_interval(e.standard_error), 2),
                shown_unit(_unit(e)),
                e.standing,
            )
            for e in self.estimates
        ]
        converged = "yes" if all(fit.converged for fit in self.fits) else "no"
        said = [text for fit in self.fits for text in (*fit.assumes, *fit.notes)]
        return Summary(
            f"fit by {self.method}",
            [("converged", converged)],
            ("parameter", "value", "+-", "unit", "standing"),
            rows,
            [*self.warnings, *dict.fromkeys(said)],
        )

    def data(self) -> Data:
        """Return value, standard error, unit and standing by parameter."""
        found = self.estimates

        def column(values: Sequence[object], kind: type = object) -> Values:
            return Values(("parameter",), np.array(values, dtype=kind))

        return Data(
            "parameter",
            {"parameter": column([each.name for each in found])},
            {
                "value": column([each.value for each in found], float),
                "standard_error": column([each.standard_error for each in found], float),
                "unit": column([_unit(each) for each in found]),
                "standing": column([each.standing for each in found]),
            },
            {"method": self.method},
        )


def fit(
    flights: Sequence[ComparedFlight] | Sequence[MeasuredCoefficients],
    model: str | Path | Model,
    method: str = "regression",
) -> FittedModel:
    """Estimate a declared model from flights of one vehicle.

    Parameters
    ----------
    flights : compared with one database, on which increments are estimated; or coefficients alone,
        which give whole derivatives.
    model : a model file (TOML) of increments or of a linear model, its text, or what it holds as a
        dict.
    method : by its name in ``aerodb estimate``, such as ``regression`` or ``output-error``.

    Raises InputError for an unknown method, and where the method cannot give an estimate.
    """
    chosen = chosen_methods([method])[0]
    text = model_of(model)
    source = flights_in_memory([_compared(each, flights[0]) for each in several(flights)])
    given = identification_flights(list(source.flown.values()))
    if declares_state_space(text):
        file = parse_state_space(text)
        return FittedModel(
            chosen.name, (state_space_fit(chosen, flight_records(given, file), file),)
        )
    database = next(iter(source.flown.values())).database
    fits = tuple(fits_of(chosen, given, parse_model_file(text), database))
    narrower = (_NARROWER,) if chosen.kind == "equation error" else ()
    return FittedModel(chosen.name, fits, narrower)


def model_of(model: str | Path | Model) -> str | Model:
    """Return a model as the text of its file (TOML), or as the dict that it is; InputError where
    the file cannot be read. Quantities are in SI units, or texts with a unit."""
    if isinstance(model, Mapping) or (isinstance(model, str) and "\n" in model):
        return model
    return read_text(model)


def identification_flights(flights: Sequence[ComparedFlight]) -> list[IdentificationFlight]:
    """Return compared flights, channels (n,) in SI units, with the manoeuvres to fly; see
    `IdentificationFlight`."""
    return [_as_identification(each) for each in flights]


def _unit(estimate: ParameterEstimate) -> str:
    """The unit of a parameter; derivatives (``CZ_alpha``) are per radian."""
    unit = derivative_unit(estimate.name) or estimate.unit
    return "1" if unit == "-" else unit


def _compared(
    flight: ComparedFlight | MeasuredCoefficients, first: ComparedFlight | MeasuredCoefficients
) -> ComparedFlight:
    """Return a flight with the database it was compared with, else with zero on all axes."""
    if isinstance(flight, ComparedFlight):
        return flight
    reference = first.measured if isinstance(first, ComparedFlight) else first
    own = reference.reconstructed.vehicle.reference
    return compare(flight, no_database_beside(reference.coefficients, own))


def _as_identification(flight: ComparedFlight) -> IdentificationFlight:
    channels, vehicle = flight.measured.flight, flight.measured.reconstructed.vehicle
    windows = manoeuvre_windows(segments_of(flight), channels.duration)
    return IdentificationFlight(
        channels,
        flight.comparison,
        flight.measured.coefficients,
        vehicle,
        tuple((since, until) for since, until, _ in windows),
    )
