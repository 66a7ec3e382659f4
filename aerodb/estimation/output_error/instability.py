"""Motions that grow so fast that their start decides where they end."""

from collections.abc import Sequence

import numpy as np

from aerodb.estimation.dynamic_model import DynamicModel
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array

#: Difference of a state, for the linearised motion.
_STEP = 1e-5


def instability(
    model: DynamicModel, records: Sequence[TimeHistory], vector: Array, largest: float
) -> str:
    """Return why the longest record has no answer, with doubling time [s]; empty where it has one.

    The growth is that of the motion linearised at the first sample.

    Parameters
    ----------
    vector : (f,) unknowns.
    largest : growth of an error of the start within the record that is still resolved.
    """
    record = max(records, key=lambda each: float(each.time[-1] - each.time[0]))
    state = model.initial_state(model.parameters.values(vector[:, None]), record)[:, :1]
    if not np.isfinite(state).all() or not len(state):
        return ""
    steps = _STEP * np.maximum(np.abs(state[:, 0]), 1.0)
    lanes = np.concatenate([state, state + np.diag(steps)], axis=1)
    values = model.parameters.values(np.repeat(vector[:, None], lanes.shape[1], axis=1))
    with np.errstate(all="ignore"):
        rates = model.rates(values, record, 0, lanes)
    jacobian = (rates[:, 1:] - rates[:, :1]) / steps
    if not np.isfinite(jacobian).all():
        return ""
    fastest = float(np.linalg.eigvals(jacobian).real.max())
    length = float(record.time[-1] - record.time[0])
    if fastest * length < np.log(largest):
        return ""
    return (
        f"the model's motion is unstable: it doubles in {np.log(2.0) / fastest:.2g} s, and"
        f" {np.exp(min(fastest * length, 700.0)):.0e}-fold within {record.name} ({length:.4g} s);"
        " use multiple shooting, a stabilised model or shorter records"
    )
