"""Compare a flight with a database: measured and predicted coefficients on the same axes, about the
same moment reference."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from aerodb.coefficients.total import DEFAULT_BANDWIDTH, Coefficients
from aerodb.errors import InputError, nearest
from aerodb.flight import Flight
from aerodb.nomenclature import AXES, FORCE_AXES, MOMENT_AXES, in_order, is_hinge_axis
from aerodb.signals import low_passed, rms, smooth
from aerodb.support import Array
from aerodb.tables import WIND_AXES, AeroDatabase, Prediction, body_to_wind, transfer_moments
from aerodb.vehicle import Reference

#: Rates of change of the flow angles, which logs seldom hold.
FLOW_RATES: Final = ("alphadot", "betadot")

#: Larger coefficients are those of an aircraft that stands: its airspeed is almost zero. Limiting
#: the band would spread them over the flight.
MOST: Final = 1e3


@dataclass(frozen=True, eq=False)
class DatabaseSide:
    """A database's prediction of a flight, and what it was made of.

    channels : name -> (n,), SI, of all that `database` uses, as `as_inputs` made them.
    over_ground : whether the velocity over the earth stands for the flow, which no sensor measures.
    """

    database: AeroDatabase
    channels: Mapping[str, Array]
    prediction: Prediction
    over_ground: bool = False

    def holds_for(self, database: AeroDatabase, channels: Mapping[str, Array]) -> bool:
        """Return whether `database` predicts the same of these `channels` (n,), SI units, to the
        last bit."""
        return database is self.database and all(
            name in channels
            and (channels[name] is values or np.array_equal(channels[name], values))
            for name, values in self.channels.items()
        )


@dataclass(frozen=True)
class Comparison:
    """Measured and predicted coefficients, in the database's reference geometry and about its
    moment reference.

    Parameters
    ----------
    time : (n,) s.
    measured, sigma, predicted, usable : axis -> (n,). The axes are the body axes and hinge moments
        that the flight gives, and C_lift, C_drag, C_side where all three forces are available.
    outside : (n,) true where a table argument lies outside its breakpoints and the table's edge
        value is held.
    bandwidth : Hz, to which moments are band-limited on both sides; None: not limited.
    notes : what was assumed or is missing.
    left_out : axes that the flight would give if its thrust were known.
    database_side : the prediction before any band limit, where this is a flight's at its full rate.

    Differentiated rates are band-limited, and so are moments from them. Against a prediction that
    is not limited every slope would be estimated too small (f1_017, Cl_p: -.49 at 2 Hz and -.57 at
    8 Hz one-sided; -.571 and -.572 two-sided).
    """

    flight: str
    time: Array
    measured: Mapping[str, Array]
    sigma: Mapping[str, Array]
    predicted: Mapping[str, Array]
    usable: Mapping[str, NDArray[np.bool_]]
    outside: NDArray[np.bool_]
    bandwidth: float | None
    notes: tuple[str, ...]
    left_out: tuple[str, ...] = ()
    database_side: DatabaseSide | None = field(default=None, repr=False, compare=False)

    def residual(self, axis: str) -> Array:
        """measured - predicted on `axis`, (n,)."""
        return self.measured[axis] - self.predicted[axis]

    def beside(
        self, flight: Flight, database: AeroDatabase
    ) -> tuple[
        Flight,
        AeroDatabase,
        Mapping[str, Array],
        Mapping[str, Array],
        Mapping[str, NDArray[np.bool_]],
        float | None,
    ]:
        """Return what suspicions look at, in their order (`aerodb.suspicions.against_database`).

        flight, database : those compared, channels (n,) in SI units; the flight comes back with all
        inputs that it has. Then measured, predicted and usable as here, and the bandwidth in Hz.
        Raises InputError as `as_inputs` does.
        """
        inputs = as_inputs(flight, database, self.bandwidth)
        return inputs, database, self.measured, self.predicted, self.usable, self.bandwidth

    def summary(self, axis: str) -> dict[str, float]:
        """Number of usable samples of `axis`, and over them what was measured and what is left.

        ``rms_measured``, ``rms_residual``; rms of sigma (``noise_floor``); rms of what was measured
        about its mean (``variation``), mean residual (``mean_residual``), and ``of_flown``, the rms
        residual as a part of the variation, NaN where there is none.

        Coefficients (n,), dimensionless. Raises KeyError for an axis that it lacks.
        """
        good = self.usable[axis]
        measured, residual = self.measured[axis][good], self.residual(axis)[good]
        variation = float(np.std(measured)) if measured.size else 0.0
        return {
            "samples": measured.size,
            "rms_measured": rms(measured),
            "rms_residual": rms(residual),
            "noise_floor": rms(self.sigma[axis][good]),
            "variation": variation,
            "mean_residual": float(np.mean(residual)) if residual.size else 0.0,
            "of_flown": rms(residual) / variation if variation > 0.0 else math.nan,
        }


def compare(
    flight: Flight, coefficients: Coefficients, database: AeroDatabase, reference: Reference
) -> Comparison:
    """Compare a flight's total coefficients with the database's prediction for the same inputs.

    Parameters
    ----------
    reference : the geometry that `coefficients` refer to.

    Measured values are rescaled to the database's reference geometry, and their moments moved to
    its moment reference; the database itself is never changed.

    Raises InputError naming the inputs of the database that the flight lacks.
    """
    bandwidth = coefficients.bandwidth
    at = rate_bandwidth(flight, bandwidth)
    flight, made = with_flow_rates(flight, at, database.flight_inputs)
    notes = [f"{rate} from its angle, at a bandwidth of {at:g} Hz" for rate in made]
    lacking = [name for name in database.flight_inputs if name not in flight]
    if lacking:
        what = (
            f"database {database.name} needs {', '.join(lacking)}, which the flight does not have"
        )
        remedy = (
            f"{nearest(lacking[0], flight.channels)} What is proposed for each, and what it"
            " changes: aerodb database inputs. To take the proposals: aerodb database import FILE"
            " --accept-proposals; or bind it there (--bind), or set it in the vehicle's"
            " [configuration]"
        )
        raise InputError(what, f"flight {flight.id}", remedy)
    flight = with_states(flight, database)
    side = _predicted(flight, database)
    prediction = side.prediction
    notes = [*coefficients.notes, *notes]
    measured, sigma = _in_geometry_of(database, coefficients, reference)
    usable, left_out = _with_known_thrust(database, coefficients, reference, measured)
    measured = {axis: values for axis, values in measured.items() if axis not in left_out}
    if any(axis in FORCE_AXES for axis in left_out):
        left_out += WIND_AXES
    nothing = np.zeros(len(flight.time))  # of a hinge moment that the database does not know
    predicted = {axis: prediction.coefficients.get(axis, nothing) for axis in in_order(measured)}
    if all(axis in measured for axis in AXES[:3]) and "alpha" in flight:
        beta = flight["beta"] if "beta" in flight else np.zeros_like(flight["alpha"])
        all_forces = usable["CX"] & usable["CY"] & usable["CZ"] & flight.usable(["alpha"])
        for target, source in ((measured, measured), (predicted, predicted)):
            wind = body_to_wind(source["CX"], source["CY"], source["CZ"], flight["alpha"], beta)
            target.update(zip(WIND_AXES, wind, strict=True))
        sigma.update(_along_the_wind(sigma, flight["alpha"], beta))
        usable.update(dict.fromkeys(("C_lift", "C_drag", "C_side"), all_forces))
    state = flight.usable(name for name in database.inputs if name in flight)
    usable = {
        axis: good & state & np.isfinite(predicted[axis])
        for axis, good in usable.items()
        if axis in predicted
    }
    for axis in MOMENT_AXES:
        if axis in predicted and bandwidth is not None:
            flies = (np.abs(measured[axis]) < MOST) & (np.abs(predicted[axis]) < MOST)
            for values in (measured, predicted):
                at_speed = np.where(flies, values[axis], np.nan)
                values[axis] = band_limited(at_speed, flight.step, bandwidth)
    share = float(np.mean(prediction.outside))
    if share > 0:
        tables = ", ".join(sorted(prediction.outside_tables))
        notes.append(
            f"{share:.0%} of the samples lie outside tables ({tables}), where edge values are held"
        )
    return Comparison(
        flight.id,
        flight.time,
        measured,
        sigma,
        predicted,
        usable,
        prediction.outside,
        bandwidth,
        tuple(notes),
        left_out,
        side,
    )


def _along_the_wind(sigma: Mapping[str, Array], alpha: Array, beta: Array) -> dict[str, Array]:
    """Noise (n,) of the forces along the wind axes, of independent noise along the body axes."""
    variance = np.stack([np.square(sigma[axis]) for axis in FORCE_AXES])
    weights = np.square(
        [np.stack(body_to_wind(x, y, z, alpha, beta)) for x, y, z in np.eye(3)]
    )  # body axis, wind axis, sample
    return dict(zip(WIND_AXES, np.sqrt(np.einsum("bn,bwn->wn", variance, weights)), strict=True))


def _predicted(flight: Flight, database: AeroDatabase) -> DatabaseSide:
    """Return what the database predicts of a flight that has all inputs, and the channels it
    used."""
    used = dict.fromkeys((*database.inputs, *database.needs))
    return DatabaseSide(
        database,
        {name: flight[name] for name in used if name in flight},
        database.predict(flight.channels),
        bool(flight.estimated.issuperset(("V", "alpha", "beta"))),
    )


def rate_bandwidth(flight: Flight, bandwidth: float | None) -> float:
    """Hz, at which rates of the flow angles are made: `bandwidth` of a flight's coefficients, or
    where they have none (None) the default, below half of the Nyquist frequency."""
    return bandwidth or min(DEFAULT_BANDWIDTH, 0.25 / flight.step)


def as_inputs(flight: Flight, database: AeroDatabase, bandwidth: float | None = None) -> Flight:
    """Return the flight with the channels that databases use beyond a log's: rates of the flow
    angles [rad/s] at `rate_bandwidth`, and the states of `database`.

    Raises InputError naming channels that a state needs and the flight lacks.
    """
    with_rates, _ = with_flow_rates(flight, rate_bandwidth(flight, bandwidth))
    return with_states(with_rates, database)


def with_states(flight: Flight, database: AeroDatabase) -> Flight:
    """Add the channels that the database's state models compute (`flow_attachment`), where the
    flight lacks them.

    Unusable samples are bridged in the integration, and are NaN in the result. Raises InputError
    naming channels that the flight lacks.
    """
    if not database.states:
        return flight
    named = {name for state in database.states for name in (*state.needs, state.name)}
    if database.rates:  # whose inputs only their database knows
        named |= set(database.flight_inputs)
    needed = {name for name in named if name in flight}
    channels = {name: np.where(flight.usable([name]), flight[name], np.nan) for name in needed}
    found = database.states_along(flight.time, channels)
    own = replace(flight, states=flight.states | (found.keys() & database.rates.keys()))
    return own.with_channels(found)


def band_limited(values: Array, step: float, bandwidth: float) -> Array:
    """Low-pass `values` (n,) with zero phase; unchanged where no value is finite.

    step : s, between samples. bandwidth : Hz.
    """
    return low_passed(values, step, bandwidth) if np.isfinite(values).any() else values


def with_flow_rates(
    flight: Flight, bandwidth: float, wanted: Collection[str] = FLOW_RATES
) -> tuple[Flight, tuple[str, ...]]:
    """Return the flight with those `wanted` rates of its flow angles (``alphadot``, ``betadot``)
    that the log lacks, from the angles at a bandwidth [Hz]; and which were made."""
    rates = {
        rate: smooth(flight[angle], flight.step, bandwidth).rate
        for rate in FLOW_RATES
        if rate in wanted
        and rate not in flight
        and (angle := rate.removesuffix("dot")) in flight
        and np.isfinite(flight[angle]).any()
    }
    return flight.with_channels(rates), tuple(rates)


def _in_geometry_of(
    database: AeroDatabase, coefficients: Coefficients, reference: Reference
) -> tuple[dict[str, Array], dict[str, Array]]:
    """Measured values and standard deviations referred to the database's area and lengths, moments
    about its moment reference."""
    factor = _factors(database, reference)
    for axis in filter(is_hinge_axis, coefficients.values):  # over lengths of their own
        factor[axis] = _pressure_ratio(database, reference)
    measured = {axis: values * factor[axis] for axis, values in coefficients.values.items()}
    sigma = {axis: values * factor[axis] for axis, values in coefficients.sigma.items()}
    target = np.asarray(database.reference.moment_reference)
    # An axis left out has no share in the others: `_with_known_thrust` leaves out where it has.
    complete = {
        **{axis: np.zeros(len(coefficients.time)) for axis in coefficients.left_out},
        **measured,
    }
    if all(axis in complete for axis in AXES):
        moved = transfer_moments(
            complete, coefficients.moment_reference, target, database.reference
        )
        measured = {axis: moved[axis] for axis in measured}
    elif not np.allclose(coefficients.moment_reference, target):
        measured = {axis: each for axis, each in measured.items() if axis not in MOMENT_AXES}
    return measured, sigma


def _factors(database: AeroDatabase, reference: Reference) -> dict[str, float]:
    """Axis -> factor from coefficients of the geometry `reference` to those of the database's."""
    pressure = _pressure_ratio(database, reference)
    ratio = reference.area / database.reference.area * pressure
    span = ratio * reference.span / database.reference.span
    chord = ratio * reference.chord / database.reference.chord
    return {"CX": ratio, "CY": ratio, "CZ": ratio, "Cl": span, "Cm": chord, "Cn": span}


def _pressure_ratio(database: AeroDatabase, reference: Reference) -> float:
    """Constant pressure of a vehicle over that of the database; 1 without."""
    given, own = reference.pressure, database.reference.pressure
    if (given is None) != (own is None):
        raise InputError(
            "one has a constant reference pressure, the other not: vehicle"
            f" {given or 'none'}, database {own or 'none'} [Pa]",
            f"database {database.name}",
            "state the same [reference] pressure in the vehicle file and the database",
        )
    return (given or 1.0) / (own or 1.0)


def _with_known_thrust(
    database: AeroDatabase,
    coefficients: Coefficients,
    reference: Reference,
    measured: Mapping[str, Array],
) -> tuple[dict[str, NDArray[np.bool_]], tuple[str, ...]]:
    """Usable samples per axis about the database's moment reference, where thrust that is not known
    may load other axes; and the axes left out because the flight has none.

    measured : axis -> (n,), in the database's geometry.
    """
    usable, left_out = dict(coefficients.usable), coefficients.left_out
    if coefficients.thrust is None or coefficients.thrust.known.all():
        return usable, left_out
    share = coefficients.thrust.moved(
        _factors(database, reference),
        coefficients.moment_reference,
        np.asarray(database.reference.moment_reference),
        database.reference,
    )
    loaded = share.loaded(measured)
    usable = {axis: u & share.known if axis in loaded else u for axis, u in usable.items()}
    if not share.known.any():
        left_out = tuple(axis for axis in AXES if axis in (*left_out, *loaded))
    return usable, left_out
