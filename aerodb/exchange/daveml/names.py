"""Map DAVE-ML's names, units and signs to channels and axes (AIAA S-119 standard names)."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from aerodb.errors import InputError, OpenQuestionsError, Question
from aerodb.nomenclature import AXES, CHANNELS, channel, is_command, is_hinge_axis, is_surface
from aerodb.tables import WIND_AXES, Expression, Name, Negation, Number, Operation
from aerodb.units import conversion

#: Standard name of an input -> channel, equal sign conventions, opposite sign conventions.
_INPUTS: Final[dict[str, tuple[str, str, str]]] = {
    "angleOfAttack": ("alpha", "anu", "and"),
    "angleOfSideslip": ("beta", "anl wfr", "anr wfl"),
    "angleOfAttackRate": ("alphadot", "anu", "and"),
    "angleOfSideslipRate": ("betadot", "anl", "anr"),
    "mach": ("mach", "", ""),
    "machNumber": ("mach", "", ""),
    "trueAirspeed": ("V", "", ""),
    "calibratedAirspeed": ("calibrated_airspeed", "", ""),
    "dynamicPressure": ("qbar", "", ""),
    "airDensity": ("rho", "", ""),
    "bodyAngularRate_Roll": ("p", "rwd", "lwd"),
    "bodyAngularRate_Pitch": ("q", "anu", "and"),
    "bodyAngularRate_Yaw": ("r", "anr", "anl"),
    "eulerAngle_Roll": ("phi", "rwd", "lwd"),
    "eulerAngle_Pitch": ("theta", "anu", "and"),
    "eulerAngle_Yaw": ("psi", "anr", "anl"),
    "altitudeMSL": ("altitude", "up", "down dn"),
    "heightOfCgWrtRwy": ("height_above_ground", "up", "down dn"),
    "totalMass": ("mass", "", ""),
}
#: Standard name of an output -> axis, equal sign conventions, opposite sign conventions.
_OUTPUTS: Final[dict[str, tuple[str, str, str]]] = {
    "aeroBodyForceCoefficient_X": ("CX", "fwd", "aft"),
    "aeroBodyForceCoefficient_Y": ("CY", "rt right", "lt left"),
    "aeroBodyForceCoefficient_Z": ("CZ", "down dn", "up"),
    "aeroBodyMomentCoefficient_Roll": ("Cl", "rwd", "lwd"),
    "aeroBodyMomentCoefficient_Pitch": ("Cm", "anu", "and"),
    "aeroBodyMomentCoefficient_Yaw": ("Cn", "anr", "anl"),
    "totalCoefficientOfLift": ("C_lift", "up", "down dn"),
    "totalCoefficientOfDrag": ("C_drag", "aft", "fwd"),
    "totalCoefficientOfSideforce": ("C_side", "rt right", "lt left"),
}
#: Axis or channel -> its standard name.
STANDARD_OUTPUTS: Final = {axis: name for name, (axis, _, _) in _OUTPUTS.items()}
STANDARD_INPUTS: Final = {known: name for name, (known, _, _) in reversed(_INPUTS.items())}
STANDARD_SIGNS: Final = {
    row[0]: row[1].split()[0] for row in (*_INPUTS.values(), *_OUTPUTS.values()) if row[1]
}
#: Standard name -> attribute of `ReferenceGeometry`; positions are from the datum.
REFERENCES: Final = {
    "referenceWingArea": "area",
    "referenceWingChord": "chord",
    "referenceWingSpan": "span",
}
POSITIONS: Final = ("vrsPositionOfMrc_X", "vrsPositionOfMrc_Y", "vrsPositionOfMrc_Z")
POSITION_SIGNS: Final = (("fwd", "aft"), ("rt right", "lt left"), ("down dn", "up"))

_DEFLECTION = re.compile(r"([A-Za-z]\w*)Deflection")
_SURFACE_SIGNS: Final[tuple[str, str]] = ("ted tel ext", "teu ter ret")
_FACTOR = re.compile(r"([A-Za-z%]+)\^?(-?\d*)")
_UNITS: Final = {
    "f": "ft",
    "nd": "",
    "frac": "",
    "s": "s",
    "sec": "s",
    "d": "deg",
    "r": "rad",
    "pct": "percent",
    "k": "degK",
}


@dataclass(frozen=True)
class Declaration:
    """A variable as the file declares it, all as text."""

    identity: str
    name: str
    unit: str
    sign: str = ""


def described(meaning: str, declared: Declaration) -> str:
    """Return the description of a free input, with the unit and the sign that its file declares."""
    sign = f", positive {declared.sign}" if declared.sign else ""
    return f"{meaning} [{declared.unit}{sign}]"


def described_unit(description: str) -> str | None:
    """Return the unit of a `described` input, as its file writes it; None for another description.

    Stored databases hold the unit there alone.

    >>> described_unit("rudder [deg, positive tel]")
    'deg'
    """
    found = _DESCRIBED.search(description)
    return found[1].strip() if found else None


_DESCRIBED: Final = re.compile(r"\[([^\],]*)(?:, positive [^\]]*)?\]$")


def read_unit(unit: str) -> str:
    """Return a DAVE-ML unit in this product's spelling; units after an underscore divide (AIAA
    S-119).

    >>> read_unit("rad_s"), read_unit("f2"), read_unit("kg_m3"), read_unit("nd")
    ('rad/s', 'ft^2', 'kg/m^3', '')
    """
    top, *below = unit.strip().split("_")
    if "/" in unit or "*" in unit or " " in unit.strip():
        return unit.strip()
    above = [_factor(top)] if _factor(top) else []
    return "/".join([*(above or (["1"] if below else [])), *map(_factor, below)])


def _factor(text: str) -> str:
    match = _FACTOR.fullmatch(text)
    if match is None:
        return text
    name = _UNITS.get(
        match[1].lower() if match[1].lower() in ("nd", "sec", "pct") else match[1], match[1]
    )
    return f"{name}^{match[2]}" if name and match[2] else name


def write_unit(unit: str) -> str:
    """Return an SI unit of `CHANNELS` in DAVE-ML's spelling (AIAA S-119).

    >>> write_unit("rad/s"), write_unit("kg/m^3"), write_unit("1"), write_unit("m/s^2")
    ('rad_s', 'kg_m3', 'nd', 'm_s2')
    """
    return (
        unit.replace("/", "_").replace("^", "").replace(" ", "") if unit not in ("", "1") else "nd"
    )


def unit_conversion(unit: str, to: str) -> tuple[float, float] | None:
    """Return scale and offset from a DAVE-ML unit to the unit `to`.

    None if the unit is unknown or of another dimension.
    """
    try:
        return conversion(read_unit(unit), to)
    except InputError:
        return None


def sign_factor(sign: str, same: str, opposite: str) -> int:
    """Return 1 or -1 (dimensionless) for a known sign convention, 0, and no error, for an unknown
    one.

    A file that states none uses the standard's own: 1.
    """
    word = sign.strip().lower().lstrip("+")
    if not word or word in same.split():
        return 1
    return -1 if word in opposite.split() else 0


def input_channel(declared: Declaration, where: str) -> tuple[str, int] | None:
    """Return the channel of an input and its sign; None if the input is not a channel.

    An input is identified by its standard name, by the name or id of a channel, or as
    ``<surface>Deflection`` with a stated sign.

    Raises OpenQuestionsError, with the bindings to choose from, if the name identifies a channel
    but the sign or unit does not match.
    """
    known = _standard(_INPUTS, declared.name)
    if known is None:
        own = next(
            (
                each
                for each in (declared.name, declared.identity)
                if each in CHANNELS or is_surface(each) or is_command(each)
            ),
            None,
        )
        if own is None or unit_conversion(declared.unit, channel(own).unit) is None:
            return _surface(declared)
        known = next((row for row in _INPUTS.values() if row[0] == own), (own, *_SURFACE_SIGNS))
    sign = sign_factor(declared.sign, known[1], known[2])
    if unit_conversion(declared.unit, channel(known[0]).unit) is None:
        raise _unit_question(declared, known[0], where)
    if sign == 0:
        raise _sign_question(declared, known, where)
    return known[0], sign


def _unit_question(declared: Declaration, name: str, where: str) -> OpenQuestionsError:
    """An input that its name identifies and whose unit is unknown, or of another dimension."""
    what = (
        f"input {declared.name} in '{declared.unit}' cannot be {name}, which is in"
        f" {channel(name).unit}"
    )
    question = Question(what, declared.identity, ((f"{name}*FACTOR", ""),))
    return OpenQuestionsError(what, where, "bind it in the unit of the file", [question])


def _sign_question(
    declared: Declaration, known: tuple[str, str, str], where: str
) -> OpenQuestionsError:
    """An input that its name identifies and whose sign convention is not known."""
    name, same, opposite = known
    known_signs = f"positive like {name}: {same or 'none'}; opposite: {opposite or 'none'}"
    what = (
        f"input {declared.name} cannot be {name} without its sign convention: '{declared.sign}' is"
        f" none that is known ({known_signs})"
    )
    unit = channel(name).unit
    proposals = tuple(
        (
            str(channel_in_unit(Name(name), declared.unit, unit, sign)),
            f"if it is positive {word} {name} ({channel(name).description})",
        )
        for sign, word in ((1, "like"), (-1, "against"))
    )
    question = Question(what, declared.identity, proposals)
    return OpenQuestionsError(what, where, "bind it with the sign of the file", [question])


def _surface(declared: Declaration) -> tuple[str, int] | None:
    """A surface with a stated sign: trailing edge down or left is positive here."""
    match = _DEFLECTION.fullmatch(declared.name)
    sign = sign_factor(declared.sign, *_SURFACE_SIGNS) if declared.sign.strip() else 0
    if (
        match is None
        or not sign
        or unit_conversion(declared.unit, "rad") is None
        or not read_unit(declared.unit)
    ):
        return None
    name = "delta_" + re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", match[1]).lower()
    return (name, sign) if is_surface(name) else None


def channel_in_unit(quantity: Expression, unit: str, si: str, sign: int) -> Expression:
    """Return a channel, in the SI unit `si`, in the file's unit and sign."""
    scale, offset = unit_conversion(unit, si) or (1.0, 0.0)
    if offset:
        quantity = Operation("-", quantity, Number(offset))
    if scale != 1.0:
        quantity = Operation("*", quantity, Number(1.0 / scale))
    return Negation(quantity) if sign < 0 else quantity


def output_axis(declared: Declaration, where: str) -> tuple[str, int] | None:
    """Return the axis of an output and its sign; None if the output is not a coefficient.

    An output is identified by its standard name (AIAA S-119, `STANDARD_SIGNS`) or by the name of an
    axis, such as Ch_elevator of a hinge moment.

    Raises InputError for an unknown sign; with one, a name like that of a hinge moment is none.
    """
    known = _standard(_OUTPUTS, declared.name)
    if known is None:
        given = (declared.name, declared.identity)
        own = (name for name in given if name in (*AXES, *WIND_AXES) or is_hinge_axis(name))
        axis = next(own, None)
        known = (axis, *_signs(axis)) if axis else None
    if known is None:
        return None
    sign = sign_factor(declared.sign, known[1], known[2])
    if sign == 0 and is_hinge_axis(known[0]):
        return None
    if sign == 0:
        raise InputError(
            f"output {declared.name} with sign '{declared.sign}'",
            where,
            f"bind the axis: {known[0]}=EXPRESSION",
        )
    return known[0], sign


def _standard(rows: Mapping[str, tuple[str, str, str]], name: str) -> tuple[str, str, str] | None:
    """The row of a standard name, which people write in letters of either case."""
    lower = name.lower()
    return next((row for standard, row in rows.items() if standard.lower() == lower), None)


def output_sign(axis: str) -> str:
    """Return the sign that an output is written with; a hinge moment has that of its surface.

    >>> output_sign("Cm"), output_sign("Ch_elevator"), output_sign("Ch_rudder")
    ('anu', 'ted', 'tel')
    """
    if is_hinge_axis(axis):
        return "tel" if "rudder" in axis else "ted"
    return STANDARD_SIGNS[axis]


def _signs(axis: str) -> tuple[str, str]:
    if is_hinge_axis(axis):
        return _SURFACE_SIGNS
    return next((same, opposite) for known, same, opposite in _OUTPUTS.values() if known == axis)


def signed_name(name: str, factor: int) -> Expression:
    """Return the name, negated for a negative factor."""
    return Negation(Name(name)) if factor < 0 else Name(name)
