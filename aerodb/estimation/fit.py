"""The answer that every method gives: estimates with their standing, residuals, and what the method
assumes."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from aerodb.estimation.independence import InputCorrelation
from aerodb.signals import Theil
from aerodb.support import Array

#: What an estimate is worth: ``estimated``; ``fixed`` or ``tied`` by the user; ``prior``: the data
#: add nothing to the prior; ``at bound``; ``not excited``: the record does not move what it acts
#: on; ``not identifiable``: others take its place; ``biased``: the method draws it towards its
#: start value; ``left out``: the method took the term out of the model; ``diverged``: the search
#: did not end.
Standing = Literal[
    "estimated",
    "fixed",
    "tied",
    "prior",
    "at bound",
    "not excited",
    "not identifiable",
    "biased",
    "left out",
    "diverged",
]


@dataclass(frozen=True)
class ParameterEstimate:
    """One estimate.

    Parameters
    ----------
    name, unit : of the parameter.
    value : NaN where the standing says that the data give none.
    standard_error : corrected for coloured residuals; NaN where there is none.
    standing : see `Standing`.
    reason : what the standing means here, and what would help; empty for ``estimated``.
    cramer_rao : lower bound of the standard error, as if the residuals were white; NaN where the
        method has none.
    insensitivity : standard error, for white residuals, if all other parameters were known: how far
        the outputs do not notice it; NaN where the method has none.
    """

    name: str
    value: float
    standard_error: float
    unit: str = "1"
    standing: Standing = "estimated"
    reason: str = ""
    cramer_rao: float = np.nan
    insensitivity: float = np.nan


@dataclass(frozen=True)
class AxisError:
    """What a fit leaves on an axis, over all of its records.

    Parameters
    ----------
    error, flown : root mean square of what is left, and standard deviation of what was measured, in
        the unit of the axis.
    load : the error as a force [N] or moment [N m]; NaN where the dynamic pressure varies.
    """

    error: float
    flown: float
    load: float = np.nan

    @property
    def r_squared(self) -> float:
        """Share of the square of what was measured, about its mean, that the fit explains; without
        unit, NaN where nothing was measured."""
        return 1.0 - (self.error / self.flown) ** 2 if self.flown > 0.0 else np.nan


@dataclass(frozen=True, eq=False)
class Fit:
    """Result of one method.

    Parameters
    ----------
    method : its name on the command line, such as ``output-error``.
    estimates : every parameter, those that were fixed too.
    names : of the k parameters that `covariance` belongs to.
    covariance : (k, k), corrected for coloured residuals.
    residuals : record -> output -> (n,), measured minus model, SI; NaN where not measured.
    fitted : record -> output -> (n,), of the model. times : record -> (n,) [s] of both, from the
        first sample.
    noise : output -> estimated standard deviation of the measurement noise, SI.
    theil : record -> output -> agreement.
    converged : whether the search ended at an optimum.
    iterations : of the search; 0 for a method without one.
    degrees_of_freedom : independent samples less estimates, of Student's t; inf for the normal.
    log_likelihood : NaN for methods without one.
    tests : what a method tested -> probability of such data if it were not there.
    histories : record -> parameter that changes with time -> (n, 2), smoothed values and standard
        errors.
    input_correlations : of residuals with inputs before them; empty where nobody asked.
    axes : axis -> what is left there; empty where records are not of axes.
    regressors : (k, k) correlations of the columns of `names`, NaN for one that stands still; None
        where nothing is linear.
    assumes : what the method takes for granted, one sentence each.
    notes : what the user must know of this result, one sentence each.
    reservations : what speaks against believing it, one sentence each.
    """

    method: str
    estimates: tuple[ParameterEstimate, ...]
    names: tuple[str, ...]
    covariance: Array
    residuals: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    fitted: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    times: Mapping[str, Array] = field(default_factory=dict)
    noise: Mapping[str, float] = field(default_factory=dict)
    theil: Mapping[str, Mapping[str, Theil]] = field(default_factory=dict)
    converged: bool = True
    iterations: int = 0
    degrees_of_freedom: float = np.inf
    log_likelihood: float = np.nan
    tests: Mapping[str, float] = field(default_factory=dict)
    histories: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    input_correlations: tuple[InputCorrelation, ...] = ()
    axes: Mapping[str, AxisError] = field(default_factory=dict)
    regressors: Array | None = None
    assumes: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    reservations: tuple[str, ...] = ()

    def __getitem__(self, name: str) -> ParameterEstimate:
        """The estimate of this name; KeyError where there is none."""
        for estimate in self.estimates:
            if estimate.name == name:
                return estimate
        raise KeyError(name)

    def interval(self, name: str, level: float = 0.95) -> tuple[float, float]:
        """Confidence interval of an estimate at `level`, by Student's t; NaN without standard
        error."""
        from scipy.special import stdtrit  # slow to import

        each = self[name]
        half = each.standard_error * float(stdtrit(self.degrees_of_freedom, 0.5 + level / 2.0))
        return each.value - half, each.value + half

    def p_value(self, name: str) -> float:
        """Dimensionless probability of an estimate at least this far from zero if the truth were
        zero, by Student's t, two-sided; NaN without standard error. Raises KeyError for a parameter
        that it has not."""
        from scipy.special import stdtr  # slow to import

        each = self[name]
        if not each.standard_error > 0.0:
            return float("nan")
        return 2.0 * float(stdtr(self.degrees_of_freedom, -abs(each.value) / each.standard_error))

    @property
    def correlation(self) -> Array:
        """Correlation (k, k) of the estimates, without unit."""
        deviation = np.sqrt(np.diag(self.covariance))
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.covariance / np.outer(deviation, deviation)
        return np.where(np.isfinite(ratio), ratio, np.eye(len(deviation)))
