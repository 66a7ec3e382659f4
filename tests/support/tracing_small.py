"""A made-up vehicle of two axes with three terms and two sensors: what tracing's parts are tried
on, fast."""

from collections.abc import Mapping

import numpy as np

from aerodb.effects.hypothesis import Hypothesis
from aerodb.tracing.evidence.evidence import Evidence
from aerodb.tracing.settings import TracingSettings
from tests.support.tracing_flights import coloured

STEP = 0.04
SETTINGS = TracingSettings()


def term(name: str, axis: str, plausible: tuple[float, float] = (-50.0, 50.0)) -> Hypothesis:
    """An aerodynamic hypothesis on one axis."""
    return Hypothesis(
        name,
        (axis,),
        axis,
        f"{axis}_{name}",
        "aerodynamic",
        "1",
        plausible,
        None,
        f"{axis} lacks {name}",
    )


def instrument(
    name: str, sigma: float, plausible: tuple[float, float] = (-50.0, 50.0)
) -> Hypothesis:
    """A sensor hypothesis on both axes."""
    return Hypothesis(
        name, ("CX", "CZ"), "", name, "sensor", "1", plausible, sigma, f"{name} reads wrong"
    )


LIBRARY = (
    term("a", "CX"),
    term("b", "CX"),
    term("a", "CZ"),
    instrument("s", 0.5),
    instrument("u", 0.2),
)


def evidence(
    seed: int, values: Mapping[str, float] | None = None, n: int = 1500, name: str = ""
) -> Evidence:
    """One flight of a made-up vehicle: correlated columns on two axes, sensors on both."""
    rng = np.random.default_rng(seed)
    x, y, z = (coloured(rng, n, 0.6) for _ in range(3))
    columns = {
        LIBRARY[0].id: {"CX": x},
        LIBRARY[1].id: {"CX": 0.6 * x + 0.8 * y},
        LIBRARY[2].id: {"CZ": z},
        LIBRARY[3].id: {"CX": 0.5 * x + z, "CZ": 0.7 * z + y},
        LIBRARY[4].id: {"CX": y * y, "CZ": x + 0.3 * z},
    }
    residual = {
        axis: 0.3 * coloured(rng, n, 0.5) + 0.1 * rng.standard_normal() for axis in ("CX", "CZ")
    }
    for key, value in (values or {}).items():
        for axis, column in columns[key].items():
            residual[axis] = residual[axis] + value * column
    usable = {axis: np.ones(n, dtype=bool) for axis in residual}
    return Evidence(name or f"f{seed}", STEP, residual, usable, columns)
