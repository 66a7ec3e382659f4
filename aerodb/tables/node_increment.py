"""An increment on table nodes: where a grid needs nodes to carry it exactly, and what its
regressors are there.

Within a cell of the grid every regressor, its hold at the envelope's edge and its fading are linear
in each variable, so that the table carries them exactly: evaluation through the nodes and through
the expressions agree to rounding.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np

from aerodb.support import Array
from aerodb.tables.expression import Expression
from aerodb.tables.increment import Increment
from aerodb.tables.multilinear import NotMultilinearError, breaks

#: Nodes of one grid: more would cost more memory than an exact table is worth.
MAX_NODES: Final = 500_000


def knots(
    regressor: Expression, increment: Increment, fading: frozenset[str]
) -> dict[str, set[float]]:
    """Per variable, where `regressor` under the envelope rule bends; `fading`: whose envelopes take
    weight from it.

    Raises NotMultilinearError with the reason where it is not multilinear between such points.
    """
    free = sorted(regressor.names - increment.envelope.keys())
    if free:
        raise NotMultilinearError(
            f"'{regressor}' goes on without end in {', '.join(free)}, which has no envelope"
        )
    found = breaks(regressor, {name: (i.low, i.high) for name, i in increment.envelope.items()})
    for name in sorted(fading):
        interval = increment.envelope[name]
        if interval.cell == 0.0:
            raise NotMultilinearError(f"its envelope over {name} ends in a step")
        corners = {interval.low - 2 * interval.cell, interval.low - interval.cell}
        corners |= {interval.high + interval.cell, interval.high + 2 * interval.cell}
        found[name] = (
            found.get(name, set())
            | corners
            | ({interval.low, interval.high} if name in found else set())
        )
    return found


def columns_at(increment: Increment, mesh: Mapping[str, Array]) -> tuple[Array, Array]:
    """Regressors at nodes as they act and without fading, (m, k) each; variables that `mesh` lacks
    lie inside the envelope."""
    m = len(next(iter(mesh.values())))
    middle = {name: np.full(m, (i.low + i.high) / 2) for name, i in increment.envelope.items()}
    columns, weights = increment.columns({**middle, **mesh})
    k = columns.shape[1]
    return np.broadcast_to(columns * weights, (m, k)), np.broadcast_to(columns, (m, k))
