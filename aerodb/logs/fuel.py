"""Fuel on board from what the engines used: mass, CG and inertia then follow from the vehicle
file's fuel table."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from aerodb.flight import Flight
from aerodb.signals import bridge
from aerodb.support import Array
from aerodb.vehicle import Vehicle


def with_fuel_mass(flight: Flight, vehicle: Vehicle) -> Flight:
    """Return the flight with the channel ``fuel_mass`` [kg], where [fuel] of the vehicle file tells
    how to make it and the log does not hold it.

    ``initial`` less what all engines have used, or less the integral of their flows. Gaps are
    bridged; an engine of which nothing is logged leaves the channel out.
    """
    fuel = vehicle.fuel
    if fuel is None or "fuel_mass" in flight:
        return flight
    used = [f"fuel_used_{engine}" for engine in fuel.used]
    flows = [f"fuel_flow_{engine}" for engine in fuel.flow]
    if used and all(name in flight for name in used):
        burnt, source = _sum(flight, used), " and ".join(used)
    elif flows and all(name in flight for name in flows):
        flow = _sum(flight, flows)
        steps = 0.5 * (flow[1:] + flow[:-1]) * np.diff(flight.time)
        burnt = np.concatenate([[0.0], np.cumsum(steps)])
        source = "the integral of " + " and ".join(flows)
    else:
        return flight
    mass = np.maximum(fuel.initial - burnt, 0.0)
    note = f"fuel_mass is {fuel.initial:g} kg less {source}"
    return replace(flight.with_channels({"fuel_mass": mass}), notes=(*flight.notes, note))


def _sum(flight: Flight, names: Sequence[str]) -> Array:
    return np.asarray(np.sum([bridge(flight[name]) for name in names], axis=0))
