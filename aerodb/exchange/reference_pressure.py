"""Coefficients over a constant reference pressure, for formats that know dynamic pressure only."""

from dataclasses import replace

from aerodb.exchange.increment_terms import with_increments_as_terms
from aerodb.tables import (
    HAT_RATES,
    LOAD_AXES,
    AeroDatabase,
    Name,
    Number,
    Operation,
    load_axis,
    number,
    scale_of,
    substituted,
    times,
)


def over_dynamic_pressure(database: AeroDatabase) -> AeroDatabase:
    """Return `database` with its coefficients [1] over a constant pressure as loads [N, N m], which
    act the same; a database over the dynamic pressure is returned as it is."""
    pressure = database.reference.pressure
    if pressure is None:
        return database
    flat = with_increments_as_terms(database)
    speed = number(database.reference.speed)
    # Dimensionless rates were over a constant airspeed.
    hats = {
        hat: Operation(
            "/",
            times(Name(rate), Name("b_ref" if length == "span" else "c_ref")),
            times(Number(2.0), speed),
        )
        for hat, (rate, length) in HAT_RATES.items()
    }
    terms = []
    for term in flat.terms:
        if term.axis not in LOAD_AXES:
            axis = load_axis(term.axis)
            load = times(term.expression, scale_of(axis, pressure))
            term = replace(term, axis=axis, expression=load)
        terms.append(replace(term, expression=substituted(term.expression, hats)))
    variables = {
        name: replace(each, expression=substituted(each.expression, hats))
        for name, each in flat.variables.items()
    }
    return replace(
        flat,
        terms=tuple(terms),
        variables=variables,
        reference=replace(flat.reference, pressure=None),
    )
