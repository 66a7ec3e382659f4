"""Declared increments as unknowns of a vehicle that flies on its database."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.errors import InputError
from aerodb.estimation import DynamicModel, Fit, Parameters, TimeHistory, regression
from aerodb.flight import Flight
from aerodb.identification.database_parameters import fit_parameters, unknown, within_bounds
from aerodb.identification.equations import no_database, parameter_name
from aerodb.identification.flight_dynamics import MOTION, OUTPUTS, FlightDynamics, flight_dynamics
from aerodb.identification.identification_flight import IdentificationFlight
from aerodb.increments import (
    DeclaredIncrement,
    ModelFile,
    check_parameters_of,
    estimate_increments,
    expand,
    with_chosen_knots,
)
from aerodb.nomenclature import AXES, FORCE_AXES, MOMENT_AXES, is_hinge_axis
from aerodb.simulation import FlightModel, FlightStretch, stretch_model, stretch_of
from aerodb.support import Array
from aerodb.tables import AeroDatabase, Increment, depends_on, with_parameters

#: Wind axis -> the body axes that an increment on it changes.
_BODY: Final = {"C_lift": ("CX", "CZ"), "C_drag": ("CX", "CZ"), "C_side": ("CY",)}
#: Outputs and states of the longitudinal and of the lateral motion, and the axes that drive them.
_MOTIONS: Final = (
    (("V", "alpha", "q", "theta", "ax", "az"), frozenset({"CX", "CZ", "Cm"})),
    (("beta", "p", "r", "phi", "ay"), frozenset({"CY", "Cl", "Cn"})),
)
#: Terms of an axis on which neither the database nor the model file has any.
_SUPPORT: Final = {
    "CX": ("1", "alpha"),
    "CZ": ("1", "alpha"),
    "Cm": ("1", "alpha", "q_hat", "delta_elevator"),
    "CY": ("1", "beta"),
    "Cl": ("1", "beta", "p_hat", "r_hat", "delta_aileron", "delta_rudder"),
    "Cn": ("1", "beta", "p_hat", "r_hat", "delta_aileron", "delta_rudder"),
}
#: States that turbulence drives; attitudes follow from the rates.
DISTURBED: Final = ("V", "alpha", "beta", "p", "q", "r")
#: Rate at which a motion that is held comes back to the flight's [1/s]: faster than it drifts; its
#: own modes come from the loads as flown.
_HOLDING: Final = 2.0
#: Reasons for stretches left out that an error quotes.
_SHOWN: Final = 3


def flown_problem(
    flights: Sequence[IdentificationFlight], model: ModelFile, database: AeroDatabase
) -> tuple[DynamicModel, list[TimeHistory], dict[str, str]]:
    """Return the flight dynamics with the declared increments unknown, the flown stretches, and the
    name of each unknown (``estimate_Cm_3_0`` -> ``Cm_alpha``).

    Each window of each flight is a record with initial states of its own. The increments start at
    their least-squares estimates. Forces and moments on axes that the model file does not declare
    are those of the flight: what the database lacks there does not disturb the declared axes, and
    where it is empty, linear terms (`_SUPPORT`) keep the motion close to the flight's. A motion of
    which no axis is declared, the lateral one for instance, is held at the flight's by further
    loads. The outputs
    are those of the longitudinal or of the lateral motion, or all, as the declared axes are.
    States that no output shows start as measured.

    Raises InputError naming what the flights lack, where no stretch can be flown.
    """
    logs, comparisons = [f.flight for f in flights], [f.comparison for f in flights]
    if hinges := [each.axis for each in model.increment if is_hinge_axis(each.axis)]:
        raise InputError(
            f"{', '.join(hinges)}: a hinge moment moves no aircraft, so no motion tells of it",
            "model file",
            "use a method of equation error",
        )
    check_parameters_of(model.parameters, database)
    model = with_chosen_knots(logs, comparisons, model, database)
    declared = _declared_axes(model) | _reached(model.parameters, database)
    support = _supporting(logs, comparisons, database, declared)
    start = (
        estimate_increments(
            logs, comparisons, model.model_copy(update={"parameters": (), "inertias": ()}), database
        ).candidate
        if model.increment
        else database
    )
    named = {name: name for name in model.parameters} | _unknowns(start, database, model)
    if model.parameters:
        fit = fit_parameters(regression, flights, model.parameters, database, model.own_constants)
        start = with_parameters(start, within_bounds(fit, database))
    start = replace(start, increments=(*start.increments, *support))
    flying = stretch_model(start, logs[0], _held(logs, declared))
    stretches, reasons = _stretches(flying, flights, declared, support)
    if not stretches:
        first = dict.fromkeys(reasons)
        raise InputError(
            "no stretch of these flights can be flown: " + "; ".join([*first][:_SHOWN]),
            "estimate",
            "use a method of equation error",
        )
    moving = {name for names, axes in _MOTIONS if declared & axes for name in names}
    outputs = [
        name
        for name in OUTPUTS
        if name in moving and any(_judged(s, name) for s in stretches.values())
    ]
    initial = [name for name in MOTION if name in outputs]
    dynamics, records = flight_dynamics(
        flying, stretches, tuple(named), outputs=outputs, initial=initial, inertias=model.inertias
    )
    return _with_priors(dynamics, model.parameters, database), records, named


def _with_priors(
    dynamics: FlightDynamics, names: Sequence[str], database: AeroDatabase
) -> FlightDynamics:
    """The dynamics, whose parameters of the database start elsewhere, with what `database` knows of
    them."""
    items = tuple(
        replace(unknown(each.name, database), value=each.value) if each.name in names else each
        for each in dynamics.parameters.items
    )
    return replace(dynamics, parameters=Parameters(items))


def with_names(fit: Fit, named: Mapping[str, str]) -> Fit:
    """Return the fit with other names of its parameters (`Fit.names`); values (k,) and units
    stay."""
    return replace(
        fit,
        estimates=tuple(replace(e, name=named.get(e.name, e.name)) for e in fit.estimates),
        names=tuple(named.get(name, name) for name in fit.names),
    )


def _unknowns(start: AeroDatabase, database: AeroDatabase, model: ModelFile) -> dict[str, str]:
    """Name of an increment's estimate in the flight model -> its name in answers."""
    first = len(database.increments)
    named: dict[str, str] = {}
    for number, declared in enumerate(model.increment):
        increment = start.increments[first + number]
        terms = {regressor.expression: regressor.name for regressor in expand(declared)}
        for k, expression in enumerate(increment.regressors):
            if terms[expression] not in declared.fixed:
                inside = f"estimate_{increment.axis}_{first + number}_{k}"
                named[inside] = parameter_name(declared.axis, terms[expression])
    return named


def _declared_axes(model: ModelFile) -> frozenset[str]:
    return frozenset(
        body for entry in model.increment for body in _BODY.get(entry.axis, (entry.axis,))
    )


def _reached(parameters: Sequence[str], database: AeroDatabase) -> frozenset[str]:
    """The body axes on which terms of the database use any of these parameters."""
    return frozenset(
        body
        for term in database.coefficient_terms
        if not depends_on(term.expression, database).isdisjoint(parameters)
        for body in _BODY.get(term.axis, (term.axis,))
    )


def _held(flights: Sequence[Flight], declared: frozenset[str]) -> dict[tuple[str, str], float]:
    """Gains of the loads [N, N m] that hold the motion which no declared axis drives at the
    flight's."""
    mean = {
        name: float(np.mean([np.nanmean(flight[name]) for flight in flights]))
        for name in ("mass", "V", "Ixx", "Iyy", "Izz")
    }
    force, damping, stiffness = mean["mass"] * _HOLDING, 2.0 * _HOLDING, _HOLDING**2
    longitudinal, lateral = (not declared & axes for _, axes in _MOTIONS)
    gains: dict[tuple[str, str], float] = {}
    if longitudinal:
        gains |= {
            ("force_x", "V"): force,
            ("force_z", "alpha"): force * mean["V"],
            ("moment_y", "q"): damping * mean["Iyy"],
            ("moment_y", "theta"): stiffness * mean["Iyy"],
        }
    if lateral:
        gains |= {
            ("force_y", "beta"): force * mean["V"],
            ("moment_x", "p"): damping * mean["Ixx"],
            ("moment_x", "phi"): stiffness * mean["Ixx"],
            ("moment_z", "r"): damping * mean["Izz"],
        }
    return gains


def _supporting(
    flights: Sequence[Flight],
    comparisons: Sequence[Comparison],
    database: AeroDatabase,
    declared: frozenset[str],
) -> tuple[Increment, ...]:
    """Least-squares increments on the axes on which neither the database nor the model file has
    any."""
    axes = [
        *(term.axis for term in database.coefficient_terms),
        *(increment.axis for increment in database.increments),
    ]
    filled = {body for axis in axes for body in _BODY.get(axis, (axis,))}
    found: list[Increment] = []
    for axis, terms in _SUPPORT.items():
        if axis in filled | declared:
            continue
        there = [t for t in terms if not t.startswith("delta_") or all(t in f for f in flights)]
        entry = DeclaredIncrement(axis=axis, terms=tuple(there))
        with suppress(InputError):  # the flights do not have the axis
            model = ModelFile(increment=(entry,))
            found += estimate_increments(flights, comparisons, model, database).candidate.increments
    return tuple(found)


def _stretches(
    flying: FlightModel,
    flights: Sequence[IdentificationFlight],
    declared: frozenset[str],
    support: Sequence[Increment],
) -> tuple[dict[str, FlightStretch], list[str]]:
    """Record -> stretch, and why others were left out."""
    stretches: dict[str, FlightStretch] = {}
    reasons: list[str] = []
    for each in flights:
        first = float(each.flight.time[0])
        for number, (since, until) in enumerate(each.windows):
            try:
                stretch = stretch_of(
                    flying,
                    each.flight,
                    each.coefficients,
                    each.vehicle,
                    first + since,
                    first + until,
                )
                stretches[f"{each.flight.id[:12]}#{number + 1}"] = _as_flown(
                    stretch, each, flying.database, declared, support
                )
            except InputError as error:
                reasons.append(str(error).split("\n", 1)[0])
    return stretches, reasons


def _as_flown(
    stretch: FlightStretch,
    flight: IdentificationFlight,
    database: AeroDatabase,
    declared: frozenset[str],
    support: Sequence[Increment],
) -> FlightStretch:
    """The stretch with the residual forces and moments of the axes that are not declared, beyond
    those of `support`."""
    comparison, reference = flight.comparison, database.reference
    inside = np.searchsorted(comparison.time, stretch.time - 1e-9)
    constant = reference.pressure
    pressure = (
        _filled(flight.flight["qbar"][inside])
        if constant is None
        else np.full(len(inside), constant)
    )
    lengths = dict(zip(AXES, (1.0, 1.0, 1.0, reference.span, reference.chord, reference.span),
                       strict=True))  # fmt: skip

    alone = replace(no_database(reference), increments=tuple(support))
    supported = alone.predict(dict(flight.flight.channels)).coefficients

    def load(axis: str) -> Array:
        inferred = axis == "CX" and "ax" in stretch.free
        if axis in declared or axis not in comparison.measured or inferred:
            return np.zeros(len(inside))
        usable = comparison.usable[axis][inside]
        left = comparison.residual(axis) - supported.get(axis, 0.0)
        residual = _filled(np.where(usable, left[inside], np.nan))
        return residual * pressure * reference.area * lengths[axis]

    force = np.stack([load(axis) for axis in FORCE_AXES], axis=1)
    moment = np.stack([load(axis) for axis in MOMENT_AXES], axis=1)
    centre = np.stack([stretch.series[f"cg_{axis}"] for axis in "xyz"], axis=1)
    moment = moment + np.cross(np.asarray(reference.moment_reference) - centre, force)
    series = dict(stretch.series)
    for j, axis in enumerate("xyz"):
        series[f"force_{axis}"] = series[f"force_{axis}"] + force[:, j]
        series[f"moment_{axis}"] = series[f"moment_{axis}"] + moment[:, j]
    return replace(stretch, series=series)


def _filled(values: Array) -> Array:
    """Values (n,) with those between, before and after finite ones interpolated; 0 where none
    is."""
    good = np.flatnonzero(np.isfinite(values))
    if not len(good):
        return np.zeros(len(values))
    return np.asarray(np.interp(np.arange(len(values)), good, values[good]))


def _judged(stretch: FlightStretch, name: str) -> bool:
    values = stretch.flown.get(name)
    return name not in stretch.free and values is not None and bool(np.isfinite(values).any())
