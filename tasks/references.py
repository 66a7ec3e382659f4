"""Resolve what a user names: a vehicle, a version, a point or a table node.

The command line and the console both use these functions.
"""

import math
import re
from collections.abc import Iterable
from datetime import UTC, datetime
from typing import Final

from aerodb.errors import InputError, UnknownNameError, nearest
from aerodb.nomenclature import channel
from aerodb.storage.catalogue import Catalogue, VersionRow
from aerodb.units import quantity

#: Brackets and powers of numbers: no unit needs them, and they could produce huge numbers.
_LABORIOUS: Final = re.compile(r"[()\[\]]|\d\s*(\*\*|\^)")
_LONGEST_VALUE: Final = 60
_NODE: Final = re.compile(r"\s*([A-Za-z_]\w*)\s*\[\s*(\d{1,9}(?:\s*,\s*\d{1,9})*)\s*\]\s*")


def vehicle_of(catalogue: Catalogue, vehicle: str | None) -> str:
    """Return the vehicle that is named, or the only one of `Catalogue.vehicles`; UnknownNameError
    otherwise."""
    if vehicle is not None:
        return catalogue.vehicle(vehicle).name
    names = [row.name for row in catalogue.vehicles()]
    if len(names) != 1:
        raise UnknownNameError(
            "which vehicle?",
            remedy=f"--vehicle {' or '.join(names)}" if names else "add one: aerodb vehicle add",
        )
    return names[0]


def version_of(
    catalogue: Catalogue, reference: str, vehicle: str | None, as_of: str | None = None
) -> VersionRow:
    """Return the version that a reference names, now or as of a date (ISO 8601). Raises InputError
    for what is no date, UnknownNameError for an unknown reference."""
    when = None
    if as_of is not None:
        try:
            when = datetime.fromisoformat(as_of)
            when = when.replace(tzinfo=UTC) if when.tzinfo is None else when.astimezone(UTC)
        except (ValueError, OverflowError) as error:
            raise InputError(
                f"'{as_of}' is not a date", "--as-of", "for example 2026-05-31 or 2026-05-31T12:00"
            ) from error
    return catalogue.version(vehicle_of(catalogue, vehicle), reference, when)


#: Other names of inputs that people write, in lower case.
_ALIASES: Final = {
    **dict.fromkeys(("aoa", "angle_of_attack", "alfa"), "alpha"),
    **dict.fromkeys(("aos", "angle_of_sideslip", "sideslip"), "beta"),
    **dict.fromkeys(("airspeed", "true_airspeed", "tas", "speed"), "V"),
    **dict.fromkeys(("mach_number", "ma"), "mach"),
    **dict.fromkeys(("dynamic_pressure", "q_bar"), "qbar"),
    **dict.fromkeys(("roll_rate",), "p"),
    **dict.fromkeys(("pitch_rate",), "q"),
    **dict.fromkeys(("yaw_rate",), "r"),
    **{
        alias: f"delta_{surface}"
        for surface in ("elevator", "aileron", "rudder", "flap")
        for alias in (surface, f"{surface}_deflection")
    },
}


def point_of(text: str, inputs: tuple[str, ...]) -> dict[str, float]:
    """Parse ``NAME=VALUE,...`` to channel -> value [SI]; common other names are taken (aoa,
    airspeed, elevator).

    Raises InputError for a name that is not one of `inputs` or stands twice, and for a value that
    is not a number.
    """
    point = {}
    for part in filter(None, (part.strip() for part in text.split(","))):
        name, sign, value = (piece.strip() for piece in part.partition("="))
        if name not in inputs:
            name = _ALIASES.get(name.casefold(), name)
        if not sign or name not in inputs:
            raise InputError(
                f"'{part}' is not an input of this version", "--at", nearest(name, inputs)
            )
        if name in point:
            raise InputError(f"{name} stands twice", "--at", "give each input once")
        point[name] = value_of(name, value)
    return point


#: Largest angle [rad] that a number without a unit is taken for: beyond a quarter of a turn it is
#: rather meant in degrees.
_LARGEST_PLAIN_ANGLE: Final = 1.6
#: Angles that may be anything.
_WHOLE_TURN: Final = ("psi", "longitude")


def value_of(name: str, text: str, *, by_program: bool = False) -> float:
    """Parse the value of an input, with a unit or in SI, to a finite value [SI]; InputError
    otherwise, and for an angle above 1.6 rad without a unit. by_program : SI without a unit.

    >>> value_of("V", "36 km/h")
    10.0
    """
    try:
        unit = channel(name).unit
    except UnknownNameError:
        unit = "1"  # a free input of an imported file: a bare number
    if len(text) > _LONGEST_VALUE or _LABORIOUS.search(text):
        raise InputError(
            f"'{text[:_LONGEST_VALUE]}' is not a quantity",
            "--at",
            "write a number, or a number with a unit: 5deg",
        )
    value = quantity(text, unit)
    plain = text.strip()[-1:].isdigit() or text.strip().endswith(".")
    doubtful = plain and abs(value) > _LARGEST_PLAIN_ANGLE and math.isfinite(value)
    if unit == "rad" and doubtful and not by_program and name not in _WHOLE_TURN:
        raise InputError(
            f"{name}={text} has no unit, and {value:g} rad are {math.degrees(value):.0f} deg",
            remedy=f"write {text.strip()}deg or {text.strip()}rad",
        )
    if not math.isfinite(value):
        raise InputError(
            f"'{name}={text}' is not a finite number", "--at", "give a number, with a unit or in SI"
        )
    return value


def node_of(text: str) -> tuple[str, tuple[int, ...]]:
    """Parse ``TABLE[i,j]`` to the table's name and the index; InputError for anything else.

    >>> node_of("CZ0[2, 1]")
    ('CZ0', (2, 1))
    """
    match = _NODE.fullmatch(text)
    if match is None:
        raise InputError(
            f"'{text}' is not a table node",
            "--node",
            "write TABLE[i,j], counted from 0, for example CZ0[2]",
        )
    return match[1], tuple(int(k) for k in match[2].split(","))


def flights_to_judge(
    catalogue: Catalogue, version: VersionRow, named: Iterable[str] = ()
) -> tuple[list[str], bool]:
    """Return the flights (ids) on which a version is judged, and whether they are independent of
    it: those named, else those held out, else those that identified it.

    Raises InputError where there is none. Rule: docs/reference/conventions.md, section "Hold-out".
    """
    uses = catalogue.version_flights(version.id)
    held = [use.flight for use in uses if use.role == "held_out"]
    identified = sorted(use.flight for use in uses if use.role == "identified")
    flights = [catalogue.flight(name, version.vehicle).id for name in named] or held or identified
    if not flights:
        raise InputError(
            "no flights stand behind it", f"version {version.label}", "name flights with --flight"
        )
    return flights, not set(identified) & set(flights)
