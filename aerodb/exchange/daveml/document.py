"""Elements of a DAVE-ML document that is being written.

They are ids, variables, breakpoints, tables, functions and check cases.
"""

import re
from typing import Any, Final

import numpy as np
from lxml import etree
from numpy.typing import NDArray

from aerodb.exchange.daveml.check_cases import CheckSignal, StaticShot
from aerodb.exchange.daveml.names import (
    STANDARD_INPUTS,
    STANDARD_SIGNS,
    Declaration,
    described_unit,
    output_axis,
    output_sign,
    write_unit,
)
from aerodb.exchange.daveml.writing import text_number, text_numbers, write_math
from aerodb.nomenclature import AXES, CHANNELS, channel, is_command, is_surface
from aerodb.tables import (
    AeroDatabase,
    Call,
    Expression,
    Name,
    Negation,
    Number,
    ScatteredTable,
    Table,
    TableCall,
    Uncertainty,
    Variable,
)

NAMESPACE: Final = "http://daveml.org/2010/DAVEML"
_DOCTYPE: Final = (
    '<!DOCTYPE DAVEfunc PUBLIC "-//AIAA//DTD for Flight Dynamic Models - Functions 2.0//EN" '
    '"http://www.daveml.org/DTDs/2p0/DAVEfunc.dtd">'
)
_CONTROL = re.compile("[^\t\n\r\u0020-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
_DECLARED_ATTRIBUTES: Final = {
    "sign": "sign",
    "symbol": "symbol",
    "axis_system": "axisSystem",
    "alias": "alias",
}


class DavemlDocument:
    """A document that collects elements; `finish` puts them in the standard's order."""

    def __init__(self, database: AeroDatabase, created: str, author: str) -> None:
        self._database = database
        self._root = etree.Element(f"{{{NAMESPACE}}}DAVEfunc", nsmap={None: NAMESPACE})
        self._header(created, author)
        # By the database's name, or by the id of a variable that only the file has.
        self._variables: dict[str, Any] = {}
        self._ids: dict[str, str] = {}
        self._calls: dict[Expression, str] = {}  # table call -> id of its variable
        self._arguments: dict[Expression, str] = {}
        self._breakpoints: dict[bytes, str] = {}
        self._breakpoint_elements: list[Any] = []
        self._functions: list[Any] = []
        self._units: dict[str, str] = {}
        self._shown: dict[str, str] = {}  # id -> name
        self.inputs: list[str] = []
        self.outputs: dict[str, str] = {}  # axis -> id
        taken = {*CHANNELS, *database.free_inputs}
        for name, variable in database.variables.items():
            wanted = variable.declared.get("id", name)
            self._ids[name] = wanted if wanted not in taken else self._unused(name, taken)
            taken.add(self._ids[name])
        self._taken = taken | {f"moment_reference_{axis}" for axis in "xyz"}

    @property
    def identities(self) -> frozenset[str]:
        """Ids of all variables of the file."""
        return frozenset(self._shown)

    def identity(self, name: str) -> str:
        """Return the id of a name of the database."""
        return self._ids.get(name, name)

    def add_input(self, name: str) -> None:
        """Add an input: a channel in SI units with the standard name and sign of AIAA S-119
        (`STANDARD_INPUTS`), or a free input of the database."""
        patterned = is_surface(name) or is_command(name)
        known = name in CHANNELS or (patterned and name not in self._database.free_inputs)
        unit = (
            write_unit(channel(name).unit)
            if known
            else (described_unit(self._database.free_inputs[name]) or "nd")
        )
        note = channel(name).description if known else self._database.free_inputs[name]
        sign = STANDARD_SIGNS.get(name, "")
        if known and is_surface(name) and name not in CHANNELS:
            sign = "tel" if "rudder" in name else "ted"
        self.inputs.append(name)
        shown = STANDARD_INPUTS.get(name, name)
        roles = ("isInput", "isStdAIAA") if name in STANDARD_INPUTS else ("isInput",)
        self.add_variable(name, shown, unit, note, None, roles, {"sign": sign})

    def add_variable(
        self,
        identity: str,
        name: str,
        unit: str,
        note: str,
        expression: Expression | None,
        roles: tuple[str, ...] = (),
        attributes: dict[str, str] | None = None,
        uncertainty: Uncertainty | None = None,
    ) -> None:
        """Add a ``variableDef``.

        It is a constant, a calculation, the result of a table or, without `expression`, an input.
        unit : in DAVE-ML's spelling, ``nd`` for none.
        """
        element = etree.Element(f"{{{NAMESPACE}}}variableDef")
        self._variables[identity] = element
        self._units[identity], self._shown[identity] = unit or "nd", name or identity
        for key, text in {
            "name": name or identity,
            "varID": identity,
            "units": unit or "nd",
            **(attributes or {}),
        }.items():
            if text:
                element.set(key, _clean(text))
        if note:
            _child(element, "description", note)
        self._expression(element, identity, expression)
        order = (
            "isInput",
            "isControl",
            "isDisturbance",
            "isState",
            "isStateDeriv",
            "isOutput",
            "isStdAIAA",
        )
        for role in (each for each in order if each in roles):
            _child(element, role)
        self._uncertainty(element, uncertainty)

    def _expression(self, element: Any, identity: str, expression: Expression | None) -> None:
        if expression is None:
            return
        inner, low, high = _limits(expression)
        for attribute, limit in (("minValue", low), ("maxValue", high)):
            if limit is not None:
                element.set(attribute, text_number(limit))
        value = _number(inner)
        if value is not None:
            element.set("initialValue", text_number(value))
        elif (
            isinstance(inner, TableCall)
            and low is None
            and high is None
            and inner not in self._calls
        ):
            self._calls[inner] = identity
            self._function(inner, identity)
        else:
            _child(element, "calculation").append(write_math(inner, self._refer))

    def add_calculation(
        self, wanted: str, name: str, unit: str, note: str, expression: Expression, axis: str = ""
    ) -> str:
        """Add a variable that only the file has; return its name.

        axis : the coefficient that this variable is, if any; unit : in DAVE-ML's spelling, as
        `write_unit` gives it.
        """
        identity = self._unused(re.sub(r"\W", "_", wanted), self._taken)
        self._taken.add(identity)
        roles: tuple[str, ...] = ()
        attributes: dict[str, str] = {}
        if axis:
            self.outputs[axis] = identity
            roles, attributes = ("isOutput",), {"sign": output_sign(axis)}
        if axis in AXES:
            roles, attributes = (*roles, "isStdAIAA"), {**attributes, "axisSystem": "body"}
        self.add_variable(identity, name, unit, note, expression, roles, attributes)
        return identity

    def add_declared(self, name: str, variable: Variable, output: bool) -> None:
        """Add a variable of the database with its declaration.

        On an axis, only a total of the database remains an output (`output_axis`). Units are those
        declared; raises InputError for an unknown sign.
        """
        declared, identity = variable.declared, self._ids[name]
        shown = declared.get("name", identity)
        axis = output_axis(
            Declaration(identity, shown, variable.unit, declared.get("sign", "")),
            self._database.name,
        )
        roles = {
            role
            for role in declared.get("role", "").split()
            if role in ("isOutput", "isStdAIAA", "isState", "isStateDeriv")
        }
        if output and axis:
            self.outputs[axis[0]] = identity
            roles.add("isOutput")
        elif axis:
            roles.discard("isOutput")
        attributes = {
            attribute: declared.get(key, "") for key, attribute in _DECLARED_ATTRIBUTES.items()
        }
        note = variable.description
        unit = variable.unit if variable.unit not in ("", "1") else "nd"
        self.add_variable(
            identity,
            shown,
            unit,
            note,
            variable.expression,
            tuple(roles),
            attributes,
            variable.uncertainty,
        )

    def finish(self) -> None:
        """Put all elements into the standard's order."""
        self._root.extend(self._variables.values())
        tables = [self._grid(table) for table in self._database.tables.values()]
        self._root.extend(self._breakpoint_elements)
        self._root.extend(tables)
        self._root.extend(self._points(table) for table in self._database.scattered.values())
        self._root.extend(self._functions)

    def write_cases(self, cases: tuple[StaticShot, ...]) -> None:
        """Write ``checkData``: inputs and outputs by name and unit, internal signals by id."""
        data = _child(self._root, "checkData")
        for case in cases:
            shot = _child(data, "staticShot")
            shot.set("name", case.name)
            for part, signals in (
                ("checkInputs", case.inputs),
                ("internalValues", case.internals),
                ("checkOutputs", case.outputs),
            ):
                parent = _child(shot, part)
                for signal in signals:
                    self._signal(parent, signal, part == "internalValues")

    def to_bytes(self) -> bytes:
        """Return the content of the file: DAVE-ML 2.0 (AIAA S-119), XML in UTF-8."""
        etree.indent(self._root)
        data: bytes = etree.tostring(
            self._root, encoding="UTF-8", xml_declaration=True, doctype=_DOCTYPE
        )
        return data

    def _header(self, created: str, author: str) -> None:
        database = self._database
        header = _child(self._root, "fileHeader")
        header.set("name", _clean(database.name))
        _child(header, "author").set("name", _clean(author or "aerodb"))
        if created:
            _child(header, "creationDate").set("date", created)
        point = ", ".join(f"{x:.9g}" for x in database.reference.moment_reference)
        parts = [
            database.description,
            "Inputs in SI units and radians; surfaces positive trailing edge down (rudder left).",
            (
                "Coefficients on body axes (x forward, y right, z down) over qbar S; Cl and Cn over"
                " the span, Cm over the chord."
            ),
            f"Moments about ({point}) m from the vehicle's datum in body axes.",
            f"From: {database.source}" if database.source else "",
        ]
        _child(header, "description", " ".join(part for part in parts if part))

    def _signal(self, parent: Any, signal: CheckSignal, internal: bool) -> None:
        element = _child(parent, "signal")
        if internal:
            _child(element, "varID", signal.identity)
        else:
            _child(element, "signalName", self._shown[signal.identity])
            _child(element, "signalUnits", self._units[signal.identity])
        _child(element, "signalValue", text_number(signal.value))
        if signal.tolerance is not None:
            _child(element, "tol", text_number(signal.tolerance))

    def _refer(self, node: Expression) -> str:
        """Id of a name, or of the variable that is the value of a table call.

        That variable is added at its first use.
        """
        if isinstance(node, Name):
            return self._ids.get(node.name, node.name)
        if node not in self._calls and isinstance(node, TableCall):
            self._calls[node] = identity = self._unused(f"{node.table}_value", self._taken)
            self._taken.add(identity)
            self.add_variable(identity, "", "nd", f"value of {node.table}", None)
            self._function(node, identity)
        return self._calls[node]

    def _argument(self, table: str, expression: Expression) -> str:
        """Id of a variable whose value is the argument of a table."""
        if isinstance(expression, (Name, TableCall)):
            return self._refer(expression)
        if expression not in self._arguments:
            self._arguments[expression] = self.add_calculation(
                f"{table}_argument", "", "nd", f"argument of {table}", expression
            )
        return self._arguments[expression]

    def _function(self, call: TableCall, dependent: str) -> None:
        function = etree.Element(f"{{{NAMESPACE}}}function")
        function.set("name", f"{dependent}_fn")
        table = self._database.tables.get(call.table)
        for k, argument in enumerate(call.arguments):
            reference = _child(function, "independentVarRef")
            reference.set("varID", self._argument(call.table, argument))
            for attribute, words in (
                (("extrapolate", table.extrapolation), ("interpolate", table.interpolation))
                if table
                else ()
            ):
                if words:
                    reference.set(attribute, words[k])
        _child(function, "dependentVarRef").set("varID", dependent)
        definition = _child(function, "functionDefn")
        definition.set("name", f"{dependent}_defn")
        if table is not None:
            _child(definition, "griddedTableRef").set("gtID", call.table)
        else:
            _child(definition, "ungriddedTableRef").set("utID", call.table)
        self._functions.append(function)

    def _grid(self, table: Table) -> Any:
        element = etree.Element(f"{{{NAMESPACE}}}griddedTableDef", name=table.name, gtID=table.name)
        references = _child(element, "breakpointRefs")
        for label, axis in zip(table.arguments, table.breakpoints, strict=True):
            _child(references, "bpRef").set("bpID", self._breakpoint(label, axis))
        self._uncertainty(element, table.uncertainty)
        _child(element, "dataTable", text_numbers(table.values))
        return element

    def _breakpoint(self, label: str, axis: NDArray[np.float64]) -> str:
        """Id of breakpoints, which tables share."""
        key = axis.tobytes()
        if key not in self._breakpoints:
            taken = set(self._breakpoints.values())
            self._breakpoints[key] = self._unused(
                f"{re.sub(r'[^A-Za-z0-9_]', '_', label) or 'x'}_points", taken
            )
            element = etree.Element(f"{{{NAMESPACE}}}breakpointDef", bpID=self._breakpoints[key])
            _child(element, "bpVals", text_numbers(axis))
            self._breakpoint_elements.append(element)
        return self._breakpoints[key]

    def _points(self, table: ScatteredTable) -> Any:
        element = etree.Element(
            f"{{{NAMESPACE}}}ungriddedTableDef", name=table.name, utID=table.name
        )
        self._uncertainty(element, table.uncertainty)
        for point, value in zip(table.points, table.values, strict=True):
            _child(
                element,
                "dataPoint",
                ", ".join(text_number(x) for x in (*point.tolist(), float(value))),
            )
        return element

    def _uncertainty(self, parent: Any, uncertainty: Uncertainty | None) -> None:
        if uncertainty is None:
            return
        element = _child(parent, "uncertainty")
        element.set("effect", uncertainty.effect)
        normal = uncertainty.distribution == "normal"
        distribution = _child(element, "normalPDF" if normal else "uniformPDF")
        if normal:
            distribution.set(
                "numSigmas",
                (
                    f"{uncertainty.sigmas:g}"
                    if uncertainty.sigmas.is_integer()
                    else repr(uncertainty.sigmas)
                ),
            )
        else:
            distribution.set("symmetric", "yes" if len(uncertainty.bounds) == 1 else "no")
        for bound in uncertainty.bounds:
            if isinstance(bound, str):
                _child(_child(distribution, "bounds"), "variableRef").set(
                    "varID", self.identity(bound)
                )
            elif isinstance(bound, tuple):
                _child(_child(distribution, "bounds"), "dataTable", text_numbers(np.array(bound)))
            else:
                _child(distribution, "bounds", text_number(bound))
        for name in uncertainty.correlates_with:
            _child(distribution, "correlatesWith").set("varID", self.identity(name))
        for name, coefficient in uncertainty.correlations:
            correlation = _child(distribution, "correlation")
            correlation.set("varID", self.identity(name))
            correlation.set("corrCoef", text_number(coefficient))

    @staticmethod
    def _unused(wanted: str, taken: set[str]) -> str:
        name, count = wanted, 1
        while name in taken:
            count += 1
            name = f"{wanted}_{count}"
        return name


def _child(parent: Any, name: str, text: str | None = None) -> Any:
    element = etree.SubElement(parent, f"{{{NAMESPACE}}}{name}")
    if text is not None:
        element.text = _clean(text)
    return element


def _clean(text: str) -> str:
    """`text` with a space for every character that XML cannot hold."""
    return _CONTROL.sub(" ", text)


def _number(expression: Expression) -> float | None:
    if isinstance(expression, Number):
        return expression.value
    if isinstance(expression, Negation) and isinstance(expression.operand, Number):
        return -expression.operand.value
    return None


def _limits(expression: Expression) -> tuple[Expression, float | None, float | None]:
    """The expression inside an outermost limiter with constant limits, and these limits.

    The standard writes them as attributes.
    """
    if isinstance(expression, Call) and expression.function in ("clip", "min", "max"):
        first, *rest = expression.arguments
        ends = [_number(each) for each in rest]
        if None not in ends and _number(first) is None:
            if expression.function == "clip":
                return first, ends[0], ends[1]
            if len(ends) == 1:
                return (
                    (first, ends[0], None)
                    if expression.function == "max"
                    else (first, None, ends[0])
                )
    return expression, None, None
