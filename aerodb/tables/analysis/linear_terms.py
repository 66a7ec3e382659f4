"""Tables that enter a coefficient linearly: a term as a sum of products with one table each."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from aerodb.tables.analysis.arguments import ScaledChannel, channel_of, scaled_channel, table_calls
from aerodb.tables.database import AeroDatabase
from aerodb.tables.definitions import CONSTANTS
from aerodb.tables.expression import Expression, Name, Negation, Number, Operation, TableCall
from aerodb.tables.loads import LOAD_AXES
from aerodb.tables.program import evaluate
from aerodb.tables.uncertainty import Uncertainty


@dataclass(frozen=True)
class LinearTable:
    """A table that enters one coefficient linearly, as ``constant * factors * table(channels)``,
    and is used nowhere else.

    Parameters
    ----------
    axis : of the coefficient.
    channels : one per argument; None where the argument is another formula.
    own : names of the channels of the source's table; the other channels are axes that were added
        when increments were folded in, along which these fade.
    """

    axis: str
    table: str
    channels: tuple[ScaledChannel | None, ...]
    own: frozenset[str]
    constant: float
    factors: tuple[Expression, ...]


def linear_tables(database: AeroDatabase) -> list[LinearTable]:
    """Return the tables into which increments can be folded (`consolidate`), with dimensionless
    constant factors: they enter one coefficient, once and linearly."""
    reached = table_uses([term.expression for term in database.terms], database)
    written = Counter(call.table for call in table_calls(database))
    once = {
        name
        for name in database.tables
        if reached[name] == written[name] == 1 and _foldable(database, name)
    }
    linear = []
    for term in database.terms:
        if term.axis in LOAD_AXES:  # its share of a coefficient is not linear: it is over qbar
            continue
        for constant, factors, call in _products(term.expression, database, once, 1.0, ()):
            channels = tuple(scaled_channel(argument, database) for argument in call.arguments)
            named = [channel.name for channel in channels if channel]
            if call.table in once and constant != 0.0 and len(set(named)) == len(named):
                extent = database.tables[call.table].extent or ((0.0, 0.0),) * len(channels)
                own = frozenset(
                    c.name
                    for c, bounds in zip(channels, extent, strict=True)
                    if c and bounds is not None
                )
                renamed = tuple(_renamed(factor, database) for factor in factors)
                linear.append(LinearTable(term.axis, call.table, channels, own, constant, renamed))
    return linear


def factors_of(expression: Expression) -> tuple[float, list[Expression]]:
    """Split `expression` into a number and the other factors.

    >>> from aerodb.tables.expression import parse
    >>> constant, factors = factors_of(parse("-2*alpha*abs(beta)/4"))
    >>> constant, [str(factor) for factor in factors]
    (-0.5, ['alpha', 'abs(beta)'])
    """
    if isinstance(expression, Number):
        return expression.value, []
    if isinstance(expression, Negation):
        constant, factors = factors_of(expression.operand)
        return -constant, factors
    if isinstance(expression, Operation) and expression.operator in "*/":
        left, right = factors_of(expression.left), factors_of(expression.right)
        if expression.operator == "*":
            return left[0] * right[0], left[1] + right[1]
        if not right[1] and right[0] != 0.0:
            return left[0] / right[0], left[1]
    return 1.0, [expression]


def _foldable(database: AeroDatabase, name: str) -> bool:
    """Return whether increments can be folded into a table.

    It must be linear between breakpoints and held outside them, and its declared uncertainty, if
    any, must be additive: an uncertainty in proportion to the value would change its meaning.
    """
    table = database.tables[name]
    return not table.interpolation and not table.extrapolation and _added(table.uncertainty)


def _added(uncertainty: Uncertainty | None) -> bool:
    return uncertainty is None or uncertainty.effect == "additive"


def table_uses(expressions: Iterable[Expression], database: AeroDatabase) -> Counter[str]:
    """Return the number of calls of each table in `expressions`, including calls through
    variables."""
    known: dict[str, Counter[str]] = {}

    def count(expression: Expression) -> Counter[str]:
        total: Counter[str] = Counter()
        nodes = [expression]
        while nodes:
            node = nodes.pop()
            nodes.extend(node.children)
            if isinstance(node, TableCall):
                total[node.table] += 1
            elif isinstance(node, Name) and node.name in database.variables:
                if node.name not in known:
                    known[node.name] = count(database.variables[node.name].expression)
                total.update(known[node.name])
        return total

    total: Counter[str] = Counter()
    for expression in expressions:
        total.update(count(expression))
    return total


def depends_on(expression: Expression, database: AeroDatabase) -> frozenset[str]:
    """Return the names of all tables and variables of the database that `expression` uses, directly
    or through variables."""
    dependencies: set[str] = set()
    pending = [expression]
    while pending:
        each = pending.pop()
        dependencies |= each.tables
        fresh = (each.names & database.variables.keys()) - dependencies
        dependencies |= fresh
        pending += [database.variables[name].expression for name in fresh]
    return frozenset(dependencies)


def _products(
    node: Expression,
    database: AeroDatabase,
    wanted: set[str],
    constant: float,
    factors: tuple[Expression, ...],
) -> Iterator[tuple[float, tuple[Expression, ...], TableCall]]:
    """Yield the calls of `wanted` tables on which `node` depends linearly, each with the number and
    the factors before it.

    Only variables that lead to such a table are followed. Each is visited once, because there is
    only one path to every call.
    """
    if isinstance(node, TableCall):
        yield constant, factors, node
    elif isinstance(node, Name) and node.name in database.variables:
        variable = database.variables[node.name]
        if _added(variable.uncertainty) and depends_on(node, database) & wanted:
            yield from _products(variable.expression, database, wanted, constant, factors)
    elif isinstance(node, Negation):
        yield from _products(node.operand, database, wanted, -constant, factors)
    elif isinstance(node, Operation) and node.operator in "+-":
        yield from _products(node.left, database, wanted, constant, factors)
        yield from _products(
            node.right, database, wanted, constant if node.operator == "+" else -constant, factors
        )
    elif isinstance(node, Operation) and node.operator in "*/":
        for part, other in ((node.left, node.right), (node.right, node.left)):
            if part is node.right and node.operator == "/":
                continue
            value = _fixed(other, database)
            if value is None:
                more = factors_of(
                    other if node.operator == "*" else Operation("/", Number(1.0), other)
                )
                yield from _products(
                    part, database, wanted, constant * more[0], (*factors, *more[1])
                )
            elif value != 0.0:
                yield from _products(
                    part,
                    database,
                    wanted,
                    constant * value if node.operator == "*" else constant / value,
                    factors,
                )


def _fixed(expression: Expression, database: AeroDatabase) -> float | None:
    """The value of an expression of numbers and reference lengths; None for any other expression.

    A variable is never treated as a number, even if it is constant: it may be an uncertainty
    factor, which scales the table but not an increment.
    """
    if expression.tables or not expression.names <= CONSTANTS.keys():
        return None
    values = {
        name: float(getattr(database.reference, attribute)) for name, attribute in CONSTANTS.items()
    }
    return float(evaluate(expression, values))


def _renamed(factor: Expression, database: AeroDatabase) -> Expression:
    """A factor, replaced by the name of its channel where it is a channel."""
    name = channel_of(factor, database)
    return Name(name) if name else factor
