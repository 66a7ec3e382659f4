"""The expression language of databases: text to a tree, and back to text.

It has numbers, names, ``+ - * /``, ``^`` (or ``**``, right associative, binding more tightly than
unary minus), parentheses, comparisons (``<`` and so on; true is 1), the functions of `FUNCTIONS`
such as ``piecewise(value, condition, ..., otherwise)``, and table calls ``TABLE(expression, ...)``:
every called name that is not a function is a table. There are no attributes, strings or
assignments, so that text from a file can do nothing but arithmetic. Evaluation is in `program`; the
meaning of names is in `database`.
"""

import math
import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final, NoReturn

from aerodb.errors import InputError, nearest
from aerodb.tables.functions import COMPARISONS, FUNCTIONS

MAX_LENGTH: Final = 20_000  # characters of one expression
MAX_NESTING: Final = 50  # nested parentheses, signs and powers; the parser is recursive
MAX_DEPTH: Final = 200  # levels of the tree; every term of a sum adds one

_PRECEDENCE: Final = {"+": 1, "-": 1, "*": 2, "/": 2, "^": 4}
_COMPARISON: Final = 0
_NEGATION: Final = 3
_ATOM: Final = 5
_COMPARED: Final = {symbol: name for name, symbol in COMPARISONS.items()}
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_]*")
_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?)"
    r"|(?P<name>[A-Za-z_][A-Za-z0-9_]*)"
    r"|(?P<symbol>\*\*|[<>=!]=|[-+*/^(),<>]))"
)


@dataclass(frozen=True)
class Expression:
    """A node of an expression tree. Equal trees are equal, and ``parse(str(e)) == e``."""

    @property
    def children(self) -> tuple["Expression", ...]:
        return ()

    def _walk(self) -> Iterator["Expression"]:
        pending: list[Expression] = [self]
        while pending:
            node = pending.pop()
            yield node
            pending.extend(node.children)

    @cached_property
    def names(self) -> frozenset[str]:
        """Names that must be given a value."""
        return frozenset(node.name for node in self._walk() if isinstance(node, Name))

    @cached_property
    def tables(self) -> frozenset[str]:
        """Names of the tables that are called."""
        return frozenset(node.table for node in self._walk() if isinstance(node, TableCall))

    @cached_property
    def depth(self) -> int:
        """Levels of the tree."""
        level, nodes = 0, [self]
        while nodes:
            level += 1
            nodes = [child for node in nodes for child in node.children]
        return level

    @property
    def precedence(self) -> int:
        return _ATOM

    def within(self, precedence: int) -> str:
        """The text, in parentheses where it binds less tightly than `precedence`."""
        return f"({self})" if self.precedence < precedence else str(self)


@dataclass(frozen=True)
class Number(Expression):
    """A number that is not negative: ``-2`` is the negation of 2. `number` makes either."""

    value: float

    def __post_init__(self) -> None:
        if not math.isfinite(self.value) or math.copysign(1.0, self.value) < 0:
            raise InputError(f"{self.value!r} is not a number that an expression can contain")
        object.__setattr__(self, "value", float(self.value))

    def __str__(self) -> str:
        return (
            repr(int(self.value))
            if self.value.is_integer() and self.value < 1e15
            else repr(self.value)
        )


@dataclass(frozen=True)
class Name(Expression):
    """A variable, a channel or a constant."""

    name: str

    def __post_init__(self) -> None:
        check_identifier(self.name)

    def __str__(self) -> str:
        return self.name


@dataclass(frozen=True)
class Negation(Expression):
    """Minus the operand."""

    operand: Expression

    @property
    def children(self) -> tuple[Expression, ...]:
        return (self.operand,)

    @property
    def precedence(self) -> int:
        return _NEGATION

    def __str__(self) -> str:
        return f"-{self.operand.within(_NEGATION)}"


@dataclass(frozen=True)
class Operation(Expression):
    """``left operator right`` with one of ``+ - * / ^``."""

    operator: str
    left: Expression
    right: Expression

    @property
    def children(self) -> tuple[Expression, ...]:
        return (self.left, self.right)

    @property
    def precedence(self) -> int:
        return _PRECEDENCE[self.operator]

    def __str__(self) -> str:
        own = self.precedence
        if (
            self.operator == "^"
        ):  # right associative: an atom as base, an exponent with or without sign
            return f"{self.left.within(_ATOM)}^{self.right.within(_NEGATION)}"
        text = f" {self.operator} " if own == 1 else self.operator
        return f"{self.left.within(own)}{text}{self.right.within(own + 1)}"


@dataclass(frozen=True)
class Call(Expression):
    """A function of `FUNCTIONS` applied to arguments."""

    function: str
    arguments: tuple[Expression, ...]

    @property
    def children(self) -> tuple[Expression, ...]:
        return self.arguments

    @property
    def precedence(self) -> int:
        return _COMPARISON if self.function in COMPARISONS else _ATOM

    def __str__(self) -> str:
        if self.function in COMPARISONS:
            return f" {COMPARISONS[self.function]} ".join(
                side.within(_COMPARISON + 1) for side in self.arguments
            )
        return f"{self.function}({', '.join(map(str, self.arguments))})"


@dataclass(frozen=True)
class TableCall(Expression):
    """A table looked up at arguments."""

    table: str
    arguments: tuple[Expression, ...]

    def __post_init__(self) -> None:
        check_identifier(self.table)

    @property
    def children(self) -> tuple[Expression, ...]:
        return self.arguments

    def __str__(self) -> str:
        return f"{self.table}({', '.join(map(str, self.arguments))})"


def check_identifier(name: str) -> None:
    """InputError unless `name` can be a variable or a table."""
    if _NAME.fullmatch(name) is None:
        raise InputError(
            f"'{name}' is not a valid name",
            remedy="use letters, digits and underscores, not starting with a digit",
        )
    if name in FUNCTIONS:
        raise InputError(f"'{name}' is the name of a function", remedy="choose another name")


def number(value: float) -> Expression:
    """`value` as an expression; negative values as a `Negation`."""
    return Negation(Number(-value)) if value < 0 else Number(abs(value))


def parse(text: str) -> Expression:
    """Parse the text of an expression.

    >>> str(parse("q*c_ref/(2*V) + -CZ_0(alpha)**2"))
    'q*c_ref/(2*V) + -CZ_0(alpha)^2'

    Raises InputError with the position for anything outside the language, and for text beyond
    MAX_LENGTH, MAX_NESTING or MAX_DEPTH.
    """
    if len(text) > MAX_LENGTH:
        raise InputError(
            f"expression of {len(text)} characters",
            remedy=f"at most {MAX_LENGTH}: split it into variables",
        )
    return _Parser(text).parse()


class _Parser:
    """Recursive descent over the tokens of one expression."""

    def __init__(self, text: str) -> None:
        self._text = text
        self._tokens = list(self._scan())
        self._at = 0
        self._nesting = 0

    def _scan(self) -> Iterator[tuple[str, str, int]]:
        position, end = 0, len(self._text.rstrip())
        while position < end:
            match = _TOKEN.match(self._text, position)
            if match is None or match.lastgroup is None:
                rest = self._text[position:].lstrip()
                self._fail(f"unexpected '{rest[:1]}'", len(self._text) - len(rest))
            yield match.lastgroup, match[match.lastgroup], match.start(match.lastgroup)
            position = match.end()
        yield "end", "", end

    def _fail(self, what: str, position: int) -> NoReturn:
        excerpt = self._text[max(0, position - 20) : position + 20]
        raise InputError(
            f"{what} at position {position + 1} of an expression", remedy=f"near: {excerpt!r}"
        )

    def _take(self, *symbols: str) -> str:
        kind, text, _ = self._tokens[self._at]
        if kind != "symbol" or text not in symbols:
            return ""
        self._at += 1
        return text

    def parse(self) -> Expression:
        tree = self._comparison()
        kind, text, position = self._tokens[self._at]
        if kind != "end":
            self._fail(f"unexpected '{text}'", position)
        if tree.depth > MAX_DEPTH:
            raise InputError(
                f"expression of {tree.depth} levels",
                remedy=f"at most {MAX_DEPTH}: split it into variables",
            )
        return tree

    def _comparison(self) -> Expression:
        tree = self._sum()
        if symbol := self._take(*_COMPARED):
            tree = Call(_COMPARED[symbol], (tree, self._sum()))
        return tree

    def _sum(self) -> Expression:
        tree = self._product()
        while operator := self._take("+", "-"):
            tree = Operation(operator, tree, self._product())
        return tree

    def _product(self) -> Expression:
        tree = self._signed()
        while operator := self._take("*", "/"):
            tree = Operation(operator, tree, self._signed())
        return tree

    def _signed(self) -> Expression:
        self._nesting += 1
        if self._nesting > MAX_NESTING:
            self._fail(f"more than {MAX_NESTING} levels of nesting", self._tokens[self._at][2])
        if self._take("-"):
            tree: Expression = Negation(self._signed())
        else:
            self._take("+")
            tree = self._atom()
            if self._take("^", "**"):
                tree = Operation("^", tree, self._signed())
        self._nesting -= 1
        return tree

    def _atom(self) -> Expression:
        kind, text, position = self._tokens[self._at]
        self._at += 1
        if kind == "number":
            value = float(text)
            return (
                Number(value)
                if math.isfinite(value)
                else self._fail(f"number '{text}' is too large", position)
            )
        if kind == "name":
            return self._call(text, position) if self._take("(") else self._name(text, position)
        if kind == "symbol" and text == "(":
            tree = self._comparison()
            self._close()
            return tree
        self._fail(f"unexpected '{text}'" if text else "unexpected end", position)

    def _name(self, name: str, position: int) -> Expression:
        if name in FUNCTIONS:
            self._fail(f"function '{name}' without arguments", position)
        return Name(name)

    def _call(self, name: str, position: int) -> Expression:
        arguments = [self._comparison()]
        while self._take(","):
            arguments.append(self._comparison())
        self._close()
        function = FUNCTIONS.get(name)
        if function is None:
            return TableCall(name, tuple(arguments))
        if len(arguments) < function.least or (
            function.most is not None and len(arguments) > function.most
        ):
            self._fail(
                f"'{name}' takes {function.least} argument(s), here {len(arguments)}", position
            )
        return Call(name, tuple(arguments))

    def _close(self) -> None:
        if not self._take(")"):
            _, text, position = self._tokens[self._at]
            self._fail(f"expected ')' instead of '{text or 'the end'}'", position)


def unknown_table(name: str, tables: Iterable[str]) -> InputError:
    """The InputError for a called name that is neither a function nor one of `tables`."""
    return InputError(f"no table or function '{name}'", remedy=nearest(name, [*FUNCTIONS, *tables]))
