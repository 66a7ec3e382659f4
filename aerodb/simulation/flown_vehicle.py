"""How a vehicle file and a database become what flies: masses, propulsion, limits and a
`FlightModel`."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.parts import command_ranges
from aerodb.physics import Earth
from aerodb.simulation.engine import FlightModel, Propulsion, flight_model
from aerodb.tables import AeroDatabase, parse
from aerodb.vehicle import Vehicle

#: Mass properties of a run: mass [kg], CG from the vehicle's datum [m], inertia about it [kg m2].
MASS_PROPERTIES: Final = ("mass", "cg_x", "cg_y", "cg_z", "Ixx", "Iyy", "Izz", "Ixz")


@dataclass(frozen=True, eq=False)
class FlownVehicle:
    """A vehicle with a database, at one fuel state.

    Parameters
    ----------
    vehicle : its file.
    model : the database with the vehicle's propulsion.
    masses : each of `MASS_PROPERTIES`.
    propulsion : of a vehicle whose thrust is an input ("thrust"); else a further force.
    limits : input -> lower and upper limit [rad], of a throttle 0 and 1.
    """

    vehicle: Vehicle
    model: FlightModel
    masses: Mapping[str, float]
    propulsion: tuple[Propulsion, ...]
    limits: Mapping[str, tuple[float, float]]

    @property
    def thrust(self) -> str:
        """The series that holds the airspeed."""
        return "thrust" if self.propulsion else "force_x"

    def build(self, database: AeroDatabase) -> FlightModel:
        """Return the model of another database with the same propulsion (`flight_model`; its errors
        are InputError)."""
        return flight_model(database, engines=self.propulsion)


def flown_of(
    vehicle: Vehicle,
    database: AeroDatabase,
    *,
    fuel: float | None = None,
    given: Mapping[str, float] | None = None,
) -> FlownVehicle:
    """Return a vehicle that flies on a database.

    Parameters
    ----------
    fuel : fuel mass [kg], for a vehicle with a table of it.
    given : mass properties by name, for a vehicle whose masses are logged in flight.

    Raises InputError where the masses are not known.
    """
    masses = _masses(vehicle, fuel, given or {})
    cg = (masses["cg_x"], masses["cg_y"], masses["cg_z"])
    lines = vehicle.thrust.lines.values() if vehicle.thrust.source == "channel" else ()
    propulsion = tuple(
        Propulsion(parse(f"thrust/{len(lines)}"), line.point or cg, line.direction)
        for line in lines
    )
    model = flight_model(database, engines=propulsion)
    known = {**command_ranges(database), **surface_limits(vehicle), "throttle": (0.0, 1.0)}
    limits = {n: ends for n, ends in known.items() if n in model.inputs}
    return FlownVehicle(vehicle, model, masses, propulsion, limits)


def stretch_model(
    database: AeroDatabase,
    flight: Flight,
    feedback: Mapping[tuple[str, str], float] | None = None,
) -> FlightModel:
    """Return the database as a `FlightModel` (SI units): over the rotating earth where the flight's
    place is known, else over a flat one."""
    earth = None
    if "latitude" in flight and "longitude" in flight:
        good = flight.usable(["latitude", "longitude"])
        if good.any():
            place = (float(np.median(flight[name][good])) for name in ("latitude", "longitude"))
            earth = Earth(*place)
    return flight_model(database, feedback=feedback, earth=earth)


def surface_limits(vehicle: Vehicle) -> dict[str, tuple[float, float]]:
    """Return limits (low, high) of the surfaces [rad], and of combinations of two, each by itself,
    as `Vehicle.surfaces` states them."""
    ends = {name: surface.limits for name, surface in vehicle.surfaces.items()}
    for name, pair in vehicle.combinations.items():
        right, left = vehicle.surfaces[pair.right].limits, vehicle.surfaces[pair.left].limits
        other = left if pair.kind == "symmetric" else (-left[1], -left[0])
        ends[name] = (0.5 * (right[0] + other[0]), 0.5 * (right[1] + other[1]))
    return {f"delta_{name}": limits for name, limits in ends.items()}


def _masses(vehicle: Vehicle, fuel: float | None, given: Mapping[str, float]) -> dict[str, float]:
    """Mass properties of the vehicle file, by name."""
    properties = vehicle.mass
    where = f"vehicle {vehicle.name}"
    if properties.source == "channels":
        absent = [name for name in MASS_PROPERTIES if name not in given]
        if absent:
            raise InputError(
                f"its mass properties are logged in flight: {', '.join(absent)} are not known",
                where,
                f"state them: --set {absent[0]}=VALUE",
            )
        return {name: given[name] for name in MASS_PROPERTIES}
    columns = np.column_stack(
        [
            np.atleast_1d(np.asarray(properties.mass, float)),
            np.atleast_2d(np.asarray(properties.cg, float)),
            *(
                np.atleast_1d(np.asarray(getattr(properties, name), float))
                for name in MASS_PROPERTIES[4:]
            ),
        ]
    )
    if properties.source == "constant":
        if fuel is not None:
            raise InputError("its mass is constant", where, "leave out --fuel")
        return dict(zip(MASS_PROPERTIES, columns[0].tolist(), strict=True))
    low, high = properties.fuel_mass[0], properties.fuel_mass[-1]
    if fuel is None or not low <= fuel <= high:
        raise InputError(
            "its masses are a table over fuel mass"
            + ("" if fuel is None else f", which ends before {fuel:g} kg"),
            where,
            f"state it: --fuel, from {low:g} to {high:g} kg",
        )
    return {
        name: float(np.interp(fuel, properties.fuel_mass, columns[:, k]))
        for k, name in enumerate(MASS_PROPERTIES)
    }
