"""Spline terms of the model file as expressions, which an increment keeps.

Linear splines are sums of `clip`, so that they fold into tables exactly; cubic ones act as a layer.
"""

import re
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation import SplineKind, piecewise_polynomials
from aerodb.nomenclature import CHANNELS
from aerodb.tables import number
from aerodb.units import conversion

#: In place of knots: they are chosen from the flights.
CHOSEN: Final = "chosen"
#: Between the term and the variable of a key of `knots`.
OVER: Final = " over "
_TEXT: Final = re.compile(r"\s*\[?(?P<numbers>[-+0-9.eE,\s]+?)\]?\s*(?P<unit>[A-Za-z/][\w/ ]*)?\s*")


def split_key(key: str) -> tuple[str, str]:
    """Return term and variable of a key of `knots` (docs/reference/conventions.md, section Model
    file).

    >>> split_key("alpha"), split_key("delta_elevator over alpha")
    (('alpha', 'alpha'), ('delta_elevator', 'alpha'))
    """
    term, over, variable = key.partition(OVER)
    return (term, variable) if over else (key, key)


def knots_from_text(key: str, given: Any) -> Any:
    """Return knots in SI units from text with a unit, such as ``"1, 5, 9, 11, 13, 16 deg"``; other
    values are returned as they are, and none for those to be chosen. Raises InputError for an
    unknown unit."""
    if given == CHOSEN:
        return ()
    found = _TEXT.fullmatch(given) if isinstance(given, str) else None
    if found is None:
        return given
    variable = split_key(key)[1]
    values = [float(text) for text in re.split(r"[,\s]+", found["numbers"].strip(", \t"))]
    if found["unit"]:
        to = CHANNELS[variable].unit if variable in CHANNELS else "rad"
        scale, offset = conversion(found["unit"].strip(), to)
        values = [round(scale * value + offset, 12) for value in values]
    return values


def spline_expressions(
    term: str, variable: str, knots: Sequence[float], kind: SplineKind, relative: bool
) -> list[tuple[str, str]]:
    """Return names and expressions of the regressors of a spline term, one for each knot.

    A term that is the variable itself means a function of it, any other is multiplied by one.
    relative : leave out the first knot, whose value is then the constant. Knots are in SI units.
    Raises InputError where they are too close to have different names.
    """
    polynomials = piecewise_polynomials(knots, kind)
    parts = [
        f"clip({variable} - {number(low)}, 0, {number(high - low)})".replace("- -", "+ ")
        for low, high in pairwise(knots)
    ]
    regressors = []
    for j, knot in enumerate(knots):
        if relative and j == 0:
            continue
        pieces = [f"{float(polynomials[j, 0, 0])!r}"] if polynomials[j, 0, 0] else []
        for i, part in enumerate(parts):
            for degree in range(1, polynomials.shape[2]):
                coefficient = float(polynomials[j, i, degree])
                if abs(coefficient) * (knots[i + 1] - knots[i]) ** degree > 1e-15:
                    power = f"*{part}" if degree == 1 else f"*{part}^{degree}"
                    pieces.append(f"{number(coefficient)}{power}")
        text = " + ".join(pieces)
        if term != variable:
            text = f"({term})*({text})"
        label = f"{term} at {knot:.4g}" if term == variable else f"{term} at {variable} {knot:.4g}"
        regressors.append((label, text))
    if len({label for label, _ in regressors}) != len(regressors):
        raise InputError(f"knots of '{term}' are too close to be told apart", "model file")
    return regressors


def increasing(knots: Sequence[float]) -> bool:
    """Return whether knots (k,), in SI units, make a spline: two or more, finite, increasing."""
    return len(knots) > 1 and bool(np.all(np.diff(knots) > 0)) and bool(np.isfinite(knots).all())
