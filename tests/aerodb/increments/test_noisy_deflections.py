"""Noise of logged deflections: its size from the log alone, and what it takes from parameters."""

import numpy as np
import pytest

from aerodb.coefficients import compare
from aerodb.errors import InputError
from aerodb.estimation import coloured_sum, deflection_noise, input_noise, shared_coloured_sum
from aerodb.increments import DeclaredIncrement, ModelFile, estimate_increments
from aerodb.increments.parameters import estimate_parameters
from tests.support import six_surfaces
from tests.support.build_up import build_up, flights


def test_steps_with_noise_show_its_size_and_without_none() -> None:
    """Steps of servos with a lag, with the noise of the YF-22's potentiometers."""
    log = six_surfaces.leg(3, six_surfaces.database())
    seen = deflection_noise(log.channels)
    for name in six_surfaces.SURFACES:
        stated = six_surfaces.NOISE[f"delta_{name.split('_')[0]}"]
        assert seen[f"delta_{name}"] == pytest.approx(stated, rel=0.25), name
    assert deflection_noise(six_surfaces.exact_deflections(3)) == {}
    wave = 0.05 * np.sin(2.0 * np.pi * 1.5 * np.arange(500) / 20.0)
    assert deflection_noise({"delta_elevator": wave, "alpha": log.channels["alpha"]}) == {}


def drawn(added: float, sign: float) -> float:
    """Elevator effectiveness less that of exact deflections, as a part of it."""
    database, truth = build_up({"tail_tau": 0.45}), build_up()
    source = flights(range(60, 62), truth, 0.1)
    comparisons = []
    for id, (flight, made) in source.flown.items():
        values = flight["delta_elevator"]
        noise = np.random.default_rng(3).standard_normal(len(values)) * values.std()
        flight = flight.with_channels({"delta_elevator": values + sign * added * noise})
        comparisons.append(compare(flight, made, database, source.vehicle.reference))
        assert comparisons[-1].flight == id
    found = estimate_parameters(comparisons, ["tail_tau"], database, {})
    assert found.reservations == ()
    return found.database.parameters["tail_tau"] / truth.parameters["tail_tau"] - 1.0


def test_what_noise_takes_is_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    """Noise of a fifth of the elevator's motion takes 1 - 1/1.04 of its effect. Noise of both signs
    leaves no error of first order."""
    exact = drawn(0.0, 1.0)
    assert np.mean([drawn(0.2, sign) for sign in (-1.0, 1.0)]) == pytest.approx(exact, abs=0.006)
    monkeypatch.setattr(input_noise, "deflection_noise", lambda channels: {})
    plain = float(np.mean([drawn(0.2, sign) for sign in (-1.0, 1.0)]))
    assert plain - exact == pytest.approx(1.0 / 1.04 - 1.0, rel=0.2)


@pytest.mark.parametrize("own_constants", [False, True])
def test_declared_terms_of_ten_legs_with_all_printed_noise(own_constants: bool) -> None:
    """The YF-22's new terms beside the nominal ones, two sets of ten legs: 35 of 36 are within two
    standard errors. Without the correction half of a stabilator's are beyond six."""
    nominal, own = six_surfaces.database(False), six_surfaces.vehicle()
    new = six_surfaces.added()
    model = ModelFile(
        increment=tuple(
            DeclaredIncrement(
                axis=axis,
                terms=(*(["1"] if own_constants else []), *(f"delta_{name}" for name in terms)),
                own_constants=own_constants,
            )
            for axis, terms in new.items()
        )
    )
    apart = []
    for first in (0, 10):
        source = six_surfaces.legs(range(first, first + 10), six_surfaces.database())
        flown = [flight for flight, _ in source.flown.values()]
        beside = [compare(f, made, nominal, own.reference) for f, made in source.flown.values()]
        update = estimate_increments(flown, beside, model, nominal)
        assert update.reservations == ()
        for axis in update.axes:
            found = zip(axis.names, axis.estimates, axis.standard_errors, strict=True)
            apart += [
                (value - new[axis.axis][name.removeprefix("delta_")]) / error
                for name, value, error in found
                if name != "1"
            ]
    assert len(apart) == 36
    assert np.mean(np.abs(apart) < 2.0) >= 0.9


def test_deflections_that_are_mostly_noise_are_said() -> None:
    database, truth = build_up(), build_up()
    source = flights(range(60, 61), truth, 0.1)
    ((flight, made),) = source.flown.values()
    noise = np.random.default_rng(3).standard_normal(len(flight.time)) * 2.0
    flight = flight.with_channels({"delta_elevator": flight["delta_elevator"].std() * noise})
    beside = compare(flight, made, database, source.vehicle.reference)
    with pytest.raises(InputError, match="moves tail_tau in these flights is noise of deflections"):
        estimate_parameters([beside], ["tail_tau"], database, {})
    model = ModelFile(increment=(DeclaredIncrement(axis="Cm", terms=("delta_elevator",)),))
    said = estimate_increments([flight], [beside], model, database).reservations
    assert any("noise of the deflections is most of what moves them" in each for each in said)


def test_errors_that_equations_share_do_not_average_out() -> None:
    random = np.random.default_rng(1)
    x, v = random.standard_normal((200, 2)), random.standard_normal(200)
    one = coloured_sum(x, v)
    both = shared_coloured_sum([(x, v, 200), (x, v, 200)])
    assert both == pytest.approx(4.0 * one)
    against = shared_coloured_sum([(x, v, 200), (x, -v, 200)])
    assert np.abs(against).max() < 1e-12 * np.abs(one).max()
