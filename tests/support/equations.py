"""Linear equations of known truth: what equation-error methods are tried on."""

from collections.abc import Mapping, Sequence

import numpy as np
import scipy.signal

from aerodb.estimation import EquationRecord, LinearEquation, Parameter, Parameters
from aerodb.support import Array

STEP = 0.02


def coloured(rng: np.random.Generator, n: int, pole: float) -> Array:
    """First-order noise (n,) of unit variance, stationary."""
    drive = np.sqrt(1.0 - pole**2) * rng.standard_normal(n + 1000)
    return scipy.signal.lfilter([1.0], [1.0, -pole], drive)[1000:]


def doublet(n: int) -> Array:
    """A doublet (n,) of unit size in the second and third eighth of a record."""
    values, part = np.zeros(n), n // 8
    values[part : 2 * part], values[2 * part : 3 * part] = 1.0, -1.0
    return values


def equation(
    columns: Sequence[Mapping[str, Array]],
    responses: Sequence[Array],
    response: str = "Cm",
    **changed: Parameter,
) -> LinearEquation:
    """An equation of records with columns by name; `changed` replaces parameters by name."""
    names = tuple(columns[0])
    return LinearEquation(
        response,
        Parameters(tuple(changed.get(name, Parameter(name, 0.0)) for name in names)),
        tuple(
            EquationRecord(
                f"r{k}", STEP * np.arange(len(z)), np.column_stack([c[name] for name in names]), z
            )
            for k, (c, z) in enumerate(zip(columns, responses, strict=True))
        ),
    )


def manoeuvre(rng: np.random.Generator, n: int) -> dict[str, Array]:
    """Columns of a manoeuvre: slow response with a doublet, a faster rate, the doublet, and a
    constant."""
    control = doublet(n)
    return {
        "alpha": coloured(rng, n, 0.98) + control,
        "q": coloured(rng, n, 0.95),
        "de": control,
        "1": np.ones(n),
    }
