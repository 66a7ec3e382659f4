"""White noise of logged deflections: its size, and what it takes from a fit.

Noise of a deflection draws its effectiveness towards zero, and changes what moves with it (Fuller,
*Measurement Error Models*, 1987, section 2.2). The size of white noise shows in differences of the
log. The same noise added once more changes the normal equations once more by as much (Cook &
Stefanski, JASA 89, 1994): what it changes is taken off. Noise of both signs leaves nothing of first
order, and signs drawn for each sample leave no products of two deflections.
"""

from collections.abc import Callable, Mapping
from math import comb
from typing import Final

import numpy as np

from aerodb.support import Array

#: How names of deflections begin.
_DEFLECTION: Final = "delta_"
#: Highest order of the differences in which noise is looked for.
_ORDERS: Final = 6
#: Noise, as a part of a deflection's range, below which it is left: 1e-5 of an effect.
_LEAST: Final = 1e-3
#: Least part of what the deflections tell that must be no noise, as for regressors of
#: `aerodb.estimation.total_least_squares`.
_RELIABLE: Final = 0.3

#: Noise that moves no estimate by more than this, in standard errors for white noise, is left.
_SMALL: Final = 0.1
#: Move of an estimate, in the same unit, from which it is told.
_TOLD: Final = 0.5

#: Information (f, f) and gradient (f,) of a log-likelihood.
Equations = tuple[Array, Array]


def moved_by_noise(
    noisier: Callable[[int], tuple[Equations, Equations] | None],
    information: Array,
    gradient: Array,
    directions_of: Callable[[Array], Array],
    draws: int,
) -> Array | None:
    """Return by how much noise of deflections has moved f estimates on average (f,), in their
    units; None where that is little, or where what flies it has no end.

    The same noise once more, drawn several times with both signs, tells it: each draw is one
    Gauss-Newton step, so that initial states take up what they can, as they did of the noise that
    is there (Cook & Stefanski, JASA 89, 1994).

    Parameters
    ----------
    noisier : number of a draw -> equations with its noise once more, of both signs; None without
        noise. information, gradient : at the estimates.
    directions_of : information -> directions (f, j) in which the estimates can move, of unit length
        in standard errors.
    draws : how many.

    Raises ValueError where noise is most of what moves the deflections.
    """
    directions = directions_of(information)
    sigma = np.linalg.norm(directions, axis=1)
    moves, more = list[Array](), np.zeros_like(information)
    for draw in range(draws):
        sides = noisier(draw)
        if sides is None or not all(np.isfinite(own).all() for own, _ in sides):
            return None
        for own, score in sides:
            turned = directions_of(own)
            moves.append(turned @ (turned.T @ (score - gradient)))
            more += (own - information) / (2 * draws)
        if not draw and np.all(np.abs(moves) <= _SMALL * sigma):
            return None
    told_without_noise(directions, more)
    return np.asarray(np.mean(moves, axis=0))


def told_of_move(move: Array, directions: Array) -> tuple[str, ...]:
    """Return a sentence on a move (f,) that is worth it, with the directions of `moved_by_noise`,
    both in the units of the estimates."""
    sigma = np.linalg.norm(directions, axis=1)
    most = float(np.max(np.abs(move) / np.where(sigma > 0.0, sigma, np.inf), initial=0.0))
    told = f"Noise of deflections moved estimates by up to {most:.1f} standard errors: taken off."
    return (told,) if most > _TOLD else ()


def deflection_noise(channels: Mapping[str, Array]) -> dict[str, float]:
    """Return one sigma of the white noise of each deflection among the channels (n,), in its unit;
    those without noise are absent.

    The least that differences of order one to six show, by their median: a deflection that moves
    slowly for its rate leaves little in the higher orders, and steps leave little in the median
    (variate differences: Tintner, 1940).
    """
    found = {}
    for name, values in channels.items():
        if name.startswith(_DEFLECTION) and len(values) > 2 * _ORDERS and np.isfinite(values).all():
            sizes = [
                float(np.median(np.abs(np.diff(values, order)))) / comb(2 * order, order) ** 0.5
                for order in range(1, _ORDERS + 1)
            ]
            if (sigma := 1.4826 * min(sizes)) > _LEAST * np.ptp(values):
                found[name] = sigma
    return found


def with_noise_once_more(
    channels: Mapping[str, Array], record: str, draw: int = 0
) -> tuple[dict[str, Array], dict[str, Array]] | None:
    """Return the channels (n,) with the noise of their deflections once more, with both signs; None
    where they have none. A record has the same signs every time, and others in another draw."""
    if not (noise := deflection_noise(channels)):
        return None
    seed = int.from_bytes(record.encode()[:8].ljust(8, b"0"), "big")
    generator = np.random.default_rng(seed + draw)
    added = {
        name: sigma * generator.choice((-1.0, 1.0), len(channels[name]))
        for name, sigma in noise.items()
    }
    above = {name: channels[name] + error for name, error in added.items()}
    below = {name: channels[name] - error for name, error in added.items()}
    return {**channels, **above}, {**channels, **below}


def noise_alone(product: Array, more: Array) -> Array:
    """Return which of k unknowns noise of the deflections moves and little else: (k,) of bool.

    product, more : diagonal (k,) of the normal matrix, and what the noise once more adds to it.
    """
    return np.asarray(more > (1.0 - _RELIABLE) * product)


def told_without_noise(directions: Array, more: Array) -> Array:
    """Return what the deflections tell without their noise, as a share (j, j) of what they tell.

    directions : (k, j) in which k estimates can move, of unit length in standard errors.
    more : what the noise once more adds to the normal matrix (k, k).

    Raises ValueError where noise is most of what moves the deflections.
    """
    left = np.eye(directions.shape[1]) - directions.T @ more @ directions
    if np.linalg.eigvalsh(left).min(initial=1.0) < _RELIABLE:
        raise ValueError("noise of the deflections is most of what moves them")
    return np.asarray(left)
