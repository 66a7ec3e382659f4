"""Parameters of a database, estimated from the residuals of flights as declared increments are."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import pytest

from aerodb.coefficients import band_limited
from aerodb.effects import predicted_change
from aerodb.errors import InputError
from aerodb.increments import ConsiderParameter, Update, estimate_increments, parse_model_file
from aerodb.increments.parameters import estimate_parameters
from aerodb.loop.angle_errors import with_attenuation
from aerodb.nomenclature import MOMENT_AXES
from aerodb.tables import (
    AeroDatabase,
    Parameter,
    Uncertainty,
    changed_parameters,
    normal,
    parameter_covariance,
    parse,
    sigma_of,
)
from tests.support.build_up import build_up, flights
from tests.support.flights_in_memory import FlightsInMemory

WRONG = {"wing_CLa": 4.0, "tail_CLa": 3.0, "tail_tau": 0.4, "fin_CLa": 2.2}


@pytest.fixture(scope="module")
def source() -> FlightsInMemory:
    return flights(range(60, 64), build_up())


def estimated(
    source: FlightsInMemory,
    names: Sequence[str],
    database: AeroDatabase,
    consider: Mapping[str, Sequence[ConsiderParameter]] | None = None,
) -> Update:
    ids = tuple(source.flown)
    return estimate_increments(
        [source.flight(id) for id in ids],
        [source.comparison(id, database) for id in ids],
        parse_model_file(f"parameters = {list(names)}"),
        database,
        consider,
    )


def sigma(update: Update, name: str) -> float:
    return sigma_of(update.candidate.variables[name].uncertainty) or 0.0


def test_all_wrong_parameters_at_once(source: FlightsInMemory) -> None:
    """The tail's slope multiplies the elevator's effectiveness, so that one solution does not do."""
    update = estimated(source, [*WRONG], build_up(WRONG))
    assert update.axes == ()
    assert update.reservations == ()
    assert update.candidate.increments == ()
    for name in WRONG:
        true, found = build_up().parameters[name], update.candidate.parameters[name]
        assert found == pytest.approx(true, rel=0.03), name
        assert abs(found - true) < 3.0 * sigma(update, name), name
    assert update.candidate.parameters["body_CD"] == build_up().parameters["body_CD"]
    moved = [
        abs(update.candidate.parameters[name] - WRONG[name]) / sigma(update, name)
        for name in changed_parameters(build_up(WRONG), update.candidate)
    ]
    assert len(moved) == len(WRONG)
    assert moved == sorted(moved, reverse=True)


def test_intervals_hold_the_truth_as_often_as_they_say() -> None:
    """Forty sets of three flights with coloured noise, each flight with constants of its own."""
    inside = total = 0
    for first in range(100, 220, 3):
        update = estimated(flights(range(first, first + 3), build_up()), [*WRONG], build_up(WRONG))
        for name in WRONG:
            off = update.candidate.parameters[name] - build_up().parameters[name]
            inside += abs(off) < 1.96 * sigma(update, name)
            total += 1
    assert total == 160
    assert inside >= 0.9 * total  # 95 % of 160: 152 +- 3


def test_right_parameters_stay(source: FlightsInMemory) -> None:
    update = estimated(source, [*WRONG], build_up())
    for name in WRONG:
        off = update.candidate.parameters[name] - build_up().parameters[name]
        assert abs(off) < 3.0 * sigma(update, name), name


def test_a_sensor_error_that_is_considered_widens(source: FlightsInMemory) -> None:
    """By what the estimates would be off if the error were there in all flights, of the same size:
    all axes of a flight feel the same error."""
    database, names = build_up(), ["wing_CLa", "tail_CLa"]
    errors = {
        id: predicted_change(source.view(id, database), alpha=source.flight(id)["alpha"].copy())
        for id in source.flown
    }

    def doubt(shared: bool) -> dict[str, list[ConsiderParameter]]:
        return {
            id: [ConsiderParameter("alpha_scale", 0.002, shared, columns)]
            for id, columns in errors.items()
        }

    plain = estimated(source, names, database)
    own, alike = (estimated(source, names, database, doubt(each)) for each in (False, True))
    for name in names:
        assert sigma(plain, name) < sigma(own, name) < sigma(alike, name), name
    off = [source.comparison(id, database) for id in source.flown]
    for compared in off:
        for axis, column in errors[compared.flight].items():
            seen = 0.002 * column
            if axis in MOMENT_AXES and compared.bandwidth is not None:
                seen = band_limited(seen, source.flight(compared.flight).step, compared.bandwidth)
            compared.measured[axis] += seen
    moved = estimate_parameters(off, names, database, {}).database
    shift = np.array([moved.parameters[n] - plain.candidate.parameters[n] for n in names])
    added = parameter_covariance(alike.candidate, names) - parameter_covariance(
        plain.candidate, names
    )
    assert added == pytest.approx(np.outer(shift, shift), rel=0.1)


def test_priors_bounds_and_earlier_flights(source: FlightsInMemory) -> None:
    database = build_up(WRONG)
    free = estimated(source, ["fin_CLa"], database)
    variable = database.variables["fin_CLa"]

    def told(uncertainty: Uncertainty | None, known: Parameter | None) -> Update:
        fin = replace(variable, uncertainty=uncertainty, parameter=known)
        changed = {**database.variables, "fin_CLa": fin}
        return estimated(source, ["fin_CLa"], replace(database, variables=changed))

    prior = normal(sigma(free, "fin_CLa"))
    drawn = told(prior, variable.parameter)
    # What flights add to the prior, by the variance that is left; about half.
    share = 1.0 - (sigma(drawn, "fin_CLa") / sigma(free, "fin_CLa")) ** 2
    assert share == pytest.approx(0.5, abs=0.1)
    between = 2.2 + share * (free.candidate.parameters["fin_CLa"] - 2.2)
    assert drawn.candidate.parameters["fin_CLa"] == pytest.approx(between, abs=0.02)
    flown = told(prior, Parameter(flights=("one",)))
    assert flown.candidate.parameters["fin_CLa"] == pytest.approx(
        free.candidate.parameters["fin_CLa"]
    )
    held = told(None, Parameter((2.0, 2.5)))
    assert held.candidate.parameters["fin_CLa"] == pytest.approx(2.5)
    assert held.reservations == ("fin_CLa ended on a bound",)


def test_parameters_that_act_alike_are_named(source: FlightsInMemory) -> None:
    """Tail slope and tail area: one number, written as two; with priors it could be solved."""
    database = build_up()
    variables = dict(database.variables)
    slope = variables["tail_CLa"]
    variables["tail_CLa"] = replace(slope, uncertainty=normal(1.0))
    variables["tail_area"] = replace(
        slope,
        expression=build_up().variables["tail_tau"].expression,
        uncertainty=normal(0.3),
        parameter=Parameter((0.05, 1.0)),
    )
    lift = variables["tail_lift"]
    variables["tail_lift"] = replace(lift, expression=parse("0.4*tail_area*tail_CLa*tail_alpha"))
    doubled = replace(database, variables=variables)
    with pytest.raises(InputError, match="tail_CLa"):
        estimated(source, ["tail_CLa", "tail_area"], doubled)


def test_errors_of_the_regressors_count(source: FlightsInMemory) -> None:
    """The same estimate from flights with the error of their states once more is the doubt."""
    update = estimated(source, ["wing_CLa", "fin_CLa"], build_up(WRONG))
    moved = replace(
        update,
        candidate=replace(
            update.candidate,
            variables={
                **update.candidate.variables,
                "wing_CLa": build_up({"wing_CLa": 4.3}).variables["wing_CLa"],
            },
        ),
    )
    wider = with_attenuation(update, [moved], 2.0)
    shift = 4.3 - update.candidate.parameters["wing_CLa"]
    names = ["wing_CLa", "fin_CLa"]
    before, after = (parameter_covariance(u.candidate, names) for u in (update, wider))
    assert after[0, 0] == pytest.approx(before[0, 0] + 4.0 * shift**2)
    assert after[1, 1] == pytest.approx(before[1, 1])
    assert wider.candidate.parameters == update.candidate.parameters


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('parameters = ["tale_CLa"]', "no parameter 'tale_CLa'"),
        ('parameters = ["body_CD"]', "body_CD changes nothing, or only a constant"),
        (
            'parameters = ["fin_CLa"]\n[[increment]]\naxis = "Cl"\nterms = ["beta"]',
            "declares parameters and increments",
        ),
    ],
)
def test_what_cannot_be_estimated_is_said(source: FlightsInMemory, text: str, says: str) -> None:
    ids = tuple(source.flown)
    with pytest.raises(InputError, match=says):
        estimate_increments(
            [source.flight(id) for id in ids],
            [source.comparison(id, build_up()) for id in ids],
            parse_model_file(text),
            build_up(),
        )


def test_own_constants_at_the_top_are_of_parameters() -> None:
    with pytest.raises(InputError, match="own_constants"):
        parse_model_file('own_constants = false\n[[increment]]\naxis = "Cm"\nterms = ["q_hat"]')
