"""Which deflections control which axis, and whether their size can be an angle of a surface."""

from collections.abc import Collection
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from aerodb.conditioning import Suspicion
from aerodb.flight import Flight
from aerodb.nomenclature import is_surface
from aerodb.support import HALF, Array
from aerodb.suspicions.evidence import FEWEST, LARGEST_ANGLE
from aerodb.suspicions.in_flight import flying
from aerodb.vehicle import Surface, Vehicle

#: Deflection beyond the limits, as a share of the travel, that no rigging explains.
BEYOND = HALF
#: Least share of a flight at the limits that no flight has: commands beyond them are clipped.
CLIPPED = 0.4
_ROLES = {"elevator": "pitch", "aileron": "roll", "rudder": "yaw"}
#: Words of a name that is no elevator, aileron or rudder although it contains one, or no surface.
_OTHERS = ("ruddervator", "elevon", "tab", "trim", "gear")


@dataclass(frozen=True)
class Control:
    """A control: the channels that make it with their weights, its role (``pitch roll yaw``, or
    empty), whether it acts on the lateral axes (None: not known), whether its sign is that of the
    conventions, and whether it is the only one of its role."""

    parts: tuple[tuple[str, float], ...]
    role: str
    lateral: bool | None
    signed: bool
    alone: bool = True


def along(flight: Flight, control: Control) -> Array:
    """Return the deflection (n,) of a control [rad]."""
    return np.asarray(sum(weight * flight[name] for name, weight in control.parts))


def size_suspicions(flight: Flight, vehicle: Vehicle) -> tuple[Suspicion, ...]:
    """Return surfaces that deflect far beyond their limits, or beyond any surface's.

    Deflections (n,) [rad]. Source: `docs/method/consistency.md`, section "Against the vehicle".
    """
    listed = []
    combined = {f"delta_{name}" for name in vehicle.combinations}
    where = flying(flight, ())
    for name in flight.channels:
        if not is_surface(name) or name in combined or name == "delta_landing_gear":
            continue
        good = where & flight.usable([name], despite=("implausible", "stuck"))
        if int(good.sum()) < FEWEST:
            continue
        low, high = (float(v) for v in np.quantile(flight[name][good], [0.02, 0.98]))
        surface = vehicle.surfaces.get(name.removeprefix("delta_"))
        least, most = _bounds(surface)
        if low >= least and high <= most:
            listed += _at_its_limits(name, flight[name][good], surface)
            continue
        size = max(abs(low), abs(high))
        unit = "in microseconds" if size > 400.0 else "in percent or degrees" if size > 3.0 else ""
        words = (
            f"{name} reaches {low if size == abs(low) else high:.4g} rad, beyond"
            f" {'its limits' if surface else 'any surface'} ({least:.3g} to {most:.3g} with a"
            f" margin): it is {unit or 'in another unit'}, or its scale or zero is wrong"
        )
        listed.append(Suspicion(name, "unit", words, {"low": low, "high": high}))
    return tuple(listed)


def copied_suspicions(flight: Flight, vehicle: Vehicle) -> tuple[Suspicion, ...]:
    """Return surfaces with the samples of a surface about another axis: one field was mapped twice.

    Elevators, ailerons and rudders by their names; a rudder is no copy of any other surface.

    Samples are (n,) [rad]. Source: `docs/method/consistency.md`, section "Against the vehicle".
    """
    combined = {f"delta_{name}" for name in vehicle.combinations}
    names = [n for n in flight.channels if is_surface(n) and n not in combined]
    listed = []
    for name, other in permutations(names, 2):
        role, its = role_of(name), role_of(other)
        apart = role == "yaw" != its or (role == "roll" and its == "pitch")
        if apart and np.ptp(flight[name]) > 0.0 and np.array_equal(flight[name], flight[other]):
            words = f"{name} has the samples of {other}: one field of the log was mapped to both"
            listed.append(Suspicion(name, "swapped", words, {}))
    return tuple(listed)


def _at_its_limits(name: str, values: Array, surface: Surface | None) -> list[Suspicion]:
    """Return a control that stands at its limits: its command is clipped there."""
    if surface is None or not surface.limits[0] < 0.0 < surface.limits[1]:
        return []
    share = float(np.mean(np.any([np.isclose(values, limit) for limit in surface.limits], axis=0)))
    if share < CLIPPED:
        return []
    words = (
        f"{name} stands at its limits for {100 * share:.0f} % of the flight: the unit, scale or"
        " offset of its command is another"
    )
    return [Suspicion(name, "unit", words, {"share": share})]


def _bounds(surface: Surface | None) -> tuple[float, float]:
    if surface is None:
        return -LARGEST_ANGLE, LARGEST_ANGLE
    low, high = surface.limits
    margin = BEYOND * (high - low)
    return low - margin, high + margin


def by_role(flight: Flight, vehicle: Vehicle, unusable: Collection[str]) -> dict[str, Control]:
    """Return the controls of a flight by channel name; pairs of sides as one, combinations in place
    of their members; weights are dimensionless scalars.

    vehicle : its combinations, and whether a sign is declared.
    """
    members = {f"delta_{side}" for c in vehicle.combinations.values() for side in (c.right, c.left)}
    controls: dict[str, Control] = {}
    for name in flight.channels:
        if not is_surface(name) or name in members or name in unusable:
            continue
        if name == "delta_landing_gear":
            continue
        role = role_of(name)
        pair = _pair(name, flight)
        if pair is not None and role in ("pitch", "roll", "yaw") and "elevon" not in name:
            right, left = pair
            if {right, left} & set(unusable) or name == left:
                continue
            weights = (0.5, -0.5) if role == "roll" else (0.5, 0.5)
            signed = is_declared(right, vehicle) and is_declared(left, vehicle)
            parts = ((right, weights[0]), (left, weights[1]))
            controls[right.removesuffix("_right")] = Control(parts, role, role != "pitch", signed)
            continue
        lateral = None if not role else role != "pitch"
        controls[name] = Control(((name, 1.0),), role, lateral, is_declared(name, vehicle))
    counts = [control.role for control in controls.values()]
    return {
        name: Control(c.parts, c.role, c.lateral, c.signed, counts.count(c.role) == 1)
        for name, c in controls.items()
    }


def role_of(name: str) -> str:
    """Return the role of a surface by its name: ``pitch roll yaw``, or empty."""
    if any(word in name for word in _OTHERS):
        return ""
    return next((role for word, role in _ROLES.items() if word in name), "")


def _pair(name: str, flight: Flight) -> tuple[str, str] | None:
    """Return the right and the left channel of a surface with two sides; None for another."""
    stem = name.removesuffix("_right").removesuffix("_left")
    right, left = f"{stem}_right", f"{stem}_left"
    return (right, left) if stem != name and right in flight and left in flight else None


def is_declared(name: str, vehicle: Vehicle) -> bool:
    """Return whether the vehicle file declares a deflection, with the sign of the conventions
    (docs/reference/conventions.md, section Axes, signs, units)."""
    short = name.removeprefix("delta_")
    combination = vehicle.combinations.get(short)
    if combination is not None:
        wanted = "asymmetric" if role_of(name) == "roll" else "symmetric"
        sides = (f"delta_{combination.right}", f"delta_{combination.left}")
        return combination.kind == wanted and all(is_declared(side, vehicle) for side in sides)
    surface = vehicle.surfaces.get(short)
    if surface is None:
        return False
    said = surface.convention.lower()
    usual = said.startswith("trailing edge down positive")
    return usual or (role_of(name) == "yaw" and said.startswith("trailing edge left positive"))
