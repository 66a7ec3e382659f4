"""Tests of the smoother on analytic flights in Dryden turbulence, which differs from the
process that it assumes, and on measured records."""

from dataclasses import replace

import numpy as np
import pytest

from aerodb.consistency.kinematics import INPUTS
from aerodb.consistency.output_error.reconstruction import reconstruct
from aerodb.consistency.smoother import smooth_flight, smoothing
from aerodb.consistency.smoother.path_error import path_error
from aerodb.errors import InputError, UnknownNameError
from tests.support.consistency_records import ATTAS_BIASES, attas, hfb320
from tests.support.golden import same
from tests.support.moving_air import CHANNELS, FIRST, FREE, moving_air, parts
from tests.support.simulated_path import NOISE

ANGLES = ("phi", "theta", "psi")
SHOWN = ("V", "alpha", "beta", *ANGLES)
MODERATE = 8.0  # m/s of wind at 6 m: gusts of about 1.2 m/s (horizontal) and .8 m/s (vertical)


def solve(record, free=FREE, **how):
    result = reconstruct([record] if not isinstance(record, list) else record, free, initial=FIRST)
    return result, smooth_flight(result, "gusty", **how)


def channel(path, name):
    return path.states[3 + ANGLES.index(name)] if name in ANGLES else getattr(path, name)


def rms(error):
    return float(np.sqrt(np.mean(error**2)))


def share(entry, true, name):
    """Share of samples within 1.96 sigma, and mean square error in units of sigma."""
    ratio = (channel(entry.path, name) - true[name]) / entry.sigma[name]
    return float(np.mean(np.abs(ratio) < 1.96)), float(np.mean(ratio**2))


def test_the_error_of_a_path_is_linear_as_said():
    """A bias of an inertial sensor, taken through the linear system step by step, moves states and
    sensors as the exact sensitivities of the reconstruction do."""
    result, _ = solve(moving_air(1, 0.0)[0], (*FREE, "q_scale"))
    free = [entry.parameter for entry in result.estimates if entry.parameter.kind != "initial"]
    system = path_error(
        result.paths[0], {entry.parameter.name: entry.value for entry in result.estimates}, free
    )
    m = system.observation.shape[2]
    for number, item in enumerate(free):
        if item.subject not in INPUTS or item.kind != "bias":
            continue
        state = np.zeros((len(system.at), m))
        for i in range(len(state) - 1):
            step = np.eye(m)
            step[system.rows, system.columns] += system.values[i]
            state[i, 9:15] = system.state_sensitivity[i, 9:15, number]
            state[i + 1] = step @ state[i]
        exact = system.state_sensitivity[:, :, number]
        size = np.abs(exact[:, :6]).max(axis=0)
        moving = size > 1e-2 * size.max()
        assert np.all(np.abs(state - exact)[:, :6].max(axis=0)[moving] < 0.006 * size[moving]), (
            item.name
        )
        shown = np.einsum("gcm,gm->gc", system.observation, exact)
        exact_shown = system.output_sensitivity[:, :, number]
        assert np.abs(shown - exact_shown).max() < 0.006 * np.abs(exact_shown).max(), item.name


def test_in_calm_air_it_is_the_path():
    """No gusts are found (their light-turbulence expectation is .77 m/s), and the two estimates
    agree within their sigmas."""
    record, true = moving_air(2, 0.0)
    result, smoothed = solve(record)
    entry, path = smoothed.paths[0], result.paths[0]
    assert smoothed.intensities.gusts.horizontal < 0.05
    for row, name in enumerate(("V", "alpha", "beta")):
        apart = rms(channel(entry.path, name) - channel(path, name))
        assert apart < np.hypot(entry.sigma[name].mean(), path.air_sigma[row].mean()), name
        assert rms(channel(entry.path, name) - true[name]) < 0.1 * NOISE[name]
    for name in ANGLES:
        assert rms(channel(entry.path, name) - true[name]) < 1.1 * rms(
            channel(path, name) - true[name]
        )


def test_gusts_are_followed():
    """Better than the path of the steady wind by a factor of 5, than the sensors by 2, and their
    size is found."""
    record, true = moving_air(3, MODERATE, seconds=60.0)
    result, smoothed = solve(record)
    entry, path = smoothed.paths[0], result.paths[0]
    for name in ("V", "alpha", "beta"):
        error = rms(channel(entry.path, name) - true[name])
        assert error < 0.2 * rms(channel(path, name) - true[name]), name
        assert error < 0.6 * NOISE[name], name
    for number, name in enumerate(("wind_north", "wind_east", "wind_down")):
        assert rms(entry.wind[number] - true[name]) < 0.25 * np.std(true[name]), name
    found, real = entry.intensities.gusts, np.std([true["wind_north"], true["wind_east"]], axis=1)
    assert found.horizontal == pytest.approx(rms(real), rel=0.35)
    assert found.vertical == pytest.approx(np.std(true["wind_down"]), rel=0.35)


CASES = {
    "calm": (0.0, CHANNELS),
    "gusts": (MODERATE, CHANNELS),
    "no beta": (MODERATE, tuple(name for name in CHANNELS if name != "beta")),
    "no vane": (MODERATE, tuple(name for name in CHANNELS if name not in ("alpha", "beta"))),
}


KNOWN = {
    "calm": [
        ("V", 1.0, 0.53),
        ("alpha", 0.963, 0.696),
        ("beta", 1.0, 0.492),
        ("phi", 1.0, 0.631),
        ("theta", 0.945, 1.15),
        ("psi", 0.954, 0.853),
    ],
    "gusts": [
        ("V", 0.94, 1.16),
        ("alpha", 0.947, 1.02),
        ("beta", 0.947, 1.04),
        ("phi", 1.0, 0.542),
        ("theta", 0.954, 1.13),
        ("psi", 0.917, 1.17),
    ],
    "no beta": [
        ("V", 0.948, 1.07),
        ("alpha", 0.938, 1.07),
        ("beta", 0.934, 1.34),
        ("phi", 0.989, 0.587),
        ("theta", 0.999, 0.936),
        ("psi", 0.962, 0.99),
    ],
    "no vane": [
        ("V", 0.951, 1.05),
        ("alpha", 0.977, 0.848),
        ("beta", 0.952, 1.11),
        ("phi", 0.945, 1.08),
        ("theta", 0.972, 1.06),
        ("psi", 1.0, 0.532),
    ],
}


@pytest.mark.parametrize("case", CASES)
def test_one_flight_has_the_errors_that_it_always_had(case):
    """Share of the samples within two standard errors, and mean square error over that stated."""
    strength, channels = CASES[case]
    record, true = moving_air(400, strength, channels=channels)
    entry = solve(record)[1].paths[0]
    rows = [
        (name, *map(float, share(entry, true, name))) for name in ("V", "alpha", "beta", *ANGLES)
    ]
    assert same(rows, KNOWN[case])


@pytest.mark.parametrize("case", ["gusts", "no vane"])
def test_the_slow_grid_tells_the_same(case, monkeypatch):
    """In moderate turbulence: attitude, air data and wind within a fiftieth of a standard error of a
    smoother that does everything on the fine grid, and standard errors within 5 %."""
    strength, channels = CASES[case]
    result, quick = solve(moving_air(401, strength, channels=channels)[0], draws=8)
    monkeypatch.setattr(smoothing, "worth_a_coarse_search", lambda *_: False)
    whole = smooth_flight(result, "gusty", intensities=quick.intensities, draws=8)
    one, other = quick.paths[0], whole.paths[0]
    assert one.intensities != other.intensities  # the grids were different ones
    apart = dict(zip(("wind_north", "wind_east", "wind_down"), one.wind - other.wind, strict=True))
    apart |= {name: channel(one.path, name) - channel(other.path, name) for name in SHOWN}
    for name, difference in apart.items():
        assert rms(difference / other.sigma[name]) < 0.02, name
        assert one.sigma[name] == pytest.approx(other.sigma[name], rel=0.05), name


@pytest.mark.campaign
@pytest.mark.parametrize("case", CASES)
def test_standard_errors_are_honest(case):
    """Pooled over runs: 95 % intervals cover, mean square errors are those stated; without a vane
    only as far as one intensity for gusts that nobody saw can say."""
    strength, channels = CASES[case]
    found = {name: [] for name in ("V", "alpha", "beta", *ANGLES)}
    for seed in range(60):
        record, true = moving_air(400 + seed, strength, channels=channels)
        entry = solve(record)[1].paths[0]
        for name, shares in found.items():
            shares.append(share(entry, true, name))
    for name, shares in found.items():
        cover, square = np.mean(shares, axis=0)
        blind = name not in channels
        assert cover > (0.85 if blind else 0.91), name
        assert square < (1.6 if blind else 1.3), name
        if strength > 0 and not blind and name in ("V", "alpha", "beta"):
            assert square > 0.6, name


def test_a_missing_vane_costs_what_it_costs():
    """Without beta its sigma is that of the gusts across; alpha and V lose nothing."""
    full, blind = (
        solve(moving_air(5, MODERATE, seconds=30.0, channels=CASES[case][1])[0])[1].paths[0]
        for case in ("gusts", "no beta")
    )
    across = full.intensities.gusts.horizontal / 60.0
    assert full.sigma["beta"].mean() < 0.3 * across
    assert 0.5 * across < blind.sigma["beta"].mean() < 1.5 * across
    assert blind.sigma["alpha"].mean() == pytest.approx(full.sigma["alpha"].mean(), rel=0.1)
    assert blind.sigma["V"].mean() == pytest.approx(full.sigma["V"].mean(), rel=0.1)


def test_gaps_and_rates():
    """Velocity over the earth five times a second, and three seconds without alpha: sigma grows
    there, and holds."""
    record, true = moving_air(6, MODERATE)
    n = len(record.inputs)
    thin = {
        name: np.where(np.arange(n) % 10 == 0, values, np.nan)
        for name, values in record.outputs.items()
        if name[:3] == "vel"
    }
    gap = slice(n // 2, n // 2 + 150)
    alpha = np.array(record.outputs["alpha"])
    alpha[gap] = np.nan
    result, smoothed = solve(replace(record, outputs={**record.outputs, **thin, "alpha": alpha}))
    entry = smoothed.paths[0]
    middle = slice(gap.start + 50, gap.stop - 50)
    assert entry.sigma["alpha"][middle].mean() > 3 * entry.sigma["alpha"][: n // 3].mean()
    error = entry.path.alpha - true["alpha"]
    assert np.all(np.abs(error[gap]) < 4 * entry.sigma["alpha"][gap])
    assert rms(error[: gap.start]) < 0.6 * NOISE["alpha"]
    assert np.isnan(entry.path.residuals["alpha"][gap]).all()
    assert rms(entry.path.states[4] - true["theta"]) < 1.2 * rms(
        result.paths[0].states[4] - true["theta"]
    )


def test_a_late_vane_is_put_back():
    """alpha .1 s late: with its delay known, the smoothed alpha is as good as that of a prompt
    vane; unknown, it is not."""
    prompt, _ = moving_air(7, MODERATE, seconds=25.0)
    late, true = moving_air(7, MODERATE, seconds=25.0, delay=0.1)
    errors = {}
    for case, record, fixed in (
        ("prompt", prompt, {}),
        ("known", late, {"alpha_delay": 0.1}),
        ("unknown", late, {}),
    ):
        result = reconstruct([record], FREE, initial=FIRST, fixed=fixed)
        path = smooth_flight(result, "gusty", fixed=fixed).paths[0].path
        errors[case] = rms((path.alpha - true["alpha"])[50:-50])
    assert errors["known"] < 1.1 * errors["prompt"]
    assert errors["unknown"] > 1.5 * errors["prompt"]


def test_a_drifting_gyro_is_followed():
    """Half a milliradian per second of drift over a minute: output error's one bias cannot, the
    smoother takes it out."""
    record, true = moving_air(8, 0.0, seconds=60.0)
    drift = 5e-4 * np.linspace(-1.0, 1.0, len(record.inputs))
    inputs = record.inputs + drift[:, None] * (np.array(INPUTS) == "q")
    result, smoothed = solve(replace(record, inputs=inputs))
    path = smoothed.paths[0].path
    assert rms(path.states[4] - true["theta"]) < 0.3 * rms(
        result.paths[0].states[4] - true["theta"]
    )
    left = path.inputs[:, 4] - inputs[:, 4] + drift
    assert rms(left - left.mean()) < 0.4 * rms(drift)


def test_windows_of_one_flight():
    """Shared intensities, and one path per record."""
    record, true = moving_air(9, MODERATE, seconds=60.0)
    records = [replace(part, name=part.name, flight="gusty") for part in parts(record, 3)]
    _, smoothed = solve(records)
    assert [entry.path.record.name for entry in smoothed.paths] == ["gusty/0", "gusty/1", "gusty/2"]
    joined = np.concatenate([entry.path.alpha for entry in smoothed.paths])
    assert rms(joined - true["alpha"]) < 0.65 * NOISE["alpha"]


def test_a_pressure_that_is_shown_twice_counts_once():
    """qbar computed from the same noisy V: sigma of V must not shrink by the square root of two."""
    record, _ = moving_air(10, MODERATE)
    twice = replace(
        record, outputs={**record.outputs, "qbar": 0.5 * record.density * record.outputs["V"] ** 2}
    )
    once, both = (solve(each)[1].paths[0] for each in (record, twice))
    assert both.sigma["V"].mean() == pytest.approx(once.sigma["V"].mean(), rel=0.02)
    assert np.corrcoef(both.path.residuals["qbar"], both.path.residuals["V"])[0, 1] > 0.99


def test_draws_have_the_stated_size():
    """Random errors of the smoother scatter as its covariance says, and come again from the same
    seed."""
    record, _ = moving_air(11, MODERATE, seconds=20.0)
    result, smoothed = solve(record, draws=40)
    entry = smoothed.paths[0]
    for name in ("V", "alpha", "beta", *ANGLES, "q"):
        stated = np.mean(entry.sigma[name][entry.grid] ** 2) - entry.within[name] ** 2
        if name == "q":  # the white noise of a single sample is not among the draws
            stated -= NOISE_OF_RATES**2
            assert np.mean(entry.draws[name] ** 2) < max(2.0 * stated, 0.1 * NOISE_OF_RATES**2)
            continue
        assert np.mean(entry.draws[name] ** 2) == pytest.approx(stated, rel=0.25), name
    again = smooth_flight(result, "gusty", draws=40).paths[0]
    assert np.array_equal(again.draws["alpha"], entry.draws["alpha"])


NOISE_OF_RATES = 5e-4


def test_what_cannot_be_smoothed_is_refused():
    record, true = moving_air(12, 0.0, seconds=10.0)
    result, _ = solve(record)
    with pytest.raises(UnknownNameError, match="did you mean 'gusty'"):
        smooth_flight(result, "gsty")
    given = replace(record, given={"phi": true["phi"]})
    taken = reconstruct([given], ("q_bias",), initial=("u", "w", "theta"))
    with pytest.raises(InputError, match="states taken from measurement"):
        smooth_flight(taken, "gusty")


def alike(values):
    """Correlation from one sample to the next."""
    values = values[np.isfinite(values)]
    return float(np.sum(values[1:] * values[:-1]) / np.sum(values**2))


def test_hfb320_in_turbulence(measured):
    """Innovations are far whiter than the residuals of output error, and the lift coefficient
    regressed on the smoothed states is nearer to the published filter-error estimates (-.0929 .1487
    4.328) than on the sensors or the steady path."""
    file = measured("hfb320/hfb320_1_10.asc")
    record = hfb320(file)
    result = reconstruct([record], ATTAS_BIASES, initial=("u", "v", "w", "phi", "theta"))
    entry = smooth_flight(result, "hfb320").paths[0]
    path, steady = entry.path, result.paths[0]
    for name in record.outputs:
        assert alike(steady.residuals[name]) > 0.8
        assert alike(entry.innovations[name][10:]) < (0.6 if name == "alpha" else 0.2), name
    data = np.loadtxt(file)
    thrust, pressure = data[:, 3] / 7472.0, data[:, 2] * 0.004028

    def lift(alpha, speed, inputs):
        ahead, down = inputs[:, 0] - thrust * np.cos(0.0524), inputs[:, 2] + thrust * np.sin(0.0524)
        coefficient = (ahead * np.sin(alpha) - down * np.cos(alpha)) / pressure
        columns = np.column_stack([np.ones(len(alpha)), speed / 104.67, alpha])
        return np.linalg.lstsq(columns, coefficient, rcond=None)[0]

    published = np.array([-0.0929113, 0.148726, 4.32785])
    apart = {
        "smoothed": np.abs(lift(path.alpha, path.V, path.inputs) - published),
        "steady": np.abs(lift(steady.alpha, steady.V, steady.inputs) - published),
        "sensors": np.abs(lift(data[:, 5], data[:, 4], data[:, [9, 11, 10]]) - published),
    }
    assert np.all(apart["smoothed"] < apart["sensors"])
    assert np.all(apart["smoothed"] < apart["steady"])
    assert apart["smoothed"][2] < 0.02 * published[2]


def test_attas_in_calm_air(measured):
    """Gusts of at most .3 m/s; innovations of the air data far whiter than the residuals; what no
    gust explains (altitude, the bank angle of the bank-to-bank record) is trusted no further than
    its slow part."""
    records = [attas(measured(f"attas/fAttas{name}.mat")) for name in ("Elv1", "Ail1", "Rud1")]
    result = reconstruct(records, ATTAS_BIASES)
    for record, steady in zip(records, result.paths, strict=True):
        smoothed = smooth_flight(result, record.flight)
        entry = smoothed.paths[0]
        assert max(smoothed.intensities.gusts.horizontal, smoothed.intensities.gusts.vertical) < 0.3
        for name in ("V", "alpha", "beta"):
            assert alike(entry.innovations[name][10:]) < 0.5 < 0.8 < alike(steady.residuals[name])
        assert rms(entry.path.alpha - steady.alpha) < np.deg2rad(0.15)
        assert entry.intensities.noise["altitude"] > 5 * np.std(np.diff(record.outputs["altitude"]))
        assert entry.sigma["theta"].max() < np.deg2rad(0.1)
        if record.name == "fAttasAil1":
            assert smoothed.intensities.noise["phi"] > np.nanstd(steady.residuals["phi"])
