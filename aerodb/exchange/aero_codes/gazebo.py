"""Gazebo AdvancedLiftDrag: parameters of the plugin in an SDF file, read and written.

The plugin is that of PX4's Gazebo Classic and of gz-sim. Its traps:

- Derivatives by controls (``CL_ctrl``) are **per degree**, all others per rad and per rate without
  dimension; a control's ``direction`` (1 or -1) multiplies its joint angle.
- Forces are along stability axes and the body's y axis, moments about **body** axes, at ``ref_pt``
  in the link (x forward, y left, z up).
- The dynamic pressure is that of the flow in the plane of symmetry: coefficients fall with
  ``cos(beta)^2``, those by rates with ``cos(beta)``. ``beta`` is ``atan2(v, u)``.
- The span is ``sqrt(area AR)``, and the chord that of ``mac`` or ``area/span``.
- ``CDp``, ``CDq``, ``CDr`` are of the drag by rates. Some releases overwrite ``Cem0`` and ``Cema``
  by ``Cemb beta``; what the parameters mean is read here.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

from lxml import etree

from aerodb.errors import InputError
from aerodb.exchange.aero_codes.answers import Answers
from aerodb.exchange.aero_codes.controls import DEGREE, control_name, control_variable
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
from aerodb.exchange.xml_elements import children, parsed, tag
from aerodb.tables import AeroDatabase, ReferenceGeometry, Term, Variable, parse

#: Axis -> how its parameters begin.
_STARTS: Final = {
    "C_lift": "CL",
    "C_drag": "CD",
    "CY": "CY",
    "Cl": "Cell",
    "Cm": "Cem",
    "Cn": "Cen",
}
_RATES: Final = {"p": "p_hat", "q": "q_hat", "r": "r_hat"}
_NEEDED: Final = ("CL0", "CLa", "CD0", "alpha_stall", "AR", "eff", "area")
_LINEAR: Final = {
    "Cem0": "",
    **{f"{start}{end}": "" for start in ("CY", "Cell", "Cem", "Cen") for end in "ab"},
    "CLb": "",
    "Cema_stall": "",
    **{f"{start}{end}": "" for start in _STARTS.values() for end in _RATES},
}
_NUMBERS: Final = ("CL0", "CLa", "CD0", "alpha_stall", "AR", "eff", *_LINEAR)
_ENDS: Final = {axis: f"{start}_ctrl" for axis, start in _STARTS.items()}
#: Of the plugin: sharpness of its stall, and drag of a flat plate over the aspect ratio.
_SHARP: Final = 15.0
_PLATE: Final = (-0.224, -0.115)


def is_gazebo(text: str) -> bool:
    """Return whether a text holds the parameters of the plugin."""
    return text.lstrip().startswith("<") and "<CLa>" in text and "<Cema>" in text


def import_gazebo(files: Sequence[tuple[str, bytes]], name: str, answers: Answers) -> AeroDatabase:
    """Return the database of the plugin in an SDF file, or of the plugin alone. Raises InputError
    for what is no such file, and OpenQuestionsError for what it leaves open."""
    if len(files) > 1:
        raise InputError("a second file", files[1][0], "a model is one file")
    where, data = files[0]
    plugin = _plugin(where, data)
    answers.state(stated_answers(data.decode("utf-8", "replace")))
    found = {
        tag(each): _value(where, each)
        for each in children(plugin)
        if tag(each) in (*_NEEDED, *_NUMBERS, "mac")
    }
    missing = "and the plugin takes its own: which one is it?"
    stated = {
        key: answers.number(key, "1", f"<{key}> is not in the file, {missing}", (), found.get(key))
        for key in _NEEDED
    }
    numbers = {**dict.fromkeys(_NUMBERS, 0.0), **found, **stated}
    for key in ("AR", "area", "eff"):
        if not numbers[key] > 0.0:
            raise InputError(f"<{key}> is {numbers[key]:g}", where, "it must be positive")
    zero = sorted(key for key in _LINEAR if key not in found)
    if zero:
        answers.notes.append(f"zero, as the plugin has what is left out: {', '.join(zero)}")
    area = numbers.pop("area")
    span = math.sqrt(area * numbers["AR"])
    chord = numbers.pop("mac", 0.0) or area / span
    x, y, z = _point(where, plugin)
    reference = answers.reference(area, chord, span, (x + 0.0, -y + 0.0, -z + 0.0))
    controls: dict[str, Variable] = {}
    for element in (each for each in children(plugin) if tag(each) == "control_surface"):
        own, values = _surface(where, element, controls)
        slopes = {axis: values["direction"] * values[end] for axis, end in _ENDS.items()}
        numbers |= {f"{own}_{key}": value for key, value in values.items()}
        joint = (element.findtext("name") or "").strip()
        variable = control_variable(answers, joint, [slopes], DEGREE, "deg", "")
        described = f"control {joint}, angle of the joint"
        controls[own] = Variable(variable.expression, "deg", described, {CONTROL: joint})
    answers.notes.append("controls are per degree of the joint; moments are about body axes")
    answers.close()
    made = build_gazebo(Model(numbers, reference, controls), name)
    return replace(made, description="\n".join(answers.notes))


def _plugin(where: str, data: bytes) -> Any:
    root = parsed(data, where, MAX_BYTES)
    for element in root.iter():
        if isinstance(element.tag, str) and any(tag(each) == "CLa" for each in children(element)):
            return element
    raise InputError("no plugin with <CLa>", where, "give the SDF model with AdvancedLiftDrag")


def _value(where: str, element: Any) -> float:
    text = (element.text or "").strip()
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise InputError(
            f"<{tag(element)}> is '{text[:40]}', which is no number",
            f"{where}, line {element.sourceline}",
            "write a number",
        )
    return value


def _point(where: str, plugin: Any) -> tuple[float, float, float]:
    element = plugin.find("ref_pt")
    cells = [] if element is None else (element.text or "").split()
    try:
        x, y, z = map(float, cells or (0.0, 0.0, 0.0))
    except ValueError:
        raise InputError("<ref_pt> is not three numbers", where, "write x y z in metres") from None
    return x, y, z


def _surface(
    where: str, element: Any, taken: Mapping[str, Variable]
) -> tuple[str, dict[str, float]]:
    """Identifier and numbers of a control surface."""
    place = f"{where}, line {element.sourceline}"
    own = control_name(element.findtext("name") or "")
    if own in taken:
        raise InputError(f"two control surfaces '{own}'", place, "give each joint once")
    values = {tag(each): _value(where, each) for each in children(element) if tag(each) in _KEYS}
    lacking = [key for key in _KEYS if key not in values]
    if lacking:
        raise InputError(f"<control_surface> without <{lacking[0]}>", place, "the plugin needs it")
    return own, values


_KEYS: Final = ("direction", *_ENDS.values())


def build_gazebo(model: Model, name: str) -> AeroDatabase:
    """Return the database of the model's numbers: the plugin's formulas (module docstring)."""
    k = model.numbers
    aspect = k["AR"]
    plate = 2.0 / (1.0 + math.exp(_PLATE[0] + _PLATE[1] * max(aspect, 1.0 / aspect)))
    up, down = f"exp(-{_SHARP!r}*(alpha - alpha_stall))", f"exp({_SHARP!r}*(alpha + alpha_stall))"
    moved = {
        axis: "".join(
            f" + {own}_direction*{own}_{end}*{own}" for own in model.controls if k[f"{own}_{end}"]
        )
        for axis, end in _ENDS.items()
    }
    rates = {
        axis: " + ".join(f"{start}{end}*{hat}" for end, hat in _RATES.items() if k[f"{start}{end}"])
        for axis, start in _STARTS.items()
    }
    bend = "clip(alpha, -alpha_stall, alpha_stall)"
    static = {
        "C_lift": "static_lift",
        "C_drag": f"(1 - stalled)*(CD0 + static_lift^2/({math.pi!r}*AR*eff))"
        f" + stalled*{plate!r}*(0.5 - 0.5*cos(2*alpha)){moved['C_drag']}",
        "CY": f"CYa*alpha + CYb*sideslip{moved['CY']}",
        "Cl": f"Cella*alpha + Cellb*sideslip{moved['Cl']}",
        "Cm": f"Cem0 + Cema*{bend} + Cema_stall*(alpha - {bend}) + Cemb*sideslip{moved['Cm']}",
        "Cn": f"Cena*alpha + Cenb*sideslip{moved['Cn']}",
    }
    lift = (
        "(1 - stalled)*(CL0 + CLa*alpha)"
        " + stalled*2*sign(alpha)*sin(alpha)^2*cos(alpha)"
        f" + CLb*sideslip{moved['C_lift']}"
    )
    variables = {
        **model.variables,
        "sideslip": Variable(parse("atan2(sin(beta), cos(alpha)*cos(beta))"), "rad"),
        "stalled": Variable(parse(f"(1 + {up} + {down})/((1 + {up})*(1 + {down}))"), "1"),
        "static_lift": Variable(parse(lift), "1"),
    }
    terms = []
    for axis, text in static.items():
        own = f"in_plane_{axis}"
        with_rates = f"cos(beta)^2*({text})"
        if rates[axis]:
            with_rates += f" + cos(beta)*({rates[axis]})"
        variables[own] = Variable(parse(with_rates), "1")
        if axis == "C_drag":
            terms += [
                Term("drag_x", "CX", parse(f"-({own}*cos(alpha))")),
                Term("drag_z", "CZ", parse(f"-({own}*sin(alpha))")),
            ]
        else:
            terms.append(Term(f"{axis}_term", axis, parse(own)))
    source = "Gazebo AdvancedLiftDrag"
    return AeroDatabase(name, model.reference, variables, {}, tuple(terms), source=source)


def project_gazebo(database: AeroDatabase) -> AeroDatabase:
    """Return the plugin's model nearest to a database; itself, if it is one and has no increments.
    A deflection of the database becomes a control surface of its name."""
    plain = model_in(database, _NUMBERS, build_gazebo)
    if plain is not None and not database.increments:
        return build_gazebo(plain, database.name)
    slopes, reference = slopes_of(database), database.reference
    aspect = reference.span**2 / reference.area
    if plain is None:
        names = [n.removeprefix("delta_") for n in database.inputs if n.startswith("delta_")]
        controls = {
            own: Variable(
                parse(f"{DEGREE!r}*delta_{own}"),
                "deg",
                f"control {own}, angle of the joint",
                {CONTROL: own},
            )
            for own in names
        }
        base = {**dict.fromkeys(_NUMBERS, 0.0), "alpha_stall": slopes.stall, "AR": aspect}
        for own in controls:
            base |= {f"{own}_{end}": 0.0 for end in _ENDS.values()}
            base[f"{own}_direction"] = 1.0
        factor = 0.0
    else:
        controls, base = dict(plain.controls), dict(plain.numbers)
        slopes = by_difference(slopes, slopes_of(replace(database, increments=())))
        factor = induced(plain, "eff", aspect)
    numbers = _added(base, slopes, controls)
    numbers["eff"] = efficiency(factor + slopes.polar[3], aspect)
    if plain is None:
        numbers["Cema_stall"] = numbers["Cema"]
    return build_gazebo(Model(numbers, _spanned(reference), controls), database.name)


def _spanned(reference: ReferenceGeometry) -> ReferenceGeometry:
    """The reference with the span that the plugin computes of its area and aspect ratio."""
    aspect = reference.span**2 / reference.area
    return replace(reference, span=math.sqrt(reference.area * aspect))


def _added(
    base: Mapping[str, float], slopes: Slopes, controls: Mapping[str, Variable]
) -> dict[str, float]:
    """The numbers with slopes added."""
    numbers = dict(base)
    for n, value in zip(("CL0", "CLa", "CD0"), slopes.polar, strict=False):
        numbers[n] += value
    numbers["Cem0"] += slopes.pitch[0]
    numbers["Cema"] += slopes.pitch[1]
    for axis, start in _STARTS.items():
        for end, hat in _RATES.items():
            numbers[f"{start}{end}"] += slopes.by[axis, hat]
        if axis != "C_drag":
            numbers[f"{start}b"] += slopes.by[axis, "beta"]
        for own, control in controls.items():
            channel, scale = per_unit(control)
            slope = slopes.by.get((axis, channel), 0.0) * scale
            numbers[f"{own}_{_ENDS[axis]}"] += slope * numbers[f"{own}_direction"]
    return numbers


def export_gazebo(database: AeroDatabase) -> bytes:
    """Return the SDF plugin of a database that is its model (`project_gazebo`). Comments say what
    its controls are, and `import_gazebo` reads them. Raises InputError for another database."""
    model = model_in(database, _NUMBERS, build_gazebo)
    if model is None:
        raise InputError("no model of AdvancedLiftDrag", f"database {database.name}")
    plugin = etree.Element(
        "plugin",
        filename="gz-sim-advanced-lift-drag-system",
        name="gz::sim::systems::AdvancedLiftDrag",
    )
    for line in bind_lines(model):
        plugin.append(etree.Comment(f" {line} "))
    reference = model.reference
    x, y, z = reference.moment_reference
    _add(plugin, "num_ctrl_surfaces", str(len(model.controls)))
    for key in _NUMBERS:
        _add(plugin, key, repr(model.numbers[key]))
    _add(plugin, "area", repr(reference.area))
    _add(plugin, "mac", repr(reference.chord))
    _add(plugin, "ref_pt", " ".join(repr(c + 0.0) for c in (x, -y, -z)))
    _add(plugin, "forward", "1 0 0")
    _add(plugin, "upward", "0 0 1")
    _add(plugin, "link_name", "base_link")
    for index, own in enumerate(model.controls):
        surface = etree.SubElement(plugin, "control_surface")
        _add(surface, "name", own)
        _add(surface, "index", str(index))
        for key in _KEYS:
            _add(surface, key, repr(model.numbers[f"{own}_{key}"]))
    etree.indent(plugin)
    return bytes(etree.tostring(plugin, pretty_print=True))


def _add(parent: Any, key: str, text: str) -> None:
    etree.SubElement(parent, key).text = text
