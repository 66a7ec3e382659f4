"""The estimation methods by their names on the command line."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Final, Literal

from aerodb.errors import InputError, nearest
from aerodb.estimation import Fit

#: The method of `aerodb.increments.estimate_increments`.
REGRESSION: Final = "regression"
#: What a method solves: linear equations, or a model that is flown.
Kind = Literal["equation error", "dynamic"]


@dataclass(frozen=True)
class Method:
    """One method.

    Parameters
    ----------
    name : on the command line.
    kind : ``equation error``: called with a `LinearEquation`; ``dynamic``: called with a
        `DynamicModel` and its `TimeHistory` records.
    function : module and name of the function; it is imported when it is first called.
    display : a help for judgement, never a candidate.
    disturbed : its states have process noise: those that outputs show. slow : `all` leaves
    it out, as it searches from several starts. linear : it takes linear models alone.
    """

    name: str
    kind: Kind
    function: tuple[str, str]
    display: bool = False
    disturbed: bool = False
    slow: bool = False
    linear: bool = False

    def load(self) -> Callable[..., Fit]:
        """Return the function that estimates (`Method.function`); raises ImportError where its
        module is missing."""
        module, name = self.function
        found: Callable[..., Fit] = getattr(import_module(module), name)
        return found


_METHODS = (
    Method(REGRESSION, "equation error", ("aerodb.estimation", "regression")),
    Method(
        "frequency-domain", "equation error", ("aerodb.estimation", "frequency_domain_regression")
    ),
    Method("fourier-regression", "equation error", ("aerodb.estimation", "fourier_regression")),
    Method("recursive", "equation error", ("aerodb.estimation", "recursive_least_squares")),
    Method(
        "normalised-recursive",
        "equation error",
        ("aerodb.estimation", "normalised_recursive_least_squares"),
    ),
    Method(
        "principal-components",
        "equation error",
        ("aerodb.estimation.regression", "principal_components"),
    ),
    Method(
        "total-least-squares",
        "equation error",
        ("aerodb.estimation.regression", "total_least_squares"),
    ),
    Method(
        "instrumental-variables",
        "equation error",
        ("aerodb.estimation.regression", "instrumental_variables"),
    ),
    Method(
        "stepwise", "equation error", ("aerodb.estimation.regression", "stepwise"), display=True
    ),
    Method(
        "orthogonal-functions",
        "equation error",
        ("aerodb.estimation.regression", "orthogonal_functions"),
        display=True,
    ),
    Method("output-error", "dynamic", ("aerodb.estimation", "output_error")),
    Method("filter-error", "dynamic", ("aerodb.estimation", "filter_error"), disturbed=True),
    Method("ekf", "dynamic", ("aerodb.estimation", "extended_kalman"), disturbed=True),
    Method("ukf", "dynamic", ("aerodb.estimation", "unscented_kalman"), disturbed=True),
    Method("multiple-shooting", "dynamic", ("aerodb.estimation", "multiple_shooting")),
    Method(
        "frequency-domain-output-error",
        "dynamic",
        ("aerodb.estimation", "frequency_domain_output_error"),
        linear=True,
    ),
    Method(
        "nonlinear-refinement",
        "dynamic",
        ("aerodb.estimation", "nonlinear_refinement"),
        slow=True,
    ),
)

#: Name -> method, in the order in which they are tried and printed.
METHODS: Final[dict[str, Method]] = {method.name: method for method in _METHODS}


def chosen_methods(names: Sequence[str], *, linear: bool = True) -> tuple[Method, ...]:
    """Methods by name; ``all`` for every one that is neither a display nor slow, and, unless the
    model is `linear`, takes others than linear models.

    Raises InputError with the nearest name for an unknown one.
    """
    if list(names) == ["all"]:
        usual = (m for m in METHODS.values() if not m.display and not m.slow)
        return tuple(m for m in usual if linear or not m.linear)
    for name in names:
        if name not in METHODS:
            raise InputError(f"no method '{name}'", remedy=nearest(name, METHODS, len(METHODS)))
    return tuple(METHODS[name] for name in dict.fromkeys(names))
