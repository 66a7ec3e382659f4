"""Tests of sideslip without a vane in moving air.

It is computed from the motion and a wind that was estimated from few independent samples; its
intervals must include that.
"""

import numpy as np
import pytest

from aerodb.consistency.corrected import with_gusty_winds
from aerodb.consistency.output_error.reconstruction import reconstruct
from aerodb.consistency.smoother.gusts import Gusts
from aerodb.consistency.whole_flight import Consistent, make_consistent
from aerodb.flight import Flight
from aerodb.signals import rms
from aerodb.support.arrays import Array
from aerodb.vehicle import parse_vehicle
from tests.support.consistent_flights import NAME, VEHICLE
from tests.support.golden import same
from tests.support.moving_air import CHANNELS, FIRST, FREE, WIND, moving_air

NO_BETA = tuple(name for name in CHANNELS if name != "beta")


def _reconstructed(seed: int, strength: float) -> tuple[Consistent, dict[str, Array]]:
    record, true = moving_air(seed, strength, seconds=60.0, channels=NO_BETA)
    inertial = dict(zip(("ax", "ay", "az", "p", "q", "r"), record.inputs.T, strict=True))
    channels = {**inertial, **record.outputs, "rho": record.density}
    time = record.step * np.arange(len(record.inputs))
    return make_consistent(Flight("0" * 64, NAME, time, channels), parse_vehicle(VEHICLE)), true


@pytest.mark.campaign
@pytest.mark.parametrize("strength", [3.0, 8.0], ids=["light", "moderate"])
def test_intervals_of_a_sideslip_without_a_vane_cover_it(
    strength: float,
) -> None:
    """95 % intervals of every sample of sideslip and of wind, gusts included, and those of the mean
    winds, over independent flights in turbulence after Dryden."""
    inside, winds, blown = [], [], []
    for seed in range(60):
        found, true = _reconstructed(seed, strength)
        inside.append(
            np.mean(np.abs(found.flight["beta"] - true["beta"]) < 1.96 * found.sigma["beta"])
        )
        entries = {entry["parameter"]: entry for entry in found.document["estimates"]}
        for name, blowing in zip(("wind_north", "wind_east"), WIND[:2], strict=True):
            winds.append((entries[name]["value"] - blowing) / entries[name]["standard_error"])
            away = np.abs(found.beyond[name] - true[name])
            blown.append(np.mean(away < 1.96 * found.sigma[name]))
    assert 0.91 < np.mean(inside) < 0.98
    assert 0.91 < np.mean(blown) < 0.98
    assert np.sqrt(np.mean(np.square(winds))) < 1.4


def test_one_flight_without_a_vane_is_as_it_always_was() -> None:
    """Moderate turbulence: root mean square errors of sideslip and winds, and those that are stated
    (rad, m/s)."""
    found, true = _reconstructed(0, 8.0)
    shown = {"beta": found.flight["beta"], **found.beyond}
    rows = [
        (name, rms(shown[name] - true[name]), rms(found.sigma[name]))
        for name in ("beta", "wind_north", "wind_east")
    ]
    known = [
        ("beta", 0.0128, 0.0116),
        ("wind_north", 0.637, 0.528),
        ("wind_east", 0.373, 0.396),
    ]
    assert same(rows, known)


def test_the_mean_of_gusts_is_as_uncertain_as_a_gauss_markov_process_makes_it() -> None:
    """Against 400 drawn processes of 40 s; a vane sees both components all the time, without it
    each for half of it."""
    record = moving_air(1, 0.0)[0]
    result = reconstruct([record], FREE, initial=FIRST)
    gusts = Gusts(0.8, 0.5, 2.0, 1.0)
    added = [
        with_gusty_winds(each, gusts)["wind_north[gusty]"].standard_error ** 2
        - each["wind_north[gusty]"].standard_error ** 2
        for each in (
            result,
            reconstruct([moving_air(1, 0.0, channels=NO_BETA)[0]], FREE, initial=FIRST),
        )
    ]
    rng, keep = np.random.default_rng(0), np.exp(-record.step / gusts.horizontal_time)
    drive = (
        gusts.horizontal * np.sqrt(1.0 - keep**2) * rng.standard_normal((len(record.inputs), 400))
    )
    drive[0] = gusts.horizontal * rng.standard_normal(400)
    for k in range(1, len(drive)):
        drive[k] += keep * drive[k - 1]
    assert added[0] == pytest.approx(np.mean(drive.mean(axis=0) ** 2), rel=0.25)
    assert added[1] == pytest.approx(2.0 * added[0])
    calm = with_gusty_winds(result, Gusts(0.0, 0.0, 2.0, 1.0))
    np.testing.assert_array_equal(calm.covariance, result.covariance)
