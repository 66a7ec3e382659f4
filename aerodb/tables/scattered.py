"""A table on scattered points: linear interpolation in the simplices of a Delaunay triangulation.

The standard for such tables (ungridded tables of DAVE-ML) requires a triangulation and does not
define values outside. Here a point outside takes the value where the line to it from the mean of
all points leaves the hull: this is continuous, and with one argument the same as holding the end
value.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.support import Array
from aerodb.tables.expression import check_identifier
from aerodb.tables.table import Lookup, stacked_arguments
from aerodb.tables.uncertainty import Uncertainty, check_bounds

#: The number of simplices grows as m^(N/2): with more arguments a triangulation is not practical.
MAX_DIMENSIONS = 6
#: A point outside the hull by less than this fraction counts as inside: rounding.
_INSIDE = 1e-12


@dataclass(frozen=True, eq=False)
class ScatteredTable:
    """A table on scattered points.

    Parameters
    ----------
    arguments : N labels, 2 <= N <= 6.
    points : (m, N), in the units of the arguments, which are scaled by their extent before the
        triangulation.
    values : (m,).

    Raises InputError for points that span no volume, repeated points and numbers that are not
    finite.
    """

    name: str
    arguments: tuple[str, ...]
    points: Array
    values: Array
    uncertainty: Uncertainty | None = None

    def __post_init__(self) -> None:
        check_identifier(self.name)
        where = f"table {self.name}"
        points = np.array(self.points, dtype=np.float64, order="C") + 0.0
        values = np.array(self.values, dtype=np.float64) + 0.0
        if (
            points.ndim != 2
            or points.shape[1] != len(self.arguments)
            or values.shape != points.shape[:1]
        ):
            raise InputError(
                f"points {points.shape}, values {values.shape} for {len(self.arguments)} arguments",
                where,
            )
        if not 2 <= points.shape[1] <= MAX_DIMENSIONS:
            raise InputError(
                f"scattered points over {points.shape[1]} arguments",
                where,
                f"2 to {MAX_DIMENSIONS}",
            )
        if not (np.all(np.isfinite(points)) and np.all(np.isfinite(values))):
            raise InputError("numbers that are not finite", where)
        if len(np.unique(points, axis=0)) != len(points):
            raise InputError("a point is listed twice", where)
        check_bounds(self.uncertainty, len(values))
        points.flags.writeable = values.flags.writeable = False
        object.__setattr__(self, "arguments", tuple(self.arguments))
        object.__setattr__(self, "points", points)
        object.__setattr__(self, "values", values)
        _ = self.triangulation  # raises for points without volume now, not at the first lookup

    @cached_property
    def scale(self) -> Array:
        """(N,) extent of the points along each argument, in its unit; 1 where it is zero."""
        extent = np.ptp(self.points, axis=0)
        return np.where(extent > 0, extent, 1.0)

    @cached_property
    def triangulation(self) -> Any:
        # Imported here because it loads slowly and few databases have such a table.
        """Delaunay triangulation of the points (n, N), each divided by `scale`. Raises InputError
        where they span no volume."""
        from scipy.spatial import Delaunay, QhullError

        try:
            return Delaunay(self.points / self.scale)
        except (QhullError, ValueError):
            raise InputError(
                "points that span no volume",
                f"table {self.name}",
                "give more points, or drop an argument",
            ) from None

    @cached_property
    def hull(self) -> tuple[Array, Array]:
        """Outward normals (f, N) and offsets (f,) of the facets of the hull; x is inside where
        ``normals @ x + offsets <= 0``.

        Coordinates are dimensionless: points are divided by `scale`.
        """
        from scipy.spatial import ConvexHull

        equations = ConvexHull(self.points / self.scale).equations
        return equations[:, :-1], equations[:, -1]

    def lookup(self, *arguments: Array | float) -> Lookup:
        """Values, and which points lie outside the hull; NaN gives NaN and is outside.

        arguments : each (n,) or a number, in the units of the points; values (n,).
        """
        x = stacked_arguments(self.name, len(self.arguments), arguments).T / self.scale
        unknown = ~np.isfinite(x).all(axis=1)
        centre = self.points.mean(axis=0) / self.scale
        x[unknown] = centre
        normals, offsets = self.hull
        beyond = np.empty(len(x), dtype=np.bool_)
        # Blocks limit the memory for points times facets.
        for part in np.array_split(np.arange(len(x)), 1 + len(x) // 65_536):
            toward = (x[part] - centre) @ normals.T
            with np.errstate(all="ignore"):
                leaves = np.where(toward > 0, -(normals @ centre + offsets) / toward, np.inf)
            # Fraction of the way from the centre that lies in the hull.
            reach = np.minimum(np.min(leaves, axis=1), 1.0)
            beyond[part] = reach < 1.0 - _INSIDE
            x[part] = np.where(
                (reach < 1.0)[:, None], centre + reach[:, None] * (x[part] - centre), x[part]
            )
        values = self._inside(x, centre)
        values[unknown] = np.nan
        outside = beyond | unknown
        return Lookup(values, outside, bool(outside.any()))

    def evaluate(self, *arguments: Array | float) -> Array:
        """Values (n,) at arguments, each (n,) or a number.

        Arguments are in the units of the points.
        """
        return self.lookup(*arguments).values

    def outside(self, *arguments: Array | float) -> NDArray[np.bool_]:
        """(n,) true where the arguments lie outside the hull of the points, or are NaN.

        Arguments are in the units of the points.
        """
        return self.lookup(*arguments).outside

    def _inside(self, x: Array, centre: Array) -> Array:
        """Linear interpolation at points (n, N) in or on the hull."""
        triangulation = self.triangulation
        simplex = triangulation.find_simplex(x)
        lost = np.flatnonzero(simplex < 0)
        if lost.size:  # on the surface of the hull, outside by rounding
            simplex[lost] = triangulation.find_simplex(
                centre + (x[lost] - centre) * (1.0 - 1e-10), bruteforce=True
            )
        transform = triangulation.transform[simplex]
        weights = np.einsum("nij,nj->ni", transform[:, :-1], x - transform[:, -1])
        weights = np.column_stack([weights, 1.0 - weights.sum(axis=1)])
        return np.einsum("ni,ni->n", weights, self.values[triangulation.simplices[simplex]])
