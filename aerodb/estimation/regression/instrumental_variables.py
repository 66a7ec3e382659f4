"""Linear equations whose regressors are noisy or driven by feedback, solved with instruments:
series that move the regressors and are independent of the noise, such as commands."""

from collections.abc import Collection, Mapping
from typing import Final

import numpy as np

from aerodb.errors import InputError, nearest
from aerodb.estimation.coloured_noise import autoregressive_noise
from aerodb.estimation.fit import Fit, Standing
from aerodb.estimation.regression.equation_error import (
    Reduced,
    Standings,
    answer,
    reduced,
    whitened,
)
from aerodb.estimation.regression.linear_equation import LinearEquation
from aerodb.support import Array, Mask

#: F of the first stage below which instruments are weak (Staiger & Stock, Econometrica 65(3),
#: 1997).
WEAK: Final = 10.0
#: Samples by which a regressor is late where it is its own instrument; twice that, too.
LAG: Final = 1


def instrumental_variables(
    equation: LinearEquation,
    *,
    instruments: Mapping[str, Array] | None = None,
    noisy: Collection[str] | None = None,
    lag: int = LAG,
) -> Fit:
    """Two-stage least squares.

    Noisy regressors are replaced by what the instruments and the other regressors predict of them.

    Parameters
    ----------
    instruments : record -> series (n, m) that are independent of the noise, such as commands and
        their past; None: the noisy regressors themselves, `lag` and twice `lag` samples earlier,
        which is right where their noise is white.
    noisy : parameters whose regressors are noisy; None: all that are no constant and no deflection
        (``delta`` in their name).

    References
    ----------
    Theil, Repeated Least Squares applied to Complete Equation Systems, 1953. Young, Automatica
    6(2), 1970. Strength of instruments: Shea, Review of Economics and Statistics 79(2), 1997.

    Priors and bounds are not used. Raises InputError for unknown names, instruments of another
    length, and too few of them.
    """
    problem = reduced(equation)
    chosen = _noisy(problem, noisy)
    excited = problem.excited
    series, keep = _instruments(problem, equation, instruments, chosen, lag)
    x, y = problem.columns[keep][:, excited], problem.response[keep]
    clean = problem.columns[keep][:, excited & ~chosen]
    z = np.column_stack([clean, series[keep]])
    if z.shape[1] < x.shape[1]:
        raise InputError(
            f"{series.shape[1]} instruments cannot replace {int((excited & chosen).sum())}"
            " regressors",
            f"equation of {equation.response}",
            "give more instruments, such as the commands and their past",
        )
    left, singular, _ = np.linalg.svd(z / np.maximum(np.linalg.norm(z, axis=0), 1e-300), False)
    base = left[:, singular > 1e-9 * singular[0]]
    scale = np.linalg.norm(x, axis=0)
    predicted = base @ (base.T @ (x / scale))
    product = predicted.T @ predicted
    if np.linalg.matrix_rank(product) < len(product):
        raise InputError(
            "the instruments do not move every noisy regressor on its own",
            f"equation of {equation.response}",
            "give instruments that do, or leave out a term",
        )
    inverse = np.linalg.inv(product)
    found = inverse @ (predicted.T @ y)
    values = np.zeros(len(excited))
    values[excited] = found / scale
    lengths = [int(block.sum()) for block in problem.blocks(keep.astype(float))]
    shorter = Reduced(
        problem.equation, problem.unknown, problem.mix, problem.known,
        problem.columns[keep], y, tuple(lengths),
    )  # fmt: skip
    noise = shorter.noise(values)
    covariance = np.zeros((len(excited),) * 2)
    covariance[np.ix_(excited, excited)] = (
        inverse @ whitened(shorter, predicted, noise, x.shape[1]) @ inverse
    ) / np.outer(scale, scale)
    spread = len(base.T) - clean.shape[1]
    strength = _strength(shorter, x / scale, inverse, predicted, spread)
    return answer(
        "instrumental-variables",
        problem,
        values,
        covariance,
        noise,
        x.shape[1],
        standings=_standings(problem, excited, chosen, strength),
        assumes=(
            "Instruments are independent of the noise of regressors and response.",
            "Deflections and constants are free of noise.",
        ),
        notes=tuple(
            f"{problem.names[k]}: F {strength[j]:.0f} of its instruments."
            for j, k in enumerate(np.flatnonzero(excited))
            if chosen[k]
        ),
    )


def _noisy(problem: Reduced, names: Collection[str] | None) -> Mask:
    if names is None:
        still = np.ptp(problem.columns, axis=0) == 0.0
        named = np.array(["delta" in name for name in problem.names])
        steady = np.array(
            [len(np.unique(column)) <= len(problem.lengths) for column in problem.columns.T]
        )
        return ~still & ~named & ~steady
    for name in names:
        if name not in problem.names:
            raise InputError(
                f"no unknown parameter '{name}'", "noisy", nearest(name, problem.names)
            )
    return np.array([name in names for name in problem.names])


def _instruments(
    problem: Reduced,
    equation: LinearEquation,
    given: Mapping[str, Array] | None,
    chosen: Mask,
    lag: int,
) -> tuple[Array, Mask]:
    """Instruments (n, m), and which samples have them."""
    if given is None:
        if lag < 1:
            raise InputError("the lag of instruments is at least one sample", "lag")
        pieces, keeps = [], []
        for block in problem.blocks(problem.columns[:, chosen]):
            pieces.append(np.column_stack([np.roll(block, lag, 0), np.roll(block, 2 * lag, 0)]))
            keeps.append(np.arange(len(block)) >= 2 * lag)
        return np.concatenate(pieces), np.concatenate(keeps)
    pieces = []
    for record in equation.records:
        if record.name not in given or len(given[record.name]) != len(record.time):
            raise InputError(
                f"instruments need {len(record.time)} samples", f"record {record.name}"
            )
        pieces.append(np.asarray(given[record.name], dtype=float).reshape(len(record.time), -1))
    return np.concatenate(pieces), np.ones(len(problem.response), dtype=bool)


def _strength(problem: Reduced, x: Array, inverse: Array, predicted: Array, spread: int) -> Array:
    """F (e,) of the instruments of each regressor, on independent samples: Shea's partial R2."""
    part = np.clip(np.diag(np.linalg.inv(x.T @ x)) / np.diag(inverse), 0.0, 1.0)
    strength = np.zeros(len(part))
    for k, share in enumerate(part):
        rest = x[:, k] - predicted[:, k]
        if share >= 1.0 or not rest.any():
            strength[k] = np.inf
            continue
        independent = autoregressive_noise(problem.blocks(rest)).independent
        strength[k] = share / (1.0 - share) * max(independent - x.shape[1], 1.0) / max(spread, 1)
    return strength


def _standings(problem: Reduced, excited: Mask, chosen: Mask, strength: Array) -> Standings:
    standings: dict[str, tuple[Standing, str]] = {}
    for j, k in enumerate(np.flatnonzero(excited)):
        if chosen[k] and strength[j] < WEAK:
            standings[problem.names[k]] = (
                "not identifiable",
                f"its instruments are weak: F {strength[j]:.1f}, at least {WEAK:g} is needed; give"
                " commands that move it",
            )
    for k in np.flatnonzero(~excited):
        standings[problem.names[k]] = ("not excited", "its regressor stands still")
    return standings
