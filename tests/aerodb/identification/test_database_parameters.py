"""Parameters of a database as unknowns: of an equation that all axes share, and of a vehicle that
flies."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from aerodb.coefficients import compare
from aerodb.errors import InputError
from aerodb.estimation import output_error, regression
from aerodb.identification import METHODS, IdentificationFlight, fits_of, flight_dynamics
from aerodb.identification.candidate import update_by
from aerodb.identification.database_parameters import fit_parameters, unknown
from aerodb.identification.equations import usable_runs
from aerodb.increments import estimate_increments, parameter_samples, parse_model_file
from aerodb.simulation import flight_model
from aerodb.tables import (
    AeroDatabase,
    Parameter,
    Term,
    Variable,
    normal,
    number,
    parameter_covariance,
    parse,
    with_parameters,
)
from tests.support import flying_increments
from tests.support.build_up import build_up, flights

WRONG = {"wing_CLa": 4.0, "tail_CLa": 3.0, "tail_tau": 0.4, "fin_CLa": 2.2}


def given(database: AeroDatabase, seeds: range = range(60, 64)) -> list[IdentificationFlight]:
    source = flights(seeds, build_up())
    return [
        IdentificationFlight(
            flight, source.comparison(id, database), coefficients, source.vehicle, ()
        )
        for id, (flight, coefficients) in source.flown.items()
    ]


@pytest.mark.parametrize("method", ["regression", "frequency-domain", "total-least-squares"])
def test_all_parameters_at_once(method: str) -> None:
    """Wing, tail, elevator and fin are all wrong; the tail's slope multiplies the elevator's
    effectiveness, so that one linear solution does not do."""
    database = build_up(WRONG)
    model = parse_model_file(f"parameters = {list(WRONG)}")
    (fit,) = fits_of(METHODS[method], given(database), model, database)
    assert fit.converged
    assert fit.iterations > 2
    for name, value in build_up().parameters.items():
        if name in WRONG:
            assert fit[name].value == pytest.approx(value, rel=0.02), name
            assert abs(fit[name].value - value) < 4.0 * fit[name].standard_error, name


def test_what_only_noise_of_a_deflection_moves_has_no_value() -> None:
    """The log of the elevator holds noise alone; by regression its effectiveness ended on a bound."""
    database, noise = build_up(WRONG), np.random.default_rng(1)
    model = parse_model_file('parameters = ["wing_CLa", "tail_tau"]')
    source, flown = flights(range(60, 63), build_up()), []
    for flight, coefficients in source.flown.values():
        still = 0.01 + 5e-4 * noise.standard_normal(len(flight.time))
        flight = flight.with_channels({"delta_elevator": still})
        beside = compare(flight, coefficients, database, source.vehicle.reference)
        flown.append(IdentificationFlight(flight, beside, coefficients, source.vehicle, ()))
    (fit,) = fits_of(METHODS["regression"], flown, model, database)
    assert fit["tail_tau"].standing == "not excited"
    assert "is noise of the logged deflections" in fit["tail_tau"].reason
    assert np.isnan(fit["tail_tau"].value)
    assert fit["wing_CLa"].standing == "estimated"
    (whole,) = fits_of(METHODS["regression"], given(database, range(60, 63)), model, database)
    assert whole["tail_tau"].standing == "estimated"
    with pytest.raises(InputError, match="most of what moves tail_tau in these flights is noise"):
        estimate_increments(
            [each.flight for each in flown], [each.comparison for each in flown], model, database
        )


def test_errors_that_weigh_axes_are_found_before_the_search() -> None:
    """The fin acts on three axes, whose errors by other wrong parts disagree on it. Its estimate stays
    where the axes count by what it leaves on them: found by one look at linear parameters, and the
    same from either side."""
    fits = []
    for start in (0.5, 6.0):
        database = build_up({**WRONG, "fin_CLa": start})
        fit = fit_parameters(regression, given(database), ["fin_CLa"], database)
        assert (fit.converged, fit.iterations) == (True, 1)
        fits.append(fit["fin_CLa"])
    assert abs(fits[0].value - fits[1].value) < 0.05 * fits[0].standard_error
    database = build_up({**WRONG, "fin_CLa": 0.5})
    weighed, measured = database, [each.comparison for each in given(database)]
    for _ in range(20):  # the same by weights of the values before, one solution at a time
        top = below = 0.0
        for each in parameter_samples(measured, ["fin_CLa"], weighed):
            for run in usable_runs(each.good, each.comparison.time):
                x, y = each.over(run)
                top, below = top + float(x[:, 0] @ y), below + float(x[:, 0] @ x[:, 0])
        value = weighed.parameters["fin_CLa"] + top / below
        weighed = with_parameters(weighed, {"fin_CLa": value})
    assert abs(fits[0].value - value) < 0.05 * fits[0].standard_error


def test_a_prior_draws_a_parameter_and_bounds_hold_it() -> None:
    database, measured = build_up(WRONG), given(build_up(WRONG))
    free = fit_parameters(regression, measured, ["fin_CLa"], database)["fin_CLa"]
    variable = database.variables["fin_CLa"]
    known = with_variable(database, replace(variable, uncertainty=normal(free.standard_error)))
    drawn = fit_parameters(regression, measured, ["fin_CLa"], known)["fin_CLa"]
    assert 2.2 < drawn.value < free.value - 0.1
    held = with_variable(database, replace(variable, parameter=Parameter((2.0, 2.5))))
    assert fit_parameters(regression, measured, ["fin_CLa"], held)["fin_CLa"].value <= 2.5 + 1e-9
    once = replace(known.variables["fin_CLa"], parameter=Parameter(flights=("one",)))
    assert unknown("fin_CLa", with_variable(known, once)).prior is None


def with_variable(database: AeroDatabase, variable: Variable) -> AeroDatabase:
    return replace(database, variables={**database.variables, "fin_CLa": variable})


def test_what_flights_do_not_move_has_no_value_and_the_others_theirs() -> None:
    """The drag of the body is a constant here, which counts for a sensor's bias."""
    with pytest.raises(InputError, match="no parameter 'tale_CLa'"):
        fit_parameters(regression, given(build_up()), ["tale_CLa"], build_up())
    both = fit_parameters(regression, given(build_up()), ["fin_CLa", "body_CD"], build_up())
    alone = fit_parameters(regression, given(build_up()), ["fin_CLa"], build_up())
    assert both["body_CD"].standing == "not excited"
    assert np.isnan(both["body_CD"].value)
    assert both["fin_CLa"].value == pytest.approx(alone["fin_CLa"].value, rel=1e-9)


def test_a_bound_is_no_value_of_what_no_flight_moves() -> None:
    """Its column is zero throughout, and zero lies outside its bounds."""
    spare = Variable(number(0.5), parameter=Parameter((0.1, 1.0)))
    still = Term("still", "CX", parse("spare*(alpha - alpha)"))
    database = replace(
        build_up(),
        variables={**build_up().variables, "spare": spare},
        terms=(*build_up().terms, still),
    )
    found = fit_parameters(regression, given(database), ["fin_CLa", "spare"], database)
    assert found["spare"].standing == "not excited"
    assert np.isnan(found["spare"].value)
    assert found["fin_CLa"].standing == "estimated"
    unused = replace(database, terms=build_up().terms)
    with pytest.raises(InputError, match="no expression of the database uses spare"):
        fit_parameters(regression, given(unused), ["fin_CLa", "spare"], unused)


def test_what_tells_less_than_the_bounds_is_named() -> None:
    """Bounds narrower than the standard error know more than the flights."""
    database, measured = build_up(WRONG), given(build_up(WRONG))
    free = fit_parameters(regression, measured, list(WRONG), database)
    error = free["fin_CLa"].standard_error
    centre = database.parameters["fin_CLa"]
    for width, standing in ((8.0 * error, None), (2.0 * error, "not excited")):
        known = Parameter((centre - 0.5 * width, centre + 0.5 * width))
        held = with_variable(database, replace(database.variables["fin_CLa"], parameter=known))
        found = fit_parameters(regression, measured, list(WRONG), held)["fin_CLa"]
        assert (found.standing == "not excited") == (standing is not None)
        assert np.isfinite(found.value) == (standing is None)


def test_an_update_by_another_method_has_its_values_and_errors() -> None:
    """Frequency-domain regression in place of the time domain's: the candidate has its estimates,
    correlations between them, and the flights."""
    database = build_up(WRONG)
    measured, model = given(database), parse_model_file(f"parameters = {list(WRONG)}")
    update = update_by(METHODS["frequency-domain"], measured, model, database)
    (fit,) = fits_of(METHODS["frequency-domain"], measured, model, database)
    assert update.parameters == tuple(WRONG)
    covariance = parameter_covariance(update.candidate, list(WRONG))
    for row, name in enumerate(WRONG):
        assert update.candidate.parameters[name] == pytest.approx(fit[name].value), name
        assert covariance[row, row] ** 0.5 == pytest.approx(fit[name].standard_error), name
        known = update.candidate.variables[name].parameter
        assert known is not None
        assert known.flights == tuple(each.flight.id for each in measured)
        assert known.flown["alpha"][0] < known.flown["alpha"][1]
    assert abs(covariance[1, 2]) > 0.1 * np.sqrt(covariance[1, 1] * covariance[2, 2])


def flying(share: float) -> AeroDatabase:
    """The light aircraft with its pitch derivatives as parameters, `share` of the true ones."""
    truth, database = flying_increments.TRUTH, flying_increments.light_aircraft().database
    variables: dict[str, Variable] = {}
    terms: list[Term] = []
    for axis in ("CZ", "Cm"):
        for regressor, value in truth[axis].items():
            name = f"{axis}_by_{regressor}"
            variables[name] = Variable(number(share * value), parameter=Parameter())
            terms.append(Term(name, axis, parse(f"{name}*{regressor}")))
    lateral = tuple(each for each in database.increments if each.axis not in ("CZ", "Cm"))
    return replace(
        database, variables=variables, terms=(*database.terms, *terms), increments=lateral
    )


def test_a_flying_database_is_fitted_by_output_error() -> None:
    """Start values 25 % off; simulated responses with the noise of sensors."""
    outputs: tuple[Any, ...] = ("V", "alpha", "q", "theta", "ax", "az")
    flown = flying_increments.stretches(np.random.default_rng(4), count=2)
    start = flight_model(flying(0.75))
    names = tuple(start.database.parameters)
    dynamics, records = flight_dynamics(start, flown, names, outputs=outputs, initial=outputs[:4])
    fit = output_error(dynamics, records)
    assert fit.converged
    for name, value in flying(1.0).parameters.items():
        assert fit[name].value == pytest.approx(value, rel=0.05), name
        assert abs(fit[name].value - value) < 4.0 * fit[name].standard_error, name
