"""Estimates of declared increments by several methods, on the same samples of the same flights."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation import Fit
from aerodb.identification import (
    IdentificationFlight,
    Method,
    MethodAgreement,
    RolledFlight,
    chosen_methods,
    compare_methods,
    declares_state_space,
    fits_of,
    fitted_modes,
    flight_records,
    ground_fit,
    ground_parameters,
    no_database_beside,
    parse_state_space,
    recorded_rolls,
    state_space_fit,
    with_recorded_trim,
    within,
)
from aerodb.increments import ModelFile, channels_of, parse_model_file, with_model_rates
from aerodb.report import fit_report
from aerodb.simulation import Mode
from aerodb.storage.files import read_results, write_results
from aerodb.support import Array
from aerodb.tables import AeroDatabase
from aerodb.tasks.steps.coefficients import load_coefficients
from aerodb.tasks.steps.compare import compare_loaded
from aerodb.tasks.steps.consistency import load_consistent, unmeasured_angles
from aerodb.tasks.steps.fly import flown_windows, manoeuvre_windows
from aerodb.tasks.steps.ingest import load_flight
from aerodb.tasks.stored_steps import StoredResult
from aerodb.tasks.view import modes_part
from aerodb.tasks.workspace_access import WorkspaceAccess, access_workspace

#: Longest piece in which a whole flight is flown [s].
_PIECE = 60.0
#: Most samples of a history in a document.
_SHOWN = 200
#: Share of the flights' time beyond which the manoeuvres are most of it.
_MOST = 0.5


def estimate_by_methods(
    flights: Sequence[str],
    *,
    workspace: str,
    run: str,
    model: str,
    methods: Sequence[str],
    version: str | None = None,
    whole: bool = False,
    select: Sequence[str] = (),
    beside: str = "",
) -> dict[str, Any]:
    """Estimate the increments declared in `model` (text) by several methods, and store the answers.

    flights : their ids. version : its id; None: on no database, which gives whole derivatives.
    select : conditions of the samples that count (`aerodb.conditioning.selected`).
    beside : as of `WorkspaceAccess.flown_database`.
    methods : names, or ``["all"]``. whole : methods that fly take the whole of each flight.

    Returns a document: key, version, flights, methods (method, kind, assumes, converged,
    iterations, log_likelihood, notes, estimates, correlations, input_correlations, histories of
    parameters that change, report, modes of a linear model; or reason where it gave none),
    parameters (parameter, estimates by method, spread, furthest, agree), believe, preferred (that
    which is believed, or would be if nothing contradicted it), reserved, reasons, and left_out
    (flight -> why its rolls are not used, where others are). Estimates are in the unit that each
    states.
    """
    access = access_workspace(workspace)
    chosen = chosen_methods(methods)
    database = (
        _no_database(access, flights[0], run)
        if version is None
        else access.flown_database(version, beside)
    )
    rolls = rolls_on_ground(model, database)
    inputs = (
        {f"flight {k}": key for k, key in enumerate(_flight_keys(access, flights, run))}
        if rolls
        else {
            f"coefficients {k}": load_coefficients(access, access.catalogue.flight(each), run).key
            for k, each in enumerate(flights)
        }
    )
    result = StoredResult(
        access,
        "estimate",
        "estimates",
        inputs
        | ({} if version is None else {"version": version})
        | ({"beside": beside} if beside else {}),
        {"model": model, "methods": [method.name for method in chosen]}
        | ({"whole": True} if whole else {})
        | ({"select": list(select)} if select else {}),
    )
    path = result.stored()
    if path is not None:
        return dict(read_results(path, ("time",))[1]["document"])
    if rolls:
        if select:
            raise InputError(
                "--select with parameters of the legs",
                "estimate",
                "leave it out: rolls on the ground are found by themselves",
            )
        rolled = rolled_flights(access, flights, run)
        fits, compared = _of_rolls(rolled, parse_model_file(model), database, chosen)
    else:
        fits, compared = _in_flight(access, flights, database, run, model, chosen, whole, select)
    document = {"key": result.key, "version": version, "flights": list(flights), **compared}
    document |= {"select": list(select)} if select else {}
    document |= {"with": beside} if beside else {}
    table = _long([fit for each in fits.values() for fit in each])
    result.keep(run, lambda path: write_results(path, table, {"document": document}))
    return document


def is_on_ground(version: str, model: str, *, workspace: str, beside: str = "") -> bool:
    """Return whether a model file (text) is of rolls on the ground on a version (its id); beside :
    as of `WorkspaceAccess.flown_database`."""
    return rolls_on_ground(model, access_workspace(workspace).flown_database(version, beside))


def rolls_on_ground(model: str, database: AeroDatabase) -> bool:
    """Return whether a model file (text) declares parameters of a database's legs."""
    if declares_state_space(model):
        return False
    names = parse_model_file(model).parameters
    known = bool(names) and all(name in database.parameters for name in names)
    return known and ground_parameters(names, database)


def rolled_flights(access: WorkspaceAccess, flights: Sequence[str], run: str) -> list[RolledFlight]:
    """Return flights (ids, channels (n,) in SI units) as they were mapped, with their vehicles.
    UnknownNameError for an unknown id."""
    rows = [access.catalogue.flight(flight) for flight in flights]
    return [
        RolledFlight(load_flight(access, row, run)[0], access.vehicle(row.vehicle)[0], row.id[:12])
        for row in rows
    ]


def _flight_keys(access: WorkspaceAccess, flights: Sequence[str], run: str) -> list[str]:
    return [load_flight(access, access.catalogue.flight(each), run)[1] for each in flights]


def _of_rolls(
    flights: Sequence[RolledFlight],
    model: ModelFile,
    database: AeroDatabase,
    chosen: Sequence[Method],
) -> tuple[dict[str, list[Fit]], dict[str, Any]]:
    """Return what `fits_document` returns of all rolls of flights, and flight -> why it is left
    out where others are used."""
    left_out = dict[str, str]()

    def fitted(method: Method) -> list[Fit]:
        function = method_for_rolls(method, model)
        rolls = recorded_rolls(flights, database)
        left_out.update(rolls.left_out)
        return [ground_fit(function, rolls, model.parameters, database, model.wind)]

    fits, compared = fits_document(chosen, fitted)
    return fits, compared | ({"left_out": left_out} if left_out else {})


def method_for_rolls(method: Method, model: ModelFile) -> Callable[..., Fit]:
    """Return the function of a method that flies rolls on the ground.

    Raises InputError for a method that does not fly, and for a model file that declares more than
    parameters of the legs.
    """
    if method.kind != "dynamic" or method.disturbed:
        raise InputError(
            f"{method.name} takes no roll on the ground", "estimate", "use output-error"
        )
    if model.increment or model.inertias:
        raise InputError(
            "parameters of the legs beside increments or inertias",
            "model file",
            "write two model files: the ground and the air are two estimates",
        )
    return method.load()


def _in_flight(
    access: WorkspaceAccess,
    flights: Sequence[str],
    database: AeroDatabase,
    run: str,
    model: str,
    chosen: Sequence[Method],
    whole: bool,
    select: Sequence[str],
) -> tuple[dict[str, list[Fit]], dict[str, Any]]:
    """Fits of each method in flight, and what the document says of them."""
    given = [
        within(each, select)
        for each in identification_flights(access, flights, database, run, whole)
    ]
    file, steady = None, list[str]()
    if declares_state_space(model):
        file, steady = with_recorded_trim(parse_state_space(model), given)
    else:  # a term that no flight has is a mistake of who wrote it, not of a method
        declared, beside = parse_model_file(model), [each.comparison for each in given]
        flown = with_model_rates([each.flight for each in given], beside, declared)
        channels_of(flown, declared, database)

    def fitted(method: Method) -> list[Fit]:
        if file is not None:
            return [state_space_fit(method, flight_records(given, file), file)]
        return fits_of(method, given, parse_model_file(model), database)

    def modes_of(fit: Fit) -> Sequence[Mode]:
        return () if file is None else fitted_modes(fit, file, flight_records(given, file))

    estimated = frozenset[str]().union(*(each.estimated for each in given))
    fits, compared = fits_document(chosen, fitted, estimated, modes_of)
    compared["reasons"] += [each.removesuffix(".") for each in steady]
    compared["reasons"] += _left_out(fits, given)
    return fits, compared


def _left_out(fits: dict[str, list[Fit]], flights: Sequence[IdentificationFlight]) -> list[str]:
    """Advice to fly whole flights where the air drives most of what the manoeuvres leave out."""
    flown = sum(until - since for each in flights for since, until in each.windows)
    share = flown / sum(each.flight.duration for each in flights)
    disturbed = any(
        name.startswith("process_noise_")
        for each in fits.values()
        for fit in each
        for name in fit.names
    )
    if not disturbed or share > _MOST:
        return []
    return [
        f"Turbulence drives these flights, and {100.0 * share:.0f} % of their time was flown, the"
        " manoeuvres: --whole flies all of it, which tells more"
    ]


def identification_flights(
    access: WorkspaceAccess,
    flights: Sequence[str],
    database: AeroDatabase,
    run: str,
    whole: bool = False,
) -> list[IdentificationFlight]:
    """Return flights (ids, channels (n,) in SI units) with their comparison with a database, and
    the manoeuvres to fly, or all of each flight in pieces. UnknownNameError for an unknown id."""
    found = []
    for flight in flights:
        row = access.catalogue.flight(flight)
        loaded = load_coefficients(access, row, run)
        vehicle = access.vehicle(row.vehicle)[0]
        windows = (
            manoeuvre_windows([], loaded.flight.duration, _PIECE)
            if whole
            else flown_windows(access, row, loaded.flight, run)
        )
        found.append(
            IdentificationFlight(
                loaded.flight,
                compare_loaded(loaded, database, vehicle),
                loaded.coefficients,
                vehicle,
                tuple((since, until) for since, until, _ in windows),
                loaded.flight.estimated
                | unmeasured_angles(load_consistent(access, row, run).document),
            )
        )
    return found


def fits_document(
    methods: Sequence[Method],
    fitted: Callable[[Method], list[Fit]],
    estimated: Collection[str] = (),
    modes_of: Callable[[Fit], Sequence[Mode]] = lambda fit: (),
) -> tuple[dict[str, list[Fit]], dict[str, Any]]:
    """Return the fits of each method over all axes, empty where it gave none (its InputError is the
    reason); and the part of the document of `estimate_by_methods` that says what they are.

    estimated : channels that no sensor measured. modes_of : the modes of the model of a fit.
    """
    fits: dict[str, list[Fit]] = {}
    reasons: dict[str, str] = {}
    for method in methods:
        try:
            fits[method.name] = fitted(method)
        except InputError as error:
            fits[method.name], reasons[method.name] = [], str(error)
    comparison = compare_methods({name: each for name, each in fits.items() if each}, estimated)
    return fits, {
        "methods": [
            {"method": method.name, "kind": method.kind}
            | (
                _answer(fits[method.name], modes_of)
                if fits[method.name]
                else {"reason": reasons[method.name]}
            )
            for method in methods
        ],
        "parameters": [_parameter(each) for each in comparison.parameters],
        "believe": comparison.believe,
        "preferred": comparison.preferred,
        "reasons": list(comparison.reasons),
        "reserved": comparison.reserved,
    }


def _no_database(access: WorkspaceAccess, flight: str, run: str) -> AeroDatabase:
    """A database of zeros in the vehicle's reference geometry, about the moment reference of the
    flight's coefficients, or its mean where that is the moving CG."""
    row = access.catalogue.flight(flight)
    found = load_coefficients(access, row, run).coefficients
    return no_database_beside(found, access.vehicle(row.vehicle)[0].reference)


def _answer(fits: Sequence[Fit], modes_of: Callable[[Fit], Sequence[Mode]]) -> dict[str, Any]:
    """Return what a document says of the fits of a method."""
    return {
        "assumes": list(dict.fromkeys(text for fit in fits for text in fit.assumes)),
        "converged": all(fit.converged for fit in fits),
        "iterations": max(fit.iterations for fit in fits),
        "log_likelihood": _finite(sum(fit.log_likelihood for fit in fits)),
        "notes": list(dict.fromkeys(note for fit in fits for note in fit.notes)),
        "estimates": [
            {key: _finite(value) for key, value in asdict(estimate).items()}
            for fit in fits
            for estimate in fit.estimates
        ],
        "correlations": [
            {"names": list(fit.names), "correlation": fit.correlation.tolist()} for fit in fits
        ],
        "regressors": [
            {"names": list(fit.names), "correlation": _finite_rows(fit.regressors)}
            for fit in fits
            if fit.regressors is not None
        ],
        "axes": {
            axis: {
                "error": each.error,
                "flown": each.flown,
                "r_squared": _finite(each.r_squared),
                "load": _finite(each.load),
            }
            for fit in fits
            for axis, each in fit.axes.items()
        },
        "input_correlations": [
            {key: _finite(value) for key, value in asdict(each).items()}
            for fit in fits
            for each in fit.input_correlations
        ],
        "histories": [
            _history(fit.times[record], record, name, history)
            for fit in fits
            for record, each in fit.histories.items()
            for name, history in each.items()
        ],
        "report": "\n".join(fit_report(fit) for fit in fits),
    } | ({"modes": modes_part(found)} if (found := [m for f in fits for m in modes_of(f)]) else {})


def _history(time: Array, record: str, name: str, history: Array) -> dict[str, Any]:
    """A parameter (n, 2: value, standard error) at no more than `_SHOWN` times (n,)."""
    shown = np.unique(np.linspace(0, len(time) - 1, _SHOWN).astype(int))
    return {
        "record": record,
        "parameter": name,
        "time": time[shown].tolist(),
        "value": history[shown, 0].tolist(),
        "standard_error": history[shown, 1].tolist(),
    }


def _parameter(agreement: MethodAgreement) -> dict[str, Any]:
    return {
        "parameter": agreement.name,
        "estimates": {
            method: {
                "value": _finite(e.value),
                "standard_error": _finite(e.standard_error),
                "standing": e.standing,
            }
            for method, e in agreement.estimates.items()
        },
        "spread": _finite(agreement.spread),
        "furthest": list(agreement.furthest or ()),
        "agree": agreement.agree,
    }


def _finite(value: Any) -> Any:
    """None for a number that JSON does not have."""
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _finite_rows(matrix: Array) -> list[list[Any]]:
    return [[_finite(value) for value in row] for row in matrix.tolist()]


def _long(fits: Sequence[Fit]) -> dict[str, Array]:
    """Fitted responses, one row per method, record, response and time from the first sample [s]."""
    columns: dict[str, list[Any]] = {
        name: [] for name in ("method", "record", "response", "time", "fitted", "residual")
    }
    for fit in fits:
        for record, outputs in fit.fitted.items():
            for response, fitted in outputs.items():
                n = len(fitted)
                words = {"method": fit.method, "record": record, "response": response}
                for name, word in words.items():
                    columns[name].append(np.full(n, word, dtype=object))  # n copies are not made
                columns["time"].append(fit.times[record])
                columns["fitted"].append(fitted)
                columns["residual"].append(fit.residuals[record][response])
    return {
        name: np.concatenate(parts) if parts else np.zeros(0) for name, parts in columns.items()
    }
