"""What flight-path reconstruction gives: estimates, and one path for each record."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from aerodb.consistency.sensors import FlightRecord, SensorParameter
from aerodb.support import Array


@dataclass(frozen=True)
class Estimate:
    """One estimated parameter, SI: value, standard error for coloured residuals and for white ones,
    and whether the value is at a bound."""

    parameter: SensorParameter
    value: float
    standard_error: float
    white_standard_error: float
    at_bound: bool = False


@dataclass(frozen=True)
class ReconstructedPath:
    """One record reconstructed, n samples.

    states : (9, n), order of `kinematics.STATES`.
    air : (3, n), velocity of the CG through the air, body axes [m/s].
    inputs : (n, 6), corrected specific force [m/s2] and rates [rad/s].
    residuals, before : channel -> (n,), measured minus reconstructed, after and before the
        estimation, SI (nan where not used).
    state_sigma : (9, n), standard errors of the states; nan where they were not asked for.
    air_sigma : (3, n), standard errors of V [m/s], alpha and beta [rad]; likewise.
    """

    record: FlightRecord
    states: Array
    air: Array
    inputs: Array
    residuals: Mapping[str, Array]
    before: Mapping[str, Array]
    state_sigma: Array
    air_sigma: Array

    @property
    def V(self) -> Array:
        """(n,) true airspeed at the CG, m/s."""
        return np.asarray(np.sqrt(np.sum(self.air**2, axis=0)))

    @property
    def alpha(self) -> Array:
        """(n,) angle of attack at the CG, rad."""
        return np.asarray(np.arctan2(self.air[2], self.air[0]))

    @property
    def beta(self) -> Array:
        """(n,) angle of sideslip at the CG, rad."""
        return np.asarray(np.arcsin(self.air[1] / self.V))


@dataclass(frozen=True)
class Reconstruction:
    """A joint reconstruction.

    estimates : one per unknown, k in all. covariance : (k, k), in their order, SI.
    still : (k, k), the part of the covariance that does not come from the vertical motion of the
        air.
    white : (k, k), covariance for white residuals: that of the search.
    noise : channel -> one sigma of its residual, SI. paths : one per record.
    converged, iterations : of the Gauss-Newton search.
    air_sigma : standard deviation of the air's slow vertical velocity given the residuals [m/s],
        zero where nothing of a vane is estimated.
    completed : gives the reconstruction with its covariances, where these are still those of white
        residuals.
    """

    estimates: tuple[Estimate, ...]
    covariance: Array
    still: Array
    white: Array
    noise: Mapping[str, float]
    paths: tuple[ReconstructedPath, ...]
    converged: bool
    iterations: int
    air_sigma: float
    completed: Callable[[], "Reconstruction"] | None = field(default=None, repr=False)

    @cached_property
    def whole(self) -> "Reconstruction":
        """The reconstruction with its covariances."""
        return self if self.completed is None else self.completed()

    def __getitem__(self, label: str) -> Estimate:
        """The estimate with a label (``ax_bias``, ``wind_north[flight]``); raises KeyError when it
        was not estimated."""
        return {estimate.parameter.label: estimate for estimate in self.estimates}[label]
