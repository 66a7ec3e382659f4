"""Put the normal equations of several flights and the library on one order of columns."""

from collections import Counter
from collections.abc import Mapping, Sequence

import numpy as np

from aerodb.effects import Hypothesis
from aerodb.errors import InputError
from aerodb.support import Array
from aerodb.tracing.estimates.per_flight import Campaign
from aerodb.tracing.estimates.products import products_of
from aerodb.tracing.evidence import FlightNormalEquations, parent, shape_term_columns

#: The effect whose column is the axis' own constant.
OFFSET = "zero_offset"


def campaign(
    normal_equations: Sequence[FlightNormalEquations],
    hypotheses: Sequence[Hypothesis],
    earlier: Mapping[str, float] | None = None,
    extrapolated: bool = True,
) -> Campaign:
    """Return the campaign of flights on the order of `hypotheses`.

    A flight that lacks a column says nothing about that hypothesis. earlier : id -> value of the
    terms that earlier rounds added: their shape-misfit terms are in every model. extrapolated : as
    in `Campaign`.

    Raises InputError when a flight has columns that the library lacks (they were made with another
    library), when a flight is given twice under one name, or when a sensor has no prior.
    """
    _check(normal_equations, hypotheses)
    known = {h.id: index for index, h in enumerate(hypotheses)}
    columns = frozenset[str]().union(*{g.hypotheses for g in normal_equations})
    beside = [
        (h.id, name, least)
        for h in hypotheses
        for name, least in shape_term_columns(h.id).items()
        if name in columns
    ]
    shape_terms = {
        len(hypotheses) + n: (known[id], least) for n, (id, _, least) in enumerate(beside)
    }
    known |= {name: len(hypotheses) + n for n, (_, name, _) in enumerate(beside)}
    offsets = {
        index: h.axes[0]
        for index, h in enumerate(hypotheses)
        if h.effect == OFFSET and len(h.axes) == 1
    }
    sensors = tuple(index for index, h in enumerate(hypotheses) if h.kind == "sensor")
    products, noisy, total = products_of(
        normal_equations,
        known,
        offsets,
        {shape: index for shape, (index, _) in shape_terms.items()},
    )
    scale = 1.0 / products.factor[:-1]
    precision = np.zeros(len(known))
    for index in sensors:
        precision[index] = (hypotheses[index].prior_sigma or np.inf) ** -2 / scale[index] ** 2
    return Campaign(
        flights=tuple(g.flight for g in normal_equations),
        hypotheses=tuple(hypotheses),
        products=products,
        noisy=noisy,
        total=total,
        scale=scale,
        precision=precision,
        sensors=sensors,
        offsets=tuple(offsets),
        shape_terms=shape_terms,
        earlier={known[id]: value for id, value in (earlier or {}).items() if id in known},
        extrapolated=extrapolated,
        squares=_squares(normal_equations, {h.id: index for index, h in enumerate(hypotheses)}),
    )


def _squares(normal_equations: Sequence[FlightNormalEquations], known: Mapping[str, int]) -> Array:
    """Squares (flights, axes, k + 1) of hypotheses and, last, of the residual on each axis."""
    axes = list(dict.fromkeys(axis for g in normal_equations for axis in g.axes))
    squares = np.zeros((len(normal_equations), len(axes), len(known) + 1))
    for own, g in zip(squares, normal_equations, strict=True):
        at = [(known[name], place) for place, name in enumerate(g.hypotheses) if name in known]
        rows = [axes.index(axis) for axis in g.axes]
        own[np.ix_(rows, [k for k, _ in at])] = g.squares[:, [place for _, place in at]]
        own[rows, -1] = g.squares[:, -1]
    return squares


def _check(
    normal_equations: Sequence[FlightNormalEquations], hypotheses: Sequence[Hypothesis]
) -> None:
    names = [h.id for h in hypotheses]
    if len(set(names)) != len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(
            f"hypothesis {twice} stands twice in the list of effects",
            "library",
            "give each effect, axis and subject once",
        )
    for h in hypotheses:
        if h.kind == "sensor" and not (h.prior_sigma is not None and h.prior_sigma > 0.0):
            raise InputError(
                f"sensor hypothesis {h.id} has no prior sigma",
                "library",
                "give its one sigma in SI units",
            )
    flights, known = Counter(g.flight for g in normal_equations), set(names)
    for columns, g in {g.hypotheses: g for g in reversed(normal_equations)}.items():
        unknown = [name for name in columns if (parent(name) or name) not in known]
        if unknown:
            what = f"its columns were made with another list of effects ({unknown[0]} is not in it)"
            raise InputError(what, g.flight, "make its normal equations anew with the list in use")
    for flight, times in flights.items():
        if times > 1:
            raise InputError("the same flight twice", flight, "give each flight once")
