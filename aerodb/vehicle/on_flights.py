"""What a vehicle adds to the channels of a flight: combined surfaces, mass, CG and inertia."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from aerodb.errors import InputError
from aerodb.flight import Flight
from aerodb.support import Array
from aerodb.vehicle.description import Vehicle
from aerodb.vehicle.mass_properties import MASS_CHANNELS, after_events


def add_combinations(flight: Flight, vehicle: Vehicle) -> Flight:
    """Return the flight with ``delta_<name>`` of every combination whose two surfaces it has.

    A sample is flagged where either surface is. Source: "Data Analysis of Phoenix Reusable Launch
    Vehicle Demonstrator Flight Test", below eq. 6.

    Deflections are (n,) [rad].
    """
    deflections: dict[str, Array] = {}
    flags: dict[str, NDArray[np.uint8]] = {}
    for name, combination in vehicle.combinations.items():
        right, left = f"delta_{combination.right}", f"delta_{combination.left}"
        if right in flight and left in flight:
            sign = 1.0 if combination.kind == "symmetric" else -1.0
            deflections[f"delta_{name}"] = 0.5 * (flight[right] + sign * flight[left])
            bits = [flight.flags[side] for side in (right, left) if side in flight.flags]
            if bits:
                flags[f"delta_{name}"] = np.bitwise_or.reduce(bits)
    return replace(flight.with_channels(deflections), flags={**flight.flags, **flags})


def mass_channels(flight: Flight, vehicle: Vehicle) -> Mapping[str, Array]:
    """Return mass [kg], CG [m, from the datum] and inertia [kg m2] at each sample.

    The keys are the channels mass, cg_x, cg_y, cg_z, Ixx, Iyy, Izz and Ixz; each (n,). Raises
    InputError when the vehicle file expects logged values that the flight does not have. Events of
    mass that the file states for this flight count from their time on.
    """
    properties, n = vehicle.mass, len(flight.time)
    names = MASS_CHANNELS
    if properties.source == "channels":
        absent = [name for name in names if name not in flight]
        if absent:
            what = f"mass properties are not logged: {', '.join(absent)}"
            raise InputError(
                what, f"flight {flight.id}", "state constants in [mass] of the vehicle file"
            )
        return {name: flight[name] for name in names}
    columns = np.column_stack(
        [
            np.atleast_1d(np.asarray(properties.mass, float)),
            np.atleast_2d(np.asarray(properties.cg, float)),
        ]
        + [np.atleast_1d(np.asarray(getattr(properties, name), float)) for name in names[4:]]
    )
    if properties.source == "constant":
        constant = {name: np.full(n, columns[0, k]) for k, name in enumerate(names)}
        return after_events(flight, constant, properties.event)
    if "fuel_mass" not in flight:
        raise InputError(
            "the fuel table needs channel fuel_mass, which is not logged",
            f"flight {flight.id}",
            "log fuel_mass, state in [fuel] of the vehicle file where what was used is logged, or"
            " state constants in [mass]",
        )
    burnt = {
        name: np.interp(flight["fuel_mass"], properties.fuel_mass, columns[:, k])
        for k, name in enumerate(names)
    }
    return after_events(flight, burnt, properties.event)


def with_mass_channels(flight: Flight, vehicle: Vehicle) -> Flight:
    """Return the flight with mass [kg], CG [m] and inertia [kg m2] of the vehicle file where it has
    no such channels: a database may depend on them.

    Raises InputError as `mass_channels` does.
    """
    properties = mass_channels(flight, vehicle)
    return flight.with_channels({k: v for k, v in properties.items() if k not in flight})


def cg_positions(flight: Flight, vehicle: Vehicle) -> Array:
    """Return the CG position at each sample, (n, 3) [m] in body axes from the datum.

    Raises InputError as `mass_channels` does.
    """
    properties = mass_channels(flight, vehicle)
    return np.column_stack([properties[name] for name in ("cg_x", "cg_y", "cg_z")])
