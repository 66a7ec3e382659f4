"""Declared increments estimated while the log is being written.

The last seconds of the log become channels, total coefficients and equations exactly as a whole
flight does (`map_recording`, `total_coefficients`, `axis_equations`); the samples in the middle of
that window, where its ends no longer matter, enter a recursive estimator one by one. The rates are
thus differentiated with the same zero-phase filter as afterwards, a fixed time behind the flight.
Flight-path reconstruction, which needs the whole flight, is left out.
"""

from dataclasses import dataclass, field
from typing import Final, Literal

import numpy as np

from aerodb.coefficients import DEFAULT_BANDWIDTH, bandwidth_of, compare, total_coefficients
from aerodb.conditioning import flag_unusable
from aerodb.errors import InputError
from aerodb.estimation import (
    Fit,
    FourierRegression,
    LinearEquation,
    Parameters,
    RecursiveLeastSquares,
    running_frequencies,
)
from aerodb.flight import Flight
from aerodb.identification.equations import SHORTEST, axis_equations, no_database
from aerodb.increments import ModelFile
from aerodb.logs import Mapping, map_recording
from aerodb.recording import Recording
from aerodb.tables import AeroDatabase, ReferenceGeometry
from aerodb.vehicle import Vehicle, with_mass_channels

OnlineMethod = Literal["recursive", "normalised-recursive", "fourier-regression"]
ONLINE_METHODS: Final[tuple[OnlineMethod, ...]] = (
    "recursive",
    "normalised-recursive",
    "fourier-regression",
)
#: Time at the ends of a window that is not used, in periods of the bandwidth.
_EDGE = 4.0
#: Least such time [s].
_LEAST_EDGE = 1.0
#: Time constants after which a surface's lag has settled.
_SETTLED = 6.0
#: The flight's name in the equations.
_NAME: Final = "online"


@dataclass(frozen=True)
class OnlineSettings:
    """How the estimates are made.

    method : see `ONLINE_METHODS`. forgetting : of recursive least squares. highest : frequency [Hz]
    of Fourier transform regression; None: half the bandwidth of the moments. since : time [s] on
    the log's clock before which samples are left out.
    """

    method: OnlineMethod = "recursive"
    forgetting: float = 1.0
    highest: float | None = None
    since: float = -np.inf


@dataclass
class OnlineEstimation:
    """Estimates of the increments of a model file, of the log so far.

    mapping : of the log; None until it is known. database : that the increments are declared on;
    None: zero on all axes. `samples` : that entered. `reached` : time [s] of the last of them.
    """

    model: ModelFile
    vehicle: Vehicle
    mapping: Mapping | None
    database: AeroDatabase | None
    settings: OnlineSettings = field(default_factory=OnlineSettings)
    samples: int = 0
    reached: float = -np.inf
    _axes: dict[str, RecursiveLeastSquares | FourierRegression] = field(default_factory=dict)

    def __post_init__(self) -> None:
        fuel = self.vehicle.fuel
        if fuel is not None and fuel.flow and not fuel.used:
            raise InputError(
                "the fuel on board follows from the flow since the first sample",
                f"vehicle {self.vehicle.name}, [fuel]",
                "state where the log holds the fuel used, which needs no past",
            )
        if any(not at for declared in self.model.increment for at in declared.knots.values()):
            raise InputError(
                "knots cannot be chosen from a log that has not arrived", "model file", "state them"
            )
        self.reached = self.settings.since

    @property
    def edge(self) -> float:
        """Time [s] by which the estimates stay behind the log; `processing.bandwidth` [Hz] decides
        it."""
        bandwidth = self.vehicle.processing.bandwidth or DEFAULT_BANDWIDTH
        return max(_LEAST_EDGE, _EDGE / bandwidth)

    @property
    def latency(self) -> float:
        """Length of the log [s], a scalar, that is needed beyond what was reached, at first to
        settle the lags as well."""
        return self.edge if self._axes else 2.0 * self.edge + self._settling

    @property
    def needed(self) -> float:
        """Time [s], a scalar on the log's clock, since which the next window needs the log."""
        return self.reached - self.edge - self._settling

    @property
    def _settling(self) -> float:
        lag = max((surface.lag for surface in self.vehicle.surfaces.values()), default=0.0)
        return max(_SETTLED * lag, SHORTEST)

    def take(self, recording: Recording, *, final: bool = False) -> int:
        """Take what is new in a recording of the log since `needed`; returns the samples taken.

        final : the log has ended, and its last samples count as well.

        Raises InputError where the log cannot be mapped, and where no axis can be computed.
        """
        if self.mapping is None:
            raise InputError("no mapping is chosen", recording.source, "choose one")
        flight = map_recording(recording, self.mapping, self.vehicle, _NAME)
        flight = flag_unusable(with_mass_channels(flight, self.vehicle))
        coefficients = total_coefficients(flight, self.vehicle)
        if self.database is None:
            x, y, z = (float(value) for value in coefficients.moment_reference.mean(axis=0))
            own = self.vehicle.reference
            self.database = no_database(
                ReferenceGeometry(own.area, own.chord, own.span, (x, y, z), own.pressure)
            )
        comparison = compare(flight, coefficients, self.database, self.vehicle.reference)
        until = float(flight.time[-1]) - (0.0 if final else self.edge)
        taken, problems = 0, []
        for declared in self.model.increment:
            alone = ModelFile(increment=(declared,))
            try:
                (equation,) = axis_equations([flight], [comparison], alone, self.database)
            except InputError as error:
                problems.append(error)
                continue
            taken = max(taken, self._update(equation, until, flight))
        if len(problems) == len(self.model.increment) and not self._axes:
            raise problems[0]
        self.reached = max(self.reached, until)
        self.samples += taken
        return taken

    def _update(self, equation: LinearEquation, until: float, flight: Flight) -> int:
        """Pass the new samples of an axis on; returns how many they were."""
        if equation.response not in self._axes:
            self._axes[equation.response] = self._estimator(equation.parameters, flight)
        estimator, taken = self._axes[equation.response], 0
        for record in equation.records:
            new = np.flatnonzero((record.time > self.reached) & (record.time <= until))
            for k in new:
                if isinstance(estimator, FourierRegression):
                    estimator.update(
                        float(record.time[k]), record.regressors[k], float(record.response[k])
                    )
                else:
                    estimator.update(record.regressors[k], float(record.response[k]))
            taken += len(new)
        return taken

    def _estimator(
        self, parameters: Parameters, flight: Flight
    ) -> RecursiveLeastSquares | FourierRegression:
        if self.settings.method == "fourier-regression":
            highest = self.settings.highest or 0.5 * bandwidth_of(flight, self.vehicle)
            return FourierRegression(parameters, running_frequencies(highest))
        return RecursiveLeastSquares(
            parameters,
            forgetting=self.settings.forgetting,
            normalised=self.settings.method == "normalised-recursive",
        )

    def fits(self) -> dict[str, Fit]:
        """Axis -> the estimates so far (k,), dimensionless per SI unit of the term, of the axes
        that had samples."""
        return {
            axis: estimator.fit() for axis, estimator in self._axes.items() if estimator.samples
        }
