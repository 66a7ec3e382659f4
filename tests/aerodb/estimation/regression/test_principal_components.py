"""Principal-component regression: textbook formulas by hand, least squares at full rank, planted
collinearity, and the published bin of sweeps and stalls with columns that move together."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.estimation import Parameter
from aerodb.estimation.regression.principal_components import principal_components
from aerodb.estimation.regression.regression_fit import regression
from aerodb.estimation.splines import spline_basis
from tests.support.caravan import ALPHA, CHORD, KNOTS, LIFT, bin_equation, caravan_bin
from tests.support.equations import STEP, coloured, equation, manoeuvre


def planted(seed, apart=0.02, n=1500, records=1):
    """Columns of which two move almost together."""
    rng = np.random.default_rng(seed)
    columns = []
    for _ in range(records):
        made = manoeuvre(rng, n)
        columns.append({**made, "alphadot": made["q"] + apart * coloured(rng, n, 0.9)})
    truth = {"alpha": 1.0, "q": -2.0, "de": 0.5, "1": 0.1, "alphadot": -1.0}
    responses = [
        sum(truth[name] * column for name, column in c.items()) + 0.3 * coloured(rng, n, 0.8)
        for c in columns
    ]
    return columns, responses


@pytest.mark.parametrize("constant", [True, False])
def test_full_rank_is_least_squares(constant):
    columns, responses = planted(1, apart=1.0)
    if not constant:
        columns = [{name: c[name] for name in c if name != "1"} for c in columns]
    whole = equation(columns, responses)
    fit = principal_components(whole, criterion="ratio", condition_index=1e6)
    plain = regression(whole)
    assert [e.value for e in fit.estimates] == pytest.approx([e.value for e in plain.estimates])
    assert [e.standard_error for e in fit.estimates] == pytest.approx(
        [e.standard_error for e in plain.estimates], rel=1e-6
    )
    assert all(e.standing == "estimated" for e in fit.estimates)


def test_by_hand():
    """Centred columns of unit length, three of four components, and start values along the rest."""
    columns, responses = planted(3)
    start = {"q": -1.5, "alphadot": -1.5}
    fit = principal_components(
        equation(columns, responses, **{k: Parameter(k, v) for k, v in start.items()}),
        criterion="ratio",
    )
    names = ("alpha", "q", "de", "alphadot")
    x = np.column_stack([columns[0][name] for name in names])
    x = x - x.mean(axis=0)
    p0 = np.array([start.get(name, 0.0) for name in names])
    scale = np.sqrt(np.sum(x**2, axis=0))
    u, s, vt = np.linalg.svd(x / scale, full_matrices=False)
    assert s[0] / s[3] > 30 > s[0] / s[2]
    y = responses[0] - responses[0].mean() - x @ p0
    expected = p0 + (vt[:3].T @ ((u[:, :3].T @ y) / s[:3])) / scale
    np.testing.assert_allclose([fit[name].value for name in names], expected, rtol=1e-9)
    assert fit["q"].standing == fit["alphadot"].standing == "biased"
    assert "stay at their start values" in fit["q"].reason
    assert "least squares gives" in fit["q"].reason
    assert fit["alpha"].standing == "estimated"
    assert any("Rank 3 of 4" in note for note in fit.notes)
    assert any("Left at its start value: 0.71" in note for note in fit.notes)


@pytest.mark.parametrize("criterion", ["prediction", "cross-validation"])
def test_what_is_not_determined_is_left_and_errors_fall(criterion):
    """With two columns that move almost together, estimates are nearer the truth than those of
    least squares; the sum of the two is right."""
    error, plain, ranks, sums = [], [], [], []
    for seed in range(12):
        columns, responses = planted(seed + 10, apart=0.01, n=600, records=3)
        fit = principal_components(equation(columns, responses), criterion=criterion)
        least = regression(equation(columns, responses))
        error.append(fit["q"].value + 2.0)
        plain.append(least["q"].value + 2.0)
        ranks.append(fit["q"].standing)
        sums.append(fit["q"].value + fit["alphadot"].value + 3.0)
    assert np.mean(np.square(error)) < 0.6 * np.mean(np.square(plain))
    assert ranks.count("biased") >= 8
    assert np.abs(sums).max() < 0.3


def test_columns_that_stand_still_or_repeat_others():
    columns, responses = planted(5, apart=1.0)
    made = {**columns[0], "flap": 2.0 * columns[0]["de"], "gear": np.zeros(1500)}
    fit = principal_components(equation([made], responses), criterion="ratio", condition_index=1e6)
    assert fit["gear"].standing == "not excited"
    assert fit["flap"].standing == fit["de"].standing == "biased"
    assert "least squares" not in fit["de"].reason
    assert fit["alpha"].standing == "estimated"
    only = principal_components(equation([{"1": np.ones(100)}], [np.arange(100.0)]))
    assert only["1"].value == pytest.approx(49.5)
    with pytest.raises(InputError, match="fixed or tied"):
        principal_components(
            equation(
                [columns[0]],
                responses,
                **{name: Parameter(name, 0.0, free=False) for name in columns[0]},
            )
        )


def test_the_bin_of_sweeps_and_stalls():
    """Eq. 41 with the rate of alpha beside the pitch rate, all free: the curve comes back, and the
    two rates are told to be one."""
    flown = caravan_bin(1)
    names = [f"{np.rad2deg(knot):.0f} deg" for knot in KNOTS]
    bases = []
    for each in flown:
        smooth = np.convolve(each.alpha, np.hanning(26) / np.hanning(26).sum(), "same")
        rate = np.gradient(smooth, STEP) * CHORD / (2 * 64.3)
        bases.append(np.column_stack([spline_basis(each.alpha, KNOTS, "linear"), rate]))
    whole = bin_equation(flown, bases, [*names, "alphadot_hat"])
    free = type(whole)(
        whole.response,
        type(whole.parameters)(tuple(Parameter(p.name, 0.0) for p in whole.parameters.items)),
        whole.records,
    )
    fit = principal_components(free)
    assert any("of 9 by predicted square error" in note for note in fit.notes)
    truth = np.interp(KNOTS, ALPHA, LIFT)
    for name, value in zip(names, truth, strict=True):
        each = fit[name]
        assert each.standing in ("estimated", "biased")
        if each.standing == "estimated":
            assert each.value == pytest.approx(value, abs=max(3.5 * each.standard_error, 0.02))
    note = next(n for n in fit.notes if n.startswith("All 7 records"))
    assert float(note.split("fit ")[1].split(" %")[0]) > 97.7
