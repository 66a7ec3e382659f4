"""A wake that parts feel at their own places: forces of strips written here anew."""

import numpy as np
import pytest

from aerodb.errors import InputError
from aerodb.exchange import in_wake, read_native
from aerodb.physics import Core, VortexPair

SPAN, CHORD, RHO = 12.0, 1.5, 1.1
#: A rectangular wing with dihedral and a fin, on datum's origin.
TEXT = """
name = "wing and fin"
[reference]
area = 18.0
chord = 1.5
span = 12.0
moment_reference = [0.2, 0.0, 0.1]
[parts.wing]
kind = "surface"
root = [0.0, 0.0, 0.0]
tip = [-0.4, 6.0, -0.5]
root_chord = 1.5
strips = {strips}
lift = "5*alpha"
drag = "0.02"
mirror = true
[parts.fin]
kind = "section"
position = [-5.0, 0.0, -0.8]
area = 1.2
dihedral = "90 deg"
lift = "3*alpha"
"""
CORES: tuple[Core, ...] = ("lamb_oseen", "burnham_hallock")


def _pair(core: Core) -> VortexPair:
    return VortexPair(210.0, 1.3, 16.0, (30.0, -4.0, 998.5), np.deg2rad(35.0), 0.04, core)


def _body_to_earth(phi: float, theta: float, psi: float) -> np.ndarray:
    c, s = np.cos, np.sin
    roll = np.array([[1, 0, 0], [0, c(phi), -s(phi)], [0, s(phi), c(phi)]])
    pitch = np.array([[c(theta), 0, s(theta)], [0, 1, 0], [-s(theta), 0, c(theta)]])
    yaw = np.array([[c(psi), -s(psi), 0], [s(psi), c(psi), 0], [0, 0, 1]])
    return yaw @ pitch @ roll


def _air(pair: VortexPair, north_east_down: np.ndarray) -> np.ndarray:
    """Velocity of the air, by vectors alone: circulation times axis cross distance."""
    axis = np.array([
        np.cos(pair.heading) * np.cos(pair.slope), np.sin(pair.heading) * np.cos(pair.slope), -np.sin(pair.slope),
    ])  # fmt: skip
    right = np.array([-np.sin(pair.heading), np.cos(pair.heading), 0.0])
    n, e, up = pair.place
    total = np.zeros(3)
    for side in (-1.0, 1.0):
        away = north_east_down - np.array([n, e, -up]) - 0.5 * side * pair.spacing * right
        away = away - (away @ axis) * axis
        r = np.linalg.norm(away)
        if pair.core == "lamb_oseen":
            swirl = (
                pair.circulation
                / (2 * np.pi * r)
                * (1 - np.exp(-1.2544 * (r / pair.core_radius) ** 2))
            )
        else:
            swirl = pair.circulation / (2 * np.pi) * r / (pair.core_radius**2 + r**2)
        total += -side * swirl * np.cross(axis, away / r)
    return total


@pytest.mark.parametrize("core", CORES)
def test_loads_of_strips_are_those_of_the_air_at_their_places(core: Core) -> None:
    """Forces and moments of each strip and of the fin in a pair, by vectors; V, alpha and beta hold
    the air at the moment reference."""
    pair, strips = _pair(core), 6
    database = in_wake(read_native(TEXT.format(strips=strips), "file"), pair)
    rng = np.random.default_rng(7)
    for _ in range(6):
        phi, theta, psi = rng.uniform(-0.6, 0.6, 3)
        rates = rng.uniform(-0.3, 0.3, 3)
        speed, alpha, beta = rng.uniform(50, 70), rng.uniform(-0.05, 0.15), rng.uniform(-0.1, 0.1)
        place = np.array([30.0, -4.0, -998.5]) + rng.uniform(-9.0, 9.0, 3)
        turn = _body_to_earth(phi, theta, psi)
        here = speed * np.array(
            [np.cos(alpha) * np.cos(beta), np.sin(beta), np.sin(alpha) * np.cos(beta)]
        )
        force, moment = np.zeros(3), np.zeros(3)
        root, tip = np.zeros(3), np.array([-0.4, 6.0, -0.5])
        panels = []
        for side in (1.0, -1.0):
            flip = np.array([1.0, side, 1.0])
            across = (tip - root) * flip * np.array([0, 1, 1]) * side  # to the right
            span = tip * flip * side
            y = span / np.linalg.norm(span)
            z = np.cross([1.0, 0, 0], across / np.linalg.norm(across))
            panels += [
                (
                    (k + 0.5) / strips * tip * flip,
                    np.cross(y, z),
                    z,
                    CHORD * np.linalg.norm(across) / strips,
                    5.0,
                    0.02,
                )
                for k in range(strips)
            ]
        panels.append(
            (
                np.array([-5.0, 0.0, -0.8]),
                np.array([1.0, 0, 0]),
                np.array([0, 1.0, 0]),
                1.2,
                3.0,
                0.0,
            )
        )
        for position, x, z, area, slope, drag in panels:
            arm = position - np.array([0.2, 0.0, 0.1])
            blown = turn.T @ (_air(pair, place + turn @ arm) - _air(pair, place))
            local = here + np.cross(rates, arm) - blown
            u, w = local @ x, local @ z
            size, lift = np.hypot(u, w), slope * np.arctan2(w, u)
            own = 0.5 * RHO * area * size * ((lift * w - drag * u) * x - (lift * u + drag * w) * z)
            force, moment = force + own, moment + np.cross(arm, own)
        channels = {
            "V": speed, "alpha": alpha, "beta": beta, "p": rates[0], "q": rates[1], "r": rates[2], "rho": RHO,
            "qbar": 0.5 * RHO * speed**2, "phi": phi, "theta": theta, "psi": psi,
            "north": place[0], "east": place[1], "altitude": -place[2],
        }  # fmt: skip
        found = database.predict(
            {name: np.array([value]) for name, value in channels.items()}
        ).coefficients
        scale = 0.5 * RHO * speed**2 * 18.0
        expected = [*(force / scale), *(moment / scale / np.array([12.0, 1.5, 12.0]))]
        got = [found[axis][0] for axis in ("CX", "CY", "CZ", "Cl", "Cm", "Cn")]
        assert got == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_without_circulation_nothing_changes() -> None:
    plain = read_native(TEXT.format(strips=4), "file")
    pair = VortexPair(0.0, 1.3, 16.0, (30.0, -4.0, 998.5), 0.4)
    channels = {
        name: np.array([value])
        for name, value in {
            "V": 60.0, "alpha": 0.05, "beta": 0.02, "p": 0.1, "q": 0.0, "r": 0.0, "rho": RHO, "qbar": 1980.0,
            "phi": 0.1, "theta": 0.1, "psi": 0.5, "north": 28.0, "east": -3.0, "altitude": 999.0,
        }.items()
    }  # fmt: skip
    inside, outside = (
        each.predict(channels).coefficients for each in (in_wake(plain, pair), plain)
    )
    for axis in outside:
        assert inside[axis] == pytest.approx(outside[axis], abs=1e-14)


def test_a_second_wake_and_a_mirrored_one_are_refused() -> None:
    wake = '[parts.{}]\nkind = "wake"\ncirculation = 200\ncore_radius = 1\nspacing = 16\npoint = [0, 0, 0]\nheading = 0\n'
    text = TEXT.format(strips=4)
    with pytest.raises(InputError, match="a second wake"):
        read_native(text + wake.format("one") + wake.format("two"), "file")
    with pytest.raises(InputError, match="a wake with mirror or load"):
        read_native(text + wake.format("one") + "mirror = true\n", "file")
