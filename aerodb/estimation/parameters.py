"""Named parameters of a model: which are free, fixed, tied to another, bounded, or known
beforehand."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from aerodb.errors import InputError, nearest
from aerodb.support import Array


@dataclass(frozen=True)
class Parameter:
    """One parameter.

    Parameters
    ----------
    name : unique in its model. A parameter of one record ends with the record's name in brackets:
        ``bias_p[f1_017]``, ``initial_v[f1_017]``.
    value : start value of a free parameter, or the value of a fixed one.
    unit : SI unit, for reports.
    free : False: held at `value`.
    lower, upper : bounds.
    prior, prior_error : what is known beforehand, mean and standard deviation; None: nothing.
    tied : (other parameter, factor): the value is the factor times the other's.
    random_walk : standard deviation of its change within a second, in its unit; with time it grows
        by the root. 0: constant. Methods other than the Kalman filters take it as constant.
    """

    name: str
    value: float
    unit: str = "1"
    free: bool = True
    lower: float = -np.inf
    upper: float = np.inf
    prior: float | None = None
    prior_error: float | None = None
    tied: tuple[str, float] | None = None
    random_walk: float = 0.0


@dataclass(frozen=True)
class Parameters:
    """The parameters of a model, in order.

    Raises InputError for a name that occurs twice, a tie to an unknown, tied or own name, bounds
    that exclude the start value, and a prior without a positive standard deviation.
    """

    items: tuple[Parameter, ...]

    def __post_init__(self) -> None:
        names = self.names
        for item in self.items:
            where = f"parameter {item.name}"
            if names.count(item.name) > 1:
                raise InputError("the name stands twice", where, "name each parameter once")
            if not np.isfinite(item.value) or not item.lower <= item.value <= item.upper:
                raise InputError(
                    f"the start value {item.value:g} is outside {item.lower:g} to {item.upper:g}",
                    where,
                    "start inside the bounds",
                )
            if item.tied is not None and (
                item.tied[0] not in names or self[item.tied[0]].tied is not None
            ):
                raise InputError(
                    f"it cannot be tied to '{item.tied[0]}'",
                    where,
                    nearest(item.tied[0], [each.name for each in self.items if each.tied is None]),
                )
            if (item.prior is None) != (item.prior_error is None) or (
                item.prior_error is not None and not item.prior_error > 0
            ):
                raise InputError(
                    "a prior needs a value and a positive standard deviation", where, "state both"
                )

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names of all p parameters, as a tuple (p,) in the order of `items`."""
        return tuple(item.name for item in self.items)

    @cached_property
    def unknown(self) -> tuple[Parameter, ...]:
        """The f parameters that are estimated: free ones that are tied to no other. A tuple (f,) in
        the order of the declaration, in SI units."""
        return tuple(item for item in self.items if item.free and item.tied is None)

    def __getitem__(self, name: str) -> Parameter:
        for item in self.items:
            if item.name == name:
                return item
        raise InputError(f"no parameter '{name}'", "model", nearest(name, self.names))

    def start(self) -> Array:
        """Start values (f,) of the unknown parameters, in the SI unit of each."""
        return np.array([item.value for item in self.unknown])

    def values(self, vector: Array) -> dict[str, Array]:
        """Return the value of every parameter, each (k,), or a number where `vector` is (f,).

        vector : the unknown parameters, (f,) or (f, k) for k runs side by side.

        In the unit of each, SI.
        """
        known = {item.name: np.asarray(item.value) for item in self.items if item.tied is None}
        known |= {
            item.name: np.asarray(value) for item, value in zip(self.unknown, vector, strict=True)
        }
        tied = {
            item.name: item.tied[1] * known[item.tied[0]]
            for item in self.items
            if item.tied is not None
        }
        whole = {**known, **tied}
        return {name: np.asarray(whole[name]) for name in self.names}

    @cached_property
    def jacobian(self) -> Array:
        """Derivatives (p, f) of all p parameters with respect to the f unknown ones. Units are
        those of a parameter per those of the one that it is tied to."""
        column = {item.name: j for j, item in enumerate(self.unknown)}
        matrix = np.zeros((len(self.items), len(column)))
        for row, item in enumerate(self.items):
            source, factor = item.tied or (item.name, 1.0)
            if source in column:
                matrix[row, column[source]] = factor
        return matrix

    @cached_property
    def offset(self) -> Array:
        """Values (p,) of all parameters where the unknown ones are zero, in the SI unit of each."""
        still = self.values(np.zeros(len(self.unknown)))
        return np.array([float(value) for value in still.values()])

    def changed(self, values: Mapping[str, float]) -> "Parameters":
        """The same parameters with other start values; unknown names raise InputError. values :
        name -> start value in SI units."""
        for name in values:
            self[name]
        return Parameters(
            tuple(
                replace(item, value=float(values.get(item.name, item.value))) for item in self.items
            )
        )

    def with_more(self, more: Iterable[Parameter]) -> "Parameters":
        """The same parameters and `more` after them. Raises InputError for a name that occurs
        twice, as `Parameters`; values are in SI units."""
        return Parameters((*self.items, *more))


def bounds_of(unknown: Sequence[Parameter]) -> tuple[Array, Array]:
    """Return lower and upper bounds, (f,) each, in the unit of each parameter, -inf and inf where
    there is none."""
    return (
        np.array([item.lower for item in unknown], dtype=np.float64),
        np.array([item.upper for item in unknown], dtype=np.float64),
    )


def priors_of(unknown: Sequence[Parameter]) -> tuple[Array, Array]:
    """Return mean (f,) and standard deviation (f,) of the priors, in the SI unit of each; 0 and inf
    where there is none."""
    return (
        np.array([0.0 if item.prior is None else item.prior for item in unknown]),
        np.array([np.inf if item.prior_error is None else item.prior_error for item in unknown]),
    )
