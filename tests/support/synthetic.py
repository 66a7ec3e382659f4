"""Flights and comparisons of known truth, without sensors or equations of motion: what estimators
are tried on."""

from collections.abc import Mapping

import numpy as np

from aerodb.coefficients.comparison import Comparison
from aerodb.exchange.native import read_native
from aerodb.flight import Flight
from aerodb.support.arrays import Array
from aerodb.tables.database import AeroDatabase

RATE = 25.0

DATABASE = """\
name = "baseline"
[reference]
area = 10.0
chord = 2.0
span = 8.0
moment_reference = [0.0, 0.0, 0.0]
[tables.CZ0]
arguments = ["alpha"]
breakpoints = [[-0.2, -0.1, 0.0, 0.1, 0.2, 0.3]]
values = [0.6, 0.3, 0.0, -0.3, -0.6, -0.8]
[[terms]]
name = "lift_curve"
axis = "CZ"
expression = "CZ0(alpha)"
[derivatives.Cl]
beta = -0.1
"""


def database() -> AeroDatabase:
    """A baseline with breakpoints over alpha every 0.1 rad."""
    return read_native(DATABASE)


def smooth_noise(rng: np.random.Generator, n: int, lag: float, size: float = 1.0) -> Array:
    """Coloured noise (n,): white noise through a first-order lag of `lag` s, standard deviation
    `size`."""
    keep = np.exp(-1.0 / (RATE * lag))
    values = np.empty(n)
    values[0] = rng.standard_normal()
    drive = np.sqrt(1.0 - keep**2) * rng.standard_normal(n)
    for k in range(1, n):
        values[k] = keep * values[k - 1] + drive[k]
    return size * values


def flight(rng: np.random.Generator, name: str = "f", seconds: float = 40.0) -> Flight:
    """A flight that moves everything: alpha from about 0 to 0.25 rad, rates, two surfaces; V = 70
    m/s."""
    n = round(seconds * RATE)
    channels = {
        "V": np.full(n, 70.0),
        "alpha": 0.12 + smooth_noise(rng, n, 0.8, 0.05),
        "beta": smooth_noise(rng, n, 0.8, 0.04),
        "p": smooth_noise(rng, n, 0.5, 0.3),
        "q": smooth_noise(rng, n, 0.5, 0.15),
        "r": smooth_noise(rng, n, 0.5, 0.1),
        "delta_elevator": smooth_noise(rng, n, 0.5, 0.05),
        "delta_flap": smooth_noise(rng, n, 1.0, 0.1),
    }
    return Flight(name, "synthetic", np.arange(n) / RATE, channels)


def comparison(flown: Flight, residual: Mapping[str, Array], sigma: float = 0.01) -> Comparison:
    """A comparison whose residual on each axis is what is given; measured is the residual,
    predicted zero."""
    n = len(flown.time)
    return Comparison(
        flight=flown.id,
        time=flown.time,
        measured=dict(residual),
        sigma={axis: np.full(n, sigma) for axis in residual},
        predicted={axis: np.zeros(n) for axis in residual},
        usable={axis: np.ones(n, dtype=bool) for axis in residual},
        outside=np.zeros(n, dtype=bool),
        bandwidth=None,
        notes=(),
    )
