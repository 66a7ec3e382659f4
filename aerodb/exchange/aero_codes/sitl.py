"""ArduPilot SITL: coefficients of its plane model, ``plane.json``, read and written.

The model is that of ``SIM_Plane.cpp``. Lift is linear and blends into a flat plate at
``alpha_stall``; drag is a parabola of the linear lift; the rest is linear. Its traps:

- Controls are **shares of full travel** from -1 to 1, not angles. Positive aileron rolls right,
  elevator pitches up, rudder yaws right: each **against** the deflections here.
- ``beta`` is ``atan2(v, u)``, not ``asin(v/V)``.
- Forces act at ``CGOffset`` from the CG [m, body axes]: moments are about that point.
- What a file leaves out keeps the value that SITL has built in, which the file does not tell.
- Lines may end in a comment after ``#``, which JSON does not allow.
"""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

from aerodb.errors import InputError
from aerodb.exchange.aero_codes.answers import Answers
from aerodb.exchange.aero_codes.lines import MAX_BYTES
from aerodb.exchange.aero_codes.parametric import (
    CONTROL,
    Model,
    Slopes,
    bind_lines,
    by_difference,
    efficiency,
    induced,
    model_in,
    per_unit,
    slopes_of,
    stated_answers,
)
from aerodb.tables import AeroDatabase, Term, Variable, number, parse

_LENGTHS: Final = ("s", "b", "c")
_LIFT: Final = ("c_lift_0", "c_lift_a", "c_lift_q", "c_lift_deltae", "mcoeff", "alpha_stall")
_DRAG: Final = ("c_drag_p", "oswald", "c_drag_q", "c_drag_deltae")
#: Axis -> beginning of its numbers, and what they multiply.
_LINEAR: Final[dict[str, tuple[str, tuple[str, ...]]]] = {
    "CY": ("c_y", ("0", "b", "p", "r", "deltaa", "deltar")),
    "Cl": ("c_l", ("0", "b", "p", "r", "deltaa", "deltar")),
    "Cm": ("c_m", ("0", "a", "q", "deltae")),
    "Cn": ("c_n", ("0", "b", "p", "r", "deltaa", "deltar")),
}
_FACTORS: Final = {
    "0": "1",
    "a": "alpha",
    "b": "sideslip",
    "p": "p_hat",
    "q": "q_hat",
    "r": "r_hat",
    "deltaa": "aileron",
    "deltae": "elevator",
    "deltar": "rudder",
}
_NUMBERS: Final = (
    *_LIFT,
    *_DRAG,
    *(f"{start}_{end}" for start, ends in _LINEAR.values() for end in ends),
)
#: Numbers of which zero is none: they are asked one by one.
_SHAPE: Final = ("c_lift_0", "c_lift_a", "mcoeff", "alpha_stall", "c_drag_p", "oswald")
_OFFSET: Final = ("CGOffset_x", "CGOffset_y", "CGOffset_z")
_CONTROLS: Final = {"aileron": "deltaa", "elevator": "deltae", "rudder": "deltar"}
#: Control -> the file's number of its full travel [rad], by which SITL itself does not multiply.
_TRAVELS: Final = {key: f"{short}_max" for key, short in _CONTROLS.items()}
#: Beyond this from the stall SITL holds the angle of attack [rad].
_HELD: Final = 0.8
#: Sharpness of the stall that is written where the database is no such model: SITL's own.
_SHARP: Final = 50.0
#: No coefficient or length is as large: guards against numbers that no float can hold.
_LARGEST: Final = 1e12


def is_sitl(text: str) -> bool:
    """Return whether a text holds coefficients of SITL's plane model."""
    return text.lstrip().startswith(("{", "#")) and '"c_lift_a"' in text


def import_sitl(files: Sequence[tuple[str, bytes]], name: str, answers: Answers) -> AeroDatabase:
    """Return the database of a ``plane.json``. Raises InputError for what is no such file, and
    OpenQuestionsError for what it leaves open."""
    if len(files) > 1:
        raise InputError("a second file", files[1][0], "a plane model is one file")
    where, data = files[0]
    found = _entries(where, data)
    answers.state(stated_answers(data.decode("utf-8", "replace")))
    s, b, c = (
        _stated(answers, found, key, unit)
        for key, unit in zip(_LENGTHS, ("m^2", "m", "m"), strict=True)
    )
    numbers = {
        key: _stated(answers, found, key, "1") for key in _NUMBERS if key in (*_SHAPE, *found)
    }
    numbers |= {key: _stated(answers, found, key, "m") for key in _OFFSET if key in found}
    wanted = [key for key in (*_NUMBERS, *_OFFSET) if key not in numbers]
    numbers |= answers.left_out(wanted, "SITL")
    offset = [numbers[key] for key in _OFFSET]
    reference = answers.reference(s, c, b, offset=offset)
    controls = {key: _control(answers, key, found.get(_TRAVELS[key], 0.0)) for key in _CONTROLS}
    answers.notes += [
        "controls are shares of full travel; SITL's sideslip is atan2(v, u)",
        f"moments are about the CG and CGOffset ({', '.join(f'{x:g}' for x in offset)}) m",
    ]
    answers.close()
    for key in ("oswald", "mcoeff"):
        if numbers[key] == 0.0:
            raise InputError(f"{key} is 0", where, "it divides, or makes no stall")
    made = build_sitl(Model(numbers, reference, controls), name)
    return replace(made, description="\n".join(answers.notes))


def _entries(where: str, data: bytes) -> dict[str, float]:
    """The numbers of the file, by name."""
    if len(data) > MAX_BYTES:
        raise InputError(f"{len(data)} bytes", where, f"at most {MAX_BYTES}")
    plain = "\n".join(line.split("#", 1)[0] for line in data.decode("utf-8", "replace").split("\n"))
    try:
        content: Any = json.loads(plain, parse_constant=lambda text: text)
    except (ValueError, RecursionError) as error:
        line = getattr(error, "lineno", 1)
        raise InputError(
            f"not JSON: {error}", f"{where}, line {line}", "as SITL's example of a plane.json"
        ) from None
    if not isinstance(content, dict):
        raise InputError("not an object of coefficients", where, "as SITL's example")
    found: dict[str, float] = {}
    for key, value in content.items():
        is_point = key == "CGOffset" and isinstance(value, list) and len(value) == 3
        values = dict(zip(_OFFSET, value, strict=True)) if is_point else {key: value}
        for own, each in values.items():
            if own not in (*_LENGTHS, *_NUMBERS, *_OFFSET, *_TRAVELS.values()):
                continue
            number_ = isinstance(each, (int, float)) and not isinstance(each, bool)
            if not number_ or not abs(each) < _LARGEST:
                raise InputError(f"{own} is {str(each)[:40]}, which is no number", where)
            found[own] = float(each)
    return found


def _stated(answers: Answers, found: Mapping[str, float], key: str, unit: str) -> float:
    text = f"{key} is not in the file, and SITL takes its own: which one is it?"
    return answers.number(key, unit, text, (), found.get(key))


def _control(answers: Answers, key: str, travel: float) -> Variable:
    """The variable of a control. travel : that the file states [rad]; 0 where it states none."""
    described, declared = f"control {key} of SITL, share of full travel", {CONTROL: key}
    if answers.is_given(key):
        return Variable(answers.expression(key), "1", described, declared)
    of_vehicle = {n: x for n, x in answers.vehicle.surfaces.items() if key in n}
    proposals = [(key, f"{travel:.6g}", f"{_TRAVELS[key]} of the file")] if travel > 0.0 else []
    proposals += [(n, f"{x:.6g}", "full travel in rad") for n, x in of_vehicle.items()]
    answers.ask(
        key,
        f"{key} is a share of full travel, against delta_{key}: of which travel [rad]?",
        [
            (f"-delta_{each}/{size}", words)
            for each, size, words in proposals or [(key, "NUMBER", "full travel in rad")]
        ],
    )
    return Variable(number(0.0), "1", described, declared)


def build_sitl(model: Model, name: str) -> AeroDatabase:
    """Return the database of the model's numbers: SITL's formulas (module docstring)."""
    k = model.numbers
    aspect = model.reference.span**2 / model.reference.area
    held = f"clip(alpha, alpha_stall - {_HELD!r}, alpha_stall + {_HELD!r})"
    up, down = "exp(-mcoeff*(lift_alpha - alpha_stall))", "exp(mcoeff*(lift_alpha + alpha_stall))"
    variables = {
        **model.variables,
        "sideslip": Variable(parse("atan2(sin(beta), cos(alpha)*cos(beta))"), "rad"),
        "lift_alpha": Variable(parse(held), "rad"),
        "stalled": Variable(parse(f"(1 + {up} + {down})/((1 + {up})*(1 + {down}))"), "1"),
        "drag": Variable(
            parse(
                f"c_drag_p + (c_lift_0 + c_lift_a*alpha)^2/({math.pi * aspect!r}*oswald)"
                " + c_drag_q*q_hat + c_drag_deltae*abs(elevator)"
            ),
            "1",
        ),
    }
    plate = "2*sign(lift_alpha)*sin(lift_alpha)^2*cos(lift_alpha)"
    texts = {
        ("lift", "C_lift"): f"(1 - stalled)*(c_lift_0 + c_lift_a*lift_alpha) + stalled*{plate}",
        ("lift_q", "C_lift"): "c_lift_q*q_hat" if k["c_lift_q"] else "",
        ("lift_elevator", "C_lift"): "c_lift_deltae*elevator" if k["c_lift_deltae"] else "",
        ("drag_x", "CX"): "-(drag*cos(alpha))",
        ("drag_z", "CZ"): "-(drag*sin(alpha))",
    }
    for axis, (start, ends) in _LINEAR.items():
        for end in ends:
            own = f"{start}_{end}"
            factor = "" if end == "0" else f"*{_FACTORS[end]}"
            texts[f"{own}_term", axis] = f"{own}{factor}" if k[own] else ""
    terms = tuple(Term(n, axis, parse(text)) for (n, axis), text in texts.items() if text)
    source = "ArduPilot SITL, plane model"
    return AeroDatabase(name, model.reference, variables, {}, terms, source=source)


def project_sitl(database: AeroDatabase, travels: Mapping[str, float]) -> AeroDatabase:
    """Return the plane model nearest to a database; itself, if it is one and has no increments.

    travels : full travel of a surface [rad], by its name. Raises InputError where a surface of the
    database has none, and for rotors that lift.
    """
    _refuse_lifting(database)
    plain = model_in(database, (*_NUMBERS, *_OFFSET), build_sitl)
    if plain is not None and not database.increments:
        return build_sitl(plain, database.name)
    slopes = slopes_of(database)
    reference = database.reference
    aspect = reference.span**2 / reference.area
    if plain is None:
        controls = {key: _travel(database, key, travels) for key in _CONTROLS}
        base = dict.fromkeys((*_NUMBERS, *_OFFSET), 0.0)
        base |= {"mcoeff": _SHARP, "alpha_stall": slopes.stall}
        factor = 0.0
    else:
        controls, base = dict(plain.controls), dict(plain.numbers)
        without = replace(database, increments=())
        slopes, factor = by_difference(slopes, slopes_of(without)), induced(plain, "oswald", aspect)
    numbers = _added(base, slopes, controls)
    numbers["oswald"] = efficiency(factor + slopes.polar[3], aspect)
    return build_sitl(Model(numbers, reference, controls), database.name)


def _refuse_lifting(database: AeroDatabase) -> None:
    """Raise InputError for rotors that tilt or whose axis is nearer to upwards than to level.

    SITL's own frame file for them (`SIM_Frame.h`) wants voltage and current of a reference flight,
    which no database has, and knows no advance ratio.
    """
    from aerodb.parts import rotors_of

    for name, rotor in rotors_of(database.parts).items():
        if rotor.tilt is not None or -rotor.axis[2] > math.hypot(*rotor.axis[:2]):
            raise InputError(
                "a rotor that lifts, which the plane model of ArduPilot's SITL cannot hold",
                f"part {name}",
                "its frame file wants a battery's voltage and current in a reference flight, and"
                " has no advance ratio. Choose --format jsbsim or gazebo: SITL flies with both",
            )


def _travel(database: AeroDatabase, key: str, travels: Mapping[str, float]) -> Variable:
    described, declared = f"control {key} of SITL, share of full travel", {CONTROL: key}
    if f"delta_{key}" not in database.inputs:
        return Variable(parse(f"-delta_{key}"), "1", described, declared)
    if key not in travels:
        raise InputError(
            f"the full travel of {key} is not known",
            f"database {database.name}",
            f"give [surfaces.{key}] limits in the vehicle file",
        )
    return Variable(parse(f"-delta_{key}/{travels[key]!r}"), "1", described, declared)


def _added(
    base: Mapping[str, float], slopes: Slopes, controls: Mapping[str, Variable]
) -> dict[str, float]:
    """The numbers with slopes added."""
    numbers = dict(base)
    by = {
        **{end: factor for end, factor in _FACTORS.items() if end in ("p", "q", "r")},
        "b": "beta",
        "0": "1",
    }
    units = {end: per_unit(controls[key]) for key, end in _CONTROLS.items()}

    def slope(axis: str, end: str) -> float:
        if end in units:
            channel, scale = units[end]
            return slopes.by.get((axis, channel), 0.0) * scale
        return slopes.by.get((axis, by[end]), 0.0)

    for n, value in zip(("c_lift_0", "c_lift_a", "c_drag_p"), slopes.polar, strict=False):
        numbers[n] += value
    for n, axis, end in (
        ("c_lift_q", "C_lift", "q"),
        ("c_lift_deltae", "C_lift", "deltae"),
        ("c_drag_q", "C_drag", "q"),
    ):
        numbers[n] += slope(axis, end)
    numbers["c_m_0"] += slopes.pitch[0]
    numbers["c_m_a"] += slopes.pitch[1]
    for axis, (start, ends) in _LINEAR.items():
        for end in ends:
            if axis != "Cm" or end in ("q", "deltae"):
                numbers[f"{start}_{end}"] += slope(axis, end)
    return numbers


def export_sitl(database: AeroDatabase) -> bytes:
    """Return the ``plane.json`` of a database that is a plane model (`project_sitl`). Comments say
    what its inputs are, and `import_sitl` reads them. Raises InputError for another database."""
    model = model_in(database, (*_NUMBERS, *_OFFSET), build_sitl)
    if model is None:
        raise InputError("no plane model of SITL", f"database {database.name}")
    reference = model.reference
    entries: dict[str, Any] = {"s": reference.area, "b": reference.span, "c": reference.chord}
    entries |= {n: model.numbers[n] for n in _NUMBERS}
    entries["CGOffset"] = [model.numbers[n] for n in _OFFSET]
    comments = "".join(f"# {line}\n" for line in bind_lines(model))
    return f"{comments}{json.dumps(entries, indent=4)}\n".encode()
