"""Covariance of the values of several findings, so that their sum is not stated too precisely."""

from collections.abc import Sequence

import numpy as np

from aerodb.support import Array
from aerodb.tracing.decision.findings import Finding


def joint_covariance(findings: Sequence[Finding], prior_dof: float) -> Array:
    """Return the covariance (k, k) of the findings' values.

    Standard errors are those of the intervals, systematic part included. Correlations are those of
    the per-flight estimates over the flights that took part in both, shrunk towards zero by ``d /
    (d + prior_dof)`` with d degrees of freedom: few flights say little about them.

    Values are in the units of their parameters.
    """
    sigma = np.array([(f.ci95[1] - f.ci95[0]) / (2.0 * 1.96) for f in findings])
    correlation = np.eye(len(findings))
    values = [{vote.flight: vote.value for vote in f.votes} for f in findings]
    for i, one in enumerate(values):
        for j in range(i):
            shared = sorted(one.keys() & values[j].keys())
            pairs = np.array([[one[flight], values[j][flight]] for flight in shared]).reshape(-1, 2)
            if len(shared) > 2 and np.all(np.ptp(pairs, axis=0) > 0.0):
                freedom = len(shared) - 1
                correlation[i, j] = correlation[j, i] = (
                    np.corrcoef(pairs.T)[0, 1] * freedom / (freedom + prior_dof)
                )
    return np.asarray(correlation * np.outer(sigma, sigma))
