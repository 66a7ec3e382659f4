"""Read JSBSim's functions: ``<function>`` elements become expressions, tables and identifiers.

`aerodb.exchange.jsbsim.reader` gives properties their meaning once all functions are known.
"""

import re
from functools import reduce
from typing import Any, Final, NoReturn

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.jsbsim.metrics import MAX_NAME, read_number
from aerodb.exchange.jsbsim.operations import build_operation
from aerodb.exchange.jsbsim.properties import OWN_FREE, own_property, property_identifier
from aerodb.exchange.jsbsim.table import read_table, stack_slices
from aerodb.nomenclature import CHANNELS, is_command, is_surface
from aerodb.support import Array
from aerodb.tables import (
    CONSTANTS,
    FUNCTIONS,
    MAX_DEPTH,
    Expression,
    Name,
    Negation,
    Number,
    Table,
    TableCall,
    number,
    plus,
    times,
)

TEXT: Final = ("description", "documentation", "limitation")
MAX_FUNCTIONS: Final = 10_000
MAX_TOTAL: Final = 5_000_000  # numbers in all tables of a file
_SHORT: Final = {"p": "property", "v": "value", "t": "table"}


class JsbsimFunctions:
    """Functions, tables and properties of one file that have been read."""

    def __init__(self, where: str) -> None:
        self.where = where
        self.identifiers: dict[str, str] = {}  # property -> identifier
        # Property that a function defines -> expression, description.
        self.defined: dict[str, tuple[Expression, str]] = {}
        self.tables: dict[str, Table] = {}
        self._taken: set[str] = {*CHANNELS, *CONSTANTS, *FUNCTIONS}
        self._counts: dict[str, int] = {}
        self._numbers = 0

    def refuse(self, element: Any, parent: str) -> NoReturn:
        """Raise the InputError for an element that is not supported."""
        raise InputError(
            f"unsupported element <{element.tag}> in {parent}",
            self.where,
            "its effect cannot be left out silently",
        )

    def reserve(self, aerodynamics: Any) -> None:
        """Reserve the names of free inputs of an earlier export, before tables can take them."""
        for name in sorted(properties_read(aerodynamics)):
            if name.startswith(OWN_FREE):
                self.identifier(name)

    def constant(self, element: Any) -> None:
        """Read ``<property value="...">name</property>``, a scalar in JSBSim's units. Raises
        InputError for no number."""
        value = read_number(element.get("value", "0"), f"{self.where}: <property>")
        self.defined[(element.text or "").strip()] = (number(value), "constant of the file")

    def computed(self, element: Any, name: str) -> Expression:
        """Return the expression of a function outside the aerodynamics that sets a property.

        Raises InputError for what is not supported.
        """
        return self._tree(self._only_operation(element, name), name)

    def _only_operation(self, element: Any, name: str) -> Any:
        operations = [child for child in element if child.tag not in TEXT]
        if len(operations) != 1:
            raise InputError(
                f"function '{name}' has {len(operations)} operations",
                self.where,
                "exactly one is needed",
            )
        return operations[0]

    def function(self, element: Any) -> str:
        """Read a function; return the property that it defines, in JSBSim's units. Raises
        InputError for what is not supported and for a name that is there already."""
        name = (element.get("name") or f"function-{len(self.defined) + 1}").strip()
        at_cg = element.get("apply_at_cg", "false") != "false"
        known = {"name", "type", "apply_at_cg"}
        if at_cg or set(element.attrib) - known or element.get("type", "pre") != "pre":
            raise InputError(
                f"unsupported attributes of function {name}: {dict(element.attrib)}", self.where
            )
        if len(self.defined) >= MAX_FUNCTIONS:
            raise InputError(f"more than {MAX_FUNCTIONS} functions", self.where)
        if name in self.defined:
            raise InputError(
                f"duplicate function '{name}'",
                self.where,
                "JSBSim refuses it too: rename one of them",
            )
        operation = self._only_operation(element, name)
        description = " ".join(
            " ".join(text.text.split()) for text in element if text.tag in TEXT and text.text
        )
        self.defined[name] = (self._tree(operation, name), description.replace("_", " "))
        return name

    def identifier(self, name: str) -> str:
        """Return the identifier of a property (`property_identifier`), always the same. Raises
        InputError for an empty or too long name."""
        if not name or len(name) > MAX_NAME:
            raise InputError(
                f"a property name of {len(name)} characters",
                self.where,
                f"at least 1, at most {MAX_NAME}",
            )
        if name not in self.identifiers:
            self.identifiers[name] = self.unique(property_identifier(name))
        return self.identifiers[name]

    def unique(self, wanted: str) -> str:
        """Return `wanted` as an unused identifier."""
        base = re.sub(r"\W", "_", wanted, flags=re.ASCII)
        # A name in the form of a surface would be read as that channel, with any number appended.
        channel = is_surface(base) or is_command(base)
        base = f"_{base}" if not base or base[0].isdigit() or channel else base
        name, count = base, self._counts.get(base, 1)
        while name in self._taken:
            count += 1
            name = f"{base}_{count}"
        self._taken.add(name)
        self._counts[base] = count
        return name

    def _tree(self, element: Any, function: str) -> Expression:
        """An expression that is not deeper than the language allows."""
        tree = self._node(element, function)
        if tree.depth > MAX_DEPTH:
            raise InputError(
                f"function '{function}' has {tree.depth} levels",
                self.where,
                f"at most {MAX_DEPTH}: split it",
            )
        return tree

    def _node(self, element: Any, function: str) -> Expression:
        tag = _SHORT.get(element.tag, element.tag)
        if tag == "value":
            return number(read_number(element.text, f"{self.where}: {function}"))
        if tag == "property":
            return self._property((element.text or "").strip())
        if tag == "table":
            return self._inline_table(element, function)
        elements = [child for child in element if child.tag not in TEXT]
        if tag == "interpolate1d":
            return self._interpolation(
                [self._tree(child, function) for child in elements], function
            )
        operation = build_operation(
            tag, [self._node(child, function) for child in elements], f"{self.where}: {function}"
        )
        return operation if operation is not None else self.refuse(element, f"function {function}")

    def _property(self, name: str) -> Expression:
        name = own_property(name)
        if name.startswith("-"):
            return Negation(Name(self.identifier(name[1:])))
        return Name(self.identifier(name))

    def _inline_table(self, element: Any, function: str) -> Expression:
        if set(element.attrib) - {"name"}:
            raise InputError(
                f"unsupported attributes of a table: {dict(element.attrib)}",
                f"{self.where}: {function}",
            )
        inline = read_table(element, f"{self.where}: {function}")
        arguments = tuple(self._property(each) for each in inline.properties)
        call = self._table(
            function, arguments, inline.properties, inline.breakpoints, inline.values
        )
        if element.get("name"):
            self.defined[element.get("name")] = (call, f"table of {function}")
        return call

    def _table(
        self,
        function: str,
        arguments: tuple[Expression, ...],
        labels: tuple[str, ...],
        axes: tuple[Array, ...],
        values: Array,
    ) -> TableCall:
        self._numbers += values.size
        if self._numbers > MAX_TOTAL:
            raise InputError(
                f"tables of more than {MAX_TOTAL} numbers",
                self.where,
                "their slices have different breakpoints",
            )
        name = self.unique(function.rsplit("/", 1)[-1])
        try:
            self.tables[name] = Table(name, labels, axes, values)
        except InputError as error:
            raise InputError(error.what, f"{self.where}: {error.where}", error.remedy) from None
        return TableCall(name, arguments)

    def _interpolation(self, children: list[Expression], function: str) -> Expression:
        """Read ``interpolate1d``: x, then pairs of breakpoint and value.

        It is linear in between and holds its end values.

        Tables at the breakpoints become one table with one more axis. Other values are weighted by
        interpolation weights, which are a table of unit vectors.
        """
        where = f"{self.where}: {function}"
        if len(children) < 5 or len(children) % 2 == 0:
            raise InputError(
                f"<interpolate1d> with {len(children)} operands",
                where,
                "x and at least two pairs are needed",
            )
        x, levels = children[0], np.array([_constant(level, where) for level in children[1::2]])
        ordinates, label = children[2::2], str(x)
        calls = [each for each in ordinates if isinstance(each, TableCall)]
        if (
            len(calls) == len(ordinates) == len({call.table for call in calls})
            and len({c.arguments for c in calls}) == 1
        ):
            parts = [self.tables.pop(call.table) for call in calls]
            axes, values = stack_slices(
                levels, [(part.breakpoints, part.values) for part in parts], where
            )
            return self._table(
                function, (*calls[0].arguments, x), (*parts[0].arguments, label), axes, values
            )
        indices = np.arange(levels.size, dtype=np.float64)
        weights = self._table(
            function, (x, Number(0)), (label, "index"), (levels, indices), np.eye(levels.size)
        )
        return reduce(
            plus,
            [times(TableCall(weights.table, (x, Number(k))), y) for k, y in enumerate(ordinates)],
        )


def properties_read(element: Any) -> set[str]:
    """Return the properties that the elements of a function read."""
    elements = element.iter("property", "p", "independentVar")
    return {(each.text or "").strip().removeprefix("-") for each in elements}


def _constant(expression: Expression, where: str) -> float:
    if isinstance(expression, Number):
        return expression.value
    if isinstance(expression, Negation) and isinstance(expression.operand, Number):
        return -expression.operand.value
    raise InputError("breakpoints of <interpolate1d> must be numbers", where)
