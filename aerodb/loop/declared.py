"""Declared increments from the flights of a source: estimated with the sensor errors that
reconstruction leaves open, and validated on flights that did not identify."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

from aerodb.coefficients import Comparison
from aerodb.errors import InputError
from aerodb.increments import (
    AxisValidation,
    Beyond,
    ConsiderParameter,
    HoldOut,
    ModelFile,
    Update,
    beyond_envelopes,
    estimate_increments,
    keep_slope_signs,
    validate_by_leaving_one_out,
    validate_on_held_out,
    with_extrapolated_slopes,
)
from aerodb.loop.angle_errors import with_attenuation
from aerodb.loop.consider import consider_parameters, noisier_flights
from aerodb.loop.flight_source import FlightSource
from aerodb.tables import AeroDatabase
from aerodb.tracing import TracingSettings

#: Estimates by a method that is not the plain regression, from flights (ids), with the sensor
#: errors to consider, or None.
ByMethod = Callable[
    [Sequence[str], ModelFile, Mapping[str, Sequence[ConsiderParameter]] | None], Update
]


def estimate_declared(
    source: FlightSource,
    flights: Sequence[str],
    model: ModelFile,
    database: AeroDatabase,
    by_method: ByMethod | None = None,
) -> Update:
    """Estimate declared increments on flights (ids): values in SI units, covariance (k, k)
    (docs/method/updates.md, section "Estimation").

    by_method : None for the plain regression. Raises InputError where no declared term is excited.
    """
    flown = [source.flight(flight) for flight in flights]
    comparisons = [source.comparison(flight, database) for flight in flights]
    reconstructions = {flight: source.reconstruction(flight) for flight in flights}
    given = reconstructions, source.vehicle, database, flown, comparisons
    doubtful = consider_parameters(*given)
    update = estimate_increments(flown, comparisons, model, database, doubtful)
    if by_method is not None:
        return keep_slope_signs(by_method(flights, model, doubtful), database)
    noisier = [
        estimate_increments([f for f, _ in each], [c for _, c in each], model, database)
        for each in noisier_flights(*given)
    ]
    return keep_slope_signs(
        with_attenuation(update, noisier, TracingSettings().shift_factor), database
    )


def validate_declared(
    source: FlightSource,
    hold_out: HoldOut,
    update: Update,
    model: ModelFile,
    baseline: AeroDatabase,
    by_method: ByMethod | None = None,
) -> tuple[tuple[AxisValidation, ...], tuple[Beyond, ...]]:
    """Return the rms error (dimensionless) before and after an update, on flights that did not
    identify it if there are any, and both errors of those of them that leave the envelope.

    Raises InputError where a flight lacks what is needed.
    """
    flights = (*hold_out.identified, *hold_out.held_out)
    before = {flight: source.comparison(flight, baseline) for flight in flights}
    after = {flight: source.comparison(flight, update.candidate) for flight in flights}
    if hold_out.kind != "cross-validated":
        floors = source.noise_floors(hold_out.held_out or flights, update.candidate)
        proof = validate_on_held_out(before, after, hold_out, floors)
        held_out = dict.fromkeys(hold_out.held_out, update.candidate)
        return proof, outside_envelopes(source, held_out)
    predictors: dict[str, AeroDatabase] = {}

    def without(left_out: str) -> Comparison:
        others = [flight for flight in flights if flight != left_out]

        def estimated(declared: ModelFile) -> Update:
            if by_method is not None:
                return by_method(others, declared, None)
            return estimate_increments(
                [source.flight(f) for f in others], [before[f] for f in others], declared, baseline
            )

        predictors[left_out] = _estimated_where_possible(estimated, model, baseline)
        return source.comparison(left_out, predictors[left_out])

    floors = source.noise_floors(flights, update.candidate)
    proof = validate_by_leaving_one_out(before, after, without, floors)
    return proof, outside_envelopes(source, predictors)


def outside_envelopes(
    source: FlightSource, predictors: Mapping[str, AeroDatabase]
) -> tuple[Beyond, ...]:
    """Return both errors (dimensionless rms), held and extrapolated, of the flights that leave the
    envelope.

    predictors : flight (its id) -> the database that predicted it. See docs/method/updates.md,
    section "Envelope".
    """
    found: list[Beyond] = []
    for flight, database in predictors.items():
        held = source.comparison(flight, database)
        free = source.comparison(flight, with_extrapolated_slopes(database))
        found += beyond_envelopes(source.flight(flight), database, held, free)
    return tuple(found)


def _estimated_where_possible(
    estimated: Callable[[ModelFile], Update], model: ModelFile, baseline: AeroDatabase
) -> AeroDatabase:
    """Return the candidate with increments on the axes that flights can identify.

    An axis that they cannot identify stays as in the baseline, and so do parameters.
    """
    candidate = baseline
    if model.parameters:
        with suppress(InputError):
            candidate = estimated(model).candidate
    for declared in model.increment:
        try:
            one = estimated(ModelFile(increment=(declared,)))
        except InputError:
            continue
        added = one.candidate.increments[len(baseline.increments) :]
        candidate = replace(candidate, increments=(*candidate.increments, *added))
    return candidate
