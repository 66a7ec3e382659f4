"""JSBSim aircraft files in: ``<metrics>`` and ``<aerodynamics>`` become an AeroDatabase.

JSBSim's axis functions give forces in lbf and moments in lbf ft, already times dynamic pressure, area and length.
These factors are cancelled out of the products that contain them; where they cannot be, the function is divided by
them. Structural axes (inches, x aft, y right, z up) become metres in body axes with the structural origin as datum.
"""

import re
from collections.abc import Iterable, Mapping
from functools import reduce
from typing import Any, Final

from aerodb.errors import InputError, nearest
from aerodb.exchange.jsbsim_properties import AREA, CHORD, LIFT_SQUARED, PROPERTIES, QBAR, SPAN, height_of_reference_point
from aerodb.exchange.jsbsim_table import read_table
from aerodb.exchange.jsbsim_xml import only, read_number, read_reference, read_root
from aerodb.nomenclature import CHANNELS, is_surface
from aerodb.tables.algebra import cancel, plus, times
from aerodb.tables.database import CONSTANTS, AeroDatabase, Reference, Term, Variable
from aerodb.tables.expression import Call, Expression, Name, Negation, Number, Operation, TableCall, number, parse
from aerodb.tables.functions import FUNCTIONS
from aerodb.tables.table import Table

#: JSBSim axis -> our axis, sign, and the properties that its functions carry as factors.
_FORCE: Final = (QBAR, AREA)
_AXES: Final[dict[str, tuple[str, int, tuple[str, ...]]]] = {
    "DRAG": ("C_drag", 1, _FORCE),
    "SIDE": ("C_side", 1, _FORCE),
    "LIFT": ("C_lift", 1, _FORCE),
    "X": ("CX", 1, _FORCE),
    "Y": ("CY", 1, _FORCE),
    "Z": ("CZ", 1, _FORCE),
    "AXIAL": ("CX", -1, _FORCE),
    "NORMAL": ("CZ", -1, _FORCE),
    "ROLL": ("Cl", 1, (*_FORCE, SPAN)),
    "PITCH": ("Cm", 1, (*_FORCE, CHORD)),
    "YAW": ("Cn", 1, (*_FORCE, SPAN)),
}
_SYSTEMS: Final = ({"DRAG", "SIDE", "LIFT"}, {"X", "Y", "Z"}, {"AXIAL", "SIDE", "NORMAL"})

_FOLDS: Final = {"product": "*", "sum": "+", "difference": "-", "quotient": "/", "pow": "^"}
_EXACTLY_TWO: Final = ("quotient", "pow")
_CALLS: Final = {
    name: name for name in ("abs", "min", "max", "sqrt", "exp", "sin", "cos", "tan", "asin", "acos", "atan", "atan2")
}
_CALLS["ln"] = "log"
_SHORT: Final = {"p": "property", "v": "value", "t": "table"}
_TEXT: Final = ("description", "documentation")


def import_jsbsim(xml: bytes, *, bindings: Mapping[str, str] | None = None, name: str) -> AeroDatabase:
    """The aerodynamics of a JSBSim aircraft file.

    xml : the file's bytes. bindings : property -> expression over channels and S_ref, c_ref, b_ref, in the property's
    own unit; it takes precedence over the meaning in `jsbsim_properties`. A property that neither gives a meaning to, or
    that is bound to its own identifier, becomes a free input of the database. Every property is kept as a variable
    whose description holds its JSBSim name.

    ``aero/cl-squared`` is the square of the total lift coefficient. JSBSim itself takes the lift of its previous
    time step there; the two agree when nothing changes between steps.

    Raises InputError for XML with a document type or entities, for an element outside the supported set (named), and
    for bindings of properties that the file does not use.
    """
    root = read_root(xml, name)
    reading = _Reading(name, dict(bindings or {}))
    reference = read_reference(only(root, "metrics", name), name)
    aerodynamics = only(root, "aerodynamics", name)
    if aerodynamics.get("file"):
        raise InputError(f"aerodynamics stand in another file, '{aerodynamics.get('file')}'", name, "put them into this one")
    reading.read(aerodynamics)
    return reading.database(reference)


class _Reading:
    """What has been found while the elements of one file are read."""

    def __init__(self, where: str, bindings: dict[str, str]) -> None:
        self._where = where
        self._bindings = bindings
        self._identifiers: dict[str, str] = {}  # property -> identifier
        self._taken: set[str] = {*CHANNELS, *CONSTANTS, *FUNCTIONS}
        self._functions: dict[str, tuple[Expression, str]] = {}  # property that a function defines -> expression, description
        self._tables: dict[str, Table] = {}
        self._axis_functions: list[tuple[str, str]] = []  # JSBSim axis, function's property
        self._notes: list[str] = []

    def read(self, aerodynamics: Any) -> None:
        """Takes in everything below ``<aerodynamics>``."""
        always = []
        for child in aerodynamics:
            if child.tag == "axis":
                self._axis(child)
            elif child.tag == "function":
                always.append(self._function(child))
            elif child.tag == "property":
                value = read_number(child.get("value", "0"), f"{self._where}: <property>")
                self._functions[(child.text or "").strip()] = (number(value), "constant of the file")
            elif child.tag in ("alphalimits", "hysteresis_limits"):
                limits = " ".join(f"{limit.tag} {(limit.text or '').strip()}" for limit in child)
                self._notes.append(f"{child.tag} {limits} {child.get('unit', 'RAD')}")
            elif child.tag not in _TEXT:
                self._unsupported(child, "aerodynamics")
        for name in always:
            self._identifier(name)
        axes = {axis for axis, _ in self._axis_functions} - {"ROLL", "PITCH", "YAW"}
        if not any(axes <= system for system in _SYSTEMS):
            raise InputError(f"force axes of different systems: {', '.join(sorted(axes))}", self._where)

    def _unsupported(self, element: Any, place: str) -> None:
        raise InputError(f"unsupported element <{element.tag}> in {place}", self._where, "its effect cannot be left out silently")

    def _axis(self, element: Any) -> None:
        axis = element.get("name", "")
        if axis not in _AXES:
            raise InputError(f"axis '{axis}'", self._where, nearest(axis, _AXES))
        if set(element.attrib) - {"name"}:
            raise InputError(f"unsupported attributes of axis {axis}: {dict(element.attrib)}", self._where)
        for child in element:
            if child.tag == "function":
                self._axis_functions.append((axis, self._function(child)))
            elif child.tag not in _TEXT:
                self._unsupported(child, f"axis {axis}")

    def _function(self, element: Any) -> str:
        """Reads a function; gives the property that it defines."""
        name = (element.get("name") or f"function-{len(self._functions) + 1}").strip()
        if set(element.attrib) - {"name"}:
            raise InputError(f"unsupported attributes of function {name}: {dict(element.attrib)}", self._where)
        if name in self._functions:
            raise InputError(f"function '{name}' stands twice", self._where)
        operations = [child for child in element if child.tag not in _TEXT]
        if len(operations) != 1:
            raise InputError(f"function '{name}' has {len(operations)} operations", self._where, "exactly one is needed")
        description = " ".join(" ".join(text.text.split()) for text in element if text.tag in _TEXT and text.text)
        self._functions[name] = (self._node(operations[0], name), description.replace("_", " "))
        return name

    def _node(self, element: Any, function: str) -> Expression:
        tag = _SHORT.get(element.tag, element.tag)
        where = f"{self._where}: {function}"
        if tag == "value":
            return number(read_number(element.text, where))
        if tag == "property":
            return self._property((element.text or "").strip())
        if tag == "table":
            return self._table(element, function)
        children = [self._node(child, function) for child in element if child.tag not in _TEXT]
        if not children or (tag in _EXACTLY_TWO and len(children) != 2):
            raise InputError(f"<{element.tag}> with {len(children)} operands", where)
        if tag in _FOLDS:
            return reduce(lambda left, right: Operation(_FOLDS[tag], left, right), children)
        if tag in _CALLS:
            takes = FUNCTIONS[_CALLS[tag]]
            if len(children) < takes.least or (takes.most is not None and len(children) > takes.most):
                raise InputError(f"<{element.tag}> with {len(children)} operands", where)
            return Call(_CALLS[tag], tuple(children))
        self._unsupported(element, f"function {function}")
        raise AssertionError

    def _property(self, name: str) -> Expression:
        if name.startswith("-"):
            return Negation(Name(self._identifier(name[1:])))
        return Name(self._identifier(name))

    def _table(self, element: Any, function: str) -> Expression:
        if set(element.attrib) - {"name"}:
            raise InputError(f"unsupported attributes of a table: {dict(element.attrib)}", f"{self._where}: {function}")
        found = read_table(element, f"{self._where}: {function}")
        name = self._unique(_last(function))
        arguments = tuple(self._property(each) for each in found.properties)
        try:
            self._tables[name] = Table(name, found.properties, found.breakpoints, found.values)
        except InputError as error:
            raise InputError(error.what, f"{self._where}: {error.where}", error.remedy) from None
        call = TableCall(name, arguments)
        if element.get("name"):
            self._functions[element.get("name")] = (call, f"table of {function}")
        return call

    def _unique(self, wanted: str) -> str:
        base = re.sub(r"\W", "_", wanted, flags=re.ASCII)
        base = f"_{base}" if not base or base[0].isdigit() else base
        name, count = base, 1
        while name in self._taken or is_surface(name):
            count += 1
            name = f"{base}_{count}"
        self._taken.add(name)
        return name

    def _identifier(self, name: str) -> str:
        """The identifier of a property, the same each time."""
        if not name:
            raise InputError("a property without a name", self._where)
        if name not in self._identifiers:
            self._identifiers[name] = self._unique(name)
        return self._identifiers[name]

    def database(self, reference: Reference) -> AeroDatabase:
        """The database of all that was read."""
        terms = self._terms()
        variables: dict[str, Variable] = {}
        free: dict[str, str] = {}
        pending = list(self._identifiers)
        while pending:
            for name in pending:
                identifier = self._identifiers[name]
                meaning = self._meaning(name, reference, terms)
                if meaning is None:
                    free[identifier] = f"JSBSim property {name}"
                else:
                    variables[identifier] = meaning
            pending = [name for name, key in self._identifiers.items() if key not in variables and key not in free]
        unused = sorted(set(self._bindings) - set(self._identifiers))
        if unused:
            what = f"binding of '{unused[0]}', which the aerodynamics do not use"
            raise InputError(what, self._where, nearest(unused[0], self._identifiers))
        for tree in [term.expression for term in terms] + [variable.expression for variable in variables.values()]:
            parse(str(tree))  # what is stored must be readable: the limits of the language hold for imports too
        notes = f"; {'; '.join(self._notes)}" if self._notes else ""
        return AeroDatabase(
            self._where, reference, variables, self._tables, tuple(terms), free_inputs=free, source=f"JSBSim aircraft file{notes}"
        )

    def _terms(self) -> list[Term]:
        terms, names = [], set()
        for axis, function in self._axis_functions:
            ours, sign, factors = _AXES[axis]
            expression, description = self._functions[function]
            coefficient = self._without(expression, factors)
            name = _last(function) if _last(function) not in names else function
            names.add(name)
            terms.append(Term(name, ours, Negation(coefficient) if sign < 0 else coefficient, description))
        lateral = "CY" if any(term.axis in ("CX", "CZ") for term in terms) else "C_side"
        return [Term(t.name, lateral, t.expression, t.description) if t.axis == "C_side" else t for t in terms]

    def _without(self, expression: Expression, factors: Iterable[str]) -> Expression:
        """`expression` over the factors: cancelled where it is a multiple of them, else divided by."""
        rest: list[Expression] = []
        for factor in factors:
            name = Name(self._identifier(factor))
            cancelled = cancel(expression, name)
            if cancelled is None:
                rest.append(name)
            else:
                expression = cancelled
        if rest:
            return Operation("/", expression, reduce(times, rest))
        return expression

    def _meaning(self, name: str, reference: Reference, terms: list[Term]) -> Variable | None:
        """What a property stands for; None: a free input."""
        text = self._bindings.get(name)
        note = f"JSBSim property {name}"
        if text is not None:
            try:
                bound = parse(text)
            except InputError as error:
                raise InputError(error.what, f"{self._where}: binding of {name}", error.remedy) from None
            return None if bound == Name(self._identifiers[name]) else Variable(bound, "", note)
        if name in self._functions:
            expression, description = self._functions[name]
            return Variable(expression, "", f"{note}: {description}" if description else note)
        if name == LIFT_SQUARED:
            lift = [term.expression for term in terms if term.axis == "C_lift"]
            return Variable(Operation("^", reduce(plus, lift), Number(2)), "1", note) if lift else None
        if name == "aero/h_b-mac-ft":
            return Variable(parse(height_of_reference_point(*reference.moment_reference)), "1", note)
        return Variable(parse(PROPERTIES[name]), "", note) if name in PROPERTIES else None


def _last(path: str) -> str:
    return path.rsplit("/", 1)[-1]
