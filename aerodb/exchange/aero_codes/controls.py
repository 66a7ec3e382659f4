"""Control surfaces of aerodynamic codes: which channel one is, in which unit and with which sign.

The sign is read from what the surface does, which does not depend on where it is mounted: trailing
edge down lifts, trailing edge left pushes to the right, and a right aileron down rolls to the left.
"""

import re
from collections.abc import Mapping, Sequence
from typing import Final

from aerodb.errors import InputError
from aerodb.exchange.aero_codes.answers import Answers
from aerodb.nomenclature import CHANNELS
from aerodb.tables import Name, Variable, number, parse

#: Short name -> the surface that it means.
_KINDS: Final = {
    "ail": "aileron",
    "elev": "elevator",
    "ele": "elevator",
    "rud": "rudder",
    "flap": "flap",
}
#: Surface -> the axis that tells its sign, and that sign for a positive deflection here.
_TELLS: Final = {"aileron": ("Cl", -1.0), "rudder": ("CY", 1.0)}
_LIFTS: Final = ("C_lift", 1.0)
#: Share of the largest derivative of a surface below which one tells no sign: printed digits.
_TELLING: Final = 1e-3
DEGREE: Final = 57.29577951308232


def control_name(name: str) -> str:
    """Return the name of a control as an identifier of a database.

    >>> control_name("Elev-1"), control_name("q"), control_name("2nd")
    ('elev_1', 'q_control', 'control_2nd')
    """
    plain = re.sub(r"\W+", "_", name.strip(), flags=re.ASCII).strip("_").lower() or "control"
    plain = plain if plain[0].isalpha() else f"control_{plain}"
    try:
        free = isinstance(parse(plain), Name) and plain not in CHANNELS
    except InputError:  # the name of a function
        free = False
    return plain if free else f"{plain}_control"


def kind_of(name: str) -> str:
    """Return which of aileron, elevator, rudder and flap a name means; '' for another.

    >>> kind_of("Ail"), kind_of("elevator"), kind_of("elevon_L"), kind_of("rudder_1")
    ('aileron', 'elevator', '', '')
    """
    plain = name.strip().lower()
    for start, kind in _KINDS.items():
        if plain in (start, kind, f"{kind}s"):
            return kind
    return ""


def control_variable(
    answers: Answers,
    name: str,
    slopes: Sequence[Mapping[str, float]],
    scale: float,
    unit: str,
    code: str,
) -> Variable:
    """Return the variable of a control, in the file's unit, as an expression of its channel.

    name : in the file. slopes : per run, axis -> derivative by the control. scale : units of the
    file per SI unit of the channel. Without an answer, a known name whose sign the derivatives tell
    in all runs is taken; anything else becomes a question.
    """
    own = control_name(name)
    described = f"{code} control {name.strip()} [{unit}]"
    if answers.is_given(own):
        return Variable(answers.expression(own), unit, described)
    kind = kind_of(name)
    axis, sense = _TELLS.get(kind, _LIFTS)
    signs = {_sign(each, axis) for each in slopes}
    sign = sense * signs.pop() if len(signs) == 1 else 0.0
    surfaces = answers.vehicle.surfaces
    near = [each for each in surfaces if each in own or own in each or (kind and kind in each)]
    if kind and sign and (kind in surfaces or not near):
        text = _scaled(f"delta_{kind}", sign * scale)
        answers.notes.append(
            f"{name.strip()} [{unit}] is delta_{kind}, positive"
            f" {'alike' if sign > 0 else 'the other way'}: {axis} says so"
        )
        return Variable(parse(text), unit, described)
    channels = [f"delta_{each}" for each in near or [own]]
    both = [(factor, case) for factor, case in _CASES if not sign or factor == sign]
    answers.ask(
        own,
        f"control {name.strip()} [{unit}]: which deflection is it, and with which sign?",
        [
            (_scaled(channel, factor * scale), case)
            for channel in channels[:6]
            for factor, case in both
        ],
    )
    return Variable(number(0.0), unit, described)


_CASES: Final = (
    (1.0, "if positive alike: trailing edge down, or left"),
    (-1.0, "if positive the other way"),
)


def _scaled(channel: str, factor: float) -> str:
    """
    >>> _scaled("delta_flap", -1.0), _scaled("delta_flap", 2.0)
    ('-delta_flap', '2.0*delta_flap')
    """
    if abs(factor) == 1.0:
        return channel if factor > 0 else f"-{channel}"
    return f"{factor!r}*{channel}"


def _sign(slopes: Mapping[str, float], axis: str) -> float:
    """Sign of a derivative that is not small beside the others of its surface; else 0."""
    value, largest = slopes.get(axis, 0.0), max(map(abs, slopes.values()), default=0.0)
    return 0.0 if abs(value) <= _TELLING * largest else (1.0 if value > 0 else -1.0)
