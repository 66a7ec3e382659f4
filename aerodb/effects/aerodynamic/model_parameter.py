"""Parameters of the database: named numbers of its expressions, such as a tail's lift slope.

Model: parameter += k, on every axis on which a term uses it, through all expressions at once: a
downwash acts on the tail's lift and on the pitching moment alike. The column is the derivative of
the prediction by the parameter. Believable size: within its bounds, and three sigmas of its prior
where it has one; without either as much as the parameter itself.

Data needed: whatever moves the terms that use it. Parameters that act alike in these flights (tail
slope and tail area) are aliases, and said as such.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np

from aerodb.effects.flight_view import FlightView
from aerodb.effects.hypothesis import Columns, Hypothesis
from aerodb.effects.template import WIND_TO_BODY_AXES, LibraryContext, Template
from aerodb.nomenclature import AXES
from aerodb.tables import AeroDatabase, Parameter, depends_on, sigma_of

#: Name of the effect.
PARAMETER = "parameter"
SOURCE = "001, eqs. 6-24"
_SIGMAS = 3.0


def columns(view: FlightView, parameter: str) -> Columns:
    """Columns of a parameter: body axis -> (n,), per unit of it."""
    slopes = view.slope_by_parameter(parameter)
    return {axis: slopes.get(axis, np.zeros(len(view.time))) for axis in AXES}


def believable(value: float, parameter: Parameter, sigma: float | None) -> tuple[float, float]:
    """Believable change of a parameter, lowest and highest, in its unit.

    >>> believable(4.0, Parameter((2.0, 8.0)), 0.5)
    (-1.5, 1.5)
    >>> believable(4.0, Parameter((2.0, 8.0)), None)
    (-2.0, 4.0)
    >>> believable(4.0, Parameter(), None)
    (-4.0, 4.0)
    """
    bounds = (parameter.bounds[0] - value, parameter.bounds[1] - value)
    if sigma is not None:
        most = _SIGMAS * sigma
    else:
        most = (
            np.inf if np.isfinite(bounds).all() else max(abs(value), 1.0 if value == 0.0 else 0.0)
        )
    return float(max(bounds[0], -most)), float(min(bounds[1], most))


def axes_of(database: AeroDatabase, parameter: str) -> tuple[str, ...]:
    """Body axes on which a term of the database uses the parameter, in their order."""
    found = {
        body
        for term in database.coefficient_terms
        if parameter in depends_on(term.expression, database)
        for body in WIND_TO_BODY_AXES.get(term.axis, (term.axis,))
    }
    return tuple(axis for axis in AXES if axis in found)


def _hypotheses(context: LibraryContext) -> Iterator[Hypothesis]:
    database = context.database
    for name, value in database.parameters.items():
        variable, axes = database.variables[name], axes_of(database, name)
        known, prior = variable.parameter, variable.uncertainty
        if known is None or not axes:
            continue
        sigma = None if known.flights else sigma_of(prior)
        using = sorted(
            f"{term.axis}: {term.name}"
            for term in database.terms
            if name in depends_on(term.expression, database)
        )
        what = variable.description or name.replace("_", " ")
        yield Hypothesis(
            effect=PARAMETER,
            axes=axes,
            subject=name,
            parameter=name,
            kind="aerodynamic",
            unit=variable.unit,
            plausible=believable(value, known, sigma),
            prior_sigma=None,
            because=f"the {what} differs from the database's {value:.4g}",
            tangent=partial(columns, parameter=name),
            formula=f"{name} += k in {'; '.join(using)}",
            needs=("alpha",),
            source=SOURCE,
        )


TEMPLATE = Template(PARAMETER, "aerodynamic", "parameter += k", SOURCE, _hypotheses)
