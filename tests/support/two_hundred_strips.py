"""A small aircraft as a vortex lattice of 200 strips on wing and on tail, and its free flight through a wake.

Body axes from the centre of gravity. The wing has 12 m span, 1.5 m chord, 4 deg dihedral and 2 deg incidence, the tail 3.8
and .9 m, the fin 1.4 and 1 m. AeroSandbox 4.2.10 has for the same surfaces, the loads `AEROSANDBOX`;
it is no dependency, as it brings a compiler of symbolic expressions. References: Katz & Plotkin, Low-Speed Aerodynamics, section 12.3.
"""

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import numpy as np

from tests.support.vortex_lattice import _velocity

Array = np.ndarray
Air = Callable[[Array], Array]
SPEED, RHO, MASS = 60.0, 1.1108, 890.0
#: Velocity, rates, slope of the sinking air over the span [1/s] -> force x, y, z [N] and moments [N m] of AeroSandbox.
AEROSANDBOX = (
    ((59.99086, 0.0, 1.04714), (0.0, 0.0, 0.0), 0.0, (61.93, 0.0, -8700.71, 0.0, -610.85, 0.0)),
    (
        (60.0, 2.0, 3.0),
        (0.1, 0.05, -0.1),
        0.5,
        (527.18, -110.86, -14904.75, 7830.49, -4385.42, 2099.80),
    ),
)
INERTIA = np.array([1300.0, 1800.0, 2700.0])
CG = np.array([-0.05, 0.0, 0.0])
#: Geometry axes (x aft, z up) to body axes.
TO_BODY = np.array([-1.0, 1.0, -1.0])
ALPHA = np.deg2rad(1.0)


class Lattice(NamedTuple):
    """Geometry axes: control points, normals, middles and bound vortices (n, 3); inverse of the influence (n, n), and the
    velocity at the middles (n, n, 3) of unit vortices."""

    control: Array
    normal: Array
    middle: Array
    bound: Array
    inverse: Array
    induced: Array


def _strips(root: Array, tip: Array, chord: float, strips: int, incidence: float) -> list[Array]:
    """Left and right ends of leading and trailing edge of each strip (4, 3), from root (quarter chord) to tip."""
    edge = np.linspace(root, tip, strips + 1) - np.array([0.25 * chord, 0.0, 0.0])
    back = edge + chord * np.array([np.cos(incidence), 0.0, -np.sin(incidence)])
    return [np.array([edge[k], edge[k + 1], back[k], back[k + 1]]) for k in range(strips)]


@cache
def lattice() -> Lattice:
    height = 6.0 * np.tan(np.deg2rad(4.0))
    panels = []
    for root, tip, chord, incidence in (
        (np.zeros(3), np.array([0.0, 6.0, height]), 1.5, np.deg2rad(2.0)),
        (np.array([5.0, 0.0, 0.6]), np.array([5.0, 1.9, 0.6]), 0.9, 0.0),
    ):
        right = _strips(root, tip, chord, 100, incidence)
        flip = np.array([1.0, -1.0, 1.0])
        panels += right + [(each * flip)[[1, 0, 3, 2]] for each in right]
    panels += _strips(np.array([5.0, 0.0, 0.0]), np.array([5.0, 0.0, 1.4]), 1.0, 25, 0.0)
    front_left, front_right, back_left, back_right = np.array(panels).transpose(1, 0, 2)
    left, right = (
        0.75 * front + 0.25 * back
        for front, back in ((front_left, back_left), (front_right, back_right))
    )
    control = 0.125 * (front_left + front_right) + 0.375 * (back_left + back_right)
    normal = np.cross(front_right - back_left, front_left - back_right)
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    middle = 0.5 * (left + right)
    influence = np.einsum("ijk,ik->ij", _velocity(control, left, right), normal)
    return Lattice(
        control, normal, middle, right - left, np.linalg.inv(influence), _velocity(middle, left, right)
    )  # fmt: skip


def loads(velocity: Array, rates: Array, air: Air) -> tuple[Array, Array]:
    """Force [N] and moment about the centre of gravity [N m] at a velocity over the earth [m/s] and rates [rad/s]; air :
    arms (n, 3) [m] -> its velocity there (n, 3) [m/s]; all in body axes."""
    grid = lattice()

    def seen(points: Array) -> Array:
        arm = (points - CG) * TO_BODY
        return (air(arm) - velocity - np.cross(rates, arm)) * TO_BODY

    strength = grid.inverse @ -np.sum(seen(grid.control) * grid.normal, axis=1)
    local = seen(grid.middle) + np.einsum("ijk,j->ik", grid.induced, strength)
    force = RHO * strength[:, None] * np.cross(local, grid.bound)
    moment = np.cross(grid.middle - CG, force)
    return force.sum(axis=0) * TO_BODY, moment.sum(axis=0) * TO_BODY


def to_earth(phi: float, theta: float, psi: float) -> Array:
    """Body axes to north, east, down (3, 3)."""
    c, s = np.cos, np.sin
    roll = np.array([[1, 0, 0], [0, c(phi), -s(phi)], [0, s(phi), c(phi)]])
    pitch = np.array([[c(theta), 0, s(theta)], [0, 1, 0], [-s(theta), 0, c(theta)]])
    yaw = np.array([[c(psi), -s(psi), 0], [s(psi), c(psi), 0], [0, 0, 1]])
    return np.asarray(yaw @ pitch @ roll)


def wake(circulation: float, core_radius: float, spacing: float, core: str) -> Air:
    """Velocity of the air (n, 3) at places (n, 3) north, east, down of a pair along north, by its textbook formula."""

    def air(places: Array) -> Array:
        total = np.zeros_like(places)
        for side in (-1.0, 1.0):
            y, z = places[:, 1] - 0.5 * side * spacing, places[:, 2]
            r = np.maximum(np.hypot(y, z), 1e-9)
            if core == "lamb_oseen":
                swirl = (
                    circulation / (2 * np.pi * r) * (1 - np.exp(-1.2544 * (r / core_radius) ** 2))
                )
            else:
                swirl = circulation / (2 * np.pi) * r / (core_radius**2 + r**2)
            total[:, 1] += side * swirl * z / r
            total[:, 2] -= side * swirl * y / r
        return total

    return air


def through(
    air: Air, angle: float, seconds: float, above: float, step: float = 0.02
) -> dict[str, Array]:
    """Free flight (Runge-Kutta) at an angle [rad] to north that comes to the origin after half the time, `above` [m] it:
    states, and the loads of the lattice. Held near level by moments that are none of the air's."""
    start, begin = (
        np.array([SPEED * np.cos(ALPHA), 0.0, SPEED * np.sin(ALPHA)]),
        np.array([0.0, ALPHA, angle]),
    )
    weight = np.array([0.0, 0.0, 9.80665 * MASS])
    held = loads(start, np.zeros(3), lambda arm: 0.0 * arm)
    thrust = -(held[0] + to_earth(0.0, ALPHA, 0.0).T @ weight)

    def acting(x: Array) -> tuple[Array, Array]:
        turn = to_earth(*x[6:9])
        return loads(x[:3], x[3:6], lambda arm: air(x[9:] + arm @ turn.T) @ turn)

    def rate(x: Array) -> Array:
        (u, w), (phi, theta, _) = (x[:3], x[3:6]), x[6:9]
        force, moment = acting(x)
        level = (
            -np.array([6000.0, 8000.0, 4000.0]) * (x[6:9] - begin)
            - np.array([3000.0, 3000.0, 2000.0]) * w
        )
        turn = to_earth(*x[6:9])
        about = w[1] * np.sin(phi) + w[2] * np.cos(phi)
        return np.concatenate([
            (force + thrust + turn.T @ weight) / MASS - np.cross(w, u),
            (moment - held[1] + level - np.cross(w, INERTIA * w)) / INERTIA,
            [w[0] + np.tan(theta) * about, w[1] * np.cos(phi) - w[2] * np.sin(phi), about / np.cos(theta)],
            turn @ u,
        ])  # fmt: skip

    half = 0.5 * seconds * SPEED
    x = np.concatenate(
        [start, np.zeros(3), begin, [-half * np.cos(angle), -half * np.sin(angle), -above]]
    )
    rows = []
    for _ in range(round(seconds / step)):
        rows.append(np.concatenate([x, *acting(x)]))
        k1 = rate(x)
        k2 = rate(x + 0.5 * step * k1)
        k3 = rate(x + 0.5 * step * k2)
        x = x + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + rate(x + step * k3))
    table = np.array(rows).T
    return {
        "time": step * np.arange(table.shape[1]), "velocity": table[:3], "rates": table[3:6], "attitude": table[6:9],
        "place": table[9:12], "force": table[12:15], "moment": table[15:],
    }  # fmt: skip
