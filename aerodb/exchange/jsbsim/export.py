"""Write an AeroDatabase as a minimal JSBSim aircraft whose aerodynamics give the same coefficients.

Units, axes and the moment reference are converted explicitly (feet, slugs, inches, structural axes)
and stated in the file. A database has no mass, ground reactions or propulsion; the mass is given
beside it.
"""

import re
from collections.abc import Iterable, Sequence
from typing import Final

from lxml import etree

from aerodb.exchange.increment_terms import with_increments_as_terms
from aerodb.exchange.jsbsim.axes import FACTORS, body_forces
from aerodb.exchange.jsbsim.elements import Element, function, node, prop, total, value
from aerodb.exchange.jsbsim.mass_balance import MassBalance, location, mass_balance
from aerodb.exchange.jsbsim.properties import (
    CHANNEL_PROPERTIES,
    FOOT,
    LIFT_SQUARED,
    OWN_CHANNEL,
    OWN_FREE,
    POUND_FORCE,
    PROPERTIES,
    STALL_HYSTERESIS,
    described_property,
    hysteresis_limits,
)
from aerodb.exchange.jsbsim.states import Memory, memory_channel, with_memories
from aerodb.exchange.jsbsim.writing import FunctionWriter, channel_property
from aerodb.nomenclature import CHANNELS, axis_description, channel, is_hinge_axis
from aerodb.tables import (
    LOAD_AXES,
    WIND_AXES,
    AeroDatabase,
    CheckCase,
    Name,
    ReferenceGeometry,
    Term,
    coefficient_axis,
    parse,
)

_WIND: Final = {"C_drag": "DRAG", "C_side": "SIDE", "C_lift": "LIFT"}
_BODY: Final = {"CX": "X", "CY": "Y", "CZ": "Z"}
_MOMENTS: Final = {"Cl": "ROLL", "Cm": "PITCH", "Cn": "YAW"}
#: Controls that every JSBSim aircraft has, in addition to the properties in `properties`.
_NATIVE_CONTROL: Final = re.compile(
    r"fcs/(elevator|(left|right)-aileron|rudder|flap|speedbrake|spoiler)-(pos|cmd)-\w+"
)

#: Name of the system that declares the inputs which nothing else creates.
INPUTS: Final = "aerodynamic inputs"
_STATE: Final = {
    *(path for path, _ in CHANNEL_PROPERTIES.values()),
    STALL_HYSTERESIS,
    LIFT_SQUARED,
    "aero/Re",
    "aero/h_b-mac-ft",
}

_STATEMENT: Final = (
    "Converted from a database in SI and body axes (x forward, y right, z down). Every function on"
    " an axis is a coefficient times aero/qbar-psf and metrics/Sw-sqft, in pounds. Moments are also"
    " times metrics/bw-ft (ROLL, YAW) or metrics/cbarw-ft (PITCH), in foot-pounds. DRAG is"
    " positive aft, LIFT up, SIDE right; X forward, Y right, Z down; ROLL right wing down, PITCH"
    " nose up, YAW nose right. Moments are about AERORP, which is the database's moment reference"
    " in structural axes from its datum (inches, x aft, y right, z up). Surfaces: trailing edge"
    " down positive, rudder left; the aileron is (right - left)/2, so JSBSim's left aileron enters"
    " with a minus sign. Rates are those relative to the air; angles are in radians. Where a"
    " coefficient is divided by speed or dynamic pressure these are at least 1e-6 ft/s and 1e-9"
    " psf."
)
_LOADS: Final = (
    "A function whose description says [N] or [N m] is a load: it does not scale with dynamic"
    " pressure. It is the database's value in pounds or foot-pounds."
)
_CASES: Final = (
    "What the database gives at these inputs (SI, radians, names of the database; above: which"
    " property is which), moments about AERORP. JSBSim passes over them; it agrees within 1e-9 of"
    " the larger of the coefficient and 0.001."
)


def export_jsbsim(
    database: AeroDatabase,
    *,
    name: str,
    cases: Sequence[CheckCase] = (),
    mass: MassBalance | None = None,
) -> bytes:
    """Return the JSBSim aircraft file of `database`, UTF-8.

    name : of the aircraft. cases : check cases that are written to the file; JSBSim ignores them.
    mass : of the vehicle, from the database's datum; None writes placeholders.

    Terms, variables and tables become functions. Increments become functions with their envelope
    rule, without their covariance. Force terms remain in wind axes if all of them are; otherwise
    all forces are written in body axes. A channel or free input without a JSBSim property becomes a
    property below ``aerodb/`` that the user sets; it is 0 at first and is listed in the file. A
    relay becomes the one that JSBSim runs itself. A system of the file runs states with memory,
    from their steady values on (`memory_channel`).

    Raises InputError for an expression that has no equivalent in JSBSim.
    """
    whole, paths, memories = with_memories(database)
    plain = with_increments_as_terms(whole)
    writer = FunctionWriter(plain, free_properties(plain) | paths)
    axes = _axes(plain, writer)
    for memory in memories:
        writer.write(Name(memory.quick))
    root = node(
        "fdm_config",
        _header(database),
        _metrics(plain.reference),
        mass_balance(mass, plain.reference.moment_reference),
        node("ground_reactions"),
        _declarations(writer, memories),
        node(
            "aerodynamics",
            *_statements(database, writer),
            *_hysteresis(plain),
            *writer.definitions,
            *axes,
        ),
        *([_check_cases(cases)] if cases else []),
        name=(name),
        version="2.0",
        release="BETA",
    )
    etree.indent(root)
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)


def free_properties(database: AeroDatabase) -> dict[str, str]:
    """Return the JSBSim property of each free input: that of its source, or one of its own.

    One with the name of a channel is that channel.
    """
    properties = {}
    for name, description in database.free_inputs.items():
        if name in CHANNELS:
            continue
        found = described_property(description)
        limits_missing = found == STALL_HYSTERESIS and hysteresis_limits(description) is None
        properties[name] = found if found and not limits_missing else f"{OWN_FREE}{name}"
    return properties


def input_properties(database: AeroDatabase) -> dict[str, tuple[str, float]]:
    """Return the JSBSim property of each input of `predict`, and the scale to the input's unit."""
    free = free_properties(database)
    return {
        name: (free[name], 1.0) if name in free else channel_property(name)
        for name in database.inputs
    }


def _header(database: AeroDatabase) -> Element:
    text = "; ".join(
        part for part in (database.name, database.description, database.source) if part
    )
    return node("fileheader", node("description", text=(text)))


def _metrics(reference: ReferenceGeometry) -> Element:
    sizes = {
        "wingarea": ("FT2", reference.area / FOOT**2),
        "wingspan": ("FT", reference.span / FOOT),
        "chord": ("FT", reference.chord / FOOT),
    }
    elements = [node(tag, text=repr(size), unit=unit) for tag, (unit, size) in sizes.items()]
    return node("metrics", *elements, location(reference.moment_reference, "AERORP"))


def _declarations(writer: FunctionWriter, memories: Sequence[Memory]) -> Element:
    """Declare the properties that nothing else creates, and run states with memory.

    They are in a system, because a property in the aerodynamics is a constant.
    """
    paths = sorted({path for path, _ in writer.inputs.values() if not _is_built_in(path)})
    return node(
        "system",
        *[node("property", text=path, value="0.0") for path in paths],
        *([memory_channel(memories)] if memories else []),
        name=INPUTS,
    )


def _is_built_in(path: str) -> bool:
    return path in PROPERTIES or path in _STATE or _NATIVE_CONTROL.fullmatch(path) is not None


def _statements(database: AeroDatabase, writer: FunctionWriter) -> Iterable[Element]:
    yield node("documentation", text=_STATEMENT)
    if database.has_loads:
        yield node("documentation", text=_LOADS)
    for name, (path, scale) in sorted(writer.inputs.items()):
        if path.startswith((OWN_CHANNEL, OWN_FREE)):
            meaning = (
                database.free_inputs.get(name)
                or f"{channel(name).description} [{channel(name).unit}]"
            )
            yield node("documentation", text=f"To be set from outside: {path}: {meaning}")
        else:
            factor = f" times {scale!r}" if scale != 1.0 else ""
            yield node("documentation", text=f"{name} is {path}{factor}")
    if database.increments:
        flights = sorted(
            {flight for increment in database.increments for flight in increment.flights}
        )
        text = (
            "Increments from flights are functions that fade beyond the flown range; their"
            " covariance is not part of this file. Flights: "
        )
        yield node("documentation", text=(text + (", ".join(flights) or "none named")))


def _hysteresis(database: AeroDatabase) -> Iterable[Element]:
    """The relay that JSBSim runs itself, if a free input is that relay."""
    for limits in filter(None, map(hysteresis_limits, database.free_inputs.values())):
        sides = [
            node(tag, text=repr(limit)) for tag, limit in zip(("min", "max"), limits, strict=True)
        ]
        yield node("hysteresis_limits", *sides, unit="RAD")
        return


def _axes(database: AeroDatabase, writer: FunctionWriter) -> list[Element]:
    used = {coefficient_axis(term.axis) for term in database.terms}
    mixed = bool(used & set(WIND_AXES)) and bool(used & set(_BODY))
    forces = _WIND if used & set(WIND_AXES) and not mixed else _BODY
    names = _Names()
    written: dict[str, list[Element]] = {axis: [] for axis in (*forces, *_MOMENTS)}
    totals: dict[str, list[Term]] = {axis: [] for axis in WIND_AXES}
    hinges: dict[str, list[Term]] = {}
    for term in database.terms:
        if is_hinge_axis(term.axis):
            hinges.setdefault(term.axis, []).append(term)
        elif (axis := coefficient_axis(term.axis)) in written:
            written[axis].append(_term_function(term, writer, names))
        else:
            totals[term.axis].append(term)
    if mixed:
        for axis, element in _wind_as_body_axes(totals, writer, names):
            written[axis].append(element)
    for axis, terms in hinges.items():  # on no axis of JSBSim: properties of their own
        parts = [writer.write(term.expression) for term in terms]
        writer.define(axis, names.unique(axis), total(parts), axis_description(axis))
    names_in_jsbsim = {**forces, **_MOMENTS}
    return [
        node("axis", *elements, name=names_in_jsbsim[axis])
        for axis, elements in written.items()
        if elements
    ]


def _term_function(term: Term, writer: FunctionWriter, names: "_Names") -> Element:
    note = f"{term.name}: {term.description or term.expression}; {axis_description(term.axis)}"
    return _force(names.unique(term.name), term.axis, writer.write(term.expression), note)


def _force(path: str, axis: str, coefficient: Element, note: str) -> Element:
    if axis in LOAD_AXES:
        unit = POUND_FORCE * FOOT if axis.startswith("M") else POUND_FORCE
        return function(path, node("product", value(1.0 / unit), coefficient), note)
    factors = [prop(factor) for factor in FACTORS[axis]]
    return function(path, node("product", *factors, coefficient), note)


def _wind_as_body_axes(
    totals: dict[str, list[Term]], writer: FunctionWriter, names: "_Names"
) -> Iterable[tuple[str, Element]]:
    """The terms in wind axes as one function on each body axis."""
    sums = {f"wind_{axis}": axis for axis in WIND_AXES}
    for name, axis in sums.items():
        parts = [writer.write(term.expression) for term in totals[axis]]
        note = f"{axis}: sum of {', '.join(term.name for term in totals[axis]) or 'nothing'}"
        writer.define(name, names.unique(f"total_{axis}"), total(parts), note)
    for axis, text in body_forces(*sums).items():
        coefficient = writer.write(parse(text))
        yield (
            axis,
            _force(
                names.unique(f"{axis}_of_wind_axes"),
                axis,
                coefficient,
                f"wind axes turned into {axis}",
            ),
        )


class _Names:
    """Unique properties of the functions on axes."""

    def __init__(self) -> None:
        self._taken: set[str] = set()

    def unique(self, wanted: str) -> str:
        """Return ``aero/coefficient/...`` with the characters that JSBSim allows in a name."""
        base = re.sub(r"[^A-Za-z0-9_.-]", "_", wanted)
        path, count = f"aero/coefficient/{base if base[:1].isalpha() else f'_{base}'}", 1
        while path in self._taken:
            count += 1
            path = f"aero/coefficient/{base if base[:1].isalpha() else f'_{base}'}_{count}"
        self._taken.add(path)
        return path


def _check_cases(cases: Sequence[CheckCase]) -> Element:
    """Inputs in SI and the coefficients of the database; moments about AERORP."""
    return node(
        "check_cases", node("description", text=_CASES), *[_check_case(case) for case in cases]
    )


def _check_case(case: CheckCase) -> Element:
    inputs = [node("input", text=repr(value), name=name) for name, value in case.inputs.items()]
    return node(
        "case",
        *inputs,
        *[node("output", text=repr(value), axis=axis) for axis, value in case.coefficients.items()],
    )
