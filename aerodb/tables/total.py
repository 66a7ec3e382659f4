"""The six coefficients of a database as one program: terms, increments with their envelopes, rates
and the rotation from wind axes, all as expressions. Hinge moments, which move no aircraft, are left
out.

`AeroDatabase.predict` evaluates these parts one after the other, for many points at once; a
simulation needs them together, with what it may vary as inputs of the program.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Final

from aerodb.nomenclature import AXES, FORCE_AXES, is_hinge_axis
from aerodb.tables.algebra import plus, substituted, times
from aerodb.tables.database import AeroDatabase
from aerodb.tables.definitions import LIFT_INCREMENTS
from aerodb.tables.expression import Call, Expression, Name, Negation, Number, Operation, number
from aerodb.tables.increment import Increment, Interval
from aerodb.tables.instructions import Machine, machine
from aerodb.tables.loads import LOAD_AXES, summed
from aerodb.tables.program import AnyTable
from aerodb.tables.rate_state import Rate
from aerodb.tables.reference import HAT_RATES, STILL_AIR, WIND_AXES
from aerodb.tables.state_model import Relay, StateModel

#: Begin of the names of inputs that hold an increment's estimates: axis, number, regressor.
_ESTIMATE: Final = "estimate"


@dataclass(frozen=True, eq=False)
class TotalCoefficients:
    """A database as one machine.

    Parameters
    ----------
    machine : its outputs are CX CY CZ Cl Cm Cn about the database's moment reference, without the
        share of loads; then of each of `states` the steady value, or the rate [1/s] where it has
        one; then FX FY FZ [N] MX MY MZ [N m] of a database that has loads; then the given
        `further` expressions.
    inputs : channels and free inputs that it needs, without states, estimates and scales.
    states : those with memory, whose values are inputs under their names.
    estimates : names of the inputs for the database's parameters and then for the estimates of the
        increments that act, in the order of `values`; they stand in place of those of the database.
    values : the parameters and estimates of the database.
    """

    machine: Machine
    inputs: tuple[str, ...]
    states: tuple[StateModel, ...]
    estimates: tuple[str, ...]
    values: tuple[float, ...]


def total_coefficients(
    database: AeroDatabase,
    further: Iterable[Expression] = (),
    factors: Mapping[str, str] | None = None,
) -> TotalCoefficients:
    """Return the whole database as one machine: body-axis coefficients (6, k), dimensionless, of
    inputs in SI units.

    Parameters
    ----------
    further : other expressions over the same names, such as a thrust table's.
    factors : term of the database -> name of an input by which it is multiplied.
    """
    variables = {
        name: variable.expression
        for name, variable in database.variables.items()
        if variable.parameter is None
    }
    speed, weight = _hat_speed(database)
    for hat, (rate, _) in HAT_RATES.items():
        length = "b_ref" if rate in ("p", "r") else "c_ref"
        half = Operation("/", Name(length), Number(2.0))
        over = Operation("/", Operation("*", Name(rate), half), speed)
        variables[hat] = over if weight is None else times(over, weight)
    remembered = []
    rates = database.rates if not database.rates.keys().isdisjoint(database.needs) else {}
    for state in database.states:
        if state.name not in database.needs and state.name not in rates:
            continue
        if isinstance(state.law, (Relay, Rate)) or state.law.relaxation > 0.0:
            remembered.append(state)
        else:
            variables[state.name] = state.expression()
    estimates: dict[str, float] = dict(database.parameters)
    sums: dict[str, list[Expression]] = {axis: [] for axis in (*AXES, *WIND_AXES, *LOAD_AXES)}
    for term in (each for each in database.terms if not is_hinge_axis(each.axis)):
        factor = (factors or {}).get(term.name)
        sums[term.axis].append(
            term.expression if factor is None else times(Name(factor), term.expression)
        )
    loads = [summed(sums.pop(axis)) for axis in LOAD_AXES]
    lift: list[Expression] = []
    for k, increment in enumerate(database.increments):
        if not increment.acts_as_layer or is_hinge_axis(increment.axis):
            continue
        parts = _layer(k, increment, estimates)
        sums[increment.axis] += parts
        if increment.axis == "C_lift" and increment.induces_drag:
            lift += parts
    variables[LIFT_INCREMENTS] = summed(lift)
    totals = _on_body_axes({axis: summed(parts) for axis, parts in sums.items()})
    steady = [
        state.law.rate
        if isinstance(state.law, Rate)
        else Number(0.0)
        if isinstance(state.law, Relay)
        else state.expression()
        for state in remembered
    ]
    tables: dict[str, AnyTable] = {**database.tables, **database.scattered}
    apart = loads if database.has_loads else []
    program = database.compiled([*totals, *steady, *apart, *further], variables, tables)
    unused = database.parameters.keys() - set(program.inputs)
    estimates = {name: value for name, value in estimates.items() if name not in unused}
    own = {state.name for state in remembered} | set(estimates) | set((factors or {}).values())
    return TotalCoefficients(
        machine(program, tables),
        tuple(sorted(set(program.inputs) - own)),
        tuple(remembered),
        tuple(estimates),
        tuple(estimates.values()),
    )


def _hat_speed(database: AeroDatabase) -> tuple[Expression, Expression | None]:
    """Airspeed of the dimensionless rates [m/s], and their weight. With loads it is never zero, and
    the weight is zero at V = 0 and 1 in flight."""
    if database.reference.pressure is not None:
        return Number(database.reference.speed), None
    if not database.has_loads:
        return Name("V"), None
    still = Number(STILL_AIR)
    return (
        Call("max", (Name("V"), still)),
        Call("min", (Operation("/", Name("V"), still), Number(1.0))),
    )


def _layer(number_: int, increment: Increment, estimates: dict[str, float]) -> list[Expression]:
    """The regressors of an increment, held and faded by its envelope, times their estimates."""
    held: dict[str, Expression] = {
        name: Call("clip", (Name(name), *map(number, increment.held_between(name))))
        for name in increment.envelope
    }
    parts: list[Expression] = []
    for k, regressor in enumerate(increment.regressors):
        if increment.folded[k]:
            continue
        name = f"{_ESTIMATE}_{increment.axis}_{number_}_{k}"
        estimates[name] = float(increment.estimates[k])
        factors = [_weight(name, increment.envelope[name]) for name in sorted(increment.fading(k))]
        parts.append(reduce(times, [Name(name), substituted(regressor, held), *factors]))
    return parts


def _weight(name: str, interval: Interval) -> Expression:
    """`Interval.weight` as an expression."""
    x, low, high = Name(name), number(interval.low), number(interval.high)
    if interval.cell == 0.0:
        return Call("and", (Call("ge", (x, low)), Call("le", (x, high))))
    beyond = Call("max", (Operation("-", low, x), Operation("-", x, high)))
    cells = Operation("/", beyond, Number(interval.cell))
    return Call("clip", (Operation("-", Number(2.0), cells), Number(0.0), Number(1.0)))


def _on_body_axes(sums: Mapping[str, Expression]) -> list[Expression]:
    """The six body axes; wind axes are rotated as `wind_to_body` does."""
    nothing = Number(0.0)
    drag, side, lift = (sums[axis] for axis in WIND_AXES)
    if (drag, side, lift) == (nothing,) * 3:
        return [sums[axis] for axis in AXES]

    def of(function: str, angle: str) -> Expression:
        return Call(function, (Name(angle),))

    ca, sa, cb, sb = (of(f, x) for x in ("alpha", "beta") for f in ("cos", "sin"))
    along = plus(times(drag, cb), times(side, sb))
    rotated = {
        "CX": Operation("-", times(lift, sa), times(along, ca)),
        "CY": Operation("-", times(side, cb), times(drag, sb)),
        "CZ": Negation(plus(times(along, sa), times(lift, ca))),
    }
    return [plus(sums[axis], rotated[axis]) if axis in FORCE_AXES else sums[axis] for axis in AXES]
