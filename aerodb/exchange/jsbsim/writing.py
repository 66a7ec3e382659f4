"""Write expressions as JSBSim's XML functions.

A function that JSBSim lacks is rewritten in terms of those it has. Its tables look up only
properties, so any other argument becomes a function of its own. In JSBSim the sign of zero is 1 and
conditions accept only 0 and 1; what is written here behaves as `aerodb.tables.functions`.
"""

from collections.abc import Mapping
from typing import Final

from aerodb.errors import InputError
from aerodb.exchange.jsbsim.elements import (
    Axis,
    Element,
    function,
    node,
    prop,
    snapped_argument,
    table,
    value,
)
from aerodb.exchange.jsbsim.properties import (
    CHANNEL_PROPERTIES,
    FOOT,
    OWN_ARGUMENT,
    OWN_CHANNEL,
    OWN_VARIABLE,
    QBAR,
)
from aerodb.tables import (
    COMPARISONS,
    AeroDatabase,
    Call,
    Expression,
    Name,
    Negation,
    Number,
    Operation,
    Table,
    TableCall,
    parse,
)

_CONSTANTS: Final = {
    "S_ref": ("metrics/Sw-sqft", FOOT**2),
    "c_ref": ("metrics/cbarw-ft", FOOT),
    "b_ref": ("metrics/bw-ft", FOOT),
}
_HAT_RATES: Final = {
    "p_hat": parse("p*(b_ref/2)/V"),
    "q_hat": parse("q*(c_ref/2)/V"),
    "r_hat": parse("r*(b_ref/2)/V"),
    "alphadot_hat": parse("alphadot*(c_ref/2)/V"),
}
_OPERATIONS: Final = {"+": "sum", "-": "difference", "*": "product", "/": "quotient", "^": "pow"}
_SAME: Final = (
    "abs",
    "min",
    "max",
    "sqrt",
    "exp",
    "sin",
    "cos",
    "tan",
    "asin",
    "acos",
    "atan",
    "atan2",
    "floor",
    "ceil",
)
_CALLS: Final = {
    **{name: name for name in _SAME},
    **{name: name for name in COMPARISONS},
    "ne": "nq",
    "log": "ln",
    "log10": "log10",
    "rem": "fmod",
}
_MOST_EXTRAPOLATED: Final = 4  # each replaces one table by three
#: Lower limits of divisors: an aircraft at rest has finite coefficients and no force.
_LEAST: Final = {"velocities/vt-fps": 1e-6, QBAR: 1e-9}
#: Functions of x, y and z that JSBSim lacks, in terms of those it has.
_REWRITTEN: Final = {
    "sign": "(x > 0) - (x < 0)",
    "step": "x > 0",
    "sinh": "(exp(x) - exp(-x))/2",
    "cosh": "(exp(x) + exp(-x))/2",
    "tanh": "1 - 2/(exp(2*x) + 1)",
    "asinh": "((x > 0) - (x < 0))*log(abs(x) + sqrt(x*x + 1))",
    "acosh": "log(x + sqrt(x*x - 1))",
    "atanh": "log((1 + x)/(1 - x))/2",
    "root": "piecewise(abs(x)^(1/y), x >= 0, -abs(x)^(1/y), rem(abs(y), 2) == 1, sqrt(-1))",
    "clip": "min(max(x, y), z)",
}


class FunctionWriter:
    """Writer of the expressions of one database.

    paths : name -> property that holds it, for free inputs and further names in the expressions.

    `definitions` are the functions that the expressions use, in the order of evaluation: JSBSim
    takes the value of a later function from the previous time step. `inputs` are the channels and
    free inputs in use, each with property and scale.
    """

    def __init__(self, database: AeroDatabase, paths: Mapping[str, str]) -> None:
        self._database = database
        self._paths = dict(paths)
        self._defined: dict[Expression, str] = {}
        self._arguments = 0
        self._bound: dict[str, str] = {}  # x, y, z of a rewritten function -> property
        self.definitions: list[Element] = []
        self.inputs: dict[str, tuple[str, float]] = {}  # channel or free input -> property, scale

    def define(self, name: str, path: str, operation: Element, description: str) -> None:
        """Add a function of its own, known as `name` to expressions written later."""
        self._paths[name] = path
        self.definitions.append(function(path, operation, description))

    def write(self, expression: Expression) -> Element:
        """Return `expression` as an element inside a function; raises InputError for what JSBSim
        cannot hold."""
        if isinstance(expression, Number):
            return value(expression.value)
        if isinstance(expression, Name):
            return self._name(expression.name)
        if isinstance(expression, Negation):
            operand = expression.operand
            return (
                value(-operand.value)
                if isinstance(operand, Number)
                else node("product", value(-1.0), self.write(operand))
            )
        if isinstance(expression, Operation):
            return node(
                _OPERATIONS[expression.operator],
                *[self.write(each) for each in _operands(expression)],
            )
        if isinstance(expression, Call):
            return self._call(expression)
        if isinstance(expression, TableCall):
            return self._table(expression)
        raise self._unwritable(f"'{expression}'")

    def _unwritable(self, what: str) -> InputError:
        return InputError(
            f"{what} has no equivalent in JSBSim",
            f"database {self._database.name}",
            "export to another format",
        )

    def _name(self, name: str) -> Element:
        if name in self._bound:
            return prop(self._bound[name])
        if name in self._database.variables:
            return prop(self._variable(name))
        if name in _HAT_RATES and name not in self._paths:
            return self.write(_HAT_RATES[name])
        path, scale = self._source(name)
        read = node("max", prop(path), value(_LEAST[path])) if path in _LEAST else prop(path)
        return read if scale == 1.0 else node("product", read, value(scale))

    def _source(self, name: str) -> tuple[str, float]:
        """Property and scale of a constant, a channel or a free input."""
        if name in _CONSTANTS:
            return _CONSTANTS[name]
        if name in self._paths and name not in self._database.free_inputs:
            return self._paths[name], 1.0
        source = (self._paths[name], 1.0) if name in self._paths else channel_property(name)
        self.inputs[name] = source
        return source

    def _variable(self, name: str) -> str:
        path = f"{OWN_VARIABLE}{name}"
        if Name(name) not in self._defined:
            variable = self._database.variables[name]
            operation = self.write(variable.expression)
            self._defined[Name(name)] = path
            self.definitions.append(function(path, operation, variable.description))
        return path

    def _property(self, expression: Expression) -> str:
        """A property that holds `expression`, for a table to look up."""
        if isinstance(expression, Name):
            if expression.name in self._database.variables:
                return self._variable(expression.name)
            if expression.name not in _HAT_RATES and self._source(expression.name)[1] == 1.0:
                return self._source(expression.name)[0]
        if expression not in self._defined:
            self._defined[expression] = self._argument(self.write(expression), str(expression))
        return self._defined[expression]

    def _argument(self, operation: Element, description: str) -> str:
        self._arguments += 1
        path = f"{OWN_ARGUMENT}x{self._arguments}"
        self.definitions.append(function(path, operation, description))
        return path

    def _call(self, call: Call) -> Element:
        name, arguments = call.function, call.arguments
        if name in _CALLS:
            return node(_CALLS[name], *[self.write(each) for each in arguments])
        if name in ("and", "or", "not"):
            return node(name, *[self._condition(each) for each in arguments])
        if name == "piecewise":
            return self._piecewise(arguments)
        if name in _REWRITTEN:
            return self._rewritten(parse(_REWRITTEN[name]), arguments)
        raise self._unwritable(f"function '{name}'")

    def _rewritten(self, form: Expression, arguments: tuple[Expression, ...]) -> Element:
        """`form` with the arguments for x, y, z.

        Each argument is computed once, in a function of its own.
        """
        self._bound = {
            name: self._property(each) for name, each in zip("xyz", arguments, strict=False)
        }
        element = self.write(form)
        self._bound = {}
        return element

    def _condition(self, expression: Expression) -> Element:
        """Zero or one; anything but a comparison is compared with zero."""
        truth = isinstance(expression, Call) and expression.function in {
            *COMPARISONS,
            "and",
            "or",
            "not",
            "step",
        }
        return self.write(expression) if truth else node("nq", self.write(expression), value(0.0))

    def _piecewise(self, pieces: tuple[Expression, ...]) -> Element:
        """Nested choices.

        Without a last value, the default is NaN, the root of a negative number."""
        element = self.write(pieces[-1]) if len(pieces) % 2 else node("sqrt", value(-1.0))
        for chosen, condition in reversed(list(zip(pieces[:-1:2], pieces[1::2], strict=True))):
            element = node("ifthen", self._condition(condition), self.write(chosen), element)
        return element

    def _table(self, call: TableCall) -> Element:
        """A table without the axes of one breakpoint, along which it is constant."""
        stored = self._database.tables.get(call.table)
        if stored is None:
            raise self._unwritable(f"table '{call.table}' on scattered points")
        kept = [k for k, axis in enumerate(stored.breakpoints) if axis.size > 1]
        if sum(word != "neither" for word in stored.extrapolation) > _MOST_EXTRAPOLATED:
            raise self._unwritable(
                f"table '{call.table}' with more than {_MOST_EXTRAPOLATED} extrapolated axes"
            )
        axes = [self._axis(stored, k, call.arguments[k]) for k in kept]
        return table(axes, stored.values.reshape([axis.breakpoints.size for axis in axes]))

    def _axis(self, stored: Table, k: int, argument: Expression) -> Axis:
        way = stored.interpolation[k] if stored.interpolation else "linear"
        beyond = stored.extrapolation[k] if stored.extrapolation else "neither"
        axis = Axis(self._property(argument), stored.breakpoints[k], way, beyond)
        if way == "linear":
            return axis
        return Axis(
            self._argument(snapped_argument(axis), f"{argument}: {way} of the breakpoints"),
            axis.breakpoints,
        )


def channel_property(name: str) -> tuple[str, float]:
    """Return the property of a channel and the scale (a scalar) to the channel's unit.

    A channel without a JSBSim property has one below ``aerodb/``.
    """
    return CHANNEL_PROPERTIES.get(name, (f"{OWN_CHANNEL}{name}", 1.0))


def _operands(operation: Operation) -> list[Expression]:
    """Operands of a left-associative chain of one operator, as JSBSim folds them."""
    operands = [operation.right]
    left = operation.left
    while (
        operation.operator in "+-*"
        and isinstance(left, Operation)
        and left.operator == operation.operator
    ):
        operands.append(left.right)
        left = left.left
    return [left, *reversed(operands)]
