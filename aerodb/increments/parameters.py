"""Estimate parameters of a database from the residuals of several flights.

A parameter acts on several axes, through several expressions, and not always linearly. So all axes
are fitted together, each in units of the error that is left there, about the present values, and
again until these stay (Gauss-Newton). Each flight has a constant of its own on each axis: what
biased sensors leave says nothing of a parameter. What noise of the deflections takes is given back
(`noisy_deflections`). Standard errors are those of declared increments.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from aerodb.coefficients import Comparison
from aerodb.errors import InputError, nearest
from aerodb.estimation import (
    Regression,
    least_squares,
    noise_alone,
    shared_coloured_sum,
    within_bounds,
)
from aerodb.increments.considered import ConsiderParameter, consider_covariance
from aerodb.increments.constraints import alias_groups, constrained_fit, correlation_of
from aerodb.increments.noisy_deflections import with_noise, without_deflection_noise
from aerodb.increments.samples import as_compared
from aerodb.increments.unmeasured_air import air_covariance
from aerodb.nomenclature import in_order
from aerodb.signals import rms
from aerodb.support import Array, Mask
from aerodb.tables import (
    AeroDatabase,
    flown_envelope,
    parameter_inside,
    sigma_of,
    slopes_along,
    with_estimated_parameters,
    with_own_states,
    with_parameters,
)

#: The search ends when no value moves by more than this part of its standard error,
_SETTLED: Final = 0.05
#: or after so many solutions.
_MOST: Final = 8
#: Weights of axes are found before it. This ends when no value moves by more than this part of its
#: standard error for white residuals,
_SAME: Final = 1e-3
#: or after so many solutions.
_MOST_WEIGHTS: Final = 100
#: Share of a square of the residual below which products of samples tell rounding.
_ROUNDING: Final = 1e-10
#: Variation, as a part of the largest value, below which a column is a constant.
_STILL: Final = 1e-9
#: Share of the standard deviation of all values between the bounds (their distance over sqrt(12))
#: above which flights have told nothing of a parameter. Priors of the regression have the same.
_NOTHING_TOLD: Final = 0.95


@dataclass(frozen=True)
class ParameterEstimates:
    """The database with the estimates, and what speaks against them, in sentences."""

    database: AeroDatabase
    reservations: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class ParameterSamples:
    """One flight on one axis beside a database: residual (n,), its slopes by k parameters (n, k)
    per unit of each, and which samples are used (n,). size : rms that is left on the axis.
    centred : whether samples count about their mean."""

    axis: str
    comparison: Comparison
    good: Mask
    residual: Array
    slopes: Array
    size: float = 1.0
    centred: bool = True

    def over(self, chosen: Mask | slice) -> tuple[Array, Array]:
        """Slopes (m, k) and residual (m,) of chosen samples, about their means where `centred`, in
        units of `size`."""
        slopes, residual = self.slopes[chosen], self.residual[chosen]
        if not self.centred:
            return slopes / self.size, residual / self.size
        return (slopes - slopes.mean(axis=0)) / self.size, (residual - residual.mean()) / self.size


def estimate_parameters(
    comparisons: Sequence[Comparison],
    names: Sequence[str],
    database: AeroDatabase,
    consider: Mapping[str, Sequence[ConsiderParameter]],
    own_constants: bool = True,
) -> ParameterEstimates:
    """Estimate parameters of `database` from comparisons with it, at their full rate.

    consider : flight id -> sensor errors that the standard errors then include. Estimates (k,) and
    covariance (k, k) are in the parameters' units. A prior counts where no flight has estimated the
    parameter yet; bounds hold. Raises InputError for an unknown parameter, for one that these
    flights do not move, and for parameters of which one is a combination of others.
    """
    check_parameters_of(names, database)
    present, settled = database, False
    priors, bounds = _priors(names, database), _bounds(names, database)
    present = start_of_search(comparisons, names, database, own_constants)
    for _ in range(_MOST):
        about = present
        samples = parameter_samples(comparisons, names, about, own_constants)
        _check_moved(samples, names)
        fit = _fitted(samples, names, present, consider)
        constrained = constrained_fit(fit, priors, bounds)
        values = dict(zip(names, constrained.estimates.tolist(), strict=True))
        sigma = np.sqrt(np.diag(constrained.covariance))
        moved = np.array([abs(values[name] - present.parameters[name]) for name in names])
        present = with_parameters(present, values)
        if np.all(moved <= _SETTLED * sigma):
            settled = True
            break
    unsure = [
        name
        for name, error in zip(names, sigma, strict=True)
        if name in constrained.at_bound or 2.0 * error > abs(values[name])
    ]
    _check_no_noise(comparisons, unsure, about, own_constants)
    sizes = {each.axis: each.size for each in samples}
    fit, noise = _without_deflection_noise(fit, comparisons, about, sizes, own_constants)
    constrained = constrained_fit(fit, priors, bounds)
    values = dict(zip(names, constrained.estimates.tolist(), strict=True))
    sigma = np.sqrt(np.diag(constrained.covariance))
    flights = tuple(dict.fromkeys(each.comparison.flight for each in samples))
    flown = flown_envelope(database.flight_inputs, _flown(samples), database)
    return ParameterEstimates(
        with_estimated_parameters(database, values, constrained.covariance, flights, flown),
        (
            *([] if settled else [f"The parameters still move after {_MOST} solutions"]),
            *noise,
            *(f"{name} ended on a bound" for name in constrained.at_bound),
            *(
                f"These flights tell no more of {name} than its bounds do: leave it out"
                for name, error in zip(names, sigma, strict=True)
                if tells_nothing(database, name, float(error))
            ),
            *(
                f"These flights cannot separate {' and '.join(group)}"
                for group in alias_groups(names, correlation_of(constrained.covariance))
            ),
        ),
    )


def moved_by_noise_alone(
    comparisons: Sequence[Comparison],
    names: Sequence[str],
    database: AeroDatabase,
    own_constants: bool = True,
) -> list[str]:
    """Return the parameters that act in these flights by noise of the deflections and little else.

    comparisons : at the full rate. Raises InputError as `parameter_samples` does.
    """
    noisy = [with_noise(comparison) for comparison in comparisons]
    if not names or all(each is None for each in noisy):
        return []

    def told(those: Sequence[Comparison]) -> Array:
        parts = [
            np.square(each.over(each.good)[0] * each.size / sizes.setdefault(each.axis, each.size))
            for each in parameter_samples(those, names, database, own_constants)
        ]
        return np.sum([part.sum(axis=0) for part in parts], axis=0)

    sizes: dict[str, float] = {}
    product = told(comparisons)
    sides = [
        told(
            [c if both is None else both[side] for c, both in zip(comparisons, noisy, strict=True)]
        )
        for side in (0, 1)
    ]
    found = noise_alone(product, 0.5 * (sides[0] + sides[1]) - product)
    return [name for name, each in zip(names, found, strict=True) if each]


def _check_no_noise(
    comparisons: Sequence[Comparison],
    names: Sequence[str],
    database: AeroDatabase,
    own_constants: bool,
) -> None:
    """Raise InputError naming parameters that noise of the deflections moves and little else."""
    if alone := moved_by_noise_alone(comparisons, names, database, own_constants):
        raise InputError(
            f"most of what moves {' and '.join(alone)} in these flights is noise of deflections",
            "estimate",
            "fly what they act on, or leave them out",
        )


def between_bounds(database: AeroDatabase, name: str) -> float:
    """Return the standard deviation of all values between the bounds of a parameter, in its unit;
    inf without bounds. KeyError for a name that it has not."""
    known = database.variables[name].parameter
    return np.inf if known is None else float(np.ptp(known.bounds)) / np.sqrt(12.0)


def tells_nothing(database: AeroDatabase, name: str, error: float) -> bool:
    """Return whether an estimate of a parameter with this standard error [its unit] tells no more
    than its bounds do; between them, all values are as likely beforehand."""
    return error > _NOTHING_TOLD * between_bounds(database, name)


def check_parameters_of(names: Sequence[str], database: AeroDatabase) -> None:
    """Raise InputError for a name that is no parameter of a database, with the nearest known one,
    and for a parameter that no expression uses."""
    for name in names:
        if name not in database.parameters:
            raise InputError(
                f"the database has no parameter '{name}'",
                f"database {database.name}",
                nearest(name, database.parameters)
                if database.parameters
                else "write [parameters] in the database file, and import it",
            )
    if unused := [name for name in database.unused_parameters if name in names]:
        raise InputError(
            f"no expression of the database uses {' or '.join(unused)}",
            f"database {database.name}",
            "use it in a part, a variable or a term, or leave it out",
        )


def parameter_samples(
    comparisons: Sequence[Comparison],
    names: Sequence[str],
    present: AeroDatabase,
    own_constants: bool = True,
) -> list[ParameterSamples]:
    """Return the samples of flights on the axes that parameters (k) reach, beside a database.

    comparisons : at the full rate, with that database or with one that differs in values of
    parameters only. Slopes (n, k) are per unit of each parameter. Raises InputError for a
    comparison that is not at the full rate.
    """
    found = []
    for comparison in comparisons:
        side = comparison.database_side
        if side is None:
            raise InputError(
                "this comparison is not at the flight's full rate",
                f"flight {comparison.flight}",
                "compare the flight as it is stored",
            )
        time, channels = comparison.time, side.channels
        now = present.predict(with_own_states(present, time, channels)).coefficients
        slopes = [slopes_along(present, name, time, channels) for name in names]
        for axis in in_order(comparison.usable):
            if not any(axis in each for each in slopes):
                continue
            still = np.zeros(len(comparison.time))
            columns = [as_compared(axis, each.get(axis, still), comparison) for each in slopes]
            residual = comparison.measured[axis] - as_compared(
                axis, np.broadcast_to(now.get(axis, 0.0), still.shape), comparison
            )
            good = comparison.usable[axis] & np.isfinite(residual)
            if good.any():
                matrix = np.column_stack(columns)
                found.append(
                    ParameterSamples(
                        axis, comparison, good, residual, matrix, centred=own_constants
                    )
                )
    return [replace(each, size=_left(found, each.axis)) for each in found]


def start_of_search(
    comparisons: Sequence[Comparison],
    names: Sequence[str],
    database: AeroDatabase,
    own_constants: bool = True,
    known: Mapping[str, tuple[float, float]] = {},
    stretches: Callable[[ParameterSamples], Sequence[Mask | slice]] = lambda each: (each.good,),
) -> AeroDatabase:
    """Return the database with values at which a search for parameters (k) begins.

    Each axis counts in units of the error that is left there, and this depends on the values. With
    slopes as they are at the present values, products (k + 1, k + 1) of each axis tell both until
    they stay, without another look at the samples. Bounds hold.

    known : parameter -> value and standard deviation beforehand [its unit], beside the priors of
    the database. stretches : what is fitted of samples, each about its mean. Raises InputError as
    `parameter_samples` does.
    """
    k = len(names)
    left, told = (dict[str, Array]() for _ in range(2))
    counts: dict[str, int] = {}
    for each in parameter_samples(comparisons, names, database, own_constants):
        raw = replace(each, size=1.0)
        counts[each.axis] = counts.get(each.axis, 0) + int(each.good.sum())
        for sums, parts in ((left, (each.good,)), (told, stretches(each))):
            products = [np.column_stack(raw.over(part)) for part in parts]
            sums[each.axis] = sums.get(each.axis, np.zeros((k + 1, k + 1))) + sum(
                part.T @ part for part in products
            )
    present = np.array([database.parameters[name] for name in names])
    prior, bounds = {**_priors(names, database), **known}, _bounds(names, database)
    ahead, sigma = np.array([prior.get(name, (0.0, np.inf)) for name in names]).T
    low, high = np.array([bounds.get(name, (-np.inf, np.inf)) for name in names]).T - present
    change = np.zeros(k)
    for _ in range(_MOST_WEIGHTS):
        both = np.append(-change, 1.0)
        whole = sum(
            told[axis] * counts[axis] / max(both @ of @ both, _ROUNDING * of[-1, -1], 1e-300)
            for axis, of in left.items()
        )
        information = whole[:-1, :-1] + np.diag(sigma**-2.0)
        inverse = _inverse(information)
        free = inverse @ (whole[:-1, -1] + (ahead - present) * sigma**-2.0)
        before, change = change, within_bounds(free, information, low, high)[0]
        if np.all(np.abs(change - before) <= _SAME * np.sqrt(np.diag(inverse))):
            break
    values = dict(zip(names, (present + change).tolist(), strict=True))
    return with_parameters(
        database, {name: parameter_inside(database, name, x) for name, x in values.items()}
    )


def _inverse(information: Array) -> Array:
    """Inverse (k, k) of an information matrix, zero along what it does not tell."""
    size = np.sqrt(np.maximum(np.diag(information), 1e-300))
    return np.asarray(
        np.linalg.pinv(information / np.outer(size, size), rcond=1e-12, hermitian=True)
        / np.outer(size, size)
    )


def _check_moved(samples: Sequence[ParameterSamples], names: Sequence[str]) -> None:
    """Raise InputError naming parameters that move nothing, or only a constant."""
    moves = np.zeros(len(names), dtype=np.bool_)
    for each in samples:
        used = each.slopes[each.good]
        size = np.abs(used).max(axis=0)
        moves |= (np.ptp(used, axis=0) if each.centred else size) > _STILL * size
    if still_ones := [name for name, each in zip(names, moves, strict=True) if not each]:
        raise InputError(
            f"in these flights {' and '.join(still_ones)}"
            f" change{'s' * (len(still_ones) == 1)} nothing, or only a constant",
            "estimate",
            "fly what they act on, or leave them out: a constant is taken for a sensor's bias",
        )


def _left(samples: Sequence[ParameterSamples], axis: str) -> float:
    """The error that is left on an axis, about the mean of each flight where that is its own; rms
    over all."""
    return rms(np.concatenate([s.over(s.good)[1] for s in samples if s.axis == axis])) or 1.0


def _fitted(
    samples: Sequence[ParameterSamples],
    names: Sequence[str],
    present: AeroDatabase,
    consider: Mapping[str, Sequence[ConsiderParameter]],
) -> Regression:
    """Least squares about the present values, every flight and axis about its mean and in units of
    what is left there."""
    pairs = [each.over(each.good) for each in samples]
    matrix = np.concatenate([slopes for slopes, _ in pairs])
    left = np.concatenate([residual for _, residual in pairs])
    values = np.array([present.parameters[name] for name in names])
    try:
        fit = least_squares(
            matrix, left + matrix @ values, names, [len(residual) for _, residual in pairs]
        )
    except ValueError as error:
        remedy = "leave one of them out, or fly manoeuvres that separate them"
        raise InputError(f"parameters: {error}", "update", remedy) from error
    doubt = consider_covariance(
        matrix,
        [(each.axis, each.comparison, each.good) for each in samples],
        consider,
        {each.axis: each.size for each in samples},
    )
    doubt = doubt + air_covariance([(each, each.good) for each in samples], present)
    return replace(fit, covariance=_shared_covariance(samples, matrix, fit.residual) + doubt)


def _shared_covariance(samples: Sequence[ParameterSamples], matrix: Array, left: Array) -> Array:
    """Covariance (k, k) of estimates with residuals (n,) that are coloured and that the axes of a
    flight share: an error of a deflection, of the airspeed or of a flow angle is in all of them."""
    flights: dict[str, list[tuple[Array, Array, int]]] = {}
    start = 0
    for each in samples:
        used = int(each.good.sum())
        columns, residual = np.zeros(each.slopes.shape), np.zeros(len(each.good))
        columns[each.good] = matrix[start : start + used]
        residual[each.good] = left[start : start + used]
        flights.setdefault(each.comparison.flight, []).append((columns, residual, used))
        start += used
    gain = np.linalg.inv(matrix.T @ matrix)
    return np.asarray(gain @ sum(map(shared_coloured_sum, flights.values())) @ gain)


def _without_deflection_noise(
    fit: Regression,
    comparisons: Sequence[Comparison],
    about: AeroDatabase,
    sizes: Mapping[str, float],
    own_constants: bool,
) -> tuple[Regression, list[str]]:
    """The fit without the draw of noisy deflections, and what speaks against it, in sentences.

    about : the database of the fit. sizes : axis -> what its samples were divided by.
    """

    def equations(those: Sequence[Comparison]) -> tuple[Array, Array]:
        samples = parameter_samples(those, fit.names, about, own_constants)
        pairs = [replace(each, size=sizes[each.axis]).over(each.good) for each in samples]
        matrix = np.concatenate([slopes for slopes, _ in pairs])
        return matrix.T @ matrix, matrix.T @ np.concatenate([left for _, left in pairs])

    return without_deflection_noise(fit, comparisons, equations)


def _priors(names: Sequence[str], database: AeroDatabase) -> dict[str, tuple[float, float]]:
    """Name -> value and sigma of the parameters of which something is known before flight."""
    found = {}
    for name in names:
        variable = database.variables[name]
        sigma = sigma_of(variable.uncertainty)
        if sigma and variable.parameter is not None and not variable.parameter.flights:
            found[name] = (database.parameters[name], sigma)
    return found


def _bounds(names: Sequence[str], database: AeroDatabase) -> dict[str, tuple[float, float]]:
    known = {name: database.variables[name].parameter for name in names}
    return {name: each.bounds for name, each in known.items() if each is not None}


def _flown(samples: Sequence[ParameterSamples]) -> list[tuple[Mapping[str, Array], Mask]]:
    """Channels of each flight, and its samples (n,) that are used on every axis."""
    good: dict[str, tuple[Mapping[str, Array], Mask]] = {}
    for each in samples:
        side = each.comparison.database_side
        assert side is not None  # `parameter_samples` has asked
        _, earlier = good.get(each.comparison.flight, (None, each.good))
        good[each.comparison.flight] = (side.channels, earlier & each.good)
    return [each for each in good.values() if each[1].any()]
