"""Flights whose channels follow from one motion by differentiation: consistent by construction,
without aerodynamics."""

import numpy as np

from aerodb.flight import Flight
from aerodb.support.arrays import Array

GRAVITY = 9.80665


def waves(
    rng: np.random.Generator, time: Array, size: float, slow: float = 0.08, fast: float = 0.9
) -> Array:
    """A sum of six sines of random frequencies [Hz] and phases, rms about `size`."""
    frequencies, phases = rng.uniform(slow, fast, 6), rng.uniform(0.0, 2.0 * np.pi, 6)
    result: Array = (
        size
        * np.sqrt(2.0 / 6.0)
        * np.sin(2 * np.pi * np.outer(time, frequencies) + phases).sum(axis=1)
    )
    return result


def kinematic_flight(
    seed: int, seconds: float = 40.0, rate: float = 50.0, noise: float = 1.0
) -> Flight:
    """A manoeuvring flight of an aircraft at 60 m/s: air angles, attitude, rates, specific forces,
    altitude; `noise` times usual sensor noise. Side force opposes sideslip and lift grows with
    alpha, as they must."""
    rng = np.random.default_rng(seed)
    fine = np.arange(0.0, seconds, 1.0 / (4.0 * rate))
    dt = fine[1]
    theta, phi, psi = (waves(rng, fine, size, 0.1, 0.6) for size in (0.06, 0.15, 0.05))
    alpha, beta = 0.08 + waves(rng, fine, 0.025, 0.15), waves(rng, fine, 0.02, 0.15)
    speed = 60.0 + waves(rng, fine, 1.5, 0.05, 0.2)

    def dot(values: Array) -> Array:
        return np.asarray(np.gradient(values, dt, edge_order=2))

    p = dot(phi) - np.sin(theta) * dot(psi)
    q = np.cos(phi) * dot(theta) + np.sin(phi) * np.cos(theta) * dot(psi)
    r = np.cos(phi) * np.cos(theta) * dot(psi) - np.sin(phi) * dot(theta)
    u, v, w = (
        speed * np.cos(alpha) * np.cos(beta),
        speed * np.sin(beta),
        speed * np.sin(alpha) * np.cos(beta),
    )
    channels = {
        "V": speed,
        "alpha": alpha,
        "beta": beta,
        "theta": theta,
        "phi": phi,
        "psi": psi,
        "p": p,
        "q": q,
        "r": r,
        "ax": dot(u) + q * w - r * v + GRAVITY * np.sin(theta),
        "ay": dot(v) + r * u - p * w - GRAVITY * np.cos(theta) * np.sin(phi),
        "az": dot(w) + p * v - q * u - GRAVITY * np.cos(theta) * np.cos(phi),
        "qbar": 0.5 * 1.1 * speed**2,
    }
    usual = {
        "V": 0.1,
        "alpha": 1e-3,
        "beta": 1e-3,
        "theta": 5e-4,
        "phi": 5e-4,
        "psi": 5e-4,
        "qbar": 5.0,
    }
    kept = slice(None, None, 4)
    sizes = {name: usual.get(name, 2e-3 if name in "pqr" else 0.03) for name in channels}
    noisy = {
        name: x[kept] + noise * sizes[name] * rng.standard_normal(len(fine[kept]))
        for name, x in channels.items()
    }
    return Flight(f"kinematic-{seed}", "synthetic", fine[kept], noisy)
