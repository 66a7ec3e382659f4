"""Algebra on expressions: sums, products, exact division by a factor, and replaced names."""

from collections.abc import Mapping

from aerodb.tables.expression import Call, Expression, Name, Negation, Number, Operation, TableCall


def substituted(expression: Expression, names: Mapping[str, Expression]) -> Expression:
    """Return `expression` with the names that `names` has replaced."""
    if isinstance(expression, Name):
        return names.get(expression.name, expression)
    if isinstance(expression, Negation):
        return Negation(substituted(expression.operand, names))
    if isinstance(expression, Operation):
        left, right = (substituted(side, names) for side in (expression.left, expression.right))
        return Operation(expression.operator, left, right)
    if isinstance(expression, Call):
        arguments = tuple(substituted(each, names) for each in expression.arguments)
        return Call(expression.function, arguments)
    if isinstance(expression, TableCall):
        arguments = tuple(substituted(each, names) for each in expression.arguments)
        return TableCall(expression.table, arguments)
    return expression


def times(left: Expression, right: Expression) -> Expression:
    """``left*right``."""
    return Operation("*", left, right)


def plus(left: Expression, right: Expression) -> Expression:
    """``left + right``."""
    return Operation("+", left, right)


def cancel(expression: Expression, factor: Name) -> Expression | None:
    """Divide `expression` by `factor` exactly; None, and no error, where it is not a multiple of
    it.

    >>> from aerodb.tables.expression import parse
    >>> str(cancel(parse("qbar*(2*S) - CL(alpha)*S/4*qbar"), Name("S")))
    'qbar*2 - CL(alpha)/4*qbar'
    """
    if expression == factor:
        return Number(1.0)
    if isinstance(expression, Negation):
        inner = cancel(expression.operand, factor)
        return None if inner is None else Negation(inner)
    if not isinstance(expression, Operation) or expression.operator == "^":
        return None
    left = cancel(expression.left, factor)
    if expression.operator in "+-":
        right = cancel(expression.right, factor)
        return (
            None if left is None or right is None else Operation(expression.operator, left, right)
        )
    if left is not None:
        return _simple(expression.operator, left, expression.right)
    right = cancel(expression.right, factor) if expression.operator == "*" else None
    return None if right is None else _simple("*", expression.left, right)


def _simple(operator: str, left: Expression, right: Expression) -> Expression:
    """``left operator right`` without a factor of one."""
    one = Number(1.0)
    if operator == "*" and left == one:
        return right
    return left if right == one else Operation(operator, left, right)
