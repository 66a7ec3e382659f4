"""What each estimate is worth, from the information that the records hold."""

from collections.abc import Mapping, Sequence

import numpy as np

from aerodb.estimation.fit import Standing
from aerodb.estimation.parameters import Parameter
from aerodb.support import Array

#: The data add nothing to a prior whose standard deviation they reduce by less than this share.
_ADDED = 0.05
#: Parameters of a direction that is not determined: those with at least this share of the largest,
#: above what differences in place of derivatives leave of a zero.
_SHARE = 1e-4


def standings(
    unknown: Sequence[Parameter],
    vector: Array,
    information: Array,
    covariance: Array,
    singular: float,
) -> Mapping[str, tuple[Standing, str]]:
    """Return standing and reason of each of f unknowns (`Standing`).

    Parameters
    ----------
    vector : (f,) estimates.
    information : (f, f) with priors. covariance : (f, f), as if the residuals were white.
    singular : eigenvalue of the information, scaled to a unit diagonal, below which a direction is
        not determined.
    """
    found: dict[str, tuple[Standing, str]] = {}
    size = np.sqrt(np.diag(information))
    live = np.flatnonzero(size > 0)
    for item, alone in zip(unknown, size, strict=True):
        if alone == 0:
            found[item.name] = (
                "not excited",
                "no output changes with it: excite what it acts on, or fix it",
            )
    if len(live):
        scaled = information[np.ix_(live, live)] / np.outer(size[live], size[live])
        values, vectors = np.linalg.eigh(scaled)
        for direction in vectors[:, values <= singular * values[-1]].T:
            weight = np.abs(direction)
            names = [unknown[live[j]].name for j in np.flatnonzero(weight > _SHARE * weight.max())]
            for name in names:
                others = ", ".join(other for other in names if other != name)
                found.setdefault(
                    name,
                    (
                        "not identifiable",
                        f"{others} can take its place: excite them apart, or fix one of them",
                    ),
                )
    for j, item in enumerate(unknown):
        if item.name in found:
            continue
        if vector[j] <= item.lower or vector[j] >= item.upper:
            end = "lower" if vector[j] <= item.lower else "upper"
            found[item.name] = (
                "at bound",
                f"the likelihood still rises beyond its {end} bound {vector[j]:.6g}",
            )
        elif item.prior_error is not None and (
            np.sqrt(covariance[j, j]) > (1.0 - _ADDED) * item.prior_error
        ):
            found[item.name] = (
                "prior",
                "the data reduce the prior's standard deviation by less than"
                f" {100.0 * _ADDED:.0f} %",
            )
    return found
