"""Read JSBSim aircraft files: ``<metrics>`` and ``<aerodynamics>`` become an AeroDatabase.

JSBSim's functions on axes give forces in lbf and moments in lbf ft, with dynamic pressure, area and
length as factors. These factors are cancelled from the products that contain them; where that is
impossible, the function is divided by them. Structural axes (inches, x aft, y right, z up) become
metres in body axes, with the structural origin as datum.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from functools import reduce
from typing import Any, Final

from aerodb.errors import InputError, OpenQuestionsError, UnknownNameError, nearest
from aerodb.exchange.binding_units import binding_fault, binding_question, raise_together
from aerodb.exchange.jsbsim.axes import FACTORS, axis_frame, axis_shares, body_forces, check_systems
from aerodb.exchange.jsbsim.functions import TEXT, JsbsimFunctions, properties_read
from aerodb.exchange.jsbsim.metrics import (
    read_constants,
    read_limits,
    read_reference,
    read_root,
    read_section,
)
from aerodb.exchange.jsbsim.properties import (
    AERO_REFERENCE,
    INCH,
    LIFT_SQUARED,
    OWN_CHANNEL,
    OWN_STATE,
    PROPERTIES,
    STALL_HYSTERESIS,
    TIME_PASSES,
    WING_ALPHA,
    WING_INCIDENCE,
    height_of_reference_point,
    hysteresis_description,
    hysteresis_limits,
    property_description,
    property_unit,
)
from aerodb.exchange.jsbsim.scalings import read_computed, read_scalings, roots_of
from aerodb.nomenclature import channel
from aerodb.tables import (
    LIFT_INCREMENTS,
    MAX_DEPTH,
    WIND_AXES,
    AeroDatabase,
    Expression,
    Name,
    Negation,
    Number,
    Operation,
    ReferenceGeometry,
    Relay,
    StateModel,
    Term,
    Variable,
    cancel,
    number,
    parse,
    plus,
    times,
)

Loader = Callable[[str], bytes]

_LIMITS: Final = ("alphalimits", "hysteresis_limits")
#: Position of a leg of the landing gear: all legs move together.
_GEAR: Final = re.compile(r"gear/(unit|gear)(\[\d+\])?/(position|pos)-norm")


#: Most properties that are looked at for one that flight control makes: files from outside end.
_WAYS: Final = 12


def import_jsbsim(
    xml: bytes,
    *,
    bindings: Mapping[str, str] | None = None,
    name: str,
    loader: Loader | None = None,
) -> AeroDatabase:
    """Return the aerodynamics of a JSBSim aircraft file.

    xml : content of the file. name : of the database; shown in errors. bindings : property ->
    expression of channels and S_ref, c_ref, b_ref, in the property's own unit; it takes precedence
    over the meaning in `aerodb.exchange.jsbsim.properties`. loader : returns the content of a file
    that the aircraft names for its metrics or aerodynamics (``file="..."``, as written there,
    always relative and without ``..``). It is asked for those of flight control and systems too,
    which may be absent: an InputError or OSError of it is not raised then.

    A property without a binding or known meaning, or bound to its own identifier, becomes a free
    input of the database. Every other property becomes a variable whose description holds its
    JSBSim name.

    ``aero/cl-squared`` is the square of the total lift coefficient, later increments on it
    included: a corrected lift changes the induced drag. JSBSim itself uses the lift of its previous
    time step; the two agree if nothing changes between steps. ``aero/stall-hyst-norm`` has memory
    and becomes the free input `stall_hyst_norm`, whose values along a flight come from a
    state model. A moving reference point becomes terms on Cm and Cn about the fixed one.

    Raises InputError for XML with a document type or entities, for an unsupported element (by
    name), for another file without a `loader`, and for bindings of properties that the file does
    not use.
    """
    root = read_root(xml, name)
    metrics = read_section(root, "metrics", name, loader)
    reference, constants = read_reference(metrics, name), read_constants(metrics, name)
    roots = roots_of(root, name, loader)
    reading = _AircraftReader(name, dict(bindings or {}), constants, roots)
    reading.read(read_section(root, "aerodynamics", name, loader))
    return reading.database(reference)


class _AircraftReader:
    """Reader of one file's aerodynamics: functions, axes, and meanings of properties."""

    def __init__(
        self,
        where: str,
        bindings: dict[str, str],
        constants: dict[str, float],
        roots: list[Any],
    ) -> None:
        self._where = where
        self._scalings, self._computed = read_scalings(roots, where), read_computed(roots)
        self._bindings = bindings
        self._constants = constants
        self._functions = JsbsimFunctions(where)
        self._acting: list[tuple[str, str, str]] = []  # JSBSim axis, frame, function's property
        self._shift = ""  # property of the function that shifts the reference point
        self._hysteresis = ""
        self._notes: list[str] = []
        self._questions: list[OpenQuestionsError] = []

    def read(self, aerodynamics: Any) -> None:
        """Read everything below ``<aerodynamics>``."""
        self._functions.reserve(aerodynamics)
        outside_axes = []
        for child in aerodynamics:
            if child.tag == "axis":
                self._axis(child)
            elif child.tag == "function":
                outside_axes.append(self._functions.function(child))
            elif child.tag == "property":
                self._functions.constant(child)
            elif child.tag in _LIMITS:
                self._limits(child)
            elif child.tag == "aero_ref_pt_shift_x" and not self._shift:
                self._shift = self._only_function(child)
            elif child.tag not in TEXT:
                self._functions.refuse(child, "aerodynamics")
        for name in outside_axes:
            self._functions.identifier(name)
        check_systems(self._acting, self._where)

    def _axis(self, element: Any) -> None:
        axis, frame = axis_frame(element, self._where)
        for child in element:
            if child.tag == "function":
                self._acting.append((axis, frame, self._functions.function(child)))
            elif child.tag not in TEXT:
                self._functions.refuse(child, f"axis {axis}")

    def _limits(self, element: Any) -> None:
        low, high = read_limits(element, self._where)
        self._notes.append(f"{element.tag} from {low!r} to {high!r} rad")
        if (
            element.tag == "hysteresis_limits" and low != 0.0 != high
        ):  # JSBSim's relay does not switch if either is zero
            self._hysteresis = hysteresis_description(low, high)

    def _only_function(self, element: Any) -> str:
        functions = [child for child in element if child.tag not in TEXT]
        if len(functions) != 1 or functions[0].tag != "function":
            raise InputError(f"<{element.tag}> must contain exactly one function", self._where)
        return self._functions.function(functions[0])

    def database(self, reference: ReferenceGeometry) -> AeroDatabase:
        """Return the database of everything that was read."""
        terms = self._terms()
        variables: dict[str, Variable] = {}
        if self._shift:
            totals, shift = self._shift_terms(terms)
            terms += shift
            variables |= totals
        free: dict[str, str] = {}
        # A binding may also name the input as the database does: fcs_flap_pos_norm.
        written = {known: name for name, known in self._functions.identifiers.items()}
        self._bindings = {
            name if name in self._functions.identifiers else written.get(name, name): text
            for name, text in self._bindings.items()
        }
        self._resolve(reference, terms, variables, free)
        unused = sorted(set(self._bindings) - set(self._functions.identifiers))
        if unused:
            what = f"binding of '{unused[0]}', which the aerodynamics do not use"
            raise InputError(what, self._where, nearest(unused[0], self._functions.identifiers))
        raise_together(self._questions, self._where)
        for tree in [term.expression for term in terms] + [
            variable.expression for variable in variables.values()
        ]:
            if tree.depth > MAX_DEPTH:
                raise InputError(
                    f"an expression has {tree.depth} levels", self._where, f"at most {MAX_DEPTH}"
                )
            # A stored expression must be readable: the limits of the language apply to imports.
            parse(str(tree))
        notes = f"; {'; '.join(self._notes)}" if self._notes else ""
        source = f"JSBSim aircraft file{notes}"
        return AeroDatabase(
            self._where,
            reference,
            variables,
            self._functions.tables,
            tuple(terms),
            free_inputs=free,
            source=source,
            states=_relays(free),
        )

    def _resolve(
        self,
        reference: ReferenceGeometry,
        terms: list[Term],
        variables: dict[str, Variable],
        free: dict[str, str],
    ) -> None:
        """Set the meaning of every property in use; a meaning may use further properties."""
        done: set[str] = set()
        while pending := [name for name in self._functions.identifiers if name not in done]:
            for name in pending:
                identifier = self._functions.identifiers[name]
                meaning = self._meaning(name, reference, terms)
                if meaning is None:
                    free[identifier] = (
                        self._hysteresis if name == STALL_HYSTERESIS else property_description(name)
                    )
                else:
                    variables[identifier] = meaning
            done.update(pending)

    def _terms(self) -> list[Term]:
        terms: list[Term] = []
        names: set[str] = set()
        body = any(axis in ("AXIAL", "NORMAL") for axis, _, _ in self._acting)
        for axis, frame, function in self._acting:
            expression, description = self._functions.defined[function]
            reached = axis_shares(axis, frame)
            for target, factor in reached:
                scaled = _scaled(self._without(expression, FACTORS[target]), parse(factor))
                short = (
                    function.rsplit("/", 1)[-1]
                    if len(reached) == 1
                    else f"{function.rsplit('/', 1)[-1]}_{target}"
                )
                name = (
                    short
                    if short not in names
                    else f"{function}_{target}"
                    if len(reached) > 1
                    else function
                )
                names.add(name)
                terms.append(
                    Term(name, "CY" if body and target == "C_side" else target, scaled, description)
                )
        return terms

    def _shift_terms(self, terms: list[Term]) -> tuple[dict[str, Variable], list[Term]]:
        """Moments about the fixed reference point of forces that act at a shifted one.

        The point is shifted aft by a fraction of the chord.
        """
        axes = WIND_AXES if any(term.axis in WIND_AXES for term in terms) else ("CX", "CY", "CZ")
        totals: dict[str, Variable] = {}
        for axis in axes:
            parts = [term.expression for term in terms if term.axis == axis]
            identifier = self._functions.unique(f"total_{axis}")
            totals[identifier] = Variable(
                reduce(plus, parts) if parts else Number(0), "1", f"{axis} of all terms"
            )
        names = list(totals)
        forces = body_forces(*names) if axes == WIND_AXES else dict(zip(axes, names, strict=True))
        shift, note = (
            self._functions.identifier(self._shift),
            "reference point shifted aft, in chords",
        )
        normal, side = (parse(f"{shift}*({forces[axis]})") for axis in ("CZ", "CY"))
        yaw = times(_scaled(side, parse("-1")), parse("c_ref/b_ref"))
        return totals, [
            Term("reference_point_shift_Cm", "Cm", normal, note),
            Term("reference_point_shift_Cn", "Cn", yaw, note),
        ]

    def _without(self, expression: Expression, factors: Iterable[str]) -> Expression:
        """`expression` divided by the factors.

        A factor is cancelled if the expression is a multiple of it.
        """
        rest: list[Expression] = []
        for factor in factors:
            name = Name(self._functions.identifier(factor))
            cancelled = cancel(expression, name)
            if cancelled is None:
                rest.append(name)
            else:
                expression = cancelled
        return Operation("/", expression, reduce(times, rest)) if rest else expression

    def _meaning(
        self, name: str, reference: ReferenceGeometry, terms: list[Term]
    ) -> Variable | None:
        """The variable that a property stands for; None for a free input."""
        note = property_description(name)
        if name in self._bindings:
            try:
                bound = parse(self._bindings[name])
            except InputError as error:
                raise InputError(
                    error.what, f"{self._where}: binding of {name}", error.remedy
                ) from None
            if bound == Name(self._functions.identifiers[name]):
                return None
            unit = property_unit(name)
            fault = binding_fault(bound, unit) if unit else None
            if fault is not None:
                self._questions.append(binding_question(name, fault, self._where))
            return Variable(bound, "", note)
        if name in self._functions.defined:
            expression, description = self._functions.defined[name]
            return Variable(expression, "", property_description(name, description))
        if name in self._constants:
            return Variable(
                number(self._constants[name]),
                "",
                property_description(name, "constant of the file"),
            )
        if name == LIFT_SQUARED:
            lift = [term.expression for term in terms if term.axis == "C_lift"]
            total = reduce(plus, [*lift, Name(LIFT_INCREMENTS)])
            return Variable(Operation("^", total, Number(2)), "1", note) if lift else None
        text = self._text(name, reference)
        if text:
            return Variable(parse(text), "", note)
        if made := self._made(name, reference, {name}):
            of, text = made
            scaled = parse(text.replace("{x}", self._functions.identifier(of)))
            return Variable(scaled, "", property_description(name, f"scaled {of}, by the file"))
        if name in self._computed and self._is_known(name, reference, {name}):
            tree = self._functions.computed(self._computed[name], name)
            return Variable(tree, "", property_description(name, "computed by the file"))
        return None

    def _made(
        self, name: str, reference: ReferenceGeometry, seen: set[str]
    ) -> tuple[str, str] | None:
        """A known property that one is a scaled copy of by the file's flight control, and the
        expression (`read_scalings`) of the whole way; None without such a way.

        seen : properties that are on other ways already, and this one; it grows.
        """
        for of, text in self._scalings.get(name, ()):
            if self._is_stated(of, reference):
                return of, text
            if of not in seen and len(seen) < _WAYS:
                seen.add(of)
                if further := self._made(of, reference, seen):
                    return further[0], text.replace("{x}", f"({further[1]})")
        return None

    def _is_stated(self, name: str, reference: ReferenceGeometry) -> bool:
        known = (self._bindings, self._functions.defined, self._constants)
        return any(name in each for each in known) or bool(self._text(name, reference))

    def _is_known(self, name: str, reference: ReferenceGeometry, seen: set[str]) -> bool:
        """Whether a property that the file computes is made of known ones alone.

        seen : as in `_made`.
        """
        if name not in self._computed or len(seen) > _WAYS:
            return False
        for of in properties_read(self._computed[name]):
            if self._is_stated(of, reference) or self._made(of, reference, {of}):
                continue
            if of in seen or not self._is_known(of, reference, seen | {of}):
                return False
        try:
            JsbsimFunctions(self._where).computed(self._computed[name], name)
        except InputError:
            return False  # by elements that have no meaning here
        return True

    def _text(self, name: str, reference: ReferenceGeometry) -> str:
        """The expression of a property of JSBSim or of an earlier export; '' if there is none."""
        if name == "aero/h_b-mac-ft":
            return height_of_reference_point(*reference.moment_reference)
        if name in AERO_REFERENCE:
            place, sign = AERO_REFERENCE[name]
            return repr(sign * reference.moment_reference[place] / INCH)
        if name == WING_ALPHA:
            return f"alpha + {self._constants.get(WING_INCIDENCE, 0.0)!r}".replace("+ -", "- ")
        if name == STALL_HYSTERESIS and not self._hysteresis:
            return "0"  # without limits JSBSim never switches it
        if name == TIME_PASSES or name.startswith(OWN_STATE):
            return "0"  # states of an export are read as their steady values
        own = name.removeprefix(OWN_CHANNEL)
        if own != name:
            try:
                return channel(own).name
            except UnknownNameError as error:
                raise InputError(
                    error.what, f"{self._where}: property {name}", error.remedy
                ) from None
        return PROPERTIES.get(_GEAR.sub("gear/gear-pos-norm", name.removeprefix("/")), "")


def _relays(free: Mapping[str, str]) -> tuple[StateModel, ...]:
    """JSBSim's stall hysteresis, if a free input is it.

    Along a flight, the relay provides the values of that input.
    """
    limits = {name: hysteresis_limits(text) for name, text in free.items()}
    return tuple(
        StateModel(name, Relay(*limit, separated=1.0)) for name, limit in limits.items() if limit
    )


def _scaled(expression: Expression, factor: Expression) -> Expression:
    """`expression` times `factor`, without a factor of one."""
    if factor == Number(1):
        return expression
    return Negation(expression) if factor == Negation(Number(1)) else times(factor, expression)
