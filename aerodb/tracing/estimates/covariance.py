"""How the estimates of several findings hang together, so that what they add together is no surer
than it is."""

from collections.abc import Sequence

import numpy as np

from aerodb.support import Array
from aerodb.tracing.decision import Finding


def joint_covariance(findings: Sequence[Finding], prior_dof: float) -> Array:
    """Covariance (k, k) of the findings' values.

    Standard errors are those of the intervals, systematic part included. Correlations are those of
    the votes over the flights that voted on both, shrunk towards none by ``d / (d + prior_dof)``
    with d degrees of freedom: few flights say little of them.
    """
    sigma = np.array([(f.ci95[1] - f.ci95[0]) / (2.0 * 1.96) for f in findings])
    correlation = np.eye(len(findings))
    votes = [{vote.flight: vote.value for vote in f.votes} for f in findings]
    for i, one in enumerate(votes):
        for j in range(i):
            shared = sorted(one.keys() & votes[j].keys())
            pairs = np.array([[one[flight], votes[j][flight]] for flight in shared]).reshape(-1, 2)
            if len(shared) > 2 and np.all(np.ptp(pairs, axis=0) > 0.0):
                freedom = len(shared) - 1
                correlation[i, j] = correlation[j, i] = (
                    np.corrcoef(pairs.T)[0, 1] * freedom / (freedom + prior_dof)
                )
    return np.asarray(correlation * np.outer(sigma, sigma))
