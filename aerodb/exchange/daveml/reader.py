"""Read DAVE-ML 2.0 (AIAA S-119): variables, calculations and tables become an AeroDatabase.

Variables keep the file's own units. `aerodb.exchange.daveml.model` relates inputs to channels and
outputs to coefficients. Metadata (header, provenance, descriptions) are kept as text. Anything that
is not understood is refused by name.
"""

import math
import re
from collections.abc import Mapping
from typing import Any, Final

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.daveml.mathml import read_math
from aerodb.exchange.daveml.model import DavemlSignal, Model
from aerodb.exchange.daveml.names import Declaration
from aerodb.exchange.daveml.root_element import read_root
from aerodb.exchange.daveml.tables import (
    METADATA,
    Argument,
    Grid,
    TableReader,
    UngriddedTable,
    limited,
    read_argument,
    read_breakpoints,
    read_point_lists,
)
from aerodb.exchange.xml_elements import children, find, number, plain, required, tag, unsupported
from aerodb.tables import (
    AeroDatabase,
    Expression,
    ReferenceGeometry,
    ScatteredTable,
    Table,
    TableCall,
)
from aerodb.tables import number as constant

_ROLES: Final = (
    "isInput",
    "isControl",
    "isDisturbance",
    "isState",
    "isStateDeriv",
    "isOutput",
    "isStdAIAA",
)
_GIVEN: Final = ("isInput", "isControl", "isDisturbance")
_ATTRIBUTES: Final = {
    "name": "name",
    "sign": "sign",
    "symbol": "symbol",
    "axisSystem": "axis_system",
    "alias": "alias",
}
_TABLES: Final = ("griddedTableDef", "griddedTable", "ungriddedTableDef", "ungriddedTable")
_TABLE_REFERENCES: Final = {"griddedTableRef": "gtID", "ungriddedTableRef": "utID"}


def import_daveml(
    xml: bytes,
    *,
    name: str = "",
    bindings: Mapping[str, str] | None = None,
    reference: ReferenceGeometry | None = None,
) -> AeroDatabase:
    """Return the aerodynamics of a DAVE-ML file.

    xml : content of the file. name : of the database; shown in errors. reference : replaces that of
    the file. bindings : take precedence over standard names; they map

    - an input (id or name) to an expression of channels and S_ref, c_ref, b_ref, in the file's own
      unit and sign;
    - an axis (CX .. Cn, C_drag, C_side, C_lift) to an expression of the file's variables;
    - S_ref, c_ref, b_ref to a number in m2 or m.

    An input that is neither bound nor a channel becomes a free input of the database, in the file's
    unit. Lift and drag are in stability axes if the side force is in body axes, and in wind axes if
    the side force is in wind axes.

    Raises InputError for XML with entities or declarations, elements outside the standard's set (by
    name), undefined names, and files without reference geometry or without an output that is a
    coefficient.
    """
    reading = _FileReader(name or "DAVE-ML file", dict(bindings or {}))
    reading.read(read_root(xml, reading.where))
    return reading.model.database(reference)


class _FileReader:
    """What has been found so far in the elements of one file."""

    def __init__(self, where: str, bindings: dict[str, str]) -> None:
        self.where = where
        self.model = Model(where, bindings)
        self._definitions: dict[str, Any] = {}  # variableDef by id
        self._breakpoints: dict[str, Any] = {}
        self._tables: dict[str, Grid | UngriddedTable] = {}  # by gtID or utID
        self._converted: dict[Any, str] = {}  # table and its modes -> name in the database
        self._reader = TableReader(self._breakpoints, self._refer, self._declare_inner)

    def read(self, root: Any) -> None:
        """Read all elements, which may be in any order."""
        parts: dict[str, list[Any]] = {}
        for child in children(root):
            parts.setdefault(tag(child), []).append(child)
        known = (
            "fileHeader",
            "variableDef",
            "breakpointDef",
            *_TABLES,
            "function",
            "checkData",
            *METADATA,
        )
        for kind, elements in parts.items():
            if kind not in known:
                raise unsupported(elements[0], "<DAVEfunc>", self.where)
        self.model.header = "; ".join(plain(element) for element in parts.get("fileHeader", []))
        for element in parts.get("variableDef", []):
            self._declare(element)
        for element in parts.get("breakpointDef", []):
            identity = required(element, "bpID", self.where)
            self._new(identity, self._breakpoints, "breakpointDef")
            self._breakpoints[identity] = read_breakpoints(element, f"{self.where}: {identity}")
        for kind, attribute in (("griddedTableDef", "gtID"), ("ungriddedTableDef", "utID")):
            for element in parts.get(kind, []):
                identity = (element.get(attribute) or required(element, "name", self.where)).strip()
                self._new(identity, self._tables, kind)
                self._tables[identity] = self._table(element, identity)
        for element in parts.get("function", []):
            self._function(element)
        for identity, element in list(self._definitions.items()):
            self._define(identity, element)
        used = {key[0] for key in self._converted}
        for identity in self._tables:
            if identity not in used:
                self._convert_table(
                    identity,
                    self._tables[identity],
                    [Argument(f"x{k}") for k in range(_dimensions(self._tables[identity]))],
                )

    def _new(self, identity: str, known: Mapping[str, Any], kind: str) -> None:
        if identity in known:
            raise InputError(f"duplicate {kind} '{identity}'", self.where, "use each id once")

    def _declare(self, element: Any) -> str:
        """Add a variableDef; return its identifier in the database."""
        identity = required(element, "varID", self.where)
        self._new(identity, self._definitions, "variableDef")
        for child in children(element):
            if tag(child) not in (*METADATA, "calculation", "uncertainty", *_ROLES):
                raise unsupported(child, f"variableDef {identity}", self.where)
        self._definitions[identity] = element
        declared = Declaration(
            identity,
            (element.get("name") or identity).strip(),
            (element.get("units") or "nd").strip(),
            (element.get("sign") or "").strip(),
        )
        roles = tuple(child for child in map(tag, children(element)) if child in _ROLES)
        note = " ".join(plain(find(element, "description")).split())
        notes = {key: element.get(a, "").strip() for a, key in _ATTRIBUTES.items()}
        notes["provenance"] = plain(find(element, "provenance", "provenanceRef"))
        initial = element.get("initialValue")
        value = None if initial is None else number(initial, f"{self.where}: {identity}")
        return self.model.declare(
            DavemlSignal(
                declared, roles, note, {k: text for k, text in notes.items() if text}, value
            )
        )

    def _declare_inner(self, element: Any) -> str:
        """Add a variableDef inside an uncertainty's bounds as one of the file."""
        name = self._declare(element)
        identity = required(element, "varID", self.where)
        self._define(identity, element)
        return name

    def _refer(self, identity: str) -> str:
        """Name in the database of a variable or a table by its id."""
        if identity in self._definitions:
            return self.model.identifier(identity)
        if identity in self._tables:
            return re.sub(r"\W", "_", identity, flags=re.ASCII)
        raise InputError(f"no variable or table has the id '{identity}'", self.where)

    def _table(self, element: Any, identity: str) -> Grid | UngriddedTable:
        where = f"{self.where}: {identity}"
        ungridded = tag(element).startswith("ungridded")
        return (
            self._reader.ungridded(element, where)
            if ungridded
            else self._reader.gridded(element, where)
        )

    def _function(self, element: Any) -> None:
        """Define the variable that depends on a function."""
        name = (element.get("name") or f"function {element.sourceline}").strip()
        where = f"{self.where}: function {name}"
        if find(element, "independentVarPts", "dependentVarPts") is not None:
            points = read_point_lists(element, where)
            self._call(points.dependent, name, points.table, points.arguments, where)
            return
        arguments, tables, dependents = [], [], []
        for child in children(element):
            if tag(child) == "independentVarRef":
                arguments.append(read_argument(child, where))
            elif tag(child) == "dependentVarRef":
                dependents.append(required(child, "varID", where))
            elif tag(child) == "functionDefn":
                tables += [each for each in children(child) if tag(each) not in METADATA]
            elif tag(child) not in METADATA:
                raise unsupported(child, f"function {name}", self.where)
        if len(tables) != 1 or len(dependents) != 1:
            raise InputError(
                f"{len(dependents)} dependent variables and {len(tables)} tables",
                where,
                "exactly one of each is needed",
            )
        if tag(tables[0]) in _TABLE_REFERENCES:
            identity = required(tables[0], _TABLE_REFERENCES[tag(tables[0])], where)
            if identity not in self._tables:
                raise InputError(f"no table '{identity}'", where)
        elif tag(tables[0]) in _TABLES:
            identity = (
                tables[0].get("gtID") or tables[0].get("utID") or tables[0].get("name") or name
            ).strip()
            if identity in self._tables:
                identity = f"{identity} of {name}"
            self._tables[identity] = self._table(tables[0], identity)
        else:
            raise unsupported(tables[0], f"function {name}", self.where)
        self._call(dependents[0], identity, self._tables[identity], arguments, where)
        note = plain(find(element, "description"))
        self.model.annotate(dependents[0], " ".join(note.split()))

    def _call(
        self,
        dependent: str,
        identity: str,
        table: Grid | UngriddedTable,
        arguments: list[Argument],
        where: str,
    ) -> None:
        if len(arguments) != _dimensions(table):
            raise InputError(
                f"{len(arguments)} independent variables for a table of {_dimensions(table)}", where
            )
        values = []
        for k, argument in enumerate(arguments):
            nodes = table.breakpoints[k] if isinstance(table, Grid) else table.points[:, k]
            first, last = (
                (float(nodes.min()), float(nodes.max()))
                if isinstance(table, Grid)
                else (-math.inf, math.inf)
            )
            values.append(argument.limited(self._resolve(argument.identity, where), first, last))
        name = self._convert_table(identity, table, arguments)
        self.model.define(dependent, TableCall(name, tuple(values)), where)

    def _convert_table(
        self, identity: str, table: Grid | UngriddedTable, arguments: list[Argument]
    ) -> str:
        """Convert a table and return its name in the database.

        Functions that use a table in the same way share it.
        """
        interpolation = tuple(argument.interpolation for argument in arguments)
        extrapolation = tuple(argument.extrapolation for argument in arguments)
        key = (identity, interpolation, extrapolation)
        if key in self._converted:
            return self._converted[key]
        name = self._converted[key] = self.model.unique(identity)
        labels = tuple(argument.identity for argument in arguments)
        try:
            if isinstance(table, Grid):
                gridded = Table(
                    name,
                    labels,
                    table.breakpoints,
                    table.values,
                    interpolation,
                    extrapolation,
                    table.uncertainty,
                )
                self.model.tables[name] = gridded
            elif {*interpolation, *extrapolation} != {"linear", "neither"}:
                raise InputError(
                    "unsupported interpolate or extrapolate",
                    f"ungridded table {identity}",
                )
            elif len(labels) == 1:
                order = np.argsort(table.points[:, 0], kind="stable")
                gridded = Table(
                    name,
                    labels,
                    (table.points[order, 0],),
                    table.values[order],
                    uncertainty=table.uncertainty,
                )
                self.model.tables[name] = gridded
            else:
                self.model.scattered[name] = ScatteredTable(
                    name, labels, table.points, table.values, table.uncertainty
                )
        except InputError as error:
            raise InputError(error.what, f"{self.where}: {error.where}", error.remedy) from None
        return name

    def _resolve(self, identity: str, where: str) -> Expression:
        if identity not in self._definitions:
            raise InputError(f"no variableDef '{identity}'", where)
        return self.model.value(identity)

    def _define(self, identity: str, element: Any) -> None:
        """Set the calculation, constant or limits of a variable."""
        where = f"{self.where}: {identity}"
        calculation = find(element, "calculation")
        if calculation is not None:
            inner = [child for child in children(calculation) if tag(child) not in METADATA]
            if len(inner) != 1 or tag(inner[0]) != "math":
                raise InputError("<calculation> without one <math>", where)
            self.model.define(
                identity, read_math(inner[0], lambda each: self._resolve(each, where), where), where
            )
        ends = [element.get(each) for each in ("minValue", "maxValue")]
        low, high = (
            number(text, where) if text else end
            for text, end in zip(ends, (-math.inf, math.inf), strict=True)
        )
        if low > high:
            raise InputError(f"minValue {low:g} exceeds maxValue {high:g}", where)
        given = any(find(element, role) is not None for role in _GIVEN)
        value = self.model.signals[identity].initial
        if value is not None and not given and not self.model.defined(identity):
            self.model.define(identity, constant(value), where)
        if math.isfinite(low) or math.isfinite(high):
            self.model.limits[identity] = lambda raw: limited(raw, low, high)
        uncertainty = self._reader.uncertainty(find(element, "uncertainty"), where)
        if uncertainty is not None:
            self.model.uncertainties[identity] = uncertainty


def _dimensions(table: Grid | UngriddedTable) -> int:
    return len(table.breakpoints) if isinstance(table, Grid) else int(table.points.shape[1])
