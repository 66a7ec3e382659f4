"""Completion of air data: density, airspeed, dynamic pressure, Mach number from logged channels."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from aerodb.flight import Flight
from aerodb.physics import density, mach_from_calibrated, speed_of_sound, standard_atmosphere
from aerodb.support import Array


@dataclass(frozen=True)
class _Rule:
    """Relation that computes channel `gives` from the channels `of`; `note` describes it."""

    gives: str
    of: tuple[str, ...]
    relation: Callable[..., Array]
    note: str


def _ratio(numerator: Array, denominator: Array) -> Array:
    """Return the quotient; nan where the denominator is not positive, as for air data at rest."""
    good = denominator > 0.0
    return np.where(good, numerator / np.where(good, denominator, 1.0), np.nan)


def _root(square: Array) -> Array:
    return np.asarray(np.sqrt(np.maximum(square, 0.0)))


# Applied in this order: a rule may use the result of an earlier one. Relations:
# `aerodb.physics.atmosphere`; qbar = rho V^2 / 2 = 0.7 p M^2.
_RULES: Sequence[_Rule] = (
    _Rule(
        "rho", ("static_pressure", "temperature"), density, "from static pressure and temperature"
    ),
    _Rule(
        "rho",
        ("qbar", "V"),
        lambda qbar, v: _ratio(2.0 * qbar, v * v),
        "from dynamic pressure and airspeed",
    ),
    _Rule(
        "mach",
        ("calibrated_airspeed", "static_pressure"),
        mach_from_calibrated,
        "from calibrated airspeed and static pressure",
    ),
    _Rule(
        "mach",
        ("calibrated_airspeed", "altitude"),
        lambda v, h: mach_from_calibrated(v, standard_atmosphere(h).pressure),
        "from calibrated airspeed and the standard atmosphere's pressure at the altitude",
    ),
    _Rule(
        "V",
        ("mach", "temperature"),
        lambda mach, t: mach * speed_of_sound(t),
        "from Mach number and temperature",
    ),
    _Rule(
        "rho",
        ("altitude", "temperature"),
        lambda h, t: density(standard_atmosphere(h).pressure, t),
        "from the standard atmosphere's pressure at the altitude and the measured temperature",
    ),
    _Rule(
        "rho",
        ("altitude",),
        lambda h: standard_atmosphere(h).density,
        "of the standard atmosphere at the altitude",
    ),
    _Rule(
        "V",
        ("qbar", "rho"),
        lambda qbar, rho: _root(_ratio(2.0 * qbar, rho)),
        "from dynamic pressure and density",
    ),
    _Rule("qbar", ("rho", "V"), lambda rho, v: 0.5 * rho * v * v, "from density and airspeed"),
    _Rule(
        "qbar",
        ("mach", "static_pressure"),
        lambda mach, p: 0.7 * p * mach**2,
        "from Mach number and static pressure",
    ),
    _Rule(  # again: calibrated airspeed and static pressure have given qbar by now
        "V",
        ("qbar", "rho"),
        lambda qbar, rho: _root(_ratio(2.0 * qbar, rho)),
        "from dynamic pressure and density",
    ),
    _Rule(
        "mach",
        ("V", "temperature"),
        lambda v, t: _ratio(v, speed_of_sound(t)),
        "from airspeed and temperature",
    ),
    _Rule(
        "mach",
        ("V", "altitude"),
        lambda v, h: v / speed_of_sound(standard_atmosphere(h).temperature),
        "from airspeed and the standard atmosphere's temperature at the altitude",
    ),
    # Last, and density with it: a measured pressure says more than the standard atmosphere.
    _Rule(
        "V",
        ("mach", "altitude"),
        lambda mach, h: mach * speed_of_sound(standard_atmosphere(h).temperature),
        "from Mach number and the standard atmosphere's temperature at the altitude",
    ),
    _Rule("qbar", ("rho", "V"), lambda rho, v: 0.5 * rho * v * v, "from density and airspeed"),
)


def complete_air_data(flight: Flight) -> Flight:
    """Return the flight with rho, V, qbar and mach computed where they are missing and can be.

    Each added channel has a note and is flagged where one of its sources is.

    Added channels are (n,), SI: kg/m^3, m/s, Pa, Mach number.
    """
    for rule in _RULES:
        if rule.gives in flight or not all(name in flight for name in rule.of):
            continue
        values = rule.relation(*(flight[name] for name in rule.of))
        if not np.any(np.isfinite(values)):
            continue
        bits = [flight.flags[name] for name in rule.of if name in flight.flags]
        flags = {**flight.flags, rule.gives: np.bitwise_or.reduce(bits)} if bits else flight.flags
        flight = replace(
            flight.with_channels({rule.gives: values}),
            flags=flags,
            notes=(*flight.notes, f"{rule.gives} {rule.note}"),
        )
    return flight
