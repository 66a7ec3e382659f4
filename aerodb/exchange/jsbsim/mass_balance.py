"""Mass, CG and inertia of a vehicle in a JSBSim aircraft file."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from aerodb.exchange.jsbsim.elements import Element, node
from aerodb.exchange.jsbsim.properties import FOOT, INCH, POUNDS_PER_SLUG, SLUG
from aerodb.vehicle import MassProperties

_INERTIAS: Final = ("Ixx", "Iyy", "Izz", "Ixz")
_UNKNOWN: Final = (
    "Placeholder: the mass is not known. Put the vehicle's own mass, inertia and centre of gravity"
    " here."
)


@dataclass(frozen=True)
class MassBalance:
    """One loading of a vehicle.

    mass : kg. cg : (3,) m, body axes from the datum. inertia : Ixx, Iyy, Izz, Ixz about the CG,
    kg m2; Ixz is the integral of x z dm. source : where the numbers are from, in words.
    """

    mass: float
    cg: tuple[float, float, float]
    inertia: tuple[float, float, float, float]
    source: str


def mass_balance_of(properties: MassProperties, source: str) -> MassBalance | None:
    """Return the loading (mass [kg], CG (3,) [m], inertia [kg m²]) that a vehicle file states: at
    half the range of its fuel table, if it has one; None where the mass is logged instead.

    source : names the vehicle file.
    """
    if properties.source == "channels":
        return None
    columns = np.column_stack(
        [
            np.atleast_1d(np.asarray(properties.mass, float)),
            np.atleast_2d(np.asarray(properties.cg, float)),
        ]
        + [np.atleast_1d(np.asarray(getattr(properties, name), float)) for name in _INERTIAS]
    )
    row = columns[0]
    if properties.source == "fuel_table":
        fuel = 0.5 * (properties.fuel_mass[0] + properties.fuel_mass[-1])
        row = np.array([np.interp(fuel, properties.fuel_mass, column) for column in columns.T])
        source = f"{source}, with {fuel:g} kg of fuel (the middle of its table)"
    mass, x, y, z, ixx, iyy, izz, ixz = row.tolist()
    return MassBalance(mass, (x, y, z), (ixx, iyy, izz, ixz), source)


def location(point: tuple[float, float, float], name: str) -> Element:
    """Return a point [m, body axes] in structural axes (inches, x aft, y right, z up), whose origin
    is the datum.

    The point is (3,).
    """
    x, y, z = point
    structural = {"x": -x / INCH + 0.0, "y": y / INCH, "z": -z / INCH + 0.0}
    return node(
        "location",
        *[node(axis, text=repr(position)) for axis, position in structural.items()],
        name=name,
        unit="IN",
    )


def mass_balance(
    balance: MassBalance | None, moment_reference: tuple[float, float, float]
) -> Element:
    """Return ``<mass_balance>``: that of `balance`, or placeholders about `moment_reference`.

    JSBSim's <ixz> is an element of the inertia tensor, minus the integral of x z dm
    (``negated_crossproduct_inertia``). Written are [slug ft²] and [lbs].
    """
    if balance is None:
        note, cg = _UNKNOWN, moment_reference
        inertias, pounds = dict.fromkeys(("ixx", "iyy", "izz"), 1000.0), 1000.0
    else:
        cg, given = balance.cg, zip(_INERTIAS, balance.inertia, strict=True)
        inertias = {name.lower(): value / (SLUG * FOOT**2) for name, value in given}
        inertias["ixz"] = 0.0 - inertias["ixz"]
        pounds = balance.mass / SLUG * POUNDS_PER_SLUG
        note = f"{balance.mass:g} kg; CG and inertia in structural axes: {balance.source}."
    return node(
        "mass_balance",
        node("documentation", text=note),
        *[node(tag, text=repr(value), unit="SLUG*FT2") for tag, value in inertias.items()],
        node("emptywt", text=repr(pounds), unit="LBS"),
        location(cg, "CG"),
        negated_crossproduct_inertia="true",
    )
