"""Aileron and rudder exchanged, by the database's effects of both about roll and yaw.

About each axis the database says how much of the moment is the aileron's and how much the rudder's.
With the two channels exchanged it predicts another history of the same size, and the flight shows
which of the two was flown: the ratio of likelihoods, with the samples that are independent in the
residual (Klein & Morelli, Aircraft System Identification, 2006, chapter 5). Motion may have
derivatives of any size.
"""

from collections.abc import Mapping

import numpy as np

from aerodb.conditioning import Suspicion
from aerodb.estimation import Regression, least_squares, samples_per_independent
from aerodb.flight import Flight
from aerodb.nomenclature import is_surface
from aerodb.support import Array
from aerodb.suspicions.derivatives import AxisShares, whole_surface
from aerodb.suspicions.evidence import LIKELIER, RATIOS
from aerodb.suspicions.surfaces import role_of


def exchanged_suspicions(axes: Mapping[str, AxisShares], flight: Flight) -> list[Suspicion]:
    """Return an aileron and a rudder whose histories fit the moments better as the other's.

    Of aircraft with one control of each role.

    Histories are (n,), ratios dimensionless. Source: `docs/method/consistency.md`, section "Against
    the database".
    """
    told = {a: each for a in ("Cl", "Cn") if a in axes and (each := _told(axes[a], flight))}
    if not told:
        return []
    likelier = sum(each[0] for each in told.values())
    ratio = max(told.values(), key=lambda each: each[0])[1]
    if not (likelier > LIKELIER and RATIOS[0] < ratio < RATIOS[1]):
        return []
    aileron, rudder = _names(axes[next(iter(told))], flight)
    words = (
        f"{aileron} fits the {' and '.join(told)} of the database as the rudder and {rudder} as the"
        f" aileron, with {ratio:.3g} times its effect: the two channels are swapped"
    )
    return [Suspicion(aileron, "swapped", words, {"likelier": likelier, "ratio": ratio})]


def _names(axis: AxisShares, flight: Flight) -> tuple[str, ...]:
    """Return the one aileron and the one rudder of an axis; empty where it has not just these."""
    surfaces = [name for name in axis.slopes if is_surface(name)]
    by_role = (
        {whole_surface(name, flight) for name in surfaces if role_of(name) == role}
        for role in ("roll", "yaw")
    )
    return tuple(names.pop() for names in by_role if len(names) == 1)


def _told(axis: AxisShares, flight: Flight) -> tuple[float, float] | None:
    """Return by how much an exchange is likelier on one axis, and the ratio of the controls' effect
    to the database's with it; None where the axis does not tell."""
    names = _names(axis, flight)
    if len(names) != 2:
        return None
    slopes = [
        axis.slopes.get(n, axis.slopes.get(f"{n}_right", 0.0) - axis.slopes.get(f"{n}_left", 0.0))
        for n in names
    ]
    if 0.0 in slopes or not any(name in axis.parts for name in names):
        return None
    still = np.zeros_like(axis.measured)
    moved = [axis.parts.get(n, still) / slope for n, slope in zip(names, slopes, strict=True)]
    as_logged = _fit(axis, names, slopes[0] * moved[0] + slopes[1] * moved[1])
    exchanged = _fit(axis, names, slopes[0] * moved[1] + slopes[1] * moved[0])
    if as_logged is None or exchanged is None:
        return None
    independent = axis.where.sum() / max(1.0, samples_per_independent(exchanged.residual))
    left = [max(1.0 - fit.r_squared, 1e-12) for fit in (as_logged, exchanged)]
    return 0.5 * independent * float(np.log(left[0] / left[1])), float(exchanged.estimates[-1])


def _fit(axis: AxisShares, names: tuple[str, ...], controls: Array) -> Regression | None:
    """Return the regression on the motion and on both controls in the database's proportion."""
    columns = {name: part for name, part in axis.parts.items() if name not in names}
    columns["controls"] = controls
    matrix = np.column_stack([values[axis.where] for values in columns.values()])
    try:
        return least_squares(matrix, axis.measured[axis.where], tuple(columns))
    except ValueError:
        return None
