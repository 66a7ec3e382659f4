"""Nonlinear refinement: output error's answer where that has one, the YF-22's new terms in six surfaces
and its product of inertia from several starts, and variants of a locked surface on legs left out."""

import numpy as np
import pytest

from aerodb.coefficients import compare, total_coefficients
from aerodb.errors import InputError
from aerodb.estimation import nonlinear_refinement, output_error
from aerodb.identification import METHODS, IdentificationFlight, fits_of, flight_dynamics
from aerodb.increments import estimate_increments, parse_model_file
from aerodb.signals import rms
from aerodb.vehicle import parse_vehicle, with_mass_channels
from tests.support import six_surfaces
from tests.support.flying_increments import TRUTH, light_aircraft, stretches

IXZ = six_surfaces.YF22.Ixz
#: The new terms of six surfaces, beside those of the database, which are held.
NEW = "".join(
    f"[[increment]]\naxis = {axis!r}\nterms = {[f'delta_{name}' for name in terms]}\n"
    for axis, terms in six_surfaces.added().items()
)
#: All derivatives by motion and surfaces.
ALL = "".join(
    f"[[increment]]\naxis = {axis!r}\nterms = {['1', *(n for n in terms if n != '1'), *more]}\n"
    for axis, terms in six_surfaces.halves(six_surfaces.nominal()).items()
    for more in [[f"delta_{n}" for n in six_surfaces.added()[axis] if f"delta_{n}" not in terms]]
)


def flights(seeds, product: float, surfaces: bool = True) -> list[IdentificationFlight]:
    """Legs beside the nominal database, by a vehicle file with this product of inertia; `surfaces`:
    their deflections are noisy as well."""
    own = parse_vehicle(six_surfaces.VEHICLE.replace(f"Ixz = {IXZ}", f"Ixz = {product}"))
    found = []
    for seed in seeds:
        flight = six_surfaces.leg(seed, six_surfaces.database())
        if not surfaces:
            flight = flight.with_channels(six_surfaces.exact_deflections(seed))
        flight = with_mass_channels(flight, own)
        made = total_coefficients(flight, own)
        beside = compare(flight, made, six_surfaces.database(False), own.reference)
        found.append(IdentificationFlight(flight, beside, made, own, ((0.0, 9.9),)))
    return found


def refined(given: list[IdentificationFlight]):
    model = parse_model_file('inertias = ["Ixz"]\n' + NEW)
    (fit,) = fits_of(METHODS["nonlinear-refinement"], given, model, six_surfaces.database(False))
    return fit


def planted() -> dict[str, float]:
    return {
        f"{axis}_delta_{name}": value
        for axis, terms in six_surfaces.added().items()
        for name, value in terms.items()
    }


def test_where_output_error_has_the_answer_it_is_the_same() -> None:
    wrong = light_aircraft(
        {axis: {n: 0.8 * v for n, v in own.items()} for axis, own in TRUTH.items()}
    )
    flown = stretches(np.random.default_rng(5), count=2, seconds=14.0)
    dynamics, records = flight_dynamics(wrong, flown, tuple(wrong.parameters))
    fit, plain = nonlinear_refinement(dynamics, records), output_error(dynamics, records)
    assert fit.converged
    assert "All 3 starts end at the same values." in fit.notes
    for each in fit.estimates:
        assert abs(each.value - plain[each.name].value) < 1.5 * each.standard_error, each
        assert each.standard_error == pytest.approx(plain[each.name].standard_error, rel=0.2)


@pytest.mark.parametrize(
    "product",
    [-0.35, *(pytest.param(x, marks=pytest.mark.campaign) for x in (-0.8, 0.0))],
)
def test_new_terms_and_the_product_of_inertia(product: float) -> None:
    """Deflections as they were, all other sensors with their printed noise: three legs."""
    fit = refined(flights(range(3), product, surfaces=False))
    assert fit["Ixz"].value == pytest.approx(IXZ, rel=0.1)
    assert abs(fit["Ixz"].value - IXZ) < 4.0 * fit["Ixz"].standard_error
    inside = [
        abs(fit[name].value - value) < 2.0 * fit[name].standard_error
        for name, value in planted().items()
    ]
    assert np.mean(inside) >= 0.88  # 16 of 18: 95 % of trials have as many
    assert any("3 starts end at the same values" in note for note in fit.notes)


def test_noise_of_the_deflections_is_taken_off_and_counted() -> None:
    """The printed noise of the potentiometers. In six sets of three legs 102 of 108 terms are within
    two standard errors. Without the correction 41 of 54 were, and CY of a stabilator was five away."""
    model, nominal = parse_model_file(NEW), six_surfaces.database(False)
    exact, noisy = (
        fits_of(METHODS["output-error"], flights(range(3), IXZ, surfaces), model, nominal)[0]
        for surfaces in (False, True)
    )
    assert not any("deflections" in each for each in exact.notes)
    assert any("Noise of deflections moved estimates" in n for n in noisy.notes)
    inside = [abs(noisy[n].value - v) < 2.0 * noisy[n].standard_error for n, v in planted().items()]
    assert np.mean(inside) >= 0.88  # 16 of 18: 95 % of trials have as many
    for name in planted():
        if "CY" in name:
            assert noisy[name].standard_error > 1.5 * exact[name].standard_error


def test_refinement_with_noise_of_the_deflections() -> None:
    fit = refined(flights(range(3), -0.35))
    assert fit["Ixz"].value == pytest.approx(IXZ, rel=0.1)
    inside = [abs(fit[n].value - v) < 2.0 * fit[n].standard_error for n, v in planted().items()]
    assert np.mean(inside) >= 0.88  # 16 of 18: 95 % of trials have as many
    assert any("errors of the inputs bias" in each for each in fit.assumes)


def test_held_and_free_variants_of_a_locked_surface_on_legs_left_out() -> None:
    """The left stabilator is locked, and logged so. With the nominal terms held, the new ones predict
    legs left out as well as all terms freed (within .3 % here), and far better than none."""
    truth, nominal = six_surfaces.database(), six_surfaces.database(False)
    own = six_surfaces.vehicle()

    def legs(seeds):
        found = []
        for seed in seeds:
            flight = six_surfaces.leg(seed, truth, {"stabilator_left": 0.0})
            still = np.zeros(len(flight.time))
            flight = flight.with_channels({"delta_stabilator_left": still})
            found.append((flight, total_coefficients(flight, own)))
        return found

    def comparisons(flown, database):
        return [compare(f, c, database, own.reference) for f, c in flown]

    used, left_out = legs(range(10)), legs(range(10, 16))
    errors = {}
    for name, text in (("held", NEW), ("free", ALL)):
        model = parse_model_file(text)
        update = estimate_increments(
            [f for f, _ in used], comparisons(used, nominal), model, nominal
        )
        errors[name] = {
            axis: rms(np.concatenate([c.residual(axis)[c.usable[axis]] for c in beside]))
            for beside in [comparisons(left_out, update.candidate)]
            for axis in ("CY", "Cl", "Cm", "Cn")
        }
    before = comparisons(left_out, nominal)
    for axis, error in errors["held"].items():
        assert error < 1.02 * errors["free"][axis], errors
        known = rms(np.concatenate([c.residual(axis)[c.usable[axis]] for c in before]))
        assert error < 0.7 * known, (axis, error, known)


def test_refusals_say_what_to_do() -> None:
    model = parse_model_file('inertias = ["Ixz"]\n' + NEW)
    with pytest.raises(InputError, match="estimates no Ixz"):
        fits_of(METHODS["regression"], [], model, six_surfaces.database(False))
    with pytest.raises(InputError, match="not Ixz"):
        estimate_increments([], [], model, six_surfaces.database(False))
    with pytest.raises(InputError, match="Iyz"):
        parse_model_file('inertias = ["Iyz"]\n' + NEW)
    with pytest.raises(InputError, match="an inertia stands twice"):
        parse_model_file('inertias = ["Ixz", "Ixz"]\n' + NEW)


@pytest.mark.campaign
def test_a_filter_is_without_what_noise_of_deflections_does_on_average() -> None:
    """Side forces of the stabilators were 2.9 and 3.6 standard errors low in two sets of legs."""
    model, nominal = parse_model_file(NEW), six_surfaces.database(False)
    fit = fits_of(METHODS["filter-error"], flights(range(3), IXZ), model, nominal)[0]
    assert any("Noise of deflections moved estimates" in note for note in fit.notes)
    for name, value in planted().items():
        if "CY" in name:
            assert abs(fit[name].value - value) < 2.5 * fit[name].standard_error
