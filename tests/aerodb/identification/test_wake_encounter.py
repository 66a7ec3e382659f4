"""A vortex pair identified from the air along a path: written here anew, flown by 200 strips."""

from collections.abc import Callable

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.identification import WakeEncounter, identify_wake
from aerodb.physics import Turbulence, VortexPair, gust_series

STEP, SPEED, SPAN = 0.01, 60.0, 12.0
G, RC, B = 200.0, 1.5, 17.0


def _swirl(core: str, r: np.ndarray) -> np.ndarray:
    r = np.maximum(r, 1e-9)
    if core == "lamb_oseen":
        return G / (2 * np.pi * r) * (1 - np.exp(-1.2544 * (r / RC) ** 2))
    return G / (2 * np.pi) * r / (RC**2 + r**2)


def _wake(core: str) -> Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """East and down velocity of a pair along north, at east y and z below it."""

    def air(y: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        east, down = np.zeros_like(y), np.zeros_like(y)
        for side in (-1.0, 1.0):
            dy = y - side * B / 2
            r = np.hypot(dy, z)
            over = side * _swirl(core, r) / np.maximum(r, 1e-9)
            east, down = east + over * z, down - over * dy
        return east, down

    return air


def _flown(
    core: str, angle: float, start: tuple[float, float], seconds: float
) -> tuple[np.ndarray, np.ndarray]:
    """Path of a wing of 200 strips (2D lift slope 5, elliptic, 3000 kg) that rolls and heaves in
    the wake, and the air at its nose: Euler steps of a fifth of the samples."""
    air = _wake(core)
    y = (np.arange(200) + 0.5) / 200 * SPAN - SPAN / 2
    chord = 2.0 * np.sqrt(1 - (2 * y / SPAN) ** 2)
    width = SPAN / 200
    heave, bank, roll, z = 0.0, 0.0, 0.0, start[1]
    path, seen = [], []
    for k in range(int(seconds / STEP) * 5):
        t = k * STEP / 5
        x = SPEED * np.cos(angle) * (t - seconds / 2)
        east = start[0] + SPEED * np.sin(angle) * (t - seconds / 2)
        at_y = east + y * np.cos(bank) * np.cos(angle)
        at_z = z + y * np.sin(bank)
        _, down = air(at_y, at_z)
        lift = 0.5 * 1.1 * SPEED * 5.0 * chord * (heave - down + roll * y) * width
        heave += -lift.sum() / 3000.0 * STEP / 5
        roll += -np.sum(lift * y) / 9000.0 * STEP / 5
        bank += (roll - bank / 2.0) * STEP / 5
        z += heave * STEP / 5
        if k % 5 == 0:
            path.append((x, east, 1000.0 - z))
            e, d = air(np.array([east]), np.array([z]))
            seen.append((0.0, e[0], d[0]))
    return np.array(seen).T, np.array(path).T


def _measured(air: np.ndarray, seed: int, sigma: float = 0.3) -> np.ndarray:
    """With wind, Dryden's turbulence and the noise of vanes."""
    time = STEP * np.arange(air.shape[1])
    gusts = gust_series(Turbulence("dryden", (300.0,) * 3, (sigma,) * 3), time, SPEED, SPAN, seed)
    noise = 0.05 * np.random.default_rng([seed, 1]).standard_normal(air.shape)
    wind = np.array([[3.0], [-2.0], [0.0]])
    return air + wind + np.stack([gusts[f"gust_{name}"] for name in "uvw"]) + noise


def _recovered(found: WakeEncounter, core: str) -> None:
    assert found.found
    assert found.pair.circulation == pytest.approx(G, rel=0.1)
    assert found.pair.core_radius == pytest.approx(RC, rel=0.1)
    assert found.pair.spacing == pytest.approx(B, rel=0.1)
    assert found.pair.core == core
    assert found.core == core


@pytest.mark.parametrize("core", ["lamb_oseen", "burnham_hallock"])
@pytest.mark.parametrize(
    ("angle", "start", "seconds"), [(60.0, (0.0, 0.5), 4.0), (15.0, (0.0, 0.6), 8.0)]
)
def test_a_pair_that_is_crossed_is_recovered(
    core: str, angle: float, start: tuple[float, float], seconds: float
) -> None:
    """Circulation, core radius and spacing within 10 %, and the model is named."""
    air, path = _flown(core, np.deg2rad(angle), start, seconds)
    _recovered(identify_wake(_measured(air, 1), path), core)


@pytest.mark.parametrize("core", ["lamb_oseen", "burnham_hallock"])
def test_a_pair_that_is_followed_is_recovered(core: str) -> None:
    """Over 8 s at 3 deg to the axis, across both vortices, while the air between them sinks it by
    18 m; with its heading known and without."""
    air, path = _flown(core, np.deg2rad(3.0), (0.0, 0.8), 8.0)
    for heading in (0.0, None):
        _recovered(identify_wake(_measured(air, 1, 0.1), path, heading=heading), core)


def _body(angle: float, n: int) -> np.ndarray:
    """Body axes forward, right, down of a level flight that banks from side to side."""
    bank = 0.3 * np.sin(1.5 * STEP * np.arange(n))
    zero = 0.0 * bank
    forward = np.stack([np.cos(angle) + zero, np.sin(angle) + zero, zero])
    flat = np.stack([-np.sin(angle) + zero, np.cos(angle) + zero, zero])
    below = np.stack([zero, zero, 1.0 + zero])
    right = np.cos(bank) * flat + np.sin(bank) * below
    return np.stack([forward, right, np.cos(bank) * below - np.sin(bank) * flat])


@pytest.mark.parametrize("core", ["lamb_oseen", "burnham_hallock"])
@pytest.mark.parametrize("seen", [2, 1])
@pytest.mark.parametrize(("angle", "seconds"), [(60.0, 4.0), (15.0, 8.0)])
def test_one_vane_tells_of_a_pair_whose_heading_is_known(
    core: str, seen: int, angle: float, seconds: float, trials: Callable[[int, int], int]
) -> None:
    """Alpha alone, or beta, of an aircraft that banks: within 10 % and four standard errors."""
    air, path = _flown(core, np.deg2rad(angle), (0.0, 0.6), seconds)
    for seed in range(trials(2, 10)):
        moved = _measured(air, seed)
        axes = _body(np.deg2rad(angle), moved.shape[1])[[seen]]
        found = identify_wake(moved, path, axes=axes, heading=0.0)
        _recovered(found, core)
        for name, true in (("circulation", G), ("core_radius", RC), ("spacing", B)):
            assert abs(getattr(found.pair, name) - true) < 4.0 * found.errors[name]


def test_the_slope_of_an_axis_has_the_sign_of_its_heading() -> None:
    """Seen from ahead, an axis that climbs sinks; a pair given with either heading is the same."""
    time = STEP * np.arange(400)
    path = np.stack([SPEED * (time - 2.0) * 0.9, SPEED * (time - 2.0) * 0.43, 1000.5 + 0.0 * time])
    for heading, slope in ((np.deg2rad(3.0), 0.06), (np.deg2rad(177.0), -0.06)):
        pair = VortexPair(G, RC, B, (0.0, 0.0, 1000.0), heading, slope)
        found = identify_wake(_measured(pair.velocity(path), 3, 0.1), path).pair
        turned = found.heading - heading
        opposite = abs(turned) > 0.5 * np.pi
        assert abs(np.sin(turned)) < 0.05
        assert found.slope == pytest.approx(-slope if opposite else slope, abs=0.02)


def test_far_from_the_cores_neither_model_is_named() -> None:
    air, path = _flown("lamb_oseen", np.deg2rad(60.0), (0.0, 9.0), 4.0)
    found = identify_wake(_measured(air, 1), path)
    assert found.found
    assert found.pair.circulation == pytest.approx(G, rel=0.15)
    assert found.nearest > 2.0 * RC
    assert found.core == ""


def _claims(seeds: range, vane: int | None = None) -> int:
    time = np.arange(500) * 0.02
    path = np.stack([SPEED * time, 0 * time, 0 * time + 1000.0])
    count = 0
    for seed in seeds:
        air = Turbulence("dryden", (300.0,) * 3, (1.0,) * 3)
        gusts = gust_series(air, time, SPEED, SPAN, seed)
        noise = 0.05 * np.random.default_rng([seed, 1]).standard_normal((3, 500))
        moved = np.stack([gusts[f"gust_{name}"] for name in "uvw"]) + noise
        axes = None if vane is None else _body(0.0, 500)[[vane]]
        count += identify_wake(moved, path, axes=axes).found
    return count


def test_turbulence_alone_is_no_wake() -> None:
    assert _claims(range(4)) == 0
    assert _claims(range(2), 2) == 0


@pytest.mark.campaign
def test_of_100_flights_in_turbulence_5_at_most_show_a_wake() -> None:
    assert _claims(range(100)) <= 5
    assert _claims(range(100), 2) <= 5


def test_too_short_an_encounter_is_refused() -> None:
    with pytest.raises(InputError, match="needs 60"):
        identify_wake(np.zeros((3, 20)), np.zeros((3, 20)))
