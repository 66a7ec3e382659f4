"""What hypotheses use of one flight: channels, the model's prediction and its sensitivities.

All of it comes from the flight's state and the model, never from the measured coefficients: a
sensor column computed from the measurement would explain any residual.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from aerodb.coefficients import FLOW_RATES, Comparison, as_inputs, rate_bandwidth, thrust_loads
from aerodb.flight import Flight
from aerodb.nomenclature import AXES, MOMENT_AXES
from aerodb.physics import inertial_moment
from aerodb.signals import bridge
from aerodb.support import Array
from aerodb.tables import (
    HAT_RATES,
    LIFT_INCREMENTS,
    AeroDatabase,
    ReferenceGeometry,
    hat_rate,
    slopes_by,
    slopes_by_lift,
    slopes_by_parameter,
    transfer_moments,
)
from aerodb.vehicle import Vehicle, cg_positions, mass_channels

#: Share of the samples that are used on any axis which a channel must have for a hypothesis that
#: needs it.
_ENOUGH = 0.95


@dataclass(frozen=True, eq=False)
class FlightView:
    """One flight compared with a database, the current model.

    recorded : the flight as it was given. comparison : its coefficients, measured and predicted.
    channels : name -> (n,), SI, bridged over gaps: the flight's own, hat rates over the database's
    lengths, alphadot and betadot, mass, CG, inertia. predicted : body axis -> (n,), by the
    database, not band-limited. thrust : (n, 3) N, and thrust_moment : (n, 3) N m about the CG, zero
    where not known. imu_arm, air_data_arm : (n, 3) m from the CG, zero where nothing was moved.
    derived : alphadot, betadot where they were made from the angle, whose errors they then share.
    poor : channels with too few good samples.
    """

    recorded: Flight
    comparison: Comparison
    channels: Mapping[str, Array]
    predicted: Mapping[str, Array]
    database: AeroDatabase
    vehicle: Vehicle
    cg: Array
    thrust: Array
    thrust_moment: Array
    imu_arm: Array
    air_data_arm: Array
    bandwidth: float
    derived: frozenset[str] = frozenset()
    poor: frozenset[str] = frozenset()
    _slopes: dict[str, Mapping[str, Array]] = field(default_factory=dict, repr=False)

    def __getitem__(self, name: str) -> Array:
        return self.channels[name]

    @property
    def flight(self) -> str:
        """The flight's id, as `Flight.id`."""
        return self.recorded.id

    @property
    def time(self) -> Array:
        """(n,) [s]."""
        return self.recorded.time

    @property
    def step(self) -> float:
        """Time [s] between samples, a scalar."""
        return self.recorded.step

    @cached_property
    def usable(self) -> Mapping[str, NDArray[np.bool_]]:
        """Body axis that the flight gives -> mask (n,) of its usable samples; see
        `Comparison.usable`."""
        usable = self.comparison.usable
        return {axis: usable[axis] for axis in AXES if axis in usable}

    def has(self, names: Iterable[str]) -> bool:
        """Return whether the flight holds all of these channels, with enough good samples."""
        return all(name in self.channels and name not in self.poor for name in names)

    @property
    def reference(self) -> ReferenceGeometry:
        """The database's reference geometry: columns are coefficients over its area [m²] and
        lengths [m], moments about its point (3,)."""
        return self.database.reference

    def slope(self, variable: str) -> Mapping[str, Array]:
        """Body axis -> dC/d`variable` (n,) of the current model; empty where it does not depend on
        it. `LIFT_INCREMENTS`: by an increment on C_lift, where more than the lift depends on it."""
        if variable not in self._slopes:
            self._slopes[variable] = _on_body(
                slopes_by_lift(self.database, self.channels)
                if variable == LIFT_INCREMENTS
                else slopes_by(self.database, variable, self.channels)
            )
        return self._slopes[variable]

    def slope_by_parameter(self, parameter: str) -> Mapping[str, Array]:
        """Body axis -> dC/d`parameter` (n,) of the current model, per unit of the parameter; empty
        where no term uses it."""
        key = f"parameter {parameter}"
        if key not in self._slopes:
            slopes = slopes_by_parameter(self.database, parameter, self.channels)
            self._slopes[key] = _on_body(slopes)
        return self._slopes[key]

    @cached_property
    def rates(self) -> Array:
        """(n, 3) p, q, r in rad/s, zero where they are not logged."""
        zero = np.zeros(len(self.time))
        return np.column_stack([self.channels.get(name, zero) for name in "pqr"])

    @cached_property
    def angular_acceleration(self) -> Array:
        """(n, 3) rad/s2 that the current model's moments give: ``I wdot = M - w x (I w)``."""
        forces_about_cg = transfer_moments(
            self.predicted, self.reference.moment_reference, self.cg, self.reference
        )
        moment = self.moments(forces_about_cg) + self.thrust_moment
        inertia = {name: self.channels[name] for name in ("Ixx", "Iyy", "Izz", "Ixz")}
        gyroscopic = inertial_moment(self.rates, np.zeros_like(moment), inertia)
        roll, pitch, yaw = (moment - gyroscopic).T
        ixx, iyy, izz, ixz = (inertia[name] for name in ("Ixx", "Iyy", "Izz", "Ixz"))
        determinant = ixx * izz - ixz**2
        return np.column_stack(
            [
                (izz * roll + ixz * yaw) / determinant,
                pitch / iyy,
                (ixz * roll + ixx * yaw) / determinant,
            ]
        )

    @cached_property
    def pressure(self) -> Array:
        """(n,) [Pa] that coefficients are over: dynamic pressure, or the database's constant."""
        constant = self.reference.pressure
        return self["qbar"] if constant is None else np.full(len(self.time), constant)

    @cached_property
    def inverse_pressure(self) -> Array:
        """(n,) [1/Pa]; zero where there is no dynamic pressure: nothing is claimed there."""
        pressure = self.pressure
        return np.where(pressure > 0.0, 1.0 / np.where(pressure > 0.0, pressure, 1.0), 0.0)

    def moments(self, coefficients: Mapping[str, Array]) -> Array:
        """(n, 3) [N m] of moment coefficients over the database's lengths."""
        lengths = np.array([self.reference.span, self.reference.chord, self.reference.span])
        scale = (self.pressure * self.reference.area)[:, None] * lengths
        return np.column_stack([coefficients[axis] for axis in MOMENT_AXES]) * scale

    def as_coefficients(self, force: Array, moment: Array) -> dict[str, Array]:
        """Force (n, 3) [N] and moment about the CG (n, 3) [N m] as the six coefficients about the
        database's moment reference."""
        lengths = np.array([self.reference.span, self.reference.chord, self.reference.span])
        scaled = (
            np.column_stack([force, moment / lengths])
            * (self.inverse_pressure / self.reference.area)[:, None]
        )
        about_cg = dict(zip(AXES, scaled.T, strict=True))
        return transfer_moments(about_cg, self.cg, self.reference.moment_reference, self.reference)

    def as_measured(self, but: str = "") -> "FlightView":
        """This view with the measured coefficients in place of the predicted ones, where there are
        any; all `but` one axis.

        For what an error of known size changes, to first order also where the model is wrong; such
        columns are for no test, as they would explain any residual, but that of the axis left out.
        """
        measured = {
            axis: np.where(np.isfinite(values), values, self.predicted[axis])
            for axis, values in self.comparison.measured.items()
            if axis in self.predicted and axis != but
        }
        return replace(self, predicted={**self.predicted, **measured})

    @property
    def force(self) -> Array:
        """(n, 3) [N]: mass times specific force as the current model gives it, thrust included."""
        scale = (self.pressure * self.reference.area)[:, None]
        return np.column_stack([self.predicted[axis] for axis in AXES[:3]]) * scale + self.thrust


def _on_body(slopes: Mapping[str, Array]) -> dict[str, Array]:
    """Slopes (n,) on the body axes: effects are sought on no hinge moment."""
    return {axis: slopes[axis] for axis in AXES if axis in slopes}


def view_of(
    flight: Flight,
    comparison: Comparison,
    database: AeroDatabase,
    vehicle: Vehicle,
    near: FlightView | None = None,
) -> FlightView:
    """The view of one flight for one database; `comparison` says which samples are usable.

    near : a view of the same flight in hardly another state, whose slopes hold here too: they cost
    most of what a view is asked; its arm of the air data holds as well.

    Raises InputError naming inputs of the database that the flight lacks.
    """
    recorded = flight
    bandwidth = rate_bandwidth(flight, comparison.bandwidth)
    flight = as_inputs(
        flight.with_channels(mass_channels(flight, vehicle)), database, comparison.bandwidth
    )
    good = {
        name: np.isfinite(values) & _unflagged(flight, name)
        for name, values in flight.channels.items()
    }
    channels = {
        name: bridge(values)
        for name, values in flight.channels.items()
        if np.isfinite(values).any()
    }
    channels.setdefault("beta", np.zeros(len(flight.time)))
    for name, (rate, _) in HAT_RATES.items():
        if {rate, "V"} <= channels.keys():
            channels[name] = hat_rate(name, channels, database.reference)
    used = np.logical_or.reduce(
        [np.zeros(len(flight.time), dtype=np.bool_), *comparison.usable.values()]
    )
    cg = cg_positions(flight, vehicle)
    thrust, thrust_moment = thrust_loads(flight, vehicle.thrust, cg, [])
    imu, probe = vehicle.points.imu, vehicle.points.air_data
    moved = imu != "cg" and "ax" not in flight
    brought = probe is not None and all(
        name in flight for name in ("V", "alpha", "p", "q", "r")
    )  # see `air_data_at_cg`
    side = comparison.database_side
    prediction = (
        side.prediction
        if side is not None and side.holds_for(database, channels)
        else database.predict(channels)  # bridged gaps, or another rate
    )
    return FlightView(
        recorded=recorded,
        comparison=comparison,
        channels=channels,
        predicted=prediction.coefficients,
        database=database,
        vehicle=vehicle,
        cg=cg,
        thrust=thrust,
        thrust_moment=thrust_moment,
        imu_arm=np.asarray(imu) - cg if moved else np.zeros_like(cg),
        air_data_arm=near.air_data_arm
        if near
        else np.asarray(probe) - cg
        if brought
        else np.zeros_like(cg),
        bandwidth=bandwidth,
        _slopes={} if near is None else near._slopes,
        derived=frozenset(rate for rate in FLOW_RATES if rate in flight and rate not in recorded),
        poor=frozenset(
            name
            for name in channels
            if name in good and good[name][used].sum() < _ENOUGH * max(used.sum(), 1)
        ),
    )


def _unflagged(flight: Flight, name: str) -> NDArray[np.bool_]:
    return (
        flight.flags[name] == 0
        if name in flight.flags
        else np.ones(len(flight.time), dtype=np.bool_)
    )
