"""Fly a database over a stretch of a recorded flight: its start, inputs, mass and thrust."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np

from aerodb.coefficients import Coefficients, thrust_loads, with_states
from aerodb.conditioning import despite_ground
from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.parts import contact_points
from aerodb.physics import quaternion_from_euler, standard_atmosphere, to_earth
from aerodb.signals import low_passed
from aerodb.simulation.condition import Condition
from aerodb.simulation.engine import FlightModel, Simulation, flight_model, simulate
from aerodb.simulation.flown_vehicle import MASS_PROPERTIES
from aerodb.simulation.layout import FEEDBACK
from aerodb.simulation.trim import trim
from aerodb.support import Array, Mask
from aerodb.tables import height_outside_ground_effect
from aerodb.vehicle import Vehicle, cg_positions, with_mass_channels

#: What a flight must have to be flown again.
NEEDED: Final = ("V", "alpha", "beta", "p", "q", "r", "phi", "theta")
#: Responses of a run that are compared with the flight, if it has them.
RESPONSES: Final = (*NEEDED, "psi", "altitude", "ax", "ay", "az")
#: Longest gap of an input that is bridged [s].
_LONGEST_GAP: Final = 1.0
#: Cut-off of the measured wind [Hz] where the coefficients of the flight have no bandwidth.
WIND_BANDWIDTH: Final = 2.0

Wind = Literal["mean", "measured"]


@dataclass(frozen=True, eq=False)
class FlightStretch:
    """A stretch of a flight in the form of a run.

    Parameters
    ----------
    time : (n,) [s], as in the flight.
    start, series : as `simulate` takes them.
    flown : response -> (n,) of the flight, NaN where it is not usable.
    notes : what was assumed.
    free : responses that the run cannot judge, with the reason: what was inferred from them.
    """

    time: Array
    start: Mapping[str, float]
    series: Mapping[str, Array]
    flown: Mapping[str, Array]
    notes: tuple[str, ...]
    free: Mapping[str, str]


def stretch_of(
    model: FlightModel,
    flight: Flight,
    coefficients: Coefficients,
    vehicle: Vehicle,
    since: float,
    until: float,
    *,
    wind: Wind = "measured",
) -> FlightStretch:
    """Return a stretch of a flight as start and inputs of a run.

    Parameters
    ----------
    model : of `stretch_model`.
    flight : consistent.
    coefficients : of the flight: from them the thrust is inferred where the flight has none.
    since, until : [s], times of the flight.
    wind : as reconstructed, velocity over the earth minus velocity through the air, up to the
        bandwidth of the coefficients; or its mean over the stretch.

    Time on the ground counts where the database has legs. The ground is where the height above it
    says; where that is not known, out of reach of what depends on it.

    Raises InputError naming what the flight lacks: channels, usable samples at the start, an input
    without a gap of more than 1 s.
    """
    first = float(flight.time[0])  # people count from the first sample
    where = f"flight {flight.id[:12]}, {since - first:.1f} to {until - first:.1f} s"
    flight = with_states(with_mass_channels(flight, vehicle), model.database)
    logged, legs = flight, len(contact_points(model.database)) > 0
    if legs:
        flight = despite_ground(flight)
    _require(flight, (*NEEDED, *model.inputs), where)
    inside = np.flatnonzero((flight.time >= since - 1e-9) & (flight.time <= until + 1e-9))
    if len(inside) < 3:
        raise InputError("fewer than three samples", where, "name a longer stretch")
    whole = slice(int(inside[0]), int(inside[-1]) + 1)
    time, notes = flight.time[whole], list[str]()
    on_legs = (
        flight.usable()[whole] & ~logged.usable()[whole] if legs else np.zeros(len(time), bool)
    )
    known = {
        # Vanes of a vehicle that stands tell nothing, and nothing depends on them.
        name: bridged(flight, name, whole, where, on_legs if name in ("alpha", "beta") else None)
        for name in dict.fromkeys((*NEEDED, *MASS_PROPERTIES, *model.inputs))
    }
    altitude = _optional(flight, "altitude", whole, notes)
    series = {name: known[name] for name in (*MASS_PROPERTIES, *model.inputs)}
    series["Ixy"] = series["Iyz"] = np.zeros(len(time))
    _ground(series, model, flight, altitude, whole, where, notes)
    air = standard_atmosphere(altitude)
    if "rho" in flight:
        series["density_ratio"] = bridged(flight, "rho", whole, where) / air.density
    if "temperature" in flight:
        warm = bridged(flight, "temperature", whole, where)
        series["temperature_offset"] = warm - air.temperature
    unknown = vehicle.thrust.source == "unknown"
    said: list[str] = []
    loads = thrust_loads(flight, vehicle.thrust, cg_positions(flight, vehicle), said)
    notes += [] if unknown else said
    for kind, values in zip(("force", "moment"), loads, strict=True):
        series |= {f"{kind}_{axis}": values[whole, j] for j, axis in enumerate("xyz")}
    flown = _responses(flight, coefficients, vehicle, whole, series)
    free = (
        _infer_thrust(series, model, flight, coefficients, vehicle, whole, notes) if unknown else {}
    )
    psi = _optional(flight, "psi", whole, notes)
    cut = coefficients.bandwidth or min(WIND_BANDWIDTH, 0.25 / flight.step)
    _wind(series, flight, known, psi, whole, cut if wind == "measured" else None, notes)
    start = {name: float(known[name][0]) for name in NEEDED}
    start |= {"psi": float(psi[0]), "altitude": float(altitude[0])}
    if on_legs[0]:
        start |= _on_its_legs(model, start["V"], series)
    start |= {state.name: float(flight[state.name][whole][0]) for state in model.total.states}
    references = {FEEDBACK[int(channel)] for channel in model.numbers.gains[:, 1]}
    series |= {f"reference_{channel}": known[channel] for channel in references}
    return FlightStretch(time, start, series, flown, tuple(notes), free)


def fly_stretch(
    model: FlightModel, stretch: FlightStretch, parameters: Mapping[str, Array] | None = None
) -> Simulation:
    """Fly a stretch open loop, or with the model's feedback; see `simulate`, whose arrays are (n,
    k) in SI units. Headings go on over north, beside those of the flight."""
    step = float(stretch.time[1] - stretch.time[0])
    parts = max(1, int(np.ceil(step / 0.02 - 1e-9)))
    run = simulate(
        model, stretch.time, stretch.start, stretch.series, parts=parts, parameters=parameters
    )
    turned = np.unwrap(run.channels["psi"], axis=0)
    turns = np.round((stretch.start["psi"] - turned[0]) / (2.0 * np.pi))
    return replace(run, channels={**run.channels, "psi": turned + 2.0 * np.pi * turns})


@dataclass(frozen=True)
class TrimOffset:
    """What holds a database in the trim of the flight: constant specific force [m/s2] and angular
    acceleration [rad/s2] that are added, x y z."""

    force: tuple[float, ...]
    angular: tuple[float, ...]


def with_trim_offset(
    model: FlightModel, stretch: FlightStretch, duration: float
) -> tuple[FlightStretch, TrimOffset]:
    """Return the stretch with the constant force and moment that the database lacks on average over
    its first `duration` [s]: as when a simulator is trimmed before the manoeuvre, and only the
    changes of the controls are flown."""
    n = max(3, int(np.searchsorted(stretch.time - stretch.time[0], duration)))
    n = min(n, len(stretch.time))
    start = {
        name: (
            np.nan_to_num(stretch.flown[name][:n], nan=float(value))
            if name in stretch.flown
            else np.full(n, value)
        )
        for name, value in stretch.start.items()
    }
    series = {name: values[None, :n] for name, values in stretch.series.items()}
    run = simulate(model, stretch.time[:1], start, series)
    since = float(stretch.time[n - 1] - stretch.time[0])
    angular = np.zeros(3)
    for row, name in enumerate("pqr"):
        values = stretch.flown[name][:n]
        good = np.isfinite(values)
        if good.sum() >= 3 and since > 0:
            slope = np.polyfit(stretch.time[:n][good], values[good], 1)[0]
            angular[row] = slope - run.rates[3 + row].mean()
    force = np.zeros(3)
    for row, name in enumerate(("ax", "ay", "az")):
        if name in stretch.flown and name not in stretch.free:
            difference = stretch.flown[name][:n] - run.channels[name][0]
            good = np.isfinite(difference)
            force[row] = difference[good].mean() if good.any() else 0.0
    own = {name: values.copy() for name, values in stretch.series.items()}
    ixx, iyy, izz, ixz = (own[name] for name in ("Ixx", "Iyy", "Izz", "Ixz"))
    own["moment_x"] = own["moment_x"] + ixx * angular[0] - ixz * angular[2]
    own["moment_y"] = own["moment_y"] + iyy * angular[1]
    own["moment_z"] = own["moment_z"] + izz * angular[2] - ixz * angular[0]
    for axis, more in zip("xyz", force, strict=True):
        own[f"force_{axis}"] = own[f"force_{axis}"] + own["mass"] * more
    offset = TrimOffset(tuple(force.tolist()), tuple(angular.tolist()))
    return replace(stretch, series=own), offset


def moved_controls(model: FlightModel, stretch: FlightStretch) -> tuple[str, ...]:
    """Return the axes (roll, pitch, yaw) on which the inputs' movements act most: those with at
    least 40 % of the greatest angular acceleration [rad/s²] that the movements make at the start.
    See `simulate`."""
    now = {name: float(values[0]) for name, values in stretch.series.items()}
    ranges = [float(np.ptp(stretch.series[name])) for name in model.inputs]
    moved = [name for name, extent in zip(model.inputs, ranges, strict=True) if extent > 0]
    if not moved:
        return ()
    k = len(moved) + 1
    series: dict[str, Array] = {name: np.full((1, k), value) for name, value in now.items()}
    for lane, name in enumerate(moved, 1):
        series[name][0, lane] += float(np.ptp(stretch.series[name]))
    rates = simulate(model, stretch.time[:1], stretch.start, series).rates[3:6]
    effect = np.abs(rates[:, 1:] - rates[:, :1]).max(axis=1)
    return tuple(
        axis
        for axis, size in zip(("roll", "pitch", "yaw"), effect, strict=True)
        if size >= 0.4 * effect.max() > 0
    )


def _require(flight: Flight, names: tuple[str, ...], where: str) -> None:
    lacking = sorted({name for name in names if name not in flight})
    if lacking:
        raise InputError(
            f"the flight lacks {', '.join(lacking)}",
            where,
            "fly another flight, or bind the input when importing the database (--bind)",
        )


def bridged(
    flight: Flight, name: str, whole: slice, where: str, without: Mask | None = None
) -> Array:
    """Return a channel over the stretch (n,), in its unit, without gaps.

    without : (n,) where it may be without a value, however long. Raises InputError for a gap of
    more than 1 s.
    """
    values, good = flight[name][whole], flight.usable([name])[whole]
    if good.all():
        return values
    if not good.any():
        raise InputError(f"no usable sample of {name}", where, "choose another stretch")
    at = np.flatnonzero(good)
    told = np.flatnonzero(good if without is None else good | without)
    gap = float(np.diff([-1, *told, len(good)]).max() - 1) * flight.step
    if gap > _LONGEST_GAP:
        raise InputError(
            f"{name} has a gap of {gap:.1f} s, longer than {_LONGEST_GAP:g} s",
            where,
            "choose a stretch without it",
        )
    return np.asarray(np.interp(np.arange(len(good)), at, values[at]))


def _optional(flight: Flight, name: str, whole: slice, notes: list[str]) -> Array:
    """A channel over the stretch, or zero with a note."""
    if name in flight:
        good = flight.usable([name])[whole]
        if good.any():
            at = np.flatnonzero(good)
            return np.asarray(np.interp(np.arange(len(good)), at, flight[name][whole][at]))
    notes.append(f"{name} is not known; 0 was taken")
    return np.zeros(whole.stop - whole.start)


def _responses(
    flight: Flight,
    coefficients: Coefficients,
    vehicle: Vehicle,
    whole: slice,
    series: Mapping[str, Array],
) -> dict[str, Array]:
    """Return what the vehicle did; the specific force is that at the CG."""
    flown = {
        name: np.where(flight.usable([name])[whole], flight[name][whole], np.nan)
        for name in (*NEEDED, "psi", "altitude")
        if name in flight
    }
    if "psi" in flown:
        good = np.isfinite(flown["psi"])
        flown["psi"][good] = np.unwrap(flown["psi"][good])
    scale = _pressure(flight, vehicle, whole) * vehicle.reference.area
    for name, axis in (("ax", "CX"), ("ay", "CY"), ("az", "CZ")):
        if axis in coefficients.values:
            force = scale * coefficients.values[axis][whole] + series[f"force_{name[1]}"]
            usable = coefficients.usable[axis][whole]
            flown[name] = np.where(usable, force / series["mass"], np.nan)
    return flown


def _pressure(flight: Flight, vehicle: Vehicle, whole: slice) -> Array:
    """Pressure [Pa] that the coefficients of a flight are over."""
    constant = vehicle.reference.pressure
    return flight["qbar"][whole] if constant is None else np.full(len(flight.time[whole]), constant)


def _infer_thrust(
    series: dict[str, Array],
    model: FlightModel,
    flight: Flight,
    coefficients: Coefficients,
    vehicle: Vehicle,
    whole: slice,
    notes: list[str],
) -> dict[str, str]:
    """Set the force along x to what the flight shows beyond the database, where thrust is not
    known; returns the responses that can no longer be judged."""
    channels = {name: flight[name][whole] for name in flight.channels}
    predicted = model.database.predict(channels).coefficients["CX"]
    measured = coefficients.values["CX"][whole]
    area, own = vehicle.reference.area, model.database.reference.area
    missing = _pressure(flight, vehicle, whole) * (area * measured - own * predicted)
    at = np.flatnonzero(coefficients.usable["CX"][whole] & np.isfinite(missing))
    if not at.size:
        notes.append("thrust is not known; none was flown")
        return {}
    series["force_x"] = np.interp(np.arange(len(missing)), at, missing[at])
    reason = "thrust is not known: the force along x is inferred from the flight's acceleration"
    notes.append(reason)
    return {"V": reason, "ax": reason}


def _ground(
    series: dict[str, Array],
    model: FlightModel,
    flight: Flight,
    altitude: Array,
    whole: slice,
    where: str,
    notes: list[str],
) -> None:
    """Add the altitude of the ground below the flight, where the database depends on its height.

    Between samples of the height the ground goes on: altimeters lose it high above.
    """
    outside = height_outside_ground_effect(model.database)
    if outside is None:
        return
    legs, name = len(contact_points(model.database)) > 0, "height_above_ground"
    if name in flight and (good := flight.usable([name])[whole]).any():
        at = np.flatnonzero(good)
        ground = np.interp(np.arange(len(good)), at, (altitude - flight[name][whole])[at])
        # A runway: noise is no bump.
        series["ground_altitude"] = np.full(len(ground), np.median(ground)) if legs else ground
        return
    if legs and name not in flight:
        raise InputError(
            f"the flight lacks {name}",
            where,
            "map it: the altitude less that of the runway, the datum of the vehicle on its legs"
            " included",
        )
    notes.append("height above ground is not known: it was flown outside ground effect")
    series["ground_altitude"] = np.full(len(altitude), float(altitude.min()) - outside)


def _on_its_legs(model: FlightModel, speed: float, series: Mapping[str, Array]) -> dict[str, float]:
    """Altitude [m], bank and pitch [rad] at which the legs carry a vehicle that rolls at a speed
    [m/s]: errors of a measured height would throw it up."""
    at_start = {name: float(values[0]) for name, values in series.items()}
    flat = flight_model(model.database)
    carried = trim(flat, Condition(speed, at_start["ground_altitude"], ground=True), at_start)
    return {name: float(carried.start[name]) for name in ("altitude", "phi", "theta")}


def _wind(
    series: dict[str, Array],
    flight: Flight,
    known: Mapping[str, Array],
    psi: Array,
    whole: slice,
    bandwidth: float | None,
    notes: list[str],
) -> None:
    """Add the wind, low-passed at `bandwidth` [Hz], or its mean."""
    names = ("velocity_north", "velocity_east", "velocity_down")
    if not all(name in flight for name in names) or not flight.usable(names)[whole].all():
        notes.append("wind is not known; none was flown")
        return
    along = known["V"] * np.cos(known["beta"])
    side = known["V"] * np.sin(known["beta"])
    air = np.stack([along * np.cos(known["alpha"]), side, along * np.sin(known["alpha"])])
    over = to_earth(quaternion_from_euler(known["phi"], known["theta"], psi), air)
    for name, through in zip(names, over, strict=True):
        blown = flight[name][whole] - through
        series[name.replace("velocity", "wind")] = (
            np.full(len(blown), blown.mean())
            if bandwidth is None
            else low_passed(blown, flight.step, bandwidth)
        )
