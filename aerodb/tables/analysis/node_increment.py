"""An increment on table nodes: the nodes that a grid needs to represent it exactly, and its
regressors there.

Within a cell of such a grid every regressor, its hold at the edge of the envelope and its fading
are linear in each variable. Evaluation through the nodes and through the expressions therefore
agree to rounding.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np

from aerodb.support import Array
from aerodb.tables.analysis.multilinear import NotMultilinearError, breaks
from aerodb.tables.expression import Expression
from aerodb.tables.increment import Increment

#: Most nodes of one grid; a larger table would cost too much memory.
MAX_NODES: Final = 500_000


def knots(
    regressor: Expression, increment: Increment, fading: frozenset[str]
) -> dict[str, set[float]]:
    """Per variable, the breakpoints of `regressor` under the envelope rule.

    fading : variables over whose envelope it fades.

    Raises NotMultilinearError with the reason where it is not multilinear between breakpoints.
    """
    free = sorted(regressor.names - increment.envelope.keys())
    if free:
        raise NotMultilinearError(
            f"'{regressor}' goes on without end in {', '.join(free)}, which has no flown range"
        )
    by_channel = breaks(
        regressor, {name: (i.low, i.high) for name, i in increment.envelope.items()}
    )
    for name in sorted(fading):
        interval = increment.envelope[name]
        if interval.cell == 0.0:
            raise NotMultilinearError(f"its flown range over {name} ends in a step")
        corners = {interval.low - 2 * interval.cell, interval.low - interval.cell}
        corners |= {interval.high + interval.cell, interval.high + 2 * interval.cell}
        by_channel[name] = (
            by_channel.get(name, set())
            | corners
            | ({interval.low, interval.high} if name in by_channel else set())
        )
    return by_channel


def columns_at(increment: Increment, mesh: Mapping[str, Array]) -> tuple[Array, Array]:
    """Regressors at nodes with and without fading, each (m, k); variables that `mesh` lacks are
    taken inside the envelope."""
    m = len(next(iter(mesh.values())))
    middle = {name: np.full(m, (i.low + i.high) / 2) for name, i in increment.envelope.items()}
    columns, weights = increment.columns({**middle, **mesh})
    k = columns.shape[1]
    return np.broadcast_to(columns * weights, (m, k)), np.broadcast_to(columns, (m, k))
