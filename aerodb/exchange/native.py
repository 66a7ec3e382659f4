"""The native forms of a database: a TOML file that people write, and the document that is stored.

The TOML file holds plain handbook derivatives (``[derivatives.CZ]`` with ``alpha = -6.6``), or
variables, tables and terms, or both. Numbers are in SI and rad; text with a unit is converted. The
document is JSON-serialisable and exact: floats are unchanged, expressions are text.
"""

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import MISSING, asdict, fields, replace
from itertools import starmap
from typing import Any, Final
from weakref import WeakKeyDictionary

import numpy as np

from aerodb.errors import InputError, UnknownNameError, nearest, together
from aerodb.exchange.increment_notes import decode_note, note_without_structure
from aerodb.exchange.native_parts import made_of, written_parts
from aerodb.exchange.native_schema import (
    DatabaseFile,
    Document,
    EstimatedFile,
    IncrementFile,
    ParameterFile,
    RefitFile,
    StateFile,
    TableFile,
    UncertaintyFile,
)
from aerodb.nomenclature import axis_description, channel
from aerodb.support import content_sha256, parsed_toml, validated
from aerodb.tables import (
    LAWS,
    AeroDatabase,
    Expression,
    Increment,
    Interval,
    Number,
    Operation,
    Parameter,
    Rate,
    ReferenceGeometry,
    RefinedShape,
    Refit,
    ScatteredTable,
    StateModel,
    Table,
    Term,
    Uncertainty,
    Variable,
    bound_arrays,
    normal,
    number,
    parse,
)
from aerodb.units import conversion

DOCUMENT_FORMAT: Final = 1


def read_native(
    text: str, where: str = "database file", reference: Mapping[str, Any] | None = None
) -> AeroDatabase:
    """Return the database of a TOML text (docs/reference/conventions.md, section "Database file"),
    in SI units.

    reference : keys of [reference] where the text has none.
    Raises InputError that names the key and, for a mistyped name, the nearest valid one.
    Breakpoints that do not increase and shapes that do not match are refused.
    """
    known = {} if reference is None else {"reference": reference}
    file = validated(DatabaseFile, known | entries(text, where), where)
    if not file.terms and not file.derivatives and not file.parts:
        raise InputError(
            "neither terms nor derivatives nor parts",
            where,
            "write [[terms]], [derivatives.<axis>] or [parts.<name>]",
        )
    return _database(file, (), where)


def entries(text: str, where: str) -> dict[str, Any]:
    """Return the keys of a TOML text, in the units of the text; states as a list. InputError where
    it is not TOML."""
    data = parsed_toml(text, where)
    if isinstance(data.get("states"), dict):  # [states.NAME], each with a rate
        named = data["states"].items()
        data["states"] = [
            {"law": "rate", **entry, "name": name} if isinstance(entry, dict) else entry
            for name, entry in named
        ]
    return data


def _database(file: DatabaseFile, increments: tuple[Increment, ...], where: str) -> AeroDatabase:
    try:
        terms = [
            Term(t.name, t.axis, _parsed(t.expression, f"term {t.name}"), t.description)
            for t in file.terms
        ]
        terms += [
            term
            for axis, entries in file.derivatives.items()
            for term in _derivative_terms(axis, entries)
        ]
        reference = ReferenceGeometry(**dict(file.reference))
        variables = _variables(file)
        rates = {s.name: s.description or s.name for s in file.states if s.law == "rate"}
        free = {**rates, **file.free_inputs}
        known = {
            **dict.fromkeys((*file.tables, *file.scattered), "a table"),
            **dict.fromkeys(free, "a free input"),
            **dict.fromkeys(variables, "a variable"),
            **dict.fromkeys(file.parameters, "a parameter"),
        }
        of_parts, loads = made_of(file.parts, reference, known)
        return AeroDatabase(
            name=file.name,
            reference=reference,
            variables={**variables, **of_parts},
            tables=dict(zip(file.tables, starmap(_table, file.tables.items()), strict=True)),
            scattered={
                name: ScatteredTable(
                    name,
                    t.arguments,
                    np.array(t.points),
                    np.array(t.values),
                    _uncertainty(t.uncertainty),
                )
                for name, t in file.scattered.items()
            },
            terms=(*terms, *loads),
            increments=increments,
            states=tuple(_state(entry) for entry in file.states),
            free_inputs=free,
            description=file.description,
            source=file.source,
            parts=file.parts,
        )
    except InputError as error:
        location = f"{where}: {error.where}" if error.where else where
        raise InputError(error.what, location, error.remedy) from error


def _variables(file: DatabaseFile) -> dict[str, Variable]:
    twice = sorted(file.parameters.keys() & file.variables.keys())
    if twice:
        raise InputError(
            f"'{twice[0]}' is a parameter and a variable", "", "choose another name for one"
        )
    parameters, wrong = {}, []
    for name, p in file.parameters.items():
        try:
            parameters[name] = Variable(
                number(float(p.value)),
                p.unit,
                p.description,
                uncertainty=None if p.prior_sigma is None else normal(p.prior_sigma),
                parameter=_told(p),
            )
        except InputError as error:
            wrong.append(InputError(error.what, f"[parameters] {name}", error.remedy))
    if wrong:
        raise together(wrong)
    return parameters | {
        name: Variable(
            _parsed(v.expression, f"variable {name}"),
            v.unit,
            v.description,
            v.declared,
            _uncertainty(v.uncertainty),
            None if v.parameter is None else _estimated(v.parameter),
        )
        for name, v in file.variables.items()
    }


def _told(file: ParameterFile) -> Parameter:
    """The parameter of an entry; InputError for bounds [its unit] that exclude its value."""
    theory = None if file.theory is None else float(file.theory)
    if file.bounds is None:
        return Parameter(theory=theory)
    told = Parameter((float(file.bounds[0]), float(file.bounds[1])), theory=theory)
    told.check(float(file.value))
    return told


def _estimated(file: EstimatedFile) -> Parameter:
    low, high = file.bounds
    return Parameter(
        (-np.inf if low is None else low, np.inf if high is None else high),
        file.flights,
        file.flown,
        file.theory,
    )


def _parameter_document(parameter: Parameter | None) -> dict[str, Any]:
    """The entry ``parameter`` of a variable; empty if it is none."""
    if parameter is None:
        return {}
    bounds = [bound if np.isfinite(bound) else None for bound in parameter.bounds]
    estimated = {
        **({"flights": list(parameter.flights)} if parameter.flights else {}),
        **({"flown": {n: list(v) for n, v in parameter.flown.items()}} if parameter.flown else {}),
        **({} if parameter.theory is None else {"theory": parameter.theory}),
    }
    return {"parameter": {"bounds": bounds, **estimated}}


def _parsed(text: str, where: str) -> Expression:
    try:
        return parse(text)
    except InputError as error:
        raise InputError(error.what, where, error.remedy) from None


def _table(name: str, file: TableFile) -> Table:
    where = f"table {name}"
    units = file.units or ("",) * len(file.arguments)
    if len(units) != len(file.breakpoints):
        raise InputError(f"{len(units)} units for {len(file.breakpoints)} breakpoint lists", where)
    axes = []
    for argument, unit, axis in zip(file.arguments, units, file.breakpoints, strict=False):
        scale, offset = conversion(unit, _si(argument)) if unit else (1.0, 0.0)
        axes.append(np.array(axis) * scale + offset)
    try:
        values = np.array(file.values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("values are not a rectangular list of numbers", where) from None
    return Table(
        name,
        file.arguments,
        tuple(axes),
        values,
        file.interpolation,
        file.extrapolation,
        _uncertainty(file.uncertainty),
        extent=file.extent,
    )


def _uncertainty(file: UncertaintyFile | None) -> Uncertainty | None:
    return None if file is None else Uncertainty(**dict(file))


def _si(argument: str) -> str:
    """SI unit of a table argument: that of the channel of this name, otherwise rad."""
    try:
        return channel(argument).unit
    except UnknownNameError:
        return "rad"


def _state(file: StateFile) -> StateModel:
    where = f"state {file.name}"
    if (file.law == "rate") != bool(file.rate):
        raise InputError("a state has a law or a rate", where, 'for example rate = "(1 - x)/0.2"')
    if file.law == "rate":
        law = Rate(_parsed(file.rate, f"states.{file.name} rate"), float(file.initial), file.unit)
        return StateModel(file.name, law, file.description)
    kind = LAWS[file.law]
    known = [item.name for item in fields(kind)]
    for name, value in file.parameters.items():
        if name not in known:
            raise InputError(f"{file.law} has no parameter '{name}'", where, nearest(name, known))
        if isinstance(value, tuple) != (name in ("breakpoints", "attached")):
            raise InputError(
                f"{name} is {value}",
                where,
                "breakpoints and attached are lists, all others numbers",
            )
    needed = [item.name for item in fields(kind) if item.default is MISSING]
    absent = [name for name in needed if name not in file.parameters]
    if absent:
        raise InputError(
            f"{file.law} lacks {', '.join(absent)}", where, "give them in its parameters"
        )
    return StateModel(file.name, kind(**file.parameters), file.description)  # type: ignore[arg-type]


def _state_document(state: StateModel) -> dict[str, Any]:
    if isinstance(state.law, Rate):
        return {
            "name": state.name,
            "law": "rate",
            "rate": str(state.law.rate),
            "initial": state.law.initial,
            "unit": state.law.unit,
            "description": state.description,
        }
    parameters = {
        name: list(x) if isinstance(x, tuple) else float(x) for name, x in asdict(state.law).items()
    }
    law = next(name for name, kind in LAWS.items() if isinstance(state.law, kind))
    return {
        "name": state.name,
        "law": law,
        "parameters": parameters,
        "description": state.description,
    }


def _derivative_terms(axis: str, entries: Mapping[str, float]) -> list[Term]:
    """Terms ``value * regressor`` of handbook derivatives.

    The regressor ``1`` is the constant, named ``<axis>_0``.
    """
    try:
        axis_description(axis)
    except UnknownNameError as error:
        raise InputError(error.what, f"[derivatives.{axis}]", error.remedy) from None
    terms = []
    for regressor, value in entries.items():
        tree = _parsed(regressor, f"[derivatives.{axis}]")
        if isinstance(tree, Number) and tree.value != 1.0:
            raise InputError(
                f"the key '{regressor}' would multiply {value:g} by {tree.value:g}",
                f"[derivatives.{axis}]",
                'the constant has the key "1"',
            )
        if isinstance(tree, Number):
            terms.append(Term(f"{axis}_0", axis, number(value)))
        else:
            suffix = re.sub(r"\W+", "_", regressor).strip("_")
            terms.append(Term(f"{axis}_{suffix}", axis, Operation("*", number(value), tree)))
    return terms


def to_document(database: AeroDatabase) -> dict[str, Any]:
    """Return `database`, increments included, as JSON-serialisable values.

    `from_document` gives back an equal database. Values are in SI units; arrays keep their shape as
    nested lists.
    """
    reference = database.reference
    parts = written_parts(database)
    return {
        "format": DOCUMENT_FORMAT,
        "name": database.name,
        "description": database.description,
        "source": database.source,
        "reference": {
            "area": reference.area,
            "chord": reference.chord,
            "span": reference.span,
            "moment_reference": list(reference.moment_reference),
            **({} if reference.pressure is None else {"pressure": reference.pressure}),
        },
        "free_inputs": dict(database.free_inputs),
        "variables": {
            name: {
                "expression": str(v.expression),
                "unit": v.unit,
                "description": v.description,
                **({"declared": dict(v.declared)} if v.declared else {}),
                **_uncertainty_document(v.uncertainty),
                **_parameter_document(v.parameter),
            }
            for name, v in database.variables.items()
            if not (parts and v.part)
        },
        **({"parts": parts} if parts else {}),
        "tables": {
            name: {
                "arguments": list(table.arguments),
                "breakpoints": [axis.tolist() for axis in table.breakpoints],
                "values": table.values.tolist(),
                **(
                    {"extent": [bounds and list(bounds) for bounds in table.extent]}
                    if table.extent
                    else {}
                ),
                **({"interpolation": list(table.interpolation)} if table.interpolation else {}),
                **({"extrapolation": list(table.extrapolation)} if table.extrapolation else {}),
                **_uncertainty_document(table.uncertainty),
            }
            for name, table in database.tables.items()
        },
        **(
            {"scattered": {n: _scattered_document(t) for n, t in database.scattered.items()}}
            if database.scattered
            else {}
        ),
        "terms": [
            {
                "name": t.name,
                "axis": t.axis,
                "expression": str(t.expression),
                "description": t.description,
            }
            for t in database.terms
            if not (parts and t.part)
        ],
        "increments": [_increment_document(increment) for increment in database.increments],
        **(
            {"states": [_state_document(state) for state in database.states]}
            if database.states
            else {}
        ),
    }


def _scattered_document(table: ScatteredTable) -> dict[str, Any]:
    document = {
        "arguments": list(table.arguments),
        "points": table.points.tolist(),
        "values": table.values.tolist(),
    }
    return {**document, **_uncertainty_document(table.uncertainty)}


def _uncertainty_document(uncertainty: Uncertainty | None) -> dict[str, Any]:
    """The entry ``uncertainty``; empty if there is none."""
    if uncertainty is None:
        return {}
    document = {
        "effect": uncertainty.effect,
        "distribution": uncertainty.distribution,
        "bounds": [
            list(bound) if isinstance(bound, tuple) else bound for bound in uncertainty.bounds
        ],
        "sigmas": uncertainty.sigmas,
        "correlates_with": list(uncertainty.correlates_with),
        "correlations": [list(pair) for pair in uncertainty.correlations],
    }
    return {"uncertainty": document}


def _increment_document(increment: Increment) -> dict[str, Any]:
    return {
        "axis": increment.axis,
        "regressors": [str(regressor) for regressor in increment.regressors],
        "estimates": increment.estimates.tolist(),
        "covariance": increment.covariance.tolist(),
        "envelope": {
            name: {"low": i.low, "high": i.high, "cell": i.cell}
            for name, i in increment.envelope.items()
        },
        "flights": list(increment.flights),
        "note": increment.full_note,
        **({"folded": list(increment.folded)} if any(increment.folded) else {}),
        **({"refit": _refit_document(increment.refit)} if increment.refit is not None else {}),
        **({"lengthened_cells": increment.lengthened_cells} if increment.lengthened_cells else {}),
        **({} if increment.induces_drag else {"induces_drag": False}),
        **({} if increment.margins is None else {"margins": dict(increment.margins)}),
    }


#: Keys of an increment whose content the note repeats in words.
_REPEATED_IN_NOTE: Final = frozenset({"refit", "lengthened_cells"})


def _refit_document(refit: Refit) -> dict[str, Any]:
    return {
        "shapes": [{**asdict(shape), "variables": list(shape.variables)} for shape in refit.shapes]
    }


def database_document_sha256(database: AeroDatabase) -> str:
    """Return the sha256 of everything in a database (`to_document`, sorted keys), expressions
    included.

    Results computed with a database are stored under this hash. It leaves out the fields that the
    notes of increments repeat in words, so that the hashes of documents that have only notes do not
    change.
    """
    if database not in _DOCUMENT_HASHES:
        document = to_document(database)
        increments = [
            {key: value for key, value in each.items() if key not in _REPEATED_IN_NOTE}
            for each in document["increments"]
        ]
        text = json.dumps({**document, "increments": increments}, sort_keys=True)
        _DOCUMENT_HASHES[database] = hashlib.sha256(text.encode("utf-8")).hexdigest()
    return _DOCUMENT_HASHES[database]


#: Hashes are cached because databases are immutable.
_DOCUMENT_HASHES: WeakKeyDictionary[AeroDatabase, str] = WeakKeyDictionary()


def from_document(document: Mapping[str, Any], where: str = "stored database") -> AeroDatabase:
    """Return the database of a `to_document` result. Raises InputError for anything else."""
    file = validated(Document, dict(document), where)
    if file.format != DOCUMENT_FORMAT:
        raise InputError(
            f"format {file.format}", where, f"this version reads format {DOCUMENT_FORMAT}"
        )
    return _database(file, tuple(_increment(item, where) for item in file.increments), where)


def _increment(file: IncrementFile, where: str) -> Increment:
    bare = Increment(
        axis=file.axis,
        regressors=tuple(
            _parsed(text, f"{where}: increment on {file.axis}") for text in file.regressors
        ),
        estimates=np.array(file.estimates),
        covariance=np.array(file.covariance),
        envelope={name: Interval(i.low, i.high, i.cell) for name, i in file.envelope.items()},
        flights=file.flights,
        folded=file.folded,
        refit=_refit(file.refit),
        lengthened_cells=file.lengthened_cells,
        induces_drag=file.induces_drag,
        margins=file.margins,
    )
    if bare.full_note:
        return replace(bare, note=note_without_structure(file.note, bare))
    note = decode_note(file.note)
    return replace(bare, note=note.text, refit=note.refit, lengthened_cells=note.lengthened_cells)


def _refit(file: RefitFile | None) -> Refit | None:
    return (
        None
        if file is None
        else Refit(tuple(RefinedShape(**shape.model_dump()) for shape in file.shapes))
    )


def database_content_sha256(database: AeroDatabase) -> str:
    """Return the sha256 of the numbers of a database (float64, little-endian, SI units;
    `content_sha256` of their arrays).

    The numbers are the reference, the tables by name, the increments and the states in order. The
    hash protects the stored numbers; the key of the version's document protects expressions and
    texts.
    """
    reference = database.reference
    arrays = [
        np.array([reference.area, reference.chord, reference.span, *reference.moment_reference])
    ]
    if reference.pressure is not None:
        arrays.append(np.array([reference.pressure]))
    for name in sorted(database.tables):
        arrays += [*database.tables[name].breakpoints, database.tables[name].values]
    for name in sorted(database.scattered):
        arrays += [database.scattered[name].points, database.scattered[name].values]
    carriers: dict[str, Any] = {**database.tables, **database.scattered, **database.variables}
    arrays += [
        bounds for name in sorted(carriers) for bounds in bound_arrays(carriers[name].uncertainty)
    ]
    for increment in database.increments:
        bounds = [[i.low, i.high, i.cell] for _, i in sorted(increment.envelope.items())]
        arrays += [
            increment.estimates,
            increment.covariance,
            np.array(bounds, dtype=np.float64).reshape(-1, 3),
        ]
        if increment.margins is not None:
            arrays.append(np.array([m for _, m in sorted(increment.margins.items())]))
    for state in database.states:
        if isinstance(state.law, Rate):
            arrays.append(np.array([state.law.initial]))
            continue
        parameters = _state_document(state)["parameters"]
        arrays += [
            np.atleast_1d(np.array(parameters[name], dtype=np.float64))
            for name in sorted(parameters)
        ]
    return content_sha256(arrays)
