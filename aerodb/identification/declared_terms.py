"""A database with the terms of a model file: nothing yet, or as flights tell them."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.estimation import Fit
from aerodb.identification.equations import parameter_name
from aerodb.increments import DeclaredIncrement, ModelFile, expand
from aerodb.support import Array
from aerodb.tables import AeroDatabase, Increment

#: Estimate of a term that the database lacks: an increment of zeros would not act at all.
_NOTHING: Final = 1e-12


def with_terms(database: AeroDatabase, declared: ModelFile) -> tuple[AeroDatabase, dict[str, str]]:
    """Return the database with an increment of nothing (k zeros, covariance (k, k)) for each
    declared term, and the name of each in its flight model -> its name in answers. Raises
    InputError as `expand` does."""
    named: dict[str, str] = {}
    added = []
    for number, entry in enumerate(declared.increment):
        terms = expand(entry)
        k = len(terms)
        expressions = tuple(term.expression for term in terms)
        added.append(Increment(entry.axis, expressions, np.full(k, _NOTHING), np.zeros((k, k))))
        for j, term in enumerate(terms):
            inside = f"estimate_{entry.axis}_{len(database.increments) + number}_{j}"
            named[inside] = parameter_name(entry.axis, term.name)
    return replace(database, increments=(*database.increments, *added)), named


def with_known_terms(
    database: AeroDatabase, declared: ModelFile, fits: Sequence[Fit]
) -> AeroDatabase:
    """The database with each declared term as `fits` tell it, else as its prior does, with its
    covariance, and without an envelope: beyond what was flown a term goes on as it is written.

    Increments that the database has of the same terms keep their values without uncertainty: what
    is estimated is the sum, and the fits know how well.

    Raises InputError for a term of which neither a fit nor a prior tells anything.
    """
    wider, _ = with_terms(database, declared)
    first = len(database.increments)
    increments = [_settled(each, declared) for each in wider.increments[:first]]
    for entry, empty in zip(declared.increment, wider.increments[first:], strict=True):
        values, covariance = _known(entry, fits)
        values = np.where(values == 0.0, _NOTHING, values)
        increments.append(replace(empty, estimates=values, covariance=covariance))
    return replace(wider, increments=tuple(increments))


def _settled(increment: Increment, declared: ModelFile) -> Increment:
    """An increment without the uncertainty of the terms that are declared anew."""
    anew = {
        term.expression
        for entry in declared.increment
        if entry.axis == increment.axis
        for term in expand(entry)
    }
    kept = np.array([each not in anew for each in increment.regressors], dtype=np.float64)
    return replace(increment, covariance=increment.covariance * np.outer(kept, kept))


def _known(entry: DeclaredIncrement, fits: Sequence[Fit]) -> tuple[Array, Array]:
    """Values (k,) and covariance (k, k) of the terms of an axis; a constant of its own for each
    flight counts as their mean."""
    terms = expand(entry)
    values, covariance = np.zeros(len(terms)), np.zeros((len(terms),) * 2)
    names = [parameter_name(entry.axis, term.name) for term in terms]
    fit = next((f for f in fits if any(e.name.split("[")[0] in names for e in f.estimates)), None)
    mix = np.zeros((len(terms), 0 if fit is None else len(fit.names)))
    for row, (term, name) in enumerate(zip(terms, names, strict=True)):
        if term.name in entry.fixed:
            values[row] = entry.fixed[term.name]
            continue
        found = [
            each
            for each in (() if fit is None else fit.estimates)
            if each.name.split("[")[0] == name and np.isfinite(each.value)
        ]
        if found and fit is not None:
            values[row] = np.mean([each.value for each in found])
            for each in found:
                if each.name in fit.names:
                    mix[row, fit.names.index(each.name)] = 1.0 / len(found)
        elif term.name in entry.prior:
            values[row], sigma = entry.prior[term.name]
            covariance[row, row] = sigma**2
        else:
            raise InputError(
                f"the flights tell nothing of {name}",
                f"model file, {entry.axis}",
                f"state what is known beforehand: prior = {{{term.name} = [value, sigma]}}",
            )
    if fit is not None:
        covariance += mix @ fit.covariance @ mix.T
    return values, covariance
