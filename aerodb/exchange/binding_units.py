"""Units of bindings: what an expression of channels is in, beside the unit of the input it binds.

Names of channels carry their SI unit; a number as a factor states a conversion, so that only the
dimension of what contains one is checked.
"""

from collections.abc import Sequence
from typing import Final

from aerodb.errors import InputError, OpenQuestionsError, Question, UnknownNameError
from aerodb.nomenclature import channel
from aerodb.tables import Call, Expression, Name, Negation, Number, Operation
from aerodb.units import conversion

_CONSTANTS: Final = {"S_ref": "m^2", "c_ref": "m", "b_ref": "m"}
#: Functions whose result is in the unit of their first argument.
_KEEP_UNIT: Final = ("abs", "min", "max", "clip")
_NO_UNIT: Final = "dimensionless"


def binding_fault(expression: Expression, unit: str) -> tuple[str, str] | None:
    """Return what is wrong with the unit of a binding, and the expression to bind instead (''
    where there is none); None where nothing is.

    expression : of channels, in SI. unit : of the input, in pint's spelling; one that pint does not
    know is not checked. An unknown unit raises no error here.

    >>> from aerodb.tables import parse
    >>> binding_fault(parse("alpha"), "deg")
    ('alpha is in rad, the input in deg', 'alpha*57.29577951308232')
    >>> binding_fault(parse("alpha*57.3"), "deg") is None
    True
    >>> binding_fault(parse("V"), "deg")
    ('V is in m/s, the input in deg', '')
    """
    found = _unit_of(expression)
    if found is None:
        return None
    given, exact = found
    try:
        conversion(unit, unit)
    except InputError:
        return None
    said = f"{expression} is in {_shown(given)}, the input in {unit or 'no unit'}"
    try:
        scale, offset = conversion(given, unit)
    except InputError:
        return said, ""
    if not exact or (abs(scale - 1.0) < 1e-12 and not offset):
        return None
    without = (given == _NO_UNIT) != (unit in ("", "1"))  # a share of the travel is no angle
    return said, "" if offset or without else str(in_unit(expression, scale))


def binding_question(name: str, fault: tuple[str, str], where: str) -> OpenQuestionsError:
    """Return the question that a `binding_fault` of an input leaves open.

    It is an OpenQuestionsError, for the caller to raise.
    """
    what, instead = fault
    what = f"the binding of {name} is in another unit: {what}"
    proposal = instead or "EXPRESSION in the unit of the file"
    question = Question(what, name, ((proposal, ""),))
    return OpenQuestionsError(what, where, "bind it in the unit of the file", [question])


def raise_together(questions: Sequence[OpenQuestionsError], where: str) -> None:
    """Raise all questions about a file as one OpenQuestionsError, where there are any; see
    `binding_fault`."""
    if not questions:
        return
    what = questions[0].what if len(questions) == 1 else f"{len(questions)} inputs leave a question"
    raise OpenQuestionsError(
        what,
        where,
        "import again with the lines that are right, all in one command:",
        [each for question in questions for each in question.questions],
    )


def in_unit(expression: Expression, scale: float) -> Expression:
    """Return an expression times the scale of a conversion. scale : of a unit, a scalar
    (`conversion`)."""
    return expression if scale == 1.0 else Operation("*", expression, Number(scale))


def _unit_of(expression: Expression) -> tuple[str, bool] | None:
    """Unit of an expression, and whether no number scales it; None where the unit is not known."""
    if isinstance(expression, Name):
        return _unit_of_name(expression.name)
    if isinstance(expression, Negation):
        return _unit_of(expression.operand)
    if isinstance(expression, Call):
        known = expression.function in _KEEP_UNIT
        return _unit_of(expression.arguments[0]) if known else None
    return _unit_of_operation(expression) if isinstance(expression, Operation) else None


def _unit_of_name(name: str) -> tuple[str, bool] | None:
    if name in _CONSTANTS:
        return _CONSTANTS[name], True
    try:
        unit = channel(name).unit
    except UnknownNameError:
        return None
    return (_NO_UNIT if unit in ("", "1") else unit), True


def _unit_of_operation(expression: Operation) -> tuple[str, bool] | None:
    left, right = expression.left, expression.right
    one, other = _unit_of(left), _unit_of(right)
    symbol = expression.operator
    if symbol in "+-":
        return one if isinstance(right, Number) else other if isinstance(left, Number) else one
    if symbol in "*/" and isinstance(right, Number):
        return one and (one[0], False)
    if symbol == "*" and isinstance(left, Number):
        return other and (other[0], False)
    if symbol in "*/" and one and other:
        return f"({one[0]}){symbol}({other[0]})", one[1] and other[1]
    return None


def _shown(unit: str) -> str:
    return "no unit" if unit == _NO_UNIT else unit
