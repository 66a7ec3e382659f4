"""Write an AeroDatabase as DAVE-ML 2.0 (AIAA S-119) that its receiver can check.

Inputs are channels in SI with this product's signs. Outputs are the six coefficients in body axes
about the stated moment reference, and those of hinge moments. Variables and tables keep the ids,
names and units of their import. Increments become calculations that give the same values inside
their envelope and beyond it; state models become their steady values. Covariance, flights and
memory are not exported, because DAVE-ML cannot hold them.
"""

from functools import reduce
from typing import Final

import numpy as np

from aerodb.errors import InputError
from aerodb.exchange.daveml.check_cases import (
    CheckSignal,
    SignalEvaluator,
    StaticShot,
    verify_cases,
)
from aerodb.exchange.daveml.document import DavemlDocument
from aerodb.exchange.daveml.model import hat_rate_expression
from aerodb.exchange.daveml.names import (
    POSITION_SIGNS,
    POSITIONS,
    REFERENCES,
    STANDARD_OUTPUTS,
    Declaration,
    output_axis,
)
from aerodb.exchange.daveml.reader import import_daveml
from aerodb.exchange.increment_terms import with_increments_as_terms
from aerodb.exchange.state_terms import without_states
from aerodb.nomenclature import FORCE_AXES
from aerodb.tables import (
    CONSTANTS,
    HAT_RATES,
    LOAD_AXES,
    WIND_AXES,
    AeroDatabase,
    Expression,
    Name,
    Negation,
    Number,
    Operation,
    Term,
    as_coefficient,
    coefficient_axis,
    make_check_cases,
    parse,
    plus,
    summed,
)

_TOLERANCE: Final = 1e-9  # of max(|C|, 1e-3): what the receiving program must achieve
_FILL: Final = 0.1  # value of an input that no coefficient depends on


def export_daveml(
    database: AeroDatabase, *, check_cases: int = 25, created: str = "", author: str = ""
) -> bytes:
    """Return `database` as the bytes of a DAVE-ML file.

    check_cases : number of check cases to write. created : date, YYYY-MM-DD. author : name.

    The file is read back and must pass its own check cases before it is returned.

    Raises InputError if a check case fails: this database cannot be exported exactly.
    """
    flat = with_increments_as_terms(without_states(database))
    document = _written(flat, created, author)
    again = import_daveml(document.to_bytes(), name=database.name)
    cases = _cases(flat, again, document, check_cases)
    document.write_cases(cases)
    failed = [failure for result in verify_cases(again, cases) for failure in result.failures]
    if failed:
        raise InputError(
            f"the exported file fails a check case: {failed[0]}", f"database {database.name}"
        )
    return document.to_bytes()


def _written(database: AeroDatabase, created: str, author: str) -> DavemlDocument:
    document = DavemlDocument(database, created, author)
    for key, attribute in CONSTANTS.items():
        name = next(standard for standard, known in REFERENCES.items() if known == attribute)
        unit = "m2" if attribute == "area" else "m"
        note = f"reference {attribute}"
        document.add_variable(
            key,
            name,
            unit,
            note,
            Number(getattr(database.reference, attribute)),
            roles=("isOutput", "isStdAIAA"),
        )
    for k, name in enumerate(POSITIONS):
        note = "moment reference from the vehicle's datum, body axes (x forward, y right, z down)"
        value = database.reference.moment_reference[k]
        expression: Expression = Negation(Number(-value)) if value < 0 else Number(value)
        sign = POSITION_SIGNS[k][0].split()[0]
        document.add_variable(
            f"moment_reference_{'xyz'[k]}",
            name,
            "m",
            note,
            expression,
            ("isOutput", "isStdAIAA"),
            {"sign": sign},
        )
    totals = _totals(database)
    names = {name for v in database.variables.values() for name in v.expression.names}
    names |= {name for term in database.terms for name in term.expression.names} | set(
        database.inputs
    )
    names |= {"alpha", "beta"} if any(axis in totals for axis in WIND_AXES) else set()
    hats = sorted(names & set(HAT_RATES))
    names |= {rate for hat in hats for rate in (HAT_RATES[hat][0], "V")}
    for name in sorted(names - set(database.variables) - set(CONSTANTS) - set(hats)):
        document.add_input(name)
    for hat in hats:
        rate, length = HAT_RATES[hat]
        constant = next(key for key, attribute in CONSTANTS.items() if attribute == length)
        document.add_variable(
            hat, hat, "nd", "rate without dimension", hat_rate_expression(rate, constant)
        )
    outputs = {axis: _present(axis, total, database) for axis, total in totals.items()}
    for name, variable in database.variables.items():
        document.add_declared(name, variable, output=name in outputs.values())
    _write_outputs(document, database, outputs)
    document.finish()
    return document


def _totals(database: AeroDatabase) -> dict[str, Expression]:
    """For each axis with terms, their sum in order."""
    parts: dict[str, list[Expression]] = {}
    for term in database.terms:
        parts.setdefault(term.axis, []).append(term.expression)
    return {axis: reduce(plus, expressions) for axis, expressions in parts.items()}


def _present(axis: str, total: Expression, database: AeroDatabase) -> str:
    """Name of the variable that is already this total, as after an import; or empty."""
    if axis in (*WIND_AXES, *LOAD_AXES) or any(
        term.axis in WIND_AXES or coefficient_axis(term.axis) == axis != term.axis
        for term in database.terms
    ):
        return ""
    for name, variable in database.variables.items():
        declared = variable.declared
        signal = Declaration(
            declared.get("id", name),
            declared.get("name", ""),
            variable.unit,
            declared.get("sign", ""),
        )
        if variable.expression == total and output_axis(signal, database.name) == (axis, 1):
            return name
    return ""


def _write_outputs(
    document: DavemlDocument, database: AeroDatabase, outputs: dict[str, str]
) -> None:
    """Write a variable per term and the coefficients on the axes of the database.

    Forces in wind axes are transformed to body axes; loads become their share of a coefficient.
    """
    parts: dict[str, list[Expression]] = {
        axis: [] for axis in (*database.axes, *WIND_AXES, *LOAD_AXES)
    }
    for term in database.terms:
        if not outputs[term.axis]:
            parts[term.axis].append(_term(document, database, term))
    if any(parts[axis] for axis in WIND_AXES):
        for axis in WIND_AXES:
            sum_of_terms = reduce(plus, parts[axis]) if parts[axis] else Number(0.0)
            name = document.add_calculation(
                axis, "", "nd", "sum of the terms along this wind axis", sum_of_terms
            )
            parts[axis] = [Name(name)]
        for axis, expression in _wind_to_body(*(parts[axis][0] for axis in WIND_AXES)).items():
            parts[axis].append(expression)
    for axis in LOAD_AXES:
        if parts[axis]:
            unit = "nm" if axis.startswith("M") else "n"
            total = summed(parts[axis])
            name = document.add_calculation(axis, "", unit, "sum of these loads", total)
            parts[coefficient_axis(axis)].append(as_coefficient(axis, Name(name)))
    for axis in database.axes:
        if outputs.get(axis):
            continue
        total = reduce(plus, parts[axis]) if parts[axis] else Number(0.0)
        document.add_calculation(axis, STANDARD_OUTPUTS.get(axis, axis), "nd", "", total, axis=axis)


def _term(document: DavemlDocument, database: AeroDatabase, term: Term) -> Expression:
    """Return a term as a variable of its own, unless it is one already."""
    if isinstance(term.expression, Name) and term.expression.name in database.variables:
        return term.expression
    unit = ("nm" if term.axis.startswith("M") else "n") if term.axis in LOAD_AXES else "nd"
    return Name(
        document.add_calculation(
            term.name, "", unit, term.description or f"term on {term.axis}", term.expression
        )
    )


def _wind_to_body(drag: Expression, side: Expression, lift: Expression) -> dict[str, Expression]:
    """CX, CY, CZ of forces in wind axes, as in `aerodb.tables.reference.wind_to_body`."""
    ca, sa, cb, sb = (
        parse(text) for text in ("cos(alpha)", "sin(alpha)", "cos(beta)", "sin(beta)")
    )
    along = Operation("+", Operation("*", drag, cb), Operation("*", side, sb))
    x = Operation("-", Operation("*", lift, sa), Operation("*", along, ca))
    y = Operation("-", Operation("*", side, cb), Operation("*", drag, sb))
    z = Operation("-", Operation("*", Negation(along), sa), Operation("*", lift, ca))
    return dict(zip(FORCE_AXES, (x, y, z), strict=True))


def _cases(
    database: AeroDatabase, again: AeroDatabase, document: DavemlDocument, count: int
) -> tuple[StaticShot, ...]:
    """Check cases with the coefficients of `database`.

    Internal signals are evaluated from the file as it is read back.
    """
    signals = SignalEvaluator(again)
    cases = []
    for k, case in enumerate(make_check_cases(database, count), start=1):
        inputs = {document.identity(name): case.inputs.get(name, _FILL) for name in document.inputs}
        values = signals.at(inputs)
        outputs = {document.outputs[axis]: case.coefficients[axis] for axis in database.axes}
        cases.append(
            StaticShot(
                f"case {k}",
                tuple(CheckSignal(identity, value) for identity, value in inputs.items()),
                tuple(
                    CheckSignal(i, v)
                    for i, v in values.items()
                    if i in document.identities and np.isfinite(v)
                ),
                tuple(
                    CheckSignal(i, v, _TOLERANCE * max(abs(v), 1e-3)) for i, v in outputs.items()
                ),
            )
        )
    return tuple(cases)
