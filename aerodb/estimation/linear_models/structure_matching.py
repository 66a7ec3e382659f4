"""Start values for a linear model whose states are not measured: its structure is matched to a
subspace model of its outputs."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation.linear_models.affine import AffineMatrix
from aerodb.estimation.linear_models.state_space import StateSpace
from aerodb.estimation.linear_models.subspace import LinearIdentified, identified_linear_model, path
from aerodb.estimation.time_history import TimeHistory
from aerodb.support import Array

#: Changes of the coordinates that the search begins from.
_TRIES: Final = 30
#: Orders of magnitude over which their size is spread, to either side.
_DECADES: Final = 1.5


def matched_start_values(model: StateSpace, records: Sequence[TimeHistory]) -> dict[str, float]:
    """Return start values of the unknown entries of A, B, C and D.

    A subspace model of the outputs has states of no meaning, ``x = T s``. Given T, the entries
    follow from ``T As = A T``, ``T Bs = B``, ``Cs = C T`` and ``Ds = D`` by least squares; T is
    searched from several random ones (seeded). Each row counts by its own size, so that units do
    not matter.

    References
    ----------
    Xie & Ljung, IFAC Proceedings 35(1), 2002: physically parametrised models from subspace
    estimates. Golub & Pereyra, SIAM Journal on Numerical Analysis 10(2), 1973: what is linear is
    eliminated.

    Raises InputError as `identified_linear_model`.
    """
    from scipy.optimize import least_squares  # slow to import

    passing = sum(np.abs(each) for each in (model.d.constant, *model.d.slopes.values()))
    direct = [
        name for name, row in zip(model.outputs, np.asarray(passing), strict=True) if row.any()
    ]
    found = identified_linear_model(
        records, model.inputs, model.outputs, order=len(model.states), direct=direct
    )
    problem = _Matching(model, records, found)
    s, rng = len(model.states), np.random.default_rng(0)
    best, cost = None, np.inf
    for _ in range(_TRIES):
        size = 10.0 ** rng.uniform(-_DECADES, _DECADES, (s, 1))
        first = (size * rng.standard_normal((s, s))).ravel()
        with np.errstate(all="ignore"):
            tried = least_squares(problem.residual, first, x_scale="jac", max_nfev=200)
        if tried.cost < cost:
            best, cost = tried.x, float(tried.cost)
    if best is None:
        raise InputError("no coordinates fit the structure", "start values", "give start values")
    return problem.entries(best)


class _Matching:
    """The equations between the matrices of a model and of a subspace model."""

    def __init__(
        self, model: StateSpace, records: Sequence[TimeHistory], found: LinearIdentified
    ) -> None:
        paths = np.concatenate([path(found, record)[0] for record in records])
        inputs = np.concatenate([model.driving(record)[:, :-1] for record in records])
        outputs = np.concatenate([record.stacked(model.outputs) for record in records])
        root = np.linalg.cholesky(
            np.atleast_2d(np.cov(paths.T)) + 1e-12 * np.eye(len(found.A)) * paths.var()
        )
        inverse = np.linalg.inv(root)  # states of unit covariance
        self.a, self.c = inverse @ found.A @ root, found.C @ root
        self.input_sizes = np.maximum(inputs.std(axis=0), 1e-300)
        self.b, self.d = inverse @ found.B, found.D
        self.seen = np.maximum(np.nanstd(outputs, axis=0), 1e-300)
        self.names = [
            item.name
            for item in model.parameters.unknown
            if any(item.name in matrix.slopes for matrix in (model.a, model.b, model.c, model.d))
        ]
        values = model.parameters.values(np.zeros(len(model.parameters.unknown)))
        tied = {item.name: item.tied for item in model.parameters.items if item.tied is not None}
        self.parts = [
            self._part(matrix, values, tied) for matrix in (model.a, model.b, model.c, model.d)
        ]

    def _part(
        self,
        matrix: AffineMatrix,
        values: dict[str, Array],
        tied: dict[str, tuple[str, float]],
    ) -> tuple[Array, Array]:
        """Return what is known of a matrix (r, c), and its derivatives (g, r, c)."""
        known = matrix.constant.copy()
        slopes = np.zeros((len(self.names), *known.shape))
        for name, slope in matrix.slopes.items():
            source, factor = tied.get(name, (name, 1.0))
            if source in self.names:
                slopes[self.names.index(source)] += factor * slope
            elif name in values:
                known += float(values[name]) * slope
        return known, slopes

    def _solved(self, vector: Array) -> tuple[Array, Array]:
        """Entries (g,) that fit best with T, and what they leave."""
        turn = vector.reshape(len(self.a), -1)
        row = 1.0 / np.maximum(np.linalg.norm(turn, axis=1), 1e-300)
        (a, da), (b, db), (c, dc), (d, dd) = self.parts
        output = 1.0 / self.seen
        left = [
            (turn @ self.a - a @ turn) * row[:, None],
            (turn @ self.b - b) * self.input_sizes * row[:, None],
            (self.c - c @ turn) * output[:, None],
            (self.d - d) * self.input_sizes * output[:, None],
        ]
        wide = [
            (da @ turn) * row[:, None],
            db * self.input_sizes * row[:, None],
            (dc @ turn) * output[:, None],
            dd * self.input_sizes * output[:, None],
        ]
        matrix = np.concatenate([part.reshape(len(self.names), -1) for part in wide], axis=1).T
        response = np.concatenate([part.ravel() for part in left])
        size = np.maximum(np.linalg.norm(matrix, axis=0), 1e-300)
        solved = np.linalg.lstsq(matrix / size, response, rcond=1e-9)[0] / size
        return solved, response - matrix @ solved

    def residual(self, vector: Array) -> Array:
        """Return what the best entries leave of the equations."""
        return self._solved(vector)[1]

    def entries(self, vector: Array) -> dict[str, float]:
        """The best entries by name."""
        return dict(zip(self.names, self._solved(vector)[0].tolist(), strict=True))
