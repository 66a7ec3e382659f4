"""Knots that the model file leaves to the flights: ``knots = {alpha = "chosen"}``."""

from collections.abc import Mapping, Sequence

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.errors import InputError
from aerodb.estimation import chosen_knots, own_constants
from aerodb.flight import Flight
from aerodb.increments.model_file import CONSTANT, DeclaredIncrement, ModelFile, expand
from aerodb.increments.samples import AxisSamples, axis_samples, channels_of, with_model_rates
from aerodb.increments.spline_terms import split_key
from aerodb.support import Array
from aerodb.tables import AeroDatabase, evaluate, parse

#: Digits of a chosen knot in SI units.
_DIGITS = 4


def with_chosen_knots(
    flights: Sequence[Flight],
    comparisons: Sequence[Comparison],
    model: ModelFile,
    database: AeroDatabase,
) -> ModelFile:
    """Return the model file with knots from the flights where it leaves them open.

    They are chosen from what the axis lacks with its other terms (`chosen_knots`); several open
    splines of an axis one after the other, with the others as single terms until theirs come.

    Raises InputError where a variable does not move, and as `channels_of`.
    """
    if all(all(declared.knots.values()) for declared in model.increment):
        return model
    flights = with_model_rates(flights, comparisons, model)
    channels = channels_of(flights, model, database)
    return ModelFile(
        increment=tuple(
            _settled(declared, flights, channels, comparisons) for declared in model.increment
        )
    )


def _settled(
    declared: DeclaredIncrement,
    flights: Sequence[Flight],
    channels: Sequence[Mapping[str, Array]],
    comparisons: Sequence[Comparison],
) -> DeclaredIncrement:
    for key in [key for key, knots in declared.knots.items() if not knots]:
        samples = axis_samples(declared, flights, channels, comparisons)
        if not samples:
            raise InputError(
                f"no flight gives a usable sample on {declared.axis}",
                f"knots of {key}",
                "state them, or remove the axis from the model file",
            )
        knots = _knots(declared, key, samples)
        declared = DeclaredIncrement.model_validate(
            {**declared.model_dump(), "knots": {**declared.knots, key: knots}}
        )
    return declared


def _knots(
    declared: DeclaredIncrement, key: str, samples: Sequence[AxisSamples]
) -> tuple[float, ...]:
    term, variable = split_key(key)
    regressors = expand(declared)
    lengths = [each.count for each in samples]
    values = np.concatenate([_series(variable, each) for each in samples])
    others = np.concatenate([each.columns[each.good] for each in samples])
    names = [regressor.name for regressor in regressors]
    if declared.own_constants:
        others, _ = own_constants(others, lengths, names.index(CONSTANT))
        names.remove(CONSTANT)
        names += [CONSTANT] * len(lengths)
    factor = None if term in (variable, CONSTANT) else others[:, names.index(term)]
    beside = others[:, [name != term for name in names]]
    if term == variable and not declared.own_constants:  # the spline holds the constant
        beside = others[:, [name not in (term, CONSTANT) for name in names]]
    response = np.concatenate(
        [each.comparison.residual(declared.axis)[each.good] for each in samples]
    )
    try:
        knots = chosen_knots(values, response, beside, declared.spline, factor, lengths)
    except InputError as error:
        where = f"knots of {key} on {declared.axis}"
        raise InputError(error.what, where, "state them, or fly a range of it") from error
    return tuple(dict.fromkeys(round(knot, _DIGITS) for knot in knots))


def _series(variable: str, samples: AxisSamples) -> Array:
    """The variable of a spline (n,) at the samples that are used."""
    n = len(samples.comparison.time)
    values = evaluate(parse(variable), samples.channels)
    return np.asarray(np.broadcast_to(values, (n,))[samples.good])
