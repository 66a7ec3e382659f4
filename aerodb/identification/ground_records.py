"""Rolls of a flight on the ground, as records of a model with unknown parameters."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.ndimage import median_filter

from aerodb.coefficients import thrust_loads
from aerodb.conditioning import despite_ground, ground_and_air, ground_speed, places
from aerodb.errors import InputError
from aerodb.estimation import Fit, Parameter, Parameters, TimeHistory
from aerodb.flight import Flight
from aerodb.identification.database_parameters import unknown
from aerodb.identification.ground_roll import OUTPUTS, START, GroundRoll, fitted_roll
from aerodb.identification.likelihood_bounds import with_bounds
from aerodb.nomenclature import MOST_SHARE, SHARES
from aerodb.parts import contact_points
from aerodb.physics import GRAVITY, Earth, standard_atmosphere
from aerodb.simulation import MASS_PROPERTIES, Condition, FlightModel, bridged, flight_model, trim
from aerodb.support import CLAIM, Array, half_interval, standard_errors
from aerodb.tables import AeroDatabase
from aerodb.vehicle import Vehicle, cg_positions, with_mass_channels

#: One standard deviation of a component of the wind near the ground before a roll is seen [m/s]: a
#: runway is hardly used in twice as much.
_WIND: Final = 10.0
#: Speed over the ground [m/s] down to which a roll counts: below, friction sticks, and slip angles
#: lose their meaning,
SLOW: Final = 3.0
#: and that a roll reaches: taxiing tells nothing of friction at speed.
_FAST: Final = 10.0
#: Shortest and longest roll [s].
_SHORTEST: Final = 5.0
_LONGEST: Final = 120.0
#: Time over which a roll's start is taken from what was measured [s].
_BEGINNING: Final = 2.0
#: Share of the largest airspeed down to which a pitot tube is believed.
_PITOT: Final = 0.5
#: Pitch attitude [rad] above that on all wheels at which the nose wheel is in the air.
_NOSE_UP: Final = float(np.deg2rad(2.0))
#: Time over which pitch attitude and height are smoothed for that [s].
_NOSE_WINDOW: Final = 0.5
#: Time after a bounce from which the height on the wheels is taken [s]: bounces last a second or
#: two.
_SETTLES: Final = 6.0
#: Variance of a second difference of independent values, over theirs: 1 + 4 + 1.
SECOND_DIFFERENCE: Final = 6.0
#: Slope of a runway over its standard error from which it counts, and parts of a roll from whose
#: mean altitudes it is taken: altitudes drift,
_SLOPED: Final = 4.0
_PARTS: Final = 8
#: and least slope that counts: it decelerates by 0.005 m/s2.
_LEAST_SLOPE: Final = 5e-4
#: What to do where no flight has a roll.
_REMEDY: Final = "name flights that roll to a stop, with velocities or positions over the ground"
#: Reasons that an error names.
_REASONS: Final = 3


@dataclass(frozen=True, eq=False)
class RolledFlight:
    """A mapped flight, its vehicle, and the name of its records."""

    flight: Flight
    vehicle: Vehicle
    name: str


@dataclass(frozen=True, eq=False)
class Rolls:
    """Rolls of some flights as records, beside the legs of a database.

    Parameters
    ----------
    model : what rolls. starts : record -> altitude [m], phi, theta [rad] at the start.
    flights : record -> id of its flight. notes : record -> what was assumed. left_out : id of a
        flight without a usable roll -> why. said : what was assumed of all.
    """

    model: FlightModel
    records: tuple[TimeHistory, ...]
    starts: Mapping[str, Mapping[str, float]]
    flights: Mapping[str, str]
    notes: Mapping[str, Sequence[str]]
    left_out: Mapping[str, str]
    said: tuple[str, ...] = ()

    def of(self, flights: Collection[str]) -> "Rolls":
        """The rolls (time histories (n,), SI units) of some of the flights (ids)."""
        return replace(
            self, records=tuple(r for r in self.records if self.flights[r.name] in flights)
        )

    @property
    def assumed(self) -> list[str]:
        """What was assumed and left out (lengths in [m], times in [s]), a sentence each."""
        notes = [f"{r.name}: {text}" for r in self.records for text in self.notes[r.name]]
        reasons = dict.fromkeys(self.left_out.values())
        said = [*self.said, *(f"left out: {reason}" for reason in reasons)]
        return [f"{each}." for each in (*notes, *(f"{s[0].upper()}{s[1:]}" for s in said))]


def recorded_rolls(flights: Sequence[RolledFlight], database: AeroDatabase) -> Rolls:
    """Return the rolls of some flights, time histories (n,) in SI units.

    Raises InputError naming what the flights lack, where there is no roll.
    """
    model = flight_model(database)
    records, starts = list[TimeHistory](), dict[str, dict[str, float]]()
    names, notes, left_out = dict[str, str](), dict[str, list[str]](), dict[str, str]()
    remedy = ""
    for each in flights:
        seen = despite_ground(each.flight)
        try:
            rolls = ground_rolls(each.flight)
            prepared = with_mass_channels(seen, each.vehicle)
            for number, whole in enumerate(rolls, 1):
                name = f"{each.name}#{number}"
                record, start, said = _record(name, prepared, each.vehicle, model, whole)
                records.append(record)
                starts[name], names[name], notes[name] = start, each.flight.id, said
        except InputError as error:
            left_out[each.flight.id] = str(error).split("\n", 1)[0]
            remedy = remedy or error.remedy
            continue
        if not rolls:
            left_out[each.flight.id] = _why(each.flight)
    if not records:
        reasons = "; ".join([*dict.fromkeys(left_out.values())][:_REASONS])
        raise InputError(
            f"no roll on the ground can be used: {reasons}",
            "estimate",
            remedy or _REMEDY,
        )
    latitude = next(filter(None, (_mean(f.flight, "latitude", slice(None)) for f in flights)), None)
    general: tuple[str, ...] = ()
    if latitude is None:
        general = ("latitude is not known: the earth's rotation was left out",)
    else:
        model = flight_model(database, earth=Earth(latitude))
    return Rolls(model, tuple(records), starts, names, notes, left_out, general)


def roll_model(
    rolls: Rolls,
    names: Sequence[str],
    database: AeroDatabase,
    wind: tuple[float, float] | None = None,
) -> GroundRoll:
    """Return the model of rolls with parameters of a database unknown.

    wind : north and east [m/s]; None: unknown, steady in each roll. SI units.
    """
    items = [unknown(name, database) for name in names]
    for record in rolls.records:
        items += _unknowns(record, wind)
    outputs = tuple(
        name for name in OUTPUTS if any(np.isfinite(r.outputs[name]).any() for r in rolls.records)
    )
    return GroundRoll(rolls.model, Parameters(tuple(items)), outputs, rolls.starts)


def ground_fit(
    function: Callable[..., Fit],
    rolls: Rolls,
    names: Sequence[str],
    database: AeroDatabase,
    wind: tuple[float, float] | None = None,
    start: Mapping[str, float] | None = None,
) -> Fit:
    """Return the fit of parameters of a database's legs by a method that flies, in SI units.

    start : as of `fitted_roll`. The other arguments are those of `roll_model`. A parameter that the
    rolls do not determine is ``not excited``, with the values that they do not exclude.
    """
    fit = fitted_roll(function, roll_model(rolls, names, database, wind), rolls.records, start)
    fit = bounded_roll_fit(function, rolls, fit, names, database, names, wind)
    return replace(fit, notes=(*fit.notes, *rolls.assumed))


def roll_fit(
    function: Callable[..., Fit],
    rolls: Rolls,
    names: Sequence[str],
    database: AeroDatabase,
    start: Mapping[str, float] | None = None,
    held: Mapping[str, float] | None = None,
) -> Fit:
    """Return the fit of parameters of a database over rolls in unknown winds, in SI units.

    start : as of `fitted_roll`, of a fit without the parameters. held : parameter -> value that it
        keeps.
    """
    kept = held or {}
    model = roll_model(rolls, [*names, *kept], database)
    items = [
        replace(item, value=kept[item.name], free=False) if item.name in kept else item
        for item in model.parameters.items
    ]
    model = replace(model, parameters=Parameters(tuple(items)))
    return fitted_roll(function, model, rolls.records, start)


def bounded_roll_fit(
    function: Callable[..., Fit],
    rolls: Rolls,
    fit: Fit,
    names: Sequence[str],
    database: AeroDatabase,
    examined: Sequence[str],
    wind: tuple[float, float] | None = None,
) -> Fit:
    """Return a fit of `names` in which those that are `examined` have bounds where the rolls do not
    determine them, in SI units; wind as of `roll_model`."""
    model = roll_model(rolls, names, database, wind)
    return with_bounds(function, model, rolls.records, fit, examined)


def _why(flight: Flight) -> str:
    if ground_speed(flight) is None:
        return "the flight has no velocity and no position over the ground"
    if not {"altitude", "height_above_ground"} & set(flight.channels):
        return "the flight has no height: where it rolls and where it flies is not known"
    return f"no roll of {_SHORTEST:g} s that reaches {_FAST:g} m/s on the ground"


def ground_rolls(flight: Flight) -> list[slice]:
    """Return the samples of the rolls of a flight (n,) on the ground.

    Each is a stretch on the ground in motion over it, of up to 120 s. Speeds [m/s] come from
    velocities over the earth, else from positions.
    """
    moving = ground_speed(flight)
    if moving is None:
        return []
    down = np.zeros(len(flight.time), dtype=bool)
    for segment in ground_and_air(flight):
        if segment.kind == "on_ground":
            down |= (flight.time >= segment.start) & (flight.time <= segment.end)
    rolling = np.concatenate([[False], down & (moving > SLOW), [False]])
    edges = np.flatnonzero(np.diff(rolling.astype(int)))
    most = round(_LONGEST / flight.step)
    return [
        slice(int(first), int(min(stop, first + most)))
        for first, stop in edges.reshape(-1, 2)
        if (stop - first) * flight.step >= _SHORTEST and moving[first:stop].max() >= _FAST
    ]


def _record(
    name: str, flight: Flight, vehicle: Vehicle, model: FlightModel, whole: slice
) -> tuple[TimeHistory, dict[str, float], list[str]]:
    """A roll as a record, the height and attitude at which the legs carry it, and what was
    assumed."""
    where = f"roll {name}, {flight.time[whole][0]:.1f} to {flight.time[whole.stop - 1]:.1f} s"
    lacking = sorted(n for n in model.inputs if n not in flight)
    if lacking:
        raise InputError(
            f"the flight lacks {', '.join(lacking)}",
            where,
            f"map these channels; how it slows down is seen without them: aerodb flight show"
            f" {name.partition('#')[0]}",
        )
    notes = list[str]()
    known = {n: bridged(flight, n, whole, where) for n in (*MASS_PROPERTIES, *model.inputs)}
    for n in SHARES:
        if n in known and (most := float(np.max(known[n]))) > MOST_SHARE:
            raise InputError(
                f"{n} reaches {most:.4g}, but is a share from 0 to 1",
                where,
                "state its unit in the mapping: percent, or scale it to full travel",
            )
    measured = _measured(flight, whole)
    speed = _first(flight.time[whole], measured)["speed"]
    altitude = _mean(flight, "altitude", whole)
    if altitude is None:
        notes.append("altitude is not known; air at sea level was taken")
    series = dict(known)
    air = standard_atmosphere(np.array([altitude or 0.0]))
    for channel, key in (("rho", "density_ratio"), ("temperature", "temperature_offset")):
        mean = _mean(flight, channel, whole)
        if mean is not None:
            own = mean / air.density[0] if channel == "rho" else mean - air.temperature[0]
            series[key] = np.full(whole.stop - whole.start, own)
    said = list[str]()
    loads = thrust_loads(flight, vehicle.thrust, cg_positions(flight, vehicle), said)
    if vehicle.thrust.source == "unknown":
        notes.append("thrust is not known; none was taken")
    for kind, values in zip(("force", "moment"), loads, strict=True):
        series |= {f"{kind}_{axis}": values[whole, j] for j, axis in enumerate("xyz")}
    at_start = {key: float(value[0]) for key, value in series.items()}
    carried = trim(model, Condition(speed, altitude or 0.0, ground=True), at_start)
    start = {key: float(carried.start[key]) for key in ("altitude", "phi", "theta")}
    series["ground_altitude"] = np.full(whole.stop - whole.start, altitude or 0.0)
    slope, spread = _slope(flight, whole)
    if slope:
        notes.append(
            f"the runway climbs by {100.0 * slope:.2f} % by the altitudes; it counts. Were it"
            f" level, rolling friction would be about {slope:.4f} more. Static pressure that errs"
            " with speed looks alike"
        )
        if "height_above_ground" not in flight:
            notes.append(
                "height above ground is not known: what rolled more than a few metres above or"
                " below the place of standstill was left out as flight"
            )
        series["force_x"] = series["force_x"] - GRAVITY * slope * series["mass"]
    elif np.isnan(spread):
        notes.append("the runway's slope is not known: 1 % of climb looks like 0.01 of friction")
    elif spread > _LEAST_SLOPE:
        notes.append(
            f"the runway is level to +- {100.0 * spread:.1g} % (95 %) by the altitudes: rolling"
            f" friction may be off by {spread:.1g} beside its own error"
        )
    travel = _compression(model.database, at_start, start, altitude or 0.0)
    kept = _on_all_wheels(flight, whole, start["theta"], travel, notes)
    if (kept.stop - kept.start) * flight.step < _SHORTEST:
        raise InputError("wheels are in the air", where, "choose a roll on all wheels")
    time = flight.time[whole][kept]
    record = TimeHistory(
        name,
        time,
        {key: np.asarray(value[kept]) for key, value in series.items()},
        {key: value[kept] for key, value in measured.items()},
    )
    return record, start, notes


def _measured(flight: Flight, whole: slice) -> dict[str, Array]:
    """What a roll is compared with, NaN where it was not measured; headings are continuous, and
    airspeeds those of a fast roll."""
    place = places(flight)
    found = {}
    for name in OUTPUTS:
        values = place.get(name) if name in ("north", "east") else None
        if values is None and name in flight:
            values = np.where(flight.usable([name]), flight[name], np.nan)
        found[name] = np.full(len(flight.time), np.nan)[whole] if values is None else values[whole]
    heading = found["psi"]
    good = np.isfinite(heading)
    found["psi"][good] = np.unwrap(heading[good])
    fast = np.nanmax(found["V"], initial=0.0)
    found["V"] = np.where(found["V"] > _PITOT * fast, found["V"], np.nan)
    return found


def _unknowns(record: TimeHistory, wind: tuple[float, float] | None) -> list[Parameter]:
    """The wind of a roll and how it began, from its first seconds."""
    first, ways = _first(record.time, record.outputs), ("north", "east")
    return [
        *(
            Parameter(f"wind_{way}[{record.name}]", 0.0, "m/s", prior=0.0, prior_error=_WIND)
            if wind is None
            else Parameter(f"wind_{way}[{record.name}]", blown, "m/s", free=False)
            for way, blown in zip(ways, wind or (0.0, 0.0), strict=True)
        ),
        *(
            Parameter(f"initial_{name}[{record.name}]", first[name], unit)
            for name, unit in START.items()
        ),
    ]


def _first(time: Array, measured: Mapping[str, Array]) -> dict[str, float]:
    """How a roll begins, by polynomials through its first seconds."""
    early = time - time[0] <= 2.0 * _BEGINNING
    since = time[early] - time[0]

    def fitted(name: str, order: int) -> Array | None:
        values = measured[name][early]
        good = np.isfinite(values)
        if good.sum() <= 2 * order:
            return None
        return np.polyfit(since[good], values[good], order)[::-1]

    place = {way: fitted(way, 2) for way in ("north", "east")}
    velocity = []
    for way in ("north", "east"):
        own, along = fitted(f"velocity_{way}", 1), place[way]
        velocity.append(
            float(own[0]) if own is not None else 0.0 if along is None else float(along[1])
        )
    heading = fitted("psi", 1)
    psi = float(np.arctan2(velocity[1], velocity[0])) if heading is None else float(heading[0])
    speed, drift = (
        velocity[0] * np.cos(psi) + velocity[1] * np.sin(psi),
        velocity[1] * np.cos(psi) - velocity[0] * np.sin(psi),
    )
    return {
        "speed": float(speed),
        "drift": float(drift) if heading is not None else 0.0,
        "psi": psi,
        "r": 0.0 if heading is None else float(heading[1]),
        **{way: 0.0 if value is None else float(value[0]) for way, value in place.items()},
    }


def _compression(
    database: AeroDatabase,
    at_start: Mapping[str, float],
    start: Mapping[str, float],
    ground: float,
) -> float:
    """By how much [m] the leg that is compressed most carries the vehicle."""
    points = contact_points(database) - [at_start[f"cg_{axis}"] for axis in "xyz"]
    phi, theta = start["phi"], start["theta"]
    down = [-np.sin(theta), np.cos(theta) * np.sin(phi), np.cos(theta) * np.cos(phi)]
    return float((points @ down).max() - (start["altitude"] - ground))


def _on_all_wheels(
    flight: Flight, whole: slice, level: float, travel: float, notes: list[str]
) -> slice:
    """The longest part of a roll (its own samples) in which all wheels are on the ground.

    level : pitch attitude on all wheels [rad]. travel : of the legs under the weight [m].
    """
    n = whole.stop - whole.start
    window = max(3, round(_NOSE_WINDOW / flight.step))
    low = np.ones(n, dtype=bool)
    theta = _bridged(flight, "theta", whole)
    if theta is None:
        notes.append("theta is not known; all wheels were taken to be on the ground")
    else:
        low = median_filter(theta, window, mode="nearest") < level + _NOSE_UP
    height = _bridged(flight, "height_above_ground", whole)
    bounced = np.zeros(n, dtype=bool)
    if height is not None:
        smooth = median_filter(height, window, mode="nearest")
        noise = np.std(np.diff(height, 2)) / np.sqrt(SECOND_DIFFERENCE * window)
        ahead = round(_SETTLES / flight.step)
        later = median_filter(smooth, ahead, mode="nearest", origin=-(ahead // 2))
        bounced = smooth - later > travel + standard_errors(CLAIM) * noise
    edges = np.flatnonzero(np.diff(np.concatenate([[False], low & ~bounced, [False]]).astype(int)))
    if not len(edges):
        return slice(0, 0)
    parts = edges.reshape(-1, 2)
    first, last = parts[np.argmax(parts[:, 1] - parts[:, 0])]
    if bounced.any():
        notes.append(
            f"it leaves the ground for {bounced.sum() * flight.step:.1f} s; the longest part on all"
            " wheels was taken"
        )
    if not low.all():
        notes.append(
            f"{(n - last + first) * flight.step:.1f} s with the nose wheel in the air left out"
        )
    return slice(int(first), int(last))


def _bridged(flight: Flight, name: str, whole: slice) -> Array | None:
    """A channel (n,) of a roll, interpolated where it may not be used; None where it never may."""
    if name not in flight or not (usable := flight.usable([name])[whole]).any():
        return None
    good = np.flatnonzero(usable)
    return np.interp(np.arange(len(usable)), good, flight[name][whole][good])


def _slope(flight: Flight, whole: slice) -> tuple[float, float]:
    """Slope of the runway along a roll, 0 where the altitudes show none, and half of its interval
    of 95 %; NaN where they tell nothing."""
    moving = ground_speed(flight)
    if "altitude" not in flight or moving is None:
        return 0.0, np.nan
    good = flight.usable(["altitude"])[whole]
    way = np.cumsum(moving[whole]) * flight.step
    if good.sum() < 4 * _PARTS:
        return 0.0, np.nan
    parts = np.array_split(np.flatnonzero(good), _PARTS)
    x = np.array([way[part].mean() for part in parts])
    y = np.array([flight["altitude"][whole][part].mean() for part in parts])
    x = x - x.mean()
    spread = float(x @ x)
    if not spread > 0.0:
        return 0.0, np.nan
    slope = float(x @ y) / spread
    left = y - y.mean() - slope * x
    error = float(np.sqrt(left @ left / (_PARTS - 2) / spread))
    shown = abs(slope) > max(_SLOPED * error, _LEAST_SLOPE)
    return slope if shown else 0.0, float(np.hypot(half_interval(error), slope))


def _mean(flight: Flight, name: str, whole: slice) -> float | None:
    if name not in flight:
        return None
    good = flight.usable([name], despite=("on_ground",))[whole]
    return float(flight[name][whole][good].mean()) if good.any() else None
