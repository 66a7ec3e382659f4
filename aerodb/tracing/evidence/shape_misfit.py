"""Shape-misfit terms: allow an effect to grow with alpha, or with its own size, unlike its
template.

A term that is right in name and wrong in shape leaves a residual, which is neither a second effect
nor a sensor error. So aerodynamic columns have shape-misfit terms, the column times alpha and times
its own size, which join the model with the accepted term, each with the prior that the effect
changes by TOLERANCE of itself over one sigma of alpha (or of the size; at least over LEAST). Shapes
that the library itself names have none: a slope times alpha is a slope break; beta times alpha and
a deflection cubed are hypotheses of their own. See docs/method/tracing.md, section 20.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.effects import Hypothesis
from aerodb.flight import Flight
from aerodb.support import Array
from aerodb.tables import Expression, evaluate
from aerodb.tracing.evidence.evidence import Columns, Evidence

#: One sigma of the change of an effect over one sigma of alpha or of its size, part of the effect.
TOLERANCE: Final = 0.5
#: Ending of a shape-misfit term's name -> least sigma of alpha [rad], and of the size [its own
#: rms], that this is stated for. Where it hardly moves, no shape shows.
LEAST: Final[Mapping[str, float]] = {"~alpha": 0.035, "~size": 0.3}
#: Points at which regressors are compared.
_POINTS: Final = 200
#: Correlation from which two regressors are one.
_SAME: Final = 0.95


def parent(name: str) -> str:
    """Return the id whose shape this column changes; empty for other columns."""
    return next((name.removesuffix(mark) for mark in LEAST if name.endswith(mark)), "")


def shape_term_columns(id: str) -> dict[str, float]:
    """Return the columns' names of a hypothesis' shape-misfit terms.

    Each with the least sigma of what it varies with, in that variable's unit
    (docs/method/tracing.md, section 20).
    """
    return {id + mark: least for mark, least in LEAST.items()}


def with_shape_terms(
    evidence: Evidence, flight: Flight, hypotheses: Sequence[Hypothesis]
) -> Evidence:
    """Return the evidence with the shape-misfit terms of its hypotheses (`all_shape_terms`).

    Those over alpha only where the flight has alpha.
    """
    alpha = (
        np.nan_to_num(flight["alpha"], nan=float(np.nanmean(flight["alpha"])))
        if "alpha" in flight
        else None
    )
    return _joined(evidence, alpha, all_shape_terms(hypotheses))


def without_shape_terms(evidence: Evidence) -> Evidence:
    """Return the evidence without any shape-misfit term."""
    return replace(
        evidence,
        columns={name: columns for name, columns in evidence.columns.items() if not parent(name)},
    )


def _joined(evidence: Evidence, alpha: Array | None, names: frozenset[str]) -> Evidence:
    shape_columns: Columns = {
        name: {axis: column * along for axis, column in evidence.columns[parent(name)].items()}
        for name in sorted(names)
        if parent(name) in evidence.columns
        for along in [alpha if name.endswith("~alpha") else _size(evidence.columns[parent(name)])]
        if along is not None
    }
    noisy = tuple(_joined(copy, alpha, names) for copy in evidence.noisy)
    return replace(evidence, columns={**evidence.columns, **shape_columns}, noisy=noisy)


def _size(by_axis: Mapping[str, Array]) -> Array | None:
    """Magnitude (n,) of a column over all its axes, in units of its rms."""
    square = np.sum([column**2 for column in by_axis.values()], axis=0)
    mean = float(np.mean(square))
    return np.sqrt(square / mean) if mean > 0.0 else None


def all_shape_terms(hypotheses: Sequence[Hypothesis]) -> frozenset[str]:
    """Return the names of all shape-misfit terms.

    Effects that depend on alpha alone have none, nor shapes that the library holds itself.
    """
    own = [h for h in hypotheses if h.kind == "aerodynamic" and len(h.increment) == 1]
    alike: dict[tuple[str, frozenset[str]], list[Hypothesis]] = {}
    for hypothesis in own:
        axis, regressor = hypothesis.increment[0]
        alike.setdefault((axis, frozenset(regressor.names)), []).append(hypothesis)
    terms = set[str]()
    for hypothesis in own:
        axis, regressor = hypothesis.increment[0]
        if regressor.names - {"alpha"}:
            for name in shape_term_columns(hypothesis.id):
                over = {"alpha"} if name.endswith("~alpha") else set()
                beside = alike.get((axis, frozenset(regressor.names | over)), ())
                others = (h.increment[0][1] for h in beside if h is not hypothesis)
                if not any(_is(other, regressor, name) for other in others):
                    terms.add(name)
    return frozenset(terms)


def _is(other: Expression, regressor: Expression, name: str) -> bool:
    """Return whether `other`, of the same names, equals the shape-misfit term `name` of
    `regressor`, up to a share of the regressor.
    """
    over_alpha = name.endswith("~alpha")
    generator = np.random.default_rng(0)
    names = sorted(other.names)
    at: Mapping[str, Array] = {
        n: generator.uniform(-0.3 if _signed(n) else 0.05, 0.3, _POINTS) for n in names
    }
    base, wanted = (np.broadcast_to(evaluate(each, at), (_POINTS,)) for each in (regressor, other))
    candidate = base * (at["alpha"] if over_alpha else np.abs(base))
    left = [each - base * ((base @ each) / (base @ base)) for each in (candidate, wanted)]
    size = np.linalg.norm(left[0]) * np.linalg.norm(left[1])
    return bool(size > 0.0 and abs(left[0] @ left[1]) >= _SAME * size)


def _signed(name: str) -> bool:
    return name in ("alpha", "beta") or name.startswith("delta_") or name.endswith("_hat")
