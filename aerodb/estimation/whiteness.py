"""Whether residuals are white: what a method that takes them so must tell."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.special import gammaincc

from aerodb.support import Array

#: Most lags that are looked at.
_LAGS = 20
#: Fewest samples for each lag.
_PER_LAG = 10


#: Probability that white innovations of a fit are called coloured, over all its outputs together.
FALSE_ALARMS = 0.01
#: Correlation of one innovation with the next below which they are as good as white: the standard
#: errors of a first-order process are then wrong by a fifth.
_CORRELATED = 0.2


def coloured_innovations(residuals: Mapping[str, Mapping[str, Array]]) -> dict[str, float]:
    """Return the outputs whose innovations are not white, with their correlation from one sample to
    the next (a scalar without unit).

    residuals : record -> output -> (n,). Of fits with white innovations at most `FALSE_ALARMS` have
    such an output: each is tested by Ljung and Box at that level over the number of outputs.
    """
    names = dict.fromkeys(name for record in residuals.values() for name in record)
    found = {}
    for name in names:
        p_value, correlation = ljung_box([record[name] for record in residuals.values()])
        if p_value * len(names) < FALSE_ALARMS and abs(correlation) > _CORRELATED:
            found[name] = correlation
    return found


def ljung_box(records: Sequence[Array]) -> tuple[float, float]:
    """Probability of so much correlation in time if the residuals (n,) of all records were white,
    and their correlation from one sample to the next.

    Samples that are NaN are left out.

    References
    ----------
    Ljung & Box, Biometrika 65(2), 1978.

    >>> round(ljung_box([np.tile([1.0, -1.0], 50)])[1], 2)
    -0.99
    """
    total = sum(int(np.isfinite(values).sum()) for values in records)
    power = sum(float(np.nansum(values**2)) for values in records)
    lags = min(_LAGS, total // _PER_LAG)
    if lags < 1 or power <= 0.0:
        return 1.0, 0.0
    correlation = np.zeros(lags)
    for values in records:
        known = np.nan_to_num(values)
        for lag in range(1, min(lags, len(known) - 1) + 1):
            correlation[lag - 1] += float(known[lag:] @ known[:-lag]) / power
    statistic = total * (total + 2.0) * np.sum(correlation**2 / (total - np.arange(1, lags + 1)))
    return float(gammaincc(0.5 * lags, 0.5 * float(statistic))), float(correlation[0])
